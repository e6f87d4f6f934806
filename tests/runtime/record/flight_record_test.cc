#include "runtime/record/flight_record.h"

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

using testing::AsBytes;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::string& SmallRecord() {
  static const std::string bytes = testing::RecordedBytes(testing::SmallConfiguration(), 40);
  return bytes;
}

/// The result of reading some bytes.
struct Reading {
  bool opened = false;
  std::string refusal;
  std::vector<std::int64_t> indices;
  std::vector<Damage> damages;
  bool cut_off = false;
  bool complete = false;
  std::size_t offset = 0;
};

Reading Read(const std::string& bytes) {
  Reading reading;
  try {
    FlightRecord record(AsBytes(bytes), "run.rec");
    reading.opened = true;
    const auto entry = std::make_unique<TickEntry>();
    while (record.Next(*entry)) reading.indices.push_back(entry->index);
    reading.damages = record.damages();
    reading.cut_off = record.cut_off();
    reading.complete = record.end().has_value();
    reading.offset = record.offset();
  } catch (const RecordError& error) {
    reading.refusal = error.what();
  }
  return reading;
}

/// Where blocks begin, and where the last one ends.
std::vector<std::size_t> BlockOffsets(const std::string& bytes) {
  std::vector<std::size_t> offsets;
  BlockReader reader(AsBytes(bytes));
  for (Block block; reader.Next(block);) offsets.push_back(block.offset);
  offsets.push_back(reader.offset());
  return offsets;
}

TEST(FlightRecord, ReadsAllThatWasWritten) {
  const Reading reading = Read(SmallRecord());
  ASSERT_TRUE(reading.opened) << reading.refusal;
  EXPECT_EQ(reading.indices.size(), 40U);
  EXPECT_THAT(reading.damages, IsEmpty());
  EXPECT_FALSE(reading.cut_off);
  EXPECT_TRUE(reading.complete);
  FlightRecord record(AsBytes(SmallRecord()), "run.rec");
  EXPECT_EQ(record.configuration().files[0].text, testing::SmallConfiguration().files[0].text);
}

TEST(FlightRecord, CutOffAtAnyByteOpensUpToThere) {
  const std::string& whole = SmallRecord();
  const std::vector<std::size_t> offsets = BlockOffsets(whole);
  ASSERT_EQ(offsets.back(), whole.size());
  // Configuration, one file, 40 ticks, end.
  ASSERT_EQ(offsets.size(), 44U);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const Reading reading = Read(whole.substr(0, size));
    std::size_t blocks = 0;
    while (offsets[blocks + 1] <= size) ++blocks;
    ASSERT_EQ(reading.opened, blocks >= 2) << size;
    if (!reading.opened) {
      ASSERT_THAT(reading.refusal, HasSubstr("run.rec: is cut off within")) << size;
      continue;
    }
    ASSERT_EQ(reading.indices.size(), std::min<std::size_t>(blocks - 2, 40)) << size;
    ASSERT_THAT(reading.damages, IsEmpty()) << size;
    ASSERT_FALSE(reading.complete);
    ASSERT_EQ(reading.cut_off, size != offsets[blocks]) << size;
    ASSERT_EQ(reading.offset, offsets[blocks]) << size;
  }
}

TEST(FlightRecord, NoFlippedBitGoesUnnoticed) {
  const std::string& whole = SmallRecord();
  const std::size_t ticks_begin = BlockOffsets(whole)[2];
  std::size_t refused = 0, tick_lost = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << (at % 8)));
    const Reading reading = Read(bytes);
    if (at < ticks_begin) {
      ASSERT_FALSE(reading.opened) << at;
      ASSERT_FALSE(reading.refusal.empty());
      ++refused;
      continue;
    }
    ASSERT_TRUE(reading.opened) << at;
    ASSERT_FALSE(reading.damages.empty()) << at;
    ASSERT_THAT(reading.damages[0].what, HasSubstr("CRC")) << at;
    ASSERT_LE(reading.damages[0].offset, at);
    // One block is lost, but not those behind it. (The CRC in the last block notices it too.)
    ASSERT_GE(reading.indices.size(), 39U) << at;
    tick_lost += reading.indices.size() == 39 ? 1 : 0;
  }
  EXPECT_GT(refused, 1000U);
  EXPECT_GT(tick_lost, 1000U);
}

TEST(FlightRecord, SaysWhereABlockIsDamagedAndReadsOnBehindIt) {
  std::string bytes = SmallRecord();
  const std::vector<std::size_t> offsets = BlockOffsets(bytes);
  bytes[offsets[12] + kBlockHeaderBytes + 50] ^= 1;  // the tenth tick
  const Reading content = Read(bytes);
  ASSERT_GE(content.damages.size(), 1U);
  EXPECT_EQ(content.damages[0].offset, offsets[12]);
  EXPECT_THAT(content.damages[0].what,
              HasSubstr("block 12 (tick): its content does not have the CRC it had"));
  EXPECT_EQ(content.indices.size(), 39U);
  EXPECT_EQ(content.indices[10], 11);

  bytes = SmallRecord();
  bytes[offsets[12] + 12] ^= 1;  // its length
  const Reading header = Read(bytes);
  EXPECT_EQ(header.damages[0].offset, offsets[12]);
  EXPECT_THAT(header.damages[0].what,
              HasSubstr("block 12: its header does not have the CRC it had"));
  EXPECT_EQ(header.indices, content.indices);
}

TEST(FlightRecord, NoticesBlocksThatWereTakenOutOrAdded) {
  const std::string& whole = SmallRecord();
  const std::vector<std::size_t> offsets = BlockOffsets(whole);
  const std::string without = whole.substr(0, offsets[12]) + whole.substr(offsets[14]);
  const Reading taken = Read(without);
  ASSERT_EQ(taken.damages.size(), 2U);
  EXPECT_THAT(taken.damages[0].what, HasSubstr("blocks 12 ... are missing; block 14 (tick)"));
  EXPECT_THAT(taken.damages[1].what, HasSubstr("the file before it does not have the CRC it had"));
  EXPECT_FALSE(taken.complete);
}

TEST(FlightRecord, WhatIsBehindItsEndIsNoPartOfARecordThatIsCutOffOrDamagedBeforeThat) {
  const std::string& whole = SmallRecord();
  for (const std::string& behind : {std::string("rubbish"), std::string(1000, 'x'), whole}) {
    const Reading reading = Read(whole + behind);
    EXPECT_EQ(reading.indices, Read(whole).indices);
    EXPECT_TRUE(reading.complete);
    EXPECT_FALSE(reading.cut_off);
    ASSERT_EQ(reading.damages.size(), 1U);
    EXPECT_EQ(reading.damages[0].offset, whole.size());
    EXPECT_EQ(reading.damages[0].what,
              std::to_string(behind.size()) + " bytes are behind the end of the record");
  }
}

TEST(FlightRecord, NamesWhatIsNoRecordOrAnotherVersion) {
  EXPECT_THAT(Read("(1436509052.249713) vcan0 044#2A366C2BBA\n").refusal,
              HasSubstr("run.rec: is not a flight record"));
  EXPECT_THAT(Read("").refusal, HasSubstr("cut off within its first 16 bytes"));
  RecordBytes header;
  AppendRecordHeader(header);
  header[8] = kRecordVersion + 1;
  const std::uint32_t crc = Crc32(std::span(header).first(12));
  for (std::size_t i = 0; i < 4; ++i) header[12 + i] = static_cast<std::uint8_t>(crc >> (8 * i));
  EXPECT_THAT(Read({header.begin(), header.end()}).refusal, HasSubstr("another version"));
  header[8] = kRecordVersion + 2;
  EXPECT_THAT(Read({header.begin(), header.end()}).refusal, HasSubstr("damaged in its first 16"));
}

/// The record without what ticks have had only since there are sensors.
std::string WithoutSensor(const std::string& bytes) {
  constexpr std::size_t kOfRecord = 25, kOfJoint = 4, kJoint = 71;
  BlockReader reader(AsBytes(bytes));
  RecordBytes out(bytes.begin(), bytes.begin() + 16);
  const auto entry = std::make_unique<TickEntry>();
  for (Block block; reader.Next(block);) {
    RecordBytes content(block.content.begin(), block.content.end());
    RecordEnd end;
    if (block.kind == BlockKind::kTick && DecodeTick(content, *entry)) {
      const std::size_t joints = entry->record.joint_count;
      for (std::size_t j = 0; j < joints; ++j) {
        const auto last = content.end() - static_cast<std::ptrdiff_t>(j * (kJoint - kOfJoint));
        content.erase(last - kOfJoint, last);
      }
      const auto first_joint =
          content.end() - static_cast<std::ptrdiff_t>(joints * (kJoint - kOfJoint));
      content.erase(first_joint - kOfRecord, first_joint);
    }
    if (block.kind == BlockKind::kEnd && DecodeEnd(content, end)) {
      end.crc32 = Crc32(out);
      content = EncodeEnd(end);
    }
    AppendBlock(block.kind, block.number, content, out);
  }
  return {out.begin(), out.end()};
}

TEST(FlightRecord, OpensRecordsOfTheVersionsBefore) {
  std::string bytes = WithoutSensor(SmallRecord());
  const auto set_version = [&bytes](char version) {
    bytes[8] = version;
    const std::uint32_t crc = Crc32(AsBytes(bytes).first(12));
    for (std::size_t i = 0; i < 4; ++i) bytes[12 + i] = static_cast<char>(crc >> (8 * i));
  };
  for (const char version : {'\1', '\2', '\3'}) {
    set_version(version);
    const Reading reading = Read(bytes);
    EXPECT_EQ(reading.indices.size(), 40U);
    EXPECT_THAT(reading.damages, IsEmpty());
    EXPECT_EQ(FlightRecord(AsBytes(bytes), "run.rec").version(), static_cast<unsigned>(version));
  }
  set_version(static_cast<char>(kRecordVersion + 1));
  EXPECT_THAT(Read(bytes).refusal, HasSubstr("another version"));
}

TEST(FlightRecord, HasTheCrcOfZlibAndPng) {
  const std::string text = "123456789";  // the check value of CRC-32/ISO-HDLC
  EXPECT_EQ(Crc32(AsBytes(text)), 0xcbf43926U);
  EXPECT_EQ(Crc32(AsBytes("456789"), Crc32(AsBytes("123"))), 0xcbf43926U);
}

TEST(FlightRecord, RewindsToItsFirstTick) {
  FlightRecord record(AsBytes(SmallRecord()), "run.rec");
  const auto entry = std::make_unique<TickEntry>();
  while (record.Next(*entry)) {
  }
  record.Rewind();
  EXPECT_FALSE(record.end());
  ASSERT_TRUE(record.Next(*entry));
  EXPECT_EQ(entry->index, 0);
}

TEST(MappedFile, NamesWhatCannotBeRead) {
  EXPECT_THROW(MappedFile("/absent.rec"), RecordError);
  EXPECT_THROW(MappedFile("/"), RecordError);
  EXPECT_THROW(MappedFile("/dev/zero"), RecordError);
  const testing::TemporaryFolder folder;
  std::ofstream(folder / "empty").close();
  EXPECT_TRUE(MappedFile(folder / "empty").bytes().empty());
}

}  // namespace
}  // namespace tumbler
