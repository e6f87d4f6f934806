#include "offline/studies/lane_trials.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/files/program.h"
#include "offline/scene/self_clearance.h"
#include "offline/studies/look_ticks.h"
#include "runtime/executor/run_procedure.h"

namespace tumbler {
namespace {

constexpr std::size_t kLanes = Packet::kLanes;
/// A swing adds up what each step is off by, and above a bar it grows.
constexpr int kStepsOnBar = 40;

/// One robot with its judges.
struct Judged {
  Judged(const SequenceFile& file, const PostureConfig& config, const PrimitivePose& start,
         const Scene& scene)
      : purpose(file, scene.robot),
        posture(file, config, start),
        distances(scene.robot, scene.self_contact.pairs),
        q(scene.robot.joint_count() + 3) {
    truth.joint_positions_rad.resize(scene.robot.joint_count());
    truth.joint_velocities_rad_s.resize(scene.robot.joint_count());
  }

  /// Shows the judges the robot's state at a tick.
  /// @param next  the tick in which they look again.
  void Look(const LaneState<Packet>& state, std::size_t lane, std::int64_t time_ns, std::size_t k,
            std::size_t next, const Script& script, const TickRecord& record) {
    Take(state, lane);
    truth.time_ns = time_ns;
    truth.held = script.ticks[k].held;
    truth.self_overlap_m = std::max(0.0, -distances.Nearest(q, 1e-3).distance_m);
    purpose.Observe(record, truth.time_ns, truth);
    departure.Observe(script.ticks[k], truth.root_pitch_rad, static_cast<std::int64_t>(next - k));
    posture.Observe(truth, {}, {true, false});
    over = posture.falls() > 0;
  }

  void Take(const LaneState<Packet>& state, std::size_t lane) {
    truth.root_x_m = state.q[0].lane(lane);
    truth.root_z_m = state.q[1].lane(lane);
    truth.root_pitch_rad = state.q[2].lane(lane);
    truth.root_vx_m_s = state.v[0].lane(lane);
    truth.root_vz_m_s = state.v[1].lane(lane);
    truth.root_pitch_rate_rad_s = state.v[2].lane(lane);
    for (std::size_t j = 0; j < truth.joint_positions_rad.size(); ++j) {
      truth.joint_positions_rad[j] = state.q[j + 3].lane(lane);
      truth.joint_velocities_rad_s[j] = state.v[j + 3].lane(lane);
      q[j + 3] = state.q[j + 3].lane(lane);
    }
  }

  PurposeJudge purpose;
  PostureWatch posture;
  SelfDistances distances;
  std::vector<double> q;  // as distances take them; those of the root do not matter
  DepartureWatch departure;
  TwinState truth;
  std::size_t whole_ticks = 0;  // by which setpoints are late, besides a part of a tick
  bool over = false;
};

LaneState<double> StateAt(const PrimitivePose& pose) {
  LaneState<double> state{};
  state.q[0] = pose.root_x_m;
  state.q[1] = pose.root_z_m;
  state.q[2] = pose.root_pitch_rad;
  std::copy(pose.joint_positions_rad.begin(), pose.joint_positions_rad.end(), state.q.begin() + 3);
  return state;
}

bool HasFeedback(const SequenceFile& file) {
  for (int node = 0; node < file.graph.node_count; ++node) {
    if (file.PrimitiveOf(node).primitive.feedback.present()) return true;
  }
  return false;
}

void Displace(LaneState<Packet>& state, std::size_t lane, const PlanarRobot& robot,
              const RobotVariation& variation) {
  const auto q = variation.StartPositions(robot), v = variation.StartRates(robot);
  for (std::size_t i = 0; i < q.size(); ++i) {
    state.q[i].set_lane(lane, state.q[i].lane(lane) + q[i]);
    state.v[i].set_lane(lane, state.v[i].lane(lane) + v[i]);
  }
}

/// Adds the setpoints of a tick, which some robots get later.
void TellAll(const Script& script, std::size_t k, const std::vector<Judged>& judged,
             std::vector<LaneSetpoint<Packet>>& setpoints) {
  const std::size_t first = setpoints.size();
  for (const JointSetpoint& s : script.ticks[k].setpoints) {
    setpoints.push_back({Packet::Of(static_cast<double>(s.position_rad)),
                         Packet::Of(static_cast<double>(s.velocity_rad_s)),
                         Packet::Of(static_cast<double>(s.torque_nm))});
  }
  for (std::size_t lane = 0; lane < judged.size(); ++lane) {
    const std::size_t late = std::min(k, judged[lane].whole_ticks);
    if (late == 0) continue;
    for (std::size_t j = first; j < setpoints.size(); ++j) {
      const JointSetpoint& s = script.ticks[k - late].setpoints[j - first];
      setpoints[j].position.set_lane(lane, static_cast<double>(s.position_rad));
      setpoints[j].velocity.set_lane(lane, static_cast<double>(s.velocity_rad_s));
      setpoints[j].third.set_lane(lane, static_cast<double>(s.torque_nm));
    }
  }
}

}  // namespace

LaneTrials::LaneTrials(const RobustnessStudy& study, int finer, int look_every) : trials_(study) {
  if (!study.twin.empty())
    throw Refused(study.twin + ": lanes do not simulate what twin files ask for; leave it out");
  if (study.disturbs())
    throw Refused(study.motion + ": lanes have no pushes and no sensors that fail; leave them out");
  if (trials_.drives().sensor && HasFeedback(trials_.motion().file())) {
    throw Refused(study.motion +
                  ": lanes have no sensor, by which this motion is played with these drives");
  }
  const Script& script = trials_.script();
  if (script.delay_s.empty())
    throw Refused(study.motion + ": the model itself does not get as far as this motion");
  if (!script.broken_off.empty()) {
    throw Refused(fmt::format(
        "{}: the model's own run is broken off, and lanes play what its drives were told: {}",
        study.motion, script.broken_off));
  }
  looks_ = LookTicks(script, trials_.motion().file(), static_cast<std::size_t>(look_every));
  steps_.tick_s = script.tick_s;
  if (trials_.scene().robot.hinged()) steps_.per_tick = kStepsOnBar;
  // Steps that are fine for a bar are fine for much harder ground, too.
  finer = std::max(finer, FinerStepsFor(trials_.scene().contact, trials_.study().spreads,
                                        trials_.study().scale));
  steps_.per_tick = std::max(steps_.per_tick, LaneSteps{}.per_tick * finer);
  for (std::size_t j = 0; j < trials_.drives().drives.size(); ++j) {
    const DriveEntry& entry = trials_.drives().drives[j];
    LaneDrive& drive = drives_.emplace_back();
    drive.kp = static_cast<double>(entry.kp_nm_per_rad);
    drive.kd = static_cast<double>(entry.kd_nm_s_per_rad);
    drive.torque_max_nm = *trials_.robot().motors[j].torque_max_nm;
    drive.delay_s = std::clamp(script.delay_s[j], 0.0, script.tick_s);
  }
  try {
    model_ = MakeLaneScene(trials_.scene(), drives_.front());
  } catch (const std::invalid_argument& error) {
    throw Refused(fmt::format("{}: cannot be simulated in lanes: {}", study.motion, error.what()));
  }
}

LaneRobot<double> LaneTrials::RobotOf(const Scene& scene, const RobotVariation& variation) const {
  LaneRobot<double> robot = MakeLaneScene(scene, drives_.front()).robot;
  const double tick_s = steps_.tick_s;
  for (std::size_t j = 0; j < drives_.size(); ++j) {
    auto& joint = robot.joints[j];
    const JointMotor& motor = trials_.robot().motors[j];
    const double torque = *motor.torque_factor * variation.joints[j].torque;
    joint.kp = drives_[j].kp * variation.joints[j].gain * torque;
    joint.kd = drives_[j].kd * variation.joints[j].gain * torque;
    joint.torque_max = drives_[j].torque_max_nm * variation.joints[j].torque_limit * torque;
    joint.feed_forward = torque;
    joint.velocity_filter =
        std::max(0.0, *motor.velocity_filter_s + variation.joints[j].velocity_filter_s);
    joint.torque_lag =
        std::max(0.0, *motor.torque_time_constant_s + variation.joints[j].torque_lag_s);
    const double late_s = std::fmod(variation.delay_s, tick_s);
    joint.delay = std::min(drives_[j].delay_s + late_s, tick_s);
    if (motor.encoder_counts_per_turn > 0) {
      const JointMap map = JointOf(trials_.drives().drives[j].config);
      const double turn_rad = 2 * std::numbers::pi / std::abs(static_cast<double>(map.gear_ratio));
      joint.zero_error = -0.5 * turn_rad / motor.encoder_counts_per_turn;
      if (map.direction < 0) joint.zero_error = -joint.zero_error;
    }
    joint.zero_error += variation.joints[j].zero_rad;
  }
  return robot;
}

std::vector<TrialOutcome> LaneTrials::Play(std::span<const std::uint64_t> indices) const {
  std::vector<RobotVariation> variations;
  for (const std::uint64_t index : indices) variations.push_back(trials_.Draw(index));
  return Play(variations);
}

void LaneTrials::Rest(const LaneRobot<Packet>& robots, const ScriptTick& tick,
                      HeldSetpoints<Packet>& held, LaneState<Packet>& state) const {
  const std::size_t joints = drives_.size();
  std::array<bool, kLanes> rocks{};
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    for (std::size_t j = 0; j < joints; ++j) {
      const double moves_rad = std::abs(robots.joints[j].zero_error.lane(lane));
      rocks[lane] = rocks[lane] || moves_rad > static_cast<double>(RunProcedure::kRocks_rad);
    }
  }
  if (std::ranges::none_of(rocks, std::identity{})) return;
  HeldSetpoints<Packet> start = held;
  for (std::size_t j = 0; j < joints; ++j) {
    const JointSetpoint& s = tick.setpoints[j];
    start[j] = {Packet::Of(static_cast<double>(s.position_rad)), Packet::Of(0),
                Packet::Of(static_cast<double>(s.torque_nm))};
  }
  std::vector<LaneSetpoint<Packet>> setpoints;
  const auto ticks = std::llround(trials_.study().run.rest_s / steps_.tick_s);
  const auto end = start.begin() + static_cast<std::ptrdiff_t>(joints);
  for (std::int64_t k = 0; k < ticks; ++k) setpoints.insert(setpoints.end(), start.begin(), end);
  LaneState<Packet> rested = state;
  HeldSetpoints<Packet> before = start;
  LaneWatch<Packet> watch;
  PacketKernels().front()->drive(model_.model, robots, steps_, setpoints, before, rested, watch);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (!rocks[lane]) continue;
    for (std::size_t j = 0; j < joints; ++j) {
      held[j].position.set_lane(lane, start[j].position.lane(lane));
      held[j].velocity.set_lane(lane, start[j].velocity.lane(lane));
      held[j].third.set_lane(lane, start[j].third.lane(lane));
    }
    for (std::size_t d = 0; d < joints + 3; ++d) {
      state.q[d].set_lane(lane, rested.q[d].lane(lane));
      state.v[d].set_lane(lane, rested.v[d].lane(lane));
    }
    for (std::size_t j = 0; j < joints; ++j) {
      state.seen[j].set_lane(lane, rested.seen[j].lane(lane));
      state.exerted[j].set_lane(lane, rested.exerted[j].lane(lane));
    }
  }
}

std::vector<TrialOutcome> LaneTrials::Play(std::span<const RobotVariation> variations) const {
  const SequenceFile& file = trials_.motion().file();
  const Script& script = trials_.script();
  const PrimitivePose start = trials_.robot().start.value_or(StartOf(file));
  std::vector<Judged> judged;
  std::array<LaneRobot<double>, kLanes> robots{};
  judged.reserve(variations.size());
  for (const RobotVariation& variation : variations) {
    const Scene scene = Varied(trials_.scene(), variation);
    robots[judged.size()] = RobotOf(scene, variation);
    judged.emplace_back(file, trials_.robot().posture, start, scene);
    judged.back().whole_ticks = static_cast<std::size_t>(variation.delay_s / script.tick_s);
  }
  // Lanes without a robot have the first one's.
  for (std::size_t lane = variations.size(); lane < kLanes; ++lane) robots[lane] = robots[0];
  const LaneRobot<Packet> packed = PackLanes<LaneRobot>(robots);
  std::array<LaneState<double>, kLanes> states;
  states.fill(StateAt(start));
  LaneState<Packet> state = PackLanes<LaneState>(states);
  HeldSetpoints<Packet> held{};
  LaneWatch<Packet> watch;
  const LaneKernel<Packet>& kernel = *PacketKernels().front();
  std::vector<LaneSetpoint<Packet>> setpoints;
  TickRecord record;
  bool begun = false, free = false;
  for (std::size_t look = 0; look + 1 < looks_.size(); ++look) {
    const std::size_t k = looks_[look], next = looks_[look + 1];
    const ScriptTick& tick = script.ticks[k];
    record.state = tick.state;
    record.node = tick.node;
    record.primitive_time_s = tick.primitive_time_s;
    const std::int64_t time_ns = std::llround(1e9 * script.tick_s * static_cast<double>(k));
    bool any = false;
    for (std::size_t lane = 0; lane < judged.size(); ++lane) {
      if (judged[lane].over) continue;
      judged[lane].Look(state, lane, time_ns, k, next, script, record);
      any = any || !judged[lane].over;
    }
    if (!any) break;
    if (tick.held) continue;  // and so are all ticks up to the next look
    if (!begun && tick.state == ExecutorState::kRunning) {
      begun = true;
      for (std::size_t lane = 0; lane < variations.size(); ++lane)
        Displace(state, lane, trials_.scene().robot, variations[lane]);
    }
    if (!free) Rest(packed, tick, held, state);
    free = true;
    setpoints.clear();
    for (std::size_t t = k; t < next; ++t) TellAll(script, t, judged, setpoints);
    kernel.drive(model_.model, packed, steps_, setpoints, held, state, watch);
  }
  std::vector<TrialOutcome> outcomes;
  for (std::size_t lane = 0; lane < judged.size(); ++lane) {
    const Judged& robot = judged[lane];
    outcomes.push_back(
        OutcomeOf(robot.purpose, robot.posture, robot.departure, file, script.tick_s));
    outcomes.back().variation = variations[lane];
  }
  return outcomes;
}

}  // namespace tumbler
