#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/core/capacity.h"
#include "offline/model/contact_shapes.h"
#include "offline/model/robot.h"

namespace tumbler {

/// What a robot file can be used for, and everything that stands in the way of the rest.
struct RobotReview {
  /// Not empty: the file holds no robot, and there is nothing below.
  std::vector<RobotFinding> mistakes;

  std::optional<Robot> robot;  ///< Can be looked at.
  /// What was taken otherwise than it is written, without making another robot of it.
  std::vector<RobotFinding> notes;
  std::vector<IgnoredShape> ignored_shapes;  ///< Contact does not use them.

  /// What a task with this root does not take.
  std::vector<RobotFinding> obstacles;
  /// Joints that no task moves: their axes leave the plane, they follow others, or they move no
  /// mass. Where a task locks them, as near to 0 as their limits let them be, it takes the others.
  LockedJoints to_lock;
  std::vector<RobotFinding> left;  ///< Of the obstacles, with those joints locked.
  /// The joints that are left then, of which a task may move `kMostMoved`, and has at most
  /// Plane::kMaxDofs with its root, or Spatial::kMaxDofs where that floats.
  std::vector<std::string> joints_left;
  bool touches = false;  ///< Whether a shape of it, with those joints locked, can touch something.

  /// Of a floating robot: the moving links that no contact shape is on, with commas between.
  std::string without_contact;

  /// Whether a task takes it, with `to_lock` locked.
  [[nodiscard]] bool CanBePlanned() const {
    return robot && left.empty() && !joints_left.empty() && TooMany() == 0;
  }
  /// So many more of `joints_left` have to be locked, or passive, for a task to take the robot.
  [[nodiscard]] std::size_t TooMany() const;

  /// The most joints with a motor (kMaxJoints of a primitive).
  static constexpr std::size_t kMostMoved = kMaxJoints;
};

/// What stands between a robot and a task in space: masses, inertias or limits that are not
/// physical, joints that are not modelled (`Robot::findings`), and degrees of freedom that move no
/// mass.
std::vector<RobotFinding> ObstaclesToPlanningInSpace(const Robot& robot);

/// Reads a robot, and looks at everything at once.
/// @param locked  joints that are locked already.
RobotReview ReviewRobot(const std::string& text, const std::string& file, RootKind root,
                        const LockedJoints& locked = {});

/// The position nearest to 0 that the limits allow.
double NearestToZero(const RobotJointLimits& limits);

/// A name as a key of a TOML file: in quotes where it has to be. Names hold no control characters.
std::string TomlKey(const std::string& name);

/// For a task's file: `locked = { FL_HAA = 0.0, FR_HAA = 0.0 }`.
std::string LockedAsToml(const LockedJoints& locked);

}  // namespace tumbler
