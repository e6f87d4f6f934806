#include <cstddef>

#include "offline/model/robot.h"

namespace tumbler {

int Robot::FindDof(std::string_view joint) const {
  for (std::size_t j = static_cast<std::size_t>(root_dofs); j < tree.dofs.size(); ++j) {
    if (tree.dofs[j].name == joint) return static_cast<int>(j);
  }
  return -1;
}

const RobotLink* Robot::FindLink(std::string_view link) const {
  for (const RobotLink& candidate : links) {
    if (candidate.name == link) return &candidate;
  }
  return nullptr;
}

bool Robot::MovesMass(int dof) const {
  for (std::size_t i = tree.dofs.size(); i-- > static_cast<std::size_t>(dof);) {
    int above = static_cast<int>(i);
    while (above > dof) above = tree.dofs[static_cast<std::size_t>(above)].parent;
    if (above == dof && !tree.dofs[i].massless) return true;
  }
  return false;
}

}  // namespace tumbler
