#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "common/core/index.h"
#include "offline/scene/tableau.h"
#include "offline/solve/motion_outputs.h"
#include "offline/solve/smooth_maximum.h"

namespace tumbler {

/// What a stage of ForwardSensitivity leaves behind for the smooth maxima: quantities with their
/// derivatives in the parameters.
struct StageSensitivities {
  std::vector<double> torque;             ///< By joint [N m].
  std::vector<double> torque_slope;       ///< By joint, then parameter.
  std::vector<double> curve;              ///< OnCurve, by joint; of those that have a curve.
  std::vector<double> curve_slope;        ///< By joint, then parameter.
  double penetration = 0;                 ///< MotionOutputs::Penetration.
  std::vector<double> penetration_slope;  ///< By parameter.
};

/// The smooth maxima of a motion and their derivatives in the parameters, step by step as it is
/// integrated: nothing of a step is kept but its share.
class ForwardMaxima {
 public:
  /// @param motion     is kept by reference, as `outputs`.
  /// @param longest_s  of all steps.
  ForwardMaxima(const ParametricMotion& motion, const MotionOutputs& outputs, const Tableau& scheme,
                double longest_s);

  void Begin();
  /// Where the stages of the present step are recorded.
  [[nodiscard]] StageSensitivities& stage(std::size_t s) { return stages_[s]; }
  [[nodiscard]] std::size_t last_stage() const { return scheme_.own_stages() - 1; }
  /// Adds the step whose stages are recorded, and goes on to the next one.
  /// @param growth  derivative of the step by the last parameter, divided by the step; 0 where that
  ///                is not the duration.
  void AddStep(double step_s, double growth);
  /// Sets the excesses of torque and penetration, and their rows in the gradient.
  void Finish(RolloutResult& result, std::span<double> gradient) const;

 private:
  /// A smooth maximum, and its derivative in the parameters.
  struct MaximumWithSlope {
    SmoothMaximum maximum;
    std::vector<double> slope;  // of the integral, divided as it is
  };
  template <class Slopes>
  void Add(MaximumWithSlope& sum, const StepPoints& points, double step_s,
           std::span<const double> values, Slopes&& slopes, double unit, double growth) const;

  const ParametricMotion& motion_;
  const MotionOutputs& outputs_;
  const Tableau& scheme_;
  LookPoints look_points_;
  std::array<StageSensitivities, Tableau::kMaxStages> stages_;
  std::vector<MaximumWithSlope> maxima_;  // of the joints' torques, then of the penetration
};

}  // namespace tumbler
