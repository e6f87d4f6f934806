#include "offline/solve/solve_near.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "common/core/index.h"
#include "offline/model/dense_eigen.h"
#include "offline/solve/constraints.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/quadratic_program.h"

namespace tumbler {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Radius of the trust region at most [rad].
constexpr double kLargestRadius = 0.5;
/// A radius below this means that no step within rounding helps [rad].
constexpr double kSmallestRadius = 1e-7;
/// A step is taken when the merit falls by this part of what the model promises.
constexpr double kTaken = 0.05;
/// A step whose fall is this part of what the model promises needs no correction.
constexpr double kGood = 0.5;
/// A step that promises less than this part of the merit promises nothing but rounding.
constexpr double kRoundingOfMerit = 1e-12;
/// When no step helps, secants that mislead may be why. They are forgotten so many times, and the
/// radius is this one then [rad].
constexpr int kMostResets = 5;
constexpr double kRadiusAfterReset = 0.01;
/// A solve ends when it makes no progress worth mentioning in so many evaluations. On the way, what
/// creeps along a bent valley like this seldom arrives, and another start does. Near a minimum it
/// mostly arrives.
constexpr int kPatienceOnTheWay = 30, kPatience = 100;
/// Evaluations that a step can take: its motion, two corrections of it, and that with fine steps at
/// the end.
constexpr int kMostForAStep = 4;
/// Further ones, with which a solve that ends on its budget goes back to its constraints.
constexpr int kMostOnTheWayBack = 3;
/// A solve that stalls within so many times the residual that is wanted goes on with finer steps.
constexpr double kNearMinimum = 100;
/// By so much finer.
constexpr double kFinest = 0.01;
/// Linear limits that are exceeded by less are kept.
constexpr double kRounding = 1e-9;

VectorXd Vector(const std::vector<double>& values) {
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// The matrix with its eigenvalues' sizes: along a direction of negative curvature a step is as
/// long as one of the same curvature upwards would allow.
MatrixXd Convex(const MatrixXd& B) {
  const DenseEigen eigen = DecomposeSymmetric(B);
  const VectorXd sizes = eigen.values.cwiseAbs();
  const double least = 1e-10 * sizes.maxCoeff();
  return eigen.vectors * sizes.cwiseMax(least).asDiagonal() * eigen.vectors.transpose();
}

/// What Gauss and Newton's matrix leaves out of the Lagrangian's second derivatives, from secants.
class SecantMatrix {
 public:
  explicit SecantMatrix(Eigen::Index n) : S_(MatrixXd::Zero(n, n)) {}

  explicit SecantMatrix(MatrixXd known) : S_(std::move(known)) {}

  [[nodiscard]] const MatrixXd& matrix() const { return S_; }
  [[nodiscard]] bool empty() const { return S_.isZero(0); }
  void Forget() { S_.setZero(); }

  /// Learns S s = y. The old matrix is sized first, so that it does not stand for a curvature that
  /// is gone [Dennis, Gay and Welsch 1981].
  void Learn(const VectorXd& s, const VectorXd& y) {
    const double of_old = s.dot(S_ * s);
    if (of_old != 0) S_ *= std::min(1.0, std::abs(s.dot(y) / of_old));
    const VectorXd missing = y - S_ * s;
    const double along = missing.dot(s);
    if (std::abs(along) > 1e-8 * missing.norm() * s.norm())
      S_ += missing * missing.transpose() / along;
  }

 private:
  MatrixXd S_;
};

/// A motion, and what is known of it.
struct Point {
  VectorXd y;             ///< What is free of its paths; derivatives are by these.
  std::vector<double> x;  ///< The problem's parameters, which y stands for.
  RolloutResult result;
  VectorXd c;               ///< Simulated constraints.
  OutputGradients outputs;  ///< Gradients: of the cost, then of the constraints.
  GaussNewton model;
  std::optional<StepGrid> steps;  ///< Those of AdaptiveSteps, where it was evaluated with these.

  [[nodiscard]] VectorXd g() const { return outputs.row(0).transpose(); }
  /// Gradients of the constraints, by rows.
  [[nodiscard]] MatrixXd A() const { return outputs.middleRows(1, c.size()); }
  [[nodiscard]] VectorXd residuals() const { return Vector(result.residuals); }
  /// The gradient of all but the squares of targets.
  [[nodiscard]] VectorXd GradientBesideTargets() const {
    return g() - 2 * model.residual_slopes.transpose() * residuals();
  }
  /// The matrix of Gauss and Newton of the same.
  [[nodiscard]] MatrixXd MatrixBesideTargets() const {
    return model.matrix - 2 * model.residual_slopes.transpose() * model.residual_slopes;
  }
  [[nodiscard]] double violation() const { return c.cwiseMax(0).sum(); }
  /// Cost, and the price of what violates constraints.
  [[nodiscard]] double Merit(double price) const {
    return result.finite ? result.cost + price * violation()
                         : std::numeric_limits<double>::infinity();
  }
};

/// How far a solve has come.
struct Progress {
  int evaluations = 0;
  double cost = 0;
  double violation = 0;  ///< At least kNoViolation.
  double kkt = 0;        ///< KktResidual::relative.

  /// Whether it is worth the evaluations since then.
  [[nodiscard]] bool WellBeyond(const Progress& then) const {
    return cost < then.cost - 0.01 * std::abs(then.cost) || violation < 0.8 * then.violation ||
           kkt < 0.3 * then.kkt;
  }
};

/// A way to a motion's cost and constraints with their derivatives.
struct Way {
  template <class Motions>
  explicit Way(Motions& motions)
      : outputs(motions.output_count()),
        run([&motions](std::span<const double> x, OutputGradients& gradients, GaussNewton& model) {
          return motions.Run(x, gradients, &model);
        }),
        evaluations([&motions] { return EvaluationsOf(motions); }) {}

  static std::int64_t EvaluationsOf(const ForwardSensitivity& motions) {
    return motions.statistics().evaluations;
  }
  static std::int64_t EvaluationsOf(const LaneSensitivity& motions) {
    return motions.evaluations();
  }

  int outputs;
  std::function<RolloutResult(std::span<const double>, OutputGradients&, GaussNewton&)> run;
  std::function<std::int64_t()> evaluations;  ///< Of the dynamics, in the last one.
  const ForwardSensitivity* steps = nullptr;  ///< Of which a motion tells its steps; null: of none.
};

class NearSolve {
 public:
  /// @param finer  the ways with which it goes on, one after the other; none: it ends on the way.
  /// @param memory  what is known already, and gets what was learnt; may be null.
  NearSolve(const Problem& problem, const NearLimits& limits, Way coarse, std::vector<Way> finer,
            NearMemory* memory, const SolveOptions& options, std::vector<Evaluation>* history)
      : problem_(problem),
        limits_(limits),
        way_(std::move(coarse)),
        finer_(std::move(finer)),
        memory_(memory),
        options_(options),
        history_(history),
        paths_(problem),
        rows_(DerivativeLimitRows(problem)),
        own_rows_(paths_.Reduce(rows_)),
        n_(static_cast<int>(paths_.count())),
        secants_(n_),
        hard_(static_cast<Eigen::Index>(own_rows_.size()), n_),
        offset_(hard_.rows()),
        lower_(n_),
        upper_(n_) {
    for (int i = 0; i < n_; ++i) {
      const Interval<double> bounds = paths_.bounds(Index(i));
      lower_[i] = bounds.min;
      upper_[i] = bounds.max;
    }
    for (std::size_t i = 0; i < own_rows_.size(); ++i) {
      if (!own_rows_[i].of_free_duration) SetHardRow(i, own_rows_[i]);
    }
    if (memory == nullptr || memory->secants.size() == 0) return;
    secants_ = SecantMatrix(memory->secants);
    multipliers_ = memory->multipliers;
    price_ = memory->price;
    radius_ = std::max(memory->radius_rad, kRadiusAfterReset);
  }

  Solution Run(std::span<const double> start) {
    const VectorXd first = Vector(paths_.Reduce(start));
    SetHardRowsAt(first);
    Point here = Expand(Inside(first));
    Solution best;
    best.start_cost = here.result.cost;
    if (here.result.finite) best.end = Iterate(here);
    while (here.result.finite && !finer_.empty()) {
      const bool first_fine = coarse();
      const bool confirms = limits_.confirm && best.end == SolveEnd::kConverged;
      if (!first_fine && !confirms && !StallsNearMinimum(best.end, here)) break;
      Refine(here);
      if (here.result.finite && GoesOn(best.end)) best.end = Iterate(here);
    }
    if (memory_ != nullptr) *memory_ = {secants_.matrix(), multipliers_, price_, radius_};
    if (best.end != SolveEnd::kInterrupted) Restore(here);
    best.x = here.x;
    best.rollout = here.result;
    best.steps = here.steps;
    best.evaluations = evaluations_;
    if (!here.result.finite) return best;
    const WorstConstraint worst = FindWorst(problem_, rows_, best.x, best.rollout);
    best.constraint_violation = worst.value;
    best.worst_constraint = worst.name;
    best.core_reached = best.rollout.peak_penetration_m >= problem_.scene.contact.d_on_m;
    best.kkt = KktAt(here);
    if (best.end == SolveEnd::kConverged && best.constraint_violation > kNoViolation)
      best.end = SolveEnd::kInfeasible;
    return best;
  }

 private:
  void SetHardRow(std::size_t i, const LinearRow& row) {
    const auto k = static_cast<Eigen::Index>(i);
    hard_.row(k) = Vector(row.a).transpose();
    offset_[k] = row.b;
  }
  /// Where the duration is free, limits are linear near a motion only.
  void SetHardRowsAt(const VectorXd& y) {
    if (!problem_.free_duration) return;
    for (std::size_t i = 0; i < own_rows_.size(); ++i)
      SetHardRow(i, own_rows_[i].LinearAt({y.data(), Index(n_)}));
  }

  /// Leads a motion whose solve ended on the way, a little beyond its constraints, back to where it
  /// keeps them, by the shortest steps.
  void Restore(Point& here) {
    for (int i = 0; i < kMostOnTheWayBack && evaluations_ < limits_.max_evaluations; ++i) {
      if (!here.result.finite || here.c.size() == 0 || here.c.maxCoeff() <= kNoViolation) return;
      SetHardRowsAt(here.y);
      QuadraticProgram nearest =
          Program(here, MatrixXd::Identity(n_, n_), NearMemory::kFirstRadius_rad);
      nearest.g = VectorXd::Zero(n_);
      // Constraints bend, so a step that aims at their edge ends a little beyond it again.
      nearest.soft_value.array() += 0.1 * here.c.maxCoeff() + 0.5 * kNoViolation;
      nearest.price = 1e3;
      Point there = Expand(here.y + Solve(nearest).p);
      if (!there.result.finite || there.violation() >= here.violation()) return;
      here = std::move(there);
    }
  }

  /// The motion nearest to y that keeps all linear limits.
  VectorXd Inside(const VectorXd& y) const {
    QuadraticProgram nearest = Subproblem(y, std::numeric_limits<double>::infinity());
    nearest.g = VectorXd::Zero(n_);
    nearest.B = MatrixXd::Identity(n_, n_);
    nearest.soft = MatrixXd::Zero(0, n_);
    nearest.soft_value = VectorXd::Zero(0);
    // Limits that cannot be kept are left as they are.
    const QuadraticSolution solution = Solve(nearest);
    const VectorXd moved = y + solution.p;
    return (solution.converged ? moved : y).cwiseMax(lower_).cwiseMin(upper_);
  }

  /// The limits of a step from y.
  [[nodiscard]] QuadraticProgram Subproblem(const VectorXd& y, double radius) const {
    QuadraticProgram program;
    program.lower = (lower_ - y).cwiseMax(-radius);
    program.upper = (upper_ - y).cwiseMin(radius);
    program.hard = hard_;
    program.hard_value = hard_ * y + offset_;
    // A limit that is violated by rounding must not get worse.
    if (std::isfinite(radius)) program.hard_value = program.hard_value.cwiseMin(0);
    return program;
  }

  /// Counts and reports an evaluation.
  void Count(const Point& point) {
    ++evaluations_;
    const double violation = LargestViolation(problem_, rows_, point.x, point.result);
    const Evaluation evaluation{
        false, 0, evaluations_, point.result.cost, violation, way_.evaluations()};
    if (history_ != nullptr) history_->push_back(evaluation);
    if (options_.progress) options_.progress(evaluation);
  }

  /// The motion y with its derivatives.
  Point Expand(const VectorXd& y) {
    Point point;
    point.y = y;
    point.x = paths_.Expand({y.data(), Index(n_)});
    point.outputs.resize(way_.outputs, static_cast<Eigen::Index>(point.x.size()));
    point.result = way_.run(point.x, point.outputs, point.model);
    point.outputs = paths_.ReduceSlopes(std::move(point.outputs));
    point.model = paths_.Reduce(std::move(point.model));
    if (way_.steps != nullptr && point.result.finite) point.steps = way_.steps->grid();
    Count(point);
    point.c = Vector(SimulatedConstraints(problem_, point.result));
    return point;
  }

  [[nodiscard]] KktResidual KktAt(const Point& point) const {
    return FindKktResidual(problem_, paths_, rows_, point.x, point.result, point.outputs,
                           &point.model);
  }

  [[nodiscard]] bool Converged(const Point& here) const {
    return here.c.maxCoeff() <= kNoViolation &&
           KktAt(here).relative.value() <=
               (coarse() ? limits_.nearly : 1) * problem_.solver.kkt_residual;
  }

  [[nodiscard]] Progress ProgressOf(const Point& here) const {
    return {evaluations_, here.result.cost, std::max(here.violation(), kNoViolation),
            KktAt(here).relative.value_or(1)};
  }

  [[nodiscard]] bool coarse() const { return !refined_; }
  /// Whether fine steps can still change a motion that ended like this.
  static bool GoesOn(SolveEnd end) {
    return end != SolveEnd::kEvaluations && end != SolveEnd::kInterrupted;
  }
  /// Whether a solve stopped so near to a minimum that errors of its steps may be what holds it.
  bool StallsNearMinimum(SolveEnd end, const Point& here) const {
    return end == SolveEnd::kStalled && here.c.maxCoeff() <= kNoViolation &&
           KktAt(here).relative.value_or(1) <= kNearMinimum * problem_.solver.kkt_residual;
  }
  /// Looks at the motion with finer steps from now on.
  void Refine(Point& here) {
    way_ = std::move(finer_.front());
    finer_.erase(finer_.begin());
    refined_ = true;
    radius_ = std::clamp(radius_, kRadiusAfterReset, NearMemory::kFirstRadius_rad);
    here = Expand(here.y);
  }

  SolveEnd Iterate(Point& here) {
    price_ = std::max(
        {price_, std::abs(here.result.cost), 1e-3 * here.g().lpNorm<Eigen::Infinity>(), 1e-9});
    int resets = 0;
    Progress last = ProgressOf(here);
    for (;;) {
      if (options_.interrupt != nullptr && *options_.interrupt) return SolveEnd::kInterrupted;
      if (Converged(here)) return SolveEnd::kConverged;
      if (!here.result.finite) return SolveEnd::kStalled;
      if (const Progress now = ProgressOf(here); now.WellBeyond(last)) {
        last = now;
      } else if (now.evaluations - last.evaluations > (coarse() ? kPatienceOnTheWay : kPatience)) {
        return SolveEnd::kStalled;
      }
      SetHardRowsAt(here.y);
      const MatrixXd B = Convex(here.model.matrix + secants_.matrix());
      const QuadraticSolution step = FindStep(here, B, radius_);
      const double promised = Promised(here, B, step.p);
      const double size = std::abs(here.Merit(price_));
      const bool keeps = here.c.maxCoeff() <= kNoViolation;
      const double enough = evaluations_ < limits_.enough_after ? 0 : limits_.enough;
      if (enough > 0 && keeps && !(promised > enough * size)) return SolveEnd::kEnough;
      if (evaluations_ + kMostForAStep + kMostOnTheWayBack > limits_.max_evaluations)
        return SolveEnd::kEvaluations;
      if (!(promised > kRoundingOfMerit * size) || radius_ < kSmallestRadius) {
        if (secants_.empty() || coarse() || resets++ == kMostResets) return SolveEnd::kStalled;
        secants_.Forget();
        radius_ = std::max(radius_, kRadiusAfterReset);
        continue;
      }
      Point there = Corrected(here, B, step.p, radius_, promised);
      Learn(here, there);
      const double length = step.p.lpNorm<Eigen::Infinity>();
      const double fall = here.Merit(price_) - there.Merit(price_);
      const bool taken = fall >= kTaken * promised;
      if (!taken || fall < 0.25 * promised) {
        radius_ = (taken ? 0.5 : 0.25) * length;
      } else if (fall > 0.75 * promised && length > 0.9 * radius_) {
        radius_ = std::min(2 * radius_, kLargestRadius);
      }
      if (taken) here = std::move(there);
    }
  }

  /// Takes in how derivatives differ between two motions. With y the change of the Lagrangian's
  /// gradient, less what Gauss and Newton's matrix says of it:
  ///
  ///   y = 2 (J1 - J0)^T r1 + (g1 - g0 - G1 s) + (A1 - A0)^T mu
  ///
  /// J, r of the targets; g, G of the rest of the cost, A of the constraints.
  void Learn(const Point& here, const Point& there) {
    if (!there.result.finite) return;
    const VectorXd s = there.y - here.y;
    const MatrixXd turned = there.model.residual_slopes - here.model.residual_slopes;
    VectorXd y = 2 * turned.transpose() * there.residuals();
    y += there.GradientBesideTargets() - here.GradientBesideTargets() -
         there.MatrixBesideTargets() * s;
    y += (there.A() - here.A()).transpose() * multipliers_;
    secants_.Learn(s, y);
  }

  /// Tries a step, and corrects it where it goes wrong because of curvature.
  Point Corrected(const Point& here, const MatrixXd& B, const VectorXd& p, double radius,
                  double promised) {
    Point there = Expand(here.y + p);
    if (!there.result.finite) return there;
    const auto good = [&](double part) {
      return here.Merit(price_) - there.Merit(price_) > part * promised;
    };
    if (!good(kGood)) BackToTargets(here, p, there);
    if (!good(0.5 * kGood) && there.c.maxCoeff() > kNoViolation) {
      // The constraints as they are there take the place of what the model says of them there
      // (second-order correction).
      QuadraticProgram program = Program(here, B, radius);
      program.soft_value = there.c - here.A() * (there.y - here.y);
      KeepBetter(Expand(here.y + Solve(program).p), there);
    }
    return there;
  }

  /// The targets are far more curved than the rest of the cost, as the robot balances on the way to
  /// them: a step that is right in the first order misses them in the second. So the shortest way
  /// back is added to what the model says of them there, by the slopes there.
  void BackToTargets(const Point& here, const VectorXd& p, Point& there) {
    const MatrixXd& J = there.model.residual_slopes;
    if (J.rows() == 0) return;
    const VectorXd wanted = here.residuals() + here.model.residual_slopes * p;
    MatrixXd square = J * J.transpose();
    square.diagonal().array() += 1e-4 * square.diagonal().maxCoeff();
    const VectorXd missed = there.residuals() - wanted;
    const VectorXd back = -J.transpose() * square.ldlt().solve(missed);
    if (!(back.lpNorm<Eigen::Infinity>() <= 2 * p.lpNorm<Eigen::Infinity>())) return;
    const VectorXd y = (there.y + back).cwiseMax(lower_).cwiseMin(upper_);
    const Eigen::ArrayXd before = (hard_ * here.y + offset_).array().max(0);
    if (((hard_ * y + offset_).array() > before + kRounding).any()) return;
    KeepBetter(Expand(y), there);
  }

  void KeepBetter(Point&& other, Point& there) const {
    if (other.Merit(price_) < there.Merit(price_)) there = std::move(other);
  }

  /// The model around a motion.
  [[nodiscard]] QuadraticProgram Program(const Point& here, const MatrixXd& B,
                                         double radius) const {
    QuadraticProgram program = Subproblem(here.y, radius);
    program.g = here.g();
    program.B = B;
    program.soft = here.A();
    program.soft_value = here.c;
    program.price = price_;
    return program;
  }

  /// Minimises the model, with a price at which constraints are kept about as well as they can be.
  QuadraticSolution FindStep(const Point& here, const MatrixXd& B, double radius) {
    QuadraticProgram program = Program(here, B, radius);
    QuadraticSolution step = Solve(program);
    const MatrixXd A = here.A();
    const auto left = [&](const VectorXd& p) { return (here.c + A * p).cwiseMax(0).sum(); };
    if (left(step.p) > kRounding) {
      QuadraticProgram constraints = program;
      constraints.g.setZero();
      constraints.B = MatrixXd::Identity(n_, n_) * 1e-6;
      constraints.price = 1;
      const double possible = here.violation() - left(Solve(constraints).p);
      for (int i = 0; i < kMostRaises; ++i) {
        if (here.violation() - left(step.p) >= 0.5 * possible - kRounding) break;
        price_ *= 4;
        program.price = price_;
        step = Solve(program);
      }
    }
    // Those of constraints that cannot be kept are the price, and say nothing of the cost.
    const double largest = step.soft_multiplier.size() > 0 ? step.soft_multiplier.maxCoeff() : 0;
    if (largest < 0.99 * price_) {
      multipliers_ = step.soft_multiplier;
      price_ = std::max(price_, 1.5 * largest);
    } else if (multipliers_.size() == 0) {
      multipliers_ = VectorXd::Zero(here.c.size());
    }
    return step;
  }

  /// What the model says that the step takes from the merit.
  [[nodiscard]] double Promised(const Point& here, const MatrixXd& B, const VectorXd& p) const {
    return -(here.g().dot(p) + 0.5 * p.dot(B * p)) +
           price_ * (here.violation() - (here.c + here.A() * p).cwiseMax(0).sum());
  }

  static constexpr int kMostRaises = 8;  // of the price, for one step

  const Problem& problem_;
  NearLimits limits_;
  Way way_;                 // the one that is used at present
  std::vector<Way> finer_;  // those that follow
  bool refined_ = false;    // whether it is not the first any more
  NearMemory* memory_;
  const SolveOptions& options_;
  std::vector<Evaluation>* history_;
  FreePaths paths_;
  std::vector<LinearRow> rows_;
  std::vector<LinearRow> own_rows_;  // by what is free of the paths
  int n_;                            // how much that is
  SecantMatrix secants_;
  VectorXd multipliers_;  // of the simulated constraints
  MatrixXd hard_;         // of the linear limits: hard_ x + offset_ <= 0
  VectorXd offset_;
  VectorXd lower_, upper_;
  double price_ = 0;
  double radius_ = NearMemory::kFirstRadius_rad;
  int evaluations_ = 0;
};

/// The steps of a motion that is not near a minimum yet.
StepSettings CoarseSteps(const Problem& problem) {
  StepSettings settings = AdaptiveSteps(problem);
  settings.tolerance = std::max(settings.tolerance, kCoarseTolerance);
  return settings;
}

/// Those with which a solve ends that the task's own do not bring to its end.
StepSettings FinestSteps(const Problem& problem) {
  StepSettings settings = AdaptiveSteps(problem);
  settings.tolerance = std::max(kFinest * settings.tolerance, kFinestTolerance);
  return settings;
}

}  // namespace

NearRollouts::NearRollouts(const Problem& problem, const SolveOptions& options)
    : coarse(problem, CoarseSteps(problem), options.contact ? options.contact() : nullptr),
      fine(problem, AdaptiveSteps(problem), options.contact ? options.contact() : nullptr),
      finest(problem, FinestSteps(problem), options.contact ? options.contact() : nullptr) {}

Solution SolveNear(const Problem& problem, std::span<const double> start, const NearLimits& limits,
                   NearRollouts& rollouts, const SolveOptions& options,
                   std::vector<Evaluation>* history, NearMemory* memory) {
  Way fine(rollouts.fine);
  // What is free of a motion beside its paths is not in the motion that is written.
  const bool paths_alone = problem.first_start_rate() == problem.parameter_count();
  if (paths_alone && !options.contact) fine.steps = &rollouts.fine;
  return NearSolve(problem, limits, Way(rollouts.coarse), {fine, Way(rollouts.finest)}, memory,
                   options, history)
      .Run(start);
}

Solution SolveNear(const Problem& problem, std::span<const double> start, const NearLimits& limits,
                   LaneSensitivity& lanes, const SolveOptions& options,
                   std::vector<Evaluation>* history, NearMemory* memory) {
  return NearSolve(problem, limits, Way(lanes), {}, memory, options, history).Run(start);
}

}  // namespace tumbler
