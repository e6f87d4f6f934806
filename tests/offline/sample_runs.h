#pragma once

#include "offline/pages/run_data.h"

namespace tumbler {

/// A run of the sample motion's robot, made from formulas. It takes 2 s at 100 Hz: arming, running
/// from 0 s to 1.2 s, settling to 1.5 s, holding. Commands differ from the plan by 0.01 rad,
/// measurements by 0.02 rad, and the truth by 0.03 rad. The first three ticks have no reply. The
/// plan's root is 0.1 m to the right of the true one. There are requests, and a fault at 0.9 s.
RunData SampleRun();

}  // namespace tumbler
