#pragma once

#include <array>
#include <span>

#include "common/bspline.h"
#include "common/fixed_string.h"

namespace tumbler {

/// Capacities of everything that a primitive holds; the real-time side allocates nothing.
inline constexpr int kMaxJoints = 8;  ///< The runtime serves one to eight joints.
inline constexpr int kMaxControlPoints =
    64;  ///< A 1.2 s motion needs about 12 a joint; 64 leaves room for feed-forward.

/// Limits that a motion of one joint was made for, and that its commands never exceed.
template <typename Scalar>
struct JointLimits {
  Scalar position_min_rad = 0;
  Scalar position_max_rad = 0;
  Scalar velocity_max_rad_s = 0;       ///< of |velocity|
  Scalar acceleration_max_rad_s2 = 0;  ///< of |acceleration|
  Scalar torque_max_nm = 0;            ///< of |torque|
};

/// The motion of one actuated joint.
template <typename Scalar>
struct JointMotion {
  using Spline = BSpline<Scalar, kMaxControlPoints>;
  FixedString<32> name;  ///< The joint's name in the robot's URDF.
  Spline position;       ///< [rad] on [0, duration], twice continuously differentiable.
  Spline torque;  ///< Feed-forward [N m] on [0, duration]: what the plan expects the motor to give.
  JointLimits<Scalar> limits;
};

/// A motion primitive: what the optimiser makes and the executor plays.
///
/// It holds the paths of the actuated joints only; where they carry the robot is recorded in its
/// file
/// (`common/primitive_toml.h`). A leg role swap and the order of primitives belong to the sequence,
/// not to the primitive. A primitive starts and ends with the joint velocities and accelerations of
/// its splines' ends.
template <typename Scalar>
struct Primitive {
  FixedString<48> name;
  Scalar duration_s = 1;  ///< Every spline ends here.
  Scalar settle_s =
      0;  ///< How long the final setpoint is held before the motion counts as finished.
  Scalar entry_tolerance_rad =
      0;  ///< The start set: largest |measured - first position| of any joint.
  Scalar following_tolerance_rad =
      0;  ///< Largest |measured - setpoint| of any joint while running.
  int joint_count = 0;
  std::array<JointMotion<Scalar>, kMaxJoints> joints;

  [[nodiscard]] std::span<const JointMotion<Scalar>> motions() const noexcept {
    return {joints.data(), static_cast<std::size_t>(joint_count)};
  }
};

}  // namespace tumbler
