#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/bench/bench_tests.h"

namespace tumbler {

/// Something that is not as the drives file says, or as it should be.
struct BenchFinding {
  /// A name for programs, such as `identifiers-exchanged`; docs/formats.md lists them.
  std::string kind;
  std::string subject;  ///< A joint, a drive, or `bus`.
  std::string text;     ///< The finding with its numbers, and what follows from it.
  bool mended = false;  ///< Whether the drives file that is written has it right.
};

/// What was looked at: nothing counts as right that does not stand here.
struct Judgement {
  std::vector<BenchFinding> findings;
  std::vector<std::string> judged;    ///< In a few words each, with the drive or joint.
  std::vector<std::string> not_told;  ///< What the measurements do not tell, and why.

  void Add(const Judgement& more) {
    findings.insert(findings.end(), more.findings.begin(), more.findings.end());
    judged.insert(judged.end(), more.judged.begin(), more.judged.end());
    not_told.insert(not_told.end(), more.not_told.begin(), more.not_told.end());
  }
};

/// From when on something counts as a finding.
struct BenchTolerances {
  double zero_rad = 0.05;       ///< What hands and eyes are good for.
  double range_rad = 0.1;       ///< Of each end of a joint's way.
  double lost_share = 0.001;    ///< Of replies.
  double late_periods = 1;      ///< 99 % of replies within so many periods of the loop.
  double watchdog_share = 0.2;  ///< By how much a time-out may differ, besides what was resolved.
};

/// A joint of the robot, as far as commissioning needs it.
struct BenchJoint {
  std::string name;
  double lower_rad = 0;  ///< Ends of its way.
  double upper_rad = 0;
  double reference_rad = 0;  ///< The pose in which its zero is found.
};

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
/// The scale of a joint's reported positions: the way between its limits to the way through which
/// it was turned; 1 where that is the same by the tolerance. Nothing: it was not turned.
std::optional<double> WayScale(const BenchJoint& joint, const TurnedResult& turned,
                               const BenchTolerances& tolerances);
/// The joint's position that a drive can be asked for and can report, against the joint's limits.
std::vector<BenchFinding> JudgeRanges(const std::string& drive, const DriveEntry& entry,
                                      const BenchJoint& joint);

/// A joint that is reported outside its limits, with the torque off.
std::vector<BenchFinding> JudgePlace(const std::string& drive, double position_rad,
                                     const BenchJoint& joint, const BenchTolerances& tolerances);

Json ToJson(const std::vector<BenchFinding>& findings);

}  // namespace tumbler
