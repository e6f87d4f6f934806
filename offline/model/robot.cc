#include "offline/model/robot.h"

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <mutex>
#include <sstream>
#include <system_error>

#include "common/toml_reader.h"
#include "offline/model/urdf_source.h"

namespace tumbler {
namespace {

constexpr double kGravity = 9.81;
/// A joint axis counts as in the plane when it leaves it by less than this angle [rad]: file
/// digits, not geometry.
constexpr double kPlaneTolerance = 1e-6;

/// Farther out, rounding spoils what is computed of a robot [m].
constexpr double kReach = 1e3;
const char* const kOutOfReach =
    "its <origin> is out of reach; allowed: up to 1000 m from the frame that carries it";

bool InReach(const Eigen::Isometry3d& X) { return X.translation().norm() <= kReach; }

/// Collects what urdfdom would print.
class CollectingHandler : public console_bridge::OutputHandler {
 public:
  void log(const std::string& text, console_bridge::LogLevel level, const char* /*file*/,
           int /*line*/) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR)
      messages += (messages.empty() ? "" : "; ") + text;
  }
  std::string messages;
};

urdf::ModelInterfaceSharedPtr ParseUrdf(const std::string& text, const std::string& file) {
  static std::mutex mutex;  // The output handler of console_bridge is one for the whole process.
  const std::lock_guard<std::mutex> lock(mutex);
  CollectingHandler handler;
  console_bridge::useOutputHandler(&handler);
  urdf::ModelInterfaceSharedPtr model;
  std::string thrown;
  try {
    model = urdf::parseURDF(text);
  } catch (const std::exception& error) {
    thrown = error.what();
  }
  console_bridge::restorePreviousOutputHandler();
  if (model == nullptr) {
    const std::string& why = handler.messages.empty() ? thrown : handler.messages;
    throw FileError(file, 0, "",
                    fmt::format("not a valid URDF: {}", why.empty() ? "no reason given" : why));
  }
  return model;
}

Eigen::Isometry3d ToIsometry(const urdf::Pose& pose) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translate(Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z));
  X.rotate(Eigen::Quaterniond(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z));
  return X;
}

Eigen::Vector2d InPlane(const Eigen::Vector3d& r) { return {r.x(), r.z()}; }

/// A rigid body being put together from merged links, in the frame of its degree of freedom with
/// world axes.
struct BodySum {
  double mass = 0;
  Eigen::Vector3d first_moment = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second_moment = Eigen::Matrix3d::Zero();  // about the frame's origin
};

class Builder {
 public:
  Builder(const std::string& text, std::string file, RootKind root)
      : file_(std::move(file)), source_(text, file_), model_(ParseUrdf(text, file_)) {
    robot_.name = model_->getName();
    robot_.tree.gravity = {0, -kGravity};
    AddRoot(root);
    const urdf::LinkConstSharedPtr link = model_->getRoot();
    const int body = static_cast<int>(robot_.tree.dofs.size()) - 1;
    AddLink(*link, body, Eigen::Isometry3d::Identity());
    Finish();
  }

  PlanarRobot Take() { return std::move(robot_); }

 private:
  /// Fails about a link, or about the first element of that name in it.
  [[noreturn]] void FailLink(const std::string& link, const std::string& problem,
                             const char* element = "") const {
    throw FileError(file_, source_.LineOfLink(link, element), fmt::format("link '{}'", link),
                    problem);
  }
  [[noreturn]] void FailJoint(const std::string& joint, const std::string& problem,
                              const char* element = "") const {
    throw FileError(file_, source_.LineOfJoint(joint, element), fmt::format("joint '{}'", joint),
                    problem);
  }

  void AddDof(Dof<Plane> dof, const std::string& body_name, const RobotJointLimits& limits) {
    if (static_cast<int>(robot_.tree.dofs.size()) == Plane::kMaxDofs) {
      FailLink(body_name,
               fmt::format("the robot has more than {} degrees of freedom, its root's included",
                           Plane::kMaxDofs));
    }
    robot_.tree.dofs.push_back(std::move(dof));
    robot_.body_names.push_back(body_name);
    robot_.limits.push_back(limits);
    bodies_.emplace_back();
  }

  void AddRoot(RootKind root) {
    if (root != RootKind::kPlanarXz) return;
    const std::string link = model_->getRoot()->name;
    const char* const names[] = {"x", "z", "pitch"};
    for (int i = 0; i < 3; ++i) {
      Dof<Plane> dof;
      dof.name = names[i];
      dof.parent = i - 1;
      dof.kind = i < 2 ? JointKind::kPrismatic : JointKind::kRevolute;
      if (i < 2) dof.direction[i] = 1;
      AddDof(dof, link, {});
    }
    robot_.root_dofs = 3;
  }

  void AddLink(const urdf::Link& link, int body, const Eigen::Isometry3d& X) {
    AddInertia(link, body, X);
    AddShapes(link, body, X);
    std::vector<urdf::JointSharedPtr> joints = link.child_joints;
    const auto place = [this](const urdf::JointSharedPtr& joint) {
      return std::find(source_.joint_order().begin(), source_.joint_order().end(), joint->name);
    };
    std::sort(joints.begin(), joints.end(),
              [&](const auto& a, const auto& b) { return place(a) < place(b); });
    for (const urdf::JointSharedPtr& joint : joints) AddJoint(*joint, body, X);
  }

  void AddJoint(const urdf::Joint& joint, int body, const Eigen::Isometry3d& X) {
    const Eigen::Isometry3d X_joint = X * ToIsometry(joint.parent_to_joint_origin_transform);
    if (!InReach(X_joint)) FailJoint(joint.name, kOutOfReach, "origin");
    const urdf::LinkConstSharedPtr child = model_->getLink(joint.child_link_name);
    if (joint.type == urdf::Joint::FIXED) {
      AddLink(*child, body, X_joint);
      return;
    }
    const bool revolute =
        joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::CONTINUOUS;
    if (!revolute && joint.type != urdf::Joint::PRISMATIC) {
      FailJoint(joint.name,
                "its type is not supported; allowed: revolute, continuous, prismatic, fixed");
    }
    Eigen::Vector3d axis(joint.axis.x, joint.axis.y, joint.axis.z);
    if (!axis.allFinite() || axis.norm() < 1e-6)
      FailJoint(joint.name, "its <axis> has no direction", "axis");
    axis = X_joint.linear() * axis.normalized();
    Dof<Plane> dof;
    dof.name = joint.name;
    dof.parent = body;
    dof.offset = InPlane(X_joint.translation());
    if (revolute) {
      if (std::hypot(axis.x(), axis.z()) > kPlaneTolerance) {
        FailJoint(
            joint.name,
            fmt::format("its axis in the robot's frame is ({:.4g}, {:.4g}, {:.4g}); allowed for a "
                        "robot in the x-z plane: (0, 1, 0) or (0, -1, 0)",
                        axis.x(), axis.y(), axis.z()),
            "axis");
      }
      dof.axis = axis.y() < 0 ? 1 : -1;
    } else {
      if (std::abs(axis.y()) > kPlaneTolerance) {
        FailJoint(
            joint.name,
            "its axis leaves the x-z plane; allowed for a prismatic joint: any direction in it",
            "axis");
      }
      dof.kind = JointKind::kPrismatic;
      dof.direction = InPlane(axis).normalized();
    }
    RobotJointLimits limits;
    if (joint.limits != nullptr) {
      const urdf::JointLimits& given = *joint.limits;
      if (joint.type != urdf::Joint::CONTINUOUS) {
        limits.lower_rad = given.lower;
        limits.upper_rad = given.upper;
        if (!(given.lower <= given.upper)) {
          FailJoint(joint.name,
                    fmt::format("limit lower = {:g} upper = {:g}; allowed: finite, lower <= upper",
                                given.lower, given.upper),
                    "limit");
        }
      }
      if (!(given.velocity > 0)) {
        FailJoint(joint.name, fmt::format("limit velocity = {:g}; allowed: > 0", given.velocity),
                  "limit");
      }
      if (!(given.effort > 0)) {
        FailJoint(joint.name, fmt::format("limit effort = {:g}; allowed: > 0", given.effort),
                  "limit");
      }
      limits.velocity_rad_s = given.velocity;
      limits.effort_nm = given.effort;
    }
    if (joint.dynamics != nullptr) {
      dof.damping_nm_s_per_rad = joint.dynamics->damping;
      if (!(joint.dynamics->damping >= 0)) {
        FailJoint(joint.name,
                  fmt::format("dynamics damping = {:g}; allowed: >= 0", joint.dynamics->damping),
                  "dynamics");
      }
    }
    if (joint.mimic != nullptr)
      FailJoint(joint.name, "mimics another joint; mimic joints are not supported", "mimic");
    AddDof(dof, child->name, limits);
    // The new frame keeps the robot's axes at q = 0; only the rotation of the link's own frame is
    // carried on.
    Eigen::Isometry3d X_child = Eigen::Isometry3d::Identity();
    X_child.linear() = X_joint.linear();
    AddLink(*child, static_cast<int>(robot_.tree.dofs.size()) - 1, X_child);
  }

  void AddInertia(const urdf::Link& link, int body, const Eigen::Isometry3d& X) {
    if (link.inertial == nullptr) return;
    const urdf::Inertial& given = *link.inertial;
    Eigen::Matrix3d I;
    I << given.ixx, given.ixy, given.ixz, given.ixy, given.iyy, given.iyz, given.ixz, given.iyz,
        given.izz;
    const Eigen::Isometry3d X_com = X * ToIsometry(given.origin);
    if (!(given.mass > 0)) {
      FailLink(
          link.name,
          fmt::format(
              "inertial mass is {:g} kg; allowed: > 0 (leave <inertial> out for a massless link)",
              given.mass),
          "mass");
    }
    if (!InReach(X_com)) FailLink(link.name, kOutOfReach, "inertial");
    const Eigen::Vector3d moments = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(I).eigenvalues();
    if (moments(0) <= 0) {
      FailLink(
          link.name,
          fmt::format("inertia has the principal moment {:g} kg m^2; allowed: > 0", moments(0)),
          "inertia");
    }
    if (moments(0) + moments(1) < moments(2) * (1 - 1e-9)) {
      FailLink(link.name,
               fmt::format("inertia is that of no body: principal moments {:g}, {:g}, "
                           "{:g} kg m^2; allowed: none larger "
                           "than the sum of the others",
                           moments(0), moments(1), moments(2)),
               "inertia");
    }
    if (body < 0) return;  // Fixed to the world: it never moves.
    const Eigen::Vector3d c = X_com.translation();
    BodySum& sum = bodies_[static_cast<std::size_t>(body)];
    sum.mass += given.mass;
    sum.first_moment += given.mass * c;
    sum.second_moment +=
        X_com.linear() * I * X_com.linear().transpose() +
        given.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  }

  void AddShapes(const urdf::Link& link, int body, const Eigen::Isometry3d& X) {
    const auto ignore = [&](const std::string& reason) {
      robot_.ignored_shapes.push_back({link.name, source_.LineOfLink(link.name, ""), reason});
    };
    int number = 0;
    for (const urdf::CollisionSharedPtr& shape : link.collision_array) {
      const std::string name = fmt::format("{}/{}", link.name, number++);
      if (shape == nullptr || shape->geometry == nullptr) continue;
      const Eigen::Isometry3d X_shape = X * ToIsometry(shape->origin);
      if (!InReach(X_shape)) FailLink(link.name, kOutOfReach, "collision");
      if (shape->geometry->type != urdf::Geometry::SPHERE) {
        ignore(fmt::format("collision shape {} is not a sphere", name));
        continue;
      }
      const double radius = static_cast<const urdf::Sphere&>(*shape->geometry).radius;
      if (body < 0) {
        ignore(fmt::format("collision shape {} is fixed to the world", name));
        continue;
      }
      robot_.spheres.push_back({name, body, InPlane(X_shape.translation()), radius});
    }
    for (const urdf::VisualSharedPtr& shape : link.visual_array) {
      if (shape == nullptr || shape->geometry == nullptr || body < 0) continue;
      AddDrawing(*shape->geometry, body, X * ToIsometry(shape->origin));
    }
  }

  void AddDrawing(const urdf::Geometry& geometry, int body, const Eigen::Isometry3d& X) {
    DrawnSegment segment;
    segment.body = body;
    Eigen::Vector3d half = Eigen::Vector3d::Zero();
    if (geometry.type == urdf::Geometry::SPHERE) {
      segment.radius_m = static_cast<const urdf::Sphere&>(geometry).radius;
    } else if (geometry.type == urdf::Geometry::CYLINDER) {
      const auto& cylinder = static_cast<const urdf::Cylinder&>(geometry);
      segment.radius_m = cylinder.radius;
      half.z() = cylinder.length / 2;
    } else if (geometry.type == urdf::Geometry::BOX) {
      // Drawn as a bar along the box's longest side that lies in the plane.
      const urdf::Vector3 dim = static_cast<const urdf::Box&>(geometry).dim;
      const Eigen::Vector3d size(dim.x, dim.y, dim.z);
      int longest = -1;
      double thickness = 0;
      for (int i = 0; i < 3; ++i) {
        const double in_plane = std::hypot(X.linear()(0, i), X.linear()(2, i)) * size[i];
        if (longest < 0 || in_plane > half[longest] * 2) {
          if (longest >= 0) thickness = std::max(thickness, half[longest] * 2);
          half.setZero();
          half[i] = in_plane / 2;
          longest = i;
        } else {
          thickness = std::max(thickness, in_plane);
        }
      }
      segment.radius_m = thickness / 2;
      half[longest] = std::max(0.0, half[longest] - segment.radius_m);
    } else {
      return;
    }
    segment.from = InPlane(X * -half);
    segment.to = InPlane(X * half);
    if (segment.from.allFinite() && segment.to.allFinite()) robot_.drawing.push_back(segment);
  }

  void Finish() {
    auto& dofs = robot_.tree.dofs;
    for (std::size_t j = 0; j < dofs.size(); ++j) {
      const BodySum& sum = bodies_[j];
      dofs[j].massless = sum.mass == 0;
      if (dofs[j].massless) continue;
      const Eigen::Vector3d c = sum.first_moment / sum.mass;
      dofs[j].mass_kg = sum.mass;
      dofs[j].mass_centre = InPlane(c);
      // About -y through the mass centre: the same number as about +y.
      dofs[j].inertia_kg_m2 = sum.second_moment(1, 1) - sum.mass * InPlane(c).squaredNorm();
    }
    if (dofs.empty()) throw FileError(file_, 0, "", "the robot has no joint that moves");
    for (std::size_t j = 0; j < dofs.size(); ++j) {
      double mass = 0;
      for (std::size_t i = dofs.size(); i-- > j;) {
        int above = static_cast<int>(i);
        while (above > static_cast<int>(j)) above = dofs[static_cast<std::size_t>(above)].parent;
        if (above == static_cast<int>(j)) mass += dofs[i].mass_kg;
      }
      if (mass == 0) {
        FailLink(robot_.body_names[j],
                 fmt::format("degree of freedom '{}' moves no mass; give the link, or one that it "
                             "carries, an <inertial>",
                             dofs[j].name));
      }
    }
  }

  std::string file_;
  UrdfSource source_;
  urdf::ModelInterfaceSharedPtr model_;
  PlanarRobot robot_;
  std::vector<BodySum> bodies_;
};

}  // namespace

int PlanarRobot::FindDof(std::string_view joint) const {
  for (std::size_t j = static_cast<std::size_t>(root_dofs); j < tree.dofs.size(); ++j) {
    if (tree.dofs[j].name == joint) return static_cast<int>(j);
  }
  return -1;
}

PlanarRobot ParsePlanarRobot(const std::string& text, const std::string& file_name, RootKind root) {
  return Builder(text, file_name, root).Take();
}

std::string ReadTextFile(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw FileError(path, 0, "", "is a directory, not a file");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    throw FileError(path, 0, "",
                    fmt::format("cannot be opened: {}", std::generic_category().message(errno)));
  }
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

}  // namespace tumbler
