#include "offline/solver/solve_near.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/index.h"
#include "offline/linear/symmetric_eigen.h"
#include "offline/solver/constraints.h"
#include "offline/solver/quadratic_program.h"

namespace tumbler {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Radius of the trust region at first, and at most [rad].
constexpr double kFirstRadius = 0.1, kLargestRadius = 0.2;
/// A radius below this means that no step within rounding helps [rad].
constexpr double kSmallestRadius = 1e-7;
/// A step is taken when the merit falls by this part of what the model promises.
constexpr double kTaken = 0.05;
/// A step whose fall is this part of what the model promises needs no correction.
constexpr double kGood = 0.5;
/// The Kuhn-Tucker residual, relative to the largest gradient of the solve, at which it has
/// converged.
constexpr double kConverged = 1e-4;
/// Linear limits that are exceeded by less are kept.
constexpr double kRounding = 1e-9;

VectorXd Vector(const std::vector<double>& values) {
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// The nearest matrix without negative eigenvalues.
MatrixXd Convex(const MatrixXd& B) {
  const SymmetricEigen<MatrixXd> eigen = DecomposeSymmetric(B);
  const double least = 1e-10 * eigen.values.cwiseAbs().maxCoeff();
  return eigen.vectors * eigen.values.cwiseMax(least).asDiagonal() * eigen.vectors.transpose();
}

/// A motion, and what is known of it.
struct Point {
  VectorXd x;
  RolloutResult result;
  VectorXd c;  ///< Simulated constraints.
  VectorXd g;  ///< Gradient of the cost.
  MatrixXd A;  ///< Gradients of the constraints, by rows.
  GaussNewton model;

  /// Cost, and the price of what violates constraints.
  [[nodiscard]] double Merit(double price) const {
    return result.finite ? result.cost + price * c.cwiseMax(0).sum()
                         : std::numeric_limits<double>::infinity();
  }
};

class NearSolve {
 public:
  NearSolve(const Problem& problem, int max_evaluations, double enough, AdaptiveRollout& rollout,
            const SolveOptions& options, std::vector<Evaluation>* history)
      : problem_(problem),
        max_evaluations_(max_evaluations),
        enough_(enough),
        rollout_(rollout),
        options_(options),
        history_(history),
        rows_(DerivativeLimitRows(problem)),
        n_(problem.parameter_count()),
        outputs_(rollout.output_count(), n_),
        hard_(static_cast<Eigen::Index>(rows_.size()), n_),
        offset_(hard_.rows()),
        lower_(n_),
        upper_(n_) {
    for (int i = 0; i < n_; ++i) {
      const JointLimits<double>& limits = problem.joints[problem.joint_of_parameter(i)].limits;
      lower_[i] = limits.position_min_rad;
      upper_[i] = limits.position_max_rad;
    }
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      hard_.row(k) = Vector(rows_[i].a).transpose();
      offset_[k] = rows_[i].b;
    }
  }

  Solution Run(std::span<const double> start) {
    Point here = Expand(Inside(Eigen::Map<const VectorXd>(start.data(), n_)));
    Solution best;
    best.start_cost = here.result.cost;
    if (here.result.finite) best.end = Iterate(here);
    best.x.assign(here.x.begin(), here.x.end());
    best.rollout = here.result;
    best.evaluations = evaluations_;
    if (!here.result.finite) return best;
    best.rollout = rollout_.RunAnew(best.x, outputs_);
    const WorstConstraint worst = FindWorst(problem_, rows_, best.x, best.rollout);
    best.constraint_violation = worst.value;
    best.worst_constraint = worst.name;
    best.core_reached = best.rollout.peak_penetration_m >= problem_.scene.contact.d_on_m;
    best.projected_gradient = ProjectedGradient(problem_, rows_, best.x, best.rollout, outputs_);
    if (best.end == SolveEnd::kConverged && best.constraint_violation > kNoViolation)
      best.end = SolveEnd::kInfeasible;
    return best;
  }

 private:
  /// The motion nearest to x that keeps all linear limits.
  VectorXd Inside(const VectorXd& x) const {
    QuadraticProgram nearest = Subproblem(x, std::numeric_limits<double>::infinity());
    nearest.g = VectorXd::Zero(n_);
    nearest.B = MatrixXd::Identity(n_, n_);
    nearest.soft = MatrixXd::Zero(0, n_);
    nearest.soft_value = VectorXd::Zero(0);
    // Limits that cannot be kept are left as they are.
    const QuadraticSolution solution = Solve(nearest);
    const VectorXd moved = x + solution.p;
    return (solution.converged ? moved : x).cwiseMax(lower_).cwiseMin(upper_);
  }

  /// The limits of a step from x.
  [[nodiscard]] QuadraticProgram Subproblem(const VectorXd& x, double radius) const {
    QuadraticProgram program;
    program.lower = (lower_ - x).cwiseMax(-radius);
    program.upper = (upper_ - x).cwiseMin(radius);
    program.hard = hard_;
    program.hard_value = hard_ * x + offset_;
    // A limit that is violated by rounding must not get worse.
    if (std::isfinite(radius)) program.hard_value = program.hard_value.cwiseMin(0);
    return program;
  }

  /// Counts and reports an evaluation.
  void Count(const Point& point) {
    ++evaluations_;
    const double violation =
        LargestViolation(problem_, rows_, {point.x.data(), Index(n_)}, point.result);
    const Evaluation evaluation{false, 0, evaluations_, point.result.cost, violation};
    if (history_ != nullptr) history_->push_back(evaluation);
    if (options_.progress) options_.progress(evaluation);
  }

  /// The motion x with its gradients, by steps that are chosen for it.
  Point Expand(const VectorXd& x) {
    Point point;
    point.x = x;
    point.result = rollout_.RunAnew({x.data(), Index(n_)}, outputs_, point.model);
    Count(point);
    point.c = Vector(SimulatedConstraints(problem_, point.result));
    point.g = outputs_.row(0).transpose();
    point.A = outputs_.middleRows(1, point.c.size());
    return point;
  }

  SolveEnd Iterate(Point& here) {
    double radius = kFirstRadius;
    double largest_gradient = here.g.lpNorm<Eigen::Infinity>();
    price_ = std::max({std::abs(here.result.cost), 1e-3 * largest_gradient, 1e-9});
    while (evaluations_ < max_evaluations_) {
      if (options_.interrupt != nullptr && *options_.interrupt) return SolveEnd::kInterrupted;
      const MatrixXd B = Convex(here.model.matrix);
      const QuadraticSolution step = FindStep(here, B, radius);
      const double promised = Promised(here, B, step.p);
      const double length = step.p.lpNorm<Eigen::Infinity>();
      // With these multipliers, B p is what is left of the Kuhn-Tucker condition.
      if (length < 0.99 * radius &&
          (B * step.p).lpNorm<Eigen::Infinity>() <= kConverged * largest_gradient &&
          here.c.maxCoeff() <= kNoViolation)
        return SolveEnd::kConverged;
      if (!(promised > enough_ * std::abs(here.Merit(price_)))) return SolveEnd::kStalled;
      Point trial = Corrected(here, step.p, promised);
      const double fall = here.Merit(price_) - trial.Merit(price_);
      const bool taken = fall >= kTaken * promised;
      if (!taken || fall < 0.25 * promised) {
        radius = (taken ? 0.5 : 0.25) * length;
      } else if (fall > 0.75 * promised && length > 0.9 * radius) {
        radius = std::min(2 * radius, kLargestRadius);
      }
      if (taken) {
        here = std::move(trial);
        largest_gradient = std::max(largest_gradient, here.g.lpNorm<Eigen::Infinity>());
      }
      if (radius < kSmallestRadius) return SolveEnd::kStalled;
    }
    return SolveEnd::kEvaluations;
  }

  /// Tries a step, and corrects it once. The targets are far more curved than the rest of the cost,
  /// as the robot balances on the way to them: a step that is right in the first order misses them
  /// in the second. So the shortest way back is added to what the model says of them there, by the
  /// slopes there.
  Point Corrected(const Point& here, const VectorXd& p, double promised) {
    Point there = Expand(here.x + p);
    const MatrixXd& J = there.model.residual_slopes;
    if (!there.result.finite || J.rows() == 0) return there;
    if (here.Merit(price_) - there.Merit(price_) > kGood * promised) return there;
    const VectorXd wanted = Vector(here.result.residuals) + here.model.residual_slopes * p;
    MatrixXd square = J * J.transpose();
    square.diagonal().array() += 1e-4 * square.diagonal().maxCoeff();
    const VectorXd missed = Vector(there.result.residuals) - wanted;
    const VectorXd back = -J.transpose() * square.ldlt().solve(missed);
    if (back.lpNorm<Eigen::Infinity>() > 2 * p.lpNorm<Eigen::Infinity>()) return there;
    const VectorXd x = (there.x + back).cwiseMax(lower_).cwiseMin(upper_);
    const Eigen::ArrayXd before = (hard_ * here.x + offset_).array().max(0);
    if (((hard_ * x + offset_).array() > before + kRounding).any()) return there;
    Point corrected = Expand(x);
    return corrected.Merit(price_) < there.Merit(price_) ? corrected : there;
  }

  /// Minimises the model, with a price at which violations pay off no more where they can be
  /// avoided.
  QuadraticSolution FindStep(const Point& here, const MatrixXd& B, double radius) {
    QuadraticProgram program = Subproblem(here.x, radius);
    program.g = here.g;
    program.B = B;
    program.soft = here.A;
    program.soft_value = here.c;
    const double violation = here.c.cwiseMax(0).sum();
    for (int raises = 0;; ++raises) {
      program.price = price_;
      QuadraticSolution step = Solve(program);
      const double left = (here.c + here.A * step.p).cwiseMax(0).sum();
      const bool cheap = step.soft_multiplier.size() > 0 &&
                         step.soft_multiplier.maxCoeff() > 0.9 * price_ && left > 1e-9 &&
                         left > 0.5 * violation;
      if (!cheap || raises == 5) return step;
      price_ *= 4;
    }
  }

  /// What the model says that the step takes from the merit.
  [[nodiscard]] double Promised(const Point& here, const MatrixXd& B, const VectorXd& p) const {
    return -(here.g.dot(p) + 0.5 * p.dot(B * p)) +
           price_ * (here.c.cwiseMax(0).sum() - (here.c + here.A * p).cwiseMax(0).sum());
  }

  const Problem& problem_;
  int max_evaluations_;
  double enough_;
  AdaptiveRollout& rollout_;
  const SolveOptions& options_;
  std::vector<Evaluation>* history_;
  std::vector<LinearRow> rows_;
  int n_;
  OutputGradients outputs_;
  MatrixXd hard_;  // of the linear limits: hard_ x + offset_ <= 0
  VectorXd offset_;
  VectorXd lower_, upper_;
  double price_ = 1;
  int evaluations_ = 0;
};

}  // namespace

Solution SolveNear(const Problem& problem, std::span<const double> start, int max_evaluations,
                   double enough, AdaptiveRollout& rollout, const SolveOptions& options,
                   std::vector<Evaluation>* history) {
  return NearSolve(problem, max_evaluations, enough, rollout, options, history).Run(start);
}

}  // namespace tumbler
