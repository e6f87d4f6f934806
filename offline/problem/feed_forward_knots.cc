#include "offline/problem/feed_forward_knots.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/core/index.h"
#include "common/core/primitive.h"

namespace tumbler {
namespace {

/// The spline is fine enough for the swing, and too coarse for the spikes of an impact, which no
/// drive should be asked for.
constexpr double kPointsPerSecond = 40;

}  // namespace

std::vector<double> FeedForwardKnots(double duration_s) {
  const int n = std::clamp(static_cast<int>(std::lround(kPointsPerSecond * duration_s)),
                           kFeedForwardDegree + 1, kMaxControlPoints);
  std::vector<double> knots(Index(n + kFeedForwardDegree + 1));
  if (JointMotion<double>::Spline::ClampedUniformKnots(kFeedForwardDegree, n, duration_s, knots) !=
      Status::kOk) {
    throw std::logic_error("the knots of a feed-forward could not be set up");
  }
  return knots;
}

}  // namespace tumbler
