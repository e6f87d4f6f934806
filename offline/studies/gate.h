#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "offline/problem/posterior_toml.h"
#include "offline/scene/variation.h"
#include "offline/studies/identified_model.h"
#include "offline/studies/trial.h"

namespace tumbler {

/// The robots that a gate plays beside the mean.
struct GateDraws {
  int count = 3;
  double deviations = 2;  ///< By so many are they drawn.
};
/// Of an effective model: where a third of its robots falls, three pass by chance; and what it does
/// not explain of its records is not in its deviations.
inline constexpr GateDraws kDrawsOfEffective = {12, 2.5};

/// Settings of a gate.
struct GateSettings {
  /// None: GateDraws, or kDrawsOfEffective.
  std::optional<int> draws = {};
  std::optional<double> deviations = {};
  std::uint64_t seed = 1;
  UntoldSpreads margins;
  /// Motions that the robot has failed in, with the encoders' zeros of its records. A model that
  /// stands in one of them is not to be believed where it stands in another
  /// (GateOutcome::credible).
  std::vector<std::string> failed;
  /// Set it from any thread to end early; may be null.
  const std::atomic<bool>* interrupt = nullptr;
};

/// What robots of a posterior do in a motion that the robot has failed in.
struct FailedMotion {
  std::string motion;
  bool mean_fails = false;
  /// Draws that do not fail in it, though they do in those before it: none of them is this robot.
  int left_out = 0;
};

/// What became of the robots of a posterior in a motion: of its mean first, then of the draws.
struct GateOutcome {
  /// Fewer than were asked for where too many draws were left out.
  std::vector<TrialOutcome> robots;
  GateDraws draws;                   ///< As they were asked for.
  DrivesConfig drives;               ///< With which they were played.
  std::vector<FailedMotion> failed;  ///< Those of the settings, in their order.
  bool interrupted = false;          ///< Then nothing is decided.
  /// Draws that were left out.
  [[nodiscard]] int left_out() const;
  /// Whether the mean fails in all motions that the robot has failed in, and as many draws do as
  /// were asked for.
  [[nodiscard]] bool credible() const;
  /// Whether all robots are as asked, and credible, and all were played. Only then is the motion to
  /// be tried on the robot.
  [[nodiscard]] bool open() const;
};

/// Plays a motion in the twin of the robot that was identified, and of robots that it may be. Each
/// is played through the executor, simulated drives and the twin. Draws that do not fail where the
/// robot did are left out, and others drawn for them, until twice as many were drawn as are asked
/// for: a posterior of which more is left out has not understood why the robot failed.
/// @param motion  primitive or sequence, of whatever model of the robot.
/// @param drives  those of the run; empty: the default ones, as in tumbler run. Their zeros may
///                differ from those of the records.
/// @throws FileError, Refused, std::runtime_error  as tumbler run sim does; std::invalid_argument
///         when the drives are others than those of the records, or the motion's robot lacks a link
///         or joint of the posterior; Refused where nobody can say whether a robot fails in a
///         motion of GateSettings::failed, since it asks for nothing.
GateOutcome PassGate(const std::string& motion, const std::string& drives,
                     const PosteriorFile& posterior, const GateSettings& settings);

/// Whether robots fail in a motion, as the gate plays them: for FitSettings::fails. Copies of the
/// function play in one twin, and are not to be called at the same time.
/// @param drives  those of the records; empty: the default ones.
/// @param like    quantities that the coordinates are of, and drives of the records.
/// @throws  as PassGate.
std::function<bool(const std::vector<double>& coordinates)> FailsIn(const std::string& motion,
                                                                    const std::string& drives,
                                                                    const PosteriorFile& like);

/// What became of them as JSON.
std::string ToJson(const GateOutcome& outcome, const GateSettings& settings,
                   const std::string& motion, const std::string& drives,
                   const std::string& posterior, bool effective);

}  // namespace tumbler
