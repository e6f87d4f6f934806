// Begins to look for a hop of the lamp from nothing, with one of two contact models, and prints how
// many evaluations that took. scripts/count-instructions measures it. The two solves take different
// ways, so that only what an evaluation costs can be compared. usage: lamp_driver general|specific

#include <cstdio>
#include <string_view>

#include "tests/benchmarks/lamp_hop.h"

namespace tumbler {
namespace {

[[gnu::noinline]] SolveOutcome CountedHop(const LampHop& hop, bool general) {
  return hop.Find(general);
}

int Main(std::string_view model) {
  const SolveOutcome found = CountedHop(LampHop::Begun(), model == "general");
  if (found.evaluations < 25) return 1;
  std::printf("%lld\n", static_cast<long long>(found.evaluations));
  return 0;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return argc == 2 ? tumbler::Main(argv[1]) : 2; }
