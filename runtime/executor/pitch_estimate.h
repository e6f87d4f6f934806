#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/core/primitive.h"
#include "firmware_interface/can/frame.h"

namespace tumbler {

struct Joint;

/// What is thought of an inertial sensor. From kFrozen on it is implausible, and is not believed
/// again before the next arming.
enum class SensorStatus : std::uint8_t {
  kNone,          ///< There is no sensor.
  kOk,            ///< Its attitude and rate are known.
  kNoData,        ///< It has not reported yet.
  kStale,         ///< Its last report is too old.
  kLate,          ///< Its reports come later than they did, by its own clock.
  kFrozen,        ///< It repeats the same numbers.
  kNoRotation,    ///< Its quaternion has not the length of one.
  kTilted,        ///< It is tilted, or turns, out of the plane in which the robot moves.
  kTooFast,       ///< It turns faster than is possible.
  kInconsistent,  ///< Its attitude does not change as its rate says.
};
inline constexpr std::size_t kSensorStatusCount = 10;
[[nodiscard]] const char* ToString(SensorStatus status) noexcept;

/// How the pitch of one of the robot's links is known: here, by one inertial sensor on that link
/// (`SensorWatch`). Another estimator is a class that derives from this one, and that the assembly
/// of a run makes; the executor knows no more of it than this.
///
/// In each tick the executor asks of every frame whether it is the estimator's (`Owns`), gives it
/// those that are (`Take`), and ends the tick with its joints (`EndTick`); afterwards it reads what
/// is known. Reading costs no call: an estimator leaves its results in members of this class.
///
/// Real time: no heap, no locks, no exceptions. Freestanding.
class PitchEstimate {
 public:
  PitchEstimate() = default;
  PitchEstimate(const PitchEstimate&) = default;
  PitchEstimate& operator=(const PitchEstimate&) = default;
  virtual ~PitchEstimate() = default;

  /// Forgets all frames. Called while disarmed, once the settings have been found valid.
  virtual void Start(float period_s) noexcept = 0;
  [[nodiscard]] virtual bool IsValid() const noexcept = 0;
  /// Called at arming: forgets what was implausible.
  virtual void Trust() noexcept = 0;

  /// Whether a frame has one of the identifiers that the estimator listens to.
  [[nodiscard]] bool Owns(const CanFrame& frame) const noexcept {
    return frame.id == ids_[0] || frame.id == ids_[1] || frame.id == ids_[2];
  }
  /// Takes such a frame. @param age_ticks  0: it came since the tick before.
  /// @retval false  it is none of its frames for all that.
  virtual bool Take(const CanFrame& frame, std::int32_t age_ticks) noexcept = 0;
  /// After the frames of a tick.
  /// @param elapsed  ticks since the call before, >= 1.
  /// @param joints   as measured in this tick, in the robot's order.
  virtual void EndTick(int elapsed, std::span<const Joint> joints) noexcept = 0;

  /// Whether pitch and rate are known; and else, why not.
  [[nodiscard]] SensorStatus status() const noexcept { return status_; }
  /// Whether it tells of a turn out of the plane, of late, that is small as yet, but not to that in
  /// the plane. No motion should be corrected by its angle until that is over: a sensor that sits
  /// the wrong way round is known to be wrong only later.
  [[nodiscard]] bool is_doubtful() const noexcept { return is_doubtful_; }
  /// Of the link, within -pi ... pi. Pitch is about -y, as in the robot's model: from +x towards
  /// +z.
  [[nodiscard]] float pitch_rad() const noexcept { return pitch_rad_; }
  [[nodiscard]] float rate_rad_s() const noexcept { return rate_rad_s_; }
  /// How far the link leans out of the robot's plane by the last report, where the status is
  /// kTilted: 0 ... pi/2 rad. 0 where the report is stale or no rotation, and where the sensor has
  /// come back into the plane since: then it was the sensor, and not the robot.
  [[nodiscard]] float tilt_rad() const noexcept { return IsOld() ? 0 : tilt_rad_; }
  /// Whether such a link turns no more. @pre tilt_rad() > 0
  [[nodiscard]] bool tilt_rests() const noexcept { return tilt_rests_; }
  /// Ticks since the last report; -1: there was none.
  [[nodiscard]] std::int32_t age_ticks() const noexcept { return age_ticks_; }
  /// An older report is stale.
  [[nodiscard]] int age_ticks_max() const noexcept { return age_ticks_max_; }
  /// For each of the robot's joints, by how much the link's angle grows with it: 1, -1, or 0 where
  /// the joint is not between the root and that link.
  [[nodiscard]] std::span<const float> chain() const noexcept { return chain_; }

 protected:
  /// Whether the last report is stale, or there is none: -1 is the largest then.
  [[nodiscard]] bool IsOld() const noexcept {
    return static_cast<std::uint32_t>(age_ticks_) > static_cast<std::uint32_t>(age_ticks_max_);
  }

  std::array<std::uint32_t, 3> ids_{};  ///< Of 11 bits; for `Owns`.
  int age_ticks_max_ = 0;
  std::array<float, kMaxJoints> chain_{};
  SensorStatus status_ = SensorStatus::kNoData;
  bool is_doubtful_ = false;
  bool tilt_rests_ = false;
  std::int32_t age_ticks_ = -1;
  float pitch_rad_ = 0;
  float rate_rad_s_ = 0;
  float tilt_rad_ = 0;
};

}  // namespace tumbler
