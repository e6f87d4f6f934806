#pragma once

#include "offline/scene/robot_posterior.h"
#include "offline/studies/recorded_motion.h"
#include "offline/studies/robot_fit.h"

namespace tumbler {

/// What tumbler identify fit prints for people.

/// What is used of a record.
void PrintReadings(const RecordedMotion& record);
/// Every quantity with its interval, and what the model is worth.
void PrintFit(const FitOutcome& fit, const FitSettings& settings);
/// Quantities that are far from what was known of them before.
void PrintFarOff(const RobotPosterior& posterior, const RobotPosterior& prior);

}  // namespace tumbler
