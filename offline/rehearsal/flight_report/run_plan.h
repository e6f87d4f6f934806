#pragma once

#include "offline/rehearsal/flight_report/robot_paths.h"
#include "offline/rehearsal/flight_report/run_data.h"

namespace tumbler {

/// Adds the planned motion of a run whose ticks and bands are there.
/// @param start_node  where the robot rests in a run without a motion.
void AddPlan(RunData& run, RobotPaths& paths, int start_node);

}  // namespace tumbler
