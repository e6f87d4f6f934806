// Motions of robots in space: found, certified, written, read, and played on robots that differ.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/certify/certificate.h"
#include "offline/certify/second_look.h"
#include "offline/certify/space_robust.h"
#include "offline/certify/task_result.h"
#include "offline/pages/space_motion.h"
#include "offline/problem/space_task.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/guess.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/rollout.h"
#include "offline/studies/space_study.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::Outcome;
using testing::ReadFile;
using testing::RunProgram;
using testing::SourcePath;

/// Solo8 stands, and shifts its weight forward by 3 cm as it goes 3 cm lower: few control points,
/// and solved in seconds.
std::string ShiftTask() {
  return R"(format = "tumbler-task"
version = 1
name = "shift"
robot = "solo8.urdf"
root = "floating"
duration_s = 0.4
settle_s = 0.2
[start]
joints_rad = { FL_HFE = 0.8, FL_KFE = -1.6, FR_HFE = 0.8, FR_KFE = -1.6, HL_HFE = -0.8, HL_KFE = 1.6, HR_HFE = -0.8, HR_KFE = 1.6 }
[end]
joints_rad = { FL_HFE = 1.0, FL_KFE = -1.9, FR_HFE = 1.0, FR_KFE = -1.9, HL_HFE = -1.0, HL_KFE = 1.9, HR_HFE = -1.0, HR_KFE = 1.9 }
[spline]
control_points = 7
[limits]
velocity_max_rad_s = 40.0
[[cost]]
term = "terminal"
of = "position"
along = [0.0, 0.0, 1.0]
when = "settled"
from_start = true
target = -0.03
tolerance = 0.01
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

Task Parsed(const std::string& text) {
  return ParseTask(text, "shift.toml", ReadFile(SourcePath("primitives/solo8/solo8.urdf")),
                   "solo8.urdf", TaskSpaces::kPlaneAndSpace);
}
Task Shift() { return Parsed(ShiftTask()); }

/// What is wrong with such a task; empty: nothing.
std::string MistakeIn(const std::string& text) {
  try {
    Parsed(text);
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

WorkSettings Quietly(int threads) {
  WorkSettings settings;
  settings.threads = threads;
  settings.quiet = true;
  return settings;
}

/// The motion of that task, found once for all tests of MotionInSpace, which are one process.
const TaskResult& TheResult() {
  static const TaskResult result = WorkOn(Shift(), Quietly(1));
  return result;
}

TEST(MotionInSpace, IsAsAskedByAFinerStep) {
  const TaskResult& result = TheResult();
  ASSERT_TRUE(result.file) << result.cause;
  EXPECT_TRUE(result.look.acceptable()) << result.look.Objections();
  ASSERT_EQ(result.look.purpose.size(), 2U);
  EXPECT_NEAR(result.look.purpose[0].result, result.look.purpose[0].target, 0.01);
  EXPECT_LT(result.file->certificate.gradient_error, 1e-5);
  ASSERT_TRUE(result.look.slip_m);
  EXPECT_GT(*result.look.slip_m, 0);
  EXPECT_LT(result.file->certificate.constraint_violation, 1e-6);
}

TEST(MotionInSpace, IsPlayedOnTheModelThroughItsDrives) {
  ASSERT_TRUE(TheResult().through_drives);
  EXPECT_TRUE(TheResult().through_drives->as_asked());
}

TEST(MotionInSpace, IsTheSameAgainWithTwoThreads) {
  ASSERT_TRUE(TheResult().file);
  const TaskResult again = WorkOn(Shift(), Quietly(2));
  ASSERT_TRUE(again.file);
  EXPECT_EQ(ContentHash(*again.file), ContentHash(*TheResult().file));
}

TEST(MotionInSpace, KeepsWhereItsRootIsAndWhatItIsForThroughItsFile) {
  ASSERT_TRUE(TheResult().file);
  const PrimitiveFile& file = *TheResult().file;
  const PrimitiveFile read = ParsePrimitive(ToToml(file), "shift.toml");
  EXPECT_TRUE(read.entry.is_in_space());
  EXPECT_EQ(read.entry.root_quaternion, file.entry.root_quaternion);
  EXPECT_NEAR(read.entry.root_z_m, 0.24, 0.02);
  ASSERT_EQ(read.purpose.size(), file.purpose.size());
  EXPECT_EQ(read.purpose[1].of, PurposeTarget::Of::kMisalignment);
  EXPECT_EQ(read.purpose[1].along, (std::array<double, 3>{0, 0, 1}));
  const Task task = TaskOf(read, TaskSpaces::kPlaneAndSpace);
  EXPECT_NEAR(task.problem.start_q[2], file.entry.root_z_m, 1e-12);
  EXPECT_THAT(ParametersOf(read.primitive),
              ::testing::Pointwise(::testing::DoubleEq(), TheResult().best.x));
  EXPECT_THROW(TaskOf(read), FileError);  // A caller who takes the plane alone.
}

TEST(MotionInSpace, IsRefusedWithAQuaternionThatIsNoRotation) {
  ASSERT_TRUE(TheResult().file);
  PrimitiveFile file = *TheResult().file;
  file.entry.root_quaternion = {1, 0.1, 0, 0};
  try {
    ToToml(file);
    FAIL();
  } catch (const std::exception& error) {
    EXPECT_THAT(error.what(), HasSubstr("root_quaternion"));
  }
}

TEST(MotionInSpace, IsJudgedOnRobotsByItsTaskAndOnTheModelIsAsAsked) {
  ASSERT_TRUE(TheResult().file);
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "shift.toml").string();
  testing::WriteFile(path, ToToml(*TheResult().file));
  SpaceStudy study;
  study.motion = path;
  study.robots = 3;
  study.spreads.mass = 0;
  study.spreads.LeaveGround();
  const SpaceStudyResult model = RunSpaceStudy(study);
  EXPECT_EQ(model.share().count, 3);
  EXPECT_EQ(model.trials[0].purpose[0].result, model.trials[1].purpose[0].result);
  // A ground without friction lets the feet go.
  study.spreads.friction = GroundSpread::Between{1e-4, 2e-4};
  const SpaceStudyResult ice = RunSpaceStudy(study);
  EXPECT_NE(ice.trials[0].purpose[0].result, model.trials[0].purpose[0].result);
  // And one of which no step that is taken is short enough is refused.
  study.spreads.LeaveGround();
  study.spreads.damping = GroundSpread::Between{5e5, 1e6};
  EXPECT_THROW(RunSpaceStudy(study), std::invalid_argument);
  study.spreads.LeaveGround();
  study.spreads.length = 0.1;
  EXPECT_THROW(RunSpaceStudy(study), std::invalid_argument);
}

TEST(MotionInSpace, IsJudgedByWhatItsPrimitiveIsForAndNotWhereNoPushCouldChangeThat) {
  ASSERT_TRUE(TheResult().file);
  const testing::TemporaryFolder folder;
  PrimitiveFile file = *TheResult().file;
  SpaceStudy study;
  study.motion = (folder.path() / "shift.toml").string();
  study.robots = 2;
  study.scale = 0;
  // It goes 3 cm lower. A purpose that says it stays is missed, whatever the task's cost asks for.
  file.purpose[0].target = file.purpose[0].result = 0.3;
  testing::WriteFile(study.motion, ToToml(file));
  EXPECT_EQ(RunSpaceStudy(study).share().count, 0);
  // Where nothing is to last, nobody would be judged after a push.
  file = *TheResult().file;
  for (PurposeFigure& figure : file.purpose) figure.when = PurposeTarget::When::kEnd;
  testing::WriteFile(study.motion, ToToml(file));
  study.push_n = 100;
  study.hold_s = 2;
  EXPECT_THROW(RunSpaceStudy(study), std::invalid_argument);
}

TEST(MotionInSpace, IsRefusedWithADirectionOfNoLengthOrAPitchBesideItsQuaternion) {
  ASSERT_TRUE(TheResult().file);
  PrimitiveFile file = *TheResult().file;
  file.purpose[0].along = {0, 0, 0};
  EXPECT_THROW(ToToml(file), std::exception);
  file = *TheResult().file;
  file.entry.root_pitch_rad = 1.5;
  EXPECT_THROW(ToToml(file), std::exception);
}

TEST(MotionInSpace, WithoutItsQuaternionIsSaidToLackIt) {
  ASSERT_TRUE(TheResult().file);
  PrimitiveFile file = *TheResult().file;
  file.entry.root_quaternion = {};
  try {
    static_cast<void>(TaskOf(file, TaskSpaces::kPlaneAndSpace));
    ADD_FAILURE() << "accepted";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("the entry of 'shift' has no root_quaternion"));
  }
}

TEST(MotionInSpace, IsThatAtBothOfItsEnds) {
  ASSERT_TRUE(TheResult().file);
  PrimitiveFile file = *TheResult().file;
  file.exit.root_quaternion = {};
  file.exit.root_y_m = 0;
  try {
    ParsePrimitive(ToToml(file), "shift.toml");
    ADD_FAILURE() << "accepted";
  } catch (const std::exception& error) {
    EXPECT_THAT(error.what(), HasSubstr("exit.root_quaternion: is missing, unlike the entry's"));
  }
}

/// The same on ground of which little is known, and searched for briefly.
Task RobustShift() {
  Task task = ParseTask(ShiftTask() +
                            "[robust]\nmass = 0.1\nfriction = { from = 0.2, to = 1.0 }\n"
                            "robots = 2\ncandidates = 4\ngenerations = 2\n",
                        "shift.toml", ReadFile(SourcePath("primitives/solo8/solo8.urdf")),
                        "solo8.urdf", TaskSpaces::kPlaneAndSpace);
  SpaceRobustSettings& robust = *task.problem.space->robust;
  robust.first_judges = 2;
  robust.last_judges = 4;
  robust.fresh = 10;
  return task;
}

TEST(MotionInSpace, MadeRobustServesNoFewerRobotsThanBeforeWhateverTheThreads) {
  ASSERT_TRUE(TheResult().file);
  // From the motion that is there, so that nothing is searched for the model again.
  const auto find = [](int threads) {
    Task task = RobustShift();
    task.guess = ParametersOf(TheResult().file->primitive);
    return WorkOn(std::move(task), Quietly(threads));
  };
  const TaskResult one = find(1);
  ASSERT_TRUE(one.file) << one.cause;
  ASSERT_TRUE(one.robust);
  EXPECT_EQ(one.robust->of, 10);
  EXPECT_GE(one.robust->as_asked, one.robust->before);
  EXPECT_GT(one.robust->as_asked, 0);
  EXPECT_EQ(ToToml(*find(2).file), ToToml(*one.file));
  // What is said of the robots is what they do when they are played.
  SolveOptions options;
  EXPECT_EQ(CountAsAskedInSpace(one.problem(), one.best.x, one.look.purpose, options, 10),
            one.robust->as_asked);
}

TEST(MotionInSpace, IsCountedOnRobotsThatDiffer) {
  ASSERT_TRUE(TheResult().file);
  const std::vector<double>& x = TheResult().best.x;
  const std::vector<PurposeFigure>& purpose = TheResult().look.purpose;
  Problem problem = RobustShift().problem;
  SolveOptions options;
  problem.space->robust->spreads = {};
  problem.space->robust->spreads.mass = 0;
  problem.space->robust->spreads.LeaveGround();
  EXPECT_EQ(CountAsAskedInSpace(problem, x, purpose, options, 8), 8) << "the model, eight times";
  problem.space->robust->spreads.mass = 0.9;
  EXPECT_LT(CountAsAskedInSpace(problem, x, purpose, options, 8), 8);
}

TEST(SpaceScene, CreepsOnASlopeThatDryFrictionWouldHoldItOn) {
  const std::string level = ShiftTask();
  const std::string slope =
      testing::Replaced(level, "normal = [0.0, 0.0, 1.0]", "normal = [-0.05, 0.0, 1.0]");
  const Problem problem =
      ParseTask(slope, "shift.toml", ReadFile(SourcePath("primitives/solo8/solo8.urdf")),
                "solo8.urdf", TaskSpaces::kPlaneAndSpace)
          .problem;
  // It stands as the ground slopes.
  EXPECT_NEAR(problem.space->start_orientation(2, 0), 0.05, 0.01);
}

TEST(MotionInSpace, HasAPageOfItsPrimitive) {
  ASSERT_TRUE(TheResult().file);
  const TaskResult& result = TheResult();
  const SpaceMotionPage page = MakeSpaceMotionPage(result.task, result.best.x, *result.file);
  EXPECT_EQ(page.bodies.size(), 9U);  // base, and two links of each leg
  EXPECT_GT(page.frames.size(), 30U);
  EXPECT_NEAR(page.frames.front().poses.front().translation.z(), result.file->entry.root_z_m, 1e-9);
  EXPECT_EQ(page.frames.front().contacts.size(), 4U);
  double weight = 0;
  for (const SpaceContact& contact : page.frames.front().contacts) weight += contact.force_n.z();
  EXPECT_NEAR(weight, 9.81 * result.problem().space->scene.robot.mass_kg(), 0.05);
  EXPECT_EQ(page.plots.size(), 2U);
  EXPECT_EQ(page.plots[0].series.size(), 8U);
}

TEST(MotionInSpace, ProgramsThatDoNotTakeItYetSaySo) {
  ASSERT_TRUE(TheResult().file);
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "shift.toml").string();
  testing::WriteFile(path, ToToml(*TheResult().file));
  for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{
           {"tumbler", "robustness", path, "--lanes"},
           {"tumbler", "robustness", SourcePath("primitives/solo12/get_up_turn_walk.toml"),
            "--cycles", "1", "--lanes"}}) {
    const Outcome outcome = RunProgram(command);
    EXPECT_NE(outcome.exit_code, 0) << command[1];
    EXPECT_THAT(outcome.text, HasSubstr("space")) << command[1];
    EXPECT_THAT(outcome.text, Not(HasSubstr("segmentation"))) << command[1];
  }
}

TEST(SpaceTask, NamesWhatIsForThePlane) {
  EXPECT_EQ(MistakeIn(ShiftTask()), "");
  EXPECT_THAT(MistakeIn(ShiftTask() + "[robust]\nzero_rad = 0.05\n"),
              HasSubstr("zero_rad: is not a key"));
  EXPECT_EQ(MistakeIn(ShiftTask() + "[robust]\nfriction = { factor = 2.0 }\n"), "");
  EXPECT_THAT(MistakeIn(testing::Replaced(ShiftTask(), "settle_s = 0.2",
                                          "settle_s = 0.2\nslope_rad = 0.1")),
              HasSubstr("normal of an [[obstacle]]"));
  EXPECT_THAT(
      MistakeIn(testing::Replaced(ShiftTask(), "axis = [0.0, 0.0, 1.0]", "axis = [0.0, 0.0, 0.0]")),
      HasSubstr("no direction"));
  EXPECT_THAT(MistakeIn(testing::Replaced(ShiftTask(), "[start]",
                                          "[start]\nquaternion = [1.0, 1.0, 0.0, 0.0]")),
              HasSubstr("unit quaternion"));
  EXPECT_THAT(MistakeIn(testing::Replaced(ShiftTask(), "[start]", "[start]\npitch_rad = 1.0")),
              HasSubstr("pitch_rad"));
}

/// That task, with the hind legs tied to the front ones, whose mirror images they are.
std::string TiedTask(const std::string& tied = R"(HL_HFE = "-FL_HFE", HL_KFE = "-FL_KFE", )"
                                               R"(HR_HFE = "-FR_HFE", HR_KFE = "-FR_KFE")") {
  return testing::Replaced(ShiftTask(), "settle_s = 0.2",
                           "settle_s = 0.2\ntied = { " + tied + " }");
}

Task Tied() { return Parsed(TiedTask()); }

TEST(TiedJoints, MoveAsTheOthersDoAndTheSearchLooksForTheseAlone) {
  const Task task = Tied();
  const FreePaths paths(task.problem);
  EXPECT_EQ(paths.count() * 2, static_cast<std::size_t>(task.problem.parameter_count()));
  const TaskResult result = WorkOn(task, Quietly(1));
  ASSERT_TRUE(result.file) << result.cause;
  EXPECT_TRUE(result.look.acceptable()) << result.look.Objections();
  const Primitive<double>& primitive = result.file->primitive;
  const auto path_of = [&primitive](std::string_view name) -> const auto& {
    const auto found = std::ranges::find_if(
        primitive.motions(), [&](const auto& motion) { return motion.name.view() == name; });
    return found->position;
  };
  for (const std::string joint : {"FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE"}) {
    std::string hind = joint;
    hind[0] = 'H';
    for (const double time_s : {0.05, 0.17, 0.2, 0.33}) {
      EXPECT_NEAR(path_of(hind).Evaluate(time_s).value, -path_of(joint).Evaluate(time_s).value,
                  1e-12)
          << joint;
    }
  }
}

TEST(TiedJoints, OfOneThatIsLockedItIsSaidThatNothingMovesIt) {
  std::string text = testing::Replaced(TiedTask(), "[start]", "[locked]\nFL_KFE = -1.6\n[start]");
  text = testing::Replaced(text, "FL_KFE = -1.6, FR_HFE", "FR_HFE");
  text = testing::Replaced(text, "FL_KFE = -1.9, FR_HFE", "FR_HFE");
  EXPECT_THAT(MistakeIn(text), HasSubstr("tied.HL_KFE: is tied to 'FL_KFE', which is locked"));
}

TEST(TiedJoints, HaveSlopesThatAreThoseOfWhatTheyFollow) {
  const Problem problem = Tied().problem;
  const FreePaths paths(problem);
  std::vector<double> y = paths.Reduce(RandomStarts(problem).Draw(3));
  Rollout rollout(problem, 1e-3);
  OutputGradients outputs = OutputGradients::Of(rollout);
  rollout.Run(paths.Expand(y), outputs);
  const OutputGradients slopes = paths.ReduceSlopes(outputs);
  for (std::size_t i = 0; i < y.size(); ++i) {
    constexpr double kStep = 1e-6;
    std::vector<double> up = y, down = y;
    up[i] += kStep;
    down[i] -= kStep;
    const double difference =
        (rollout.Run(paths.Expand(up)).cost - rollout.Run(paths.Expand(down)).cost) / (2 * kStep);
    EXPECT_NEAR(slopes(0, static_cast<Eigen::Index>(i)), difference,
                1e-5 * (1 + std::abs(difference)));
  }
}

TEST(TiedJoints, AreWithinTheLimitsOfEachOfThem) {
  Problem problem = Tied().problem;
  problem.joints[problem.tied.front().joint].limits.position_max_rad = 0.5;
  const FreePaths paths(problem);
  const auto leader = static_cast<std::size_t>(problem.first_parameter(problem.tied.front().to));
  EXPECT_EQ(paths.bounds(leader).min, -0.5) << "it moves the other way round";
  std::vector<double> y(paths.count(), 0.0);
  y[leader] = 0.25;
  const std::vector<double> x = paths.Expand(y);
  EXPECT_EQ(x[static_cast<std::size_t>(problem.first_parameter(problem.tied.front().joint))],
            -0.25);
  EXPECT_EQ(paths.Reduce(x), y);
  y[leader] = -1;
  EXPECT_EQ(paths.Inside(y)[leader], -0.5);
}

TEST(TiedJoints, ThatCannotFollowAreRefused) {
  EXPECT_EQ(MistakeIn(TiedTask()), "");
  EXPECT_THAT(MistakeIn(TiedTask(R"(HL_HFE = "FL_HFE")")),
              HasSubstr("tied.HL_HFE: is tied to 'FL_HFE', and its start is -0.8 rad where that "
                        "needs 0.8"));
  EXPECT_THAT(MistakeIn(TiedTask(R"(HL_HFE = "-FL_KNEE")")),
              HasSubstr("allowed: another joint that is tied to none"));
  EXPECT_THAT(MistakeIn(TiedTask(R"(HL_HFE = "HL_HFE")")), HasSubstr("allowed: another joint"));
  EXPECT_THAT(MistakeIn(TiedTask(R"(HL_HFE = "-FL_HFE", FL_HFE = "FR_HFE")")),
              HasSubstr("allowed: another joint that is tied to none"));
  EXPECT_THAT(MistakeIn(TiedTask(R"(HL_KNEE = "FL_HFE")")),
              HasSubstr("is not a joint of the robot"));
  EXPECT_THAT(MistakeIn(testing::Replaced(
                  TiedTask(), "control_points = 7",
                  "control_points = { FL_HFE = 8, FL_KFE = 7, FR_HFE = 7, FR_KFE = 7, HL_HFE = 7, "
                  "HL_KFE = 7, HR_HFE = 7, HR_KFE = 7 }")),
              HasSubstr("has 7 control points, and 'FL_HFE', which it is tied to, 8"));
}

TEST(SpaceScene, ComesToRestOnItsFeetWithItsWeightOnThem) {
  const Problem problem = Shift().problem;
  const SpaceScene& scene = problem.space->scene;
  SpacePose pose{problem.start_q, problem.space->start_orientation};
  pose.q[2] = 0;
  const SpacePose rest = RestPose(scene, pose);
  EXPECT_NEAR(rest.q[2], problem.start_q[2], 1e-6);
  EXPECT_NEAR(rest.orientation(2, 2), 1, 1e-4);
  EXPECT_LT(rest.q[2], TouchingHeight(scene, pose));
}

TEST(SpaceSelfDistances, AreThoseOfPointsByHandAndHaveTheirDifferencesAsSlopes) {
  const Problem problem = Shift().problem;
  const SpaceRobot& robot = problem.space->scene.robot;
  SpaceSelfDistances distances(robot, problem.space->scene.self_contact.pairs);
  std::vector<double> q(robot.tree.dofs.size(), 0.0);
  // Legs that are folded towards each other.
  for (const char* joint : {"FL_HFE", "FR_HFE"})
    q[static_cast<std::size_t>(robot.FindDof(joint))] = 1.4;
  for (const char* joint : {"HL_HFE", "HR_HFE"})
    q[static_cast<std::size_t>(robot.FindDof(joint))] = -1.4;
  const auto near = distances.FindNearer(q, 0.1);
  ASSERT_FALSE(near.empty());
  const std::vector<SpaceSelfDistances::Near> found(near.begin(), near.end());
  for (const SpaceSelfDistances::Near& pair : found) {
    for (std::size_t j = 6; j < q.size(); ++j) {
      const auto at = [&](double h) {
        std::vector<double> moved = q;
        moved[j] += h;
        SpaceSelfDistances other(robot, std::span(&pair.pair, 1));
        return other.Nearest(moved).distance_m;
      };
      EXPECT_NEAR((at(1e-6) - at(-1e-6)) / 2e-6, pair.slopes[j], 1e-5)
          << NameOf(robot, pair.pair) << " " << j;
    }
  }
}

/// The slip term of a motion in this problem [m].
double SlipOf(Problem problem, const std::vector<double>& x) {
  std::erase_if(problem.cost,
                [](const CostTerm& term) { return term.kind != CostTerm::Kind::kSlip; });
  problem.cost.at(0).weight = 1;
  return Rollout(problem, problem.solver.step_s).Run(x).cost;
}

TEST(WalkThatPaysForSlip, SlidesLessThanHalfOfTheWayOfOneThatDoesNot) {
  const std::string walk = ReadFile(SourcePath("primitives/solo8/tasks/walk.toml"));
  Task task = Parsed(
      testing::Replaced(walk, "[contact]", "[[cost]]\nterm = \"slip\"\nweight = 2.0\n\n[contact]"));
  const std::vector<double> shipped =
      ParametersOf(LoadPrimitive(SourcePath("primitives/solo8/walk.toml")).primitive);
  const double before_m = SlipOf(task.problem, shipped);
  const TaskResult result = WorkOn(std::move(task), Quietly(1));
  ASSERT_TRUE(result.file) << result.cause;
  EXPECT_TRUE(result.look.acceptable()) << result.look.Objections();
  EXPECT_GT(before_m, 0.02);
  EXPECT_LT(SlipOf(result.problem(), result.best.x), before_m / 2);
  ASSERT_TRUE(result.look.slip_m);
  EXPECT_LT(*result.look.slip_m, 0.1);
}

}  // namespace
}  // namespace tumbler
