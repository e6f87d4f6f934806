#pragma once

#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/certify/chain.h"
#include "offline/pages/space_page.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"

namespace tumbler {

/// The page of a motion in space, simulated with the solver's steps to the end of its settle phase.
/// @param x     parameters of the motion.
/// @param file  what was made of it.
SpaceMotionPage MakeSpaceMotionPage(const Task& task, const std::vector<double>& x,
                                    const PrimitiveFile& file);

/// The page of a sequence in space that is played in simulation (SimulateChainInSpace, which it is
/// twice), and what became of it.
SpaceMotionPage MakeSpaceChainPage(const SimulatedMotion& motion, const ChainOptions& options);

}  // namespace tumbler
