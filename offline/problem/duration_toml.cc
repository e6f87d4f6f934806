#include "offline/problem/duration_toml.h"

#include <fmt/format.h>

namespace tumbler {

std::optional<DurationBounds> CheckedBounds(TomlTable& table, const std::optional<double>& min_s,
                                            const std::optional<double>& max_s, double duration_s) {
  if (!min_s && !max_s) return std::nullopt;
  if (!min_s || !max_s) {
    table.Fail(min_s ? "duration_max_s" : "duration_min_s",
               "is missing; allowed: both bounds of the duration, or none");
  }
  if (*min_s > *max_s) {
    table.Fail("duration_min_s", fmt::format("is {} s, above duration_max_s, which is {} s; give "
                                             "the smaller one as duration_min_s",
                                             *min_s, *max_s));
  }
  if (duration_s < *min_s || duration_s > *max_s) {
    table.Fail(duration_s < *min_s ? "duration_min_s" : "duration_max_s",
               fmt::format("is {} s, but the task's duration_s is {} s; allowed: {}",
                           duration_s < *min_s ? *min_s : *max_s, duration_s,
                           duration_s < *min_s ? "up to duration_s" : "duration_s or more"));
  }
  return DurationBounds{*min_s, *max_s};
}

}  // namespace tumbler
