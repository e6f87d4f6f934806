#include "runtime/record/trace_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "common/files/result_file.h"
#include "runtime/record/record_configuration.h"

namespace tumbler {
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

/// About as many points as there are pixels to show them: the lowest and the highest point of each
/// group of neighbours.
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
      thinned.push_back(*first);  // It is NaN, since nothing was measured.
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
  // Two joints stand beside each other, so that the picture fits a page with any number of them.
  const std::size_t rows = (first.joints.size() + 1) / 2;
  const double columns = first.joints.size() > 1 ? 2 : 1;
  constexpr double kRow = 2 * (kPanelHeight + kGap);
  const double width = kMargin + columns * (kPanelWidth + kGap + kMargin);
  const double height = kTop + static_cast<double>(rows) * kRow + 30;
  std::string svg = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {0} {1}' style='max-width:{0}px' "
      "font-family='sans-serif' font-size='12'>\n<style>path{{fill:none;stroke-width:1.3}}"
      ".grid{{stroke:#ddd}}.frame{{fill:none;stroke:#666}}.title{{font-size:14px}}</style>\n"
      "<rect width='{0}' height='{1}' fill='white'/>\n",
      width, height);
  for (std::size_t i = 0; i < first.joints.size(); ++i) {
    const double x = kMargin + static_cast<double>(i % 2) * (kPanelWidth + kGap + kMargin);
    const std::size_t row = i / 2;
    const double y = kTop + static_cast<double>(row) * kRow;
    Panel position(x, y, first.joints[i] + ": position [rad]");
    Panel error(x, y + kPanelHeight + kGap, first.joints[i] + ": reply less setpoint [rad]");
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
  WriteResult(path, svg);
}

}  // namespace tumbler
