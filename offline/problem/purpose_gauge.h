#pragma once

#include <span>

#include "common/purpose.h"
#include "offline/model/planar_robot.h"
#include "offline/problem/link_point.h"

namespace tumbler {

/// Takes what a target of a motion's purpose asks for from a robot's state.
class PurposeGauge {
 public:
  /// @throws std::invalid_argument  as PointOfLink, when the target is of a point that the robot
  /// has not.
  PurposeGauge(const PurposeTarget& target, const PlanarRobot& robot);

  /// The value at an instant [m, rad, m/s, rad/s]. A fixed root is at 0. Of a speed it is the
  /// largest |rate| of the root now, of which the target asks for the largest in a while.
  /// @param q, qd  of all degrees of freedom, in the coordinates of the task.
  [[nodiscard]] double At(std::span<const double> q, std::span<const double> qd) const;

 private:
  PurposeTarget::Of of_;
  std::size_t root_dofs_;
  LinkPoint point_;  // Not present: of the root.
};

/// When a target is due, since the start of a motion that lasts `duration_s` and settles for
/// `settle_s` [s].
[[nodiscard]] double DueTime(const PurposeTarget& target, double duration_s, double settle_s);

}  // namespace tumbler
