#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "runtime/record/run_description.h"
#include "runtime/record/timed_record.h"

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
/// LCM allocates and may block for milliseconds, and a file may block for ever, so the loop only
/// pushes records into rings. Each output has a ring of its own, and either a thread of its own
/// that empties it (Start), so that none keeps another one waiting, or the caller does between
/// ticks (Drain). In virtual time the latter loses nothing and makes the log reproducible.
class Telemetry {
 public:
  /// @throws std::runtime_error naming the file or URL that cannot be opened.
  explicit Telemetry(const TelemetryConfig& config);
  /// Without Stop, what is in the rings is written, as far as the outputs take it within a second.
  ~Telemetry();
  Telemetry(const Telemetry&) = delete;
  Telemetry& operator=(const Telemetry&) = delete;

  /// Puts a record into the rings, from the loop. It never blocks, and counts a record for which
  /// one of them has no room as lost.
  void Push(const TimedRecord& record) noexcept;

  /// Writes the records in the rings. Must not be called between Start and Stop.
  void Drain();
  /// Sets how the loop's thread is scheduled, when that is known only after construction.
  void SetScheduling(const std::string& scheduling);
  /// From now on until the first record, run_t says that the drives are being checked, live, four
  /// times a second: so others know of the run, and can end it.
  void NoteChecking();
  /// A request has ended the check, and with it the run. run_t says so to who sent it.
  /// @param request_id  0: it did not come by LCM.
  void NoteCheckEnded(std::uint32_t request_id);
  /// Starts threads that empty the rings until Stop, unless they are there.
  void Start();
  /// Ends the threads, when they have written the remaining records. Whole files appear. A thread
  /// whose output takes nothing for too long is left behind.
  /// @param patience  for how long it may; asked again and again, since whoever waits for the end
  ///                  may lose it. Empty: 10 s.
  /// @throws std::runtime_error  naming the files that could not be written whole.
  void Stop(const std::function<std::chrono::milliseconds()>& patience = {});

  /// Records for which a ring had no room.
  [[nodiscard]] std::int64_t lost() const noexcept;
  [[nodiscard]] std::int64_t unpublished() const noexcept;  ///< Messages that LCM did not take.
  /// Records that all outputs have taken.
  [[nodiscard]] std::int64_t written() const noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
