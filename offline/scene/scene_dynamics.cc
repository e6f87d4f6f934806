#include "offline/scene/scene_dynamics.h"

#include <utility>

#include "offline/contact/contact_model.h"

namespace tumbler {

SceneDynamics::SceneDynamics(const Scene& scene, std::unique_ptr<ContactForces<Plane>> own_contact)
    : dynamics(scene.robot.tree),
      contact(std::move(own_contact)),
      n(static_cast<std::size_t>(dynamics.size())) {
  if (contact == nullptr) {
    contact =
        std::make_unique<ContactModel<Plane>>(scene.contact, scene.robot.shapes, scene.obstacles);
  }
  for (int j = 0; j < dynamics.size(); ++j) {
    if (!dynamics.prescribed(j)) free.push_back(j);
  }
  if (scene.robot.hinged()) {
    q[0] = scene.bar.x();
    q[1] = scene.bar.y();
  }
}

}  // namespace tumbler
