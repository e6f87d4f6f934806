#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <nlopt.hpp>
#include <numeric>
#include <optional>

#include "offline/solve/constraints.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/solver.h"

namespace tumbler {
namespace {

/// A local solve has converged when what is left of the Kuhn-Tucker condition is below this part of
/// the cost's gradient, at its start or its end. Otherwise it only stopped making progress.
constexpr double kStationary = 1e-3;

/// Violations below this do not compete with the cost.
constexpr double kLeastViolation = 1e-7;

/// A box that gains nothing is not made smaller than a quarter of this.
constexpr double kSmallestBox_rad = 2e-3;

/// A value without what is below 2^-20 of a scale.
double RoundedTo(double value, double scale) {
  constexpr int kDigits = 20;
  int exponent = 0;
  if (!std::isfinite(value) || std::frexp(scale, &exponent) == 0) return value;
  return std::ldexp(std::round(std::ldexp(value, kDigits - exponent)), exponent - kDigits);
}

/// One SLSQP run, with NLopt's callbacks. Cost and constraints share one rollout for each point.
class LocalSolve {
 public:
  LocalSolve(const Problem& problem, int max_evaluations, Rollout& rollout,
             const SolveOptions& options, std::vector<Evaluation>* history, Digits digits,
             double box_rad)
      : digits_(digits),
        box_rad_(box_rad),
        problem_(problem),
        max_evaluations_(max_evaluations),
        rollout_(rollout),
        options_(options),
        history_(history),
        rows_(DerivativeLimitRows(problem)),
        paths_(problem),
        own_rows_(paths_.Reduce(rows_)),
        outputs_(OutputGradients::Zero(rollout.output_count(), rollout.parameter_count())) {}

  Solution Run(std::span<const double> start) {
    const std::vector<double> x = paths_.Expand(paths_.Reduce(start));
    Solution best;
    best.x = x;
    Evaluate(x, true);
    best.start_cost = result_.cost;
    if (!result_.finite) {
      best.rollout = result_;
      return best;
    }
    // |g| of order one half: a first step of SLSQP, which takes the Hessian for the identity, then
    // stays local.
    const double first_gradient = outputs_.row(0).lpNorm<Eigen::Infinity>();
    scale_ = 0.5 / std::max(first_gradient, 1e-3);
    best_violation_ = std::numeric_limits<double>::infinity();
    if (std::isfinite(box_rad_)) most_cost_ = 3 * std::abs(result_.cost);
    Remember();
    SolveEnd end = SolveEnd::kFailed;
    // SLSQP 2.7.1 can stop early or far from feasible: it is started again from the best point,
    // which also resets its Hessian, until that changes nothing.
    while (evaluations_ < max_evaluations_) {
      Evaluate(best_x_, true);
      best_cost_ = result_.cost;
      best_violation_ = std::max(LargestViolation(problem_, rows_, x_, result_), kLeastViolation);
      const double before = best_cost_ * scale_ + best_violation_;
      end = RunOnce(paths_.Reduce(best_x_));
      if (end == SolveEnd::kInterrupted || end == SolveEnd::kEvaluations) break;
      const double merit = best_cost_ * scale_ + best_violation_;
      if (merit < before - 1e-3 * std::abs(before)) continue;
      if (!std::isfinite(box_rad_) || box_rad_ < kSmallestBox_rad) break;
      box_rad_ /= 4;
    }
    best.x = best_x_;
    Evaluate(best.x, true);
    best.rollout = result_;
    const WorstConstraint worst = FindWorst(problem_, rows_, best.x, result_);
    best.constraint_violation = worst.value;
    best.worst_constraint = worst.name;
    best.core_reached = result_.peak_penetration_m >= problem_.contact().d_on_m;
    if (end == SolveEnd::kConverged && best.constraint_violation > kNoViolation)
      end = SolveEnd::kInfeasible;
    best.evaluations = evaluations_;
    best.kkt = FindKktResidual(problem_, paths_, rows_, best.x, result_, slopes_);
    const double gradient = std::max(first_gradient, outputs_.row(0).lpNorm<Eigen::Infinity>());
    if (end == SolveEnd::kConverged && best.kkt.absolute > kStationary * gradient)
      end = SolveEnd::kStalled;
    best.end = end;
    return best;
  }

 private:
  SolveEnd RunOnce(std::vector<double> y) {
    const std::size_t n = y.size();
    nlopt::opt opt(nlopt::LD_SLSQP, static_cast<unsigned>(n));
    std::vector<double> lower, upper;
    for (std::size_t i = 0; i < n; ++i) {
      const Interval<double> bounds = paths_.bounds(i);
      const double at = std::clamp(y[i], bounds.min, bounds.max);
      lower.push_back(std::max(bounds.min, at - box_rad_));
      upper.push_back(std::min(bounds.max, at + box_rad_));
    }
    opt.set_lower_bounds(lower);
    opt.set_upper_bounds(upper);
    // NLopt refuses a start that is outside of its bounds by a rounding, which sums come to be.
    for (std::size_t i = 0; i < n; ++i) y[i] = std::clamp(y[i], lower[i], upper[i]);
    opt.set_min_objective(&Objective, this);
    const bool own = !problem_.self_contact().pairs.empty();
    const std::size_t constraints = own_rows_.size() + problem_.joints.size() + (own ? 2 : 1);
    opt.add_inequality_mconstraint(&Constraints, this, std::vector<double>(constraints, 1e-8));
    opt.set_ftol_rel(problem_.solver.relative_tolerance);
    opt.set_xtol_rel(1e-9);
    opt.set_maxeval(max_evaluations_ - evaluations_);
    opt_ = &opt;
    SolveEnd end = SolveEnd::kFailed;
    double value = 0;
    try {
      switch (opt.optimize(y, value)) {
        case nlopt::MAXEVAL_REACHED:
          end = SolveEnd::kEvaluations;
          break;
        default:
          end = SolveEnd::kConverged;
      }
    } catch (const nlopt::forced_stop&) {
      end = SolveEnd::kInterrupted;
    } catch (const nlopt::roundoff_limited&) {
      end = SolveEnd::kStalled;
    } catch (const std::runtime_error&) {
      // NLOPT_FAILURE: "more than iter SQP iterations" and its like mean inconsistent linearised
      // constraints.
      end = SolveEnd::kInfeasible;
    }
    opt_ = nullptr;
    if (failure_) std::rethrow_exception(failure_);
    return end;
  }

  /// SLSQP asks for the cost alone along a line, and for the gradient at the point of the line that
  /// it takes. As a rule it takes the first one: hence the first point gets its gradient at once,
  /// and the others only when it is asked for.
  void Evaluate(std::span<const double> x, bool with_gradient) {
    const bool known = x_.size() == x.size() && std::equal(x.begin(), x.end(), x_.begin());
    const bool first_of_line = settled_;
    settled_ = with_gradient;
    if (known && (has_gradient_ || !with_gradient)) return;
    x_.assign(x.begin(), x.end());
    has_gradient_ = with_gradient || first_of_line;
    result_ = has_gradient_ ? rollout_.Run(x_, outputs_) : rollout_.Run(x_);
    if (digits_ == Digits::kThatRoundingSpares) RoundOutputs();
    if (has_gradient_) slopes_ = paths_.ReduceSlopes(outputs_);
    if (known) return;
    ++evaluations_;
    const double violation = LargestViolation(problem_, rows_, x_, result_);
    const Evaluation evaluation{false, 0, evaluations_, result_.cost, violation};
    if (history_ != nullptr) history_->push_back(evaluation);
    if (options_.progress) options_.progress(evaluation);
    if (scale_ > 0) Remember();
    if (options_.interrupt != nullptr && *options_.interrupt && opt_ != nullptr) opt_->force_stop();
  }

  void RoundOutputs() {
    const auto round = [](double& value) { value = RoundedTo(value, value); };
    round(result_.cost);
    for (double& excess : result_.torque_excess) round(excess);
    round(result_.penetration_excess);
    round(result_.clearance_excess);
    if (!has_gradient_) return;
    for (Eigen::Index row = 0; row < outputs_.rows(); ++row) {
      const double largest = outputs_.row(row).lpNorm<Eigen::Infinity>();
      for (double& slope : outputs_.row(row)) slope = RoundedTo(slope, largest);
    }
  }

  /// Keeps the best point seen: less violation first, and among feasible points the lower cost.
  void Remember() {
    if (!result_.finite || result_.cost > most_cost_) return;
    const double violation =
        std::max(LargestViolation(problem_, rows_, x_, result_), kLeastViolation);
    const bool better =
        violation < best_violation_ || (violation == best_violation_ && result_.cost < best_cost_);
    if (!better) return;
    best_x_ = x_;
    best_violation_ = violation;
    best_cost_ = result_.cost;
  }

  static double Objective(const std::vector<double>& y, std::vector<double>& gradient, void* data) {
    auto& self = *static_cast<LocalSolve*>(data);
    try {
      self.Evaluate(self.paths_.Expand(y), !gradient.empty());
      if (!self.result_.finite) return std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < gradient.size(); ++i) {
        gradient[i] = self.scale_ * self.slopes_(0, static_cast<Eigen::Index>(i));
      }
      return self.scale_ * self.result_.cost;
    } catch (...) {  // NLopt would lose the exception. It is kept and thrown after the run.
      self.failure_ = std::current_exception();
      self.opt_->force_stop();
      return std::numeric_limits<double>::infinity();
    }
  }

  static void Constraints(unsigned m, double* value, unsigned n, const double* y, double* gradient,
                          void* data) {
    auto& self = *static_cast<LocalSolve*>(data);
    try {
      self.Evaluate(self.paths_.Expand({y, n}), gradient != nullptr);
    } catch (...) {
      self.failure_ = std::current_exception();
      self.opt_->force_stop();
    }
    const std::size_t rows = self.own_rows_.size();
    const std::vector<double> simulated = SimulatedConstraints(self.problem_, self.result_);
    for (std::size_t i = 0; i < m; ++i) {
      if (i < rows) {
        std::optional<LinearRow> linear;
        if (self.own_rows_[i].of_free_duration) linear = self.own_rows_[i].LinearAt({y, n});
        const LinearRow& row = linear ? *linear : self.own_rows_[i];
        value[i] = row.b + std::inner_product(row.a.begin(), row.a.end(), y, 0.0);
        if (gradient != nullptr) std::copy(row.a.begin(), row.a.end(), gradient + i * n);
      } else {
        value[i] = self.result_.finite ? simulated[i - rows] : 1.0;
        for (std::size_t k = 0; gradient != nullptr && k < n; ++k) {
          gradient[i * n + k] =
              self.slopes_(static_cast<Eigen::Index>(i - rows + 1), static_cast<Eigen::Index>(k));
        }
      }
    }
  }

  const Digits digits_;
  double box_rad_;
  double most_cost_ = std::numeric_limits<double>::infinity();  // of what is remembered
  const Problem& problem_;
  int max_evaluations_;
  Rollout& rollout_;
  const SolveOptions& options_;
  std::vector<Evaluation>* history_;
  std::vector<LinearRow> rows_;
  FreePaths paths_;
  std::vector<LinearRow> own_rows_;   // by what is free of the paths
  OutputGradients outputs_, slopes_;  // by the parameters, and by what is free of them
  std::vector<double> x_;
  RolloutResult result_;
  bool has_gradient_ = false;  // whether outputs_ belongs to x_
  bool settled_ = false;       // whether the last request was for a gradient
  double scale_ = 0;
  int evaluations_ = 0;
  std::vector<double> best_x_;
  double best_cost_ = 0;
  double best_violation_ = 0;
  nlopt::opt* opt_ = nullptr;
  std::exception_ptr failure_;
};

}  // namespace

Solution SolveFrom(const Problem& problem, std::span<const double> start, int max_evaluations,
                   Rollout& rollout, const SolveOptions& options, std::vector<Evaluation>* history,
                   Digits digits, double box_rad) {
  return LocalSolve(problem, max_evaluations, rollout, options, history, digits, box_rad)
      .Run(start);
}

}  // namespace tumbler
