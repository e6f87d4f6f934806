#include "offline/solver/constraints.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/index.h"
#include "offline/linear/least_squares.h"

namespace tumbler {
namespace {

/// A constraint counts as active within this distance of zero (scaled).
constexpr double kActive = 1e-5;

/// The solver aims at the whole margins of torque and penetration. A motion that keeps this part of
/// them keeps its limits: where steps are chosen anew, peaks move by a little.
constexpr double kKeptMargin = 0.5;

/// The residual with least-squares multipliers. Constraints with negative ones are dropped, and the
/// others are solved again.
double Residual(const Eigen::VectorXd& g, std::vector<Eigen::VectorXd> active) {
  Eigen::VectorXd residual = g;
  while (!active.empty()) {
    Eigen::MatrixXd A(g.size(), static_cast<Eigen::Index>(active.size()));
    for (std::size_t i = 0; i < active.size(); ++i) A.col(static_cast<Eigen::Index>(i)) = active[i];
    const Eigen::VectorXd lambda = SolveLeastSquares(A, -g);
    Eigen::Index lowest = 0;
    if (lambda.minCoeff(&lowest) >= 0) {
      residual = g + A * lambda;
      break;
    }
    active.erase(active.begin() + lowest);
  }
  return residual.size() == 0 ? 0 : residual.lpNorm<Eigen::Infinity>();
}

}  // namespace

std::vector<LinearRow> DerivativeLimitRows(const Problem& problem) {
  std::vector<LinearRow> rows;
  const std::size_t n = static_cast<std::size_t>(problem.parameter_count());
  const std::vector<double> zero(n, 0.0);
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const JointLimits<double>& limits = problem.joints[j].limits;
    const auto first = static_cast<std::size_t>(problem.first_parameter(j));
    const auto free = static_cast<std::size_t>(problem.joints[j].free_points());
    const double limit[3] = {0, kInside * limits.velocity_max_rad_s,
                             kInside * limits.acceleration_max_rad_s2};
    const auto constant = PositionSpline(problem, zero, j);
    for (int d = 1; d <= 2; ++d) {
      if (!std::isfinite(limit[d])) continue;
      const std::size_t points = constant.control_points(d).size();
      std::vector<LinearRow> upper(points);
      for (std::size_t k = 0; k < points; ++k) {
        upper[k].name =
            std::string(d == 1 ? "velocity of " : "acceleration of ") +
            problem.scene.robot.tree.dofs[static_cast<std::size_t>(problem.joints[j].dof)].name;
        upper[k].a.assign(n, 0.0);
        upper[k].b = constant.control_points(d)[k] / limit[d];
        upper[k].derivative = d;
      }
      for (std::size_t i = 0; i < free; ++i) {
        std::vector<double> unit = zero;
        unit[first + i] = 1;
        const auto moved = PositionSpline(problem, unit, j);
        for (std::size_t k = 0; k < points; ++k) {
          upper[k].a[first + i] =
              (moved.control_points(d)[k] - constant.control_points(d)[k]) / limit[d];
        }
      }
      for (const LinearRow& row : upper) {
        // The ends fix this control point, so no parameter changes it.
        if (std::all_of(row.a.begin(), row.a.end(), [](double a) { return a == 0; })) continue;
        LinearRow lower = row;
        for (double& a : lower.a) a = -a;
        lower.b = -row.b - 1;
        rows.push_back(row);
        rows.back().b -= 1;
        rows.push_back(std::move(lower));
      }
    }
  }
  return rows;
}

std::vector<double> SimulatedConstraints(const Problem& problem, const RolloutResult& result) {
  std::vector<double> values;
  for (const double excess : result.torque_excess)
    values.push_back(excess + problem.solver.torque_margin);
  values.push_back(result.core_excess);
  if (!problem.scene.self_contact.pairs.empty()) values.push_back(result.clearance_excess);
  return values;
}

WorstConstraint FindWorst(const Problem& problem, const std::vector<LinearRow>& rows,
                          std::span<const double> x, const RolloutResult& result) {
  WorstConstraint worst;
  const auto consider = [&worst](double value, const auto& name) {
    if (value > worst.value) worst = {value, name()};
  };
  const auto joint_name = [&](std::size_t j) {
    return problem.scene.robot.tree.dofs[static_cast<std::size_t>(problem.joints[j].dof)].name;
  };
  for (const LinearRow& row : rows) {
    consider(row.b + std::inner_product(row.a.begin(), row.a.end(), x.begin(), 0.0),
             [&] { return row.name; });
  }
  for (std::size_t j = 0; j < result.torque_excess.size(); ++j) {
    consider(result.torque_excess[j] + kKeptMargin * problem.solver.torque_margin,
             [&] { return "torque of " + joint_name(j); });
  }
  const double core_margin = problem.solver.core_margin;
  consider(result.core_excess - (1 - kKeptMargin) * core_margin / (1 - core_margin),
           [] { return std::string("penetration"); });
  consider(result.clearance_excess, [] { return std::string("clearance of own shapes"); });
  for (std::size_t j = 0, i = 0; j < problem.joints.size(); ++j) {
    const JointLimits<double>& limits = problem.joints[j].limits;
    for (int k = 0; k < problem.joints[j].free_points(); ++k, ++i) {
      consider(std::max(x[i] - limits.position_max_rad, limits.position_min_rad - x[i]),
               [&] { return "position of " + joint_name(j); });
    }
  }
  return worst;
}

double LargestViolation(const Problem& problem, const std::vector<LinearRow>& rows,
                        std::span<const double> x, const RolloutResult& result) {
  return FindWorst(problem, rows, x, result).value;
}

double ProjectedGradient(const Problem& problem, const std::vector<LinearRow>& rows,
                         std::span<const double> x, const RolloutResult& result,
                         const Eigen::Ref<const OutputGradients>& outputs) {
  const Eigen::Index n = static_cast<Eigen::Index>(x.size());
  std::vector<Eigen::VectorXd> active;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const std::size_t joint = problem.joint_of_parameter(static_cast<int>(i));
    const JointLimits<double>& limits = problem.joints[joint].limits;
    const auto k = static_cast<Eigen::Index>(i);
    if (x[i] > limits.position_max_rad - kActive) active.emplace_back(Eigen::VectorXd::Unit(n, k));
    if (x[i] < limits.position_min_rad + kActive) active.emplace_back(-Eigen::VectorXd::Unit(n, k));
  }
  for (const LinearRow& row : rows) {
    if (row.b + std::inner_product(row.a.begin(), row.a.end(), x.begin(), 0.0) > -kActive) {
      active.emplace_back(Eigen::Map<const Eigen::VectorXd>(row.a.data(), n));
    }
  }
  for (std::size_t j = 0; j < result.torque_excess.size(); ++j) {
    if (result.torque_excess[j] > -problem.solver.torque_margin - kActive) {
      active.emplace_back(outputs.row(static_cast<Eigen::Index>(j + 1)).transpose());
    }
  }
  if (result.core_excess > -kActive)
    active.emplace_back(outputs.row(outputs.rows() - 2).transpose());
  if (result.clearance_excess > -kActive)
    active.emplace_back(outputs.row(outputs.rows() - 1).transpose());
  return Residual(outputs.row(0).transpose(), std::move(active));
}

}  // namespace tumbler
