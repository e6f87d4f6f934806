// Primitives and sequences in Python.

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/primitive_rounding.h"
#include "common/result_file.h"
#include "common/sequence_toml.h"
#include "common/toml_reader.h"
#include "offline/problem/task_toml.h"
#include "offline/rehearsal/python/arrays.h"
#include "offline/rehearsal/python/bindings.h"
#include "offline/rehearsal/python/file_error_parts.h"
#include "offline/rehearsal/python/loaded_primitive.h"

namespace tumbler {

LoadedPrimitive::LoadedPrimitive(PrimitiveFile content) : file(std::move(content)) {
  try {
    runtime = std::make_unique<const Primitive<float>>(ToRuntime(file.primitive));
  } catch (const std::invalid_argument& error) {
    misfit = error.what();
  }
}

namespace {

namespace py = pybind11;
using Path = std::filesystem::path;  // what Python can name a file by

using FileSpline = JointMotion<double>::Spline;

/// A joint's path or feed-forward in a primitive.
struct SplineOf {
  PrimitivePointer owner;
  const FileSpline* spline;
};

/// One joint of a primitive.
struct JointOf {
  PrimitivePointer owner;
  const JointMotion<double>* motion;
};

py::array_t<double> ControlPoints(const SplineOf& self, int derivative) {
  if (derivative < 0 || derivative > FileSpline::kMaxDerivative)
    throw py::value_error("derivative: allowed: from 0 ... 2");
  return ViewOf(self.spline->control_points(derivative), self.owner);
}

std::vector<JointOf> JointsOfPrimitive(const PrimitivePointer& self) {
  std::vector<JointOf> joints;
  for (const JointMotion<double>& motion : self->file.primitive.motions())
    joints.push_back({self, &motion});
  return joints;
}

/// Evaluates paths and feed-forward as the executor does (Executor::PlanRun, at full speed).
template <typename Scalar>
py::object EvaluateAs(const Primitive<Scalar>& primitive, const py::array_t<double>& times_s) {
  using Basis = typename JointMotion<Scalar>::Spline::Basis;
  const auto contiguous = py::array_t<double, py::array::c_style | py::array::forcecast>(times_s);
  const std::span<const double> times(contiguous.data(),
                                      static_cast<std::size_t>(contiguous.size()));
  const auto joints = primitive.motions();
  std::vector<py::ssize_t> shape(times_s.shape(), times_s.shape() + times_s.ndim());
  shape.push_back(static_cast<py::ssize_t>(joints.size()));
  std::vector<Scalar> position, velocity, acceleration, torque;
  for (std::vector<Scalar>* column : {&position, &velocity, &acceleration, &torque})
    column->reserve(times.size() * joints.size());
  std::vector<std::pair<Basis, Basis>> bases(joints.size());  // of path and feed-forward
  for (const double time_s : times) {
    const auto t = static_cast<Scalar>(time_s);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      auto& [of_path, of_torque] = bases[j];
      joints[j].position.EvaluateBasis(t, of_path);
      joints[j].torque.EvaluateBasis(t, of_torque);
      const auto sample = joints[j].position.Evaluate(of_path);
      position.push_back(sample.value);
      velocity.push_back(sample.first);
      acceleration.push_back(sample.second);
      torque.push_back(joints[j].torque.Value(of_torque));
    }
  }
  return py::module_::import("tumbler._native")
      .attr("Evaluation")(ArrayOf(std::move(position), shape), ArrayOf(std::move(velocity), shape),
                          ArrayOf(std::move(acceleration), shape),
                          ArrayOf(std::move(torque), shape));
}

py::object EvaluatePrimitive(const LoadedPrimitive& self, const py::array_t<double>& times_s,
                             const py::object& dtype) {
  const py::dtype wanted = py::dtype::from_args(dtype);
  if (wanted.is(py::dtype::of<double>())) return EvaluateAs(self.file.primitive, times_s);
  if (!wanted.is(py::dtype::of<float>()))
    throw py::value_error("dtype: allowed: float64 (as in the file) and float32 (as executed)");
  if (!self.runtime) throw std::invalid_argument(self.misfit);
  return EvaluateAs(*self.runtime, times_s);
}

/// What the file is: found by its key `format`. @throws FileError
std::string CheckFile(const std::string& path) {
  const std::string format = TomlTable::ParseFile(path).String("format", "");
  if (format == "tumbler-task") {
    static_cast<void>(LoadTask(path));
    return "task";
  }
  const SequenceFile motion = LoadMotion(path);
  static_cast<void>(ToRuntime(motion));
  return format == "tumbler-sequence" ? "sequence" : "primitive";
}

/// A sequence with primitives that can be handed out one by one.
struct LoadedSequence {
  SequenceFile file;
  std::vector<PrimitivePointer> primitives;
};

LoadedSequence LoadSequenceOf(const std::string& path) {
  LoadedSequence loaded;
  loaded.file = LoadSequence(path);
  for (const PrimitiveFile& primitive : loaded.file.primitives)
    loaded.primitives.push_back(std::make_shared<const LoadedPrimitive>(primitive));
  return loaded;
}

template <typename Text>
std::string StringOf(const Text& text) {
  return std::string(text.view());
}

void BindSpline(py::module_& module) {
  py::class_<SplineOf>(module, "Spline",
                       "A clamped B-spline in the time since the motion began [s].")
      .def_property_readonly("degree", [](const SplineOf& self) { return self.spline->degree(); })
      .def_property_readonly(
          "knots_s", [](const SplineOf& self) { return ViewOf(self.spline->knots(), self.owner); },
          "All knots [s], the outer ones as often as the degree says, and once more.")
      .def_property_readonly(
          "control_points", [](const SplineOf& self) { return ControlPoints(self, 0); },
          "Control points, in the unit of the value.")
      .def("derivative_control_points", &ControlPoints, py::arg("derivative"),
           "Control points of derivative 0, 1 or 2; they bound it for all times.");
}

void BindJoint(py::module_& module) {
  const auto limit = [](double JointLimits<double>::*member) {
    return [member](const JointOf& self) { return self.motion->limits.*member; };
  };
  using Limits = JointLimits<double>;
  py::class_<JointOf>(module, "Joint", "The motion of one joint, and its limits.")
      .def_property_readonly("name",
                             [](const JointOf& self) { return StringOf(self.motion->name); })
      .def_property_readonly(
          "position",
          [](const JointOf& self) {
            return SplineOf{self.owner, &self.motion->position};
          },
          "The path [rad].")
      .def_property_readonly(
          "torque",
          [](const JointOf& self) {
            return SplineOf{self.owner, &self.motion->torque};
          },
          "The feed-forward [N m].")
      .def_property_readonly("position_min_rad", limit(&Limits::position_min_rad))
      .def_property_readonly("position_max_rad", limit(&Limits::position_max_rad))
      .def_property_readonly("velocity_max_rad_s", limit(&Limits::velocity_max_rad_s))
      .def_property_readonly("acceleration_max_rad_s2", limit(&Limits::acceleration_max_rad_s2))
      .def_property_readonly("torque_max_nm", limit(&Limits::torque_max_nm))
      .def("__repr__", [](const JointOf& self) {
        return "<tumbler.Joint " + StringOf(self.motion->name) + ">";
      });
}

void BindPrimitive(py::module_& module) {
  const py::object namedtuple = py::module_::import("collections").attr("namedtuple");
  module.attr("Evaluation") = namedtuple(
      "Evaluation",
      py::make_tuple("position_rad", "velocity_rad_s", "acceleration_rad_s2", "torque_nm"),
      py::arg("module") = "tumbler");
  const auto number = [](double Primitive<double>::*member) {
    return [member](const LoadedPrimitive& self) { return self.file.primitive.*member; };
  };
  using Motion = Primitive<double>;
  py::class_<LoadedPrimitive, std::shared_ptr<LoadedPrimitive>>(
      module, "Primitive", "One motion of the robot's joints, as its file has it.")
      .def_static(
          "load",
          [](const Path& path) {
            return std::make_shared<LoadedPrimitive>(Reading(path.string(), LoadPrimitive));
          },
          py::arg("path"), "Reads and checks a primitive file. Throws FileError.")
      .def_static(
          "parse",
          [](const std::string& text, const std::string& name) {
            const auto parse = [&text](const std::string& n) { return ParsePrimitive(text, n); };
            return std::make_shared<LoadedPrimitive>(Reading(name, parse));
          },
          py::arg("text"), py::arg("name") = "text",
          "Reads and checks the text of a primitive file; `name` stands for it in messages.")
      .def_property_readonly(
          "name", [](const LoadedPrimitive& self) { return StringOf(self.file.primitive.name); })
      .def_property_readonly("duration_s", number(&Motion::duration_s))
      .def_property_readonly("settle_s", number(&Motion::settle_s))
      .def_property_readonly("entry_tolerance_rad", number(&Motion::entry_tolerance_rad))
      .def_property_readonly("following_tolerance_rad", number(&Motion::following_tolerance_rad))
      .def_property_readonly(
          "joints",
          [](const std::shared_ptr<LoadedPrimitive>& self) {
            return py::tuple(py::cast(JointsOfPrimitive(self)));
          },
          "In the order of the columns of `evaluate`.")
      .def_property_readonly(
          "content_hash", [](const LoadedPrimitive& self) { return ContentHash(self.file); },
          "Identifies the primitive.")
      .def_property_readonly(
          "maker", [](const LoadedPrimitive& self) { return MakerOf(self.file.provenance); })
      .def_property_readonly(
          "text", [](const LoadedPrimitive& self) { return ToToml(self.file); },
          "The file's text (TOML), certificate and provenance included.")
      .def(
          "save",
          [](const LoadedPrimitive& self, const Path& path) {
            // A file of any name: "-" alone would be standard output.
            WriteResult(path == "-" ? "./-" : path.string(), ToToml(self.file));
          },
          py::arg("path"), "Writes the file whole, or throws and leaves what is there.")
      .def(
          "evaluate", &EvaluatePrimitive, py::arg("times_s"), py::arg("dtype") = "float64",
          "Position, velocity, acceleration and feed-forward at times [s]: arrays of the shape of\n"
          "`times_s` with one more dimension for the joints. float64: as the file says; float32:\n"
          "the executor's numbers, bit for bit. Times before and after the motion count as its\n"
          "ends.")
      .def("__repr__", [](const LoadedPrimitive& self) {
        return "<tumbler.Primitive " + StringOf(self.file.primitive.name) + ">";
      });
}

void BindSequence(py::module_& module) {
  py::class_<LoadedSequence>(module, "Sequence", "Primitives, and how they may follow each other.")
      .def_static(
          "load", [](const Path& path) { return Reading(path.string(), LoadSequenceOf); },
          py::arg("path"),
          "Reads a sequence file with its primitives, and proves every join. Throws "
          "FileError.")
      .def_property_readonly(
          "name", [](const LoadedSequence& self) { return StringOf(self.file.graph.name); })
      .def_property_readonly(
          "primitives",
          [](const LoadedSequence& self) {
            py::dict primitives;
            for (std::size_t i = 0; i < self.primitives.size(); ++i) {
              primitives[py::str(self.file.primitive_names[i])] =
                  std::const_pointer_cast<LoadedPrimitive>(self.primitives[i]);
            }
            return primitives;
          },
          "By their names in the file.")
      .def_property_readonly(
          "nodes",
          [](const LoadedSequence& self) {
            py::dict nodes;
            for (const SequenceNode& node : self.file.graph.nodes()) {
              nodes[py::str(StringOf(node.name))] =
                  self.file.primitive_names[static_cast<std::size_t>(node.primitive)];
            }
            return nodes;
          },
          "The primitive that each node plays, by their names.")
      .def_property_readonly(
          "edges",
          [](const LoadedSequence& self) {
            const auto& graph = self.file.graph;
            py::list edges;
            for (const auto& edge : graph.edges()) {
              // After a fall there may be another node in the place of an edge's.
              for (const int to : {edge.to, graph.node(edge.to).after_fall}) {
                if (to < 0) continue;
                edges.append(py::make_tuple(StringOf(graph.node(edge.from).name),
                                            StringOf(graph.node(to).name)));
              }
            }
            return py::tuple(edges);
          },
          "Pairs of nodes that may follow each other.")
      .def_property_readonly(
          "start",
          [](const LoadedSequence& self) {
            return StringOf(self.file.graph.node(self.file.graph.start).name);
          },
          "The first node.")
      .def_property_readonly(
          "branches",
          [](const LoadedSequence& self) {
            return py::tuple(py::cast(BranchNames(self.file.graph)));
          },
          "Names of the branches that can be asked for.")
      .def("__repr__", [](const LoadedSequence& self) {
        return "<tumbler.Sequence " + StringOf(self.file.graph.name) + ">";
      });
}

}  // namespace

void BindMotions(py::module_& module) {
  BindSpline(module);
  BindJoint(module);
  BindPrimitive(module);
  BindSequence(module);
  module.def(
      "check", [](const Path& path) { return Reading(path.string(), CheckFile); }, py::arg("path"),
      "Reads and checks a primitive, sequence or task, and says which of them it is. Throws "
      "FileError.");
}

}  // namespace tumbler
