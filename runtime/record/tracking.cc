#include "runtime/record/tracking.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace tumbler {
namespace {

constexpr double kSetpointTolerance_rad = 1e-6;

/// The value below which a share of all values lies. Sorts them.
double Percentile(std::vector<double>& values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const double at = std::ceil(share * static_cast<double>(values.size())) - 1;
  return values[static_cast<std::size_t>(std::max(at, 0.0))];
}

struct Accumulator {
  std::int64_t count = 0;
  double squares = 0;
  double max = 0;

  void Add(double x) {
    ++count;
    squares += x * x;
    max = std::max(max, std::abs(x));
  }
  [[nodiscard]] double rms() const {
    return count == 0 ? 0 : std::sqrt(squares / static_cast<double>(count));
  }
};

}  // namespace

TrackingFigures FiguresOf(std::span<const TraceSample> samples) {
  TrackingFigures figures;
  figures.setpoints = static_cast<std::int64_t>(samples.size());
  Accumulator error;
  std::vector<double> delays;
  for (const TraceSample& sample : samples) {
    if (sample.reply_rad) {
      error.Add(*sample.reply_rad - sample.setpoint_rad);
    } else if (&sample != &samples.back()) {
      ++figures.missing_replies;
    }
    if (sample.delay_s) delays.push_back(*sample.delay_s);
  }
  figures.error_rms_rad = error.rms();
  figures.error_max_rad = error.max;
  figures.delay_p50_s = Percentile(delays, 0.5);
  figures.delay_p99_s = Percentile(delays, 0.99);
  figures.delay_max_s = Percentile(delays, 1);
  return figures;
}

TraceComparison Compare(std::span<const TraceSample> a, std::span<const TraceSample> b) {
  TraceComparison comparison;
  Accumulator reply;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (a[i].tick != b[j].tick) {
      ++(a[i].tick < b[j].tick ? i : j);
      continue;
    }
    const double difference = std::abs(a[i].setpoint_rad - b[j].setpoint_rad);
    ++comparison.ticks;
    if (!(difference <= kSetpointTolerance_rad)) ++comparison.different_setpoints;
    comparison.setpoint_max_rad = std::max(comparison.setpoint_max_rad, difference);
    if (a[i].reply_rad && b[j].reply_rad) reply.Add(*b[j].reply_rad - *a[i].reply_rad);
    ++i;
    ++j;
  }
  comparison.replies = reply.count;
  comparison.reply_rms_rad = reply.rms();
  comparison.reply_max_rad = reply.max;
  return comparison;
}

std::string Describe(const RunTrace& trace) {
  std::string text = fmt::format("{}:\n", trace.name);
  for (std::size_t i = 0; i < trace.joints.size(); ++i) {
    const TrackingFigures f = FiguresOf(trace.samples[i]);
    text += fmt::format(
        "  {}: {} setpoints, {} replies missing; tracking error {:.5f} rad rms, {:.5f} max; reply "
        "after {:.3f} ms (p50), {:.3f} (p99), {:.3f} (max)\n",
        trace.joints[i], f.setpoints, f.missing_replies, f.error_rms_rad, f.error_max_rad,
        1e3 * f.delay_p50_s, 1e3 * f.delay_p99_s, 1e3 * f.delay_max_s);
  }
  return text;
}

std::string DescribeDifference(const RunTrace& recorded, const RunTrace& played) {
  std::string text = "played less recorded:\n";
  for (std::size_t i = 0; i < std::min(recorded.joints.size(), played.joints.size()); ++i) {
    const TraceComparison c = Compare(recorded.samples[i], played.samples[i]);
    text += fmt::format(
        "  {}: {} ticks in both, setpoints differ in {}, by at most {:.2g} rad; replies differ by "
        "{:.5f} rad rms, {:.5f} max, over {} ticks\n",
        recorded.joints[i], c.ticks, c.different_setpoints, c.setpoint_max_rad, c.reply_rms_rad,
        c.reply_max_rad, c.replies);
  }
  return text;
}

}  // namespace tumbler
