#include "offline/solve/hold_feedback.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/scene/normal.h"
#include "offline/solve/cma_es.h"

namespace tumbler {
namespace {

constexpr std::size_t kLaneCount = Packet::kLanes;
constexpr std::size_t kPitchRow = 2;
/// After the settle phase a robot is left alone for this time, then pushed, then watched.
constexpr double kAlone_s = 0.3, kPushed_s = 0.1, kAfterwards_s = 3.0, kRestless_s = 1.0;
/// Pushes, as parts of the one asked for: the first, and by how much the next ones are larger.
constexpr double kLeastPush = 0.6, kLeastLargePush = 1.0, kPushStep = 0.25;
constexpr std::size_t kPushes = 4;
/// The loss of a robot that fell, and from which error on it has.
constexpr double kFallenLoss = 1.5, kFallen_rad = 1;
/// Gains for one of the variables that stand for them; the dead zone and its ramp for a variable of
/// zero, which is their logarithm.
constexpr double kHoldAngleGain = 4, kHoldRateGain = 0.4, kZone_rad = 0.03, kZoneChange = 0.5;
constexpr double kLargestHoldGain = 3, kHoldGainRange = 30;
constexpr double kHoldSigma = 0.3;
constexpr int kHoldPopulation = 12;
/// Packets for random gains, and for their improvement without errors.
constexpr std::size_t kFewPackets = 2, kMorePackets = 6;

/// A law by its variables: for each joint the gains of the angle, then those of the rate, then dead
/// zone and ramp, where there are any.
struct HoldLaw {
  std::vector<double> x;
  double loss = 0;
};

Feedback<double> FeedbackOf(const HoldStudy& study, const std::vector<double>& x) {
  Feedback<double> law = study.law;
  const auto last = Index(law.knot_count - 1);
  for (std::size_t j = 0; j < study.joints; ++j) {
    law.joints[j].angle_gain[last] = std::clamp(kHoldAngleGain * x[j], -20.0, 20.0);
    law.joints[j].rate_gain[last] = std::clamp(kHoldRateGain * x[study.joints + j], -5.0, 5.0);
  }
  if (x.size() > 2 * study.joints) {
    const auto size = [&x](std::size_t i) { return kZone_rad * portable::Exp(kZoneChange * x[i]); };
    law.error_min_rad = std::min(size(2 * study.joints), 0.5 * law.error_max_rad);
    law.error_full_rad =
        std::min(law.error_min_rad + size(2 * study.joints + 1), law.error_max_rad);
  }
  return law;
}

/// A packet on its way through the hold.
class HoldPlay {
 public:
  HoldPlay(const HoldStudy& study, const Feedback<double>& law, const LaneNoise& noise,
           std::size_t packet)
      : study_(study),
        packet_(study.packets[packet]),
        state_(packet_.state),
        held_(packet_.held),
        feedback_(law, noise, study.settings.delay_s, study.steps.tick_s, study.joints,
                  study.first_tick) {}

  /// Plays on for a time. @param robots  the packet's, pushed or not.
  /// @param loss  of each robot, to which its mean over the time is added; null: none.
  void Advance(double time_s, const LaneRobot<Packet>& robots, double* loss, bool restless) {
    const auto ticks = std::lround(time_s / study_.steps.tick_s);
    for (long k = 0; k < ticks; ++k) {
      Tick(robots);
      for (std::size_t lane = 0; lane < kLaneCount; ++lane) {
        const double error_rad = std::abs(state_.q[kPitchRow].lane(lane) - study_.target_rad);
        fell_[lane] = fell_[lane] || !(error_rad < kFallen_rad);
        if (loss != nullptr) {
          loss[lane] += (fell_[lane] ? kFallenLoss : LossOf(lane, error_rad, restless)) /
                        static_cast<double>(ticks);
        }
      }
    }
  }

 private:
  void Tick(const LaneRobot<Packet>& robots) {
    std::array<LaneSetpoint<Packet>, LaneModel::kMaxJoints> tick;
    const std::span<const LaneSetpoint<Packet>> all(study_.setpoints);
    const std::size_t row = std::min(tick_++, all.size() / study_.joints - 1);
    std::ranges::copy(all.subspan(row * study_.joints, study_.joints), tick.begin());
    const std::span<LaneSetpoint<Packet>> corrected(tick.data(), study_.joints);
    feedback_.Correct(state_, corrected);
    LaneWatch<Packet> watch;
    study_.kernel.drive(study_.model, robots, study_.steps, corrected, held_, state_, watch);
    for (std::size_t j = 0; j < study_.joints; ++j) {
      for (std::size_t lane = 0; lane < kLaneCount; ++lane) {
        const double off =
            state_.q[kPitchRow + 1 + j].lane(lane) - corrected[j].position.lane(lane);
        fell_[lane] = fell_[lane] || !(std::abs(off) <= study_.following_tolerance_rad);
      }
    }
  }

  /// Of a robot that has not fallen, in one tick.
  [[nodiscard]] double LossOf(std::size_t lane, double error_rad, bool restless) const {
    if (!restless) return error_rad;
    double joints = 0;
    for (std::size_t j = 0; j < study_.joints; ++j)
      joints = std::max(joints, std::abs(state_.v[kPitchRow + 1 + j].lane(lane)));
    return error_rad + 5 * std::max(0.0, error_rad - kZone_rad) +
           0.5 * std::min(1.0, std::abs(state_.v[kPitchRow].lane(lane))) +
           0.1 * std::min(1.0, joints);
  }

  const HoldStudy& study_;
  const HeldRobots& packet_;
  LaneState<Packet> state_;
  HeldSetpoints<Packet> held_;
  LaneFeedback feedback_;
  std::size_t tick_ = 0;
  std::array<bool, kLaneCount> fell_{};
};

LaneNoise NoiseOf(const HoldStudy& study, bool errors, std::uint64_t seed, std::size_t packet) {
  FeedbackSettings settings = study.settings;
  if (!errors) settings.noise_rad = settings.rate_noise_rad_s = settings.bias_rad = 0;
  const double time_s = study.settle_s + kAlone_s + kPushed_s + kAfterwards_s;
  const auto ticks = Index(study.first_tick) + study.setpoints.size() / study.joints +
                     Index(static_cast<int>(std::lround(time_s / study.steps.tick_s))) + 1;
  return LaneNoise(settings, ticks, seed, packet);
}

/// The robots of a packet while they are pushed: on all of their mass, each lane with a force and a
/// side of its own.
LaneRobot<Packet> Pushed(const HoldStudy& study, std::size_t packet, double least) {
  LaneRobot<Packet> pushed = study.packets[packet].robots;
  for (std::size_t lane = 0; lane < kLaneCount; ++lane) {
    double mass_kg = 0;
    for (std::size_t i = 0; i <= study.joints; ++i) mass_kg += pushed.bodies[i].mass.lane(lane);
    const auto step = static_cast<double>((lane + packet / 2) % kPushes);
    const double side = (lane / kPushes + packet) % 2 == 0 ? 1 : -1;
    const double force_n = side * study.settings.push_n * (least + kPushStep * step);
    pushed.gravity_x.set_lane(lane, pushed.gravity_x.lane(lane) + force_n / mass_kg);
  }
  return pushed;
}

double PacketLoss(const HoldStudy& study, const Feedback<double>& law, const LaneNoise& noise,
                  bool errors, std::size_t packet) {
  HoldPlay play(study, law, noise, packet);
  const LaneRobot<Packet>& robots = study.packets[packet].robots;
  std::array<double, kLaneCount> loss{};
  const std::size_t left_ticks = study.setpoints.size() / study.joints;
  const double left_s = static_cast<double>(left_ticks) * study.steps.tick_s;
  play.Advance(left_s + study.settle_s, robots, nullptr, false);
  play.Advance(kAlone_s, robots, loss.data(), true);
  const LaneRobot<Packet> pushed = Pushed(study, packet, errors ? kLeastPush : kLeastLargePush);
  play.Advance(kPushed_s, pushed, nullptr, false);
  play.Advance(kAfterwards_s - kRestless_s, robots, loss.data(), false);
  play.Advance(kRestless_s, robots, loss.data(), true);
  double sum = 0;
  for (const double each : loss) sum += each;
  return sum;
}

class HoldSearch {
 public:
  HoldSearch(const HoldStudy& study, const HoldSearchSize& size, std::uint64_t seed, int threads,
             const std::function<void(int, std::int64_t, double)>& tell,
             const std::function<bool()>& interrupted)
      : study_(study),
        size_(size),
        seed_(seed),
        threads_(threads),
        tell_(tell),
        interrupted_(interrupted) {
    for (std::size_t p = 0; p < study.packets.size(); ++p) {
      quiet_.push_back(NoiseOf(study, false, seed, p));
      noise_.push_back(NoiseOf(study, true, seed, p));
    }
  }

  Feedback<double> Run() {
    std::vector<HoldLaw> laws = RandomLaws();
    std::vector<HoldLaw> improved;
    for (int i = 0; i < size_.improved && i < static_cast<int>(laws.size()); ++i)
      improved.push_back(Improve(laws[Index(i)].x, i, kMorePackets, false));
    Sort(improved);
    HoldLaw best{std::vector<double>(2 * study_.joints, 0.0), 0};
    best.loss = Losses({best.x}, study_.packets.size(), true).front();
    if (interrupted_()) return FeedbackOf(study_, best.x);
    for (std::size_t i = 0; i < improved.size() && i < 2; ++i) {
      std::vector<double> x = improved[i].x;
      x.resize(2 * study_.joints + 2);
      const HoldLaw law = Improve(x, static_cast<int>(i), study_.packets.size(), true);
      if (interrupted_()) break;
      if (law.loss < best.loss) best = law;
    }
    return FeedbackOf(study_, best.x);
  }

 private:
  std::vector<double> Losses(const std::vector<std::vector<double>>& all, std::size_t packets,
                             bool errors) {
    packets = std::min(packets, study_.packets.size());
    std::vector<double> losses(all.size());
    ParallelFor(static_cast<int>(all.size()), threads_, [&](int i, int /*thread*/) {
      if (interrupted_()) return;
      const Feedback<double> law = FeedbackOf(study_, all[Index(i)]);
      double sum = 0;
      for (std::size_t p = 0; p < packets; ++p)
        sum += PacketLoss(study_, law, errors ? noise_[p] : quiet_[p], errors, p);
      losses[Index(i)] = sum / static_cast<double>(packets * kLaneCount);
    });
    tried_ += static_cast<std::int64_t>(all.size());
    return losses;
  }

  std::vector<HoldLaw> RandomLaws() {
    std::vector<std::vector<double>> all;
    for (int i = 0; i < size_.samples; ++i) {
      Normal normal(seed_, static_cast<std::uint64_t>(i));
      const double size = kLargestHoldGain * portable::Power(kHoldGainRange, -normal.DrawUniform());
      std::vector<double>& x = all.emplace_back(2 * study_.joints);
      for (double& gain : x) gain = size * normal.Draw();
    }
    const std::vector<double> losses = Losses(all, kFewPackets, false);
    std::vector<HoldLaw> laws;
    for (std::size_t i = 0; i < all.size(); ++i) laws.push_back({all[i], losses[i]});
    Sort(laws);
    if (!laws.empty()) Tell(0, laws.front().loss);
    return laws;
  }

  HoldLaw Improve(const std::vector<double>& from, int start, std::size_t packets, bool errors) {
    CmaEs search(from, kHoldSigma, kHoldPopulation,
                 seed_ * 1000 + Index(start * 2 + (errors ? 1 : 0)));
    HoldLaw best{from, Losses({from}, packets, errors).front()};
    for (int g = 0; g < size_.generations && !interrupted_(); ++g) {
      const std::vector<std::vector<double>> laws = search.Ask();
      const std::vector<double> losses = Losses(laws, packets, errors);
      if (interrupted_()) break;
      for (std::size_t i = 0; i < laws.size(); ++i) {
        if (losses[i] < best.loss) best = {laws[i], losses[i]};
      }
      search.Tell(losses);
      Tell(start, best.loss);
    }
    return best;
  }

  void Tell(int start, double loss) {
    tell_(start, tried_, loss);
    tried_ = 0;
  }

  static void Sort(std::vector<HoldLaw>& laws) {
    std::ranges::stable_sort(laws, {}, &HoldLaw::loss);
  }

  const HoldStudy& study_;
  const HoldSearchSize& size_;
  std::uint64_t seed_;
  int threads_;
  const std::function<void(int, std::int64_t, double)>& tell_;
  const std::function<bool()>& interrupted_;
  std::vector<LaneNoise> quiet_, noise_;
  std::int64_t tried_ = 0;
};

}  // namespace

Feedback<double> FindHoldFeedback(
    const HoldStudy& study, const HoldSearchSize& size, std::uint64_t seed, int threads,
    const std::function<void(int start, std::int64_t tried, double loss)>& tell,
    const std::function<bool()>& interrupted) {
  return HoldSearch(study, size, seed, threads, tell, interrupted).Run();
}

double HoldLoss(const HoldStudy& study, const Feedback<double>& law, std::size_t packets,
                bool errors, std::uint64_t seed) {
  double sum = 0;
  for (std::size_t p = 0; p < packets; ++p)
    sum += PacketLoss(study, law, NoiseOf(study, errors, seed, p), errors, p);
  return sum / static_cast<double>(packets * kLaneCount);
}

}  // namespace tumbler
