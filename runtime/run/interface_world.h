#pragma once

#include <memory>
#include <string>
#include <vector>

#include "firmware_interface/drives/drives_toml.h"
#include "runtime/run/world.h"

namespace tumbler {

/// A SocketCAN interface, and where the drives on it are described, for messages.
struct InterfaceName {
  std::string interface;
  std::string drives_file;
  double pace = 1;  ///< Seconds of the robot in a second of the clock; 1 on a real bus.
};

/// The interface itself in real time, for the one program that drives its motors.
/// @throws Refused when the interface runs at another bit rate than the drives, or a real bus is
///         to keep another pace than the clock's;
///         std::runtime_error when it cannot be used.
std::unique_ptr<World> MakeInterfaceWorld(const InterfaceName& name, const DrivesConfig& drives);

/// Stands for the interface, in virtual time: nothing is sent; frames are printed on standard
/// output as candump logs them, and imagined drives follow perfectly. The interface has to be there
/// all the same.
/// @param start_rad  where the joints are imagined to be, one for each drive.
std::unique_ptr<World> MakeDryRunWorld(const InterfaceName& name, const DrivesConfig& drives,
                                       const std::vector<double>& start_rad);

}  // namespace tumbler
