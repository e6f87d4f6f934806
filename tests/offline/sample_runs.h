#pragma once

#include "offline/rehearsal/flight_report/run_data.h"

namespace tumbler {

/// A run of the sample motion's robot, made from formulas: 2 s at 100 Hz, arming, running from 0 s
/// to 1.2 s, settling to 1.5 s, holding. Commands are 0.01 rad beside the plan, measurements 0.02
/// rad, the truth 0.03 rad; the first three ticks have no reply. The plan's root is 0.1 m to the
/// right of the truth's. Requests, and a fault at 0.9 s.
RunData SampleRun();

}  // namespace tumbler
