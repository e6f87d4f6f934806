#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "runtime/executor/tick.h"

namespace tumbler {

/// The description of a field of a joint's record.
struct JointField {
  enum class Origin : std::uint8_t { kExecutor, kDrive };

  const char* name;    ///< Name of the member of JointRecord, e.g. `planned.position_rad`.
  const char* column;  ///< Name in messages and tables, e.g. `planned_position_rad`.
  const char* unit;    ///< Empty: there is none.
  const char* meaning;
  Origin origin = Origin::kExecutor;  ///< Where the value comes from.
  const char* status = nullptr;       ///< Its key in `tumbler ctl status --json`; null: not there.
  bool empty_if_nan = false;  ///< Whether tables are empty where it is NaN: nothing was measured.
  std::uint32_t since = 1;    ///< The first version of flight records that has it.
};

/// The first version of flight records with a sensor.
inline constexpr std::uint32_t kRecordedSensors = 4;

/// Calls `visit(field, of_tick, in_message)` for every field of a joint that messages and tables
/// have besides those of JointRecord: it follows from the frames of a run. `of_tick(tick, j)` is
/// the value of joint j in a tick with its times (TimedRecord).
template <typename Visit>
constexpr void ForEachDerivedJointField(const Visit& visit) noexcept {
  visit(
      JointField{"reply_sampled_us", "reply_sampled_us", "us",
                 "when the measured position was sampled, from the start of this tick, so below 0; "
                 "NaN (empty in CSV): not known",
                 JointField::Origin::kDrive, nullptr, true},
      [](const auto& tick, std::size_t j) noexcept { return tick.reply_sampled_us[j]; },
      [](auto& message) noexcept -> auto& { return message.reply_sampled_us; });
}

/// Calls `visit(field, in_record, in_message)` for every field of a joint in one tick, in the order
/// of the members of JointRecord. `in_record(joint)` is the member of a JointRecord, and
/// `in_message(message)` that of a `joint_state_t`.
///
/// A field is described only here. Flight records and their comparison, messages, tables, the
/// status and docs/formats.md take it from here, and a test compares joint_state_t.lcm with it.
template <typename Visit>
constexpr void ForEachJointField(Visit&& visit) noexcept {
  using enum JointField::Origin;
#define TUMBLER_FIELD(member, ...)                                \
  visit(                                                          \
      JointField{#member, #member, __VA_ARGS__},                  \
      [](auto& joint) noexcept -> auto& { return joint.member; }, \
      [](auto& message) noexcept -> auto& { return message.member; })
#define TUMBLER_FIELD_OF(part, member, ...)                            \
  visit(                                                               \
      JointField{#part "." #member, #part "_" #member, __VA_ARGS__},   \
      [](auto& joint) noexcept -> auto& { return joint.part.member; }, \
      [](auto& message) noexcept -> auto& { return message.part##_##member; })

  TUMBLER_FIELD_OF(planned, position_rad, "rad", "asked for by the state, or by the primitive");
  TUMBLER_FIELD_OF(planned, velocity_rad_s, "rad/s", "asked for by the state, or by the primitive");
  TUMBLER_FIELD_OF(planned, torque_nm, "N m", "feed-forward");
  TUMBLER_FIELD(planned_acceleration_rad_s2, "rad/s^2",
                "of the primitive at its speed; 0 unless running");
  TUMBLER_FIELD_OF(limited, position_rad, "rad", "after the last gate", kExecutor, "setpoint_rad");
  TUMBLER_FIELD_OF(limited, velocity_rad_s, "rad/s", "after the last gate");
  TUMBLER_FIELD_OF(limited, torque_nm, "N m", "after the last gate");
  TUMBLER_FIELD_OF(encoded, position_rad, "rad", "as the drive will decode it");
  TUMBLER_FIELD_OF(encoded, velocity_rad_s, "rad/s", "as the drive will decode it");
  TUMBLER_FIELD_OF(encoded, torque_nm, "N m", "as the drive will decode it");
  TUMBLER_FIELD_OF(measured, position_rad, "rad", "in the reply to the setpoint of the tick before",
                   kDrive, "measured_rad");
  TUMBLER_FIELD_OF(measured, velocity_rad_s, "rad/s",
                   "in the reply to the setpoint of the tick before", kDrive, "measured_rad_s");
  TUMBLER_FIELD_OF(measured, torque_nm, "N m",
                   "as the drive reported it last; NaN (empty in CSV, null in JSON): it never has",
                   kDrive, "measured_nm", true);
  TUMBLER_FIELD(temperature_c, "deg C", "0 where the drive does not say", kDrive, "temperature_c");
  TUMBLER_FIELD(reply_age_ticks, "ticks", "0: replied since the tick before; -1: never", kDrive,
                "reply_age_ticks");
  TUMBLER_FIELD(drive_state, "",
                "0 unknown, 1 disabled, 2 enabling, 3 enabled, 4 fault, 5 heartbeat lost", kDrive,
                "drive");
  TUMBLER_FIELD(reply_status, "",
                "0 ok, 1 no new data, 2 repeated, 3 ok, some lost, 4 ok, some late");
  TUMBLER_FIELD(drive_error, "", "the drive's own code (32 bits without sign), 0 none", kDrive,
                "drive_error");
  TUMBLER_FIELD(limit_active, "", "planned was outside a limit");
  TUMBLER_FIELD(correction_rad, "rad",
                "of the position by the feedback, in planned; 0 without a sensor", kExecutor,
                nullptr, false, kRecordedSensors);

#undef TUMBLER_FIELD_OF
#undef TUMBLER_FIELD
}

/// The type of a field, from its `in_record`.
template <typename InRecord>
using JointFieldType = std::remove_cvref_t<std::invoke_result_t<InRecord, JointRecord&>>;

/// The size of a struct whose members are the fields in their order.
constexpr std::size_t SizeOfJointFields() noexcept {
  const auto padded = [](std::size_t size, std::size_t alignment) {
    return (size + alignment - 1) / alignment * alignment;
  };
  std::size_t size = 0;
  ForEachJointField([&](const JointField& /*field*/, auto in_record, auto /*in_message*/) {
    using Type = JointFieldType<decltype(in_record)>;
    size = padded(size, alignof(Type)) + sizeof(Type);
  });
  return padded(size, alignof(JointRecord));
}
static_assert(sizeof(JointRecord) == SizeOfJointFields(),
              "ForEachJointField has to describe every member of JointRecord");

}  // namespace tumbler
