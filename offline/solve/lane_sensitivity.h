#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "offline/solve/gauss_newton.h"
#include "offline/solve/lane_rollout.h"

namespace tumbler {

/// Cost and constraints of a motion with their derivatives in all parameters, by differences: a
/// motion and those beside it run in the lanes of one packet, or a few where there are more than
/// seven parameters. So a gradient costs as much as a motion.
///
/// Differences are forward ones, and as wrong as the cost is curved over kDifference_rad: enough to
/// come near a minimum, where ForwardSensitivity goes on. The clearance of own shapes has exact
/// derivatives.
class LaneSensitivity {
 public:
  /// @pre  LaneRollout covers the problem.
  LaneSensitivity(const Problem& problem, double step_s);
  /// With these steps, by the method of Dormand and Prince.
  LaneSensitivity(const Problem& problem, const StepGrid& grid);

  [[nodiscard]] int parameter_count() const { return parameters_; }
  [[nodiscard]] int output_count() const { return outputs_; }
  /// As ForwardSensitivity::Run. What is squared in the effort is taken at the starts of steps.
  RolloutResult Run(std::span<const double> x, std::span<double> gradient,
                    GaussNewton* gauss_newton = nullptr);
  /// Evaluations of the dynamics, of all lanes, in the last Run.
  [[nodiscard]] std::int64_t evaluations() const {
    return (1 + parameters_) * rollout_.evaluations();
  }

  /// Evaluations of the dynamics of whole packets that a Run takes.
  [[nodiscard]] std::int64_t packet_evaluations() const {
    const auto lanes = static_cast<std::int64_t>(Packet::kLanes);
    return (parameters_ + lanes) / lanes * rollout_.evaluations();
  }

  /// By so much each parameter is moved [rad, and the unit of a velocity].
  static constexpr double kDifference_rad = 2e-8;

 private:
  LaneSensitivity(const Problem& problem, LaneRollout rollout);
  void AddEffort(std::size_t first, std::size_t count);

  int parameters_, outputs_;
  std::size_t joints_;
  LaneRollout rollout_;
  std::vector<std::vector<double>> x_;
  std::vector<double> torque_;        // of the motion, by step, then joint
  std::vector<double> torque_slope_;  // by step, then joint, then parameter
};

}  // namespace tumbler
