#pragma once

#include <span>
#include <vector>

#include "offline/model/hybrid_dynamics.h"
#include "offline/model/plane.h"
#include "offline/scene/scene.h"

namespace tumbler {

/// The rate at which the dampings of a robot's drives act: the largest eigenvalue of A Kd
/// (common/core/damping_bound.h) [1/s]. It does not depend on where the root is, nor on what it
/// touches.
class DriveDamping {
 public:
  /// @param dofs  of the driven joints.
  /// @param kd    of each of their drives, at the joint [N m s/rad], 0 or more.
  DriveDamping(const Scene& scene, std::vector<int> dofs, std::vector<double> kd);

  /// @param q  positions of all degrees of freedom [m, rad].
  [[nodiscard]] double RateAt(std::span<const double> q);

 private:
  HybridDynamics<Plane> dynamics_;
  std::vector<int> dofs_;
  std::vector<double> kd_;
};

}  // namespace tumbler
