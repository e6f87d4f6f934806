#include "offline/problem/free_start.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "common/core/index.h"

namespace tumbler {
namespace {

/// The start as the cost sees it.
CostPoint StartOf(const Problem& problem, const std::vector<double>& qd) {
  const SpaceMatrix* const axes = problem.space ? &problem.space->start_orientation : nullptr;
  return {problem.start_q, qd, {}, axes};
}

/// Velocities of all degrees of freedom at the start. Passive joints are at rest there.
std::vector<double> StartRates(const Problem& problem) {
  std::vector<double> qd(problem.start_q.size());
  if (problem.scene.robot.root_dofs > 0) std::ranges::copy(problem.start_root_rates, qd.begin());
  for (const ActuatedJoint& joint : problem.joints) qd[Index(joint.dof)] = joint.start_rad_s;
  return qd;
}

}  // namespace

void SetTargetsFromStart(Problem& problem) {
  const std::vector<double> qd = StartRates(problem);
  for (CostTerm& term : problem.cost) {
    if (term.from_start) term.target = term.target_from_start + term.Value(StartOf(problem, qd));
    if (term.targets_pitch() && term.weight > 0) problem.target_pitch_rad = term.target;
  }
}

FreeStart::FreeStart(const Problem& problem) {
  int parameter = problem.first_start_rate();
  for (const std::size_t coordinate : problem.free_start_coordinates())
    rates_.push_back({static_cast<int>(coordinate), parameter++});
  if (rates_.empty()) return;
  const std::vector<double> qd = StartRates(problem);
  for (const CostTerm& term : problem.cost) {
    std::vector<double> by_q(qd.size()), by_qd(qd.size());
    if (term.from_start) term.AddValueSlopes(1, StartOf(problem, qd), {by_q, by_qd, {}});
    for (const Rate& rate : rates_) target_slopes_.push_back(by_qd[Index(rate.dof)]);
  }
}

void FreeStart::Set(Problem& problem, std::span<const double> x) const {
  if (rates_.empty()) return;
  for (const Rate& rate : rates_)
    problem.start_root_rates[Index(rate.dof)] = x[Index(rate.parameter)];
  SetTargetsFromStart(problem);
}

}  // namespace tumbler
