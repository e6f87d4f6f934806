#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/core/primitive.h"
#include "offline/problem/feed_forward_knots.h"

namespace tumbler {

/// Splines with the knots of a primitive's feed-forward, by values at every tick of a motion: many
/// of them are fitted in a search. The matrix of the normal equations is factored once.
class TickSpline {
 public:
  using Spline = JointMotion<double>::Spline;

  /// @param ticks  of the motion, RobustTask::kTick_s each; values are there from 0 to the last.
  TickSpline(double duration_s, int ticks);

  /// The control points of the least-squares spline through a value for each tick.
  [[nodiscard]] std::vector<double> Fit(const std::vector<double>& values) const;
  /// The value of a spline at a tick.
  [[nodiscard]] double At(std::size_t tick, const std::vector<double>& points) const;
  /// The spline with these control points.
  /// @throws std::logic_error  when one is not finite.
  [[nodiscard]] Spline With(const std::vector<double>& points) const;

 private:
  static constexpr std::size_t kBand = kFeedForwardDegree + 1;
  void Factor(std::size_t count);

  std::vector<double> knots_;
  std::vector<Spline::Weights> weights_;  // by tick
  /// L of L L^T, where [i][d] is row i, column i - d: basis functions that are farther apart do not
  /// overlap.
  std::vector<std::array<double, kBand>> factor_;
};

}  // namespace tumbler
