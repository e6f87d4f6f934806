// The program in which scripts/count-instructions counts dynamics and rollouts of a robot in space.
// It calls the counted function and prints how many times (for a rollout, the number of its
// Runge-Kutta stages). usage: space_driver g|dg|ground_g|ground_dg [driven]: without `driven` the
// joints follow paths, with it they have motors that are given torques; or space_driver
// cost|gradient: Solo12's turn, its legs moved a little

#include <cstdio>
#include <string_view>

#include "offline/problem/task_toml.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/rollout.h"
#include "tests/benchmarks/space_cases.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

[[gnu::noinline]] void CountedDynamics(SpaceCase& c, bool differentiate) {
  c.Solve();
  if (differentiate) c.Differentiate();
}

[[gnu::noinline]] double CountedRollout(Rollout& rollout, const std::vector<double>& x,
                                        OutputGradients* gradient) {
  return gradient == nullptr ? rollout.Run(x).cost : rollout.Run(x, *gradient).cost;
}

int CountTurn(bool with_gradient) {
  Problem problem = LoadTask(testing::SourcePath("primitives/solo12/tasks/nominal/turn.toml"),
                             TaskSpaces::kPlaneAndSpace)
                        .problem;
  problem.search.spread_rad = 0.2;
  const std::vector<double> x = RandomStarts(problem).Draw(1);
  const double step_s = problem.solver.step_s;
  Rollout rollout(problem, step_s);
  auto gradient = OutputGradients::Of(rollout);
  rollout.Run(x, gradient);  // The first gradient makes room for the record.
  CountedRollout(rollout, x, with_gradient ? &gradient : nullptr);
  std::printf("%.0f\n", 4 * (problem.duration_s + problem.settle_s) / step_s);
  return 0;
}

int Main(std::string_view what, bool driven) {
  if (what == "cost" || what == "gradient") return CountTurn(what == "gradient");
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
