#include "offline/certify/result_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "common/files/share.h"
#include "offline/certify/certificate_text.h"
#include "offline/certify/default_drives_note.h"
#include "offline/model/robot_notes.h"
#include "offline/model/urdf_source.h"
#include "offline/solve/robust_task.h"

namespace tumbler {
namespace {

/// Of the limits that hold a motion, as many are named as take this many characters.
constexpr std::size_t kLongestHeld = 120;

/// Prints the contact law, and the integration step that it needs.
void PrintContact(const Problem& problem, const std::string& task_file) {
  if (!problem.in_empty_space()) {
    const ContactLaw& law = problem.contact();
    fmt::print(stderr,
               "contact: k {:.4g} N/m, c {:.4g} N s/m, d_on {:.3g} mm, d_off {:.3g} mm, mu {:.3g}, "
               "v_max {:.3g} m/s; step {:.3g} ms{}\n",
               law.stiffness_n_per_m, law.damping_n_s_per_m, 1e3 * law.d_on_m, 1e3 * law.d_off_m,
               law.mu, law.v_max_m_per_s, 1e3 * problem.solver.step_s,
               // What is prescribed bears any step.
               std::isfinite(problem.advisable_step_s)
                   ? fmt::format(", advisable up to {:.3g} ms", 1e3 * problem.advisable_step_s)
                   : "");
  }
  if (problem.solver.step_s > problem.advisable_step_s) {
    const bool springs = !problem.scene.robot.passive.empty();
    fmt::print(stderr,
               "{}: solver.step_s: warning: is {:.3g} s, longer than the {:.3g} s that {}; leave "
               "it out, or make {} softer\n",
               task_file, problem.solver.step_s, problem.advisable_step_s,
               springs ? "contact and springs allow" : "this contact law allows",
               springs ? "them" : "contact");
  }
}

/// The reason why differences of the cost do not follow its gradient, and the remedy.
const char* GradientCause(const Certificate& certificate) {
  // A cliff changes the differences across it, but hardly the gradient at one point.
  return certificate.gradient_step_halving_change > 0.5
             ? "the steps are too long for the contact, which amplifies every change; use a "
               "smaller solver.tolerance, a larger contact.v_max_m_per_s or a smaller "
               "contact.stiffness_n_per_m"
             : "the cost has a cliff near this motion, such as a contact that is made or missed by "
               "a hair, so that a small disturbance may end elsewhere; use another --seed or a "
               "larger contact.d_on_m";
}

/// Prints targets and results beside each other, and warns of a limit that only the finer step
/// shows to be exceeded.
/// @param in_space  whether it is of a robot in space.
/// @param played    whether what becomes of it through drives is said of itself.
void PrintSecondLook(std::FILE* people, const SecondLook& look, bool in_space, bool played) {
  fmt::print(people, "  with a step of {:.3g} ms: peak torque {:.2f} N m, penetration {:.2f} mm\n",
             1e3 * look.step_s, look.peak_torque_nm, 1e3 * look.peak_penetration_m);
  if (!look.self_clearance_of.empty()) {
    fmt::print(people, "  own shapes: {} come as near as {:.1f} mm, at {:.3f} s (allowed {:.3g})\n",
               look.self_clearance_of, 1e3 * look.self_clearance_m, look.self_clearance_time_s,
               1e3 * look.clearance_m);
  }
  if (look.slip_m && !look.slip_of.empty()) {
    fmt::print(people, "  slip: {} slides {:.0f} mm while it carries weight, no shape more\n",
               look.slip_of, 1e3 * *look.slip_m);
  }
  for (const PurposeFigure& figure : look.purpose) {
    fmt::print(people, "    {}: {}\n", figure.name(), figure.AskedAndGot(figure.result));
  }
  if (look.purpose.empty())
    fmt::print(people, "    the task asks for nothing that a run could meet or miss\n");
  if (look.drives) {
    fmt::print(
        people,
        "  stays until {} s after the end through drives of {} N m/rad and {} N m s/rad, on floors "
        "that slope by {} mrad to either side, and from starts that lean by {} mrad\n",
        in_space ? kStaysInSpace_s : kStays_s, look.drives->kp_nm_per_rad,
        look.drives->kd_nm_s_per_rad, 1e3 * kUnevenness_rad, 1e3 * kLean_rad);
  } else if (!played) {
    fmt::print(people,
               "  not played through drives, which give way: that is done with what is to end at "
               "rest, without a feedback in the hold\n");
  }
  if (look.held_torque_excess > 0) {
    fmt::print(
        stderr,
        "warning: to hold the joints in the 2 s after the motion takes a torque {:.0f} % above "
        "its limit, which the solver does not look at: the robot will not stay as planned; "
        "use a longer settle_s\n",
        100 * look.held_torque_excess);
  }
}

/// Prints how slow the loops of the drives may be for the task's damping, and warns where the twin
/// is too slow.
void PrintDamping(std::FILE* people, const TaskResult& result) {
  const DampedMotion& damping = result.damping;
  if (damping.rate_per_s == 0) return;
  fmt::print(people, "  damping: {}\n",
             damping.Describe({result.problem().drive_gains().kd_nm_s_per_rad}));
  constexpr double kTwinStep_s = 50e-6;  // what a simulation has without a twin file
  if (damping.AdvisedPeriod() >= kTwinStep_s) return;
  fmt::print(stderr,
             "warning: advised are loops of the drives of {:.3g} ms or less, which is shorter than "
             "the {:.3g} ms of most drives and of a simulation: give the drives less kd, or the "
             "joints a rotor_inertia_kg_m2 if the motors have one\n",
             1e3 * damping.AdvisedPeriod(), 1e3 * kTwinStep_s);
}

/// Prints what becomes of the model through its drives in space, and warns where it is not as
/// asked.
void PrintThroughDrives(std::FILE* people, const TaskResult& result) {
  if (!result.through_drives) return;
  const DriveGains gains = result.problem().drive_gains();
  const std::string drives = fmt::format(
      "through drives of {} N m/rad and {} N m s/rad with the usual friction, and with "
      "setpoints every {:.3g} ms,",
      gains.kp_nm_per_rad, gains.kd_nm_s_per_rad, 1e3 * SpaceRobustSettings{}.period_s);
  if (result.through_drives->as_asked()) {
    fmt::print(people, "  {} the model is as asked, too\n", drives);
    return;
  }
  std::string missed;
  for (const JudgedTarget& judged : result.through_drives->purpose) {
    if (judged.met() != true) {
      missed +=
          fmt::format("{}{}: {}", missed.empty() ? "" : "; ", judged.name(), judged.Verdict());
    }
  }
  fmt::print(stderr,
             "warning: {} the model itself is NOT as asked: {}; give [drives] of the task stiffer "
             "gains, let [robust] look for a motion that holds, or try another --seed\n",
             drives, missed);
}

/// Prints how many robots that differ a motion serves.
void PrintRobust(std::FILE* people, const TaskResult& result) {
  if (result.best.robots) {
    const RobotsCarried& robots = *result.best.robots;
    const RobustSettings& settings = *result.problem().robust;
    fmt::print(people,
               "  of {} robots{}{}, which the search has not met, {} rest as asked {:.1f} s after "
               "the motion, "
               "{}; tumbler robustness looks 2 s after it, and at all that a run does\n",
               robots.of,
               settings.spreads.posterior
                   ? fmt::format(" of the posterior at {:.3g} standard deviations", robots.scale)
                   : fmt::format(" at {:.3g} times the spreads", robots.scale),
               result.task.complement.empty() ? "" : " that the other motions do not carry",
               robots.carried, result.problem().settle_s + RobustTask::kLater_s,
               ToText(ShareOf(robots.carried, robots.of)));
  }
  if (!result.robust) return;
  const RobotsAsAsked& robust = *result.robust;
  fmt::print(
      people,
      "  of {} robots that differ, which the search has not met, {} are as asked through drives "
      "({} before it); tumbler robustness plays more of them\n",
      robust.of, robust.as_asked, robust.before);
}

/// Warns of steps that contact does not bear somewhere on the motion, though it does at its ends.
void PrintSteps(std::FILE* people, const TaskResult& result) {
  const double step_s = result.problem().solver.step_s;
  if (!(step_s > 1.001 * result.steps.step_s)) return;
  fmt::print(people,
             "  warning: the solver's steps are {:.3g} ms, and with the pose at {:.3g} s contact "
             "allows {:.3g} ms: give solver.step_s that, or look at the figures of the step of "
             "{:.3g} ms\n",
             1e3 * step_s, result.steps.time_s, 1e3 * result.steps.step_s,
             1e3 * result.look.step_s);
}

/// Prints how far the motion is from a minimum, and what holds it there.
void PrintMinimum(std::FILE* people, const TaskResult& result) {
  const KktResidual& kkt = result.best.kkt;
  const std::optional<double>& finer = result.file->certificate.kkt_residual;
  if (!kkt.relative || !finer) return;
  std::string held;
  for (const Multiplier& multiplier : kkt.multipliers) {
    if (result.best.end != SolveEnd::kConverged) break;  // They mean nothing then.
    if (held.size() > kLongestHeld) {
      held += ", ...";
      break;
    }
    held += fmt::format("{}{} ({:.1e})", held.empty() ? "; held by " : ", ", multiplier.name,
                        multiplier.value);
  }
  const std::string by_finer =
      IsFarFromMinimum(result.problem(), result.best)
          ? ""
          : fmt::format(", with a tolerance 100 times finer {:.1e}", *finer);
  fmt::print(people, "  Kuhn-Tucker residual {:.1e}{} (relative; at a minimum {:.0e} or less){}\n",
             *kkt.relative, by_finer, result.problem().solver.kkt_residual, held);
}

}  // namespace

void PrintNotes(const Task& task) {
  const UrdfSource robot(task.robot_text, task.robot_file);
  const auto print = [&task](const std::vector<RobotFinding>& notes) {
    for (const RobotFinding& note : notes) {
      fmt::print(stderr, "{}:{}: {}: note: {}\n", task.robot_file, note.line, note.key,
                 note.problem);
    }
  };
  print(NotesOf(robot));
  for (const MeshInContact& mesh : task.meshes) {
    fmt::print(stderr, "{}:{}: link '{}': note: {}\n", task.robot_file, mesh.line, mesh.link,
               Describe(mesh));
  }
  task.problem.WithScene([&](const auto& scene) { print(NotesOf(scene.robot.ignored_shapes)); });
  const std::string through =
      task.problem.WithScene([](const auto& scene) { return LinksWithoutContact(scene.robot); });
  if (!task.problem.in_empty_space() && !through.empty()) {
    fmt::print(stderr, "{}: note: no collision shape, so passes through the ground: {}\n",
               task.robot_file, through);
  }
  if (const std::string beyond = BeyondDefaultDrives(task.problem); !beyond.empty())
    fmt::print(stderr, "{}: note: {}\n", task.task_file, beyond);
  PrintContact(task.problem, task.task_file);
}

void PrintMotion(std::FILE* people, const TaskResult& result) {
  const MotionSummary& summary = result.summary;
  const Certificate& c = result.file->certificate;
  const std::string end =
      result.problem().space
          ? "the root's place and axes at the end by {step_halving_error_rad:.1e}"
          : "the final pitch by {step_halving_error_rad:.1e} rad";
  const std::string format =
      "  gradient error {gradient_error:.1e}, projected gradient {projected_gradient:.1e}; with "
      "half "
      "the step the gradient changes by {gradient_step_halving_change:.1e}, " +
      end +
      "\n"
      "  peak torque {peak_torque_nm:.2f} N m, margins: {torque_margin_nm:.2f} N m, "
      "{position_margin_rad:.2f} rad, {velocity_margin_rad_s:.2f} rad/s, "
      "{acceleration_margin_rad_s2:.0f} rad/s^2; "
      "peak penetration {peak_penetration_mm:.2f} mm\n";
  fmt::print(people,
             "{}: objective {:.6g} after {} evaluations, {:.2f} s ({:.2f} s of CPU, {:.2f} of them "
             "to look again); {}\n{}{}",
             result.problem().name, result.best.rollout.cost, result.outcome.evaluations,
             result.wall_s, result.cpu_s, result.look_cpu_s, ToString(result.best.end),
             result.problem().target_pitch_rad
                 ? fmt::format("  pitch at the end {:.4f} rad, {:.3g} s later {:.4f} rad\n",
                               summary.final_pitch_rad, ExitAfter(result.problem()),
                               summary.settled_pitch_rad)
                 : "",
             FormatCertificate(format.c_str(), c, result.problem().contact().d_on_m));
  for (const auto& [name, value] : FoundBesidesPaths(result.problem()))
    fmt::print(people, "  {} {}\n", name, value);
  PrintSecondLook(people, result.look, result.problem().space.has_value(),
                  result.robust.has_value() || result.through_drives.has_value());
  PrintThroughDrives(people, result);
  PrintDamping(people, result);
  PrintSteps(people, result);
  PrintRobust(people, result);
  PrintMinimum(people, result);
  if (c.gradient_error > kDoubtfulGradient) {
    fmt::print(
        stderr,
        "warning: gradient and differences of the cost disagree by {:.1e} (above {:.0e}): {}\n",
        c.gradient_error, kDoubtfulGradient, GradientCause(c));
  }
}

std::vector<std::vector<std::string>> MinimaTable(const TaskResult& result) {
  std::vector<std::vector<std::string>> rows = {
      {"#", "starts", "cost", "violation", "pitch end", "peak torque", "evaluations", "ended"}};
  for (std::size_t i = 0; i < result.minima.size(); ++i) {
    const LocalMinimum& minimum = result.minima[i];
    const Solution& solution = result.outcome.solutions[minimum.solution];
    const MotionSummary& summary = result.minima_summaries[i];
    const std::string& objections = result.minima_objections[i];
    const std::string because =
        solution.feasible()     ? (objections.empty() ? "" : ", refused: " + objections)
        : solution.core_reached ? ", no motion: a contact reached the core"
                                : ", no motion: " + solution.worst_constraint;
    rows.push_back({std::to_string(i + 1), std::to_string(minimum.starts.size()),
                    fmt::format("{:.6g}", solution.rollout.cost),
                    fmt::format("{:.1e}", solution.constraint_violation),
                    fmt::format("{:.4f}", summary.final_pitch_rad),
                    fmt::format("{:.3f}", summary.peak_torque_nm),
                    std::to_string(solution.evaluations), ToString(solution.end) + because});
  }
  return rows;
}

void PrintMinima(std::FILE* people, const TaskResult& result) {
  std::size_t starts = 0;
  for (const LocalMinimum& minimum : result.minima) starts += minimum.starts.size();
  fmt::print(people,
             "{}: {} starts solved to the end led to {} minima (apart by more than {} rad)\n",
             result.problem().name, starts, result.minima.size(), kSameMotionRad);
  // The last column is as long as it is.
  constexpr std::array<int, 8> kWidths = {4, 6, 12, 10, 9, 11, 11, 0};
  for (const std::vector<std::string>& row : MinimaTable(result)) {
    std::string text = " ";
    for (std::size_t k = 0; k + 1 < row.size(); ++k)
      text += fmt::format(" {:>{}}", row[k], kWidths[k]);
    fmt::print(people, "{}  {}\n", text, row.back());
  }
}

void PrintRanking(std::FILE* people, const std::vector<const TaskResult*>& order) {
  std::size_t width = 4;
  for (const TaskResult* result : order) width = std::max(width, result->problem().name.size());
  fmt::print(people, "{:>4}  {:<{}} {:>12} {:>8} {:>11} {:>11} {:>13}\n", "rank", "task", width,
             "cost", "time s", "evaluations", "peak torque", "settled error");
  for (std::size_t i = 0; i < order.size(); ++i) {
    const TaskResult& result = *order[i];
    fmt::print(people, "{:>4}  {:<{}} ", i + 1, result.problem().name, width);
    if (result.file) {
      const std::optional<double> error = result.settled_error_rad();
      fmt::print(people, "{:>12.6g} {:>8.2f} {:>11} {:>11.3f} {:>13}\n", result.best.rollout.cost,
                 result.wall_s, result.outcome.evaluations, result.summary.peak_torque_nm,
                 error ? fmt::format("{:.4f}", *error) : "-");
    } else {
      fmt::print(people, "{:>12} {:>8.2f} {:>11}  {}\n", "none", result.wall_s,
                 result.outcome.evaluations,
                 result.usable ? "interrupted" : "no motion: " + result.cause);
    }
  }
}

}  // namespace tumbler
