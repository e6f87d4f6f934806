// The twin in space: against the plane, against kinematics, and as a user meets it in `tumbler run
// sim`.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/simulated_mit.h"
#include "offline/problem/contact_steps.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/quaternion.h"
#include "offline/twin/purpose_judge.h"
#include "offline/twin/simulated_robot.h"
#include "offline/twin/twin.h"
#include "offline/twin/twin_toml.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::ReadFile;
using testing::Replaced;
using testing::ShippedRobot;
using testing::SourcePath;
using testing::WriteFile;

constexpr std::int64_t kMs = 1'000'000;

/// The tumbler 10 cm above the ground.
std::string DropTask(const std::string& root, const std::string& point, const std::string& normal,
                     const std::string& start, const std::string& cost) {
  return "format = \"tumbler-task\"\nversion = 1\nname = \"drop\"\nrobot = \"tumbler.urdf\"\n"
         "root = \"" +
         root + "\"\nduration_s = 0.6\nsettle_s = 0.4\n[start]\nz_m = 0.42\n" + start +
         "joints_rad = { leg1 = -1.5707963267948966, leg2 = 1.5707963267948966 }\n"
         "[end]\njoints_rad = { leg1 = -1.2, leg2 = 1.3 }\n" +
         cost +
         "[contact]\nstiffness_n_per_m = 1.0e4\ndamping_n_s_per_m = 100.0\nd_on_m = 0.01\n"
         "d_off_m = 0.0075\nmu = 0.3\nv_max_m_per_s = 0.05\n[[obstacle]]\nname = \"ground\"\n"
         "kind = \"half-space\"\npoint_m = " +
         point + "\nnormal = " + normal + "\n";
}
/// Pitched by 0.2 rad, which is about -y.
std::string InPlane() {
  return DropTask("planar-xz", "[0.0, 0.0]", "[0.0, 1.0]", "pitch_rad = 0.2\n",
                  "[[cost]]\nterm = \"terminal\"\nof = \"pitch\"\nweight = 1.0\n");
}
std::string InSpace() {
  return DropTask("floating", "[0.0, 0.0, 0.0]", "[0.0, 0.0, 1.0]",
                  "quaternion = [0.9950041652780258, 0.0, -0.09983341664682815, 0.0]\n",
                  "[[cost]]\nterm = \"terminal\"\nof = \"misalignment\"\naxis = [0.0, 0.0, 1.0]\n"
                  "along = [0.0, 0.0, 1.0]\nweight = 1.0\n");
}
Problem ProblemOf(const std::string& task) {
  return ParseTask(task, "task.toml", ShippedRobot(), "tumbler.urdf", TaskSpaces::kPlaneAndSpace)
      .problem;
}

/// A twin that nobody holds, with two drives that are off.
struct LimpTwin {
  explicit LimpTwin(const std::string& task, TwinConfig config = {}) {
    config.held = false;
    std::vector<SimulatedDrive*> pointers;
    for (std::uint16_t i = 0; i < 2; ++i) {
      SimulatedMitConfig drive;
      drive.mit.command_id = static_cast<std::uint16_t>(1 + i);
      drive.mit.reply_id = static_cast<std::uint16_t>(17 + i);
      drives.push_back(std::make_unique<SimulatedMitDrive>(drive));
      bus.Attach(*drives.back(), SimulatedMitDrive::PortConfig());
      pointers.push_back(drives.back().get());
    }
    const Problem problem = ProblemOf(task);
    PrimitivePose start;
    start.joint_positions_rad = {-1.5707963267948966, 1.5707963267948966};
    start.root_z_m = 0.42;
    if (problem.space) {
      start.root_quaternion = {0.9950041652780258, 0.0, -0.09983341664682815, 0.0};
      twin = std::make_unique<Twin>(problem.space->scene, start, config, bus, pointers);
    } else {
      start.root_pitch_rad = 0.2;
      twin = std::make_unique<Twin>(problem.scene, start, config, bus, pointers);
    }
  }
  SimulatedBus bus;
  std::vector<std::unique_ptr<SimulatedMitDrive>> drives;
  std::unique_ptr<Twin> twin;
};

TEST(SpaceTwin, OfARobotThatStaysInThePlaneFollowsThePlanesTwinThroughImpactsAndAPush) {
  TwinConfig pushed;
  pushed.pushes = {{"leg1_link", 0.3, 0.05, false, {4, 0, 3}, {0, 0, 0.1}}};
  pushed.mass_factor = {{"leg2_link", 1.3}};
  pushed.patches = {{"ground", 0.8, 0.0}};
  LimpTwin plane(InPlane(), pushed), space(InSpace(), pushed);
  for (int ms = 10; ms <= 800; ms += 10) {
    SCOPED_TRACE(ms);
    plane.twin->AdvanceTo(ms * kMs);
    space.twin->AdvanceTo(ms * kMs);
    const TwinState &p = plane.twin->state(), &s = space.twin->state();
    ASSERT_NEAR(s.root_x_m, p.root_x_m, 1e-9);
    ASSERT_NEAR(s.root_y_m, 0, 1e-12);
    ASSERT_NEAR(s.root_z_m, p.root_z_m, 1e-9);
    const double pitch = -2 * std::atan2(s.root_quaternion[2], s.root_quaternion[0]);
    ASSERT_NEAR(NearestTurn(pitch - p.root_pitch_rad), 0, 1e-9);
    ASSERT_NEAR(-s.root_angular_velocity_rad_s[1], p.root_pitch_rate_rad_s, 1e-7);
    ASSERT_NEAR(s.joint_positions_rad[0], p.joint_positions_rad[0], 1e-9);
    ASSERT_NEAR(s.joint_velocities_rad_s[1], p.joint_velocities_rad_s[1], 1e-7);
    ASSERT_NEAR(s.normal_force_n, p.normal_force_n, 1e-5);
  }
  EXPECT_GT(plane.twin->state().impact_m_s, 0.5) << "it never fell";
  EXPECT_NEAR(space.twin->state().impact_m_s, plane.twin->state().impact_m_s, 1e-7);
}

TEST(SpaceTwin, TurnsAsItsAngularVelocitySaysWhereverItIsTurned) {
  LimpTwin tumbling(Replaced(InSpace(), "z_m = 0.42", "z_m = 50.0"));
  std::vector<double> q(8, 0.0), v(8, 0.0);
  q[2] = 50;
  v[3] = 6;  // pitch, roll and yaw together
  v[4] = -1;
  v[5] = 1;
  tumbling.twin->Displace(q, v);
  double furthest = 0;  // that an axis of the root goes from where it was
  Quaternion before{};
  std::array<double, 3> w_before{};
  for (int i = 0; i <= 4000; ++i) {
    tumbling.twin->AdvanceTo(i * kMs / 2);
    const TwinState& state = tumbling.twin->state();
    const Quaternion& now = state.root_quaternion;
    if (i > 0) {
      // q' = (0, w) q / 2, by the mean of both ends; the quaternion's sign is free.
      double dot = 0;
      for (std::size_t k = 0; k < 4; ++k) dot += now[k] * before[k];
      const double sign = dot < 0 ? -1 : 1;
      std::array<double, 3> w{};
      for (std::size_t k = 0; k < 3; ++k)
        w[k] = 0.25 * 5e-4 * (w_before[k] + state.root_angular_velocity_rad_s[k]);
      Quaternion mean{};
      for (std::size_t k = 0; k < 4; ++k) mean[k] = 0.5 * (before[k] + sign * now[k]);
      const Quaternion change{-w[0] * mean[1] - w[1] * mean[2] - w[2] * mean[3],
                              w[0] * mean[0] + w[1] * mean[3] - w[2] * mean[2],
                              w[1] * mean[0] + w[2] * mean[1] - w[0] * mean[3],
                              w[2] * mean[0] + w[0] * mean[2] - w[1] * mean[1]};
      for (std::size_t k = 0; k < 4; ++k)
        ASSERT_NEAR(sign * now[k] - before[k], change[k], 1e-7) << i;
    }
    before = now;
    w_before = state.root_angular_velocity_rad_s;
    furthest = std::max(furthest, 1 - (1 - 2 * (now[1] * now[1] + now[2] * now[2])));
  }
  EXPECT_GT(furthest, 1.8) << "it never came upside down";
}

TEST(SpaceTwin, WithStepsWithinAnErrorBoundMovesAsWithFixedOnes) {
  TwinConfig bound;
  bound.steps = TwinConfig::Steps::kErrorBound;
  LimpTwin fixed(InSpace()), within(InSpace(), bound);
  std::vector<double> none(8, 0.0), v(8, 0.0);
  v[4] = 1.5;  // It rolls as it falls.
  fixed.twin->Displace(none, v);
  within.twin->Displace(none, v);
  fixed.twin->AdvanceTo(120 * kMs);
  within.twin->AdvanceTo(120 * kMs);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(within.twin->state().root_quaternion[k], fixed.twin->state().root_quaternion[k],
                1e-4);
  }
  EXPECT_NEAR(within.twin->state().root_z_m, fixed.twin->state().root_z_m, 1e-5);
  EXPECT_NEAR(within.twin->state().joint_positions_rad[0],
              fixed.twin->state().joint_positions_rad[0], 1e-4);
}

TEST(SpaceTwin, OnAStandKeepsItsRootAndIsPutBackWhereItBegan) {
  TwinConfig stand;
  stand.stand_m = 0.3;
  LimpTwin held(InSpace(), stand);
  held.twin->AdvanceTo(500 * kMs);
  EXPECT_EQ(held.twin->state().root_z_m, 0.72);
  EXPECT_NEAR(held.twin->state().root_quaternion[2], -0.09983341664682815, 1e-15);
  EXPECT_NE(held.twin->state().joint_positions_rad[0], -1.5707963267948966);

  LimpTwin fallen(InSpace());
  fallen.twin->AdvanceTo(500 * kMs);
  ASSERT_LT(fallen.twin->state().root_z_m, 0.4);
  fallen.twin->PutBack();
  EXPECT_EQ(fallen.twin->state().root_z_m, 0.42);
  EXPECT_NEAR(fallen.twin->state().root_quaternion[2], -0.09983341664682815, 1e-15);
  EXPECT_EQ(fallen.twin->state().root_vz_m_s, 0);
}

/// Solo8's walk through its drives, on one simulated bus.
class SoloWalks : public ::testing::Test {
 protected:
  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] std::string Write(const std::string& name, const std::string& text) const {
    WriteFile(Path(name), text);
    return Path(name);
  }
  struct Outcome : testing::Outcome {
    Json json;
  };
  [[nodiscard]] Outcome Run(const std::string& motion, const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{"tumbler run",
                                       "sim",
                                       motion,
                                       "--drives",
                                       SourcePath("primitives/solo8/drives.toml"),
                                       "--json",
                                       Path("run.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    std::filesystem::remove(Path("run.json"));
    Outcome outcome{testing::RunProgram(arguments), {}};
    if (std::filesystem::exists(Path("run.json")))
      outcome.json = Json::Parse(ReadFile(Path("run.json"))).value();
    return outcome;
  }
  [[nodiscard]] static std::vector<double> ResultsOf(const Outcome& run) {
    std::vector<double> results;
    const Json& purpose = run.json["passages"][0]["purpose"];
    for (std::size_t i = 0; i < purpose.size(); ++i)
      results.push_back(purpose[i]["result"].number());
    return results;
  }

  const std::string walk_ = SourcePath("primitives/solo8/walk.toml");

 private:
  testing::TemporaryFolder folder_;
};

constexpr const char* kTwinHead = "format = \"tumbler-twin\"\nversion = 1\n";

TEST_F(SoloWalks, AsAskedAndTheRecordReplaysAndIsExportedAndShown) {
  const std::string record = Path("run.rec");
  const Outcome run = Run(walk_, {"--record", record});
  ASSERT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text, HasSubstr("root tilted"));
  EXPECT_THAT(run.text, Not(HasSubstr("FELL")));
  const std::vector<double> results = ResultsOf(run);
  ASSERT_EQ(results.size(), 4U);
  EXPECT_NEAR(results[0], 0.3, 0.02);

  const testing::Outcome replay = testing::RunProgram({"tumbler replay", record});
  EXPECT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_THAT(replay.text, HasSubstr("identical"));

  ASSERT_EQ(testing::RunProgram({"tumbler record", record, "--truth-csv", Path("truth.csv"),
                                 "--mcap", Path("run.mcap")})
                .exit_code,
            0);
  std::istringstream csv(ReadFile(Path("truth.csv")));
  std::string header, row, last;
  std::getline(csv, header);
  EXPECT_THAT(header, HasSubstr("root_y_m,root_z_m,root_quaternion_w,"));
  EXPECT_THAT(header, Not(HasSubstr("pitch")));
  while (std::getline(csv, row)) last = row;
  std::vector<double> numbers;
  std::istringstream cells(last);
  for (std::string cell; std::getline(cells, cell, ',');) numbers.push_back(std::stod(cell));
  double square = 0;
  for (std::size_t i = 4; i < 8; ++i) square += numbers[i] * numbers[i];
  EXPECT_NEAR(square, 1, 1e-12);
  EXPECT_THAT(ReadFile(Path("run.mcap")), HasSubstr("tumbler.TruthInSpace"));

  const testing::Outcome view =
      testing::RunProgram({"tumbler view", record, "--out", Path("page.html")});
  ASSERT_EQ(view.exit_code, 0) << view.text;
  const std::string page = ReadFile(Path("page.html"));
  EXPECT_THAT(page, HasSubstr("as the simulation says that it truly was"));
  EXPECT_THAT(page, HasSubstr("Following error"));
  EXPECT_THAT(page, HasSubstr("the robot rests as after walk"));
}

TEST_F(SoloWalks, APageTellsOfPushesFromTheSideAndWhatCannotShowItSaysWhatCan) {
  const std::string record = Path("pushed.rec");
  const std::string twin = SourcePath("primitives/solo8/twin.toml");
  ASSERT_EQ(Run(walk_, {"--record", record, "--twin", twin}).exit_code, 0);
  ASSERT_EQ(testing::RunProgram({"tumbler view", record, "--out", Path("pushed.html")}).exit_code,
            0);
  EXPECT_THAT(ReadFile(Path("pushed.html")), HasSubstr("0 N along x, -6 N along y, 0 N along z"));
  const testing::Outcome served = testing::RunProgram({"tumbler view", record, "--port", "0"});
  EXPECT_EQ(served.exit_code, 1);
  EXPECT_THAT(served.text, HasSubstr("the entry of 'walk' is of a robot in space"));
  EXPECT_THAT(served.text, HasSubstr("tumbler view --out with it alone"));
}

TEST_F(SoloWalks, AsItsPageShowsTheMotionAlone) {
  const testing::Outcome view =
      testing::RunProgram({"tumbler view", walk_, "--out", Path("motion.html")});
  ASSERT_EQ(view.exit_code, 0) << view.text;
  EXPECT_THAT(ReadFile(Path("motion.html")), HasSubstr("Simulated as the model"));
}

TEST_F(SoloWalks, TheSameWhereverItBeginsAndWhateverItsHeading) {
  const Outcome here = Run(walk_, {});
  // Turned by 1.1 rad about the vertical, elsewhere.
  const Outcome there =
      Run(walk_, {"--twin", Write("there.toml", std::string(kTwinHead) +
                                                    "[start]\nx_m = 2.0\ny_m = -1.0\nquaternion = "
                                                    "[0.8525245220595057, 0.0, 0.0, "
                                                    "0.5226872289306592]\n")});
  ASSERT_EQ(there.exit_code, 0) << there.text;
  const std::vector<double> a = ResultsOf(here), b = ResultsOf(there);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 2e-4) << i;
}

/// Judges the walk, as if it were for a heading of the base's x at its end, of a robot that begins
/// turned by `begins` about the vertical and ends as it says.
JudgedTarget HeadingJudged(const std::string& walk, double target, double begins,
                           const SpaceMatrix& ends) {
  const SimulatedMotion motion(LoadMotion(walk), TaskSpaces::kPlaneAndSpace);
  SequenceFile file = motion.file();
  PrimitiveFile& primitive = file.primitives[0];
  PurposeTarget heading{PurposeTarget::Of::kHeading, PurposeTarget::When::kEnd, target, 0.05};
  heading.link = "base_link";
  heading.in_space = {1, 0, 0};
  heading.along = {0, 0, 1};
  primitive.purpose = {{heading, target}};
  PurposeJudge judge(file, motion.problem().space->scene.robot);
  TwinState truth;
  truth.joint_positions_rad = primitive.entry.joint_positions_rad;
  truth.joint_velocities_rad_s.resize(truth.joint_positions_rad.size());
  const auto turned = [&](const SpaceMatrix& by) {
    truth.root_quaternion = ToQuaternion(by * ToRotation(primitive.entry.root_quaternion));
  };
  TickRecord record;
  record.state = ExecutorState::kRunning;
  turned(Spatial::RotationBy(SpaceVector::UnitZ(), begins).m);
  judge.Observe(record, 0, truth);
  turned(ends);
  record.state = ExecutorState::kSettling;
  judge.Observe(record, 1000 * kMs, truth);
  return judge.passages().at(0).purpose.at(0);
}

TEST_F(SoloWalks, AHeadingIsJudgedFromThatWithWhichTheMotionBeginsAndTheShortWayRound) {
  const auto about_z = [](double angle) {
    return Spatial::RotationBy(SpaceVector::UnitZ(), angle).m;
  };
  for (const double begins : {0.0, 1.0, 2.9, -2.0}) {
    const JudgedTarget left = HeadingJudged(walk_, 1.57, begins, about_z(begins + 1.55));
    ASSERT_TRUE(left.result);
    EXPECT_NEAR(*left.result, 1.55, 1e-6) << begins;
    EXPECT_EQ(left.met(), true);
    const JudgedTarget right = HeadingJudged(walk_, 1.57, begins, about_z(begins - 1.55));
    EXPECT_NEAR(right.result.value(), -1.55, 1e-6) << begins;
    // Beyond half a turn the angle goes on.
    const JudgedTarget about = HeadingJudged(walk_, 3.1, begins, about_z(begins + 3.18));
    EXPECT_NEAR(about.result.value(), 3.18, 1e-6) << begins;
  }
}

TEST_F(SoloWalks, ARobotWhoseAxisPointsUpHasNoHeadingAndIsNotJudged) {
  const SpaceMatrix up = Spatial::RotationBy(SpaceVector::UnitY(), -1.5707963267948966).m;
  const JudgedTarget judged = HeadingJudged(walk_, 0, 0.3, up);
  EXPECT_FALSE(judged.result);
  EXPECT_EQ(judged.name(), "heading of base_link's (1, 0, 0) about (0, 0, 1), at the end");
  EXPECT_THAT(judged.Verdict(), HasSubstr("not judged, the axis points along the direction"));
  EXPECT_FALSE(AllMet({judged}));
}

TEST_F(SoloWalks, APushFromTheSideThatFellsItIsToldAndOneThatItBearsIsNot) {
  const auto pushed = [this](double force_n) {
    return Run(walk_, {"--twin", Write("pushed.toml", std::string(kTwinHead) +
                                                          "[[push]]\nlink = \"base_link\"\n"
                                                          "start_s = 2.2\nduration_s = 0.1\n"
                                                          "force_n = [0.0, " +
                                                          std::to_string(force_n) + ", 0.0]\n")});
  };
  const Outcome hard = pushed(60);
  EXPECT_EQ(hard.exit_code, 4) << hard.text;
  EXPECT_THAT(hard.text, HasSubstr("FELL"));
  EXPECT_THAT(hard.text, HasSubstr("tilted by"));
  const Outcome light = pushed(5);
  EXPECT_EQ(light.exit_code, 0) << light.text;
  EXPECT_THAT(light.text, Not(HasSubstr("FELL")));
}

TEST_F(SoloWalks, AFallThatEndsAfterTheTorqueIsOffIsToldToo) {
  // The torque is off at 5.8 s.
  const Outcome late = Run(
      walk_, {"--twin", Write("late.toml", std::string(kTwinHead) +
                                               "[[push]]\nlink = \"base_link\"\nstart_s = 5.6\n"
                                               "duration_s = 0.1\nforce_n = [0.0, 90.0, 0.0]\n")});
  EXPECT_EQ(late.exit_code, 4) << late.text;
  EXPECT_THAT(late.text, HasSubstr("FELL"));
}

TEST_F(SoloWalks, OnAndOnInASequence) {
  const std::string sequence = Write(
      "on.toml",
      "format = \"tumbler-sequence\"\nversion = 1\nname = \"on\"\nstart = \"walk\"\n[primitives]\n"
      "walk = \"" +
          walk_ +
          "\"\n[[node]]\nname = \"walk\"\nprimitive = \"walk\"\nsafe = true\nends_cycle = true\n"
          "[[edge]]\nfrom = \"walk\"\nto = \"walk\"\nwhen = \"always\"\n");
  const Outcome run = Run(sequence, {"--cycles", "2"});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text, HasSubstr("2 motions, 2 complete cycles"));
  const std::string begun =
      ReadFile(sequence) + "[begin]\nnodes = [\"walk\"]\nlink = \"base_link\"\n";
  const Outcome refused = Run(Write("begun.toml", begun), {});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.text, HasSubstr("begin: tells poses apart by a pitch, and is for robots in "
                                      "the plane so far"));
}

TEST_F(SoloWalks, ATwinThatBeginsInsideAnObstacleIsRefused) {
  const std::string box =
      "[[obstacle]]\nname = \"crate\"\nkind = \"box\"\ncentre_m = [0.0, 0.0, 0.2]\n"
      "size_m = [0.3, 0.3, 0.3]\n";
  const Outcome run = Run(walk_, {"--twin", Write("crate.toml", std::string(kTwinHead) + box)});
  EXPECT_EQ(run.exit_code, 1) << run.text;
  EXPECT_THAT(run.text, HasSubstr("inside 'crate'"));
}

TEST_F(SoloWalks, DrivesThatTheMotionHasNoJointForAreNamed) {
  const std::string drives = ReadFile(SourcePath("primitives/solo8/drives.toml"));
  const std::size_t first = drives.find("[[drive]]"), second = drives.find("[[drive]]", first + 1);
  std::string tail = Replaced(drives.substr(first, second - first), "FL_HFE", "tail");
  tail = Replaced(tail, "command_id = 1\n", "command_id = 100\n");
  tail = Replaced(tail, "reply_id = 17\n", "reply_id = 101\n");
  const testing::Outcome run = testing::RunProgram(
      {"tumbler run", "sim", walk_, "--drives", Write("drives.toml", drives + "\n" + tail)});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text,
              HasSubstr("the motion has no joint for the drives of tail, which stay off"));
}

TEST(Solo12, GetsUpFromItsBackTurnsAndWalksInOneSequence) {
  const std::string sequence = SourcePath("primitives/solo12/get_up_turn_walk.toml");
  const testing::Outcome fits = testing::RunProgram({"tumbler", "chain", "check", sequence});
  EXPECT_EQ(fits.exit_code, 0) << fits.text;
  EXPECT_THAT(fits.text, HasSubstr("3 nodes, 3 joins, all fit"));
  const testing::TemporaryFolder folder;
  const std::string record = (folder.path() / "run.rec").string();
  const testing::Outcome run = testing::RunProgram({"tumbler", "run", "sim", sequence, "--drives",
                                                    SourcePath("primitives/solo12/drives.toml"),
                                                    "--cycles", "2", "--record", record});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text, HasSubstr("4 motions, 2 complete cycles; the robot where it should be"));
  const testing::Outcome again = testing::RunProgram({"tumbler", "replay", record});
  EXPECT_EQ(again.exit_code, 0) << again.text;
  EXPECT_THAT(again.text, HasSubstr("identical"));
  const std::string page = (folder.path() / "page.html").string();
  const testing::Outcome viewed = testing::RunProgram({"tumbler", "view", record, "--out", page});
  EXPECT_EQ(viewed.exit_code, 0) << viewed.text;
  EXPECT_THAT(ReadFile(page), HasSubstr("<h1 id=\"title\">get_up, turn, walk</h1>"));
}

TEST_F(SoloWalks, StepsThatContactDoesNotBearAreWarnedOf) {
  const SimulatedMotion motion(LoadMotion(walk_), TaskSpaces::kPlaneAndSpace);
  const Problem& problem = motion.problem();
  const Primitive<double>& walk = motion.file().PrimitiveOf(0).primitive;
  const ContactSteps by_path =
      ContactStepsOf(problem, walk, problem.contact(), JointMoves::kByPath);
  EXPECT_LT(by_path.step_s, problem.advisable_step_s) << "of the poses at the ends alone";
  EXPECT_GT(by_path.time_s, 0);
  EXPECT_LT(by_path.time_s, walk.duration_s);
  // A foot is lighter than the robot.
  EXPECT_LT(ContactStepsOf(problem, walk, problem.contact(), JointMoves::kByTorque).step_s,
            0.5 * by_path.step_s);
  const Outcome long_steps =
      Run(walk_, {"--twin", Write("long.toml", std::string(kTwinHead) + "step_s = 2.0e-4\n")});
  EXPECT_THAT(long_steps.text, HasSubstr("warning: step_s of the twin takes 0.2 ms, and contact "
                                         "allows 0.1"));
  EXPECT_THAT(Run(walk_, {}).text, Not(HasSubstr("warning: step_s")));
}

TEST_F(SoloWalks, ATaskInThePlaneHasNoQuaternion) {
  PrimitiveFile handstand = LoadPrimitive(SourcePath("primitives/handstand.toml"));
  handstand.entry.root_quaternion = {1, 0, 0, 0};
  try {
    static_cast<void>(TaskOf(handstand, TaskSpaces::kPlaneAndSpace));
    ADD_FAILURE() << "accepted";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("the entry of 'handstand' has a root_quaternion"));
  }
}

TEST_F(SoloWalks, TwinFilesSayWhatIsNotInSpaceYet) {
  const SimulatedMotion motion(LoadMotion(walk_), TaskSpaces::kPlaneAndSpace);
  const auto refusal = [&motion](const std::string& text) -> std::string {
    try {
      ParseTwin(kTwinHead + text, "twin.toml", motion);
    } catch (const FileError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal("[sensor]\nnoise_rad = 0.1\n"), HasSubstr("plane so far"));
  EXPECT_THAT(refusal("[start]\npitch_rad = 0.1\n"), HasSubstr("pitch_rad"));
  EXPECT_THAT(refusal("[start]\nquaternion = [1.0, 0.5, 0.0, 0.0]\n"), HasSubstr("has the length"));
  EXPECT_THAT(refusal("[[push]]\nlink = \"base_link\"\nstart_s = 0\nduration_s = 1\n"
                      "force_n = [1.0, 2.0]\n"),
              HasSubstr("force_n"));
  const SimulatedRobotConfig on_a_box = ParseTwin(
      std::string(kTwinHead) +
          "[[obstacle]]\nname = \"step\"\nkind = \"box\"\ncentre_m = [0.0, 0.0, 0.0]\n"
          "size_m = [2.0, 2.0, 0.1]\nmu = 0.9\n[start]\nquaternion = [1.0, 0.0, 0.0, 0.0]\n",
      "twin.toml", motion);
  ASSERT_EQ(on_a_box.twin.obstacles_in_space.size(), 1U);
  EXPECT_EQ(on_a_box.twin.patches.at(0).mu, 0.9);
  // It is lowered until it rests on the box, which is 5 cm high.
  EXPECT_NEAR(on_a_box.start->root_z_m, motion.file().PrimitiveOf(0).entry.root_z_m + 0.05, 1e-3);
}

}  // namespace
}  // namespace tumbler
