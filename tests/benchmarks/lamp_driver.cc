// Finds a hop of the lamp from nothing, with one of two contact models. scripts/count-instructions
// measures it.
// usage: lamp_driver general|specific

#include <cstdio>
#include <string_view>

#include "tests/benchmarks/lamp_hop.h"

namespace tumbler {
namespace {

[[gnu::noinline]] bool CountedHop(const LampHop& hop, bool general) {
  return hop.Find(general).solutions.front().feasible();
}

int Main(std::string_view model) {
  if (!CountedHop(LampHop(), model == "general")) return 1;
  std::printf("1\n");
  return 0;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return argc == 2 ? tumbler::Main(argv[1]) : 2; }
