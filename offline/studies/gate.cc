#include "offline/studies/gate.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "common/core/index.h"
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

/// So many draws are looked at for each that is asked for.
constexpr int kDrawnForEach = 2;

/// With which zeros of its encoders a robot plays a motion: those of the drives file, or those with
/// which it was recorded, as what it has failed in before they were corrected.
enum class PlayedZeros { kOfDrives, kOfRecords };

/// The robots of a posterior in a motion.
class GateRobots {
 public:
  GateRobots(const std::string& motion, const std::string& drives, const PosteriorFile& posterior,
             PlayedZeros zeros, GateSettings settings = {})
      : settings_(std::move(settings)), known_(posterior), trials_(StudyOf(motion, drives)) {
    if (known_.drives.of_joint.empty()) return;
    const PosteriorDrives played = FactsOf(trials_.drives());
    const std::string difference = DifferenceOf(played, known_.drives, false);
    if (!difference.empty()) {
      throw std::invalid_argument(fmt::format(
          "{}: {} and those with which the records were made differ: {}; {}",
          drives.empty() ? motion : drives,
          drives.empty() ? "the default drives with this motion's gains" : "its drives", difference,
          drives.empty() ? "it is to be played with those (--drives of the gate), or the robot "
                           "recorded with these"
                         : "give those of the records, or record the robot with these"));
    }
    if (zeros == PlayedZeros::kOfDrives) ShiftZeros(known_, played);
  }
  [[nodiscard]] const DrivesConfig& drives() const { return trials_.drives(); }

  /// @param number  0: the mean; from 1 on: a draw.
  [[nodiscard]] TrialOutcome Play(int number, double deviations) {
    const RobotPosterior& robots = known_.posterior;
    if (number == 0) return Play(robots.mean);
    RobotVariation robot =
        RobotOf(robots.Draw(deviations, settings_.seed, static_cast<std::uint64_t>(number)));
    AddMargins(trials_.scene(), settings_, deviations, number, robot);
    return trials_.Play(robot);
  }
  /// @throws Refused  where nobody can say of the model whether it fails.
  void CheckIsJudged(const std::string& motion) {
    if (trials_.Play(trials_.Model()).judged()) return;
    throw Refused(motion +
                  ": asks for nothing that its robot could be judged by, so that nobody can say "
                  "whether one fails in it");
  }
  /// @param coordinates  with zeros as the posterior's, which are of the records' drives.
  [[nodiscard]] TrialOutcome Play(const std::vector<double>& coordinates) {
    return trials_.Play(RobotOf(coordinates));
  }

 private:
  [[nodiscard]] RobotVariation RobotOf(const std::vector<double>& coordinates) const {
    const std::vector<RobotQuantity>& quantities = known_.posterior.quantities;
    RobotVariation robot = VariationOf(trials_.scene(), quantities, coordinates);
    OwnDrives(StatedIn(known_.drives), quantities, robot);
    TakeOff(trials_.robot().motors, robot);
    return robot;
  }
  static RobustnessStudy StudyOf(const std::string& motion, const std::string& drives) {
    if (LoadMotion(motion).graph.edge_count > 0)
      throw Refused(motion + ": goes on for ever; give motions that end, one by one");
    RobustnessStudy study;
    study.motion = motion;
    study.drives = drives;
    return study;
  }

  GateSettings settings_;
  PosteriorFile known_;
  Trials trials_;
};

}  // namespace

int GateOutcome::left_out() const {
  return std::transform_reduce(failed.begin(), failed.end(), 0, std::plus<>{},
                               [](const FailedMotion& motion) { return motion.left_out; });
}

bool GateOutcome::credible() const {
  return robots.size() == Index(draws.count) + 1 &&
         std::ranges::all_of(failed, &FailedMotion::mean_fails);
}

bool GateOutcome::open() const {
  return !interrupted && credible() && std::ranges::all_of(robots, &TrialOutcome::stands);
}

GateOutcome PassGate(const std::string& motion, const std::string& drives,
                     const PosteriorFile& posterior, const GateSettings& settings) {
  GateRobots asked(motion, drives, posterior, PlayedZeros::kOfDrives, settings);
  std::vector<GateRobots> failed_in;
  for (const std::string& failed : settings.failed) {
    failed_in.emplace_back(failed, drives, posterior, PlayedZeros::kOfRecords, settings);
    failed_in.back().CheckIsJudged(failed);
  }
  GateOutcome outcome;
  outcome.drives = asked.drives();
  outcome.draws = posterior.effective ? kDrawsOfEffective : GateDraws{};
  if (settings.draws) outcome.draws.count = *settings.draws;
  if (settings.deviations) outcome.draws.deviations = *settings.deviations;
  const double deviations = outcome.draws.deviations;
  const auto ended = [&] { return settings.interrupt != nullptr && *settings.interrupt; };
  for (std::size_t i = 0; i < failed_in.size() && !ended(); ++i)
    outcome.failed.push_back({settings.failed[i], failed_in[i].Play(0, deviations).fails()});
  if (!ended()) outcome.robots.push_back(asked.Play(0, deviations));
  // Whether a draw is this robot is asked before what it does in the motion.
  const auto is_left_out = [&](int number) {
    for (std::size_t i = 0; i < failed_in.size() && !ended(); ++i) {
      if (failed_in[i].Play(number, deviations).fails()) continue;
      ++outcome.failed[i].left_out;
      return true;
    }
    return false;
  };
  const int wanted = outcome.draws.count;
  const auto missing = [&] { return static_cast<int>(outcome.robots.size()) <= wanted; };
  for (int number = 1; number <= kDrawnForEach * wanted && missing() && !ended(); ++number) {
    if (is_left_out(number) || ended()) continue;
    outcome.robots.push_back(asked.Play(number, deviations));
  }
  outcome.interrupted = ended() && missing();
  return outcome;
}

std::function<bool(const std::vector<double>&)> FailsIn(const std::string& motion,
                                                        const std::string& drives,
                                                        const PosteriorFile& like) {
  // The function is to be cheap to copy.
  const auto robots = std::make_shared<GateRobots>(motion, drives, like, PlayedZeros::kOfRecords);
  robots->CheckIsJudged(motion);
  return [robots](const std::vector<double>& coordinates) {
    return robots->Play(coordinates).fails();
  };
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
  for (const FailedMotion& of : outcome.failed) {
    failed.Append(
        {{"motion", of.motion}, {"mean_fails", of.mean_fails}, {"left_out", of.left_out}});
  }
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
