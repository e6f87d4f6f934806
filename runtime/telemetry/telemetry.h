#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "runtime/telemetry/run_description.h"
#include "runtime/telemetry/timed_record.h"

namespace tumbler {

/// The outputs of telemetry. An empty name leaves that output out.
struct TelemetryConfig {
  std::string log_file;    ///< LCM log, for lcm-logplayer and lcm-spy.
  std::string lcm_url;     ///< Live LCM, e.g. `udpm://239.255.76.67:7667?ttl=0`.
  std::string trace_file;  ///< CSV, one row a tick.
  /// Whether the files appear only when they are whole, by Stop: where what they are made of is
  /// kept elsewhere. Else a run that is ended leaves what it has written.
  bool whole_files = false;
  RunDescription run;
  /// The log's time at time 0 of the loop: 0 for virtual time, else microseconds since 1970.
  std::int64_t utime_at_zero_us = 0;
};

/// Takes records out of the control loop and writes them.
///
/// LCM allocates and may block for milliseconds, so the loop only pushes records into a ring. They
/// are written either by a thread that drains the ring (Start), or by the caller between ticks
/// (Drain). In virtual time the latter loses nothing and makes the log reproducible.
class Telemetry {
 public:
  /// @throws std::runtime_error naming the file or URL that cannot be opened.
  explicit Telemetry(const TelemetryConfig& config);
  ~Telemetry();
  Telemetry(const Telemetry&) = delete;
  Telemetry& operator=(const Telemetry&) = delete;

  /// Puts a record into the ring, from the loop. It never blocks, and counts a record for which
  /// there is no room as lost.
  void Push(const TimedRecord& record) noexcept;

  /// Writes the records in the ring. Must not be called between Start and Stop.
  void Drain();
  /// Sets how the loop's thread is scheduled, when that is known only after construction. Must be
  /// called before the first Push, since the draining thread does not read it earlier.
  void SetScheduling(const std::string& scheduling);
  /// Starts a thread that drains the ring until Stop.
  void Start();
  /// Ends the thread, writes the remaining records and flushes. Whole files appear.
  /// @throws std::runtime_error  when a file could not be written whole.
  void Stop();

  [[nodiscard]] std::int64_t lost() const noexcept;  ///< Records that the ring had no room for.
  [[nodiscard]] std::int64_t unpublished() const noexcept;  ///< Messages that LCM did not take.
  [[nodiscard]] std::int64_t written() const noexcept;      ///< Records that were drained.

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
