#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/core/primitive.h"
#include "firmware_interface/devices/inertial_sensor.h"
#include "runtime/executor/pitch_estimate.h"

namespace tumbler {

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
class SensorWatch final : public PitchEstimate {
 public:
  SensorWatch() = default;
  /// @param sensor  must outlive the watch.
  SensorWatch(InertialSensor& sensor, const SensorSettings& settings) noexcept
      : sensor_(&sensor), settings_(settings) {}

  [[nodiscard]] bool IsValid() const noexcept override { return settings_.IsValid(); }
  void Start(float period_s) noexcept override;
  void Trust() noexcept override;
  bool Take(const CanFrame& frame, std::int32_t age_ticks) noexcept override;
  void EndTick(int elapsed, std::span<const Joint> /*joints*/) noexcept override {
    EndTick(elapsed, sensor_->reading());
  }

  /// Notes what a frame has brought.
  /// @param age_ticks  0: it came since the tick before.
  void Count(InertialPart part, const InertialReading& reading, std::int32_t age_ticks) noexcept {
    if (part == InertialPart::kAttitude) attitude_age_ticks_ = age_ticks;
    if (part == InertialPart::kRate) rate_age_ticks_ = age_ticks;
    if (part == InertialPart::kTime) TakeTime(reading.time);
  }
  void EndTick(int elapsed, const InertialReading& reading) noexcept;

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

  InertialSensor* sensor_ = nullptr;
  SensorSettings settings_;
  std::array<Lanes, 3> mounting_{};  ///< Its columns: the sensor's axes in those of the link.
  float period_s_ = 0.001F;
  SensorStatus implausible_ = SensorStatus::kOk;  ///< Why it is not believed any more.
  bool is_late_ = false;
  bool has_promptest_ = false;
  Lanes twist_rad_{};  ///< What it has turned about each axis of the link, of late.
  float twist_kept_ = 0, twist_lead_s_ = 0, twist_square_max_ = 0;
  float parted_rad_ = 0;  ///< What the attitude has changed beyond the sum of the rates, of late.
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
