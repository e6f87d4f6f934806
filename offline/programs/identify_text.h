#pragma once

#include <cstdio>
#include <string>
#include <vector>

#include "offline/problem/posterior_toml.h"
#include "offline/studies/excitation.h"
#include "offline/studies/gate.h"
#include "offline/studies/recorded_motion.h"
#include "offline/studies/robot_fit.h"

namespace tumbler {

/// What tumbler identify prints for people.

/// What the record of an excitation is expected to tell.
/// @param after  records before it, if any.
void PrintExpected(const Excitation& found, const std::vector<std::string>& after);
/// What is used of a record.
void PrintReadings(const RecordedMotion& record);
/// Every quantity with its interval, and what the model is worth.
void PrintFit(const FitOutcome& fit, const FitSettings& settings);
/// Quantities that are far from what was known of them before.
void PrintFarOff(const RobotPosterior& posterior, const RobotPosterior& prior);

/// Names of files that a gate was given.
struct GateFiles {
  std::string posterior, drives;  ///< No drives: the default ones.
};
/// What the gate played, what became of it, and whether it is open.
/// @param file  the posterior.
void PrintGate(std::FILE* people, const GateOutcome& outcome, const GateSettings& settings,
               const PosteriorFile& file, const GateFiles& names);

}  // namespace tumbler
