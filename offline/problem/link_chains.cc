#include "offline/problem/link_chains.h"

namespace tumbler {

std::vector<LinkChain> LinkChainsOf(const PlanarRobot& robot) {
  const auto& dofs = robot.tree.dofs;
  const auto root = static_cast<std::size_t>(robot.root_dofs);
  const std::size_t joints = robot.joint_count();
  std::vector<int> joint_of(dofs.size(), -1);
  for (std::size_t j = 0; j < joints; ++j) joint_of[robot.DofOfJoint(j)] = static_cast<int>(j);
  std::vector<LinkChain> chains;
  if (root > 0) chains.push_back({robot.body_names[root - 1], std::vector<double>(joints)});
  for (std::size_t d = root; d < dofs.size(); ++d) {
    LinkChain chain{robot.body_names[d], std::vector<double>(joints)};
    bool measured = true;
    for (int k = static_cast<int>(d); k >= static_cast<int>(root);
         k = dofs[static_cast<std::size_t>(k)].parent) {
      const Dof<Plane>& dof = dofs[static_cast<std::size_t>(k)];
      if (dof.kind != JointKind::kRevolute) continue;
      const int joint = joint_of[static_cast<std::size_t>(k)];
      measured = measured && joint >= 0;
      if (joint >= 0) chain.joints[static_cast<std::size_t>(joint)] = dof.axis;
    }
    if (measured) chains.push_back(chain);
  }
  return chains;
}

}  // namespace tumbler
