#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/can/socketcan_bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/simulated_drive.h"

namespace tumbler {

/// A simulated drive with a name.
struct ServedDrive {
  std::string joint;
  const SimulatedDrive* drive = nullptr;
};

/// Puts the drives of a simulated bus on a SocketCAN interface, in real time. Frames that arrive at
/// the interface go onto the simulated bus at the time at which they came; frames of the drives go
/// out when their last bit does, as nearly as the machine wakes the server. On standard output the
/// server says when a drive is enabled or disabled, and when its watchdog takes over, with the time
/// as candump gives it.
///
/// A pause of the program delays answers, but does not starve the drives' watchdogs. The server
/// waits for an interface that goes down or away.
class DriveServer {
 public:
  /// @param bus      has the drives attached, and room for one more node.
  /// @param advance  moves the bus, and what its drives move, on to a time [ns] since the server
  ///                 was made.
  /// @param pace     seconds of the drives in a second of the clock, above 0. A value below 1 helps
  ///                 a machine that cannot keep up; the host has to count its time likewise.
  /// @throws std::runtime_error  when the interface cannot be used.
  DriveServer(const std::string& interface, const DrivesConfig& config, SimulatedBus& bus,
              std::vector<ServedDrive> drives, std::function<void(std::int64_t)> advance,
              double pace = 1);

  /// Serves until this time at the latest, and returns earlier when frames came. Afterwards the
  /// simulation has reached the time at which it looked for them.
  void ServeUntil(std::int64_t time_ns);
  /// Time of the drives since the server was made.
  [[nodiscard]] std::int64_t now_ns() const;

  /// Prints one line on standard output, with the time before it.
  static void Say(std::string_view what);

 private:
  struct Watched {
    ServedDrive served;
    bool enabled = false;
    bool limp = false;
  };
  [[nodiscard]] std::int64_t TimeAt(std::int64_t monotonic_ns) const;
  void AdvanceTo(std::int64_t time_ns);
  void Tell(Watched& watched) const;
  static SimulatedPortConfig GatewayConfig();
  static SocketCanConfig InterfaceConfig(const DrivesConfig& drives);

  std::string interface_;
  SocketCanConfig interface_config_;
  const SimulatedBus& drives_bus_;
  SimulatedPort& gateway_;
  std::vector<Watched> drives_;
  std::function<void(std::int64_t)> advance_;
  SocketCanBus bus_;
  double pace_;
  std::int64_t start_ns_ = 0;    // on CLOCK_MONOTONIC
  std::int64_t reached_ns_ = 0;  // time of the simulation
  std::int64_t heard_ns_ = 0;    // time of the last frame
  bool lost_ = false;
};

}  // namespace tumbler
