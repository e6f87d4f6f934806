#pragma once

#include "offline/pages/report.h"

namespace tumbler {

/// A handstand of the three-link tumbler as a report shows it, made from formulas and not by the
/// optimiser. Leg angles and root pitch are smooth functions of time, the lowest foot stays on the
/// ground, and forces and torques follow from the accelerations of the links. It has 1.2 s of
/// motion and 0.3 s of settling, with 200 samples a second.
ReportData SampleMotion();

}  // namespace tumbler
