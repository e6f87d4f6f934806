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

/// A constraint that is active.
struct Active {
  std::string name;
  Eigen::VectorXd gradient;
  double multiplier = 0;
};

/// Name of an actuated joint.
const std::string& JointName(const Problem& problem, std::size_t joint) {
  return problem.scene.robot.tree.dofs[static_cast<std::size_t>(problem.joints[joint].dof)].name;
}

/// Those at x.
std::vector<Active> FindActive(const Problem& problem, const std::vector<LinearRow>& rows,
                               std::span<const double> x, const RolloutResult& result,
                               const OutputGradients& outputs) {
  const Eigen::Index n = static_cast<Eigen::Index>(x.size());
  std::vector<Active> active;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const std::size_t joint = problem.joint_of_parameter(static_cast<int>(i));
    const JointLimits<double>& limits = problem.joints[joint].limits;
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(n, static_cast<Eigen::Index>(i));
    const std::string name = "position of " + JointName(problem, joint);
    if (x[i] > limits.position_max_rad - kActive) active.push_back({name, unit});
    if (x[i] < limits.position_min_rad + kActive) active.push_back({name, -unit});
  }
  for (const LinearRow& row : rows) {
    if (row.b + std::inner_product(row.a.begin(), row.a.end(), x.begin(), 0.0) > -kActive)
      active.push_back({row.name, Eigen::Map<const Eigen::VectorXd>(row.a.data(), n)});
  }
  const auto consider = [&](double value, const std::string& name, Eigen::Index output) {
    if (value > -kActive) active.push_back({name, outputs.row(output).transpose()});
  };
  for (std::size_t j = 0; j < result.torque_excess.size(); ++j) {
    consider(result.torque_excess[j] + problem.solver.torque_margin,
             "torque of " + JointName(problem, j), static_cast<Eigen::Index>(j + 1));
  }
  consider(result.core_excess, "penetration", outputs.rows() - 2);
  consider(result.clearance_excess, "clearance of own shapes", outputs.rows() - 1);
  return active;
}

/// What is left of the gradient with least-squares multipliers. Constraints with negative ones are
/// dropped from `active`, and the others are solved again.
Eigen::VectorXd Residual(const Eigen::VectorXd& g, std::vector<Active>& active) {
  while (!active.empty()) {
    Eigen::MatrixXd A(g.size(), static_cast<Eigen::Index>(active.size()));
    for (std::size_t i = 0; i < active.size(); ++i)
      A.col(static_cast<Eigen::Index>(i)) = active[i].gradient;
    const Eigen::VectorXd lambda = SolveLeastSquares(A, -g);
    Eigen::Index lowest = 0;
    if (lambda.minCoeff(&lowest) >= 0) {
      for (std::size_t i = 0; i < active.size(); ++i)
        active[i].multiplier = lambda[static_cast<Eigen::Index>(i)];
      return g + A * lambda;
    }
    active.erase(active.begin() + lowest);
  }
  return g;
}

/// KktResidual::relative.
double RelativeSize(const Eigen::VectorXd& left, const std::vector<Active>& active,
                    const GaussNewton& model) {
  const double squares = model.squares + kNegligibleResidual * kNegligibleResidual;
  double largest = 0;
  for (Eigen::Index i = 0; i < left.size(); ++i) {
    if (left[i] == 0) continue;
    // By Cauchy and Schwarz, no less than the gradient of the squares.
    double parts = std::sqrt(2 * squares * model.matrix(i, i)) + std::abs(model.linear[i]);
    for (const Active& a : active) parts += a.multiplier * std::abs(a.gradient[i]);
    largest = std::max(largest, std::abs(left[i]) / parts);
  }
  return largest;
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
  for (const LinearRow& row : rows) {
    consider(row.b + std::inner_product(row.a.begin(), row.a.end(), x.begin(), 0.0),
             [&] { return row.name; });
  }
  for (std::size_t j = 0; j < result.torque_excess.size(); ++j) {
    consider(result.torque_excess[j] + kKeptMargin * problem.solver.torque_margin,
             [&] { return "torque of " + JointName(problem, j); });
  }
  const double core_margin = problem.solver.core_margin;
  consider(result.core_excess - (1 - kKeptMargin) * core_margin / (1 - core_margin),
           [] { return std::string("penetration"); });
  consider(result.clearance_excess, [] { return std::string("clearance of own shapes"); });
  for (std::size_t j = 0, i = 0; j < problem.joints.size(); ++j) {
    const JointLimits<double>& limits = problem.joints[j].limits;
    for (int k = 0; k < problem.joints[j].free_points(); ++k, ++i) {
      consider(std::max(x[i] - limits.position_max_rad, limits.position_min_rad - x[i]),
               [&] { return "position of " + JointName(problem, j); });
    }
  }
  return worst;
}

double LargestViolation(const Problem& problem, const std::vector<LinearRow>& rows,
                        std::span<const double> x, const RolloutResult& result) {
  return FindWorst(problem, rows, x, result).value;
}

KktResidual FindKktResidual(const Problem& problem, const std::vector<LinearRow>& rows,
                            std::span<const double> x, const RolloutResult& result,
                            const OutputGradients& outputs, const GaussNewton* model) {
  std::vector<Active> active = FindActive(problem, rows, x, result, outputs);
  const Eigen::VectorXd left = Residual(outputs.row(0).transpose(), active);
  KktResidual residual;
  if (left.size() > 0) residual.absolute = left.lpNorm<Eigen::Infinity>();
  if (model != nullptr) residual.relative = RelativeSize(left, active, *model);
  for (const Active& a : active) {
    if (a.multiplier > 0) residual.multipliers.push_back({a.name, a.multiplier});
  }
  std::stable_sort(residual.multipliers.begin(), residual.multipliers.end(),
                   [](const Multiplier& a, const Multiplier& b) { return a.value > b.value; });
  return residual;
}

}  // namespace tumbler
