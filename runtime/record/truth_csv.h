#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/record/message_readers.h"

namespace tumbler {

/// Of which kind a true state is.
enum class TruthKind : std::uint8_t { kInPlane, kInSpace };
[[nodiscard]] inline TruthKind KindOf(const space_truth_t& state) {
  return IsInSpace(state) ? TruthKind::kInSpace : TruthKind::kInPlane;
}

/// Calls `visit(name, value)` for where the root is, and how fast, all as `double`.
template <typename Visit>
void ForEachTruthRootColumn(const space_truth_t& state, TruthKind kind, Visit&& visit) {
  const truth_t& truth = state.truth;
  const bool in_space = kind == TruthKind::kInSpace;
  visit("root_x_m", truth.root_x_m);
  if (in_space) visit("root_y_m", state.root_y_m);
  visit("root_z_m", truth.root_z_m);
  if (!in_space) {
    visit("root_pitch_rad", truth.root_pitch_rad);
  } else {
    visit("root_quaternion_w", state.root_quaternion[0]);
    visit("root_quaternion_x", state.root_quaternion[1]);
    visit("root_quaternion_y", state.root_quaternion[2]);
    visit("root_quaternion_z", state.root_quaternion[3]);
  }
  visit("root_vx_m_s", truth.root_vx_m_s);
  if (in_space) visit("root_vy_m_s", state.root_vy_m_s);
  visit("root_vz_m_s", truth.root_vz_m_s);
  if (!in_space) {
    visit("root_pitch_rate_rad_s", truth.root_pitch_rate_rad_s);
  } else {
    visit("root_angular_velocity_x_rad_s", state.root_angular_velocity_rad_s[0]);
    visit("root_angular_velocity_y_rad_s", state.root_angular_velocity_rad_s[1]);
    visit("root_angular_velocity_z_rad_s", state.root_angular_velocity_rad_s[2]);
  }
}

/// Calls `visit(name, value)` for the numbers of a simulated robot's true state, without its
/// joints. All are `double` or `std::int32_t`.
template <typename Visit>
void ForEachTruthColumn(const space_truth_t& state, TruthKind kind, Visit&& visit) {
  const truth_t& truth = state.truth;
  visit("time_s", static_cast<double>(truth.time_ns) * 1e-9);
  ForEachTruthRootColumn(state, kind, visit);
  visit("held", std::int32_t{truth.held});
  visit("fallen", std::int32_t{truth.fallen});
  visit("falls", truth.falls);
  visit("push_x_n", truth.push_x_n);
  if (kind == TruthKind::kInSpace) visit("push_y_n", state.push_y_n);
  visit("push_z_n", truth.push_z_n);
  visit("peak_penetration_m", truth.peak_penetration_m);
}

/// The first line of a table of true states, without a line feed.
/// @param joint_names  the joints that it is to have.
std::string TruthCsvHeader(const std::vector<std::string>& joint_names, TruthKind kind);

/// Appends the row of one true state, with a line feed. Every number reads back exactly. The cells
/// of a joint that the state does not have are empty. It has the columns of its kind.
void AppendTruthCsvRow(const space_truth_t& state, const std::vector<std::string>& joint_names,
                       std::string& csv);

}  // namespace tumbler
