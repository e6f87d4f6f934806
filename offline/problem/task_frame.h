#pragma once

#include <span>

#include "common/files/primitive_toml.h"
#include "offline/model/space_vector.h"

namespace tumbler {

/// How far a frame has turned about the vertical from another one: the part about z of the rotation
/// between the two [rad], -pi to pi.
double TurnedAboutVertical(const SpaceMatrix& from, const SpaceMatrix& to);

/// The coordinates of the task of a motion in space, which begins there where its primitive does
/// and with the heading that it has there, wherever the robot is: moved level, and turned about the
/// vertical. The ground is taken for level.
class TaskFrame {
 public:
  /// The world's.
  TaskFrame() = default;
  /// @param entry    of the primitive.
  /// @param x_m, y_m, axes  where the root's frame is in the world as the motion begins.
  TaskFrame(const PrimitivePose& entry, double x_m, double y_m, const SpaceMatrix& axes);

  /// Takes a root from the world into the task.
  /// @param q, qd  of all degrees of freedom, of which the place of the root and its velocity
  ///               change. Its angles are 0, and their rates are about its own axes.
  /// @param axes   of the root.
  void Enter(std::span<double> q, std::span<double> qd, SpaceMatrix& axes) const;

 private:
  SpaceMatrix back_ = SpaceMatrix::Identity();  ///< Turns what the world has into the task.
  SpaceVector began_ = SpaceVector::Zero();     ///< In the world; its height is 0.
  SpaceVector entry_ = SpaceVector::Zero();     ///< Likewise in the task.
};

}  // namespace tumbler
