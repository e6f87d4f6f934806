#pragma once

#include "offline/solve/solver.h"

namespace tumbler {

/// Settings of the search for motions of robots in space.
struct SpaceSearch {
  /// Candidates of a generation of CMA-ES.
  int population = 24;
  /// Generations of an attempt, at most. An attempt ends sooner where nothing is gained.
  int generations = 250;
  /// An attempt ends when so many generations together have not lowered the rank by a hundredth.
  int patience = 40;
  /// Initial standard deviation of every control point [rad].
  double sigma_rad = 0.35;
  /// Attempts, each from a start of its own, until a motion is as asked.
  int attempts = 8;
  /// Most evaluations of cost and gradient with SolverSettings::screen_step_s, and then with the
  /// solver's own steps where no proof is asked for.
  int screen_evaluations = 60, finish_evaluations = 25;
  /// Without a proof, SLSQP ends when the cost changes by less than this part of itself.
  double enough = 1e-3;
  /// Weight in the rank of the square of what a velocity or an acceleration exceeds its limit by,
  /// as a part of it, for each bound.
  double limit_penalty = 1;
};

/// Finds a motion of a robot in space without a guess, and without a schedule of contacts: CMA-ES
/// on random paths, ranked by a coarse simulation, then SLSQP with the adjoint's gradient from the
/// best of them, with the solver's steps; from another start when that is not as asked.
/// @pre Problem::space.
SolveOutcome SolveInSpace(const Problem& problem, const SolveOptions& options,
                          const SpaceSearch& search = {});

/// Finds the motion near a guess: by SLSQP from there.
/// @pre Problem::space.
SolveOutcome SolveInSpaceFrom(const Problem& problem, std::span<const double> guess,
                              const SolveOptions& options);

}  // namespace tumbler
