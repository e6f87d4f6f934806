#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tumbler {

/// The version of the file format that this build writes.
inline constexpr std::uint32_t kRecordVersion = 5;
/// The oldest version that this build reads. Version 1 has no truth; up to version 2 all numbers of
/// faults and refusals are floats; up to version 3 there is no sensor; up to version 4 the
/// configuration of the joints has 8 entries, however many joints there are.
inline constexpr std::uint32_t kRecordVersionMin = 1;

/// The content of a block of a flight record (docs/formats.md has the bytes).
enum class BlockKind : std::uint32_t {
  kConfiguration = 1,  ///< JSON text: RecordConfiguration.
  kFile = 2,           ///< A file that the run loaded: length of its name, name, text.
  kTick = 3,           ///< TickEntry.
  kLost = 4,           ///< Ticks that were executed but not recorded.
  kEnd = 5,            ///< RecordEnd: the recording ended in order.
  kTruth = 6,          ///< The true state of a simulated robot: an LCM message truth_t.
};

/// Ticks that were executed but not recorded.
struct LostTicks {
  std::int64_t first_index = 0;
  std::int64_t count = 0;
};

/// The content of the last block.
struct RecordEnd {
  std::int64_t ticks = 0;   ///< How many ticks were recorded.
  std::int64_t lost = 0;    ///< How many ticks were executed but not recorded.
  std::uint32_t crc32 = 0;  ///< Of everything before this block.
  std::string outcome;      ///< How the run ended, for people.
};

using RecordBytes = std::vector<std::uint8_t>;

/// The bytes with which every record begins.
inline constexpr std::size_t kRecordHeaderBytes = 16;
/// The bytes before the content of every block.
inline constexpr std::size_t kBlockHeaderBytes = 24;
/// A block's content is no longer than this.
inline constexpr std::size_t kBlockContentMax = 32U << 20U;

void AppendRecordHeader(RecordBytes& bytes);
/// @param number  of the block, from 0 on.
void AppendBlock(BlockKind kind, std::uint32_t number, std::span<const std::uint8_t> content,
                 RecordBytes& bytes);

[[nodiscard]] RecordBytes EncodeFile(std::string_view name, std::string_view text);
[[nodiscard]] RecordBytes EncodeLost(const LostTicks& lost);
[[nodiscard]] RecordBytes EncodeEnd(const RecordEnd& end);
/// @returns false when the bytes are no such content.
[[nodiscard]] bool DecodeFile(std::span<const std::uint8_t> content, std::string& name,
                              std::string& text);
[[nodiscard]] bool DecodeLost(std::span<const std::uint8_t> content, LostTicks& lost);
[[nodiscard]] bool DecodeEnd(std::span<const std::uint8_t> content, RecordEnd& end);

/// CRC-32 (ISO 3309, that of zlib and PNG), continued from the CRC of the bytes before.
[[nodiscard]] std::uint32_t Crc32(std::span<const std::uint8_t> bytes, std::uint32_t before = 0);

/// A block as it lies in the file.
struct Block {
  BlockKind kind = BlockKind::kTick;
  std::uint32_t number = 0;
  std::size_t offset = 0;  ///< Of its header in the file.
  std::span<const std::uint8_t> content;
};

/// A place in the file where bytes are damaged.
struct Damage {
  std::size_t offset = 0;  ///< In the file [bytes].
  std::string what;        ///< e.g. `block 17 (tick): its content does not have the CRC it had`
};

/// Goes through the blocks of a record in memory. Any bytes are safe to read: whole blocks are
/// handed out, damages are noted, and a file that was cut off is read up to its end.
class BlockReader {
 public:
  /// @param bytes  of the whole file; they must outlive the reader and its blocks.
  explicit BlockReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  /// The next whole block. @returns false at the end of what can be read.
  bool Next(Block& block);

  /// Damages found so far, in the order of the file. Damaged blocks are skipped.
  [[nodiscard]] const std::vector<Damage>& damages() const { return damages_; }
  /// Whether the file ends within a block or its header. Known after the last Next.
  [[nodiscard]] bool cut_off() const { return cut_off_; }
  /// Offset [bytes] at which reading goes on; at the end, at which the whole blocks end.
  [[nodiscard]] std::size_t offset() const { return offset_; }

 private:
  void Skip(const std::string& what);

  std::span<const std::uint8_t> bytes_;
  std::size_t offset_ = kRecordHeaderBytes;
  std::uint32_t expected_ = 0;
  bool cut_off_ = false;
  std::vector<Damage> damages_;
};

/// The kind of a file, by its first bytes.
enum class RecordStart : std::uint8_t {
  kRecord,        ///< A flight record that this build reads.
  kOtherVersion,  ///< A flight record of another version.
  kNotARecord,    ///< No flight record; perhaps a log of candump.
  kTooShort,      ///< Cut off within its first 16 bytes.
  kDamaged,       ///< A flight record whose header is damaged.
};
[[nodiscard]] RecordStart StartOf(std::span<const std::uint8_t> bytes);
/// The version in the header of the file; 0 when the file is too short.
[[nodiscard]] std::uint32_t VersionOf(std::span<const std::uint8_t> bytes);

}  // namespace tumbler
