// Tasks in Python, and finding motions for them.

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

#include "offline/optimize/task_result.h"
#include "offline/problem/task_toml.h"
#include "offline/rehearsal/python/bindings.h"
#include "offline/rehearsal/python/file_error_parts.h"
#include "offline/rehearsal/python/interruptible.h"
#include "offline/rehearsal/python/loaded_primitive.h"
#include "offline/solver/guess.h"

namespace tumbler {
namespace {

namespace py = pybind11;
using TaskPath = std::filesystem::path;

/// What came of a task.
struct OptimiseOutcome {
  const char* status = "";                     ///< found, not found or interrupted
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
  const std::string name =
      loaded ? asked.cast<const Task&>().task_file : asked.cast<TaskPath>().string();
  Task task;
  if (loaded && !options.start_from) {
    task = asked.cast<const Task&>();
  } else if (options.start_from) {
    const std::string before = options.start_from->string();
    const PrimitiveFile file = Reading(before, LoadPrimitive);
    task = Reading(name, [&](const std::string& p) { return LoadTask(p, file, before); });
  } else {
    task = Reading(name, [](const std::string& p) { return LoadTask(p); });
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

std::vector<std::string> JointNames(const Problem& problem) {
  std::vector<std::string> names;
  for (const ActuatedJoint& joint : problem.joints)
    names.push_back(problem.scene.robot.tree.dofs[static_cast<std::size_t>(joint.dof)].name);
  return names;
}

py::object ValuesOf(const std::string& toml) {
  return py::module_::import("tomllib").attr("loads")(toml);
}

void BindTask(py::module_& module) {
  py::class_<Task, std::shared_ptr<Task>>(module, "Task", "What is asked of a motion.")
      .def_static(
          "load",
          [](const TaskPath& path) {
            return std::make_shared<Task>(
                Reading(path.string(), [](const std::string& p) { return LoadTask(p); }));
          },
          py::arg("path"), "Reads and checks a task file, and its robot. Throws FileError.")
      .def_property_readonly("name", [](const Task& self) { return self.problem.name; })
      .def_property_readonly("duration_s", [](const Task& self) { return self.problem.duration_s; })
      .def_property_readonly("settle_s", [](const Task& self) { return self.problem.settle_s; })
      .def_property_readonly("seed", [](const Task& self) { return self.problem.search.seed; })
      .def_property_readonly(
          "joints", [](const Task& self) { return py::tuple(py::cast(JointNames(self.problem))); },
          "Names of the joints that move, in the order of a motion for the task.")
      .def_property_readonly(
          "parameters", [](const Task& self) { return self.problem.parameter_count(); },
          "How many numbers the motion is searched over.")
      .def_readonly("robot_file", &Task::robot_file)
      .def_readonly("text", &Task::task_text, "The file's text (TOML).")
      .def_property_readonly(
          "values", [](const Task& self) { return ValuesOf(self.task_text); },
          "The keys that the file gives, as nested dictionaries and lists.")
      .def("__repr__", [](const Task& self) { return "<tumbler.Task " + self.problem.name + ">"; });
}

}  // namespace

void BindOptimising(py::module_& module) {
  BindTask(module);
  const py::object namedtuple = py::module_::import("collections").attr("namedtuple");
  module.attr("Progress") =
      namedtuple("Progress", py::make_tuple("stage", "start", "evaluations", "cost", "violation"),
                 py::arg("module") = "tumbler");
  py::class_<OptimiseOutcome>(module, "Outcome", "What came of a task.")
      .def_readonly("status", &OptimiseOutcome::status, "'found', 'not found' or 'interrupted'.")
      .def_readonly("reason", &OptimiseOutcome::reason, "Why there is no motion; else empty.")
      .def_readonly("primitive", &OptimiseOutcome::primitive, "None where there is none.")
      .def_readonly("cost", &OptimiseOutcome::cost, "Of the motion; None where there is none.")
      .def_readonly("evaluations", &OptimiseOutcome::evaluations)
      .def_readonly("wall_s", &OptimiseOutcome::wall_s)
      .def_readonly("cpu_s", &OptimiseOutcome::cpu_s)
      .def("__repr__", [](const OptimiseOutcome& self) {
        return std::string("<tumbler.Outcome ") + self.status + ">";
      });
  module.def(
      "optimise",
      [](const py::object& task, std::optional<std::int64_t> seed, int threads,
         const py::object& progress, bool keep_best, std::optional<TaskPath> start_from,
         std::shared_ptr<LoadedPrimitive> guess) {
        return Optimise(task, {seed, threads, keep_best, std::move(start_from), std::move(guess)},
                        progress);
      },
      py::arg("task"), py::kw_only(), py::arg("seed") = py::none(), py::arg("threads") = 0,
      py::arg("progress") = py::none(), py::arg("keep_best") = false,
      py::arg("start_from") = py::none(), py::arg("guess") = py::none(),
      "Finds a motion for a Task or its file, as tumbler-optimize does. The result depends on task "
      "and\n"
      "seed alone, not on the threads (0: one for each core). `progress` is called with a "
      "Progress\n"
      "after every evaluation, from any thread; when it returns False the search ends, and with\n"
      "`keep_best` the best motion so far is the outcome's. What it raises, and Ctrl-C, end the\n"
      "search and are raised. Throws FileError.");
}

}  // namespace tumbler
