#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/core/primitive.h"
#include "offline/problem/problem.h"
#include "offline/scene/step_grid.h"
#include "offline/solve/kkt_residual.h"
#include "offline/solve/rollout.h"

namespace tumbler {

/// What robust searches tell of motions before robots judge them.
enum class SearchStage : std::uint8_t {
  kUsual,    ///< `Evaluation::cost` is what it says.
  kModel,    ///< It is the cost of a motion that was found for the model.
  kArrivals  ///< It is the least of a generation's CapturedMotion::loss. In no history.
};

/// One evaluation of a motion, for progress messages and reports.
struct Evaluation {
  bool global = false;     ///< Whether it belongs to the global search, or to a local solve.
  int start = 0;           ///< Number of the local solve.
  std::int64_t count = 0;  ///< Evaluations so far, of all threads in this stage.
  double cost = 0;         ///< Of the global search, the rank; in progress, the best so far.
  double violation = 0;    ///< Largest scaled constraint; 0 when all hold.
  /// Evaluations of g that it took, where its steps were adaptive; 0: equal steps.
  std::int64_t dynamics = 0;
  /// Whether robots that differ judged it: then `cost` is what they miss on average, of the best
  /// motion of a generation, and `count` how many were played.
  bool by_robots = false;
  SearchStage stage = SearchStage::kUsual;
};

/// Why a local solve ended.
enum class SolveEnd {
  kConverged,  ///< The Kuhn-Tucker condition holds: KktResidual::relative is small enough.
  /// The same, but with finer steps KktResidual::relative is larger.
  kConvergedCoarsely,
  kStalled,  ///< The cost stopped falling before that.
  kEnough,   ///< A further step promised less than the caller asked for: near a guess.
  /// The same, or the work that a proof is worth was done: it keeps its limits, and may or may not
  /// be at a minimum (SolverSettings::prove).
  kUnproved,
  kEvaluations,  ///< The evaluation budget is used up.
  kGenerations,  ///< A robust search is over: its generations, or that they gain anything.
  kAllRest,      ///< A robust search has nothing left to gain: all its robots rest, with a margin.
  kTaken,        ///< Nothing was searched: a guess is taken as it is.
  kInfeasible,   ///< The linearised constraints contradict each other, or stay violated.
  kInterrupted,  ///< The caller asked to stop.
  kFailed,       ///< The rollout left every plausible range at the start.
};
const char* ToString(SolveEnd end);

/// An excess of a limit counts as a violation when it is larger than this, relative to the limit
/// (for a position, in rad).
inline constexpr double kNoViolation = 1e-6;

/// Robots that the search for a motion has not met, and how many of them come to rest as asked.
struct RobotsCarried {
  int carried = 0, of = 0;
  double scale = 1;  ///< Of the task's spreads; of a posterior, in standard deviations.
};

/// A motion that the solver returned. It was evaluated again, so that nothing rests on the solver's
/// word.
struct Solution {
  /// Parameters of the problem [rad].
  std::vector<double> x;
  /// How long the motion takes, where the problem leaves that to the search for robots that differ;
  /// none: as the problem says, or its parameters (Problem::duration_of).
  std::optional<double> duration_s;
  /// How the motion answers a sensor, where the problem asks for that.
  Feedback<double> feedback;
  RolloutResult rollout;
  /// The steps that it was evaluated with last, where these are StepsFor of it; none: others.
  std::optional<StepGrid> steps;
  SolveEnd end = SolveEnd::kFailed;
  /// Whether it was solved with the final step, or only screened with a longer one.
  bool finished = false;
  /// Number of the start that it came from, in the order of screening.
  int start = 0;
  /// Cost of that start.
  double start_cost = 0;
  /// Largest scaled constraint; 0 when all hold.
  double constraint_violation = 0;
  /// How far it is from a minimum, and what limits hold it.
  KktResidual kkt;
  /// Evaluations of cost and gradient that it took.
  int evaluations = 0;
  /// Name of the largest constraint, e.g. `velocity of leg1`.
  std::string worst_constraint;
  /// Whether a contact went through the whole compliant layer. The contact model ends there.
  bool core_reached = false;
  /// Whether it keeps all limits and `SolveOptions::accept` refused it.
  bool refused = false;
  /// Whether it was accepted, and `SolveOptions::calm` says that a cliff of the cost is near.
  bool beside_cliff = false;
  /// Of a motion that was found for robots that differ: how many others it carries.
  std::optional<RobotsCarried> robots;

  /// Whether all limits hold, and the contact model with them.
  [[nodiscard]] bool feasible() const {
    return evaluations > 0 && rollout.finite && constraint_violation <= kNoViolation &&
           !core_reached;
  }
};

/// How far `Solve` takes motions.
enum class SolveTo : std::uint8_t {
  kMinimum,  ///< As far as it says.
  /// Through screening alone: what comes of it is changed further by others. Where it is found with
  /// fewer control points (Solve), its rollout is that of these.
  kScreened
};

/// Options of `Solve`. They do not change the result, unless it is interrupted, `contact` gives
/// another contact model, `accept` or `calm` objects to a motion, or `to` says so.
struct SolveOptions {
  SolveTo to = SolveTo::kMinimum;
  int threads = 1;
  /// Set it from any thread to stop early; may be null.
  std::atomic<bool>* interrupt = nullptr;
  /// Called after evaluations, from any thread but by one at a time; may be empty.
  std::function<void(const Evaluation&)> progress;
  /// Judges a finished motion that keeps all limits, from any thread and by several at a time;
  /// empty: takes every one. The search goes on in place of a motion that it refuses.
  std::function<bool(const Solution&)> accept;
  /// Judges whether an accepted motion is away from cliffs of the cost, likewise; empty: all are.
  /// Of motions that are as asked one that is away from them is preferred, unless it costs more by
  /// half, and two more are tried for it.
  std::function<bool(const Solution&)> calm;
  /// Gets a motion that `accept` takes while the search goes on, because a proof that it is at a
  /// minimum takes a while, or another one may be better: from any thread but by one at a time, and
  /// not always a better one than before. Empty: nobody asks. It changes nothing in the result.
  std::function<void(const Solution&)> interim;
  /// Makes the contact forces of a rollout, one for each thread; empty: the general model.
  std::function<std::unique_ptr<ContactForces<Plane>>()> contact;
};

/// The result of `Solve`.
struct SolveOutcome {
  /// One for each start, best first: feasible before refused before infeasible, then by cost. Empty
  /// when interrupted before the first batch of the search was done.
  std::vector<Solution> solutions;
  /// In the order of stage, start and count: the same for any number of threads.
  std::vector<Evaluation> history;
  /// Of the global search and all local solves.
  std::int64_t evaluations = 0;
  bool interrupted = false;
};

/// Finds a motion without a guess: by a global search over random splines, a few iterations of
/// SolveNear in lanes from the best of them, or of SLSQP (NLopt) where lanes do not cover the
/// problem, and SolveNear from the best of what comes of that, each by what is free of the paths
/// where joints are tied (FreePaths): until one motion is as asked, or
/// with `solver.prove` until `solver.finalists` motions have converged. A joint with more than 12
/// control points is searched for with 12, and what is found is refined with all of them.
SolveOutcome Solve(const Problem& problem, const SolveOptions& options);

/// Finds the motion near a guess: by SolveNear from there, without a search. It ends as soon as a
/// step promises little more. When a motion is then refused or breaks a limit, it is solved on with
/// the rest of `solver.max_evaluations`.
/// @param guess  parameters of the problem.
SolveOutcome SolveFromGuess(const Problem& problem, std::span<const double> guess,
                            const SolveOptions& options);

/// Which digits of cost, constraints and gradients count.
enum class Digits {
  kAll,
  /// The first 20 binary ones, those of a gradient relative to its largest component. SLSQP makes
  /// differences of 1e-15 ones of 1e-4 within 24 evaluations, and then two computations that differ
  /// by rounding go two ways; so they hardly do.
  kThatRoundingSpares
};

/// Runs SLSQP from one start. It has converged when what is left of the Kuhn-Tucker condition is
/// below a thousandth of the cost's gradient, at its start or its end. Its variables are the
/// parameters [rad], which are of order one already. The cost is divided by its gradient at the
/// start, and every constraint by its limit, because NLopt's SLSQP fails on large gradients.
/// @param history  gets the evaluations appended; may be null.
/// @param box_rad  it goes no farther than this from where it is before it looks again, and only a
/// quarter as far each time that gained nothing; and it forgets what costs three times what the
/// start does. For motions among cliffs, where SLSQP's first steps lead over one, and what is found
/// there breaks fewer limits since the robot lies still. Infinite: not so.
Solution SolveFrom(const Problem& problem, std::span<const double> start, int max_evaluations,
                   Rollout& rollout, const SolveOptions& options, std::vector<Evaluation>* history,
                   Digits digits = Digits::kAll,
                   double box_rad = std::numeric_limits<double>::infinity());

}  // namespace tumbler
