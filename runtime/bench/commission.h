#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/json.h"
#include "runtime/bench/bench_operator.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/bench_tests.h"
#include "runtime/bench/bus_scan.h"
#include "runtime/bench/drives_draft.h"
#include "runtime/bench/findings.h"
#include "runtime/bench/step_page.h"

namespace tumbler {

/// A joint of the robot, as far as commissioning needs it.
struct BenchJoint {
  std::string name;
  double lower_rad = 0;  ///< Ends of its way.
  double upper_rad = 0;
  double reference_rad = 0;  ///< The pose in which its zero is found.
};

/// From when on something counts as a finding.
struct BenchTolerances {
  double zero_rad = 0.05;       ///< What hands and eyes are good for.
  double range_rad = 0.1;       ///< Of each end of a joint's way.
  double lost_share = 0.001;    ///< Of replies.
  double late_periods = 1;      ///< 99 % of replies within so many periods of the loop.
  double watchdog_share = 0.2;  ///< By how much a time-out may differ, besides what was resolved.
};

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
  std::vector<WatchdogResult> watchdogs;
  std::vector<NamedStep> steps;
  std::vector<BenchFinding> findings;
};

/// Goes the whole way with a robot whose drives a draft describes: looks for the drives, measures
/// their replies, finds out by small motions which joint each drive turns and in which direction,
/// sets the joints' zeros in a known pose, has the joints turned through their ways, proves the
/// watchdogs by staying silent, and measures a step response. The draft becomes what was found.
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
/// Judges the replies of a drive.
std::vector<BenchFinding> JudgeReplies(const std::string& drive, const ReplyResult& result,
                                       double period_s, const BenchTolerances& tolerances);
/// Judges a step: more than half of it remains.
std::vector<BenchFinding> JudgeStep(const std::string& drive, const StepConfig& config,
                                    const StepResult& result);
/// Judges the reaction of a drive to silence. No finding is marked as mended.
std::vector<BenchFinding> JudgeWatchdog(const std::string& drive, const WatchdogResult& result,
                                        double expected_s, double period_s,
                                        const BenchTolerances& tolerances);
/// Compares the way through which a joint was turned with its limits.
std::vector<BenchFinding> JudgeWay(const BenchJoint& joint, const TurnedResult& turned,
                                   const BenchTolerances& tolerances);
/// The joint's position that a drive can be asked for and can report, against the joint's limits.
std::vector<BenchFinding> JudgeRanges(const std::string& drive, const DriveEntry& entry,
                                      const BenchJoint& joint);

Json ToJson(const CommissionResult& result);

}  // namespace tumbler
