#pragma once

#include <optional>
#include <string>

#include "offline/model/urdf_writer.h"

namespace tumbler {

/// Whether the outermost element of a file is `<sdf>`. False, too, where it has none.
/// @throws FileError  when it cannot be read.
bool IsSdf(const std::string& path);

/// Reads a robot of SDF, the files of Gazebo, by libsdformat, in the pose in which all joints are
/// at zero.
///
/// The one model that has joints is taken, or the first where none has; others are noted. Links
/// and joints of models in it are its own, with the names that SDF has for them, `ARM::hand`. Poses
/// may be relative to any frame, and axes expressed in one. The frame of a link is that of the
/// joint that carries it. A joint on `world`, and `<static>`, fix the root to the link `world`.
///
/// Joints that are neither revolute, continuous, prismatic nor fixed keep their type, as which
/// `ParseRobot` holds them. A joint whose ends are 1e15 or more in size, or not there, is
/// continuous, or slides by 1000 m; where one is there, the other is 1000 beyond it or beyond zero,
/// which is noted. What an inertial has not is that of SDF, 1 kg and 1 kg m^2, which is noted.
///
/// Noted, and not in the URDF: materials, plugins, sensors, lights, springs, surfaces, and shapes
/// that a URDF has not, and `<mimic>`; also what the library warns of, such as unknown elements,
/// and a version above 1.9, the last that it knows.
///
/// An `<include>` is looked for in the file's folder and in those above it, with and without
/// `model://`, and never in a network. A mesh of `model://` is one of `package://`.
/// @param velocity  the limit of joints that have none [rad/s, m/s].
/// @throws FileError  with line and name: the library does not take the file, its version is
/// missing or below 1.2, there is no model or several have joints, a file includes itself, there
/// are more than 3000 frames, a text is not the numbers that it should be, or not finite, a size is
/// not above 0, an axis has no direction, ends of a joint are in the wrong order, an inertial is
/// `auto`, or links and joints are not one tree.
/// @throws std::runtime_error  when this build has no libsdformat.
TranslatedRobot ReadSdf(const std::string& path, std::optional<double> velocity);

}  // namespace tumbler
