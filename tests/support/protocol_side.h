#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <ostream>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "firmware_interface/can/frame.h"
#include "firmware_interface/drives/protocols.h"
#include "tests/support/frame_samples.h"
#include "tests/support/joint_judge.h"

namespace tumbler::testing {

/// What differs between protocols by their nature, and is documented.
struct ProtocolNature {
  bool carries_gains = false;    ///< With every setpoint; otherwise they are the drive's own.
  bool clears_errors = true;     ///< There is an order to clear the drive's errors.
  bool latches_watchdog = true;  ///< After the host's silence the drive stays off.
  bool says_temperature = true;
  bool follows_in_error = false;  ///< What the host orders goes out while a drive has an error.
  std::uint32_t error = 2;        ///< A code that its drives may have.
};

/// The tests' view of a protocol, from the wire and without the host's code: what every test "with
/// every protocol" needs to know of one. Each is in tests/support/protocols/, in a file that has
/// the name of the protocol's own.
class ProtocolSide {
 public:
  ProtocolSide() = default;
  ProtocolSide(const ProtocolSide&) = delete;
  ProtocolSide& operator=(const ProtocolSide&) = delete;
  virtual ~ProtocolSide() = default;

  [[nodiscard]] virtual ProtocolNature nature() const = 0;
  [[nodiscard]] virtual WireSteps StepsOf(const DriveConfig& drive) const = 0;
  /// Watches the frames of a drive for the judge.
  [[nodiscard]] virtual std::unique_ptr<DriveWatch> Watch(const DriveConfig& drive,
                                                          JointJudge& joint) const = 0;

  /// Identifiers of a drive's frames: with its measured positions, its heartbeat (0: it has none),
  /// the setpoint's position, and its feed-forward torque.
  [[nodiscard]] virtual std::uint32_t PositionId(const DriveConfig& drive) const = 0;
  [[nodiscard]] virtual std::uint32_t HeartbeatId(const DriveConfig& /*drive*/) const { return 0; }
  [[nodiscard]] virtual std::uint32_t SetpointId(const DriveConfig& drive) const = 0;
  [[nodiscard]] virtual std::uint32_t TorqueId(const DriveConfig& drive) const {
    return SetpointId(drive);
  }
  /// Of the frame without which the drive is not enabled; 0: one that is lost costs a tick or so.
  [[nodiscard]] virtual std::uint32_t EnableId(const DriveConfig& /*drive*/) const { return 0; }

  /// The host's order to take the torque away.
  [[nodiscard]] virtual CanFrame TorqueOff(const DriveConfig& drive) const = 0;
  /// What somebody else may send so that the drive drops out and says so; nothing where it does not
  /// say.
  [[nodiscard]] virtual std::optional<CanFrame> DropOut(const DriveConfig& /*drive*/) const {
    return std::nullopt;
  }
  /// A measured position that is not a number; nothing where the wire has none.
  [[nodiscard]] virtual std::optional<CanFrame> NotANumber(const DriveConfig& /*drive*/) const {
    return std::nullopt;
  }
  /// Has the drive say often what it says rarely, for short tests.
  virtual void Hasten(DriveConfig& /*drive*/) const {}

  /// Spoils a setpoint's position, a reply's, by 0.05 to 1 rad; a feed-forward torque, beyond its
  /// limit.
  virtual void SpoilSetpoint(CanFrame& frame) const = 0;
  virtual void SpoilReply(CanFrame& frame) const = 0;
  virtual void SpoilTorque(CanFrame& frame) const = 0;

  /// Adds one frame of each kind, of random values, for holding the .dbc file against the codec.
  virtual void AddSamples(FrameSamples& samples) const = 0;
};

/// What the test side of a protocol is found by: `SideOf(SideTag<MitProtocol>{})`.
template <typename Protocol>
struct SideTag {
// Each protocol defines the function for itself alone, which g++ takes for a mistake.
#pragma GCC diagnostic push
#ifndef __clang__
#pragma GCC diagnostic ignored "-Wnon-template-friend"
#endif
  friend const ProtocolSide& SideOf(SideTag<Protocol>);
#pragma GCC diagnostic pop
};

/// A protocol as tests take it for a parameter.
struct TestedProtocol {
  std::string name;    ///< of its files
  std::string drives;  ///< Its example, from the project's folder.
  const ProtocolSide* side = nullptr;
};
/// Every protocol that is listed in drives/protocols.h.
const std::vector<TestedProtocol>& EveryProtocol();
void PrintTo(const TestedProtocol& protocol, std::ostream* out);

const ProtocolSide& SideOf(const DriveConfig& drive);

}  // namespace tumbler::testing
