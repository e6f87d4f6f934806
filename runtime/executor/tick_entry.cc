#include "runtime/executor/tick_entry.h"

#include <bit>

namespace tumbler {
namespace {

constexpr std::uint32_t kExtended = 1U << 31;  // the bit that SocketCAN uses too
constexpr std::uint32_t kRemote = 1U << 30;

/// Writes fields little-endian on every machine.
class Writer {
 public:
  explicit Writer(std::span<std::uint8_t> out) noexcept : out_(out) {}

  template <typename T>
  void Put(T value) noexcept {
    if constexpr (std::is_enum_v<T>) {
      Put(static_cast<std::underlying_type_t<T>>(value));
    } else if constexpr (std::is_same_v<T, bool>) {
      Put<std::uint8_t>(value ? 1 : 0);
    } else if constexpr (std::is_same_v<T, float>) {
      Put(std::bit_cast<std::uint32_t>(value));
    } else {
      if (out_.size() - size_ < sizeof(T)) {
        fits_ = false;
        return;
      }
      const auto bits = static_cast<std::make_unsigned_t<T>>(value);
      for (std::size_t i = 0; i < sizeof(T); ++i) {
        out_[size_ + i] = static_cast<std::uint8_t>(bits >> (8 * i));
      }
      size_ += sizeof(T);
    }
  }
  void Put(const CanFrame& frame) noexcept {
    Put(frame.id | (frame.extended ? kExtended : 0U) | (frame.remote ? kRemote : 0U));
    Put(frame.size);
    for (const std::uint8_t byte : frame.data) Put(byte);
  }
  [[nodiscard]] std::size_t size() const noexcept { return fits_ ? size_ : 0; }

 private:
  std::span<std::uint8_t> out_;
  std::size_t size_ = 0;
  bool fits_ = true;
};

class Reader {
 public:
  explicit Reader(std::span<const std::uint8_t> bytes) noexcept : bytes_(bytes) {}

  template <typename T>
  void Take(T& value) noexcept {
    if constexpr (std::is_same_v<T, bool>) {
      std::uint8_t byte = 0;
      Take(byte);
      valid_ = valid_ && byte <= 1;
      value = byte != 0;
    } else if constexpr (std::is_enum_v<T>) {
      std::underlying_type_t<T> number{};
      Take(number);
      value = static_cast<T>(number);
    } else if constexpr (std::is_same_v<T, float>) {
      std::uint32_t bits = 0;
      Take(bits);
      value = std::bit_cast<float>(bits);
    } else {
      if (bytes_.size() < sizeof(T)) {
        valid_ = false;
        bytes_ = {};
        return;
      }
      std::make_unsigned_t<T> bits = 0;
      for (std::size_t i = 0; i < sizeof(T); ++i) {
        bits = static_cast<std::make_unsigned_t<T>>(
            bits | static_cast<std::make_unsigned_t<T>>(bytes_[i]) << (8 * i));
      }
      value = static_cast<T>(bits);
      bytes_ = bytes_.subspan(sizeof(T));
    }
  }
  void Take(CanFrame& frame) noexcept {
    std::uint32_t word = 0;
    Take(word);
    frame.extended = (word & kExtended) != 0;
    frame.remote = (word & kRemote) != 0;
    frame.id = word & ~(kExtended | kRemote);
    Take(frame.size);
    Require(frame.size <= frame.data.size() && frame.id <= (frame.extended ? 0x1fffffffU : 0x7ffU));
    for (std::uint8_t& byte : frame.data) Take(byte);
  }
  void Require(bool condition) noexcept { valid_ = valid_ && condition; }
  [[nodiscard]] bool valid() const noexcept { return valid_; }
  [[nodiscard]] bool done() const noexcept { return valid_ && bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
  bool valid_ = true;
};

constexpr DriveState LastOf(DriveState /*any*/) noexcept { return DriveState::kLost; }
constexpr SensorStatus LastOf(SensorStatus /*any*/) noexcept { return SensorStatus::kInconsistent; }
constexpr ReplyStatus LastOf(ReplyStatus /*any*/) noexcept { return ReplyStatus::kOkSomeLate; }

template <typename Enum>
constexpr bool IsUpTo(Enum value, Enum last) noexcept {
  return value <= last;
}

bool HasKnownEnumerators(const TickEntry& entry) noexcept {
  const TickRecord& record = entry.record;
  const auto last_fault = static_cast<Fault>(kFaultCount - 1);
  const auto last_state = static_cast<ExecutorState>(kExecutorStateCount - 1);
  const auto last_reaction = static_cast<Reaction>(kReactionCount - 1);
  bool known =
      IsUpTo(entry.receive_status, Status::kLinkGone) &&
      IsUpTo(entry.send_status, Status::kLinkGone) &&
      IsUpTo(entry.notes.sent_status, Status::kLinkGone) && IsUpTo(record.state, last_state) &&
      IsUpTo(entry.controller, CanControllerState::kBusOff) &&
      IsUpTo(record.reaction, last_reaction) && IsUpTo(record.first_fault.fault, last_fault) &&
      IsUpTo(record.first_fault.state, last_state) &&
      IsUpTo(record.first_fault.reaction, last_reaction) &&
      IsUpTo(record.sensor.status, LastOf(record.sensor.status));
  for (std::size_t i = 0; i < record.joint_count; ++i) {
    VisitFields(record.joints[i], [&known](const char* /*name*/, const auto& field) {
      if constexpr (std::is_enum_v<std::remove_cvref_t<decltype(field)>>) {
        known = known && IsUpTo(field, LastOf(field));
      }
    });
  }
  return known;
}

}  // namespace

// Flattened, as the control loop encodes every tick: without it the compiler's estimate decides
// which fields are written by calls.
[[gnu::flatten]] std::size_t EncodeTick(std::int64_t index, const TickNotes& notes,
                                        const TickInput& input, const TickOutput& output,
                                        std::span<std::uint8_t> out) noexcept {
  const TickRecord& record = output.record;
  if (input.received.size() > TickEntry::kReceivedMax || record.joint_count > kMaxJoints) return 0;
  Writer writer(out);
  writer.Put(index);
  writer.Put(notes.deadline_ns);
  writer.Put(notes.due_ns);
  writer.Put(notes.awake_ns);
  writer.Put(notes.send_ns);
  writer.Put(notes.done_ns);
  writer.Put(notes.request_id);
  writer.Put(notes.request);
  writer.Put(notes.request_refusal);
  writer.Put(notes.sent_status);
  writer.Put(notes.sent_count);
  writer.Put(input.tick);
  writer.Put(input.receive_status);
  writer.Put(input.send_status);
  writer.Put(input.command);
  writer.Put(input.branch);
  writer.Put(input.controller);
  writer.Put(static_cast<std::uint8_t>(input.received.size()));
  writer.Put(record.joint_count);
  for (const ReceivedFrame& received : input.received) {
    writer.Put(received.time_ns);
    writer.Put(received.frame);
  }
  for (std::size_t i = 0; i < record.joint_count; ++i) {
    const std::span<const CanFrame> frames = output.frames[i].frames();
    writer.Put(static_cast<std::uint8_t>(frames.size()));
    for (const CanFrame& frame : frames) writer.Put(frame);
  }
  const auto put = [&writer](const char* /*name*/, const auto& field) { writer.Put(field); };
  VisitFields(record, put);
  for (std::size_t i = 0; i < record.joint_count; ++i) VisitFields(record.joints[i], put);
  return writer.size();
}

[[gnu::flatten]] bool DecodeTick(std::span<const std::uint8_t> bytes, TickEntry& entry,
                                 std::uint32_t version) noexcept {
  Reader reader(bytes);
  std::uint8_t received_count = 0, joint_count = 0;
  reader.Take(entry.index);
  TickNotes& notes = entry.notes;
  reader.Take(notes.deadline_ns);
  reader.Take(notes.due_ns);
  reader.Take(notes.awake_ns);
  reader.Take(notes.send_ns);
  reader.Take(notes.done_ns);
  reader.Take(notes.request_id);
  reader.Take(notes.request);
  reader.Take(notes.request_refusal);
  reader.Take(notes.sent_status);
  reader.Take(notes.sent_count);
  reader.Take(entry.tick);
  reader.Take(entry.receive_status);
  reader.Take(entry.send_status);
  reader.Take(entry.command);
  reader.Take(entry.branch);
  reader.Take(entry.controller);
  reader.Take(received_count);
  reader.Take(joint_count);
  reader.Require(received_count <= TickEntry::kReceivedMax && joint_count <= kMaxJoints);
  if (!reader.valid()) return false;
  entry.received_count = received_count;
  for (std::size_t i = 0; i < received_count; ++i) {
    reader.Take(entry.received[i].time_ns);
    reader.Take(entry.received[i].frame);
  }
  std::size_t frame_count = 0;
  for (std::size_t i = 0; i < joint_count; ++i) {
    std::uint8_t count = 0;
    reader.Take(count);
    reader.Require(count <= FrameBatch::kCapacity);
    if (!reader.valid()) return false;
    entry.frames[i].Clear();
    for (std::size_t f = 0; f < count; ++f) {
      CanFrame frame;
      reader.Take(frame);
      reader.Require(entry.frames[i].Add(frame) == Status::kOk);
    }
    frame_count += count;
  }
  static constexpr TickRecord kNone{};
  ForEachRow(kTickFields, [&]<typename Row>(const Row& row) {
    if constexpr (Row::kRecorded) {
      if (row.field.since > version) {
        row.in_record(entry.record) = row.in_record(kNone);
      } else {
        reader.Take(row.in_record(entry.record));
      }
    }
  });
  reader.Require(entry.record.joint_count == joint_count && notes.sent_count <= frame_count);
  if (!reader.valid()) return false;
  for (std::size_t i = 0; i < joint_count; ++i) {
    ForEachJointField([&](const JointField& field, auto in_record, auto /*in_message*/) {
      if (field.since > version) {
        in_record(entry.record.joints[i]) = in_record(kNone.joints[i]);
      } else {
        reader.Take(in_record(entry.record.joints[i]));
      }
    });
  }
  return reader.done() && HasKnownEnumerators(entry);
}

}  // namespace tumbler
