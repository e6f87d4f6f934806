// Uses one thing of every installed library: a task, its robot's dynamics, a spline, and a frame.

#include <cstdio>
#include <exception>
#include <vector>

#include "common/bspline.h"
#include "firmware_interface/can/frame_length.h"
#include "offline/problem/task_toml.h"
#include "offline/rollout/rollout.h"
#include "runtime/faults.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    const tumbler::Task task = tumbler::LoadTask(argv[1]);
    tumbler::Rollout rollout(task.problem, task.problem.solver.step_s);
    const std::vector<double> x(static_cast<std::size_t>(rollout.parameter_count()), 0.0);
    const double cost = rollout.Run(x).cost;
    const tumbler::BSpline<float, 16> spline;
    tumbler::CanFrame frame;
    frame.size = 8;
    std::printf(
        "consumer: %s has %d parameters and cost %g at zero; a spline says %g, a frame takes %d "
        "bits, %s\n",
        task.problem.name.c_str(), rollout.parameter_count(), cost,
        static_cast<double>(spline.Evaluate(0.5F).value), tumbler::FrameBits(frame),
        tumbler::ToString(tumbler::ExecutorState::kDisarmed));
    return cost == cost && tumbler::FrameBits(frame) > 0 ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
