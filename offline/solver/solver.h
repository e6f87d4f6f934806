#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "offline/problem/problem.h"
#include "offline/rollout/rollout.h"

namespace tumbler {

/// One evaluation, as progress shows it and reports plot it.
struct Evaluation {
  bool global = false;     ///< Of the global search, else of a local solve.
  int start = 0;           ///< Which local solve.
  std::int64_t count = 0;  ///< Evaluations so far, of all threads in this stage.
  double cost = 0;         ///< Global search: the rank; in progress, the best so far.
  double violation = 0;    ///< Largest scaled constraint, 0 when all hold.
};

/// Why a local solve ended.
enum class SolveEnd {
  kConverged,    ///< Cost and parameters stopped changing within their tolerance.
  kStalled,      ///< No further progress is possible within rounding.
  kEvaluations,  ///< The evaluation budget is used up.
  kInfeasible,   ///< The linearised constraints contradict each other, or stay violated.
  kInterrupted,  ///< The caller asked to stop.
  kFailed,       ///< The rollout left every plausible range at the start.
};
const char* ToString(SolveEnd end);

/// Larger excess of a limit, relative to it (of a position, in rad), is a violation.
inline constexpr double kNoViolation = 1e-6;

/// One solution, re-checked after the solver returned it.
struct Solution {
  std::vector<double> x;
  RolloutResult rollout;
  SolveEnd end = SolveEnd::kFailed;
  bool finished = false;  ///< Solved with the final step; else screened only, with a longer one.
  int start = 0;          ///< Which start it came from, in the order of screening.
  double start_cost = 0;
  double constraint_violation = 0;  ///< Largest scaled constraint value above zero, recomputed.
  double projected_gradient = 0;    ///< Largest component of the cost's gradient that no active
                                    ///< constraint holds [cost per rad].
  int evaluations = 0;              ///< Of cost and gradient.
  std::string worst_constraint;     ///< Name of the largest one, e.g. `velocity of leg1`.
  bool core_reached =
      false;  ///< A contact went through the whole compliant layer: the model does not hold there.
  [[nodiscard]] bool feasible() const {
    return evaluations > 0 && rollout.finite && constraint_violation <= kNoViolation &&
           !core_reached;
  }
};

struct SolveOptions {
  int threads = 1;                         ///< Changes nothing but time.
  std::atomic<bool>* interrupt = nullptr;  ///< Set it from anywhere to stop early.
  /// Called after evaluations, from any thread but one at a time.
  std::function<void(const Evaluation&)> progress;
  /// Makes the contact forces of a rollout, one for each thread; empty: the general model.
  std::function<std::unique_ptr<ContactForces<Plane>>()> contact;
};

struct SolveOutcome {
  /// Of every start, best first: feasible before infeasible, then by cost. Empty when interrupted
  /// before the first batch of the search was done.
  std::vector<Solution> solutions;
  std::vector<Evaluation>
      history;  ///< In the order of stage, start and count: the same for any number of threads.
  std::int64_t evaluations = 0;  ///< Global and local.
  bool interrupted = false;
};

/// Finds a motion from nothing: global search over random splines, then SLSQP (NLopt) from the best
/// few.
SolveOutcome Solve(const Problem& problem, const SolveOptions& options);

/// SLSQP from one start. Variables are control points [rad], of order one already; the cost is
/// divided by its gradient at the start and every constraint by its limit, because NLopt's SLSQP
/// fails on large gradients.
Solution SolveFrom(const Problem& problem, std::span<const double> start, int max_evaluations,
                   Rollout& rollout, const SolveOptions& options, std::vector<Evaluation>* history);

/// Bounds that hold for all t: velocity and acceleration limits as rows a . x + b <= 0 over the
/// parameters, each divided by its limit. Positions are plain bounds of the parameters.
struct LinearRow {
  std::string name;
  std::vector<double> a;
  double b = 0;
};
std::vector<LinearRow> DerivativeLimitRows(const Problem& problem);

}  // namespace tumbler
