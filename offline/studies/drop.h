#pragma once

#include <cstdint>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/scene/scene.h"

namespace tumbler {

/// How a robot is let go, without torque.
struct Drop {
  PrimitivePose pose;
  /// Of all degrees of freedom: x and z of the root, its pitch, and the joints [m/s, rad/s].
  std::vector<double> rates;
};

/// One of all drops.
struct DropNumber {
  std::uint64_t seed = 1;
  std::uint64_t index = 0;    ///< Of the robot.
  std::uint64_t attempt = 0;  ///< Of its drops.
};

/// Draws a drop: the pitch is uniform in the whole turn, every joint within its
/// limits (a joint without limits within half a turn to either side), where the robot's own shapes
/// do not overlap; the lowest point is up to 0.1 m above the obstacles; the root moves along x by
/// up to 0.3 m/s and turns by up to 2 rad/s, to either side.
/// @pre the root is planar.
/// @throws std::runtime_error  when the robot cannot be put above the obstacles, or its shapes
///                             overlap wherever the joints are.
Drop DrawDrop(const Scene& scene, const DropNumber& number);

/// Whether links overlap that no joint connects. Limp joints bring a simulated robot into such
/// poses, since nothing in the twin keeps its links apart; no robot lies so. What is at a joint's
/// stop may overlap the link at its other side, if the limits of the joint say so.
/// @param joints_rad  in the order of the robot's joints.
[[nodiscard]] bool LiesInItself(const Scene& scene, const std::vector<double>& joints_rad);

}  // namespace tumbler
