#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <tumbler/truth_t.hpp>

namespace tumbler {

/// Calls `visit(name, value)` for the numbers of a simulated robot's true state, without its
/// joints. All are `double` or `std::int32_t`.
template <typename Visit>
void ForEachTruthColumn(const truth_t& truth, Visit&& visit) {
  visit("time_s", static_cast<double>(truth.time_ns) * 1e-9);
  visit("root_x_m", truth.root_x_m);
  visit("root_z_m", truth.root_z_m);
  visit("root_pitch_rad", truth.root_pitch_rad);
  visit("root_vx_m_s", truth.root_vx_m_s);
  visit("root_vz_m_s", truth.root_vz_m_s);
  visit("root_pitch_rate_rad_s", truth.root_pitch_rate_rad_s);
  visit("held", std::int32_t{truth.held});
  visit("fallen", std::int32_t{truth.fallen});
  visit("falls", truth.falls);
  visit("push_x_n", truth.push_x_n);
  visit("push_z_n", truth.push_z_n);
  visit("peak_penetration_m", truth.peak_penetration_m);
}

/// The first line of a table of true states, without a line feed.
/// @param joint_names  the joints that it is to have.
std::string TruthCsvHeader(const std::vector<std::string>& joint_names);

/// Appends the row of one true state, with a line feed. Every number reads back exactly. The cells
/// of a joint that the state does not have are empty.
void AppendTruthCsvRow(const truth_t& truth, const std::vector<std::string>& joint_names,
                       std::string& csv);

}  // namespace tumbler
