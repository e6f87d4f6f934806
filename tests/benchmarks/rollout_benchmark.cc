// Measures the time of a rollout of the handstand, with the cost alone and with its gradient, for
// 12 and for 60 parameters. The counter `times_cost` is the price of the gradient: the time with it
// divided by the time without it, measured in the same run. And of candidates of a search in space,
// Solo12 on its back: one by one, and eight at once in the lanes of each kind of vectors that the
// processor has, with `items_per_second` candidates.

#include <benchmark/benchmark.h>

#include <chrono>
#include <string>
#include <vector>

#include "offline/problem/task_toml.h"
#include "offline/scene/lane_plan_kernel.h"
#include "offline/solve/lane_rollout.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/rollout.h"
#include "tests/support/files.h"
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

/// Candidates of the search for Solo12's get-up, its own shapes left out.
struct CandidatesInSpace {
  CandidatesInSpace() {
    problem.space->scene.self_contact.pairs.clear();
    const RandomStarts starts(problem);
    for (std::uint64_t i = 0; i < Packet::kLanes; ++i) motions.push_back(starts.Draw(i));
  }
  Problem problem = LoadTask(testing::SourcePath("primitives/solo12/tasks/nominal/get_up.toml"),
                             TaskSpaces::kPlaneAndSpace)
                        .problem;
  std::vector<std::vector<double>> motions;
};

void OneByOneInSpace(benchmark::State& state) {
  const CandidatesInSpace candidates;
  Rollout rollout(candidates.problem, candidates.problem.search.step_s);
  for (auto _ : state) {
    for (const std::vector<double>& x : candidates.motions)
      benchmark::DoNotOptimize(rollout.Estimate(x).cost);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(Packet::kLanes));
}
BENCHMARK(OneByOneInSpace)->Unit(benchmark::kMillisecond);

void InLanesInSpace(benchmark::State& state, const LanePlanKernel<Packet>* kernel) {
  const CandidatesInSpace candidates;
  LaneRollout lanes(candidates.problem, candidates.problem.search.step_s,
                    LanePlan::Scheme::kSemiImplicitEuler, kernel);
  for (auto _ : state) benchmark::DoNotOptimize(lanes.Run(candidates.motions).front().cost);
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(Packet::kLanes));
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  for (const tumbler::LanePlanKernel<tumbler::Packet>* kernel : tumbler::PacketPlanKernels()) {
    benchmark::RegisterBenchmark((std::string("InLanesInSpace/") + kernel->name).c_str(),
                                 tumbler::InLanesInSpace, kernel)
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
