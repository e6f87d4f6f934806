#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "common/core/primitive.h"
#include "offline/problem/problem.h"
#include "offline/scene/step_grid.h"
#include "offline/solve/joint_paths.h"

namespace tumbler {

/// How the times, steps and paths of a motion follow its duration T, where that is a parameter of
/// the problem.
///
/// A path is the same function of t / T for all T. Times within the motion at which the cost looks
/// stay what they are; steps after the last of them, or from the start on where there is none, are
/// stretched with T, and keep their number. So cost and constraints are smooth functions of T, and
/// everything here is the derivative of that very computation by the parameter T / `duration_s`.
class FreeDuration {
 public:
  /// @throws std::invalid_argument  when the duration is free, and the cost looks at a given time
  /// after the motion.
  explicit FreeDuration(const Problem& problem);

  [[nodiscard]] bool is_free() const { return is_free_; }
  /// Takes the duration of the motion with these parameters, and its paths.
  /// @returns false when the cost would look at a time that is not within the motion.
  bool Set(const Problem& problem, std::span<const double> x);
  /// T [s].
  [[nodiscard]] double duration_s() const { return duration_s_; }
  /// The last time within the motion at which the cost looks; 0 where there is none [s].
  [[nodiscard]] double stretched_from_s() const { return from_s_; }
  /// The derivative of a step after that time by the parameter, divided by the step.
  [[nodiscard]] double growth() const { return unit_s_ / (duration_s_ - from_s_); }
  /// That of a step that begins here: 0 before that time.
  [[nodiscard]] double GrowthOfStepAt(double begin_s) const {
    return begin_s > from_s_ - kSameTime_s ? growth() : 0;
  }
  /// The derivative of a joint's path at a time of the motion, which moves with its step.
  [[nodiscard]] PathPoint PathSlope(std::size_t joint, double time_s) const;
  /// The grid with its steps after `stretched_from_s` stretched to the duration.
  [[nodiscard]] StepGrid Stretched(StepGrid grid) const;

 private:
  static constexpr double kSameTime_s = 1e-9;
  using Spline = JointMotion<double>::Spline;

  bool is_free_;
  double unit_s_;  // of the parameter
  double from_s_ = 0;
  double duration_s_;
  std::vector<Spline> paths_;
  std::vector<Spline> rates_;  // their derivatives, if there is a time at which the cost looks
  /// By T, of the paths at the same t / T, if an end moves: then the points there move with T.
  std::vector<Spline> moved_;
};

/// The equal steps of a new Rollout: between the instants of the problem's cost, no longer than
/// `longest_s`. Where the duration is free, they are as many as its longest needs.
StepGrid EvenGrid(const Problem& problem, double longest_s);

/// For each instant, how many steps of its phase are before it.
std::vector<std::size_t> StepsUntil(const StepGrid& grid, std::span<const CostInstant> instants);

}  // namespace tumbler
