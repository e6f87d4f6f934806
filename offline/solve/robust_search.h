#pragma once

#include <span>

#include "common/core/primitive.h"
#include "offline/solve/solver.h"

namespace tumbler {

/// Finds a motion that robots survive which differ from the problem's (`Problem::robust`), without
/// a guess, in lanes (`LaneKernel`):
///
/// 1. Motions are found for the model, without a guess (Solve).
/// 2. They are led to where robots arrive so that they come to rest (Capture). Where how robots
///    arrive does not tell what comes of them, random motions are improved in place of these.
/// 3. CMA-ES improves the best with `polish_robots`.
///
/// A robot follows the motion through its drives, with the plan's torques as feed-forward. What is
/// minimised is the mean over the robots of how far they are from resting at the targets: less than
/// 0.2 for one that does what the motion's purpose asks for, 0.35 ... 0.65 for one that is near,
/// and more than 1 for one that fell; and penalties for limits that the plan itself does not keep.
///
/// Joints that are tied follow the others in every motion: CMA-ES changes what is free of the paths
/// (FreePaths).
///
/// @returns motions, the most robust first, with the figures that `Solve` gives. `options.accept`
///          and `options.contact` do not count. The result does not depend on the threads.
/// @param guess  parameters of the problem: a motion that is only polished, with `polish_robots`.
///               Where one robot is known by a posterior and that does not do, it is led before, as
///               in step 2. Empty: none. Joints that are tied follow the others in it.
/// @param gains  of a feedback that the guess gets as they are, where the problem asks for one: for
///               its joints in their order, with knots for its duration. Null: they are found.
/// @param complement  motions of the problem's joints that are tried before this one: only robots
///                    count that none of them carries, and the guess is changed for one of these at
///                    first. Empty: all do.
/// @throws std::runtime_error  when the motions to complement carry all but a few of many robots,
/// or
///                             nothing is found that carries one of the others.
/// @pre problem.robust, and no feedback in it where there is a complement
SolveOutcome SolveRobust(const Problem& problem, const SolveOptions& options,
                         std::span<const double> guess = {},
                         const Feedback<double>* gains = nullptr,
                         std::span<const Primitive<double>> complement = {});

}  // namespace tumbler
