#pragma once

#include <memory>
#include <span>

#include "offline/problem/problem.h"

namespace tumbler {

/// The limit that keeps a robot's own shapes apart, `Scene::self_contact`: the smooth maximum
/// [KS79] of (clearance - distance) / kClearanceScale_m over the motion and all pairs,
///
///   E = 1 / rho ln( 1 / (1 ms) sum_k w_k sum_pairs exp(rho (clearance - d) / kClearanceScale_m) ),
///
/// with the times w_k that the steps stand for, so that E hardly depends on the step. It is at or
/// above the true maximum where a pair stays near for a millisecond or more, which limits of
/// acceleration see to. -1 where no pair comes nearer than the clearance and two thirds of
/// kClearanceScale_m (with rho = 60).
///
/// Distances depend on the paths of the joints alone, so value and derivative need no simulation.
/// No heap after construction.
class ClearanceConstraint {
 public:
  /// @param step_s  distances are looked at at the ends of equal steps no longer than this.
  ClearanceConstraint(const Problem& problem, double step_s);
  ~ClearanceConstraint();
  ClearanceConstraint(ClearanceConstraint&&) noexcept;

  /// @param x         parameters of the problem [rad].
  /// @param gradient  gets dE/dx, one number for each parameter; or is empty.
  double Evaluate(std::span<const double> x, std::span<double> gradient = {});

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
