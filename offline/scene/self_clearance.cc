#include "offline/scene/self_clearance.h"

#include "common/index.h"
#include "offline/contact/near_points.h"

namespace tumbler {

std::vector<ContactPair> SeparatePairs(const PlanarRobot& robot) {
  std::vector<ContactPair> pairs;
  const auto parent = [&robot](int body) { return robot.tree.dofs[Index(body)].parent; };
  for (std::size_t a = 0; a < robot.shapes.size(); ++a) {
    for (std::size_t b = a + 1; b < robot.shapes.size(); ++b) {
      const int body_a = robot.shapes[a].body, body_b = robot.shapes[b].body;
      if (body_a == body_b || parent(body_a) == body_b || parent(body_b) == body_a) continue;
      pairs.push_back({static_cast<int>(a), static_cast<int>(b)});
    }
  }
  return pairs;
}

SelfClearance FindSelfClearance(const PlanarRobot& robot, const std::vector<ContactPair>& pairs,
                                const HybridDynamics<Plane>& dynamics) {
  const auto posed = [&](int shape) {
    const ContactShape<Plane>& own = robot.shapes[Index(shape)];
    return PosedShape<Plane>::Of(own.shape, dynamics.rotation(own.body),
                                 dynamics.position(own.body));
  };
  SelfClearance nearest;
  for (const ContactPair& pair : pairs) {
    const double distance = FindNearPoints(posed(pair.a), posed(pair.b)).d;
    if (distance < nearest.distance_m) nearest = {distance, pair};
  }
  return nearest;
}

}  // namespace tumbler
