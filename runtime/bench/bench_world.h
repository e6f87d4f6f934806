#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "firmware_interface/can/bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/clock.h"

namespace tumbler {

/// What somebody who stands beside a simulated robot can see and do.
class SimulatedHands {
 public:
  SimulatedHands() = default;
  SimulatedHands(const SimulatedHands&) = delete;
  SimulatedHands& operator=(const SimulatedHands&) = delete;
  virtual ~SimulatedHands() = default;
  /// The joints that the robot really has.
  [[nodiscard]] virtual const std::vector<std::string>& joints() const = 0;
  /// The true angle of a joint [rad].
  [[nodiscard]] virtual double AngleOf(std::size_t joint) const = 0;
  /// Turns a joint to a true angle, where it stays at rest until its drive moves it.
  virtual void Turn(std::size_t joint, double angle_rad) = 0;
};

/// What the bench counts of a bus that is out of order, since it was opened.
struct BusTrouble {
  std::int64_t error_frames = 0;  ///< As far as the host's controller reports them.
  std::int64_t dropped = 0;       ///< Frames that came and found no room.
};

/// A bus with drives on it, and the clock that goes with it.
class BenchWorld {
 public:
  BenchWorld() = default;
  BenchWorld(const BenchWorld&) = delete;
  BenchWorld& operator=(const BenchWorld&) = delete;
  virtual ~BenchWorld() = default;
  virtual CanBus& bus() = 0;
  virtual Clock& clock() = 0;
  [[nodiscard]] virtual BusTrouble trouble() const = 0;
  /// Null where the robot is real.
  [[nodiscard]] virtual SimulatedHands* hands() { return nullptr; }
  [[nodiscard]] bool simulated() { return hands() != nullptr; }
};

/// A SocketCAN interface, for the one program that may send to its drives: it holds the interface's
/// lock, and hears every frame.
/// @param drives   its bit rate has to be that of the interface, where the kernel knows it; null:
///                 no drives file was given.
/// @param driving  whether motors will be driven, so that frames that are out of date are
///                 discarded.
/// @throws Refused  when another program holds the lock, or the bit rates differ.
/// @throws std::runtime_error  when the interface cannot be used.
std::unique_ptr<BenchWorld> MakeInterfaceBench(const std::string& interface,
                                               const DrivesConfig* drives, bool driving);

/// How a simulated bench is set up.
struct SimulatedBenchConfig {
  DrivesConfig drives;  ///< The drives as they are, whatever the drives file of the bench says.
  /// True angles of the joints at the start [rad]; joints that are not named begin at 0.
  std::vector<std::pair<std::string, double>> positions;
  std::string bus_faults;  ///< File that disturbs the bus; empty: none.
};

/// Simulated drives on a simulated bus in virtual time. Each turns a rotor of its own, like motors
/// on a bench without the robot. @throws FileError about the file of bus faults.
std::unique_ptr<BenchWorld> MakeSimulatedBench(const SimulatedBenchConfig& config);

}  // namespace tumbler
