// Tasks in Python.

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "offline/problem/task_toml.h"
#include "offline/python/bindings.h"
#include "offline/python/define.h"
#include "offline/python/file_error_parts.h"
#include "offline/python/robot_model.h"
#include "offline/studies/toml_edit.h"

namespace tumbler {
namespace {

namespace py = pybind11;
using TaskPath = std::filesystem::path;
using TaskPointer = std::shared_ptr<Task>;

/// @param robot_text  none: that of the file which the task names.
TaskPointer TaskOfText(const std::string& text, const std::string& name,
                       const std::optional<std::string>& robot_text) {
  return std::make_shared<Task>(Reading(name, [&](const std::string& n) {
    return robot_text ? ParseTask(text, n, *robot_text, "robot_text", TaskSpaces::kPlaneAndSpace)
                      : ParseTask(text, n, TaskSpaces::kPlaneAndSpace);
  }));
}

std::vector<std::string> JointNames(const Problem& problem) {
  std::vector<std::string> names;
  for (const ActuatedJoint& joint : problem.joints) names.push_back(problem.name_of(joint));
  return names;
}

py::object ValuesOf(const std::string& toml) {
  return py::module_::import("tomllib").attr("loads")(toml);
}

py::module_ TomlOfPython() { return py::module_::import("tumbler._toml"); }

TaskPointer Replaced(const Task& self, const py::object& changes,
                     const std::optional<std::string>& robot_text, const py::kwargs& keys) {
  const py::dict all(**(changes.is_none() ? py::dict() : py::dict(changes)));
  for (const auto& [key, value] : keys) {
    if (all.contains(key)) {
      throw py::value_error("changes: has the key '" + key.cast<std::string>() +
                            "', which is also given by name; leave one out");
    }
    all[key] = value;
  }
  const auto text =
      TomlOfPython().attr("changed")(self.task_text, self.task_file, all).cast<std::string>();
  if (robot_text || all.contains("robot")) return TaskOfText(text, self.task_file, robot_text);
  return std::make_shared<Task>(Reading(self.task_file, [&](const std::string& name) {
    return ParseTask(text, name, self.robot_as_given, self.robot_file, TaskSpaces::kPlaneAndSpace);
  }));
}

void BindConstructors(py::class_<Task, TaskPointer>& of) {
  DefineStatic(
      of, "load",
      [](const TaskPath& path) {
        return std::make_shared<Task>(Reading(path.string(), [](const std::string& p) {
          return LoadTask(p, TaskSpaces::kPlaneAndSpace);
        }));
      },
      "Reads and checks a task file, and its robot. Throws FileError.", py::arg("path"));
  DefineStatic(
      of, "from_toml", &TaskOfText,
      "Reads and checks the text of a task file. Throws FileError.\n\n"
      "`name` stands for the file in messages, and the path of the robot begins in its folder;\n"
      "`robot_text` (URDF) takes the place of the robot's file.",
      py::arg("text"), py::arg("name") = "task.toml", py::arg("robot_text") = py::none());
  DefineStatic(
      of, "from_values",
      [](const py::object& values, const std::string& name,
         const std::optional<std::string>& robot_text) {
        return TaskOfText(TomlOfPython().attr("dumps")(values).cast<std::string>(), name,
                          robot_text);
      },
      "Makes a task of the keys of its file, as `values` has them. Otherwise as `from_toml`.",
      py::arg("values"), py::arg("name") = "task.toml", py::arg("robot_text") = py::none());
  DefineMethod(
      of, "replace", &Replaced,
      "The same task with other values: of keys by their names, or of `changes` by their paths\n"
      "(`{'contact.mu': 0.4, 'cost.0.weight': 2}`).\n\n"
      "None takes a key away; a dictionary takes the place of a whole table. Where a number takes\n"
      "the place of a number all else of the text stays; otherwise comments are lost. "
      "`robot_text`\n"
      "(URDF) takes the place of the robot. Throws FileError, about lines of the new text.",
      py::arg("changes") = py::none(), py::arg("robot_text") = py::none());
}

}  // namespace

void BindTasks(py::module_& module) {
  py::class_<Task, TaskPointer> of(
      module, "Task",
      "What is asked of a motion. Tasks never change, and are equal when their text and their\n"
      "robot's are.");
  BindConstructors(of);
  of.def_property_readonly("name", [](const Task& self) { return self.problem.name; })
      .def_property_readonly("duration_s", [](const Task& self) { return self.problem.duration_s; })
      .def_property_readonly("settle_s", [](const Task& self) { return self.problem.settle_s; })
      .def_property_readonly("seed", [](const Task& self) { return self.problem.search.seed; })
      .def_property_readonly(
          "joints", [](const Task& self) { return py::tuple(py::cast(JointNames(self.problem))); },
          "Names of the joints that move, in the order of a motion for the task.")
      .def_property_readonly(
          "parameters", [](const Task& self) { return self.problem.parameter_count(); },
          "How many numbers the motion is searched over.")
      .def_readonly("file", &Task::task_file, "The file's name, or what stands for it.")
      .def_readonly("robot_file", &Task::robot_file)
      .def_readonly("text", &Task::task_text, "The file's text (TOML).")
      .def_readonly("robot_text", &Task::robot_text,
                    "The robot's file (URDF), with points for meshes that touch.")
      .def_property_readonly(
          "values", [](const Task& self) { return ValuesOf(self.task_text); },
          "The keys that the file gives, as nested dictionaries and lists.")
      .def_property_readonly(
          "model", [](const TaskPointer& self) { return ModelOf(self); },
          "The robot on its ground, whose equations of motion can be called: a Model, or a\n"
          "SpaceModel of a robot in space.")
      .def("__eq__", &SameTask, py::is_operator())
      .def("__hash__",
           [](const Task& self) {
             return py::hash(py::make_tuple(self.task_text, self.robot_text));
           })
      .def(py::pickle(
          [](const Task& self) {
            return py::make_tuple(self.task_text, self.task_file, self.robot_text, self.robot_file);
          },
          [](const py::tuple& state) {
            const auto text = [&state](std::size_t i) { return state[i].cast<std::string>(); };
            return std::make_shared<Task>(Reading(text(1), [&](const std::string& name) {
              return ParseTask(text(0), name, text(2), text(3), TaskSpaces::kPlaneAndSpace);
            }));
          }))
      .def("__repr__", [](const Task& self) { return "<tumbler.Task " + self.problem.name + ">"; });
  module.def("_with_number", [](const std::string& text, const std::string& name,
                                const std::string& path, double value) {
    return Reading(name, [&](const std::string& n) { return WithNumber(text, n, path, value); });
  });
}

}  // namespace tumbler
