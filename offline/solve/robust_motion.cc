#include "offline/solve/robust_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/core/functions.h"
#include "common/core/index.h"

namespace tumbler {
namespace {

/// Change of the logarithm of a free duration with the variable that stands for it, so that this is
/// of the size of the others.
constexpr double kStretch = 0.5;
/// What a path that is at its limits exceeds them by once a primitive's file has rounded it.
constexpr double kRounding = 1e-9;
/// The clearance is looked at so often [ticks], and a little more is asked for than the task does.
constexpr int kClearanceEvery = 5;
constexpr double kMoreClearance_m = 5e-4;

}  // namespace

RobustMotion::RobustMotion(const RobustTask& task)
    : task_(task), paths_(task.problem), rows_(paths_.Reduce(DerivativeLimitRows(task.problem))) {}

std::vector<double> RobustMotion::Reduce(std::span<const double> parameters) const {
  std::vector<double> x = paths_.Reduce(parameters);
  x.resize(count());
  return x;
}

std::vector<double> RobustMotion::Reduce(std::span<const double> parameters,
                                         double duration_s) const {
  std::vector<double> x = Reduce(parameters);
  if (task_.free_duration())
    x.back() = portable::Log(duration_s / task_.problem.duration_s) / kStretch;
  return x;
}

std::vector<double> RobustMotion::Parameters(const std::vector<double>& x) const {
  return paths_.Expand({x.data(), paths_.count()});
}

double RobustMotion::Duration_s(const std::vector<double>& x) const {
  const double usual_s = task_.problem.duration_s;
  if (!task_.free_duration()) return usual_s;
  const double stretched_s = usual_s * portable::Exp(kStretch * x[paths_.count()]);
  return RobustTask::kTick_s * std::round(stretched_s / RobustTask::kTick_s);
}

double RobustMotion::Excess(const std::vector<double>& x, SelfDistances& distances) const {
  const Problem& problem = task_.problem;
  double excess = 0;
  const double duration_s = Duration_s(x), haste = Haste(x);
  if (task_.free_duration()) {
    excess += std::max({0.0, *task_.settings.duration_min_s - duration_s,
                        duration_s - *task_.settings.duration_max_s});
  }
  for (std::size_t i = 0; i < paths_.count(); ++i) {
    const auto [least, most] = paths_.bounds(i);
    excess += std::max({0.0, x[i] - most, least - x[i]});
  }
  for (const LinearRow& row : rows_) {
    double sum = row.b;
    for (std::size_t i = 0; i < row.a.size(); ++i) sum += row.a[i] * x[i];
    const double faster = row.derivative == 1 ? haste : haste * haste;
    excess += std::max(0.0, sum * faster + (faster - 1));
  }
  if (excess > kRounding) return kUnplayable + excess;
  const SelfContact& own = problem.scene.self_contact;
  if (own.pairs.empty()) return 0;
  const auto splines = Splines(x);
  std::vector<double> q = problem.start_q;
  double nearest = std::numeric_limits<double>::infinity();
  for (int k = 0; k <= Ticks(x); k += kClearanceEvery) {
    for (std::size_t j = 0; j < task_.joints; ++j)
      q[Index(problem.joints[j].dof)] = splines[j].Evaluate(k * RobustTask::kTick_s * haste).value;
    nearest = std::min(nearest, distances.Nearest(q).distance_m);
  }
  const double lacks = own.clearance_m + kMoreClearance_m - nearest;
  return lacks > 0 ? 0.2 + lacks * 20 : 0;
}

std::vector<JointMotion<double>::Spline> RobustMotion::Splines(const std::vector<double>& x) const {
  std::vector<JointMotion<double>::Spline> splines;
  const std::vector<double> parameters = Parameters(x);
  for (std::size_t j = 0; j < task_.joints; ++j)
    splines.push_back(PositionSpline(task_.problem, parameters, j));
  return splines;
}

}  // namespace tumbler
