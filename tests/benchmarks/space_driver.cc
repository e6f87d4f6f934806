// The program in which scripts/count-instructions counts the dynamics of a robot in space. It calls
// the counted function and prints how many times. usage: space_driver g|dg|ground_g|ground_dg
// [driven]: without `driven` the joints follow paths, with it they have motors that are given
// torques

#include <cstdio>
#include <string_view>

#include "tests/benchmarks/space_cases.h"

namespace tumbler {
namespace {

[[gnu::noinline]] void CountedDynamics(SpaceCase& c, bool differentiate) {
  c.Solve();
  if (differentiate) c.Differentiate();
}

int Main(std::string_view what, bool driven) {
  const bool ground = what.starts_with("ground_");
  SpaceCase c(ground, driven);
  constexpr int kCalls = 1024;
  for (int i = 0; i < kCalls; ++i) {
    CountedDynamics(c, what.ends_with("dg"));
    if (ground && c.contacts() != 4) return 1;
  }
  std::printf("%d\n", kCalls);
  return 0;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) return 2;
  return tumbler::Main(argv[1], argc == 3);
}
