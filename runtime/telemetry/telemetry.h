#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "runtime/core/tick.h"
#include "runtime/linux/operator_mailbox.h"
#include "runtime/telemetry/run_description.h"

namespace tumbler {

/// The operator's last request and what became of it.
struct RequestAnswer {
  std::uint32_t id = 0;
  OperatorRequest request = OperatorRequest::kNone;
  Refusal refusal = Refusal::kNone;
};

/// A tick's record, and what the loop adds to it.
struct TimedRecord {
  std::int64_t time_ns = 0;   ///< Deadline of the tick, on the clock of the loop.
  std::int64_t number = 0;    ///< Of this record: 0, 1, 2, ...
  float wake_up_ns = 0;       ///< From the deadline to running.
  float tick_ns = 0;          ///< From running to all sent.
  std::int32_t bus_bits = 0;  ///< Of the frames received and sent, each as long as frames can be.
  RequestAnswer request;
  TickRecord record;
};

/// Channels of the messages in `runtime/lcm`.
inline constexpr const char* kStateChannel = "TUMBLER_STATE";
inline constexpr const char* kEventChannel = "TUMBLER_EVENT";
inline constexpr const char* kRunChannel = "TUMBLER_RUN";
inline constexpr const char* kCommandChannel = "TUMBLER_COMMAND";

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
