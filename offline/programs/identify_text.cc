#include "offline/programs/identify_text.h"

#include <fmt/format.h>

#include <cmath>

namespace tumbler {

void PrintReadings(const RecordedMotion& record) {
  const double used_s = static_cast<double>(record.ticks.size()) * record.tick_s;
  fmt::print(
      "{}: {}, {:.3g} s used, of which the robot stood {:.3g} s before; setpoints are late by "
      "{:.3f} ms besides the frames' time\n",
      record.name, record.motion_name, used_s, static_cast<double>(record.begins) * record.tick_s,
      1e3 * record.late_s);
  for (const std::string& remark : record.remarks) fmt::print("  {}\n", remark);
}

void PrintFarOff(const RobotPosterior& posterior, const RobotPosterior& prior) {
  constexpr double kFar = 3;
  for (std::size_t i = 0; i < posterior.size(); ++i) {
    const double off = std::abs(posterior.mean[i] - prior.mean[i]) / prior.DeviationOf(i);
    if (off <= kFar) continue;
    fmt::print(
        "warning: {} is {:.3g} standard deviations from what was known before: such is a robot far "
        "from its model, a wrong weight, or physics that the model lacks\n",
        NameOf(posterior.quantities[i]), off);
  }
}

void PrintFit(const FitOutcome& fit, const FitSettings& settings) {
  fmt::print("{:34} {:>12} {:>12} {:>10}  share of the prior left\n", "quantity", "value",
             "95 % +-", "unit");
  for (std::size_t i = 0; i < fit.posterior.size(); ++i) {
    const RobotQuantity& quantity = fit.posterior.quantities[i];
    const QuantityFacts& facts = FactsOf(quantity.kind);
    const double half = 1.96 * fit.posterior.DeviationOf(i);
    fmt::print(
        "{:34} {:12.5g} {:>12} {:>10}  {:5.1f} %{}\n", NameOf(quantity), fit.posterior.ValueOf(i),
        facts.logarithmic ? fmt::format("{:.2g} %", 100 * half) : fmt::format("{:.2g}", half),
        facts.unit, 100 * fit.ShareLeft(i),
        fit.Identifiable(i) ? "" : "  not identifiable from these records");
  }
  fmt::print("chi {:.3g} (limit {:.3g})\n", fit.chi, settings.chi_max);
  if (!fit.weighed) {
    fmt::print(
        "not weighed: masses and forces are as the drives' newton metres are; a torque "
        "constant that is off scales all of them (--weight-kg)\n");
  }
  if (fit.chi > settings.chi_max) {
    fmt::print(
        "an EFFECTIVE model: it does not explain the records, and its quantities are not the "
        "robot's\n");
  }
  if (fit.moved_max > 0) {
    fmt::print("moved by {:.3g} from the prior, squared and in its own metric (limit {:.3g})\n",
               fit.moved, fit.moved_max);
  }
  if (fit.strays()) {
    fmt::print(
        "NOT TO BE TRUSTED, and called an effective model: so far from the prior's robot its "
        "records may say other things than is known of them; fit all records at once\n");
  }
  for (const std::string& cause : fit.causes) fmt::print("{}\n", cause);
  if (fit.effective && fit.chi <= settings.chi_max && !fit.strays()) {
    fmt::print("an EFFECTIVE model: it explains the records, but need not be the robot\n");
  }
}

}  // namespace tumbler
