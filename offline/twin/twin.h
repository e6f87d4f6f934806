#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/simulated_drive.h"
#include "offline/scene/joint_stop.h"
#include "offline/scene/quaternion.h"
#include "offline/scene/scene.h"
#include "offline/scene/space_scene.h"

namespace tumbler {

/// Friction and rotor inertia of a joint.
struct JointLosses {
  /// Friction of bearing and gear. It adds to the damping in the URDF. None: that of the task's
  /// motor, or the usual one.
  std::optional<double> viscous_friction_nm_s_per_rad;
  /// Coulomb friction, >= 0 (EvaluateDryFriction). None: that of the task's motor, or, where the
  /// task does not say what its motors lose, the friction in the URDF.
  std::optional<double> dry_friction_nm;
  /// The rotor's inertia seen through the gear. None: the inertia in the task.
  std::optional<double> rotor_inertia_kg_m2;
};

/// A force that somebody exerts on the robot for a while.
struct Push {
  std::string link;
  double start_s = 0;
  double duration_s = 0;
  bool since_enabled = false;       ///< Whether `start_s` counts from when all drives were enabled.
  std::array<double, 3> force_n{};  ///< x, y and z in the world. In the plane y is 0.
  std::array<double, 3> point_m{};  ///< x, y and z in the link's frame. In the plane y is 0.
};

/// Part of an obstacle's surface with a friction of its own. Where patches overlap, the last one
/// counts.
struct FrictionPatch {
  std::string obstacle;
  double mu = 0;  ///< Coefficient of friction, >= 0.
  double from_x_m = -std::numeric_limits<double>::infinity();
  double to_x_m = std::numeric_limits<double>::infinity();
};

/// Bound of the error of a velocity v in a step, estimated by Simpson's rule: divided by 1 + |v|
/// [m/s, rad/s].
inline constexpr double kTwinStepError = 1e-3;
/// The longest step: a foot at 3 m/s crosses the layer in which contact begins in 1.3 ms.
inline constexpr std::int64_t kTwinLongestStep_ns = 800'000;

class TwinBody;

/// Makes the physics of a robot in the plane, by another engine than ours.
/// @param scene   with all that the configuration of the twin changes: every joint is driven by a
///                torque, and `motors` has the friction of each.
/// @param start   the pose in which the robot begins, at rest.
/// @param drives  one for each joint of the robot, in its order; as the bus they outlive the body.
using TwinEngine = std::function<std::unique_ptr<TwinBody>(
    const Scene& scene, const PrimitivePose& start, SimulatedBus& bus,
    std::vector<SimulatedDrive*> drives)>;

/// Settings of a simulated robot: how it is simulated, and where it differs from its scene.
struct TwinConfig {
  /// How long the steps of the physics are.
  enum class Steps : std::uint8_t {
    /// As long as what the drives do and an error bound of `kTwinStepError` allow, up to
    /// `kTwinLongestStep_ns`, but no shorter than `step_ns` because of the bound. They end where a
    /// frame reaches a drive. The drives' law is part of the equations of motion.
    kErrorBound,
    /// `step_ns`. So often the drives' law is computed, too.
    kFixed,
  };
  /// Fixed ones are the reference: with an error bound a current loop's lag comes out shorter by
  /// half a step, and on hard ground and on a bar motions end otherwise now and then
  /// (docs/simulation.md).
  Steps steps = Steps::kFixed;
  /// The current loop of a drive runs at 20 to 40 kHz.
  std::int64_t step_ns = 50'000;
  /// Whether the robot and its joints are held until every drive is enabled: limp legs do not
  /// stand.
  bool held = true;
  /// Height by which a stand lifts the root link off its start, and holds it there for good, so
  /// that the joints move freely [m]. The state is held then, whatever the drives do. 0: no stand.
  double stand_m = 0;
  /// In the order of the robot's joints. Joints without an entry have the defaults.
  std::vector<JointLosses> joints;

  /// Of the stops that joints meet at the URDF's position limits (JointStop). 0: no stop.
  double stop_stiffness_nm_per_rad = kStopStiffness_nm_per_rad;
  double stop_damping_nm_s_per_rad = kStopDamping_nm_s_per_rad;

  /// None: the contact law of the scene.
  std::optional<ContactLaw> contact;
  /// Links, each with the factor of its mass and inertia.
  std::vector<std::pair<std::string, double>> mass_factor;
  /// These add to the obstacles of the scene: of one in the plane, or of one in space.
  std::vector<Obstacle<Plane>> obstacles;
  std::vector<Obstacle<Spatial>> obstacles_in_space;
  std::vector<FrictionPatch> patches;
  std::vector<Push> pushes;

  /// Null: our own physics. Another engine has steps, stops and contacts of its own, holds the
  /// robot until every drive is enabled, and knows no stand, patches or pushes.
  TwinEngine engine;
};

/// A link of the robot that touches something.
struct TwinContact {
  std::string link;
  std::string obstacle;  ///< Or the robot's own shape.
  double normal_force_n = 0;
};

/// The true state of a simulated robot, of which its drives report only a part.
struct TwinState {
  std::int64_t time_ns = 0;
  bool held = false;
  std::int64_t enabled_ns = -1;  ///< When all drives were first enabled; -1: not yet.
  double root_x_m = 0, root_z_m = 0, root_pitch_rad = 0;
  double root_vx_m_s = 0, root_vz_m_s = 0, root_pitch_rate_rad_s = 0;
  /// Of a robot in space, whose pitch and its rate are 0: the rest of where its root's frame is,
  /// how that is turned in the world (w, x, y, z), and its velocities in world axes.
  double root_y_m = 0, root_vy_m_s = 0;
  Quaternion root_quaternion{};
  std::array<double, 3> root_angular_velocity_rad_s{};
  [[nodiscard]] bool is_in_space() const { return root_quaternion != Quaternion{}; }
  std::vector<double> joint_positions_rad;
  std::vector<double> joint_velocities_rad_s;
  std::vector<double> passive_positions_rad;     ///< Of the joints without a motor [rad, m].
  std::vector<double> passive_velocities_rad_s;  ///< Likewise.
  std::vector<double> joint_torques_nm;          ///< The torques that the drives exert.
  double peak_penetration_m = 0;                 ///< Since the start.
  /// The hardest impact since the start or the last `ForgetImpacts`: the largest speed with which a
  /// point in contact moves into what it touches, and its link; empty: nothing was touched.
  double impact_m_s = 0;
  std::string impact_link;
  double normal_force_n = 0;       ///< Sum over all contacts.
  std::array<double, 3> push_n{};  ///< Sum of all pushes that act: x, y, z.
  /// By how much the robot's own shapes overlap, which the twin does not prevent; 0 where they do
  /// not. Only those count that are to stay apart.
  double self_overlap_m = 0;
  std::string overlapping;  ///< The two shapes that overlap most: "leg1_link/0 and leg2_link/1".
};

/// The equations of motion behind a robot's simulated drives, and what solves them.
class TwinBody {
 public:
  TwinBody() = default;
  virtual ~TwinBody() = default;
  TwinBody(const TwinBody&) = delete;
  TwinBody& operator=(const TwinBody&) = delete;
  /// What they do: as the functions of Twin.
  virtual void AdvanceTo(std::int64_t time_ns) = 0;
  [[nodiscard]] virtual const TwinState& state() const = 0;
  [[nodiscard]] virtual std::vector<TwinContact> contacts() const = 0;
  virtual void Displace(std::span<const double> q, std::span<const double> v) = 0;
  virtual void ForgetImpacts() = 0;
  virtual void PutBack() = 0;
};

/// The physics of a robot, contact included, behind simulated drives on a simulated bus. Robot and
/// ground are those of a scene in the plane or in space, apart from what the configuration changes.
/// The twin is the only place that sees both the dynamics and the firmware interface.
///
/// In space the root's frame is turned after each step (RootChart), so that steps within an error
/// bound need a slope more each.
class Twin {
 public:
  /// @param start   the pose in which the robot begins, at rest.
  /// @param drives  one for each joint of the robot, in its order. They must outlive the twin.
  /// @throws std::invalid_argument  when the configuration names a link or an obstacle that is not
  ///                                there, a drive is missing, or the step is not positive.
  Twin(const Scene& scene, const PrimitivePose& start, const TwinConfig& config, SimulatedBus& bus,
       std::vector<SimulatedDrive*> drives);
  /// The same in space. @pre the start is in space.
  Twin(const SpaceScene& scene, const PrimitivePose& start, const TwinConfig& config,
       SimulatedBus& bus, std::vector<SimulatedDrive*> drives);
  ~Twin();
  Twin(const Twin&) = delete;
  Twin& operator=(const Twin&) = delete;

  /// Advances bus, drives and robot to this time.
  void AdvanceTo(std::int64_t time_ns);
  /// Valid until the twin changes.
  [[nodiscard]] const TwinState& state() const;
  /// The contacts in the last step.
  [[nodiscard]] std::vector<TwinContact> contacts() const;
  /// Moves the robot at once, as a knock does. What a stand or a bar holds stays where it is.
  /// @param q, v  what is added to positions and velocities of all degrees of freedom: x and z of
  ///              the root, its pitch (of a fixed root none), and the joints [m, rad, m/s, rad/s].
  ///              In space x, y, z, and small angles of pitch, roll and yaw in the root's frame.
  /// @throws std::invalid_argument  when there are not as many.
  void Displace(std::span<const double> q, std::span<const double> v);
  /// Begins anew with the hardest impact.
  void ForgetImpacts();
  /// Puts the robot back into the pose in which it began. If it was held then, it is held again
  /// until all drives are enabled.
  void PutBack();

 private:
  std::unique_ptr<TwinBody> body_;
};

}  // namespace tumbler
