// The order in which a graph of primitives is played.

#include "common/core/sequence.h"

#include <gtest/gtest.h>

#include <type_traits>

namespace tumbler {
namespace {

/// A graph: stand -> walk -> stand ..., where walk ends a cycle and is not safe; stand -> bow when
/// the operator asks, and stand -> rest when the cycles are done.
SequenceGraph<float> ExampleGraph() {
  enum { kStand, kWalk, kBow, kRest };
  SequenceGraph<float> graph;
  const auto node = [&graph](const char* name, bool swapped, bool safe, bool ends_cycle) {
    graph.node_storage[static_cast<std::size_t>(graph.node_count)] = {
        FixedString<48>(name), graph.node_count, swapped, safe, ends_cycle};
    ++graph.node_count;
  };
  node("stand", false, true, false);
  node("walk", true, false, true);
  node("bow", false, true, false);
  node("rest", false, true, false);
  const auto edge = [&graph](int from, int to, EdgeCondition condition, const char* branch = "") {
    graph.edge_storage[static_cast<std::size_t>(graph.edge_count++)] = {from, to, 0.5F, condition,
                                                                        FixedString<32>(branch)};
  };
  edge(kStand, kWalk, EdgeCondition::kAlways);
  edge(kWalk, kStand, EdgeCondition::kAlways);
  edge(kStand, kBow, EdgeCondition::kBranch, "bow");
  edge(kStand, kRest, EdgeCondition::kCyclesDone);
  graph.partner = {1, 0, 2, 3, 4, 5, 6, 7};
  return graph;
}

TEST(NextEdge, GoesOnWithoutRequests) {
  EXPECT_EQ(NextEdge(ExampleGraph(), 0, 0, {}), 0);
  EXPECT_EQ(NextEdge(ExampleGraph(), 1, 1000, {}), 1) << "no number of cycles was asked for";
}

TEST(NextEdge, EndsWhereNothingFollows) { EXPECT_EQ(NextEdge(ExampleGraph(), 2, 0, {}), -1); }

TEST(NextEdge, TakesABranchOnlyByItsNameAndOnlyWhereItIs) {
  EXPECT_EQ(NextEdge(ExampleGraph(), 0, 0, {.branch = "bow"}), 2);
  EXPECT_EQ(NextEdge(ExampleGraph(), 0, 0, {.branch = "bo"}), 0);
  EXPECT_EQ(NextEdge(ExampleGraph(), 1, 0, {.branch = "bow"}), 1);
  EXPECT_TRUE(ExampleGraph().HasBranch("bow"));
  EXPECT_FALSE(ExampleGraph().HasBranch("stand"));
  EXPECT_FALSE(ExampleGraph().HasBranch("")) << "edges without a branch have no name";
}

TEST(NextEdge, ABranchGoesBeforeTheEndOfTheCycles) {
  EXPECT_EQ(NextEdge(ExampleGraph(), 0, 3, {.cycles = 3, .branch = "bow"}), 2);
}

TEST(NextEdge, WithTheCyclesDoneItTakesTheEdgeForThatOrEndsInASafeNode) {
  const SequenceGraph<float> graph = ExampleGraph();
  EXPECT_EQ(NextEdge(graph, 0, 2, {.cycles = 3}), 0);
  EXPECT_EQ(NextEdge(graph, 0, 3, {.cycles = 3}), 3);
  EXPECT_EQ(NextEdge(graph, 0, 4, {.cycles = 3}), 3);
  EXPECT_EQ(NextEdge(graph, 1, 3, {.cycles = 3}), 1) << "not safe: on to where it is";
  SequenceGraph<float> without = graph;
  --without.edge_count;
  EXPECT_EQ(NextEdge(without, 0, 3, {.cycles = 3}), -1);
}

TEST(NextEdge, AStopEndsAtTheNextSafeNodeWhateverElseIsAskedFor) {
  EXPECT_EQ(NextEdge(ExampleGraph(), 0, 3, {.cycles = 3, .branch = "bow", .stop = true}), -1);
  EXPECT_EQ(NextEdge(ExampleGraph(), 1, 3, {.cycles = 3, .branch = "bow", .stop = true}), 1);
}

TEST(SequenceGraph, RolesAreExchangedInSwappedNodesOnlyAndTwiceIsBack) {
  const SequenceGraph<float> graph = ExampleGraph();
  for (int j = 0; j < 3; ++j) {
    EXPECT_EQ(graph.RoleOf(0, j), j);
    EXPECT_EQ(graph.RoleOf(1, graph.RoleOf(1, j)), j);
  }
  EXPECT_EQ(graph.RoleOf(1, 0), 1);
  EXPECT_EQ(graph.RoleOf(1, 2), 2);
}

TEST(SequenceGraph, FindsNodesByTheirNames) {
  EXPECT_EQ(ExampleGraph().FindNode("bow"), 2);
  EXPECT_EQ(ExampleGraph().FindNode("bo"), -1);
  EXPECT_EQ(ExampleGraph().FindNode(""), -1) << "unused places have no name";
}

TEST(Sequence, IsAPlainValueOfFixedSize) {
  EXPECT_TRUE(std::is_trivially_copyable_v<Sequence<float>>);
  EXPECT_TRUE(std::is_trivially_destructible_v<Sequence<float>>);
}

}  // namespace
}  // namespace tumbler
