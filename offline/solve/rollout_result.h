#pragma once

#include <vector>

namespace tumbler {

/// A state beyond this (m, rad, and their rates) is a failed rollout: no tumbler gets near it.
inline constexpr double kImplausibleState = 1e4;

/// The result of a rollout with one choice of parameters.
struct RolloutResult {
  double cost = 0;
  /// False when the state left every plausible range. The cost is then infinite.
  bool finite = true;
  bool any_contact = false;
  /// Deepest penetration into the compliant layer.
  double peak_penetration_m = 0;
  /// Largest distance of the pitch from the target of a cost term in the pitch's square. 0 when
  /// there is no such term.
  double target_error_rad = 0;
  /// The residuals of the cost's terms that draw the motion to a target (CostTerm::Residual), in
  /// the order of the problem's instants.
  std::vector<double> residuals;
  /// For each joint, the smooth maximum of |tau| / limit, less 1, with the torque tau of its motor.
  /// An upper bound of the true one, unless its peak is shorter than kPeakDuration_s. Where a motor
  /// has a torque-speed curve, that of |OnCurve| counts in it, too. -1 where there is no limit, or
  /// no torque.
  std::vector<double> torque_excess;
  /// Smooth maximum of (penetration / usable part of the layer), less 1, likewise. -1 where nothing
  /// comes near that.
  double penetration_excess = -1;
  /// Smooth maximum of (required - actual clearance) of the robot's own shapes, in units of
  /// kClearanceScale_m (ClearanceConstraint).
  double clearance_excess = -1;
  /// For each joint, the largest |tau| of its motor at the starts of steps.
  std::vector<double> peak_torque_nm;
};

/// The outputs of a rollout that have a gradient, as rows of one matrix: the cost, the torque
/// excess of each joint, the penetration excess, the clearance excess.
class OutputRows {
 public:
  explicit constexpr OutputRows(int joints) : joints_(joints) {}
  static constexpr int kCost = 0;
  [[nodiscard]] static constexpr int torque(int joint) { return 1 + joint; }
  [[nodiscard]] constexpr int penetration() const { return 1 + joints_; }
  [[nodiscard]] constexpr int clearance() const { return 2 + joints_; }
  [[nodiscard]] constexpr int count() const { return 3 + joints_; }

 private:
  int joints_;
};

}  // namespace tumbler
