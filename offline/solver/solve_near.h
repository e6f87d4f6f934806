#pragma once

#include <span>
#include <vector>

#include "offline/rollout/adaptive_rollout.h"
#include "offline/solver/solver.h"

namespace tumbler {

/// Solves from a start that is near a solution, and stays near it: sequential quadratic programming
/// with a trust region, for motions that are known from another task.
///
/// In each iteration, the step p minimises the quadratic model of the cost within the box |p_i| <=
/// radius, the position limits and the limits of velocity and acceleration, which are linear, so
/// that no iterate violates them. Torque, penetration and clearance are linearised, and violating
/// them costs a price that grows until it pays to keep them (an exact l1 penalty) [Fletcher 1987,
/// chapter 14]. The step is taken when cost and price together fall by enough of what the model
/// promises, and the radius follows from how well the model did: so the motion never jumps into
/// another basin, however low it is.
///
/// The model's matrix is that of Gauss and Newton for the squares of the cost, from the forward
/// sensitivities. A step that misses its targets because they are curved is corrected once, by the
/// shortest way back [Nocedal and Wright 2006, chapters 10 and 18].
///
/// @param max_evaluations  most evaluations of cost and gradient.
/// @param enough           ends when a step promises to lower the cost by less than this part of
/// it.
/// @param history          gets the evaluations appended; may be null.
Solution SolveNear(const Problem& problem, std::span<const double> start, int max_evaluations,
                   double enough, AdaptiveRollout& rollout, const SolveOptions& options,
                   std::vector<Evaluation>* history);

}  // namespace tumbler
