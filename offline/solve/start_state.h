#pragma once

#include <type_traits>

#include "offline/problem/problem.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {

/// The scene of a problem, in the plane or in space.
template <class Space>
const SceneOf<Space>& SceneIn(const Problem& problem) {
  if constexpr (std::is_same_v<Space, Plane>) {
    return problem.scene;
  } else {
    return problem.space->scene;
  }
}

/// The axes of the root in which a problem's motions begin.
template <class Space>
RootChart<Space> StartChart(const Problem& problem) {
  RootChart<Space> chart;
  if constexpr (RootChart<Space>::kMoves) chart.axes = problem.space->start_orientation;
  return chart;
}

/// The state of the free degrees of freedom in which a problem's motions begin. In space that is at
/// rest.
template <class Space>
typename SceneDynamicsIn<Space>::State StartState(const SceneDynamicsIn<Space>& robot,
                                                  const Problem& problem) {
  typename SceneDynamicsIn<Space>::State y = robot.AtRest(problem.start_q);
  if constexpr (std::is_same_v<Space, Plane>) {
    for (std::size_t i = 0; i < robot.free.size(); ++i) {
      if (robot.free[i] < problem.scene.robot.root_dofs) {
        y[robot.free.size() + i] =
            problem.start_root_rates[static_cast<std::size_t>(robot.free[i])];
      }
    }
  }
  return y;
}

}  // namespace tumbler
