#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "common/core/drive_law.h"
#include "common/core/index.h"
#include "offline/certify/driven_motion.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/stepper.h"
#include "offline/solve/joint_paths.h"
#include "offline/solve/rollout_result.h"
#include "offline/solve/start_state.h"

namespace tumbler {

/// The executor's usual period, and how long frames take [s].
inline constexpr double kUsualPeriod_s = 1e-3, kUsualDelay_s = LaneDrive{}.delay_s;

/// The nominal robot of a problem, but for a disturbance.
template <class SceneKind>
auto Nominal(SceneKind scene, const Problem& problem, const Disturbance& disturbance) {
  using Space = std::conditional_t<std::is_same_v<SceneKind, Scene>, Plane, Spatial>;
  Tilt(scene.robot, disturbance.slope_rad);
  return PlayedRobot<Space>{std::move(scene), problem.drive_gains(), disturbance.lean_rad};
}

/// A robot whose joints are moved by the torques of drives.
template <class Space>
class DrivenRobotIn {
 public:
  using Dynamics = SceneDynamicsIn<Space>;

  DrivenRobotIn(const Problem& problem, const std::vector<double>& x,
                std::span<const JointMotion<double>::Spline> feed_forward,
                const PlayedRobot<Space>& played)
      : problem_(&problem),
        gains_(played.gains),
        period_s_(played.period_s),
        push_(played.push),
        root_body_(played.scene.robot.first_body()),
        robot_(MovedByTorques(played.scene, problem.joints)),
        state_(StartState(robot_, problem)),
        chart_(StartChart<Space>(problem)) {
    constexpr int kRootPitch = RootChart<Space>::kMoves ? 3 : 2;
    if (played.scene.robot.root_dofs > 0)
      state_[Index(robot_.FreeIndexOf(kRootPitch))] += played.lean_rad;
    robot_.Use(chart_);
    TakePaths(x, feed_forward);
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      const ActuatedJoint& joint = problem.joints[j];
      dry_friction_nm_.push_back(played.scene.motors.empty()
                                     ? played.scene.robot.dry_friction_nm[Index(joint.dof)]
                                     : joint.motor.dry_friction_nm);
      state_[robot_.free.size() + Index(robot_.FreeIndexOf(joint.dof))] = joint.start_rad_s;
    }
  }

  /// Goes on with another motion, of which the time begins at 0.
  /// @param problem  of the same robot.
  /// @param began_s  since the start of the first motion.
  void Begin(const Problem& problem, const std::vector<double>& x,
             std::span<const JointMotion<double>::Spline> feed_forward, double began_s) {
    problem_ = &problem;
    began_s_ = began_s;
    TakePaths(x, feed_forward);
  }

  /// The longest step that the drives' damping allows: that of a joint's inertia over kd, with
  /// which the classical method is stable also where the inertia is a third of that at the start.
  double LongestStep() {
    constexpr double kShortest_s = 50e-6;  // that of the twin
    robot_.SetFree(state_);
    double longest_s = problem_->solver.step_s;
    for (const ActuatedJoint& joint : problem_->joints) {
      const double by_torque = AccelerationBy(joint.dof, 1) - AccelerationBy(joint.dof, 0);
      longest_s = std::min(longest_s, 1 / (by_torque * gains_.kd_nm_s_per_rad));
    }
    return std::max(longest_s, kShortest_s);
  }

  /// @returns whether the state is plausible after the step.
  bool Step(double time_s, double step_s) {
    TakeSetpoints(time_s);
    const double since_push_s = push_ ? began_s_ + time_s - push_->start_s : -1;
    pushed_ = since_push_s >= 0 && since_push_s < push_->duration_s;
    const std::size_t free = robot_.free.size();
    StepRungeKutta<kClassical>(state_, 2 * free, step_s,
                               [this](int, const typename Dynamics::State& state, double* k) {
                                 Slope(state, k);
                                 return true;
                               });
    const bool plausible =
        std::all_of(state_.begin(), state_.begin() + static_cast<std::ptrdiff_t>(2 * free),
                    [](double value) { return std::abs(value) < kImplausibleState; });
    if constexpr (RootChart<Space>::kMoves) {
      constexpr std::size_t kFirst = RootChart<Space>::kFirst;
      if (plausible) chart_.MoveOn(&state_[kFirst], &state_[free + kFirst]);
      robot_.Use(chart_);
    }
    return plausible;
  }

  /// Valid until the next step.
  std::span<const double> Positions() {
    robot_.SetFree(state_);
    return {robot_.q.data(), robot_.n};
  }
  /// After Positions.
  [[nodiscard]] std::span<const double> Velocities() const { return {robot_.qd.data(), robot_.n}; }
  [[nodiscard]] const RootChart<Space>& chart() const { return chart_; }

 private:
  struct Setpoint {
    double position_rad = 0, velocity_rad_s = 0, torque_nm = 0;
  };
  struct Drive {
    JointMotion<double>::Spline path, feed_forward;
    Setpoint setpoint;
  };

  /// Joints of motors of which nothing is known have the friction that they have in the twin: paths
  /// were found without.
  static SceneOf<Space> MovedByTorques(SceneOf<Space> scene,
                                       const std::vector<ActuatedJoint>& joints) {
    for (const ActuatedJoint& joint : joints) {
      Dof<Space>& dof = scene.robot.tree.dofs[Index(joint.dof)];
      dof.prescribed = false;
      if (scene.motors.empty())
        dof.damping_nm_s_per_rad += LaneDrive{}.viscous_friction_nm_s_per_rad;
    }
    return scene;
  }

  void TakePaths(const std::vector<double>& x,
                 std::span<const JointMotion<double>::Spline> feed_forward) {
    drives_.clear();
    for (std::size_t j = 0; j < problem_->joints.size(); ++j)
      drives_.push_back({PositionSpline(*problem_, x, j), feed_forward[j], {}});
    tick_ = kNoTick;
  }

  double AccelerationBy(int dof, double torque_nm) {
    robot_.tau.fill(0);
    robot_.Touch();
    robot_.tau[Index(dof)] = torque_nm;
    robot_.Solve();
    return robot_.qdd[Index(dof)];
  }

  void TakeSetpoints(double time_s) {
    // A step that begins where a setpoint arrives has it, whatever rounding makes of its time.
    const double tick = std::floor((time_s - kUsualDelay_s) / period_s_ + 1e-6);
    if (tick == tick_) return;
    tick_ = tick;
    const double t = std::clamp(tick * period_s_, 0.0, problem_->duration_s);
    const bool moves = tick * period_s_ < problem_->duration_s;
    for (Drive& drive : drives_) {
      const auto path = drive.path.Evaluate(t);
      drive.setpoint = {path.value, moves ? path.first : 0, drive.feed_forward.Evaluate(t).value};
    }
  }

  void Slope(const typename Dynamics::State& state, double* k) {
    robot_.SetFree(state);
    robot_.tau.fill(0);
    robot_.Touch();
    if (pushed_) {
      robot_.dynamics.AddWrench(
          root_body_, Space::ForceAt(robot_.dynamics.position(root_body_), push_->force_n));
    }
    for (std::size_t j = 0; j < drives_.size(); ++j) {
      const ActuatedJoint& joint = problem_->joints[j];
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

  const Problem* problem_;
  std::vector<double> dry_friction_nm_;  // of each joint
  DriveGains gains_;
  double period_s_;
  std::optional<RootPush<Space>> push_;
  bool pushed_ = false;  // now
  double began_s_ = 0;
  int root_body_;
  Dynamics robot_;
  typename Dynamics::State state_;
  RootChart<Space> chart_;
  std::vector<Drive> drives_;
  static constexpr double kNoTick = -1e9;
  double tick_ = kNoTick;  ///< Whose setpoints the drives have.
};

}  // namespace tumbler
