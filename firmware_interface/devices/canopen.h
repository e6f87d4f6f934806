#pragma once

#include <array>
#include <cstdint>

#include "common/core/status.h"
#include "firmware_interface/can/frame.h"

namespace tumbler {

/// The services of CANopen (CiA 301) that a motion host needs: identifiers of the predefined
/// connection set, NMT, SYNC, heartbeat, EMCY and expedited SDO transfers. Payloads are
/// little-endian. Nodes are 1 ... 127.

inline constexpr std::uint8_t kCanOpenNodeMax = 127;

/// Identifiers of frames: one of these plus the node's number, except NMT, SYNC and LSS, which go
/// to all nodes.
namespace canopen_id {
inline constexpr std::uint32_t kNmt = 0x000;
inline constexpr std::uint32_t kSync = 0x080;
inline constexpr std::uint32_t kEmergency = 0x080;
inline constexpr std::uint32_t kTpdo1 = 0x180;
inline constexpr std::uint32_t kRpdo1 = 0x200;
inline constexpr std::uint32_t kTpdo2 = 0x280;
inline constexpr std::uint32_t kRpdo2 = 0x300;
inline constexpr std::uint32_t kRpdo3 = 0x400;
inline constexpr std::uint32_t kRpdo4 = 0x500;
inline constexpr std::uint32_t kSdoReply = 0x580;
inline constexpr std::uint32_t kSdoRequest = 0x600;
inline constexpr std::uint32_t kHeartbeat = 0x700;
inline constexpr std::uint32_t kLssRequest = 0x7e5;  ///< CiA 305: numbers and bit rates of nodes.
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

/// @param node  0 for all nodes.
[[nodiscard]] CanFrame EncodeNmt(NmtCommand command, std::uint8_t node) noexcept;
/// @retval kInvalidArgument  no NMT frame, for another node, or with an unknown command.
Status DecodeNmt(std::uint8_t node, const CanFrame& frame, NmtCommand& command) noexcept;

[[nodiscard]] CanFrame EncodeSync() noexcept;
/// Whether the frame is a SYNC, with or without the counter byte.
[[nodiscard]] bool IsSync(const CanFrame& frame) noexcept;

/// The heartbeat of a node, or its boot-up message.
[[nodiscard]] CanFrame EncodeNodeState(std::uint8_t node, NmtState state) noexcept;
/// @retval kInvalidArgument  no heartbeat or boot-up of this node, or with an unknown state.
Status DecodeNodeState(std::uint8_t node, const CanFrame& frame, NmtState& state) noexcept;

/// The content of an EMCY message. Code 0 means that the error is gone.
struct CanOpenEmergency {
  std::uint16_t code = 0;
  std::uint8_t error_register = 0;
  std::array<std::uint8_t, 5> detail{};
};
inline constexpr std::uint16_t kEmergencyHeartbeat = 0x8130;       ///< Heartbeat or life guard.
inline constexpr std::uint16_t kEmergencyFollowingError = 0x8611;  ///< Of CiA 402.
inline constexpr std::uint16_t kEmergencyGeneric = 0x1000;

[[nodiscard]] CanFrame EncodeEmergency(std::uint8_t node, const CanOpenEmergency& value) noexcept;
Status DecodeEmergency(std::uint8_t node, const CanFrame& frame, CanOpenEmergency& value) noexcept;

/// A request to write 1 ... 4 bytes to a node's object dictionary (an expedited transfer), or to
/// read an object.
struct SdoRequest {
  bool write = true;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint8_t size = 0;    ///< Bytes to write.
  std::uint32_t value = 0;  ///< To write.
};
/// The node's answer to an SdoRequest.
struct SdoReply {
  enum class Kind : std::uint8_t { kWritten, kRead, kAborted };
  Kind kind = Kind::kWritten;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint8_t size = 0;    ///< Bytes that were read.
  std::uint32_t value = 0;  ///< The value that was read, or the abort code.
};

/// @pre a write has 1 ... 4 bytes.
[[nodiscard]] CanFrame EncodeSdoRequest(std::uint8_t node, const SdoRequest& value) noexcept;
[[nodiscard]] CanFrame EncodeSdoReply(std::uint8_t node, const SdoReply& value) noexcept;
/// @retval kInvalidArgument  for another node, not of 8 bytes, or no expedited transfer.
Status DecodeSdoRequest(std::uint8_t node, const CanFrame& frame, SdoRequest& value) noexcept;
Status DecodeSdoReply(std::uint8_t node, const CanFrame& frame, SdoReply& value) noexcept;

}  // namespace tumbler
