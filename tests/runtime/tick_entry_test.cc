#include "runtime/executor/tick_entry.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <functional>
#include <memory>
#include <random>
#include <string_view>
#include <vector>

namespace tumbler {
namespace {

CanFrame RandomFrame(std::mt19937& random) {
  CanFrame frame;
  frame.extended = random() % 2 == 0;
  frame.remote = random() % 4 == 0;
  frame.id = static_cast<std::uint32_t>(random()) & (frame.extended ? 0x1fffffffU : 0x7ffU);
  frame.size = static_cast<std::uint8_t>(random() % 9);
  for (std::uint8_t& byte : frame.data) byte = static_cast<std::uint8_t>(random());
  return frame;
}

/// Fills fields with any bits that their types can have; enumerations with values below a bound.
struct Randomise {
  std::mt19937& random;
  template <typename T>
  void operator()(const char* /*name*/, T& field) const {
    if constexpr (std::is_same_v<T, float>) {
      field = std::bit_cast<float>(static_cast<std::uint32_t>(random()));  // NaNs included
    } else if constexpr (std::is_same_v<T, bool>) {
      field = random() % 2 == 0;
    } else if constexpr (std::is_enum_v<T>) {
      field = static_cast<T>(random() % 4);
    } else {
      field = static_cast<T>(std::uint64_t{random()} << 32 | random());
    }
  }
};

struct CollectBits {
  std::vector<std::uint64_t>& bits;
  template <typename T>
  void operator()(const char* /*name*/, const T& field) const {
    if constexpr (std::is_same_v<T, float>) {
      bits.push_back(std::bit_cast<std::uint32_t>(field));
    } else {
      bits.push_back(static_cast<std::uint64_t>(field));
    }
  }
};

std::vector<std::uint64_t> BitsOf(const TickRecord& record) {
  std::vector<std::uint64_t> bits;
  VisitFields(record, CollectBits{bits});
  for (std::size_t i = 0; i < record.joint_count; ++i) {
    VisitFields(record.joints[i], CollectBits{bits});
  }
  return bits;
}

/// A tick of random content.
struct AnyTick {
  explicit AnyTick(unsigned seed) {
    std::mt19937 random(seed);
    received.resize(random() % (TickEntry::kReceivedMax + 1));
    for (ReceivedFrame& frame : received) {
      frame = {RandomFrame(random), static_cast<std::int64_t>(random()) - (1LL << 31)};
    }
    input.tick = static_cast<std::int64_t>(random()) << 20;
    input.received = received;
    input.receive_status = static_cast<Status>(random() % 7);
    input.send_status = static_cast<Status>(random() % 7);
    input.command = static_cast<OperatorCommand>(random() % 9);
    input.branch = static_cast<std::int8_t>(random());
    input.controller = static_cast<CanControllerState>(random() % 4);
    TickRecord& record = output.record;
    VisitFields(record, Randomise{random});
    record.joint_count = static_cast<std::uint8_t>(random() % (kMaxJoints + 1));
    for (std::size_t i = 0; i < record.joint_count; ++i) {
      VisitFields(record.joints[i], Randomise{random});
      const int frames = static_cast<int>(random() % (FrameBatch::kCapacity + 1));
      for (int f = 0; f < frames; ++f) {
        EXPECT_EQ(output.frames[i].Add(RandomFrame(random)), Status::kOk);
      }
      sent += static_cast<std::size_t>(frames);
    }
    index = static_cast<std::int64_t>(random());
    notes.deadline_ns = static_cast<std::int64_t>(random());
    notes.due_ns = -5;
    notes.awake_ns = static_cast<std::int64_t>(random()) << 30;
    notes.send_ns = static_cast<std::int64_t>(random());
    notes.done_ns = static_cast<std::int64_t>(random());
    notes.request_id = static_cast<std::uint32_t>(random());
    notes.request = static_cast<std::uint8_t>(random() % 7);
    notes.request_refusal = static_cast<Refusal>(random() % 10);
    notes.sent_status = static_cast<Status>(random() % 7);
    notes.sent_count = static_cast<std::uint8_t>(random() % (sent + 1));
  }
  std::vector<std::uint8_t> Encode() const {
    std::vector<std::uint8_t> bytes(kTickEntryBytesMax);
    bytes.resize(EncodeTick(index, notes, input, output, bytes));
    return bytes;
  }

  std::vector<ReceivedFrame> received;
  TickInput input;
  TickOutput output;
  std::int64_t index = 0;
  TickNotes notes;
  std::size_t sent = 0;  // frames
};

TEST(TickEntry, IsReadBackBitForBit) {
  const auto entry = std::make_unique<TickEntry>();
  for (unsigned seed = 0; seed < 500; ++seed) {
    const AnyTick tick(seed);
    const std::vector<std::uint8_t> bytes = tick.Encode();
    ASSERT_FALSE(bytes.empty());
    ASSERT_TRUE(DecodeTick(bytes, *entry)) << seed;
    EXPECT_EQ(entry->index, tick.index);
    EXPECT_EQ(entry->notes.deadline_ns, tick.notes.deadline_ns);
    EXPECT_EQ(entry->notes.due_ns, tick.notes.due_ns);
    EXPECT_EQ(entry->notes.awake_ns, tick.notes.awake_ns);
    EXPECT_EQ(entry->notes.send_ns, tick.notes.send_ns);
    EXPECT_EQ(entry->notes.done_ns, tick.notes.done_ns);
    EXPECT_EQ(entry->notes.request_id, tick.notes.request_id);
    EXPECT_EQ(entry->notes.request, tick.notes.request);
    EXPECT_EQ(entry->notes.request_refusal, tick.notes.request_refusal);
    EXPECT_EQ(entry->notes.sent_status, tick.notes.sent_status);
    EXPECT_EQ(entry->notes.sent_count, tick.notes.sent_count);
    const TickInput input = entry->input();
    EXPECT_EQ(input.tick, tick.input.tick);
    EXPECT_EQ(input.receive_status, tick.input.receive_status);
    EXPECT_EQ(input.send_status, tick.input.send_status);
    EXPECT_EQ(input.command, tick.input.command);
    EXPECT_EQ(input.branch, tick.input.branch);
    EXPECT_EQ(input.controller, tick.input.controller);
    ASSERT_EQ(input.received.size(), tick.received.size());
    for (std::size_t i = 0; i < tick.received.size(); ++i) {
      EXPECT_EQ(input.received[i].frame, tick.received[i].frame);
      EXPECT_EQ(input.received[i].time_ns, tick.received[i].time_ns);
    }
    EXPECT_EQ(BitsOf(entry->record), BitsOf(tick.output.record));
    for (std::size_t i = 0; i < tick.output.record.joint_count; ++i) {
      const auto frames = tick.output.frames[i].frames();
      ASSERT_EQ(entry->frames[i].frames().size(), frames.size());
      EXPECT_TRUE(std::equal(frames.begin(), frames.end(), entry->frames[i].frames().begin()));
    }
  }
}

TEST(TickEntry, HasTheDocumentedBytes) {
  std::vector<ReceivedFrame> received(1);
  received[0].time_ns = 0x0102030405060708;
  received[0].frame.id = 0x123;
  received[0].frame.size = 2;
  received[0].frame.data = {0xaa, 0xbb};
  TickInput input;
  input.tick = 258;
  input.received = received;
  input.command = OperatorCommand::kRun;
  input.controller = CanControllerState::kErrorPassive;
  TickOutput output;
  output.record.tick = 258;
  output.record.joint_count = 1;
  output.record.joints[0].planned.position_rad = 1.0F;  // 3f800000
  CanFrame sent;
  sent.id = 0x1;
  sent.extended = true;
  sent.size = 1;
  sent.data = {0xcc};
  ASSERT_EQ(output.frames[0].Add(sent), Status::kOk);
  std::vector<std::uint8_t> bytes(kTickEntryBytesMax);
  const TickNotes notes{1, 2, 3, 4, 5, 0x01020304, 6, Refusal::kNoReply, Status::kBusOff, 1};
  bytes.resize(EncodeTick(7, notes, input, output, bytes));
  // clang-format off
  const std::vector<std::uint8_t> expected_start = {
      7, 0, 0, 0, 0, 0, 0, 0,  // index
      1, 0, 0, 0, 0, 0, 0, 0,  // deadline
      2, 0, 0, 0, 0, 0, 0, 0,  // due
      3, 0, 0, 0, 0, 0, 0, 0,  // awake
      4, 0, 0, 0, 0, 0, 0, 0,  // sent
      5, 0, 0, 0, 0, 0, 0, 0,  // done
      4, 3, 2, 1, 6, 4,        // a request was refused: no reply
      4, 1,                    // bus off, 1 sent
      2, 1, 0, 0, 0, 0, 0, 0,  // tick
      0, 0, 3, 0xff, 2,        // statuses, run, no branch, error-passive
      1, 1,                    // 1 received, 1 joint
      8, 7, 6, 5, 4, 3, 2, 1,  // arrival
      0x23, 1, 0, 0, 2, 0xaa, 0xbb, 0, 0, 0, 0, 0, 0,     // frame
      1, 1, 0, 0, 0x80, 1, 0xcc, 0, 0, 0, 0, 0, 0, 0,     // one frame, extended
  };
  // clang-format on
  ASSERT_EQ(bytes.size(), expected_start.size() + 80 + 71);
  bytes.resize(bytes.size() - 80 - 71 + 80 + 4);
  EXPECT_EQ(std::vector<std::uint8_t>(
                bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(expected_start.size())),
            expected_start);
  EXPECT_EQ(bytes[bytes.size() - 4 + 2], 0x80);
  EXPECT_EQ(bytes[bytes.size() - 4 + 3], 0x3f);
}

TEST(TickEntry, IsRefusedWhenAnythingIsMissingOrTooMuch) {
  const auto entry = std::make_unique<TickEntry>();
  std::vector<std::uint8_t> bytes = AnyTick(3).Encode();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    ASSERT_FALSE(DecodeTick(std::span(bytes).first(size), *entry)) << size;
  }
  bytes.push_back(0);
  EXPECT_FALSE(DecodeTick(bytes, *entry));
}

TEST(TickEntry, IsRefusedWithCountsAndEnumeratorsThatCannotBe) {
  const auto entry = std::make_unique<TickEntry>();
  const std::vector<std::uint8_t> good = AnyTick(4).Encode();
  ASSERT_TRUE(DecodeTick(good, *entry));
  // Sending, receiving, sending before, the controller, frames received, joints.
  for (const std::size_t at : {54U, 64U, 65U, 68U, 69U, 70U}) {
    std::vector<std::uint8_t> bad = good;
    bad[at] = 0xf0;
    EXPECT_FALSE(DecodeTick(bad, *entry)) << at;
  }
}

TEST(TickEntry, FitsItsLargestSizeAndNoSmallerOne) {
  std::vector<ReceivedFrame> received(TickEntry::kReceivedMax);
  TickInput input;
  input.received = received;
  TickOutput output;
  output.record.joint_count = kMaxJoints;
  for (FrameBatch& batch : output.frames) {
    for (int f = 0; f < FrameBatch::kCapacity; ++f) ASSERT_EQ(batch.Add({}), Status::kOk);
  }
  std::vector<std::uint8_t> bytes(kTickEntryBytesMax);
  const std::size_t size = EncodeTick(0, {}, input, output, bytes);
  ASSERT_GT(size, 3000U);
  EXPECT_EQ(EncodeTick(0, {}, input, output, std::span(bytes).first(size)), size);
  EXPECT_EQ(EncodeTick(0, {}, input, output, std::span(bytes).first(size - 1)), 0U);
  received.resize(received.size() + 1);
  input.received = received;
  EXPECT_EQ(EncodeTick(0, {}, input, output, bytes), 0U);
}

/// A small tick: no frame received, and one joint that was sent one.
struct SmallTick {
  SmallTick() {
    output.record.joint_count = 1;
    EXPECT_EQ(output.frames[0].Add({}), Status::kOk);
  }
  [[nodiscard]] std::vector<std::uint8_t> Encode() const {
    std::vector<std::uint8_t> bytes(kTickEntryBytesMax);
    TickInput with_frames = input;
    with_frames.received = received;
    bytes.resize(EncodeTick(0, notes, with_frames, output, bytes));
    return bytes;
  }
  [[nodiscard]] bool IsRead() const {
    const auto entry = std::make_unique<TickEntry>();
    return DecodeTick(Encode(), *entry);
  }

  std::vector<ReceivedFrame> received;
  TickInput input;
  TickOutput output;
  TickNotes notes;
};

// The bytes of a record, and of each of its joints (docs/formats.md); and those of each that came
// with the sensor, at their ends.
constexpr std::size_t kRecordBytes = 80, kJointBytes = 71;
constexpr std::size_t kSensorBytes = 25, kCorrectionBytes = 4;

TEST(TickEntry, IsReadWithTheLastEnumeratorOfEveryKindAndWithNoneBeyond) {
  struct Kind {
    const char* name;
    int last;
    std::function<void(SmallTick&, int)> set;
  };
  const int last_status = static_cast<int>(Status::kLinkGone);
  const int last_state = kExecutorStateCount - 1, last_reaction = kReactionCount - 1;
  const std::array kinds{
      Kind{"of receiving", last_status,
           [](auto& t, int n) { t.input.receive_status = static_cast<Status>(n); }},
      Kind{"of sending before", last_status,
           [](auto& t, int n) { t.input.send_status = static_cast<Status>(n); }},
      Kind{"of sending", last_status,
           [](auto& t, int n) { t.notes.sent_status = static_cast<Status>(n); }},
      Kind{"of the controller", static_cast<int>(CanControllerState::kBusOff),
           [](auto& t, int n) { t.input.controller = static_cast<CanControllerState>(n); }},
      Kind{"state", last_state,
           [](auto& t, int n) { t.output.record.state = static_cast<ExecutorState>(n); }},
      Kind{"reaction", last_reaction,
           [](auto& t, int n) { t.output.record.reaction = static_cast<Reaction>(n); }},
      Kind{"fault", kFaultCount - 1,
           [](auto& t, int n) { t.output.record.first_fault.fault = static_cast<Fault>(n); }},
      Kind{"state of the fault", last_state,
           [](auto& t, int n) {
             t.output.record.first_fault.state = static_cast<ExecutorState>(n);
           }},
      Kind{"reaction to the fault", last_reaction,
           [](auto& t, int n) { t.output.record.first_fault.reaction = static_cast<Reaction>(n); }},
      Kind{"of the sensor", kSensorStatusCount - 1,
           [](auto& t, int n) { t.output.record.sensor.status = static_cast<SensorStatus>(n); }},
      Kind{"state of the drive", static_cast<int>(DriveState::kLost),
           [](auto& t, int n) {
             t.output.record.joints[0].drive_state = static_cast<DriveState>(n);
           }},
      Kind{"of the reply", static_cast<int>(ReplyStatus::kOkSomeLate), [](auto& t, int n) {
             t.output.record.joints[0].reply_status = static_cast<ReplyStatus>(n);
           }}};
  for (const Kind& kind : kinds) {
    for (const int number : {kind.last, kind.last + 1}) {
      SmallTick tick;
      kind.set(tick, number);
      EXPECT_EQ(tick.IsRead(), number == kind.last) << kind.name << " " << number;
    }
  }
}

TEST(TickEntry, IsRefusedWithAFrameThatNoBusCarries) {
  struct Row {
    std::uint32_t id;
    bool extended;
    int size;
    bool read;
  };
  for (const Row& row : {Row{0x7ff, false, 8, true},
                         {0x800, false, 8, false},
                         {0x800, true, 8, true},
                         {0x1fffffff, true, 8, true},
                         {0x20000000, true, 8, false},
                         {0x7ff, false, 9, false}}) {
    CanFrame frame;
    frame.id = row.id;
    frame.extended = row.extended;
    frame.size = static_cast<std::uint8_t>(row.size);
    SmallTick received, sent;
    received.received = {{frame, 0}};
    EXPECT_EQ(received.IsRead(), row.read) << row.id << " of " << row.size;
    EXPECT_EQ(sent.output.frames[0].Add(frame), Status::kOk);
    EXPECT_EQ(sent.IsRead(), row.read) << row.id << " of " << row.size;
  }
}

TEST(TickEntry, IsRefusedWhereItsCountsContradictEachOtherOrATruthIsNoTruth) {
  SmallTick tick;
  tick.notes.sent_count = 1;
  EXPECT_TRUE(tick.IsRead());
  const std::vector<std::uint8_t> good = tick.Encode();
  tick.notes.sent_count = 2;
  EXPECT_FALSE(tick.IsRead()) << "more frames were sent than there are";

  const auto entry = std::make_unique<TickEntry>();
  const std::size_t record = good.size() - kRecordBytes - kJointBytes;
  const std::size_t frames = record - 14, joint_count = record + 19;
  const std::size_t limit_active = good.size() - kCorrectionBytes - 1;
  ASSERT_EQ(good[frames], 1);
  ASSERT_EQ(good[joint_count], 1);
  ASSERT_EQ(good[limit_active], 0);
  const auto is_read = [&](std::size_t at, int byte) {
    std::vector<std::uint8_t> bytes = good;
    bytes[at] = static_cast<std::uint8_t>(byte);
    return DecodeTick(bytes, *entry);
  };
  EXPECT_FALSE(is_read(frames, FrameBatch::kCapacity + 1));
  EXPECT_FALSE(is_read(joint_count, 0)) << "one joint's frames, and no joint";
  EXPECT_FALSE(is_read(joint_count, 2));
  EXPECT_TRUE(is_read(limit_active, 1));
  EXPECT_FALSE(is_read(limit_active, 2));
}

TEST(TickEntry, IsNeitherWrittenNorReadWithMoreJointsThanAnExecutorHas) {
  SmallTick tick;
  tick.output.frames[0].Clear();
  tick.output.record.joint_count = kMaxJoints;
  EXPECT_TRUE(tick.IsRead());
  std::vector<std::uint8_t> bytes = tick.Encode();
  tick.output.record.joint_count = kMaxJoints + 1;
  EXPECT_TRUE(tick.Encode().empty());

  // One joint more, everywhere: the count, its frames (none), the record's count, its fields.
  constexpr std::size_t kFrames = 71;
  ASSERT_EQ(bytes[kFrames - 1], kMaxJoints);
  bytes[kFrames - 1] = kMaxJoints + 1;
  bytes.insert(bytes.begin() + kFrames, 0);
  const std::size_t joint_count = kFrames + kMaxJoints + 1 + 19;
  ASSERT_EQ(bytes[joint_count], kMaxJoints);
  bytes[joint_count] = kMaxJoints + 1;
  bytes.resize(bytes.size() + kJointBytes);
  const auto entry = std::make_unique<TickEntry>();
  EXPECT_FALSE(DecodeTick(bytes, *entry));
}

TEST(TickEntry, OfBeforeThereWereSensorsIsReadAsOneWithoutASensor) {
  const auto entry = std::make_unique<TickEntry>();
  for (unsigned seed = 0; seed < 50; ++seed) {
    AnyTick tick(seed);
    std::vector<std::uint8_t> bytes = tick.Encode();
    // What a record of version 3 does not have.
    const std::size_t joints = tick.output.record.joint_count;
    for (std::size_t i = joints; i-- > 0;) {
      const auto end = bytes.end() - static_cast<std::ptrdiff_t>((joints - 1 - i) *
                                                                 (kJointBytes - kCorrectionBytes));
      bytes.erase(end - kCorrectionBytes, end);
    }
    const auto end =
        bytes.end() - static_cast<std::ptrdiff_t>(joints * (kJointBytes - kCorrectionBytes));
    bytes.erase(end - kSensorBytes, end);

    EXPECT_FALSE(DecodeTick(bytes, *entry)) << "it lacks what a tick has now";
    entry->record.sensor.status = SensorStatus::kLate;  // of the entry that was read before
    for (JointRecord& joint : entry->record.joints) joint.correction_rad = 1;
    ASSERT_TRUE(DecodeTick(bytes, *entry, kRecordedSensors - 1)) << seed;
    tick.output.record.sensor = {};
    for (JointRecord& joint : tick.output.record.joints) joint.correction_rad = 0;
    EXPECT_EQ(BitsOf(entry->record), BitsOf(tick.output.record)) << seed;
  }
}

}  // namespace
}  // namespace tumbler
