#include "offline/solve/propagation.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "common/core/index.h"
#include "offline/scene/stepper.h"
#include "offline/solve/rollout_result.h"
#include "offline/solve/start_state.h"

namespace tumbler {

template <class Space>
Propagation<Space>::Propagation(const Problem& problem, double step_s,
                                std::unique_ptr<ContactForces<Space>> contact)
    : motion(problem),
      robot(SceneIn<Space>(problem), std::move(contact)),
      outputs(motion, step_s),
      longest_step_s(step_s),
      grid(EvenGrid(problem, step_s)),
      table(kClassical, grid, problem.duration_s, motion.instants()),
      paths(motion),
      record(motion, robot),
      maxima(motion, outputs, table, paths, record.values()),
      instant_states(motion.instants().size()),
      instant_charts(motion.instants().size()),
      slip_weight(CostTerm::SlipWeight(problem.cost)),
      clearance_gradient(Index(motion.parameters())) {
  for (const CostTerm& term : problem.cost) {
    if (term.when == CostTerm::When::kThroughout && term.kind != CostTerm::Kind::kSlip)
      running.push_back({term});
  }
}

template <class Space>
void Propagation<Space>::Take(Timetable&& new_table) {
  table = std::move(new_table);
  tabulated_ = has_room_ = false;
}

/// Makes room for what the steps of the timetable leave behind.
template <class Space>
void Propagation<Space>::MakeRoom() {
  if (has_room_) return;
  has_room_ = true;
  record.Resize(table);
  maxima.Resize();
  if constexpr (RootChart<Space>::kMoves) turns.resize(Index(table.steps()));
}

template <class Space>
void Propagation<Space>::Use(const StepGrid& new_grid) {
  const FreeDuration& duration = motion.duration();
  const double motion_s = std::accumulate(new_grid.motion.begin(), new_grid.motion.end(), 0.0);
  const double settling_s =
      std::accumulate(new_grid.settling.begin(), new_grid.settling.end(), 0.0);
  const auto same = [](double sum_s, double span_s) {
    return std::abs(sum_s - span_s) <= 1e-9 * (1 + span_s);
  };
  const bool free = duration.is_free();
  if (!(free ? motion_s > duration.stretched_from_s()
             : same(motion_s, motion.problem().duration_s)) ||
      !same(settling_s, motion.problem().settle_s))
    throw std::invalid_argument("the steps do not add up to motion and settle phase");
  grid = new_grid;
  Take(Timetable(kDormandPrince, free ? duration.Stretched(grid) : grid, duration.duration_s(),
                 motion.instants()));
}

template <class Space>
bool Propagation<Space>::SetMotion(std::span<const double> x) {
  const double before_s = motion.duration_s();
  if (!motion.Set(x)) return false;
  if (motion.duration_s() != before_s) {
    Take(Timetable(table.scheme(), motion.duration().Stretched(grid), motion.duration_s(),
                   motion.instants()));
  }
  if (!tabulated_) paths.Tabulate(table);
  tabulated_ = true;
  paths.Evaluate(x);
  return true;
}

template <class Space>
RolloutResult Propagation<Space>::Run(std::span<const double> x, ForwardPass pass) {
  return table.classical ? RunScheme<kClassical>(x, pass) : RunScheme<kDormandPrince>(x, pass);
}

template <class Space>
template <const Tableau& kScheme>
RolloutResult Propagation<Space>::RunScheme(std::span<const double> x, ForwardPass pass) {
  const bool with_record = pass == ForwardPass::kGradient;
  RolloutResult result = outputs.Begin();
  if (!SetMotion(x)) return MotionOutputs::Failed(std::move(result));
  MakeRoom();
  if (with_record && motion.duration().is_free()) paths.EvaluateSlopes();
  result.clearance_excess = outputs.ClearanceExcess(
      x, with_record ? std::span<double>(clearance_gradient) : std::span<double>());
  if (with_record) record.PrepareDerivatives();
  State y = StartState(robot, motion.problem());
  RootChart<Space> chart = StartChart<Space>(motion.problem());
  robot.Use(chart);
  for (RunningTerm& term : running) term.integral = 0;
  slip_integral = 0;
  std::size_t instant = 0;
  for (int step = 0; step < table.steps(); ++step) {
    AddInstants(step, y, chart, instant, result);
    if (pass == ForwardPass::kEstimate) {
      StepByEuler(step, y, result);
    } else {
      StepByRungeKutta<kScheme>(step, with_record, y, result);
    }
    if (!IsPlausible(y)) return MotionOutputs::Failed(std::move(result));
    if constexpr (RootChart<Space>::kMoves) turns[Index(step)] = MoveOn(chart, y);
  }
  AddInstants(table.steps(), y, chart, instant, result);
  for (const RunningTerm& term : running) result.cost += term.weight * term.integral;
  if (slip_weight != 0) result.cost += slip_weight * slip_integral;
  maxima.Evaluate(pass, result);
  return result;
}

/// Adds the cost of all instants from `next` on at which this step begins.
template <class Space>
void Propagation<Space>::AddInstants(int step, const State& y, const RootChart<Space>& chart,
                                     std::size_t& next, RolloutResult& result) {
  for (; next < instant_states.size() && table.step_at[next] == step; ++next) {
    instant_states[next] = y;
    instant_charts[next] = chart;
    const CostPoint here = InstantAt(next);
    outputs.ForEachTermAt(motion.instants()[next], [&](std::size_t, const CostTerm& term) {
      result.cost = term.Accumulate(result.cost, term.weight, here);
      MotionOutputs::RecordTarget(term, here, result);
    });
  }
}

template <class Space>
template <const Tableau& kScheme>
void Propagation<Space>::StepByRungeKutta(int step, bool with_record, State& y,
                                          RolloutResult& result) {
  const double h = table.length[Index(step)];
  const std::size_t size = 2 * robot.free.size();
  StepRungeKutta<kScheme>(y, size, h, [&](int s, const State& y_s, double* k) {
    Evaluate(y_s, table.PointOf(step, s));
    robot.TakeSlope(k);
    const std::size_t stage = table.StageOf(step, s);
    const double dt = h * kScheme.b[Index(s)];
    AddRunning(dt, record.StoreTorques(stage));
    if (record.integrates_slip()) slip_integral += dt * record.StoreSlip(stage);
    if (s == 0) outputs.RecordPeaks(robot, result);
    record.StorePenetration(stage, outputs.Penetration(robot));
    if (!with_record) return true;
    typename Dynamics::Numbers by_q{};
    outputs.AddPenetrationSlopes(robot, by_q);
    record.StorePenetrationSlopes(stage, by_q);
    record.StoreDerivatives(stage, k);
    return true;
  });
}

template <class Space>
void Propagation<Space>::StepByEuler(int step, State& y, RolloutResult& result) {
  const double h = table.length[Index(step)];
  const std::size_t size = robot.free.size();
  StepSemiImplicitEuler(y, size, h, [&](int, const State& y_s, double* k) {
    Evaluate(y_s, table.PointOf(step, 0));
    robot.TakeSlope(k);
    const std::size_t stage = table.StageOf(step, 0);
    AddRunning(h, record.StoreTorques(stage));
    if (record.integrates_slip()) slip_integral += h * record.StoreSlip(stage);
    outputs.RecordPeaks(robot, result);
    record.StorePenetration(stage, outputs.Penetration(robot));
    return true;
  });
}

/// Adds a stage to the integrals, with weight dt.
template <class Space>
void Propagation<Space>::AddRunning(double dt, const CostPoint& here) {
  for (RunningTerm& term : running) term.integral = term.Accumulate(term.integral, dt, here);
}

template <class Space>
bool Propagation<Space>::IsPlausible(const State& y) const {
  for (std::size_t i = 0; i < 2 * robot.free.size(); ++i) {
    if (!(std::abs(y[i]) < kImplausibleState)) return false;  // NaN is implausible, too.
  }
  return true;
}

template struct Propagation<Plane>;
template struct Propagation<Spatial>;

}  // namespace tumbler
