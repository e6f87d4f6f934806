#include "runtime/telemetry/state_csv.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <string_view>
#include <type_traits>

#include "runtime/core/faults.h"
#include "runtime/core/joint_fields.h"

namespace tumbler {
namespace {

/// Whether the field is empty in a table where it is NaN: nothing was measured.
bool IsTorque(const JointField& field) {
  return std::string_view(field.name) == "measured.torque_nm";
}

/// Calls `visit(field, in_message)` for every column of a joint. Planned, limited, encoded and
/// measured values come first.
template <typename Visit>
void ForEachColumn(const Visit& visit) {
  for (const bool of_part : {true, false}) {
    ForEachJointField([&](const JointField& field, auto /*in_record*/, auto in_message) {
      if ((std::string_view(field.name).find('.') != std::string_view::npos) == of_part) {
        visit(field, in_message);
      }
    });
  }
}

}  // namespace

std::string StateCsvHeader(const std::vector<std::string>& joint_names) {
  std::string header =
      "number,tick,time_s,state,node,cycles,primitive_time_s,faults,fault,fault_joint,fault_tick,"
      "fault_value,fault_limit,command,refusal,request_id,request,request_refusal,wake_up_us,"
      "tick_us,bus_bits";
  for (const std::string& joint : joint_names) {
    ForEachColumn([&](const JointField& field, auto /*in_message*/) {
      header += fmt::format(",{}_{}", joint, field.column);
    });
  }
  return header +
         ",sensor_status,sensor_age_ticks,sensor_pitch_rad,sensor_rate_rad_s,feedback_error_rad,"
         "feedback_rate_error_rad_s,feedback_share";
}

void AppendStateCsvRow(const state_t& state, std::string& csv) {
  auto out = std::back_inserter(csv);
  const DetailUnit unit = UnitOf(static_cast<Fault>(state.fault));
  const auto number = [unit](double value) {
    return IsInteger(unit) ? fmt::format("{:.0f}", value)
                           : fmt::format("{}", static_cast<float>(value));
  };
  fmt::format_to(out, "{},{},{:.6f},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                 state.number, state.tick, static_cast<double>(state.time_ns) * 1e-9,
                 ToString(static_cast<ExecutorState>(state.state)), state.node, state.cycles,
                 state.primitive_time_s, static_cast<std::uint32_t>(state.faults), state.fault,
                 state.fault_joint, state.fault_tick, number(state.fault_value),
                 number(state.fault_limit), state.command, state.refusal, state.request_id,
                 state.request, state.request_refusal, state.wake_up_us, state.tick_us,
                 state.bus_bits);
  for (const joint_state_t& joint : state.joints) {
    ForEachColumn([&](const JointField& field, auto in_message) {
      const auto& value = in_message(joint);
      if constexpr (std::is_floating_point_v<std::remove_cvref_t<decltype(value)>>) {
        if (std::isnan(value) && IsTorque(field)) {
          csv += ',';
          return;
        }
      }
      fmt::format_to(out, ",{}", value);
    });
  }
  fmt::format_to(out, ",{},{},{},{},{},{},{}", state.sensor_status, state.sensor_age_ticks,
                 state.sensor_pitch_rad, state.sensor_rate_rad_s, state.feedback_error_rad,
                 state.feedback_rate_error_rad_s, state.feedback_share);
  csv += '\n';
}

}  // namespace tumbler
