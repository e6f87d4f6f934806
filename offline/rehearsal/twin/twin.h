#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/primitive_toml.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/drives/simulated_drive.h"
#include "offline/scene/scene.h"

namespace tumbler {

/// What resists in a joint.
struct JointLosses {
  double viscous_friction_nm_s_per_rad = 0.02;  ///< Bearing and gear, on top of the URDF's damping.
  double dry_friction_nm = 0;  ///< >= 0: Coulomb's, at full strength above 0.05 rad/s.
  std::optional<double> rotor_inertia_kg_m2;  ///< Seen through the gear; the task's by default.
};

/// A force that somebody exerts on the robot for a while.
struct Push {
  std::string link;
  double start_s = 0;
  double duration_s = 0;
  bool since_enabled = false;       ///< Counted from when all drives were first enabled.
  std::array<double, 2> force_n{};  ///< x, z in the world
  std::array<double, 2> point_m{};  ///< x, z in the link's frame
};

/// Part of an obstacle's surface with a friction of its own. Where several are, the last counts.
struct FrictionPatch {
  std::string obstacle;
  double mu = 0;  ///< Coefficient of friction, >= 0.
  double from_x_m = -std::numeric_limits<double>::infinity();
  double to_x_m = std::numeric_limits<double>::infinity();
};

/// How the simulated robot is run, and where it differs from the one of its scene.
struct TwinConfig {
  /// Of physics and drive law; a drive's current loop runs at 20 to 40 kHz.
  std::int64_t step_ns = 50'000;
  /// Somebody holds the robot, joints and all, until every drive is enabled: limp legs do not
  /// stand.
  bool held = true;
  std::vector<JointLosses> joints;  ///< In the robot's order; those missing are as above.

  /// The legs' stops at the URDF's position limits: a spring that never pulls, and a damper in it.
  double stop_stiffness_nm_per_rad = 500;  ///< A leg at 10 rad/s goes 0.04 rad into it; 0: none.
  double stop_damping_nm_s_per_rad = 2;

  std::optional<ContactLaw> contact;                        ///< The scene's by default.
  std::vector<std::pair<std::string, double>> mass_factor;  ///< Link, factor of mass and inertia.
  std::vector<Obstacle<Plane>> obstacles;                   ///< Besides those of the scene.
  std::vector<FrictionPatch> patches;
  std::vector<Push> pushes;
};

/// A link of the robot that touches something.
struct TwinContact {
  std::string link;
  std::string obstacle;
  double normal_force_n = 0;
};

/// What is true of the simulated robot now, beyond what its drives report.
struct TwinState {
  std::int64_t time_ns = 0;
  bool held = false;
  double root_x_m = 0, root_z_m = 0, root_pitch_rad = 0;
  double root_vx_m_s = 0, root_vz_m_s = 0, root_pitch_rate_rad_s = 0;
  std::vector<double> joint_positions_rad;
  std::vector<double> joint_velocities_rad_s;
  std::vector<double> joint_torques_nm;  ///< as the drives gave them
  double peak_penetration_m = 0;         ///< since the start
  double normal_force_n = 0;             ///< sum over contacts
  std::array<double, 2> push_n{};        ///< sum of all pushes that act: x, z
};

/// The robot's physics (contact and all) behind simulated drives on a simulated bus. Robot and
/// ground are those of a scene, but for what the configuration changes. The one place that sees
/// both the dynamics and the firmware interface.
class Twin {
 public:
  /// @param start   where it begins, at rest.
  /// @param drives  one for each joint of the robot, in its order; they must outlive the twin.
  /// @throws std::invalid_argument about a link or obstacle that is not there.
  Twin(const Scene& scene, const PrimitivePose& start, const TwinConfig& config, SimulatedBus& bus,
       std::vector<SimulatedDrive*> drives);
  ~Twin();
  Twin(const Twin&) = delete;
  Twin& operator=(const Twin&) = delete;

  /// Moves bus, drives and robot on to this time.
  void AdvanceTo(std::int64_t time_ns);
  [[nodiscard]] TwinState state() const;
  /// Of the last step.
  [[nodiscard]] std::vector<TwinContact> contacts() const;
  /// Somebody picks the robot up and puts it where it began, held until all drives are enabled
  /// if it was held then.
  void PutBack();

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
