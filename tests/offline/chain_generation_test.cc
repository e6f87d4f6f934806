// The gait's chain, from nothing: every motion found, each from the simulated exit of the one
// before, and then the gait and the roll out of a handstand.

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "common/toml_reader.h"
#include "offline/certificate/certificate.h"
#include "offline/chain/chain.h"
#include "tests/support/sequence_files.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::ReadFile;
using testing::Replaced;
using testing::SequenceFolder;
using testing::TaskFolder;

constexpr double kPi = std::numbers::pi;

/// The shipped handstand on a thicker layer, which the landings need.
std::string Handstand() {
  std::string text = testing::ShippedTask();
  const std::size_t from = text.find("[contact]");
  return text.replace(from, text.find("[[obstacle]]") - from,
                      "[contact]\nstiffness_n_per_m = 2.0e4\ndamping_n_s_per_m = 90.0\n"
                      "d_on_m = 0.010\nd_off_m = 0.0075\nmu = 0.3\nv_max_m_per_s = 0.05\n\n");
}

/// The same robot and ground, from the handstand down onto the other side.
std::string AfterIt(const std::string& name, const std::string& costs) {
  std::string text = Replaced(Handstand(), "name = \"handstand\"", "name = \"" + name + "\"");
  text = Replaced(text, "pitch_rad = 0.0", "pitch_rad = 1.5707963267948966");
  text = Replaced(text, "leg1 = 0.0, leg2 = 0.0",
                  "leg1 = 1.5707963267948966, leg2 = -1.5707963267948966", "[end]");
  text = Replaced(text, "leg1 = -1.5707963267948966, leg2 = 1.5707963267948966",
                  "leg1 = 0.0, leg2 = 0.0");
  const std::size_t from = text.find("[[cost]]");
  text.replace(from, text.find("[contact]") - from, costs);
  return Replaced(text, "seed = 1",
                  "seed = 1\ncore_penalty = 5.0\nbatch = 500\npromising = 30\nrefine = 10");
}

std::string Cost(const std::string& term, const std::string& of, double weight,
                 const std::string& more = "") {
  return "[[cost]]\nterm = \"" + term + "\"\nof = \"" + of +
         "\"\nwhen = \"settled\"\nweight = " + ExactDecimal(weight) + "\n" + more + "\n";
}

/// Level again and at rest.
std::string Downstand() {
  return AfterIt("downstand", Cost("terminal", "pitch", 1, "target = 3.141592653589793\n") +
                                  Cost("terminal", "pitch_rate", 0.1) +
                                  "[[cost]]\nterm = \"effort\"\nweight = 1.0e-4\n\n");
}

/// As far round and to the left as it goes.
std::string Roll() {
  return Replaced(
      AfterIt("roll", Cost("terminal-linear", "x", 0.5) + Cost("terminal-linear", "pitch", -1) +
                          Cost("terminal", "pitch_rate", 0.01) +
                          "[[cost]]\nterm = \"effort\"\nweight = 1.0e-4\n\n"),
      "duration_s = 1.2\nsettle_s = 0.3", "duration_s = 2.0\nsettle_s = 0.5");
}

PrimitiveFile Find(const Task& task) {
  SolveOptions options;
  options.threads = 2;
  const SolveOutcome outcome = Solve(task.problem, options);
  EXPECT_TRUE(outcome.solutions.at(0).feasible()) << task.problem.name;
  return MakePrimitiveFile(task, outcome, outcome.solutions.at(0));
}

/// Handstand, downstand and roll, and the shipped sequence of them.
SequenceFile FindTheGait() {
  const TaskFolder first(Handstand());
  const PrimitiveFile handstand = Find(LoadTask(first.task_file()));
  const auto after_it = [&handstand](const std::string& task) {
    const TaskFolder next(task);
    return Find(LoadTask(next.task_file(), handstand, "handstand.toml"));
  };
  const SequenceFolder folder(ReadFile(TUMBLER_SOURCE_DIR "/primitives/gait.toml"),
                              {handstand, after_it(Downstand()), after_it(Roll())});
  return LoadSequence(folder.file());
}

void GoesTwentyCycles(const SequenceFile& gait) {
  ChainOptions options;
  options.cycles = 20;
  const ChainOutcome outcome = SimulateChain(gait, options);
  ASSERT_FALSE(outcome.failure) << ToString(outcome.failure->cause) << ": "
                                << outcome.failure->text;
  EXPECT_EQ(outcome.cycles, 20);
  ASSERT_EQ(outcome.passages.size(), 40U);
  double turned = 0;
  for (std::size_t i = 0; i < outcome.passages.size(); ++i) {
    const Passage& passage = outcome.passages[i];
    EXPECT_EQ(passage.posture, i % 2 == 0 ? Posture::kUpright : Posture::kLevel) << i;
    EXPECT_EQ(gait.graph.node(passage.node).swapped, i % 4 >= 2) << i;
    turned += passage.turned_rad;
    // At rest within 0.05 rad of the target: a quarter turn further each time.
    EXPECT_NEAR(turned, kPi / 2 * static_cast<double>(i + 1), 0.05) << i;
    EXPECT_LT(passage.exit_speed, 0.05) << i;
  }
}

void RollsOutOfTheHandstandInEitherRole(const SequenceFile& gait) {
  for (const int cycles : {0, 1}) {
    ChainOptions options;
    options.cycles = cycles;
    options.branch = "roll";
    const ChainOutcome outcome = SimulateChain(gait, options);
    ASSERT_FALSE(outcome.failure) << outcome.failure->text;
    const Passage& roll = outcome.passages.back();
    EXPECT_EQ(gait.PrimitiveOf(roll.node).primitive.name.view(), "roll");
    EXPECT_EQ(gait.graph.node(roll.node).swapped, cycles == 1);
    EXPECT_GT(roll.turned_rad, kPi - 0.05) << "a half turn further";
    EXPECT_LT(roll.travelled_m, -0.1) << "to the left";
  }
}

void EveryMotionStartsAtTheSimulatedExitOfTheOneBefore(const SequenceFile& gait) {
  for (const JoinComparison& join : CompareJoins(gait)) {
    const auto& edge = gait.graph.edge(join.edge);
    // The first handstand starts from the ideal rest; a downstand ends there but for what is left
    // of its own rocking. The others start where the handstand ends, to the last bit.
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
  const ChainOutcome outcome = SimulateChain(file, {});
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->node, 0);
  EXPECT_GT(outcome.failure->time_s, 0);
  EXPECT_LE(outcome.failure->time_s,
            file.primitives[0].primitive.duration_s + file.graph.edge(0).settle_s + 1e-9)
      << "at the latest when the next one would begin";
}

// One case, because finding the motions takes most of its time.
TEST(Gait, IsFoundFromNothingAndHolds) {
  const SequenceFile gait = FindTheGait();
  GoesTwentyCycles(gait);
  RollsOutOfTheHandstandInEitherRole(gait);
  EveryMotionStartsAtTheSimulatedExitOfTheOneBefore(gait);
  AMotionSpoiltIsAFallThatIsSeen(gait);
}

}  // namespace
}  // namespace tumbler
