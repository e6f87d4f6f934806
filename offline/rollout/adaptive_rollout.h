#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "offline/problem/problem.h"
#include "offline/rollout/forward_sensitivity.h"
#include "offline/rollout/rollout.h"

namespace tumbler {

/// Rollouts whose steps resolve impacts: Dormand and Prince's method with steps that bound the
/// error of the states and of their derivatives in the parameters by `solver.tolerance` (StepsFor).
/// A landing that takes a fixed step of 1 ms by surprise, so that the gradient is wrong by its own
/// size, gets steps of microseconds, and a flight gets steps of 10 ms.
///
/// Steps are chosen anew for a motion farther from the last ones' than kSameSteps_rad in any
/// parameter. In between they are kept, so that cost and constraints are smooth there, and the
/// gradient is exactly that of what is computed.
///
/// Not thread-safe: one object per thread.
class AdaptiveRollout {
 public:
  /// @param contact  replaces the general contact model; null: the general one. With another model
  /// there are no sensitivities to choose steps by: all are equal, of `solver.step_s`.
  explicit AdaptiveRollout(const Problem& problem,
                           std::unique_ptr<ContactForces<Plane>> contact = nullptr);
  ~AdaptiveRollout();
  AdaptiveRollout(AdaptiveRollout&&) noexcept;

  [[nodiscard]] int parameter_count() const;
  /// As Rollout's.
  [[nodiscard]] int output_count() const;

  using Gradient =
      Eigen::Ref<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  /// As Rollout::Run. The result depends on x, and on the motion for which steps were chosen last.
  RolloutResult Run(std::span<const double> x);
  RolloutResult Run(std::span<const double> x, Gradient gradient);
  /// The same with steps chosen for x, so that the result depends on nothing else.
  RolloutResult RunAnew(std::span<const double> x, Gradient gradient);
  /// The same, with what Gauss and Newton's method asks for.
  /// @throws std::logic_error with a contact model of the caller's, which has no sensitivities.
  RolloutResult RunAnew(std::span<const double> x, Gradient gradient, GaussNewton& gauss_newton);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Within this distance in each parameter, motions share their steps.
inline constexpr double kSameSteps_rad = 0.03;

}  // namespace tumbler
