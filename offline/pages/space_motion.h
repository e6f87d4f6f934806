#pragma once

#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/pages/space_page.h"
#include "offline/problem/task_toml.h"

namespace tumbler {

/// The page of a motion in space, simulated with the solver's steps to the end of its settle phase.
/// @param x     parameters of the motion.
/// @param file  what was made of it.
SpaceMotionPage MakeSpaceMotionPage(const Task& task, const std::vector<double>& x,
                                    const PrimitiveFile& file);

}  // namespace tumbler
