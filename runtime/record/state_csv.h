#pragma once

#include <string>
#include <vector>

#include <tumbler/state_t.hpp>

namespace tumbler {

/// The first line of a table of ticks: names of the columns, with their units, without a line feed.
/// @param joint_names  one for each joint of the states.
std::string StateCsvHeader(const std::vector<std::string>& joint_names);

/// Appends the row of one tick, with a line feed. Every number reads back exactly.
void AppendStateCsvRow(const state_t& state, std::string& csv);

}  // namespace tumbler
