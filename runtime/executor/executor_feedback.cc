// How the executor corrects setpoints by an inertial sensor.

#include <algorithm>

#include "common/core/feedback.h"
#include "runtime/executor/executor.h"
#include "runtime/executor/numbers.h"

namespace tumbler {
namespace {

/// How fast a correction vanishes in a primitive without feedback.
constexpr float kRelease_rad_s = 1;
/// No gains change any more when a primitive was held for so long.
constexpr float kLongHold_s = 1e3F;

}  // namespace

void Executor::SetFeedback() noexcept {
  const auto& sensor_chain = sensor_watch_.settings().chain;
  for (int i = 0; i < joint_count_; ++i) {
    Joint& joint = joints_[static_cast<std::size_t>(i)];
    const auto role = static_cast<std::size_t>(graph_.RoleOf(node_, i));
    joint.feedback = &primitive_->feedback.joints[role];
    joint.angle_factor = joint.feedback->chain - sensor_chain[static_cast<std::size_t>(i)];
  }
  gain_knot_ = 0;
  // A primitive without feedback has no angle to keep, and the next one with it fades in again.
  if (!primitive_->feedback.present()) error_rad_ = rate_error_rad_s_ = share_ = 0;
  // The optimiser gives the angle the knots of the feed-forward, whose basis is there already.
  angle_has_torque_knots_ = primitive_->feedback.angle.HasKnotsOf(joints_[0].motion->torque);
}

// Measures the error of the link's angle, and of its rate, and returns whether both are known. In a
// tick without a new report or reply they stay what they were.
bool Executor::MeasureError(bool moving) noexcept {
  if (sensor_watch_.status() != SensorStatus::kOk) return false;
  // In the hold a robot may be pushed askew, and falls without help.
  if (sensor_watch_.is_doubtful() && moving && !starts_) return false;
  bool is_new = starts_ || sensor_watch_.age_ticks() == 0;
  const Feedback<float>& feedback = primitive_->feedback;
  float angle = sensor_watch_.pitch_rad();
  float rate = sensor_watch_.rate_rad_s();
  if (graph_.node(node_).swapped) angle -= graph_.swap_pitch_rad;
  for (const Joint& joint : joints()) {
    if (joint.angle_factor == 0) continue;
    const int age_ticks = joint.replies.age_ticks();
    // -1, of no reply at all, is the largest.
    if (static_cast<std::uint32_t>(age_ticks) >
            static_cast<std::uint32_t>(sensor_watch_.settings().age_ticks_max) ||
        !joint.IsMeasuredFinite()) {
      return false;
    }
    is_new = is_new && (starts_ || age_ticks == 0);
    angle += joint.angle_factor * joint.measured.position_rad;
    rate += joint.angle_factor * joint.measured.velocity_rad_s;
  }
  if (!is_new) return knows_error_;
  if (!angle_has_torque_knots_) feedback.angle.EvaluateBasis(primitive_time_s_, angle_basis_);
  const Basis& basis = angle_has_torque_knots_ ? joints_[0].torque_basis : angle_basis_;
  const float error = WithoutTurns(angle - feedback.angle.Value(basis));
  if (!(Magnitude(error) <= (starts_ ? feedback.start_error_max_rad : feedback.error_max_rad))) {
    return false;
  }
  error_rad_ = error;
  rate_error_rad_s_ = moving ? rate - config_.speed * feedback.angle.Slope(basis) : rate;
  return true;
}

// How much of the feedback is in force after a time: it fades in while the error is known, and else
// out.
void Executor::Fade(bool moving, float time_s) noexcept {
  const Feedback<float>& feedback = primitive_->feedback;
  const bool measured = (!plays_open_loop_ || starts_) && MeasureError(moving);
  knows_error_ = measured;
  if (starts_) plays_open_loop_ = !measured;
  starts_ = false;
  share_ = NextShare(feedback, share_, measured, time_s);
}

void Executor::Correct(int elapsed, TickRecord& record) noexcept {
  const bool moving = state_ == ExecutorState::kRunning || reaction_ == Reaction::kRollOut;
  // A hold after a motion keeps its feedback as it keeps its feed-forward.
  const bool holds = corrects_ && keep_torque_ && reaction_ <= Reaction::kHold && !lowering_ &&
                     state_ != ExecutorState::kDisarmed;
  const Feedback<float>& feedback = primitive_->feedback;
  const float time_s = static_cast<float>(elapsed) * config_.period_s;
  if (!moving && !holds) {
    // The commanded position is the one that is held or left, correction included.
    corrects_ = false;
    share_ = 0;
    for (int i = 0; i < joint_count_; ++i) {
      const auto index = static_cast<std::size_t>(i);
      joints_[index].correction_rad = record.joints[index].correction_rad = 0;
    }
  } else {
    if (!corrects_) share_ = 0;
    corrects_ = true;
    GainPlace<float> place;
    float share = 0;
    if (feedback.present()) {
      Fade(moving, time_s);
      share = share_ * ErrorShare(feedback, error_rad_);
      held_s_ = moving ? 0 : std::min(held_s_ + time_s, kLongHold_s);
      place = FindGains(feedback, primitive_time_s_ + held_s_, gain_knot_);
      gain_knot_ = place.knot;
    }
    for (int i = 0; i < joint_count_; ++i) {
      const auto index = static_cast<std::size_t>(i);
      Joint& joint = joints_[index];
      float& planned = record.joints[index].planned.position_rad;
      // While holding, the plan starts from the commanded position, correction included.
      joint.uncorrected_rad =
          moving ? planned : joint.uncorrected_rad + (planned - joint.commanded.position_rad);
      float wanted = 0;
      float rate_max = kRelease_rad_s;
      if (feedback.present()) {
        wanted = WantedCorrection(*joint.feedback, place, error_rad_, rate_error_rad_s_, share);
        rate_max = joint.feedback->correction_rate_max_rad_s;
      }
      joint.correction_rad = NextCorrection(joint.correction_rad, wanted, rate_max, time_s);
      record.joints[index].correction_rad = joint.correction_rad;
      planned = joint.uncorrected_rad + joint.correction_rad;
    }
  }
  SensorRecord& sensor = record.sensor;
  sensor.pitch_rad = sensor_watch_.pitch_rad();
  sensor.rate_rad_s = sensor_watch_.rate_rad_s();
  sensor.error_rad = error_rad_;
  sensor.rate_error_rad_s = rate_error_rad_s_;
  sensor.share = share_;
  sensor.age_ticks = sensor_watch_.age_ticks();
  sensor.status = sensor_watch_.status();
}

}  // namespace tumbler
