#pragma once

#include <span>
#include <vector>

#include "offline/scene/scene.h"

namespace tumbler {

/// The height of the root at which the robot just touches the obstacles [m].
/// @param q  positions of all degrees of freedom [m, rad]; the root's height is not used.
/// @throws std::runtime_error  when the robot cannot be put above the obstacles.
double TouchingHeight(const Scene& scene, const std::vector<double>& q);

/// How far the centre of mass of a robot on a bar has turned about the bar from straight below it
/// [rad], -pi to pi. 0 where it is on the bar.
/// @param q  positions of all degrees of freedom [m, rad].
/// @pre The root is hinged.
double TurnFromHanging(const Scene& scene, std::span<const double> q);

/// The pitch nearest to that of q at which a robot on a bar is at rest with its joints held [rad]:
/// its centre of mass is straight below the bar, where it stays, or straight above, where it tips.
/// @param q  positions of all degrees of freedom [m, rad].
/// @pre The root is hinged.
double RestingPitch(const Scene& scene, std::span<const double> q);

/// Finds the pose in which the robot rests on the obstacles. A simulation puts the robot just above
/// them, lets it go, and holds its joints until nothing moves any more, or, on a slope, until it
/// only creeps along the ground as the law of friction allows.
/// @param q  positions of all degrees of freedom [m, rad]. Joints with a motor keep theirs. Passive
///           ones and the root's x and pitch begin with these, and change as the robot settles; the
///           root's height is not used.
/// @pre The root is planar, and all joints but the passive ones are prescribed.
/// @returns positions of all degrees of freedom at rest.
/// @throws std::runtime_error  when the robot cannot be put above the obstacles, or is not at rest
///                             after 5 s (20 s where joints are passive). The message says where it
///                             is then.
std::vector<double> RestPose(const Scene& scene, std::vector<double> q);

}  // namespace tumbler
