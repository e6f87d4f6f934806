#pragma once

#include <array>
#include <cstddef>

#include "common/core/capacity.h"
#include "offline/model/contact_law.h"
#include "offline/scene/lane_robot.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/space_scene.h"

namespace tumbler {

/// What all robots of a simulation in lanes in space share, as LaneModel in the plane: how many
/// bodies, which carries which, and about which axes they turn.
struct SpaceLaneModel {
  static constexpr std::size_t kMaxJoints = LaneModel::kMaxJoints;
  static constexpr std::size_t kMaxBodies = LaneModel::kMaxBodies;
  /// x, y, z, pitch, roll and yaw of the root, the angles in its chart (RootChart).
  static constexpr std::size_t kRootDofs = 6;
  static constexpr std::size_t kMaxDofs = kMaxJoints + kRootDofs;
  static constexpr std::size_t kMaxPoints = 32;
  static constexpr std::size_t kMaxGrounds = LaneModel::kMaxGrounds;

  /// The joint i moves body i + 1. Its degree of freedom is 6 + i.
  std::size_t joints = 0;
  std::array<std::size_t, kMaxBodies> parent{};  ///< Body that carries a body; of the root: itself.
  /// Of joints: unit vectors in the frames of both bodies that they join.
  std::array<std::array<double, 3>, kMaxBodies> axis{};
  std::size_t points = 0;  ///< Contact points, each with a radius, one body's after the other's.
  /// The first point of each body or of the next that has one, and behind them `points`.
  std::array<std::size_t, kMaxBodies + 1> first_point{};
  std::size_t grounds = 0;  ///< Half-spaces.
  ContactSmoothing smoothing = ContactSmoothing::kCubic;
  ContactDamping damping_law = ContactDamping::kNoPull;
};

/// Everything in which robots of a simulation in lanes in space can differ, as LaneRobot in the
/// plane. SI units. All members are S.
template <class S>
struct SpaceLaneRobot {
  using Triple = std::array<S, 3>;  ///< x, y, z
  struct Body {
    Triple offset;  ///< Origin of the frame in the parent's at q = 0 [m].
    S mass;
    Triple centre;  ///< Of mass, in the body's frame [m].
    /// About the centre of mass, in the body's frame: xx, yy, zz, xy, xz, yz.
    std::array<S, 6> inertia;
  };
  using Joint = LaneJoint<S>;
  struct Point {
    Triple at;  ///< In the body's frame [m].
    S radius;
  };
  struct Ground {
    Triple normal;
    S distance;  ///< normal . p = distance on the surface.
  };
  Triple gravity;
  Triple push;  ///< A force on the root's origin, where joints are driven [N].
  S stiffness, damping, mu, v_max, d_on, d_off;  ///< As in ContactLaw.
  S stop_stiffness, stop_damping;
  std::array<Body, SpaceLaneModel::kMaxBodies> bodies;
  std::array<Joint, SpaceLaneModel::kMaxJoints> joints;
  std::array<Point, SpaceLaneModel::kMaxPoints> points;
  std::array<Ground, SpaceLaneModel::kMaxGrounds> grounds;
};

/// Positions and velocities of robots in space: those of the root, then the joints, and the axes in
/// which the root's angles are zero (RootChart), by rows.
template <class S>
struct SpaceLaneState {
  std::array<S, SpaceLaneModel::kMaxDofs> q;
  std::array<S, SpaceLaneModel::kMaxDofs> v;
  std::array<S, 9> axes;
};

/// The axes of the root.
inline void SetAxes(const SpaceMatrix& axes, SpaceLaneState<double>& state) {
  for (int i = 0; i < 9; ++i) state.axes[static_cast<std::size_t>(i)] = axes(i / 3, i % 3);
}
inline SpaceMatrix AxesOf(const SpaceLaneState<Packet>& state, std::size_t lane) {
  SpaceMatrix axes;
  for (int i = 0; i < 9; ++i)
    axes(i / 3, i % 3) = state.axes[static_cast<std::size_t>(i)].lane(lane);
  return axes;
}

/// A robot in space with its ground, as lanes have it.
struct SpaceLaneScene {
  SpaceLaneModel model;
  SpaceLaneRobot<double> robot{};
};

/// The scene of a task in space in lanes. Boxes and capsules touch half-spaces with their vertices.
/// @param drive  of every joint.
/// @throws std::invalid_argument  when there is something in the scene that lanes do not have: its
///                                motors are given, a joint is prismatic, an obstacle is no
///                                half-space, own shapes touch each other, or there are more
///                                bodies, points or obstacles than lanes have room for. The message
///                                names it.
SpaceLaneScene MakeLaneScene(const SpaceScene& scene, const LaneDrive& drive);

/// The types of lanes that belong to an algebra.
template <class Space>
struct LaneTypes;
template <>
struct LaneTypes<Plane> {
  using Model = LaneModel;
  template <class S>
  using Robot = LaneRobot<S>;
  template <class S>
  using State = LaneState<S>;
  static constexpr std::size_t kRootDofs = 3;  ///< x, z and pitch.
};
template <>
struct LaneTypes<Spatial> {
  using Model = SpaceLaneModel;
  template <class S>
  using Robot = SpaceLaneRobot<S>;
  template <class S>
  using State = SpaceLaneState<S>;
  static constexpr std::size_t kRootDofs = SpaceLaneModel::kRootDofs;
};

}  // namespace tumbler
