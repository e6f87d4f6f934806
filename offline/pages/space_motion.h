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

/// The parameters of a primitive's paths.
/// @pre the task is that of the primitive.
std::vector<double> ParametersOf(const Problem& problem, const Primitive<double>& primitive);

}  // namespace tumbler
