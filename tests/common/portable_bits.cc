// Says the hash of the elementary functions' bits, compiled for whatever machine: it ends with 0
// where it is that of all others.

#include "tests/common/portable_bits.h"

#include <cstdio>

int main() {
  const std::uint64_t hash = tumbler::portable::HashOfFunctions();
  std::printf("%016llx\n", static_cast<unsigned long long>(hash));
  return hash == tumbler::portable::kHashOfFunctions ? 0 : 1;
}
