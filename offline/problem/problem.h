#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/core/primitive.h"
#include "common/files/primitive_toml.h"
#include "offline/problem/cost_term.h"
#include "offline/problem/robust_settings.h"
#include "offline/scene/scene.h"
#include "offline/scene/space_scene.h"

namespace tumbler {

/// The part of a limit of velocity or acceleration that the solver is kept within, so that its
/// result keeps the true one despite rounding.
inline constexpr double kInside = 1 - 1e-6;

/// Limits, end conditions and size of the path of one actuated joint.
struct ActuatedJoint {
  int dof = 0;
  JointLimits<double> limits;
  double start_rad = 0;
  double end_rad = 0;
  /// At least 6: the start fixes the first three, the end the last three.
  int control_points = 12;
  /// Velocities at the ends, where accelerations are zero.
  double start_rad_s = 0, end_rad_s = 0;
  /// The same as in the scene. The limit of the torque is for what it gives.
  Motor motor = {};

  [[nodiscard]] int free_points() const { return control_points - 6; }
};

/// A joint whose path is that of another one, or its opposite.
struct TiedJoint {
  std::size_t joint = 0, to = 0;  ///< Of the problem's joints.
  double factor = 1;              ///< 1, or -1: it moves the other way round.
};

/// Settings of the global search. It draws random splines in batches, ranks them by their cost, and
/// stops when enough of them stand out from the rest or enough have been tried.
struct SearchSettings {
  std::uint64_t seed = 1;
  /// Number of random splines in a batch.
  int batch = 150;
  /// The search stops when this many splines stand out from the rest in rank, and each of them ends
  /// within `basin_rad` of its target pitch.
  int promising = 3;
  /// The search stops after this many splines in any case.
  int max_samples = 3000;
  /// Number of the best splines that go to the local solver. When they do not lead to enough
  /// solutions, the search goes on until `promising` more splines stand out, hands on as many of
  /// the best again, and so on.
  int refine = 4;
  /// A random spline departs from the straight line between start and end by this many half-sine
  /// modes.
  int modes = 3;
  /// Largest amplitude of the first mode. Mode m has it divided by m.
  double spread_rad = 3.2;
  /// Weight of (|tau| / limit - 1)^2 in the rank.
  double torque_penalty = 1;
  /// Weight in the rank of penetration beyond the compliant layer, in thicknesses of the layer.
  double core_penalty = 0.1;
  /// Weight in the rank of what lacks to the clearance of the robot's own shapes, in units of
  /// kClearanceScale_m.
  double clearance_penalty = 0.1;
  /// A motion that ends further than this from its target pitch comes to rest in another pose, and
  /// the local solver would not bring it back.
  double basin_rad = 0.5;
  /// Step of the semi-implicit Euler method. Ranking needs little accuracy.
  double step_s = 2e-3;
};

/// Settings of the local solvers. Every start that the search hands over is screened by a few
/// evaluations of SLSQP with a long step; the best of them are then solved with the final steps
/// (SolveNear).
struct SolverSettings {
  /// The method that computes gradients. Both give the same to rounding.
  enum class Gradient {
    /// Backwards through the steps. The price hardly depends on the number of parameters.
    kAdjoint,
    /// The paper's gradient equations, integrated with the states [AB04, section V].
    kForward,
  };
  Gradient gradient = Gradient::kAdjoint;
  /// Equal integration step of what is simulated beside the solver. Certificate and second look
  /// divide it by 16.
  double step_s = 1e-3;
  /// Largest error in a step of the adaptive steps with which finalists are solved, of each state
  /// and each of its derivatives z, divided by 1 + |z|.
  double tolerance = 1e-6;
  /// Integration step while starts are screened.
  double screen_step_s = 2e-3;
  /// Evaluations of cost and gradient with which each start is screened.
  int screen_evaluations = 24;
  /// Number of solutions with the final step that are wanted.
  int finalists = 1;
  /// Most evaluations of cost and gradient for each finalist, screening included.
  int max_evaluations = 300;
  /// A finalist has converged when its KktResidual::relative is no larger. The smaller it is, the
  /// smaller `tolerance` has to be.
  double kkt_residual = 1e-4;
  /// Whether a motion is solved until it has converged, or makes no progress any more, however long
  /// that takes. Otherwise, where
  /// lanes cover the problem, it goes on to the minimum for as long as the search took, and then
  /// only as long as a step promises a thousandth of the cost.
  bool prove = false;
  /// Screening ends when the cost changes by less than this part of itself.
  double relative_tolerance = 1e-7;
  /// The part of the torque limit that is kept free for torques between samples. With a tenth of a
  /// step of 1 ms, a hard landing shows up to 0.8 % of the limit more.
  double torque_margin = 0.02;
  /// The part of the compliant layer that a motion leaves unused, so that a slightly different
  /// start does not reach the core.
  double core_margin = 0.1;
  /// Sharpness of the smooth maxima (Kreisselmeier-Steinhauser) that stand for the limits of
  /// torque, penetration and clearance.
  double sharpness = 200;
};

/// The durations among which the solver may choose [s].
struct DurationBounds {
  double min_s = 0, max_s = 0;
};

/// Which feed-forward a primitive holds after its motion.
enum class HeldTorque {
  kEnd,   ///< What its spline through the plan's torques has at the end.
  kRest,  ///< The plan's torque at the end of the settle phase.
};

/// What takes the place of a problem's `scene` where the robot moves in space.
struct SceneInSpace {
  SpaceScene scene;
  /// Of the root's frame at the start; its angles in `start_q` are 0.
  SpaceMatrix start_orientation = SpaceMatrix::Identity();
  /// What the motion has to bear; none: it is found for the model alone.
  std::optional<SpaceRobustSettings> robust;
};

/// An optimal control problem of [AB04, Eqs. 1-6] in numbers.
struct Problem {
  std::string name;
  /// Its robot's actuated joints are prescribed, and its passive ones are free.
  Scene scene;
  /// In the order of the robot's degrees of freedom.
  std::vector<ActuatedJoint> joints;
  /// Those whose paths follow others. A robot in space alone has such.
  std::vector<TiedJoint> tied;
  /// The longest integration step that contact and the springs of passive joints allow
  /// (`AdvisableStep`, `SpringStep`). Infinite without either.
  double advisable_step_s = std::numeric_limits<double>::infinity();

  /// None: the robot moves in the plane. Where it is there, `scene` is empty.
  std::optional<SceneInSpace> space;

  /// Positions of all degrees of freedom at the start [m, rad].
  std::vector<double> start_q;
  /// Velocities of the root's coordinates at the start [m/s, rad/s]; zero at rest.
  std::array<double, 3> start_root_rates{};
  /// Where the solver looks for such a velocity, too: what it may be. `start_root_rates` are among
  /// it.
  std::array<std::optional<Interval<double>>, 3> free_start_rates{};
  /// Length of the motion; where that is free, of the motions that a search begins with.
  double duration_s = 1;
  /// Where the solver looks for the duration, too: what it may be. `duration_s` is among it.
  std::optional<DurationBounds> free_duration;
  /// Length of the settle phase after it, in which the joints are held.
  double settle_s = 0;
  HeldTorque held_torque = HeldTorque::kEnd;
  /// Degree of the splines.
  int degree = 5;
  std::vector<CostTerm> cost;
  /// The settled pitch is compared with this; none where the cost asks for no pitch.
  std::optional<double> target_pitch_rad;

  /// The runtime starts the motion only when every joint is this near to its first position.
  double entry_tolerance_rad = 0.1;
  /// The runtime calls it a fault when a joint is further than this from its setpoint.
  double following_tolerance_rad = 0.35;

  SearchSettings search;
  SolverSettings solver;
  /// The gains of the drives through which a motion for the model alone is to be played; none:
  /// those of the default drives.
  std::optional<DriveGains> drives;
  /// What the motion has to survive; none: it is found for the model alone.
  std::optional<RobustSettings> robust;
  /// For each of the joints, the one that moves as it does in the mirror image that a guess is
  /// taken for. Empty: the guess is taken as it is.
  std::vector<std::size_t> guess_mirror;

  /// The instants at which the cost looks at the motion that takes `duration_s`.
  [[nodiscard]] std::vector<CostInstant> instants() const { return instants(duration_s); }
  /// The same of a motion of another duration.
  [[nodiscard]] std::vector<CostInstant> instants(double other_duration_s) const {
    return InstantsOf(cost, other_duration_s, settle_s);
  }

  // What both kinds of scenes have.
  [[nodiscard]] const ContactLaw& contact() const {
    return space ? space->scene.contact : scene.contact;
  }
  [[nodiscard]] const SelfContact& self_contact() const {
    return space ? space->scene.self_contact : scene.self_contact;
  }
  [[nodiscard]] std::size_t dof_count() const {
    return space ? space->scene.robot.tree.dofs.size() : scene.robot.tree.dofs.size();
  }
  /// The name of a joint in the robot's file.
  [[nodiscard]] const std::string& name_of(const ActuatedJoint& joint) const {
    const auto dof = static_cast<std::size_t>(joint.dof);
    return space ? space->scene.robot.tree.dofs[dof].name : scene.robot.tree.dofs[dof].name;
  }
  [[nodiscard]] const std::string& joint_name(std::size_t j) const { return name_of(joints[j]); }
  /// Calls `work` with the scene, a `Scene` or a `SpaceScene`.
  template <class Work>
  auto WithScene(Work&& work) {
    return space ? work(space->scene) : work(scene);
  }
  template <class Work>
  auto WithScene(Work&& work) const {
    return space ? work(space->scene) : work(scene);
  }
  /// Whether there is nothing that the robot could touch.
  [[nodiscard]] bool in_empty_space() const {
    return space ? space->scene.obstacles.empty() : scene.obstacles.empty();
  }

  /// The gains of every joint's drive through which the motion is to be played.
  [[nodiscard]] DriveGains drive_gains() const {
    const LaneDrive drive = robust ? robust->drive : LaneDrive{};
    return drives.value_or(DriveGains{drive.kp, drive.kd});
  }

  /// Whether a joint moves when the motion ends: then nothing holds it there, and there is no
  /// settle phase.
  [[nodiscard]] bool joint_ends_moving() const {
    return std::ranges::any_of(joints,
                               [](const ActuatedJoint& joint) { return joint.end_rad_s != 0; });
  }
  /// Whether the robot is to move when the motion ends, so that its state there is what comes of
  /// the motion, and not where it comes to rest: a joint moves, the cost asks for a velocity of the
  /// root there, or there is nothing but air.
  [[nodiscard]] bool ends_moving() const {
    const auto asks_for_velocity = [this](const CostTerm& term) {
      if (!term.draws() || !term.of_velocity || term.point.present()) return false;
      const bool free = free_start_rates[static_cast<std::size_t>(term.dof)].has_value();
      return term.when == CostTerm::When::kEnd && (term.target != 0 || (term.from_start && free));
    };
    const bool flies =
        space ? space->scene.obstacles.empty()
              : scene.robot.root_dofs > 0 && !scene.robot.hinged() && scene.obstacles.empty();
    return joint_ends_moving() ||
           (settle_s == 0 && (flies || std::ranges::any_of(cost, asks_for_velocity)));
  }

  /// Parameters are the free control points of the first joint, then those of the second, ... Then
  /// come the root's velocities at the start that are free, x before z before pitch. The last one
  /// is the duration, in units of `duration_s`, if that is free.
  [[nodiscard]] int parameter_count() const {
    return first_start_rate() + static_cast<int>(free_start_coordinates().size()) +
           (free_duration ? 1 : 0);
  }
  /// Index of the parameter that is the first free velocity of the root at the start, if any is.
  [[nodiscard]] int first_start_rate() const { return first_parameter(joints.size()); }
  /// The root's coordinates (0 x, 1 z, 2 pitch) whose velocity at the start is free.
  [[nodiscard]] std::vector<std::size_t> free_start_coordinates() const {
    std::vector<std::size_t> coordinates;
    for (std::size_t i = 0; i < free_start_rates.size(); ++i) {
      if (free_start_rates[i]) coordinates.push_back(i);
    }
    return coordinates;
  }
  /// The coordinate whose velocity at the start a parameter is; none for other parameters.
  [[nodiscard]] std::optional<std::size_t> start_coordinate_of(int parameter) const {
    if (parameter < first_start_rate() || is_duration(parameter)) return std::nullopt;
    return free_start_coordinates()[static_cast<std::size_t>(parameter - first_start_rate())];
  }
  /// The duration of the motion with these parameters.
  [[nodiscard]] double duration_of(std::span<const double> x) const {
    return free_duration ? duration_s * x.back() : duration_s;
  }
  /// Whether a parameter is the duration.
  [[nodiscard]] bool is_duration(int parameter) const {
    return free_duration && parameter + 1 == parameter_count();
  }
  /// The smallest and the largest value of a parameter.
  [[nodiscard]] Interval<double> bounds_of_parameter(int parameter) const {
    if (is_duration(parameter))
      return {free_duration->min_s / duration_s, free_duration->max_s / duration_s};
    if (const auto coordinate = start_coordinate_of(parameter))
      return *free_start_rates[*coordinate];
    const JointLimits<double>& limits = joints[joint_of_parameter(parameter)].limits;
    return {limits.position_min_rad, limits.position_max_rad};
  }
  /// Index of the first parameter of a joint.
  [[nodiscard]] int first_parameter(std::size_t joint) const {
    int first = 0;
    for (std::size_t j = 0; j < joint; ++j) first += joints[j].free_points();
    return first;
  }
  /// The joint whose path a parameter belongs to, which is one of a path.
  [[nodiscard]] std::size_t joint_of_parameter(int parameter) const {
    std::size_t joint = 0;
    while (parameter >= first_parameter(joint + 1)) ++joint;
    return joint;
  }
};

/// Whether two problems with the same URDF have joints that are alike: motors, springs and dampers.
/// @pre both are of a robot in the plane, or both in space; likewise below.
inline bool SameJoints(const Problem& a, const Problem& b) {
  return a.space ? SameJoints(a.space->scene, b.space->scene) : SameJoints(a.scene, b.scene);
}
/// Whether the ground of two problems is the same: obstacles, contact and gravity.
inline bool SameGround(const Problem& a, const Problem& b) {
  return a.space ? SameGround(a.space->scene, b.space->scene) : SameGround(a.scene, b.scene);
}

}  // namespace tumbler
