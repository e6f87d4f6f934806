#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "runtime/executor/tick_entry.h"
#include "runtime/record/record_blocks.h"
#include "runtime/record/record_configuration.h"

namespace tumbler {

/// The bytes of a file, mapped into memory.
class MappedFile {
 public:
  /// @throws RecordError naming the file that cannot be read.
  explicit MappedFile(const std::string& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return bytes_; }

 private:
  std::span<const std::uint8_t> bytes_;
};

/// Reads a flight record: its configuration at once, then one tick after the other. Any bytes are
/// safe to read. A record that was cut off is read up to its end.
class FlightRecord {
 public:
  /// @param bytes  of the whole file; they must outlive the record.
  /// @param name   of the file, for messages.
  /// @throws RecordError  when the bytes are no record of a known version, or its configuration is
  /// not whole.
  FlightRecord(std::span<const std::uint8_t> bytes, std::string name);

  [[nodiscard]] const RecordConfiguration& configuration() const { return configuration_; }
  [[nodiscard]] const std::string& name() const { return name_; }

  /// The next tick. @returns false at the end of what can be read.
  bool Next(TickEntry& entry);
  /// The true states of a simulated robot that were recorded just before the tick that Next gave
  /// last (at the end of the record: after the last tick), as LCM messages truth_t in order. Valid
  /// until the next call of Next.
  [[nodiscard]] std::span<const std::span<const std::uint8_t>> truths() const { return truths_; }
  /// Goes back to the first tick.
  void Rewind();

  /// Damages, losses and the end that were found up to the last Next.
  [[nodiscard]] const std::vector<Damage>& damages() const { return damages_; }
  [[nodiscard]] const std::vector<LostTicks>& lost() const { return lost_; }
  [[nodiscard]] const std::optional<RecordEnd>& end() const { return end_; }
  [[nodiscard]] bool cut_off() const { return reader_.cut_off(); }
  /// Offset in the file [bytes] at which the whole blocks that were read end.
  [[nodiscard]] std::size_t offset() const { return reader_.offset(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] std::uint32_t version() const { return VersionOf(bytes_); }
  /// Offset in the file [bytes] of the last tick's block.
  [[nodiscard]] std::size_t tick_offset() const { return tick_offset_; }

  /// Remarks for people, to be asked for after the last Next: one sentence on how the record ends
  /// (complete, interrupted, or cut off and where), and a line for everything that is lost or
  /// damaged.
  [[nodiscard]] std::vector<std::string> Remarks() const;

 private:
  void TakeDamages();

  std::span<const std::uint8_t> bytes_;
  std::string name_;
  RecordConfiguration configuration_;
  BlockReader reader_;
  BlockReader after_configuration_;
  std::size_t taken_damages_ = 0;
  std::vector<Damage> damages_;
  std::vector<LostTicks> lost_;
  std::optional<RecordEnd> end_;
  std::vector<std::span<const std::uint8_t>> truths_;
  std::size_t tick_offset_ = 0;
};

}  // namespace tumbler
