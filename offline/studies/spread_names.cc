#include "offline/studies/spread_names.h"

#include <fmt/format.h>

namespace tumbler {
namespace {

Json JsonOfSpread(double value) { return value; }
Json JsonOfSpread(const GroundSpread& spread) {
  if (const double* deviation = spread.deviation()) return *deviation;
  if (const GroundSpread::Between* between = spread.between())
    return {{"from", between->from}, {"to", between->to}};
  return {{"factor", spread.either_way()->most}};
}

std::string ToText(double value) { return fmt::format("{}", value); }

bool IsNone(double value) { return value == 0; }
bool IsNone(const GroundSpread& spread) { return spread.none(); }

}  // namespace

std::string SpreadName::TextOf(const Spreads& spreads) const {
  return std::visit([&spreads](auto at) { return ToText(spreads.*at); }, member);
}

Json SpreadName::JsonOf(const Spreads& spreads) const {
  return std::visit([&spreads](auto at) { return JsonOfSpread(spreads.*at); }, member);
}

bool SpreadName::none(const Spreads& spreads) const {
  return std::visit([&spreads](auto at) { return IsNone(spreads.*at); }, member);
}

void SpreadName::Set(double value, Spreads& spreads) const {
  std::visit([&spreads, value](auto at) { spreads.*at = value; }, member);
}

}  // namespace tumbler
