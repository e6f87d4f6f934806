#pragma once

#include "offline/solve/solver.h"

namespace tumbler {

/// Settings of the search for motions of robots in space.
struct SpaceSearch {
  /// Candidates of a generation of CMA-ES: three for four variables, and at most so many.
  int population = 24;
  /// Generations of an attempt, at most. An attempt ends sooner where nothing is gained.
  int generations = 250;
  /// An attempt ends when so many generations together have not lowered the rank by a hundredth.
  int patience = 40;
  /// Once its best motion is on target and within limits, it ends when half as many have not
  /// lowered the rank by this part.
  double worth = 0.2;
  /// While waypoints lead it, it ends when half as many have not lowered the rank by this part: few
  /// attempts find the way, and those do so soon.
  double led = 0.05;
  /// Initial standard deviation of every control point [rad].
  double sigma_rad = 0.35;
  /// An axis that starts more than a right angle from where it is to point is asked for at so many
  /// instants of the motion, too, until candidates come near: the square of the misalignment is
  /// flat where the axis points the other way, and a robot on its back gains nothing by small
  /// motions, unless one that tilts it for a while ranks better than one that does not.
  int waypoints = 5;
  /// Random motions among which an attempt finds the one that it begins with, where there are
  /// waypoints. Where a robot lies flat, small motions about the straight line do not tilt it.
  int draws = 240;
  /// A motion has come near its targets when what it misses them by costs less than this part of
  /// what the first motion does.
  double near = 0.1;
  /// The waypoints are left away when so large a part of a generation has come near.
  double most = 0.5;
  /// How far SLSQP goes at once from a motion that waypoints led to [rad] (SolveFrom), or from one
  /// that it could not make keep a limit, which this part of it or less is exceeded by.
  double box_rad = 0.05, little = 0.1;
  /// Attempts, each from a start of its own, until a motion is as asked.
  int attempts = 8, led_attempts = 40;
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
