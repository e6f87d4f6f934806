#include "offline/solve/paths_with_slopes.h"

#include <limits>

namespace tumbler {

PathsWithSlopes::PathsWithSlopes(const ParametricMotion& motion)
    : motion_(motion), splines_(Index(motion.joints())), by_duration_(Index(motion.joints())) {
  for (int j = 0; j < motion.joints(); ++j) {
    int same = 0;
    while (motion.joint(same).control_points != motion.joint(j).control_points) ++same;
    same_knots_.push_back(same);
  }
}

void PathsWithSlopes::Begin(std::span<const double> x) {
  for (std::size_t j = 0; j < splines_.size(); ++j)
    splines_[j] = PositionSpline(motion_.problem(), x, j);
  time_s_ = std::numeric_limits<double>::quiet_NaN();
}

void PathsWithSlopes::PlaceJoints(double time_s, bool moving, SceneDynamics& robot) {
  const double key = moving ? time_s : -1;
  if (key == time_s_) return;
  time_s_ = key;
  for (int j = 0; j < motion_.joints(); ++j) {
    const ActuatedJoint& joint = motion_.joint(j);
    const std::size_t dof = Index(joint.dof);
    if (!moving) {
      robot.q[dof] = joint.end_rad;
      robot.qd[dof] = joint.end_rad_s;
      robot.qdd[dof] = 0;
      continue;
    }
    const Spline& spline = splines_[Index(j)];
    // Paths of as many control points have the same knots.
    const int same = same_knots_[Index(j)];
    weights_[Index(j)] = same < j ? weights_[Index(same)] : spline.EvaluateWeights(time_s);
    const Spline::Weights& w = weights_[Index(j)];
    std::array<double, 3> path{};
    for (int i = 0; i <= motion_.problem().degree; ++i) {
      const double point = spline.control_points()[Index(w.first + i)];
      for (std::size_t d = 0; d < 3; ++d) path[d] += w.w[d][Index(i)] * point;
    }
    robot.q[dof] = path[0];
    robot.qd[dof] = path[1];
    robot.qdd[dof] = path[2];
    if (motion_.duration().is_free())
      by_duration_[Index(j)] = motion_.duration().PathSlope(Index(j), time_s);
  }
}

}  // namespace tumbler
