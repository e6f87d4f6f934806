#pragma once

#include <optional>
#include <string>
#include <vector>

#include "offline/model/root_kind.h"
#include "offline/programs/new_robot.h"

namespace tumbler {

/// The files of a robot that has a URDF.
struct FilesOfUrdf {
  std::vector<NewFile> files;
  std::vector<std::string> joints;  ///< That its tasks move.
  /// For people: what was decided, such as joints that are locked, and why.
  std::vector<std::string> notes;
};

/// Everything that a robot needs before it moves in simulation, with the names and limits of its
/// URDF: a copy of that, two tasks that bend every joint a little and bring it back, a sequence of
/// them, imagined drives, a twin, and a page that says what to do with them. Joints that no task
/// moves (RobotReview::to_lock) are locked, and so are those beyond what a task moves, from the
/// file's end.
/// @param name  IsRobotName.
/// @param urdf, urdf_file  its text, and what stands for it in messages.
/// @param root  how the tasks hold its root link. None: free in the plane where the robot rests on
///              the ground in its pose near zero, else fixed.
/// @throws FileError  naming everything that keeps a task from taking the robot.
FilesOfUrdf NewRobotOfUrdf(const std::string& name, const std::string& urdf,
                           const std::string& urdf_file, std::optional<RootKind> root);

}  // namespace tumbler
