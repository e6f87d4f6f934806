#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <stdexcept>

namespace tumbler {

/// A robot is looked for so far above and below the origin.
inline constexpr double kLowestReach_m = 10;

/// The height of the root at which the lowest shape of a robot in the plane or in space just
/// reaches the compliant layer, by bisection.
/// @param height  which coordinate it is.
/// @throws std::runtime_error  when the robot is inside an obstacle as far up as is looked.
template <typename Dynamics, typename AnyScene>
double LowestHeight(Dynamics& robot, const AnyScene& scene, std::size_t height) {
  const auto touches = [&robot, height](double z) {
    robot.q[height] = z;
    robot.Touch();
    return !robot.contact->active().empty();
  };
  double low = -kLowestReach_m, high = kLowestReach_m;
  if (touches(high)) {
    const auto& inside = robot.contact->active().front();
    throw std::runtime_error(fmt::format(
        "with its root {} m high the robot is still {:.4g} m inside '{}', so it cannot be lowered "
        "on it (a half-space lies behind its normal)",
        high, inside.depth_m - scene.contact.d_on_m, TouchedName(scene, inside)));
  }
  for (int i = 0; i < 60; ++i) (touches(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
  return high;
}

}  // namespace tumbler
