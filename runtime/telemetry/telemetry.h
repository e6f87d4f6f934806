#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "runtime/telemetry/run_description.h"
#include "runtime/telemetry/timed_record.h"

namespace tumbler {

/// Where telemetry goes; an empty name leaves that output out.
struct TelemetryConfig {
  std::string log_file;    ///< LCM log, for lcm-logplayer and lcm-spy.
  std::string lcm_url;     ///< Live LCM, e.g. `udpm://239.255.76.67:7667?ttl=0`.
  std::string trace_file;  ///< CSV, one row a tick.
  RunDescription run;
  std::int64_t utime_at_zero_us =
      0;  ///< Log time of loop time 0: 0 for virtual time, else microseconds since 1970.
};

/// Takes records out of the control loop and writes them. LCM allocates and may block for
/// milliseconds, so the loop only ever pushes into a ring; everything else happens in whoever
/// drains it: a thread of its own (Start), or the caller between ticks (Drain), which in virtual
/// time loses nothing and makes the log reproducible.
class Telemetry {
 public:
  /// @throws std::runtime_error naming the file or URL that cannot be opened.
  explicit Telemetry(const TelemetryConfig& config);
  ~Telemetry();
  Telemetry(const Telemetry&) = delete;
  Telemetry& operator=(const Telemetry&) = delete;

  /// From the loop: never blocks. A record that does not fit is counted as lost.
  void Push(const TimedRecord& record) noexcept;

  /// Writes what the ring holds. Not while a thread is started.
  void Drain();
  /// How the loop's thread is scheduled, once that is known. Before the first record: its thread
  /// does not look at it earlier.
  void SetScheduling(const std::string& scheduling);
  /// Drains in a thread until Stop.
  void Start();
  /// Ends the thread, writes the rest and flushes. @throws std::runtime_error if a file could not
  /// be written whole.
  void Stop();

  [[nodiscard]] std::int64_t lost() const noexcept;  ///< Records that the ring had no room for.
  [[nodiscard]] std::int64_t unpublished() const noexcept;  ///< Messages that LCM did not take.
  [[nodiscard]] std::int64_t written() const noexcept;      ///< Records that were drained.

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
