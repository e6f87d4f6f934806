#pragma once

#include <optional>
#include <span>
#include <vector>

#include "common/core/feedback.h"
#include "offline/solve/hold_feedback.h"
#include "offline/solve/motion_plan.h"
#include "offline/solve/robot_ensemble.h"

namespace tumbler {

/// The feedbacks of a robust search: laws that keep the angle of the task's link
/// (`[robust.feedback]`) where the model behind its drives has it.
///
/// A law has the knots of its gains in the motion, and behind them two more: when the gains of the
/// hold begin, once the robot has landed, and when they are whole.
///
/// @pre for all but the constructor: the task asks for a feedback.
class MotionFeedback {
 public:
  /// All have to outlive this object. @param model  see ModelEnsemble.
  MotionFeedback(const RobustTask& task, const RobustMotion& motion, const Ensemble& model);

  /// How many variables stand for gains: for each joint those of the angle at each knot, then those
  /// of the rate. They are of order one.
  [[nodiscard]] std::size_t gains() const;

  /// Gives plans of up to a packet of motions their laws.
  /// @param motions  with the variables of their gains behind the others.
  /// @param hold     whose dead zone and last gains are taken.
  void Add(const std::vector<std::vector<double>>& motions, const Feedback<double>& hold,
           std::vector<MotionPlan>& plans) const;
  /// A law of the hold that does nothing there, for feedback that acts in the motion alone.
  [[nodiscard]] static Feedback<double> NoHold(double duration_s);
  /// A law's gains along the angle of another motion.
  [[nodiscard]] Feedback<double> Along(const Feedback<double>& law, const std::vector<double>& x,
                                       const MotionPlan& plan) const;
  /// What a feedback of the hold after a motion is found for, with robots that have arrived in it.
  [[nodiscard]] HoldStudy StudyHold(const std::vector<double>& x, const MotionPlan& plan,
                                    const Ensemble& robots) const;

 private:
  [[nodiscard]] std::vector<double> Chain() const;
  [[nodiscard]] std::vector<std::vector<double>> Angles(
      const std::vector<std::vector<double>>& motions, std::span<const MotionPlan> plans) const;
  [[nodiscard]] Feedback<double> WithoutGains(double duration_s,
                                              const std::vector<double>& angles) const;

  const RobustTask& task_;
  const RobustMotion& motion_;
  const Ensemble& model_;
};

}  // namespace tumbler
