#pragma once

#include "offline/problem/problem.h"
#include "offline/report/report.h"
#include "offline/scene/motion_sample.h"

namespace tumbler {

/// What a report page shows of a robot and what it touches: links, joints and obstacles, no motion.
ReportData ReportScene(const Problem& problem);

/// One instant of a motion, for the page of that scene.
ReportSample ShownSample(const Problem& problem, const MotionSample& sample);

}  // namespace tumbler
