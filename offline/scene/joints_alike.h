#pragma once

#include <algorithm>

namespace tumbler {

/// SameJoints of scenes in the plane or in space.
template <class AScene>
bool JointsAreAlike(const AScene& a, const AScene& b) {
  const auto same_damping = [](const auto& x, const auto& y) {
    return x.damping_nm_s_per_rad == y.damping_nm_s_per_rad;
  };
  return a.motors == b.motors && a.robot.passive == b.robot.passive &&
         a.robot.locked == b.robot.locked &&
         std::ranges::equal(a.robot.tree.dofs, b.robot.tree.dofs, same_damping);
}

}  // namespace tumbler
