#include "runtime/executor/sequencer.h"

#include <string_view>

#include "common/core/feedback.h"
#include "runtime/executor/numbers.h"

namespace tumbler {

// Cold: what is seldom done is compiled for its size. A small processor has no space for copies.
[[gnu::cold]] void Sequencer::Configure(const SequenceGraph<float>& graph,
                                        const Plan& plan) noexcept {
  graph_ = graph;
  plan_ = plan;
  node_ = graph.start;
  run_ = {};
}

[[gnu::cold]] void Sequencer::EndMotion() noexcept {
  if (!graph_.node(node_).ends_cycle) return;
  ++run_.cycles_done;
  run_.unconfirmed = true;
}

int Sequencer::NextEdge(bool home) const noexcept {
  SequenceRequest request = PlannedRequest(plan_.cycles, graph_.BranchName(plan_.branch),
                                           run_.cycles_done, run_.branched);
  if (run_.wanted_branch >= 0) request.branch = graph_.BranchName(run_.wanted_branch);
  request.stop = home || run_.finishes;
  return tumbler::NextEdge(graph_, node_, run_.cycles_done, request);
}

int Sequencer::Follow(int edge) noexcept {
  if (graph_.edge(edge).when == EdgeCondition::kBranch) {
    const std::string_view taken = graph_.BranchName(edge);
    if (run_.wanted_branch >= 0 && graph_.BranchName(run_.wanted_branch) == taken) {
      run_.wanted_branch = -1;
    } else {
      run_.branched = true;
    }
  }
  return InPlaceOf(graph_.edge(edge).to);
}

[[gnu::cold]] void Sequencer::TakeCycleBack() noexcept {
  if (run_.unconfirmed) --run_.cycles_done;
  run_.unconfirmed = false;
}

[[gnu::cold]] void Sequencer::GetUp() noexcept {
  static_assert(kMaxSequenceNodes <= 32);
  TakeCycleBack();
  ++run_.get_ups;
  for (int i = 0; i < graph_.node_count; ++i) {
    if (graph_.node(i).after_fall == node_) run_.fell_in &= ~(1U << static_cast<unsigned>(i));
  }
  if (graph_.node(node_).after_fall >= 0) run_.fell_in |= 1U << static_cast<unsigned>(node_);
}

float Sequencer::FarFromEnd(float pitch_rad) const noexcept {
  return Magnitude(
      WithoutTurns(pitch_rad - graph_.last_pitch_rad[static_cast<std::size_t>(node_)]));
}

float Sequencer::NearestBeginning(float pitch_rad, int only, int& node) const noexcept {
  float nearest = 1e9F;
  for (const SequenceBeginning<float>& beginning : graph_.beginnings()) {
    if (only >= 0 && beginning.node != only) continue;
    const float off = Magnitude(WithoutTurns(pitch_rad - beginning.pitch_rad));
    if (!(off < nearest)) continue;
    nearest = off;
    node = beginning.node;
  }
  return nearest;
}

}  // namespace tumbler
