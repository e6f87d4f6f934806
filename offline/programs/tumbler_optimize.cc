// tumbler optimize: makes a primitive file from a task file.

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/held_results.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/certify/result_json.h"
#include "offline/certify/result_text.h"
#include "offline/certify/task_result.h"
#include "offline/pages/motion_report.h"
#include "offline/pages/page_file.h"
#include "offline/pages/report.h"
#include "offline/pages/space_motion.h"
#include "offline/pages/space_page.h"
#include "offline/problem/posterior_toml.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/guess.h"
#include "offline/studies/identified_model.h"
#include "offline/studies/window.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0    found
  1    wrong usage, or a file that cannot be used or written: nothing was written
  2    no motion was found (of one of the tasks) that keeps the limits and reaches the targets of its cost
  4    found, but with --window: there is none, for a reason that is said; all else is written
  130  interrupted)";

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> tasks;
  std::string start_from;
  std::vector<std::string> guesses;
  std::string posterior;                ///< What is known of the robot.
  std::vector<std::string> complement;  ///< Primitives that are tried before.
  std::string out;
  std::string report;
  std::string json;
  std::optional<std::uint64_t> seed;
  int threads = 1;
  int minima = 0;  ///< Number of starts that are solved to their end for the table; 0: no table.
  bool prove = false;
  bool keep_best = false;
  bool window = false;
  bool quiet = false;
};

/// Evaluations with which a solve converges. The shipped tasks need 100 (roll) to 1200 (handstand).
constexpr int kEvaluationsToConverge = 2000;

/// Loads a primitive, and says whether it was changed by hand.
PrimitiveFile LoadNoting(const std::string& path) {
  PrimitiveFile file = LoadPrimitive(path);
  fmt::print(stderr, "{}", EditNotes(path, {&file, 1}));
  return file;
}

/// @param guess  empty: none.
Task Load(const Arguments& arguments, const std::string& path, const std::string& guess) {
  Task task = arguments.start_from.empty()
                  ? LoadTask(path, TaskSpaces::kPlaneAndSpace)
                  : LoadTask(path, LoadNoting(arguments.start_from), arguments.start_from);
  if (!arguments.posterior.empty()) {
    const PosteriorFile known = LoadPosterior(arguments.posterior);
    if (!task.problem.robust) {
      throw FileError(path, 0, "robust",
                      "is not there; a motion for a robot that was identified (--posterior) is "
                      "judged by robots that this may be: give the task [robust]");
    }
    if (known.effective) {
      fmt::print(stderr,
                 "note: {} is of an effective model, which does not explain its records; try the "
                 "motion in tumbler identify gate first\n",
                 arguments.posterior);
    }
    task = IdentifiedTask(task, known);
    TuneTo(known, {}, task);
  }
  Problem& problem = task.problem;
  if (!guess.empty()) TakeGuess(task, LoadNoting(guess), guess);
  CheckGuess(task);
  for (const std::string& other : arguments.complement)
    TakeComplement(task, LoadNoting(other), other);
  if (arguments.window && (problem.space || problem.in_empty_space())) {
    throw UsageError("--window",
                     fmt::format("is of the ground of robots in the plane; leave it out: {} has {}",
                                 path, problem.space ? "one in space" : "no ground"));
  }
  if (arguments.seed) problem.search.seed = *arguments.seed;
  if (arguments.prove || arguments.minima > 0) problem.solver.prove = true;
  if (arguments.minima > 0) {
    // This many motions are solved, each from a start of its own and until it converges. A motion
    // that ends early is no minimum, and two that end early never look the same.
    problem.solver.max_evaluations =
        std::max(problem.solver.max_evaluations, kEvaluationsToConverge);
    problem.solver.finalists = arguments.minima;
    problem.search.refine = std::max(problem.search.refine, arguments.minima);
  }
  return task;
}

WorkSettings SettingsOf(const Arguments& arguments, std::atomic<bool>& end_requested) {
  WorkSettings settings;
  settings.threads = arguments.threads;
  settings.minima = arguments.minima > 0;
  settings.keep_best = arguments.keep_best;
  settings.quiet = arguments.quiet;
  settings.interrupt = &end_requested;
  return settings;
}

void Flush(std::FILE* stream) {
  if (std::fflush(stream) != 0) {
    throw std::runtime_error(
        fmt::format("standard output: {}", std::generic_category().message(errno)));
  }
}

/// Writes the page of a motion in space. @returns its path.
std::string WriteSpacePage(const TaskResult& result, const std::string& where) {
  return WritePage(SpacePage(MakeSpaceMotionPage(result.task, result.best.x, *result.file)), where);
}

/// What came of --window: nothing where it was not asked for, or not looked for any more.
struct Window {
  std::string text;  ///< For people.
  bool lacking = false;

  [[nodiscard]] ExitStatus status() const {
    return lacking ? ExitStatus::kAmiss : ExitStatus::kDone;
  }
};

/// Finds the window of a result, for its file. @pre the result has a file.
Window LookForWindow(const Arguments& arguments, TaskResult& result) {
  if (!arguments.window || result.outcome.interrupted) return {};
  try {
    const WindowResult found = FindWindows(*result.file, arguments.threads);
    if (!found.windows.empty()) result.file->window = WindowOf(found);
    return {ToText(found), found.windows.empty()};
  } catch (const Refused& error) {
    return {fmt::format("no window was found: {}\n", error.what()), true};
  }
}

/// The data of the page of a result. @pre the result has a file.
ReportData PageOf(const TaskResult& result, const Window& window) {
  ReportData data = MakeReportData(result.task, result.outcome, result.best, *result.file);
  if (window.lacking) data.window_note = window.text;
  if (result.minima.empty()) return data;
  const std::vector<std::vector<std::string>> table = MinimaTable(result);
  data.minima = {table.front(), {table.begin() + 1, table.end()}};
  return data;
}

/// The task, once from each guess.
std::vector<Task> LoadFromGuesses(const Arguments& arguments) {
  const std::string& path = arguments.tasks.front();
  if (arguments.guesses.empty()) return {Load(arguments, path, "")};
  std::vector<Task> tasks = {Load(arguments, path, arguments.guesses.front())};
  for (std::size_t i = 1; i < arguments.guesses.size(); ++i) {
    Task task = tasks.front();
    TakeGuess(task, LoadNoting(arguments.guesses[i]), arguments.guesses[i]);
    CheckGuess(task);
    tasks.push_back(std::move(task));
  }
  return tasks;
}

/// Says where a motion for an identified robot is a guess's path.
void NoteStandingGuess(const Arguments& arguments, const TaskResult& result) {
  if (arguments.posterior.empty() || result.best.x != result.task.guess) return;
  fmt::print(
      stderr,
      "note: all robots of {} stand with the path of {} as it is: try that motion first, and "
      "keep it where it stands\n",
      arguments.posterior, result.task.guess_file);
}

/// Writes a motion that is as asked while the work on it goes on, and says how near to a minimum it
/// is.
void WriteInterim(const PrimitiveFile& file, const Arguments& arguments) {
  const std::string text = ToToml(file);
  ParsePrimitive(text, "the interim primitive");  // The text must read back.
  PendingFile(arguments.out, text).Commit();
  if (arguments.quiet) return;
  const std::optional<double>& residual = file.certificate.kkt_residual;
  fmt::print(stderr, "interim: objective {:.6g}, {}, in {}; goes on\n", file.provenance.objective,
             residual ? fmt::format("Kuhn-Tucker residual {:.1e}", *residual)
                      : "of unknown distance from a minimum",
             arguments.out);
}

/// Writes all that is asked for, or nothing.
/// @param text    of the primitive.
/// @param report  the page of a motion in the plane.
/// @returns the page's file; empty: there is none.
std::string WriteOutputs(const Arguments& arguments, const TaskResult& result,
                         const std::string& text, const std::optional<ReportData>& report) {
  const std::string json = ToJson(result);
  std::optional<PendingFile> primitive_file, json_file;
  if (!arguments.out.empty()) primitive_file.emplace(arguments.out, text);
  if (!arguments.json.empty() && arguments.json != "-") json_file.emplace(arguments.json, json);
  if (arguments.json == "-") fmt::print("{}", json);
  Flush(stdout);
  std::string page;
  if (report) page = WriteReport(*report, arguments.report);
  if (!arguments.report.empty() && result.problem().space)
    page = WriteSpacePage(result, arguments.report);
  if (json_file) json_file->Commit();
  if (primitive_file) primitive_file->Commit();
  return page;
}

ExitStatus OptimizeOne(const Arguments& arguments) {
  std::vector<std::string> inputs = {arguments.tasks.front()};
  std::vector<Task> tasks = LoadFromGuesses(arguments);
  for (const std::string& path : {arguments.start_from, arguments.posterior}) {
    if (!path.empty()) inputs.push_back(path);
  }
  inputs.insert(inputs.end(), arguments.guesses.begin(), arguments.guesses.end());
  inputs.insert(inputs.end(), arguments.complement.begin(), arguments.complement.end());
  inputs.push_back(tasks.front().robot_file);
  std::vector<std::string> files;
  for (const std::string& path : {arguments.out, arguments.json}) {
    if (!path.empty() && path != "-") files.push_back(path);
  }
  for (const std::string& path : files) CheckTextFile(path);
  if (!arguments.report.empty()) {
    CheckFolderWritable(PageFolder(arguments.report));
    files.push_back(PagePath(arguments.report));
  }
  CheckDistinct(inputs, files);
  const HeldResults held(files);
  PrintNotes(tasks.front());
  std::FILE* const people = arguments.json == "-" ? stderr : stdout;

  std::atomic<bool>& end_requested = EndOnSignals();
  WorkSettings settings = SettingsOf(arguments, end_requested);
  bool interim = false;  // whether a motion was written
  if (!arguments.out.empty() && !IsDevice(arguments.out)) {
    settings.interim = [&](const PrimitiveFile& file) {
      WriteInterim(file, arguments);
      interim = true;
    };
  }
  TaskResult result = tasks.size() > 1 ? WorkOnGuesses(std::move(tasks), settings)
                                       : WorkOn(std::move(tasks.front()), settings);
  if (arguments.minima > 0) PrintMinima(people, result);
  const auto nothing_more = [&] {
    return interim ? fmt::format("the interim motion in {} stands", arguments.out)
                   : "no file was written";
  };
  const auto drop = [&] {
    fmt::print(stderr, "interrupted: {}; {}\n",
               arguments.keep_best ? "no motion was found so far: " + result.cause
                                   : "what was found so far is dropped (--keep-best keeps a "
                                     "motion that is as asked)",
               nothing_more());
    return ExitStatus::kInterrupted;
  };
  if (result.outcome.interrupted) {
    if (!result.file) return drop();
  } else if (!result.usable) {
    fmt::print(stderr, "no motion was found: {}\n{}\n", result.cause, nothing_more());
    return ExitStatus::kRefused;
  }

  const Window window = LookForWindow(arguments, result);
  const std::string text = ToToml(*result.file);
  ParsePrimitive(text, "the new primitive");  // The text must read back.
  std::optional<ReportData> report;
  if (!arguments.report.empty() && !result.problem().space) report = PageOf(result, window);
  if (end_requested && !arguments.keep_best) return drop();
  IgnoreEndSignals();  // From here on, files are written whole.
  const bool interrupted = end_requested;
  if (interrupted)
    fmt::print(stderr, "interrupted: the best motion so far is kept, as --keep-best asks\n");

  std::string page;
  try {
    page = WriteOutputs(arguments, result, text, report);
  } catch (...) {
    if (interim) fmt::print(stderr, "{}\n", nothing_more());
    throw;
  }

  NoteStandingGuess(arguments, result);
  PrintMotion(people, result);
  fmt::print(people, "{}", window.text);
  if (!arguments.out.empty()) fmt::print(people, "  primitive {}\n", arguments.out);
  if (!page.empty()) fmt::print(people, "  report {}\n", page);
  Flush(people);
  return interrupted ? ExitStatus::kInterrupted : window.status();
}

// The following functions work on several tasks one after the other, and print a table that ranks
// them. The primitive of each task is DIR/NAME.toml, its report REPORT/NAME.

std::string PrimitiveOf(const Task& task, const Arguments& arguments) {
  return (fs::path(arguments.out) / (task.problem.name + ".toml")).string();
}
std::string ReportOf(const Task& task, const Arguments& arguments) {
  return (fs::path(arguments.report) / task.problem.name).string();
}

/// Loads the tasks, and checks that their names can be names of files.
std::vector<Task> LoadSeveral(const Arguments& arguments) {
  std::vector<Task> tasks;
  std::map<std::string, std::string> file_of_name;
  for (const std::string& path : arguments.tasks) {
    const std::string& name = tasks.emplace_back(Load(arguments, path, "")).problem.name;
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
  return tasks;
}

/// Checks before the first task is worked on whether all results can be written. @returns a hold
/// on them.
HeldResults CheckResults(const std::vector<Task>& tasks, const Arguments& arguments) {
  std::vector<std::string> inputs, outputs;
  for (const std::string& folder : {arguments.out, arguments.report}) {
    if (!folder.empty()) CheckFolderWritable(folder);
  }
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    inputs.insert(inputs.end(), {arguments.tasks[i], tasks[i].robot_file});
    if (!arguments.out.empty()) {
      outputs.push_back(PrimitiveOf(tasks[i], arguments));
      if (fs::exists(arguments.out)) CheckWritable(outputs.back());
    }
    if (!arguments.report.empty()) outputs.push_back(ReportOf(tasks[i], arguments) + "/index.html");
  }
  if (!arguments.json.empty() && arguments.json != "-") {
    CheckTextFile(arguments.json);
    outputs.push_back(arguments.json);
  }
  CheckDistinct(inputs, outputs);
  return HeldResults(outputs);
}

/// Writes the primitive and the report of a motion, and prints their names.
/// @returns what came of its window.
ExitStatus WriteMotion(std::FILE* people, TaskResult& result, const Arguments& arguments) {
  const Window window = LookForWindow(arguments, result);
  const std::string text = ToToml(*result.file);
  ParsePrimitive(text, "the new primitive");  // The text must read back.
  PrintMotion(people, result);
  fmt::print(people, "{}", window.text);
  if (!arguments.report.empty()) {
    const std::string where = ReportOf(result.task, arguments);
    fmt::print(people, "  report {}\n",
               result.problem().space ? WriteSpacePage(result, where)
                                      : WriteReport(PageOf(result, window), where));
  }
  if (arguments.out.empty()) return window.status();
  fs::create_directories(arguments.out);
  const std::string path = PrimitiveOf(result.task, arguments);
  PendingFile(path, text).Commit();
  fmt::print(people, "  primitive {}\n", path);
  return window.status();
}

ExitStatus OptimizeSeveral(const Arguments& arguments) {
  if (!arguments.start_from.empty())
    throw std::invalid_argument("--start-from: is for one task; give the tasks one at a time");
  if (!arguments.guesses.empty())
    throw std::invalid_argument("--guess: is for one task; give the tasks one at a time");
  if (!arguments.posterior.empty())
    throw std::invalid_argument("--posterior: is for one task; give the tasks one at a time");
  if (!arguments.complement.empty())
    throw std::invalid_argument("--complement: is for one task; give the tasks one at a time");
  std::vector<Task> tasks = LoadSeveral(arguments);
  const HeldResults held = CheckResults(tasks, arguments);
  for (const Task& task : tasks) PrintNotes(task);
  std::FILE* const people = arguments.json == "-" ? stderr : stdout;

  std::atomic<bool>& end_requested = EndOnSignals();
  std::vector<TaskResult> results;
  ExitStatus windows = ExitStatus::kDone;
  for (Task& task : tasks) {
    if (end_requested) break;
    fmt::print(stderr, "{}\n", task.task_file);
    results.push_back(WorkOn(std::move(task), SettingsOf(arguments, end_requested)));
    if (arguments.minima > 0) PrintMinima(people, results.back());
    if (!results.back().file) continue;
    if (WriteMotion(people, results.back(), arguments) != ExitStatus::kDone)
      windows = ExitStatus::kAmiss;
  }

  const std::vector<const TaskResult*> order = Ranked(results);
  const std::string json = ToJson(order);
  if (arguments.json == "-") {
    fmt::print("{}", json);
  } else if (!arguments.json.empty()) {
    PendingFile(arguments.json, json).Commit();
  }
  PrintRanking(people, order);
  Flush(stdout);
  Flush(people);
  if (end_requested) {
    fmt::print(stderr, "interrupted: {} of {} tasks were worked on\n", results.size(),
               tasks.size());
    return ExitStatus::kInterrupted;
  }
  const bool all_found = std::ranges::all_of(
      results, [](const TaskResult& result) { return result.file.has_value(); });
  return all_found ? windows : ExitStatus::kRefused;
}

ExitStatus Optimize(const Arguments& arguments) {
  if (arguments.guesses.size() > 1 && arguments.posterior.empty()) {
    throw UsageError(
        "--guess",
        "is given more than once, which is for a motion of a robot that was identified; "
        "give one, or --posterior");
  }
  if (!arguments.guesses.empty() && (arguments.minima > 0 || arguments.seed)) {
    throw UsageError("--guess",
                     fmt::format("takes the place of the search that {} is about; leave one out",
                                 arguments.seed ? "--seed" : "--minima"));
  }
  return arguments.tasks.size() == 1 ? OptimizeOne(arguments) : OptimizeSeveral(arguments);
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line("Finds a motion for a task and writes it as a primitive.", "tumbler optimize");
  line.SetFooter(kExitCodes);
  line.Option("TASK", arguments.tasks,
              "Task file (TOML); several are worked on one by one, and ranked")
      .Required();
  line.Option("--start-from", arguments.start_from,
              "Start where this primitive leaves the robot (its simulated exit), not in the "
              "task's own start pose");
  line.Option("--guess", arguments.guesses,
              "Solve from the paths of this primitive, and near them, without a search: of another "
              "task, robot, ground, duration or number of control points; with --posterior it may "
              "be given more than once: they are tried one after the other, until robots stand")
      .TakesOneValueEachTime();
  line.Option("--complement", arguments.complement,
              "Find the motion for the robots on which these primitives fail, which are tried "
              "before it; for tasks with [robust]");
  line.Option(
      "--posterior", arguments.posterior,
      "Find the motion for the robot of this posterior (tumbler identify fit): its URDF and "
      "ground take the place of the task's, and robots that it may be judge the motion, few "
      "and for a short while, since it begins near; for tasks with [robust]");
  line.Option("--out", arguments.out,
              "Write the primitive here; for several tasks the folder, for NAME.toml of each");
  line.Seed(arguments.seed, "Seed of the global search, instead of the task's");
  line.Option("--threads", arguments.threads, "Threads; the result does not depend on it")
      .Within(1, 256)
      .ShowDefault();
  line.Option("--report", arguments.report,
              "Write a page that shows the motion to this file, *.html, or into this folder; for "
              "several tasks into its folder NAME");
  line.Option("--json", arguments.json,
              "Write figures as JSON to this file, or to standard output for -");
  line.Option("--minima", arguments.minima,
              "Solve this many starts to the end, and show a table of all minima found")
      .Within(1, 1000);
  line.Flag(
      "--prove", arguments.prove,
      "Go on until the motion is at a minimum, by the residual of the task, or the solver makes "
      "no progress any more; otherwise only where it takes no longer than the search");
  line.Flag(
      "--window", arguments.window,
      "Find on which ground the model is as asked, for the primitive and the page, as tumbler "
      "robustness --window does; for robots in the plane");
  line.Flag("--keep-best", arguments.keep_best,
            "When interrupted, still write the best motion so far");
  line.Flag("--quiet", arguments.quiet, "No progress: only warnings and what was found");
  line.Parse(argc, argv);
  return Optimize(arguments);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler optimize", argc, argv, tumbler::Main);
}
