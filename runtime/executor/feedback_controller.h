#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/core/primitive.h"
#include "common/core/sequence.h"
#include "runtime/executor/joint.h"
#include "runtime/executor/pitch_estimate.h"
#include "runtime/executor/tick.h"

namespace tumbler {

/// Corrects position setpoints by a pitch: measures the error of the angle that a primitive's
/// feedback is about, fades the feedback in and out, and applies its law
/// (`common/core/feedback.h`).
///
/// A value without clock, bus or sensor of its own. It is in one of two conditions. At rest it
/// corrects nothing. `Begin` starts it with a motion, `Correct` carries it on tick by tick, through
/// the hold after the motion and into the next motion, and `Rest` ends it.
///
/// A motion whose angle is not known when it begins, or too far from the plan, is played without
/// feedback to its end. One whose angle is lost later gets it back as soon as the angle is known.
///
/// Real time: no heap, no locks, no exceptions. Freestanding.
class FeedbackController {
 public:
  FeedbackController() = default;
  /// @param speed  at which motions are played.
  explicit FeedbackController(float speed) noexcept : speed_(speed) {}

  /// Sets the motion, which is the primitive of a node. Outlives the controller's use of it.
  /// @param graph, node  say which joint plays which path.
  /// @param chain        of the link whose pitch is measured (`PitchEstimate::chain`).
  void SetMotion(const Primitive<float>& primitive, const SequenceGraph<float>& graph, int node,
                 std::span<const float> chain, int joint_count) noexcept;

  /// The motion begins with the next tick.
  void Begin() noexcept { loop_ = Loop::kStarts; }

  /// Adds the corrections to the planned positions of a tick.
  /// @param joints  as measured; joint 0 with its torque basis at that time in the primitive.
  ///                `commanded` is that of the tick before.
  /// @param moving  whether the motion goes on; else its last pose is held.
  /// @param time_s  since the tick before.
  /// @param record  has the setpoints planned without feedback; `correction_rad` is set.
  void Correct(const PitchEstimate& pitch, std::span<const Joint> joints, bool moving,
               float primitive_time_s, float time_s, TickRecord& record) noexcept;
  /// A tick without corrections. What was commanded, correction included, is what is held or left.
  void Rest(int joint_count, TickRecord& record) noexcept;
  /// Whether the last tick was corrected, or the motion begins with the next.
  [[nodiscard]] bool acts() const noexcept { return loop_ != Loop::kRests; }

  /// Of a joint, in the last tick.
  [[nodiscard]] float correction_rad(int joint) const noexcept {
    return laws_[static_cast<std::size_t>(joint)].correction_rad;
  }
  /// Of the feedback that is in force, 0 ... 1.
  [[nodiscard]] float share() const noexcept { return share_; }
  /// Of the fed-back angle, and of its rate: the last that were known.
  [[nodiscard]] float error_rad() const noexcept { return error_rad_; }
  [[nodiscard]] float rate_error_rad_s() const noexcept { return rate_error_rad_s_; }

 private:
  using Basis = Joint::Basis;
  enum class Loop : std::uint8_t {
    kRests,
    kStarts,  ///< The motion has just begun.
    kKnown,   ///< The error was known in the last tick.
    kLost,    ///< It was not, and may be known again.
    kOpen,    ///< It was not known at the start, or too large.
  };
  struct JointLaw {
    const JointFeedback<float>* feedback = nullptr;
    float angle_factor = 0;     ///< By how much link less sensor turn while the joint turns.
    float uncorrected_rad = 0;  ///< The last setpoint without its correction.
    float correction_rad = 0;
  };

  [[nodiscard]] inline bool MeasureError(const PitchEstimate& pitch, std::span<const Joint> joints,
                                         bool moving, float primitive_time_s) noexcept;

  float speed_ = 1;
  const Feedback<float>* feedback_ = nullptr;
  std::array<JointLaw, kMaxJoints> laws_;
  bool angle_has_torque_knots_ = false;  ///< Whether the plan's angle has joint 0's of the torque.
  Basis angle_basis_;
  float turned_rad_ = 0;  ///< The robot's pitch less the primitive's.
  int gain_knot_ = 0;     ///< Before the present time in the primitive.
  float held_s_ = 0;      ///< Since the end of the primitive, while its feedback acts.
  float error_rad_ = 0;
  float rate_error_rad_s_ = 0;
  float share_ = 0;
  Loop loop_ = Loop::kRests;
};

}  // namespace tumbler
