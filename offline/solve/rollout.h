#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "offline/model/contact_forces.h"
#include "offline/problem/problem.h"
#include "offline/scene/motion_sample.h"
#include "offline/scene/step_grid.h"
#include "offline/solve/smooth_maximum.h"

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
  /// has a torque-speed curve, that of |OnCurve| counts in it, too.
  std::vector<double> torque_excess;
  /// The smooth maximum of penetration over the usable part of the layer, less 1, likewise.
  double core_excess = -1;
  /// The same of the clearance between the robot's own shapes, see ClearanceConstraint.
  double clearance_excess = -1;
  /// For each joint, the largest |tau| of its motor at the starts of steps.
  std::vector<double> peak_torque_nm;
};

/// Integrates [AB04, Eq. 8] by single shooting and differentiates the result exactly.
///
/// Steps end at every instant at which the cost looks (`Problem::instants`). The scheme is the
/// classical Runge-Kutta method of order 4 with equal steps between these, until `Use` gives it
/// other steps, which are those of Dormand and Prince's method of order 5. The gradient is the
/// derivative of that very computation, by the discrete adjoint: the price of a gradient hardly
/// depends on the number of parameters, and it agrees with differences of the cost to rounding.
/// A task may ask for the paper's forward gradient instead (ForwardSensitivity, with equal steps).
///
/// Not thread-safe: one object per thread. After the first gradient, only the returned vectors
/// allocate.
class Rollout {
 public:
  /// @param contact  replaces the general contact model of the problem; null: the general model.
  /// @throws std::invalid_argument when `contact` is given and the problem asks for the paper's
  /// forward gradient, which knows only the general model; about an instant of the cost that the
  /// motion does not have (InstantsOf).
  Rollout(const Problem& problem, double step_s,
          std::unique_ptr<ContactForces<Plane>> contact = nullptr);
  ~Rollout();
  Rollout(Rollout&&) noexcept;

  [[nodiscard]] int parameter_count() const;
  /// Number of outputs with a gradient: the cost, the torque excess of each joint, the core excess,
  /// the clearance excess.
  [[nodiscard]] int output_count() const;

  /// Cost, torques and penetration for the parameters x: the free control points [rad] of the first
  /// joint, then those of the second, and so on.
  RolloutResult Run(std::span<const double> x);

  /// The same, with gradients.
  /// @param gradient  gets a row for each output, one after the other, with a number for each
  /// parameter.
  /// @throws std::invalid_argument when `gradient` has another size.
  RolloutResult Run(std::span<const double> x, std::span<double> gradient);

  /// Takes these steps from now on, by the method of Dormand and Prince. Gradients are then those
  /// of the adjoint, whatever the problem asks for.
  /// @throws std::invalid_argument when they do not add up to the problem's times, or stride over
  /// an instant at which its cost looks.
  void Use(const StepGrid& grid);

  /// Cost, torques and penetration by the semi-implicit Euler method with the same step: a quarter
  /// of the price, and good enough to tell promising motions from others.
  RolloutResult Estimate(std::span<const double> x);

  /// Visits the motion step by step, from 0 to the end of the settle phase and `extra_s` beyond.
  /// After the motion itself the joints are held at their ends.
  void Visit(std::span<const double> x, double extra_s,
             const std::function<void(const MotionSample&)>& visitor);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// The equal steps of a new Rollout: between the instants of the problem's cost, no longer than
/// `longest_s`.
StepGrid EvenGrid(const Problem& problem, double longest_s);

/// All control points of a joint for the parameters x: fixed start, free points, fixed end [rad].
std::vector<double> ControlPoints(const Problem& problem, std::span<const double> x,
                                  std::size_t joint);

/// The joint's spline for the parameters x.
JointMotion<double>::Spline PositionSpline(const Problem& problem, std::span<const double> x,
                                           std::size_t joint);

}  // namespace tumbler
