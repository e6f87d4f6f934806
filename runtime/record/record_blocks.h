#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tumbler {

/// The version of the file format that this build writes.
inline constexpr std::uint32_t kRecordVersion = 2;
/// The oldest version that it reads: version 1 has no truth.
inline constexpr std::uint32_t kRecordVersionMin = 1;

/// What a block of a flight record holds (docs/formats.md has the bytes).
enum class BlockKind : std::uint32_t {
  kConfiguration = 1,  ///< JSON text: RecordConfiguration.
  kFile = 2,           ///< A file that was loaded: length of its name, name, text.
  kTick = 3,           ///< TickEntry.
  kLost = 4,           ///< Ticks that were executed but not recorded.
  kEnd = 5,            ///< The recording was ended in order.
  kTruth = 6,          ///< What is true of a simulated robot: an LCM message truth_t.
};

/// Ticks of which the record knows nothing but that they were.
struct LostTicks {
  std::int64_t first_index = 0;
  std::int64_t count = 0;
};

/// The last block.
struct RecordEnd {
  std::int64_t ticks = 0;   ///< Recorded.
  std::int64_t lost = 0;    ///< Executed, but not recorded.
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
/// @returns false when the bytes are not that.
[[nodiscard]] bool DecodeFile(std::span<const std::uint8_t> content, std::string& name,
                              std::string& text);
[[nodiscard]] bool DecodeLost(std::span<const std::uint8_t> content, LostTicks& lost);
[[nodiscard]] bool DecodeEnd(std::span<const std::uint8_t> content, RecordEnd& end);

/// CRC-32 (ISO 3309, that of zlib and PNG), continued from the one of what came before.
[[nodiscard]] std::uint32_t Crc32(std::span<const std::uint8_t> bytes, std::uint32_t before = 0);

/// A block as it lies in the file.
struct Block {
  BlockKind kind = BlockKind::kTick;
  std::uint32_t number = 0;
  std::size_t offset = 0;  ///< Of its header in the file.
  std::span<const std::uint8_t> content;
};

/// Bytes of the file that are not what they were.
struct Damage {
  std::size_t offset = 0;  ///< In the file.
  std::string what;        ///< e.g. `block 17 (tick): its content does not have the CRC it had`
};

/// Goes through the blocks of a record in memory, whatever its bytes are: what is whole is handed
/// out, what is damaged is said, and a file that was cut off is read up to there.
class BlockReader {
 public:
  /// @param bytes  of the whole file; they must outlive the reader and its blocks.
  explicit BlockReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  /// The next whole block. @returns false at the end of what can be read.
  bool Next(Block& block);

  /// Found so far, in the order of the file. A block of no use is skipped.
  [[nodiscard]] const std::vector<Damage>& damages() const { return damages_; }
  /// After the last Next: the file ends within a block (or within its header).
  [[nodiscard]] bool cut_off() const { return cut_off_; }
  /// Where reading goes on; at the end, where whole blocks end.
  [[nodiscard]] std::size_t offset() const { return offset_; }

 private:
  void Skip(const std::string& what);

  std::span<const std::uint8_t> bytes_;
  std::size_t offset_ = kRecordHeaderBytes;
  std::uint32_t expected_ = 0;
  bool cut_off_ = false;
  std::vector<Damage> damages_;
};

/// What the first bytes of a file say about it.
enum class RecordStart : std::uint8_t {
  kRecord,
  kOtherVersion,
  kNotARecord,  ///< Not a flight record at all; perhaps a log of candump.
  kTooShort,    ///< Cut off within its first 16 bytes.
  kDamaged,
};
[[nodiscard]] RecordStart StartOf(std::span<const std::uint8_t> bytes);
/// The version that the file says it has; 0 when it is too short.
[[nodiscard]] std::uint32_t VersionOf(std::span<const std::uint8_t> bytes);

}  // namespace tumbler
