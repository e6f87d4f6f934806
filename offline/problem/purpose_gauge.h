#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "common/files/purpose.h"
#include "offline/model/planar_robot.h"
#include "offline/problem/link_point.h"
#include "offline/problem/space_quantity.h"

namespace tumbler {

/// Takes what a target of a motion's purpose asks for from a robot's state.
class PurposeGauge {
 public:
  PurposeGauge(const PurposeTarget& target, const PlanarRobot& robot);
  PurposeGauge(const PurposeTarget& target, const SpaceRobot& robot);

  /// Why the robot does not show it: it has no such point, or moves in another space. Empty: it
  /// does.
  [[nodiscard]] const std::string& obstacle() const { return obstacle_; }

  /// The value at an instant [m, rad, m/s, rad/s]. A fixed root is at 0. Of a speed it is the
  /// largest |rate| of the root now, of which the target asks for the largest in a while. Of a
  /// heading it is the angle nearest to the target, and not a number where there is none
  /// (SpaceQuantity::IsDefined).
  /// @param q, qd  of all degrees of freedom, in the coordinates of the task.
  /// @param axes   of a root in space (RootChart).
  /// @pre there is no obstacle.
  [[nodiscard]] double At(std::span<const double> q, std::span<const double> qd,
                          const SpaceMatrix& axes = SpaceMatrix::Identity()) const;

 private:
  PurposeTarget::Of of_;
  double target_;
  std::size_t root_dofs_;
  LinkPoint point_;         // Not present: of the root.
  SpaceQuantity quantity_;  // Present in space alone, but for a speed.
  std::string obstacle_;
};

/// When a target is due, since the start of a motion that lasts `duration_s` and settles for
/// `settle_s` [s].
[[nodiscard]] double DueTime(const PurposeTarget& target, double duration_s, double settle_s);

}  // namespace tumbler
