#pragma once

#include <optional>

#include "common/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// Checks the bounds of a duration that is looked for.
/// @param table       has `duration_min_s` and `duration_max_s`, whose values these are.
/// @param duration_s  of the task; has to lie between them.
/// @returns the bounds; none where the table has neither.
/// @throws FileError  when one of the two is missing, or duration_s lies outside of them.
std::optional<DurationBounds> CheckedBounds(TomlTable& table, const std::optional<double>& min_s,
                                            const std::optional<double>& max_s, double duration_s);

}  // namespace tumbler
