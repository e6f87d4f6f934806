// Which motion is next, without an executor: edges, branches, ends, cycles and falls.

#include "runtime/executor/sequencer.h"

#include <gtest/gtest.h>

namespace tumbler {
namespace {

enum Node : int { kUp, kDown, kOut, kAround };

/// `up` and `down` in turn, a cycle at the end of `down`, which is safe. The branch `leave` goes
/// from `up` to `out`. After a fall in `up`, `around` is played in its place.
SequenceGraph<float> Rounds() {
  SequenceGraph<float> graph;
  graph.node_count = 4;
  graph.node_storage[kDown].safe = graph.node_storage[kDown].ends_cycle = true;
  graph.node_storage[kOut].safe = true;
  graph.node_storage[kUp].after_fall = kAround;
  graph.edge_count = 4;
  graph.edge_storage[0] = {kUp, kDown, 0, EdgeCondition::kAlways, {}};
  graph.edge_storage[1] = {kDown, kUp, 0, EdgeCondition::kAlways, {}};
  graph.edge_storage[2] = {kUp, kOut, 0, EdgeCondition::kBranch, FixedString<32>("leave")};
  graph.edge_storage[3] = {kAround, kDown, 0, EdgeCondition::kAlways, {}};
  return graph;
}
constexpr int kLeave = 2;  // the number of its branch

class SequencerTest : public ::testing::Test {
 protected:
  void Begin(const Sequencer::Plan& plan) {
    sequencer.Configure(Rounds(), plan);
    sequencer.BeginRun();
  }
  /// Plays the node to its end. @returns the next one, or -1 at the end.
  int Next(bool home = false) {
    sequencer.EndMotion();
    const int edge = sequencer.NextEdge(home);
    sequencer.ConfirmCycle();
    if (edge < 0) return -1;
    sequencer.EnterNode(sequencer.Follow(edge));
    return sequencer.node();
  }
  /// The robot falls at the end of the node, and begins anew.
  void Fall() {
    sequencer.EndMotion();
    sequencer.GetUp();
    sequencer.EnterNode(sequencer.InPlaceOf(kUp));
  }

  Sequencer sequencer;
};

TEST_F(SequencerTest, EndsInASafeNodeWhenTheCyclesAreDone) {
  Begin({2, -1, 0});
  EXPECT_EQ(Next(), kDown);
  EXPECT_EQ(sequencer.cycles_done(), 0);
  EXPECT_EQ(Next(), kUp);
  EXPECT_EQ(sequencer.cycles_done(), 1);
  EXPECT_EQ(Next(), kDown);
  EXPECT_EQ(Next(), -1);
  EXPECT_EQ(sequencer.cycles_done(), 2);
}

TEST_F(SequencerTest, TakesThePlansBranchOnceAfterTheCycles) {
  Begin({1, kLeave, 0});
  EXPECT_EQ(Next(), kDown);
  EXPECT_EQ(Next(), kUp);
  EXPECT_EQ(Next(), kOut);
  EXPECT_EQ(Next(), -1);
}

TEST_F(SequencerTest, TakesAWantedBranchFirstAndForgetsItOnceItIsTaken) {
  Begin({0, -1, 0});
  sequencer.Want(kLeave);
  EXPECT_EQ(Next(), kOut);
  sequencer.EnterNode(kUp);
  EXPECT_EQ(Next(), kDown);
}

TEST_F(SequencerTest, AWantedBranchThatIsThePlansLeavesThePlansToBeTaken) {
  Begin({0, kLeave, 0});
  sequencer.Want(kLeave);
  EXPECT_EQ(Next(), kOut);
  sequencer.EnterNode(kUp);
  EXPECT_EQ(Next(), kOut) << "by the plan";
  sequencer.EnterNode(kUp);
  EXPECT_EQ(Next(), kDown);
}

TEST_F(SequencerTest, AnotherBranchIsNotTakenForTheWantedOne) {
  SequenceGraph<float> graph = Rounds();
  graph.edge_storage[static_cast<std::size_t>(graph.edge_count++)] = {
      kUp, kDown, 0, EdgeCondition::kBranch, FixedString<32>("other")};
  sequencer.Configure(graph, {});
  sequencer.Want(kLeave);
  EXPECT_EQ(sequencer.Follow(graph.edge_count - 1), kDown);
  EXPECT_EQ(Next(), kOut) << "still wanted";
}

TEST_F(SequencerTest, FinishesAndGoesHomeToTheNextSafeNodeWhateverElseWasAskedFor) {
  for (const bool home : {false, true}) {
    Begin({5, kLeave, 3});
    sequencer.Want(kLeave);
    if (!home) sequencer.Finish();
    EXPECT_EQ(sequencer.finishes(), !home);
    EXPECT_EQ(Next(home), kDown);
    EXPECT_EQ(Next(home), -1);
  }
}

TEST_F(SequencerTest, NoRunKnowsOfTheOneBefore) {
  Begin({1, kLeave, 1});
  EXPECT_EQ(Next(), kDown);
  EXPECT_EQ(Next(), kUp);
  Fall();
  sequencer.Finish();
  sequencer.BeginRun();
  EXPECT_EQ(sequencer.cycles_done(), 0);
  EXPECT_FALSE(sequencer.finishes());
  EXPECT_TRUE(sequencer.MayGetUp());
  EXPECT_EQ(sequencer.InPlaceOf(kUp), kUp);
}

TEST_F(SequencerTest, ACycleThatEndsInAFallIsTakenBackUnlessItWasConfirmed) {
  Begin({3, -1, 1});
  sequencer.EnterNode(kDown);
  sequencer.EndMotion();
  EXPECT_EQ(sequencer.cycles_done(), 1);
  sequencer.TakeCycleBack();
  sequencer.TakeCycleBack();
  EXPECT_EQ(sequencer.cycles_done(), 0);
  sequencer.EndMotion();
  sequencer.ConfirmCycle();
  sequencer.TakeCycleBack();
  EXPECT_EQ(sequencer.cycles_done(), 1);
  Fall();
  EXPECT_EQ(sequencer.cycles_done(), 1);
}

TEST_F(SequencerTest, GetsUpAsOftenAsThePlanSaysAndNotOnceTheRunIsToEnd) {
  Begin({0, -1, 2});
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(sequencer.MayGetUp());
    sequencer.GetUp();
  }
  EXPECT_FALSE(sequencer.MayGetUp());
  Begin({0, -1, 2});
  sequencer.Finish();
  EXPECT_FALSE(sequencer.MayGetUp());
}

TEST_F(SequencerTest, TakesTheOtherWayWhereItFellUntilItFallsThereToo) {
  Begin({0, -1, 9});
  Fall();
  EXPECT_EQ(sequencer.node(), kAround);
  EXPECT_EQ(Next(), kDown);
  EXPECT_EQ(Next(), kAround) << "an edge leads there in its place, too";
  Fall();
  EXPECT_EQ(sequencer.node(), kUp);
}

TEST_F(SequencerTest, FindsTheBeginningInWhosePoseTheRobotLies) {
  SequenceGraph<float> graph = Rounds();
  graph.beginning_count = 2;
  graph.beginning_storage[0] = {kUp, 0.0F};
  graph.beginning_storage[1] = {kDown, 3.1F};
  graph.last_pitch_rad[kDown] = 1;
  sequencer.Configure(graph, {});
  int node = -1;
  EXPECT_NEAR(sequencer.NearestBeginning(-3.1F, -1, node), 0.083, 1e-3) << "less whole turns";
  EXPECT_EQ(node, kDown);
  EXPECT_NEAR(sequencer.NearestBeginning(-3.1F, kUp, node), 3.1, 1e-6);
  EXPECT_EQ(node, kUp);
  node = kOut;
  EXPECT_GT(sequencer.NearestBeginning(0, kOut, node), 3.2F) << "no beginning of that node";
  EXPECT_EQ(node, kOut);
  sequencer.EnterNode(kDown);
  EXPECT_NEAR(sequencer.FarFromEnd(0.75F), 0.25, 1e-6);
}

}  // namespace
}  // namespace tumbler
