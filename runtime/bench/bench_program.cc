#include "runtime/bench/bench_program.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include "common/core/damping_bound.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/say_to_operator.h"
#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/drives_dbc.h"
#include "firmware_interface/devices/error_texts.h"
#include "runtime/assembly/interrupts.h"
#include "runtime/bench/bench_options.h"
#include "runtime/bench/drive_reading.h"
#include "runtime/bench/drive_scales.h"

namespace tumbler {
namespace {

void SayLine(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

/// The joints of a motion, with the limits and the place of its first node.
std::vector<BenchJoint> JointsOf(const SequenceFile& motion) {
  const int node = motion.graph.start;
  const PrimitiveFile& first = motion.PrimitiveOf(node);
  std::vector<BenchJoint> joints;
  for (std::size_t j = 0; j < first.primitive.motions().size(); ++j) {
    const auto role = static_cast<std::size_t>(motion.graph.RoleOf(node, static_cast<int>(j)));
    const JointMotion<double>& of_role = first.primitive.joints[role];
    joints.push_back({std::string(first.primitive.joints[j].name.view()),
                      of_role.limits.position_min_rad, of_role.limits.position_max_rad,
                      first.entry.joint_positions_rad[role]});
  }
  return joints;
}

/// An option `JOINT=RAD`.
std::pair<std::string, double> PositionIn(const std::string& text, const DrivesConfig& drives) {
  const std::size_t equals = text.find('=');
  const std::string joint = text.substr(0, equals);
  const std::string number = equals == std::string::npos ? "" : text.substr(equals + 1);
  std::size_t used = 0;
  double angle_rad = 0;
  try {
    angle_rad = std::stod(number, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || used != number.size() || !(std::abs(angle_rad) <= 1000))
    throw UsageError("--position", fmt::format("is {}; allowed: JOINT=RAD, -1000 ... 1000", text));
  for (const DriveEntry& drive : drives.drives) {
    if (drive.joint == joint) return {joint, angle_rad};
  }
  throw UsageError("--position", fmt::format("is {}, and no drive has the joint {}", text, joint));
}

/// One run of the program.
class BenchRun {
 public:
  explicit BenchRun(const BenchOptions& options) : options_(options) {
    // Everything that can refuse comes before the bus.
    std::vector<std::string> inputs = {options.drives, options.actual, options.bus_faults,
                                       options.answers};
    if (!options.motion.empty())
      joints_ = JointsOf(LoadMotion(options.motion, NotingReader(inputs)));
    if (!options.drives.empty()) {
      draft_ = std::make_unique<DrivesDraft>(ReadTextFile(options.drives), options.drives);
      for (const DriveEntry& drive : draft_->config().drives) CheckJoint(drive.joint);
    }
    CheckDistinct(inputs, {options.write, options.json, options.page});
    for (const std::string& output : {options.write, options.page}) {
      if (!output.empty()) CheckWritable(output);
    }
    CheckResult(options.json);
    if (!options.write.empty() && !options.overwrite && std::filesystem::exists(options.write)) {
      throw std::runtime_error(
          fmt::format("{}: is there already; --overwrite replaces it", options.write));
    }
    if (options_.command == "dbc") return;
    CatchInterrupts();
    OpenWorld();
  }

  ExitStatus Run() {
    json_["bus"] = options_.bus;
    json_["command"] = options_.command;
    Dispatch();
    WriteResults();
    SayJudgement();
    const auto remains = [](const BenchFinding& finding) { return !finding.mended; };
    return std::ranges::any_of(judgement_.findings, remains) ? ExitStatus::kAmiss
                                                             : ExitStatus::kDone;
  }

 private:
  void CheckJoint(const std::string& name) const {
    if (joints_.empty()) return;
    for (const BenchJoint& joint : joints_) {
      if (joint.name == name) return;
    }
    throw std::runtime_error(fmt::format("{}: has a drive for joint '{}', and {} has no such joint",
                                         options_.drives, name, options_.motion));
  }

  void OpenWorld() {
    OperatorScript script{options_.answers, options_.yes, nullptr};
    if (options_.simulated()) {
      SimulatedBenchConfig config;
      config.drives = options_.actual.empty() ? draft_->config() : LoadDrives(options_.actual);
      for (const BenchJoint& joint : joints_)
        config.positions.emplace_back(joint.name, joint.reference_rad);
      for (const std::string& text : options_.positions)
        config.positions.push_back(PositionIn(text, config.drives));
      config.bus_faults = options_.bus_faults;
      world_ = MakeSimulatedBench(config);
      script.hands = world_->hands();
    } else {
      world_ = MakeInterfaceBench(options_.bus, draft_ ? &draft_->config() : nullptr,
                                  options_.moves() && options_.arm);
    }
    const bool knows = options_.simulated() && options_.answers.empty() && !options_.ask;
    operator_ = knows ? MakeSimulatedOperator(*world_->hands()) : MakeAskedOperator(script);
  }

  void DescribeFrames() const;
  void Dispatch();
  void Scan();
  void Read();
  void JudgePlaceOf(std::size_t drive);
  void TellDampingOf(std::size_t drive);
  bool TurnsItsJoint(std::size_t drive);
  void Identify();
  void JogOne();
  [[nodiscard]] double ZeroAt(std::size_t drive) const {
    return options_.at_rad.empty() ? JointOfDrive(drive).reference_rad : options_.at_rad.front();
  }
  void CheckInDriveZeros() const;
  void Zero();
  void Check();
  void Step();
  void Watchdog();
  void Latency();
  void CommissionAll();

  /// Speaks with the drives of the file.
  BenchSession& Begin() {
    session_.reset();
    session_ = std::make_unique<BenchSession>(*world_, draft_->config(), options_.config.bounds);
    const std::vector<std::size_t> silent = session_->AwaitReplies();
    if (!silent.empty()) {
      throw Refused(session_->NameOf(silent.front()) +
                    " does not reply: is it switched on, and are its identifiers right? "
                    "(tumbler bench BUS scan)");
    }
    if (options_.clear) session_->ClearErrors();
    return *session_;
  }
  /// The drives that the command is about.
  [[nodiscard]] std::vector<std::size_t> Chosen() const {
    std::vector<std::size_t> chosen;
    for (std::size_t i = 0; i < session_->size(); ++i) {
      if (options_.joint.empty() || session_->entry(i).joint == options_.joint) chosen.push_back(i);
    }
    if (chosen.empty()) {
      throw UsageError("JOINT", fmt::format("is {}, which no drive of {} turns", options_.joint,
                                            options_.drives));
    }
    return chosen;
  }
  [[nodiscard]] std::function<void()> Meanwhile() {
    return [this] { session_->Tick(); };
  }
  void ConfirmMotion(const std::string& what) {
    if (!operator_->Confirm(what + " Is the way clear?", Meanwhile()))
      throw Refused("it was not to move");
  }
  [[nodiscard]] const BenchJoint& JointOfDrive(std::size_t drive) const {
    return *std::find_if(joints_.begin(), joints_.end(), [&](const BenchJoint& joint) {
      return joint.name == session_->entry(drive).joint;
    });
  }
  void Found(const std::vector<BenchFinding>& findings) { judgement_.Add({findings, {}, {}}); }
  void Judged(const std::string& what) { judgement_.judged.push_back(what); }
  void SayJudgement() const;
  void WriteDraft(const DrivesDraft& draft) const {
    PendingFile(options_.write, draft.TextFor(options_.write)).Commit();
  }
  void WriteResults();

  BenchOptions options_;
  std::vector<BenchJoint> joints_;
  std::unique_ptr<DrivesDraft> draft_;
  std::unique_ptr<BenchWorld> world_;
  std::unique_ptr<BenchOperator> operator_;
  std::unique_ptr<BenchSession> session_;
  Judgement judgement_;
  std::vector<NamedStep> steps_;
  Json json_;
};

void BenchRun::DescribeFrames() const {
  PendingFile(options_.write, DrivesDbc(draft_->config())).Commit();
  SayLine(fmt::format("{} is written, with the frames of {} drives.", options_.write,
                      draft_->config().drives.size()));
}

void BenchRun::Dispatch() {
  const std::string& command = options_.command;
  if (command == "dbc") return DescribeFrames();
  if (command == "scan") return Scan();
  if (command == "commission") return CommissionAll();
  if (command == "read") return Read();
  Begin();
  if (command == "identify") return Identify();
  if (command == "jog") return JogOne();
  if (command == "zero") return Zero();
  if (command == "check") return Check();
  if (command == "step") return Step();
  if (command == "watchdog") return Watchdog();
  Latency();
}

/// Says what was found, and what that rests on: nothing counts as right that was not judged.
void BenchRun::SayJudgement() const {
  const auto list = [](const std::string& head, const std::vector<std::string>& lines) {
    if (lines.empty()) return;
    SayLine(head);
    for (const std::string& line : lines) SayLine("  " + line);
  };
  if (judgement_.findings.empty() && judgement_.judged.empty()) {
    SayLine("Nothing was judged.");
  } else if (judgement_.findings.empty()) {
    list("Nothing is amiss of what was judged:", judgement_.judged);
  } else {
    list("Judged:", judgement_.judged);
  }
  list("Not told by these measurements:", judgement_.not_told);
  for (const BenchFinding& finding : judgement_.findings) {
    SayLine(fmt::format("{} {}: {}", finding.mended ? "set right" : "REMAINS", finding.kind,
                        finding.text));
  }
}

void BenchRun::WriteResults() {
  if (!options_.page.empty()) WriteResult(options_.page, StepPage(steps_));
  if (options_.json.empty()) return;
  json_["findings"] = ToJson(judgement_.findings);
  json_["judged"] = judgement_.judged;
  json_["not_told"] = judgement_.not_told;
  const std::string text = json_.Dump(2) + '\n';
  WriteResult(options_.json, text);
}

void BenchRun::Scan() {
  const std::vector<FoundDrive> found = ScanBus(*world_, options_.config.scan);
  json_["found"] = Json::Array();
  for (const FoundDrive& drive : found) {
    SayLine(Describe(drive));
    json_["found"].Append(ToJson(drive));
  }
  SayLine(fmt::format("{} {} found", found.size(), found.size() == 1 ? "drive" : "drives"));
  if (!draft_) return;
  Judged("which drives answer, with which identifiers, against the drives file");
  Found(CompareWithDraft(found, draft_->config()));
  for (BenchFinding& finding : judgement_.findings) finding.mended = false;  // Nothing is written.
}

void BenchRun::Read() {
  std::vector<std::vector<DriveReading>> readings;
  for (const DriveEntry& drive : draft_->config().drives) {
    readings.push_back(ReadDrive(*world_, drive));
    judgement_.Add(JudgeReadings(drive, readings.back()));
  }
  Begin();
  session_->Wait(0.2);  // Temperatures and torques come more seldom than positions.
  json_["drives"] = Json::Array();
  for (std::size_t i = 0; i < session_->size(); ++i) session_->RequireHeard(i);
  for (std::size_t i = 0; i < session_->size(); ++i) {
    const DriveFeedback feedback = session_->drive(i).feedback();
    const DriveState state = session_->drive(i).state();
    const std::string error =
        feedback.error == 0 ? "" : DescribeDriveError(session_->entry(i).config, feedback.error);
    std::string line =
        fmt::format("{}: {:.4f} rad, {:.3f} rad/s, {}", session_->NameOf(i), feedback.position_rad,
                    feedback.velocity_rad_s,
                    feedback.has_torque ? fmt::format("{:.3f} N m", feedback.torque_nm)
                                        : std::string("torque not measured"));
    if (feedback.has_temperature) line += fmt::format(", {:.0f} C", feedback.temperature_c);
    line += error.empty() ? ", no error" : ", " + error;
    SayLine(line);
    for (const DriveReading& reading : readings[i]) SayLine("  " + Describe(reading));
    Json drive = {{"joint", session_->entry(i).joint},
                  {"readings", ToJson(readings[i])},
                  {"position_rad", feedback.position_rad},
                  {"velocity_rad_s", feedback.velocity_rad_s},
                  {"error", feedback.error}};
    drive["torque_nm"] = feedback.has_torque ? Json(feedback.torque_nm) : Json(nullptr);
    if (feedback.has_temperature) drive["temperature_c"] = feedback.temperature_c;
    json_["drives"].Append(drive);
    JudgePlaceOf(i);
    Judged(session_->NameOf(i) + ": errors");
    if (state != DriveState::kFault) continue;
    judgement_.findings.push_back(
        {"drive-error", session_->entry(i).joint,
         fmt::format("{} reports {}{}", session_->NameOf(i), error,
                     DescribeRemarks(session_->entry(i).config, session_->drive(i)))});
  }
}

/// Compares the place of a joint with its limits, where they are known.
void BenchRun::JudgePlaceOf(std::size_t drive) {
  const std::string name = session_->NameOf(drive);
  if (joints_.empty()) {
    judgement_.not_told.push_back(name +
                                  ": whether its joint is within its limits, which --motion gives");
  } else {
    Judged(name + ": place of its joint against the limits");
    Found(JudgePlace(name, session_->position_rad(drive), JointOfDrive(drive),
                     options_.config.tolerances));
  }
  judgement_.not_told.push_back(name +
                                ": the scales of positions, velocities, torques and gains, since "
                                "nothing moves (tumbler bench BUS check)");
  TellDampingOf(drive);
}

/// What it takes for the drive's damping to be stable: nothing here knows the robot's inertia.
void BenchRun::TellDampingOf(std::size_t drive) {
  const DriveEntry& entry = session_->entry(drive);
  if (entry.kd_nm_s_per_rad <= 0) return;
  const double kd = static_cast<double>(entry.kd_nm_s_per_rad);
  judgement_.not_told.push_back(
      fmt::format("{}: whether its kd of {:.4g} N m s/rad is stable in the drive's own loop{}",
                  session_->NameOf(drive), kd,
                  entry.loop_hz > 0
                      ? fmt::format(" of {:.4g} kHz: above a least inertia of {:.2g} kg m^2 at the "
                                    "joint, advised twice that (tumbler run tells a motion's)",
                                    1e-3 * entry.loop_hz, LeastDampedInertia(kd, 1 / entry.loop_hz))
                      : ", whose rate is not known (loop_hz)"));
}

/// Whether the joint of this drive is the one that turned.
bool BenchRun::TurnsItsJoint(std::size_t drive) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < session_->size(); ++i) names.push_back(session_->entry(i).joint);
  const std::string name = session_->NameOf(drive);
  Judged(name + ": which joint it turns");
  const std::string turned = operator_->WhichTurned(names, Meanwhile());
  if (turned == session_->entry(drive).joint) return true;
  judgement_.findings.push_back(
      {"identifiers-exchanged", name,
       fmt::format("{} turns {}, and the drives file says {}", name,
                   turned.empty() ? "nothing" : turned, session_->entry(drive).joint)});
  return false;
}

void BenchRun::Identify() {
  json_["drives"] = Json::Array();
  for (const std::size_t i : Chosen()) {
    const std::string name = session_->NameOf(i);
    const double way_rad = options_.config.bounds.amplitude_rad;
    ConfirmMotion(fmt::format("{} will turn its joint by {} rad and back.", name, way_rad));
    const JogResult jog = Jog(*session_, i, {way_rad, false}, operator_.get());
    for (std::size_t k = 0; k < jog.ways_rad.size(); ++k)
      SayLine(fmt::format("  {} moved by {:+.4f} rad", session_->NameOf(k), jog.ways_rad[k]));
    const bool right = TurnsItsJoint(i);
    json_["drives"].Append({{"drive", name}, {"right", right}, {"ways_rad", jog.ways_rad}});
  }
}

void BenchRun::JogOne() {
  const std::size_t drive = Chosen().front();
  ConfirmMotion(fmt::format("{} will turn its joint by {} rad and back.", session_->NameOf(drive),
                            options_.by_rad));
  const JogResult jog = Jog(*session_, drive, {options_.by_rad, false}, nullptr);
  SayLine(fmt::format("{} moved by {:+.4f} rad, at most at {:.3f} rad/s, and back",
                      session_->NameOf(drive), jog.ways_rad[drive], jog.peak_speed_rad_s));
  json_["way_rad"] = jog.ways_rad[drive];
  json_["peak_speed_rad_s"] = jog.peak_speed_rad_s;
}

/// Refuses, before anything is changed, what would be refused after the first drive's new zero.
void BenchRun::CheckInDriveZeros() const {
  DrivesDraft expected = *draft_;
  for (const std::size_t i : Chosen()) {
    if (!std::holds_alternative<MitConfig>(session_->entry(i).config)) {
      throw Refused(session_->NameOf(i) +
                    ": only MIT drives are told to take another zero; leave --in-drive out");
    }
    expected.SetNumber(i, "zero_offset_rad", ZeroAt(i));
  }
  expected.Check();
}

void BenchRun::Zero() {
  json_["joints"] = Json::Array();
  if (options_.in_drive) CheckInDriveZeros();
  for (const std::size_t i : Chosen()) {
    const std::string joint = session_->entry(i).joint;
    const double at_rad = ZeroAt(i);
    if (!operator_->Place(joint, at_rad, Meanwhile()))
      throw Refused(joint + " is not where its zero can be found");
    if (options_.in_drive) {
      if (!operator_->Confirm(session_->NameOf(i) + " will take this place as its own zero. Go on?",
                              Meanwhile())) {
        throw Refused("the drive was to keep its zero");
      }
      session_->ZeroEncoder(i);
      SayLine(
          fmt::format("{} was told to take this place as its own zero: zero_offset_rad of {} "
                      "in {}, and in every other drives file made before, holds no longer",
                      session_->NameOf(i), joint, options_.drives));
    }
    double offset_rad = double{JointOf(session_->entry(i).config).zero_offset_rad};
    const double off_rad = at_rad - RestingPosition(*session_, i);
    offset_rad += off_rad;
    SayLine(
        fmt::format("{}: off by {:.4f} rad; zero_offset_rad = {:.6f}", joint, off_rad, offset_rad));
    Judged(joint + ": zero");
    json_["joints"].Append(
        {{"joint", joint}, {"off_rad", off_rad}, {"zero_offset_rad", offset_rad}});
    draft_->SetNumber(i, "zero_offset_rad", std::round(1e6 * offset_rad) * 1e-6);
    if (options_.in_drive) {
      // Whatever becomes of the next drive, this one has its new zero.
      draft_->Check();
      WriteDraft(*draft_);
    }
    if (std::abs(off_rad) <= options_.config.tolerances.zero_rad) continue;
    judgement_.findings.push_back(
        {"zero-off", joint,
         fmt::format("the zero of {} is off by {:.3f} rad: zero_offset_rad is {:.4f}", joint,
                     off_rad, offset_rad),
         !options_.write.empty()});
  }
  draft_->Check();
  if (!options_.write.empty()) WriteDraft(*draft_);
}

void BenchRun::Check() {
  json_["scales"] = Json::Array();
  for (const std::size_t i : Chosen()) {
    const std::string name = session_->NameOf(i);
    const BenchJoint& joint = JointOfDrive(i);
    const double way_rad = options_.config.bounds.amplitude_rad;
    ConfirmMotion(fmt::format("{} will turn its joint by {} rad and back.", name, way_rad));
    static_cast<void>(Jog(*session_, i, {way_rad, false}, operator_.get()));
    if (!TurnsItsJoint(i)) continue;
    Judged(name + ": direction");
    if (!operator_->Grew(joint.name, Meanwhile())) {
      judgement_.findings.push_back(
          {"wrong-direction", joint.name,
           fmt::format("{} turns {} against its axis: direction is {:.0f} in the "
                       "drives file",
                       name, joint.name, JointOf(session_->entry(i).config).direction)});
    }
    Found(JudgeRanges(name, session_->entry(i), joint));
    const TurnedResult turned =
        WatchTurning(*session_, *operator_, i, joint.name, joint.lower_rad, joint.upper_rad);
    SayLine(fmt::format("{}: from {:.3f} to {:.3f} rad", joint.name, turned.lower_rad,
                        turned.upper_rad));
    Found(JudgeWay(joint, turned, options_.config.tolerances));
    Judged(name + ": way of its joint, and positions that it can be asked for");
    ConfirmMotion(name + " will turn its joint to and fro for some seconds.");
    const DriveScales scales = MeasureScales(*session_, i);
    SayLine(fmt::format("{}: {}", name, Describe(scales)));
    Json json = ToJson(scales);
    json["drive"] = name;
    json_["scales"].Append(json);
    KnownScales known;
    known.position = WayScale(joint, turned, options_.config.tolerances);
    judgement_.Add(JudgeScales(name, session_->entry(i), scales, known));
    TellDampingOf(i);
  }
}

void BenchRun::Step() {
  const std::size_t drive = Chosen().front();
  const StepConfig& config = options_.config.step;
  ConfirmMotion(fmt::format("{} will turn its joint by {} rad at once.", session_->NameOf(drive),
                            config.size_rad));
  const StepResult step = MeasureStep(*session_, drive, config);
  steps_.push_back({session_->NameOf(drive), config, step});
  SayLine(fmt::format("{}: {}", session_->NameOf(drive), Describe(step)));
  Found(JudgeStep(session_->NameOf(drive), config, step));
  Judged(session_->NameOf(drive) + ": step");
  json_["step"] = ToJson(step);
}

void BenchRun::Watchdog() {
  json_["watchdogs"] = Json::Array();
  for (const std::size_t i : Chosen()) {
    const std::string name = session_->NameOf(i);
    const double expected_s = session_->entry(i).watchdog_s;
    ConfirmMotion(fmt::format("{} will push with little torque for moments.", name));
    const WatchdogResult watchdog = ProveWatchdog(*session_, i);
    SayLine(fmt::format("{}: {}", name, Describe(watchdog)));
    json_["watchdogs"].Append({{"joint", session_->entry(i).joint},
                               {"let_go", watchdog.let_go},
                               {"pushed_after_s", watchdog.pushed_after_s},
                               {"limp_after_s", watchdog.limp_after_s},
                               {"longest", watchdog.longest}});
    Found(JudgeWatchdog(name, watchdog, expected_s, session_->period_s(),
                        options_.config.tolerances));
    Judged(name + ": watchdog");
  }
}

void BenchRun::Latency() {
  const BusTrouble before = world_->trouble();
  const std::vector<ReplyResult> results = MeasureReplies(*session_, options_.config.replies_s);
  json_["replies"] = Json::Array();
  for (std::size_t i = 0; i < results.size(); ++i) {
    const ReplyResult& replies = results[i];
    SayLine(fmt::format(
        "{}: {} {:.3f} ms (median), {:.3f} ms (99 %), {:.3f} ms (max), {} of {} lost",
        session_->NameOf(i),
        !replies.answers   ? "reports every"
        : replies.at_least ? "answers after at least"
                           : "answers after",
        replies.median_ms, replies.p99_ms, replies.max_ms, replies.lost, replies.asked));
    Json json = ToJson(replies);
    json["joint"] = session_->entry(i).joint;
    json_["replies"].Append(json);
    Found(JudgeReplies(session_->NameOf(i), replies, session_->period_s(),
                       options_.config.tolerances));
    Judged(session_->NameOf(i) + ": replies");
  }
  json_["error_frames"] = world_->trouble().error_frames - before.error_frames;
}

void BenchRun::CommissionAll() {
  if (options_.clear) {
    Begin();
    session_.reset();
  }
  const CommissionResult result =
      Commission(*world_, *draft_, joints_, *operator_, options_.config,
                 [this](const DrivesDraft& draft) { WriteDraft(draft); });
  json_.Merge(ToJson(result));
  judgement_ = result.judgement;
  steps_ = result.steps;
  SayLine(fmt::format("{} is written.", options_.write));
}

}  // namespace

ExitStatus RunBench(int argc, char** argv) {
  const BenchOptions options = ReadBenchOptions(argc, argv);
  try {
    return BenchRun(options).Run();
  } catch (const BenchFault& fault) {
    SayToOperator(fmt::format("tumbler bench: fault: {}; the torque is off", fault.what()));
    return ExitStatus::kFault;
  } catch (const BenchInterrupted&) {
    SayToOperator("tumbler bench: interrupted; the torque is off");
    return ExitStatus::kInterrupted;
  }
}

}  // namespace tumbler
