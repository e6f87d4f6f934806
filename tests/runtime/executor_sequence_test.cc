// The executor on a graph of primitives: order, roles, cycles, branches, ends, and the frames at
// the splices.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "runtime/executor/executor.h"
#include "tests/support/executor_rig.h"
#include "tests/support/sequence_files.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;

/// `up`, `down`, and both with exchanged roles, round and round; `out` leaves from `up`.
class SequenceTest : public ::testing::Test {
 protected:
  static Sequence<float> Gait() {
    const testing::SequenceFolder folder(testing::GaitText());
    return ToRuntime(ReadSequence(folder.file()));
  }

  /// @param ups_safe  whether the robot stays without torque after `up`, too.
  static ExecutorRig MakeRig(int cycles, const std::string& branch = "", bool ups_safe = true) {
    const auto sequence = std::make_unique<Sequence<float>>(Gait());
    sequence->graph.node_storage[0].safe = sequence->graph.node_storage[2].safe = ups_safe;
    ExecutorConfig config;
    config.cycles = cycles;
    config.branch = sequence->graph.FindBranch(branch);
    return ExecutorRig(
        config, sequence->graph,
        {sequence->primitives.begin(), sequence->primitives.begin() + sequence->primitive_count});
  }

  /// Arms, moves to the start and runs.
  static void Begin(ExecutorRig& rig) {
    ASSERT_EQ(rig.configured, Status::kOk);
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    rig.Tick(OperatorCommand::kMoveToStart);
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
    rig.Tick(OperatorCommand::kRun);
    ASSERT_EQ(rig.executor.state(), ExecutorState::kRunning);
  }

  /// Ticks to the end; @returns the names of the nodes as they were played.
  template <typename Each>
  static std::vector<std::string> Play(ExecutorRig& rig, Each each, int ticks_max = 100000) {
    std::vector<std::string> nodes;
    ExecutorState last = ExecutorState::kHolding;
    for (int i = 0; i < ticks_max && rig.executor.state() != ExecutorState::kHolding &&
                    rig.executor.state() != ExecutorState::kFault;
         ++i) {
      const TickRecord& record = rig.Tick(each(rig));
      if (record.state == ExecutorState::kRunning && last != ExecutorState::kRunning)
        nodes.emplace_back(rig.executor.graph().node(record.node).name.view());
      last = record.state;
    }
    return nodes;
  }
  static OperatorCommand Nothing(const ExecutorRig& /*rig*/) { return OperatorCommand::kNone; }
};

using Nodes = std::vector<std::string>;

TEST_F(SequenceTest, GoesRoundAsManyCyclesAsAskedForAndEndsInASafeNode) {
  ExecutorRig rig = MakeRig(3);
  Begin(rig);
  EXPECT_EQ(Play(rig, Nothing),
            (Nodes{"up", "down", "up, swapped", "down, swapped", "up", "down"}));
  EXPECT_EQ(rig.executor.state(), ExecutorState::kHolding);
  EXPECT_EQ(rig.output.record.cycles, 3);
}

TEST_F(SequenceTest, TakesTheConfiguredBranchWhenTheCyclesAreDone) {
  ExecutorRig none = MakeRig(0, "leave");
  Begin(none);
  EXPECT_EQ(Play(none, Nothing), (Nodes{"up", "out"}));
  ExecutorRig two = MakeRig(2, "leave");
  Begin(two);
  EXPECT_EQ(Play(two, Nothing), (Nodes{"up", "down", "up, swapped", "down, swapped", "up", "out"}));
}

TEST_F(SequenceTest, TakesTheBranchThatTheOperatorAsksForWhereThereIsOne) {
  ExecutorRig rig = MakeRig(0);
  Begin(rig);
  bool asked = false;
  const Nodes nodes = Play(rig, [&](ExecutorRig& r) {
    // The branch is asked for in a node that it does not leave from.
    if (asked || r.output.record.node != 1) return OperatorCommand::kNone;
    asked = true;
    r.input.branch = static_cast<std::int8_t>(r.executor.graph().FindBranch("leave"));
    return OperatorCommand::kBranch;
  });
  EXPECT_EQ(nodes, (Nodes{"up", "down", "up, swapped", "down, swapped", "up", "out"}));
}

TEST_F(SequenceTest, RefusesABranchThatIsNotThereAndGoesOn) {
  ExecutorRig rig = MakeRig(1);
  Begin(rig);
  rig.input.branch = -1;
  rig.Tick(OperatorCommand::kBranch);
  EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kNoSuchBranch);
  rig.input.branch = 0;  // An edge, but not a branch.
  rig.Tick(OperatorCommand::kBranch);
  EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kNoSuchBranch);
  EXPECT_EQ(Play(rig, Nothing).back(), "down");
}

TEST_F(SequenceTest, FinishEndsAtTheNextSafeNode) {
  ExecutorRig rig = MakeRig(0);
  Begin(rig);
  for (int i = 0; i < 20; ++i) rig.Tick();
  EXPECT_EQ(Play(rig,
                 [asked = false](const ExecutorRig& r) mutable {
                   if (asked || r.output.record.node != 1) return OperatorCommand::kNone;
                   asked = true;
                   return OperatorCommand::kFinish;
                 })
                .back(),
            "down");
  EXPECT_EQ(rig.output.record.faults, 0);
}

TEST_F(SequenceTest, AStopInMidMotionStopsThereAndTheNextRunBeginsAtTheStartNode) {
  ExecutorRig rig = MakeRig(0);
  Begin(rig);
  while (rig.output.record.node != 1 || rig.executor.state() != ExecutorState::kRunning) rig.Tick();
  for (int i = 0; i < 30; ++i) rig.Tick();
  rig.Tick(OperatorCommand::kStop);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
  rig.Tick(OperatorCommand::kRun);
  EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kNotAtStart);
  rig.Tick(OperatorCommand::kMoveToStart);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
  rig.Tick(OperatorCommand::kRun);
  EXPECT_EQ(rig.Tick().node, 0);
}

TEST_F(SequenceTest, NoCommandJumpsAtASpliceAndRolesAreExchanged) {
  ExecutorRig rig = MakeRig(2);
  Begin(rig);
  const Sequence<float> gait = Gait();
  std::vector<float> last;
  int swapped_ticks = 0;
  Play(rig, [&](const ExecutorRig& r) {
    const TickRecord& record = r.output.record;
    for (std::size_t j = 0; j < record.joint_count; ++j) {
      const JointRecord& joint = record.joints[j];
      const int role = gait.graph.RoleOf(record.node, static_cast<int>(j));
      const JointMotion<float>& motion =
          gait.PrimitiveOf(record.node).joints[static_cast<std::size_t>(role)];
      if (last.size() == record.joint_count) {
        EXPECT_LE(std::abs(joint.limited.position_rad - last[j]),
                  motion.limits.velocity_max_rad_s * 1.002e-3F)
            << record.tick;
      }
      if (record.state == ExecutorState::kRunning) {
        EXPECT_EQ(joint.planned.position_rad,
                  motion.position.Evaluate(record.primitive_time_s).value);
        swapped_ticks += gait.graph.node(record.node).swapped ? 1 : 0;
      }
    }
    last.clear();
    for (std::size_t j = 0; j < record.joint_count; ++j)
      last.push_back(record.joints[j].limited.position_rad);
    return OperatorCommand::kNone;
  });
  EXPECT_GT(swapped_ticks, 0);
  EXPECT_EQ(rig.output.record.faults, 0);
}

TEST_F(SequenceTest, WhereTheNextPrimitiveHasNarrowerLimitsTheSetpointGoesThereStepByStep) {
  ExecutorRig rig = MakeRig(0);
  Begin(rig);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling));
  const float kept = rig.Tick().joints[0].limited.torque_nm;
  ASSERT_GT(std::abs(kept), 0.1F);

  const auto sequence = std::make_unique<Sequence<float>>(Gait());
  JointLimits<float>& limits = sequence->primitives[1].joints[0].limits;
  limits.torque_max_nm = 0.5F * std::abs(kept);
  ExecutorRig narrow(
      {}, sequence->graph,
      {sequence->primitives.begin(), sequence->primitives.begin() + sequence->primitive_count});
  Begin(narrow);
  float last = narrow.output.record.joints[0].limited.torque_nm;
  bool outside = false;
  while (narrow.output.record.node != 1 || narrow.executor.state() != ExecutorState::kSettling) {
    const TickRecord& record = narrow.Tick();
    const float torque = record.joints[0].limited.torque_nm;
    if (record.node == 1) {
      outside = outside || std::abs(torque) > limits.torque_max_nm;
      EXPECT_LE(std::abs(torque - last), 0.1001F * limits.torque_max_nm) << record.tick;
    }
    last = torque;
  }
  EXPECT_TRUE(outside) << "the limits of the node before were no wider";
  EXPECT_LE(std::abs(last), limits.torque_max_nm);
}

TEST_F(SequenceTest, AJointThatIsNotWhereTheNextPrimitiveBeginsIsAFaultAndNotAMotion) {
  ExecutorRig rig = MakeRig(0);
  Begin(rig);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling));
  // The joint is inside the following tolerance, but outside the next primitive's entry tolerance.
  rig.follow = false;
  const Sequence<float> gait = Gait();
  const float allowed = gait.PrimitiveOf(1).entry_tolerance_rad;
  const float followed = gait.PrimitiveOf(0).following_tolerance_rad;
  ASSERT_LT(allowed, followed);
  rig.drives[1]->reply.position_rad += 0.5F * (allowed + followed);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kFault, 5000));
  EXPECT_EQ(rig.Tick().first_fault.fault, Fault::kEntryMissed);
  EXPECT_EQ(rig.output.record.first_fault.joint, 1);
  EXPECT_NEAR(rig.output.record.first_fault.value.real(), 0.5F * (allowed + followed), 1e-5);
  EXPECT_EQ(rig.output.record.reaction, Reaction::kHold);
}

TEST_F(SequenceTest, GoesOnToASafeNodeAfterAFaultThatWasAnsweredByAHoldAtANodesEnd) {
  ExecutorRig rig = MakeRig(0, "", false);
  Begin(rig);
  rig.Tick(OperatorCommand::kGoHome);
  EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kWrongState) << "nothing is amiss";
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling));
  rig.silent[1] = true;
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kFault, 20));
  EXPECT_EQ(rig.Tick().reaction, Reaction::kHold);
  rig.Tick(OperatorCommand::kGoHome);
  EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kNoReply) << "the drive is still silent";
  EXPECT_EQ(rig.output.record.refusal.joint, 1);
  rig.silent[1] = false;
  rig.Tick();
  rig.Tick(OperatorCommand::kGoHome);
  EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kNone);
  ASSERT_EQ(rig.executor.state(), ExecutorState::kSettling);
  EXPECT_EQ(Play(rig, Nothing), (Nodes{"down"}));
  EXPECT_EQ(rig.executor.state(), ExecutorState::kHolding);
  EXPECT_EQ(rig.output.record.first_fault.fault, Fault::kStaleReply) << "it stays latched";
  EXPECT_NE(rig.output.record.faults, 0);
  rig.Tick(OperatorCommand::kDisarm);
  rig.Tick(OperatorCommand::kArm);
  EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kFaultLatched);
  rig.Tick(OperatorCommand::kClearFaults);
  rig.Tick(OperatorCommand::kArm);
  EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kNone);
}

TEST_F(SequenceTest, AFaultOnTheWayToTheSafeNodeIsAnsweredAsEver) {
  ExecutorRig rig = MakeRig(0, "", false);
  Begin(rig);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling));
  rig.input.tick += 100;
  rig.Tick();
  ASSERT_EQ(rig.executor.state(), ExecutorState::kFault);
  rig.Tick(OperatorCommand::kGoHome);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kRunning));
  rig.input.tick += 100;  // The same fault once more, in mid-motion.
  rig.Tick();
  EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
  EXPECT_EQ(rig.output.record.reaction, Reaction::kDamp);
  rig.Tick(OperatorCommand::kGoHome);
  EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kWrongState);
}

TEST_F(SequenceTest, RefusesGraphsThatDoNotHoldTogether) {
  const Sequence<float> gait = Gait();
  const std::vector<Primitive<float>> primitives(gait.primitives.begin(),
                                                 gait.primitives.begin() + gait.primitive_count);
  const auto configured = [&](const auto& change) {
    SequenceGraph<float> graph = gait.graph;
    ExecutorConfig config;
    change(graph, config);
    return ExecutorRig(config, graph, primitives).configured;
  };
  EXPECT_EQ(configured([](auto&, auto&) {}), Status::kOk);
  EXPECT_EQ(configured([](auto& g, auto&) { g.node_storage[1].primitive = 3; }),
            Status::kInvalidArgument);
  EXPECT_EQ(configured([](auto& g, auto&) { g.edge_storage[0].to = 5; }), Status::kInvalidArgument);
  EXPECT_EQ(configured([](auto& g, auto&) { g.edge_storage[0].settle_s = -1; }),
            Status::kInvalidArgument);
  EXPECT_EQ(configured([](auto&, auto& c) { c.branch = 99; }), Status::kInvalidArgument);
}

}  // namespace
}  // namespace tumbler
