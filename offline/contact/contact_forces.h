#pragma once

#include <span>

namespace tumbler {

template <class Space>
class HybridDynamics;

/// One contact that carries force.
template <class Space>
struct ActiveContact {
  int shape = 0;         ///< On which `force` acts.
  int obstacle = -1;     ///< -1: another shape of the robot.
  int other_shape = -1;  ///< That shape; -1: an obstacle.
  double depth_m = 0;    ///< Into the layer, d_on - d.
  double normal_force_n = 0;
  typename Space::Vector point;   ///< p_rob relative to the origin of the dynamics.
  typename Space::Vector force;   ///< On the robot's shape.
  typename Space::Vector normal;  ///< Unit, towards that shape.
};

/// The forces of contact on a robot, as the integration of its motion sees them: `ContactModel`
/// does, or what is written for one robot alone.
///
/// Order of calls: those of HybridDynamics, which see.
template <class Space>
class ContactForces {
 public:
  virtual ~ContactForces() = default;

  /// Adds the wrench of every active contact to `dynamics`, after its SetState. No heap.
  virtual void Apply(HybridDynamics<Space>& dynamics) = 0;

  /// Adds the derivatives of the wrenches of the last Apply to `dynamics`, after its Solve.
  virtual void Differentiate(HybridDynamics<Space>& dynamics) const = 0;

  /// The contacts of the last Apply; valid until the next.
  [[nodiscard]] virtual std::span<const ActiveContact<Space>> active() const = 0;

  /// Adds `scale` times the derivative of the depth of an active contact by all positions.
  virtual void AddDepthSlopes(const HybridDynamics<Space>& dynamics,
                              const ActiveContact<Space>& active, double scale,
                              std::span<double> slopes) const = 0;
};

}  // namespace tumbler
