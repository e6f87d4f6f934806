#pragma once

#include <array>

#include "common/core/sequence.h"

namespace tumbler {

/// Whether a sequence comes, without a branch, to a node that ends a cycle or where nothing follows
/// by itself. One that does not goes round for ever, however many cycles are asked for.
template <typename Scalar>
bool CanEnd(const SequenceGraph<Scalar>& graph) {
  std::array<bool, kMaxSequenceNodes> reached{};
  reached[static_cast<std::size_t>(graph.start)] = true;
  for (int round = 0; round < graph.node_count; ++round) {
    for (const SequenceEdge<Scalar>& edge : graph.edges()) {
      if (edge.when != EdgeCondition::kBranch && reached[static_cast<std::size_t>(edge.from)])
        reached[static_cast<std::size_t>(edge.to)] = true;
    }
  }
  for (int node = 0; node < graph.node_count; ++node) {
    if (!reached[static_cast<std::size_t>(node)]) continue;
    bool goes_on = false;
    for (const SequenceEdge<Scalar>& edge : graph.edges())
      goes_on = goes_on || (edge.from == node && edge.when == EdgeCondition::kAlways);
    if (!goes_on || graph.node(node).ends_cycle) return true;
  }
  return false;
}

/// What is said of one that cannot.
inline constexpr const char* kGoesRoundForEver =
    "goes round for ever: no node on its way ends a cycle; give one `ends_cycle = true`, or name a "
    "branch";

}  // namespace tumbler
