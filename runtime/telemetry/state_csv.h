#pragma once

#include <string>
#include <vector>

#include <tumbler/state_t.hpp>

namespace tumbler {

/// The columns of a table of ticks, units in their names, without a line feed.
/// @param joint_names  as many as the states have joints.
std::string StateCsvHeader(const std::vector<std::string>& joint_names);

/// Appends the row of one tick, with a line feed. Numbers are written with as many digits as bring
/// them back exactly.
void AppendStateCsvRow(const state_t& state, std::string& csv);

}  // namespace tumbler
