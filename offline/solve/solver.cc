#include "offline/solve/solver.h"

#include <algorithm>
#include <array>
#include <map>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "offline/solve/campaign.h"
#include "offline/solve/guess.h"
#include "offline/solve/solve_near.h"

namespace tumbler {

const char* ToString(SolveEnd end) {
  switch (end) {
    case SolveEnd::kConverged:
      return "converged";
    case SolveEnd::kConvergedCoarsely:
      return "converged, but not by finer steps";
    case SolveEnd::kStalled:
      return "stopped making progress";
    case SolveEnd::kEnough:
      return "good as asked; the next step would lower the cost by less than a tenth";
    case SolveEnd::kUnproved:
      return "as asked; whether it is at a minimum was not proved, which --prove asks for";
    case SolveEnd::kEvaluations:
      return "evaluation budget used up";
    case SolveEnd::kGenerations:
      return "the search is over; more generations may find better";
    case SolveEnd::kAllRest:
      return "all robots of the search rest as asked, with a margin";
    case SolveEnd::kTaken:
      return "taken from the guess as it is";
    case SolveEnd::kInfeasible:
      return "constraints contradict each other";
    case SolveEnd::kInterrupted:
      return "interrupted";
    case SolveEnd::kFailed:
      return "the rollout fails at the start";
  }
  return "unknown";
}

namespace {

/// When a refinement ends: first, as soon as a step promises less than a tenth of the cost; if
/// that is not good enough, a thousandth; if that is not either, when it has converged.
constexpr std::array kEnoughOfGuess = {0.1, 1e-3, 0.0};

/// Solves on from a motion that is nearly good, in one stage or two, until it is good enough.
class Refinement {
 public:
  Refinement(const Problem& problem, const SolveOptions& options)
      : problem_(problem), options_(options), rollouts_(problem, options) {
    options_.progress = nullptr;  // Several may run at a time, each for a moment.
  }

  Solution Run(std::span<const double> guess, int start) {
    Solution solution;
    solution.x.assign(guess.begin(), guess.end());
    solution.start = start;
    for (const double enough : kEnoughOfGuess) {
      SolveOn(solution, enough);
      if (interrupted() || (solution.feasible() && !solution.refused)) break;
    }
    return solution;
  }

  /// Solves a motion on with what is left of its budget.
  /// @param enough  as SolveNear's.
  void SolveOn(Solution& solution, double enough) {
    const int before = solution.evaluations;
    const int budget = problem_.solver.max_evaluations - before;
    if (budget <= 0) return;
    std::vector<Evaluation> history;
    Solution found =
        SolveNear(problem_, solution.x, {budget, enough}, rollouts_, options_, &history);
    for (Evaluation& evaluation : history) {
      evaluation.start = solution.start;
      evaluation.count += before;
      history_.push_back(evaluation);
    }
    if (before > 0) found.start_cost = solution.start_cost;
    found.evaluations += before;
    found.start = solution.start;
    found.finished = true;
    if (options_.accept && found.feasible() && !interrupted())
      found.refused = !options_.accept(found);
    if (options_.calm && found.feasible() && !found.refused && !interrupted())
      found.beside_cliff = !options_.calm(found);
    solution = std::move(found);
  }
  [[nodiscard]] std::vector<Evaluation>& history() { return history_; }

 private:
  [[nodiscard]] bool interrupted() const {
    return options_.interrupt != nullptr && *options_.interrupt;
  }

  const Problem& problem_;
  SolveOptions options_;
  NearRollouts rollouts_;
  std::vector<Evaluation> history_;
};

/// The number of control points with which motions are searched for. The settings of the search
/// were chosen for it.
constexpr int kSearchPoints = 12;

Problem WithFewPoints(Problem problem) {
  for (ActuatedJoint& joint : problem.joints)
    joint.control_points = std::min(joint.control_points, kSearchPoints);
  return problem;
}

/// Solves the best motion on until it has converged, unless it is worse then.
void Converge(const Problem& problem, const SolveOptions& options, SolveOutcome& outcome) {
  Solution& best = outcome.solutions.front();
  if (outcome.interrupted || !best.feasible() || best.refused) return;
  Refinement refinement(problem, options);
  Solution further = best;
  refinement.SolveOn(further, 0);
  outcome.evaluations += further.evaluations - best.evaluations;
  outcome.history.insert(outcome.history.end(), refinement.history().begin(),
                         refinement.history().end());
  outcome.interrupted = options.interrupt != nullptr && *options.interrupt;
  if (further.feasible() && !further.refused && further.rollout.cost <= best.rollout.cost)
    best = std::move(further);
}

/// Finds a motion with few control points, and refines what is good enough of it.
SolveOutcome SolveWithManyPoints(const Problem& problem, const SolveOptions& options) {
  const Problem coarse = WithFewPoints(problem);
  if (options.to == SolveTo::kScreened) {
    SolveOutcome outcome = RunCampaign(coarse, options);
    for (Solution& solution : outcome.solutions)
      solution.x = WithControlPointsOf(problem, coarse, solution.x);
    return outcome;
  }
  std::mutex mutex;
  std::map<int, std::pair<Solution, std::vector<Evaluation>>> refined;  // by start
  const auto refine = [&](const Solution& solution) {
    Refinement refinement(problem, options);
    Solution fine =
        refinement.Run(WithControlPointsOf(problem, coarse, solution.x), solution.start);
    const bool good = fine.feasible() && !fine.refused;
    const std::lock_guard<std::mutex> lock(mutex);
    refined[solution.start] = {std::move(fine), std::move(refinement.history())};
    return good;
  };
  SolveOptions searching = options;
  searching.accept = refine;
  searching.interim = {};  // Motions of few points are none of the problem's.
  if (options.calm) {
    // It judges motions of the problem. What was refined has been judged.
    searching.calm = [&](const Solution& solution) {
      const std::lock_guard<std::mutex> lock(mutex);
      return !refined.at(solution.start).first.beside_cliff;
    };
  }
  SolveOutcome outcome = RunCampaign(coarse, searching, Asks::kAtEnd);
  // What keeps its limits was refined to be judged. When nothing did, the best one shows why.
  if (refined.empty() && !outcome.solutions.empty()) refine(outcome.solutions.front());
  outcome.solutions.clear();
  for (auto& [start, fine] : refined) {
    outcome.evaluations += fine.first.evaluations;
    outcome.history.insert(outcome.history.end(), fine.second.begin(), fine.second.end());
    outcome.solutions.push_back(std::move(fine.first));
  }
  std::stable_sort(outcome.solutions.begin(), outcome.solutions.end(), IsBetter);
  if (!outcome.solutions.empty()) Converge(problem, options, outcome);
  return outcome;
}

}  // namespace

SolveOutcome Solve(const Problem& problem, const SolveOptions& options) {
  const bool few = std::ranges::all_of(problem.joints, [](const ActuatedJoint& joint) {
    return joint.control_points <= kSearchPoints;
  });
  if (few) return RunCampaign(problem, options);
  return SolveWithManyPoints(problem, options);
}

SolveOutcome SolveFromGuess(const Problem& problem, std::span<const double> guess,
                            const SolveOptions& options) {
  Refinement refinement(problem, options);
  SolveOutcome outcome;
  outcome.solutions.push_back(refinement.Run(guess, 0));
  outcome.evaluations = outcome.solutions.front().evaluations;
  outcome.history = std::move(refinement.history());
  outcome.interrupted = options.interrupt != nullptr && *options.interrupt;
  if (problem.solver.prove) {
    const Solution& found = outcome.solutions.front();
    if (options.interim && !outcome.interrupted && found.feasible() && !found.refused)
      options.interim(found);
    Converge(problem, options, outcome);
  }
  return outcome;
}

}  // namespace tumbler
