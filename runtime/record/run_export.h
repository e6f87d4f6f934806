#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "runtime/executor/tick_entry.h"
#include "runtime/record/timed_record.h"

namespace tumbler {

/// An output that is made of a run's ticks, in their order: while the run goes on (Telemetry), or
/// of its flight record (ExportRecord). It may allocate and block.
class RunExport {
 public:
  /// @param file  empty: it is none.
  explicit RunExport(std::string file) : file_(std::move(file)) {}
  RunExport(const RunExport&) = delete;
  RunExport& operator=(const RunExport&) = delete;
  virtual ~RunExport() = default;

  virtual void Take(const TickEntry& entry, const TimedRecord& timed) = 0;
  /// The true state of a simulated robot after the last tick, an LCM message truth_t or
  /// space_truth_t.
  virtual void TakeTruth(std::span<const std::uint8_t> /*truth*/) {}
  /// Called again and again while nothing more has come, in a thread.
  virtual void Idle() {}
  /// Writes what comes after the last tick.
  virtual void Finish() {}
  /// Puts a whole file in place, after Finish.
  virtual void Commit() {}
  [[nodiscard]] virtual bool failed() const { return false; }
  /// Grows as long as what is written to takes something, besides with each tick. Any thread may
  /// ask.
  [[nodiscard]] virtual std::int64_t progress() const noexcept { return 0; }
  [[nodiscard]] const std::string& file() const { return file_; }

 private:
  std::string file_;
};

}  // namespace tumbler
