#pragma once

#include <vector>

#include "offline/scene/scene.h"

namespace tumbler {

/// Lowers the robot on the obstacles with its joints held, until it is at rest. Its joints, and x
/// and pitch of its root, are those of `q`, the positions of all degrees of freedom; how high it is
/// there does not matter.
/// @pre its root is planar, its joints are prescribed.
/// @returns all positions at rest. @throws std::runtime_error when it has not come to rest within 5
/// s, with where it was.
std::vector<double> RestPose(const Scene& scene, std::vector<double> q);

}  // namespace tumbler
