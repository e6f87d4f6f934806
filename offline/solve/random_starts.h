#pragma once

#include <cstdint>
#include <vector>

#include "offline/problem/problem.h"
#include "offline/solve/constraints.h"
#include "offline/solve/free_paths.h"

namespace tumbler {

/// Random smooth motions from which the global search starts.
///
/// A motion is the straight line from start to end plus half-sine modes over the free control
/// points, mode m with an amplitude uniform in +-spread / m, inside the position limits, and shrunk
/// towards the line until the velocity and acceleration limits hold. Low modes move the robot;
/// independent control points mostly shake it (measured: 14 times fewer samples near a handstand).
///
/// Half sines have a slope at their ends, where the robot is at rest. The more control points there
/// are, the shorter is the time in which it has to come up to that slope, and the more the limits
/// shrink the motion. Solve therefore searches with few control points.
///
/// Joints that are tied follow the others.
///
/// Safe for use from several threads.
class RandomStarts {
 public:
  explicit RandomStarts(const Problem& problem);

  /// Sample i of the problem's seed, the same in whichever thread it is drawn. @returns parameters
  /// within the position limits, and within those of velocity and acceleration where the straight
  /// line is.
  [[nodiscard]] std::vector<double> Draw(std::uint64_t sample) const;

 private:
  Problem problem_;
  std::vector<LinearRow> rows_;
  FreePaths paths_;
};

}  // namespace tumbler
