#include "offline/problem/simulated_motion.h"

#include <utility>

#include "offline/problem/task_toml.h"

namespace tumbler {

SimulatedMotion::SimulatedMotion(SequenceFile file)
    : file_(std::move(file)), problems_(file_.primitives.size()) {}

const Problem& SimulatedMotion::ProblemOf(std::size_t primitive) const {
  std::shared_ptr<const Problem>& problem = problems_[primitive];
  if (problem == nullptr)
    problem = std::make_shared<const Problem>(TaskOf(file_.primitives[primitive]).problem);
  return *problem;
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

}  // namespace tumbler
