#include "offline/model/robot_review.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/core/index.h"
#include "offline/model/planar_robot.h"
#include "offline/model/robot_notes.h"
#include "offline/model/urdf_source.h"

namespace tumbler {
namespace {

/// The joint that a joint follows in the end: of those that are not fixed, or in a circle.
int LeaderOf(const Robot& robot, int dof) {
  for (std::size_t i = 0; i < robot.joints.size(); ++i) {
    const std::string& mimics = robot.joints[Index(dof)].mimics;
    const int leader = mimics.empty() ? -1 : robot.FindDof(mimics);
    if (leader < 0) break;
    dof = leader;
  }
  return dof;
}

/// Adds the joints that no task moves. @returns whether there were any.
bool AddUnmovable(const Robot& robot, LockedJoints& locked) {
  const std::size_t known = locked.size();
  for (std::size_t j = Index(robot.root_dofs); j < robot.tree.dofs.size(); ++j) {
    const Dof<Spatial>& dof = robot.tree.dofs[j];
    const RobotJoint& joint = robot.joints[j];
    if (joint.mimics.empty()) {
      if (LeavesPlane(dof) || !robot.MovesMass(static_cast<int>(j)))
        locked.emplace(dof.name, NearestToZero(joint.limits));
    } else {
      const int leader = LeaderOf(robot, static_cast<int>(j));
      const std::size_t moved = Index(leader);
      locked.emplace(robot.tree.dofs[moved].name, NearestToZero(robot.joints[moved].limits));
    }
  }
  for (const std::string& joint : robot.held_joints) locked.emplace(joint, 0.0);
  return locked.size() > known;
}

}  // namespace

std::size_t RobotReview::TooMany() const {
  if (!robot) return 0;
  const int dofs = robot->root == RootKind::kFloating ? Spatial::kMaxDofs : Plane::kMaxDofs;
  const std::size_t room = std::min(kMostMoved, static_cast<std::size_t>(dofs - robot->root_dofs));
  return joints_left.size() > room ? joints_left.size() - room : 0;
}

std::vector<RobotFinding> ObstaclesToPlanningInSpace(const Robot& robot) {
  std::vector<RobotFinding> obstacles = robot.findings;
  for (std::size_t j = 0; j < robot.tree.dofs.size(); ++j) {
    if (robot.MovesMass(static_cast<int>(j))) continue;
    const std::string& name = robot.joints[j].link;
    const RobotLink* const link = robot.FindLink(name);
    obstacles.push_back({link == nullptr ? 0 : link->line, fmt::format("link '{}'", name),
                         fmt::format("and all that it carries has no mass, so that '{}' cannot be "
                                     "simulated; allowed: an <inertial>, or the joint in `locked`",
                                     robot.tree.dofs[j].name)});
  }
  return obstacles;
}

namespace {

/// What a task with a floating root says to the robot.
void ReviewInSpace(RobotReview& review) {
  const Robot& robot = *review.robot;
  const ContactShapes<Spatial> contact = SpatialContactShapes(robot);
  review.ignored_shapes = contact.ignored;
  review.touches = !contact.shapes.empty();
  review.obstacles = ObstaclesToPlanningInSpace(robot);
  review.left = review.obstacles;
  for (std::size_t body = Index(robot.root_dofs) - 1; body < robot.tree.dofs.size(); ++body) {
    const auto on_body = [body](const auto& shape) { return Index(shape.body) == body; };
    if (std::ranges::any_of(contact.shapes, on_body)) continue;
    review.without_contact +=
        (review.without_contact.empty() ? "" : ", ") + robot.joints[body].link;
  }
  for (std::size_t j = Index(robot.root_dofs); j < robot.tree.dofs.size(); ++j)
    review.joints_left.push_back(robot.tree.dofs[j].name);
}

}  // namespace

RobotReview ReviewRobot(const std::string& text, const std::string& file, RootKind root,
                        const LockedJoints& locked) {
  RobotReview review;
  try {
    review.robot = ParseRobot(text, file, root, locked);
    const UrdfSource source(text, file);
    review.notes = NotesOf(source);
  } catch (const RobotFileError& error) {
    review.mistakes = error.findings();
    return review;
  }
  if (root == RootKind::kFloating) {
    ReviewInSpace(review);
    return review;
  }
  review.obstacles = ObstaclesToPlanning(*review.robot);
  LockedJoints all = locked;
  std::optional<Robot> reduced = review.robot;
  // An axis may leave the plane only because of another that is not at 0.
  while (AddUnmovable(*reduced, all)) {
    reduced.reset();
    try {
      reduced = ParseRobot(text, file, root, all);
    } catch (const RobotFileError&) {
      break;  // Nothing moves any more.
    }
  }
  for (const auto& [name, position] : all) {
    if (!locked.contains(name)) review.to_lock.emplace(name, position);
  }
  if (!reduced) return review;
  for (std::size_t j = Index(reduced->root_dofs); j < reduced->tree.dofs.size(); ++j)
    review.joints_left.push_back(reduced->tree.dofs[j].name);
  review.left = ObstaclesToPlanning(*reduced);
  const ContactShapes<Plane> contact = PlanarContactShapes(*reduced);
  review.touches = !contact.shapes.empty();
  review.ignored_shapes = contact.ignored;
  return review;
}

double NearestToZero(const RobotJointLimits& limits) {
  return std::clamp(0.0, std::min(limits.lower_rad, limits.upper_rad),
                    std::max(limits.lower_rad, limits.upper_rad));
}

std::string TomlKey(const std::string& name) {
  const bool bare = !name.empty() && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  });
  if (bare) return name;
  std::string text = "\"";
  for (const char c : name) {
    if (c == '"' || c == '\\') text += '\\';
    text += c;
  }
  return text + "\"";
}

std::string LockedAsToml(const LockedJoints& locked) {
  std::string text = "locked = {";
  for (const auto& [name, position] : locked) {
    text += fmt::format("{} {} = {}", text.back() == '{' ? "" : ",", TomlKey(name),
                        ExactDecimal(position));
  }
  return text + " }";
}

}  // namespace tumbler
