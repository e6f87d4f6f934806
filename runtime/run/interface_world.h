#pragma once

#include <memory>
#include <string>
#include <vector>

#include "firmware_interface/devices/drives_toml.h"
#include "runtime/run/world.h"

namespace tumbler {

/// A SocketCAN interface with drives on it.
struct InterfaceName {
  std::string interface;    ///< e.g. `can0`
  std::string drives_file;  ///< The file that describes the drives, for messages.
  double pace = 1;          ///< Seconds of the robot in a second of the clock; 1 on a real bus.
};

/// The world of the interface in real time, for the one program that drives its motors: it holds
/// the interface's lock.
/// @throws Refused  when another program holds the lock, the interface runs at another bit rate
/// than the drives, or a real bus is asked to keep another pace than the clock's.
/// @throws std::runtime_error  when the interface cannot be used.
std::unique_ptr<World> MakeInterfaceWorld(const InterfaceName& name, const DrivesConfig& drives);

/// The world of a dry run, in virtual time: nothing is sent to the interface, frames are printed on
/// standard output as candump logs them, and imagined drives follow perfectly. If the interface is
/// there, its bit rate has to be that of the drives.
/// @param start_rad  the imagined positions of the joints at the start, one for each drive.
std::unique_ptr<World> MakeDryRunWorld(const InterfaceName& name, const DrivesConfig& drives,
                                       const std::vector<double>& start_rad);

}  // namespace tumbler
