#include "offline/solve/free_duration.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "offline/problem/end_points.h"

namespace tumbler {

FreeDuration::FreeDuration(const Problem& problem)
    : is_free_(problem.free_duration.has_value()),
      unit_s_(problem.duration_s),
      duration_s_(problem.duration_s) {
  for (const CostInstant& instant : problem.instants()) {
    if (!instant.held) from_s_ = instant.time_s;
    if (is_free_ && instant.held && instant.when == CostTerm::When::kTime) {
      throw std::invalid_argument(
          "a term of the cost is at a given time after a motion whose duration is free");
    }
  }
}

namespace {

/// The spline of a path's derivative by the duration, at the same part of it.
JointMotion<double>::Spline MovedWithEnds(const ActuatedJoint& joint,
                                          const JointMotion<double>::Spline& path) {
  const EndPoints slopes = EndPointSlopes(joint, path.degree());
  std::vector<double> points(path.control_points().size(), 0.0);
  std::ranges::copy(slopes.first, points.begin());
  std::ranges::copy(slopes.last, points.end() - 3);
  JointMotion<double>::Spline moved;
  if (moved.Assign(path.degree(), path.knots(), points) != Status::kOk)
    throw std::logic_error("what moves a path is no spline");
  return moved;
}

}  // namespace

bool FreeDuration::Set(const Problem& problem, std::span<const double> x) {
  duration_s_ = problem.duration_of(x);
  if (!(duration_s_ > from_s_ + kSameTime_s)) return false;
  paths_.clear();
  rates_.clear();
  moved_.clear();
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    paths_.push_back(PositionSpline(problem, x, j));
    if (from_s_ > 0) rates_.push_back(paths_.back().Derivative());
    moved_.push_back(MovedWithEnds(problem.joints[j], paths_.back()));
  }
  return true;
}

PathPoint FreeDuration::PathSlope(std::size_t joint, double time_s) const {
  const Spline::Sample at = paths_[joint].Evaluate(time_s);
  PathPoint slope{0, -at.first / duration_s_, -2 * at.second / duration_s_};
  if (from_s_ > 0) {
    // How far the time moves beyond what keeps t / T.
    const double moves = time_s > from_s_ ? (time_s - from_s_) / (duration_s_ - from_s_) : 0;
    const double beyond = moves - time_s / duration_s_;
    slope.q += at.first * beyond;
    slope.qd += at.second * beyond;
    slope.qdd += rates_[joint].Evaluate(time_s).second * beyond;
  }
  const Spline::Sample moved = moved_[joint].Evaluate(time_s);
  return {unit_s_ * (slope.q + moved.value), unit_s_ * (slope.qd + moved.first),
          unit_s_ * (slope.qdd + moved.second)};
}

StepGrid FreeDuration::Stretched(StepGrid grid) const {
  double begin = 0;
  auto first = grid.motion.begin();
  while (first != grid.motion.end() && begin <= from_s_ - kSameTime_s) begin += *first++;
  const double factor = (duration_s_ - from_s_) / std::accumulate(first, grid.motion.end(), 0.0);
  std::for_each(first, grid.motion.end(), [factor](double& step_s) { step_s *= factor; });
  return grid;
}

StepGrid EvenGrid(const Problem& problem, double longest_s) {
  std::vector<double> motion, settling;
  bool held = false;
  const double longest_duration_s =
      problem.free_duration ? problem.free_duration->max_s : problem.duration_s;
  for (const CostInstant& instant : problem.instants(longest_duration_s)) {
    (held ? settling : motion).push_back(instant.since_s);
    held = instant.held;
  }
  StepGrid grid = EvenGrid(motion, settling, longest_s);
  return problem.free_duration ? FreeDuration(problem).Stretched(std::move(grid)) : grid;
}

std::vector<std::size_t> StepsUntil(const StepGrid& grid, std::span<const CostInstant> instants) {
  std::vector<std::size_t> counts;
  std::size_t count = 0;
  double time = 0;  // since the start of the phase
  double wanted = 0;
  for (const CostInstant& instant : instants) {
    const bool ends_motion = instant.when == CostTerm::When::kEnd;
    const std::vector<double>& steps = instant.held && !ends_motion ? grid.settling : grid.motion;
    wanted += instant.since_s;
    while (count < steps.size() && time < wanted - 1e-9 * (1 + wanted)) time += steps[count++];
    if (instant.when != CostTerm::When::kTime) count = steps.size();
    counts.push_back(count);
    if (ends_motion) count = 0, time = wanted = 0;
  }
  return counts;
}

}  // namespace tumbler
