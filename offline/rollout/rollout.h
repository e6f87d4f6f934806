#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "offline/contact/contact_forces.h"
#include "offline/problem/problem.h"
#include "offline/scene/motion_sample.h"

namespace tumbler {

/// A penetration whose share in the smooth maximum is e to less than this adds nothing to it.
inline constexpr double kNegligibleExponent = -40;

/// What a rollout says of one choice of parameters.
struct RolloutResult {
  double cost = 0;
  bool finite = true;  ///< False when the state left every plausible range; cost is then infinite.
  bool any_contact = false;
  double peak_penetration_m = 0;  ///< Into the layer.
  double target_error_rad = 0;    ///< Largest distance from the target of a term of the cost in the
                                  ///< square of the pitch; 0 where there is none.
  std::vector<double>
      torque_excess;  ///< Of each joint: smooth maximum of |tau| / limit, less 1; an upper bound.
  double core_excess = -1;  ///< Smooth maximum of penetration over the usable part of the layer,
                            ///< less 1; an upper bound.
  std::vector<double> peak_torque_nm;
};

/// Integrates [AB04, Eq. 8] by single shooting and differentiates the result exactly.
///
/// The scheme is the classical Runge-Kutta method of order 4 with a fixed step, and the gradient is
/// the derivative of that very computation, by the discrete adjoint: the price of a gradient hardly
/// depends on the number of parameters, and it agrees with differences of the cost to rounding.
/// Motion and settle phase are divided into whole steps no longer than the one asked for. A task
/// may ask for the paper's forward gradient instead (ForwardSensitivity, with the same steps).
///
/// Not thread-safe: one object per thread. No heap after the first gradient, save in the returned
/// vectors.
class Rollout {
 public:
  /// @param contact in place of the general contact model of the problem; null: that.
  /// @throws std::invalid_argument when `contact` is given and the problem asks for the paper's
  /// forward gradient, which has the general model.
  Rollout(const Problem& problem, double step_s,
          std::unique_ptr<ContactForces<Plane>> contact = nullptr);
  ~Rollout();
  Rollout(Rollout&&) noexcept;

  [[nodiscard]] int parameter_count() const;
  /// Number of outputs with a gradient: the cost, the torque excess of each joint, the core excess.
  [[nodiscard]] int output_count() const;

  /// Cost and torques for the parameters x: the free control points [rad] of the first joint, of
  /// the second, ...
  RolloutResult Run(std::span<const double> x);

  /// The same with gradients, one row for each output, one column for each parameter.
  /// @throws std::invalid_argument when `gradient` has another shape.
  RolloutResult Run(
      std::span<const double> x,
      Eigen::Ref<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> gradient);

  /// Cost, torques and penetration by the semi-implicit Euler method with the same step: a quarter
  /// of the price, and good enough to tell promising motions from others.
  RolloutResult Estimate(std::span<const double> x);

  /// Visits the motion step by step from 0 to duration + settle + `extra_s`, legs held at their
  /// ends after duration.
  void Visit(std::span<const double> x, double extra_s,
             const std::function<void(const MotionSample&)>& visitor);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// All control points of joint j for the parameters x: fixed start, free points, fixed end.
std::vector<double> ControlPoints(const Problem& problem, std::span<const double> x,
                                  std::size_t joint);

/// The joint's spline for the parameters x.
JointMotion<double>::Spline PositionSpline(const Problem& problem, std::span<const double> x,
                                           std::size_t joint);

}  // namespace tumbler
