// tumbler-optimize: from a task file to a primitive file.

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include "common/command_line.h"
#include "common/program.h"
#include "common/toml_reader.h"
#include "offline/certificate/certificate.h"
#include "offline/certificate/certificate_text.h"
#include "offline/motion_report/motion_report.h"
#include "offline/problem/task_toml.h"
#include "offline/report/report.h"
#include "offline/solver/minima.h"
#include "offline/solver/solver.h"

namespace tumbler {
namespace {

// The one thing that a signal handler can reach.
std::atomic<bool> interrupt_requested = false;
extern "C" void HandleInterrupt(int /*signal*/) { interrupt_requested = true; }

/// The first SIGINT asks for an end; a second one ends the program at once.
void CatchInterrupt() {
  struct sigaction action {};
  action.sa_handler = HandleInterrupt;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
}

struct Arguments {
  std::vector<std::string> tasks;
  std::string start_from;
  std::string out;
  std::string report;
  std::string json;
  std::optional<std::int64_t> seed;
  int threads = 1;
  int minima = 0;  ///< How many starts are solved to the end for the table; 0: no table.
  bool keep_best = false;
};

std::string SystemMessage(int error) { return std::generic_category().message(error); }

[[noreturn]] void FailWrite(const std::string& path, const std::string& why) {
  throw FileError(path, 0, "", fmt::format("cannot be written: {}", why));
}

/// A file that appears under its name only when it is whole, and only when Commit is called: a
/// reader never sees half of one, and what fails before leaves nothing behind.
class PendingFile {
 public:
  /// An existing file is replaced where it is, also behind a symbolic link.
  PendingFile(const std::string& path, const std::string& text)
      : path_(std::filesystem::weakly_canonical(path)),
        temporary_(fmt::format("{}.{}.tmp", path_.string(), getpid())) {
    errno = 0;
    std::ofstream stream(temporary_, std::ios::binary);
    stream << text;
    stream.close();
    if (stream) return;
    const std::string why = SystemMessage(errno);
    Discard();
    FailWrite(path, why);
  }
  ~PendingFile() { Discard(); }
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;

  void Commit() {
    std::error_code error;
    std::filesystem::rename(temporary_, path_, error);
    if (error) FailWrite(path_.string(), error.message());
  }

 private:
  void Discard() {
    std::error_code error;
    std::filesystem::remove(temporary_, error);
  }

  std::filesystem::path path_;
  std::filesystem::path temporary_;
};

/// A file system mounted read-only, and the super-user's rights, show only when something is
/// written.
void ProbeFolder(const std::filesystem::path& folder, const std::string& path) {
  const std::filesystem::path probe = folder / fmt::format(".tumbler-optimize.{}.tmp", getpid());
  errno = 0;
  std::ofstream stream(probe);
  const int why = errno;
  if (!stream) FailWrite(path, fmt::format("{}: {}", folder.string(), SystemMessage(why)));
  stream.close();
  std::error_code error;
  std::filesystem::remove(probe, error);
}

/// Finds out before the work whether its result can be written.
void CheckWritable(const std::string& path) {
  std::error_code error;
  const std::filesystem::path target = std::filesystem::weakly_canonical(path, error);
  if (error) FailWrite(path, error.message());
  if (std::filesystem::is_directory(target, error))
    throw FileError(path, 0, "", "is a directory, not a file");
  const bool exists = std::filesystem::exists(target, error);
  if (exists && !std::filesystem::is_regular_file(target, error)) {
    throw FileError(path, 0, "",
                    "is not a regular file, and it would be replaced by one; leave the option out "
                    "to write none");
  }
  const std::filesystem::path parent = std::filesystem::absolute(target).parent_path();
  if (!std::filesystem::is_directory(parent, error))
    FailWrite(path, fmt::format("the folder {} does not exist", parent.string()));
  if (exists && access(target.c_str(), W_OK) != 0) FailWrite(path, SystemMessage(errno));
  ProbeFolder(parent, path);
}

/// The same for a folder, which is made when it is needed, not before.
void CheckFolderWritable(const std::string& path) {
  std::error_code error;
  std::filesystem::path existing = std::filesystem::absolute(path);
  while (!std::filesystem::exists(existing, error) && existing != existing.root_path())
    existing = existing.parent_path();
  if (!std::filesystem::is_directory(existing, error))
    FailWrite(path, fmt::format("{} is not a folder", existing.string()));
  ProbeFolder(existing, path);
}

/// No result may take the place of what it is made from, or of another result.
void CheckDistinct(const std::vector<std::string>& inputs,
                   const std::vector<std::string>& outputs) {
  const auto same = [](const std::string& a, const std::string& b) {
    std::error_code error;
    return std::filesystem::weakly_canonical(a, error) ==
               std::filesystem::weakly_canonical(b, error) ||
           std::filesystem::equivalent(a, b, error);
  };
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    for (const std::string& input : inputs) {
      if (same(outputs[i], input))
        throw FileError(outputs[i], 0, "", "is an input; results need a file of their own");
    }
    for (std::size_t k = 0; k < i; ++k) {
      if (same(outputs[i], outputs[k]))
        throw FileError(outputs[i], 0, "", "is named for two results; each needs its own file");
    }
  }
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

/// True when the robot never touches what the task puts in its way: the contact model, and with it
/// the motion, was not tried at all.
bool MissesEveryObstacle(const Problem& problem, const Solution& best) {
  return !problem.scene.obstacles.empty() && !best.rollout.any_contact;
}

/// Why nothing was found, and what to do about it.
std::string Cause(const Problem& problem, const Solution& best) {
  if (!best.rollout.finite)
    return "the best motion leaves every plausible range; use a smaller solver.step_s";
  if (MissesEveryObstacle(problem, best)) {
    return "no contact was ever active: the robot touches no obstacle; check start.z_m and the "
           "obstacles (a flight needs none: obstacle = [])";
  }
  if (best.constraint_violation > kNoViolation) {
    return fmt::format(
        "the best motion exceeds a limit: {} by {:.1f} % ({}); give it more duration_s, looser "
        "limits or "
        "more search.max_samples",
        best.worst_constraint, 100 * best.constraint_violation, ToString(best.end));
  }
  if (best.core_reached) {
    return fmt::format(
        "the best motion drives a contact {:.1f} mm deep, through the {:.1f} mm layer to the core; "
        "use a "
        "larger contact.stiffness_n_per_m or contact.d_on_m, or more search.max_samples",
        1e3 * best.rollout.peak_penetration_m, 1e3 * problem.scene.contact.d_on_m);
  }
  return ToString(best.end);
}

/// What contact is made of, and what it asks of the integration.
void PrintContact(const Problem& problem, const std::string& task_file) {
  if (problem.scene.obstacles.empty()) return;
  const ContactLaw& law = problem.scene.contact;
  fmt::print(stderr,
             "contact: k {:.4g} N/m, c {:.4g} N s/m, d_on {:.3g} mm, d_off {:.3g} mm, mu {:.3g}, "
             "v_max {:.3g} m/s; step {:.3g} ms, advisable up to {:.3g} ms\n",
             law.stiffness_n_per_m, law.damping_n_s_per_m, 1e3 * law.d_on_m, 1e3 * law.d_off_m,
             law.mu, law.v_max_m_per_s, 1e3 * problem.solver.step_s,
             1e3 * problem.advisable_step_s);
  if (problem.solver.step_s > problem.advisable_step_s) {
    fmt::print(stderr,
               "{}: solver.step_s: warning: is {:.3g} s, longer than the {:.3g} s that this "
               "contact law allows; leave it out, or make contact softer\n",
               task_file, problem.solver.step_s, problem.advisable_step_s);
  }
}

/// Why differences of the cost do not follow its gradient, and what to do about it.
const char* GradientCause(const Certificate& certificate) {
  // A cliff changes differences across it, hardly the gradient at one point.
  return certificate.gradient_step_halving_change > 0.5
             ? "the step is too long for the contact, which amplifies every change; use a smaller "
               "solver.step_s, a larger contact.v_max_m_per_s or a smaller "
               "contact.stiffness_n_per_m"
             : "the cost has a cliff near this motion, such as a contact that is made or missed by "
               "a "
               "hair, so that a small disturbance may end elsewhere; use another --seed or a "
               "larger "
               "contact.d_on_m";
}

/// The shipped tasks converge after 100 (roll) to 1200 (handstand) evaluations.
constexpr int kEvaluationsToConverge = 2000;

/// A task with all that is known of it when it has been worked on.
struct Result {
  Task task;
  SolveOutcome outcome;
  Solution best;
  MotionSummary summary;  ///< Of `best`, where that has a motion.
  bool usable = false;    ///< `best` is a motion that can be written.
  std::string cause;      ///< Else why it is none.
  std::vector<LocalMinimum> minima;
  std::vector<MotionSummary> minima_summaries;
  std::optional<PrimitiveFile> file;
  double wall_s = 0;
  double cpu_s = 0;

  [[nodiscard]] const Problem& problem() const { return task.problem; }
  /// How far the pitch is from where the task wants it, 2 s after the motion.
  [[nodiscard]] double settled_error_rad() const {
    return std::abs(summary.settled_pitch_rad - problem().target_pitch_rad);
  }
};

Task Load(const Arguments& arguments, const std::string& path) {
  Task task = arguments.start_from.empty()
                  ? LoadTask(path)
                  : LoadTask(path, LoadPrimitive(arguments.start_from), arguments.start_from);
  Problem& problem = task.problem;
  if (arguments.seed) problem.search.seed = static_cast<std::uint64_t>(*arguments.seed);
  if (arguments.minima > 0) {
    // So many motions are solved, each from a start of its own and until it converges: what ends
    // early is no minimum, and two that end early never look the same.
    problem.solver.max_evaluations =
        std::max(problem.solver.max_evaluations, kEvaluationsToConverge);
    problem.solver.finalists = arguments.minima;
    problem.search.refine = std::max(problem.search.refine, arguments.minima);
  }
  return task;
}

void PrintNotes(const Task& task) {
  for (const IgnoredShape& shape : task.problem.scene.robot.ignored_shapes) {
    fmt::print(stderr, "{}:{}: link '{}': note: {}: contact ignores it\n", task.robot_file,
               shape.line, shape.link, shape.reason);
  }
  PrintContact(task.problem, task.task_file);
}

Result Work(Task task, const Arguments& arguments) {
  const auto wall_start = std::chrono::steady_clock::now();
  const double cpu_start = CpuSeconds();
  Result result;
  result.task = std::move(task);
  const Problem& problem = result.problem();
  Progress progress(problem);
  SolveOptions options;
  options.threads = arguments.threads;
  options.interrupt = &interrupt_requested;
  options.progress = [&progress](const Evaluation& evaluation) { progress(evaluation); };
  result.outcome = Solve(problem, options);
  progress.Finish();

  if (!result.outcome.solutions.empty()) result.best = result.outcome.solutions.front();
  const Solution& best = result.best;
  result.usable = !best.x.empty() && best.feasible() && !MissesEveryObstacle(problem, best);
  if (!result.usable) result.cause = Cause(problem, best);
  if (arguments.minima > 0) {
    result.minima = DistinctMinima(result.outcome.solutions);
    for (const LocalMinimum& minimum : result.minima) {
      result.minima_summaries.push_back(
          Summarize(problem, result.outcome.solutions[minimum.solution].x));
    }
  }
  if (result.usable && (!result.outcome.interrupted || arguments.keep_best)) {
    result.summary = Summarize(problem, best.x);
    PrimitiveFile file = MakePrimitiveFile(result.task, result.outcome, best);
    // The certificate computes for itself, and has the last word.
    if (file.certificate.constraint_violation <= kNoViolation) {
      result.file = std::move(file);
    } else {
      result.usable = false;
      result.cause = fmt::format(
          "the certificate finds a limit exceeded by {:.1e}, which the solver does not; this is a "
          "mistake of the program, please report it",
          file.certificate.constraint_violation);
    }
  }
  result.wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_start).count();
  result.cpu_s = CpuSeconds() - cpu_start;
  return result;
}

nlohmann::ordered_json FiguresOfMinima(const Result& result) {
  auto minima = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < result.minima.size(); ++i) {
    const LocalMinimum& minimum = result.minima[i];
    const Solution& solution = result.outcome.solutions[minimum.solution];
    const MotionSummary& summary = result.minima_summaries[i];
    minima.push_back({{"objective", solution.rollout.cost},
                      {"feasible", solution.feasible()},
                      {"constraint_violation", solution.constraint_violation},
                      {"final_pitch_rad", summary.final_pitch_rad},
                      {"settled_pitch_rad", summary.settled_pitch_rad},
                      {"peak_torque_nm", summary.peak_torque_nm},
                      {"projected_gradient", solution.projected_gradient},
                      {"evaluations", solution.evaluations},
                      {"end", ToString(solution.end)},
                      {"starts", minimum.starts}});
  }
  return minima;
}

/// The figures of a task that has a motion.
nlohmann::ordered_json Figures(const Result& result) {
  const Solution& best = result.best;
  const MotionSummary& summary = result.summary;
  nlohmann::ordered_json json = {{"name", result.problem().name},
                                 {"seed", result.problem().search.seed},
                                 {"objective", best.rollout.cost},
                                 {"evaluations", result.outcome.evaluations},
                                 {"wall_s", result.wall_s},
                                 {"cpu_s", result.cpu_s},
                                 {"end", ToString(best.end)},
                                 {"final_pitch_rad", summary.final_pitch_rad},
                                 {"settled_pitch_rad", summary.settled_pitch_rad},
                                 {"settled_error_rad", result.settled_error_rad()},
                                 {"settled_speed", summary.settled_speed}};
  for (const CertificateFigure& figure : FiguresOf(result.file->certificate)) {
    const std::string_view key = figure.key;
    // settled_error_rad is the first without its sign, the second comes last.
    if (key == "settled_pitch_error_rad" || key == "coefficients_hash") continue;
    std::visit([&](const auto& value) { json[figure.key] = value; }, figure.value);
  }
  json["coefficients_hash"] = result.file->certificate.coefficients_hash;
  if (!result.minima.empty()) json["minima"] = FiguresOfMinima(result);
  return json;
}

/// What is said of a motion, and of a gradient that cannot be trusted.
void PrintMotion(std::FILE* people, const Result& result) {
  const MotionSummary& summary = result.summary;
  const Certificate& c = result.file->certificate;
  fmt::print(people,
             "{}: objective {:.6g} after {} evaluations, {:.2f} s ({:.2f} s of CPU); {}\n"
             "  pitch at the end {:.4f} rad, 2 s later {:.4f} rad\n{}",
             result.problem().name, result.best.rollout.cost, result.outcome.evaluations,
             result.wall_s, result.cpu_s, ToString(result.best.end), summary.final_pitch_rad,
             summary.settled_pitch_rad,
             FormatCertificate(
                 "  gradient error {gradient_error:.1e}, projected gradient "
                 "{projected_gradient:.1e}; with half the step the gradient changes by "
                 "{gradient_step_halving_change:.1e}, the final pitch by "
                 "{step_halving_error_rad:.1e} rad\n"
                 "  peak torque {peak_torque_nm:.2f} N m, margins: {torque_margin_nm:.2f} N m, "
                 "{position_margin_rad:.2f} rad, {velocity_margin_rad_s:.2f} rad/s, "
                 "{acceleration_margin_rad_s2:.0f} rad/s^2; "
                 "peak penetration {peak_penetration_mm:.2f} mm\n",
                 c, result.problem().scene.contact.d_on_m));
  if (c.gradient_error > kDoubtfulGradient) {
    fmt::print(
        stderr,
        "warning: gradient and differences of the cost disagree by {:.1e} (above {:.0e}): {}\n",
        c.gradient_error, kDoubtfulGradient, GradientCause(c));
  }
}

void PrintMinima(std::FILE* people, const Result& result) {
  std::size_t starts = 0;
  for (const LocalMinimum& minimum : result.minima) starts += minimum.starts.size();
  fmt::print(people,
             "{}: {} starts solved to the end led to {} minima (apart by more than {} rad)\n",
             result.problem().name, starts, result.minima.size(), kSameMotionRad);
  fmt::print(people, "  {:>4} {:>6} {:>12} {:>10} {:>9} {:>11} {:>11}  {}\n", "#", "starts", "cost",
             "violation", "pitch end", "peak torque", "evaluations", "ended");
  for (std::size_t i = 0; i < result.minima.size(); ++i) {
    const LocalMinimum& minimum = result.minima[i];
    const Solution& solution = result.outcome.solutions[minimum.solution];
    const MotionSummary& summary = result.minima_summaries[i];
    const bool held = solution.feasible();
    fmt::print(people, "  {:>4} {:>6} {:>12.6g} {:>10.1e} {:>9.4f} {:>11.3f} {:>11}  {}{}\n", i + 1,
               minimum.starts.size(), solution.rollout.cost, solution.constraint_violation,
               summary.final_pitch_rad, summary.peak_torque_nm, solution.evaluations,
               ToString(solution.end),
               held                    ? ""
               : solution.core_reached ? ", no motion: a contact reached the core"
                                       : ", no motion: " + solution.worst_constraint);
  }
}

/// Best first: tasks with a motion before those without, then by cost, or by how far they miss.
std::vector<const Result*> Ranked(const std::vector<Result>& results) {
  std::vector<const Result*> order;
  for (const Result& result : results) order.push_back(&result);
  std::stable_sort(order.begin(), order.end(), [](const Result* a, const Result* b) {
    if (a->usable != b->usable) return a->usable;
    return a->usable ? a->best.rollout.cost < b->best.rollout.cost
                     : a->best.constraint_violation < b->best.constraint_violation;
  });
  return order;
}

void PrintRanking(std::FILE* people, const std::vector<const Result*>& order) {
  std::size_t width = 4;
  for (const Result* result : order) width = std::max(width, result->problem().name.size());
  fmt::print(people, "{:>4}  {:<{}} {:>12} {:>8} {:>11} {:>11} {:>13}\n", "rank", "task", width,
             "cost", "time s", "evaluations", "peak torque", "settled error");
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Result& result = *order[i];
    fmt::print(people, "{:>4}  {:<{}} ", i + 1, result.problem().name, width);
    if (result.file) {
      fmt::print(people, "{:>12.6g} {:>8.2f} {:>11} {:>11.3f} {:>13.4f}\n",
                 result.best.rollout.cost, result.wall_s, result.outcome.evaluations,
                 result.summary.peak_torque_nm, result.settled_error_rad());
    } else {
      fmt::print(people, "{:>12} {:>8.2f} {:>11}  {}\n", "none", result.wall_s,
                 result.outcome.evaluations,
                 result.usable ? "interrupted" : "no motion: " + result.cause);
    }
  }
}

void Flush(std::FILE* stream) {
  if (std::fflush(stream) != 0)
    throw std::runtime_error(fmt::format("standard output: {}", SystemMessage(errno)));
}

ExitStatus OptimizeOne(const Arguments& arguments) {
  std::vector<std::string> inputs = {arguments.tasks.front()};
  Task task = Load(arguments, arguments.tasks.front());
  if (!arguments.start_from.empty()) inputs.push_back(arguments.start_from);
  inputs.push_back(task.robot_file);
  std::vector<std::string> files;
  for (const std::string& path : {arguments.out, arguments.json}) {
    if (!path.empty() && path != "-") files.push_back(path);
  }
  for (const std::string& path : files) CheckWritable(path);
  if (!arguments.report.empty()) {
    CheckFolderWritable(arguments.report);
    files.push_back((std::filesystem::path(arguments.report) / "index.html").string());
  }
  CheckDistinct(inputs, files);
  PrintNotes(task);
  std::FILE* const people = arguments.json == "-" ? stderr : stdout;

  CatchInterrupt();
  const Result result = Work(std::move(task), arguments);
  if (arguments.minima > 0) PrintMinima(people, result);
  const auto drop = [&arguments] {
    fmt::print(stderr, "interrupted: {}; no file was written\n",
               !arguments.keep_best ? "the best motion so far is dropped (--keep-best keeps it)"
                                    : "no motion within the limits was found so far");
    return ExitStatus::kInterrupted;
  };
  if (result.outcome.interrupted) {
    if (!result.file) return drop();
  } else if (!result.usable) {
    fmt::print(stderr, "no motion was found: {}\nno file was written\n", result.cause);
    return ExitStatus::kRefused;
  }

  const std::string text = ToToml(*result.file);
  ParsePrimitive(text, "the new primitive");  // What is written is what will be read.
  std::optional<ReportData> report;
  if (!arguments.report.empty())
    report = MakeReportData(result.task, result.outcome, result.best, *result.file);
  if (interrupt_requested && !arguments.keep_best) return drop();
  std::signal(SIGINT, SIG_IGN);  // What is written from here on is written whole.
  const bool interrupted = interrupt_requested;
  if (interrupted)
    fmt::print(stderr, "interrupted: the best motion so far is kept, as --keep-best asks\n");

  const std::string json = Figures(result).dump(2) + "\n";
  std::optional<PendingFile> primitive_file, json_file;
  if (!arguments.out.empty()) primitive_file.emplace(arguments.out, text);
  if (!arguments.json.empty() && arguments.json != "-") json_file.emplace(arguments.json, json);
  if (arguments.json == "-") fmt::print("{}", json);
  Flush(stdout);
  std::string page;
  if (report) page = WriteReport(*report, arguments.report);
  if (json_file) json_file->Commit();
  if (primitive_file) primitive_file->Commit();

  PrintMotion(people, result);
  if (!arguments.out.empty()) fmt::print(people, "  primitive {}\n", arguments.out);
  if (!page.empty()) fmt::print(people, "  report {}\n", page);
  Flush(people);
  return interrupted ? ExitStatus::kInterrupted : ExitStatus::kDone;
}

/// Several tasks one after the other, and a table that ranks them. The primitive of each is
/// DIR/NAME.toml, its report REPORT/NAME.
ExitStatus OptimizeSeveral(const Arguments& arguments) {
  if (!arguments.start_from.empty())
    throw std::invalid_argument("--start-from: is for one task; give the tasks one at a time");
  namespace fs = std::filesystem;
  // All that can be wrong is found before the first task is worked on.
  std::vector<Task> tasks;
  std::vector<std::string> inputs, outputs;
  std::map<std::string, std::string> file_of_name;
  for (const std::string& path : arguments.tasks) {
    Task& task = tasks.emplace_back(Load(arguments, path));
    inputs.insert(inputs.end(), {path, task.robot_file});
    const std::string& name = task.problem.name;
    if (const auto [other, is_new] = file_of_name.emplace(name, path); !is_new) {
      throw FileError(path, 0, "name",
                      fmt::format("is '{}', like that of {}; tasks that are ranked need different "
                                  "names",
                                  name, other->second));
    }
    if (name.find('/') != std::string::npos || name.starts_with(".")) {
      throw FileError(path, 0, "name",
                      fmt::format("is '{}', which cannot name a file; allowed where several tasks "
                                  "are ranked: no '/', and no '.' to begin with",
                                  name));
    }
  }
  const auto primitive_of = [&arguments](const Task& task) {
    return (fs::path(arguments.out) / (task.problem.name + ".toml")).string();
  };
  const auto report_of = [&arguments](const Task& task) {
    return (fs::path(arguments.report) / task.problem.name).string();
  };
  for (const std::string& folder : {arguments.out, arguments.report}) {
    if (!folder.empty()) CheckFolderWritable(folder);
  }
  for (const Task& task : tasks) {
    if (!arguments.out.empty()) outputs.push_back(primitive_of(task));
    if (!arguments.out.empty() && fs::exists(arguments.out)) CheckWritable(primitive_of(task));
    if (!arguments.report.empty()) outputs.push_back(report_of(task) + "/index.html");
  }
  if (!arguments.json.empty() && arguments.json != "-") {
    CheckWritable(arguments.json);
    outputs.push_back(arguments.json);
  }
  CheckDistinct(inputs, outputs);
  for (const Task& task : tasks) PrintNotes(task);
  std::FILE* const people = arguments.json == "-" ? stderr : stdout;

  CatchInterrupt();
  std::vector<Result> results;
  for (Task& task : tasks) {
    if (interrupt_requested) break;
    fmt::print(stderr, "{}\n", task.task_file);
    results.push_back(Work(std::move(task), arguments));
    const Result& result = results.back();
    if (arguments.minima > 0) PrintMinima(people, result);
    if (!result.file) continue;
    const std::string text = ToToml(*result.file);
    ParsePrimitive(text, "the new primitive");
    PrintMotion(people, result);
    if (!arguments.report.empty()) {
      const ReportData report =
          MakeReportData(result.task, result.outcome, result.best, *result.file);
      fmt::print(people, "  report {}\n", WriteReport(report, report_of(result.task)));
    }
    if (arguments.out.empty()) continue;
    fs::create_directories(arguments.out);
    const std::string path = primitive_of(result.task);
    PendingFile(path, text).Commit();
    fmt::print(people, "  primitive {}\n", path);
  }

  const std::vector<const Result*> order = Ranked(results);
  auto ranking = nlohmann::ordered_json::array();
  bool all_found = true;
  for (const Result* result : order) {
    all_found = all_found && result->file;
    nlohmann::ordered_json entry = {{"task", result->task.task_file},
                                    {"found", result->file.has_value()}};
    if (result->file) {
      entry.update(Figures(*result));
    } else {
      entry.update({{"name", result->problem().name},
                    {"cause", result->usable ? "interrupted" : result->cause},
                    {"evaluations", result->outcome.evaluations},
                    {"wall_s", result->wall_s},
                    {"cpu_s", result->cpu_s}});
      if (!result->minima.empty()) entry["minima"] = FiguresOfMinima(*result);
    }
    ranking.push_back(std::move(entry));
  }
  const std::string json = nlohmann::ordered_json{{"ranking", ranking}}.dump(2) + "\n";
  if (arguments.json == "-") {
    fmt::print("{}", json);
  } else if (!arguments.json.empty()) {
    PendingFile(arguments.json, json).Commit();
  }
  PrintRanking(people, order);
  Flush(stdout);
  Flush(people);
  if (interrupt_requested) {
    fmt::print(stderr, "interrupted: {} of {} tasks were worked on\n", results.size(),
               tasks.size());
    return ExitStatus::kInterrupted;
  }
  return all_found ? ExitStatus::kDone : ExitStatus::kRefused;
}

ExitStatus Optimize(const Arguments& arguments) {
  return arguments.tasks.size() == 1 ? OptimizeOne(arguments) : OptimizeSeveral(arguments);
}

std::int64_t ReadSeed(const std::string& text) {
  std::int64_t seed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
  if (error != std::errc() || end != text.data() + text.size() || seed < 0) {
    throw UsageError("--seed", fmt::format("is '{}'; allowed: from 0 ... {}", text,
                                           std::numeric_limits<std::int64_t>::max()));
  }
  return seed;
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line(
      "Finds a motion for a task and writes it as a primitive.\n"
      "Exit status: 0 found; 1 bad input; 2 no motion within the limits was found (of any task); "
      "130 "
      "interrupted.");
  line.Option("TASK", arguments.tasks,
              "Task file (TOML); several are worked on one by one, and ranked")
      .Required();
  line.Option("--start-from", arguments.start_from,
              "Start where this primitive leaves the robot (its simulated exit), not in the "
              "task's own start pose");
  line.Option("--out", arguments.out,
              "Write the primitive here; for several tasks the folder, for NAME.toml of each");
  // Read by hand: as a number, one that is too large would count as the largest that fits.
  line.Option(
      "--seed", "INT", [&arguments](const std::string& text) { arguments.seed = ReadSeed(text); },
      "Seed of the global search, instead of the task's");
  line.Option("--threads", arguments.threads, "Threads; the result does not depend on it")
      .Within(1, 256)
      .ShowDefault();
  line.Option("--report", arguments.report,
              "Write a page that shows the motion into this folder; for several tasks into "
              "its folder NAME");
  line.Option("--json", arguments.json,
              "Write figures as JSON to this file, or to standard output for -");
  line.Option("--minima", arguments.minima,
              "Solve this many starts to the end, and show a table of all minima found")
      .Within(1, 1000);
  line.Flag("--keep-best", arguments.keep_best,
            "When interrupted, still write the best motion so far");
  line.RejectEmptyValues();
  line.Parse(argc, argv);
  return Optimize(arguments);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::RunProgram("error", argc, argv, tumbler::Main); }
