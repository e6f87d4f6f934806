#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "offline/scene/root_chart.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {

/// A collision shape that is in an obstacle deeper than the compliant layer is thick.
struct BuriedShape {
  std::string shape, obstacle;
  double by_m = 0;  ///< More than the layer.
};

/// The deepest of them; none where all are outside.
/// @param q      positions of all degrees of freedom [m, rad].
/// @param chart  of a root in space.
template <class Space>
std::optional<BuriedShape> FindBuried(const SceneOf<Space>& scene, std::span<const double> q,
                                      const RootChart<Space>& chart = {}) {
  SceneDynamicsIn<Space> robot(scene);
  robot.Use(chart);
  std::copy(q.begin(), q.end(), robot.q.begin());
  robot.Touch();
  const ActiveContact<Space>* deepest = nullptr;
  for (const ActiveContact<Space>& active : robot.contact->active()) {
    if (deepest == nullptr || active.depth_m > deepest->depth_m) deepest = &active;
  }
  const double layer = scene.contact.d_on_m;
  if (deepest == nullptr || deepest->depth_m < layer) return std::nullopt;
  return BuriedShape{scene.robot.shapes[static_cast<std::size_t>(deepest->shape)].name,
                     TouchedName(scene, *deepest), deepest->depth_m - layer};
}

}  // namespace tumbler
