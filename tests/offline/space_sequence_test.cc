// Sequences of robots in space: played through on the model and on robots that differ, and motions
// that start where another one ends.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_toml.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "offline/certify/chain.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_frame.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/quaternion.h"
#include "offline/solve/guess.h"
#include "offline/solve/rollout.h"
#include "offline/studies/space_study.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::Outcome;
using testing::ReadFile;
using testing::Replaced;
using testing::RunProgram;
using testing::SourcePath;
using testing::TemporaryFolder;
using testing::WriteFile;

constexpr double kPi = std::numbers::pi;

std::string Joints(double thigh, double calf) {
  std::string text;
  for (const char* leg : {"FL", "FR", "HL", "HR"}) {
    const double sign = leg[0] == 'F' ? 1 : -1;
    text += fmt::format("{}{}_HFE = {}, {}_KFE = {}", text.empty() ? "" : ", ", leg, sign * thigh,
                        leg, sign * calf);
  }
  return "joints_rad = { " + text + " }\n";
}

/// Solo8 stands, and goes lower or higher.
std::string BendTask(const std::string& name, const std::string& start, const std::string& end) {
  return "format = \"tumbler-task\"\nversion = 1\nname = \"" + name +
         "\"\nrobot = \"solo8.urdf\"\nroot = \"floating\"\nduration_s = 0.4\nsettle_s = 0.3\n"
         "[start]\n" +
         start + "[end]\n" + end + R"([spline]
control_points = 7
[limits]
velocity_max_rad_s = 40.0
[[cost]]
term = "terminal"
of = "position"
along = [1.0, 0.0, 0.0]
when = "settled"
from_start = true
target = 0.0
tolerance = 0.03
weight = 10.0
[[cost]]
term = "terminal"
of = "misalignment"
axis = [0.0, 0.0, 1.0]
along = [0.0, 0.0, 1.0]
when = "settled"
weight = 5.0
[[cost]]
term = "effort"
weight = 1.0e-3
[contact]
resting_contacts = 4
static_penetration_m = 1.0e-3
settling_time_s = 0.06
slip_speed_m_per_s = 0.1
mu = 0.7
[[obstacle]]
name = "ground"
point_m = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
[drives]
kp_nm_per_rad = 15.0
kd_nm_s_per_rad = 0.3
)";
}
const std::string kHigh = Joints(0.8, -1.6), kLow = Joints(1.0, -1.9);

std::string Solo8() { return ReadFile(SourcePath("primitives/solo8/solo8.urdf")); }

/// A primitive whose joints follow straight lines from start to end: it needs no search.
PrimitiveFile StraightOn(const Task& task) {
  Solution solution;
  for (const ActuatedJoint& joint : task.problem.joints) {
    const int points = joint.free_points();
    for (int i = 0; i < points; ++i) {
      solution.x.push_back(joint.start_rad +
                           (i + 1.0) / (points + 1.0) * (joint.end_rad - joint.start_rad));
    }
  }
  PrimitiveFile file = MakePrimitiveFile(task, {}, solution);
  // It ends where it ends.
  const std::array<double, 3> place = {file.exit.root_x_m, file.exit.root_y_m, file.exit.root_z_m};
  for (std::size_t axis = 0; axis < place.size(); ++axis) {
    PurposeFigure& figure = file.purpose.emplace_back();
    figure.of = PurposeTarget::Of::kPosition;
    figure.when = PurposeTarget::When::kSettled;
    figure.link = "base_link";
    figure.along[axis] = 1;
    figure.target = figure.result = place[axis];
    figure.tolerance = 0.01;
  }
  return file;
}

/// Lower, and back from where that ends.
const std::vector<PrimitiveFile>& DownAndUp() {
  static const std::vector<PrimitiveFile> files = [] {
    const PrimitiveFile down =
        StraightOn(ParseTask(BendTask("down", kHigh, kLow), "down_task.toml", Solo8(), "solo8.urdf",
                             TaskSpaces::kPlaneAndSpace));
    const Task up = ParseTask(BendTask("up", kLow, kHigh), "up_task.toml", Solo8(), "solo8.urdf",
                              down, "down.toml");
    return std::vector{down, StraightOn(up)};
  }();
  return files;
}

constexpr const char* kBends = R"(format = "tumbler-sequence"
version = 1
name = "bends"
start = "down"
[primitives]
down = "down.toml"
up = "up.toml"
[[node]]
name = "down"
primitive = "down"
safe = true
[[node]]
name = "up"
primitive = "up"
safe = true
ends_cycle = true
[[edge]]
from = "down"
to = "up"
settle_s = 2
[[edge]]
from = "up"
to = "down"
settle_s = 2
)";

SequenceFile Load(const std::string& text, const std::vector<PrimitiveFile>& files) {
  const TemporaryFolder folder;
  for (const PrimitiveFile& file : files) {
    WriteFile((folder.path() / (std::string(file.primitive.name.view()) + ".toml")).string(),
              ToToml(file));
  }
  const std::string path = (folder.path() / "sequence.toml").string();
  WriteFile(path, text);
  return ReadSequence(path);
}
SimulatedMotion Bends(const std::vector<PrimitiveFile>& files = DownAndUp()) {
  return SimulatedMotion(Load(kBends, files), TaskSpaces::kPlaneAndSpace);
}
ChainOptions Cycles(int cycles) {
  ChainOptions options;
  options.cycles = cycles;
  return options;
}

TEST(ChainInSpace, PlaysWhatTheRolloutOfThePrimitiveDoes) {
  const SimulatedMotion motion = Bends();
  std::vector<SpaceSample> played;
  const ChainOutcome outcome =
      SimulateChainInSpace(motion, Cycles(1), [&](int node, const SpaceSample& sample) {
        if (node == 0) played.push_back(sample);
      });
  ASSERT_FALSE(outcome.failure) << outcome.failure->text;
  ASSERT_EQ(outcome.passages.size(), 2U);
  const Problem& problem = motion.ProblemOf(0);
  Rollout rollout(problem, problem.solver.step_s);
  std::size_t at = 0;
  double apart = 0, moved = 0;
  rollout.VisitInSpace(
      ParametersOf(motion.file().primitives[0].primitive), 0, [&](const SpaceSample& sample) {
        if (sample.time_s >= problem.duration_s - 1e-9) return;
        ASSERT_LT(at, played.size());
        const SpaceSample& other = played[at++];
        ASSERT_NEAR(other.time_s, sample.time_s, 1e-12);
        for (std::size_t i = 0; i < sample.q.size(); ++i) {
          apart = std::max(apart, std::abs(sample.q[i] - other.q[i]));
          moved = std::max(moved, std::abs(sample.q[i] - played[0].q[i]));
        }
        for (int c = 0; c < 3; ++c) {
          apart = std::max(apart, (sample.orientation.col(c) - other.orientation.col(c)).norm());
        }
      });
  EXPECT_GT(at, 100U);
  EXPECT_GT(moved, 0.01);
  EXPECT_LT(apart, 1e-9);
  for (std::size_t i = 0; i < 2; ++i) {
    const PlayedNode& passage = outcome.passages[i];
    const PrimitiveFile& made = DownAndUp()[i];
    EXPECT_NEAR(passage.entry_z_error_m, 0, 1e-6);
    EXPECT_NEAR(passage.exit_z_error_m, 0, 1e-6);
    EXPECT_NEAR(passage.exit_pitch_error_rad, 0, 1e-6);
    EXPECT_NEAR(passage.peak_torque_nm, made.certificate.peak_torque_nm, 1e-2);
    EXPECT_EQ(passage.posture, Posture::kLevel);
  }
  EXPECT_EQ(outcome.CountJudged().judged, 6);
}

TEST(ChainInSpace, CarriesTheStateThroughJoinsAndHolds) {
  std::vector<SpaceSample> samples;
  const ChainOutcome outcome = SimulateChainInSpace(
      Bends(), Cycles(2), [&](int, const SpaceSample& sample) { samples.push_back(sample); });
  ASSERT_FALSE(outcome.failure) << outcome.failure->text;
  EXPECT_EQ(outcome.passages.size(), 4U);
  for (std::size_t k = 1; k < samples.size(); ++k) {
    const double h = samples[k].time_s - samples[k - 1].time_s;
    ASSERT_GT(h, 0);
    for (std::size_t i = 0; i < 3; ++i) {  // By the trapezoidal rule there is no jump anywhere.
      const double moved = 0.5 * h * (samples[k].qd[i] + samples[k - 1].qd[i]);
      ASSERT_NEAR(samples[k].q[i] - samples[k - 1].q[i], moved, 1e-5);
    }
    // Of the root's angular velocity the vertical part is what it turns by.
    ASSERT_LT(std::abs(TurnedAboutVertical(samples[k - 1].orientation, samples[k].orientation)),
              1e-3);
  }
}

/// A primitive whose task is elsewhere and turned about the vertical.
PrimitiveFile Elsewhere(PrimitiveFile file, double turned_rad) {
  const SpaceMatrix turn = ToRotation({std::cos(turned_rad / 2), 0, 0, std::sin(turned_rad / 2)});
  const auto move = [&](PrimitivePose& pose) {
    const SpaceVector place = turn * SpaceVector(pose.root_x_m, pose.root_y_m, 0);
    pose.root_x_m = place.x() + 3;
    pose.root_y_m = place.y() - 2;
    pose.root_quaternion = ToQuaternion(turn * ToRotation(pose.root_quaternion));
  };
  move(file.entry);
  move(file.exit);
  return file;
}

TEST(ChainInSpace, JudgesEachMotionWhereItsTaskHasIt) {
  std::vector<PrimitiveFile> files = DownAndUp();
  const ChainOutcome here = SimulateChain(Bends(files), Cycles(1));
  files[1] = Elsewhere(files[1], 2.5);
  // What was level and forward is so in the turned task.
  for (std::size_t axis = 0; axis < 3; ++axis) {
    PurposeFigure& figure = files[1].purpose[axis];
    figure.target = figure.result = axis == 0   ? files[1].exit.root_x_m
                                    : axis == 1 ? files[1].exit.root_y_m
                                                : files[1].exit.root_z_m;
    figure.tolerance = 1e-3;
  }
  const ChainOutcome there = SimulateChain(Bends(files), Cycles(1));
  ASSERT_FALSE(there.failure) << there.failure->text;
  EXPECT_EQ(there.CountJudged().judged, 6);
  EXPECT_NEAR(there.travelled_m, here.travelled_m, 1e-9) << "the robot is where it was";
  EXPECT_NEAR(there.passages[1].entry_pitch_error_rad, here.passages[1].entry_pitch_error_rad, 1e-9)
      << "headings do not count";
}

/// A target that its motion does not reach, whatever the file says.
void Miss(PurposeFigure& figure) { figure.target = figure.result = figure.target + 0.05; }

TEST(ChainInSpace, AMissedPurposeIsAFailureByNameAndAmount) {
  std::vector<PrimitiveFile> files = DownAndUp();
  Miss(files[1].purpose[2]);
  const ChainOutcome outcome = SimulateChain(Bends(files), Cycles(1));
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->cause, ChainFailure::Cause::kPurpose);
  EXPECT_EQ(outcome.failure->node, 1);
  EXPECT_THAT(outcome.failure->text, AllOf(HasSubstr("base_link"), HasSubstr("MISSED")));
}

/// Of a base that stays level there is no heading of what is vertical in it.
void AskForNoHeading(PurposeFigure& figure) {
  figure.of = PurposeTarget::Of::kHeading;
  figure.in_space = figure.along = {0, 0, 1};
  figure.target = figure.result = 0;
}

TEST(ChainInSpace, AnErrorInTheTextsOfAPrimitiveNamesThePrimitive) {
  std::vector<PrimitiveFile> files = DownAndUp();
  std::string& text = files[1].provenance.task_toml;
  text = Replaced(text, "term = \"effort\"", "term = \"effortless\"");
  try {
    (void)TaskOf(files[1], TaskSpaces::kPlaneAndSpace);
    ADD_FAILURE() << "was taken";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("primitive 'up': provenance: of the texts in it, "),
                                    HasSubstr("'effortless'")));
  }
}

TEST(ChainInSpace, AHeadingThatIsNoneIsNotJudged) {
  std::vector<PrimitiveFile> files = DownAndUp();
  AskForNoHeading(files[1].purpose[2]);
  const ChainOutcome outcome = SimulateChain(Bends(files), Cycles(1));
  EXPECT_FALSE(outcome.failure) << outcome.failure->text;
  EXPECT_EQ(outcome.CountJudged().judged, 5);
  const JudgedTarget& judged = outcome.passages[1].purpose[2];
  EXPECT_FALSE(judged.met());
  EXPECT_THAT(judged.Verdict(), HasSubstr("not judged, the axis points along"));
}

TEST(ChainInSpace, AnExitTiltedOtherwiseThanRecordedIsAFailure) {
  std::vector<PrimitiveFile> files = DownAndUp();
  files[0].exit.root_quaternion = {std::cos(0.1), std::sin(0.1), 0, 0};
  const ChainOutcome outcome = SimulateChain(Bends(files), Cycles(1));
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->cause, ChainFailure::Cause::kExit);
  EXPECT_THAT(outcome.failure->text, HasSubstr("root, tilt: 0.2"));
}

TEST(ChainInSpace, AnEntryAtAnotherHeightIsAFailure) {
  std::vector<PrimitiveFile> files = DownAndUp();
  files[1].entry.root_z_m += 0.01;
  const ChainOutcome outcome = SimulateChain(Bends(files), Cycles(1));
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->cause, ChainFailure::Cause::kEntry);
  EXPECT_THAT(outcome.failure->text, HasSubstr("root, height: -0.01"));
}

TEST(ChainInSpace, Solo12GetsUpTurnsAndWalksWhereItLooksThen) {
  const TemporaryFolder folder;
  const std::string page = (folder.path() / "page.html").string();
  const std::string json = (folder.path() / "chain.json").string();
  const Outcome run = RunProgram({"tumbler", "chain", "simulate",
                                  SourcePath("primitives/solo12/get_up_turn_walk.toml"), "--cycles",
                                  "2", "--report", page, "--json", json});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text, AllOf(HasSubstr("2 cycles in 9.40 s"), HasSubstr("no fall"),
                              HasSubstr("13 of 13 targets of what motions are for met")));
  EXPECT_THAT(ReadFile(page), HasSubstr("<h1 id=\"title\">get_up_turn_walk</h1>"));
  const SimulatedMotion motion(LoadSequence(SourcePath("primitives/solo12/get_up_turn_walk.toml")),
                               TaskSpaces::kPlaneAndSpace);
  SpaceSample before, after;  // the first walk
  const ChainOutcome outcome =
      SimulateChainInSpace(motion, Cycles(1), [&](int node, const SpaceSample& sample) {
        if (node != 2) return;
        if (before.q.empty()) before = sample;
        after = sample;
      });
  ASSERT_FALSE(outcome.failure) << outcome.failure->text;
  EXPECT_NEAR(outcome.passages[1].turned_rad, kPi / 2, 0.1);
  // It walks along its own x, which is not the world's.
  const SpaceVector x = before.orientation.col(0);
  EXPECT_LT(std::abs(x.x()), 0.5);
  const SpaceVector way(after.q[0] - before.q[0], after.q[1] - before.q[1], 0);
  EXPECT_NEAR(way.dot(x), 0.3, 0.03);
}

// It rolls and pitches on its way, so that its small turns about the vertical add up to more.
TEST(ChainInSpace, SaysByHowMuchTheHeadingHasChanged) {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "walks.toml").string();
  WriteFile(path,
            "format = \"tumbler-sequence\"\nversion = 1\nname = \"walks\"\nstart = "
            "\"walk\"\n[primitives]\nwalk = \"" +
                SourcePath("primitives/solo8/walk.toml") +
                "\"\n[[node]]\nname = \"walk\"\nprimitive = \"walk\"\nsafe = true\n"
                "ends_cycle = true\n[[edge]]\nfrom = \"walk\"\nto = \"walk\"\n"
                "when = \"always\"\n");
  const SimulatedMotion motion(LoadSequence(path), TaskSpaces::kPlaneAndSpace);
  SpaceSample first, last;
  const ChainOutcome outcome =
      SimulateChainInSpace(motion, Cycles(2), [&](int, const SpaceSample& sample) {
        if (first.q.empty()) first = sample;
        last = sample;
      });
  ASSERT_FALSE(outcome.failure) << outcome.failure->text;
  const auto heading = [](const SpaceSample& at) {
    return std::atan2(at.orientation(1, 0), at.orientation(0, 0));
  };
  double turned = 0;
  for (const PlayedNode& passage : outcome.passages) turned += passage.turned_rad;
  EXPECT_NEAR(turned, heading(last) - heading(first), 1e-3);
}

TEST(StartFromInSpace, TakesPlaceQuaternionAndHeightOfTheExit) {
  PrimitiveFile down = DownAndUp()[0];
  down.exit.root_x_m = 1.5;
  down.exit.root_y_m = -0.5;
  down.exit.root_quaternion = {std::cos(0.05), 0, 0, std::sin(0.05)};
  const Task task = ParseTask(BendTask("up", kLow, kHigh), "up_task.toml", Solo8(), "solo8.urdf",
                              down, "down.toml");
  EXPECT_EQ(task.problem.start_q[0], 1.5);
  EXPECT_EQ(task.problem.start_q[1], -0.5);
  EXPECT_EQ(task.problem.start_q[2], down.exit.root_z_m);
  EXPECT_NEAR(task.problem.space->start_orientation(1, 0), std::sin(0.1), 1e-12);
  EXPECT_EQ(task.start_file, "down.toml");
  EXPECT_EQ(task.start_hash, ContentHash(down));
}

TEST(StartFromInSpace, ThePrimitiveIsWholeByItself) {
  const PrimitiveFile up = ParsePrimitive(ToToml(DownAndUp()[1]), "up.toml");
  EXPECT_EQ(up.provenance.start_file, "down.toml");
  EXPECT_EQ(up.provenance.start_hash, ContentHash(DownAndUp()[0]));
  EXPECT_NEAR(up.entry.root_z_m, DownAndUp()[0].exit.root_z_m, 1e-12);
  const Problem again = TaskOf(up, TaskSpaces::kPlaneAndSpace).problem;
  EXPECT_EQ(again.start_q[2], up.entry.root_z_m);
}

std::string RefusalFrom(const PrimitiveFile& before, const std::string& task) {
  try {
    ParseTask(task, "up_task.toml", Solo8(), "solo8.urdf", before, "down.toml");
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(StartFromInSpace, AnotherShapeGroundOrRobotIsRefusedByNameAndAmount) {
  const PrimitiveFile& down = DownAndUp()[0];
  const std::string up = BendTask("up", kLow, kHigh);
  EXPECT_EQ(RefusalFrom(down, up), "accepted");
  EXPECT_THAT(RefusalFrom(down, BendTask("up", kHigh, kLow)),
              AllOf(HasSubstr("start.joints_rad.FL_HFE: is 0.8 rad"),
                    HasSubstr("'down' (down.toml) has it at 1 rad")));
  PrimitiveFile turned = down;
  turned.exit.root_quaternion = {std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
  EXPECT_THAT(RefusalFrom(turned, up),
              AllOf(HasSubstr("start.quaternion: has the root turned 1.57"),
                    HasSubstr("[0.7071, 0.0000, 0.0000, 0.7071]"), HasSubstr("<= 0.3 rad")));
  EXPECT_EQ(RefusalFrom(turned, Replaced(up, "[start]\n",
                                         "[start]\nquaternion = [0.7071, 0.0, 0.0, 0.7071]\n")),
            "accepted");
  EXPECT_THAT(RefusalFrom(down, Replaced(up, "mu = 0.7", "mu = 0.6")),
              HasSubstr("down.toml: provenance.task_toml: has other [contact]"));
  EXPECT_THAT(RefusalFrom(down, up + "[motor]\ndry_friction_nm = 0.01\n"),
              HasSubstr("down.toml: provenance.task_toml: has other [motor]"));
}

TEST(StartFromInSpace, AnExitInTheAirIsRefused) {
  // Nothing holds what flies, and the file of a motion in space has no velocities.
  std::string text = Replaced(BendTask("down", kHigh, kLow), "settle_s = 0.3", "settle_s = 0.0");
  text = Replaced(text, "[start]\n", "[start]\nz_m = 1.0\n");
  text = text.substr(0, text.find("[[obstacle]]"));
  text = Replaced(text, "duration_s", "obstacle = []\nduration_s");
  for (std::size_t at = text.find("\"settled\""); at != std::string::npos;
       at = text.find("\"settled\""))
    text.replace(at, 9, "\"end\"");
  text = text.substr(0, text.find("[contact]"));
  const PrimitiveFile flies = StraightOn(
      ParseTask(text, "down_task.toml", Solo8(), "solo8.urdf", TaskSpaces::kPlaneAndSpace));
  EXPECT_THAT(RefusalFrom(flies, BendTask("up", kLow, kHigh)),
              HasSubstr("down.toml: exit: is in motion"));
}

/// A folder with that sequence and its primitives.
class SequenceOnRobots : public ::testing::Test {
 protected:
  std::string Write(const std::vector<PrimitiveFile>& files) {
    for (const PrimitiveFile& file : files) {
      WriteFile((folder_.path() / (std::string(file.primitive.name.view()) + ".toml")).string(),
                ToToml(file));
    }
    const std::string path = (folder_.path() / "sequence.toml").string();
    WriteFile(path, kBends);
    return path;
  }
  static SpaceStudy Nominal(const std::string& path) {
    SpaceStudy study;
    study.motion = path;
    study.robots = 1;
    study.scale = 0;
    return study;
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(SequenceOnRobots, EachMotionIsJudgedAtItsOwnTime) {
  SpaceStudy study = Nominal(Write(DownAndUp()));
  study.cycles = 2;
  const SpaceStudyResult model = RunSpaceStudy(study);
  EXPECT_EQ(model.share().count, 1);
  ASSERT_EQ(model.motions.size(), 4U);
  EXPECT_EQ(model.motions[2].name, "down");
  EXPECT_EQ(model.motions[2].cycle, 2);
  ASSERT_EQ(model.trials[0].purpose.size(), 12U);
  // Low after each way down, and high again after each way up, but for what drives give way.
  const double low_m = DownAndUp()[0].exit.root_z_m, high_m = DownAndUp()[1].exit.root_z_m;
  for (const std::size_t cycle : {std::size_t{0}, std::size_t{1}}) {
    EXPECT_NEAR(*model.trials[0].purpose[6 * cycle + 2].result, low_m, 0.01);
    EXPECT_NEAR(*model.trials[0].purpose[6 * cycle + 5].result, high_m, 0.01);
  }
  EXPECT_GT(high_m - low_m, 0.02);
}

TEST_F(SequenceOnRobots, TheFirstMotionIsJudgedAsItIsAlone) {
  std::vector<PrimitiveFile> files = DownAndUp();
  for (PrimitiveFile& file : files) {
    for (PurposeFigure& figure : file.purpose) figure.when = PurposeTarget::When::kEnd;
  }
  SpaceStudy study = Nominal(Write(files));
  study.robots = 3;
  study.scale = 1;
  study.cycles = 1;
  const SpaceStudyResult both = RunSpaceStudy(study);
  study.cycles = 0;
  study.motion = study.motion.substr(0, study.motion.rfind('/')) + "/down.toml";
  const SpaceStudyResult alone = RunSpaceStudy(study);
  for (std::size_t robot = 0; robot < 3; ++robot) {
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_EQ(both.trials[robot].purpose[i].result, alone.trials[robot].purpose[i].result);
  }
}

TEST(SpaceStudyResult, SaysThatARobotLeftEveryRangeInTheMotionInWhichItDid) {
  const JudgedTarget unknown;
  SpaceStudyResult result;
  result.motions = {{"lie", 1, 0}, {"rise", 1, 1}, {"fall", 1, 0}};
  for (const std::size_t motion : {0U, 1U, 2U})
    result.trials.push_back({.finite = false, .purpose = {unknown}, .ended_in = motion});
  EXPECT_THAT(result.FailedIn(), ::testing::ElementsAre(1, 1, 1));
  EXPECT_THAT(result.ReasonOf(result.trials[0]), HasSubstr("lie: its state left every plausible"));
}

TEST_F(SequenceOnRobots, OfWhichAHeadingIsNoneAreInNoShare) {
  std::vector<PrimitiveFile> files = DownAndUp();
  AskForNoHeading(files[1].purpose[2]);
  SpaceStudy study = Nominal(Write(files));
  study.cycles = 1;
  study.robots = 2;
  const SpaceStudyResult result = RunSpaceStudy(study);
  EXPECT_EQ(result.Unjudged(), 2);
  EXPECT_EQ(result.share().of, 0);
  EXPECT_THAT(result.FailedIn(), ::testing::ElementsAre(0, 0));
  EXPECT_THAT(ToText(result),
              AllOf(HasSubstr("no robot was judged"), HasSubstr("2 NOT JUDGED, in no share"),
                    ::testing::Not(HasSubstr("miss"))));
  EXPECT_EQ(testing::RunProgram({"tumbler robustness", study.motion, "--cycles", "1", "--robots",
                                 "1", "--scale", "0"})
                .exit_code,
            4);
}

TEST_F(SequenceOnRobots, EndAtOnceWhenInterrupted) {
  SpaceStudy study = Nominal(Write(DownAndUp()));
  study.hold_s = 3600;  // hours of CPU
  study.cycles = 1;
  std::atomic<bool> interrupt = false;
  study.interrupt = &interrupt;
  std::thread asks([&interrupt] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    interrupt = true;
  });
  const SpaceStudyResult result = RunSpaceStudy(study);
  asks.join();
  EXPECT_TRUE(result.trials.empty());
}

TEST_F(SequenceOnRobots, SaysInWhichMotionTheyFailAndPlaysThemNoFurther) {
  std::vector<PrimitiveFile> files = DownAndUp();
  Miss(files[1].purpose[2]);
  SpaceStudy study = Nominal(Write(files));
  study.cycles = 2;
  study.robots = 2;
  const SpaceStudyResult result = RunSpaceStudy(study);
  EXPECT_EQ(result.share().count, 0);
  EXPECT_THAT(result.FailedIn(), ::testing::ElementsAre(0, 2, 0, 0));
  EXPECT_FALSE(result.trials[0].purpose[6].result) << "it was not played on";
  const std::string text = ToText(result);
  EXPECT_THAT(text, AllOf(HasSubstr("  2 fail in up of cycle 1\n"), HasSubstr("    2 miss position "
                                                                              "of base_link")));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("down")));
}

TEST_F(SequenceOnRobots, TheProgramWantsToKnowHowManyCycles) {
  const std::string path = Write(DownAndUp());
  const Outcome unsaid = RunProgram({"tumbler", "robustness", path, "--robots", "1"});
  EXPECT_EQ(unsaid.exit_code, 1);
  EXPECT_THAT(unsaid.text, HasSubstr("--cycles"));
  const Outcome run = RunProgram({"tumbler", "robustness", path, "--robots", "2", "--cycles", "1",
                                  "--scale", "0", "--json", "-", "--quiet"});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text, AllOf(HasSubstr("\"node\": \"up\""), HasSubstr("\"failed\": 0"),
                              HasSubstr("\"as_asked\": 2")));
}

TEST_F(SequenceOnRobots, AChainThatFailsWhereItBeginsHasNoPage) {
  std::vector<PrimitiveFile> files = DownAndUp();
  files[0].contacts.clear();  // So that its feet touch what they never touch in the plan.
  const std::string path = Write(files);
  const std::string page = path + ".html";
  const Outcome run =
      RunProgram({"tumbler", "chain", "simulate", path, "--cycles", "1", "--report", page});
  EXPECT_EQ(run.exit_code, 4) << run.text;
  EXPECT_THAT(run.text, AllOf(HasSubstr("failed: touch"), HasSubstr("no report")));
  EXPECT_FALSE(std::filesystem::exists(page));
}

TEST_F(SequenceOnRobots, APushComesInTheHoldOfTheLastMotion) {
  SpaceStudy study = Nominal(Write(DownAndUp()));
  study.cycles = 1;
  study.hold_s = 1.5;
  const SpaceStudyResult unpushed = RunSpaceStudy(study);
  study.push_n = 60;
  const SpaceStudyResult pushed = RunSpaceStudy(study);
  EXPECT_EQ(unpushed.share().count, 1);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(pushed.trials[0].purpose[i].result, unpushed.trials[0].purpose[i].result);
  EXPECT_NE(pushed.trials[0].purpose[3].result, unpushed.trials[0].purpose[3].result);
}

}  // namespace
}  // namespace tumbler
