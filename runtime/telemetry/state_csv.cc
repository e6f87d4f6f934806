#include "runtime/telemetry/state_csv.h"

#include <fmt/format.h>

#include <iterator>

#include "runtime/core/faults.h"

namespace tumbler {

std::string StateCsvHeader(const std::vector<std::string>& joint_names) {
  std::string header =
      "number,tick,time_s,state,node,cycles,primitive_time_s,faults,fault,fault_joint,fault_tick,"
      "fault_value,fault_limit,command,refusal,request_id,request,request_refusal,wake_up_us,"
      "tick_us,bus_bits";
  for (const std::string& joint : joint_names) {
    for (const char* kind : {"planned", "limited", "encoded", "measured"}) {
      header += fmt::format(",{0}_{1}_position_rad,{0}_{1}_velocity_rad_s,{0}_{1}_torque_nm", joint,
                            kind);
    }
    header += fmt::format(
        ",{0}_planned_acceleration_rad_s2,{0}_temperature_c,{0}_reply_age_ticks,{0}_drive_state,"
        "{0}_reply_status,{0}_drive_error,{0}_limit_active",
        joint);
  }
  return header;
}

void AppendStateCsvRow(const state_t& state, std::string& csv) {
  auto out = std::back_inserter(csv);
  fmt::format_to(out, "{},{},{:.6f},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                 state.number, state.tick, static_cast<double>(state.time_ns) * 1e-9,
                 ToString(static_cast<ExecutorState>(state.state)), state.node, state.cycles,
                 state.primitive_time_s, static_cast<std::uint32_t>(state.faults), state.fault,
                 state.fault_joint, state.fault_tick, state.fault_value, state.fault_limit,
                 state.command, state.refusal, state.request_id, state.request,
                 state.request_refusal, state.wake_up_us, state.tick_us, state.bus_bits);
  for (const joint_state_t& j : state.joints) {
    fmt::format_to(out, ",{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                   j.planned_position_rad, j.planned_velocity_rad_s, j.planned_torque_nm,
                   j.limited_position_rad, j.limited_velocity_rad_s, j.limited_torque_nm,
                   j.encoded_position_rad, j.encoded_velocity_rad_s, j.encoded_torque_nm,
                   j.measured_position_rad, j.measured_velocity_rad_s, j.measured_torque_nm,
                   j.planned_acceleration_rad_s2, j.temperature_c, j.reply_age_ticks, j.drive_state,
                   j.reply_status, j.drive_error, j.limit_active);
  }
  csv += '\n';
}

}  // namespace tumbler
