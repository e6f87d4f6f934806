#include "common/files/planned_passages.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "common/core/index.h"
#include "common/files/toml_reader.h"

namespace tumbler {

std::vector<PlannedPassage> PlannedPassages(const SequenceFile& file, int cycles,
                                            const std::string& branch) {
  const SequenceGraph<double>& graph = file.graph;
  if (!branch.empty() && !graph.HasBranch(branch)) {
    const std::vector<std::string> names = BranchNames(graph);
    throw std::invalid_argument(
        fmt::format("the sequence '{}' has no branch '{}'; its branches: {}", graph.name.view(),
                    branch, names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  }
  std::vector<PlannedPassage> passages;
  int node = graph.start, done = 0, since_cycle = 0;
  bool branched = false;
  for (;;) {
    const bool ends_cycle = graph.node(node).ends_cycle;
    done += ends_cycle ? 1 : 0;
    since_cycle = ends_cycle ? 0 : since_cycle + 1;
    const int edge = NextEdge(graph, node, done, PlannedRequest(cycles, branch, done, branched));
    passages.push_back({node, edge, done});
    if (edge < 0) return passages;
    if (since_cycle > graph.node_count || done > cycles + graph.node_count) {
      throw FileError(file.path, file.node_lines[Index(node)], fmt::format("node[{}]", node),
                      fmt::format("'{}' is played again and again: the sequence '{}' goes round "
                                  "for ever; give it a number of cycles and a node that ends a "
                                  "cycle, or a branch on its way",
                                  graph.node(node).name.view(), graph.name.view()));
    }
    branched = branched || graph.edge(edge).when == EdgeCondition::kBranch;
    node = graph.edge(edge).to;
  }
}

void RequireEnd(const SequenceFile& file, int cycles, const std::string& branch) {
  static_cast<void>(PlannedPassages(file, std::min(cycles, 1), branch));
}

}  // namespace tumbler
