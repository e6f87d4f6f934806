#include "offline/rehearsal/robustness/trial.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "common/program.h"
#include "offline/rehearsal/sim/purpose_judge.h"
#include "offline/rehearsal/twin/twin_toml.h"
#include "runtime/assembly/assembly.h"
#include "runtime/assembly/run_checks.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/linux/clock.h"
#include "runtime/linux/operator_mailbox.h"
#include "runtime/run/control_loop.h"
#include "runtime/telemetry/sentences.h"

namespace tumbler {
namespace {

/// The twin file's own law of contact becomes the scene's, so that a robot's factors are of it.
Scene SharedScene(const SimulatedMotion& motion, SimulatedRobotConfig& robot) {
  Scene scene = motion.scene();
  if (robot.twin.contact) scene.contact = *std::exchange(robot.twin.contact, std::nullopt);
  return scene;
}

/// What the passages and the posture say, once the run is over or the robot fell.
void Judge(const PurposeJudge& judge, const PostureWatch& posture, TrialOutcome& outcome) {
  outcome.motions = static_cast<int>(judge.passages().size());
  for (const Passage& passage : judge.passages()) {
    if (!passage.amiss()) continue;
    outcome.verdict = TrialOutcome::Verdict::kAmiss;
    outcome.in = passage.node;
    outcome.reason = "the pitch later is not the planned one";
    for (const JudgedTarget& judged : passage.purpose) {
      if (judged.met() != false) continue;
      const PurposeFigure figure{judged.target, *judged.result};
      outcome.reason = figure.name() + ": " + figure.AskedAndGot(*judged.result);
      break;
    }
    break;
  }
  for (const PostureEvent& event : posture.events()) {
    if (event.kind == PostureEvent::Kind::kRest) continue;
    const bool fell = event.kind == PostureEvent::Kind::kFall;
    outcome.verdict = fell ? TrialOutcome::Verdict::kFell : TrialOutcome::Verdict::kOverlap;
    outcome.reason = event.cause;
    if (outcome.in.empty() && !judge.passages().empty()) outcome.in = judge.passages().back().node;
    break;
  }
}

}  // namespace

Trials::Trials(const RobustnessStudy& study) : study_(study), motion_(LoadMotion(study.motion)) {
  if (!study.twin.empty()) robot_ = LoadTwin(study.twin, motion_);
  drives_ = LoadDrivesOf(JointsOf(motion_.file()), study.drives, ReadTextFile);
  scene_ = SharedScene(motion_, robot_);
  robot_.motors.resize(drives_.drives.size());
  for (std::size_t j = 0; j < robot_.motors.size(); ++j) {
    if (!robot_.motors[j].torque_max_nm)
      robot_.motors[j].torque_max_nm = LargestTorqueLimit(motion_.file(), j);
  }
}

TrialOutcome Trials::Play(std::uint64_t index) {
  TrialOutcome outcome;
  outcome.variation = DrawRobot(scene_.robot, study_.spreads, study_.scale, study_.seed, index);
  const RobotVariation& variation = outcome.variation;

  SimulatedRobotConfig config = robot_;
  config.scene = Varied(scene_, variation);
  RunParts parts{motion_.file(), std::make_unique<const Sequence<float>>(ToRuntime(motion_.file())),
                 drives_};
  for (std::size_t j = 0; j < variation.joints.size(); ++j) {
    const RobotVariation::Joint& joint = variation.joints[j];
    config.motors[j].torque_max_nm = *config.motors[j].torque_max_nm * joint.torque_limit;
    DriveEntry& drive = parts.drives.drives[j];
    drive.kp_nm_per_rad *= static_cast<float>(joint.gain);
    drive.kd_nm_s_per_rad *= static_cast<float>(joint.gain);
  }
  SimulatedRobot robot(motion_, parts.drives, config);
  const DrivesConfig drives = parts.drives;
  Assembly assembly(std::move(parts));
  if (assembly.Configure(ExecutorConfigOf(study_.run, drives)) != Status::kOk)
    throw Refused(study_.motion + ": the executor does not take this motion");

  PurposeJudge judge(motion_.file(), true);
  SimulatedPort& host = robot.bus().Attach();
  VirtualClock clock([&robot](std::int64_t time_ns) { robot.AdvanceTo(time_ns); });
  RunProcedure procedure(ProcedureConfigOf(study_.run, drives));
  OperatorMailbox mailbox;
  ControlLoop loop({assembly.executor(), host, clock, procedure, mailbox},
                   static_cast<std::int64_t>(std::llround(1e9 / drives.rate_hz)), 0);
  while (loop.Step()) {
    judge.Observe(loop.record(), loop.time_ns(), robot.state());
    if (robot.posture().falls() > 0) break;
  }
  Judge(judge, robot.posture(), outcome);
  if (robot.posture().falls() == 0 && procedure.outcome() != RunOutcome::kCompleted) {
    outcome.verdict = TrialOutcome::Verdict::kFault;
    outcome.reason = Describe(loop.record().first_fault, robot.joints());
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
  }
  return "?";
}

}  // namespace tumbler
