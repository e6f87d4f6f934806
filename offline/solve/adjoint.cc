#include "offline/solve/adjoint.h"

#include <algorithm>

#include "common/core/index.h"

namespace tumbler {

template <class Space>
Adjoint<Space>::Pullback::Pullback() {
  adjoint.fill(Lanes::Zero());
  for (StateBar& block : y_bar) block.fill(Lanes::Zero());
  for (auto& path : paths) path.fill(Lanes::Zero());
}

template <class Space>
Adjoint<Space>::Adjoint(Propagation<Space>& forward)
    : forward_(forward),
      free_(static_cast<int>(forward.robot.free.size())),
      joints_(forward.motion.joints()),
      dofs_(free_ + joints_) {}

template <class Space>
void Adjoint<Space>::Run(const RolloutResult& result, std::span<double> gradient) {
  if (forward_.table.classical) return RunScheme<kClassical>(result, gradient);
  RunScheme<kDormandPrince>(result, gradient);
}

template <class Space>
template <const Tableau& kScheme>
void Adjoint<Space>::RunScheme(const RolloutResult& result, std::span<double> gradient) {
  std::fill(gradient.begin(), gradient.end(), 0.0);
  // The clearance needs no simulation, so its gradient is known already.
  std::ranges::copy(forward_.clearance_gradient,
                    gradient.last(forward_.clearance_gradient.size()).begin());
  pullback_ = {};
  int lanes = 0;
  const auto add_lane = [&](int output, int joint, double limit) {
    pullback_.lanes[Index(lanes++)] = {output, joint, limit};
    if (lanes < Lanes::kCount) return;
    PullBack<kScheme>(gradient);
    pullback_ = {};
    lanes = 0;
  };
  add_lane(OutputRows::kCost, -1, 0);
  for (int j = 0; j < joints_; ++j) {
    if (forward_.outputs.IsTorqueLimited(j))
      add_lane(OutputRows::torque(j), j, forward_.motion.joint(j).limits.torque_max_nm);
  }
  if (result.penetration_excess > -1) {
    pullback_.penetration_lane = lanes;
    add_lane(forward_.outputs.rows().penetration(), -1, 0);
  }
  if (lanes > 0) PullBack<kScheme>(gradient);
}

template <class Space>
template <const Tableau& kScheme>
void Adjoint<Space>::PullBack(std::span<double> gradient) {
  const int parameters = forward_.motion.parameters();
  parameters_.assign(Index(parameters), Lanes::Zero());
  std::size_t instant = forward_.instant_states.size();
  AddInstants(forward_.table.steps(), instant);
  StateBar total;
  for (int step = forward_.table.steps() - 1; step >= 0; --step) {
    if constexpr (RootChart<Space>::kMoves) {
      constexpr std::size_t kFirst = RootChart<Space>::kFirst;
      RootChart<Space>::PullBack(forward_.turns[Index(step)], &pullback_.adjoint[kFirst],
                                 &pullback_.adjoint[Index(free_) + kFirst]);
    }
    std::copy_n(pullback_.adjoint.begin(), 2 * free_, total.begin());
    for (int s = static_cast<int>(kScheme.own_stages()) - 1; s >= 0; --s) {
      PullBackStage<kScheme>(step, s);
      for (int i = 0; i < 2 * free_; ++i) total[Index(i)] += pullback_.y_bar[Index(s)][Index(i)];
    }
    std::copy_n(total.begin(), 2 * free_, pullback_.adjoint.begin());
    AddInstants(step, instant);
  }
  AddToParameters();
  for (const FreeStart::Rate& rate : forward_.motion.start().rates()) {
    parameters_[Index(rate.parameter)] +=
        pullback_.adjoint[Index(free_ + forward_.robot.FreeIndexOf(rate.dof))];
  }
  for (int lane = 0; lane < Lanes::kCount; ++lane) {
    const int output = pullback_.lanes[Index(lane)].output;
    if (output < 0) continue;
    for (int k = 0; k < parameters; ++k)
      gradient[Index(output * parameters + k)] = parameters_[Index(k)][lane];
    if (forward_.motion.duration().is_free() && output > 0) {
      gradient[Index((output + 1) * parameters - 1)] +=
          forward_.maxima.by_step_length(Index(output - 1));
    }
  }
}

/// Adds the derivatives of the cost in the instants before `end` at which this step begins.
template <class Space>
void Adjoint<Space>::AddInstants(int step, std::size_t& end) {
  for (; end > 0 && forward_.table.step_at[end - 1] == step; --end) {
    if (has_cost()) AddInstant(end - 1);
  }
}

template <class Space>
void Adjoint<Space>::AddInstant(std::size_t instant) {
  const CostPoint here = forward_.InstantAt(instant);
  const CostInstant& when = forward_.motion.instants()[instant];
  if (!when.held) CollectPathsAt(forward_.PointOf(instant));
  const FreeStart& start = forward_.motion.start();
  forward_.outputs.ForEachTermAt(when, [&](std::size_t i, const CostTerm& term) {
    const auto slopes = MotionOutputs::SlopesOf<Space>(term, here);
    AddStateSlopes(slopes.by_q, slopes.by_qd, !when.held, pullback_.adjoint);
    if (!term.draws()) return;
    for (std::size_t r = 0; r < start.rates().size(); ++r) {
      parameters_[Index(start.rates()[r].parameter)].Add(
          0, slopes.by_target * start.TargetSlope(i, r));
    }
  });
}

/// Multiplies a row of MotionRecord::dynamics, and moves on to the next.
template <class Space>
inline typename Adjoint<Space>::Lanes Adjoint<Space>::RowTimes(const double*& row,
                                                               const Entries& entries,
                                                               const Column& v) {
  Lanes sum = *row++ * v[0];
  for (int i = 1; i < entries.first; ++i) sum += *row++ * v[Index(i)];
  if constexpr (MotionRecord<Space>::kSparse) {
    for (int i = entries.begin; i < entries.end; ++i) sum += *row++ * v[Index(i)];
  }
  return sum;
}

/// Computes y_bar of a stage from the adjoint of its step and y_bar of the stages after it.
template <class Space>
template <const Tableau& kScheme>
void Adjoint<Space>::PullBackStage(int step, int s) {
  constexpr int kStages = static_cast<int>(kScheme.own_stages());
  const Timetable& table = forward_.table;
  const MotionRecord<Space>& record = forward_.record;
  const std::size_t stage = table.StageOf(step, s);
  const double h = table.length[Index(step)];
  StateBar k_bar;
  const double b = h * kScheme.b[Index(s)];
  for (int i = 0; i < 2 * free_; ++i) k_bar[Index(i)] = b * pullback_.adjoint[Index(i)];
  const int last = kScheme.chained() ? std::min(s + 2, kStages) : kStages;
  for (int r = s + 1; r < last; ++r) {
    const double a = h * kScheme.a[Index(r)][Index(s)];
    for (int i = 0; i < 2 * free_; ++i) k_bar[Index(i)] += a * pullback_.y_bar[Index(r)][Index(i)];
  }
  const double growth = table.GrowthOf(step, forward_.motion.duration());
  if (growth != 0) AddStretch(stage, growth, b, k_bar);
  StateBar& y_bar = pullback_.y_bar[Index(s)];
  const double* row = record.dynamics(stage);
  Column r, w;  // the cotangents of g's outputs, and R^T r
  for (int i = 0; i < free_; ++i) r[Index(i)] = k_bar[Index(free_ + i)];
  // The integrals of the cost also depend on the stage directly.
  std::array<double, kMaxJoints> by_torque{};
  typename Dynamics::Numbers by_q, by_qd;
  const bool by_state = record.integrates_state() && has_cost();
  if (by_state) {
    by_q.fill(0), by_qd.fill(0);
    if (record.integrates_slip())
      record.AddSlipSlopes(stage, forward_.slip_weight * b, by_q, by_qd);
  }
  if (has_cost()) {
    const CostPoint there = record.At(stage);
    for (const auto& term : forward_.running)
      term.AddSlopes(term.weight * b, there, {by_q, by_qd, by_torque});
  }
  for (int j = 0; j < joints_; ++j) {
    r[Index(free_ + j)] = Lanes::Zero();
    r[Index(free_ + j)].Add(0, by_torque[Index(j)]);
  }
  for (int i = 0; i < Lanes::kCount; ++i) {
    const auto& [output, joint, limit] = pullback_.lanes[Index(i)];
    if (joint >= 0) r[Index(free_ + joint)].Add(i, forward_.maxima.by_torque(stage, joint) / limit);
  }
  for (int i = 0; i < free_; ++i) w[Index(i)] = RowTimes(row, {dofs_, 0, 0}, r);
  for (int j = 0; j < joints_; ++j) w[Index(free_ + j)] = r[Index(free_ + j)];
  for (int i = 0; i < free_; ++i) {
    const Entries& entries = record.entries(i);
    y_bar[Index(i)] = RowTimes(row, entries, w);
    y_bar[Index(free_ + i)] = k_bar[Index(i)] + RowTimes(row, entries, w);
  }
  const int deep = pullback_.penetration_lane;
  const double by_penetration = deep >= 0 ? forward_.maxima.by_penetration(stage) : 0;
  const double* const by_position =
      by_penetration != 0 ? record.penetration_slopes(stage) : nullptr;
  for (int i = 0; by_position != nullptr && i < free_; ++i)
    y_bar[Index(i)].Add(deep, by_penetration * by_position[i]);
  const bool moving = step < table.motion_steps;
  // Stages at the same time have the same weights, so the cotangents of their paths are summed
  // first.
  if (moving) CollectPathsAt(table.PointOf(step, s));
  for (int j = 0; moving && j < joints_; ++j) {
    auto& path = pullback_.paths[Index(j)];
    const Entries& entries = record.entries(free_ + j);
    path[0] += RowTimes(row, entries, w);
    path[1] += RowTimes(row, entries, w);
    path[2] += RowTimes(row, entries, MotionRecord<Space>::kSparse ? w : r);
    if (by_position != nullptr) path[0].Add(deep, by_penetration * by_position[free_ + j]);
  }
  if (moving) AddCurveSlopes(stage);
  if (by_state) AddStateSlopes(by_q, by_qd, moving, y_bar);
}

/// Adds what a stage's share in its step has as derivative by the duration, as the step grows.
/// @param b      weight of the stage in the integrals.
/// @param k_bar  cotangent of the state's slope.
template <class Space>
void Adjoint<Space>::AddStretch(std::size_t stage, double growth, double b, const StateBar& k_bar) {
  const double* const slope = forward_.record.state_slope(stage);
  Lanes sum = Lanes::Zero();
  for (int i = 0; i < 2 * free_; ++i) sum += slope[i] * k_bar[Index(i)];
  if (has_cost()) {
    const CostPoint there = forward_.record.At(stage);
    for (const auto& term : forward_.running)
      sum.Add(0, term.weight * term.Accumulate(0, b, there));
    if (forward_.record.integrates_slip())
      sum.Add(0, forward_.slip_weight * b * forward_.record.slip(stage));
  }
  parameters_.back() += growth * sum;
}

/// Adds the derivatives of torque-speed curves in the joints' velocities at a stage.
template <class Space>
void Adjoint<Space>::AddCurveSlopes(std::size_t stage) {
  const std::span<const int> curved = forward_.outputs.curved();
  for (std::size_t c = 0; c < curved.size(); ++c) {
    const int j = curved[c];
    const double by_velocity = forward_.motion.joint(j).motor.curve_by_velocity();
    for (int i = 0; i < Lanes::kCount; ++i) {
      if (pullback_.lanes[Index(i)].joint != j) continue;
      pullback_.paths[Index(j)][1].Add(i, by_velocity * forward_.maxima.by_curve(stage, c));
    }
  }
}

/// From here on, cotangents of the paths are those at this point.
template <class Space>
void Adjoint<Space>::CollectPathsAt(int point) {
  if (point == pullback_.point) return;
  AddToParameters();
  pullback_.point = point;
}

/// Adds derivatives of the cost in positions and velocities of a stage or an instant.
template <class Space>
void Adjoint<Space>::AddStateSlopes(const typename Dynamics::Numbers& by_q,
                                    const typename Dynamics::Numbers& by_qd, bool moving,
                                    StateBar& y_bar) {
  for (int i = 0; i < free_; ++i) {
    const std::size_t dof = Index(forward_.robot.free[Index(i)]);
    y_bar[Index(i)].Add(0, by_q[dof]);
    y_bar[Index(free_ + i)].Add(0, by_qd[dof]);
  }
  for (int j = 0; moving && j < joints_; ++j) {
    const std::size_t dof = Index(forward_.motion.joint(j).dof);
    pullback_.paths[Index(j)][0].Add(0, by_q[dof]);
    pullback_.paths[Index(j)][1].Add(0, by_qd[dof]);
  }
}

/// Adds the cotangents of the paths to those of the parameters, and clears them.
template <class Space>
void Adjoint<Space>::AddToParameters() {
  for (int j = 0; j < joints_; ++j) {
    auto& bar = pullback_.paths[Index(j)];
    forward_.paths.AddToParameters(pullback_.point, j, bar, parameters_);
    bar.fill(Lanes::Zero());
  }
}

template class Adjoint<Plane>;
template class Adjoint<Spatial>;

}  // namespace tumbler
