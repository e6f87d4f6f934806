#pragma once

#include <array>
#include <cstdint>

#include "common/core/primitive.h"
#include "firmware_interface/devices/inertial_sensor.h"

namespace tumbler {

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

/// How a sensor is mounted, and what is believed of it.
struct SensorSettings {
  /// The x, y and z of the link's frame, each in the axes of the sensor.
  std::array<std::array<float, 3>, 3> mounting{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  /// For each of the robot's joints, by how much the angle of the sensor's link grows with it: 1,
  /// -1, or 0 where the joint is not between the root and that link.
  std::array<float, kMaxJoints> chain{};
  int age_ticks_max = 5;           ///< An older report is stale.
  std::uint32_t repeats_max = 20;  ///< More repeated reports in a row are frozen; 0: any number.
  float tilt_sine_max = 0.3F;      ///< Of the link's y axis, out of the horizontal.
  float rate_max_rad_s = 35;       ///< Of the turn about each axis; out of the plane, a quarter.
  /// Of the turn out of the plane within some 0.25 s: a sensor that sits the wrong way round looks
  /// right while the robot stands, and tells of turns about other axes as soon as it moves.
  float twist_max_rad = 0.1F;
  float jump_max_rad = 0.06F;  ///< By which the attitude may part from the sum of the rates.
  float late_max_s = 0.01F;    ///< By which a report may be later than the promptest.

  /// @retval false  a value is not finite or not positive, or the mounting is no rotation.
  /// Cold: called once, its loops need not be unrolled into a small board's flash.
  [[nodiscard, gnu::cold]] bool IsValid() const noexcept;
};

/// Judges the reports of an inertial sensor tick by tick, and makes the pitch of its link of them.
/// Pitch is about -y, as in the robot's model: from +x towards +z. No function of a mathematical
/// library is used.
class SensorWatch {
 public:
  /// Starts anew. @param settings  are valid.
  void Configure(const SensorSettings& settings, float period_s) noexcept;
  /// Forgets what was implausible.
  void Trust() noexcept;

  /// Notes what a frame has brought.
  /// @param age_ticks  0: it came since the tick before.
  void Count(InertialPart part, const InertialReading& reading, std::int32_t age_ticks) noexcept {
    if (part == InertialPart::kAttitude) attitude_age_ticks_ = age_ticks;
    if (part == InertialPart::kRate) rate_age_ticks_ = age_ticks;
    if (part == InertialPart::kTime) TakeTime(reading.time);
  }
  /// To be called after the frames of a tick.
  /// @param elapsed  ticks since the call before, >= 1.
  void EndTick(int elapsed, const InertialReading& reading) noexcept;

  [[nodiscard]] SensorStatus status() const noexcept { return status_; }
  /// Whether it tells of a turn out of the plane, of late, that is small as yet, but not to that in
  /// the plane. No motion should be corrected by its angle until that is over: a sensor that sits
  /// the wrong way round is known to be wrong only later.
  [[nodiscard]] bool is_doubtful() const noexcept { return is_doubtful_; }
  /// Of the sensor's link, within -pi ... pi.
  [[nodiscard]] float pitch_rad() const noexcept { return pitch_rad_; }
  [[nodiscard]] float rate_rad_s() const noexcept { return rate_rad_s_; }
  /// How far the sensor's link leans out of the robot's plane by the last report, where the status
  /// is kTilted: 0 ... pi/2 rad. 0 where the report is stale or no rotation, and where the sensor
  /// has come back into the plane since: then it was the sensor, and not the robot.
  [[nodiscard]] float tilt_rad() const noexcept { return IsOld() ? 0 : tilt_rad_; }
  /// Whether such a link turns no more. @pre tilt_rad() > 0
  [[nodiscard]] bool tilt_rests() const noexcept { return tilt_rests_; }
  /// Ticks since the last report; -1: there was none.
  [[nodiscard]] std::int32_t age_ticks() const noexcept { return age_ticks_; }
  [[nodiscard]] const SensorSettings& settings() const noexcept { return settings_; }

 private:
  // Three numbers in a vector register, with one that does not count; in g++'s and clang's
  // notation. NOLINTNEXTLINE(modernize-use-using): g++ takes the attribute in no other place.
  typedef float Lanes __attribute__((vector_size(4 * sizeof(float))));

  /// A vector of the sensor's frame in that of the link.
  [[nodiscard]] Lanes InLink(float x, float y, float z) const noexcept;
  /// @param report_age_ticks  of its older part.
  void TakeReport(const InertialReading& reading, std::int32_t report_age_ticks) noexcept;
  void JoinParts(int elapsed, const InertialReading& reading) noexcept;
  [[gnu::cold]] void TakeTilt(const InertialReading& reading, Lanes up, Lanes turn) noexcept;
  void TakeTime(std::uint32_t time) noexcept;
  /// Whether the last report is stale, or there is none: -1 is the largest then.
  [[nodiscard]] bool IsOld() const noexcept {
    return static_cast<std::uint32_t>(age_ticks_) >
           static_cast<std::uint32_t>(settings_.age_ticks_max);
  }

  SensorSettings settings_;
  std::array<Lanes, 3> mounting_{};  ///< Its columns: the sensor's axes in those of the link.
  float period_s_ = 0.001F;
  SensorStatus status_ = SensorStatus::kNoData;
  SensorStatus implausible_ = SensorStatus::kOk;  ///< Why it is not believed any more.
  bool is_late_ = false;
  bool is_doubtful_ = false;
  bool has_promptest_ = false;
  float pitch_rad_ = 0;
  float rate_rad_s_ = 0;
  Lanes twist_rad_{};  ///< What it has turned about each axis of the link, of late.
  float twist_kept_ = 0, twist_lead_s_ = 0, twist_square_max_ = 0;
  float parted_rad_ = 0;  ///< What the attitude has changed beyond the sum of the rates, of late.
  float tilt_rad_ = 0;
  bool tilt_rests_ = false;
  std::int32_t age_ticks_ = -1;
  std::int32_t attitude_age_ticks_ = -1;  ///< Of what has come in this tick; -1: it has not.
  std::int32_t rate_age_ticks_ = -1;
  InertialPart waiting_ =
      InertialPart::kNone;  ///< The half of a report that the other has to join.
  std::int32_t waiting_age_ticks_ = 0;
  /// The host's time, in 2^-16 steps of the sensor's clock; how many of them are a tick.
  std::int64_t host_time_ = 0;
  std::int64_t steps_per_tick_ = 0;
  std::int32_t creep_ticks_ = 0;
  std::int32_t promptest_ = 0;    ///< The least that the host's time was ahead of a report's.
  std::uint32_t first_time_ = 0;  ///< Of the first report.
};

/// The angle of the vector (x, y), as std::atan2(y, x), to 5e-7 rad.
[[nodiscard]] float AngleOf(float x, float y) noexcept;

}  // namespace tumbler
