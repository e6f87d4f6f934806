#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/files/key_table.h"
#include "common/files/primitive_toml.h"
#include "offline/model/mesh_points.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// A task with the texts that it came from, which go into the primitive.
struct Task {
  Problem problem;
  std::string task_file;
  std::string task_text;
  std::string robot_file;
  /// How robot_text was changed from what that file has, as motions are to say; empty: it was not.
  std::string robot_change;
  /// The URDF. Meshes that are in contact are points in it, so that their files are not needed.
  std::string robot_text;
  /// What `robot_text` was made of, with the meshes; the same where none is in contact.
  std::string robot_as_given;
  std::vector<MeshInContact> meshes;  ///< That became points.
  /// The primitive whose exit is the start pose. Empty: the task's own start pose.
  std::string start_file;
  /// The ContentHash of that primitive.
  std::string start_hash;
  /// The primitive from whose paths the solver starts. Empty: from a random search.
  std::string guess_file;
  /// The ContentHash of that primitive.
  std::string guess_hash;
  /// The parameters of those paths (GuessFrom).
  std::vector<double> guess;
  /// Its feedback, where the task takes its gains.
  std::optional<Feedback<double>> guess_feedback;
  /// The primitives that the motion complements, and the ContentHash of each. Empty: none.
  std::vector<std::string> complement_files;
  std::vector<std::string> complement_hashes;
  /// Those motions, with the problem's joints in their order.
  std::vector<Primitive<double>> complement;
};

/// The largest distance [rad] between a joint's position at the exit of one primitive and at the
/// start of the task. It allows for the rounding of decimal texts only, because the executor holds
/// the joint where it is and does not move it to the start.
inline constexpr double kStartJointTolerance = 1e-6;

/// The largest distance [rad] between the root's pitch at the exit of one primitive and at the
/// start of the task; in space between its orientations, the heading included. It only tells the
/// task's shape from another (upside down, or with the roles of the legs exchanged). The pose
/// itself is taken as it is.
inline constexpr double kStartPitchTolerance = 0.3;

/// Which tasks a caller can use.
enum class TaskSpaces {
  kPlane,          ///< Those of robots in the plane.
  kPlaneAndSpace,  ///< And those with a floating root (Problem::space).
};

/// Reads a task file and the URDF that it names (relative to the task's folder), and finds the
/// start pose. The format is described in docs/formats.md.
/// @throws FileError  with file, line, key, value and allowed range; also when the task's robot
/// moves in space, and the caller does not take that.
Task LoadTask(const std::string& path, TaskSpaces takes = TaskSpaces::kPlane);

/// The same, but the motion starts where `before` leaves the robot (its simulated exit: root and
/// joints at rest) rather than in the task's ideal pose. Of robots in the plane and in space.
/// @throws FileError  also when the exit is not the shape in which the task starts, or was made for
///                    another robot, other motors or springs, or another ground. It names joint,
///                    quantity and amount.
Task LoadTask(const std::string& path, const PrimitiveFile& before, const std::string& before_path);

/// The same as the first, from the task's text. `task_name` stands for its file: it is where the
/// URDF's path begins.
Task ParseTask(const std::string& task_text, const std::string& task_name,
               TaskSpaces takes = TaskSpaces::kPlane);

/// The same, from texts. `robot_text` stands for the file that the task names; files of meshes that
/// are in contact are read all the same, from where `robot_name` says that it is.
Task ParseTask(const std::string& task_text, const std::string& task_name,
               const std::string& robot_text, const std::string& robot_name,
               TaskSpaces takes = TaskSpaces::kPlane);

/// The same as the second LoadTask, from texts.
Task ParseTask(const std::string& task_text, const std::string& task_name,
               const std::string& robot_text, const std::string& robot_name,
               const PrimitiveFile& before, const std::string& before_path);

/// The task that a primitive was made from, parsed from the texts in the primitive. The start pose
/// is the primitive's entry, wherever that came from.
Task TaskOf(const PrimitiveFile& file, TaskSpaces takes = TaskSpaces::kPlane);

/// The keys of the file, for docs/formats.md.
std::vector<KeyTable> TaskKeyTables();

}  // namespace tumbler
