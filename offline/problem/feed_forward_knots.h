#pragma once

#include <vector>

namespace tumbler {

/// Degree of a primitive's feed-forward, and of the angle that its feedback is about: they share
/// their knots, so that the runtime evaluates one basis for all.
inline constexpr int kFeedForwardDegree = 3;

/// The knots of both for a motion of this duration.
std::vector<double> FeedForwardKnots(double duration_s);

}  // namespace tumbler
