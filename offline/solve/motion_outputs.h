#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "offline/problem/cost_term.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/solve/clearance_constraint.h"
#include "offline/solve/parametric_motion.h"
#include "offline/solve/rollout_result.h"
#include "offline/solve/smooth_maximum.h"
#include "offline/solve/torque_limit.h"

namespace tumbler {

/// What a rollout puts out of a motion, said once for both ways to differentiate it: from the robot
/// at one time to the numbers of which cost and constraints are made, with their derivatives in the
/// robot's positions, velocities and torques there. How these are summed over a motion, and brought
/// to the parameters, is the affair of Adjoint and ForwardSensitivity.
///
/// | output | at one time | over the motion |
/// |---|---|---|
/// | cost | CostTerm at instants and throughout | sum and integral |
/// | torque of a joint | |tau| / limit, and |OnCurve| of a motor with a torque-speed curve |
/// TorqueExcess of a SmoothMaximum | | penetration | Penetration, over all contacts |
/// PenetrationExcess of a SmoothMaximum | | clearance | distances of own shapes | ClearanceExcess |
///
/// What is here cannot be found wrong by comparing the two gradients. So tests compare each
/// output's gradient with differences of the output, and the outputs with what they are made of.
///
/// No heap after construction.
class MotionOutputs {
 public:
  /// @param motion  is kept by reference.
  /// @param step_s  of the times at which distances between own shapes are looked at.
  MotionOutputs(const ParametricMotion& motion, double step_s);

  [[nodiscard]] OutputRows rows() const { return OutputRows(motion_.joints()); }

  /// A result before the motion begins.
  [[nodiscard]] RolloutResult Begin() const;
  /// The result of a motion that left every plausible range.
  static RolloutResult Failed(RolloutResult result);

  /// Whether the torque of a joint's motor has a limit.
  [[nodiscard]] bool IsTorqueLimited(int joint) const {
    return std::isfinite(motion_.joint(joint).limits.torque_max_nm);
  }
  /// The joints whose limit depends on their speed.
  [[nodiscard]] std::span<const int> curved() const { return curved_; }
  [[nodiscard]] SmoothMaximum EmptyTorqueMaximum() const {
    return {sharpness(), SmoothMaximum::Of::kSize};
  }
  /// As it is after steps that were added elsewhere.
  [[nodiscard]] SmoothMaximum TorqueMaximum(double largest, double sum) const {
    return {sharpness(), SmoothMaximum::Of::kSize, largest, sum};
  }
  [[nodiscard]] SmoothMaximum EmptyPenetrationMaximum() const {
    return {sharpness(), SmoothMaximum::Of::kAboveZero};
  }
  [[nodiscard]] SmoothMaximum PenetrationMaximum(double largest, double sum) const {
    return {sharpness(), SmoothMaximum::Of::kAboveZero, largest, sum};
  }
  /// @param maximum  over |tau| / limit, and over |OnCurve| where the motor has a curve.
  static double TorqueExcess(const SmoothMaximum& maximum);
  /// @param maximum  over Penetration.
  [[nodiscard]] double PenetrationExcess(const SmoothMaximum& maximum) const;
  /// @param gradient  as ClearanceConstraint::Evaluate.
  double ClearanceExcess(std::span<const double> x, std::span<double> gradient) {
    return clearance_.Evaluate(x, gradient);
  }

  /// Smooth maximum over all contacts of (penetration / usable part of the layer) above that of
  /// SmoothDepth::least, 0 without deep contacts, after SceneDynamics::TouchAndSolve.
  template <class Space>
  double Penetration(const SceneDynamicsIn<Space>& robot) {
    return depth_.Evaluate(robot.contact->active());
  }
  /// Adds the derivatives of the last Penetration in the positions.
  /// @returns whether there are any.
  template <class Space>
  bool AddPenetrationSlopes(SceneDynamicsIn<Space>& robot,
                            typename SceneDynamicsIn<Space>::Numbers& by_q) const;

  /// Takes the robot at the start of a step into the peaks of torque and penetration.
  template <class Space>
  void RecordPeaks(const SceneDynamicsIn<Space>& robot, RolloutResult& result) const;

  /// Calls visit(i, term) for each term i of the cost that looks at an instant.
  template <class Visit>
  void ForEachTermAt(const CostInstant& instant, Visit&& visit) const {
    const std::vector<CostTerm>& cost = motion_.problem().cost;
    for (std::size_t i = 0; i < cost.size(); ++i) {
      if (instant.Has(cost[i])) visit(i, cost[i]);
    }
  }
  /// Records by how much the motion misses the target of a term at an instant.
  static void RecordTarget(const CostTerm& term, const CostPoint& here, RolloutResult& result);

  /// The derivatives of what a term at an instant adds to the cost.
  template <class Space>
  struct TermSlopesIn {
    typename SceneDynamicsIn<Space>::Numbers by_q{}, by_qd{};
    double by_target = 0;  ///< Of a term that draws; its target may follow from a free start.
  };
  using TermSlopes = TermSlopesIn<Plane>;
  template <class Space = Plane>
  static TermSlopesIn<Space> SlopesOf(const CostTerm& term, const CostPoint& here);

 private:
  [[nodiscard]] double sharpness() const { return motion_.problem().solver.sharpness; }

  const ParametricMotion& motion_;
  ClearanceConstraint clearance_;
  SmoothDepth depth_;
  std::vector<int> curved_;
};

}  // namespace tumbler
