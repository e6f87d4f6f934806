#include "offline/pages/motion_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "offline/certify/certificate_text.h"
#include "offline/pages/shown_scene.h"

namespace tumbler {
namespace {

constexpr double kSamplesPerSecond = 200;
/// Most samples of a chain: a short one is as smooth as a single motion, and a long one does not
/// make a page of tens of megabytes.
constexpr double kMaxSamples = 4000;

/// Adds the windows of a primitive to the page's, and how they were found, unless that is said.
/// @param of  behind the name of each property: which motion's it is.
void AddWindow(const GroundWindow& window, const std::string& of, ReportData& data) {
  data.window.columns = {"property", "from", "to", "looked at"};
  const auto add = [&](const char* name, const char* unit, const GroundWindow::Ends& ends,
                       const GroundWindow::Ends& scanned) {
    const auto end = [&](std::size_t side, const char* beyond) {
      return fmt::format("{}{}", GroundValueText(ends[side]),
                         ends[side] == scanned[side] ? beyond : "");
    };
    data.window.rows.push_back(
        {fmt::format("{}{}{}", name, of, unit), end(0, " or less"), end(1, " or more"),
         fmt::format("{} to {}", GroundValueText(scanned[0]), GroundValueText(scanned[1]))});
  };
  add("friction", "", window.mu, window.mu_scanned);
  add("stiffness", " [N/m]", window.stiffness_n_per_m, window.stiffness_scanned_n_per_m);
  add("damping", " [N s/m]", window.damping_n_s_per_m, window.damping_scanned_n_s_per_m);
  const std::string note = fmt::format(
      "Each property by itself, the others as in the task: a scan from the task's value outwards "
      "to the first value with which the model is not as asked, and closer at its ends. Played in "
      "{} with {}, and held for {:.3g} s after the motion (tumbler robustness --window).",
      window.where == RobustnessFigure::Where::kLanes ? "lanes" : "the twin",
      window.drives_file.empty() ? "default drives" : window.drives_file, window.hold_s);
  if (data.window_note.find(note) != std::string::npos) return;
  data.window_note += (data.window_note.empty() ? "" : " ") + note;
}

}  // namespace

ReportData MakeReportData(const Task& task, const SolveOutcome& outcome, const Solution& solution,
                          const PrimitiveFile& file) {
  const Problem& problem = task.problem;
  ReportData data = ReportScene(problem);
  data.title = problem.name;
  data.subtitle =
      fmt::format("{}, seed {}, {} evaluations, objective {:.4g}", file.provenance.tool,
                  file.provenance.seed, file.provenance.evaluations, file.provenance.objective);
  data.duration_s = problem.duration_s;
  data.settle_s = problem.settle_s;
  data.evaluation_count = file.provenance.evaluations;
  if (!problem.joints.empty()) data.peak_torque = ReportPeak{};
  double next = 0;
  Rollout rollout(problem, problem.solver.step_s);
  rollout.Visit(solution.x, SettlingAfter(problem), [&](const MotionSample& sample) {
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      const double torque = std::abs(sample.torque[j]);
      if (torque > data.peak_torque->torque_nm)
        data.peak_torque = {static_cast<int>(j), sample.time_s, torque};
    }
    if (sample.time_s < next - 1e-9) return;
    next += 1 / kSamplesPerSecond;
    data.samples.push_back(ShownSample(problem, sample));
  });
  // The certificate looks with shorter steps, and the page says what it says.
  if (data.peak_torque) data.peak_torque->torque_nm = file.certificate.peak_torque_nm;
  const auto searched =
      static_cast<int>(std::count_if(outcome.history.begin(), outcome.history.end(),
                                     [](const Evaluation& e) { return e.global; }));
  for (const Evaluation& evaluation : outcome.history) {
    const bool shown_start = evaluation.global || evaluation.start == solution.start;
    if (!shown_start || !std::isfinite(evaluation.cost)) continue;
    data.evaluations.push_back({evaluation.global ? static_cast<int>(evaluation.count)
                                                  : searched + static_cast<int>(evaluation.count),
                                evaluation.cost, evaluation.violation, evaluation.global});
  }
  data.certificate = CertificateLines(file.certificate, problem.scene.contact.d_on_m);
  if (!problem.target_pitch_rad || problem.scene.robot.hinged() || problem.ends_moving()) {
    std::erase_if(data.certificate,
                  [](const auto& line) { return line.first.starts_with("pitch 2 s after"); });
  }
  if (problem.scene.obstacles.empty()) {
    std::erase_if(data.certificate,
                  [](const auto& line) { return line.first.starts_with("peak penetration"); });
  }
  data.certificate.emplace(data.certificate.begin(), "solver", ToString(solution.end));
  for (auto& line : FoundBesidesPaths(problem)) data.certificate.push_back(std::move(line));
  for (const PurposeFigure& figure : file.purpose)
    data.certificate.emplace_back(figure.name(), figure.AskedAndGot(figure.result));
  for (const RobustnessFigure& figure : file.robustness)
    data.certificate.emplace_back("robots as asked", ToText(figure));
  if (file.window) {
    AddWindow(*file.window, "", data);
  } else if (!problem.in_empty_space()) {
    data.window_note = "The window was not looked for: tumbler robustness --window FILE.";
  }
  data.certificate.emplace_back("primitive", ContentHash(file));
  data.certificate.emplace_back("robot", file.provenance.robot_hash);
  data.certificate.emplace_back("task", file.provenance.task_hash);
  return data;
}

ReportData MakeChainReport(const SimulatedMotion& motion, const ChainOptions& options) {
  const SequenceFile& file = motion.file();
  const Problem& problem = motion.ProblemOf(0);
  const ChainOutcome outcome = SimulateChain(motion, options);
  ReportData data = ReportScene(problem);
  data.title = file.graph.name.view();
  data.subtitle = fmt::format("{} passages, {} cycles", outcome.passages.size(), outcome.cycles);
  data.duration_s = outcome.duration_s;
  const double spacing = std::max(1 / kSamplesPerSecond, outcome.duration_s / kMaxSamples);
  double next = 0;
  SimulateChain(motion, options, [&](int, const MotionSample& sample) {
    if (sample.time_s < next - 1e-9) return;
    next += spacing;
    data.samples.push_back(ShownSample(problem, sample));
  });
  data.certificate.emplace_back(
      "chain", outcome.failure ? fmt::format("{} at {:.2f} s: {}", ToString(outcome.failure->cause),
                                             outcome.failure->time_s, outcome.failure->text)
                               : "no fall");
  for (std::size_t i = 0; i < file.primitives.size(); ++i) {
    for (const RobustnessFigure& figure : file.primitives[i].robustness) {
      data.certificate.emplace_back(fmt::format("robots as asked ({})", file.primitive_names[i]),
                                    ToText(figure));
    }
    if (file.primitives[i].window)
      AddWindow(*file.primitives[i].window, fmt::format(" of {}", file.primitive_names[i]), data);
  }
  data.certificate.emplace_back("travelled", fmt::format("{:.3f} m", outcome.travelled_m));
  for (const PlayedNode& p : outcome.passages) {
    data.certificate.emplace_back(
        fmt::format("{} at {:.2f} s", file.graph.node(p.node).name.view(), p.start_s),
        fmt::format("{}, pitch off by {:.1e} rad, peak torque {:.2f} N m, penetration {:.2f} mm",
                    ToString(p.posture), p.exit_pitch_error_rad, p.peak_torque_nm,
                    1e3 * p.peak_penetration_m));
  }
  return data;
}

}  // namespace tumbler
