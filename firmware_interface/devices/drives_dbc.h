#pragma once

#include <string>
#include <string_view>

#include "firmware_interface/devices/drives_toml.h"

namespace tumbler {

/// The frames of a robot's own drives, for bus analysers: a DBC file with the messages of each
/// drive under its own identifiers, `JOINT_MESSAGE`, and what a MIT or AK V3 drive packs into
/// fields in its own ranges. Messages that all drives of a protocol share appear once. Values are
/// those at the drive's shaft: direction, gear and zero are the host's. An inertial sensor is not
/// in it.
///
/// Where an MIT drive answers on the identifier of its commands, only the commands are described,
/// since a DBC file has one message for an identifier.
///
/// It is made from the description of each protocol in firmware_interface/devices/dbc/.
std::string DrivesDbc(const DrivesConfig& drives);

/// Lines of a DBC file about a signal.
struct DbcLine {
  std::string text;
};

/// A signal's line of a DBC file with another range.
/// @param steps  of the wire, by which the range is divided.
std::string WithScale(std::string_view line, const DriveRange& range, double steps);

}  // namespace tumbler
