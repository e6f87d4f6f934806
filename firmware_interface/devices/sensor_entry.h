#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "firmware_interface/devices/sensor_protocols.h"

namespace tumbler {

/// The inertial sensor of a drives file.
struct SensorEntry {
  std::string link;  ///< The link that carries it, as in the robot's URDF.
  SensorConfig config;
  double rate_hz = 1000;    ///< Of attitudes and rates.
  double time_rate_hz = 0;  ///< Of sample times; 0: the sensor sends none.
  /// Roll, pitch and yaw of the sensor's frame in the link's, as in a URDF.
  std::array<double, 3> mount_rpy_rad{};
  double age_max_s = 0.005;      ///< An older report is stale.
  double frozen_after_s = 0.02;  ///< The same numbers for longer are implausible; 0: never.
  double tilt_max_rad = 0.3;     ///< Out of the plane in which the robot moves.
  double rate_max_rad_s = 35;
  double jump_max_rad = 0.06;  ///< By which attitude and sum of rates may part.
  double late_max_s = 0.01;    ///< By which a report may be later than the promptest.

  [[nodiscard]] double RateOf(const SensorMessage& message) const noexcept {
    return message.is_time ? time_rate_hz : rate_hz;
  }
  /// The messages that it sends; sample times only where it sends them.
  [[nodiscard]] std::vector<SensorMessage> Messages() const;
  /// The sensor's host side.
  [[nodiscard]] std::unique_ptr<InertialSensor> MakeHost() const;
};

}  // namespace tumbler
