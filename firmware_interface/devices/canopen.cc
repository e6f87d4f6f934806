#include "firmware_interface/devices/canopen.h"

#include "firmware_interface/devices/wire.h"

namespace tumbler {

namespace {

bool Is(const CanFrame& frame, std::uint32_t id, std::uint8_t size) noexcept {
  return frame.id == id && !frame.extended && !frame.remote && frame.size == size;
}

// The first byte of an expedited transfer that states its size: ccs/scs << 5 | (4 - size) << 2 | 3.
constexpr std::uint8_t Specifier(std::uint8_t service, std::uint8_t size) noexcept {
  return static_cast<std::uint8_t>(service << 5 | (4 - size) << 2 | 3);
}
constexpr bool IsExpedited(std::uint8_t byte, std::uint8_t service) noexcept {
  return byte >> 5 == service && (byte & 3) == 3;
}
constexpr std::uint8_t SizeOf(std::uint8_t byte) noexcept {
  return static_cast<std::uint8_t>(4 - (byte >> 2 & 3));
}

void StoreObject(CanFrame& frame, std::uint16_t index, std::uint8_t sub,
                 std::uint32_t value) noexcept {
  StoreLittle(frame.data, 1, 2, index);
  frame.data[3] = sub;
  StoreLittle(frame.data, 4, 4, value);
}

constexpr std::uint32_t Low(std::uint32_t value, std::uint8_t bytes) noexcept {
  return bytes >= 4 ? value : value & ((1U << (8 * bytes)) - 1U);
}

}  // namespace

CanFrame EncodeNmt(NmtCommand command, std::uint8_t node) noexcept {
  CanFrame frame = DataFrame(canopen_id::kNmt, 2);
  frame.data[0] = static_cast<std::uint8_t>(command);
  frame.data[1] = node;
  return frame;
}

Status DecodeNmt(std::uint8_t node, const CanFrame& frame, NmtCommand& command) noexcept {
  if (!Is(frame, canopen_id::kNmt, 2) || (frame.data[1] != 0 && frame.data[1] != node)) {
    return Status::kInvalidArgument;
  }
  switch (const auto given = static_cast<NmtCommand>(frame.data[0])) {
    case NmtCommand::kStart:
    case NmtCommand::kStop:
    case NmtCommand::kPreOperational:
    case NmtCommand::kResetNode:
    case NmtCommand::kResetCommunication:
      command = given;
      return Status::kOk;
  }
  return Status::kInvalidArgument;
}

CanFrame EncodeSync() noexcept { return DataFrame(canopen_id::kSync, 0); }

bool IsSync(const CanFrame& frame) noexcept {
  return Is(frame, canopen_id::kSync, 0) || Is(frame, canopen_id::kSync, 1);
}

CanFrame EncodeNodeState(std::uint8_t node, NmtState state) noexcept {
  CanFrame frame = DataFrame(canopen_id::kHeartbeat + node, 1);
  frame.data[0] = static_cast<std::uint8_t>(state);
  return frame;
}

Status DecodeNodeState(std::uint8_t node, const CanFrame& frame, NmtState& state) noexcept {
  if (!Is(frame, canopen_id::kHeartbeat + node, 1)) return Status::kInvalidArgument;
  switch (const auto given = static_cast<NmtState>(frame.data[0])) {
    case NmtState::kBootUp:
    case NmtState::kStopped:
    case NmtState::kOperational:
    case NmtState::kPreOperational:
      state = given;
      return Status::kOk;
  }
  return Status::kInvalidArgument;
}

CanFrame EncodeEmergency(std::uint8_t node, const CanOpenEmergency& value) noexcept {
  CanFrame frame = DataFrame(canopen_id::kEmergency + node, 8);
  StoreLittle(frame.data, 0, 2, value.code);
  frame.data[2] = value.error_register;
  for (std::size_t i = 0; i < value.detail.size(); ++i) frame.data[3 + i] = value.detail[i];
  return frame;
}

Status DecodeEmergency(std::uint8_t node, const CanFrame& frame, CanOpenEmergency& value) noexcept {
  if (!Is(frame, canopen_id::kEmergency + node, 8)) return Status::kInvalidArgument;
  value.code = static_cast<std::uint16_t>(LoadLittle(frame.data, 0, 2));
  value.error_register = frame.data[2];
  for (std::size_t i = 0; i < value.detail.size(); ++i) value.detail[i] = frame.data[3 + i];
  return Status::kOk;
}

CanFrame EncodeSdoRequest(std::uint8_t node, const SdoRequest& value) noexcept {
  CanFrame frame = DataFrame(canopen_id::kSdoRequest + node, 8);
  frame.data[0] = value.write ? Specifier(1, value.size) : std::uint8_t{2 << 5};
  StoreObject(frame, value.index, value.sub, value.write ? Low(value.value, value.size) : 0);
  return frame;
}

Status DecodeSdoRequest(std::uint8_t node, const CanFrame& frame, SdoRequest& value) noexcept {
  if (!Is(frame, canopen_id::kSdoRequest + node, 8)) return Status::kInvalidArgument;
  const std::uint8_t specifier = frame.data[0];
  const bool write = IsExpedited(specifier, 1);
  if (!write && specifier >> 5 != 2) return Status::kInvalidArgument;
  value.write = write;
  value.index = static_cast<std::uint16_t>(LoadLittle(frame.data, 1, 2));
  value.sub = frame.data[3];
  value.size = write ? SizeOf(specifier) : std::uint8_t{0};
  value.value = write ? LoadLittle(frame.data, 4, value.size) : 0;
  return Status::kOk;
}

CanFrame EncodeSdoReply(std::uint8_t node, const SdoReply& value) noexcept {
  CanFrame frame = DataFrame(canopen_id::kSdoReply + node, 8);
  std::uint32_t content = 0;
  switch (value.kind) {
    case SdoReply::Kind::kWritten:
      frame.data[0] = 3 << 5;
      break;
    case SdoReply::Kind::kRead:
      frame.data[0] = Specifier(2, value.size);
      content = Low(value.value, value.size);
      break;
    case SdoReply::Kind::kAborted:
      frame.data[0] = 4 << 5;
      content = value.value;
      break;
  }
  StoreObject(frame, value.index, value.sub, content);
  return frame;
}

Status DecodeSdoReply(std::uint8_t node, const CanFrame& frame, SdoReply& value) noexcept {
  if (!Is(frame, canopen_id::kSdoReply + node, 8)) return Status::kInvalidArgument;
  const std::uint8_t specifier = frame.data[0];
  SdoReply reply;
  if (specifier >> 5 == 3) {
    reply.kind = SdoReply::Kind::kWritten;
  } else if (IsExpedited(specifier, 2)) {
    reply.kind = SdoReply::Kind::kRead;
    reply.size = SizeOf(specifier);
    reply.value = LoadLittle(frame.data, 4, reply.size);
  } else if (specifier >> 5 == 4) {
    reply.kind = SdoReply::Kind::kAborted;
    reply.value = LoadLittle(frame.data, 4, 4);
  } else {
    return Status::kInvalidArgument;
  }
  reply.index = static_cast<std::uint16_t>(LoadLittle(frame.data, 1, 2));
  reply.sub = frame.data[3];
  value = reply;
  return Status::kOk;
}

}  // namespace tumbler
