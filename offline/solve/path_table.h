#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "common/core/index.h"
#include "common/core/primitive.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/solve/joint_paths.h"
#include "offline/solve/parametric_motion.h"
#include "offline/solve/timetable.h"

namespace tumbler {

/// The paths of a motion's joints at the points of a timetable, and the way back: from cotangents
/// of the paths to those of the parameters. Paths are linear in their control points, with the same
/// weights for all joints that have as many.
class PathTable {
 public:
  /// @param motion  is kept by reference.
  explicit PathTable(const ParametricMotion& motion);

  /// Makes the weights at the points of a timetable, for the motion's duration.
  void Tabulate(const Timetable& table);
  /// Computes the paths for the parameters x.
  void Evaluate(std::span<const double> x);
  /// Computes the derivatives of the paths by the duration, which is free.
  void EvaluateSlopes();

  /// Puts the actuated joints where they are at a point; at that after the last one, at their ends.
  template <class Space>
  void PlaceJoints(int point, SceneDynamicsIn<Space>& robot) const {
    const bool moving = point < points();
    const std::size_t k = Index(moving ? point : point - 1);
    for (int j = 0; j < motion_.joints(); ++j) {
      const PathPoint& path = paths_[k * joints() + Index(j)];
      const ActuatedJoint& joint = motion_.joint(j);
      const std::size_t dof = Index(joint.dof);
      robot.q[dof] = path.q;
      robot.qd[dof] = moving ? path.qd : joint.end_rad_s;
      robot.qdd[dof] = moving ? path.qdd : 0;
    }
  }
  /// A joint at a point of the motion.
  [[nodiscard]] const PathPoint& At(int point, int joint) const {
    return paths_[Index(point) * joints() + Index(joint)];
  }

  /// Adds cotangents of a joint's q, qd and qdd at a point to those of the parameters.
  /// @tparam Number  of any kind that can be added, and multiplied by a number.
  template <class Number>
  void AddToParameters(int point, int joint, const std::array<Number, 3>& bar,
                       std::vector<Number>& parameters) const {
    const Weights& w = WeightsOf(joint, Index(point));
    const FreeWeights free(motion_.joint(joint), motion_.first_parameter(joint),
                           motion_.problem().degree, w.first);
    for (int i = free.begin; i < free.end; ++i) {
      parameters[Index(free.shift + i)] +=
          w.w[0][Index(i)] * bar[0] + w.w[1][Index(i)] * bar[1] + w.w[2][Index(i)] * bar[2];
    }
    if (motion_.duration().is_free()) {
      const PathPoint& slope = slopes_[Index(point) * joints() + Index(joint)];
      parameters.back() += slope.q * bar[0] + slope.qd * bar[1] + slope.qdd * bar[2];
    }
  }

 private:
  using Spline = JointMotion<double>::Spline;
  /// The weights of control points in q, qd and qdd at one time.
  struct Weights {
    int first = 0;
    std::array<std::array<double, Spline::kMaxDegree + 1>, 3> w{};
  };

  [[nodiscard]] std::size_t joints() const { return Index(motion_.joints()); }
  [[nodiscard]] int points() const { return static_cast<int>(time_.size()); }
  [[nodiscard]] const Weights& WeightsOf(int joint, std::size_t point) const {
    return weights_[weights_of_[Index(joint)] * time_.size() + point];
  }
  void AppendWeights(int control_points);

  const ParametricMotion& motion_;
  std::vector<double> time_;             // of the points
  std::vector<Weights> weights_;         // by size of spline, then point
  std::vector<std::size_t> weights_of_;  // for each joint, the index of its size in `weights_`
  std::vector<PathPoint> paths_;         // by point, then joint
  std::vector<PathPoint> slopes_;        // by the duration if that is free, likewise
};

}  // namespace tumbler
