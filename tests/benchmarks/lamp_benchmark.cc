// Measures the time of finding the lamp's hop from nothing, with a contact model written for the
// lamp alone and with the general one.

#include <benchmark/benchmark.h>

#include "tests/benchmarks/lamp_hop.h"

namespace tumbler {
namespace {

void FindHop(benchmark::State& state) {
  const LampHop hop;
  std::int64_t evaluations = 0;
  for (auto _ : state) evaluations = hop.Find(state.range(0) != 0).evaluations;
  state.counters["evaluations"] = static_cast<double>(evaluations);
}
BENCHMARK(FindHop)->ArgName("general")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tumbler

BENCHMARK_MAIN();
