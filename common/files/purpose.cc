#include "common/files/purpose.h"

#include <fmt/format.h>

#include <cmath>

#include "common/files/json.h"

namespace tumbler {

std::string PurposeTarget::NameAfter(double later_s) const {
  std::string text(kOfNames[static_cast<std::size_t>(of)]);
  if (of == Of::kSpeed) text = "speed of the root";
  if (of_point()) text += fmt::format(" of {} at ({:.6g}, {:.6g})", link, point_m[0], point_m[1]);
  if (is_in_space()) {
    text += fmt::format(" of {}", link);
    if (of_axis()) {
      text += fmt::format("'s ({:.6g}, {:.6g}, {:.6g}) {}", in_space[0], in_space[1], in_space[2],
                          of == Of::kHeading ? "about" : "with");
    } else if (of == Of::kAngularVelocity) {
      text += " about";
    } else {
      text +=
          fmt::format(" at ({:.6g}, {:.6g}, {:.6g}) along", in_space[0], in_space[1], in_space[2]);
    }
    text += fmt::format(" ({:.6g}, {:.6g}, {:.6g})", along[0], along[1], along[2]);
  }
  switch (when) {
    case When::kEnd:
      return text + ", at the end";
    case When::kSettled:
      return text + ", settled";
    case When::kLater:
      return text + fmt::format(", {:.2g} s later", later_s);
    case When::kTime:
      return text + fmt::format(", at {:.6g} s", time_s);
  }
  return text;
}

const char* PurposeTarget::unit() const {
  constexpr std::array kUnits = {
      "m", "m",   "rad", "m/s", "m/s", "rad/s", "m/s, rad/s",        "m",
      "m", "m/s", "m/s", "m",   "m/s", "rad/s", "as 2 sin(angle/2)", "rad"};
  return kUnits[static_cast<std::size_t>(of)];
}

namespace {

constexpr const char* kNoHeading =
    "the axis points along the direction about which its heading would be: it has none";

}  // namespace

std::string PurposeTarget::AskedAndGot(double result) const {
  // A target that was calculated, such as where a resting robot is, is seldom 0 to the bit.
  const double asked = std::abs(target) < 1e-9 * tolerance ? 0 : target;
  if (of == Of::kHeading && std::isnan(result))
    return fmt::format("asked {:.6g} {}, got none: {}", asked, unit(), kNoHeading);
  return fmt::format("asked {:.6g}, got {:.6g} {} (within {:.3g})", asked, result, unit(),
                     tolerance);
}

void JudgedTarget::Judge(double value) {
  result = value;
  obstacle.clear();
  if (target.of != PurposeTarget::Of::kHeading || !std::isnan(value)) return;
  result.reset();
  obstacle = kNoHeading;
}

std::string JudgedTarget::name() const {
  return after_s ? target.NameAfter(*after_s) : target.name();
}

std::optional<bool> JudgedTarget::met() const {
  if (!result) return std::nullopt;
  return target.MetBy(*result);
}

std::string JudgedTarget::Verdict() const {
  if (!result) return "not judged, " + (obstacle.empty() ? "the run ended before" : obstacle);
  return target.AskedAndGot(*result) + (*met() ? "" : ": MISSED");
}

Json ToJson(const JudgedTarget& judged) {
  const auto maybe = [](const auto& value) { return value ? Json(*value) : Json(); };
  return {{"of", judged.target.name()},       {"unit", judged.target.unit()},
          {"target", judged.target.target},   {"result", maybe(judged.result)},
          {"after_s", maybe(judged.after_s)}, {"tolerance", judged.target.tolerance},
          {"met", maybe(judged.met())}};
}

std::optional<bool> AllMet(const std::vector<JudgedTarget>& purpose) {
  bool all = !purpose.empty();
  for (const JudgedTarget& judged : purpose) {
    const std::optional<bool> met = judged.met();
    if (met == false) return false;
    if (!met) all = false;
  }
  return all ? std::optional(true) : std::nullopt;
}

}  // namespace tumbler
