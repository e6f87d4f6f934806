// Sequences in simulation, compared with the rollouts that the primitives were made with and with
// chains in exchanged roles; and the messages about chains that do not hold.

#include "offline/certify/chain.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "common/files/json.h"
#include "common/files/primitive_hash.h"
#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "offline/pages/motion_report.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/sequence_files.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::QuickTask;
using testing::ReadFile;
using testing::Replaced;
using testing::SequenceFolder;
using testing::ShippedRobot;
using testing::TaskFolder;

constexpr double kPi = std::numbers::pi;

/// A primitive whose joints follow straight lines from start to end. It needs no search, and is
/// slow enough for the robot to stay on both feet.
PrimitiveFile StraightLine(const Task& task) {
  const Problem& problem = task.problem;
  Solution solution;
  for (const ActuatedJoint& joint : problem.joints) {
    const int points = joint.free_points();
    for (int i = 0; i < points; ++i) {
      solution.x.push_back(joint.start_rad +
                           (i + 1.0) / (points + 1.0) * (joint.end_rad - joint.start_rad));
    }
  }
  return MakePrimitiveFile(task, {}, solution);
}

std::string TaskThere() {
  return Replaced(QuickTask(), "name = \"handstand\"", "name = \"there\"");
}
std::string SecondTask() {
  std::string text =
      Replaced(QuickTask(), "leg1 = -1.5707963267948966, leg2 = 1.5707963267948966", "START");
  text = Replaced(text, "leg1 = -1.2, leg2 = 1.3",
                  "leg1 = -1.5707963267948966, leg2 = 1.5707963267948966");
  text = Replaced(text, "START", "leg1 = -1.2, leg2 = 1.3");
  return Replaced(text, "name = \"handstand\"", "name = \"back\"");
}

/// Two primitives on both feet: the legs move from home to another shape, and back from where the
/// first motion leaves the robot.
const std::vector<PrimitiveFile>& ThereAndBack() {
  static const std::vector<PrimitiveFile> files = [] {
    const PrimitiveFile there =
        StraightLine(ParseTask(TaskThere(), "task.toml", ShippedRobot(), "robot.urdf"));
    const TaskFolder folder(SecondTask());
    return std::vector{there, StraightLine(LoadTask(folder.task_file(), there, "there.toml"))};
  }();
  return files;
}

std::string Node(const std::string& name, const std::string& primitive, const std::string& more) {
  return "[[node]]\nname = \"" + name + "\"\nprimitive = \"" + primitive + "\"\nsafe = true\n" +
         more;
}
std::string Edge(const std::string& from, const std::string& to, const std::string& more) {
  return "[[edge]]\nfrom = \"" + from + "\"\nto = \"" + to + "\"\n" + more;
}
std::string Head(const std::string& start) {
  return "format = \"tumbler-sequence\"\nversion = 1\nname = \"sway\"\nstart = \"" + start +
         "\"\n[primitives]\nthere = \"there.toml\"\nback = \"back.toml\"\n"
         "[swap]\njoints = [[\"leg1\", \"leg2\"]]\nroot_pitch_rad = 3.141592653589793\n";
}
/// A sequence there and back for ever, in one role.
std::string Sway(const std::string& role = "") {
  return Head("there") + Node("there", "there", role) +
         Node("back", "back", role + "ends_cycle = true\n") +
         Edge("there", "back", "settle_s = 2\n") + Edge("back", "there", "settle_s = 2\n");
}

SequenceFile Load(const std::string& text,
                  const std::vector<PrimitiveFile>& files = ThereAndBack()) {
  const SequenceFolder folder(text, files);
  return ReadSequence(folder.file());
}

ChainOptions Cycles(int cycles, const std::string& branch = "") {
  ChainOptions options;
  options.cycles = cycles;
  options.branch = branch;
  return options;
}

TEST(SimulateChain, PlaysWhatTheRolloutOfThePrimitiveDoes) {
  const SequenceFile file = Load(Sway());
  const ChainOutcome outcome = SimulateChain(SimulatedMotion(file), Cycles(1));
  ASSERT_FALSE(outcome.failure) << outcome.failure->text;
  ASSERT_EQ(outcome.passages.size(), 2U);
  EXPECT_EQ(outcome.cycles, 1);
  EXPECT_NEAR(outcome.duration_s, 2 * (0.5 + 2), 1e-12);
  // Each was made with this hold, and the second starts where the simulation of the first ended.
  for (std::size_t i = 0; i < 2; ++i) {
    const PlayedNode& passage = outcome.passages[i];
    const PrimitiveFile& made = ThereAndBack()[i];
    EXPECT_NEAR(passage.entry_z_error_m, 0, 1e-7);
    EXPECT_NEAR(passage.entry_pitch_error_rad, 0, 1e-6);
    EXPECT_NEAR(passage.exit_z_error_m, 0, 1e-7);
    EXPECT_NEAR(passage.exit_pitch_error_rad, 0, 1e-6);
    EXPECT_NEAR(passage.travelled_m, made.exit.root_x_m - made.entry.root_x_m, 1e-5);
    EXPECT_NEAR(passage.peak_torque_nm, made.certificate.peak_torque_nm, 1e-3);
    EXPECT_NEAR(passage.torque_margin_nm, made.certificate.torque_margin_nm, 1e-3);
    EXPECT_NEAR(passage.peak_penetration_m, made.certificate.peak_penetration_m, 1e-6);
    EXPECT_EQ(passage.posture, Posture::kLevel);
  }
  EXPECT_GT(std::abs(outcome.passages[0].travelled_m), 1e-3) << "or the sum says nothing";
  EXPECT_NEAR(outcome.travelled_m,
              outcome.passages[0].travelled_m + outcome.passages[1].travelled_m, 1e-12);
}

TEST(SimulateChain, CarriesTheStateThroughJoinsAndHolds) {
  const SequenceFile file = Load(Sway());
  std::vector<MotionSample> samples;
  std::vector<int> nodes;
  const ChainOutcome outcome =
      SimulateChain(SimulatedMotion(file), Cycles(3), [&](int node, const MotionSample& sample) {
        samples.push_back(sample);
        nodes.push_back(node);
      });
  ASSERT_FALSE(outcome.failure);
  EXPECT_EQ(outcome.passages.size(), 6U);
  for (std::size_t k = 1; k < samples.size(); ++k) {
    const double h = samples[k].time_s - samples[k - 1].time_s;
    ASSERT_GT(h, 0);
    ASSERT_LT(h, 1.001e-3);
    for (std::size_t i = 0; i < 5; ++i) {  // By the trapezoidal rule there is no jump anywhere.
      const double moved = 0.5 * h * (samples[k].qd[i] + samples[k - 1].qd[i]);
      ASSERT_NEAR(samples[k].q[i] - samples[k - 1].q[i], moved, 1e-4) << samples[k].time_s;
    }
    if (nodes[k] != nodes[k - 1]) {
      EXPECT_NEAR(samples[k].q[3], samples[k - 1].q[3], 1e-12);
    }
  }
}

TEST(SimulateChain, ExchangedRolesAreTheSameMotionTurned) {
  const SequenceFile plain = Load(Sway());
  const SequenceFile swapped = Load(Sway("swapped = true\n"));
  std::vector<MotionSample> a, b;
  const auto keep = [](std::vector<MotionSample>& list) {
    return [&list](int, const MotionSample& sample) { list.push_back(sample); };
  };
  SimulateChain(SimulatedMotion(plain), Cycles(1), keep(a));
  SimulateChain(SimulatedMotion(swapped), Cycles(1), keep(b));
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); ++k) {
    ASSERT_NEAR(b[k].q[0], a[k].q[0], 1e-9);
    ASSERT_NEAR(b[k].q[1], a[k].q[1], 1e-9);
    ASSERT_NEAR(b[k].q[2], a[k].q[2] + kPi, 1e-9);
    ASSERT_EQ(b[k].q[3], a[k].q[4]) << "leg 1 does what leg 2 did";
    ASSERT_EQ(b[k].q[4], a[k].q[3]);
    ASSERT_NEAR(b[k].torque[0], a[k].torque[1], 1e-6);
  }
}

TEST(SimulateChain, DoesNotTakeTheRobotsSymmetryForGranted) {
  // With one leg heavier, the robot turned round is another robot.
  std::vector<PrimitiveFile> files = ThereAndBack();
  for (PrimitiveFile& file : files) {
    file.provenance.robot_urdf =
        Replaced(ShippedRobot(), "mass value=\"0.4\"", "mass value=\"0.5\"");
    file.provenance.robot_hash = HashOfText(file.provenance.robot_urdf);
  }
  SequenceFile plain = Load(Sway(), files);
  SequenceFile swapped = Load(Sway("swapped = true\n"), files);
  for (SequenceFile* file : {&plain, &swapped}) file->tolerances = {1, 1, 1, 1, 1};
  for (SequenceFile* file : {&plain, &swapped}) file->exit_pitch_tolerance_rad = {1, 1};
  const ChainOutcome a = SimulateChain(SimulatedMotion(plain), Cycles(1));
  const ChainOutcome b = SimulateChain(SimulatedMotion(swapped), Cycles(1));
  ASSERT_EQ(a.passages.size(), b.passages.size());
  EXPECT_GT(std::abs(a.passages[0].exit_pitch_error_rad - b.passages[0].exit_pitch_error_rad),
            1e-5);
}

TEST(SimulateChain, HalvingTheStepChangesLittle) {
  const SequenceFile file = Load(Sway());
  ChainOptions fine = Cycles(2);
  fine.step_s = 0.5e-3;
  const ChainOutcome a = SimulateChain(SimulatedMotion(file), Cycles(2));
  const ChainOutcome b = SimulateChain(SimulatedMotion(file), fine);
  EXPECT_NE(a.travelled_m, b.travelled_m);
  EXPECT_NEAR(a.travelled_m, b.travelled_m, 1e-5);
}

TEST(SimulateChain, CountsCyclesAndTakesTheBranchWhenTheyAreDone) {
  const std::string text =
      Sway() + Node("away", "there", "") +
      Edge("back", "away", "settle_s = 2\nwhen = \"branch\"\nbranch = \"go\"\n");
  const SequenceFile file = Load(text);
  const auto nodes = [&file](const ChainOptions& options) {
    std::string names;
    const ChainOutcome outcome = SimulateChain(SimulatedMotion(file), options);
    for (const PlayedNode& passage : outcome.passages)
      names += std::string(file.graph.node(passage.node).name.view()) + " ";
    return names + (outcome.failure ? outcome.failure->text : "");
  };
  EXPECT_EQ(nodes(Cycles(2)), "there back there back ");
  EXPECT_EQ(nodes(Cycles(2, "go")), "there back there back away ");
  EXPECT_EQ(nodes(Cycles(0, "go")), "there back away ");
  EXPECT_THROW(SimulateChain(SimulatedMotion(file), Cycles(2, "gone")), std::invalid_argument);
  EXPECT_THROW(SimulateChain(SimulatedMotion(file), Cycles(0)), FileError) << "it would never end";
}

TEST(SimulateChain, WithoutAnEndOfACycleALoopIsRefused) {
  const std::string text = Replaced(Sway(), "ends_cycle = true\n", "");
  const SequenceFile file = Load(text);
  EXPECT_THROW(SimulateChain(SimulatedMotion(file), Cycles(1)), FileError);
}

TEST(SimulateChain, ALoopIsRefusedByTheFileAndLineOfANodeOnIt) {
  const SequenceFolder folder(Replaced(Sway(), "ends_cycle = true\n", ""), ThereAndBack());
  const std::string file = folder.file().string();
  for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{
           {"tumbler", "chain", "simulate", file},
           {"tumbler", "export", file, "--setpoints-csv", "-", "--cycles", "1"}}) {
    const testing::Outcome outcome = testing::RunProgram(command);
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_THAT(outcome.text, ::testing::ContainsRegex("tumbler [a-z]+: " + file +
                                                       ":[1-9][0-9]*: node\\[[01]\\]: '(there|"
                                                       "back)' is played again and again"));
  }
}

/// The failure that ended a chain of these changed primitives.
ChainFailure FailureOf(const std::vector<PrimitiveFile>& files) {
  const ChainOutcome outcome = SimulateChain(SimulatedMotion(Load(Sway(), files)), Cycles(1));
  EXPECT_TRUE(outcome.failure);
  return outcome.failure.value_or(ChainFailure{});
}

TEST(SimulateChain, AnExitElsewhereThanRecordedIsAFailure) {
  auto files = ThereAndBack();
  files[1].exit.root_pitch_rad += 0.1;
  const ChainFailure failure = FailureOf(files);
  EXPECT_EQ(failure.cause, ChainFailure::Cause::kExit);
  EXPECT_EQ(failure.node, 1);
  EXPECT_NEAR(failure.time_s, 5, 1e-9);
  EXPECT_THAT(failure.text, AllOf(HasSubstr("-0.1 rad"), HasSubstr("allowed: 0.02 rad")));
}

TEST(SimulateChain, ARobotFarFromThePlanHasFallenAndIsSeenAtOnce) {
  auto files = ThereAndBack();
  files[1].entry.root_pitch_rad += 0.6;  // The plan begins tilted, but the chain arrives level.
  SequenceFile file = Load(Sway(), files);
  file.tolerances.root_pitch_rad = 1;
  const ChainOutcome outcome = SimulateChain(SimulatedMotion(file), Cycles(1));
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->cause, ChainFailure::Cause::kFallen);
  EXPECT_EQ(outcome.failure->node, 1);
  EXPECT_NEAR(outcome.failure->time_s, 2.5, 1e-9);
  EXPECT_THAT(outcome.failure->text, AllOf(HasSubstr("-0.6 rad from the plan")));
}

TEST(SimulateChain, AnEntryThatDoesNotFitIsAFailure) {
  auto files = ThereAndBack();
  files[1].entry.root_z_m += 0.004;
  const ChainFailure failure = FailureOf(files);
  EXPECT_EQ(failure.cause, ChainFailure::Cause::kEntry);
  EXPECT_EQ(failure.node, 1);
  EXPECT_NEAR(failure.time_s, 2.5, 1e-9);
  EXPECT_THAT(failure.text, AllOf(HasSubstr("height: -0.004 m"), HasSubstr("allowed: 0.002 m")));
}

TEST(SimulateChain, ATouchThatIsNotInThePlanIsAFailure) {
  auto files = ThereAndBack();
  std::erase_if(files[0].contacts, [](const ContactInterval& contact) {
    return contact.shape.starts_with("leg2_link");
  });
  const ChainFailure failure = FailureOf(files);
  EXPECT_EQ(failure.cause, ChainFailure::Cause::kTouch);
  EXPECT_EQ(failure.time_s, 0) << "it stands on it";
  EXPECT_THAT(failure.text, AllOf(HasSubstr("leg2_link/"), HasSubstr("touches ground")));
  // In the exchanged role it concerns the other leg.
  const ChainOutcome swapped =
      SimulateChain(SimulatedMotion(Load(Sway("swapped = true\n"), files)), Cycles(1));
  ASSERT_TRUE(swapped.failure);
  EXPECT_THAT(swapped.failure->text, HasSubstr("leg1_link/"));
}

/// Softens the ground of the task that the primitive was made for.
void Soften(PrimitiveFile& file) {
  std::string& task = file.provenance.task_toml;
  task = Replaced(task, "stiffness_n_per_m = ", "stiffness_n_per_m = 1.0e2  # ");
  file.provenance.task_hash = HashOfText(task);
}

TEST(SimulateChain, PrimitivesOfDifferentGroundsAreRefused) {
  auto files = ThereAndBack();
  Soften(files[1]);
  try {
    SimulateChain(SimulatedMotion(Load(Sway(), files)), Cycles(1));
    FAIL();
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("primitives.back: was made for other [contact]"),
                                    HasSubstr("than 'there'")));
  }
}

TEST(SimulateChain, NorDoesACheckASimulatedRobotOrAnExportOrAStudyTakeThem) {
  auto files = ThereAndBack();
  Soften(files[1]);
  const SequenceFolder folder(Sway(), files);
  const std::string model = (folder.path() / "model.xml").string();
  for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{
           {"tumbler", "run", "sim", folder.file().string(), "--cycles", "1"},
           {"tumbler", "chain", "check", folder.file().string()},
           {"tumbler", "robustness", folder.file().string(), "--robots", "1", "--cycles", "1"},
           {"tumbler", "export", folder.file().string(), "--setpoints-csv", "-"},
           {"tumbler", "export", folder.file().string(), "--mjcf", model}}) {
    const testing::Outcome outcome = testing::RunProgram(command);
    EXPECT_EQ(outcome.exit_code, 1) << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr("primitives.back: was made for other [contact]"));
  }
  EXPECT_FALSE(std::filesystem::exists(model));
}

TEST(SimulateChain, APurposeOfALinkThatTheRobotHasNotIsRefused) {
  auto files = ThereAndBack();
  PurposeFigure& figure = files[1].purpose.emplace_back();
  figure.of = PurposeTarget::Of::kPointX;
  figure.link = "tail";
  figure.tolerance = 1;
  try {
    SimulateChain(SimulatedMotion(Load(Sway(), files)), Cycles(1));
    FAIL();
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("of 'back'"), HasSubstr("cannot be judged"),
                                    HasSubstr("no link of the robot")));
  }
}

TEST(SimulateChain, GroundTooSoftIsACoreThatIsReached) {
  auto files = ThereAndBack();
  for (PrimitiveFile& file : files) Soften(file);
  const ChainFailure failure = FailureOf(files);
  EXPECT_EQ(failure.cause, ChainFailure::Cause::kCore);
  EXPECT_THAT(failure.text, HasSubstr("through the layer of"));
}

TEST(SimulateChain, LegsThatGoThroughEachOtherAreAFailure) {
  auto files = ThereAndBack();
  // Both legs swing inwards, until they cross.
  for (int j = 0; j < 2; ++j) {
    JointMotion<double>& joint = files[0].primitive.joints[static_cast<std::size_t>(j)];
    const auto points = joint.position.control_points(0);
    std::vector<double> moved(points.begin(), points.end());
    const std::array<double, 6> inwards = {0.4, 0.8, 1.05, 1.05, 0.8, 0.4};
    ASSERT_EQ(moved.size(), 6 + inwards.size());
    for (std::size_t i = 0; i < inwards.size(); ++i)
      moved[3 + i] += j == 0 ? -inwards[i] : inwards[i];
    const auto knots = joint.position.knots();
    ASSERT_EQ(joint.position.Assign(joint.position.degree(),
                                    std::vector<double>(knots.begin(), knots.end()), moved),
              Status::kOk);
  }
  const ChainFailure failure = FailureOf(files);
  EXPECT_EQ(failure.cause, ChainFailure::Cause::kOverlap);
  EXPECT_THAT(failure.text, AllOf(HasSubstr("leg1_link/"), HasSubstr("overlap by")));
}

// ---- The program --------------------------------------------------------------------------------

testing::Outcome Chain(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "tumbler chain");
  return testing::RunProgram(arguments);
}

TEST(ChainCli, ChecksAllJoinsInATable) {
  const SequenceFolder folder(Sway(), ThereAndBack());
  const auto [status, text] = Chain({"check", folder.file()});
  EXPECT_EQ(status, 0) << text;
  EXPECT_THAT(text, AllOf(HasSubstr("there -> back"), HasSubstr("back -> there"),
                          HasSubstr("position [rad]"), HasSubstr("pitch [rad]"),
                          HasSubstr("2 joins, all fit")));
}

TEST(ChainCli, NamesTheFirstJoinThatDoesNotFit) {
  auto files = ThereAndBack();
  files[1].entry.root_pitch_rad += 0.5;
  files[1].exit.root_z_m += 0.5;
  const SequenceFolder folder(Sway(), files);
  const auto [status, text] = Chain({"check", folder.file()});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(text, AllOf(HasSubstr("does not fit"),
                          HasSubstr("edge[0]: there -> back: root, "
                                    "pitch:"),
                          HasSubstr("0.5 rad apart; allowed: 0.02 rad")));
  EXPECT_EQ(Chain({"simulate", folder.file()}).exit_code, 1) << "nothing is played of it";
}

TEST(ChainCli, SimulatesAndReportsInJson) {
  const SequenceFolder folder(Sway(), ThereAndBack());
  const std::string file = folder.file().parent_path() / "figures.json";
  const auto [status, text] = Chain({"simulate", folder.file(), "--cycles", "2", "--json", file});
  ASSERT_EQ(status, 0) << text;
  const auto json = Json::Parse(ReadFile(file)).value();
  EXPECT_EQ(json["cycles"], 2);
  EXPECT_TRUE(json["failure"].is_null());
  ASSERT_EQ(json["passages"].size(), 4U);
  EXPECT_EQ(json["passages"][1]["node"], "back");
  EXPECT_EQ(json["passages"][1]["posture"], "level");
  EXPECT_LT(json["passages"][3]["peak_torque_nm"].number(), 8);
}

TEST(SimulateChain, ItsReportShowsTheWholeChain) {
  const SequenceFile file = Load(Sway());
  const ReportData data = MakeChainReport(SimulatedMotion(file), Cycles(1));
  EXPECT_EQ(data.duration_s, 5);
  ASSERT_GT(data.samples.size(), 990U);
  EXPECT_NEAR(data.samples.back().time_s, 5, 0.01);
  EXPECT_EQ(data.links.size(), 3U);
  EXPECT_NEAR(data.samples[500].joint_positions_rad[0], -1.2, 1e-9) << "held at the end of `there`";
  EXPECT_NEAR(data.samples.back().joint_positions_rad[0], -kPi / 2, 1e-9);
  const ReportData longer = MakeChainReport(SimulatedMotion(file), Cycles(10));
  EXPECT_LE(longer.samples.size(), 4001U);
  EXPECT_NEAR(longer.samples.back().time_s, 50, 0.05);
}

TEST(ChainCli, WritesAReport) {
  const SequenceFolder folder(Sway(), ThereAndBack());
  const std::filesystem::path report = folder.file().parent_path() / "report";
  const auto [status, text] =
      Chain({"simulate", folder.file(), "--cycles", "1", "--report", report});
  EXPECT_EQ(status, 0) << text;
  EXPECT_THAT(ReadFile(report / "index.html"), HasSubstr("2 passages, 1 cycles"));
}

TEST(ChainCli, AFallIsExitStatusFourWithCauseAndTime) {
  auto files = ThereAndBack();
  files[0].contacts.clear();
  const SequenceFolder folder(Sway(), files);
  const auto [status, text] = Chain({"simulate", folder.file()});
  EXPECT_EQ(status, 4);
  EXPECT_THAT(text, AllOf(HasSubstr("failed: touch at 0.000 s, in 'there'"),
                          HasSubstr("it did not go through")));
}

TEST(ChainCli, WrongCommandLinesAreRefused) {
  const SequenceFolder folder(Sway(), ThereAndBack());
  EXPECT_EQ(Chain({}).exit_code, 1);
  EXPECT_EQ(Chain({"check"}).exit_code, 1);
  EXPECT_EQ(Chain({"check", "/nowhere.toml"}).exit_code, 1);
  EXPECT_EQ(Chain({"simulate", folder.file(), "--cycles", "-1"}).exit_code, 1);
  const auto [status, text] = Chain({"simulate", folder.file(), "--branch", "out"});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(text, HasSubstr("has no branch 'out'; its branches: none"));
}

}  // namespace
}  // namespace tumbler
