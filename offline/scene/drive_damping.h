#pragma once

#include <span>
#include <vector>

#include "offline/model/hybrid_dynamics.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {

/// The rate at which the dampings of a robot's drives act: the largest eigenvalue of A Kd
/// (common/core/damping_bound.h) [1/s]. It does not depend on where the root is, nor on what it
/// touches.
template <class Space>
class DriveDampingIn {
 public:
  /// @param dofs  of the driven joints.
  /// @param kd    of each of their drives, at the joint [N m s/rad], 0 or more.
  DriveDampingIn(const SceneOf<Space>& scene, std::vector<int> dofs, std::vector<double> kd);

  /// @param q  positions of all degrees of freedom [m, rad].
  [[nodiscard]] double RateAt(std::span<const double> q);

 private:
  HybridDynamics<Space> dynamics_;
  std::vector<int> dofs_;
  std::vector<double> kd_;
};

using DriveDamping = DriveDampingIn<Plane>;

}  // namespace tumbler
