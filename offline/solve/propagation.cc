#include "offline/solve/propagation.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "common/core/index.h"
#include "offline/scene/stepper.h"
#include "offline/solve/rollout_result.h"

namespace tumbler {

Propagation::Propagation(const Problem& problem, double step_s,
                         std::unique_ptr<ContactForces<Plane>> contact)
    : motion(problem),
      robot(problem.scene, std::move(contact)),
      outputs(motion, step_s),
      longest_step_s(step_s),
      grid(EvenGrid(problem, step_s)),
      table(kClassical, grid, problem.duration_s, motion.instants()),
      paths(motion),
      record(motion, robot),
      maxima(motion, outputs, table, paths, record),
      instant_states(motion.instants().size()),
      clearance_gradient(Index(motion.parameters())) {
  for (const CostTerm& term : problem.cost) {
    if (term.when == CostTerm::When::kThroughout) running.push_back({term});
  }
  Resize();
}

/// Makes everything that depends on the timetable.
void Propagation::Resize() {
  paths.Tabulate(table);
  record.Resize(table);
  maxima.Resize();
}

void Propagation::Use(const StepGrid& new_grid) {
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
  table = Timetable(kDormandPrince, free ? duration.Stretched(grid) : grid, duration.duration_s(),
                    motion.instants());
  Resize();
}

bool Propagation::SetMotion(std::span<const double> x) {
  const double before_s = motion.duration_s();
  if (!motion.Set(x)) return false;
  if (motion.duration_s() != before_s) {
    table = Timetable(table.scheme(), motion.duration().Stretched(grid), motion.duration_s(),
                      motion.instants());
    Resize();
  }
  paths.Evaluate(x);
  return true;
}

RolloutResult Propagation::Run(std::span<const double> x, ForwardPass pass) {
  return table.classical ? RunScheme<kClassical>(x, pass) : RunScheme<kDormandPrince>(x, pass);
}

template <const Tableau& kScheme>
RolloutResult Propagation::RunScheme(std::span<const double> x, ForwardPass pass) {
  const bool with_record = pass == ForwardPass::kGradient;
  RolloutResult result = outputs.Begin();
  if (!SetMotion(x)) return MotionOutputs::Failed(std::move(result));
  if (with_record && motion.duration().is_free()) paths.EvaluateSlopes();
  result.clearance_excess = outputs.ClearanceExcess(
      x, with_record ? std::span<double>(clearance_gradient) : std::span<double>());
  if (with_record) record.PrepareDerivatives();
  SceneDynamics::State y = motion.StartState(robot);
  for (RunningTerm& term : running) term.integral = 0;
  std::size_t instant = 0;
  for (int step = 0; step < table.steps(); ++step) {
    AddInstants(step, y, instant, result);
    if (pass == ForwardPass::kEstimate) {
      StepByEuler(step, y, result);
    } else {
      StepByRungeKutta<kScheme>(step, with_record, y, result);
    }
    if (!IsPlausible(y)) return MotionOutputs::Failed(std::move(result));
  }
  AddInstants(table.steps(), y, instant, result);
  for (const RunningTerm& term : running) result.cost += term.weight * term.integral;
  maxima.Evaluate(pass, result);
  return result;
}

/// Adds the cost of all instants from `next` on at which this step begins.
void Propagation::AddInstants(int step, const SceneDynamics::State& y, std::size_t& next,
                              RolloutResult& result) {
  for (; next < instant_states.size() && table.step_at[next] == step; ++next) {
    instant_states[next] = y;
    const CostPoint here = InstantAt(next);
    outputs.ForEachTermAt(motion.instants()[next], [&](std::size_t, const CostTerm& term) {
      result.cost = term.Accumulate(result.cost, term.weight, here);
      MotionOutputs::RecordTarget(term, here, result);
    });
  }
}

template <const Tableau& kScheme>
void Propagation::StepByRungeKutta(int step, bool with_record, SceneDynamics::State& y,
                                   RolloutResult& result) {
  const double h = table.length[Index(step)];
  const std::size_t size = 2 * robot.free.size();
  StepRungeKutta<kScheme>(y, size, h, [&](int s, const SceneDynamics::State& y_s, double* k) {
    Evaluate(y_s, table.PointOf(step, s));
    robot.TakeSlope(k);
    const std::size_t stage = table.StageOf(step, s);
    AddRunning(h * kScheme.b[Index(s)], record.StoreTorques(stage));
    if (s == 0) outputs.RecordPeaks(robot, result);
    record.StorePenetration(stage, outputs.Penetration(robot));
    if (!with_record) return true;
    SceneDynamics::Numbers by_q{};
    outputs.AddPenetrationSlopes(robot, by_q);
    record.StorePenetrationSlopes(stage, by_q);
    record.StoreDerivatives(stage, k);
    return true;
  });
}

void Propagation::StepByEuler(int step, SceneDynamics::State& y, RolloutResult& result) {
  const double h = table.length[Index(step)];
  const std::size_t size = robot.free.size();
  StepSemiImplicitEuler(y, size, h, [&](int, const SceneDynamics::State& y_s, double* k) {
    Evaluate(y_s, table.PointOf(step, 0));
    robot.TakeSlope(k);
    const std::size_t stage = table.StageOf(step, 0);
    AddRunning(h, record.StoreTorques(stage));
    outputs.RecordPeaks(robot, result);
    record.StorePenetration(stage, outputs.Penetration(robot));
    return true;
  });
}

/// Adds a stage to the integrals, with weight dt.
void Propagation::AddRunning(double dt, const CostPoint& here) {
  for (RunningTerm& term : running) term.integral = term.Accumulate(term.integral, dt, here);
}

bool Propagation::IsPlausible(const SceneDynamics::State& y) const {
  for (std::size_t i = 0; i < 2 * robot.free.size(); ++i) {
    if (!(std::abs(y[i]) < kImplausibleState)) return false;  // NaN is implausible, too.
  }
  return true;
}

}  // namespace tumbler
