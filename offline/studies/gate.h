#pragma once

#include <string>
#include <vector>

#include "offline/problem/posterior_toml.h"
#include "offline/studies/trial.h"

namespace tumbler {

/// Settings of a gate.
struct GateSettings {
  int draws = 3;          ///< Robots beside the mean.
  double deviations = 2;  ///< By so many are they drawn.
  std::uint64_t seed = 1;
};

/// What became of the robots of a posterior in a motion: of its mean first, then of the draws.
struct GateOutcome {
  std::vector<TrialOutcome> robots;
  /// Whether all of them are as asked. Only then is the motion to be tried on the robot.
  [[nodiscard]] bool open() const;
};

/// Plays a motion in the twin of the robot that was identified, and of robots that it may be. Each
/// is played through the executor, simulated drives and the twin.
/// @param motion  primitive or sequence, of whatever model of the robot.
/// @param drives  those of the records; empty: the default ones, as in tumbler run.
/// @throws FileError, Refused, std::runtime_error  as tumbler run sim does;
///         std::invalid_argument  when the motion's robot lacks a link or joint of the posterior.
GateOutcome PassGate(const std::string& motion, const std::string& drives,
                     const RobotPosterior& posterior, const GateSettings& settings);

}  // namespace tumbler
