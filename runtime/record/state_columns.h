#pragma once

#include <cstdint>
#include <string_view>

#include <tumbler/state_t.hpp>

#include "runtime/executor/faults.h"
#include "runtime/executor/joint_fields.h"
#include "runtime/executor/tick.h"

namespace tumbler {

/// A time in a column in seconds.
struct ColumnTime {
  std::int64_t ns = 0;
};

/// The value or the limit of a fault, whose kind depends on the fault.
struct ColumnFaultNumber {
  double value = 0;
  bool integer = false;
};

/// Calls `visit(name, value)` for the columns of a tick, in a table of ticks, that come before
/// those of its joints. A value is a number, a text (`const char*`) or one of the structs above.
template <typename Visit>
void ForEachTickColumn(const state_t& state, Visit&& visit) {
  const bool integer = IsInteger(UnitOf(static_cast<Fault>(state.fault)));
  visit("number", state.number);
  visit("tick", state.tick);
  visit("time_s", ColumnTime{state.time_ns});
  visit("state", ToString(static_cast<ExecutorState>(state.state)));
  visit("node", state.node);
  visit("cycles", state.cycles);
  visit("primitive_time_s", state.primitive_time_s);
  visit("faults", static_cast<std::uint32_t>(state.faults));
  visit("fault", state.fault);
  visit("fault_joint", state.fault_joint);
  visit("fault_tick", state.fault_tick);
  visit("fault_value", ColumnFaultNumber{state.fault_value, integer});
  visit("fault_limit", ColumnFaultNumber{state.fault_limit, integer});
  visit("command", state.command);
  visit("refusal", state.refusal);
  visit("request_id", state.request_id);
  visit("request", state.request);
  visit("request_refusal", state.request_refusal);
  visit("wake_up_us", state.wake_up_us);
  visit("tick_us", state.tick_us);
  visit("bus_bits", state.bus_bits);
}

/// Calls `visit(field, in_message)` for the columns of each joint. Planned, limited, encoded and
/// measured values come first, and `kReplySampled` last. A column's name is the joint's, `_` and
/// `field.column`.
template <typename Visit>
void ForEachJointColumn(const Visit& visit) {
  for (const bool of_part : {true, false}) {
    ForEachJointField([&](const JointField& field, auto /*in_record*/, auto in_message) {
      if ((std::string_view(field.name).find('.') != std::string_view::npos) == of_part) {
        visit(field, in_message);
      }
    });
  }
  visit(
      kReplySampled, [](auto& message) noexcept -> auto& { return message.reply_sampled_us; });
}

/// The columns that come after those of the joints, as ForEachTickColumn.
template <typename Visit>
void ForEachSensorColumn(const state_t& state, Visit&& visit) {
  visit("sensor_status", state.sensor_status);
  visit("sensor_age_ticks", state.sensor_age_ticks);
  visit("sensor_pitch_rad", state.sensor_pitch_rad);
  visit("sensor_rate_rad_s", state.sensor_rate_rad_s);
  visit("feedback_error_rad", state.feedback_error_rad);
  visit("feedback_rate_error_rad_s", state.feedback_rate_error_rad_s);
  visit("feedback_share", state.feedback_share);
}

}  // namespace tumbler
