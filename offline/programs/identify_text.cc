#include "offline/programs/identify_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "offline/studies/identified_drives.h"

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

void PrintExpected(const Excitation& found, const std::vector<std::string>& after) {
  using Kind = RobotQuantity::Kind;
  std::string text;
  for (std::size_t i = 0; i < found.deviations.size(); ++i) {
    const Kind kind = found.quantities[i].kind;
    if (kind != Kind::kMass && kind != Kind::kFriction && kind != Kind::kStiffness &&
        kind != Kind::kDamping) {
      continue;
    }
    text += fmt::format("{}{} {:.2g} %", text.empty() ? "" : ", ", NameOf(found.quantities[i]),
                        100 * found.deviations[i]);
  }
  fmt::print(
      "  a record of it{}, through drives of {} N m/rad and {} N m s/rad, is expected to tell, as "
      "standard deviations: {}\n",
      after.empty() ? "" : " and of those before it", found.drives.kp_nm_per_rad,
      found.drives.kd_nm_s_per_rad, text);
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

void PrintGate(std::FILE* people, const GateOutcome& outcome, const GateSettings& settings,
               const PosteriorFile& file, const GateFiles& names) {
  fmt::print(people, "drives: {}, {:.6g} Hz\n",
             names.drives.empty()
                 ? "the default ones, with the motion's gains (no --drives was given)"
                 : names.drives,
             outcome.drives.rate_hz);
  for (const PosteriorDrive& drive : FactsOf(outcome.drives).of_joint) {
    fmt::print(people, "  {}: {}, kp {:.6g} N m/rad, kd {:.6g} N m s/rad, zero offset {:.6g} rad\n",
               drive.joint, drive.protocol, drive.kp_nm_per_rad, drive.kd_nm_s_per_rad,
               drive.zero_offset_rad);
  }
  if (file.drives.of_joint.empty()) {
    fmt::print(
        people,
        "  the posterior does not say with which drives its records were made; give theirs\n");
  }
  fmt::print(people,
             "twin: robot, ground and motors of {}; all else as in tumbler run sim without a twin "
             "file\n",
             names.posterior);
  fmt::print(people,
             "draws: {} robots at {:.3g} standard deviations{}, with margins of {:.3g} % in torque "
             "limits, {:.3g} ms in delay\n",
             outcome.robots.size() - 1, outcome.draws.deviations,
             outcome.left_out() == 0
                 ? ""
                 : fmt::format(" of {} that were drawn",
                               outcome.robots.size() - 1 + Index(outcome.left_out())),
             100 * settings.margins.torque_limit, 1e3 * settings.margins.delay_s);
  if (file.effective) {
    fmt::print(people,
               "the posterior is of an effective model, which did not explain its records\n");
  }
  for (std::size_t i = 0; i < outcome.robots.size(); ++i) {
    const TrialOutcome& robot = outcome.robots[i];
    fmt::print(people, "{}: {}{}\n",
               i == 0
                   ? std::string("the robot that was identified")
                   : fmt::format("a robot at {:.3g} standard deviations", outcome.draws.deviations),
               ToString(robot.verdict), robot.reason.empty() ? "" : ": " + robot.reason);
  }
  for (const FailedMotion& failed : outcome.failed) {
    fmt::print(people, "{}, in which the robot failed: the robot that was identified {}{}\n",
               failed.motion, failed.mean_fails ? "fails, too" : "does not fail",
               failed.left_out == 0
                   ? ""
                   : fmt::format("; draws left out because they do not: {}", failed.left_out));
  }
  if (!std::ranges::all_of(outcome.failed, &FailedMotion::mean_fails)) {
    fmt::print(people,
               "the model does not fail where the robot did, and is not to be believed; fit the "
               "record of that run, too, with --failed\n");
  } else if (!outcome.credible()) {
    fmt::print(people,
               "most robots that the posterior allows do not fail where the robot did: it does not "
               "know why that was; record more motions, and fit with --failed\n");
  }
  fmt::print(people, "{}\n",
             outcome.open()
                 ? "the gate is open: try the motion on the robot, and keep it if it stands"
                 : "the gate is closed: do not try the motion on the robot");
}

}  // namespace tumbler
