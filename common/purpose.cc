#include "common/purpose.h"

#include <fmt/format.h>

namespace tumbler {

std::string PurposeTarget::name() const {
  constexpr std::array<const char*, 3> kWhen = {"at the end", "settled", "2 s later"};
  const std::string_view of_name =
      of == Of::kSpeed ? "speed of the root" : kOfNames[static_cast<std::size_t>(of)];
  return fmt::format("{}, {}", of_name, kWhen[static_cast<std::size_t>(when)]);
}

const char* PurposeTarget::unit() const {
  constexpr std::array kUnits = {"m", "m", "rad", "m/s", "m/s", "rad/s", "m/s, rad/s"};
  return kUnits[static_cast<std::size_t>(of)];
}

std::string PurposeTarget::AskedAndGot(double result) const {
  return fmt::format("asked {:.6g}, got {:.6g} {} (within {:.3g})", target, result, unit(),
                     tolerance);
}

}  // namespace tumbler
