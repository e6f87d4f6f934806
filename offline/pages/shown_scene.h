#pragma once

#include "offline/pages/report.h"
#include "offline/problem/problem.h"
#include "offline/scene/motion_sample.h"

namespace tumbler {

/// A point, as of a mesh in contact, has no extent: pages show it as a ball of this radius [m].
inline constexpr double kShownPoint_m = 0.003;

/// The data of a report page without a motion: the robot's links and joints, and the obstacles.
ReportData ReportScene(const Problem& problem);

/// The data of one instant of a motion, for the page of ReportScene.
ReportSample ShownSample(const Problem& problem, const MotionSample& sample);

}  // namespace tumbler
