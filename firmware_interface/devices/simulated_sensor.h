#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/sensor_entry.h"

namespace tumbler {

/// The ways in which a simulated sensor fails.
enum class SensorFault : std::uint8_t {
  kSilent,       ///< It sends nothing.
  kFrozen,       ///< It repeats its last report; its clock goes on.
  kOffset,       ///< Its attitude is turned by an angle in the plane.
  kSwappedAxis,  ///< Its y and z are exchanged, as after a wrong setting.
  kLate,         ///< Its reports come later by a time.
};

/// A failure for a while.
struct SensorFailure {
  SensorFault fault = SensorFault::kSilent;
  double start_s = 0;
  bool since_enabled = false;  ///< Whether `start_s` counts from when all drives were enabled.
  double duration_s = 1e9;
  double offset_rad = 0.3;  ///< Of kOffset.
  double late_s = 0.1;      ///< Of kLate.
};

/// Errors of a simulated sensor. Standard deviations are of normal numbers, cut off at six.
struct SimulatedSensorConfig {
  double noise_rad = 5e-4;         ///< Of each report's pitch.
  double rate_noise_rad_s = 5e-3;  ///< Of each report's rate about each axis.
  double bias_rad = 0;             ///< Of the pitch.
  double rate_bias_rad_s = 0;      ///< Of the rate in the plane.
  double delay_s = 0;              ///< From measuring to sending.
  double mount_error_rad = 0;      ///< Roll of the sensor on its link, beside the drives file's.
  std::uint64_t seed = 1;
  std::vector<SensorFailure> failures;
};

/// The sensor's side of the bus: sends what it measures of the pitch of its link.
class SimulatedSensor final : public SimulatedNode {
 public:
  SimulatedSensor(const SensorEntry& entry, const SimulatedSensorConfig& config);
  /// Puts the sensor on the bus. May be called once. Both must outlive the last AdvanceTo.
  void AttachTo(SimulatedBus& bus);

  /// Time of the next measurement [ns].
  [[nodiscard]] std::int64_t next_ns() const noexcept { return next_ns_; }
  /// Measures, and sends what is due. @param enabled_ns  when all drives were enabled; -1: not yet.
  void Measure(double pitch_rad, double rate_rad_s, std::int64_t enabled_ns) noexcept;

  void OnFrame(const ReceivedFrame& /*received*/, SimulatedPort& /*port*/) noexcept override {}
  [[nodiscard]] bool Heeds(const CanFrame& /*frame*/) const noexcept override { return false; }

 private:
  struct Report : SensorReport {
    std::int64_t due_ns = 0;
  };
  [[nodiscard]] double Normal() noexcept;
  [[nodiscard]] Report Measured(double pitch_rad, double rate_rad_s, const SensorFailure* offset,
                                bool swapped) noexcept;
  void Send(const Report& report) noexcept;

  SensorEntry entry_;
  SimulatedSensorConfig config_;
  std::array<double, 4> mounting_{1, 0, 0, 0};
  std::mt19937_64 random_;
  SimulatedPort* port_ = nullptr;
  std::int64_t next_ns_ = 0;
  std::int64_t count_ = 0;
  std::int64_t sent_ = 0;
  std::vector<Report> waiting_;  ///< In the order of their times.
  Report last_;
};

}  // namespace tumbler
