#include "offline/solve/joint_paths.h"

#include <stdexcept>

namespace tumbler {
namespace {

using Spline = JointMotion<double>::Spline;

}  // namespace

std::vector<double> PathKnots(const Problem& problem, int control_points, double duration_s) {
  std::vector<double> knots(Index(control_points + problem.degree + 1));
  if (Spline::ClampedUniformKnots(problem.degree, control_points, duration_s, knots) !=
      Status::kOk) {
    throw std::invalid_argument("spline degree, size and duration do not fit together");
  }
  return knots;
}

std::vector<double> ControlPoints(const Problem& problem, std::span<const double> x,
                                  std::size_t joint) {
  const ActuatedJoint& actuated = problem.joints[joint];
  const auto free = x.subspan(Index(problem.first_parameter(joint)), Index(actuated.free_points()));
  const EndPoints ends = EndPointsOf(actuated, problem.degree, problem.duration_of(x));
  std::vector<double> points(ends.first.begin(), ends.first.end());
  points.insert(points.end(), free.begin(), free.end());
  points.insert(points.end(), ends.last.begin(), ends.last.end());
  return points;
}

Spline PositionSpline(const Problem& problem, std::span<const double> x, std::size_t joint) {
  Spline spline;
  if (spline.Assign(
          problem.degree,
          PathKnots(problem, problem.joints[joint].control_points, problem.duration_of(x)),
          ControlPoints(problem, x, joint)) != Status::kOk) {
    throw std::invalid_argument("control points do not make a spline");
  }
  return spline;
}

}  // namespace tumbler
