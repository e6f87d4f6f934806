#pragma once

#include "offline/pages/report.h"
#include "offline/problem/problem.h"
#include "offline/scene/motion_sample.h"

namespace tumbler {

/// The data of a report page without a motion: the robot's links and joints, and the obstacles.
ReportData ReportScene(const Problem& problem);

/// The data of one instant of a motion, for the page of ReportScene.
ReportSample ShownSample(const Problem& problem, const MotionSample& sample);

}  // namespace tumbler
