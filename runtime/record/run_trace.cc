#include "runtime/record/run_trace.h"

#include <fmt/format.h>

#include <memory>
#include <stdexcept>

#include "firmware_interface/devices/logged_position.h"

namespace tumbler {
namespace {

bool IsPlayed(ExecutorState state) {
  return state == ExecutorState::kRunning || state == ExecutorState::kSettling ||
         state == ExecutorState::kHolding;
}

double Seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

/// The arrival [ns] of the drive's first position report among the frames of a tick.
std::optional<std::int64_t> ReplyTime(const TickEntry& entry, const DriveConfig& drive) {
  for (const ReceivedFrame& received : entry.input().received) {
    if (ReportedPosition(drive, received.frame)) return received.time_ns;
  }
  return std::nullopt;
}

}  // namespace

RunTrace TraceOf(FlightRecord& record, const DrivesConfig& drives) {
  const RecordConfiguration& configuration = record.configuration();
  RunTrace trace{record.name(), configuration.joints, {}};
  trace.samples.resize(trace.joints.size());
  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  bool playing = false;
  std::int64_t first_tick = 0, first_ns = 0, send_before_ns = 0;
  while (record.Next(*entry)) {
    const TickRecord& tick = entry->record;
    if (!playing && tick.state == ExecutorState::kRunning) {
      playing = true;
      first_tick = tick.tick;
      first_ns = entry->notes.deadline_ns;
    } else if (playing) {
      // Measurements of this tick answer the setpoints of the tick before.
      for (std::size_t i = 0; i < trace.samples.size() && i < tick.joint_count; ++i) {
        if (tick.joints[i].reply_age_ticks != 0) continue;
        TraceSample& sample = trace.samples[i].back();
        sample.reply_rad = double{tick.joints[i].measured.position_rad};
        const auto arrival =
            i < drives.drives.size() ? ReplyTime(*entry, drives.drives[i].config) : std::nullopt;
        if (arrival) sample.delay_s = Seconds(*arrival - send_before_ns);
      }
    }
    if (playing && !IsPlayed(tick.state)) break;
    send_before_ns = entry->notes.send_ns;
    for (std::size_t i = 0; playing && i < trace.samples.size() && i < tick.joint_count; ++i) {
      trace.samples[i].push_back({tick.tick - first_tick,
                                  Seconds(entry->notes.deadline_ns - first_ns),
                                  double{tick.joints[i].limited.position_rad},
                                  {},
                                  {}});
    }
  }
  return trace;
}

RunTrace TraceOf(const std::vector<CandumpFrame>& frames, const DrivesConfig& drives,
                 const std::string& name) {
  RunTrace trace{name, {}, {}};
  std::optional<std::int64_t> first_ns;
  for (const DriveEntry& drive : drives.drives) {
    trace.joints.push_back(drive.joint);
    std::vector<TraceSample>& samples = trace.samples.emplace_back();
    std::int64_t command_ns = 0;
    for (const CandumpFrame& logged : frames) {
      const std::int64_t time_ns = logged.received.time_ns;
      if (const auto commanded = CommandedPosition(drive.config, logged.received.frame)) {
        if (!first_ns) first_ns = time_ns;
        command_ns = time_ns;
        samples.push_back({static_cast<std::int64_t>(samples.size()),
                           Seconds(time_ns - *first_ns),
                           *commanded,
                           {},
                           {}});
        continue;
      }
      const auto reported = ReportedPosition(drive.config, logged.received.frame);
      if (!reported || samples.empty() || samples.back().reply_rad) continue;
      samples.back().reply_rad = reported;
      samples.back().delay_s = Seconds(time_ns - command_ns);
    }
    if (samples.empty()) {
      throw std::runtime_error(fmt::format(
          "{}: has no setpoint for joint '{}': its drive has another protocol or identifier, or "
          "was not driven",
          name, drive.joint));
    }
  }
  return trace;
}

}  // namespace tumbler
