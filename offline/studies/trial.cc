#include "offline/studies/trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include "common/core/index.h"
#include "common/files/program.h"
#include "firmware_interface/devices/error_texts.h"
#include "offline/scene/normal.h"
#include "offline/studies/drop.h"
#include "offline/twin/purpose_judge.h"
#include "offline/twin/twin_toml.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/record/sentences.h"

namespace tumbler {
namespace {

/// A robot that is farther off the model's pitch than the first has left it, and is back within the
/// second [rad].
constexpr double kLeft_rad = 0.2, kBack_rad = 0.1;

/// How long a push is, how long after the last motion it comes at the earliest, when that is
/// judged, and how long before the end at the latest.
constexpr double kPush_s = 0.1, kJudged_s = 2.6, kAfterPush_s = 2.5;

/// How long a robot falls and comes to rest before its run begins.
constexpr double kDropped_s = 3;

/// Begins the run of a robot that was dropped, as an operator does once it lies.
/// @returns whether it is just being begun.
bool BeginAfterDrop(const ControlLoop& loop, RunProcedure& procedure) {
  if (procedure.runs() > 0) {
    procedure.RequestQuit();  // after this run
    return false;
  }
  return 1e-9 * static_cast<double>(loop.time_ns()) >= kDropped_s &&
         procedure.RequestStart(loop.record()) == Refusal::kNone;
}

/// Whether a robot that fell and got up was as asked after its last motion.
bool EndsAsAsked(const PurposeJudge& judge, const PostureWatch& posture) {
  const std::vector<PostureEvent>& events = posture.events();
  const bool overlapped = std::any_of(events.begin(), events.end(), [](const PostureEvent& event) {
    return event.kind == PostureEvent::Kind::kOverlap;
  });
  const Passage& last = judge.passages().back();
  return !overlapped && !posture.fallen() && !last.amiss() && !last.unjudged();
}

constexpr const char* kTooShort = "the run ended before it could be judged";

/// Why a passage, or that none of them, was not judged.
std::string WhyNotJudged(const Passage& passage) {
  if (passage.purpose.empty() && (!passage.free_root || passage.swings_on))
    return "its task asks for nothing that a run could meet or miss";
  for (const JudgedTarget& judged : passage.purpose) {
    if (!judged.obstacle.empty()) return judged.name() + ": " + judged.obstacle;
  }
  return kTooShort;
}

/// Notes how a robot that was dropped lies before its run, and with which node it begins.
class LieWatch {
 public:
  void Observe(const TickRecord& record, const TwinState& truth) {
    if (node_ >= 0) return;
    if (record.state == ExecutorState::kHolding) lies_rad_ = NearestTurn(truth.root_pitch_rad);
    if (record.state == ExecutorState::kRunning) node_ = record.node;
  }
  [[nodiscard]] double lies_rad() const { return lies_rad_; }
  /// -1: it has not begun.
  [[nodiscard]] int node() const { return node_; }

 private:
  double lies_rad_ = 0;
  int node_ = -1;
};

/// What the model does while a robot does a tick. Until its motion begins, for which it may rest
/// longer than the model, that is what the model does until then.
class BesideModel {
 public:
  explicit BesideModel(const Script& script)
      : script_(script),
        model_begins_(static_cast<int>(
            std::ranges::find(script.ticks, ExecutorState::kRunning, &ScriptTick::state) -
            script.ticks.begin())) {}

  /// @returns  null where the model does nothing any more.
  const ScriptTick* At(std::size_t tick, ExecutorState state) {
    const int now = static_cast<int>(tick);
    if (begins_ < 0 && state == ExecutorState::kRunning) begins_ = now;
    const int at = begins_ < 0 ? std::min(now, model_begins_ - 1) : now - begins_ + model_begins_;
    return at >= 0 && Index(at) < script_.ticks.size() ? &script_.ticks[Index(at)] : nullptr;
  }

 private:
  const Script& script_;
  int model_begins_, begins_ = -1;  // below 0: it has not begun
};

}  // namespace

void DepartureWatch::Observe(const ScriptTick& model, double pitch_rad, std::int64_t ticks) {
  const bool running = model.state == ExecutorState::kRunning;
  if (running && !running_) since_ = 0;
  running_ = running;
  const double off = std::abs(pitch_rad - model.pitch_rad);
  if (left_ && off < kBack_rad) left_ = false;
  if (!left_ && since_ >= 0 && !(off < kLeft_rad)) {
    left_ = true;
    node_ = model.node;
    ticks_ = since_;
  }
  if (since_ >= 0) since_ += ticks;
}

TrialOutcome OutcomeOf(const PurposeJudge& judge, const PostureWatch& posture,
                       const DepartureWatch& departure, const SequenceFile& file, double tick_s,
                       std::int64_t since_ns) {
  TrialOutcome outcome;
  outcome.motions =
      static_cast<int>(judge.passages().size()) + static_cast<int>(judge.left_out().motions);
  for (const Passage& passage : judge.passages()) {
    if (!passage.amiss()) continue;
    outcome.verdict = TrialOutcome::Verdict::kAmiss;
    outcome.in = passage.node;
    outcome.reason = "the pitch later is not the planned one";
    for (const JudgedTarget& judged : passage.purpose) {
      if (judged.met() != false) continue;
      outcome.reason = judged.name() + ": " + judged.target.AskedAndGot(*judged.result);
      break;
    }
    break;
  }
  // What nobody looked at is neither as asked nor amiss.
  if (judge.passages().empty()) {
    outcome.verdict = TrialOutcome::Verdict::kNotJudged;
    outcome.reason = kTooShort;
  }
  for (const Passage& passage : judge.passages()) {
    if (!outcome.stands() || !passage.unjudged()) continue;
    outcome.verdict = TrialOutcome::Verdict::kNotJudged;
    outcome.in = passage.node;
    outcome.reason = WhyNotJudged(passage);
  }
  for (const PostureEvent& event : posture.events()) {
    if (event.kind == PostureEvent::Kind::kRest || event.time_ns < since_ns) continue;
    const bool fell = event.kind == PostureEvent::Kind::kFall;
    outcome.verdict = fell ? TrialOutcome::Verdict::kFell : TrialOutcome::Verdict::kOverlap;
    outcome.reason = event.cause;
    if (outcome.in.empty() && !judge.passages().empty()) outcome.in = judge.passages().back().node;
    break;
  }
  outcome.rests = posture.resting_as().rfind("as after ", 0) == 0;
  if (outcome.fails() && departure.node() >= 0) {
    outcome.in = std::string(file.graph.node(departure.node()).name.view());
    outcome.left_s = tick_s * static_cast<double>(departure.ticks());
  }
  return outcome;
}

std::string DrivesFileOf(const RobustnessStudy& study) {
  if (!study.drives.empty() || study.twin.empty()) return study.drives;
  return ReadTwinSources(study.twin).drives;
}

Trials::Trials(const RobustnessStudy& study) : study_(study), motion_(LoadMotion(study.motion)) {
  SimulatedRobotConfig robot;
  if (!study.twin.empty()) robot = LoadTwin(study.twin, motion_);
  const DrivesConfig loaded = LoadDrivesOf(JointsOf(motion_.file()), DrivesFileOf(study),
                                           ReadTextFile, GainsOf(motion_.file()));
  shared_ = ShareRobot(motion_, loaded, std::move(robot));
  const PlanarRobot& model = scene().robot;
  try {
    CheckGetUps(study_.run.get_ups, motion_.file().graph.beginning_count, drives());
  } catch (const std::invalid_argument& error) {
    throw Refused(fmt::format("{}: {}", study_.motion, error.what()));
  }
  const bool fixed = model.root_dofs == 0;
  if (study_.drops && (fixed || model.hinged())) {
    throw Refused(
        study_.motion +
        (fixed ? ": its robot is fixed to the world and" : ": its robot hangs from a bar and") +
        " cannot be dropped; leave out --drops");
  }
  if (study_.push_n != 0 && fixed) {
    throw Refused(study_.motion +
                  ": a push is one on the root, which is fixed to the world; leave out --push");
  }
  // Robots cannot differ in a ground that is not there.
  if (scene().obstacles.empty()) study_.spreads.LeaveGround();
  if (const std::string mistake = MistakeInRanges(scene().contact, study_.spreads);
      !mistake.empty()) {
    throw Refused(fmt::format("{}: {}", study_.motion, mistake));
  }
  study_.run.end = RunEnd::kTorqueOff;  // What is judged is over by then.
  PlayModel();
  if (study_.sensor_faults && !drives().sensor) {
    throw Refused(study_.motion + ": there is no sensor that could fail; name a drives file with " +
                  "[sensor]");
  }
  if (const auto [from_s, to_s] = PushTimes(); study_.push_n != 0 && !(from_s + 0.5 <= to_s)) {
    throw Refused(study_.motion +
                  ": the hold is too short for a push at a random time in it; take --hold-s 8");
  }
}

RobotVariation Trials::Draw(std::uint64_t index) const {
  return DrawRobot(scene(), study_.spreads, study_.scale, study_.seed, index);
}

RobotVariation Trials::Model() const {
  return DrawRobot(scene(), study_.spreads, 0, study_.seed, 0);
}

TrialOutcome Trials::Play(const RobotVariation& variation) {
  return *PlayVaried(variation, robot(), {});
}

TrialOutcome Trials::Play(std::uint64_t index) {
  if (!study_.drops) return *PlayVaried(Draw(index), ConfigOf(index), {});
  for (std::uint64_t attempt = 0; attempt < 100; ++attempt) {
    std::optional<TrialOutcome> outcome =
        PlayVaried(Draw(index), ConfigOf(index), {}, DropNumber{study_.seed, index, attempt});
    if (!outcome) continue;
    outcome->drops = static_cast<int>(attempt) + 1;
    return *std::move(outcome);
  }
  throw std::runtime_error("the robot lies in itself wherever it is dropped");
}

SimulatedRobotConfig Trials::ConfigOf(std::uint64_t index) const {
  constexpr std::array kFaults = {SensorFault::kSilent, SensorFault::kFrozen, SensorFault::kOffset,
                                  SensorFault::kSwappedAxis, SensorFault::kLate};
  constexpr std::uint64_t kDisturbances = 0x6469'7374'7572'6264;  // another series than the robots'
  SimulatedRobotConfig config = robot();
  // Every robot's sensor has noise of its own.
  config.sensor.seed = robot().sensor.seed * 1'000'003 + index;
  Normal random(study_.seed ^ kDisturbances, index);
  const double when = random.DrawUniform(), side = random.DrawUniform();
  const double failure = random.DrawUniform();
  if (study_.push_n != 0) {
    const auto [from_s, to_s] = PushTimes();
    Push& push = config.twin.pushes.emplace_back();
    push.link = scene().robot.body_names[Index(scene().robot.first_body())];
    push.start_s = from_s + when * (to_s - from_s);
    push.duration_s = kPush_s;
    push.force_n = {side < 0.5 ? study_.push_n : -study_.push_n, 0};
  }
  if (study_.sensor_faults) {
    SensorFailure& fault = config.sensor.failures.emplace_back();
    fault.fault = kFaults[index % kFaults.size()];
    fault.start_s = failure * static_cast<double>(script_.ticks.size()) * script_.tick_s;
  }
  return config;
}

std::pair<double, double> Trials::PushTimes() const {
  std::size_t moved = 0, settled = 0;
  for (std::size_t k = 0; k < script_.ticks.size(); ++k) {
    if (script_.ticks[k].state == ExecutorState::kRunning) moved = k;
    if (script_.ticks[k].state == ExecutorState::kSettling) settled = k;
  }
  const auto s = [this](std::size_t ticks) { return static_cast<double>(ticks) * script_.tick_s; };
  // Robots that rest at the start (RunSettings::rest_s) are later by less than that.
  constexpr double kSpare_s = kJudged_s - Passage::kLater_s;
  static_assert(RunSettings{}.rest_s < kSpare_s);
  return {std::max(s(moved) + kJudged_s, s(settled) + kSpare_s),
          s(script_.ticks.size()) - kAfterPush_s};
}

void Trials::PlayModel() {
  script_.tick_s = 1 / drives().rate_hz;
  const RobotVariation model = Model();
  Script script = script_;  // as yet empty: nobody leaves it
  bool fault = false;
  const auto write = [&](const ControlLoop& loop, SimulatedRobot& robot) {
    const TickRecord& record = loop.record();
    // Once the torque is off there is no more to say.
    if (record.state == ExecutorState::kDisarmed && !script.delay_s.empty()) return;
    const TwinState& truth = robot.state();
    ScriptTick& tick = script.ticks.emplace_back();
    tick.state = record.state;
    tick.node = record.node;
    tick.primitive_time_s = record.primitive_time_s;
    tick.held = truth.held;
    tick.pitch_rad = truth.root_pitch_rad;
    fault = fault || tick.state == ExecutorState::kFault;
    for (std::size_t j = 0; j < record.joint_count; ++j)
      tick.setpoints.push_back(record.joints[j].encoded);
    if (tick.state != ExecutorState::kRunning) return;
    // What a drive got last is the setpoint of the tick before.
    script.delay_s.clear();
    for (std::size_t j = 0; j < record.joint_count; ++j) {
      const double ago_s =
          1e-9 * static_cast<double>(loop.time_ns() - robot.drive(j).last_setpoint_ns());
      script.delay_s.push_back(script.tick_s - ago_s);
    }
  };
  const std::optional<TrialOutcome> outcome = PlayVaried(model, robot(), write);
  if (study_.push_n != 0 && outcome->fails()) {
    throw Refused(fmt::format(
        "{}: the model itself is not as asked, so there is no hold to push robots in: {}",
        study_.motion, outcome->reason));
  }
  if (!outcome->judged() && outcome->reason == kTooShort) {
    throw Refused(
        fmt::format("{}: ends {:.6g} s after the last motion has settled, before a robot "
                    "can be judged, which is {:.6g} s after the motion; take a longer "
                    "--hold-s",
                    study_.motion, study_.run.hold_s, Passage::kLater_s));
  }
  if (fault) script.broken_off = outcome->reason;
  script_ = std::move(script);
}

std::optional<TrialOutcome> Trials::PlayVaried(const RobotVariation& variation,
                                               SimulatedRobotConfig config, const Observer& observe,
                                               std::optional<DropNumber> dropped) {
  const Scene varied = Varied(scene(), variation);
  RunSettings settings = study_.run;
  std::vector<double> rates;
  if (dropped) {
    Drop drop = DrawDrop(varied, *dropped);
    rates = std::move(drop.rates);
    config.start = std::move(drop.pose);
    config.twin.held = false;
    settings.attended = true;        // The run begins once the robot lies.
    settings.start_within_rad = 10;  // Its joints are anywhere.
  }
  SharedRobot shared = shared_;
  shared.config = std::move(config);
  VariedRun run({motion_, nullptr, settings}, shared, variation);
  SimulatedRobot& robot = run.robot();
  RunProcedure& procedure = run.procedure();
  const ControlLoop& loop = run.loop();
  PurposeJudge judge(motion_.file(), varied.robot);
  DepartureWatch departure;
  if (dropped) robot.Displace(std::vector<double>(rates.size()), rates);
  LieWatch lie;
  bool begun = false;
  BesideModel beside(script_);
  int settled = -1, fell_after = -1;  // nodes
  for (std::size_t k = 0; run.Step(); ++k) {
    const TwinState& truth = robot.state();
    if (loop.record().state == ExecutorState::kSettling) settled = loop.record().node;
    if (fell_after < 0 && loop.statistics().get_ups > 0) fell_after = settled;
    judge.Observe(loop.record(), loop.time_ns(), truth);
    lie.Observe(loop.record(), truth);
    if (dropped && BeginAfterDrop(loop, procedure) &&
        LiesInItself(varied, truth.joint_positions_rad)) {
      return std::nullopt;
    }
    // From a get-up on the robot does something else than the model.
    const ScriptTick* const model = beside.At(k, loop.record().state);
    if (!dropped && model != nullptr && loop.statistics().get_ups == 0)
      departure.Observe(*model, truth.root_pitch_rad);
    if (observe) observe(loop, robot);
    if (!begun && loop.record().state == ExecutorState::kRunning) {
      begun = true;
      run.DisplaceAtStart();
    }
    if (robot.posture().falls() > study_.run.get_ups) break;
  }
  // What is limp meets its stops and passes through itself, which is no matter of the run.
  TrialOutcome outcome = OutcomeOf(judge, robot.posture(), departure, motion_.file(),
                                   script_.tick_s, dropped ? robot.state().enabled_ns : 0);
  outcome.variation = variation;
  // What a motion was for is judged before the push.
  if (study_.push_n != 0 && outcome.stands() && departure.node() >= 0) {
    outcome.verdict = TrialOutcome::Verdict::kAmiss;
    outcome.reason = "it left its pose when it was pushed";
  }
  const std::int64_t get_ups = loop.statistics().get_ups;
  if (get_ups > 0 && procedure.outcome() == RunOutcome::kCompleted &&
      loop.record().cycles >= study_.run.cycles && EndsAsAsked(judge, robot.posture())) {
    outcome.verdict = TrialOutcome::Verdict::kGotUp;
    if (outcome.in.empty()) outcome.in = motion_.file().graph.node(fell_after).name.view();
    if (outcome.reason.empty()) outcome.reason = "it fell, by its sensor";
    outcome.reason += fmt::format("; it got up {} time{}", get_ups, get_ups == 1 ? "" : "s");
  }
  if (robot.posture().falls() == 0 && procedure.outcome() != RunOutcome::kCompleted) {
    outcome.verdict = TrialOutcome::Verdict::kFault;
    outcome.reason =
        procedure.outcome() == RunOutcome::kRefused
            ? Describe(procedure.refusal(), robot.joints(), ErrorCodesOf(drives()))
            : Describe(loop.record().first_fault, robot.joints(), ErrorCodesOf(drives()));
  }
  if (dropped) {
    outcome.lies_rad = lie.lies_rad();
    if (lie.node() >= 0) outcome.begun = motion_.file().graph.node(lie.node()).name.view();
  }
  return outcome;
}

std::string Trials::name() const { return std::string(motion_.file().graph.name.view()); }

const char* ToString(TrialOutcome::Verdict verdict) {
  switch (verdict) {
    case TrialOutcome::Verdict::kStands:
      return "stands";
    case TrialOutcome::Verdict::kAmiss:
      return "amiss";
    case TrialOutcome::Verdict::kFell:
      return "fell";
    case TrialOutcome::Verdict::kOverlap:
      return "overlap";
    case TrialOutcome::Verdict::kFault:
      return "fault";
    case TrialOutcome::Verdict::kGotUp:
      return "got up";
    case TrialOutcome::Verdict::kNotJudged:
      return "not judged";
  }
  return "?";
}

}  // namespace tumbler
