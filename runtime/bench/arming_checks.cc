#include "runtime/bench/arming_checks.h"

#include <fmt/format.h>

#include "common/files/program.h"
#include "firmware_interface/devices/error_texts.h"
#include "runtime/bench/bench_tests.h"
#include "runtime/bench/drive_scales.h"
#include "runtime/bench/findings.h"

namespace tumbler {
namespace {

using SayLineAbout = std::function<void(const std::string&)>;

void RequireHealthy(BenchSession& session, bool clear) {
  const std::vector<std::size_t> silent = session.AwaitReplies();
  if (!silent.empty()) throw Refused(session.NameOf(silent.front()) + " does not reply");
  if (clear) session.ClearErrors();
  for (std::size_t i = 0; i < session.size(); ++i) {
    const Drive& drive = session.drive(i);
    const DriveConfig& config = session.entry(i).config;
    const std::uint32_t error = drive.feedback().error;
    if (error == 0 && drive.state() != DriveState::kFault) continue;
    throw Refused(fmt::format("{} reports {}{}: clear it first (--clear)", session.NameOf(i),
                              DescribeDriveError(config, error), DescribeRemarks(config, drive)));
  }
}

void RequireIdentity(BenchSession& session, std::size_t drive,
                     const std::vector<std::string>& joints, BenchOperator& somebody,
                     const SayLineAbout& say) {
  const std::string name = session.NameOf(drive);
  const std::string& expected = session.entry(drive).joint;
  const DriveIdentity identity = IdentifyDrive(session, somebody, drive, joints);
  if (identity.joint != expected) {
    throw Refused(
        fmt::format("{} turns {}, and the drives file says {}", name, identity.joint, expected));
  }
  if (identity.direction < 0) {
    throw Refused(fmt::format(
        "{} turns {} against its axis: its direction in the drives file is wrong", name, expected));
  }
  // What the motion tells of scales, too: with wrong ranges a drive obeys, scaled.
  const DriveScales scales = FitMotion(session.entry(drive), identity.recording);
  const Judgement judgement = JudgeScales(name, session.entry(drive), scales, {});
  if (!judgement.findings.empty()) throw Refused(judgement.findings.front().text);
  say(fmt::format("{} turns {}, as the drives file says{}", name, expected,
                  scales.velocity.told() ? ", and its velocities fit its positions" : ""));
}

void RequireWatchdog(BenchSession& session, std::size_t drive, const SayLineAbout& say) {
  const std::string name = session.NameOf(drive);
  const double expected_s = session.entry(drive).watchdog_s;
  const WatchdogResult result = ProveWatchdog(session, drive);
  const std::vector<BenchFinding> findings =
      JudgeWatchdog(name, result, expected_s, session.period_s(), {});
  if (!findings.empty()) throw Refused(findings.front().text);
  say(fmt::format("{}: {}", name, Describe(result)));
}

}  // namespace

void CheckBeforeArming(BenchWorld& world, const DrivesConfig& drives,
                       const std::vector<std::string>& joints, const ArmingChecks& checks,
                       BenchOperator& somebody, const SayLineAbout& say) {
  try {
    BenchSession session(world, drives, checks.bounds);
    RequireHealthy(session, checks.clear);
    for (std::size_t i = 0; checks.identity && i < session.size(); ++i)
      RequireIdentity(session, i, joints, somebody, say);
    for (std::size_t i = 0; checks.watchdog && i < session.size(); ++i)
      RequireWatchdog(session, i, say);
  } catch (const BenchFault& fault) {
    throw Refused(fault.what());
  }
}

}  // namespace tumbler
