#include "runtime/bench/step_page.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/files/markup.h"

namespace tumbler {
namespace {

// A drawing is as wide as the window. Places across are in per cent of it, so that texts keep their
// size; the curve is in a drawing of its own, which is stretched.
constexpr double kLeft = 13, kWidth = 83;   // per cent
constexpr double kCurveWidth = 1000;        // units of the curve's drawing
constexpr double kTop = 16, kHeight = 200;  // pixels
constexpr double kWithTexts = kTop + kHeight + 32;

std::string Drawing(const NamedStep& step) {
  const StepResult& result = step.result;
  double low = std::min(0.0, step.config.size_rad);
  double high = std::max(0.0, step.config.size_rad);
  for (const double position : result.positions_rad) {
    low = std::min(low, position);
    high = std::max(high, position);
  }
  const double end_s = result.times_s.empty() ? 1 : result.times_s.back();
  const auto y = [&](double rad) { return kHeight * (high - rad) / (high - low); };
  std::string path;
  for (std::size_t i = 0; i < result.times_s.size(); ++i) {
    path += fmt::format("{:.2f},{:.2f} ", kCurveWidth * result.times_s[i] / end_s,
                        y(result.positions_rad[i]));
  }
  std::string svg = fmt::format(
      "<svg height=\"{}\" role=\"img\" aria-label=\"position after the step\">\n", kWithTexts);
  for (const double rad : {0.0, step.config.size_rad}) {
    svg += fmt::format(
        "<line class=\"ask\" x1=\"{0}%\" x2=\"{1}%\" y1=\"{2:.2f}\" y2=\"{2:.2f}\"/>\n"
        "<text x=\"{3}%\" y=\"{4:.2f}\" text-anchor=\"end\">{5:.3f}</text>\n",
        kLeft, kLeft + kWidth, kTop + y(rad), kLeft - 1, kTop + y(rad) + 4, rad);
  }
  for (int i = 0; i <= 4; ++i) {
    svg += fmt::format("<text x=\"{:.2f}%\" y=\"{}\" text-anchor=\"middle\">{:.2f}</text>\n",
                       kLeft + kWidth * i / 4, kTop + kHeight + 24, end_s * i / 4);
  }
  return svg + fmt::format(
                   "<svg x=\"{}%\" y=\"{}\" width=\"{}%\" height=\"{}\" viewBox=\"0 0 {} {}\" "
                   "preserveAspectRatio=\"none\"><polyline points=\"{}\"/></svg>\n</svg>\n",
                   kLeft, kTop, kWidth, kHeight, kCurveWidth, kHeight, path);
}

}  // namespace

std::string StepPage(const std::vector<NamedStep>& steps) {
  std::string page = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Step responses</title>
<style>
:root { color-scheme: light; --paper: #fff; --ink: #1c2330; --dim: #555; --curve: #0a5ccc; --ask: #888; }
@media screen and (prefers-color-scheme: dark) {
  :root { color-scheme: dark; --paper: #13161a; --ink: #e8e9ea; --dim: #9ba3ac; --curve: #5aa9ee; --ask: #80868c; }
}
body { font: 15px/1.5 system-ui, sans-serif; max-width: 44rem; margin: 2rem auto; padding: 0 1rem;
  color: var(--ink); background: var(--paper); overflow-wrap: anywhere; }
h2 { break-after: avoid; } p { break-after: avoid; }
body > svg { display: block; width: 100%; overflow: visible; break-inside: avoid; }
text { font-size: 12px; fill: var(--dim); }
svg svg { overflow: visible; }
polyline { fill: none; stroke: var(--curve); stroke-width: 2; vector-effect: non-scaling-stroke; }
.ask { stroke: var(--ask); stroke-dasharray: 4 4; }
@media print { body { margin: 0; max-width: none; padding: 0; } }
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
        MarkupText(step.name), step.config.kp_nm_per_rad, step.config.kd_nm_s_per_rad, rise,
        100 * result.overshoot, 1e3 * result.settling_s, result.remaining_rad, Drawing(step));
  }
  return page + "</body></html>\n";
}

}  // namespace tumbler
