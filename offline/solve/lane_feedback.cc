#include "offline/solve/lane_feedback.h"

#include <algorithm>
#include <cmath>

#include "common/core/index.h"
#include "offline/scene/normal.h"

namespace tumbler {
namespace {

constexpr std::size_t kPitchDof = 2;
constexpr std::size_t kFirstJointDof = 3;

}  // namespace

LaneNoise::LaneNoise(const FeedbackSettings& settings, std::size_t ticks, std::uint64_t seed,
                     std::uint64_t packet)
    : numbers_(ticks * Packet::kLanes) {
  Normal normal(seed, packet);
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    const double bias_rad = i % 2 == 0 ? settings.bias_rad : -settings.bias_rad;
    const double angle_rad = bias_rad + settings.noise_rad * normal.Draw();
    numbers_[i] = {angle_rad, settings.rate_noise_rad_s * normal.Draw()};
  }
}

LaneFeedback::LaneFeedback(const Feedback<double>& law, const LaneNoise& noise, double delay_s,
                           double tick_s, std::size_t joints, int first_tick)
    : law_(law),
      noise_(noise),
      tick_s_(tick_s),
      joints_(joints),
      late_ticks_(1 + Index(static_cast<int>(std::lround(delay_s / tick_s)))),
      tick_(Index(first_tick)),
      waiting_(late_ticks_ + 1) {}

LaneFeedback::Measurement LaneFeedback::Measure(const LaneState<Packet>& state) const {
  Measurement measured;
  for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
    double angle = state.q[kPitchDof].lane(lane);
    double rate = state.v[kPitchDof].lane(lane);
    for (std::size_t j = 0; j < joints_; ++j) {
      angle += law_.joints[j].chain * state.q[kFirstJointDof + j].lane(lane);
      rate += law_.joints[j].chain * state.v[kFirstJointDof + j].lane(lane);
    }
    measured.angle_rad[lane] = angle + noise_.angle(tick_, lane);
    measured.rate_rad_s[lane] = rate + noise_.rate(tick_, lane);
  }
  return measured;
}

void LaneFeedback::Correct(const LaneState<Packet>& state,
                           std::span<LaneSetpoint<Packet>> setpoints) {
  const Measurement now = Measure(state);
  if (!begun_) std::ranges::fill(waiting_, now);
  begun_ = true;
  waiting_[tick_ % waiting_.size()] = now;
  const Measurement& known = waiting_[(tick_ + waiting_.size() - late_ticks_) % waiting_.size()];

  const double end_s = law_.angle.end_s();
  const double time_s = std::min(static_cast<double>(tick_) * tick_s_, end_s);
  law_.angle.EvaluateBasis(time_s, basis_);
  const double planned_rad = law_.angle.Value(basis_);
  const double planned_rad_s = time_s < end_s ? law_.angle.Slope(basis_) : 0;
  const double gain_time_s = static_cast<double>(tick_) * tick_s_;
  const GainPlace<double> place = FindGains(law_, gain_time_s, knot_);
  knot_ = place.knot;
  for (std::size_t i = 0; i < Packet::kLanes; ++i) {
    Lane& lane = lanes_[i];
    // A robot that fell has turned far, and one that flew apart is not a number.
    const double angle_rad = known.angle_rad[i];
    const double error_rad =
        std::abs(angle_rad) < 100 ? WithoutTurns(angle_rad - planned_rad) : law_.error_max_rad + 1;
    const double error_max_rad = tick_ == 0 ? law_.start_error_max_rad : law_.error_max_rad;
    const bool is_known = std::abs(error_rad) <= error_max_rad;
    if (is_known) {
      lane.error_rad = error_rad;
      lane.rate_error_rad_s = known.rate_rad_s[i] - planned_rad_s;
    }
    lane.share = NextShare(law_, lane.share, is_known, tick_s_);
    const double share = lane.share * ErrorShare(law_, lane.error_rad);
    for (std::size_t j = 0; j < joints_; ++j) {
      const JointFeedback<double>& joint = law_.joints[j];
      const double wanted =
          WantedCorrection(joint, place, lane.error_rad, lane.rate_error_rad_s, share);
      double& correction = lane.correction_rad[j];
      correction = NextCorrection(correction, wanted, joint.correction_rate_max_rad_s, tick_s_);
      setpoints[j].position.set_lane(i, setpoints[j].position.lane(i) + correction);
    }
  }
  ++tick_;
}

}  // namespace tumbler
