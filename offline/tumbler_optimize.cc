// tumbler-optimize: from a task file to a primitive file.

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <exception>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "common/toml_reader.h"
#include "offline/certificate/certificate.h"
#include "offline/problem/task_toml.h"
#include "offline/report/report.h"
#include "offline/solver/solver.h"

namespace tumbler {
namespace {

enum ExitStatus { kFound = 0, kBadInput = 1, kNotFound = 2, kInterruptedBySignal = 130 };

// The one thing that a signal handler can reach.
std::atomic<bool> interrupt_requested = false;
extern "C" void HandleInterrupt(int /*signal*/) { interrupt_requested = true; }

struct Arguments {
  std::string task;
  std::string out;
  std::string report;
  std::string json;
  std::optional<std::uint64_t> seed;
  int threads = 1;
  bool keep_best = false;
};

/// Writes a whole file or nothing: a reader never sees half of one.
void WriteFile(const std::string& path, const std::string& text) {
  const std::string temporary = fmt::format("{}.{}.tmp", path, getpid());
  std::ofstream stream(temporary, std::ios::binary);
  stream << text;
  stream.close();
  std::error_code error;
  if (stream) std::filesystem::rename(temporary, path, error);
  if (!stream || error) {
    const std::string why = error ? error.message() : std::strerror(errno);
    std::filesystem::remove(temporary, error);
    throw FileError(path, 0, "", fmt::format("cannot be written: {}", why));
  }
}

/// Finds out before the work whether its result can be written.
void CheckWritable(const std::string& path) {
  const std::filesystem::path parent = std::filesystem::absolute(path).parent_path();
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw FileError(path, 0, "", "is a directory, not a file");
  if (!std::filesystem::is_directory(parent, error)) {
    throw FileError(
        path, 0, "",
        fmt::format("cannot be written: the folder {} does not exist", parent.string()));
  }
  const bool exists = std::filesystem::exists(path, error);
  if (access(parent.c_str(), W_OK) != 0 || (exists && access(path.c_str(), W_OK) != 0)) {
    throw FileError(path, 0, "", fmt::format("cannot be written: {}", std::strerror(errno)));
  }
  // A file system mounted read-only, and the super-user's rights, show only when something is
  // written.
  const std::string probe = fmt::format("{}.{}.tmp", path, getpid());
  std::ofstream stream(probe);
  const int why = errno;
  if (!stream)
    throw FileError(path, 0, "", fmt::format("cannot be written: {}", std::strerror(why)));
  stream.close();
  std::filesystem::remove(probe, error);
}

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Progress on standard error: one line that rewrites itself on a terminal, plain lines in a pipe.
class Progress {
 public:
  explicit Progress(const Problem& problem)
      : problem_(problem), terminal_(isatty(STDERR_FILENO) == 1), start_(Clock::now()) {}

  void operator()(const Evaluation& e) {
    if (e.global != global_) {
      Finish();
      global_ = e.global;
      stage_start_ = Clock::now();
      local_ = 0;
    }
    if (!e.global) ++local_;
    const auto now = Clock::now();
    const SolverSettings& solver = problem_.solver;
    const int screened =
        problem_.search.refine * std::min(solver.screen_evaluations, solver.max_evaluations);
    const int finals =
        solver.finalists * std::max(0, solver.max_evaluations - solver.screen_evaluations);
    const double total = e.global ? problem_.search.max_samples : screened + finals;
    const double done = e.global ? static_cast<double>(e.count) : static_cast<double>(local_);
    const bool last = done >= total;
    if (!last && now - shown_ <
                     (terminal_ ? std::chrono::milliseconds(100) : std::chrono::milliseconds(1000)))
      return;
    shown_ = now;
    const double elapsed = std::chrono::duration<double>(now - stage_start_).count();
    const double left = done > 0 ? elapsed / done * (total - done) : 0;
    const std::string text =
        e.global
            ? fmt::format("search  {:6d}/{} evaluations  best rank {:.5g}  at most {:.1f} s left",
                          e.count, problem_.search.max_samples, e.cost, left)
            : fmt::format(
                  "solve   start {} of {}  evaluation {:4d}  cost {:.6g}  violation {:.1e}  at "
                  "most {:.1f} s left",
                  e.start + 1, problem_.search.refine, e.count, e.cost, e.violation, left);
    if (terminal_) {
      fmt::print(stderr, "\r\x1b[K{}", text);
      std::fflush(stderr);
      open_line_ = true;
    } else {
      fmt::print(stderr, "{}\n", text);
    }
  }

  void Finish() {
    if (open_line_) fmt::print(stderr, "\n");
    open_line_ = false;
  }

 private:
  using Clock = std::chrono::steady_clock;
  const Problem& problem_;
  bool terminal_;
  bool global_ = true;
  bool open_line_ = false;
  std::int64_t local_ = 0;
  Clock::time_point start_, stage_start_ = Clock::now(), shown_{};
};

/// Why nothing was found, and what to do about it.
std::string Cause(const Problem& problem, const Solution& best) {
  if (!best.rollout.finite)
    return "the best motion leaves every plausible range; use a smaller solver.step_s";
  if (!problem.obstacles.empty() && !best.rollout.any_contact) {
    return "no contact was ever active: the robot falls past every obstacle; check start.z_m and "
           "the obstacles";
  }
  if (best.violation > 1e-6) {
    return fmt::format(
        "the best motion exceeds a limit: {} by {:.1f} % ({}); give it more duration_s, looser "
        "limits or "
        "more search.max_samples",
        best.worst_constraint, 100 * best.violation, ToString(best.end));
  }
  if (best.core_reached) {
    return fmt::format(
        "the best motion drives a contact {:.1f} mm deep, through the {:.1f} mm layer to the core; "
        "use a "
        "larger contact.stiffness_n_per_m or contact.d_on_m, or more search.max_samples",
        1e3 * best.rollout.peak_penetration_m, 1e3 * problem.contact.layer_m);
  }
  return ToString(best.end);
}

int Optimize(const Arguments& arguments) {
  const auto wall_start = std::chrono::steady_clock::now();
  Task task = LoadTask(arguments.task);
  Problem& problem = task.problem;
  if (arguments.seed) problem.search.seed = *arguments.seed;
  for (const std::string& path : {arguments.out, arguments.json}) {
    if (!path.empty() && path != "-") CheckWritable(path);
  }
  for (const IgnoredShape& shape : problem.robot.ignored_shapes) {
    fmt::print(stderr, "{}:{}: link '{}': note: {}; contacts use spheres only\n", task.robot_file,
               shape.line, shape.link, shape.reason);
  }

  std::signal(SIGINT, HandleInterrupt);
  Progress progress(problem);
  SolveOptions options;
  options.threads = arguments.threads;
  options.interrupt = &interrupt_requested;
  options.progress = [&progress](const Evaluation& evaluation) { progress(evaluation); };
  const SolveOutcome outcome = Solve(problem, options);
  progress.Finish();
  std::signal(SIGINT, SIG_DFL);

  const Solution& best = outcome.solutions.front();
  if (outcome.interrupted) {
    if (!arguments.keep_best || !best.feasible()) {
      fmt::print(stderr, "interrupted: {}; no file was written\n",
                 !arguments.keep_best ? "the best motion so far is dropped (--keep-best keeps it)"
                                      : "no motion within the limits was found so far");
      return kInterruptedBySignal;
    }
    fmt::print(stderr, "interrupted: the best motion so far is kept, as --keep-best asks\n");
  } else if (!best.feasible()) {
    fmt::print(stderr, "no motion was found: {}\nno file was written\n", Cause(problem, best));
    return kNotFound;
  }

  const PrimitiveFile file = MakePrimitiveFile(task, outcome, best);
  const MotionSummary summary = Summarize(problem, best.x);
  const Certificate& c = file.certificate;
  const std::string text = ToToml(file);
  ParsePrimitive(text, "the new primitive");  // What is written is what will be read.
  std::string page;
  if (!arguments.report.empty())
    page = WriteReport(MakeReportData(task, outcome, best, file), arguments.report);
  if (!arguments.out.empty()) WriteFile(arguments.out, text);

  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_start).count();
  const nlohmann::ordered_json json = {{"name", problem.name},
                                       {"seed", problem.search.seed},
                                       {"objective", best.rollout.cost},
                                       {"evaluations", outcome.evaluations},
                                       {"wall_s", wall_s},
                                       {"cpu_s", CpuSeconds()},
                                       {"end", ToString(best.end)},
                                       {"final_pitch_rad", summary.final_pitch_rad},
                                       {"settled_pitch_rad", summary.settled_pitch_rad},
                                       {"settled_speed", summary.settled_speed},
                                       {"gradient_error", c.gradient_error},
                                       {"projected_gradient", c.projected_gradient},
                                       {"constraint_violation", c.constraint_violation},
                                       {"step_halving_error_rad", c.step_halving_error_rad},
                                       {"peak_torque_nm", c.peak_torque_nm},
                                       {"peak_penetration_m", c.peak_penetration_m},
                                       {"position_margin_rad", c.position_margin_rad},
                                       {"velocity_margin_rad_s", c.velocity_margin_rad_s},
                                       {"acceleration_margin_rad_s2", c.acceleration_margin_rad_s2},
                                       {"torque_margin_nm", c.torque_margin_nm},
                                       {"coefficients_hash", c.coefficients_hash}};
  if (!arguments.json.empty() && arguments.json != "-")
    WriteFile(arguments.json, json.dump(2) + "\n");
  if (arguments.json == "-") fmt::print("{}\n", json.dump(2));

  std::FILE* const people = arguments.json == "-" ? stderr : stdout;
  fmt::print(
      people,
      "{}: objective {:.6g} after {} evaluations, {:.2f} s ({:.2f} s of CPU); {}\n"
      "  pitch at the end {:.4f} rad, 2 s later {:.4f} rad\n"
      "  gradient error {:.1e}, projected gradient {:.1e}, step-halving error {:.1e} rad\n"
      "  peak torque {:.2f} N m, margins: {:.2f} N m, {:.2f} rad, {:.2f} rad/s, {:.0f} rad/s^2; "
      "peak penetration {:.2f} mm\n",
      problem.name, best.rollout.cost, outcome.evaluations, wall_s, CpuSeconds(),
      ToString(best.end), summary.final_pitch_rad, summary.settled_pitch_rad, c.gradient_error,
      c.projected_gradient, c.step_halving_error_rad, c.peak_torque_nm, c.torque_margin_nm,
      c.position_margin_rad, c.velocity_margin_rad_s, c.acceleration_margin_rad_s2,
      1e3 * c.peak_penetration_m);
  if (!arguments.out.empty()) fmt::print(people, "  primitive {}\n", arguments.out);
  if (!page.empty()) fmt::print(people, "  report {}\n", page);
  return outcome.interrupted ? kInterruptedBySignal : kFound;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  tumbler::Arguments arguments;
  CLI::App app{
      "Finds a motion for a task and writes it as a primitive.\n"
      "Exit status: 0 found; 1 bad input; 2 no motion within the limits was found; 130 "
      "interrupted."};
  app.add_option("TASK", arguments.task, "Task file (TOML)")->required();
  app.add_option("--out", arguments.out, "Write the primitive here");
  app.add_option("--seed", arguments.seed, "Seed of the global search, instead of the task's");
  app.add_option("--threads", arguments.threads, "Threads; the result does not depend on it")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option("--report", arguments.report,
                 "Write a page that shows the motion into this folder");
  app.add_option("--json", arguments.json,
                 "Write figures as JSON to this file, or to standard output for -");
  app.add_flag("--keep-best", arguments.keep_best,
               "When interrupted, still write the best motion so far");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : tumbler::kBadInput;
  }
  try {
    return tumbler::Optimize(arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return tumbler::kBadInput;
  }
}
