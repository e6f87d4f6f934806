#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "firmware_interface/devices/drives_draft.h"
#include "runtime/bench/bench_operator.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/bench_tests.h"
#include "runtime/bench/bus_scan.h"
#include "runtime/bench/drive_scales.h"
#include "runtime/bench/findings.h"
#include "runtime/bench/step_page.h"

namespace tumbler {

/// How far commissioning goes.
struct CommissionConfig {
  ScanConfig scan;
  BenchBounds bounds;
  BenchTolerances tolerances;
  double replies_s = 60;     ///< How long replies are measured.
  bool turn_by_hand = true;  ///< Whether joints are turned to both ends of their way.
  StepConfig step;
};

/// What became of a commissioning.
struct CommissionResult {
  std::vector<FoundDrive> found;
  std::vector<ReplyResult> replies;  ///< In the order of the drives file, likewise below.
  std::vector<DriveScales> scales;
  std::vector<WatchdogResult> watchdogs;
  std::vector<NamedStep> steps;
  Judgement judgement;
};

/// Goes the whole way with a robot whose drives a draft describes: looks for the drives, measures
/// their replies, finds out by small motions which joint each drive turns and in which direction,
/// sets the joints' zeros in a known pose, has the joints turned through their ways, compares what
/// drives are asked for with what they report, proves the watchdogs by staying silent, and measures
/// a step response. The draft becomes what was found.
///
/// @param keep  called with the draft whenever it is better than before.
/// @throws Refused  when a drive does not answer, reports an error, or no joint can be told to be
///                  its; besides what BenchSession throws.
CommissionResult Commission(BenchWorld& world, DrivesDraft& draft,
                            const std::vector<BenchJoint>& joints, BenchOperator& somebody,
                            const CommissionConfig& config,
                            const std::function<void(const DrivesDraft&)>& keep);

/// Compares what was found with a drives file: drives that are missing or unknown, and identifiers
/// of replies.
std::vector<BenchFinding> CompareWithDraft(const std::vector<FoundDrive>& found,
                                           const DrivesConfig& drives);
Json ToJson(const CommissionResult& result);

}  // namespace tumbler
