#pragma once

#include <functional>
#include <span>
#include <vector>

#include "offline/certify/space_trial.h"
#include "offline/solve/solver.h"

namespace tumbler {

/// What the search for robust motions in space finds.
struct RobustInSpace {
  /// Motions, best first, the one that it began with among them.
  std::vector<std::vector<double>> motions;
  std::int64_t played = 0;  ///< Motions of robots, in all.
};

/// How many of `robots` robots do what a motion is for, which the search has not met.
int CountAsAskedInSpace(const Problem& problem, const std::vector<double>& x,
                        std::span<const PurposeFigure> purpose, const SolveOptions& options,
                        int robots);

/// Changes a motion until robots that differ from the model do what it is for: CMA-ES on its free
/// control points, in which each candidate is played through drives on robots that are others in
/// each generation, and judged by how far each target is missed, and by what the model exceeds its
/// limits by. A target counts as missed from 0.6 of its tolerance on.
/// @param found    parameters of a motion that serves the model.
/// @param purpose  what it is for, such as SecondLook::purpose.
/// @pre Problem::space and its `robust`.
/// @throws std::invalid_argument  about a purpose that cannot be judged.
RobustInSpace FindRobustInSpace(const Problem& problem, const std::vector<double>& found,
                                std::span<const PurposeFigure> purpose,
                                const SolveOptions& options);

}  // namespace tumbler
