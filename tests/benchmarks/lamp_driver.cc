// What scripts/count-instructions measures of contact models: a hop of the lamp, found from
// nothing. usage: lamp_driver general|specific

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
