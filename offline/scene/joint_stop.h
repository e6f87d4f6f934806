#pragma once

#include "common/core/scalar.h"

namespace tumbler {

/// Stiffness and damping of a stop where a simulation does not say otherwise. A leg at 10 rad/s
/// goes 0.04 rad into it.
inline constexpr double kStopStiffness_nm_per_rad = 500;
inline constexpr double kStopDamping_nm_s_per_rad = 2;

/// What a joint meets at its position limits: a spring that never pulls, with a damper. S is a
/// double, or the lanes of vectors.
template <class S>
struct JointStop {
  S stiffness, damping;
  S lower, upper;  ///< Positions where it begins.

  [[nodiscard, gnu::always_inline]] S Torque(const S& position, const S& velocity) const {
    const S above = Min(S(0), stiffness * (upper - position) - damping * velocity);
    const S below = Max(S(0), stiffness * (lower - position) - damping * velocity);
    return Select(upper < position, above, S(0)) + Select(position < lower, below, S(0));
  }
};

}  // namespace tumbler
