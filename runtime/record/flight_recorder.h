#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "runtime/record/record_blocks.h"
#include "runtime/record/tick_outlet.h"

namespace tumbler {

/// Settings of a FlightRecorder.
struct FlightRecorderConfig {
  std::string file;  ///< Must not exist: a record is never overwritten.
  /// The blocks before the first tick, without the file's header (`EncodeConfiguration`).
  RecordBytes configuration;
  std::size_t ring_bytes = RingBytes(2, 1000);  ///< Between loop and file.
  /// Called at once by the draining thread when recording has stopped or ticks were lost.
  std::function<void(const std::string&)> say;
};

/// @throws std::runtime_error  naming the file, when it is there already: a record is never
/// overwritten.
void RequireNewRecord(const std::string& file);
/// @throws std::runtime_error  naming a file that is a flight record, in whose place something else
/// would be written.
void KeepRecords(std::span<const std::string> files);

/// Writes every tick of a control loop into one file. Whatever happens to the process, the file is
/// whole up to the last block written. docs/formats.md has the format.
///
/// A TickOutlet keeps it apart from the loop. Blocks go to the kernel within milliseconds, where
/// the end of the process does not touch them, and to the disk once a second.
///
/// The ring bounds the memory. Ticks for which it has no room are counted, reported and marked in
/// the file. When the file cannot be written (disk full, limit on its size), the recorder reports
/// it, cuts the file back to its last whole block and stops, while the loop goes on. Where files
/// are limited in size (`ulimit -f`), the program has to ignore SIGXFSZ for this to work.
class FlightRecorder final : public TickSink {
 public:
  /// Writes the configuration.
  /// @throws std::runtime_error  naming the file, when it exists already or cannot be written. No
  /// file is left then.
  explicit FlightRecorder(const FlightRecorderConfig& config);
  /// When Stop was not called, writes the rest but no end block, as far as the file takes it within
  /// a second, and removes a file without a tick.
  ~FlightRecorder() override;

  /// Ticks for which the ring has no room are counted, true states are left out.
  void Push(std::span<const std::uint8_t> message) noexcept override;
  void Drain() override;
  void Start() override;
  /// Writes the rest and the block that says that the record is complete, and ends the thread. One
  /// whose file takes nothing for too long is left behind, which is the record's problem then.
  /// @param outcome   of the run, for people.
  /// @param patience  as that of TickOutlet::Stop.
  void Stop(const std::string& outcome, const Patience& patience = {});

  [[nodiscard]] std::int64_t pushed() const noexcept;    ///< Ticks of the loop.
  [[nodiscard]] std::int64_t recorded() const noexcept;  ///< Ticks in the file.
  [[nodiscard]] std::int64_t lost() const noexcept;      ///< Ticks for which the ring had no room.
  /// Why recording has stopped early; empty if it has not. Call it after Stop, or between calls of
  /// Drain.
  [[nodiscard]] const std::string& problem() const noexcept;

 private:
  struct Writer;
  std::shared_ptr<Writer> writer_;  // A thread that is stuck in a write keeps it.
  TickOutlet outlet_;
  std::string left_behind_;  // says that the thread was, if it was
};

}  // namespace tumbler
