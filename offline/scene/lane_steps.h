#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "common/core/drive_law.h"
#include "offline/scene/joint_stop.h"
#include "offline/scene/lane_dynamics.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_tree.h"
#include "offline/scene/motor.h"
#include "offline/scene/space_lane_dynamics.h"

namespace tumbler {
inline namespace TUMBLER_LANES_NAMESPACE {

/// The torque of a joint's drive, friction and stop, at the integration steps of robots in lanes.
template <class S, class P, class Robot = LaneRobot<P>>
class LaneDriveLaw {
 public:
  LaneDriveLaw(const Robot& robot, std::size_t joint, LanesFrom<S> lanes)
      : r_(robot),
        drive_(robot.joints[joint]),
        lanes_(lanes),
        rubs_(Any(S(0) < lanes(drive_.dry_friction))) {}

  /// @param largest  takes the largest |torque| of the motor.
  template <class N>
  [[gnu::always_inline]] S Torque(const LaneSetpoint<N>& before, const LaneSetpoint<N>& now,
                                  const S& since, const S& q, const S& v, S& largest) const {
    return AtJoint(Exerted(before, now, since, q, v), q, v, largest);
  }

  /// The torque of the motor alone. @param seen  the velocity that the drive sees.
  template <class N>
  [[gnu::always_inline]] S Exerted(const LaneSetpoint<N>& before, const LaneSetpoint<N>& now,
                                   const S& since, const S& q, const S& seen) const {
    const auto late = since < lanes_(drive_.delay);
    const S wanted = ImpedanceTorque<S>(
        lanes_(drive_.kp),
        Select(late, lanes_(before.position), lanes_(now.position)) -
            (q + lanes_(drive_.zero_error)),
        lanes_(drive_.kd), Select(late, lanes_(before.velocity), lanes_(now.velocity)) - seen,
        lanes_(drive_.feed_forward) * Select(late, lanes_(before.third), lanes_(now.third)));
    const S limit = lanes_(drive_.torque_max);
    return Clamp(wanted, -limit, limit);
  }

  /// The torque at the joint where the motor exerts this one.
  [[gnu::always_inline]] S AtJoint(const S& torque, const S& q, const S& v, S& largest) const {
    largest = Max(largest, Max(torque, -torque));
    // What adds nothing in any lane is left out.
    const S moving = rubs_ ? torque - lanes_(drive_.dry_friction) * DryFrictionShare(v) : torque;
    const S lower = lanes_(drive_.lower), upper = lanes_(drive_.upper);
    if (!Any((upper < q) | (q < lower))) return moving + S(0);
    const JointStop<S> stop{lanes_(r_.stop_stiffness), lanes_(r_.stop_damping), lower, upper};
    return moving + stop.Torque(q, v);
  }

 private:
  const Robot& r_;
  const LaneJoint<P>& drive_;
  LanesFrom<S> lanes_;
  bool rubs_;
};

/// State and watch of robots in lanes, taken from packets, and put back.
template <class S, class P>
struct LaneProgress {
  LaneState<S> state;
  S root_speed, depth;
  std::array<S, LaneModel::kMaxJoints> torque;

  LaneProgress(const LaneState<P>& from, const LaneWatch<P>& watch, std::size_t joints,
               LanesFrom<S> lanes)
      : root_speed(lanes(watch.root_speed)), depth(lanes(watch.depth)) {
    for (std::size_t d = 0; d < joints + 3; ++d) {
      state.q[d] = lanes(from.q[d]);
      state.v[d] = lanes(from.v[d]);
    }
    for (std::size_t j = 0; j < joints; ++j) {
      torque[j] = lanes(watch.torque[j]);
      state.seen[j] = lanes(from.seen[j]);
      state.exerted[j] = lanes(from.exerted[j]);
    }
  }
  /// Notes how fast the root is, in a step.
  [[gnu::always_inline]] void WatchRoot() {
    for (std::size_t d = 0; d < 3; ++d) root_speed = Max(root_speed, Max(state.v[d], -state.v[d]));
  }
  void Put(LaneState<P>& to, LaneWatch<P>& watch, std::size_t joints, LanesFrom<S> lanes) const {
    lanes.Put(root_speed, watch.root_speed);
    lanes.Put(depth, watch.depth);
    for (std::size_t d = 0; d < joints + 3; ++d) {
      lanes.Put(state.q[d], to.q[d]);
      lanes.Put(state.v[d], to.v[d]);
    }
    for (std::size_t j = 0; j < joints; ++j) {
      lanes.Put(torque[j], watch.torque[j]);
      lanes.Put(state.seen[j], to.seen[j]);
      lanes.Put(state.exerted[j], to.exerted[j]);
    }
  }
};

/// Positions of robots in lanes, which steps add to. In single precision what rounding loses of a
/// step is added to the next one [K65]: a robot that falls slowly moves by less than a unit in the
/// last place in a short step, and would stand for ever.
///
/// [K65] W. Kahan, Further Remarks on Reducing Truncation Errors, Comm. ACM 8(1), 1965.
template <class S>
class LanePositions {
 public:
  [[gnu::always_inline]] void Add(std::size_t dof, const S& step, S& q) {
    if constexpr (kIsSingle<S>) {
      const S due = step - lost_[dof];
      const S sum = q + due;
      lost_[dof] = (sum - q) - due;
      q = sum;
    } else {
      q += step;
    }
  }

 private:
  static constexpr std::size_t kCount = kIsSingle<S> ? LaneModel::kMaxDofs : 0;
  static std::array<S, kCount> Nothing() {
    std::array<S, kCount> nothing;
    if constexpr (kCount > 0) nothing.fill(S(0));
    return nothing;
  }
  std::array<S, kCount> lost_ = Nothing();
};

/// LaneKernel::drive for some lanes of packets P, with S and a tree that the model has.
/// @tparam N  the numbers of setpoints: P, or what all lanes share.
template <class Tree, class S, class P, class N>
void DriveSome(const LaneModel& model, const LaneRobot<P>& robot, const LaneSteps& steps,
               std::span<const LaneSetpoint<N>> setpoints, const HeldSetpoints<N>& held,
               LaneState<P>& state_of_all, LaneWatch<P>& watch, LanesFrom<S> lanes) {
  const Tree tree(model);
  const std::size_t joints = tree.joints();
  LaneProgress<S, P> robots(state_of_all, watch, joints, lanes);
  LaneDynamics<S, P, Tree> dynamics(model, robot, lanes);
  typename LaneDynamics<S, P, Tree>::Numbers tau, qdd;
  const double h_s = steps.tick_s / steps.per_tick;
  const S h(h_s);
  const LaneSetpoint<N>* before = held.data();
  LanePositions<S> positions;
  // Drives of which the law is computed at every step, sees the velocity at once and is obeyed at
  // once are the rule. Else: of the backward Euler method between two evaluations; what the filter
  // and the current loop do lags by their constants.
  std::array<S, LaneModel::kMaxJoints> share, followed;
  bool plain = steps.law_every == 1 && !steps.midpoint;
  for (std::size_t j = 0; plain && j < joints; ++j) {
    const S filter = lanes(robot.joints[j].velocity_filter),
            lag = lanes(robot.joints[j].torque_lag);
    plain = !Any((S(0) < filter) | (S(0) < lag));
  }
  for (std::size_t j = 0; !plain && j < joints; ++j) {
    const S between(h_s * steps.law_every);
    share[j] = between / (lanes(robot.joints[j].velocity_filter) + between);
    followed[j] = between / (lanes(robot.joints[j].torque_lag) + between);
  }
  for (std::size_t k = 0; k + joints <= setpoints.size(); k += joints) {
    const LaneSetpoint<N>* const now = setpoints.data() + k;
    for (int i = 0; i < steps.per_tick; ++i) {
      // The middle of the time for which the law's torque is kept.
      const S since(h_s * (i - i % steps.law_every + 0.5 * steps.law_every));
      tree.Outwards([&](auto body) __attribute__((always_inline)) {
        const std::size_t j = body - 1;
        const LaneDriveLaw<S, P> law(robot, j, lanes);
        const S &q = robots.state.q[j + 3], &v = robots.state.v[j + 3];
        if (plain) {
          tau[j + 3] = law.Torque(before[j], now[j], since, q, v, robots.torque[j]);
          return;
        }
        if (i % steps.law_every == 0) {
          S& seen = robots.state.seen[j];
          const auto filtered = S(0) < lanes(robot.joints[j].velocity_filter);
          seen = Select(filtered, seen + share[j] * (v - seen), v);
          S& exerted = robots.state.exerted[j];
          const S wanted = law.Exerted(before[j], now[j], since, q, seen);
          const auto lags = S(0) < lanes(robot.joints[j].torque_lag);
          exerted = Select(lags, exerted + followed[j] * (wanted - exerted), wanted);
        }
        tau[j + 3] = law.AtJoint(robots.state.exerted[j], q, v, robots.torque[j]);
      });
      dynamics.Accelerate(robots.state, tau, qdd);
      robots.depth = Max(robots.depth, dynamics.depth());
      if (steps.midpoint) {
        LaneState<S> middle;
        for (std::size_t d = 0; d < joints + 3; ++d) {
          middle.q[d] = robots.state.q[d] + S(0.5) * h * robots.state.v[d];
          middle.v[d] = robots.state.v[d] + S(0.5) * h * qdd[d];
        }
        tree.Outwards([&](auto body) __attribute__((always_inline)) {
          const std::size_t j = body - 1;
          tau[j + 3] = LaneDriveLaw<S, P>(robot, j, lanes)
                           .AtJoint(robots.state.exerted[j], middle.q[j + 3], middle.v[j + 3],
                                    robots.torque[j]);
        });
        dynamics.Accelerate(middle, tau, qdd);
        for (std::size_t d = 0; d < joints + 3; ++d) {
          positions.Add(d, h * middle.v[d], robots.state.q[d]);
          robots.state.v[d] += h * qdd[d];
        }
      } else {
        for (std::size_t d = 0; d < joints + 3; ++d) {
          robots.state.v[d] += h * qdd[d];
          positions.Add(d, h * robots.state.v[d], robots.state.q[d]);
        }
      }
      robots.WatchRoot();
    }
    before = now;
  }
  robots.Put(state_of_all, watch, joints, lanes);
}

/// LaneKernel::drive_classically likewise, in the plane or in space.
template <class Dynamics, class S, class P>
void DriveSomeClassically(const typename Dynamics::Model& model,
                          const typename Dynamics::Robot& robot, const LaneSteps& steps,
                          std::span<const LaneSetpoint<P>> setpoints, const HeldSetpoints<P>& held,
                          typename Dynamics::StoredState& state_of_all, LanesFrom<S> lanes) {
  // Of kClassical (tableau.h): where a stage is, and what it weighs.
  constexpr std::array kPart = {0.5, 0.5, 1.0, 0.0}, kWeight = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
  // A setpoint acts from the step on that begins with it, whatever rounding makes of its time.
  constexpr double kRounding = 1e-6;
  constexpr std::size_t kRoot = Dynamics::kRootDofs;
  Dynamics dynamics(model, robot, lanes);
  const std::size_t joints = dynamics.joints();
  typename Dynamics::State state = dynamics.Taken(state_of_all), at, sum;
  typename Dynamics::Numbers tau, qdd;
  S largest(0);  // torque, which nobody asks for
  const double h_s = steps.tick_s / steps.per_tick;
  const LaneSetpoint<P>* before = held.data();
  for (std::size_t k = 0; k + joints <= setpoints.size(); k += joints) {
    const LaneSetpoint<P>* const now = setpoints.data() + k;
    for (int i = 0; i < steps.per_tick; ++i) {
      const S since(h_s * i + kRounding * steps.tick_s);
      at = sum = state;
      for (std::size_t s = 0; s < kPart.size(); ++s) {
        dynamics.ForEachJoint([&](std::size_t j) __attribute__((always_inline)) {
          tau[j + kRoot] =
              LaneDriveLaw<S, P, typename Dynamics::Robot>(robot, j, lanes)
                  .Torque(before[j], now[j], since, at.q[j + kRoot], at.v[j + kRoot], largest);
        });
        dynamics.Accelerate(at, tau, qdd);
        const S part(h_s * kPart[s]), weight(h_s * kWeight[s]);
        for (std::size_t d = 0; d < joints + kRoot; ++d) {
          sum.q[d] += weight * at.v[d];
          sum.v[d] += weight * qdd[d];
          const S velocity = at.v[d];
          at.q[d] = state.q[d] + part * velocity;
          at.v[d] = state.v[d] + part * qdd[d];
        }
      }
      state = sum;
      dynamics.MoveOn(state);
    }
    before = now;
  }
  dynamics.Store(state, state_of_all);
}

/// LaneKernel::prescribe likewise.
template <class Tree, class S, class P>
void PrescribeSome(const LaneModel& model, const LaneRobot<P>& robot, double step_s,
                   std::span<const LaneSetpoint<P>> setpoints, LaneState<P>& state_of_all,
                   LaneWatch<P>& watch, std::span<P> torques, LanesFrom<S> lanes) {
  const Tree tree(model);
  const std::size_t joints = tree.joints();
  LaneProgress<S, P> robots(state_of_all, watch, joints, lanes);
  LaneDynamics<S, P, Tree> dynamics(model, robot, lanes);
  typename LaneDynamics<S, P, Tree>::Numbers tau, qdd;
  const S h(step_s);
  for (std::size_t k = 0; k + joints <= setpoints.size(); k += joints) {
    tree.Outwards([&](auto body) __attribute__((always_inline)) {
      const std::size_t j = body - 1;
      const LaneSetpoint<P>& now = setpoints[k + j];
      robots.state.q[j + 3] = lanes(now.position);
      robots.state.v[j + 3] = lanes(now.velocity);
      qdd[j + 3] = lanes(now.third);
    });
    dynamics.AcceleratePrescribed(robots.state, tau, qdd);
    robots.depth = Max(robots.depth, dynamics.depth());
    tree.Outwards([&](auto body) __attribute__((always_inline)) {
      const std::size_t j = body - 1;
      robots.torque[j] = Max(robots.torque[j], Max(tau[j + 3], -tau[j + 3]));
      lanes.Put(tau[j + 3], torques[k + j]);
    });
    for (std::size_t d = 0; d < 3; ++d) {
      robots.state.v[d] += h * qdd[d];
      robots.state.q[d] += h * robots.state.v[d];
    }
    robots.WatchRoot();
  }
  robots.Put(state_of_all, watch, joints, lanes);
}

/// How many lanes a packet P has.
template <class P>
inline constexpr std::size_t kLanesOf = P::kLanes;
template <>
inline constexpr std::size_t kLanesOf<double> = 1;

/// The trees that are compiled for: one joint, two on the root, and two in a row. All others are
/// asked for when they run.
using OneJoint = KnownTree<0>;
using TwoOnRoot = KnownTree<0, 0>;
using TwoInARow = KnownTree<0, 1>;

/// Calls `use`, a template of one tree, with the model's.
template <class Use>
void WithTreeOf(const LaneModel& model, Use&& use) {
  if (TwoOnRoot::IsOf(model)) {
    use.template operator()<TwoOnRoot>();
  } else if (TwoInARow::IsOf(model)) {
    use.template operator()<TwoInARow>();
  } else if (OneJoint::IsOf(model)) {
    use.template operator()<OneJoint>();
  } else {
    use.template operator()<AnyTree>();
  }
}

/// The setpoints that are held after these.
template <class P>
void TakeLast(std::size_t joints, std::span<const LaneSetpoint<P>> setpoints,
              HeldSetpoints<P>& held) {
  const std::size_t whole = setpoints.size() / joints * joints;
  if (whole == 0) return;
  for (std::size_t j = 0; j < joints; ++j) held[j] = setpoints[whole - joints + j];
}

/// LaneKernel::drive with S, some lanes after the other.
template <class P, class S, class N = P>
void DriveLanes(const LaneModel& model, const LaneRobot<P>& robot, const LaneSteps& steps,
                std::span<const LaneSetpoint<N>> setpoints, HeldSetpoints<N>& held,
                LaneState<P>& state, LaneWatch<P>& watch) {
  WithTreeOf(model, [&]<class Tree>() {
    for (std::size_t first = 0; first < kLanesOf<P>; first += LanesFrom<S>::kLanes) {
      DriveSome<Tree>(model, robot, steps, setpoints, held, state, watch, LanesFrom<S>(first));
    }
  });
  TakeLast(model.joints, setpoints, held);
}

/// LaneKernel::drive_classically likewise.
/// @tparam Few  for robots that all have a lane of it: half as wide vectors divide faster.
template <class P, class S, class Few = S>
void DriveLanesClassically(const LaneModel& model, const LaneRobot<P>& robot,
                           const LaneSteps& steps, std::span<const LaneSetpoint<P>> setpoints,
                           HeldSetpoints<P>& held, LaneState<P>& state, std::size_t lanes) {
  WithTreeOf(model, [&]<class Tree>() {
    if (lanes <= LanesFrom<Few>::kLanes) {
      DriveSomeClassically<LaneDynamics<Few, P, Tree>>(model, robot, steps, setpoints, held, state,
                                                       LanesFrom<Few>(0));
      return;
    }
    for (std::size_t first = 0; first < lanes; first += LanesFrom<S>::kLanes) {
      DriveSomeClassically<LaneDynamics<S, P, Tree>>(model, robot, steps, setpoints, held, state,
                                                     LanesFrom<S>(first));
    }
  });
  TakeLast(model.joints, setpoints, held);
}

/// LaneKernel::drive_classically_in_space likewise.
template <class P, class S>
void DriveSpaceLanesClassically(const SpaceLaneModel& model, const SpaceLaneRobot<P>& robot,
                                const LaneSteps& steps, std::span<const LaneSetpoint<P>> setpoints,
                                HeldSetpoints<P>& held, SpaceLaneState<P>& state,
                                std::size_t lanes) {
  for (std::size_t first = 0; first < lanes; first += LanesFrom<S>::kLanes) {
    DriveSomeClassically<SpaceLaneDynamics<S, P>>(model, robot, steps, setpoints, held, state,
                                                  LanesFrom<S>(first));
  }
  TakeLast(model.joints, setpoints, held);
}

/// LaneKernel::prescribe likewise.
template <class P, class S>
void PrescribeLanes(const LaneModel& model, const LaneRobot<P>& robot, double step_s,
                    std::span<const LaneSetpoint<P>> setpoints, LaneState<P>& state,
                    LaneWatch<P>& watch, std::span<P> torques) {
  WithTreeOf(model, [&]<class Tree>() {
    for (std::size_t first = 0; first < kLanesOf<P>; first += LanesFrom<S>::kLanes) {
      PrescribeSome<Tree>(model, robot, step_s, setpoints, state, watch, torques,
                          LanesFrom<S>(first));
    }
  });
}

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
