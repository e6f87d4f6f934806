#pragma once

#include <string>

#include "common/files/toml_reader.h"
#include "offline/model/robot.h"
#include "tests/support/files.h"

namespace tumbler {

/// A shipped quadruped, floating.
/// @param name  "solo8" or "solo12".
inline Robot LoadSolo(const std::string& name, RootKind root = RootKind::kFloating) {
  const std::string path = testing::SourcePath("primitives/" + name + "/" + name + ".urdf");
  return ParseRobot(ReadTextFile(path), path, root);
}

/// The degrees of freedom of a floating root.
inline constexpr int kFloatingDofs = 6;

/// Makes the joints of a floating robot follow paths.
inline void PrescribeJoints(Robot& robot) {
  for (std::size_t j = kFloatingDofs; j < robot.tree.dofs.size(); ++j)
    robot.tree.dofs[j].prescribed = true;
}

}  // namespace tumbler
