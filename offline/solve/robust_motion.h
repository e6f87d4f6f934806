#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "offline/scene/self_clearance.h"
#include "offline/solve/constraints.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/robust_task.h"

namespace tumbler {

/// The variables x of motions in the search for a robust one: what is free of the paths
/// (FreePaths), then the duration where it is free. Gains of a feedback may follow, which are not
/// looked at here.
///
/// A motion that is faster or slower than the problem's is the same path in another time.
class RobustMotion {
 public:
  /// A path that exceeds a limit by any more than rounding is worth this and more, and is not
  /// simulated. No path that keeps them is worth more, unless its own shapes overlap by decimetres:
  /// robots, their plan and the model's own rest come to 5 at most.
  static constexpr double kUnplayable = 8;

  /// @param task  has to outlive this object.
  explicit RobustMotion(const RobustTask& task);

  /// How many variables a motion has.
  [[nodiscard]] std::size_t count() const {
    return paths_.count() + (task_.free_duration() ? 1 : 0);
  }
  /// The variables of a problem's parameters, for the problem's duration.
  [[nodiscard]] std::vector<double> Reduce(std::span<const double> parameters) const;
  /// The same for another duration, where it is free.
  [[nodiscard]] std::vector<double> Reduce(std::span<const double> parameters,
                                           double duration_s) const;
  /// The problem's parameters.
  [[nodiscard]] std::vector<double> Parameters(const std::vector<double>& x) const;
  /// How long it takes: whole ticks where that is free.
  [[nodiscard]] double Duration_s(const std::vector<double>& x) const;
  [[nodiscard]] int Ticks(const std::vector<double>& x) const {
    return RobustTask::Ticks(Duration_s(x));
  }

  /// How far the path leaves its limits and the clearance of own shapes; 0 where it keeps them.
  [[nodiscard]] double Excess(const std::vector<double>& x, SelfDistances& distances) const;

  /// Goes through the paths in steps of `step_s`, from the start on, at rest after the end.
  /// @param put  gets `step * joints + joint` and value, first and second derivative by time.
  template <class Put>
  void Sample(const std::vector<double>& x, std::size_t steps, double step_s,
              const Put& put) const {
    const auto splines = Splines(x);
    const double duration_s = Duration_s(x), haste = Haste(x);
    std::size_t k = 0;
    for (; k < steps; ++k) {
      const double t = static_cast<double>(k) * step_s;
      if (t >= duration_s) break;
      for (std::size_t j = 0; j < task_.joints; ++j) {
        auto at = splines[j].Evaluate(t * haste);
        at.first *= haste;
        at.second *= haste * haste;
        put(k * task_.joints + j, at);
      }
    }
    if (k == steps) return;
    for (std::size_t j = 0; j < task_.joints; ++j) {
      auto at = splines[j].Evaluate(static_cast<double>(k) * step_s * haste);
      at.first = at.second = 0;
      for (std::size_t held = k; held < steps; ++held) put(held * task_.joints + j, at);
    }
  }

 private:
  /// By how much a motion is faster than one of the problem's duration.
  [[nodiscard]] double Haste(const std::vector<double>& x) const {
    return task_.problem.duration_s / Duration_s(x);
  }
  /// Of the problem's duration.
  [[nodiscard]] std::vector<JointMotion<double>::Spline> Splines(
      const std::vector<double>& x) const;

  const RobustTask& task_;
  FreePaths paths_;
  std::vector<LinearRow> rows_;  // limits of derivatives, by what is free of the paths
};

}  // namespace tumbler
