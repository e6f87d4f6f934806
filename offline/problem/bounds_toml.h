#pragma once

#include <optional>

#include "common/files/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// A quantity that is looked for between bounds, in the words of a task.
struct BoundedQuantity {
  const char* name;   ///< Such as `duration`.
  const char* unit;   ///< Of all three keys.
  const char* least;  ///< Key of the lower bound,
  const char* most;   ///< of the upper one, and
  const char* given;  ///< of the value with which the search begins.
};
inline constexpr BoundedQuantity kBoundedDuration{"duration", "s", "duration_min_s",
                                                  "duration_max_s", "duration_s"};

/// Checks the bounds of a quantity that is looked for.
/// @param table  has both, whose values these are.
/// @param given  has to lie between them.
/// @returns the bounds; none where the table has neither.
/// @throws FileError  when one of the two is missing, or `given` lies outside of them.
std::optional<Interval<double>> CheckedBounds(TomlTable& table, const BoundedQuantity& of,
                                              const std::optional<double>& least,
                                              const std::optional<double>& most, double given);

}  // namespace tumbler
