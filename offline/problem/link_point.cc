#include "offline/problem/link_point.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/core/functions.h"
#include "common/core/index.h"

namespace tumbler {
namespace {

using Pair = std::array<double, 2>;

Pair Perp(const Pair& r) { return {-r[1], r[0]}; }

}  // namespace

/// The chain's joints and the point, in the world.
struct LinkPoint::Places {
  /// Of a joint. The axis of a revolute joint, or the direction of a prismatic one, with its rate.
  struct Place {
    Pair at{}, rate{};
  };
  std::array<Place, Plane::kMaxDofs> joints{};
  Pair point{}, velocity{};

  /// dp/dq of a joint.
  [[nodiscard]] double Lever(const Joint& joint, std::size_t i, std::size_t axis) const {
    if (!joint.revolute) return joints[i].at[axis];
    const Pair arm = {point[0] - joints[i].at[0], point[1] - joints[i].at[1]};
    return joint.sense * Perp(arm)[axis];
  }
  /// Its rate.
  [[nodiscard]] double LeverRate(const Joint& joint, std::size_t i, std::size_t axis) const {
    if (!joint.revolute) return joints[i].rate[axis];
    const Pair rate = {velocity[0] - joints[i].rate[0], velocity[1] - joints[i].rate[1]};
    return joint.sense * Perp(rate)[axis];
  }
};

LinkPoint::Places LinkPoint::At(std::span<const double> q, std::span<const double> qd) const {
  Places places;
  Pair origin{}, velocity{};   // of the last body's frame
  double c = 1, s = 0, w = 0;  // its rotation and angular velocity
  const auto turned = [&](const Pair& r) { return Pair{c * r[0] - s * r[1], s * r[0] + c * r[1]}; };
  /// Goes on to a place that is fixed to the last body.
  const auto go_to = [&](const Pair& in_body) {
    const Pair arm = turned(in_body);
    for (std::size_t k = 0; k < 2; ++k) {
      origin[k] += arm[k];
      velocity[k] += w * Perp(arm)[k];
    }
  };
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain[i];
    Places::Place& place = places.joints[i];
    const double position = q[joint.dof], rate = qd[joint.dof];
    go_to(joint.offset_m);
    if (joint.revolute) {
      place = {origin, velocity};
      const auto [sine, cos] = portable::SinCos(position);
      const double sin = joint.sense * sine;
      const double turned_c = c * cos - s * sin;
      s = s * cos + c * sin;
      c = turned_c;
      w += joint.sense * rate;
      continue;
    }
    const Pair direction = turned(joint.direction);
    const Pair across = Perp(direction);
    place = {direction, {w * across[0], w * across[1]}};
    for (std::size_t k = 0; k < 2; ++k) {
      origin[k] += position * direction[k];
      velocity[k] += rate * direction[k] + position * place.rate[k];
    }
  }
  go_to(in_body_m);
  places.point = origin;
  places.velocity = velocity;
  return places;
}

double LinkPoint::Value(Axis axis, bool rate, std::span<const double> q,
                        std::span<const double> qd) const {
  const Places places = At(q, qd);
  return (rate ? places.velocity : places.point)[static_cast<std::size_t>(axis)];
}

void LinkPoint::AddSlopes(Axis axis, bool rate, double scale, std::span<const double> q,
                          std::span<const double> qd, std::span<double> by_q,
                          std::span<double> by_qd) const {
  const Places places = At(q, qd);
  const auto k = static_cast<std::size_t>(axis);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const std::size_t dof = chain[i].dof;
    const double lever = scale * places.Lever(chain[i], i, k);
    if (!rate) {
      by_q[dof] += lever;
      continue;
    }
    by_q[dof] += scale * places.LeverRate(chain[i], i, k);
    by_qd[dof] += lever;
  }
}

LinkPoint PointOfLink(const PlanarRobot& robot, std::string_view name,
                      const std::array<double, 2>& point_m) {
  const auto link = std::ranges::find(robot.links, name, &PlanarLink::name);
  if (link == robot.links.end()) {
    std::string names;
    for (const PlanarLink& other : robot.links) names += (names.empty() ? "" : ", ") + other.name;
    throw std::invalid_argument("is no link of the robot; allowed: " + names);
  }
  if (link->body < 0) {
    throw std::invalid_argument(
        "never moves, because the root is fixed; allowed: a link that a joint moves");
  }
  if (!link->in_plane) {
    throw std::invalid_argument(
        "has a frame whose x and z are turned out of the robot's x-z plane, so that point_m is no "
        "point of the plane; allowed: a link whose frame is turned about y only");
  }
  LinkPoint point;
  point.link = name;
  point.point_m = point_m;
  for (std::size_t k = 0; k < 2; ++k) {
    point.in_body_m[k] =
        link->origin_m[k] + link->x_axis[k] * point_m[0] + link->z_axis[k] * point_m[1];
  }
  for (int j = link->body; j >= 0; j = robot.tree.dofs[Index(j)].parent) {
    const Dof<Plane>& dof = robot.tree.dofs[Index(j)];
    point.chain.push_back({Index(j),
                           dof.kind == JointKind::kRevolute,
                           dof.axis,
                           {dof.offset.x(), dof.offset.y()},
                           {dof.direction.x(), dof.direction.y()}});
  }
  std::ranges::reverse(point.chain);
  return point;
}

}  // namespace tumbler
