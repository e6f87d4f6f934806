#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/can/socketcan_bus.h"
#include "firmware_interface/drives/drives_toml.h"
#include "firmware_interface/drives/simulated_drive.h"

namespace tumbler {

/// A simulated drive with a name.
struct ServedDrive {
  std::string joint;
  const SimulatedDrive* drive = nullptr;
};

/// Puts the drives of a simulated bus on a SocketCAN interface, in real time: frames that arrive
/// there go onto the simulated bus at the time at which they came, and what the drives send goes
/// out. Says on standard output, with the time as candump gives it, when a drive is enabled or
/// disabled, and when its watchdog takes over.
///
/// A pause of the program delays answers, but does not starve the drives' watchdogs. An interface
/// that goes down or away is waited for.
class DriveServer {
 public:
  /// @param pace     how much time passes for the drives in a second of the clock, above 0: below 1
  /// for a host that counts its time likewise, on a machine that cannot keep up.
  /// @param bus      that the drives are attached to; with room for one more node.
  /// @param advance  moves the bus, and what its drives move, on to a time. Times begin at 0 with
  /// the server.
  /// @throws std::runtime_error when the interface cannot be used.
  DriveServer(const std::string& interface, const DrivesConfig& config, SimulatedBus& bus,
              std::vector<ServedDrive> drives, std::function<void(std::int64_t)> advance,
              double pace = 1);

  /// Serves until this time, at the latest; returns earlier where frames came. Afterwards the
  /// simulation has reached `now_ns()`.
  void ServeUntil(std::int64_t time_ns);
  /// Time of the drives since the server was made.
  [[nodiscard]] std::int64_t now_ns() const;

  /// One line on standard output, after the time.
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
  SimulatedPort& gateway_;
  std::vector<Watched> drives_;
  std::function<void(std::int64_t)> advance_;
  SocketCanBus bus_;
  double pace_;
  std::int64_t start_ns_ = 0;    // on CLOCK_MONOTONIC
  std::int64_t reached_ns_ = 0;  // by the simulation
  std::int64_t heard_ns_ = 0;    // the last frame came
  bool lost_ = false;
};

}  // namespace tumbler
