// Measures the time of a rollout of the handstand, with the cost alone and with its gradient, for
// 12 and for 60 parameters. The counter `times_cost` is the price of the gradient: the time with it
// divided by the time without it, measured in the same run.

#include <benchmark/benchmark.h>

#include <chrono>

#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

constexpr double kStep = 1e-3;

Problem WithParameters(std::int64_t parameters) {
  return HandstandProblem(static_cast<int>(parameters / 2) + 6);
}

void Cost(benchmark::State& state) {
  const Problem problem = WithParameters(state.range(0));
  const std::vector<double> x = RandomMotion(problem, 1);
  Rollout rollout(problem, kStep);
  for (auto _ : state) benchmark::DoNotOptimize(rollout.Run(x).cost);
}
BENCHMARK(Cost)->ArgName("parameters")->Arg(12)->Arg(60)->Unit(benchmark::kMicrosecond);

void CostAndGradient(benchmark::State& state) {
  const Problem problem = WithParameters(state.range(0));
  const std::vector<double> x = RandomMotion(problem, 1);
  Rollout rollout(problem, kStep);
  auto gradient = OutputGradients::Of(rollout);
  using Clock = std::chrono::steady_clock;
  Clock::duration cost{};
  Clock::duration both{};
  for (auto _ : state) {
    const auto begin = Clock::now();
    benchmark::DoNotOptimize(rollout.Run(x, gradient).cost);
    const auto end = Clock::now();
    state.PauseTiming();
    benchmark::DoNotOptimize(rollout.Run(x).cost);
    cost += Clock::now() - end;
    both += end - begin;
    state.ResumeTiming();
  }
  state.counters["times_cost"] =
      static_cast<double>(both.count()) / static_cast<double>(cost.count());
}
BENCHMARK(CostAndGradient)->ArgName("parameters")->Arg(12)->Arg(60)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace tumbler

BENCHMARK_MAIN();
