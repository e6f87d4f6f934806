#include "offline/problem/simulated_motion.h"

#include <fmt/format.h>

#include <utility>

#include "offline/problem/purpose_gauge.h"
#include "offline/problem/task_toml.h"

namespace tumbler {

SimulatedMotion::SimulatedMotion(SequenceFile file, TaskSpaces takes)
    : file_(std::move(file)), takes_(takes), problems_(file_.primitives.size()) {}

const Problem& SimulatedMotion::ProblemOf(std::size_t primitive) const {
  std::shared_ptr<const Problem>& problem = problems_[primitive];
  if (problem == nullptr) {
    auto parsed =
        std::make_shared<const Problem>(TaskOf(file_.primitives[primitive], takes_).problem);
    CheckPurpose(primitive, *parsed);
    problem = std::move(parsed);
  }
  return *problem;
}

void SimulatedMotion::CheckPurpose(std::size_t primitive, const Problem& problem) const {
  const std::vector<PurposeFigure>& purpose = file_.primitives[primitive].purpose;
  for (std::size_t i = 0; i < purpose.size(); ++i) {
    const PurposeGauge gauge =
        problem.WithScene([&](const auto& scene) { return PurposeGauge(purpose[i], scene.robot); });
    if (gauge.obstacle().empty()) continue;
    throw FileError(
        file_.path, 0, fmt::format("purpose[{}]", i),
        fmt::format("of '{}': {} cannot be judged: {}", file_.primitive_names[primitive],
                    purpose[i].name(), gauge.obstacle()));
  }
}

const Problem& SimulatedMotion::ProblemAt(int node) const {
  return ProblemOf(static_cast<std::size_t>(file_.graph.node(node).primitive));
}

SimulatedMotion SimulatedMotion::Alone(int node) const {
  SimulatedMotion alone = *this;
  alone.file_.graph.start = node;
  alone.file_.graph.edge_count = 0;
  return alone;
}

void RequireOneRobot(const SimulatedMotion& motion) {
  const SequenceFile& file = motion.file();
  for (std::size_t i = 1; i < file.primitives.size(); ++i) {
    if (SameJoints(motion.ProblemOf(0), motion.ProblemOf(i))) continue;
    throw FileError(
        file.path, 0, fmt::format("primitives.{}", file.primitive_names[i]),
        fmt::format("was made for other [motor] or [passive], or damping of joints, or locked "
                    "joints, than '{}'; give both tasks the same and make it again",
                    file.primitive_names.front()));
  }
}

void RequireSameGround(const SimulatedMotion& motion) {
  const SequenceFile& file = motion.file();
  for (std::size_t i = 1; i < file.primitives.size(); ++i) {
    if (SameGround(motion.ProblemOf(0), motion.ProblemOf(i))) continue;
    throw FileError(file.path, 0, fmt::format("primitives.{}", file.primitive_names[i]),
                    fmt::format("was made for other [contact] or [[obstacle]] than '{}'; give both "
                                "tasks the same and make it again",
                                file.primitive_names.front()));
  }
}

}  // namespace tumbler
