#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

#include "firmware_interface/devices/simulated_drive.h"

namespace tumbler::testing {

/// A simulated drive that lets its joint follow a path, whatever torque that takes within the
/// limits of its motor. It knows nothing but the path.
class FollowingDrive final : public SimulatedDrive {
 public:
  using Path = std::function<std::pair<double, double>(double time_s)>;  ///< Position, velocity.

  FollowingDrive(const SimulatedMotorConfig& motor, Path path)
      : SimulatedDrive(motor, {}), path_(std::move(path)) {}
  [[nodiscard]] bool enabled() const noexcept override { return true; }
  [[nodiscard]] std::optional<double> target_rad() const noexcept override { return {}; }
  [[nodiscard]] bool limp() const noexcept override { return false; }
  void RaiseError(std::uint32_t /*code*/) noexcept override {}
  void OnFrame(const ReceivedFrame& /*received*/, SimulatedPort& /*port*/) noexcept override {}

 protected:
  [[nodiscard]] SimulatedPortConfig port_config() const noexcept override { return {}; }
  void Act(std::int64_t /*time_ns*/) noexcept override {}
  [[nodiscard]] double Law(std::int64_t time_ns, const Shaft& shaft) const noexcept override {
    const auto [q, v] = path_(1e-9 * static_cast<double>(time_ns));
    return 3e4 * (q - shaft.angle_rad) + 150 * (v - shaft.velocity_rad_s);
  }

 private:
  Path path_;
};

}  // namespace tumbler::testing
