#pragma once

#include "offline/pages/robot_paths.h"
#include "offline/pages/run_data.h"

namespace tumbler {

/// Adds the planned motion of a run whose ticks and bands are there.
/// @param start_node  where the robot rests in a run without a motion.
void AddPlan(RunData& run, RobotPaths& paths, int start_node);

}  // namespace tumbler
