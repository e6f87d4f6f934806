#include "runtime/record/record_blocks.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "common/files/file_kind.h"

namespace tumbler {
namespace {

constexpr std::uint32_t kBlockMagic = 0x4b'4c'42'54;  // "TBLK" in the file
constexpr std::array<std::uint8_t, 4> kBlockMagicBytes = {'T', 'B', 'L', 'K'};

void Put(std::uint64_t value, std::size_t size, RecordBytes& bytes) {
  for (std::size_t i = 0; i < size; ++i) {
    bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  }
}

std::uint64_t Get(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i) value |= std::uint64_t{bytes[at + i]} << (8 * i);
  return value;
}

std::uint32_t Get32(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint32_t>(Get(bytes, at, 4));
}

std::int64_t Get64(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::int64_t>(Get(bytes, at, 8));
}

void PutBytes(std::span<const std::uint8_t> more, RecordBytes& bytes) {
  if (more.empty()) return;
  const std::size_t before = bytes.size();
  bytes.resize(before + more.size());
  std::memcpy(bytes.data() + before, more.data(), more.size());
}

void PutText(std::string_view text, RecordBytes& bytes) {
  PutBytes({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, bytes);
}

std::string ToText(std::span<const std::uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

const char* NameOf(BlockKind kind) {
  switch (kind) {
    case BlockKind::kConfiguration:
      return "configuration";
    case BlockKind::kFile:
      return "file";
    case BlockKind::kTick:
      return "tick";
    case BlockKind::kLost:
      return "lost ticks";
    case BlockKind::kEnd:
      return "end";
    case BlockKind::kTruth:
      return "truth";
  }
  return "unknown kind";
}

}  // namespace

std::uint32_t Crc32(std::span<const std::uint8_t> bytes, std::uint32_t before) {
  return static_cast<std::uint32_t>(crc32_z(before, bytes.data(), bytes.size()));
}

void AppendRecordHeader(RecordBytes& bytes) {
  const std::size_t begin = bytes.size();
  PutBytes(kFlightRecordBegin, bytes);
  Put(kRecordVersion, 4, bytes);
  Put(Crc32(std::span(bytes).subspan(begin, 12)), 4, bytes);
}

void AppendBlock(BlockKind kind, std::uint32_t number, std::span<const std::uint8_t> content,
                 RecordBytes& bytes) {
  const std::size_t begin = bytes.size();
  Put(kBlockMagic, 4, bytes);
  Put(static_cast<std::uint32_t>(kind), 4, bytes);
  Put(number, 4, bytes);
  Put(content.size(), 4, bytes);
  Put(Crc32(content), 4, bytes);
  Put(Crc32(std::span(bytes).subspan(begin, 20)), 4, bytes);
  PutBytes(content, bytes);
}

RecordBytes EncodeFile(std::string_view name, std::string_view text) {
  RecordBytes bytes;
  Put(name.size(), 4, bytes);
  PutText(name, bytes);
  PutText(text, bytes);
  return bytes;
}

bool DecodeFile(std::span<const std::uint8_t> content, std::string& name, std::string& text) {
  if (content.size() < 4) return false;
  const std::size_t size = Get32(content, 0);
  content = content.subspan(4);
  if (size > content.size()) return false;
  name = ToText(content.first(size));
  text = ToText(content.subspan(size));
  return true;
}

RecordBytes EncodeLost(const LostTicks& lost) {
  RecordBytes bytes;
  Put(static_cast<std::uint64_t>(lost.first_index), 8, bytes);
  Put(static_cast<std::uint64_t>(lost.count), 8, bytes);
  return bytes;
}

bool DecodeLost(std::span<const std::uint8_t> content, LostTicks& lost) {
  if (content.size() != 16) return false;
  lost = {Get64(content, 0), Get64(content, 8)};
  return lost.first_index >= 0 && lost.count > 0;
}

RecordBytes EncodeEnd(const RecordEnd& end) {
  RecordBytes bytes;
  Put(static_cast<std::uint64_t>(end.ticks), 8, bytes);
  Put(static_cast<std::uint64_t>(end.lost), 8, bytes);
  Put(end.crc32, 4, bytes);
  PutText(end.outcome, bytes);
  return bytes;
}

bool DecodeEnd(std::span<const std::uint8_t> content, RecordEnd& end) {
  if (content.size() < 20) return false;
  end = {Get64(content, 0), Get64(content, 8), Get32(content, 16), ToText(content.subspan(20))};
  return true;
}

std::uint32_t VersionOf(std::span<const std::uint8_t> bytes) {
  return bytes.size() < kRecordHeaderBytes ? 0 : Get32(bytes, 8);
}

RecordStart StartOf(std::span<const std::uint8_t> bytes) {
  const std::size_t known = std::min(bytes.size(), kFlightRecordBegin.size());
  if (!std::equal(kFlightRecordBegin.begin(),
                  kFlightRecordBegin.begin() + static_cast<std::ptrdiff_t>(known), bytes.begin())) {
    return RecordStart::kNotARecord;
  }
  if (bytes.size() < kRecordHeaderBytes) return RecordStart::kTooShort;
  if (Crc32(bytes.first(12)) != Get32(bytes, 12)) return RecordStart::kDamaged;
  const std::uint32_t version = VersionOf(bytes);
  return version >= kRecordVersionMin && version <= kRecordVersion ? RecordStart::kRecord
                                                                   : RecordStart::kOtherVersion;
}

bool BlockReader::Next(Block& block) {
  while (offset_ < bytes_.size()) {
    const std::span<const std::uint8_t> rest = bytes_.subspan(offset_);
    if (rest.size() < kBlockHeaderBytes) {
      cut_off_ = true;
      return false;
    }
    if (Get32(rest, 0) != kBlockMagic || Crc32(rest.first(20)) != Get32(rest, 20)) {
      Skip(fmt::format("block {}: its header does not have the CRC it had", expected_));
      continue;
    }
    block.kind = static_cast<BlockKind>(Get32(rest, 4));
    block.number = Get32(rest, 8);
    const std::size_t size = Get32(rest, 12);
    block.offset = offset_;
    if (size > kBlockContentMax) {
      Skip(fmt::format("block {} ({}): is too long ({} bytes)", block.number, NameOf(block.kind),
                       size));
      continue;
    }
    if (rest.size() - kBlockHeaderBytes < size) {
      cut_off_ = true;
      return false;
    }
    if (block.number != expected_) {
      damages_.push_back({offset_, fmt::format("blocks {} ... are missing; block {} ({}) follows",
                                               expected_, block.number, NameOf(block.kind))});
    }
    expected_ = block.number + 1;
    offset_ += kBlockHeaderBytes + size;
    block.content = rest.subspan(kBlockHeaderBytes, size);
    if (Crc32(block.content) != Get32(rest, 16)) {
      damages_.push_back(
          {block.offset, fmt::format("block {} ({}): its content does not have the CRC it had",
                                     block.number, NameOf(block.kind))});
      continue;
    }
    return true;
  }
  return false;
}

void BlockReader::Skip(const std::string& what) {
  damages_.push_back({offset_, what});
  const auto begin = bytes_.begin() + static_cast<std::ptrdiff_t>(offset_) + 1;
  const auto next =
      std::search(begin, bytes_.end(), kBlockMagicBytes.begin(), kBlockMagicBytes.end());
  offset_ = static_cast<std::size_t>(next - bytes_.begin());
  // This block has been reported as damaged, so its number is not expected again.
  if (next != bytes_.end()) expected_ = expected_ + 1;
}

}  // namespace tumbler
