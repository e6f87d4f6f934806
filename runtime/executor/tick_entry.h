#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>

#include "common/core/primitive.h"
#include "common/core/status.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/drive.h"
#include "runtime/executor/joint_fields.h"
#include "runtime/executor/tick.h"
#include "runtime/executor/tick_fields.h"

namespace tumbler {

/// The loop's notes on a tick, beside the executor's inputs and outputs. Times are on the loop's
/// clock.
struct TickNotes {
  std::int64_t deadline_ns = 0;  ///< Of this tick.
  std::int64_t due_ns = 0;  ///< The time slept for: earlier than the deadline after missed periods.
  std::int64_t awake_ns = 0;     ///< Before frames were received.
  std::int64_t send_ns = 0;      ///< Before this tick's frames were handed to the bus.
  std::int64_t done_ns = 0;      ///< After everything was done.
  std::uint32_t request_id = 0;  ///< Of the operator's last request; see OperatorRequest.
  std::uint8_t request = 0;
  Refusal request_refusal = Refusal::kNone;
  Status sent_status = Status::kOk;  ///< Of handing this tick's frames to the bus.
  std::uint8_t sent_count = 0;       ///< Frames that the bus took, from the first on.
};

/// One tick in a flight record: all inputs of the executor, and all its outputs.
/// `executor.Tick(entry.input(), output)` on an executor in the state of that moment gives `frames`
/// and `record` again, bit for bit.
///
/// The encoding is part of the file format (docs/formats.md, block `tick`). Freestanding: no heap,
/// no exceptions, so that a microcontroller can replay a record too.
struct TickEntry {
  /// The most frames that the control loop takes in one tick.
  static constexpr std::size_t kReceivedMax = 128;

  std::int64_t index = 0;  ///< How many ticks were executed before, recorded or not.
  TickNotes notes;

  std::int64_t tick = 0;
  Status receive_status = Status::kOk;
  Status send_status = Status::kOk;  ///< Of the frames of the tick before, as in TickInput.
  OperatorCommand command = OperatorCommand::kNone;
  std::int8_t branch = -1;
  CanControllerState controller = CanControllerState::kErrorActive;
  std::size_t received_count = 0;
  std::array<ReceivedFrame, kReceivedMax> received;

  std::array<FrameBatch, kMaxJoints> frames;
  TickRecord record;

  /// The executor's input. It refers to this entry.
  [[nodiscard]] TickInput input() const noexcept {
    return {tick,           notes.deadline_ns, {received.data(), received_count},
            receive_status, send_status,       command,
            branch,         controller};
  }
};

/// Calls `visit(name, field)` for every field of a joint's record, in the order of the encoding.
/// Names are those of the members. Flight records hold, compare and export exactly these fields.
template <typename Joint, typename Visit>
constexpr void VisitFields(Joint& joint, Visit&& visit) noexcept requires
    std::is_same_v<std::remove_const_t<Joint>, JointRecord> {
  ForEachJointField([&](const JointField& field, auto in_record, auto /*in_message*/) {
    visit(field.name, in_record(joint));
  });
}

/// The same of a tick's record, without its joints.
template <typename Record, typename Visit>
constexpr void VisitFields(Record& record, Visit&& visit) noexcept requires
    std::is_same_v<std::remove_const_t<Record>, TickRecord> {
  ForEachRecordedField(record,
                       [&](const TickField& field, auto& member) { visit(field.record, member); });
}

static_assert(sizeof(TickInput) == 24 + sizeof(std::span<const ReceivedFrame>),
              "TickEntry has to have every member of TickInput");

/// The most bytes that an encoded tick takes.
inline constexpr std::size_t kTickEntryBytesMax =
    72 + TickEntry::kReceivedMax * 21 +
    std::size_t{kMaxJoints} * (1 + std::size_t{FrameBatch::kCapacity} * 13) + 128 +
    std::size_t{kMaxJoints} * 80;

/// Writes a tick, in time that depends on the number of frames and joints only.
/// @param input  not more frames than kReceivedMax.
/// @param out    of kTickEntryBytesMax bytes.
/// @returns the bytes written; 0 when it does not fit.
std::size_t EncodeTick(std::int64_t index, const TickNotes& notes, const TickInput& input,
                       const TickOutput& output, std::span<std::uint8_t> out) noexcept;

/// The version of flight records in which ticks have all fields.
inline constexpr std::uint32_t kCurrentTicks = std::numeric_limits<std::uint32_t>::max();

/// Reads an encoded tick. @returns false when the bytes are not exactly one tick: too few, too
/// many, or with a count or an enumerator that does not exist. `entry` may be partly written then.
/// @param version  of the flight record. What it does not have is as if it had never been set.
[[nodiscard]] bool DecodeTick(std::span<const std::uint8_t> bytes, TickEntry& entry,
                              std::uint32_t version = kCurrentTicks) noexcept;

}  // namespace tumbler
