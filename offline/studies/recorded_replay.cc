#include "offline/studies/recorded_replay.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/core/index.h"
#include "offline/studies/stated_motors.h"

namespace tumbler {
namespace {

/// How records are replayed.
struct Replaying {
  static constexpr std::size_t kLanes = Packet::kLanes;
  /// How long a robot stands on its own ground before the recorded hold, in rough steps.
  static constexpr double kRests_s = 0.3;
  static constexpr int kRoughSteps = 4;
  /// What is compared of the hold before the motion.
  static constexpr double kBefore_s = 0.1;
  /// A drive's own loop: it acts on what it sampled at the beginning of a period, answers with
  /// that, and a setpoint takes effect in the next one. 20 kHz is what drives have, and the twin.
  static constexpr double kDriveLoop_s = 50e-6;
  /// What no part of the model says. (Lanes at 20 steps in a millisecond are off by less.)
  static constexpr double kModelNoise_rad = 1e-4;
};
constexpr std::size_t kReplayed = Replaying::kLanes;

/// A cubic between two states that are h apart [s].
double Between(double q0, double v0, double q1, double v1, double h, double part) {
  const double s = part, r = 1 - part;
  return r * r * (1 + 2 * s) * q0 + s * s * (1 + 2 * r) * q1 + h * s * r * (r * v0 - s * v1);
}

/// When a drive samples the position with which it answers a frame, from the tick on [s]. Where
/// nothing tells when its periods begin it is half a period before, on the average.
double SampledAfter(double frame_s, bool periods_with_ticks) {
  if (!periods_with_ticks) return frame_s - 0.5 * Replaying::kDriveLoop_s;
  constexpr double kRounding = 1e-6;  // of a period
  return Replaying::kDriveLoop_s * std::floor(frame_s / Replaying::kDriveLoop_s + kRounding);
}

}  // namespace

RecordedReplay::RecordedReplay(const RecordedMotion& motion,
                               std::span<const RobotQuantity> quantities)
    : motion_(motion), quantities_(quantities.begin(), quantities.end()) {
  const Scene& scene = motion.scene;
  model_ = MakeLaneScene(scene, LaneDrive{}).model;
  const PrimitivePose& start = motion.start;
  start_.q[0] = start.root_x_m;
  start_.q[1] = start.root_z_m;
  start_.q[2] = start.root_pitch_rad;
  for (std::size_t j = 0; j < motion.joint_count(); ++j)
    start_.q[j + 3] = motion.ticks.front()[j].setpoint.position;
  const auto before = static_cast<std::size_t>(std::lround(Replaying::kBefore_s / motion.tick_s));
  first_ = motion.begins - std::min(motion.begins, before);
  FindParts();
  for (const RecordedDrive& joint : motion.joints) {
    stated_.push_back(joint.motor);
    noise_rad_.push_back(std::sqrt(joint.noise_rad * joint.noise_rad +
                                   Replaying::kModelNoise_rad * Replaying::kModelNoise_rad));
  }
}

void RecordedReplay::FindParts() {
  const std::size_t joints = motion_.joint_count(), ticks = motion_.ticks.size() - first_;
  parts_.assign(count(), 0.0);
  for (std::size_t j = 0; j < joints; ++j) {
    const auto reading = [&](std::size_t k) { return motion_.ticks[first_ + k][j].reading_rad; };
    for (std::size_t k = 0; k < ticks;) {
      std::size_t end = k + 1;
      while (end < ticks && reading(end) == reading(k)) ++end;
      const double part = std::isfinite(reading(k)) ? 1 / static_cast<double>(end - k) : 0;
      for (; k < end; ++k) parts_[k * joints + j] = part;
    }
  }
}

double RecordedReplay::ActsAfter(double arrival_s) const {
  return std::min(arrival_s + 0.5 * Replaying::kDriveLoop_s, motion_.tick_s);
}

LaneRobot<double> RecordedReplay::RobotOf(std::span<const double> coordinates,
                                          Sampling& sampling) const {
  RobotVariation variation = VariationOf(motion_.scene, quantities_, coordinates);
  OwnDrives(stated_, quantities_, variation);
  LaneRobot<double> robot = MakeLaneScene(Varied(motion_.scene, variation), LaneDrive{}).robot;
  for (std::size_t j = 0; j < motion_.joint_count(); ++j) {
    auto& joint = robot.joints[j];
    const RecordedDrive& drive = motion_.joints[j];
    const double torque = variation.joints[j].torque;
    joint.kp = drive.kp * torque;
    joint.kd = drive.kd * torque;
    joint.torque_max = drive.torque_max_nm * torque;
    joint.feed_forward = torque;
    joint.velocity_filter = variation.joints[j].velocity_filter_s;
    joint.torque_lag = variation.joints[j].torque_lag_s;
    joint.zero_error = variation.joints[j].zero_rad + drive.encoder_bias_rad;
    joint.delay = ActsAfter(drive.arrival_s);
    sampling.bias_rad.push_back(joint.zero_error + drive.wire_bias_rad);
  }
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    if (quantities_[i].kind == RobotQuantity::Kind::kLag) sampling.lag_s = coordinates[i];
  }
  return robot;
}

RecordedReplay::Residuals RecordedReplay::Play(std::span<const std::vector<double>> robots,
                                               int per_tick,
                                               std::span<const std::vector<double>> starts) const {
  Residuals residuals;
  residuals.of_robot.resize(robots.size());
  for (std::size_t first = 0; first < robots.size(); first += kReplayed) {
    const std::size_t n = std::min(kReplayed, robots.size() - first);
    PlayPacket(robots.subspan(first, n), per_tick,
               starts.empty() ? starts : starts.subspan(first, n),
               std::span(residuals.of_robot).subspan(first, n));
  }
  return residuals;
}

void RecordedReplay::PlayPacket(std::span<const std::vector<double>> robots, int per_tick,
                                std::span<const std::vector<double>> starts,
                                std::span<std::vector<double>> residuals) const {
  const std::size_t joints = motion_.joint_count();
  std::array<LaneRobot<double>, kReplayed> each{};
  std::array<Sampling, kReplayed> sampling;
  for (std::size_t lane = 0; lane < robots.size(); ++lane)
    each[lane] = RobotOf(robots[lane], sampling[lane]);
  for (std::size_t lane = robots.size(); lane < kReplayed; ++lane) each[lane] = each[0];
  LaneRobot<Packet> packed = PackLanes<LaneRobot>(each);
  std::array<LaneState<double>, kReplayed> states;
  states.fill(start_);
  for (std::size_t lane = 0; lane < starts.size(); ++lane)
    for (std::size_t j = 0; j < joints; ++j) states[lane].q[j + 3] += starts[lane][j];
  LaneState<Packet> state = PackLanes<LaneState>(states);
  const LaneKernel<Packet>& kernel = *PacketKernels().front();
  LaneWatch<Packet> watch;
  HeldSetpoints<Packet> held{};
  std::vector<LaneSetpoint<Packet>> setpoints(joints);
  const auto tell = [&](std::size_t k) {
    for (std::size_t j = 0; j < joints; ++j) {
      const LaneSetpoint<double>& s = motion_.ticks[k][j].setpoint;
      setpoints[j] = {Packet::Of(s.position), Packet::Of(s.velocity), Packet::Of(s.third)};
    }
  };
  tell(0);
  std::copy(setpoints.begin(), setpoints.end(), held.begin());
  const LaneSteps rough{motion_.tick_s, std::min(Replaying::kRoughSteps, per_tick)};
  LaneSteps steps{motion_.tick_s, per_tick};
  // Drives are no faster, however fine the steps are.
  steps.law_every = std::max(
      1, static_cast<int>(std::lround(per_tick * Replaying::kDriveLoop_s / motion_.tick_s)));
  // Of longer steps the explicit rule would make the most.
  steps.midpoint = std::lround(motion_.tick_s / Replaying::kDriveLoop_s) <= per_tick;
  const long rests = std::lround(Replaying::kRests_s / motion_.tick_s);
  for (long k = 0; k < rests; ++k)
    kernel.drive(model_, packed, rough, setpoints, held, state, watch);

  // Joints at the beginning of each tick.
  struct JointState {
    Packet q, v;
  };
  std::vector<JointState> path((motion_.ticks.size() + 1) * joints);
  const auto note = [&](std::size_t k) {
    for (std::size_t j = 0; j < joints; ++j)
      path[k * joints + j] = {state.q[j + 3], state.v[j + 3]};
  };
  for (std::size_t k = 0; k < motion_.ticks.size(); ++k) {
    note(k);
    tell(k);
    // Frames are not all of one length.
    for (std::size_t j = 0; j < joints; ++j)
      packed.joints[j].delay = Packet::Of(ActsAfter(motion_.ticks[k][j].arrival_s));
    const bool counts = k + 2 >= first_;
    kernel.drive(model_, packed, counts ? steps : rough, setpoints, held, state, watch);
  }
  note(motion_.ticks.size());

  for (std::size_t lane = 0; lane < robots.size(); ++lane) {
    std::vector<double>& residual = residuals[lane];
    residual.assign(count(), 0.0);
    std::size_t i = 0;
    for (std::size_t k = first_; k < motion_.ticks.size(); ++k) {
      for (std::size_t j = 0; j < joints; ++j, ++i) {
        const RecordedJoint& joint = motion_.ticks[k][j];
        if (!std::isfinite(joint.reading_rad)) continue;
        const double after_s =
            SampledAfter(joint.sampled_s, motion_.periods_with_ticks) + sampling[lane].lag_s;
        const double ticks = static_cast<double>(k) + after_s / motion_.tick_s;
        const double whole =
            std::clamp(std::floor(ticks), 0.0, static_cast<double>(motion_.ticks.size() - 1));
        const JointState& from = path[static_cast<std::size_t>(whole) * joints + j];
        const JointState& to = path[(static_cast<std::size_t>(whole) + 1) * joints + j];
        const double reading =
            Between(from.q.lane(lane), from.v.lane(lane), to.q.lane(lane), to.v.lane(lane),
                    motion_.tick_s, std::clamp(ticks - whole, 0.0, 1.0)) +
            sampling[lane].bias_rad[j];
        const double off = std::sqrt(parts_[i]) * (reading - joint.reading_rad) / noise_rad_[j];
        residual[i] = std::abs(off) < kLost ? off : kLost;  // also where it is not a number
      }
    }
  }
}

}  // namespace tumbler
