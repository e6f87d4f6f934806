#include "offline/studies/identify_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/core/functions.h"
#include "common/files/markup.h"
#include "offline/studies/plain_page.h"

namespace tumbler {
namespace {

constexpr const char* kStyle = R"(.scroll { overflow-x: auto; } .warn { color: var(--warn); }
svg { height: 110px; background: var(--empty); }
svg path { fill: none; stroke: var(--bar); stroke-width: 1; vector-effect: non-scaling-stroke; }
svg line { stroke: var(--line); vector-effect: non-scaling-stroke; })";

/// The residuals of a joint over time, within 5 units of the noise.
std::string Curve(const FitResiduals& record, std::size_t joint) {
  constexpr double kMost = 5;
  const std::vector<double>& values = record.of_joint[joint];
  std::string path;
  bool pen = false;
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (!std::isfinite(values[k])) {
      pen = false;
      continue;
    }
    path += fmt::format("{}{} {:.1f}", pen ? "L" : "M", k,
                        50 - 10 * std::clamp(values[k], -kMost, kMost));
    pen = true;
  }
  return fmt::format(
      "<svg viewBox=\"0 0 {} 100\" preserveAspectRatio=\"none\" role=\"img\" "
      "aria-label=\"residuals\">"
      "<line x1=\"0\" y1=\"50\" x2=\"{}\" y2=\"50\"/><line x1=\"0\" y1=\"40\" x2=\"{}\" y2=\"40\"/>"
      "<line x1=\"0\" y1=\"60\" x2=\"{}\" y2=\"60\"/><path d=\"{}\"/></svg>\n",
      values.size(), values.size(), values.size(), values.size(), path);
}

void AddResiduals(std::string& page, std::span<const FitResiduals> records) {
  for (const FitResiduals& record : records) {
    page += fmt::format("<p>{}: chi {:.3g}</p>\n", MarkupText(record.record), record.chi);
    for (std::size_t j = 0; j < record.of_joint.size(); ++j) {
      page += fmt::format(
          "<p class=\"dim\">joint {}: chi {:.3g}; from {:.3g} to {:.3g} s after the motion began; "
          "lines at one unit, {:.2g} mrad</p>\n",
          j + 1, record.chi_of_joint[j], record.first_s,
          record.first_s + record.tick_s * static_cast<double>(record.of_joint[j].size()),
          1e3 * record.noise_rad[j]);
      page += Curve(record, j);
    }
  }
}

/// The pairs that go together most.
void AddCorrelations(std::string& page, const RobotPosterior& robot) {
  struct Pair {
    std::size_t i, k;
    double correlation;
  };
  std::vector<Pair> pairs;
  const std::size_t n = robot.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const double scale = robot.DeviationOf(i) * robot.DeviationOf(k);
      if (scale > 0) pairs.push_back({k, i, robot.covariance[i * n + k] / scale});
    }
  }
  std::ranges::stable_sort(pairs, [](const Pair& a, const Pair& b) {
    return std::abs(a.correlation) > std::abs(b.correlation);
  });
  page += "<table>\n";
  constexpr std::size_t kShown = 12;
  for (std::size_t p = 0; p < std::min(kShown, pairs.size()); ++p) {
    page += fmt::format("<tr><td>{}</td><td>{}</td><td class=\"n\">{:+.2f}</td></tr>\n",
                        MarkupText(NameOf(robot.quantities[pairs[p].i])),
                        MarkupText(NameOf(robot.quantities[pairs[p].k])), pairs[p].correlation);
  }
  page += "</table>\n";
}

}  // namespace

std::string IdentifyPage(const FitOutcome& fit, const FitSettings& settings,
                         std::span<const FitResiduals> held_out) {
  std::string page = PlainPageHead("Identified robot", "--bar: #2a7fb8; --warn: #b2182b;",
                                   "--bar: #5aa9ee; --warn: #ff7b6e;", kStyle);
  page += "<h1>Identified robot</h1>\n";
  page += fmt::format("<p>chi {:.3g}, limit {:.3g}</p>\n", fit.chi, settings.chi_max);
  if (fit.chi > settings.chi_max) {
    page +=
        "<p class=\"warn\"><b>An effective model.</b> It moves as the robot did in these records, "
        "but "
        "does not explain them: physics or wire are not as modelled, and these are not the robot's "
        "quantities.</p>\n";
  } else if (fit.effective) {
    page +=
        "<p class=\"warn\"><b>An effective model.</b> It explains these records, but is not to be "
        "trusted: these need not be the robot's quantities.</p>\n";
  }
  if (fit.strays()) {
    page += fmt::format(
        "<p class=\"warn\">It is far from the prior's robot, {:.3g} with a limit of {:.3g}: the "
        "prior's records may say other things than is known of them.</p>\n",
        fit.moved, fit.moved_max);
  }
  for (const std::string& cause : fit.causes)
    page += fmt::format("<p class=\"warn\">{}</p>\n", MarkupText(cause));
  if (!fit.weighed) {
    page +=
        "<p>The robot was not weighed. Masses, friction, stiffness and damping scale with what a "
        "newton metre of its drives is worth, which no record of encoders tells.</p>\n";
  }
  page +=
      "<h2>Quantities</h2>\n<div class=\"scroll\"><table><tr><th>quantity</th><th>value</th>"
      "<th>95 %</th><th>unit</th><th>share of the prior left</th><th></th></tr>\n";
  for (std::size_t i = 0; i < fit.posterior.size(); ++i) {
    const RobotQuantity& quantity = fit.posterior.quantities[i];
    const QuantityFacts& facts = FactsOf(quantity.kind);
    const double half = 1.96 * fit.posterior.DeviationOf(i), mean = fit.posterior.mean[i];
    page += fmt::format(
        "<tr><td>{}</td><td class=\"n\">{:.5g}</td><td class=\"n\">{:.5g} ... "
        "{:.5g}</td><td>{}</td>"
        "<td class=\"n\">{:.1f} %</td><td class=\"dim\">{}</td></tr>\n",
        MarkupText(NameOf(quantity)), fit.posterior.ValueOf(i),
        ValueOfCoordinate(quantity.kind, mean - half),
        ValueOfCoordinate(quantity.kind, mean + half), facts.unit, 100 * fit.ShareLeft(i),
        fit.Identifiable(i) ? "" : "not identifiable from these records");
  }
  page +=
      "</table></div>\n<p class=\"dim\">Not estimated: the height of each centre of mass "
      "above its link's axis, the limits of torque and speed.</p>\n";
  page +=
      "<h2>What goes together</h2>\n<p class=\"dim\">The largest correlations: what a record tells "
      "only of both.</p>\n";
  AddCorrelations(page, fit.posterior);
  page += "<h2>Residuals</h2>\n";
  AddResiduals(page, fit.records);
  if (!held_out.empty()) {
    page += "<h2>Prediction of what was held out</h2>\n";
    AddResiduals(page, held_out);
  }
  page += "</body></html>\n";
  return page;
}

}  // namespace tumbler
