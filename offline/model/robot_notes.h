#pragma once

#include <vector>

#include "offline/model/contact_shapes.h"
#include "offline/model/robot_finding.h"
#include "offline/model/urdf_source.h"

namespace tumbler {

/// For people: all that was taken otherwise than it is written in a robot file. What is said alike
/// of several links or joints is said once, of the first, with how many others there are and the
/// names of some.
std::vector<RobotFinding> NotesOf(const UrdfSource& source);
/// The same of the shapes that contact does not use.
std::vector<RobotFinding> NotesOf(const std::vector<IgnoredShape>& ignored);

}  // namespace tumbler
