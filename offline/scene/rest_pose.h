#pragma once

#include <vector>

#include "offline/scene/scene.h"

namespace tumbler {

/// The height of the root at which the robot just touches the obstacles [m].
/// @param q  positions of all degrees of freedom [m, rad]; the root's height is not used.
/// @throws std::runtime_error  when the robot cannot be put above the obstacles.
double TouchingHeight(const Scene& scene, const std::vector<double>& q);

/// Finds the pose in which the robot rests on the obstacles. A simulation puts the robot just above
/// them, lets it go, and holds its joints until nothing moves any more.
/// @param q  positions of all degrees of freedom [m, rad]. The joints keep theirs. The root begins
///           with its x and pitch, which change as the robot settles; its height is not used.
/// @pre The root is planar, and all joints are prescribed.
/// @returns positions of all degrees of freedom at rest.
/// @throws std::runtime_error  when the robot cannot be put above the obstacles, or is not at rest
///                             after 5 s. The message says where it is then.
std::vector<double> RestPose(const Scene& scene, std::vector<double> q);

}  // namespace tumbler
