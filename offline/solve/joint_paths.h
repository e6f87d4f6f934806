#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "common/core/index.h"
#include "common/core/primitive.h"
#include "offline/problem/end_points.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// The path of a joint at one time, or its derivative by something [rad, rad/s, rad/s^2].
struct PathPoint {
  double q = 0, qd = 0, qdd = 0;
};

/// Knots of a path with so many control points: clamped and uniform over the motion.
/// @throws std::invalid_argument  when degree, size and duration do not fit together.
std::vector<double> PathKnots(const Problem& problem, int control_points, double duration_s);

/// All control points of a joint for the parameters x: fixed start, free points, fixed end [rad].
std::vector<double> ControlPoints(const Problem& problem, std::span<const double> x,
                                  std::size_t joint);

/// The joint's spline for the parameters x.
/// @throws std::invalid_argument  when they do not make one.
JointMotion<double>::Spline PositionSpline(const Problem& problem, std::span<const double> x,
                                           std::size_t joint);

/// One control point of a joint, without a vector of them all.
/// @param ends  EndPointsOf the joint.
/// @param i     counts from the first control point, which the start fixes.
inline double ControlPointOf(const ActuatedJoint& joint, const EndPoints& ends, int first_parameter,
                             std::span<const double> x, int i) {
  return i < 3 || i >= 3 + joint.free_points() ? ends.At(i, joint.control_points)
                                               : x[Index(first_parameter + i - 3)];
}

/// Which of the degree + 1 weights that make a path at one time belong to parameters: weight i to
/// the parameter `shift` + i, for `begin` <= i < `end`. The others belong to the fixed ends.
struct FreeWeights {
  /// @param first  index of the control point that the first weight belongs to.
  FreeWeights(const ActuatedJoint& joint, int first_parameter, int degree, int first)
      : begin(std::max(0, 3 - first)),
        end(std::min(degree + 1, 3 + joint.free_points() - first)),
        shift(first_parameter + first - 3) {}
  int begin, end, shift;
};

}  // namespace tumbler
