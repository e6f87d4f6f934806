// Feeds any bytes to the reader of flight records: as they are, and with every CRC mended, so that
// changes get through to the code behind the CRCs. Whatever the bytes are, the reader has to end,
// to refuse with a message, and to hand out nothing beyond its bounds.

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "common/files/toml_reader.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/replay.h"
#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

void Require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "the reader of records lets through what it must not: %s\n", what);
  std::abort();
}
#define TUMBLER_REQUIRE(condition) Require(condition, #condition)

/// A long configuration takes long to load, and teaches nothing new.
constexpr std::size_t kReplayedBytesMax = 1U << 20U;

void ReadAll(std::span<const std::uint8_t> bytes) {
  try {
    FlightRecord record(bytes, "fuzz.rec");
    TUMBLER_REQUIRE(!record.configuration().joints.empty());
    TUMBLER_REQUIRE(record.configuration().period_ns > 0);
    const auto entry = std::make_unique<TickEntry>();
    std::size_t ticks = 0;
    while (record.Next(*entry)) {
      ++ticks;
      TUMBLER_REQUIRE(entry->received_count <= TickEntry::kReceivedMax);
      TUMBLER_REQUIRE(entry->record.joint_count <= kMaxJoints);
      TUMBLER_REQUIRE(entry->notes.sent_count <= kMaxJoints * FrameBatch::kCapacity);
      for (const ReceivedFrame& received : entry->input().received) {
        TUMBLER_REQUIRE(received.frame.size <= 8);
      }
      for (const FrameBatch& batch : entry->frames) {
        for (const CanFrame& frame : batch.frames()) TUMBLER_REQUIRE(frame.size <= 8);
      }
    }
    TUMBLER_REQUIRE(record.offset() <= bytes.size());
    TUMBLER_REQUIRE(ticks <= bytes.size() / kBlockHeaderBytes);
    TUMBLER_REQUIRE(!record.Remarks().empty());
    if (bytes.size() < kReplayedBytesMax) static_cast<void>(Replay(record));
  } catch (const RecordError& error) {
    TUMBLER_REQUIRE(!std::string_view(error.what()).empty());
  } catch (const FileError& error) {
    TUMBLER_REQUIRE(!std::string_view(error.what()).empty());
  }
}

std::size_t Get32(std::span<const std::uint8_t> bytes, std::size_t at) {
  return std::size_t{bytes[at]} | std::size_t{bytes[at + 1]} << 8 |
         std::size_t{bytes[at + 2]} << 16 | std::size_t{bytes[at + 3]} << 24;
}

/// The same blocks with CRCs that fit. A block that claims to be longer than the file is shortened.
RecordBytes Mended(std::span<const std::uint8_t> bytes) {
  RecordBytes mended;
  AppendRecordHeader(mended);
  std::size_t at = kRecordHeaderBytes;
  for (std::uint32_t number = 0; at + kBlockHeaderBytes <= bytes.size(); ++number) {
    const std::size_t size = std::min(Get32(bytes, at + 12), bytes.size() - at - kBlockHeaderBytes);
    const auto kind = static_cast<BlockKind>(Get32(bytes, at + 4));
    AppendBlock(kind, number, bytes.subspan(at + kBlockHeaderBytes, size), mended);
    at += kBlockHeaderBytes + size;
  }
  return mended;
}

}  // namespace
}  // namespace tumbler

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string good =
      tumbler::testing::RecordedBytes(tumbler::testing::SmallConfiguration(), 12);
  std::string input(reinterpret_cast<const char*>(data), size);
  // An input that is no record is a list of changes to a good one: four bytes each say where, and
  // what to.
  if (!input.starts_with('T')) {
    std::string changed = good;
    for (std::size_t i = 0; i + 3 < size; i += 4) {
      const std::size_t at =
          std::size_t{data[i]} | std::size_t{data[i + 1]} << 8 | std::size_t{data[i + 2]} << 16;
      changed[at % changed.size()] = static_cast<char>(data[i + 3]);
    }
    input = changed;
  }
  tumbler::ReadAll(tumbler::testing::AsBytes(input));
  tumbler::ReadAll(tumbler::Mended(tumbler::testing::AsBytes(input)));
  return 0;
}
