#include "common/files/share.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tumbler {

Share ShareOf(int count, int of) {
  Share share{count, of};
  if (of == 0) return share;
  constexpr double z = 1.959963984540054;
  const double n = of;
  const double p = count / n;
  const double middle = (p + z * z / (2 * n)) / (1 + z * z / n);
  const double half = z / (1 + z * z / n) * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  share.low = count == 0 ? 0 : std::max(0.0, middle - half);
  share.high = count == of ? 1 : std::min(1.0, middle + half);
  return share;
}

std::string ToText(const Share& share) {
  return fmt::format("{:.1f} % (95 %: {:.1f} ... {:.1f} %)", 100 * share.value(), 100 * share.low,
                     100 * share.high);
}

}  // namespace tumbler
