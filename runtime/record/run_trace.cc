#include "runtime/record/run_trace.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <stdexcept>

#include "firmware_interface/drives/logged_position.h"

namespace tumbler {
namespace {

constexpr double kSetpointTolerance_rad = 1e-6;

bool IsPlayed(ExecutorState state) {
  return state == ExecutorState::kRunning || state == ExecutorState::kSettling ||
         state == ExecutorState::kHolding;
}

double Seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

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

/// The arrival [ns] of the drive's first position report among the frames of a tick.
std::optional<std::int64_t> ReplyTime(const TickEntry& entry, const DriveConfig& drive) {
  for (const ReceivedFrame& received : entry.input().received) {
    if (ReportedPosition(drive, received.frame)) return received.time_ns;
  }
  return std::nullopt;
}

}  // namespace

RunTrace TraceOf(FlightRecord& record, const DrivesConfig& drives) {
  const RecordConfiguration& configuration = record.configuration();
  RunTrace trace{record.name(), configuration.joints, {}};
  trace.samples.resize(trace.joints.size());
  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  bool playing = false;
  std::int64_t first_tick = 0, first_ns = 0, send_before_ns = 0;
  while (record.Next(*entry)) {
    const TickRecord& tick = entry->record;
    if (!playing && tick.state == ExecutorState::kRunning) {
      playing = true;
      first_tick = tick.tick;
      first_ns = entry->notes.deadline_ns;
    } else if (playing) {
      // Measurements of this tick answer the setpoints of the tick before.
      for (std::size_t i = 0; i < trace.samples.size() && i < tick.joint_count; ++i) {
        if (tick.joints[i].reply_age_ticks != 0) continue;
        TraceSample& sample = trace.samples[i].back();
        sample.reply_rad = double{tick.joints[i].measured.position_rad};
        const auto arrival =
            i < drives.drives.size() ? ReplyTime(*entry, drives.drives[i].config) : std::nullopt;
        if (arrival) sample.delay_s = Seconds(*arrival - send_before_ns);
      }
    }
    if (playing && !IsPlayed(tick.state)) break;
    send_before_ns = entry->notes.send_ns;
    for (std::size_t i = 0; playing && i < trace.samples.size() && i < tick.joint_count; ++i) {
      trace.samples[i].push_back({tick.tick - first_tick,
                                  Seconds(entry->notes.deadline_ns - first_ns),
                                  double{tick.joints[i].limited.position_rad},
                                  {},
                                  {}});
    }
  }
  return trace;
}

RunTrace TraceOf(const std::vector<CandumpFrame>& frames, const DrivesConfig& drives,
                 const std::string& name) {
  RunTrace trace{name, {}, {}};
  std::optional<std::int64_t> first_ns;
  for (const DriveEntry& drive : drives.drives) {
    trace.joints.push_back(drive.joint);
    std::vector<TraceSample>& samples = trace.samples.emplace_back();
    std::int64_t command_ns = 0;
    for (const CandumpFrame& logged : frames) {
      const std::int64_t time_ns = logged.received.time_ns;
      if (const auto commanded = CommandedPosition(drive.config, logged.received.frame)) {
        if (!first_ns) first_ns = time_ns;
        command_ns = time_ns;
        samples.push_back({static_cast<std::int64_t>(samples.size()),
                           Seconds(time_ns - *first_ns),
                           *commanded,
                           {},
                           {}});
        continue;
      }
      const auto reported = ReportedPosition(drive.config, logged.received.frame);
      if (!reported || samples.empty() || samples.back().reply_rad) continue;
      samples.back().reply_rad = reported;
      samples.back().delay_s = Seconds(time_ns - command_ns);
    }
    if (samples.empty()) {
      throw std::runtime_error(fmt::format(
          "{}: has no setpoint for joint '{}': its drive has another protocol or identifier, or "
          "was not driven",
          name, drive.joint));
    }
  }
  return trace;
}

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

namespace {

// Sizes in the drawing, in pixels.
constexpr double kPanelWidth = 560, kPanelHeight = 220, kMargin = 60, kGap = 50, kTop = 50;

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '<') {
      escaped += "&lt;";
    } else if (c == '&') {
      escaped += "&amp;";
    } else if (static_cast<unsigned char>(c) >= 0x20) {
      escaped += c;
    }
  }
  return escaped;
}

using Point = std::array<double, 2>;  // time, value

struct Curve {
  std::vector<Point> points;  // A value that is NaN interrupts the line.
  const char* colour = "";
};

/// As many points as there are pixels to show them: the lowest and the highest of each group of
/// neighbours.
std::vector<Point> Thinned(const std::vector<Point>& points) {
  constexpr std::size_t kGroups = 1000;
  const std::size_t size = points.size() / kGroups;
  if (size <= 2) return points;
  std::vector<Point> thinned;
  for (std::size_t begin = 0; begin < points.size(); begin += size) {
    const auto first = points.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto last =
        points.begin() + static_cast<std::ptrdiff_t>(std::min(begin + size, points.size()));
    auto low = last, high = last;
    for (auto point = first; point != last; ++point) {
      if (!std::isfinite((*point)[1])) continue;
      if (low == last || (*point)[1] < (*low)[1]) low = point;
      if (high == last || (*point)[1] > (*high)[1]) high = point;
    }
    if (low == last) {
      thinned.push_back(*first);  // NaN: nothing was measured.
      continue;
    }
    thinned.push_back(*std::min(low, high));
    if (low != high) thinned.push_back(*std::max(low, high));
  }
  return thinned;
}

/// A step that divides the axis into about four parts: 1, 2 or 5 times a power of ten.
double NiceStep(double width) {
  const double rough = width / 4;
  const double power = std::pow(10, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (rough <= factor * power) return factor * power;
  }
  return 10 * power;
}

class Panel {
 public:
  Panel(double x, double y, const std::string& title) : x_(x), y_(y), title_(title) {}

  void Add(Curve curve) { curves_.push_back(std::move(curve)); }

  [[nodiscard]] std::string Draw() const {
    double t_max = 1e-3;
    double low = std::numeric_limits<double>::max(), high = -low;
    for (const Curve& curve : curves_) {
      for (const auto& [t, value] : curve.points) {
        t_max = std::max(t_max, t);
        if (!std::isfinite(value)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
      }
    }
    if (low > high) low = high = 0;
    const double padding = std::max(0.05 * (high - low), 1e-6);
    low -= padding;
    high += padding;
    const auto px = [&](double t) { return x_ + kPanelWidth * t / t_max; };
    const auto py = [&](double v) { return y_ + kPanelHeight * (high - v) / (high - low); };
    std::string svg =
        fmt::format("<text x='{}' y='{}' class='title'>{}</text>\n", x_, y_ - 8, Escaped(title_));
    svg += fmt::format("<rect x='{}' y='{}' width='{}' height='{}' class='frame'/>\n", x_, y_,
                       kPanelWidth, kPanelHeight);
    const double t_step = NiceStep(t_max);
    for (int i = 0; i * t_step <= t_max * 1.0001; ++i) {
      const double t = i * t_step;
      svg += fmt::format(
          "<path d='M{0:.1f} {1}v{2}' class='grid'/><text x='{0:.1f}' y='{3}' "
          "text-anchor='middle'>{4:.4g} s</text>\n",
          px(t), y_, kPanelHeight, y_ + kPanelHeight + 14, t);
    }
    const double v_step = NiceStep(high - low);
    const double v_first = std::ceil(low / v_step);
    for (int i = 0; (v_first + i) * v_step <= high; ++i) {
      const double v = (v_first + i) * v_step;
      svg += fmt::format(
          "<path d='M{0} {1:.1f}h{2}' class='grid'/><text x='{3}' y='{4:.1f}' "
          "text-anchor='end'>{5:.4g}</text>\n",
          x_, py(v), kPanelWidth, x_ - 4, py(v) + 4, v + 0.0);  // + 0.0 makes 0 of -0
    }
    for (const Curve& curve : curves_) {
      svg += fmt::format("<path stroke='{}' d='", curve.colour);
      bool pen_down = false;
      for (const auto& [t, value] : Thinned(curve.points)) {
        if (!std::isfinite(value)) {
          pen_down = false;
          continue;
        }
        svg += fmt::format("{}{:.1f} {:.1f}", pen_down ? 'L' : 'M', px(t), py(value));
        pen_down = true;
      }
      svg += "'/>\n";
    }
    return svg;
  }

 private:
  double x_, y_;
  std::string title_;
  std::vector<Curve> curves_;
};

enum class Quantity { kSetpoint, kReply, kError };

Curve CurveOf(const std::vector<TraceSample>& samples, Quantity quantity, const char* colour) {
  Curve curve{{}, colour};
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  for (const TraceSample& sample : samples) {
    const double reply = sample.reply_rad.value_or(kNone);
    const double value = quantity == Quantity::kSetpoint ? sample.setpoint_rad
                         : quantity == Quantity::kReply  ? reply
                                                         : reply - sample.setpoint_rad;
    curve.points.push_back({sample.time_s, value});
  }
  return curve;
}

}  // namespace

void WriteSvg(const RunTrace& first, const RunTrace* second, const std::string& path) {
  constexpr const char* kGrey = "#888";
  constexpr const char* kBlue = "#0060c0";
  constexpr const char* kRed = "#d03020";
  const auto joints = static_cast<double>(first.joints.size());
  const double width = kMargin + joints * (kPanelWidth + kGap + kMargin);
  const double height = kTop + 2 * (kPanelHeight + kGap) + 30;
  std::string svg = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' viewBox='0 0 {0} {1}' "
      "font-family='sans-serif' font-size='12'>\n<style>path{{fill:none;stroke-width:1.3}}"
      ".grid{{stroke:#ddd}}.frame{{fill:none;stroke:#666}}.title{{font-size:14px}}</style>\n"
      "<rect width='{0}' height='{1}' fill='white'/>\n",
      width, height);
  for (std::size_t i = 0; i < first.joints.size(); ++i) {
    const double x = kMargin + static_cast<double>(i) * (kPanelWidth + kGap + kMargin);
    Panel position(x, kTop, first.joints[i] + ": position [rad]");
    Panel error(x, kTop + kPanelHeight + kGap, first.joints[i] + ": reply less setpoint [rad]");
    position.Add(CurveOf(first.samples[i], Quantity::kSetpoint, kGrey));
    position.Add(CurveOf(first.samples[i], Quantity::kReply, kBlue));
    error.Add(CurveOf(first.samples[i], Quantity::kError, kBlue));
    if (second != nullptr && i < second->samples.size()) {
      position.Add(CurveOf(second->samples[i], Quantity::kReply, kRed));
      error.Add(CurveOf(second->samples[i], Quantity::kError, kRed));
    }
    svg += position.Draw() + error.Draw();
  }
  svg += fmt::format(
      "<text x='{}' y='{}'><tspan fill='{}'>setpoint</tspan>  <tspan fill='{}'>reply: {}</tspan>",
      kMargin, height - 10, kGrey, kBlue, Escaped(first.name));
  if (second != nullptr) {
    svg += fmt::format("  <tspan fill='{}'>reply: {}</tspan>", kRed, Escaped(second->name));
  }
  svg += "</text>\n</svg>\n";
  std::ofstream stream(path, std::ios::binary);
  stream << svg << std::flush;
  if (!stream) throw RecordError(fmt::format("{}: cannot be written", path));
}

}  // namespace tumbler
