#pragma once

#include <cstdint>
#include <tuple>

#include "runtime/executor/field_rows.h"
#include "runtime/run/run_summary.h"

namespace tumbler {

/// The description of a figure of a run: a count that its summary has.
struct RunFigure {
  enum class Group : std::uint8_t { kTicks, kFrames, kOutputs };

  const char* key;  ///< In JSON.
  const char* meaning;
  Group group;  ///< JSON has each together.
};

template <typename Value>
struct RunFigureRow {
  RunFigure field;
  Value value;  ///< Of a RunSummary; 0 or more.
};

template <typename Value>
RunFigureRow(RunFigure, Value) -> RunFigureRow<Value>;

#define TUMBLER_FIGURE(key, member, group, meaning)                              \
  RunFigureRow {                                                                 \
    RunFigure{#key, meaning, RunFigure::Group::group},                           \
        [](const RunSummary& summary) -> std::int64_t { return summary.member; } \
  }

/// Every count of a run's summary. It is described only here: the JSON takes it from here, and a
/// test compares docs/schemas/tumbler-run.schema.json and docs/formats.md with it. The text for
/// people puts those that belong together into a sentence (run_summary.cc).
inline constexpr std::tuple kRunFigures{
    TUMBLER_FIGURE(ticks, statistics.ticks, kTicks, "executed"),
    TUMBLER_FIGURE(running_ticks, statistics.run_ticks, kTicks, "of these, in state running"),
    TUMBLER_FIGURE(missed_ticks, statistics.missed_ticks, kTicks, "periods without a tick"),
    TUMBLER_FIGURE(late_ticks, statistics.late_ticks, kTicks, "woken more than half a period late"),
    TUMBLER_FIGURE(limited_ticks, statistics.limited_ticks, kTicks,
                   "with a setpoint changed by the last gate"),
    TUMBLER_FIGURE(frames_sent, statistics.frames_sent, kFrames, "that the bus took"),
    TUMBLER_FIGURE(frames_received, statistics.frames_received, kFrames, "by the loop"),
    TUMBLER_FIGURE(send_failures, statistics.send_failures, kFrames,
                   "frames that the bus did not take; they are dropped"),
    TUMBLER_FIGURE(lost_records, lost_records, kOutputs,
                   "ticks for which a ring of telemetry had no room"),
    TUMBLER_FIGURE(unpublished_messages, unpublished_messages, kOutputs,
                   "messages that LCM did not take"),
    TUMBLER_FIGURE(unreadable_messages, unreadable_messages, kOutputs,
                   "messages received by LCM that were no requests of an operator"),
    TUMBLER_FIGURE(refused_messages, refused_messages, kOutputs,
                   "requests to another run, and those for motion that were too old or not signed "
                   "with the run's [key](runtime.md#a-key)"),
    TUMBLER_FIGURE(recorded_ticks, recorded_ticks, kOutputs,
                   "in the [flight record](#flight-record)"),
    TUMBLER_FIGURE(unrecorded_ticks, unrecorded_ticks, kOutputs, "executed, and not in it"),
};

#undef TUMBLER_FIGURE

}  // namespace tumbler
