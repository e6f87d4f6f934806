#pragma once

#include <string>
#include <vector>

#include "common/core/primitive.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// How slow the loops of the drives may be that play a motion (common/core/damping_bound.h).
struct DampedMotion {
  double rate_per_s = 0;  ///< The largest one of the motion's poses; 0: no damping.
  double time_s = 0;      ///< When the motion has it.

  /// The longest period of a drive's loop with which its damping is stable [s].
  [[nodiscard]] double LongestPeriod() const;
  /// Half of it, the longest that is advised [s].
  [[nodiscard]] double AdvisedPeriod() const;
  /// "kd of 5 N m s/rad is stable in a drive whose loop takes less than 0.824 ms (above 1.21 kHz;
  /// at 0.65 s of the motion); up to half of that, 0.412 ms, is advised"
  /// @param kd  of each joint's drive.
  [[nodiscard]] std::string Describe(const std::vector<double>& kd) const;
};

/// Of the poses on a primitive's paths, at 1 ms or closer. Joints without a motor are where the
/// motion begins.
/// @param problem  that the primitive was made for.
/// @param kd       of the drive of each of the problem's joints, at the joint [N m s/rad].
DampedMotion DampingOf(const Problem& problem, const Primitive<double>& primitive,
                       const std::vector<double>& kd);

}  // namespace tumbler
