#pragma once

#include <string>

namespace tumbler {

/// A share with its confidence interval at 95 %, after Wilson [W27]. It holds for small numbers,
/// and for shares near 0 and 1, too.
///
/// [W27] E. B. Wilson, Probable Inference, the Law of Succession, and Statistical Inference,
/// J. Am. Stat. Assoc. 22(158), 1927.
struct Share {
  int count = 0, of = 0;
  double low = 0, high = 1;

  [[nodiscard]] double value() const { return of == 0 ? 0 : static_cast<double>(count) / of; }
};
[[nodiscard]] Share ShareOf(int count, int of);

/// For people: the share and the interval, in percent.
std::string ToText(const Share& share);

}  // namespace tumbler
