#pragma once

#include <memory>
#include <span>

#include "offline/model/contact_forces.h"
#include "offline/problem/problem.h"
#include "offline/scene/integrator.h"
#include "offline/scene/step_grid.h"
#include "offline/solve/gauss_newton.h"
#include "offline/solve/rollout_result.h"

namespace tumbler {

/// Cost and gradient by the paper's method [AB04, section V]. The states of Eq. 8 and their
/// derivatives in every parameter are integrated together, with dg (Eq. 9) at every stage:
///
///   y' = f(y, a(t)),   S' = A S + B,    y = (q_p, qd_p, running cost),  S = dy/dp,
///   A = df/dy,  B = df/d(q_a, qd_a, qdd_a) d(q_a, qd_a, qdd_a)/dp.
///
/// With three passive coordinates and eleven parameters these are the paper's seven state and
/// seventy-seven gradient equations. B has entries only where a basis function is not zero.
///
/// With the fixed scheme the gradient is that of the discrete computation, as Rollout's is: the two
/// agree to rounding. They share g and dg, what they take from the parameters (ParametricMotion)
/// and what they put out of the robot at one time (MotionOutputs). Each propagates, sums over time
/// and differentiates in its own way. The adaptive scheme is the independent reference for the
/// error of a fixed step.
///
/// Why both: the adjoint goes back through steps that were chosen before. The adaptive scheme
/// bounds the error of states *and* sensitivities, for which it takes the sensitivities while it
/// goes forward; bounding the error of the states alone would leave that of the gradient open. It
/// also has the derivatives of each residual and of every torque at every step, of which the
/// Gauss-Newton matrix is made. SolveNear needs both. For a gradient alone the adjoint is cheaper:
/// its price hardly grows with the number of parameters, and is 0.73 of this one's for 6 and 0.46
/// for 48 (docs/benchmarks.md, a gradient by either method).
///
/// Not thread-safe: one object per thread. In the integration, only the returned vectors allocate.
class ForwardSensitivity {
 public:
  /// @param contact  replaces the general contact model; null: the general one.
  ForwardSensitivity(const Problem& problem, const StepSettings& settings,
                     std::unique_ptr<ContactForces<Plane>> contact = nullptr);
  ~ForwardSensitivity();
  ForwardSensitivity(ForwardSensitivity&&) noexcept;

  [[nodiscard]] int parameter_count() const;
  /// Number of outputs with a gradient (OutputRows), as Rollout's.
  [[nodiscard]] int output_count() const;
  /// Number of rows of y.
  [[nodiscard]] int state_equations() const;
  /// Number of entries of S.
  [[nodiscard]] int gradient_equations() const;

  /// Like Rollout::Run. The largest torque and penetration are those where steps start, hence at
  /// other times with the adaptive scheme than with the fixed one.
  /// @param gauss_newton  is filled, if it is not null.
  RolloutResult Run(std::span<const double> x, std::span<double> gradient,
                    GaussNewton* gauss_newton = nullptr);
  /// The same, with adaptive steps as they were chosen in the last run by Run, whatever their error
  /// is now: cost, constraints and derivatives are smooth functions of x so, and the derivatives
  /// are those of exactly this computation, to which differences can be compared.
  /// @throws std::logic_error when there was no such run, or none that ended.
  RolloutResult RunAgain(std::span<const double> x, std::span<double> gradient,
                         GaussNewton* gauss_newton = nullptr);

  [[nodiscard]] const IntegrationStatistics& statistics() const;
  /// The steps of the last run by Run, if they are adaptive. None when it left every plausible
  /// range.
  [[nodiscard]] const StepGrid& grid() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// The longest step of StepsFor. The tolerance shortens it where a foot comes near the ground.
inline constexpr double kLongestAdaptiveStep_s = 1e-2;

/// The settings of steps that bound the error of states and sensitivities by `solver.tolerance`.
StepSettings AdaptiveSteps(const Problem& problem);

/// The steps for a Rollout of motions near x: AdaptiveSteps at x. A Rollout that uses them repeats
/// the computation of ForwardSensitivity, and its gradient agrees with that one's to rounding.
/// Equal steps of `solver.step_s` when x leaves every plausible range.
StepGrid StepsFor(const Problem& problem, std::span<const double> x);

}  // namespace tumbler
