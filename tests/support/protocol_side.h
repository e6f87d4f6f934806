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
#include "firmware_interface/devices/protocols.h"
#include "tests/support/frame_samples.h"
#include "tests/support/joint_judge.h"

namespace tumbler::testing {

/// Documented differences that lie in the nature of the protocols.
struct ProtocolNature {
  bool carries_gains = false;    ///< Setpoints carry gains; otherwise the drive has its own.
  bool clears_errors = true;     ///< There is an order to clear the drive's errors.
  bool latches_watchdog = true;  ///< After the host's silence the drive stays off.
  bool says_temperature = true;
  bool answers = true;            ///< Each setpoint is answered; else drives report by a clock.
  bool follows_in_error = false;  ///< The host's orders go out even while a drive has an error.
  std::uint32_t error = 2;        ///< An error code that its drives may have.
};

/// A protocol as tests see it: from the wire, without the code of the host. Everything that the
/// tests "with every protocol" have to know of one is here. The protocols are in
/// tests/support/protocols/, in files with the names of their source files.
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

  /// Identifiers of a drive's frames with its measured positions, its heartbeat (0: there is none),
  /// the position of the setpoint, and the feed-forward torque.
  [[nodiscard]] virtual std::uint32_t PositionId(const DriveConfig& drive) const = 0;
  [[nodiscard]] virtual std::uint32_t HeartbeatId(const DriveConfig& /*drive*/) const { return 0; }
  [[nodiscard]] virtual std::uint32_t SetpointId(const DriveConfig& drive) const = 0;
  [[nodiscard]] virtual std::uint32_t TorqueId(const DriveConfig& drive) const {
    return SetpointId(drive);
  }
  /// Identifier of the frame without which the drive is not enabled. 0: there is none, and a lost
  /// frame only delays by about a tick.
  [[nodiscard]] virtual std::uint32_t EnableId(const DriveConfig& /*drive*/) const { return 0; }

  /// The host's order for torque off.
  [[nodiscard]] virtual CanFrame TorqueOff(const DriveConfig& drive) const = 0;
  /// A command of somebody else, after which the drive goes on as the host tells it.
  [[nodiscard]] virtual CanFrame StrangersCommand(const DriveConfig& drive) const = 0;
  /// A frame of somebody else that makes the drive drop out and report it. None if it does not
  /// report that.
  [[nodiscard]] virtual std::optional<CanFrame> DropOut(const DriveConfig& /*drive*/) const {
    return std::nullopt;
  }
  /// A measured position that is not a number. None if the wire cannot carry one.
  [[nodiscard]] virtual std::optional<CanFrame> NotANumber(const DriveConfig& /*drive*/) const {
    return std::nullopt;
  }
  /// Makes rare reports of the drive frequent, for short tests.
  virtual void Hasten(DriveConfig& /*drive*/) const {}

  /// Spoil the position of a setpoint or of a reply by 0.05 to 1 rad, or put the feed-forward
  /// torque beyond its limit.
  virtual void SpoilSetpoint(CanFrame& frame) const = 0;
  virtual void SpoilReply(CanFrame& frame) const = 0;
  virtual void SpoilTorque(CanFrame& frame) const = 0;

  /// Adds one frame of each kind, with random values, to compare the .dbc file with the codec.
  virtual void AddSamples(FrameSamples& samples) const = 0;
  /// Checks how the protocol's codec takes a frame of any content. @returns the problem, or null.
  [[nodiscard]] virtual const char* CodecProblem(const CanFrame& frame) const = 0;
};

/// Selects the test side of a protocol: `SideOf(SideTag<MitProtocol>{})`.
template <typename Protocol>
struct SideTag {
// Each protocol defines its own overload elsewhere, which g++ takes for a mistake.
#pragma GCC diagnostic push
#ifndef __clang__
#pragma GCC diagnostic ignored "-Wnon-template-friend"
#endif
  friend const ProtocolSide& SideOf(SideTag<Protocol>);
#pragma GCC diagnostic pop
};

/// A protocol as the parameter of a test.
struct TestedProtocol {
  std::string name;    ///< The name of its source files.
  std::string drives;  ///< Its example drives file, relative to the project's folder.
  const ProtocolSide* side = nullptr;
};
/// Every protocol that is listed in devices/protocols.h.
const std::vector<TestedProtocol>& EveryProtocol();
void PrintTo(const TestedProtocol& protocol, std::ostream* out);

const ProtocolSide& SideOf(const DriveConfig& drive);

}  // namespace tumbler::testing
