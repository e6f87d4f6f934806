#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "runtime/core/tick.h"
#include "runtime/core/tick_entry.h"
#include "runtime/record/record_blocks.h"

namespace tumbler {

/// Where and what to record.
struct FlightRecorderConfig {
  std::string file;  ///< Must not exist: a record is never overwritten.
  /// The blocks before the first tick, without the file's header (`EncodeConfiguration`).
  RecordBytes configuration;
  /// Room between loop and file. A tick of two joints takes about 300 bytes: 14 s at 1 kHz, longer
  /// than any stall of a disk that was seen.
  std::size_t ring_bytes = std::size_t{4} << 20U;
  /// Called by the draining thread, at once, when recording has stopped or ticks were lost.
  std::function<void(const std::string&)> say;
};

/// Writes every tick of a control loop into one file that is whole up to the last block written,
/// whatever happens to the process; docs/formats.md has the format.
///
/// The loop only encodes into a ring; whoever drains it writes: a thread of its own (Start), or the
/// caller between ticks (Drain), as Telemetry. Blocks go to the kernel within milliseconds, where
/// the end of the process does not touch them, and to the disk once a second.
///
/// Memory is bounded by the ring. Ticks that it has no room for are counted, said and marked in the
/// file. When the file cannot be written (disk full, limit on its size) the recording stops, says
/// what and when, and the file is cut back to its last whole block; the loop goes on. Where files
/// are limited in size (`ulimit -f`) the program has to ignore SIGXFSZ for that.
class FlightRecorder {
 public:
  /// Writes the configuration. @throws std::runtime_error naming the file when it exists already or
  /// cannot be written; no file is left then.
  explicit FlightRecorder(const FlightRecorderConfig& config);
  /// Without Stop before it: writes the rest, but no end block; removes a file without a tick.
  ~FlightRecorder();
  FlightRecorder(const FlightRecorder&) = delete;
  FlightRecorder& operator=(const FlightRecorder&) = delete;

  /// From the loop, in every tick: does not allocate, lock or block. Parameters are EncodeTick's.
  void Push(const TickNotes& notes, const TickInput& input, const TickOutput& output) noexcept;

  /// What is true of a simulated robot after the last tick: an LCM message truth_t of at most
  /// kTickEntryBytesMax bytes. Where the ring has no room for it, it is left out. From the loop's
  /// thread, without allocating.
  void PushTruth(std::span<const std::uint8_t> message) noexcept;

  /// Writes what the ring holds. Not while a thread is started.
  void Drain();
  /// Drains in a thread until Stop.
  void Start();
  /// Ends the thread, writes the rest and the block that says that the record is complete.
  /// @param outcome  of the run, for people.
  void Stop(const std::string& outcome);

  [[nodiscard]] std::int64_t pushed() const noexcept;    ///< Ticks of the loop.
  [[nodiscard]] std::int64_t recorded() const noexcept;  ///< Ticks in the file.
  [[nodiscard]] std::int64_t lost() const noexcept;      ///< Ticks that the ring had no room for.
  /// Why recording has stopped early; empty if it has not. After Stop, or between calls of Drain.
  [[nodiscard]] const std::string& problem() const noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
