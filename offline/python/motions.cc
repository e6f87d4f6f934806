// Primitives and sequences in Python.

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/files/primitive_rounding.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/problem/task_toml.h"
#include "offline/python/arrays.h"
#include "offline/python/bindings.h"
#include "offline/python/define.h"
#include "offline/python/file_error_parts.h"
#include "offline/python/loaded_primitive.h"
#include "runtime/assembly/file_keeper.h"

namespace tumbler {

LoadedPrimitive::LoadedPrimitive(PrimitiveFile content) : file(std::move(content)) {
  try {
    runtime = std::make_unique<const Primitive<float>>(ToRuntime(file.primitive));
  } catch (const std::invalid_argument& error) {
    misfit = error.what();
  }
}

bool SamePrimitive(const LoadedPrimitive& a, const LoadedPrimitive& b) {
  return &a == &b || ContentHash(a.file) == ContentHash(b.file);
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

/// How far beyond an end of a motion a time counts as that end, as a share of its duration: times
/// that were rounded to single precision are still in it.
constexpr double kTimeRounding = 1e-7;

/// @throws py::value_error  about the first time that is not in the motion.
void CheckTimes(const py::array_t<double>& times_s, double duration_s) {
  const auto contiguous = py::array_t<double, py::array::c_style | py::array::forcecast>(times_s);
  const double rounding_s = kTimeRounding * duration_s;
  for (py::ssize_t i = 0; i < contiguous.size(); ++i) {
    const double time_s = contiguous.data()[i];
    if (time_s >= -rounding_s && time_s <= duration_s + rounding_s) continue;
    throw py::value_error(
        fmt::format("times_s: number {} is {} s; allowed: from 0 ... {} s, the motion's duration",
                    i, time_s, duration_s));
  }
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
  CheckTimes(times_s, self.file.primitive.duration_s);
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
    static_cast<void>(LoadTask(path, TaskSpaces::kPlaneAndSpace));
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
  std::vector<LoadedFile> texts;  ///< Of the sequence and its primitives, as they were read.
};

LoadedSequence LoadSequenceOf(const std::string& path, const FileReader& source) {
  LoadedSequence loaded;
  FileKeeper keeper;
  loaded.file = LoadSequence(path, keeper.reader(source));
  loaded.texts = keeper.files();
  for (const PrimitiveFile& primitive : loaded.file.primitives)
    loaded.primitives.push_back(std::make_shared<const LoadedPrimitive>(primitive));
  return loaded;
}

/// A sequence from texts that were once read from files.
LoadedSequence SequenceOfTexts(const std::string& path,
                               const std::map<std::string, std::string>& texts) {
  return LoadSequenceOf(path, [&texts](const std::string& file) {
    const auto found = texts.find(file);
    if (found == texts.end()) throw FileError(file, 0, "", "is not among the sequence's texts");
    return found->second;
  });
}

std::map<std::string, std::string> TextsOf(const LoadedSequence& sequence) {
  std::map<std::string, std::string> texts;
  for (const LoadedFile& file : sequence.texts) texts[file.path] = file.text;
  return texts;
}

/// Whether two sequences are the same: their text, and their primitives by name.
bool SameSequence(const LoadedSequence& a, const LoadedSequence& b) {
  return a.texts.front().text == b.texts.front().text &&
         a.file.primitive_names == b.file.primitive_names &&
         std::ranges::equal(a.primitives, b.primitives,
                            [](const auto& p, const auto& q) { return SamePrimitive(*p, *q); });
}

bool SameSpline(const FileSpline& a, const FileSpline& b) {
  return a.degree() == b.degree() && std::ranges::equal(a.knots(), b.knots()) &&
         std::ranges::equal(a.control_points(0), b.control_points(0));
}

bool SameMotion(const JointMotion<double>& a, const JointMotion<double>& b) {
  using Limits = JointLimits<double>;
  for (const auto member :
       {&Limits::position_min_rad, &Limits::position_max_rad, &Limits::velocity_max_rad_s,
        &Limits::acceleration_max_rad_s2, &Limits::torque_max_nm}) {
    if (a.limits.*member != b.limits.*member) return false;
  }
  return a.name.view() == b.name.view() && SameSpline(a.position, b.position) &&
         SameSpline(a.torque, b.torque);
}

/// The joint's place in its primitive.
std::size_t PlaceOf(const JointOf& joint) {
  return static_cast<std::size_t>(joint.motion - joint.owner->file.primitive.motions().data());
}

JointOf JointAt(const std::shared_ptr<LoadedPrimitive>& owner, std::size_t place) {
  const auto motions = owner->file.primitive.motions();
  if (place >= motions.size()) throw py::value_error("joint: is none of the primitive");
  return {owner, &motions[place]};
}

/// What pickling keeps of a spline: its joint, and which of its two it is.
py::tuple StateOfSpline(const SplineOf& self) {
  for (const JointMotion<double>& motion : self.owner->file.primitive.motions()) {
    if (self.spline != &motion.position && self.spline != &motion.torque) continue;
    return py::make_tuple(JointOf{self.owner, &motion}, self.spline == &motion.torque);
  }
  throw std::logic_error("a spline is of no joint");
}

SplineOf SplineOfState(const py::tuple& state) {
  const auto joint = state[0].cast<JointOf>();
  return {joint.owner, state[1].cast<bool>() ? &joint.motion->torque : &joint.motion->position};
}

template <typename Text>
std::string StringOf(const Text& text) {
  return std::string(text.view());
}

void BindSpline(py::module_& module) {
  py::class_<SplineOf> spline(module, "Spline",
                              "A clamped B-spline in the time since the motion began [s].");
  spline.def_property_readonly("degree", [](const SplineOf& self) { return self.spline->degree(); })
      .def_property_readonly(
          "knots_s", [](const SplineOf& self) { return ViewOf(self.spline->knots(), self.owner); },
          "All knots [s], the outer ones as often as the degree says, and once more.")
      .def_property_readonly(
          "control_points", [](const SplineOf& self) { return ControlPoints(self, 0); },
          "Control points, in the unit of the value.")
      .def(
          "__eq__",
          [](const SplineOf& a, const SplineOf& b) { return SameSpline(*a.spline, *b.spline); },
          py::is_operator())
      .def(py::pickle(&StateOfSpline, &SplineOfState))
      .def("__repr__", [](const SplineOf& self) {
        return fmt::format("<tumbler.Spline of degree {}, {} control points>",
                           self.spline->degree(), self.spline->control_points(0).size());
      });
  DefineMethod(spline, "derivative_control_points", &ControlPoints,
               "Control points of derivative 0, 1 or 2; they bound it for all times.",
               py::arg("derivative"));
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
      .def(
          "__eq__",
          [](const JointOf& a, const JointOf& b) { return SameMotion(*a.motion, *b.motion); },
          py::is_operator())
      .def(py::pickle(
          [](const JointOf& self) {
            return py::make_tuple(std::const_pointer_cast<LoadedPrimitive>(self.owner),
                                  PlaceOf(self));
          },
          [](const py::tuple& state) {
            return JointAt(state[0].cast<std::shared_ptr<LoadedPrimitive>>(),
                           state[1].cast<std::size_t>());
          }))
      .def("__repr__", [](const JointOf& self) {
        return "<tumbler.Joint " + StringOf(self.motion->name) + ">";
      });
}

std::shared_ptr<LoadedPrimitive> ParsedPrimitive(const std::string& text, const std::string& name) {
  const auto parse = [&text](const std::string& n) { return ParsePrimitive(text, n); };
  return std::make_shared<LoadedPrimitive>(Reading(name, parse));
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
  py::class_<LoadedPrimitive, std::shared_ptr<LoadedPrimitive>> of(
      module, "Primitive",
      "One motion of the robot's joints, as its file has it. Primitives are equal when their\n"
      "content_hash is.");
  DefineStatic(
      of, "load",
      [](const Path& path) {
        return std::make_shared<LoadedPrimitive>(Reading(path.string(), LoadPrimitive));
      },
      "Reads and checks a primitive file. Throws FileError.", py::arg("path"));
  DefineStatic(of, "parse", &ParsedPrimitive,
               "Reads and checks the text of a primitive file; `name` stands for it in messages.\n"
               "Throws FileError.",
               py::arg("text"), py::arg("name") = "text");
  DefineMethod(
      of, "save",
      [](const LoadedPrimitive& self, const Path& path) {
        // A file of any name: "-" alone would be standard output.
        WriteResult(path == "-" ? "./-" : path.string(), ToToml(self.file));
      },
      "Writes the file whole, or throws and leaves what is there.", py::arg("path"));
  DefineMethod(
      of, "evaluate", &EvaluatePrimitive,
      "Position, velocity, acceleration and feed-forward at times [s]: arrays of the shape of\n"
      "`times_s` with one more dimension for the joints. float64: as the file says; float32: the\n"
      "executor's numbers, bit for bit. Throws ValueError about times outside the motion.",
      py::arg("times_s"), py::arg("dtype") = "float64");
  of.def_property_readonly(
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
          "__eq__",
          [](const LoadedPrimitive& a, const LoadedPrimitive& b) { return SamePrimitive(a, b); },
          py::is_operator())
      .def("__hash__",
           [](const LoadedPrimitive& self) { return py::hash(py::str(ContentHash(self.file))); })
      .def(py::pickle([](const LoadedPrimitive& self) { return py::make_tuple(ToToml(self.file)); },
                      [](const py::tuple& state) {
                        return ParsedPrimitive(state[0].cast<std::string>(), "pickled primitive");
                      }))
      .def("__repr__", [](const LoadedPrimitive& self) {
        return "<tumbler.Primitive " + StringOf(self.file.primitive.name) + ">";
      });
}

void BindSequence(py::module_& module) {
  py::class_<LoadedSequence> of(
      module, "Sequence",
      "Primitives, and how they may follow each other. Sequences are equal when their texts and\n"
      "primitives are.");
  DefineStatic(
      of, "load",
      [](const Path& path) {
        return Reading(path.string(), [](const std::string& p) { return LoadSequenceOf(p, {}); });
      },
      "Reads a sequence file with its primitives, and proves every join. Throws FileError.",
      py::arg("path"));
  of.def_property_readonly(
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
      .def("__eq__", &SameSequence, py::is_operator())
      .def("__hash__",
           [](const LoadedSequence& self) { return py::hash(py::str(self.texts.front().text)); })
      .def(py::pickle(
          [](const LoadedSequence& self) { return py::make_tuple(self.file.path, TextsOf(self)); },
          [](const py::tuple& state) {
            return SequenceOfTexts(state[0].cast<std::string>(),
                                   state[1].cast<std::map<std::string, std::string>>());
          }))
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
  DefineFunction(
      module, "check", [](const Path& path) { return Reading(path.string(), CheckFile); },
      "Reads and checks a primitive, sequence or task, and says which of them it is. Throws\n"
      "FileError.",
      py::arg("path"));
}

}  // namespace tumbler
