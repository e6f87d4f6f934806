#include "offline/solve/random_starts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "common/core/functions.h"

namespace tumbler {
namespace {

/// A small counter-based generator, SplitMix64 [Steele, Lea, Flood 2014]: sample i of a seed is the
/// same in whichever thread it is drawn. The standard library's distributions would differ between
/// implementations.
class SplitMix64 {
 public:
  SplitMix64(std::uint64_t seed, std::uint64_t stream) : state_(seed * 0x9E3779B97F4A7C15U) {
    state_ = Next() ^ (stream * 0xD1B54A32D192ED03U);
  }
  std::uint64_t Next() {
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15U;
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31U);
  }
  /// Uniform in [-1, 1).
  double Symmetric() { return static_cast<double>(Next() >> 11U) * 0x1.0p-52 - 1.0; }

 private:
  std::uint64_t state_;
};

/// The straight line from start to end, as parameters.
std::vector<double> StraightLine(const Problem& problem) {
  std::vector<double> line;
  for (const ActuatedJoint& joint : problem.joints) {
    const int free = joint.free_points();
    for (int i = 0; i < free; ++i) {
      const double s = (i + 1.0) / (free + 1.0);
      line.push_back(joint.start_rad + s * (joint.end_rad - joint.start_rad));
    }
  }
  for (const std::size_t coordinate : problem.free_start_coordinates())
    line.push_back(problem.start_root_rates[coordinate]);
  if (problem.free_duration) line.push_back(1);  // as long as the task says
  return line;
}

/// Half-sine modes on top of the line, within the position limits, and any velocities at the start
/// that are free.
std::vector<double> RandomPath(const Problem& problem, const std::vector<double>& line,
                               std::uint64_t sample) {
  SplitMix64 random(problem.search.seed, sample);
  std::vector<double> path = line;
  std::vector<double> amplitude(static_cast<std::size_t>(problem.search.modes));
  std::size_t at = 0;
  for (const ActuatedJoint& joint : problem.joints) {
    for (std::size_t m = 0; m < amplitude.size(); ++m) {
      amplitude[m] = problem.search.spread_rad * random.Symmetric() / static_cast<double>(m + 1);
    }
    const int free = joint.free_points();
    for (int i = 0; i < free; ++i, ++at) {
      const double s = (i + 1.0) / (free + 1.0);
      for (std::size_t m = 0; m < amplitude.size(); ++m) {
        path[at] += amplitude[m] * portable::Sin(M_PI * static_cast<double>(m + 1) * s);
      }
      path[at] = std::clamp(path[at], joint.limits.position_min_rad, joint.limits.position_max_rad);
    }
  }
  for (const std::size_t coordinate : problem.free_start_coordinates()) {
    const auto& [least, most] = *problem.free_start_rates[coordinate];
    path[at++] = 0.5 * (least + most + random.Symmetric() * (most - least));
  }
  return path;
}

/// The path, shrunk towards the line until the rows hold; those that the line itself breaks are
/// left alone.
std::vector<double> Shrunk(const Problem& problem, const std::vector<LinearRow>& rows,
                           std::vector<double> line, const std::vector<double>& path) {
  std::vector<double> departure(line.size());
  std::transform(path.begin(), path.end(), line.begin(), departure.begin(), std::minus<>());
  double scale = 1;
  for (const LinearRow& row : rows) {
    const double at_line = row.Excess(line);
    const double slope = std::inner_product(row.a.begin(), row.a.end(), departure.begin(), 0.0);
    if (slope > 0 && at_line < 0) scale = std::min(scale, -at_line / slope);
  }
  for (std::size_t i = 0; i < line.size(); ++i) {
    const Interval<double> bounds = problem.bounds_of_parameter(static_cast<int>(i));
    line[i] = std::clamp(line[i] + scale * departure[i], bounds.min, bounds.max);
  }
  return line;
}

}  // namespace

RandomStarts::RandomStarts(const Problem& problem)
    : problem_(problem), rows_(DerivativeLimitRows(problem)), paths_(problem) {}

std::vector<double> RandomStarts::Draw(std::uint64_t sample) const {
  const std::vector<double> line = StraightLine(problem_);
  std::vector<double> path = Shrunk(problem_, rows_, line, RandomPath(problem_, line, sample));
  if (!paths_.any_tied()) return path;
  path = paths_.Tied(std::move(path));
  // A joint that now follows another one may be slower than that.
  constexpr double kRounding = 1e-9;
  const bool kept = std::ranges::none_of(
      rows_, [&](const LinearRow& row) { return row.Excess(path) > kRounding; });
  return kept ? path : paths_.Tied(Shrunk(problem_, rows_, line, path));
}

}  // namespace tumbler
