// Joints of robots in the plane that move as others do: found, proved, made robust, and refused
// where they cannot.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/index.h"
#include "common/files/primitive_toml.h"
#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "offline/certify/task_result.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/constraints.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/guess.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/robust_search.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solver.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using testing::Replaced;

constexpr const char* kLegs[] = {"FL", "FR", "HL", "HR"};

/// A quadruped with a hip and a knee in each leg. Its base is heavier in front, so that legs which
/// are not tied would not move alike.
std::string Quadruped() {
  std::string urdf = R"(<robot name="quadruped"><link name="base">
<inertial><origin xyz="0.05 0 0"/><mass value="1.6"/><inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
</link>
)";
  const auto joint = [&urdf](const std::string& name, const std::string& parent,
                             const std::string& child, const std::string& at) {
    urdf += "<joint name=\"" + name + "\" type=\"revolute\"><parent link=\"" + parent +
            "\"/><child link=\"" + child + "\"/><origin xyz=\"" + at +
            "\"/><axis xyz=\"0 1 0\"/>"
            "<limit lower=\"-2.5\" upper=\"2.5\" velocity=\"40\" effort=\"10\"/></joint>\n";
  };
  const auto link = [&urdf](const std::string& name, const std::string& more) {
    urdf += "<link name=\"" + name +
            "\"><inertial><origin xyz=\"0 0 -0.08\"/><mass value=\"0.1\"/>"
            "<inertia ixx=\"3e-4\" iyy=\"3e-4\" izz=\"3e-5\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/>"
            "</inertial>" +
            more + "</link>\n";
  };
  for (const std::string leg : kLegs) {
    const std::string hip = leg[0] == 'F' ? "0.19 " : "-0.19 ";
    link(leg + "_UPPER", "");
    link(leg + "_LOWER",
         "<collision><origin xyz=\"0 0 -0.16\"/><geometry><sphere radius=\"0.016\"/></geometry>"
         "</collision>");
    joint(leg + "_HIP", "base", leg + "_UPPER", hip + (leg[1] == 'L' ? "0.1 0" : "-0.1 0"));
    joint(leg + "_KNEE", leg + "_UPPER", leg + "_LOWER", "0 0 -0.16");
  }
  return urdf + "</robot>\n";
}

/// All legs move as the left one in front does, or as its mirror image.
std::string AllTied() {
  return R"(FR_HIP = "FL_HIP", FR_KNEE = "FL_KNEE", HL_HIP = "-FL_HIP", HL_KNEE = "-FL_KNEE", )"
         R"(HR_HIP = "-FL_HIP", HR_KNEE = "-FL_KNEE")";
}

std::string JointsAt(const std::string& hip, const std::string& knee) {
  std::string joints;
  for (const std::string leg : kLegs) {
    const std::string sign = leg[0] == 'F' ? "" : "-", other = leg[0] == 'F' ? "-" : "";
    joints += fmt::format("{}{}_HIP = {}{}, {}_KNEE = {}{}", joints.empty() ? "{ " : ", ", leg,
                          sign, hip, leg, other, knee);
  }
  return joints + " }";
}

/// The quadruped gets up from a crouch. Few control points, and solved in a moment.
/// @param tied  the entries of `tied`; empty: none.
std::string RiseTask(const std::string& tied = AllTied(), const std::string& more = "") {
  return R"(format = "tumbler-task"
version = 1
name = "rise"
robot = "quadruped.urdf"
root = "planar-xz"
duration_s = 0.4
settle_s = 0.2
)" + (tied.empty() ? "" : "tied = { " + tied + " }\n") +
         "[start]\njoints_rad = " + JointsAt("0.9", "1.8") +
         "\n[end]\njoints_rad = " + JointsAt("0.6", "1.2") + R"(
[spline]
control_points = 8
[limits]
rotor_inertia_kg_m2 = 1.0e-3
[[cost]]
term = "terminal"
of = "pitch"
when = "settled"
weight = 10.0
[[cost]]
term = "terminal"
of = "pitch_rate"
when = "settled"
weight = 1.0
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
point_m = [0.0, 0.0]
normal = [0.0, 1.0]
[search]
batch = 16
max_samples = 16
refine = 2
spread_rad = 0.3
)" + more;
}

constexpr const char* kQuickRobust =
    "[robust]\nsamples = 16\nstarts = 1\nimproved = 1\npolish_robots = 8\ngenerations = 3\n";

Task Parsed(const std::string& text) {
  return ParseTask(text, "rise.toml", Quadruped(), "quadruped.urdf");
}

std::string MistakeIn(const std::string& text) {
  try {
    Parsed(text);
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

/// The parameters of a joint.
std::vector<double> PartOf(const Problem& problem, const std::vector<double>& x,
                           std::size_t joint) {
  const auto first = x.begin() + problem.first_parameter(joint);
  return {first, first + problem.joints[joint].free_points()};
}

std::vector<double> Times(double factor, std::vector<double> values) {
  for (double& value : values) value *= factor;
  return values;
}

/// Fails unless every tied joint has its leader's parameters, or minus these, to the bit.
void ExpectTied(const Problem& problem, const std::vector<double>& x) {
  ASSERT_FALSE(problem.tied.empty());
  ASSERT_EQ(x.size(), static_cast<std::size_t>(problem.parameter_count()));
  for (const TiedJoint& tied : problem.tied) {
    EXPECT_EQ(PartOf(problem, x, tied.joint), Times(tied.factor, PartOf(problem, x, tied.to)))
        << problem.joint_name(tied.joint);
  }
}

/// The changes of the parameters as what is free changes: for each joint that is tied to none and
/// each of its points, made by hand of the task's table.
std::vector<std::vector<double>> FreeDirections(const Problem& problem) {
  std::vector<std::vector<double>> directions;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const bool follows =
        std::ranges::any_of(problem.tied, [j](const TiedJoint& tied) { return tied.joint == j; });
    if (follows) continue;
    for (int i = 0; i < problem.joints[j].free_points(); ++i) {
      std::vector<double> direction(static_cast<std::size_t>(problem.parameter_count()));
      direction[Index(problem.first_parameter(j) + i)] = 1;
      for (const TiedJoint& tied : problem.tied) {
        if (tied.to != j) continue;
        direction[Index(problem.first_parameter(tied.joint) + i)] = tied.factor;
      }
      directions.push_back(direction);
    }
  }
  return directions;
}

Eigen::VectorXd Vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// The motion of that task, found and proved once for the tests of TiedInThePlane, which are one
/// process.
struct Proved {
  static Task Asked() {
    Task task = Parsed(RiseTask());
    task.problem.solver.prove = true;
    return task;
  }
  static WorkSettings Quietly() {
    WorkSettings settings;
    settings.quiet = true;
    return settings;
  }
  TaskResult result = WorkOn(Asked(), Quietly());
};
const TaskResult& TheProved() {
  static const Proved proved;
  return proved.result;
}

TEST(TiedInThePlane, WhatIsWrittenHasTheSameControlPointsToTheBit) {
  const TaskResult& result = TheProved();
  ASSERT_TRUE(result.file) << result.cause;
  EXPECT_TRUE(result.look.acceptable()) << result.look.Objections();
  ExpectTied(result.problem(), result.best.x);
  const PrimitiveFile read = ParsePrimitive(ToToml(*result.file), "rise.toml");
  const auto points_of = [&read](const std::string& name) {
    const auto found = std::ranges::find_if(
        read.primitive.motions(), [&](const auto& motion) { return motion.name.view() == name; });
    const auto points = found->position.control_points();
    return std::vector<double>(points.begin(), points.end());
  };
  for (const std::string joint : {"_HIP", "_KNEE"}) {
    const std::vector<double> leader = points_of("FL" + joint);
    ASSERT_EQ(leader.size(), 8U);
    EXPECT_EQ(points_of("FR" + joint), leader);
    EXPECT_EQ(points_of("HL" + joint), Times(-1, leader));
    EXPECT_EQ(points_of("HR" + joint), Times(-1, leader));
  }
}

TEST(TiedInThePlane, AProvedMotionHasNoSlopeAlongWhatIsFreeThoughItHasOneAlongOthers) {
  const TaskResult& result = TheProved();
  ASSERT_EQ(result.best.end, SolveEnd::kConverged);
  ASSERT_TRUE(result.best.kkt.multipliers.empty()) << "a limit holds it";
  const Problem& problem = result.problem();
  Rollout rollout(problem, 2.5e-4);
  const auto slope = [&](const std::vector<double>& direction) {
    constexpr double kStep = 1e-4;
    std::vector<double> up = result.best.x, down = up;
    for (std::size_t i = 0; i < up.size(); ++i) {
      up[i] += kStep * direction[i];
      down[i] -= kStep * direction[i];
    }
    return (rollout.Run(up).cost - rollout.Run(down).cost) / (2 * kStep);
  };
  double largest = 0, largest_of_one = 0;
  for (const std::vector<double>& direction : FreeDirections(problem))
    largest = std::max(largest, std::abs(slope(direction)));
  std::vector<double> one(result.best.x.size());
  for (double& of : one) {
    of = 1;
    largest_of_one = std::max(largest_of_one, std::abs(slope(one)));
    of = 0;
  }
  EXPECT_LT(largest, 0.01 * largest_of_one);
  EXPECT_LE(FinerKktResidual(problem, result.best.x)->relative.value(),
            2 * problem.solver.kkt_residual);
}

TEST(TiedInThePlane, TheKuhnTuckerResidualIsThatOfAProblemWithoutTheFollowers) {
  const Problem problem = Parsed(RiseTask()).problem;
  const std::vector<double> x = RandomStarts(problem).Draw(3);
  ForwardSensitivity rollout(problem, AdaptiveSteps(problem));
  OutputGradients outputs = OutputGradients::Of(rollout);
  GaussNewton model;
  const RolloutResult result = rollout.Run(x, outputs, &model);
  const FreePaths paths(problem);
  const GaussNewton reduced = paths.Reduce(model);
  const KktResidual residual = FindKktResidual(problem, paths, DerivativeLimitRows(problem), x,
                                               result, paths.ReduceSlopes(outputs), &reduced);
  ASSERT_TRUE(residual.multipliers.empty()) << "a limit is active, and the sums below leave it out";
  double absolute = 0, relative = 0;
  const double squares = model.squares + kNegligibleResidual * kNegligibleResidual;
  for (const std::vector<double>& direction : FreeDirections(problem)) {
    const Eigen::VectorXd along = Vector(direction);
    const double left = std::abs(outputs.row(0) * along);
    const double curvature = along.dot(model.matrix * along);
    absolute = std::max(absolute, left);
    relative = std::max(
        relative, left / (std::sqrt(2 * squares * curvature) + std::abs(model.linear.dot(along))));
  }
  EXPECT_NEAR(residual.absolute, absolute, 1e-12 * absolute);
  EXPECT_NEAR(*residual.relative, relative, 1e-9 * relative);
}

TEST(TiedInThePlane, ASearchForRobotsThatDifferKeepsThemTied) {
  for (const std::string duration : {"", "duration_min_s = 0.35\nduration_max_s = 0.5\n"}) {
    const Problem problem = Parsed(RiseTask(AllTied(), kQuickRobust + duration)).problem;
    const SolveOutcome outcome = SolveRobust(problem, {});
    ASSERT_FALSE(outcome.solutions.empty());
    for (const Solution& solution : outcome.solutions) ExpectTied(problem, solution.x);
    EXPECT_TRUE(outcome.solutions.front().feasible()) << outcome.solutions.front().worst_constraint;
    EXPECT_LT(outcome.history.back().cost, 1) << "robots stand";
    const SolveOutcome polished = SolveRobust(problem, {}, outcome.solutions.front().x);
    ExpectTied(problem, polished.solutions.front().x);
  }
}

TEST(TiedInThePlane, GainsOfAFeedbackAreFoundForTiedPaths) {
  const Problem problem = Parsed(RiseTask(AllTied(), std::string(kQuickRobust) +
                                                         "[robust.feedback]\nlink = \"FL_LOWER\"\n"
                                                         "acts = \"motion\"\nknots = 2\n"))
                              .problem;
  const SolveOutcome outcome = SolveRobust(problem, {});
  ASSERT_FALSE(outcome.solutions.empty());
  ExpectTied(problem, outcome.solutions.front().x);
  EXPECT_TRUE(outcome.solutions.front().feedback.present());
}

TEST(TiedInThePlane, AGuessOfJointsThatMoveApartIsTakenAsTheirLeadersMove) {
  const Task apart = Parsed(RiseTask(""));
  std::vector<double> x = RandomStarts(apart.problem).Draw(1);
  Solution solution;
  solution.x = x;
  Rollout rollout(apart.problem, 1e-3);
  solution.rollout = rollout.Run(x);
  solution.evaluations = 1;
  const PrimitiveFile file = MakePrimitiveFile(apart, {}, solution);
  Task task = Parsed(RiseTask());
  TakeGuess(task, file, "apart.toml");
  ExpectTied(task.problem, task.guess);
  const std::size_t leader = task.problem.tied.front().to;
  const std::vector<double> as_given = PartOf(apart.problem, x, leader);
  const std::vector<double> as_taken = PartOf(task.problem, task.guess, leader);
  for (std::size_t i = 0; i < as_given.size(); ++i) EXPECT_NEAR(as_taken[i], as_given[i], 1e-9);
  const SolveOutcome solved = SolveFromGuess(task.problem, task.guess, {});
  ExpectTied(task.problem, solved.solutions.front().x);
}

TEST(TiedInThePlane, ManyControlPointsAndAFreeDurationKeepThemTied) {
  const Task task = Parsed(
      Replaced(Replaced(RiseTask(), "control_points = 8", "control_points = 13"), "settle_s = 0.2",
               "settle_s = 0.2\nduration_min_s = 0.3\nduration_max_s = 0.6"));
  const SolveOutcome outcome = Solve(task.problem, {});
  ASSERT_FALSE(outcome.solutions.empty());
  EXPECT_TRUE(outcome.solutions.front().feasible()) << outcome.solutions.front().worst_constraint;
  ExpectTied(task.problem, outcome.solutions.front().x);
}

TEST(TiedInThePlane, TheLimitsOfEveryJointHoldForAllThatAreTiedToIt) {
  Problem problem = Parsed(RiseTask()).problem;
  const TiedJoint& slow = problem.tied.back();
  problem.joints[slow.joint].limits.velocity_max_rad_s = 3.2;
  const std::vector<LinearRow> rows = DerivativeLimitRows(problem);
  const RandomStarts starts(problem);
  for (std::uint64_t sample = 0; sample < 8; ++sample) {
    const std::vector<double> x = starts.Draw(sample);
    ExpectTied(problem, x);
    for (const LinearRow& row : rows) EXPECT_LE(row.Excess(x), 1e-9) << row.name;
  }
  const SolveOutcome outcome = Solve(problem, {});
  ASSERT_FALSE(outcome.solutions.empty());
  EXPECT_TRUE(outcome.solutions.front().feasible()) << outcome.solutions.front().worst_constraint;
  ExpectTied(problem, outcome.solutions.front().x);
}

TEST(TiedInThePlane, ARobotThatIsHeldOrHangsFromABarHasThemToo) {
  for (const std::string root : {"fixed", "hinge-y"}) {
    std::string text = Replaced(RiseTask(), "planar-xz", root);
    text = Replaced(text, "point_m = [0.0, 0.0]", "point_m = [0.0, -1.0]");
    if (root == "hinge-y") text = Replaced(text, "[start]", "[start]\npitch_rad = -0.79");
    const auto cost = text.find("[[cost]]"), effort = text.find("[[cost]]\nterm = \"effort\"");
    text.erase(cost, effort - cost);
    const Problem problem = Parsed(text).problem;
    EXPECT_EQ(FreePaths(problem).count() * 4, static_cast<std::size_t>(problem.parameter_count()));
    const SolveOutcome outcome = Solve(problem, {});
    ASSERT_FALSE(outcome.solutions.empty()) << root;
    ExpectTied(problem, outcome.solutions.front().x);
  }
}

TEST(TiedInThePlane, EndsThatDifferByARoundingBecomeTheSame) {
  const Problem problem =
      Parsed(Replaced(RiseTask(), "HL_HIP = -0.9", "HL_HIP = -0.90000000001")).problem;
  for (const TiedJoint& tied : problem.tied) {
    EXPECT_EQ(problem.joints[tied.joint].start_rad,
              tied.factor * problem.joints[tied.to].start_rad);
    const int dof = problem.joints[tied.joint].dof, of_leader = problem.joints[tied.to].dof;
    EXPECT_EQ(problem.start_q[static_cast<std::size_t>(dof)],
              tied.factor * problem.start_q[static_cast<std::size_t>(of_leader)]);
  }
}

TEST(TiedInThePlane, WhatCannotFollowIsRefused) {
  EXPECT_EQ(MistakeIn(RiseTask()), "");
  const auto of = [](const std::string& tied) { return MistakeIn(RiseTask(tied)); };
  EXPECT_THAT(of(R"(HL_HIP = "-FL_HIP", FL_HIP = "-HL_HIP")"),
              HasSubstr("allowed: another joint that is tied to none"))
      << "in a circle";
  EXPECT_THAT(of(R"(FL_HIP = "FL_HIP")"), HasSubstr("allowed: another joint")) << "to itself";
  EXPECT_THAT(of(R"(FL_HIP = "-FL_HIP")"), HasSubstr("allowed: another joint"));
  EXPECT_THAT(of(R"(HL_HIP = "FL_HIP")"),
              HasSubstr("tied.HL_HIP: is tied to 'FL_HIP', and its start is -0.9 rad where that "
                        "needs 0.9; give both the same ends, or the name a '-', or leave it out"));
  EXPECT_THAT(of(R"(HL_HIP = "--FL_HIP")"), HasSubstr("allowed: another joint"));
  EXPECT_THAT(of(R"(HL_HIP = "")"), HasSubstr("allowed: another joint"));
  EXPECT_THAT(of(R"(TAIL = "FL_HIP")"), HasSubstr("is not a joint of the robot"));
  EXPECT_THAT(of("HL_HIP = 1.0"), HasSubstr("tied.HL_HIP"));
  EXPECT_THAT(MistakeIn(Replaced(RiseTask(), "HR_HIP = -0.6", "HR_HIP = -0.7")),
              HasSubstr("tied.HR_HIP: is tied to '-FL_HIP', and its end is -0.7 rad where that "
                        "needs -0.6; give both opposite ends, or leave it out"));
  EXPECT_THAT(
      MistakeIn(Replaced(RiseTask(), "control_points = 8",
                         "control_points = { FL_HIP = 9, FL_KNEE = 8, FR_HIP = 8, FR_KNEE = 8, "
                         "HL_HIP = 8, HL_KNEE = 8, HR_HIP = 8, HR_KNEE = 8 }")),
      HasSubstr("has 8 control points, and 'FL_HIP', which it is tied to, 9"));
}

/// The task with one joint that nothing moves, or that has no motor.
std::string Without(const std::string& joint, const std::string& value, const std::string& end,
                    const std::string& table) {
  std::string text = Replaced(RiseTask(), joint + " = " + value + ", ", "");
  text = Replaced(text, joint + " = " + end + ", ", "");
  return Replaced(text, "[start]", table + "[start]");
}

TEST(TiedInThePlane, ToAJointOrOfOneThatIsLockedOrHasNoMotorIsRefused) {
  EXPECT_THAT(MistakeIn(Without("FL_KNEE", "-1.8", "-1.2", "[locked]\nFL_KNEE = -1.8\n")),
              HasSubstr("is tied to 'FL_KNEE', which is locked"));
  EXPECT_THAT(MistakeIn(Without("HL_KNEE", "1.8", "1.2", "[locked]\nHL_KNEE = 1.8\n")),
              HasSubstr("tied.HL_KNEE: is locked, so nothing moves it"));
  const std::string passive = "_KNEE]\nstiffness_nm_per_rad = 20.0\ndamping_nm_s_per_rad = 0.5\n";
  EXPECT_THAT(MistakeIn(Without("HL_KNEE", "1.8", "1.2", "[passive.HL" + passive)),
              HasSubstr("tied.HL_KNEE: has no motor"));
  EXPECT_THAT(MistakeIn(Without("FL_KNEE", "-1.8", "-1.2", "[passive.FL" + passive)),
              HasSubstr("is tied to 'FL_KNEE', which has no motor ([passive])"));
}

}  // namespace
}  // namespace tumbler
