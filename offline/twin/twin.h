#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/primitive_toml.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/drives/simulated_drive.h"

namespace tumbler {

/// How the simulated robot is run.
struct TwinConfig {
  std::int64_t step_ns =
      50'000;  ///< Of physics and drive law; a drive's current loop runs at 20 to 40 kHz.
  double joint_damping_nm_s_per_rad = 0.02;  ///< Viscous friction of bearing and gear.
};

/// What is true of the simulated robot now, beyond what its drives report.
struct TwinState {
  std::int64_t time_ns = 0;
  double root_x_m = 0, root_z_m = 0, root_pitch_rad = 0;
  double root_vx_m_s = 0, root_vz_m_s = 0, root_pitch_rate_rad_s = 0;
  std::vector<double> joint_positions_rad;
  std::vector<double> joint_velocities_rad_s;
  std::vector<double> joint_torques_nm;  ///< as the drives gave them
  double peak_penetration_m = 0;         ///< since the start
  double normal_force_n = 0;             ///< sum over contacts
};

/// The robot's physics (contact and all) behind simulated drives on a simulated bus: robot, ground
/// are those of a primitive file (its task gives the rotors' inertia), and it starts in the
/// primitive's entry pose. The one place
/// that sees both the dynamics and the firmware interface.
class Twin {
 public:
  /// @param drives  one for each joint of the primitive, in its order; they must outlive the twin.
  /// @throws FileError when the primitive's robot or task text cannot be used.
  Twin(const PrimitiveFile& file, const TwinConfig& config, SimulatedBus& bus,
       std::vector<SimulatedDrive*> drives);
  ~Twin();
  Twin(const Twin&) = delete;
  Twin& operator=(const Twin&) = delete;

  /// Moves bus, drives and robot on to this time.
  void AdvanceTo(std::int64_t time_ns);
  [[nodiscard]] TwinState state() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
