#pragma once

#include <string>

#include "offline/problem/simulated_motion.h"

namespace tumbler {

/// How far the lowest point of a robot is above what it stands on [m], along z: how far it has to
/// be lowered until a shape touches an obstacle. Negative where one penetrates. Infinite without
/// obstacles below.
///
/// In a primitive's entry pose it is not zero: our contact begins in a compliant layer above the
/// surface, in which feet rest some millimetres high. A simulator with rigid ground drops the robot
/// by so much.
double ClearanceAt(const Scene& scene, std::span<const double> q);

/// The robot, the ground and the start of a motion as MJCF, the format of MuJoCo.
///
/// The robot moves in the x-z plane: x right, z up, angles positive from +x towards +z (axis -y).
/// Bodies have the masses, and the moments about y, of the plan; rotors' inertia is `armature`,
/// friction of motors `damping` and `frictionloss`. Each motor is an actuator that obeys a drive's
/// law: torque = ctrl - kp q - kd q', within the joint's limit, with ctrl = kp position + kd
/// velocity + feed-forward, which SetpointsCsv has ready. Shapes are those of contact; only their
/// contacts with obstacles count, as in the plan. Contacts are MuJoCo's own, with its defaults; of
/// ours only mu is in the file. The key frame `start` is the entry pose, lowered until it touches.
///
/// Of a robot in space the root is a body with a free joint, and shapes have their full extents.
/// @param gains  of the drives.
/// @throws FileError  when a primitive's texts cannot be used.
std::string ToMjcf(const SimulatedMotion& motion, const DriveGains& gains);
/// That of a robot in the plane which differs from the motion's, with the same links and joints.
std::string ToMjcf(const SimulatedMotion& motion, const Scene& scene, const DriveGains& gains);
/// That of a robot in space.
std::string ToMjcfInSpace(const SimulatedMotion& motion, const DriveGains& gains);

}  // namespace tumbler
