#pragma once

#include "firmware_interface/devices/drives_toml.h"
#include "offline/studies/recorded_motion.h"

namespace tumbler {

/// Makes a record one of the model of another, `base`: for that it is fitted, whatever its motion
/// was made for. The robot that is fitted is absolute, so that it does not matter which model it is
/// told by: motions that were made for an identified robot differ from others in what a fit
/// estimates.
/// @throws std::invalid_argument  naming both and what differs, where the models differ in more
///         than masses, centres of mass along the link's x, moments of inertia, lengths of links
///         and numbers of the ground's [contact].
void TakeModelOf(const RecordedMotion& base, RecordedMotion& record);

/// In words, where a scene's robot differs from another in more than masses, centres of mass along
/// the link's x, moments of inertia and lengths of links; empty: nowhere.
[[nodiscard]] std::string DifferenceOf(const Scene& scene, const PlanarRobot& robot);

/// Makes a record one that was made with the zeros of other drives of the same robot: what was read
/// and what drives were told is shifted by as much.
/// @pre both have the same joints
void TakeZerosOf(const DrivesConfig& drives, RecordedMotion& record);

}  // namespace tumbler
