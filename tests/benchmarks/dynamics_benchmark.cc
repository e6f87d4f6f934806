// Measures the time of hybrid dynamics g and of its derivative dg for the shipped robot. DART's
// hybrid dynamics (articulated bodies in three dimensions, no derivative) is measured in the same
// run, as a known reference.

#include <benchmark/benchmark.h>

#include "tests/benchmarks/dynamics_cases.h"
#include "tests/support/dart_tumbler.h"

namespace tumbler {
namespace {

void Solve(benchmark::State& state) {
  DynamicsCase c(state.range(0) != 0);
  for (auto _ : state) {
    c.Solve();
    benchmark::DoNotOptimize(c.states().data());
  }
  state.counters["contacts"] = static_cast<double>(c.contacts());
}
BENCHMARK(Solve)->Name("g")->ArgName("ground")->Arg(0)->Arg(1);

void SolveAndDifferentiate(benchmark::State& state) {
  DynamicsCase c(state.range(0) != 0);
  for (auto _ : state) {
    c.Solve();
    c.Differentiate();
    benchmark::DoNotOptimize(c.derivatives());
  }
  state.counters["contacts"] = static_cast<double>(c.contacts());
}
BENCHMARK(SolveAndDifferentiate)->Name("g and dg")->ArgName("ground")->Arg(0)->Arg(1);

void SolveInDart(benchmark::State& state) {
  const DynamicsCase c(false);
  const dart::dynamics::SkeletonPtr skeleton = LoadTumblerInDart();
  std::array<dart::dynamics::Joint*, 5> joints{};
  for (std::size_t i = 0; i < 5; ++i) {
    joints[i] = skeleton->getJoint(kDartJoints[i]);
    joints[i]->setActuatorType(i < 3 ? dart::dynamics::Joint::FORCE
                                     : dart::dynamics::Joint::ACCELERATION);
  }
  std::size_t next = 0;
  for (auto _ : state) {
    const DynamicsState& s = c.states()[next++ % c.states().size()];
    for (std::size_t i = 0; i < 5; ++i) {
      joints[i]->setPosition(0, s.q[i]);
      joints[i]->setVelocity(0, s.qd[i]);
      joints[i]->setCommand(0, i < 3 ? s.tau[i] : s.qdd[i]);
    }
    skeleton->computeForwardDynamics();
    benchmark::DoNotOptimize(joints[4]->getForce(0));
  }
}
BENCHMARK(SolveInDart)->Name("g in DART");

}  // namespace
}  // namespace tumbler

BENCHMARK_MAIN();
