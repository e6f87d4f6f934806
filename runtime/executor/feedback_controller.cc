#include "runtime/executor/feedback_controller.h"

#include <algorithm>

#include "common/core/feedback.h"
#include "runtime/executor/numbers.h"

namespace tumbler {
namespace {

/// How fast a correction vanishes in a primitive without feedback.
constexpr float kRelease_rad_s = 1;
/// No gains change any more when a primitive was held for so long.
constexpr float kLongHold_s = 1e3F;

}  // namespace

void FeedbackController::SetMotion(const Primitive<float>& primitive,
                                   const SequenceGraph<float>& graph, int node,
                                   std::span<const float> chain, int joint_count) noexcept {
  feedback_ = &primitive.feedback;
  for (int i = 0; i < joint_count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    JointLaw& law = laws_[index];
    law.feedback = &feedback_->joints[static_cast<std::size_t>(graph.RoleOf(node, i))];
    law.angle_factor = law.feedback->chain - chain[index];
  }
  turned_rad_ = graph.node(node).swapped ? graph.swap_pitch_rad : 0;
  gain_knot_ = 0;
  // A primitive without feedback has no angle to keep, and the next one with it fades in again.
  if (!feedback_->present()) error_rad_ = rate_error_rad_s_ = share_ = 0;
  // The optimiser gives the angle the knots of the feed-forward, whose basis is there already.
  const auto first = static_cast<std::size_t>(graph.RoleOf(node, 0));
  angle_has_torque_knots_ = feedback_->angle.HasKnotsOf(primitive.joints[first].torque);
}

// Measures the error of the link's angle, and of its rate, and returns whether both are known. In a
// tick without a new report or reply they stay what they were.
inline bool FeedbackController::MeasureError(const PitchEstimate& pitch,
                                             std::span<const Joint> joints, bool moving,
                                             float primitive_time_s) noexcept {
  if (pitch.status() != SensorStatus::kOk) return false;
  const bool starts = loop_ == Loop::kStarts;
  // In the hold a robot may be pushed askew, and falls without help.
  if (pitch.is_doubtful() && moving && !starts) return false;
  bool is_new = starts || pitch.age_ticks() == 0;
  float angle = pitch.pitch_rad() - turned_rad_;
  float rate = pitch.rate_rad_s();
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const float factor = laws_[i].angle_factor;
    if (factor == 0) continue;
    const Joint& joint = joints[i];
    const int age_ticks = joint.replies.age_ticks();
    // -1, of no reply at all, is the largest.
    if (static_cast<std::uint32_t>(age_ticks) > static_cast<std::uint32_t>(pitch.age_ticks_max()) ||
        !joint.IsMeasuredFinite()) {
      return false;
    }
    is_new = is_new && (starts || age_ticks == 0);
    angle += factor * joint.measured.position_rad;
    rate += factor * joint.measured.velocity_rad_s;
  }
  if (!is_new) return loop_ == Loop::kKnown;
  const Feedback<float>& feedback = *feedback_;
  if (!angle_has_torque_knots_) feedback.angle.EvaluateBasis(primitive_time_s, angle_basis_);
  const Basis& basis = angle_has_torque_knots_ ? joints[0].torque_basis : angle_basis_;
  const float error = WithoutTurns(angle - feedback.angle.Value(basis));
  if (!(Magnitude(error) <= (starts ? feedback.start_error_max_rad : feedback.error_max_rad)))
    return false;
  error_rad_ = error;
  rate_error_rad_s_ = moving ? rate - speed_ * feedback.angle.Slope(basis) : rate;
  return true;
}

void FeedbackController::Correct(const PitchEstimate& pitch, std::span<const Joint> joints,
                                 bool moving, float primitive_time_s, float time_s,
                                 TickRecord& record) noexcept {
  const Feedback<float>& feedback = *feedback_;
  GainPlace<float> place;
  float share = 0;
  if (feedback.present()) {
    const bool known =
        loop_ != Loop::kOpen && MeasureError(pitch, joints, moving, primitive_time_s);
    loop_ = known                                            ? Loop::kKnown
            : loop_ == Loop::kStarts || loop_ == Loop::kOpen ? Loop::kOpen
                                                             : Loop::kLost;
    share_ = NextShare(feedback, share_, known, time_s);
    share = share_ * ErrorShare(feedback, error_rad_);
    held_s_ = moving ? 0 : std::min(held_s_ + time_s, kLongHold_s);
    place = FindGains(feedback, primitive_time_s + held_s_, gain_knot_);
    gain_knot_ = place.knot;
  }
  const float error = error_rad_;
  const float rate_error = rate_error_rad_s_;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    JointLaw& law = laws_[i];
    float& planned = record.joints[i].planned.position_rad;
    // While holding, the plan starts from the commanded position, correction included.
    law.uncorrected_rad =
        moving ? planned : law.uncorrected_rad + (planned - joints[i].commanded.position_rad);
    float wanted = 0;
    float rate_max = kRelease_rad_s;
    if (feedback.present()) {
      wanted = WantedCorrection(*law.feedback, place, error, rate_error, share);
      rate_max = law.feedback->correction_rate_max_rad_s;
    }
    law.correction_rad = NextCorrection(law.correction_rad, wanted, rate_max, time_s);
    record.joints[i].correction_rad = law.correction_rad;
    planned = law.uncorrected_rad + law.correction_rad;
  }
}

void FeedbackController::Rest(int joint_count, TickRecord& record) noexcept {
  loop_ = Loop::kRests;
  share_ = 0;
  for (int i = 0; i < joint_count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    laws_[index].correction_rad = record.joints[index].correction_rad = 0;
  }
}

}  // namespace tumbler
