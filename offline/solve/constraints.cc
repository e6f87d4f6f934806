#include "offline/solve/constraints.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "common/core/index.h"
#include "common/files/spline_extent.h"
#include "offline/model/least_squares.h"
#include "offline/scene/self_clearance.h"
#include "offline/solve/free_paths.h"

namespace tumbler {
namespace {

/// A constraint counts as active within this distance of zero (scaled).
constexpr double kActive = 1e-5;

/// The solver aims at the whole margins of torque and penetration. A motion that keeps this part of
/// them keeps its limits: where steps are chosen anew, peaks move by a little.
constexpr double kKeptMargin = 0.5;

/// Into how many parts each span of a path is cut for the limits of its derivatives. What bounds
/// the control points bounds the path, but an optimum's own control points are up to twice as far
/// out. The distance falls by the square of the parts.
constexpr int kParts = 8;

/// A constraint that is active.
struct Active {
  std::string name;
  Eigen::VectorXd gradient;
  double unit = 1;  // of Multiplier, in the constraint's own
  double multiplier = 0;
};

/// Name of an actuated joint.
const std::string& JointName(const Problem& problem, std::size_t joint) {
  return problem.joint_name(joint);
}

/// Name of the limits of a parameter.
std::string ParameterName(const Problem& problem, int parameter) {
  if (problem.is_duration(parameter)) return "duration";
  if (const auto coordinate = problem.start_coordinate_of(parameter)) {
    constexpr std::array kNames = {"x", "z", "pitch"};
    return std::string("velocity of ") + kNames[*coordinate] + " at the start";
  }
  return "position of " + JointName(problem, problem.joint_of_parameter(parameter));
}

/// A gradient by what is free of the paths.
Eigen::VectorXd ByWhatIsFree(const FreePaths& paths, std::span<const double> by_x) {
  const std::vector<double> by_y = paths.ReduceSlopes(by_x);
  return Eigen::Map<const Eigen::VectorXd>(by_y.data(), static_cast<Eigen::Index>(by_y.size()));
}

/// Those at x, with their gradients by what is free of the paths. Of tied joints, what says the
/// same of several is there once.
std::vector<Active> FindActive(const Problem& problem, const FreePaths& paths,
                               const std::vector<LinearRow>& rows, std::span<const double> x,
                               const RolloutResult& result, const OutputGradients& slopes) {
  std::vector<Active> active;
  const auto add = [&](Active found) {
    const bool known = paths.any_tied() && std::ranges::any_of(active, [&](const Active& other) {
                         return other.gradient == found.gradient;
                       });
    if (!known) active.push_back(std::move(found));
  };
  std::vector<double> unit(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Interval<double> bounds = problem.bounds_of_parameter(static_cast<int>(i));
    const std::string name = ParameterName(problem, static_cast<int>(i));
    unit[i] = 1;
    if (x[i] > bounds.max - kActive) add({"upper " + name, ByWhatIsFree(paths, unit)});
    unit[i] = -1;
    if (x[i] < bounds.min + kActive) add({"lower " + name, ByWhatIsFree(paths, unit)});
    unit[i] = 0;
  }
  for (const LinearRow& row : rows) {
    if (!(row.Excess(x) > -kActive)) continue;
    add({row.name, ByWhatIsFree(paths, row.LinearAt(x).a)});
  }
  const auto consider = [&](double value, const std::string& name, Eigen::Index output,
                            double scale = 1) {
    if (value > -kActive) add({name, slopes.row(output).transpose(), scale});
  };
  for (std::size_t j = 0; j < result.torque_excess.size(); ++j) {
    consider(result.torque_excess[j] + problem.solver.torque_margin,
             "torque of " + JointName(problem, j), static_cast<Eigen::Index>(j + 1),
             1 - problem.solver.torque_margin);
  }
  consider(result.penetration_excess, "penetration", slopes.rows() - 2);
  consider(result.clearance_excess, "clearance of own shapes", slopes.rows() - 1,
           1e-3 / kClearanceScale_m);
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

double LinearRow::Excess(std::span<const double> x) const {
  const double value = b + std::inner_product(a.begin(), a.end(), x.begin(), 0.0);
  if (!of_free_duration) return value;
  double power = 1;
  for (int i = 0; i < derivative; ++i) power *= x.back();
  return value / power - 1;
}

LinearRow LinearRow::LinearAt(std::span<const double> x) const {
  LinearRow row = *this;
  if (!of_free_duration) return row;
  row.of_free_duration = false;
  const double s = x.back();
  row.a.back() -= derivative == 1 ? 1 : 2 * s;
  row.b += derivative == 1 ? 0 : s * s;
  return row;
}

std::vector<LinearRow> DerivativeLimitRows(const Problem& problem) {
  std::vector<LinearRow> rows;
  const std::size_t n = static_cast<std::size_t>(problem.parameter_count());
  const bool free_duration = problem.free_duration.has_value();
  std::vector<double> zero(n, 0.0);
  if (free_duration) zero.back() = 1;
  // Where the duration is free, so is what the ends' velocities add to the points beside them.
  Problem with_ends_at_rest = problem;
  for (ActuatedJoint& joint : with_ends_at_rest.joints) joint.start_rad_s = joint.end_rad_s = 0;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const JointLimits<double>& limits = problem.joints[j].limits;
    const auto first = static_cast<std::size_t>(problem.first_parameter(j));
    const auto free = static_cast<std::size_t>(problem.joints[j].free_points());
    const double limit[3] = {0, kInside * limits.velocity_max_rad_s,
                             kInside * limits.acceleration_max_rad_s2};
    const auto constant = PositionSpline(problem, zero, j);
    const auto at_rest = PositionSpline(with_ends_at_rest, zero, j);
    for (int d = 1; d <= 2; ++d) {
      if (!std::isfinite(limit[d])) continue;
      const std::vector<double> base =
          RefinedControlPoints(free_duration ? at_rest : constant, d, kParts);
      const std::vector<double> fixed = RefinedControlPoints(constant, d, kParts);
      const std::size_t points = fixed.size();
      std::vector<LinearRow> upper(points);
      for (std::size_t k = 0; k < points; ++k) {
        upper[k].name =
            std::string(d == 1 ? "velocity of " : "acceleration of ") + problem.joint_name(j);
        upper[k].a.assign(n, 0.0);
        upper[k].b = base[k] / limit[d];
        upper[k].derivative = d;
        upper[k].of_free_duration = free_duration;
      }
      for (std::size_t i = 0; i < free; ++i) {
        std::vector<double> unit = zero;
        unit[first + i] = 1;
        const std::vector<double> moved =
            RefinedControlPoints(PositionSpline(problem, unit, j), d, kParts);
        for (std::size_t k = 0; k < points; ++k)
          upper[k].a[first + i] = (moved[k] - fixed[k]) / limit[d];
      }
      for (LinearRow& row : upper) {
        // The ends fix this control point, so no parameter changes it.
        if (std::all_of(row.a.begin(), row.a.end(), [](double a) { return a == 0; })) continue;
        if (free_duration) {
          const auto k = static_cast<std::size_t>(&row - upper.data());
          row.a.back() = (fixed[k] - base[k]) / limit[d];
        }
        const double right = free_duration ? 0 : 1;  // where it is a number
        LinearRow lower = row;
        for (double& a : lower.a) a = -a;
        lower.b = -row.b - right;
        rows.push_back(row);
        rows.back().b -= right;
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
  values.push_back(result.penetration_excess);
  if (!problem.self_contact().pairs.empty()) values.push_back(result.clearance_excess);
  return values;
}

WorstConstraint FindWorst(const Problem& problem, const std::vector<LinearRow>& rows,
                          std::span<const double> x, const RolloutResult& result) {
  WorstConstraint worst;
  const auto consider = [&worst](double value, const auto& name) {
    if (value > worst.value) worst = {value, name()};
  };
  for (const LinearRow& row : rows) {
    consider(row.Excess(x), [&] { return row.name; });
  }
  for (std::size_t j = 0; j < result.torque_excess.size(); ++j) {
    consider(result.torque_excess[j] + kKeptMargin * problem.solver.torque_margin,
             [&] { return "torque of " + JointName(problem, j); });
  }
  const double core_margin = problem.solver.core_margin;
  consider(result.penetration_excess - (1 - kKeptMargin) * core_margin / (1 - core_margin),
           [] { return std::string("penetration"); });
  consider(result.clearance_excess, [] { return std::string("clearance of own shapes"); });
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Interval<double> bounds = problem.bounds_of_parameter(static_cast<int>(i));
    consider(std::max(x[i] - bounds.max, bounds.min - x[i]),
             [&] { return ParameterName(problem, static_cast<int>(i)); });
  }
  return worst;
}

double LargestViolation(const Problem& problem, const std::vector<LinearRow>& rows,
                        std::span<const double> x, const RolloutResult& result) {
  return FindWorst(problem, rows, x, result).value;
}

KktResidual FindKktResidual(const Problem& problem, const FreePaths& paths,
                            const std::vector<LinearRow>& rows, std::span<const double> x,
                            const RolloutResult& result, const OutputGradients& slopes,
                            const GaussNewton* model) {
  std::vector<Active> active = FindActive(problem, paths, rows, x, result, slopes);
  const Eigen::VectorXd left = Residual(slopes.row(0).transpose(), active);
  KktResidual residual;
  if (left.size() > 0) residual.absolute = left.lpNorm<Eigen::Infinity>();
  if (model != nullptr) residual.relative = RelativeSize(left, active, *model);
  for (const Active& a : active) {
    if (a.multiplier > 0) residual.multipliers.push_back({a.name, a.multiplier * a.unit});
  }
  std::stable_sort(residual.multipliers.begin(), residual.multipliers.end(),
                   [](const Multiplier& a, const Multiplier& b) { return a.value > b.value; });
  return residual;
}

}  // namespace tumbler
