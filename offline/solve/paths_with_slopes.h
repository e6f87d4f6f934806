#pragma once

#include <array>
#include <span>
#include <vector>

#include "common/core/index.h"
#include "common/core/primitive.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/solve/joint_paths.h"
#include "offline/solve/parametric_motion.h"

namespace tumbler {

/// The paths of a motion's joints at one time after the other, and their derivatives in the
/// parameters. (PathTable has those of all times at once, for steps that are known beforehand.)
class PathsWithSlopes {
 public:
  /// @param motion  is kept by reference.
  explicit PathsWithSlopes(const ParametricMotion& motion);

  /// Takes the paths of the parameters x, for the motion's duration.
  void Begin(std::span<const double> x);
  /// Puts the joints where they are at a time of the motion; after it, at their ends.
  void PlaceJoints(double time_s, bool moving, SceneDynamics& robot);

  /// Adds the derivatives in the parameters of a quantity that depends on a joint's path.
  /// @param by  its derivatives in q, qd and qdd of the joint, at the time of PlaceJoints.
  void AddSlopes(int joint, const PathPoint& by, double* parameters) const {
    const Spline::Weights& w = weights_[Index(joint)];
    const FreeWeights free = FreeWeightsOf(joint);
    for (int k = free.begin; k < free.end; ++k) {
      parameters[free.shift + k] +=
          by.q * w.w[0][Index(k)] + by.qd * w.w[1][Index(k)] + by.qdd * w.w[2][Index(k)];
    }
    if (!motion_.duration().is_free()) return;
    const PathPoint& slope = by_duration_[Index(joint)];
    parameters[motion_.parameters() - 1] += by.q * slope.q + by.qd * slope.qd + by.qdd * slope.qdd;
  }
  /// The same of one that depends on one derivative of the path alone.
  /// @param order  0: on q, 1: on qd.
  void AddSlopes(int joint, std::size_t order, double by, double* parameters) const {
    const Spline::Weights& w = weights_[Index(joint)];
    const FreeWeights free = FreeWeightsOf(joint);
    for (int k = free.begin; k < free.end; ++k)
      parameters[free.shift + k] += by * w.w[order][Index(k)];
    if (!motion_.duration().is_free()) return;
    const PathPoint& slope = by_duration_[Index(joint)];
    parameters[motion_.parameters() - 1] += by * (order == 0 ? slope.q : slope.qd);
  }

 private:
  using Spline = JointMotion<double>::Spline;

  [[nodiscard]] FreeWeights FreeWeightsOf(int joint) const {
    return {motion_.joint(joint), motion_.first_parameter(joint), motion_.problem().degree,
            weights_[Index(joint)].first};
  }

  const ParametricMotion& motion_;
  std::vector<Spline> splines_;
  std::vector<int> same_knots_;  // for each joint, the first one whose path has its knots
  double time_s_ = 0;            // of the last PlaceJoints; -1: after the motion
  std::array<Spline::Weights, kMaxJoints> weights_;  // at that time
  std::vector<PathPoint> by_duration_;               // likewise, by joint, if that is free
};

}  // namespace tumbler
