#pragma once

#include <span>
#include <vector>

#include "common/core/index.h"
#include "offline/problem/free_start.h"
#include "offline/problem/problem.h"
#include "offline/solve/free_duration.h"

namespace tumbler {

/// The motion of a problem as a function of its parameters x, in everything that needs no
/// simulation: where and how fast it starts, how long it takes, and at which instants its cost
/// looks. Both ways to differentiate a rollout (Adjoint, ForwardSensitivity) take x from here.
///
/// Set gives it the parameters. Everything else is about those of the last Set that returned true;
/// before the first, about the problem as it is.
class ParametricMotion {
 public:
  /// @throws std::invalid_argument  about an instant of the cost that the motion does not have
  /// (InstantsOf, FreeDuration).
  explicit ParametricMotion(const Problem& problem);

  /// @returns false when the cost would look at a time that is not within the motion.
  bool Set(std::span<const double> x);

  /// With the start, and the targets that follow from it, of these parameters.
  [[nodiscard]] const Problem& problem() const { return problem_; }
  [[nodiscard]] const ActuatedJoint& joint(int j) const { return problem_.joints[Index(j)]; }
  [[nodiscard]] const FreeDuration& duration() const { return duration_; }
  [[nodiscard]] double duration_s() const { return duration_.duration_s(); }
  [[nodiscard]] const FreeStart& start() const { return start_; }
  /// At which the cost looks, in the order of time.
  [[nodiscard]] std::span<const CostInstant> instants() const { return instants_; }
  [[nodiscard]] int joints() const { return joints_; }
  [[nodiscard]] int parameters() const { return parameters_; }
  /// Index of the first parameter of a joint.
  [[nodiscard]] int first_parameter(int joint) const { return first_parameter_[Index(joint)]; }

 private:
  Problem problem_;
  FreeStart start_;
  FreeDuration duration_;
  std::vector<CostInstant> instants_;
  int joints_, parameters_;           // how many
  std::vector<int> first_parameter_;  // by joint
};

}  // namespace tumbler
