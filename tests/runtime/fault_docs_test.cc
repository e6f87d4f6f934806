// Compares the tables of docs/runtime.md with those of the code.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "runtime/executor/faults.h"
#include "tests/support/docs_tables.h"
#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"
#include "tests/support/sensor_motion.h"

namespace tumbler {
namespace {

using testing::MarkdownHead;
using testing::MarkdownRow;

std::string States() {
  std::string text = MarkdownHead({"state", "setpoints", "leads to"});
  for (const StateInfo& state : kStateTable) {
    std::string next;
    for (const TransitionInfo& transition : kTransitionTable) {
      if (transition.from != state.state) continue;
      next += (next.empty() ? "" : "; ") + std::string(ToString(transition.to)) + " (" +
              transition.when + ")";
    }
    text += MarkdownRow({state.name, state.setpoints, next});
  }
  return text;
}

std::string Faults() {
  std::string text = MarkdownHead({"fault", "seen when", "value, limit", "limit set by"});
  for (const FaultInfo& fault : kFaultTable) {
    if (fault.fault == Fault::kNone) continue;
    const std::string key = fault.limit_key;
    text +=
        MarkdownRow({fault.name, fault.seen_when, fault.value, key.empty() ? "" : "`" + key + "`"});
  }
  return text;
}

std::string Reactions() {
  std::string text = MarkdownHead({"reaction", "what the drives are sent"});
  for (const ReactionInfo& reaction : kReactionTable)
    text += MarkdownRow({reaction.name, reaction.meaning});
  return text;
}

std::string Answers() {
  std::vector<std::string> head = {"fault \\ state"};
  for (const StateInfo& state : kStateTable) {
    if (state.state != ExecutorState::kDisarmed) head.emplace_back(state.name);
  }
  head.emplace_back("why");
  std::string text = MarkdownHead(head);
  const FaultTable table;
  for (const FaultInfo& fault : kFaultTable) {
    if (fault.fault == Fault::kNone) continue;
    std::vector<std::string> cells = {fault.name};
    for (const StateInfo& state : kStateTable) {
      if (state.state == ExecutorState::kDisarmed) continue;
      cells.emplace_back(ToString(table(fault.fault, state.state)));
    }
    cells.emplace_back(fault.why);
    text += MarkdownRow(cells);
  }
  return text;
}

TEST(FaultDocs, TheTablesOfTheDocumentAreThoseOfTheCode) {
  const std::string source = "runtime/executor/faults.h";
  testing::ExpectTables("docs/runtime.md", {{source, "states", States()},
                                            {source, "faults", Faults()},
                                            {source, "reactions", Reactions()},
                                            {source, "answers", Answers()}});
}

/// Whether the table has this change of state.
bool IsStated(ExecutorState from, ExecutorState to) {
  if (from == to || to == ExecutorState::kDisarmed) return true;
  if (to == ExecutorState::kFault) return from != ExecutorState::kDisarmed;
  for (const TransitionInfo& transition : kTransitionTable) {
    if (transition.from == from && transition.to == to) return true;
  }
  return false;
}

TEST(FaultDocs, TheExecutorMakesEveryStatedTransitionAndNoOther) {
  std::mt19937 random(5);
  testing::MotionShape shape;
  shape.duration_s = 0.05;
  shape.settle_s = 0.01;
  shape.amplitude_rad = 0.02;
  const Primitive<float> motion = testing::RandomPrimitive<float>(shape, random);
  // There are two nodes in a row, so that settling leads to running, too.
  SequenceGraph<float> graph = GraphOf(motion);
  graph.node_count = 2;
  graph.node_storage[1] = graph.node_storage[0];
  graph.edge_count = 1;
  graph.edge_storage[0].to = 1;
  graph.edge_storage[0].settle_s = 0.005F;
  // Either may be begun with, as the robot lies, and a sensor says that it falls now and then.
  graph.beginning_count = 2;
  graph.beginning_storage[1] = {1, 3};
  graph.beginning_within_rad = 0.5F;
  Primitive<float> circle = motion;  // It ends where it begins.
  for (std::size_t i = 0; i < 2; ++i) {
    auto& path = circle.joints[i].position;
    std::vector<float> points(path.control_points().begin(), path.control_points().end());
    for (std::size_t k = points.size() - 3; k < points.size(); ++k) points[k] = points[0];
    const std::vector<float> knots(path.knots().begin(), path.knots().end());
    ASSERT_EQ(path.Assign(5, knots, points), Status::kOk);
    circle.joints[i].limits.acceleration_max_rad_s2 = 1e4F;
    circle.joints[i].limits.velocity_max_rad_s = 50;
  }
  ExecutorConfig config;
  config.move_fraction = 1;
  config.get_ups_max = 1000;
  testing::ExecutorRig rig(config, graph, {circle});
  XsensMti sensor;
  rig.sensor.device = &sensor;
  rig.sensor.settings.repeats_max = 0;
  rig.sensor.settings.jump_max_rad = 10;
  rig.Reconfigure();
  ASSERT_EQ(rig.configured, Status::kOk);
  std::array<std::array<int, kExecutorStateCount>, kExecutorStateCount> seen{};
  const std::array wishes{
      OperatorCommand::kArm,    OperatorCommand::kMoveToStart, OperatorCommand::kRun,
      OperatorCommand::kStop,   OperatorCommand::kDisarm,      OperatorCommand::kClearFaults,
      OperatorCommand::kFinish, OperatorCommand::kArm,         OperatorCommand::kClearFaults,
      OperatorCommand::kRun,    OperatorCommand::kRun,         OperatorCommand::kMoveToStart,
      OperatorCommand::kGoHome, OperatorCommand::kGoHome,      OperatorCommand::kStop};
  for (int i = 0; i < 1'500'000; ++i) {
    const ExecutorState before = rig.executor.state();
    OperatorCommand wish = OperatorCommand::kNone;
    if (random() % 40 == 0) wish = wishes[random() % wishes.size()];
    if (wish == OperatorCommand::kDisarm && random() % 4 != 0) wish = OperatorCommand::kRun;
    if (random() % 2000 == 0) rig.input.tick += 7;
    if (i % 64 == 0) rig.sensor_frames = testing::SensorFrames(random() % 4 == 0 ? 3 : 0, 0);
    const TickRecord& record = rig.Tick(wish);
    // A tick can change the state several times: by the faults that it finds, by the command, and
    // by its frames.
    const bool by_way_of_a_fault = wish == OperatorCommand::kGoHome &&
                                   before != ExecutorState::kDisarmed &&
                                   record.state == ExecutorState::kSettling;
    ASSERT_TRUE(by_way_of_a_fault || IsStated(before, record.state))
        << ToString(before) << ToString(record.state);
    ASSERT_TRUE(IsStated(record.state, rig.executor.state()))
        << ToString(record.state) << ToString(rig.executor.state());
    ++seen[static_cast<std::size_t>(before)][static_cast<std::size_t>(record.state)];
    ++seen[static_cast<std::size_t>(record.state)][static_cast<std::size_t>(rig.executor.state())];
  }
  for (const TransitionInfo& transition : kTransitionTable) {
    const int count =
        seen[static_cast<std::size_t>(transition.from)][static_cast<std::size_t>(transition.to)];
    EXPECT_GT(count, 0) << ToString(transition.from) << " to " << ToString(transition.to);
  }
}

}  // namespace
}  // namespace tumbler
