#include "runtime/bench/findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tumbler {

std::vector<BenchFinding> JudgeReplies(const std::string& drive, const ReplyResult& result,
                                       double period_s, const BenchTolerances& tolerances) {
  std::vector<BenchFinding> findings;
  if (result.lost_share() > tolerances.lost_share) {
    findings.push_back(
        {"noisy-bus", drive,
         fmt::format("{} of {} replies of {} are lost, {:.2f} %, and {:.2f} % are borne: look at "
                     "termination, cables and bit timing{}",
                     result.lost, result.asked, drive, 100 * result.lost_share(),
                     100 * tolerances.lost_share,
                     result.answers ? "" : ", and at the period that its reports are set to")});
  }
  if (result.repeated > 0) {
    findings.push_back(
        {"repeated-replies", drive,
         fmt::format("{} more replies of {} came than {}: somebody on the bus repeats frames, and "
                     "losses cannot be told",
                     result.repeated, drive,
                     result.answers ? "it was asked for" : "its period in the drives file makes")});
  }
  const double late_ms = 1e3 * period_s * tolerances.late_periods;
  if (result.answers && (result.at_least || result.p99_ms > late_ms)) {
    findings.push_back({"late-replies", drive,
                        fmt::format("1 % of the replies of {} take {:.2f} ms or more, and a period "
                                    "is {:.2f} ms: look at the adapter's latency",
                                    drive, result.p99_ms, 1e3 * period_s)});
  }
  return findings;
}

std::vector<BenchFinding> JudgeStep(const std::string& drive, const StepConfig& config,
                                    const StepResult& result) {
  if (std::abs(result.remaining_rad) <= 0.5 * std::abs(config.size_rad)) return {};
  return {{"step-not-followed", drive,
           fmt::format("{:.4f} rad of the step of {} rad of {} remain: is its joint free, and are "
                       "the gains enough?",
                       result.remaining_rad, config.size_rad, drive)}};
}

std::vector<BenchFinding> JudgeWatchdog(const std::string& drive, const WatchdogResult& result,
                                        double expected_s, double period_s,
                                        const BenchTolerances& tolerances) {
  const double slack_s = tolerances.watchdog_share * expected_s + 2 * period_s;
  if (!result.let_go) {
    const std::string says =
        expected_s <= 0 ? std::string("the drives file says so, too")
        : expected_s < result.pushed_after_s - slack_s
            ? fmt::format("the {:.0f} ms of the drives file are not so", 1e3 * expected_s)
            : fmt::format("the {:.0f} ms of the drives file are not proved", 1e3 * expected_s);
    return {{"no-watchdog", drive,
             fmt::format("{} {}; {}: set its time-out, or arm it with --without-watchdog", drive,
                         Describe(result), says)}};
  }
  const bool late = expected_s < result.pushed_after_s - slack_s;
  const bool early = expected_s > result.limp_after_s + slack_s;
  // What is known only to lie on both sides of the expected time proves nothing. A drive that says
  // when it has let go was not pushed, and its word is late.
  const bool vague = result.pushed_after_s > 0 && result.limp_after_s > expected_s + slack_s;
  if (!late && !early && vague) {
    return {{"watchdog-unproved", drive,
             fmt::format("{} lets go between {:.0f} and {:.0f} ms after the last setpoint, and the "
                         "drives file says {:.0f} ms: that is not proved; this computer was too "
                         "late, or the joint went too far: try again",
                         drive, 1e3 * result.pushed_after_s, 1e3 * result.limp_after_s,
                         1e3 * expected_s)}};
  }
  if (!late && !early) return {};
  return {{"watchdog-differs", drive,
           fmt::format("{} lets go {:.0f} ms after the last setpoint, and the drives file says "
                       "{:.0f} ms",
                       drive, 1e3 * result.limp_after_s, 1e3 * expected_s)}};
}

std::vector<BenchFinding> JudgeWay(const BenchJoint& joint, const TurnedResult& turned,
                                   const BenchTolerances& tolerances) {
  const double lower_off = turned.lower_rad - joint.lower_rad;
  const double upper_off = turned.upper_rad - joint.upper_rad;
  if (turned.turned && std::abs(lower_off) <= tolerances.range_rad &&
      std::abs(upper_off) <= tolerances.range_rad) {
    return {};
  }
  const double share = (turned.upper_rad - turned.lower_rad) / (joint.upper_rad - joint.lower_rad);
  return {
      {"wrong-range", joint.name,
       fmt::format("{} was turned from {:.3f} to {:.3f} rad, {:.2f} times the way of its limits, "
                   "{:.3f} to {:.3f}: its stops, its zero, or the ranges or gear of its drive "
                   "are others",
                   joint.name, turned.lower_rad, turned.upper_rad, share, joint.lower_rad,
                   joint.upper_rad)}};
}

std::optional<double> WayScale(const BenchJoint& joint, const TurnedResult& turned,
                               const BenchTolerances& tolerances) {
  // A joint that was hardly turned tells nothing of scales.
  constexpr double kLeastShare = 0.01;
  const double way_rad = joint.upper_rad - joint.lower_rad;
  const double turned_rad = turned.upper_rad - turned.lower_rad;
  if (!turned.turned || turned_rad < kLeastShare * way_rad) return std::nullopt;
  if (std::abs(turned_rad - way_rad) <= 2 * tolerances.range_rad) return 1;
  return way_rad / turned_rad;
}

std::vector<BenchFinding> JudgeRanges(const std::string& drive, const DriveEntry& entry,
                                      const BenchJoint& joint) {
  std::vector<BenchFinding> findings;
  const JointMap& map = JointOf(entry.config);
  const auto covers = [&](const DriveRange& range, const char* what) {
    const float a = map.ToJointPosition(range.min);
    const float b = map.ToJointPosition(range.max);
    if (double{std::min(a, b)} <= joint.lower_rad && double{std::max(a, b)} >= joint.upper_rad)
      return;
    findings.push_back({"narrow-range", joint.name,
                        fmt::format("{} {} {:.3f} to {:.3f} rad of the joint, and its limits are "
                                    "{:.3f} and {:.3f}",
                                    drive, what, std::min(a, b), std::max(a, b), joint.lower_rad,
                                    joint.upper_rad)});
  };
  covers(CommandRanges(entry.config).position_rad, "can be sent to");
  covers(ReportedPositions(entry.config), "reports without wrapping");
  return findings;
}

std::vector<BenchFinding> JudgePlace(const std::string& drive, double position_rad,
                                     const BenchJoint& joint, const BenchTolerances& tolerances) {
  const double below_rad = joint.lower_rad - position_rad;
  const double above_rad = position_rad - joint.upper_rad;
  if (below_rad <= tolerances.zero_rad && above_rad <= tolerances.zero_rad) return {};
  return {{"outside-limits", joint.name,
           fmt::format("{} reports {} at {:.4f} rad, {:.4f} rad {} its limits, {:.3f} and {:.3f}: "
                       "its zero, a turn that got lost, or the ranges or gear of its drive are "
                       "others",
                       drive, joint.name, position_rad, std::max(below_rad, above_rad),
                       below_rad > 0 ? "below" : "above", joint.lower_rad, joint.upper_rad)}};
}

Json ToJson(const std::vector<BenchFinding>& findings) {
  Json json = Json::Array();
  for (const BenchFinding& finding : findings) {
    json.Append({{"kind", finding.kind},
                 {"subject", finding.subject},
                 {"text", finding.text},
                 {"mended", finding.mended}});
  }
  return json;
}

}  // namespace tumbler
