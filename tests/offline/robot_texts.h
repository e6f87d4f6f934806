#pragma once

#include <fmt/format.h>

#include <string>

#include "common/files/toml_reader.h"
#include "offline/model/planar_robot.h"
#include "offline/model/robot.h"

namespace tumbler::testing {

inline PlanarRobot Parse(const std::string& text, RootKind root = RootKind::kPlanarXz) {
  return ParsePlanarRobot(text, "robot.urdf", root);
}

/// The message with which ParsePlanarRobot refuses the text; empty when it takes it.
inline std::string Refusal(const std::string& text) {
  try {
    Parse(text);
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

/// `<link>` with a mass at a place and a moment about -y.
inline std::string Link(const std::string& name, const std::string& mass = "1",
                        const std::string& x = "0") {
  return fmt::format(
      "<link name='{}'><inertial><origin xyz='{} 0 0'/><mass value='{}'/><inertia ixx='0.02' "
      "ixy='0' ixz='0' iyy='0.02' iyz='0' izz='0.02'/></inertial></link>",
      name, x, mass);
}
inline std::string Joint(const std::string& name, const std::string& type,
                         const std::string& parent, const std::string& child,
                         const std::string& more) {
  return fmt::format("<joint name='{}' type='{}'><parent link='{}'/><child link='{}'/>{}</joint>",
                     name, type, parent, child, more);
}
inline std::string RobotText(const std::string& inside) {
  return fmt::format("<robot name='r'>{}</robot>", inside);
}
inline const char* const kLimit = "<limit lower='-1' upper='1' effort='3' velocity='4'/>";

inline Robot ParseInSpace(const std::string& text, RootKind root = RootKind::kFloating) {
  return ParseRobot(text, "robot.urdf", root);
}

}  // namespace tumbler::testing
