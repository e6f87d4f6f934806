#include "offline/problem/end_points.h"

#include <algorithm>

namespace tumbler {

EndPoints EndPointSlopes(const ActuatedJoint& joint, int degree) {
  const int spans = joint.control_points - degree;
  // How far the points are from the end, in parts of the duration times the velocity.
  const double near = 1.0 / (degree * spans);
  const double far = near + std::min(2, spans) * near;
  return {{0, joint.start_rad_s * near, joint.start_rad_s * far},
          {-joint.end_rad_s * far, -joint.end_rad_s * near, 0}};
}

EndPoints EndPointsOf(const ActuatedJoint& joint, int degree, double duration_s) {
  EndPoints points;
  points.first.fill(joint.start_rad);
  points.last.fill(joint.end_rad);
  if (joint.start_rad_s == 0 && joint.end_rad_s == 0) return points;
  const EndPoints slopes = EndPointSlopes(joint, degree);
  for (std::size_t i = 0; i < 3; ++i) {
    points.first[i] += duration_s * slopes.first[i];
    points.last[i] += duration_s * slopes.last[i];
  }
  return points;
}

}  // namespace tumbler
