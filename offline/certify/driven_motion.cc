#include "offline/certify/driven_motion.h"

#include <algorithm>
#include <cmath>

#include "common/core/drive_law.h"
#include "common/core/index.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/stepper.h"
#include "offline/solve/rollout.h"
#include "offline/solve/start_state.h"

namespace tumbler {
namespace {

/// The executor's usual period, and how long frames take [s].
constexpr double kPeriod_s = 1e-3, kDelay_s = LaneDrive{}.delay_s;
/// The shortest step [s], which is that of the twin.
constexpr double kShortest_s = 50e-6;
/// Parts of the solver's step in the motion: a foot that lands is fast.
constexpr double kFiner = 4;
constexpr int kRootPitch = 2;  // of the degrees of freedom, where the root has any

/// The scene on sloping ground, with its joints moved by torques. Joints of motors of which nothing
/// is known have the friction that they have in the twin: paths were found without.
Scene MovedByTorques(Scene scene, const std::vector<ActuatedJoint>& joints, double slope_rad) {
  for (const ActuatedJoint& joint : joints) {
    Dof<Plane>& dof = scene.robot.tree.dofs[Index(joint.dof)];
    dof.prescribed = false;
    if (scene.motors.empty()) dof.damping_nm_s_per_rad += LaneDrive{}.viscous_friction_nm_s_per_rad;
  }
  Tilt(scene.robot, slope_rad);
  return scene;
}

class DrivenRobot {
 public:
  DrivenRobot(const Problem& problem, const std::vector<double>& x,
              std::span<const JointMotion<double>::Spline> feed_forward,
              const Disturbance& disturbance)
      : problem_(problem),
        gains_(problem.drive_gains()),
        robot_(MovedByTorques(problem.scene, problem.joints, disturbance.slope_rad)),
        state_(StartState(robot_, problem)) {
    if (problem.scene.robot.root_dofs > 0)
      state_[Index(robot_.FreeIndexOf(kRootPitch))] += disturbance.lean_rad;
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      const ActuatedJoint& joint = problem.joints[j];
      drives_.push_back({PositionSpline(problem, x, j), feed_forward[j], {}});
      dry_friction_nm_.push_back(problem.scene.motors.empty()
                                     ? problem.scene.robot.dry_friction_nm[Index(joint.dof)]
                                     : joint.motor.dry_friction_nm);
      state_[robot_.free.size() + Index(robot_.FreeIndexOf(joint.dof))] = joint.start_rad_s;
    }
  }

  /// The longest step that the drives' damping allows: that of a joint's inertia over kd, with
  /// which the classical method is stable also where the inertia is a third of that at the start.
  double LongestStep() {
    robot_.SetFree(state_);
    double longest_s = problem_.solver.step_s;
    for (const ActuatedJoint& joint : problem_.joints) {
      const double by_torque = AccelerationBy(joint.dof, 1) - AccelerationBy(joint.dof, 0);
      longest_s = std::min(longest_s, 1 / (by_torque * gains_.kd_nm_s_per_rad));
    }
    return std::max(longest_s, kShortest_s);
  }

  /// @returns whether the state is plausible after the step.
  bool Step(double time_s, double step_s) {
    TakeSetpoints(time_s);
    const std::size_t size = 2 * robot_.free.size();
    StepRungeKutta<kClassical>(state_, size, step_s,
                               [this](int, const SceneDynamics::State& state, double* k) {
                                 Slope(state, k);
                                 return true;
                               });
    return std::all_of(state_.begin(), state_.begin() + static_cast<std::ptrdiff_t>(size),
                       [](double value) { return std::abs(value) < kImplausibleState; });
  }

  std::span<const double> Positions() {
    robot_.SetFree(state_);
    return {robot_.q.data(), robot_.n};
  }

 private:
  struct Setpoint {
    double position_rad = 0, velocity_rad_s = 0, torque_nm = 0;
  };
  struct Drive {
    JointMotion<double>::Spline path, feed_forward;
    Setpoint setpoint;
  };

  double AccelerationBy(int dof, double torque_nm) {
    robot_.tau.fill(0);
    robot_.Touch();
    robot_.tau[Index(dof)] = torque_nm;
    robot_.Solve();
    return robot_.qdd[Index(dof)];
  }

  void TakeSetpoints(double time_s) {
    // A step that begins where a setpoint arrives has it, whatever rounding makes of its time.
    const double tick = std::floor((time_s - kDelay_s) / kPeriod_s + 1e-6);
    if (tick == tick_) return;
    tick_ = tick;
    const double t = std::clamp(tick * kPeriod_s, 0.0, problem_.duration_s);
    const bool moves = tick * kPeriod_s < problem_.duration_s;
    for (Drive& drive : drives_) {
      const auto path = drive.path.Evaluate(t);
      drive.setpoint = {path.value, moves ? path.first : 0, drive.feed_forward.Evaluate(t).value};
    }
  }

  void Slope(const SceneDynamics::State& state, double* k) {
    robot_.SetFree(state);
    robot_.tau.fill(0);
    robot_.Touch();
    for (std::size_t j = 0; j < drives_.size(); ++j) {
      const ActuatedJoint& joint = problem_.joints[j];
      const Setpoint& setpoint = drives_[j].setpoint;
      const std::size_t dof = Index(joint.dof);
      const double velocity = robot_.qd[dof];
      const double wanted = ImpedanceTorque(
          gains_.kp_nm_per_rad, setpoint.position_rad - robot_.q[dof], gains_.kd_nm_s_per_rad,
          setpoint.velocity_rad_s - velocity, setpoint.torque_nm);
      const double limit = joint.limits.torque_max_nm * (1 - joint.motor.LackAt(wanted, velocity));
      robot_.tau[dof] = std::clamp(wanted, -limit, limit) -
                        EvaluateDryFriction(dry_friction_nm_[j], velocity).torque_nm;
    }
    robot_.Solve();
    robot_.TakeSlope(k);
  }

  const Problem& problem_;
  std::vector<double> dry_friction_nm_;  // of each joint
  DriveGains gains_;
  SceneDynamics robot_;
  SceneDynamics::State state_;
  std::vector<Drive> drives_;
  double tick_ = -1e9;  ///< Whose setpoints the drives have.
};

}  // namespace

bool PlayThroughDrives(const Problem& problem, const std::vector<double>& x,
                       std::span<const JointMotion<double>::Spline> feed_forward,
                       const Disturbance& disturbance, double until_s,
                       const std::function<bool(double, std::span<const double>)>& visitor) {
  DrivenRobot robot(problem, x, feed_forward, disturbance);
  const double longest_s = robot.LongestStep();
  const double calm_s = problem.duration_s + ExitAfter(problem);
  // Steps divide the period, so that setpoints change between them.
  const auto divided = [&](double parts) {
    return kPeriod_s /
           std::ceil(kPeriod_s / std::min(longest_s, problem.solver.step_s / parts) - 1e-6);
  };
  const double fine_s = divided(kFiner), coarse_s = divided(1);
  double time_s = 0;
  while (time_s < until_s) {
    const double step_s = time_s < calm_s ? fine_s : coarse_s;
    if (!visitor(time_s, robot.Positions())) return true;
    if (!robot.Step(time_s, step_s)) return false;
    time_s += step_s;
  }
  return true;
}

}  // namespace tumbler
