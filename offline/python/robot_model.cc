// The equations of motion of a task's robot in Python.

#include "offline/python/robot_model.h"
#include "common/core/functions.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <stdexcept>
#include <utility>

#include "offline/python/arrays.h"
#include "offline/python/bindings.h"
#include "offline/python/define.h"

namespace tumbler {
namespace {

namespace py = pybind11;
using Lengths = std::vector<py::ssize_t>;
using Rows = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Derivatives = HybridDynamics<Plane>::Derivatives;

/// An argument of a call.
struct Named {
  const char* name;
  const py::object& value;  ///< None stands for zeros.
};

/// Arrays with the same states, one row behind the other.
struct States {
  std::vector<Rows> arrays;
  Lengths shape;  ///< Of the states.
  std::size_t count = 1;

  [[nodiscard]] const double* Row(std::size_t array, std::size_t state, std::size_t n) const {
    return arrays[array].data() + state * n;
  }
  /// The shape of an array that has more dimensions for each state.
  [[nodiscard]] Lengths With(std::initializer_list<std::size_t> more) const {
    Lengths whole = shape;
    for (const std::size_t length : more) whole.push_back(static_cast<py::ssize_t>(length));
    return whole;
  }
};

/// @throws py::value_error  naming the argument.
Rows CheckedRows(const Named& argument, const std::vector<std::string>& coordinates) {
  const auto n = static_cast<py::ssize_t>(coordinates.size());
  if (argument.value.is_none()) {
    return Rows(py::module_::import("numpy").attr("zeros")(n));
  }
  const Rows rows = Rows::ensure(argument.value);
  if (!rows) throw py::error_already_set();
  if (rows.ndim() == 0 || rows.shape(rows.ndim() - 1) != n) {
    throw py::value_error(fmt::format(
        "{}: has the shape {}; allowed: any whose last dimension is {}, for {}", argument.name,
        py::str(rows.attr("shape")).cast<std::string>(), n, fmt::join(coordinates, ", ")));
  }
  for (py::ssize_t i = 0; i < rows.size(); ++i) {
    if (std::isfinite(rows.data()[i])) continue;
    throw py::value_error(fmt::format("{}: has {} for {}; allowed: finite numbers", argument.name,
                                      rows.data()[i],
                                      coordinates[static_cast<std::size_t>(i % n)]));
  }
  return rows;
}

States StatesOf(std::initializer_list<Named> arguments,
                const std::vector<std::string>& coordinates) {
  py::list given;
  for (const Named& argument : arguments) given.append(CheckedRows(argument, coordinates));
  const py::list broadcast = py::module_::import("numpy").attr("broadcast_arrays")(*given);
  States states;
  for (const py::handle array : broadcast)
    states.arrays.push_back(Rows::ensure(py::reinterpret_borrow<py::object>(array)));
  const Rows& first = states.arrays.front();
  states.shape.assign(first.shape(), first.shape() + first.ndim() - 1);
  for (const py::ssize_t length : states.shape) states.count *= static_cast<std::size_t>(length);
  return states;
}

/// Solves the equations of motion in one state of [q, qd, input].
void SolveAt(SceneDynamics& dynamics, const States& states, std::size_t state) {
  const std::size_t n = dynamics.n;
  std::copy_n(states.Row(0, state, n), n, dynamics.q.begin());
  std::copy_n(states.Row(1, state, n), n, dynamics.qd.begin());
  dynamics.tau.fill(0);
  dynamics.qdd.fill(0);
  const double* const input = states.Row(2, state, n);
  for (std::size_t j = 0; j < n; ++j) {
    const bool prescribed = dynamics.dynamics.prescribed(static_cast<int>(j));
    (prescribed ? dynamics.qdd : dynamics.tau)[j] = input[j];
  }
  dynamics.Touch();
  dynamics.Solve();
}

/// Places the robot, and finds its contacts.
void TouchAt(SceneDynamics& dynamics, const States& states, std::size_t state) {
  const std::size_t n = dynamics.n;
  std::copy_n(states.Row(0, state, n), n, dynamics.q.begin());
  std::copy_n(states.Row(1, state, n), n, dynamics.qd.begin());
  dynamics.Touch();
}

/// The pitch of a body, with its whole turns.
double PitchOf(const Tree<Plane>& tree, const SceneDynamics::Numbers& q, int body) {
  double pitch = 0;
  for (int j = body; j >= 0; j = tree.dofs[Index(j)].parent) {
    const Dof<Plane>& dof = tree.dofs[Index(j)];
    if (dof.kind == JointKind::kRevolute) pitch += dof.axis * q[Index(j)];
  }
  return pitch;
}

/// The rows of the links' frames, of all states.
struct LinkRows {
  std::vector<double> position_m, pitch_rad, velocity_m_s, pitch_rate_rad_s;

  void Add(const PlanarRobot& robot, const SceneDynamics& scene, const PlanarLink& link) {
    const Plane::Vector origin(link.origin_m[0], link.origin_m[1]);
    const double turn = link.in_plane ? portable::Atan2(link.x_axis[1], link.x_axis[0])
                                      : std::numeric_limits<double>::quiet_NaN();
    if (link.body < 0) return Add(origin, turn, Plane::Vector::Zero(), 0);
    const HybridDynamics<Plane>& dynamics = scene.dynamics;
    const Plane::Vector at = dynamics.position(link.body) + dynamics.rotation(link.body) * origin;
    const Plane::Motion velocity = dynamics.velocity(link.body);
    Add(at + dynamics.origin(), PitchOf(robot.tree, scene.q, link.body) + turn, velocity.At(at),
        velocity.w);
  }

 private:
  void Add(const Plane::Vector& at, double pitch, const Plane::Vector& velocity, double rate) {
    position_m.insert(position_m.end(), {at.x(), at.y()});
    pitch_rad.push_back(pitch);
    velocity_m_s.insert(velocity_m_s.end(), {velocity.x(), velocity.y()});
    pitch_rate_rad_s.push_back(rate);
  }
};

/// A named tuple of the module.
py::object Tuple(const char* name) { return py::module_::import("tumbler._native").attr(name); }

Scene WithoutGround(Scene scene) {
  scene.obstacles.clear();
  return scene;
}

/// The task, which has to be one in the plane.
std::shared_ptr<const Task> InPlane(std::shared_ptr<const Task> task) {
  if (task->problem.space) {
    throw std::invalid_argument("task: '" + task->problem.name +
                                "' is of a robot in space; a Model is of one in the plane so far");
  }
  return task;
}

}  // namespace

RobotModel::RobotModel(std::shared_ptr<const Task> task)
    : task_(InPlane(std::move(task))),
      in_the_air_(WithoutGround(task_->problem.scene)),
      dynamics_(task_->problem.scene),
      dynamics_in_the_air_(in_the_air_) {}

SceneDynamics& RobotModel::DynamicsOf(bool contact) {
  return contact ? dynamics_ : dynamics_in_the_air_;
}

std::vector<std::string> RobotModel::coordinates() const {
  std::vector<std::string> names;
  for (const Dof<Plane>& dof : task_->problem.scene.robot.tree.dofs) names.push_back(dof.name);
  return names;
}

std::vector<bool> RobotModel::prescribed() const {
  std::vector<bool> prescribed;
  for (const Dof<Plane>& dof : task_->problem.scene.robot.tree.dofs)
    prescribed.push_back(dof.prescribed);
  return prescribed;
}

std::vector<std::string> RobotModel::links() const {
  std::vector<std::string> names;
  for (const PlanarLink& link : task_->problem.scene.robot.links) names.push_back(link.name);
  return names;
}

py::array_t<double> RobotModel::G(const py::object& q, const py::object& qd,
                                  const py::object& input, bool contact) {
  const States states = StatesOf({{"q", q}, {"qd", qd}, {"input", input}}, coordinates());
  SceneDynamics& dynamics = DynamicsOf(contact);
  std::vector<double> output;
  output.reserve(states.count * dynamics.n);
  for (std::size_t i = 0; i < states.count; ++i) {
    SolveAt(dynamics, states, i);
    for (std::size_t j = 0; j < dynamics.n; ++j) {
      const bool prescribed = dynamics.dynamics.prescribed(static_cast<int>(j));
      output.push_back((prescribed ? dynamics.tau : dynamics.qdd)[j]);
    }
  }
  return ArrayOf(std::move(output), states.With({dynamics.n}));
}

py::object RobotModel::Dg(const py::object& q, const py::object& qd, const py::object& input,
                          bool contact) {
  const States states = StatesOf({{"q", q}, {"qd", qd}, {"input", input}}, coordinates());
  SceneDynamics& dynamics = DynamicsOf(contact);
  const std::size_t n = dynamics.n;
  std::vector<double> by_q, by_qd, by_input;
  for (std::vector<double>* block : {&by_q, &by_qd, &by_input})
    block->reserve(states.count * n * n);
  const auto derivatives = std::make_unique<Derivatives>();
  const auto append = [n](const Derivatives::Block& block, std::vector<double>& rows) {
    for (std::size_t i = 0; i < n; ++i)
      rows.insert(rows.end(), block[i].begin(), block[i].begin() + static_cast<std::ptrdiff_t>(n));
  };
  for (std::size_t i = 0; i < states.count; ++i) {
    SolveAt(dynamics, states, i);
    dynamics.Differentiate(*derivatives);
    append(derivatives->q, by_q);
    append(derivatives->qd, by_qd);
    append(derivatives->input, by_input);
  }
  const Lengths shape = states.With({n, n});
  return Tuple("Derivatives")(ArrayOf(std::move(by_q), shape), ArrayOf(std::move(by_qd), shape),
                              ArrayOf(std::move(by_input), shape));
}

py::object RobotModel::Kinematics(const py::object& q, const py::object& qd) {
  const States states = StatesOf({{"q", q}, {"qd", qd}}, coordinates());
  const PlanarRobot& robot = task_->problem.scene.robot;
  LinkRows rows;
  for (std::size_t i = 0; i < states.count; ++i) {
    TouchAt(dynamics_in_the_air_, states, i);
    for (const PlanarLink& link : robot.links) rows.Add(robot, dynamics_in_the_air_, link);
  }
  const std::size_t count = robot.links.size();
  return Tuple("Kinematics")(ArrayOf(std::move(rows.position_m), states.With({count, 2})),
                             ArrayOf(std::move(rows.pitch_rad), states.With({count})),
                             ArrayOf(std::move(rows.velocity_m_s), states.With({count, 2})),
                             ArrayOf(std::move(rows.pitch_rate_rad_s), states.With({count})));
}

py::object RobotModel::Contacts(const py::object& q, const py::object& qd) {
  const States states = StatesOf({{"q", q}, {"qd", qd}}, coordinates());
  const Scene& scene = task_->problem.scene;
  std::vector<std::int64_t> state;
  std::vector<std::string> shape, touches;
  std::vector<double> depth_m, normal_force_n, point_m, force_n, normal;
  const auto append = [](const Plane::Vector& vector, std::vector<double>& rows) {
    rows.insert(rows.end(), {vector.x(), vector.y()});
  };
  for (std::size_t i = 0; i < states.count; ++i) {
    TouchAt(dynamics_, states, i);
    for (const ActiveContact<Plane>& contact : dynamics_.contact->active()) {
      state.push_back(static_cast<std::int64_t>(i));
      shape.push_back(scene.robot.shapes[static_cast<std::size_t>(contact.shape)].name);
      touches.push_back(TouchedName(scene, contact));
      depth_m.push_back(contact.depth_m);
      normal_force_n.push_back(contact.normal_force_n);
      append(contact.point + dynamics_.dynamics.origin(), point_m);
      append(contact.force, force_n);
      append(contact.normal, normal);
    }
  }
  const Lengths vectors = {static_cast<py::ssize_t>(state.size()), 2};
  return Tuple("Contacts")(
      ArrayOf(std::move(state)), TextArray(shape), TextArray(touches), ArrayOf(std::move(depth_m)),
      ArrayOf(std::move(normal_force_n)), ArrayOf(std::move(point_m), vectors),
      ArrayOf(std::move(force_n), vectors), ArrayOf(std::move(normal), vectors));
}

namespace {

void DefineNamedTuple(py::module_& module, const char* name, const py::tuple& fields) {
  module.attr(name) = py::module_::import("collections")
                          .attr("namedtuple")(name, fields, py::arg("module") = "tumbler");
}

void DefineCalls(py::class_<RobotModel, std::shared_ptr<RobotModel>>& of) {
  DefineMethod(
      of, "g", &RobotModel::G,
      "The equations of motion (tau_a, qdd_p) = g(q, qd, qdd_a, tau_p).\n\n"
      "`input` has the acceleration of each prescribed coordinate, and the force or torque on "
      "each\n"
      "free one (without springs and damping); the result has the motor's torque for each "
      "prescribed\n"
      "one, and the acceleration of each free one. None stands for zeros. `contact`: whether the\n"
      "ground pushes. Throws ValueError.",
      py::arg("q"), py::arg("qd") = py::none(), py::arg("input") = py::none(), py::kw_only(),
      py::arg("contact") = true);
  DefineMethod(of, "dg", &RobotModel::Dg,
               "The exact derivatives of g by q, qd and input: matrices of results (rows) and\n"
               "coordinates (columns) for each state. Arguments and errors as of g.",
               py::arg("q"), py::arg("qd") = py::none(), py::arg("input") = py::none(),
               py::kw_only(), py::arg("contact") = true);
  DefineMethod(
      of, "kinematics", &RobotModel::Kinematics,
      "Where the frames of all links are in the world (x, z), and how they move.\n\n"
      "The pitch is positive from +x towards +z, with its whole turns; NaN for a frame whose\n"
      "axes are not in the plane. Throws ValueError.",
      py::arg("q"), py::arg("qd") = py::none());
  DefineMethod(of, "contacts", &RobotModel::Contacts,
               "The contacts that carry force, of all states one behind the other: `state` counts\n"
               "these from 0. Points, forces on the robot and normals are in the world (x, z).\n"
               "Throws ValueError.",
               py::arg("q"), py::arg("qd") = py::none());
}

}  // namespace

void BindModel(py::module_& module) {
  DefineNamedTuple(module, "Derivatives", py::make_tuple("q", "qd", "input"));
  DefineNamedTuple(module, "Kinematics",
                   py::make_tuple("position_m", "pitch_rad", "velocity_m_s", "pitch_rate_rad_s"));
  DefineNamedTuple(module, "Contacts",
                   py::make_tuple("state", "shape", "touches", "depth_m", "normal_force_n",
                                  "point_m", "force_n", "normal"));
  py::class_<RobotModel, std::shared_ptr<RobotModel>> of(
      module, "Model",
      "A task's robot on its ground, in the x-z plane. The last dimension of every array has a\n"
      "number for each of `coordinates`; the others are those of the states, which are broadcast.\n"
      "Models are equal when their tasks are.");
  DefineCalls(of);
  of.def_property_readonly(
        "task", [](const RobotModel& self) { return std::make_shared<Task>(self.task()); })
      .def_property_readonly(
          "coordinates",
          [](const RobotModel& self) { return py::tuple(py::cast(self.coordinates())); },
          "Names of the degrees of freedom: the root's (x, z, pitch), then the joints'.")
      .def_property_readonly(
          "prescribed",
          [](const RobotModel& self) { return py::tuple(py::cast(self.prescribed())); },
          "Whether each has its acceleration given: joints with motors, and what a bar holds.")
      .def_property_readonly(
          "links", [](const RobotModel& self) { return py::tuple(py::cast(self.links())); },
          "Names of the links, in the order of `kinematics`.")
      .def_property_readonly(
          "start", [](const RobotModel& self) { return ArrayOf(self.task().problem.start_q); },
          "Where the task's motion starts [m, rad].")
      .def(
          "__eq__",
          [](const RobotModel& a, const RobotModel& b) { return SameTask(a.task(), b.task()); },
          py::is_operator())
      .def(py::pickle([](const py::object& self) { return py::make_tuple(self.attr("task")); },
                      [](const py::tuple& state) {
                        return std::make_shared<RobotModel>(state[0].cast<std::shared_ptr<Task>>());
                      }))
      .def("__repr__", [](const RobotModel& self) {
        return "<tumbler.Model of " + self.task().problem.name + ">";
      });
}

}  // namespace tumbler
