#include "offline/scene/scene_dynamics.h"

#include <utility>

#include "offline/model/contact_model.h"

namespace tumbler {

template <class Space>
SceneDynamicsIn<Space>::SceneDynamicsIn(const SceneOf<Space>& scene,
                                        std::unique_ptr<ContactForces<Space>> own_contact)
    : dynamics(scene.robot.tree),
      contact(std::move(own_contact)),
      n(static_cast<std::size_t>(dynamics.size())) {
  if (contact == nullptr) {
    contact =
        std::make_unique<ContactModel<Space>>(scene.contact, scene.robot.shapes, scene.obstacles);
  }
  for (int j = 0; j < dynamics.size(); ++j) {
    if (!dynamics.prescribed(j)) free.push_back(j);
  }
  for (std::size_t j = 0; j < scene.motors.size(); ++j) {
    const std::size_t dof = scene.robot.DofOfJoint(j);
    const double friction_nm = scene.motors[j].dry_friction_nm;
    if (friction_nm > 0 && scene.robot.tree.dofs[dof].prescribed)
      dry_.push_back({dof, friction_nm});
  }
  for (const PassiveJoint& joint : scene.robot.passive) {
    if (joint.stiffness_nm_per_rad > 0) springs_.push_back(joint);
  }
  plain_ = dry_.empty() && springs_.empty();
  if constexpr (std::is_same_v<Space, Plane>) {
    if (!scene.robot.hinged()) return;
    q[0] = scene.bar.x();
    q[1] = scene.bar.y();
  }
}

template <class Space>
void SceneDynamicsIn<Space>::SolveWithJoints() {
  for (const PassiveJoint& joint : springs_)
    tau[joint.dof] -= joint.stiffness_nm_per_rad * (q[joint.dof] - joint.rest_rad);
  dynamics.Solve({qdd.data(), n}, {tau.data(), n});
  for (const DryJoint& joint : dry_)
    tau[joint.dof] += EvaluateDryFriction(joint.friction_nm, qd[joint.dof]).torque_nm;
}

template struct SceneDynamicsIn<Plane>;
template struct SceneDynamicsIn<Spatial>;

}  // namespace tumbler
