#include "offline/scene/self_clearance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/core/index.h"
#include "offline/model/signed_distance.h"
#include "offline/scene/space_scene.h"

namespace tumbler {
namespace {

/// The positions of a joint at which its two bodies are looked at.
constexpr int kPositions = 65;
/// A pair that is farther apart than what was asked for by up to this is worth its exact distance:
/// the longer may all pairs be left alone.
constexpr double kWorthKnowing_m = 0.02;
constexpr double kRounding_m = 1e-9;
/// Distances that differ by less are the same.
constexpr double kSameDistance_m = 1e-9;

/// Whether a joint of the one body moves the other against it. A root with several degrees of
/// freedom is a chain of bodies, of which only the last has shapes.
template <class Robot>
bool Carries(const Robot& robot, int carrier, int body) {
  return body >= robot.root_dofs && robot.tree.dofs[Index(body)].parent == carrier;
}

/// Whether two shapes meet at the joint between their bodies, or the joint does not change their
/// distance.
/// @param joint  the degree of freedom that moves one of them against the other.
template <class Space, class Robot>
bool BelongToJoint(const Robot& robot, const OwnPair& pair, int joint, double clearance_m) {
  const RobotJointLimits& limits = robot.limits[Index(joint)];
  const double reach = robot.tree.dofs[Index(joint)].kind == JointKind::kRevolute ? M_PI : 1;
  const double lower = std::isfinite(limits.lower_rad) ? limits.lower_rad : -reach;
  const double upper = std::isfinite(limits.upper_rad) ? limits.upper_rad : reach;
  SelfDistancesIn<Space> distances(robot, std::span(&pair, 1));
  std::vector<double> q(robot.tree.dofs.size(), 0.0);
  int nearer = 0;
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (int i = 0; i < kPositions; ++i) {
    q[Index(joint)] = lower + (upper - lower) * i / (kPositions - 1);
    const double distance = distances.Nearest(q).distance_m;
    if (distance < clearance_m) ++nearer;
    least = std::min(least, distance);
    most = std::max(most, distance);
  }
  return 2 * nearer >= kPositions || most - least < kSameDistance_m;
}

/// Whether two shapes pass beside each other for good, further apart than the clearance.
bool PassBeside(const OwnShape& a, const OwnShape& b, double clearance_m) {
  const double beside = std::max(a.y_min_m - b.y_max_m, b.y_min_m - a.y_max_m);
  return beside >= clearance_m && beside > 0;
}
bool PassBeside(const SpaceOwnShape& /*a*/, const SpaceOwnShape& /*b*/, double /*clearance_m*/) {
  return false;
}

template <class Space, class Robot>
std::vector<OwnPair> FindSeparatePairs(const Robot& robot, OwnShapes shapes, double clearance_m) {
  std::vector<OwnPair> pairs;
  const auto counts = [shapes](const auto& shape) {
    return shapes == OwnShapes::kAll || (shapes == OwnShapes::kCollision && !shape.drawn_only);
  };
  for (std::size_t i = 0; i < robot.own_shapes.size(); ++i) {
    for (std::size_t j = i + 1; j < robot.own_shapes.size(); ++j) {
      const auto &a = robot.own_shapes[i], &b = robot.own_shapes[j];
      if (!counts(a) || !counts(b) || a.body == b.body) continue;
      if (PassBeside(a, b, clearance_m)) continue;
      const OwnPair pair{static_cast<int>(i), static_cast<int>(j)};
      int joint = -1;
      if (Carries(robot, a.body, b.body)) joint = b.body;
      if (Carries(robot, b.body, a.body)) joint = a.body;
      if (joint < 0 || !BelongToJoint<Space>(robot, pair, joint, clearance_m))
        pairs.push_back(pair);
    }
  }
  return pairs;
}

template <class Robot>
std::string NameOfPair(const Robot& robot, const OwnPair& pair) {
  return fmt::format("{} and {}", robot.own_shapes[Index(pair.a)].name,
                     robot.own_shapes[Index(pair.b)].name);
}

}  // namespace

std::vector<OwnPair> SeparatePairs(const PlanarRobot& robot, OwnShapes shapes, double clearance_m) {
  return FindSeparatePairs<Plane>(robot, shapes, clearance_m);
}
std::vector<OwnPair> SeparatePairs(const SpaceRobot& robot, OwnShapes shapes, double clearance_m) {
  return FindSeparatePairs<Spatial>(robot, shapes, clearance_m);
}

std::string NameOf(const PlanarRobot& robot, const OwnPair& pair) {
  return NameOfPair(robot, pair);
}
std::string NameOf(const SpaceRobot& robot, const OwnPair& pair) { return NameOfPair(robot, pair); }

template <class Space>
SelfDistancesIn<Space>::SelfDistancesIn(const RobotOf& robot, std::span<const OwnPair> pairs)
    : root_dofs_(robot.root_dofs),
      first_joint_(Index(robot.root_dofs)),
      bodies_(robot.tree.dofs.size()) {
  for (const Dof<Space>& dof : robot.tree.dofs)
    joints_.push_back({dof.parent, dof.kind, dof.axis, dof.direction, dof.offset});
  for (const auto& own : robot.own_shapes) {
    shapes_.push_back(
        {own.shape, own.body, own.shape.half_extents.norm() + own.shape.radius_m, Vector::Zero()});
  }
  const auto joints_below = [this](int body) {
    std::uint32_t bits = 0;
    for (; body >= root_dofs_; body = joints_[Index(body)].parent) bits |= 1U << body;
    return bits;
  };
  for (const OwnPair& pair : pairs) {
    const std::uint32_t a = joints_below(shapes_[Index(pair.a)].body);
    const std::uint32_t b = joints_below(shapes_[Index(pair.b)].body);
    pairs_.push_back({pair, a & ~b, b & ~a, Vector::Zero()});
  }
  near_.reserve(pairs_.size());
  found_at_.reserve(joints_.size());
  FindSweeps();
}

template <class Space>
void SelfDistancesIn<Space>::FindSweeps() {
  // From the last body on: how far from its joint's axis any of its shapes, and of those that hang
  // on it, can be.
  sweep_.assign(joints_.size(), 0.0);
  for (const Own& own : shapes_) {
    if (own.body < root_dofs_) continue;
    double& sweep = sweep_[Index(own.body)];
    sweep = std::max(sweep, own.shape.centre.norm() + own.reach_m);
  }
  for (std::size_t j = joints_.size(); j-- > first_joint_;) {
    const int parent = joints_[j].parent;
    // A joint that slides takes its shapes anywhere.
    if (joints_[j].kind != JointKind::kRevolute)
      sweep_[j] = std::numeric_limits<double>::infinity();
    if (parent < root_dofs_) continue;
    double& sweep = sweep_[Index(parent)];
    sweep = std::max(sweep, joints_[j].offset.norm() + sweep_[j]);
  }
}

template <class Space>
bool SelfDistancesIn<Space>::StillApart(std::span<const double> q, double limit_m) const {
  if (found_at_.empty() || !(apart_m_ > limit_m)) return false;
  double moved = kRounding_m;
  for (std::size_t j = first_joint_; j < joints_.size(); ++j) {
    if (q[j] != found_at_[j]) moved += sweep_[j] * std::abs(q[j] - found_at_[j]);
  }
  return apart_m_ - moved > limit_m;
}

template <class Space>
void SelfDistancesIn<Space>::RememberApart(std::span<const double> q, double distance_m) {
  found_at_.assign(q.begin(), q.end());
  apart_m_ = distance_m;
}

template <class Space>
const typename SelfDistancesIn<Space>::Body& SelfDistancesIn<Space>::BodyOf(int body) const {
  return body < root_dofs_ ? world_ : bodies_[Index(body)];
}

template <class Space>
void SelfDistancesIn<Space>::SetPositions(std::span<const double> q) {
  for (std::size_t j = first_joint_; j < joints_.size(); ++j) {
    const Joint& joint = joints_[j];
    const Body& parent = BodyOf(joint.parent);
    Body& body = bodies_[j];
    if (joint.kind == JointKind::kRevolute) {
      body.R = parent.R * Space::RotationBy(joint.axis, q[j]);
      body.p = parent.p + parent.R * joint.offset;
    } else {
      body.R = parent.R;
      body.p = parent.p + parent.R * Vector(joint.offset + q[j] * joint.direction);
    }
  }
  for (Own& own : shapes_) {
    const Body& body = BodyOf(own.body);
    own.centre = body.p + body.R * own.shape.centre;
  }
}

template <class Space>
double SelfDistancesIn<Space>::Bound(const OwnPair& pair) const {
  const Own &a = shapes_[Index(pair.a)], &b = shapes_[Index(pair.b)];
  return (a.centre - b.centre).norm() - a.reach_m - b.reach_m;
}

template <class Space>
double SelfDistancesIn<Space>::BoundAlong(const Vector& u, const PosedShape<Space>& a,
                                          const PosedShape<Space>& b) {
  double reach_m = kRounding_m + a.radius_m + b.radius_m;
  for (int i = 0; i < PosedShape<Space>::kDimension; ++i) {
    reach_m += a.half_extents[i] * std::abs(u.dot(a.axis(i))) +
               b.half_extents[i] * std::abs(u.dot(b.axis(i)));
  }
  return u.dot(a.centre - b.centre) - reach_m;
}

template <class Space>
PosedShape<Space> SelfDistancesIn<Space>::Posed(int shape) const {
  const Own& own = shapes_[Index(shape)];
  const Body& body = BodyOf(own.body);
  return PosedShape<Space>::Of(own.shape, body.R, body.p);
}

template <class Space>
std::span<const typename SelfDistancesIn<Space>::Near> SelfDistancesIn<Space>::FindNearer(
    std::span<const double> q, double limit_m) {
  near_.clear();
  if (StillApart(q, limit_m)) return near_;
  SetPositions(q);
  double apart = std::numeric_limits<double>::infinity();
  for (Pair& pair : pairs_) {
    const double bound = Bound(pair.pair);
    if (bound >= limit_m + kWorthKnowing_m) {
      apart = std::min(apart, bound);
      continue;
    }
    const PosedShape<Space> a = Posed(pair.pair.a), b = Posed(pair.pair.b);
    const double along = BoundAlong(pair.u, a, b);
    if (along >= limit_m) {
      apart = std::min(apart, along);
      continue;
    }
    const SignedDistance<Space> distance = FindSignedDistance(a, b);
    pair.u = distance.u;
    apart = std::min(apart, distance.d);
    if (distance.d >= limit_m) continue;
    Near& near = near_.emplace_back();
    near.pair = pair.pair;
    near.distance_m = distance.d;
    for (std::size_t j = first_joint_; j < joints_.size(); ++j) {
      const double sign =
          static_cast<double>(pair.moves_a >> j & 1U) - static_cast<double>(pair.moves_b >> j & 1U);
      if (sign == 0) continue;
      const Joint& joint = joints_[j];
      const Vector velocity = joint.kind == JointKind::kRevolute
                                  ? VelocityAbout(j, distance.point)
                                  : Vector(BodyOf(joint.parent).R * joint.direction);
      near.slopes[j] = sign * distance.u.dot(velocity);
    }
  }
  RememberApart(q, apart);
  return near_;
}

template <class Space>
SelfClearance SelfDistancesIn<Space>::Nearest(std::span<const double> q, double limit_m) {
  SelfClearance nearest;
  if (StillApart(q, limit_m)) return nearest;
  SetPositions(q);
  for (Pair& pair : pairs_) {
    if (Bound(pair.pair) >= nearest.distance_m) continue;
    const PosedShape<Space> a = Posed(pair.pair.a), b = Posed(pair.pair.b);
    if (BoundAlong(pair.u, a, b) >= nearest.distance_m) continue;
    const SignedDistance<Space> distance = FindSignedDistance(a, b);
    pair.u = distance.u;
    if (distance.d < nearest.distance_m) nearest = {distance.d, pair.pair};
  }
  RememberApart(q, nearest.distance_m);
  return nearest;
}

template class SelfDistancesIn<Plane>;
template class SelfDistancesIn<Spatial>;

}  // namespace tumbler
