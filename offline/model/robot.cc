#include "offline/model/robot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>

#include "common/core/functions.h"
#include "common/files/toml_reader.h"
#include "offline/model/symmetric_eigen.h"
#include "offline/model/urdf_source.h"

namespace tumbler {
namespace {

constexpr double kGravity = 9.81;
/// The largest distance of anything from the frame that carries it [m]. With a larger one, rounding
/// would spoil the dynamics.
constexpr double kReach = 1e3;
const char* const kOutOfReach =
    "its <origin> is out of reach; allowed: up to 1000 m from the frame that carries it";

bool InReach(const Pose& X) { return X.translation.norm() <= kReach; }

/// Those of an inertia, in increasing order.
std::array<double, 3> PrincipalMoments(const SpaceMatrix& inertia) {
  const SmallMatrix small = SmallMatrix::NullaryExpr(3, 3, [&](Eigen::Index i, Eigen::Index j) {
    return inertia(static_cast<int>(i), static_cast<int>(j));
  });
  const SymmetricEigen eigen = DecomposeSymmetric(small);
  return {eigen.values[0], eigen.values[1], eigen.values[2]};
}

/// Where what a joint moves is in the joint's frame.
/// @param axis  a unit vector in that frame.
Pose Moved(bool revolute, const SpaceVector& axis, double position) {
  if (!revolute) return {SpaceMatrix::Identity(), position * axis};
  const double s = portable::Sin(position / 2);
  return {Pose::RotationOf(s * axis.x(), s * axis.y(), s * axis.z(), portable::Cos(position / 2)),
          SpaceVector::Zero()};
}

/// Whether some body has these mass and principal moments, in increasing order.
bool IsPhysical(double mass, const std::array<double, 3>& moments) {
  return mass > 0 && moments[0] > 0 && moments[0] + moments[1] >= moments[2] * (1 - 1e-9);
}

/// Sums of the links that are merged into one body, in the frame of its degree of freedom with
/// world axes.
struct BodySum {
  int links = 0;                       ///< That have mass or inertia.
  std::vector<RobotFinding> doubtful;  ///< What is not physical of one of them.
  double mass = 0;
  SpaceVector first_moment = SpaceVector::Zero();
  SpaceMatrix second_moment = SpaceMatrix::Zero();  // about the frame's origin
};

/// One of the root's coordinates.
struct RootCoordinate {
  const char* name;
  JointKind kind;
  SpaceVector axis;
};

std::vector<RootCoordinate> RootCoordinates(RootKind root) {
  const RootCoordinate x{"x", JointKind::kPrismatic, {1, 0, 0}};
  const RootCoordinate y{"y", JointKind::kPrismatic, {0, 1, 0}};
  const RootCoordinate z{"z", JointKind::kPrismatic, {0, 0, 1}};
  const RootCoordinate pitch{"pitch", JointKind::kRevolute, {0, -1, 0}};
  const RootCoordinate roll{"roll", JointKind::kRevolute, {1, 0, 0}};
  const RootCoordinate yaw{"yaw", JointKind::kRevolute, {0, 0, 1}};
  switch (root) {
    case RootKind::kFixed:
      return {};
    case RootKind::kPlanarXz:
    case RootKind::kHingeY:
      return {x, z, pitch};
    case RootKind::kFloating:
      return {x, y, z, pitch, roll, yaw};
  }
  return {};
}

class Builder {
 public:
  Builder(const std::string& text, std::string file, RootKind root, const LockedJoints& locked)
      : file_(std::move(file)), source_(text, file_), locked_(locked) {
    robot_.file = file_;
    robot_.name = source_.name();
    robot_.root = root;
    robot_.tree.gravity = {0, 0, -kGravity};
    AddRoot(root);
    AddLink(source_.root(), robot_.root_dofs - 1, Pose());
    // Joints are placed in the file's order, but after the joints that carry them.
    while (!waiting_.empty()) {
      const auto first = waiting_.begin();
      const WaitingJoint next = first->second;
      joint_places_.emplace(first->first, static_cast<int>(robot_.tree.dofs.size()));
      waiting_.erase(first);
      AddJoint(*next.joint, next.body, next.X);
    }
    if (!mistakes_.empty()) throw RobotFileError(file_, mistakes_);
    Finish();
  }

  Robot Take() { return std::move(robot_); }

 private:
  using Type = UrdfSource::Joint::Type;

  /// A movable joint whose parent link is placed already.
  struct WaitingJoint {
    const UrdfSource::Joint* joint;
    int body;
    Pose X;  // of the joint's frame in the body's
  };

  /// Notes what makes the robot unusable, about a link or a joint, or about the first element of
  /// that name in it.
  void RefuseLink(const std::string& link, const std::string& problem, const char* element) {
    mistakes_.push_back(
        {source_.LineOfLink(link, element), fmt::format("link '{}'", link), problem});
  }
  void RefuseJoint(const std::string& joint, const std::string& problem, const char* element) {
    mistakes_.push_back(
        {source_.LineOfJoint(joint, element), fmt::format("joint '{}'", joint), problem});
  }
  void NoteJoint(const std::string& joint, const std::string& problem, const char* element) {
    robot_.findings.push_back(
        {source_.LineOfJoint(joint, element), fmt::format("joint '{}'", joint), problem});
  }

  void AddDof(Dof<Spatial> dof, RobotJoint joint) {
    robot_.tree.dofs.push_back(std::move(dof));
    robot_.joints.push_back(std::move(joint));
    bodies_.emplace_back();
  }

  void AddRoot(RootKind root) {
    for (const RootCoordinate& coordinate : RootCoordinates(root)) {
      Dof<Spatial> dof;
      dof.name = coordinate.name;
      dof.parent = robot_.root_dofs - 1;
      dof.kind = coordinate.kind;
      (dof.kind == JointKind::kRevolute ? dof.axis : dof.direction) = coordinate.axis;
      dof.prescribed = root == RootKind::kHingeY && dof.kind == JointKind::kPrismatic;
      RobotJoint about;
      about.link = source_.root().name;
      AddDof(dof, about);
      ++robot_.root_dofs;
    }
  }

  void AddLink(const UrdfSource::Link& link, int body, const Pose& X) {
    robot_.links.push_back({link.name, source_.LineOfLink(link.name, ""), body,
                            link.inertial ? link.inertial->mass_kg : 0, X});
    AddInertia(link, body, X);
    AddShapes(link, body, X);
    for (const UrdfSource::Joint* joint : source_.JointsOn(link.name)) {
      const Pose X_joint = X * joint->pose;
      if (!InReach(X_joint)) RefuseJoint(joint->name, kOutOfReach, "origin");
      const UrdfSource::Link& child = *source_.FindLink(joint->child);
      if (const std::optional<LockedJoint> held = LockOf(*joint)) {
        robot_.locked.push_back(*held);
        if (held->with.empty() && FollowsWhatMoves(*joint)) NoteFollower(*joint);
        const bool moves = joint->type != Type::kFixed;
        AddLink(child, body,
                moves ? X_joint * Moved(joint->type != Type::kPrismatic, AxisOf(*joint),
                                        held->position_rad)
                      : X_joint);
        continue;
      }
      if (joint->type == Type::kFixed) {
        if (!joint->held_because.empty()) {
          robot_.held_joints.push_back(joint->name);
          NoteJoint(joint->name, joint->held_because, "");
        }
        AddLink(child, body, X_joint);
        continue;
      }
      waiting_.emplace(joint - source_.joints().data(), WaitingJoint{joint, body, X_joint});
    }
  }

  /// How the joint is held, if it is: by its own name, or with the joint that it follows.
  std::optional<LockedJoint> LockOf(const UrdfSource::Joint& joint) const {
    const bool held_type = !joint.held_because.empty();
    if (joint.type == Type::kFixed && !held_type) return std::nullopt;
    LockedJoint lock;
    lock.name = joint.name;
    if (held_type) {
      lock.limits.lower_rad = lock.limits.upper_rad = 0;
    } else if (joint.limits && joint.type != Type::kContinuous) {
      lock.limits.lower_rad = joint.limits->lower_rad;
      lock.limits.upper_rad = joint.limits->upper_rad;
    }
    const auto own = locked_.find(joint.name);
    if (own != locked_.end()) lock.position_rad = own->second;
    // A joint may follow one that follows another; of a circle of them none leads.
    double factor = 1, offset = 0;
    const UrdfSource::Joint* at = &joint;
    for (std::size_t i = 0; i <= source_.joints().size(); ++i) {
      const UrdfSource::Joint* const leader =
          at->mimic ? source_.FindJoint(at->mimic->joint) : nullptr;
      if (leader != nullptr) {
        offset += factor * at->mimic->offset;
        factor *= at->mimic->multiplier;
        at = leader;
        continue;
      }
      const auto lead = at == &joint ? locked_.end() : locked_.find(at->name);
      if (lead == locked_.end()) break;
      lock.position_rad = factor * lead->second + offset;
      lock.with = at->name;
      return lock;
    }
    if (own == locked_.end()) return std::nullopt;
    return lock;
  }

  /// Some files name a leader that they do not have, or that is fixed.
  [[nodiscard]] bool FollowsWhatMoves(const UrdfSource::Joint& joint) const {
    const UrdfSource::Joint* const leader =
        joint.mimic ? source_.FindJoint(joint.mimic->joint) : nullptr;
    return leader != nullptr && leader->type != Type::kFixed;
  }

  void NoteFollower(const UrdfSource::Joint& joint) {
    NoteJoint(joint.name,
              fmt::format("follows joint '{}' (mimic), and no task has joints that follow others; "
                          "lock that, and with it this one, or leave <mimic> out",
                          joint.mimic->joint),
              "mimic");
  }

  /// A unit vector in the joint's frame.
  SpaceVector AxisOf(const UrdfSource::Joint& joint) {
    const SpaceVector given = joint.axis;
    // Its numbers may be so large or small that their squares are not.
    const double largest =
        std::max({std::abs(given.x()), std::abs(given.y()), std::abs(given.z())});
    if (!given.allFinite() || largest * (given / largest).norm() < 1e-6 || largest == 0) {
      RefuseJoint(joint.name, "its <axis> has no direction; allowed: any but 0 0 0", "axis");
      return SpaceVector::UnitX();
    }
    return given / ((given / largest).norm() * largest);
  }

  void AddJoint(const UrdfSource::Joint& joint, int body, const Pose& X_joint) {
    const bool revolute = joint.type != Type::kPrismatic;
    const SpaceVector axis = X_joint.rotation * AxisOf(joint);
    Dof<Spatial> dof;
    dof.name = joint.name;
    dof.parent = body;
    dof.offset = X_joint.translation;
    dof.kind = revolute ? JointKind::kRevolute : JointKind::kPrismatic;
    (revolute ? dof.axis : dof.direction) = axis.normalized();
    RobotJoint about;
    about.link = joint.child;
    about.continuous = joint.type == Type::kContinuous;
    about.axis_line = source_.LineOfJoint(joint.name, "axis");
    robot_.findings.insert(robot_.findings.end(), joint.lacks.begin(), joint.lacks.end());
    if (joint.limits) AddLimits(joint, about);
    dof.damping_nm_s_per_rad = joint.damping;
    about.dry_friction_nm = joint.friction;
    if (!(joint.damping >= 0)) {
      RefuseJoint(joint.name, fmt::format("dynamics damping = {:g}; allowed: >= 0", joint.damping),
                  "dynamics");
    }
    if (joint.mimic) {
      about.mimics = joint.mimic->joint;
      NoteFollower(joint);
    }
    AddDof(dof, about);
    // At q = 0 the new frame has the robot's axes. The rotation of the link's own frame is kept in
    // X_child.
    Pose X_child;
    X_child.rotation = X_joint.rotation;
    AddLink(*source_.FindLink(joint.child), static_cast<int>(robot_.tree.dofs.size()) - 1, X_child);
  }

  void AddLimits(const UrdfSource::Joint& joint, RobotJoint& about) {
    const RobotJointLimits& given = *joint.limits;
    RobotJointLimits& limits = about.limits;
    if (!about.continuous) {
      limits.lower_rad = given.lower_rad;
      limits.upper_rad = given.upper_rad;
      if (!(given.lower_rad <= given.upper_rad)) {
        RefuseJoint(joint.name,
                    fmt::format("limit lower = {:g} upper = {:g}; allowed: finite, lower <= upper",
                                given.lower_rad, given.upper_rad),
                    "limit");
      }
    }
    // Many files have a limit of 0 where nobody knew it.
    const auto positive = [&](const char* what, double value) {
      if (value > 0) return value;
      const std::string problem = fmt::format("limit {} = {:g}; allowed: > 0", what, value);
      if (value == 0) {
        NoteJoint(joint.name, problem, "limit");
      } else {
        RefuseJoint(joint.name, problem, "limit");
      }
      return value;
    };
    limits.velocity_rad_s = positive("velocity", given.velocity_rad_s);
    limits.effort_nm = positive("effort", given.effort_nm);
  }

  void AddInertia(const UrdfSource::Link& link, int body, const Pose& X) {
    if (!link.inertial) return;
    const double mass = link.inertial->mass_kg;
    const SpaceMatrix& I = link.inertial->inertia_kg_m2;
    const Pose X_com = X * link.inertial->pose;
    if (!InReach(X_com)) RefuseLink(link.name, kOutOfReach, "inertial");
    const std::vector<RobotFinding> doubtful = DoubtfulInertia(link);
    if (body < 0) return;  // The link is fixed to the world and never moves.
    BodySum& sum = bodies_[static_cast<std::size_t>(body)];
    if (mass != 0 || !(I == SpaceMatrix::Zero())) ++sum.links;
    sum.doubtful.insert(sum.doubtful.end(), doubtful.begin(), doubtful.end());
    const SpaceVector c = X_com.translation;
    sum.mass += mass;
    sum.first_moment += mass * c;
    sum.second_moment +=
        X_com.rotation * I * X_com.rotation.transpose() +
        mass * (c.squaredNorm() * SpaceMatrix::Identity() - SpaceMatrix::Outer(c, c));
  }

  /// What is not physical of a link's inertia. None of a link without mass and inertia.
  std::vector<RobotFinding> DoubtfulInertia(const UrdfSource::Link& link) {
    const double mass = link.inertial->mass_kg;
    const SpaceMatrix& I = link.inertial->inertia_kg_m2;
    if (mass == 0 && I == SpaceMatrix::Zero()) return {};
    std::vector<RobotFinding> doubtful;
    const auto doubt = [&](const std::string& problem, const char* element) {
      doubtful.push_back(
          {source_.LineOfLink(link.name, element), fmt::format("link '{}'", link.name), problem});
    };
    if (!(mass > 0)) {
      const std::string problem = fmt::format(
          "inertial mass is {:g} kg; allowed: > 0 (leave <inertial> out for a massless link)",
          mass);
      if (mass == 0) {
        doubt(problem, "mass");
      } else {
        RefuseLink(link.name, problem, "mass");
      }
    }
    const std::array<double, 3> moments = PrincipalMoments(I);
    if (!(moments[0] > 0)) {
      doubt(fmt::format("inertia has the principal moment {:g} kg m^2; allowed: > 0", moments[0]),
            "inertia");
    } else if (!IsPhysical(1, moments)) {
      doubt(fmt::format("inertia is that of no body: principal moments {:g}, {:g}, "
                        "{:g} kg m^2; allowed: none larger "
                        "than the sum of the others",
                        moments[0], moments[1], moments[2]),
            "inertia");
    }
    return doubtful;
  }

  void AddShapes(const UrdfSource::Link& link, int body, const Pose& X) {
    const auto add = [&](const std::vector<RobotShape>& given, std::vector<RobotShape>& shapes) {
      for (RobotShape shape : given) {
        shape.body = body;
        shape.pose = X * shape.pose;
        shapes.push_back(std::move(shape));
      }
    };
    const std::size_t known = robot_.collision_shapes.size();
    add(link.collision_shapes, robot_.collision_shapes);
    for (std::size_t i = known; i < robot_.collision_shapes.size(); ++i) {
      if (!InReach(robot_.collision_shapes[i].pose))
        RefuseLink(link.name, kOutOfReach, "collision");
    }
    add(link.visual_shapes, robot_.visual_shapes);
  }

  void Finish() {
    auto& dofs = robot_.tree.dofs;
    if (dofs.empty()) throw FileError(file_, 0, "", "the robot has no joint that moves");
    for (int j = 0; j < robot_.root_dofs; ++j) robot_.file_order.push_back(j);
    for (const auto& [place, dof] : joint_places_) robot_.file_order.push_back(dof);
    for (std::size_t j = 0; j < dofs.size(); ++j) {
      const BodySum& sum = bodies_[j];
      dofs[j].massless = sum.mass == 0 && sum.second_moment == SpaceMatrix::Zero();
      if (dofs[j].massless) {
        Doubt(sum);
        continue;
      }
      const double m = sum.mass;
      const SpaceVector c = m > 0 ? sum.first_moment / m : SpaceVector::Zero();
      dofs[j].mass_kg = m;
      dofs[j].mass_centre = c;
      SpaceMatrix& I = dofs[j].inertia_kg_m2;
      I = sum.second_moment + m * SpaceMatrix::Outer(c, c);
      for (int k = 0; k < 3; ++k) {
        const double a = c[(k + 1) % 3], b = c[(k + 2) % 3];
        I(k, k) = sum.second_moment(k, k) - m * (a * a + b * b);
      }
      // What a link lacks, as a point of mass does, may be with the links on fixed joints.
      const std::array<double, 3> moments = PrincipalMoments(I);
      const bool whole = sum.links > 1 && IsPhysical(m, moments) && moments[0] > 1e-9 * moments[2];
      if (!whole) Doubt(sum);
    }
  }

  void Doubt(const BodySum& sum) {
    robot_.findings.insert(robot_.findings.end(), sum.doubtful.begin(), sum.doubtful.end());
  }

  std::string file_;
  UrdfSource source_;
  const LockedJoints& locked_;
  std::vector<RobotFinding> mistakes_;
  Robot robot_;
  std::vector<BodySum> bodies_;
  std::map<std::ptrdiff_t, WaitingJoint> waiting_;  // by place in the file
  std::map<std::ptrdiff_t, int> joint_places_;      // degree of freedom by place in the file
};

}  // namespace

Robot ParseRobot(const std::string& text, const std::string& file_name, RootKind root,
                 const LockedJoints& locked) {
  return Builder(text, file_name, root, locked).Take();
}

}  // namespace tumbler
