#include "offline/problem/bounds_toml.h"

#include <fmt/format.h>

namespace tumbler {

std::optional<Interval<double>> CheckedBounds(TomlTable& table, const BoundedQuantity& of,
                                              const std::optional<double>& least,
                                              const std::optional<double>& most, double given) {
  if (!least && !most) return std::nullopt;
  if (!least || !most) {
    table.Fail(least ? of.most : of.least,
               fmt::format("is missing; allowed: both bounds of the {}, or none", of.name));
  }
  if (*least > *most) {
    table.Fail(of.least, fmt::format("is {0} {1}, above {2}, which is {3} {1}; give the smaller "
                                     "one as {4}",
                                     *least, of.unit, of.most, *most, of.least));
  }
  if (given < *least || given > *most) {
    const bool below = given < *least;
    table.Fail(below ? of.least : of.most,
               fmt::format("is {0} {1}, but the task's {2} is {3} {1}; allowed: {4}",
                           below ? *least : *most, of.unit, of.given, given,
                           below ? fmt::format("up to {}", of.given)
                                 : fmt::format("{} or more", of.given)));
  }
  return Interval<double>{*least, *most};
}

}  // namespace tumbler
