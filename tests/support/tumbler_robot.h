#pragma once

#include <string>

#include "common/files/toml_reader.h"
#include "offline/model/planar_robot.h"
#include "tests/support/files.h"

namespace tumbler {

/// The shipped robot with prescribed legs.
inline PlanarRobot LoadTumbler() {
  const std::string path = testing::SourcePath("primitives/robots/tumbler.urdf");
  PlanarRobot robot = ParsePlanarRobot(ReadTextFile(path), path, RootKind::kPlanarXz);
  robot.tree.dofs[3].prescribed = robot.tree.dofs[4].prescribed = true;
  return robot;
}

}  // namespace tumbler
