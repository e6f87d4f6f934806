#include "offline/solve/lane_sensitivity.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "common/core/index.h"

namespace tumbler {

LaneSensitivity::LaneSensitivity(const Problem& problem, LaneRollout rollout)
    : parameters_(problem.parameter_count()),
      outputs_(OutputRows(static_cast<int>(problem.joints.size())).count()),
      joints_(problem.joints.size()),
      rollout_(std::move(rollout)) {}
LaneSensitivity::LaneSensitivity(const Problem& problem, double step_s)
    : LaneSensitivity(problem, LaneRollout(problem, step_s, LanePlan::Scheme::kRungeKutta)) {}
LaneSensitivity::LaneSensitivity(const Problem& problem, const StepGrid& grid)
    : LaneSensitivity(problem, LaneRollout(problem, grid)) {}

RolloutResult LaneSensitivity::Run(std::span<const double> x, std::span<double> gradient,
                                   GaussNewton* gauss_newton) {
  const std::size_t n = Index(parameters_);
  std::ranges::fill(gradient, 0.0);
  if (gauss_newton != nullptr) {
    gauss_newton->matrix.setZero(parameters_, parameters_);
    gauss_newton->residual_slopes.resize(0, parameters_);
    gauss_newton->linear.setZero(parameters_);
    gauss_newton->squares = 0;
  }
  RolloutResult here;
  double squares = 0;
  const std::size_t clearance_row = Index(outputs_ - 1);
  // The motion has the first lane of the first packet.
  for (std::size_t first = 0; first <= n; first += Packet::kLanes) {
    const std::size_t count = std::min(Packet::kLanes, n + 1 - first);
    x_.assign(count, {x.begin(), x.end()});
    for (std::size_t lane = 0; lane < count; ++lane) {
      if (first + lane > 0) x_[lane][first + lane - 1] += kDifference_rad;
    }
    const std::vector<RolloutResult> results = rollout_.Run(x_, LaneRollout::Wanted::kSimulated);
    if (first == 0) {
      here = results.front();
      squares = rollout_.squares(0);
    }
    if (!std::ranges::all_of(results, &RolloutResult::finite)) {
      here.finite = false;
      here.cost = std::numeric_limits<double>::infinity();
      std::ranges::fill(gradient, 0.0);
      return here;
    }
    if (gauss_newton != nullptr) {
      gauss_newton->residual_slopes.conservativeResize(
          static_cast<Eigen::Index>(here.residuals.size()), parameters_);
      AddEffort(first, count);
    }
    for (std::size_t lane = 0; lane < count; ++lane) {
      if (first + lane == 0) continue;
      const std::size_t p = first + lane - 1;
      const auto column = static_cast<Eigen::Index>(p);
      const RolloutResult& there = results[lane];
      const double step = x_[lane][p] - x[p];
      gradient[p] = (there.cost - here.cost) / step;
      for (std::size_t j = 0; j < here.torque_excess.size(); ++j)
        gradient[(1 + j) * n + p] = (there.torque_excess[j] - here.torque_excess[j]) / step;
      gradient[(clearance_row - 1) * n + p] =
          (there.penetration_excess - here.penetration_excess) / step;
      if (gauss_newton == nullptr) continue;
      for (std::size_t i = 0; i < here.residuals.size(); ++i) {
        gauss_newton->residual_slopes(static_cast<Eigen::Index>(i), column) =
            (there.residuals[i] - here.residuals[i]) / step;
      }
      gauss_newton->linear[column] =
          ((there.cost - rollout_.squares(lane)) - (here.cost - squares)) / step;
    }
  }
  here.clearance_excess = rollout_.ClearanceExcess(x, gradient.subspan(clearance_row * n, n));
  if (gauss_newton == nullptr) return here;
  gauss_newton->squares = squares;
  if (rollout_.effort_weight() > 0) {
    const std::span<const double> steps = rollout_.steps();
    for (std::size_t k = 0; k < steps.size(); ++k) {
      // The time that the start of a step stands for.
      const double time_s = 0.5 * (steps[k] + (k > 0 ? steps[k - 1] : 0));
      const double weight = 2 * rollout_.effort_weight() * time_s;
      for (std::size_t j = 0; j < joints_; ++j) {
        const double* const slope = torque_slope_.data() + (k * joints_ + j) * n;
        for (std::size_t a = 0; a < n; ++a) {
          double* const row = gauss_newton->matrix.data() + a * n;
          const double scaled = weight * slope[a];
          for (std::size_t b = a; b < n; ++b) row[b] += scaled * slope[b];
        }
      }
    }
    for (Eigen::Index a = 0; a < parameters_; ++a) {
      for (Eigen::Index b = 0; b < a; ++b) gauss_newton->matrix(b, a) = gauss_newton->matrix(a, b);
    }
  }
  gauss_newton->matrix +=
      2 * gauss_newton->residual_slopes.transpose() * gauss_newton->residual_slopes;
  return here;
}

/// Takes the differences of the torques of a packet's motions, if effort counts.
void LaneSensitivity::AddEffort(std::size_t first, std::size_t count) {
  if (!(rollout_.effort_weight() > 0)) return;
  const std::size_t n = Index(parameters_), steps = rollout_.steps().size();
  torque_.resize(steps * joints_);
  torque_slope_.resize(torque_.size() * n);
  for (std::size_t k = 0; k < steps; ++k) {
    for (std::size_t j = 0; j < joints_; ++j) {
      const Packet& torque = rollout_.torque(k, j);
      const std::size_t at = k * joints_ + j;
      if (first == 0) torque_[at] = torque.lane(0);
      for (std::size_t lane = first == 0 ? 1 : 0; lane < count; ++lane) {
        torque_slope_[at * n + first + lane - 1] =
            (torque.lane(lane) - torque_[at]) / kDifference_rad;
      }
    }
  }
}

}  // namespace tumbler
