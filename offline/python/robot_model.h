#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <string>
#include <vector>

#include "offline/problem/task_toml.h"
#include "offline/scene/scene.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {

/// Whether two tasks ask for the same: their texts, and those of their robots.
inline bool SameTask(const Task& a, const Task& b) {
  return a.task_text == b.task_text && a.robot_text == b.robot_text;
}

/// A task's robot on its ground, whose equations of motion Python calls with arrays.
///
/// The last dimension of an array has a number for each of `coordinates()`; the others are those of
/// the states, and all arrays of a call are broadcast to the same ones. In space each call also
/// takes the quaternions w, x, y, z from which the root's angles are (RootChart), in a dimension of
/// four; None stands for how the root is turned where the task's motion starts.
template <class Space>
class RobotModelIn {
 public:
  /// @throws std::invalid_argument  about a task whose robot moves in the other space.
  explicit RobotModelIn(std::shared_ptr<const Task> task);

  [[nodiscard]] const Task& task() const { return *task_; }
  [[nodiscard]] std::vector<std::string> coordinates() const;
  [[nodiscard]] std::vector<bool> prescribed() const;
  [[nodiscard]] std::vector<std::string> links() const;
  [[nodiscard]] double mass_kg() const;

  /// What the equations of motion say of each coordinate: its force or torque where its
  /// acceleration is given in `input`, and its acceleration where its force is.
  pybind11::array_t<double> G(const pybind11::object& q, const pybind11::object& qd,
                              const pybind11::object& input, const pybind11::object& quaternion,
                              bool contact);
  /// The derivatives of G by q, qd and input.
  pybind11::object Dg(const pybind11::object& q, const pybind11::object& qd,
                      const pybind11::object& input, const pybind11::object& quaternion,
                      bool contact);
  /// Where the frames of all links are, and how they move.
  pybind11::object Kinematics(const pybind11::object& q, const pybind11::object& qd,
                              const pybind11::object& quaternion);
  /// The contacts that carry force, of all states.
  pybind11::object Contacts(const pybind11::object& q, const pybind11::object& qd,
                            const pybind11::object& quaternion);

 private:
  /// The dynamics with contacts, or without.
  SceneDynamicsIn<Space>& DynamicsOf(bool contact) {
    return contact ? dynamics_ : dynamics_in_the_air_;
  }

  std::shared_ptr<const Task> task_;
  const SceneOf<Space>& scene_;
  SceneOf<Space> in_the_air_;  // the same robot, and nothing that it could touch
  SceneDynamicsIn<Space> dynamics_, dynamics_in_the_air_;
};

using RobotModel = RobotModelIn<Plane>;
using SpaceModel = RobotModelIn<Spatial>;

/// The model of a task's robot, in the plane or in space.
pybind11::object ModelOf(const std::shared_ptr<const Task>& task);

}  // namespace tumbler
