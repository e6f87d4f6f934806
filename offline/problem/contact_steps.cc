#include "offline/problem/contact_steps.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/core/index.h"
#include "offline/model/contact_intent.h"

namespace tumbler {
namespace {

constexpr double kPoses_s = 0.02;

template <class SceneKind>
ContactSteps StepsIn(const SceneKind& scene, const Problem& problem,
                     const Primitive<double>& primitive, const ContactLaw& law, JointMoves moves) {
  ContactSteps least;
  if (scene.obstacles.empty()) return least;
  double mass_kg = 0;
  for (const auto& dof : scene.robot.tree.dofs) mass_kg += dof.mass_kg;
  auto tree = scene.robot.tree;
  for (const ActuatedJoint& joint : problem.joints)
    tree.dofs[Index(joint.dof)].prescribed = moves == JointMoves::kByPath;
  const double weight_n = mass_kg * scene.robot.tree.gravity.norm();
  std::vector<double> q = problem.start_q;
  const int samples = static_cast<int>(std::ceil(primitive.duration_s / kPoses_s));
  for (int i = 0; i <= samples; ++i) {
    const double time_s = primitive.duration_s * i / samples;
    for (std::size_t j = 0; j < problem.joints.size(); ++j)
      q[Index(problem.joints[j].dof)] = primitive.joints[j].position.Evaluate(time_s).value;
    const double effective = SmallestEffectiveMass(tree, scene.robot.shapes, q);
    if (!std::isfinite(effective)) continue;
    const double step_s = AdvisableStep(law, effective, weight_n);
    if (step_s < least.step_s) least = {step_s, time_s};
  }
  return least;
}

}  // namespace

ContactSteps ContactStepsOf(const Problem& problem, const Primitive<double>& primitive,
                            const ContactLaw& law, JointMoves moves) {
  return problem.space ? StepsIn(problem.space->scene, problem, primitive, law, moves)
                       : StepsIn(problem.scene, problem, primitive, law, moves);
}

}  // namespace tumbler
