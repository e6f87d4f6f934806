#include "offline/problem/space_quantity.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/model/spatial.h"

namespace tumbler {
namespace {

/// An axis is as good as aligned when its end is nearer than this to the direction's. There the
/// chord has no gradient, and its square one that is zero.
constexpr double kAligned = 1e-12;

/// The heading of an axis that is nearer than this to its direction has no slopes.
constexpr double kNoHeading = 1e-9;

SpaceVector ToVector(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }
std::array<double, 3> ToArray(const SpaceVector& v) { return {v.x(), v.y(), v.z()}; }

/// The plane across a direction, with its axes of heading 0 and of a quarter turn.
struct Compass {
  explicit Compass(const SpaceVector& d) {
    constexpr double kAlongX = 0.9;
    const SpaceVector from =
        std::abs(d.x()) < kAlongX ? SpaceVector::UnitX() : SpaceVector::UnitY();
    ahead = (from - d.dot(from) * d).normalized();
    left = d.cross(ahead);
  }
  SpaceVector ahead, left;
};

}  // namespace

/// The chain's joints and the point or axis, in the world.
struct SpaceQuantity::Places {
  struct Place {
    SpaceVector axis = SpaceVector::Zero(), origin = SpaceVector::Zero();
    SpaceVector v_origin = SpaceVector::Zero();  // of what carries the joint, at its origin
    SpaceVector w_before = SpaceVector::Zero();  // angular velocity of what carries it
  };
  std::array<Place, Spatial::kMaxDofs> joints{};
  SpaceVector at = SpaceVector::Zero();  // the point, or the axis
  SpaceVector v = SpaceVector::Zero();   // of the point
  SpaceVector w = SpaceVector::Zero();   // of the link
};

SpaceQuantity::Places SpaceQuantity::At(std::span<const double> q, std::span<const double> qd,
                                        const SpaceMatrix& axes) const {
  Places places;
  SpaceMatrix R = SpaceMatrix::Identity();
  SpaceVector p = SpaceVector::Zero(), v = SpaceVector::Zero(), w = SpaceVector::Zero();
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain[i];
    if (joint.turned) R = R * axes;
    Places::Place& place = places.joints[i];
    const SpaceVector step = R * ToVector(joint.offset_m);
    v += w.cross(step);
    p += step;
    place.axis = R * ToVector(joint.axis);
    place.origin = p;
    place.v_origin = v;
    place.w_before = w;
    if (joint.revolute) {
      w += place.axis * qd[joint.dof];
      R = R * Spatial::RotationBy(ToVector(joint.axis), q[joint.dof]).m;
    } else {
      const SpaceVector slid = place.axis * q[joint.dof];
      v += w.cross(slid) + place.axis * qd[joint.dof];
      p += slid;
    }
  }
  const SpaceVector arm = R * ToVector(in_body);
  places.at = of_axis() ? arm : p + arm;
  places.v = v + w.cross(arm);
  places.w = w;
  return places;
}

double SpaceQuantity::Value(std::span<const double> q, std::span<const double> qd,
                            const SpaceMatrix& axes) const {
  const Places places = At(q, qd, axes);
  const SpaceVector d = ToVector(direction);
  switch (of) {
    case Of::kPosition:
      return d.dot(places.at);
    case Of::kVelocity:
      return d.dot(places.v);
    case Of::kAngularVelocity:
      return d.dot(places.w);
    case Of::kMisalignment:
      return (places.at - d).norm();
    case Of::kHeading: {
      const Compass compass(d);
      const double angle =
          portable::Atan2(compass.left.dot(places.at), compass.ahead.dot(places.at));
      return angle > -std::numbers::pi ? angle : std::numbers::pi;
    }
  }
  return 0;
}

bool SpaceQuantity::IsDefined(std::span<const double> q, const SpaceMatrix& axes) const {
  if (of != Of::kHeading) return true;
  // Where an axis points does not depend on velocities: any will do.
  return At(q, q, axes).at.cross(ToVector(direction)).norm() >= kLeastProjection;
}

double SpaceQuantity::NearHeading(double target, double value) {
  constexpr double kTurn = 2 * std::numbers::pi;
  return value - kTurn * std::ceil((value - target) / kTurn - 0.5);
}

void SpaceQuantity::AddSlopes(double scale, std::span<const double> q, std::span<const double> qd,
                              const SpaceMatrix& axes, std::span<double> by_q,
                              std::span<double> by_qd) const {
  const Places places = At(q, qd, axes);
  const SpaceVector d = ToVector(direction);
  const SpaceVector chord = places.at - d;
  const Compass compass(d);
  const double ahead = compass.ahead.dot(places.at), left = compass.left.dot(places.at);
  const double square = ahead * ahead + left * left;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Joint& joint = chain[i];
    const Places::Place& place = places.joints[i];
    const SpaceVector a = joint.revolute ? place.axis : SpaceVector::Zero();
    const SpaceVector J = joint.revolute ? a.cross(places.at - place.origin) : place.axis;
    double slope = 0, rate_slope = 0;
    switch (of) {
      case Of::kPosition:
        slope = d.dot(J);
        break;
      case Of::kVelocity: {
        // What the joints from i on make of v: all of it but what the carrier of i gives the point.
        const SpaceVector carried = place.v_origin + place.w_before.cross(places.at - place.origin);
        slope = d.dot(a.cross(places.v - carried) + place.w_before.cross(J));
        rate_slope = d.dot(J);
        break;
      }
      case Of::kAngularVelocity:
        slope = d.dot(a.cross(places.w - place.w_before));
        rate_slope = d.dot(a);
        break;
      case Of::kMisalignment:
        if (chord.norm() > kAligned) slope = chord.dot(a.cross(places.at)) / chord.norm();
        break;
      case Of::kHeading: {
        const SpaceVector turned = a.cross(places.at);
        if (square > kNoHeading * kNoHeading)
          slope = (ahead * compass.left.dot(turned) - left * compass.ahead.dot(turned)) / square;
        break;
      }
    }
    by_q[joint.dof] += scale * slope;
    by_qd[joint.dof] += scale * rate_slope;
  }
}

SpaceQuantity QuantityOfLink(const SpaceRobot& robot, SpaceQuantity::Of of, std::string_view link,
                             const std::array<double, 3>& in_link,
                             const std::array<double, 3>& direction) {
  const RobotLink* const found = robot.FindLink(link);
  if (found == nullptr) throw std::invalid_argument("is not a link of the robot's file");
  if (found->body < 0) throw std::invalid_argument("does not move");
  SpaceQuantity quantity;
  quantity.of = of;
  quantity.link = link;
  quantity.direction = ToArray(ToVector(direction).normalized());
  const bool axis = quantity.of_axis();
  quantity.in_link = axis ? ToArray(ToVector(in_link).normalized()) : in_link;
  const SpaceVector turned = found->pose.rotation * ToVector(quantity.in_link);
  quantity.in_body = ToArray(axis ? turned : turned + found->pose.translation);
  for (int body = found->body; body >= 0; body = robot.tree.dofs[Index(body)].parent) {
    const Dof<Spatial>& dof = robot.tree.dofs[Index(body)];
    const bool revolute = dof.kind == JointKind::kRevolute;
    quantity.chain.push_back({Index(body), revolute, body == 3,
                              ToArray(revolute ? dof.axis : dof.direction), ToArray(dof.offset)});
  }
  std::ranges::reverse(quantity.chain);
  return quantity;
}

}  // namespace tumbler
