#include "offline/problem/link_chains.h"

namespace tumbler {

std::vector<LinkChain> LinkChainsOf(const PlanarRobot& robot) {
  const auto& dofs = robot.tree.dofs;
  const auto root = static_cast<std::size_t>(robot.root_dofs);
  std::vector<LinkChain> chains;
  if (root > 0)
    chains.push_back({robot.body_names[root - 1], std::vector<double>(dofs.size() - root)});
  for (std::size_t d = root; d < dofs.size(); ++d) {
    LinkChain chain{robot.body_names[d], std::vector<double>(dofs.size() - root)};
    for (int k = static_cast<int>(d); k >= static_cast<int>(root);
         k = dofs[static_cast<std::size_t>(k)].parent) {
      const Dof<Plane>& dof = dofs[static_cast<std::size_t>(k)];
      if (dof.kind == JointKind::kRevolute)
        chain.joints[static_cast<std::size_t>(k) - root] = dof.axis;
    }
    chains.push_back(chain);
  }
  return chains;
}

}  // namespace tumbler
