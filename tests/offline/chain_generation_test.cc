// Finds the gait's chain from nothing: every motion, each from the simulated exit of the one
// before. Then plays the gait, and the roll out of a handstand.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "common/files/primitive_hash.h"
#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "offline/certify/chain.h"
#include "tests/support/files.h"
#include "tests/support/sequence_files.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::ReadFile;
using testing::SequenceFolder;

/// A file of the motions that are found for the model alone.
std::string Nominal(const std::string& name) {
  return testing::SourcePath("primitives/nominal/") + name + ".toml";
}
std::string NominalTask(const std::string& name) {
  return testing::SourcePath("primitives/tasks/nominal/") + name + ".toml";
}

PrimitiveFile Find(const Task& task) {
  SolveOptions options;
  options.threads = 2;
  const SolveOutcome outcome = Solve(task.problem, options);
  EXPECT_TRUE(outcome.solutions.at(0).feasible()) << task.problem.name;
  return MakePrimitiveFile(task, outcome, outcome.solutions.at(0));
}

/// Finds handstand, downstand and roll, and returns the nominal sequence of them.
SequenceFile FindTheGait() {
  const PrimitiveFile handstand = Find(LoadTask(NominalTask("handstand")));
  const auto after_it = [&handstand](const std::string& name) {
    return Find(LoadTask(NominalTask(name), handstand, "handstand.toml"));
  };
  const SequenceFolder folder(ReadFile(Nominal("gait")),
                              {handstand, after_it("downstand"), after_it("roll")});
  return LoadSequence(folder.file());
}

void GoesTwentyCycles(const SequenceFile& gait) {
  ChainOptions options;
  options.cycles = 20;
  const ChainOutcome outcome = SimulateChain(SimulatedMotion(gait), options);
  ASSERT_FALSE(outcome.failure) << ToString(outcome.failure->cause) << ": "
                                << outcome.failure->text;
  EXPECT_EQ(outcome.cycles, 20);
  ASSERT_EQ(outcome.passages.size(), 40U);
  double turned = 0;
  for (std::size_t i = 0; i < outcome.passages.size(); ++i) {
    const PlayedNode& passage = outcome.passages[i];
    EXPECT_EQ(passage.posture, i % 2 == 0 ? Posture::kUpright : Posture::kLevel) << i;
    EXPECT_EQ(gait.graph.node(passage.node).swapped, i % 4 >= 2) << i;
    turned += passage.turned_rad;
    // The robot is at rest within 0.05 rad of the target, a quarter turn further each time.
    EXPECT_NEAR(turned, std::numbers::pi / 2 * static_cast<double>(i + 1), 0.05) << i;
    EXPECT_LT(passage.exit_speed, 0.05) << i;
  }
}

void RollsOutOfTheHandstandInEitherRole(const SequenceFile& gait) {
  for (const int cycles : {0, 1}) {
    ChainOptions options;
    options.cycles = cycles;
    options.branch = "roll";
    const ChainOutcome outcome = SimulateChain(SimulatedMotion(gait), options);
    ASSERT_FALSE(outcome.failure) << outcome.failure->text;
    const PlayedNode& roll = outcome.passages.back();
    EXPECT_EQ(gait.PrimitiveOf(roll.node).primitive.name.view(), "roll");
    EXPECT_EQ(gait.graph.node(roll.node).swapped, cycles == 1);
    EXPECT_GT(roll.turned_rad, std::numbers::pi - 0.05) << "a half turn further";
    EXPECT_LT(roll.travelled_m, -0.1) << "to the left";
  }
}

void EveryMotionStartsAtTheSimulatedExitOfTheOneBefore(const SequenceFile& gait) {
  for (const JoinComparison& join : CompareJoins(gait)) {
    const auto& edge = gait.graph.edge(join.edge);
    // The first handstand starts from the ideal rest, and a downstand ends there except for the
    // remains of its rocking. The others start where the handstand ends, to the last bit.
    const bool from_handstand = gait.PrimitiveOf(edge.from).primitive.name.view() == "handstand";
    EXPECT_NEAR(join.difference, 0, from_handstand ? 1e-12 : join.tolerance)
        << Describe(gait, join);
  }
}

void AMotionSpoiltIsAFallThatIsSeen(SequenceFile file) {
  // The legs swing only half as far on their way into the handstand.
  for (JointMotion<double>& motion : file.primitives[0].primitive.joints) {
    std::vector<double> points(motion.position.control_points().begin(),
                               motion.position.control_points().end());
    const std::vector<double> knots(motion.position.knots().begin(), motion.position.knots().end());
    for (std::size_t i = 3; i + 3 < points.size(); ++i) points[i] *= 0.5;
    ASSERT_EQ(motion.position.Assign(motion.position.degree(), knots, points), Status::kOk);
  }
  const ChainOutcome outcome = SimulateChain(SimulatedMotion(file), {});
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->node, 0);
  EXPECT_GT(outcome.failure->time_s, 0);
  EXPECT_LE(outcome.failure->time_s,
            file.primitives[0].primitive.duration_s + file.graph.edge(0).settle_s + 1e-9)
      << "at the latest when the next one would begin";
}

void Holds(const SequenceFile& gait) {
  GoesTwentyCycles(gait);
  RollsOutOfTheHandstandInEitherRole(gait);
  EveryMotionStartsAtTheSimulatedExitOfTheOneBefore(gait);
}

void StaysInsideItsTorqueLimits(const SequenceFile& gait) {
  ChainOptions options;
  options.cycles = 20;
  options.branch = "roll";
  for (const PlayedNode& passage : SimulateChain(SimulatedMotion(gait), options).passages)
    EXPECT_GT(passage.torque_margin_nm, 0) << gait.graph.node(passage.node).name.view();
}

// The gait is a single case, because finding the motions takes most of the time.
TEST(Gait, IsFoundFromNothingAndHolds) {
  const SequenceFile gait = FindTheGait();
  Holds(gait);
  AMotionSpoiltIsAFallThatIsSeen(gait);
}

TEST(Gait, AsShippedComesBackInEveryCycleAndStandsOnOneLeg) {
  const SequenceFile gait = LoadSequence(testing::SourcePath("primitives/gait.toml"));
  ChainOptions options;
  options.cycles = 20;
  options.branch = "roll";
  const ChainOutcome outcome = SimulateChain(SimulatedMotion(gait), options);
  ASSERT_FALSE(outcome.failure) << outcome.failure->text;
  EXPECT_EQ(outcome.cycles, 20);
  ASSERT_EQ(outcome.passages.size(), 42U);
  for (std::size_t i = 0; i < 40; ++i) {
    const PlayedNode& passage = outcome.passages[i];
    EXPECT_EQ(passage.posture, i % 2 == 0 ? Posture::kUpright : Posture::kLevel) << i;
    EXPECT_FALSE(gait.graph.node(passage.node).swapped) << i;
    EXPECT_NEAR(passage.turned_rad, i % 2 == 0 ? std::numbers::pi / 2 : -std::numbers::pi / 2, 0.05)
        << i;
    EXPECT_LT(passage.exit_speed, 0.05) << i;
  }
  EXPECT_EQ(gait.PrimitiveOf(outcome.passages.back().node).primitive.name.view(), "roll");
  StaysInsideItsTorqueLimits(gait);
}

TEST(Gait, TheShippedCartwheelHolds) {
  const SequenceFile gait = LoadSequence(testing::SourcePath("primitives/cartwheel.toml"));
  GoesTwentyCycles(gait);
  RollsOutOfTheHandstandInEitherRole(gait);
  StaysInsideItsTorqueLimits(gait);
}

/// A leg that is pushed against the ground by what is left of a landing stays off its setpoint, and
/// the next handstand begins there.
TEST(Gait, NoTorqueIsHeldAgainstTheGroundBetweenItsMotions) {
  for (const std::string name : {"downstand", "downstand_back", "downstand_back_mirrored"}) {
    const PrimitiveFile file = LoadPrimitive(testing::SourcePath("primitives/" + name + ".toml"));
    for (int j = 0; j < file.primitive.joint_count; ++j) {
      const auto& torque = file.primitive.joints[static_cast<std::size_t>(j)].torque;
      EXPECT_NEAR(torque.control_points().back(), 0, 0.01) << name;
    }
  }
}

TEST(Gait, TheNominalOneHolds) {
  const SequenceFile gait = LoadSequence(Nominal("gait"));
  Holds(gait);
  AMotionSpoiltIsAFallThatIsSeen(gait);
  StaysInsideItsTorqueLimits(gait);
}

/// Every primitive of the tumbler says from which files beside it it was made.
TEST(Gait, PrimitivesWereMadeFromTheTasksAndTheRobotBesideThem) {
  const std::string folder = testing::SourcePath("");
  const std::string robot = HashOfText(ReadFile(folder + "primitives/robots/tumbler.urdf"));
  for (const std::string name :
       {"handstand", "handstand_wide", "handstand_sensor", "handstand_sensor_mirrored", "downstand",
        "downstand_back", "downstand_back_mirrored", "roll", "roll_sensor", "stand", "rise",
        "rise_from_leg1", "rise_from_leg2", "nominal/handstand", "nominal/downstand",
        "nominal/roll"}) {
    const Provenance made =
        LoadPrimitive(fmt::format("{}primitives/{}.toml", folder, name)).provenance;
    EXPECT_EQ(made.task_file, fmt::format("primitives/tasks/{}.toml", name));
    EXPECT_EQ(made.task_hash, HashOfText(ReadFile(folder + made.task_file))) << name;
    EXPECT_EQ(made.robot_hash, robot) << name;
    EXPECT_EQ(HashOfText(ReadFile(folder + made.robot_file)), robot) << name;
  }
}

}  // namespace
}  // namespace tumbler
