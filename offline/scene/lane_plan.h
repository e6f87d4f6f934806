#pragma once

#include <cstddef>
#include <span>

#include "offline/scene/lane_dynamics.h"
#include "offline/scene/lane_plan_kernel.h"
#include "offline/scene/lane_steps.h"
#include "offline/scene/space_lane_dynamics.h"
#include "offline/scene/tableau.h"

namespace tumbler {
inline namespace TUMBLER_LANES_NAMESPACE {

/// Plans of robots whose joints are prescribed by splines, for some lanes. P is the type of the
/// robots' numbers in memory, S what is computed with, Dynamics those of the plane or of space.
template <class Dynamics, class P, class S>
class LanePlanRun {
  static constexpr std::size_t kRoot = Dynamics::kRootDofs;
  using StoredState = typename Dynamics::StoredState;

 public:
  LanePlanRun(const typename Dynamics::Model& model, const typename Dynamics::Robot& robot,
              const LanePlan& plan, std::span<const P> points, const StoredState& start,
              LanePlanRecord<P, StoredState>& record, LanesFrom<S> lanes)
      : model_(model),
        plan_(plan),
        points_(points),
        record_(record),
        lanes_(lanes),
        dynamics_(model, robot, lanes),
        state_(dynamics_.Taken(start)),
        effort_(S(0)),
        work_(S(0)),
        slip_(S(0)),
        largest_(S(0)) {}

  void Run() {
    std::size_t look = 0;
    SetPath(0);
    for (std::size_t step = 0; step < plan_.steps.size(); ++step) {
      if (step == plan_.motion_steps) Hold();
      Look(step, look);
      switch (plan_.scheme) {
        case LanePlan::Scheme::kRungeKutta:
          StepRungeKutta<kClassical>(step);
          break;
        case LanePlan::Scheme::kFifthOrder:
          StepRungeKutta<kDormandPrince>(step);
          break;
        case LanePlan::Scheme::kSemiImplicitEuler:
          StepEuler(step);
          break;
      }
      for (std::size_t d = 0; d < kRoot; ++d) {
        largest_ = Max(largest_, Max(state_.q[d], -state_.q[d]));
        largest_ = Max(largest_, Max(state_.v[d], -state_.v[d]));
      }
      dynamics_.MoveOn(state_);
    }
    Look(plan_.steps.size(), look);
    lanes_.Put(effort_, record_.effort);
    if constexpr (Dynamics::kHasWorkAndSlip) {
      lanes_.Put(work_, record_.work);
      lanes_.Put(slip_, record_.loaded_slip);
    }
    lanes_.Put(largest_, record_.largest);
  }

 private:
  /// The root's place and velocity, or their derivatives.
  struct Root {
    S q[kRoot], v[kRoot];
  };

  void Look(std::size_t step, std::size_t& look) {
    for (; look < plan_.looks.size() && plan_.looks[look] == step; ++look)
      dynamics_.Store(state_, record_.at_look[look]);
  }

  /// Puts the joints where they are at a point of the motion.
  void SetPath(std::size_t point) {
    for (std::size_t j = 0; j < model_.joints; ++j) {
      const LanePathWeights& w = plan_.paths[j][point];
      const P* const first = points_.data() + plan_.first_point[j] + w.first;
      S q(0), v(0), a(0);
      for (std::size_t i = 0; i < plan_.weights; ++i) {
        const S c = lanes_(first[i]);
        q += S(w.of[0][i]) * c;
        v += S(w.of[1][i]) * c;
        a += S(w.of[2][i]) * c;
      }
      state_.q[j + kRoot] = q;
      state_.v[j + kRoot] = v;
      acceleration_[j] = a;
    }
  }

  /// Puts the joints where they are held.
  void Hold() {
    for (std::size_t j = 0; j < model_.joints; ++j) {
      state_.q[j + kRoot] = lanes_(points_[plan_.last_point[j]]);
      state_.v[j + kRoot] = S(0);
      acceleration_[j] = S(0);
    }
  }

  /// The root's derivative in the present state. Torques are in tau_.
  void Slope(Root& k) {
    for (std::size_t j = 0; j < model_.joints; ++j) qdd_[j + kRoot] = acceleration_[j];
    dynamics_.AcceleratePrescribed(state_, tau_, qdd_);
    for (std::size_t d = 0; d < kRoot; ++d) {
      k.q[d] = state_.v[d];
      k.v[d] = qdd_[d];
    }
  }

  void Record(std::size_t stage) {
    lanes_.Put(dynamics_.depth(), record_.depth[stage]);
    for (std::size_t j = 0; j < model_.joints; ++j)
      lanes_.Put(tau_[j + kRoot], record_.torque[stage * model_.joints + j]);
  }

  void AddEffort(double weight) {
    S sum(0);
    for (std::size_t j = 0; j < model_.joints; ++j) sum += tau_[j + kRoot] * tau_[j + kRoot];
    effort_ += S(weight) * sum;
    if constexpr (Dynamics::kHasWorkAndSlip) {
      S power(0);
      for (std::size_t j = 0; j < model_.joints; ++j)
        power += tau_[j + kRoot] * state_.v[j + kRoot];
      work_ += S(weight) * power;
      slip_ += S(weight) * dynamics_.loaded_slip();
    }
  }

  /// The root at `from` and a step beyond it, along the slopes of `count` stages with weights.
  Root Beyond(const Root& from, double h_s, const Tableau::Row& weights, std::size_t count,
              const Root* k) const {
    Root to = from;
    for (std::size_t r = 0; r < count; ++r) {
      if (weights[r] == 0) continue;
      const S weight(h_s * weights[r]);
      for (std::size_t d = 0; d < kRoot; ++d) {
        to.q[d] += weight * k[r].q[d];
        to.v[d] += weight * k[r].v[d];
      }
    }
    return to;
  }
  void Place(const Root& root) {
    for (std::size_t d = 0; d < kRoot; ++d) {
      state_.q[d] = root.q[d];
      state_.v[d] = root.v[d];
    }
  }

  template <const Tableau& kScheme>
  void StepRungeKutta(std::size_t step) {
    constexpr std::size_t kStages = kScheme.own_stages();
    const double h_s = plan_.steps[step];
    Root from, k[kStages];
    for (std::size_t d = 0; d < kRoot; ++d) {
      from.q[d] = state_.q[d];
      from.v[d] = state_.v[d];
    }
    std::size_t point = plan_.points_per_step * step;
    for (std::size_t s = 0; s < kStages; ++s) {
      if (s > 0 && kScheme.c[s] != kScheme.c[s - 1] && step < plan_.motion_steps) SetPath(++point);
      if (s > 0) Place(Beyond(from, h_s, kScheme.a[s], s, k));
      Slope(k[s]);
      Record(kStages * step + s);
      AddEffort(h_s * kScheme.b[s]);
    }
    Place(Beyond(from, h_s, kScheme.b, kStages, k));
  }

  void StepEuler(std::size_t step) {
    const S h(plan_.steps[step]);
    Root k;
    Slope(k);
    Record(step);
    AddEffort(plan_.steps[step]);
    for (std::size_t d = 0; d < kRoot; ++d) {
      state_.v[d] += h * k.v[d];
      state_.q[d] += h * state_.v[d];
    }
    if (step < plan_.motion_steps) SetPath(plan_.points_per_step * (step + 1));
  }

  const typename Dynamics::Model& model_;
  const LanePlan& plan_;
  std::span<const P> points_;
  LanePlanRecord<P, StoredState>& record_;
  LanesFrom<S> lanes_;
  Dynamics dynamics_;
  typename Dynamics::State state_;
  std::array<S, LaneModel::kMaxJoints> acceleration_;
  typename Dynamics::Numbers tau_{}, qdd_{};
  S effort_, work_, slip_, largest_;
};

/// Adapts LanePlanKernel::run.
template <class P, class S>
void RunLanePlans(const LaneModel& model, const LaneRobot<P>& robot, const LanePlan& plan,
                  std::span<const P> points, const LaneState<P>& start, LanePlanRecord<P>& record) {
  WithTreeOf(model, [&]<class Tree>() {
    for (std::size_t first = 0; first < kLanesOf<P>; first += LanesFrom<S>::kLanes) {
      LanePlanRun<LaneDynamics<S, P, Tree>, P, S>(model, robot, plan, points, start, record,
                                                  LanesFrom<S>(first))
          .Run();
    }
  });
}

/// Adapts LanePlanKernel::run_in_space.
template <class P, class S>
void RunSpaceLanePlans(const SpaceLaneModel& model, const SpaceLaneRobot<P>& robot,
                       const LanePlan& plan, std::span<const P> points,
                       const SpaceLaneState<P>& start,
                       LanePlanRecord<P, SpaceLaneState<P>>& record) {
  for (std::size_t first = 0; first < kLanesOf<P>; first += LanesFrom<S>::kLanes) {
    LanePlanRun<SpaceLaneDynamics<S, P>, P, S>(model, robot, plan, points, start, record,
                                               LanesFrom<S>(first))
        .Run();
  }
}

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
