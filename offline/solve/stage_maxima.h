#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/core/index.h"
#include "offline/solve/motion_outputs.h"
#include "offline/solve/motion_record.h"
#include "offline/solve/path_table.h"
#include "offline/solve/smooth_maximum.h"
#include "offline/solve/timetable.h"

namespace tumbler {

/// What a forward pass through the steps is for.
enum class ForwardPass {
  kEstimate,  ///< The outputs by the semi-implicit Euler method, with one stage in a step.
  kOutputs,   ///< The outputs.
  kGradient,  ///< The same, and a record for the gradient.
};

/// The smooth maxima over a recorded motion, and their derivatives by the torque and the
/// penetration of every stage, with which Adjoint begins.
///
/// All stages are there already, so the step with the largest value is looked for first: few others
/// are near it, and steps that cannot count beside it are not looked at further.
class StageMaxima {
 public:
  /// All are kept by reference.
  StageMaxima(const ParametricMotion& motion, const MotionOutputs& outputs, const Timetable& table,
              const PathTable& paths, const StageValues& values);

  /// Makes room for the stages of the timetable.
  void Resize();
  /// Sets the excesses of torque and penetration of the motion in the record, and with a gradient
  /// to come all derivatives.
  void Evaluate(ForwardPass pass, RolloutResult& result);

  /// The derivative of a joint's torque excess by the torque at a stage, times the limit.
  [[nodiscard]] double by_torque(std::size_t stage, int joint) const {
    return torque_slope_[stage * joints() + Index(joint)];
  }
  /// Likewise by OnCurve, of one of MotionOutputs::curved.
  [[nodiscard]] double by_curve(std::size_t stage, std::size_t curved) const {
    return curve_slope_[stage * outputs_.curved().size() + curved];
  }
  /// The derivative of the penetration excess by the penetration of a stage.
  [[nodiscard]] double by_penetration(std::size_t stage) const { return penetration_slope_[stage]; }
  /// The derivatives of the torque excesses, then of the penetration excess, by the duration as far
  /// as steps become longer with it.
  [[nodiscard]] double by_step_length(std::size_t output) const { return by_step_length_[output]; }

 private:
  /// A quantity at all stages, and where the derivative of its smooth maximum by it goes.
  struct Quantity {
    const double* value;  // at the first stage
    double* slope;        // likewise
    std::size_t stride;   // to the next stage
    double unit;
  };
  /// A step that was added: where its slopes are, and the largest value up to it.
  struct AddedStep {
    double* slope;
    std::size_t stride;
    double largest_so_far;
  };

  [[nodiscard]] std::size_t joints() const { return Index(motion_.joints()); }
  void SetCurve(ForwardPass pass, std::size_t curved);
  double AddCurve(ForwardPass pass, std::size_t curved, SmoothMaximum& largest);
  void AddSteps(ForwardPass pass, const Quantity& quantity, SmoothMaximum& maximum);
  double FinishSlopes(const SmoothMaximum& maximum);

  const ParametricMotion& motion_;
  const MotionOutputs& outputs_;
  const Timetable& table_;
  const PathTable& paths_;
  const StageValues& values_;

  LookPoints look_points_{kClassical, 0};
  std::vector<const StepPoints*> points_in_;  // each step
  std::vector<double> curve_;                 // OnCurve: by stage, then curved joint
  std::vector<double> torque_slope_, curve_slope_, penetration_slope_;
  std::vector<double> by_step_length_;
  std::vector<double> highest_in_;  // of AddSteps: the largest value at a stage, by step
  std::vector<AddedStep> added_;    // by AddSteps, for FinishSlopes
  double stretched_sum_ = 0;        // the part of their sum over steps that the duration stretches
};

}  // namespace tumbler
