#include "runtime/bench/step_page.h"

#include <fmt/format.h>

#include <algorithm>

namespace tumbler {
namespace {

constexpr double kWidth = 640;
constexpr double kHeight = 260;
constexpr double kMargin = 48;

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '&':
        escaped += "&amp;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string Drawing(const NamedStep& step) {
  const StepResult& result = step.result;
  double low = std::min(0.0, step.config.size_rad);
  double high = std::max(0.0, step.config.size_rad);
  for (const double position : result.positions_rad) {
    low = std::min(low, position);
    high = std::max(high, position);
  }
  const double end_s = result.times_s.empty() ? 1 : result.times_s.back();
  const auto x = [&](double time_s) { return kMargin + (kWidth - 1.5 * kMargin) * time_s / end_s; };
  const auto y = [&](double rad) {
    return kHeight - kMargin - (kHeight - 1.5 * kMargin) * (rad - low) / (high - low);
  };
  std::string path;
  for (std::size_t i = 0; i < result.times_s.size(); ++i)
    path += fmt::format("{:.2f},{:.2f} ", x(result.times_s[i]), y(result.positions_rad[i]));
  std::string svg = fmt::format(
      "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"position after the step\">\n", kWidth,
      kHeight);
  for (const double rad : {0.0, step.config.size_rad}) {
    svg += fmt::format(
        "<line class=\"ask\" x1=\"{0:.2f}\" x2=\"{1:.2f}\" y1=\"{2:.2f}\" y2=\"{2:.2f}\"/>\n"
        "<text x=\"{3:.2f}\" y=\"{4:.2f}\" text-anchor=\"end\">{5:.3f}</text>\n",
        x(0), x(end_s), y(rad), kMargin - 6, y(rad) + 4, rad);
  }
  for (int i = 0; i <= 4; ++i) {
    const double time_s = end_s * i / 4;
    svg += fmt::format("<text x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"middle\">{:.2f}</text>\n",
                       x(time_s), kHeight - kMargin + 20, time_s);
  }
  return svg + fmt::format("<polyline points=\"{}\"/>\n</svg>\n", path);
}

}  // namespace

std::string StepPage(const std::vector<NamedStep>& steps) {
  std::string page = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Step responses</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; max-width: 44rem; margin: 2rem auto; padding: 0 1rem; }
svg { width: 100%; } text { font-size: 12px; fill: #555; }
polyline { fill: none; stroke: #0a5ccc; stroke-width: 2; }
.ask { stroke: #999; stroke-dasharray: 4 4; }
</style></head><body>
<h1>Step responses</h1>
<p>Position of the joint [rad] over time [s] since the step. The dashed lines are where it was, and where it was asked
to be.</p>
)";
  for (const NamedStep& step : steps) {
    const StepResult& result = step.result;
    const std::string rise =
        result.rise_s ? fmt::format("{:.0f} ms", 1e3 * *result.rise_s) : std::string("not reached");
    page += fmt::format(
        "<h2>{}</h2>\n<p>kp {} N m/rad, kd {} N m s/rad: rise {}, overshoot {:.0f} %, settled "
        "after "
        "{:.0f} ms, {:.4f} rad remain.</p>\n{}",
        Escaped(step.name), step.config.kp_nm_per_rad, step.config.kd_nm_s_per_rad, rise,
        100 * result.overshoot, 1e3 * result.settling_s, result.remaining_rad, Drawing(step));
  }
  return page + "</body></html>\n";
}

}  // namespace tumbler
