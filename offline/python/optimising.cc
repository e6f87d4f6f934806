// Finding motions for tasks in Python.

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "offline/certify/task_result.h"
#include "offline/problem/task_toml.h"
#include "offline/python/bindings.h"
#include "offline/python/define.h"
#include "offline/python/file_error_parts.h"
#include "offline/python/interruptible.h"
#include "offline/python/loaded_primitive.h"
#include "offline/solve/guess.h"

namespace tumbler {
namespace {

namespace py = pybind11;
using TaskPath = std::filesystem::path;

/// What came of a task.
struct OptimiseOutcome {
  std::string status;                          ///< found, not found or interrupted
  std::string reason;                          ///< Empty where it was found.
  std::shared_ptr<LoadedPrimitive> primitive;  ///< Null where there is none.
  std::optional<double> cost;
  std::int64_t evaluations = 0;
  double wall_s = 0;
  double cpu_s = 0;
};

OptimiseOutcome OutcomeOf(const TaskResult& result) {
  OptimiseOutcome outcome;
  const bool found = result.file.has_value();
  outcome.status = result.outcome.interrupted ? "interrupted" : found ? "found" : "not found";
  if (!found) outcome.reason = result.cause;
  if (found) outcome.primitive = std::make_shared<LoadedPrimitive>(*result.file);
  if (found) outcome.cost = result.best.rollout.cost;
  outcome.evaluations = result.outcome.evaluations;
  outcome.wall_s = result.wall_s;
  outcome.cpu_s = result.cpu_s;
  return outcome;
}

int ThreadsOf(int threads) {
  if (threads < 0 || threads > 256) throw py::value_error("threads: allowed: from 0 ... 256");
  return threads > 0 ? threads
                     : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

struct OptimiseOptions {
  std::optional<std::int64_t> seed;
  int threads = 0;
  bool keep_best = false;
  std::optional<TaskPath> start_from;
  std::shared_ptr<LoadedPrimitive> guess;
};

/// @param asked  a path, or a Task.
Task TaskFor(const py::object& asked, const OptimiseOptions& options) {
  const bool loaded = py::isinstance<Task>(asked);
  std::optional<PrimitiveFile> before;
  const std::string before_name = options.start_from ? options.start_from->string() : "";
  if (options.start_from) before = Reading(before_name, LoadPrimitive);
  Task task;
  if (loaded) {
    task = asked.cast<const Task&>();
    if (before) {
      task = Reading(task.task_file, [&](const std::string& name) {
        return ParseTask(task.task_text, name, task.robot_text, task.robot_file, *before,
                         before_name);
      });
    }
  } else {
    task = Reading(asked.cast<TaskPath>().string(), [&](const std::string& name) {
      return before ? LoadTask(name, *before, before_name)
                    : LoadTask(name, TaskSpaces::kPlaneAndSpace);
    });
  }
  if (options.seed) {
    if (*options.seed < 0) throw py::value_error("seed: allowed: >= 0");
    task.problem.search.seed = static_cast<std::uint64_t>(*options.seed);
  }
  if (options.guess) {
    TakeGuess(task, options.guess->file, std::string(options.guess->file.primitive.name.view()));
  }
  return task;
}

OptimiseOutcome Optimise(const py::object& asked, const OptimiseOptions& options,
                         const py::object& progress) {
  if (options.guess && options.seed)
    throw py::value_error("guess: takes the place of the search that seed is about; leave one out");
  Task task = TaskFor(asked, options);
  ProgressCallback callback(progress);
  WorkSettings settings;
  settings.threads = ThreadsOf(options.threads);
  settings.keep_best = options.keep_best;
  settings.quiet = true;
  OptimiseOutcome outcome = Interruptibly([&](std::atomic<bool>& stop) {
    settings.interrupt = &stop;
    if (callback.wanted()) {
      settings.progress = [&](const Evaluation& e) {
        const bool go_on = callback.Call([&] {
          return py::module_::import("tumbler._native")
              .attr("Progress")(e.global ? "search" : "solve", e.start, e.count, e.cost,
                                e.violation);
        });
        if (!go_on) stop = true;
      };
    }
    return OutcomeOf(WorkOn(std::move(task), settings));
  });
  callback.Rethrow();
  return outcome;
}

/// What pickling keeps of an outcome.
py::tuple StateOfOutcome(const OptimiseOutcome& self) {
  return py::make_tuple(self.status, self.reason, self.primitive, self.cost, self.evaluations,
                        self.wall_s, self.cpu_s);
}

OptimiseOutcome OutcomeOfState(const py::tuple& state) {
  OptimiseOutcome outcome;
  outcome.status = state[0].cast<std::string>();
  outcome.reason = state[1].cast<std::string>();
  outcome.primitive = state[2].cast<std::shared_ptr<LoadedPrimitive>>();
  outcome.cost = state[3].cast<std::optional<double>>();
  outcome.evaluations = state[4].cast<std::int64_t>();
  outcome.wall_s = state[5].cast<double>();
  outcome.cpu_s = state[6].cast<double>();
  return outcome;
}

/// Whether the same came of the same work: how long it took is another matter.
bool SameOutcome(const OptimiseOutcome& a, const OptimiseOutcome& b) {
  const bool same_primitive = a.primitive && b.primitive ? SamePrimitive(*a.primitive, *b.primitive)
                                                         : !a.primitive && !b.primitive;
  return same_primitive && a.status == b.status && a.reason == b.reason && a.cost == b.cost &&
         a.evaluations == b.evaluations;
}

}  // namespace

void BindOptimising(py::module_& module) {
  const py::object namedtuple = py::module_::import("collections").attr("namedtuple");
  module.attr("Progress") =
      namedtuple("Progress", py::make_tuple("stage", "start", "evaluations", "cost", "violation"),
                 py::arg("module") = "tumbler");
  py::class_<OptimiseOutcome>(module, "Outcome",
                              "What came of a task. Outcomes are equal when all but their times "
                              "is.")
      .def_readonly("status", &OptimiseOutcome::status, "'found', 'not found' or 'interrupted'.")
      .def_readonly("reason", &OptimiseOutcome::reason, "Why there is no motion; else empty.")
      .def_readonly("primitive", &OptimiseOutcome::primitive, "None where there is none.")
      .def_readonly("cost", &OptimiseOutcome::cost, "Of the motion; None where there is none.")
      .def_readonly("evaluations", &OptimiseOutcome::evaluations)
      .def_readonly("wall_s", &OptimiseOutcome::wall_s)
      .def_readonly("cpu_s", &OptimiseOutcome::cpu_s)
      .def("__eq__", &SameOutcome, py::is_operator())
      .def(py::pickle(&StateOfOutcome, &OutcomeOfState))
      .def("__repr__",
           [](const OptimiseOutcome& self) { return "<tumbler.Outcome " + self.status + ">"; });
  DefineFunction(
      module, "optimise",
      [](const py::object& task, std::optional<std::int64_t> seed, int threads,
         const py::object& progress, bool keep_best, std::optional<TaskPath> start_from,
         std::shared_ptr<LoadedPrimitive> guess) {
        return Optimise(task, {seed, threads, keep_best, std::move(start_from), std::move(guess)},
                        progress);
      },
      "Finds a motion for a Task or its file, as tumbler optimize does.\n\n"
      "The result depends on task and seed alone, not on the threads (0: one for each core).\n"
      "`progress` is called with a Progress after every evaluation, from any thread; when it\n"
      "returns False the search ends, and with `keep_best` the best motion so far is the\n"
      "outcome's. What it raises, and Ctrl-C, end the search and are raised. `start_from` is the\n"
      "file of a primitive where whose end the motion starts. Throws FileError.",
      py::arg("task"), py::kw_only(), py::arg("seed") = py::none(), py::arg("threads") = 0,
      py::arg("progress") = py::none(), py::arg("keep_best") = false,
      py::arg("start_from") = py::none(), py::arg("guess") = py::none());
}

}  // namespace tumbler
