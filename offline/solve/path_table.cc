#include "offline/solve/path_table.h"

#include <stdexcept>

#include "offline/problem/end_points.h"

namespace tumbler {

PathTable::PathTable(const ParametricMotion& motion) : motion_(motion) {}

void PathTable::Tabulate(const Timetable& table) {
  time_ = table.time;
  weights_.clear();
  weights_of_.clear();
  for (int j = 0; j < motion_.joints(); ++j) {
    const int size = motion_.joint(j).control_points;
    int same = 0;
    while (motion_.joint(same).control_points != size) ++same;
    weights_of_.push_back(same == j ? weights_.size() / time_.size() : weights_of_[Index(same)]);
    if (same == j) AppendWeights(size);
  }
  paths_.resize(time_.size() * joints());
}

void PathTable::AppendWeights(int control_points) {
  Spline spline;
  if (spline.Assign(motion_.problem().degree,
                    PathKnots(motion_.problem(), control_points, motion_.duration_s()),
                    std::vector<double>(Index(control_points))) != Status::kOk) {
    throw std::invalid_argument("spline degree and size do not fit together");
  }
  weights_.reserve(weights_.size() + time_.size());
  for (const double t : time_) {
    const Spline::Weights w = spline.EvaluateWeights(t);
    weights_.push_back({w.first, w.w});
  }
}

void PathTable::Evaluate(std::span<const double> x) {
  const int degree = motion_.problem().degree;
  for (int j = 0; j < motion_.joints(); ++j) {
    const ActuatedJoint& joint = motion_.joint(j);
    std::array<double, kMaxControlPoints> c{};
    const EndPoints ends = EndPointsOf(joint, degree, motion_.duration_s());
    for (int i = 0; i < joint.control_points; ++i)
      c[Index(i)] = ControlPointOf(joint, ends, motion_.first_parameter(j), x, i);
    for (std::size_t k = 0; k < time_.size(); ++k) {
      const Weights& w = WeightsOf(j, k);
      PathPoint sum;
      for (int i = 0; i <= degree; ++i) {
        const double point = c[Index(w.first + i)];
        sum.q += w.w[0][Index(i)] * point;
        sum.qd += w.w[1][Index(i)] * point;
        sum.qdd += w.w[2][Index(i)] * point;
      }
      paths_[k * joints() + Index(j)] = sum;
    }
  }
}

void PathTable::EvaluateSlopes() {
  slopes_.resize(paths_.size());
  for (std::size_t k = 0; k < time_.size(); ++k) {
    for (int j = 0; j < motion_.joints(); ++j)
      slopes_[k * joints() + Index(j)] = motion_.duration().PathSlope(Index(j), time_[k]);
  }
}

}  // namespace tumbler
