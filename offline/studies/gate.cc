#include "offline/studies/gate.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "common/files/json.h"
#include "common/files/program.h"
#include "offline/studies/identified_drives.h"
#include "offline/studies/stated_motors.h"

namespace tumbler {
namespace {

/// Lets a robot differ in what no record tells.
void AddMargins(const Scene& scene, const GateSettings& settings, double deviations, int index,
                RobotVariation& robot) {
  Spreads spreads;
  spreads.mass = 0;
  spreads.LeaveGround();
  spreads.torque_limit = settings.margins.torque_limit;
  spreads.delay_s = settings.margins.delay_s;
  constexpr std::uint64_t kOtherSeed = 0x9e3779b9;  // numbers that are not those of the posterior
  const RobotVariation other = DrawRobot(scene, spreads, deviations, settings.seed ^ kOtherSeed,
                                         static_cast<std::uint64_t>(index));
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    robot.joints[j].torque_limit = other.joints[j].torque_limit;
  robot.delay_s = other.delay_s;
}

/// Makes of how a robot's motors are by how much they depart from those that are played.
void TakeOff(const std::vector<JointMotor>& played, RobotVariation& robot) {
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    robot.joints[j].torque /= *played[j].torque_factor;
    robot.joints[j].velocity_filter_s -= *played[j].velocity_filter_s;
    robot.joints[j].torque_lag_s -= *played[j].torque_time_constant_s;
  }
}

}  // namespace

bool GateOutcome::credible() const {
  return std::ranges::all_of(failed, [](const FailedMotion& motion) { return motion.stand == 0; });
}

bool GateOutcome::open() const {
  return !robots.empty() && credible() &&
         std::ranges::all_of(robots, [](const TrialOutcome& robot) { return robot.stands(); });
}

namespace {

/// Plays the gate's robots in a motion.
GateOutcome PlayRobots(const std::string& motion, const std::string& drives,
                       const PosteriorFile& posterior, const GateSettings& settings) {
  if (LoadMotion(motion).graph.edge_count > 0)
    throw Refused(motion + ": goes on for ever; the gate takes motions that end, one by one");
  RobustnessStudy study;
  study.motion = motion;
  study.drives = drives;
  Trials trials(study);
  GateOutcome outcome;
  outcome.drives = trials.drives();
  PosteriorFile known = posterior;
  if (!known.drives.of_joint.empty()) {
    const PosteriorDrives played = FactsOf(outcome.drives);
    const std::string difference = DifferenceOf(played, known.drives, false);
    if (!difference.empty()) {
      throw std::invalid_argument(fmt::format(
          "{}: {} and those with which the records of the posterior were made differ: {}; {}",
          drives.empty() ? motion : drives,
          drives.empty() ? "the default drives with this motion's gains" : "its drives", difference,
          drives.empty() ? "name their drives file (--drives)"
                         : "give those of the records, or record the robot with these"));
    }
    ShiftZeros(known, played);
  }
  outcome.draws = posterior.effective ? kDrawsOfEffective : GateDraws{};
  if (settings.draws) outcome.draws.count = *settings.draws;
  if (settings.deviations) outcome.draws.deviations = *settings.deviations;
  for (int i = 0; i <= outcome.draws.count; ++i) {
    const RobotPosterior& robots = known.posterior;
    const std::vector<double> coordinates =
        i == 0
            ? robots.mean
            : robots.Draw(outcome.draws.deviations, settings.seed, static_cast<std::uint64_t>(i));
    RobotVariation robot = VariationOf(trials.scene(), robots.quantities, coordinates);
    OwnDrives(StatedIn(known.drives), robots.quantities, robot);
    TakeOff(trials.robot().motors, robot);
    if (i > 0) AddMargins(trials.scene(), settings, outcome.draws.deviations, i, robot);
    outcome.robots.push_back(trials.Play(robot));
  }
  return outcome;
}

}  // namespace

GateOutcome PassGate(const std::string& motion, const std::string& drives,
                     const PosteriorFile& posterior, const GateSettings& settings) {
  GateOutcome outcome = PlayRobots(motion, drives, posterior, settings);
  for (const std::string& failed : settings.failed) {
    const GateOutcome again = PlayRobots(failed, drives, posterior, settings);
    const auto stand = std::ranges::count_if(
        again.robots, [](const TrialOutcome& robot) { return !robot.fails(); });
    outcome.failed.push_back({failed, static_cast<int>(stand)});
  }
  return outcome;
}

std::string ToJson(const GateOutcome& outcome, const GateSettings& settings,
                   const std::string& motion, const std::string& drives,
                   const std::string& posterior, bool effective) {
  auto robots = Json::Array();
  for (std::size_t i = 0; i < outcome.robots.size(); ++i) {
    const TrialOutcome& robot = outcome.robots[i];
    robots.Append({{"deviations", i == 0 ? 0.0 : outcome.draws.deviations},
                   {"verdict", ToString(robot.verdict)},
                   {"reason", robot.reason}});
  }
  const PosteriorDrives facts = FactsOf(outcome.drives);
  auto of_joint = Json::Array();
  for (const PosteriorDrive& drive : facts.of_joint) {
    of_joint.Append({{"joint", drive.joint},
                     {"protocol", drive.protocol},
                     {"kp_nm_per_rad", drive.kp_nm_per_rad},
                     {"kd_nm_s_per_rad", drive.kd_nm_s_per_rad},
                     {"zero_offset_rad", drive.zero_offset_rad}});
  }
  auto failed = Json::Array();
  for (const FailedMotion& of : outcome.failed)
    failed.Append({{"motion", of.motion}, {"stand", of.stand}});
  const Json json = {
      {"motion", motion},
      {"posterior", posterior},
      {"effective", effective},
      {"open", outcome.open()},
      {"draws", outcome.draws.count},
      {"seed", settings.seed},
      {"margins",
       {{"torque_limit", settings.margins.torque_limit}, {"delay_s", settings.margins.delay_s}}},
      {"drives",
       {{"file", drives},
        {"default", drives.empty()},
        {"rate_hz", facts.rate_hz},
        {"of_joint", of_joint}}},
      {"twin", {{"file", ""}, {"default", true}}},
      {"robots", robots},
      {"failed", failed},
  };
  return json.Dump(2) + "\n";
}

}  // namespace tumbler
