#pragma once

#include <algorithm>
#include <cstddef>
#include <set>
#include <type_traits>
#include <vector>

#include "common/core/index.h"
#include "common/files/primitive_toml.h"
#include "offline/problem/purpose_gauge.h"
#include "offline/problem/simulated_motion.h"
#include "offline/scene/quaternion.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {

/// How the root is turned, as far as it can be compared with a plan: in the plane its pitch, in
/// space what is vertical, in its frame. There headings do not count.
template <class Space>
using Attitude = std::conditional_t<std::is_same_v<Space, Plane>, double, SpaceVector>;
/// What messages call it.
template <class Space>
inline constexpr const char* kAttitudeName = std::is_same_v<Space, Plane> ? "pitch" : "tilt";

/// What is vertical, in a frame with these axes.
inline SpaceVector VerticalIn(const SpaceMatrix& axes) { return axes.transpose().col(2); }

/// Of the root in a pose of a primitive.
template <class Space>
Attitude<Space> AttitudeOf(const PrimitivePose& pose) {
  if constexpr (std::is_same_v<Space, Plane>) {
    return pose.root_pitch_rad;
  } else {
    return VerticalIn(ToRotation(pose.root_quaternion));
  }
}

/// The scene of one primitive, and the plan of the primitive in it.
template <class Space>
struct ChainWorld {
  ChainWorld(const PrimitiveFile& f, const Problem& p)
      : file(f),
        problem(p),
        scene(SceneIn<Space>(p)),
        robot(scene),
        distances(scene.robot, scene.self_contact.All()) {
    for (const JointMotion<double>& motion : file.primitive.motions())
      dof_of_joint.push_back(Index(scene.robot.FindDof(motion.name.view())));
    for (const PurposeFigure& figure : file.purpose) gauges.emplace_back(figure, scene.robot);
    for (const ContactInterval& interval : file.contacts) {
      for (const ContactShape<Space>& shape : scene.robot.shapes) {
        if (shape.name == interval.shape) touching_bodies.insert(shape.body);
      }
    }
  }

  const PrimitiveFile& file;
  const Problem& problem;
  const SceneOf<Space>& scene;
  SceneDynamicsIn<Space> robot;
  SelfDistancesIn<Space> distances;
  std::vector<std::size_t> dof_of_joint;  // in the order of the primitive's joints
  std::set<int> touching_bodies;          // that touch anything in the plan
  std::vector<PurposeGauge> gauges;       // of the purpose's targets

  /// How the root is turned when the primitive is played alone, from its own entry.
  struct Planned {
    double time_s;
    Attitude<Space> attitude;
  };
  std::vector<Planned> plan;

  [[nodiscard]] Attitude<Space> PlannedAt(double t) const {
    const auto after = std::lower_bound(plan.begin(), plan.end(), t,
                                        [](const auto& p, double x) { return p.time_s < x; });
    if (after == plan.begin()) return plan.front().attitude;
    if (after == plan.end()) return plan.back().attitude;
    const auto before = after - 1;
    const double share = (t - before->time_s) / (after->time_s - before->time_s);
    return before->attitude + share * (after->attitude - before->attitude);
  }
};

}  // namespace tumbler
