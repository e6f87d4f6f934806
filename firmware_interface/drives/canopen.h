#pragma once

#include <array>
#include <cstdint>

#include "common/status.h"
#include "firmware_interface/can/frame.h"

namespace tumbler {

/// The services of CANopen (CiA 301) that a motion host needs: identifiers of the predefined
/// connection set, NMT, SYNC, heartbeat, EMCY and expedited SDO transfers. Payloads are
/// little-endian. Nodes are 1 ... 127.

inline constexpr std::uint8_t kCanOpenNodeMax = 127;

/// Identifiers: function + node.
namespace canopen_id {
inline constexpr std::uint32_t kNmt = 0x000;   ///< to all
inline constexpr std::uint32_t kSync = 0x080;  ///< to all
inline constexpr std::uint32_t kEmergency = 0x080;
inline constexpr std::uint32_t kTpdo1 = 0x180;
inline constexpr std::uint32_t kRpdo1 = 0x200;
inline constexpr std::uint32_t kTpdo2 = 0x280;
inline constexpr std::uint32_t kRpdo2 = 0x300;
inline constexpr std::uint32_t kSdoReply = 0x580;
inline constexpr std::uint32_t kSdoRequest = 0x600;
inline constexpr std::uint32_t kHeartbeat = 0x700;
}  // namespace canopen_id

enum class NmtCommand : std::uint8_t {
  kStart = 0x01,
  kStop = 0x02,
  kPreOperational = 0x80,
  kResetNode = 0x81,
  kResetCommunication = 0x82,
};
enum class NmtState : std::uint8_t {
  kBootUp = 0x00,
  kStopped = 0x04,
  kOperational = 0x05,
  kPreOperational = 0x7f,
};

/// @param node  0 for all.
[[nodiscard]] CanFrame EncodeNmt(NmtCommand command, std::uint8_t node) noexcept;
/// @retval kInvalidArgument  not an NMT frame to this node or to all with one of the commands.
Status DecodeNmt(std::uint8_t node, const CanFrame& frame, NmtCommand& command) noexcept;

[[nodiscard]] CanFrame EncodeSync() noexcept;
[[nodiscard]] bool IsSync(const CanFrame& frame) noexcept;  ///< With or without its counter byte.

[[nodiscard]] CanFrame EncodeNodeState(std::uint8_t node, NmtState state) noexcept;
/// @retval kInvalidArgument  not this node's heartbeat or boot-up, or a state that is none.
Status DecodeNodeState(std::uint8_t node, const CanFrame& frame, NmtState& state) noexcept;

/// EMCY; code 0 says that the error is gone.
struct CanOpenEmergency {
  std::uint16_t code = 0;
  std::uint8_t error_register = 0;
  std::array<std::uint8_t, 5> detail{};
};
inline constexpr std::uint16_t kEmergencyHeartbeat = 0x8130;       ///< heartbeat or life guard
inline constexpr std::uint16_t kEmergencyFollowingError = 0x8611;  ///< CiA 402
inline constexpr std::uint16_t kEmergencyGeneric = 0x1000;

[[nodiscard]] CanFrame EncodeEmergency(std::uint8_t node, const CanOpenEmergency& value) noexcept;
Status DecodeEmergency(std::uint8_t node, const CanFrame& frame, CanOpenEmergency& value) noexcept;

/// An expedited transfer of 1 ... 4 bytes to the node's object dictionary, or the wish to read one.
struct SdoRequest {
  bool write = true;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint8_t size = 0;    ///< of a write
  std::uint32_t value = 0;  ///< of a write
};
struct SdoReply {
  enum class Kind : std::uint8_t { kWritten, kRead, kAborted };
  Kind kind = Kind::kWritten;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint8_t size = 0;    ///< of what was read
  std::uint32_t value = 0;  ///< what was read, or the abort code
};

/// @pre a write has 1 ... 4 bytes.
[[nodiscard]] CanFrame EncodeSdoRequest(std::uint8_t node, const SdoRequest& value) noexcept;
[[nodiscard]] CanFrame EncodeSdoReply(std::uint8_t node, const SdoReply& value) noexcept;
/// @retval kInvalidArgument  not this node's, not of 8 bytes, or a transfer that is not expedited.
Status DecodeSdoRequest(std::uint8_t node, const CanFrame& frame, SdoRequest& value) noexcept;
Status DecodeSdoReply(std::uint8_t node, const CanFrame& frame, SdoReply& value) noexcept;

}  // namespace tumbler
