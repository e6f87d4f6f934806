#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include "runtime/assembly/histogram.h"
#include "runtime/executor/field_rows.h"
#include "runtime/record/run_description.h"
#include "runtime/record/timed_record.h"

namespace tumbler {

/// Time from one message about the run as a whole to the next.
inline constexpr std::int64_t kRunPeriod_ns = 250'000'000;

/// A run as it is known so far: what run_t is made of.
struct RunSoFar {
  RunDescription about;
  std::string version;             ///< Of the program.
  bool checking = false;           ///< Drives are being checked before the first tick.
  std::int64_t check_request = 0;  ///< That ended the check; 0: none.
  std::int64_t time_ns = 0;
  std::int64_t ticks = 0;
  std::int64_t missed_ticks = 0;
  std::int64_t late_ticks = 0;
  DurationHistogram wake_up;
  DurationHistogram tick;
  std::int32_t reply_age_max_ticks = -1;
  std::int64_t bits = 0;  ///< On the bus since the message before.
  float bus_load = 0;
  std::int64_t lost = 0;
  std::int64_t unpublished = 0;

  /// Adds a tick to the figures.
  void Count(const TimedRecord& timed) {
    const auto period_ns = static_cast<float>(1e9 / std::max(about.rate_hz, 1e-3));
    ticks = timed.number + 1;
    missed_ticks = timed.record.tick - timed.number;
    if (timed.wake_up_ns > period_ns / 2) ++late_ticks;
    wake_up.Add(static_cast<std::int64_t>(timed.wake_up_ns));
    tick.Add(static_cast<std::int64_t>(timed.tick_ns));
    bits += timed.bus_bits;
    for (std::size_t i = 0; i < timed.record.joint_count; ++i) {
      reply_age_max_ticks = std::max(reply_age_max_ticks, timed.record.joints[i].reply_age_ticks);
    }
  }
};

/// The description of a field of run_t.
struct RunField {
  const char* name;
  const char* meaning;
  int message_place;  ///< Members of run_t come by this.
  /// Fields of MCAP's Run come by this; 0: it is not there, as it does not change in a run.
  int mcap_place = 0;
  const char* dimension = nullptr;  ///< Name of the member that says how many there are; null: one.
};

template <typename Value, typename InMessage>
struct RunFieldRow {
  RunField field;
  Value value;  ///< Of a RunSoFar.
  InMessage in_message;
  /// Whether there are several.
  static constexpr bool kList =
      std::is_same_v<std::remove_cvref_t<std::invoke_result_t<Value, const RunSoFar&>>,
                     std::vector<std::string>>;
};

template <typename Value, typename InMessage>
RunFieldRow(RunField, Value, InMessage) -> RunFieldRow<Value, InMessage>;

#define TUMBLER_RUN_FIELD(name, expression, ...)                                  \
  RunFieldRow {                                                                   \
    RunField{#name, __VA_ARGS__}, [](const RunSoFar& run) { return expression; }, \
        [](auto& message) noexcept -> auto& {                                     \
      return message.name;                                                        \
    }                                                                             \
  }
#define TUMBLER_TEXT(name, expression, ...)                                                     \
  RunFieldRow {                                                                                 \
    RunField{#name, __VA_ARGS__}, [](const RunSoFar& run) -> const auto& { return expression; } \
    , [](auto& message) noexcept -> auto& { return message.name; }                              \
  }
#define TUMBLER_PERCENTILE(name, durations, share, ...)                                  \
  TUMBLER_RUN_FIELD(name, static_cast<float>(run.durations.PercentileNs(share)) * 1e-3F, \
                    __VA_ARGS__)

/// Every field of run_t. A field, figures among them, is described only here: the message, MCAP and
/// run_t.lcm take it from here, the latter by a test.
inline constexpr std::tuple kRunFields{
    TUMBLER_RUN_FIELD(time_ns, run.time_ns, "as in state_t", 10),
    TUMBLER_RUN_FIELD(run, run.about.number, "as in state_t", 20),
    TUMBLER_TEXT(robot, run.about.robot,
                 "its name, to tell the robots of one URL apart; empty in virtual time", 30),
    TUMBLER_TEXT(version, run.version, "of tumbler run", 40),
    TUMBLER_TEXT(motion, run.about.motion, "name of the primitive or sequence", 50, 10),
    TUMBLER_TEXT(bus, run.about.bus, "\"sim\" or the interface", 60, 20),
    TUMBLER_TEXT(mode, run.about.mode, "\"armed\", \"dry run\" or \"simulated\"", 70, 30),
    TUMBLER_RUN_FIELD(attended, run.about.attended, "whether every run waits for START", 80),
    TUMBLER_RUN_FIELD(keyed, run.about.keyed,
                      "whether START, BRANCH and CLEAR_FAULTS have to be signed with its key "
                      "(command_t)",
                      90),
    TUMBLER_RUN_FIELD(checking, run.checking,
                      "its drives are being checked before it arms: there is no state_t yet, and "
                      "STOP ends it",
                      100),
    TUMBLER_RUN_FIELD(check_request, run.check_request,
                      "id of the command_t that ended that check, and with it the run; 0 none",
                      110),
    TUMBLER_RUN_FIELD(rate_hz, run.about.rate_hz, "of the control loop", 120, 40),
    TUMBLER_RUN_FIELD(speed, run.about.speed, "of playback, 0.1 ... 1", 130, 50),
    TUMBLER_RUN_FIELD(joint_count, run.about.joints.size(), "", 140),
    TUMBLER_TEXT(joints, run.about.joints, "in the order of state_t", 150, 0, "joint_count"),
    TUMBLER_TEXT(
        error_codes, run.about.error_codes,
        "whose codes the drive has: \"ak\", \"damiao\", \"odrive\", \"cia402\"; empty: not "
        "known",
        160, 0, "joint_count"),
    TUMBLER_RUN_FIELD(node_count, run.about.nodes.size(), "", 170),
    TUMBLER_TEXT(nodes, run.about.nodes, "of the sequence, in the order of state_t.node", 180, 0,
                 "node_count"),
    TUMBLER_RUN_FIELD(branch_count, run.about.branches.size(), "", 190),
    TUMBLER_TEXT(branches, run.about.branches, "the names for BRANCH", 200, 0, "branch_count"),
    TUMBLER_TEXT(kernel, run.about.machine.kernel, "release, and how it may be interrupted", 210),
    TUMBLER_TEXT(cpu, run.about.machine.cpu, "of the machine", 220),
    TUMBLER_TEXT(adapter, run.about.machine.adapter, "driver of the CAN interface", 230),
    TUMBLER_TEXT(scheduling, run.about.scheduling, "of the control loop's thread", 240),
    TUMBLER_RUN_FIELD(ticks, run.ticks, "ticks executed since the start", 250, 70),
    TUMBLER_RUN_FIELD(missed_ticks, run.missed_ticks, "periods without a tick", 260, 80),
    TUMBLER_RUN_FIELD(late_ticks, run.late_ticks,
                      "ticks woken more than half a period after the deadline", 270, 90),
    TUMBLER_PERCENTILE(wake_up_p50_us, wake_up, 0.5, "from deadline to running; since the start",
                       280, 100),
    TUMBLER_PERCENTILE(wake_up_p99_us, wake_up, 0.99, "", 290, 110),
    TUMBLER_PERCENTILE(wake_up_p99_9_us, wake_up, 0.999, "", 300, 120),
    TUMBLER_PERCENTILE(wake_up_p99_99_us, wake_up, 0.9999, "", 310, 130),
    TUMBLER_RUN_FIELD(wake_up_max_us, static_cast<float>(run.wake_up.max_ns()) * 1e-3F, "", 320,
                      140),
    TUMBLER_PERCENTILE(tick_p50_us, tick, 0.5, "from running to all sent", 330, 150),
    TUMBLER_PERCENTILE(tick_p99_us, tick, 0.99, "", 340, 160),
    TUMBLER_PERCENTILE(tick_p99_9_us, tick, 0.999, "", 350, 170),
    TUMBLER_PERCENTILE(tick_p99_99_us, tick, 0.9999, "", 360, 180),
    TUMBLER_RUN_FIELD(tick_max_us, static_cast<float>(run.tick.max_ns()) * 1e-3F, "", 370, 190),
    TUMBLER_RUN_FIELD(reply_age_max_ticks, run.reply_age_max_ticks,
                      "oldest measurement that was used; -1: there was none", 380, 200),
    TUMBLER_RUN_FIELD(bus_load, run.bus_load,
                      "0 ... 1, of frames sent and received since the message before, each as long "
                      "as frames can be",
                      390, 60),
    TUMBLER_RUN_FIELD(lost_records, run.lost, "ticks that telemetry had no room for", 400, 210),
    TUMBLER_RUN_FIELD(unpublished, run.unpublished, "messages that LCM did not take", 410, 220),
};

#undef TUMBLER_PERCENTILE
#undef TUMBLER_TEXT
#undef TUMBLER_RUN_FIELD

}  // namespace tumbler
