#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "offline/scene/variation.h"
#include "offline/studies/abort_trial.h"

namespace tumbler {

/// What is asked about the aborts of a primitive.
struct AbortStudy {
  std::string primitive;  ///< Its file.
  std::string drives;     ///< Drives file; empty: that which the twin file names, if any.
  std::string twin;       ///< Twin file for what all robots share; empty: none.
  std::uint64_t seed = 1;
  double scale = 1;  ///< Of all spreads.
  Spreads spreads;
  int robots = 16;       ///< The model and robots that are not.
  double step_s = 0.03;  ///< About how long a part of the motion is that is looked at.
  double late_s =
      0.02;  ///< The latest tick that robots get: before drives' watchdogs take them off.
  int threads = 1;
  /// Set it from any thread to end early; may be null.
  const std::atomic<bool>* interrupt = nullptr;
  /// Told how many of all aborts were played, now and then; may be empty.
  std::function<void(int played, int of)> progress;
};

/// The trials of a study. @throws FileError, Refused, std::runtime_error  as `tumbler run sim`
/// does, and Refused when the motion is no primitive, or robots in space cannot differ so.
AbortTrials LoadAbortTrials(const AbortStudy& study);
/// Robot number `index` of a study; number 0 is the model.
RobotVariation AbortRobot(const AbortStudy& study, const SharedRobot& shared, int index);

/// A way in which the motion might be aborted.
struct AbortCandidate {
  std::string name;  ///< e.g. "fold to the end, share 0.2"
  AbortWay way = AbortWay::kCatch;
  double late_max_s = 0;             ///< Of kRollOut.
  double limits_share = 0;           ///< Of kFold.
  std::vector<double> position_rad;  ///< Of kFold.
};

/// What one way costs in one part of the motion's time.
struct AbortCost {
  int robots = 0;         ///< How many were played; those of a way that hurts much are fewer.
  double impact_m_s = 0;  ///< Root mean square over the robots of the hardest impact.
  double worst_m_s = 0;   ///< The largest.
  std::string link;       ///< Of that one.
  double torque_nm = 0;   ///< Largest of a motor.
  int rest = 0;           ///< How many rest in a pose in which the motion begins or ends.
  int overlap = 0;        ///< Of how many own shapes overlapped.
  /// What is made as small as can be: the mean of `impact_m_s` and `worst_m_s`, and for each robot
  /// its share of 0.1 m/s where it does not rest in such a pose, and of 10 m/s where its own shapes
  /// overlap.
  [[nodiscard]] double cost_m_s() const;
};

/// A part of the motion's time.
struct AbortPart {
  double from_s = 0, to_s = 0;
  std::vector<AbortCost> costs;  ///< Of each candidate.
  std::size_t chosen = 0;        ///< The candidate.
};

struct AbortResult {
  std::string name;  ///< Of the primitive.
  AbortStudy study;
  std::string primitive_hash;  ///< Of the primitive's file when the study began.
  std::vector<AbortCandidate> candidates;
  std::vector<AbortPart> parts;  ///< In order, without gaps.
  AbortTable<double> table;
  AbortFigure figure;
};

/// Finds the way that hurts the robot least, for each part of a primitive's time.
///
/// In each part every robot's motion is aborted at a random time, half of them by a stop of the
/// operator, and half by a loop that is late: by `late_s`, or a half or a quarter of it. Candidates
/// are a catch; roll-outs of motions that are late by no more than one of these; folds to the start
/// and to the end of the motion, slower and faster; and damping. A catch or fold that hurts the
/// first three robots much more than another way is not played on the rest. The sum of the costs is
/// made as small as can be, where a change of the way costs 0.3 m/s, and more where there would be
/// too many spans. The result does not depend on `threads`.
///
/// @returns empty parts when it was interrupted.
/// @throws as LoadAbortTrials.
AbortResult FindAborts(const AbortStudy& study);

/// Writes table and figure into the primitive's file. @throws FileError; Refused when the file is
/// another than that which was studied.
void WriteAborts(const AbortResult& result);

/// For people: a line for each part, with what every way costs, and the table.
std::string ToText(const AbortResult& result);
Json ToJson(const AbortResult& result);

}  // namespace tumbler
