#include "offline/scene/ground_spread.h"

#include <fmt/format.h>

#include <charconv>
#include <system_error>

namespace tumbler {
namespace {

std::optional<double> NumberOf(std::string_view text) {
  double value = 0;
  const char* const end = text.data() + text.size();
  // It is given its end. NOLINTNEXTLINE(bugprone-suspicious-stringview-data-usage)
  const auto [at, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || at != end) return std::nullopt;
  return value;
}

}  // namespace

std::string GroundSpreadLimits::Allowed() const {
  return fmt::format(
      "a number from 0 to {:.6g}, a range of values with 0 < from < to <= {:.6g}, or a factor "
      "above 1, to {:.6g}",
      most_deviation, most_value, most_factor);
}

std::string MistakeIn(const GroundSpread& spread, const GroundSpreadLimits& limits) {
  bool right = false;  // also of a NaN
  if (const double* deviation = spread.deviation()) {
    right = 0 <= *deviation && *deviation <= limits.most_deviation;
  } else if (const GroundSpread::Between* between = spread.between()) {
    right = 0 < between->from && between->from < between->to && between->to <= limits.most_value;
  } else {
    const double most = spread.either_way()->most;
    right = 1 < most && most <= limits.most_factor;
  }
  return right ? "" : fmt::format("is {}; allowed: {}", ToText(spread), limits.Allowed());
}

std::string ToText(const GroundSpread& spread) {
  if (const double* deviation = spread.deviation()) return fmt::format("{}", *deviation);
  if (const GroundSpread::Between* between = spread.between())
    return fmt::format("{}..{}", between->from, between->to);
  return fmt::format("x{}", spread.either_way()->most);
}

std::optional<GroundSpread> ParseGroundSpread(std::string_view text) {
  if (text.starts_with('x')) {
    const std::optional<double> most = NumberOf(text.substr(1));
    if (!most) return std::nullopt;
    return GroundSpread::EitherWay{*most};
  }
  const std::size_t dots = text.find("..");
  if (dots == std::string_view::npos) {
    const std::optional<double> deviation = NumberOf(text);
    if (!deviation) return std::nullopt;
    return *deviation;
  }
  const std::optional<double> from = NumberOf(text.substr(0, dots));
  const std::optional<double> to = NumberOf(text.substr(dots + 2));
  if (!from || !to) return std::nullopt;
  return GroundSpread::Between{*from, *to};
}

}  // namespace tumbler
