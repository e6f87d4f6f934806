#pragma once

#include <cstddef>
#include <cstdint>
#include <tuple>
#include <type_traits>

#include "runtime/executor/faults.h"
#include "runtime/executor/field_rows.h"
#include "runtime/executor/joint_fields.h"
#include "runtime/executor/tick.h"

namespace tumbler {

/// The description of a field of a tick, without its joints.
struct TickField {
  const char* record;   ///< Name of the member of TickRecord, e.g. `sensor.pitch_rad`; empty: none.
  const char* message;  ///< Name of the member of state_t; empty: it is in no message.
  const char* column;   ///< Name in tables and MCAP; empty: it is not there.
  const char* meaning;
  /// Members of state_t come by their `message_place`. Columns come by their `column_place`; those
  /// from kBehindJoints on come after the columns of the joints.
  int message_place, column_place;
  std::uint32_t since = 1;  ///< The first version of flight records that has it.
};
inline constexpr int kBehindJoints = 1000;

/// A time in a column in seconds.
struct ColumnTime {
  std::int64_t ns = 0;
};

/// The value or the limit of a fault, whose kind depends on the fault.
struct ColumnFaultNumber {
  double value = 0;
  bool integer = false;
};

/// A field with what it is made of: members, given as functions.
/// @tparam InRecord   gives the member of a TickRecord.
/// @tparam OfTick     gives the value for the message from a tick with its times (TimedRecord).
/// @tparam InMessage  gives the member of a state_t.
/// @tparam Shown      gives the column's value from a state_t: a number, a text (`const char*`), or
///                    one of the structs above.
/// `std::nullptr_t` where there is no such thing.
template <typename InRecord, typename OfTick, typename InMessage, typename Shown>
struct TickFieldRow {
  TickField field;
  InRecord in_record;
  OfTick of_tick;
  InMessage in_message;
  Shown shown;

  template <typename Part>
  static constexpr bool kIsThere = !std::is_same_v<Part, std::nullptr_t>;
  static constexpr bool kRecorded = kIsThere<InRecord>;
  static constexpr bool kFilled = kIsThere<OfTick>;
  static constexpr bool kInMessage = kIsThere<InMessage>;
  static constexpr bool kShown = kIsThere<Shown>;
};

template <typename InRecord, typename OfTick, typename InMessage, typename Shown>
TickFieldRow(TickField, InRecord, OfTick, InMessage, Shown)
    -> TickFieldRow<InRecord, OfTick, InMessage, Shown>;

// NOLINTBEGIN(bugprone-macro-parentheses): they make functions, and not values
#define TUMBLER_RECORD(member) \
  [](auto& record) noexcept -> auto& { return record.member; }
#define TUMBLER_MESSAGE(member) \
  [](auto& message) noexcept -> auto& { return message.member; }
#define TUMBLER_TICK(expression) [](const auto& tick) noexcept { return expression; }
#define TUMBLER_SHOWN(expression) [](const auto& state) noexcept { return expression; }
// NOLINTEND(bugprone-macro-parentheses)

/// A field of the record that is in the message as it is, and in the table if it has a place there.
#define TUMBLER_FIELD(member, name, message_place, column_place, meaning, ...)           \
  TickFieldRow {                                                                         \
    TickField{#member, #name,         #name,                                             \
              meaning, message_place, column_place __VA_OPT__(, ) __VA_ARGS__},          \
        TUMBLER_RECORD(member), TUMBLER_TICK(tick.record.member), TUMBLER_MESSAGE(name), \
        TUMBLER_SHOWN(state.name)                                                        \
  }

/// The same, which tables do not show.
#define TUMBLER_FIELD_NOT_SHOWN(member, name, message_place, meaning)                 \
  TickFieldRow {                                                                      \
    TickField{#member, #name, "", meaning, message_place, 0}, TUMBLER_RECORD(member), \
        TUMBLER_TICK(tick.record.member), TUMBLER_MESSAGE(name), nullptr              \
  }

/// A field of the record alone.
#define TUMBLER_FIELD_OF_RECORD(member, meaning)                                                 \
  TickFieldRow {                                                                                 \
    TickField{#member, "", "", meaning, 0, 0}, TUMBLER_RECORD(member), nullptr, nullptr, nullptr \
  }

/// A field that the loop or its outputs add to the record.
#define TUMBLER_FIELD_OF_TICK(name, of_tick, message_place, column_place, meaning) \
  TickFieldRow {                                                                   \
    TickField{"", #name, #name, meaning, message_place, column_place}, nullptr,    \
        TUMBLER_TICK(of_tick), TUMBLER_MESSAGE(name), TUMBLER_SHOWN(state.name)    \
  }

/// Every field of a tick, without its joints: those of TickRecord in the order in which they are
/// encoded, then what is added to them.
///
/// A field is described only here. Flight records and their comparison, messages, tables, MCAP and
/// docs/formats.md take it from here, and a test compares state_t.lcm with it.
inline constexpr std::tuple kTickFields{
    TUMBLER_FIELD(tick, tick, 10, 20, "control periods since the schedule began"),
    TUMBLER_FIELD(primitive_time_s, primitive_time_s, 50, 70, "position in the primitive"),
    TickFieldRow{
        TickField{"faults", "faults", "faults",
                  "latched faults, bit i is fault number i (runtime/executor/faults.h, Fault)", 180,
                  80},
        TUMBLER_RECORD(faults), TUMBLER_TICK(tick.record.faults), TUMBLER_MESSAGE(faults),
        TUMBLER_SHOWN(static_cast<std::uint32_t>(state.faults))},
    TickFieldRow{TickField{"state", "state", "state", "see STATE_*", 80, 40}, TUMBLER_RECORD(state),
                 TUMBLER_TICK(tick.record.state), TUMBLER_MESSAGE(state),
                 TUMBLER_SHOWN(ToString(static_cast<ExecutorState>(state.state)))},
    TUMBLER_FIELD_NOT_SHOWN(
        reaction, reaction, 90,
        "0 none, 1 hold, 2 collapse, 3 damp, 4 disable, 5 roll out, 6 fold; carried out in "
        "STATE_FAULT"),
    TUMBLER_FIELD(command, command, 100, 140, "operator command of this tick; see command_t"),
    TUMBLER_FIELD_NOT_SHOWN(joint_count, joint_count, 330, ""),
    TUMBLER_FIELD(node, node, 60, 50,
                  "node of the sequence, in the order of its file, that is played or was played "
                  "last"),
    TUMBLER_FIELD(cycles, cycles, 70, 60, "complete cycles of the sequence"),
    TUMBLER_FIELD(first_fault.tick, fault_tick, 210, 110, "in which it was found"),
    TickFieldRow{
        TickField{"first_fault.value", "fault_value", "fault_value",
                  "the value that was seen, in the unit of the fault: ticks, counts, codes and "
                  "identifiers are integers of at most 32 bits, and exact",
                  230, 120},
        TUMBLER_RECORD(first_fault.value.bits),
        TUMBLER_TICK(
            ToDouble(tick.record.first_fault.value, UnitOf(tick.record.first_fault.fault))),
        TUMBLER_MESSAGE(fault_value),
        TUMBLER_SHOWN((ColumnFaultNumber{state.fault_value,
                                         IsInteger(UnitOf(static_cast<Fault>(state.fault)))}))},
    TickFieldRow{TickField{"first_fault.limit", "fault_limit", "fault_limit",
                           "the value that would have been allowed", 240, 130},
                 TUMBLER_RECORD(first_fault.limit.bits),
                 TUMBLER_TICK(ToDouble(tick.record.first_fault.limit,
                                       UnitOf(tick.record.first_fault.fault))),
                 TUMBLER_MESSAGE(fault_limit),
                 TUMBLER_SHOWN((ColumnFaultNumber{
                     state.fault_limit, IsInteger(UnitOf(static_cast<Fault>(state.fault)))}))},
    TUMBLER_FIELD(first_fault.fault, fault, 190, 90,
                  "the first fault since the last clear, 0 none"),
    TUMBLER_FIELD(first_fault.joint, fault_joint, 200, 100, "index of its joint, -1 all"),
    TUMBLER_FIELD_NOT_SHOWN(first_fault.state, fault_state, 220,
                            "the state in which it was found, see STATE_*"),
    TUMBLER_FIELD_OF_RECORD(first_fault.reaction, "to it"),
    TickFieldRow{TickField{"refusal.value", "", "", "of what the command was refused for", 0, 0},
                 TUMBLER_RECORD(refusal.value.bits), nullptr, nullptr, nullptr},
    TickFieldRow{TickField{"refusal.limit", "", "", "what would have been allowed", 0, 0},
                 TUMBLER_RECORD(refusal.limit.bits), nullptr, nullptr, nullptr},
    TUMBLER_FIELD(refusal.refusal, refusal, 110, 150,
                  "0, or why the command was not followed (runtime/executor/tick.h, Refusal)"),
    TUMBLER_FIELD_OF_RECORD(refusal.joint, "index of its joint, -1 all"),
    TUMBLER_FIELD(sensor.pitch_rad, sensor_pitch_rad, 270, 1030, "of the link that carries it",
                  kRecordedSensors),
    TUMBLER_FIELD(sensor.rate_rad_s, sensor_rate_rad_s, 280, 1040, "of its pitch",
                  kRecordedSensors),
    TUMBLER_FIELD(sensor.error_rad, feedback_error_rad, 290, 1050,
                  "of the fed-back angle, when it was known last", kRecordedSensors),
    TUMBLER_FIELD(sensor.rate_error_rad_s, feedback_rate_error_rad_s, 300, 1060, "of its rate",
                  kRecordedSensors),
    TUMBLER_FIELD(sensor.share, feedback_share, 310, 1070, "of the feedback in force, 0 ... 1",
                  kRecordedSensors),
    TUMBLER_FIELD(sensor.age_ticks, sensor_age_ticks, 260, 1020,
                  "ticks since its last report, -1 never", kRecordedSensors),
    TUMBLER_FIELD(sensor.status, sensor_status, 250, 1010,
                  "of the inertial sensor (runtime/executor/sensor_watch.h, SensorStatus), 0 there "
                  "is none",
                  kRecordedSensors),

    TUMBLER_FIELD_OF_TICK(number, tick.number, 20, 10,
                          "of this record, 0, 1, 2, ...: missing numbers were lost on the way"),
    TickFieldRow{TickField{"", "run", "",
                           "drawn by each tumbler run in real time; 0 in virtual time", 30, 0},
                 nullptr, nullptr, TUMBLER_MESSAGE(run), nullptr},
    TickFieldRow{TickField{"", "time_ns", "time_s",
                           "start of the tick: virtual time of a simulation, else CLOCK_MONOTONIC "
                           "since the start",
                           40, 30},
                 nullptr, TUMBLER_TICK(tick.time_ns), TUMBLER_MESSAGE(time_ns),
                 TUMBLER_SHOWN((ColumnTime{state.time_ns}))},
    TUMBLER_FIELD_OF_TICK(request_id, tick.request.id, 120, 160,
                          "of the last command_t that was taken, 0 none"),
    TUMBLER_FIELD_OF_TICK(request, tick.request.request, 130, 170, "its command, as in command_t"),
    TUMBLER_FIELD_OF_TICK(request_refusal, tick.request.refusal, 140, 180,
                          "0, or why it was not followed"),
    TUMBLER_FIELD_OF_TICK(wake_up_us, tick.wake_up_ns * 1e-3F, 150, 190,
                          "from the deadline to running"),
    TUMBLER_FIELD_OF_TICK(tick_us, tick.tick_ns * 1e-3F, 160, 200, "from running to all sent"),
    TUMBLER_FIELD_OF_TICK(bus_bits, tick.bus_bits, 170, 210,
                          "of the frames received and sent, each as long as frames can be"),
};

#undef TUMBLER_FIELD_OF_TICK
#undef TUMBLER_FIELD_OF_RECORD
#undef TUMBLER_FIELD_NOT_SHOWN
#undef TUMBLER_FIELD
#undef TUMBLER_SHOWN
#undef TUMBLER_TICK
#undef TUMBLER_MESSAGE
#undef TUMBLER_RECORD

/// Calls `visit(field, member)` for every field of a tick's record, in the order in which they are
/// encoded.
template <typename Record, typename Visit>
constexpr void ForEachRecordedField(Record& record, const Visit& visit) {
  ForEachRow(kTickFields, [&]<typename Row>(const Row& row) {
    if constexpr (Row::kRecorded) visit(row.field, row.in_record(record));
  });
}

// A member that is added there has to be added above, or it would neither be recorded nor compared.
static_assert(sizeof(TickRecord) - kMaxJoints * sizeof(JointRecord) == 96,
              "kTickFields has to describe every member of TickRecord");

}  // namespace tumbler
