#include "offline/scene/self_clearance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/core/index.h"
#include "offline/model/signed_distance.h"

namespace tumbler {
namespace {

/// The positions of a joint at which its two bodies are looked at.
constexpr int kPositions = 65;
/// A pair that is farther apart than what was asked for by up to this is worth its exact distance:
/// the longer may all pairs be left alone.
constexpr double kWorthKnowing_m = 0.02;
/// Distances that differ by less are the same.
constexpr double kSameDistance_m = 1e-9;

/// Whether a joint of the one body moves the other against it. A root with several degrees of
/// freedom is a chain of bodies, of which only the last has shapes.
bool Carries(const PlanarRobot& robot, int carrier, int body) {
  return body >= robot.root_dofs && robot.tree.dofs[Index(body)].parent == carrier;
}

/// Whether two shapes meet at the joint between their bodies, or the joint does not change their
/// distance.
/// @param joint  the degree of freedom that moves one of them against the other.
bool BelongToJoint(const PlanarRobot& robot, const OwnPair& pair, int joint, double clearance_m) {
  const RobotJointLimits& limits = robot.limits[Index(joint)];
  const double reach = robot.tree.dofs[Index(joint)].kind == JointKind::kRevolute ? M_PI : 1;
  const double lower = std::isfinite(limits.lower_rad) ? limits.lower_rad : -reach;
  const double upper = std::isfinite(limits.upper_rad) ? limits.upper_rad : reach;
  SelfDistances distances(robot, std::span(&pair, 1));
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

}  // namespace

std::vector<OwnPair> SeparatePairs(const PlanarRobot& robot, OwnShapes shapes, double clearance_m) {
  std::vector<OwnPair> pairs;
  const auto counts = [shapes](const OwnShape& shape) {
    return shapes == OwnShapes::kAll || (shapes == OwnShapes::kCollision && !shape.drawn_only);
  };
  for (std::size_t i = 0; i < robot.own_shapes.size(); ++i) {
    for (std::size_t j = i + 1; j < robot.own_shapes.size(); ++j) {
      const OwnShape &a = robot.own_shapes[i], &b = robot.own_shapes[j];
      if (!counts(a) || !counts(b) || a.body == b.body) continue;
      const double beside = std::max(a.y_min_m - b.y_max_m, b.y_min_m - a.y_max_m);
      if (beside >= clearance_m && beside > 0) continue;
      const OwnPair pair{static_cast<int>(i), static_cast<int>(j)};
      int joint = -1;
      if (Carries(robot, a.body, b.body)) joint = b.body;
      if (Carries(robot, b.body, a.body)) joint = a.body;
      if (joint < 0 || !BelongToJoint(robot, pair, joint, clearance_m)) pairs.push_back(pair);
    }
  }
  return pairs;
}

std::string NameOf(const PlanarRobot& robot, const OwnPair& pair) {
  return fmt::format("{} and {}", robot.own_shapes[Index(pair.a)].name,
                     robot.own_shapes[Index(pair.b)].name);
}

SelfDistances::SelfDistances(const PlanarRobot& robot, std::span<const OwnPair> pairs)
    : root_dofs_(robot.root_dofs),
      first_joint_(Index(robot.root_dofs)),
      bodies_(robot.tree.dofs.size()) {
  for (const Dof<Plane>& dof : robot.tree.dofs)
    joints_.push_back({dof.parent, dof.kind, dof.axis, dof.direction, dof.offset});
  for (const OwnShape& own : robot.own_shapes) {
    shapes_.push_back({own.shape, own.body, own.shape.half_extents.norm() + own.shape.radius_m,
                       Plane::Vector::Zero()});
  }
  const auto joints_below = [this](int body) {
    std::uint32_t bits = 0;
    for (; body >= root_dofs_; body = joints_[Index(body)].parent) bits |= 1U << body;
    return bits;
  };
  for (const OwnPair& pair : pairs) {
    const std::uint32_t a = joints_below(shapes_[Index(pair.a)].body);
    const std::uint32_t b = joints_below(shapes_[Index(pair.b)].body);
    pairs_.push_back({pair, a & ~b, b & ~a});
  }
  near_.reserve(pairs_.size());
  found_at_.reserve(joints_.size());
  FindSweeps();
}

void SelfDistances::FindSweeps() {
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

bool SelfDistances::StillApart(std::span<const double> q, double limit_m) const {
  if (found_at_.empty() || !(apart_m_ > limit_m)) return false;
  constexpr double kRounding_m = 1e-9;
  double moved = kRounding_m;
  for (std::size_t j = first_joint_; j < joints_.size(); ++j) {
    if (q[j] != found_at_[j]) moved += sweep_[j] * std::abs(q[j] - found_at_[j]);
  }
  return apart_m_ - moved > limit_m;
}

void SelfDistances::RememberApart(std::span<const double> q, double distance_m) {
  found_at_.assign(q.begin(), q.end());
  apart_m_ = distance_m;
}

const SelfDistances::Body& SelfDistances::BodyOf(int body) const {
  return body < root_dofs_ ? world_ : bodies_[Index(body)];
}

void SelfDistances::SetPositions(std::span<const double> q) {
  for (std::size_t j = first_joint_; j < joints_.size(); ++j) {
    const Joint& joint = joints_[j];
    const Body& parent = BodyOf(joint.parent);
    Body& body = bodies_[j];
    if (joint.kind == JointKind::kRevolute) {
      body.R = parent.R * Plane::RotationBy(joint.axis, q[j]);
      body.p = parent.p + parent.R * joint.offset;
    } else {
      body.R = parent.R;
      body.p = parent.p + parent.R * Plane::Vector(joint.offset + q[j] * joint.direction);
    }
  }
  for (Own& own : shapes_) {
    const Body& body = BodyOf(own.body);
    own.centre = body.p + body.R * own.shape.centre;
  }
}

double SelfDistances::Bound(const OwnPair& pair) const {
  const Own &a = shapes_[Index(pair.a)], &b = shapes_[Index(pair.b)];
  return (a.centre - b.centre).norm() - a.reach_m - b.reach_m;
}

PosedShape<Plane> SelfDistances::Posed(int shape) const {
  const Own& own = shapes_[Index(shape)];
  const Body& body = BodyOf(own.body);
  return PosedShape<Plane>::Of(own.shape, body.R, body.p);
}

std::span<const SelfDistances::Near> SelfDistances::FindNearer(std::span<const double> q,
                                                               double limit_m) {
  near_.clear();
  if (StillApart(q, limit_m)) return near_;
  SetPositions(q);
  double apart = std::numeric_limits<double>::infinity();
  for (const Pair& pair : pairs_) {
    const double bound = Bound(pair.pair);
    if (bound >= limit_m + kWorthKnowing_m) {
      apart = std::min(apart, bound);
      continue;
    }
    const SignedDistance distance = FindSignedDistance(Posed(pair.pair.a), Posed(pair.pair.b));
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
      const Plane::Vector velocity = joint.kind == JointKind::kRevolute
                                         ? Plane::Cross(joint.axis, distance.point - bodies_[j].p)
                                         : Plane::Vector(BodyOf(joint.parent).R * joint.direction);
      near.slopes[j] = sign * distance.u.dot(velocity);
    }
  }
  RememberApart(q, apart);
  return near_;
}

SelfClearance SelfDistances::Nearest(std::span<const double> q, double limit_m) {
  SelfClearance nearest;
  if (StillApart(q, limit_m)) return nearest;
  SetPositions(q);
  for (const Pair& pair : pairs_) {
    if (Bound(pair.pair) >= nearest.distance_m) continue;
    const double d = FindSignedDistance(Posed(pair.pair.a), Posed(pair.pair.b)).d;
    if (d < nearest.distance_m) nearest = {d, pair.pair};
  }
  RememberApart(q, nearest.distance_m);
  return nearest;
}

}  // namespace tumbler
