// The program in which scripts/count-instructions counts dynamics and rollouts. It calls the
// counted function of the given name and prints how many times (for a rollout, the number of its
// Runge-Kutta stages). usage: dynamics_driver
// g|dg|ground_g|ground_dg|cost|gradient|long_gradient|forward, or
// adjoint|forward PARAMETERS: a gradient of the shipped handstand's task with so many parameters

#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "offline/problem/task_toml.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"
#include "tests/benchmarks/dynamics_cases.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

[[gnu::noinline]] void CountedDynamics(DynamicsCase& c, bool differentiate) {
  c.Solve();
  if (differentiate) c.Differentiate();
}

[[gnu::noinline]] double CountedRollout(Rollout& rollout, const std::vector<double>& x,
                                        OutputGradients* gradient) {
  return gradient == nullptr ? rollout.Run(x).cost : rollout.Run(x, *gradient).cost;
}

[[gnu::noinline]] double CountedForward(ForwardSensitivity& forward, const std::vector<double>& x,
                                        OutputGradients& gradient) {
  return forward.Run(x, gradient).cost;
}

void PrintStages(const Problem& problem, double step_s) {
  std::printf("%.0f\n", 4 * (problem.duration_s + problem.settle_s) / step_s);
}

/// A gradient of the shipped task by either method, with the same steps.
int CountShipped(std::string_view method, int parameters) {
  Problem problem =
      LoadTask(testing::SourcePath("primitives/tasks/nominal/handstand.toml")).problem;
  for (ActuatedJoint& joint : problem.joints) joint.control_points = 6 + parameters / 2;
  const std::vector<double> x = RandomMotion(problem, 1);
  const double step_s = problem.solver.step_s;
  if (method == "forward") {
    ForwardSensitivity forward(problem, {StepSettings::Scheme::kFixed, step_s});
    auto gradient = OutputGradients::Of(forward);
    CountedForward(forward, x, gradient);
  } else {
    Rollout rollout(problem, step_s);
    auto gradient = OutputGradients::Of(rollout);
    rollout.Run(x, gradient);
    CountedRollout(rollout, x, &gradient);
  }
  PrintStages(problem, step_s);
  return 0;
}

int Main(std::string_view what) {
  const bool ground = what.starts_with("ground_");
  if (what == "g" || what == "dg" || ground) {
    DynamicsCase c(ground);
    constexpr int kCalls = 1024;
    for (int i = 0; i < kCalls; ++i) CountedDynamics(c, what.ends_with("dg"));
    if (ground && c.contacts() != 2) return 1;
    std::printf("%d\n", kCalls);
    return 0;
  }
  constexpr double kStep = 1e-3;
  if (what == "forward") {
    Problem problem = HandstandProblem();
    problem.joints[0].control_points = 11;
    ForwardSensitivity forward(problem, {StepSettings::Scheme::kFixed, kStep});
    auto gradient = OutputGradients::Of(forward);
    CountedForward(forward, RandomMotion(problem, 1), gradient);
    PrintStages(problem, kStep);
    return 0;
  }
  const Problem problem = HandstandProblem(what == "long_gradient" ? 36 : 12);
  Rollout rollout(problem, kStep);
  auto gradient = OutputGradients::Of(rollout);
  const std::vector<double> x = RandomMotion(problem, 1);
  rollout.Run(x, gradient);  // The first gradient makes room for the record.
  CountedRollout(rollout, x, what == "cost" ? nullptr : &gradient);
  PrintStages(problem, kStep);
  return 0;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  if (argc == 3) return tumbler::CountShipped(argv[1], std::atoi(argv[2]));
  return argc == 2 ? tumbler::Main(argv[1]) : 2;
}
