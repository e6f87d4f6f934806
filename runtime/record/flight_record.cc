#include "runtime/record/flight_record.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/files/file_kind.h"
#include "runtime/record/sentences.h"

namespace tumbler {
namespace {

/// The version since which the integers of faults and refusals are integers.
constexpr std::uint32_t kIntegerDetails = 3;

/// Makes integers of the floats of an earlier version.
void TakeFloats(TickRecord& record) {
  const auto take = [](DetailNumber& number, DetailUnit unit) {
    number = FromDouble(double{number.real()}, unit);
  };
  take(record.first_fault.value, UnitOf(record.first_fault.fault));
  take(record.first_fault.limit, UnitOf(record.first_fault.fault));
  take(record.refusal.value, UnitOf(record.refusal.refusal));
  take(record.refusal.limit, UnitOf(record.refusal.refusal));
}

}  // namespace

MappedFile::MappedFile(const std::string& path) {
  const auto fail = [&path](int error) {
    throw RecordError(
        fmt::format("{}: cannot be read: {}", path, std::generic_category().message(error)));
  };
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail(errno);
  struct stat status {};
  int error = fstat(descriptor, &status) != 0 ? errno : 0;
  if (error == 0 && !S_ISREG(status.st_mode)) error = S_ISDIR(status.st_mode) ? EISDIR : EINVAL;
  if (error == 0 && status.st_size > 0) {
    const auto size = static_cast<std::size_t>(status.st_size);
    void* const memory = mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
    if (memory == MAP_FAILED) {
      error = errno;
    } else {
      bytes_ = {static_cast<const std::uint8_t*>(memory), size};
    }
  }
  close(descriptor);
  if (error != 0) fail(error);
}

MappedFile::~MappedFile() {
  if (!bytes_.empty()) munmap(const_cast<std::uint8_t*>(bytes_.data()), bytes_.size());
}

namespace {

std::string NotARecord(std::span<const std::uint8_t> bytes) {
  const std::string_view kind =
      KindOfRunFile({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  return kind.empty() ? "is not a flight record"
                      : fmt::format("is not a flight record, but {}", kind);
}

}  // namespace

FlightRecord::FlightRecord(std::span<const std::uint8_t> bytes, std::string name)
    : bytes_(bytes), name_(std::move(name)), reader_(bytes), after_configuration_(bytes) {
  const auto fail = [this](const std::string& problem) {
    throw RecordError(fmt::format("{}: {}", name_, problem));
  };
  switch (StartOf(bytes)) {
    case RecordStart::kRecord:
      break;
    case RecordStart::kOtherVersion:
      fail(
          fmt::format("is a flight record of another version; this program reads versions {} to {}",
                      kRecordVersionMin, kRecordVersion));
      break;
    case RecordStart::kNotARecord:
      fail(NotARecord(bytes));
      break;
    case RecordStart::kTooShort:
      fail("is cut off within its first 16 bytes");
      break;
    case RecordStart::kDamaged:
      fail("is damaged in its first 16 bytes");
      break;
  }
  const auto next = [&](Block& block, BlockKind kind, const char* what) {
    const bool there = reader_.Next(block);
    if (!reader_.damages().empty()) {
      const Damage& damage = reader_.damages().front();
      fail(fmt::format("byte {}: {}", damage.offset, damage.what));
    }
    if (!there || block.kind != kind) fail(fmt::format("is cut off within {}", what));
  };
  Block block;
  next(block, BlockKind::kConfiguration, "its configuration");
  try {
    configuration_ = ParseConfiguration(std::string_view(
        reinterpret_cast<const char*>(block.content.data()), block.content.size()));
  } catch (const RecordError& error) {
    fail(error.what());
  }
  for (LoadedFile& file : configuration_.files) {
    next(block, BlockKind::kFile, "the files of its configuration");
    if (!DecodeFile(block.content, file.path, file.text)) {
      fail(fmt::format("byte {}: is not the file that it should be", block.offset));
    }
  }
  after_configuration_ = reader_;
}

void FlightRecord::Rewind() {
  reader_ = after_configuration_;
  taken_damages_ = 0;
  damages_.clear();
  lost_.clear();
  truths_.clear();
  end_.reset();
}

void FlightRecord::TakeDamages() {
  const std::vector<Damage>& found = reader_.damages();
  damages_.insert(damages_.end(), found.begin() + static_cast<std::ptrdiff_t>(taken_damages_),
                  found.end());
  taken_damages_ = found.size();
}

bool FlightRecord::Next(TickEntry& entry) {
  Block block;
  truths_.clear();
  while (!end_ && reader_.Next(block)) {
    TakeDamages();
    const auto damaged = [this, &block](const std::string& what) {
      damages_.push_back({block.offset, fmt::format("block {}: {}", block.number, what)});
    };
    switch (block.kind) {
      case BlockKind::kTick:
        tick_offset_ = block.offset;
        if (DecodeTick(block.content, entry, version())) {
          if (version() < kIntegerDetails) TakeFloats(entry.record);
          return true;
        }
        damaged("does not hold a tick");
        break;
      case BlockKind::kLost: {
        LostTicks lost;
        if (DecodeLost(block.content, lost)) {
          lost_.push_back(lost);
        } else {
          damaged("does not say which ticks were lost");
        }
        break;
      }
      case BlockKind::kEnd: {
        RecordEnd end;
        if (!DecodeEnd(block.content, end)) {
          damaged("does not hold the end of a record");
        } else if (Crc32(bytes_.first(block.offset)) != end.crc32) {
          damaged("the file before it does not have the CRC it had");
        } else {
          end_ = end;
          if (offset() < size()) {
            damages_.push_back({offset(), fmt::format("{} bytes are behind the end of the record",
                                                      size() - offset())});
          }
        }
        break;
      }
      case BlockKind::kTruth:
        truths_.push_back(block.content);
        break;
      case BlockKind::kConfiguration:
      case BlockKind::kFile:
        damaged("is a second configuration");
        break;
      default:
        damaged(fmt::format("is of an unknown kind ({})", static_cast<std::uint32_t>(block.kind)));
    }
  }
  TakeDamages();
  return false;
}

std::vector<std::string> FlightRecord::Remarks() const {
  std::vector<std::string> remarks;
  for (const Damage& damage : damages_) {
    remarks.push_back(fmt::format("damaged at byte {}: {}", damage.offset, damage.what));
  }
  for (const LostTicks& lost : lost_) {
    remarks.push_back(fmt::format("{} ticks were not recorded, after {} ticks of the run",
                                  lost.count, lost.first_index));
  }
  if (cut_off()) {
    remarks.push_back(fmt::format("cut off: {} bytes after byte {} are no whole block",
                                  size() - offset(), offset()));
  }
  if (end_) {
    remarks.push_back(fmt::format("complete: {}", end_->outcome));
  } else if (damages_.empty()) {
    remarks.emplace_back("the recording was interrupted: it has no end block");
  } else {
    remarks.emplace_back("it has no end block that is whole and fits what is before it");
  }
  return remarks;
}

}  // namespace tumbler
