#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "firmware_interface/devices/sample_times.h"
#include "runtime/record/run_description.h"
#include "runtime/record/tick_feed.h"
#include "runtime/record/tick_outlet.h"

namespace tumbler {

class RunExport;
struct RunExportConfig;

/// The outputs of telemetry. An empty name leaves that output out.
struct TelemetryConfig {
  std::string log_file;      ///< LCM log, for lcm-logplayer and lcm-spy.
  std::string lcm_url;       ///< Live LCM, e.g. `udpm://239.255.76.67:7667?ttl=0`.
  std::string trace_file;    ///< CSV, one row a tick.
  std::string truth_file;    ///< LCM log of the true states of a simulated robot.
  std::string candump_file;  ///< Every frame, as `candump -l` logs it.
  /// Makes one more, which this library does not know; may be empty.
  std::function<std::unique_ptr<RunExport>(const RunExportConfig&)> another;
  RunDescription run;
  /// The log's time at time 0 of the loop: 0 for virtual time, else microseconds since 1970.
  std::int64_t utime_at_zero_us = 0;
  SampleTimes replies;  ///< Of the run's drives; of none: not known when replies were sampled.
};

/// Exports of a run that are made while it goes on, of the same ticks as its flight record and by
/// the same code as those of a record (run_exports.h).
///
/// LCM allocates and may block for milliseconds, and a file may block for ever. Each output has a
/// TickOutlet of its own, so that none keeps the loop or another one waiting.
class Telemetry final : public TickSink {
 public:
  /// @throws std::runtime_error naming the file or URL that cannot be opened.
  explicit Telemetry(const TelemetryConfig& config);
  /// Without Stop, what is in the rings is written, as far as the outputs take it within a second.
  ~Telemetry() override;

  /// Counts a tick for which one of the outputs has no room as lost.
  void Push(std::span<const std::uint8_t> message) noexcept override;
  void Drain() override;
  void Start() override;
  /// Sets how the loop's thread is scheduled, when that is known only after construction.
  void SetScheduling(const std::string& scheduling);
  /// From now on until the first record, run_t says that the drives are being checked, live, four
  /// times a second: so others know of the run, and can end it.
  void NoteChecking();
  /// A request has ended the check, and with it the run. run_t says so to who sent it.
  /// @param request_id  0: it did not come by LCM.
  void NoteCheckEnded(std::uint32_t request_id);
  /// Ends the threads, when they have written the remaining ticks. A thread whose output takes
  /// nothing for too long is left behind.
  /// @param patience  as that of TickOutlet::Stop.
  /// @throws std::runtime_error  naming the files that could not be written whole.
  void Stop(const Patience& patience = {});

  /// Ticks for which an output had no room.
  [[nodiscard]] std::int64_t lost() const noexcept;
  [[nodiscard]] std::int64_t unpublished() const noexcept;  ///< Messages that LCM did not take.
  /// Ticks that all outputs have taken; 0 where there is none.
  [[nodiscard]] std::int64_t written() const noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
