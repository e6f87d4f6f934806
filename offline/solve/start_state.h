#pragma once

#include "offline/problem/problem.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {

/// The state of the free degrees of freedom in which a problem's motions begin.
inline SceneDynamics::State StartState(const SceneDynamics& robot, const Problem& problem) {
  SceneDynamics::State y = robot.AtRest(problem.start_q);
  for (std::size_t i = 0; i < robot.free.size(); ++i) {
    if (robot.free[i] < problem.scene.robot.root_dofs)
      y[robot.free.size() + i] = problem.start_root_rates[static_cast<std::size_t>(robot.free[i])];
  }
  return y;
}

}  // namespace tumbler
