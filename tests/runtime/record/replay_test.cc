#include "runtime/record/replay.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <bit>
#include <functional>
#include <memory>
#include <random>
#include <string>

#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

using testing::AsBytes;
using ::testing::HasSubstr;

const std::string& Recorded() {
  static const std::string bytes = testing::RecordedBytes(testing::SmallConfiguration());
  return bytes;
}

/// The record with the bytes of some blocks changed, and with every CRC mended.
std::string Rewritten(const std::string& record,
                      const std::function<void(BlockKind, std::uint32_t, RecordBytes&)>& change) {
  RecordBytes out;
  AppendRecordHeader(out);
  BlockReader reader(AsBytes(record));
  for (Block block; reader.Next(block);) {
    RecordBytes content(block.content.begin(), block.content.end());
    change(block.kind, block.number, content);
    RecordEnd end;
    if (block.kind == BlockKind::kEnd && DecodeEnd(content, end)) {
      end.crc32 = Crc32(out);
      content = EncodeEnd(end);
    }
    AppendBlock(block.kind, block.number, content, out);
  }
  return {out.begin(), out.end()};
}

ReplayResult ReplayOf(const std::string& bytes) {
  FlightRecord record(AsBytes(bytes), "run.rec");
  ReplayResult report = Replay(record);
  EXPECT_TRUE(record.damages().empty());
  return report;
}

// Offsets in a tick with two frames received and one sent by each of two joints.
constexpr std::size_t kReceived = 71;
constexpr std::size_t kSent = kReceived + 2UL * 21;
constexpr std::size_t kRecord = kSent + 2UL * 14;
constexpr std::size_t kJoints = kRecord + 80;
constexpr std::size_t kJointBytes = 71;
constexpr std::size_t kTickBytes = kJoints + 2 * kJointBytes;
constexpr std::uint32_t kTickBlock = 62;  // The sixtieth tick, while the motion is played.

TEST(Replay, OfAnUnchangedRecordIsIdentical) {
  const ReplayResult report = ReplayOf(Recorded());
  EXPECT_TRUE(report.identical());
  EXPECT_GT(report.ticks, 80);
  EXPECT_EQ(report.frames_out, 2 * report.ticks);
  EXPECT_EQ(report.frames_in, 2 * (report.ticks - 1));
}

TEST(Replay, OfARecordOfVersionFourIsIdentical) {
  const std::string bytes =
      testing::ReadFile(testing::SourcePath("tests/data/records/version_4.rec"));
  FlightRecord record(AsBytes(bytes), "version_4.rec");
  EXPECT_EQ(record.version(), 4U);
  const ReplayResult report = Replay(record);
  EXPECT_TRUE(report.identical());
  EXPECT_EQ(report.ticks, 238);
  EXPECT_EQ(report.frames_out, 476);
}

TEST(Replay, RewritingARecordChangesNothing) {
  EXPECT_EQ(Rewritten(Recorded(), [](auto, auto, auto&) {}), Recorded());
}

TEST(Replay, TheFloatsOfFaultsInEarlierRecordsAreReadAsTheIntegersThatTheyStandFor) {
  const auto put = [](RecordBytes& content, std::size_t at, float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    for (std::size_t i = 0; i < 4; ++i)
      content[kRecord + at + i] = static_cast<std::uint8_t>(bits >> (8 * i));
  };
  std::string bytes = Rewritten(Recorded(), [&](BlockKind, std::uint32_t n, auto& content) {
    if (n != kTickBlock) return;
    put(content, 33, 12);
    put(content, 37, 10);
    content[kRecord + 41] = static_cast<std::uint8_t>(Fault::kStaleReply);
    put(content, 45, 0.25F);
    put(content, 49, 0.125F);
    content[kRecord + 53] = static_cast<std::uint8_t>(Refusal::kFarFromStart);
  });
  // Earlier ticks have no sensor: 25 bytes of the record, and the last 4 of each joint.
  bytes = Rewritten(bytes, [](BlockKind kind, std::uint32_t, auto& content) {
    if (kind != BlockKind::kTick) return;
    const auto erase_before = [&content](std::size_t from_end, std::size_t count) {
      const auto end = content.end() - static_cast<std::ptrdiff_t>(from_end);
      content.erase(end - static_cast<std::ptrdiff_t>(count), end);
    };
    erase_before(0, 4);
    erase_before(kJointBytes - 4, 4);
    erase_before(2 * (kJointBytes - 4), 25);
  });
  for (const char version : {'\2', '\3'}) {
    bytes[8] = version;
    const std::uint32_t crc = Crc32(AsBytes(bytes).first(12));
    for (std::size_t i = 0; i < 4; ++i) bytes[12 + i] = static_cast<char>(crc >> (8 * i));
    FlightRecord record(AsBytes(bytes), "run.rec");
    const auto entry = std::make_unique<TickEntry>();
    while (record.Next(*entry) && entry->index < 60) {
    }
    ASSERT_EQ(entry->index, 60);
    const FaultDetail& fault = entry->record.first_fault;
    EXPECT_EQ(fault.value, version == 2 ? DetailNumber::Integer(12) : DetailNumber::Real(12));
    EXPECT_EQ(fault.limit, version == 2 ? DetailNumber::Integer(10) : DetailNumber::Real(10));
    EXPECT_EQ(entry->record.refusal.value.real(), 0.25F);
    EXPECT_EQ(entry->record.refusal.limit.real(), 0.125F);
  }
}

TEST(Replay, FindsEveryFlippedBitOfTheOutputsAndNamesTick) {
  // Flips one bit of each byte of one tick's frames and record, with CRCs that fit.
  for (std::size_t at = kSent; at < kTickBytes; ++at) {
    std::int64_t tick = -1;
    const std::string bytes = Rewritten(Recorded(), [&](BlockKind, std::uint32_t n, auto& content) {
      if (n != kTickBlock) return;
      ASSERT_EQ(content.size(), kTickBytes);
      const auto entry = std::make_unique<TickEntry>();
      content[at] = static_cast<std::uint8_t>(content[at] ^ 1U << (at % 7));
      if (DecodeTick(content, *entry)) tick = entry->tick;
    });
    FlightRecord record(AsBytes(bytes), "run.rec");
    const ReplayResult report = Replay(record);
    ASSERT_FALSE(report.identical()) << at;
    EXPECT_EQ(report.ticks, 60) << at;
    if (!report.difference) {  // The bit made an impossible enumerator, count or identifier.
      EXPECT_THAT(report.gap, HasSubstr("block 62: does not hold a tick")) << at;
      continue;
    }
    EXPECT_EQ(report.difference->index, 60) << at;
    EXPECT_EQ(report.difference->tick, 60) << at;
    EXPECT_NE(report.difference->recorded, report.difference->replayed) << at;
    EXPECT_FALSE(report.difference->field.empty()) << at;
  }
}

TEST(Replay, FindsEveryFlippedBitOfAReply) {
  for (std::size_t bit = 0; bit < 8UL * 8; ++bit) {
    const std::size_t at = kReceived + 21 + 8 + 5 + bit / 8;  // data of the second joint's reply
    const std::string bytes = Rewritten(Recorded(), [&](BlockKind, std::uint32_t n, auto& content) {
      if (n == kTickBlock) content[at] = static_cast<std::uint8_t>(content[at] ^ 1U << (bit % 8));
    });
    const ReplayResult report = ReplayOf(bytes);
    ASSERT_TRUE(report.difference) << bit;
    EXPECT_EQ(report.difference->index, 60) << bit;
    if (bit < 8) continue;  // With another sender it is nobody's reply.
    EXPECT_TRUE(report.difference->field.starts_with("joint joint2: ")) << report.difference->field;
  }
}

/// The field that is named when `bit` of the byte at `at` of one tick is flipped.
std::string FieldNamed(std::size_t at, unsigned bit) {
  const ReplayResult report =
      ReplayOf(Rewritten(Recorded(), [&](BlockKind, std::uint32_t n, auto& content) {
        if (n == kTickBlock) content[at] = static_cast<std::uint8_t>(content[at] ^ 1U << bit);
      }));
  return report.difference ? report.difference->field : "none";
}

TEST(Replay, NamesTheFieldThatDiffers) {
  EXPECT_EQ(FieldNamed(kRecord + 8, 0), "primitive_time_s");
  EXPECT_EQ(FieldNamed(kRecord + 12, 3), "faults");
  EXPECT_EQ(FieldNamed(kRecord + 21, 0), "cycles");
  EXPECT_EQ(FieldNamed(kRecord + 33, 0), "first_fault.value");
  EXPECT_EQ(FieldNamed(kJoints, 0), "joint joint1: planned.position_rad");
  EXPECT_EQ(FieldNamed(kJoints + kJointBytes + 40, 0), "joint joint2: measured.position_rad");
  EXPECT_EQ(FieldNamed(kJoints + 66, 0), "joint joint1: limit_active");
  EXPECT_EQ(FieldNamed(kSent + 1 + 5 + 3, 0), "joint joint1: frame 0, byte 3");
  EXPECT_EQ(FieldNamed(kSent + 14 + 1, 2), "joint joint2: frame 0, identifier");
  EXPECT_EQ(FieldNamed(kSent + 1 + 4, 3), "joint joint1: frame 0, size");
  EXPECT_EQ(FieldNamed(kReceived + 8 + 5 + 1, 4), "joint joint1: measured.position_rad");
}

TEST(Replay, FindsAChangedConfiguration) {
  const auto with = [](const std::string& what, const std::string& instead) {
    return Rewritten(Recorded(), [&](BlockKind kind, std::uint32_t, RecordBytes& content) {
      if (kind != BlockKind::kConfiguration) return;
      std::string text(content.begin(), content.end());
      const std::size_t at = text.find(what);
      ASSERT_NE(at, std::string::npos);
      text.replace(at, what.size(), instead);
      content.assign(text.begin(), text.end());
    });
  };
  const ReplayResult speed = ReplayOf(with("\"speed\": 0.8999", "\"speed\": 0.8899"));
  ASSERT_TRUE(speed.difference);
  EXPECT_GT(speed.difference->index, 5) << "when it begins to move";
  const ReplayResult gain =
      ReplayOf(with("\"kd_nm_s_per_rad\": 3.29", "\"kd_nm_s_per_rad\": 2.29"));
  ASSERT_TRUE(gain.difference);
  EXPECT_EQ(gain.difference->field, "joint joint1: frame 0, byte 5");
}

TEST(Replay, StopsAtDamageWithWhatWasIdenticalBefore) {
  std::string bytes = Recorded();
  BlockReader reader(AsBytes(bytes));
  Block block;
  while (reader.Next(block) && block.number != kTickBlock) {
  }
  bytes[block.offset + kBlockHeaderBytes + kReceived + 15] ^= 1;
  FlightRecord record(AsBytes(bytes), "run.rec");
  const ReplayResult report = Replay(record);
  EXPECT_FALSE(report.identical());
  EXPECT_FALSE(report.difference);
  EXPECT_EQ(report.ticks, 60);
  EXPECT_THAT(report.gap, HasSubstr("byte " + std::to_string(block.offset) +
                                    ": block 62 (tick): its content does not have the CRC"));
}

TEST(Replay, OfARecordThatWasCutOffIsIdenticalUpToThere) {
  const std::string bytes = Recorded().substr(0, Recorded().size() - 1000);
  FlightRecord record(AsBytes(bytes), "run.rec");
  const ReplayResult report = Replay(record);
  EXPECT_TRUE(report.identical());
  EXPECT_LT(report.ticks, ReplayOf(Recorded()).ticks);
  EXPECT_TRUE(record.cut_off());
}

}  // namespace
}  // namespace tumbler
