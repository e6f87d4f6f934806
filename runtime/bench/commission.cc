#include "runtime/bench/commission.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "common/files/program.h"
#include "firmware_interface/devices/error_texts.h"
#include "runtime/bench/drive_reading.h"

namespace tumbler {
namespace {

void Report(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

void ReportFinding(const BenchFinding& finding) {
  Report(fmt::format("  FOUND {}: {}", finding.kind, finding.text));
}

/// The parts of a commissioning after which the draft is written, in their order.
std::vector<std::string_view> PartsOf(const CommissionConfig& config) {
  std::vector<std::string_view> parts{"scan", "joints and directions", "zeros"};
  if (config.turn_by_hand) parts.emplace_back("ways");
  parts.insert(parts.end(), {"scales", "watchdogs", "steps"});
  return parts;
}

/// One commissioning.
class Commissioner {
 public:
  Commissioner(BenchWorld& world, DrivesDraft& draft, const std::vector<BenchJoint>& joints,
               BenchOperator& somebody, const CommissionConfig& config,
               const std::function<void(const DrivesDraft&)>& keep)
      : world_(world),
        draft_(draft),
        joints_(joints),
        somebody_(somebody),
        config_(config),
        keep_(keep) {}

  CommissionResult Run() {
    Scan();
    Begin();
    CheckHealth();
    MeasureAllReplies();
    IdentifyAll();
    ZeroAll();
    if (config_.turn_by_hand) {
      TurnAll();
      Keep("ways");
    } else {
      for (std::size_t i = 0; i < session_->size(); ++i) {
        result_.judgement.not_told.push_back(session_->NameOf(i) +
                                             ": the way of its joint, which nobody turned by hand");
      }
    }
    ScaleAll();
    Keep("scales");
    ProveAllWatchdogs();
    StepAll();
    Keep("steps");
    return std::move(result_);
  }

 private:
  void Add(const std::vector<BenchFinding>& findings) {
    for (const BenchFinding& finding : findings) {
      ReportFinding(finding);
      result_.judgement.findings.push_back(finding);
    }
  }
  void Judged(std::size_t drive, const char* what) {
    result_.judgement.judged.push_back(fmt::format("{}: {}", session_->NameOf(drive), what));
  }
  /// Begins with the drives as the draft has them now.
  void Begin() {
    session_.reset();
    session_ = std::make_unique<BenchSession>(world_, draft_.config(), config_.bounds);
    const std::vector<std::size_t> silent = session_->AwaitReplies();
    if (silent.empty()) return;
    throw Refused(session_->NameOf(silent.front()) +
                  " does not reply: is it switched on, and are its identifiers right?");
  }
  /// Writes the draft, with the parts that are behind it and those that are left.
  void Keep(std::string_view part) {
    std::string done;
    std::string left;
    bool behind = true;
    for (const std::string_view one : PartsOf(config_)) {
      std::string& list = behind ? done : left;
      list += list.empty() ? "" : ", ";
      list += one;
      behind = behind && one != part;
    }
    draft_.SetNote("done so far: " + done);
    draft_.SetUnfinished(left.empty() ? "" : "commissioning has left to do: " + left);
    draft_.Check();
    keep_(draft_);
  }
  [[nodiscard]] const BenchJoint& JointNamed(const std::string& name) const {
    const auto found = std::find_if(joints_.begin(), joints_.end(),
                                    [&](const BenchJoint& joint) { return joint.name == name; });
    if (found == joints_.end())
      throw Refused(fmt::format("the motion has no joint '{}' of the drives file", name));
    return *found;
  }

  void Scan();
  void CheckHealth();
  void MeasureAllReplies();
  void IdentifyAll();
  void ApplyIdentities(const std::vector<std::string>& turned);
  void ZeroAll();
  void TurnAll();
  void ScaleAll();
  void ProveAllWatchdogs();
  bool SetWatchdog(std::size_t drive, const WatchdogResult& watchdog);
  void StepAll();

  BenchWorld& world_;
  DrivesDraft& draft_;
  const std::vector<BenchJoint>& joints_;
  BenchOperator& somebody_;
  const CommissionConfig& config_;
  const std::function<void(const DrivesDraft&)>& keep_;
  std::unique_ptr<BenchSession> session_;
  std::vector<std::optional<double>> way_scales_;  // of TurnAll
  CommissionResult result_;
};

void Commissioner::Scan() {
  Report("1. Which drives are there? Nothing moves.");
  result_.found = ScanBus(world_, config_.scan);
  for (const FoundDrive& drive : result_.found) Report("  " + Describe(drive));
  const std::vector<BenchFinding> findings = CompareWithDraft(result_.found, draft_.config());
  Add(findings);
  for (const BenchFinding& finding : findings) {
    if (finding.kind == "missing-drive") throw Refused(finding.text);
  }
  for (std::size_t i = 0; i < draft_.config().drives.size(); ++i) {
    const FoundDrive* found = FindDrive(result_.found, draft_.config().drives[i]);
    const auto* mit = std::get_if<MitConfig>(&draft_.config().drives[i].config);
    if (mit != nullptr && found->reply_id && *found->reply_id != mit->reply_id)
      draft_.SetInteger(i, "reply_id", *found->reply_id);
    if (mit != nullptr && found->damiao != (mit->dialect == MitDialect::kDamiao))
      draft_.SetText(i, "dialect", found->damiao ? "damiao" : "mini-cheetah");
  }
  Keep("scan");
  result_.judgement.judged.emplace_back("which drives answer, with which identifiers");
  for (const DriveEntry& drive : draft_.config().drives) {
    const Judgement readings = JudgeReadings(drive, ReadDrive(world_, drive));
    Add(readings.findings);
    result_.judgement.judged.insert(result_.judgement.judged.end(), readings.judged.begin(),
                                    readings.judged.end());
  }
}

void Commissioner::CheckHealth() {
  for (std::size_t i = 0; i < session_->size(); ++i) {
    const DriveFeedback feedback = session_->drive(i).feedback();
    Report(fmt::format("  {}: at {:.4f} rad{}", session_->NameOf(i), feedback.position_rad,
                       feedback.has_temperature ? fmt::format(", {:.0f} C", feedback.temperature_c)
                                                : std::string()));
    if (feedback.error == 0 && session_->drive(i).state() != DriveState::kFault) continue;
    throw Refused(fmt::format("{} reports {}{}: clear it first (--clear)", session_->NameOf(i),
                              DescribeDriveError(session_->entry(i).config, feedback.error),
                              DescribeRemarks(session_->entry(i).config, session_->drive(i))));
  }
}

void Commissioner::MeasureAllReplies() {
  Report(fmt::format("2. How fast and how surely do they reply? {} s, nothing moves.",
                     config_.replies_s));
  const BusTrouble before = world_.trouble();
  result_.replies = MeasureReplies(*session_, config_.replies_s);
  for (std::size_t i = 0; i < session_->size(); ++i) {
    const ReplyResult& replies = result_.replies[i];
    Report(fmt::format(
        "  {}: {} {:.3f} ms (median), {:.3f} ms (99 %), {:.3f} ms (max), {} of {} "
        "lost",
        session_->NameOf(i),
        !replies.answers   ? "reports every"
        : replies.at_least ? "answers after at least"
                           : "answers after",
        replies.median_ms, replies.p99_ms, replies.max_ms, replies.lost, replies.asked));
    Add(JudgeReplies(session_->NameOf(i), replies, session_->period_s(), config_.tolerances));
    Judged(i, "replies");
  }
  const BusTrouble after = world_.trouble();
  if (after.error_frames > before.error_frames) {
    Add({{"noisy-bus", "bus",
          fmt::format("{} error frames in {} s: look at termination, cables and bit timing",
                      after.error_frames - before.error_frames, config_.replies_s)}});
  }
}

void Commissioner::IdentifyAll() {
  Report("3. Which joint does each drive turn, and in which direction?");
  std::vector<std::string> turned, names;
  for (const BenchJoint& joint : joints_) names.push_back(joint.name);
  for (std::size_t i = 0; i < session_->size(); ++i) {
    const DriveIdentity identity = IdentifyDrive(*session_, somebody_, i, names);
    const int direction = identity.direction;
    turned.push_back(identity.joint);
    const std::string name = session_->NameOf(i);
    for (std::size_t k = 0; k < i; ++k) {
      if (turned[k] == turned[i])
        throw Refused(fmt::format("{} turns {}, as {} does", name, turned[i], session_->NameOf(k)));
    }
    if (turned[i] != session_->entry(i).joint) {
      Add({{"identifiers-exchanged", name,
            fmt::format("{} turns {}, and the drives file says {}", name, turned[i],
                        session_->entry(i).joint),
            true}});
    }
    if (direction < 0) {
      const float was = JointOf(session_->entry(i).config).direction;
      Add({{"wrong-direction", turned[i],
            fmt::format("{} turns {} against its axis: direction is {}, not {}", name, turned[i],
                        was > 0 ? -1 : 1, was > 0 ? 1 : -1),
            true}});
      draft_.SetInteger(i, "direction", was > 0 ? -1 : 1);
    }
  }
  ApplyIdentities(turned);
  Keep("joints and directions");
  Begin();
  for (std::size_t i = 0; i < session_->size(); ++i) Judged(i, "joint and direction");
}

void Commissioner::ApplyIdentities(const std::vector<std::string>& turned) {
  const std::vector<DriveEntry> was = draft_.config().drives;
  for (std::size_t i = 0; i < turned.size(); ++i) {
    if (turned[i] == was[i].joint) continue;
    draft_.SetText(i, "joint", turned[i]);
    // Gains belong to the joint, wherever its drive stands in the file.
    for (const DriveEntry& of_joint : was) {
      if (of_joint.joint != turned[i]) continue;
      draft_.SetNumber(i, "kp_nm_per_rad", double{of_joint.kp_nm_per_rad});
      draft_.SetNumber(i, "kd_nm_s_per_rad", double{of_joint.kd_nm_s_per_rad});
    }
  }
}

void Commissioner::ZeroAll() {
  Report("4. Where is each joint's zero? The torque is off.");
  for (std::size_t i = 0; i < session_->size(); ++i) {
    const BenchJoint& joint = JointNamed(session_->entry(i).joint);
    if (!somebody_.Place(joint.name, joint.reference_rad, [this] { session_->Tick(); }))
      throw Refused(joint.name + " is not where its zero can be found");
    const double measured_rad = RestingPosition(*session_, i);
    const double off_rad = joint.reference_rad - measured_rad;
    Judged(i, "zero");
    Report(fmt::format("  {}: reads {:.4f} rad at {:.4f} rad", session_->NameOf(i), measured_rad,
                       joint.reference_rad));
    if (std::abs(off_rad) <= config_.tolerances.zero_rad) continue;
    const double offset_rad = double{JointOf(session_->entry(i).config).zero_offset_rad} + off_rad;
    Add({{"zero-off", joint.name,
          fmt::format("the zero of {} is off by {:.3f} rad: zero_offset_rad is {:.4f}", joint.name,
                      off_rad, offset_rad),
          true}});
    draft_.SetNumber(i, "zero_offset_rad", std::round(1e6 * offset_rad) * 1e-6);
  }
  Keep("zeros");
  Begin();
}

void Commissioner::TurnAll() {
  Report("5. Does each joint have the way that the motion's limits say? The torque is off.");
  for (std::size_t i = 0; i < session_->size(); ++i) {
    const BenchJoint& joint = JointNamed(session_->entry(i).joint);
    Add(JudgeRanges(session_->NameOf(i), session_->entry(i), joint));
    const TurnedResult turned =
        WatchTurning(*session_, somebody_, i, joint.name, joint.lower_rad, joint.upper_rad);
    Report(fmt::format("  {}: from {:.3f} to {:.3f} rad; the limits are {:.3f} and {:.3f}",
                       joint.name, turned.lower_rad, turned.upper_rad, joint.lower_rad,
                       joint.upper_rad));
    Add(JudgeWay(joint, turned, config_.tolerances));
    Judged(i, "way of its joint, and positions that it can be asked for");
    way_scales_.push_back(WayScale(joint, turned, config_.tolerances));
  }
}

void Commissioner::ScaleAll() {
  Report("6. Do velocities, torques and gains have the scales that the drives file says?");
  for (std::size_t i = 0; i < session_->size(); ++i) {
    const std::string name = session_->NameOf(i);
    if (!somebody_.Confirm(fmt::format("{} will turn its joint to and fro for some seconds. Is the "
                                       "way clear?",
                                       name),
                           [this] { session_->Tick(); })) {
      throw Refused(name + " was not to move");
    }
    const DriveScales scales = MeasureScales(*session_, i);
    result_.scales.push_back(scales);
    Report(fmt::format("  {}: {}", name, Describe(scales)));
    KnownScales known;
    if (i < way_scales_.size()) known.position = way_scales_[i];
    const Judgement judgement = JudgeScales(name, session_->entry(i), scales, known);
    Add(judgement.findings);
    result_.judgement.Add({{}, judgement.judged, judgement.not_told});
  }
}

void Commissioner::ProveAllWatchdogs() {
  Report("7. Do the drives let go when the host is silent?");
  for (std::size_t i = 0; i < session_->size(); ++i) {
    const std::string name = session_->NameOf(i);
    const double expected_s = session_->entry(i).watchdog_s;
    if (!somebody_.Confirm(
            fmt::format("{} will push with little torque for moments. Is the way clear?", name),
            [this] { session_->Tick(); })) {
      throw Refused(name + " was not to move");
    }
    const WatchdogResult watchdog = ProveWatchdog(*session_, i);
    result_.watchdogs.push_back(watchdog);
    Report(fmt::format("  {}: {}", name, Describe(watchdog)));
    std::vector<BenchFinding> findings =
        JudgeWatchdog(name, watchdog, expected_s, session_->period_s(), config_.tolerances);
    // A drive that does not let go stays amiss, whatever the file says of it.
    const bool written = !findings.empty() && SetWatchdog(i, watchdog);
    for (BenchFinding& finding : findings) finding.mended = written && watchdog.let_go;
    Add(findings);
    Judged(i, "watchdog");
  }
  Keep("watchdogs");
}

/// Writes what was proved. @returns whether that was anything.
bool Commissioner::SetWatchdog(std::size_t drive, const WatchdogResult& watchdog) {
  // A time-out that the drive has outlasted is not to be relied on, though nobody knows what it is.
  const double expected_s = draft_.config().drives[drive].watchdog_s;
  const bool disproved =
      expected_s > 0 && watchdog.pushed_after_s > expected_s + 2 * session_->period_s();
  if (!watchdog.let_go && !watchdog.longest && !disproved) return false;
  if (!std::holds_alternative<Cia402Config>(draft_.config().drives[drive].config)) {
    draft_.SetNumber(
        drive, "watchdog_s",
        // The last silence that it bore: the host counts on no less.
        watchdog.let_go ? std::max(std::floor(1e3 * watchdog.pushed_after_s), 1.0) * 1e-3 : 0.0);
    return true;
  }
  // The host tells these drives their time-out, the same for all: it stays what they are told,
  // unless one does not obey.
  if (watchdog.let_go) return false;
  for (std::size_t i = 0; i < draft_.config().drives.size(); ++i) {
    if (std::holds_alternative<Cia402Config>(draft_.config().drives[i].config))
      draft_.SetNumber(i, "watchdog_s", 0);
  }
  return true;
}

void Commissioner::StepAll() {
  Report("8. How does each joint answer to a step?");
  for (std::size_t i = 0; i < session_->size(); ++i) {
    const std::string name = session_->NameOf(i);
    if (!somebody_.Confirm(
            fmt::format("{} will turn its joint by {} rad at once. Is the way clear?", name,
                        config_.step.size_rad),
            [this] { session_->Tick(); })) {
      throw Refused(name + " was not to move");
    }
    const StepResult step = MeasureStep(*session_, i, config_.step);
    result_.steps.push_back({name, config_.step, step});
    Report(fmt::format("  {}: {}", name, Describe(step)));
    Add(JudgeStep(name, config_.step, step));
    Judged(i, "step");
  }
}

}  // namespace

CommissionResult Commission(BenchWorld& world, DrivesDraft& draft,
                            const std::vector<BenchJoint>& joints, BenchOperator& somebody,
                            const CommissionConfig& config,
                            const std::function<void(const DrivesDraft&)>& keep) {
  return Commissioner(world, draft, joints, somebody, config, keep).Run();
}

std::vector<BenchFinding> CompareWithDraft(const std::vector<FoundDrive>& found,
                                           const DrivesConfig& drives) {
  std::vector<BenchFinding> findings;
  for (const DriveEntry& entry : drives.drives) {
    const FoundDrive* drive = FindDrive(found, entry);
    if (drive == nullptr) {
      findings.push_back({"missing-drive", entry.joint,
                          fmt::format("the drive of {} does not answer: is it switched on, and "
                                      "are its identifiers right?",
                                      entry.joint)});
      continue;
    }
    const auto* mit = std::get_if<MitConfig>(&entry.config);
    if (mit != nullptr && drive->reply_id && *drive->reply_id != mit->reply_id) {
      findings.push_back({"reply-identifier", entry.joint,
                          fmt::format("drive mit {} replies on {}, and the drives file says {}",
                                      drive->number, *drive->reply_id, mit->reply_id),
                          true});
    }
  }
  for (const DriveEntry& entry : drives.drives) {
    const FoundDrive* drive = FindDrive(found, entry);
    const auto* mit = std::get_if<MitConfig>(&entry.config);
    if (drive == nullptr || mit == nullptr ||
        drive->damiao == (mit->dialect == MitDialect::kDamiao)) {
      continue;
    }
    findings.push_back({"other-dialect", entry.joint,
                        fmt::format("drive mit {} {}, and the drives file says {}", drive->number,
                                    drive->damiao ? "has Damiao's registers"
                                                  : "has no register "
                                                    "of Damiao's",
                                    drive->damiao ? "mini-cheetah" : "damiao"),
                        true});
  }
  for (const FoundDrive& drive : found) {
    const bool known =
        std::any_of(drives.drives.begin(), drives.drives.end(),
                    [&](const DriveEntry& entry) { return FindDrive({drive}, entry) != nullptr; });
    if (known) continue;
    findings.push_back({"unknown-drive", fmt::format("{} {}", drive.protocol, drive.number),
                        fmt::format("{} {} answers, and is not in the drives file", drive.protocol,
                                    drive.number)});
  }
  return findings;
}

Json ToJson(const CommissionResult& result) {
  Json json;
  json["found"] = Json::Array();
  for (const FoundDrive& drive : result.found) json["found"].Append(ToJson(drive));
  json["replies"] = Json::Array();
  for (const ReplyResult& replies : result.replies) json["replies"].Append(ToJson(replies));
  json["watchdogs"] = Json::Array();
  for (const WatchdogResult& watchdog : result.watchdogs) {
    json["watchdogs"].Append({{"let_go", watchdog.let_go},
                              {"pushed_after_s", watchdog.pushed_after_s},
                              {"limp_after_s", watchdog.limp_after_s},
                              {"longest", watchdog.longest},
                              {"silences", watchdog.silences}});
  }
  json["steps"] = Json::Array();
  for (const NamedStep& step : result.steps) {
    Json drawn = ToJson(step.result);
    drawn["drive"] = step.name;
    json["steps"].Append(drawn);
  }
  json["scales"] = Json::Array();
  for (const DriveScales& scales : result.scales) json["scales"].Append(ToJson(scales));
  return json;
}

}  // namespace tumbler
