#include "offline/solve/robot_player.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>

#include "common/core/index.h"
#include "common/files/parallel_for.h"

namespace tumbler {
namespace {

/// How often the own shapes are looked at [ticks], and up to which distance [m].
constexpr int kLookAtShapes = 2;
/// Without corrections legs go where the plan has them, but for what drives are too weak for.
constexpr int kLookAtShapesNowAndThen = 16;
constexpr double kNearShapes_m = 1e-3;
/// How often it is looked at where robots are, and from how long before the end of the motion on
/// [ticks].
constexpr int kLookAtWay = 25, kBeforeEnd = 100;
/// When divergences are looked at, after the end of the motion [ticks].
constexpr int kSoonAfter = 100, kLaterOn = 250;
/// How many robots are looked at, for each that is wanted, to find those that no motion carries;
/// and in how many packets at a time.
constexpr int kLookedForEach = 200;
constexpr std::size_t kPacketsAtATime = 32;

/// A packet of robots on their way through a motion.
class PacketPlay {
 public:
  PacketPlay(const RobustTask& task, const Ensemble& ensemble, std::size_t packet,
             const PacketMotion& motion, LaneDistances& distances)
      : task_(task),
        robots_(ensemble.robots[packet]),
        steps_(ensemble.steps),
        setpoints_(motion.setpoints),
        distances_(distances),
        state_(ensemble.states[packet]),
        held_(ensemble.held) {
    if (motion.feedback != nullptr) {
      feedback_.emplace(*motion.feedback, ensemble.noise[packet], task.settings.feedback->delay_s,
                        RobustTask::kTick_s, task.joints);
    }
  }

  [[nodiscard]] std::array<double, Packet::kLanes> Off() const { return task_.loss.Off(state_); }
  [[nodiscard]] bool faulty(std::size_t lane) const { return faulty_[lane]; }
  /// The root's largest since the last Watch.
  [[nodiscard]] double speed(std::size_t lane) const { return watch_.root_speed.lane(lane); }
  void Watch() { watch_ = {}; }

  /// Plays on up to a tick.
  void Advance(int end) {
    const std::size_t joints = task_.joints;
    std::array<LaneSetpoint<Packet>, LaneModel::kMaxJoints> tick;
    for (int k = tick_; k < end; ++k) {
      std::ranges::copy(setpoints_.subspan(Index(k) * joints, joints), tick.begin());
      const std::span<LaneSetpoint<Packet>> corrected(tick.data(), joints);
      if (feedback_) feedback_->Correct(state_, corrected);
      task_.kernel.drive(task_.lanes.model, robots_, steps_, corrected, held_, state_, watch_);
      NoteFaults(corrected);
      if (k % (feedback_ ? kLookAtShapes : kLookAtShapesNowAndThen) == 0) NoteOverlaps();
    }
    tick_ = end;
  }

 private:
  /// Notes which robots the runtime stops now: weak drives, or corrections, leave a joint too far
  /// from its setpoint.
  void NoteFaults(std::span<const LaneSetpoint<Packet>> setpoints) {
    for (std::size_t j = 0; j < task_.joints; ++j) {
      for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
        // The runtime knows what the encoder reads.
        const double reading_rad =
            state_.q[j + 3].lane(lane) + robots_.joints[j].zero_error.lane(lane);
        const double error_rad = reading_rad - setpoints[j].position.lane(lane);
        faulty_[lane] =
            faulty_[lane] || !(std::abs(error_rad) <= task_.problem.following_tolerance_rad);
      }
    }
  }

  /// Notes which robots' own shapes overlap: drives may lead a leg into the other. The shapes
  /// are the model's.
  void NoteOverlaps() {
    if (task_.problem.scene.self_contact.pairs.empty()) return;
    std::array<double, LaneModel::kMaxJoints + 3> q{};
    for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
      if (faulty_[lane]) continue;
      for (std::size_t j = 0; j < task_.joints; ++j) q[j + 3] = state_.q[j + 3].lane(lane);
      const std::span<const double> at(q.data(), task_.joints + 3);
      faulty_[lane] = distances_[lane].Nearest(at, kNearShapes_m).distance_m < 0;
    }
  }

  const RobustTask& task_;
  const LaneRobot<Packet>& robots_;
  LaneSteps steps_;
  std::span<const LaneSetpoint<Packet>> setpoints_;
  LaneDistances& distances_;
  LaneState<Packet> state_;
  HeldSetpoints<Packet> held_;
  LaneWatch<Packet> watch_{};
  std::optional<LaneFeedback> feedback_;
  int tick_ = 0;
  /// Whether a joint was too far from its setpoint, or own shapes overlapped.
  std::array<bool, Packet::kLanes> faulty_{};
};

/// Robots that a motion is ranked by on their way through it.
class RankingPlay {
 public:
  RankingPlay(const RobustTask& task, const RankingEnsemble& ensemble, std::size_t packet,
              const RankingMotion& motion)
      : task_(task),
        robots_(ensemble.robots[packet]),
        steps_(ensemble.steps),
        setpoints_(motion.setpoints),
        state_(ensemble.states[packet]),
        held_(ensemble.held) {}

  [[nodiscard]] auto Off() const { return task_.loss.Off(state_); }
  [[nodiscard]] auto Divergence() const { return task_.loss.Divergence(state_); }
  [[nodiscard]] static bool faulty(std::size_t /*lane*/) { return false; }
  [[nodiscard]] double speed(std::size_t lane) const { return watch_.root_speed.lane(lane); }
  void Watch() { watch_ = {}; }

  void Advance(int end) {
    const auto first = Index(tick_) * task_.joints, last = Index(end) * task_.joints;
    task_.ranking_kernel.drive(task_.lanes.model, robots_, steps_,
                               setpoints_.subspan(first, last - first), held_, state_, watch_);
    tick_ = end;
  }

 private:
  const RobustTask& task_;
  const LaneRobot<WidePacket>& robots_;
  LaneSteps steps_;
  std::span<const LaneSetpoint<float>> setpoints_;
  LaneState<WidePacket> state_;
  HeldSetpoints<float> held_;
  LaneWatch<WidePacket> watch_{};
  int tick_ = 0;
};

/// Plays a motion of so many ticks and its hold to the end.
/// @param play  PacketPlay or RankingPlay.
template <class Play>
auto LossesOf(const RobustTask& task, Play& play, int ticks) {
  const int settled_tick = ticks + RobustTask::Ticks(task.problem.settle_s);
  const int end = task.LastTick(ticks);
  decltype(play.Off()) losses, astray{};
  int looks = 0;
  for (int tick = std::max(0, ticks - kBeforeEnd); tick < settled_tick; tick += kLookAtWay) {
    play.Advance(tick);
    const auto now = play.Off();
    for (std::size_t lane = 0; lane < now.size(); ++lane) astray[lane] += std::min(1.0, now[lane]);
    ++looks;
  }
  play.Advance(settled_tick);
  const auto settled = play.Off();
  play.Advance(end - RobustTask::Ticks(RobustTask::kWatched_s));
  play.Watch();
  play.Advance(end);
  const auto off = play.Off();
  for (std::size_t lane = 0; lane < losses.size(); ++lane) {
    losses[lane] = play.faulty(lane) ? RobotLoss::kFault
                                     : task.loss.Of(settled[lane], off[lane], play.speed(lane),
                                                    astray[lane] / looks);
  }
  return losses;
}

/// Those of a primitive, as its hold goes on.
PacketSetpoints SetpointsOf(const RobustTask& task, const Primitive<double>& motion) {
  const int end = task.LastTick(RobustTask::Ticks(motion.duration_s));
  PacketSetpoints setpoints;
  for (int k = 0; k < end; ++k) {
    const double time_s = k * RobustTask::kTick_s;
    const double t = std::min(time_s, motion.duration_s);
    for (const JointMotion<double>& joint : motion.motions()) {
      const auto at = joint.position.Evaluate(t);
      const double velocity = time_s < motion.duration_s ? at.first : 0;
      setpoints.push_back(
          {Packet::Of(at.value), Packet::Of(velocity), Packet::Of(joint.torque.Evaluate(t).value)});
    }
  }
  return setpoints;
}

}  // namespace

LaneDistances DistancesOf(const RobustTask& task) {
  const Scene& scene = task.problem.scene;
  return LaneDistances(Packet::kLanes, SelfDistances(scene.robot, scene.self_contact.pairs));
}

std::array<double, Packet::kLanes> RobotLosses(const RobustTask& task, const Ensemble& ensemble,
                                               std::size_t packet, const PacketMotion& motion,
                                               LaneDistances& distances) {
  PacketPlay play(task, ensemble, packet, motion, distances);
  return LossesOf(task, play, motion.ticks);
}

std::array<double, WidePacket::kLanes> RobotLosses(const RobustTask& task,
                                                   const RankingEnsemble& ensemble,
                                                   std::size_t packet,
                                                   const RankingMotion& motion) {
  RankingPlay play(task, ensemble, packet, motion);
  return LossesOf(task, play, motion.ticks);
}

std::array<std::array<double, WidePacket::kLanes>, 2> RobotDivergences(
    const RobustTask& task, const RankingEnsemble& ensemble, std::size_t packet,
    const RankingMotion& motion) {
  RankingPlay play(task, ensemble, packet, motion);
  play.Advance(motion.ticks + kSoonAfter);
  const std::array<double, WidePacket::kLanes> soon = play.Divergence();
  play.Advance(motion.ticks + kLaterOn);
  return {soon, play.Divergence()};
}

std::vector<std::uint64_t> RobotsNotCarried(const RobustTask& task, const RobotDraw& draw,
                                            std::size_t count) {
  constexpr std::size_t kLooked = kPacketsAtATime * Packet::kLanes;
  std::vector<PacketSetpoints> motions;
  for (const Primitive<double>& motion : task.complement)
    motions.push_back(SetpointsOf(task, motion));
  std::vector<std::uint64_t> found;
  std::uint64_t looked = 0;
  while (found.size() < count && looked < count * kLookedForEach && !task.interrupted()) {
    std::array<bool, kLooked> carried{};
    ParallelFor(
        static_cast<int>(kPacketsAtATime), task.options.threads, [&](int packet, int /*thread*/) {
          const std::size_t first = Index(packet) * Packet::kLanes;
          std::vector<std::uint64_t> which(Packet::kLanes);
          std::iota(which.begin(), which.end(), looked + first);
          const Ensemble ensemble = DrawEnsemble(task, draw, which);
          LaneDistances distances = DistancesOf(task);
          for (std::size_t m = 0; m < motions.size(); ++m) {
            const int ticks = RobustTask::Ticks(task.complement[m].duration_s);
            const auto losses = RobotLosses(task, ensemble, 0, {motions[m], ticks}, distances);
            for (std::size_t lane = 0; lane < losses.size(); ++lane)
              carried[first + lane] |= losses[lane] < RobotLoss::kCarried;
          }
        });
    for (std::size_t i = 0; i < kLooked && found.size() < count; ++i)
      if (!carried[i]) found.push_back(looked + i);
    looked += kLooked;
  }
  if (found.size() < Packet::kLanes && !task.interrupted()) {
    throw std::runtime_error(
        fmt::format("the motions to complement carry all but {} of {} robots: too few to find "
                    "another for; leave --complement out, or let robots differ more "
                    "(robust.polish_scale)",
                    found.size(), looked));
  }
  // At least one packet, also when it was interrupted.
  found.resize(std::max(found.size() / Packet::kLanes, std::size_t{1}) * Packet::kLanes);
  return found;
}

}  // namespace tumbler
