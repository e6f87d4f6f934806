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
#include <type_traits>
#include <utility>

#include "offline/python/arrays.h"
#include "offline/python/bindings.h"
#include "offline/python/define.h"
#include "offline/scene/quaternion.h"
#include "offline/solve/start_state.h"

namespace tumbler {
namespace {

namespace py = pybind11;
using Lengths = std::vector<py::ssize_t>;
using Rows = py::array_t<double, py::array::c_style | py::array::forcecast>;

template <class Space>
constexpr bool kInPlane = std::is_same_v<Space, Plane>;

/// An argument of a call.
struct Named {
  const char* name;
  const py::object& value;
  const std::vector<std::string>& columns;  ///< What the last dimension has.
  std::vector<double> none = {};            ///< What None stands for; empty: zeros.
};

/// Arrays with the same states, one row behind the other.
struct States {
  std::vector<Rows> arrays;
  Lengths shape;  ///< Of the states.
  std::size_t count = 1;

  [[nodiscard]] const double* Row(std::size_t array, std::size_t state) const {
    const Rows& rows = arrays[array];
    return rows.data() + state * static_cast<std::size_t>(rows.shape(rows.ndim() - 1));
  }
  /// The shape of an array that has more dimensions for each state.
  [[nodiscard]] Lengths With(std::initializer_list<std::size_t> more) const {
    Lengths whole = shape;
    for (const std::size_t length : more) whole.push_back(static_cast<py::ssize_t>(length));
    return whole;
  }
};

/// @throws py::value_error  naming the argument.
Rows CheckedRows(const Named& argument) {
  const auto n = static_cast<py::ssize_t>(argument.columns.size());
  if (argument.value.is_none()) {
    if (argument.none.empty()) return Rows(py::module_::import("numpy").attr("zeros")(n));
    return Rows(n, argument.none.data());
  }
  const Rows rows = Rows::ensure(argument.value);
  if (!rows) throw py::error_already_set();
  if (rows.ndim() == 0 || rows.shape(rows.ndim() - 1) != n) {
    throw py::value_error(fmt::format(
        "{}: has the shape {}; allowed: any whose last dimension is {}, for {}", argument.name,
        py::str(rows.attr("shape")).cast<std::string>(), n, fmt::join(argument.columns, ", ")));
  }
  for (py::ssize_t i = 0; i < rows.size(); ++i) {
    if (std::isfinite(rows.data()[i])) continue;
    throw py::value_error(fmt::format("{}: has {} for {}; allowed: finite numbers", argument.name,
                                      rows.data()[i],
                                      argument.columns[static_cast<std::size_t>(i % n)]));
  }
  return rows;
}

States StatesOf(const std::vector<Named>& arguments) {
  States states;
  std::vector<Rows> given;
  py::list shapes;
  for (const Named& argument : arguments) {
    const Rows& rows = given.emplace_back(CheckedRows(argument));
    shapes.append(py::tuple(py::cast(Lengths(rows.shape(), rows.shape() + rows.ndim() - 1))));
  }
  const py::module_ numpy = py::module_::import("numpy");
  states.shape = numpy.attr("broadcast_shapes")(*shapes).cast<Lengths>();
  for (const py::ssize_t length : states.shape) states.count *= static_cast<std::size_t>(length);
  for (const Rows& rows : given) {
    Lengths whole = states.shape;
    whole.push_back(rows.shape(rows.ndim() - 1));
    states.arrays.push_back(
        Rows::ensure(numpy.attr("broadcast_to")(rows, py::tuple(py::cast(whole)))));
  }
  return states;
}

const std::vector<std::string> kQuaternionParts = {"w", "x", "y", "z"};

/// The arguments q, qd and others of a call, and in space the quaternion, which comes last.
template <class Space>
States StatesIn(const Task& task, const std::vector<Named>& arguments,
                const py::object& quaternion) {
  if constexpr (kInPlane<Space>) {
    return StatesOf(arguments);
  } else {
    const Quaternion start = ToQuaternion(task.problem.space->start_orientation);
    std::vector<Named> all = arguments;
    all.push_back({"quaternion", quaternion, kQuaternionParts, {start.begin(), start.end()}});
    return StatesOf(all);
  }
}

/// Places the robot in one state, of which q and qd come first.
/// @throws py::value_error  about a quaternion that is none of a rotation.
template <class Space>
void TouchAt(SceneDynamicsIn<Space>& dynamics, const States& states, std::size_t state) {
  std::copy_n(states.Row(0, state), dynamics.n, dynamics.q.begin());
  std::copy_n(states.Row(1, state), dynamics.n, dynamics.qd.begin());
  if constexpr (!kInPlane<Space>) {
    const double* const row = states.Row(states.arrays.size() - 1, state);
    Quaternion turned = {row[0], row[1], row[2], row[3]};
    double square = 0;
    for (const double part : turned) square += part * part;
    const double length = std::sqrt(square);
    if (!(std::abs(length - 1) <= 1e-3)) {
      throw py::value_error(fmt::format(
          "quaternion: has the length {:.6g}; allowed: a unit quaternion w, x, y, z", length));
    }
    for (double& part : turned) part /= length;
    RootChart<Spatial> chart;
    chart.axes = ToRotation(turned);
    dynamics.Use(chart);
  }
  dynamics.Touch();
}

/// Solves the equations of motion in one state of [q, qd, input].
template <class Space>
void SolveAt(SceneDynamicsIn<Space>& dynamics, const States& states, std::size_t state) {
  dynamics.tau.fill(0);
  dynamics.qdd.fill(0);
  const double* const input = states.Row(2, state);
  for (std::size_t j = 0; j < dynamics.n; ++j) {
    const bool prescribed = dynamics.dynamics.prescribed(static_cast<int>(j));
    (prescribed ? dynamics.qdd : dynamics.tau)[j] = input[j];
  }
  TouchAt(dynamics, states, state);
  dynamics.Solve();
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

/// The numbers of a vector behind others.
void Append(const Plane::Vector& vector, std::vector<double>& rows) {
  rows.insert(rows.end(), {vector.x(), vector.y()});
}
void Append(const SpaceVector& vector, std::vector<double>& rows) {
  rows.insert(rows.end(), {vector.x(), vector.y(), vector.z()});
}

/// The rows of the links' frames, of all states. How a frame is turned is a pitch, or a quaternion.
template <class Space>
struct LinkRows {
  std::vector<double> position_m, turned, velocity_m_s, rate_rad_s;

  void Add(const PlanarRobot& robot, const SceneDynamics& scene, const PlanarLink& link) {
    const Plane::Vector origin(link.origin_m[0], link.origin_m[1]);
    const double turn = link.in_plane ? portable::Atan2(link.x_axis[1], link.x_axis[0])
                                      : std::numeric_limits<double>::quiet_NaN();
    if (link.body < 0) {
      Add(origin, Plane::Vector::Zero());
      turned.push_back(turn);
      rate_rad_s.push_back(0);
      return;
    }
    const HybridDynamics<Plane>& dynamics = scene.dynamics;
    const Plane::Vector at = dynamics.position(link.body) + dynamics.rotation(link.body) * origin;
    const Plane::Motion velocity = dynamics.velocity(link.body);
    Add(at + dynamics.origin(), velocity.At(at));
    turned.push_back(PitchOf(robot.tree, scene.q, link.body) + turn);
    rate_rad_s.push_back(velocity.w);
  }
  void Add(const SpaceRobot& /*robot*/, const SpaceDynamics& scene, const RobotLink& link) {
    const HybridDynamics<Spatial>& dynamics = scene.dynamics;
    const SpaceMatrix& body = dynamics.rotation(link.body).m;
    const SpaceVector at = dynamics.position(link.body) + body * link.pose.translation;
    const Spatial::Motion velocity = dynamics.velocity(link.body);
    Add(at + dynamics.origin(), velocity.At(at));
    for (const double part : ToQuaternion(body * link.pose.rotation)) turned.push_back(part);
    Append(velocity.w, rate_rad_s);
  }

 private:
  void Add(const typename Space::Vector& at, const typename Space::Vector& velocity) {
    Append(at, position_m);
    Append(velocity, velocity_m_s);
  }
};

/// A named tuple of the module.
py::object Tuple(const char* name) { return py::module_::import("tumbler._native").attr(name); }

template <class SceneKind>
SceneKind WithoutGround(SceneKind scene) {
  scene.obstacles.clear();
  return scene;
}

/// The task, which has to be one of this space.
template <class Space>
std::shared_ptr<const Task> Checked(std::shared_ptr<const Task> task) {
  if (task->problem.space.has_value() == kInPlane<Space>) {
    throw std::invalid_argument(fmt::format(
        "task: '{}' is of a robot in {}", task->problem.name,
        kInPlane<Space> ? "space; its model is a SpaceModel" : "the plane; its model is a Model"));
  }
  return task;
}

}  // namespace

template <class Space>
RobotModelIn<Space>::RobotModelIn(std::shared_ptr<const Task> task)
    : task_(Checked<Space>(std::move(task))),
      scene_(SceneIn<Space>(task_->problem)),
      in_the_air_(WithoutGround(scene_)),
      dynamics_(scene_),
      dynamics_in_the_air_(in_the_air_) {}

template <class Space>
std::vector<std::string> RobotModelIn<Space>::coordinates() const {
  std::vector<std::string> names;
  for (const Dof<Space>& dof : scene_.robot.tree.dofs) names.push_back(dof.name);
  return names;
}

template <class Space>
std::vector<bool> RobotModelIn<Space>::prescribed() const {
  std::vector<bool> prescribed;
  for (const Dof<Space>& dof : scene_.robot.tree.dofs) prescribed.push_back(dof.prescribed);
  return prescribed;
}

template <class Space>
std::vector<std::string> RobotModelIn<Space>::links() const {
  std::vector<std::string> names;
  for (const auto& link : scene_.robot.links) names.push_back(link.name);
  return names;
}

template <class Space>
double RobotModelIn<Space>::mass_kg() const {
  double mass = 0;
  for (const Dof<Space>& dof : scene_.robot.tree.dofs) mass += dof.mass_kg;
  return mass;
}

template <class Space>
py::array_t<double> RobotModelIn<Space>::G(const py::object& q, const py::object& qd,
                                           const py::object& input, const py::object& quaternion,
                                           bool contact) {
  const std::vector<std::string> names = coordinates();
  const States states = StatesIn<Space>(
      *task_, {{"q", q, names}, {"qd", qd, names}, {"input", input, names}}, quaternion);
  SceneDynamicsIn<Space>& dynamics = DynamicsOf(contact);
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

template <class Space>
py::object RobotModelIn<Space>::Dg(const py::object& q, const py::object& qd,
                                   const py::object& input, const py::object& quaternion,
                                   bool contact) {
  using Derivatives = typename HybridDynamics<Space>::Derivatives;
  const std::vector<std::string> names = coordinates();
  const States states = StatesIn<Space>(
      *task_, {{"q", q, names}, {"qd", qd, names}, {"input", input, names}}, quaternion);
  SceneDynamicsIn<Space>& dynamics = DynamicsOf(contact);
  const std::size_t n = dynamics.n;
  std::vector<double> by_q, by_qd, by_input;
  for (std::vector<double>* block : {&by_q, &by_qd, &by_input})
    block->reserve(states.count * n * n);
  const auto derivatives = std::make_unique<Derivatives>();
  const auto append = [n](const typename Derivatives::Block& block, std::vector<double>& rows) {
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

template <class Space>
py::object RobotModelIn<Space>::Kinematics(const py::object& q, const py::object& qd,
                                           const py::object& quaternion) {
  const std::vector<std::string> names = coordinates();
  const States states = StatesIn<Space>(*task_, {{"q", q, names}, {"qd", qd, names}}, quaternion);
  LinkRows<Space> rows;
  for (std::size_t i = 0; i < states.count; ++i) {
    TouchAt(dynamics_in_the_air_, states, i);
    for (const auto& link : scene_.robot.links) rows.Add(scene_.robot, dynamics_in_the_air_, link);
  }
  const std::size_t count = scene_.robot.links.size();
  constexpr bool kPlanar = kInPlane<Space>;
  const Lengths vectors = states.With({count, kPlanar ? std::size_t{2} : std::size_t{3}});
  return Tuple(kPlanar ? "Kinematics" : "SpaceKinematics")(
      ArrayOf(std::move(rows.position_m), vectors),
      ArrayOf(std::move(rows.turned), kPlanar ? states.With({count}) : states.With({count, 4})),
      ArrayOf(std::move(rows.velocity_m_s), vectors),
      ArrayOf(std::move(rows.rate_rad_s), kPlanar ? states.With({count}) : vectors));
}

template <class Space>
py::object RobotModelIn<Space>::Contacts(const py::object& q, const py::object& qd,
                                         const py::object& quaternion) {
  const std::vector<std::string> names = coordinates();
  const States states = StatesIn<Space>(*task_, {{"q", q, names}, {"qd", qd, names}}, quaternion);
  std::vector<std::int64_t> state;
  std::vector<std::string> shape, touches;
  std::vector<double> depth_m, normal_force_n, point_m, force_n, normal;
  for (std::size_t i = 0; i < states.count; ++i) {
    TouchAt(dynamics_, states, i);
    for (const ActiveContact<Space>& contact : dynamics_.contact->active()) {
      state.push_back(static_cast<std::int64_t>(i));
      shape.push_back(scene_.robot.shapes[static_cast<std::size_t>(contact.shape)].name);
      touches.push_back(TouchedName(scene_, contact));
      depth_m.push_back(contact.depth_m);
      normal_force_n.push_back(contact.normal_force_n);
      Append(contact.point + dynamics_.dynamics.origin(), point_m);
      Append(contact.force, force_n);
      Append(contact.normal, normal);
    }
  }
  const Lengths vectors = {static_cast<py::ssize_t>(state.size()), kInPlane<Space> ? 2 : 3};
  return Tuple("Contacts")(
      ArrayOf(std::move(state)), TextArray(shape), TextArray(touches), ArrayOf(std::move(depth_m)),
      ArrayOf(std::move(normal_force_n)), ArrayOf(std::move(point_m), vectors),
      ArrayOf(std::move(force_n), vectors), ArrayOf(std::move(normal), vectors));
}

template class RobotModelIn<Plane>;
template class RobotModelIn<Spatial>;

py::object ModelOf(const std::shared_ptr<const Task>& task) {
  if (task->problem.space) return py::cast(std::make_shared<SpaceModel>(task));
  return py::cast(std::make_shared<RobotModel>(task));
}

namespace {

void DefineNamedTuple(py::module_& module, const char* name, const py::tuple& fields) {
  module.attr(name) = py::module_::import("collections")
                          .attr("namedtuple")(name, fields, py::arg("module") = "tumbler");
}

constexpr const char* kOfG =
    "The equations of motion (tau_a, qdd_p) = g(q, qd, qdd_a, tau_p).\n\n"
    "`input` has the acceleration of each prescribed coordinate, and the force or torque on "
    "each\n"
    "free one (without springs and damping); the result has the motor's torque for each "
    "prescribed\n"
    "one, and the acceleration of each free one. None stands for zeros. `contact`: whether the\n"
    "ground pushes. Throws ValueError.";
constexpr const char* kOfDg =
    "The exact derivatives of g by q, qd and input: matrices of results (rows) and\n"
    "coordinates (columns) for each state. Arguments and errors as of g.";

void DefineCalls(py::class_<RobotModel, std::shared_ptr<RobotModel>>& of) {
  DefineMethod(
      of, "g",
      [](RobotModel& self, const py::object& q, const py::object& qd, const py::object& input,
         bool contact) { return self.G(q, qd, input, py::none(), contact); },
      kOfG, py::arg("q"), py::arg("qd") = py::none(), py::arg("input") = py::none(), py::kw_only(),
      py::arg("contact") = true);
  DefineMethod(
      of, "dg",
      [](RobotModel& self, const py::object& q, const py::object& qd, const py::object& input,
         bool contact) { return self.Dg(q, qd, input, py::none(), contact); },
      kOfDg, py::arg("q"), py::arg("qd") = py::none(), py::arg("input") = py::none(), py::kw_only(),
      py::arg("contact") = true);
  DefineMethod(
      of, "kinematics",
      [](RobotModel& self, const py::object& q, const py::object& qd) {
        return self.Kinematics(q, qd, py::none());
      },
      "Where the frames of all links are in the world (x, z), and how they move.\n\n"
      "The pitch is positive from +x towards +z, with its whole turns; NaN for a frame whose\n"
      "axes are not in the plane. Throws ValueError.",
      py::arg("q"), py::arg("qd") = py::none());
  DefineMethod(
      of, "contacts",
      [](RobotModel& self, const py::object& q, const py::object& qd) {
        return self.Contacts(q, qd, py::none());
      },
      "The contacts that carry force, of all states one behind the other: `state` counts\n"
      "these from 0. Points, forces on the robot and normals are in the world (x, z).\n"
      "Throws ValueError.",
      py::arg("q"), py::arg("qd") = py::none());
}

void DefineCalls(py::class_<SpaceModel, std::shared_ptr<SpaceModel>>& of) {
  DefineMethod(of, "g", &SpaceModel::G, kOfG, py::arg("q"), py::arg("qd") = py::none(),
               py::arg("input") = py::none(), py::kw_only(), py::arg("quaternion") = py::none(),
               py::arg("contact") = true);
  DefineMethod(of, "dg", &SpaceModel::Dg, kOfDg, py::arg("q"), py::arg("qd") = py::none(),
               py::arg("input") = py::none(), py::kw_only(), py::arg("quaternion") = py::none(),
               py::arg("contact") = true);
  DefineMethod(
      of, "kinematics", &SpaceModel::Kinematics,
      "Where the frames of all links are in the world, how they are turned (w, x, y, z), and\n"
      "how they move: velocities and angular velocities are in the world's axes, too. Throws\n"
      "ValueError.",
      py::arg("q"), py::arg("qd") = py::none(), py::kw_only(), py::arg("quaternion") = py::none());
  DefineMethod(
      of, "contacts", &SpaceModel::Contacts,
      "The contacts that carry force, of all states one behind the other: `state` counts\n"
      "these from 0. Points, forces on the robot and normals are in the world. Throws ValueError.",
      py::arg("q"), py::arg("qd") = py::none(), py::kw_only(), py::arg("quaternion") = py::none());
}

template <class Space>
py::class_<RobotModelIn<Space>, std::shared_ptr<RobotModelIn<Space>>> DefineModel(
    py::module_& module, const char* name, const char* meaning, const char* coordinates) {
  using Model = RobotModelIn<Space>;
  py::class_<Model, std::shared_ptr<Model>> of(module, name, meaning);
  DefineCalls(of);
  of.def_property_readonly("task",
                           [](const Model& self) { return std::make_shared<Task>(self.task()); })
      .def_property_readonly(
          "coordinates", [](const Model& self) { return py::tuple(py::cast(self.coordinates())); },
          coordinates)
      .def_property_readonly(
          "prescribed", [](const Model& self) { return py::tuple(py::cast(self.prescribed())); },
          "Whether each has its acceleration given: joints with motors, and what a bar holds.")
      .def_property_readonly(
          "links", [](const Model& self) { return py::tuple(py::cast(self.links())); },
          "Names of the links, in the order of `kinematics`.")
      .def_property_readonly("mass_kg", &Model::mass_kg, "Of the whole robot.")
      .def_property_readonly(
          "start", [](const Model& self) { return ArrayOf(self.task().problem.start_q); },
          "Where the task's motion starts [m, rad].")
      .def(
          "__eq__", [](const Model& a, const Model& b) { return SameTask(a.task(), b.task()); },
          py::is_operator())
      .def(py::pickle([](const py::object& self) { return py::make_tuple(self.attr("task")); },
                      [](const py::tuple& state) {
                        return std::make_shared<Model>(state[0].cast<std::shared_ptr<Task>>());
                      }))
      .def("__repr__", [name](const Model& self) {
        return fmt::format("<tumbler.{} of {}>", name, self.task().problem.name);
      });
  return of;
}

}  // namespace

void BindModel(py::module_& module) {
  DefineNamedTuple(module, "Derivatives", py::make_tuple("q", "qd", "input"));
  DefineNamedTuple(module, "Kinematics",
                   py::make_tuple("position_m", "pitch_rad", "velocity_m_s", "pitch_rate_rad_s"));
  DefineNamedTuple(
      module, "SpaceKinematics",
      py::make_tuple("position_m", "quaternion", "velocity_m_s", "angular_velocity_rad_s"));
  DefineNamedTuple(module, "Contacts",
                   py::make_tuple("state", "shape", "touches", "depth_m", "normal_force_n",
                                  "point_m", "force_n", "normal"));
  DefineModel<Plane>(
      module, "Model",
      "A task's robot on its ground, in the x-z plane. The last dimension of every array has a\n"
      "number for each of `coordinates`; the others are those of the states, which are broadcast.\n"
      "Models are equal when their tasks are.",
      "Names of the degrees of freedom: the root's (x, z, pitch), then the joints'.");
  DefineModel<Spatial>(
      module, "SpaceModel",
      "A task's robot on its ground, in space. The last dimension of every array has a number for\n"
      "each of `coordinates`; the others are those of the states, which are broadcast. The root's\n"
      "angles are from a `quaternion` w, x, y, z of each call, a pitch about -y, a roll about the\n"
      "turned x and a yaw about the turned z, with a singularity at a roll of a right angle: "
      "where\n"
      "they are 0 their rates are the root's angular velocity about its own -y, x and z. Without\n"
      "it they are from how the root is turned where the motion starts. Models are equal when\n"
      "their tasks are.",
      "Names of the degrees of freedom: the root's (x, y, z, pitch, roll, yaw), then the joints'.")
      .def_property_readonly(
          "start_quaternion",
          [](const SpaceModel& self) {
            const Quaternion q = ToQuaternion(self.task().problem.space->start_orientation);
            return ArrayOf(std::vector<double>(q.begin(), q.end()));
          },
          "How the root is turned where the task's motion starts: w, x, y, z. The angles of "
          "`start`\n"
          "are 0.");
}

}  // namespace tumbler
