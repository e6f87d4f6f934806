// Motions whose velocity at the start is found with them.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "offline/certify/certificate_text.h"
#include "offline/certify/chain.h"
#include "offline/certify/second_look.h"
#include "offline/problem/free_start.h"
#include "offline/problem/take_free.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/guess.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solver.h"
#include "tests/support/files.h"
#include "tests/support/gradients.h"
#include "tests/support/handstand.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::LongHandstandTask;
using testing::Replaced;
using testing::ShippedRobot;
using testing::TaskFolder;
using testing::WriteFile;

CostTerm FromStart(CostTerm term, double by) {
  term.from_start = true;
  term.target_from_start = by;
  return term;
}

/// A dropped robot whose velocities at the start are free, with targets that are given from there.
Problem DroppedFreely(bool free_duration) {
  Problem problem = HandstandProblem(9);
  problem.start_q[1] += 0.05;
  problem.start_root_rates = {0.3, -0.4, 1.1};
  problem.free_start_rates = {Interval<double>{-1, 1}, std::nullopt, Interval<double>{0, 2}};
  problem.joints[0].start_rad_s = 2;
  problem.joints[0].end_rad_s = -3;
  problem.duration_s = 0.5;
  problem.settle_s = 0;
  if (free_duration) problem.free_duration = DurationBounds{0.3, 0.9};
  CostTerm of_point = SquareTerm(CostTerm::When::kEnd, 0, true, 0.1, 0.7);
  of_point.point = PointOfLink(problem.scene.robot, "leg1_link", {0.2, 0});
  problem.cost = {FromStart(SquareTerm(CostTerm::When::kEnd, 0, true, 0, 0.7), 0.2),
                  FromStart(of_point, -0.1),
                  FromStart(SquareTerm(CostTerm::When::kSettled, 2, true, 0, 0.4), 0),
                  SquareTerm(CostTerm::When::kSettled, 2, false, 1, 1), EffortTerm(1e-2)};
  SetTargetsFromStart(problem);
  return problem;
}

std::vector<double> FreeMotion(const Problem& problem, std::uint64_t seed) {
  std::vector<double> x = RandomMotion(problem, seed);
  x.resize(static_cast<std::size_t>(problem.first_start_rate()));
  x.push_back(-0.6);
  x.push_back(1.7);
  if (problem.free_duration) x.push_back(1.1);
  return x;
}

TEST(FreeStart, VelocitiesAreTheParametersBetweenThePathsAndTheDuration) {
  const Problem problem = DroppedFreely(true);
  const int first = problem.first_start_rate();
  EXPECT_EQ(problem.parameter_count(), first + 3);
  EXPECT_EQ(problem.start_coordinate_of(first), 0U);
  EXPECT_EQ(problem.start_coordinate_of(first + 1), 2U);
  EXPECT_FALSE(problem.start_coordinate_of(first - 1) || problem.start_coordinate_of(first + 2));
  EXPECT_TRUE(problem.is_duration(first + 2));
  EXPECT_EQ(problem.bounds_of_parameter(first + 1).max, 2);
  const std::vector<double> x = FreeMotion(problem, 1);
  Rollout(problem, 1e-3).Visit(x, 0, [](const MotionSample& sample) {
    if (sample.time_s > 0) return;
    EXPECT_EQ(sample.qd, (std::vector<double>{-0.6, -0.4, 1.7, 2, 0}));
  });
}

TEST(FreeStart, TheGradientIsThatOfCentralDifferencesAndForwardAndBackwardAgree) {
  for (const bool free_duration : {false, true}) {
    SCOPED_TRACE(free_duration ? "free duration" : "");
    const Problem problem = DroppedFreely(free_duration);
    testing::ExpectTrueGradients(problem, FreeMotion(problem, 4));
  }
}

/// A robot that is thrown so that after 0.5 s it is 0.8 m farther, and as high as before.
std::string ThrowTask(const std::string& start) {
  return "format = \"tumbler-task\"\nversion = 1\nname = \"throw\"\nrobot = "
         "\"../robots/tumbler.urdf\"\nduration_s = 0.5\nobstacle = []\n[start]\nz_m = 1.0\n" +
         start +
         "\njoints_rad = { leg1 = -0.5, leg2 = 0.4 }\n[end]\njoints_rad = { leg1 = -0.5, leg2 = "
         "0.4 "
         "}\n[[cost]]\nterm = \"terminal\"\nof = \"x\"\nfrom_start = true\ntarget = 0.8\nweight = "
         "10.0\n[[cost]]\nterm = \"terminal\"\nof = \"z\"\nfrom_start = true\nweight = "
         "10.0\n[[cost]]\nterm = \"terminal\"\nof = \"pitch\"\nfrom_start = true\nweight = "
         "1.0\n[[cost]]\nterm = \"effort\"\nweight = 1e-3\n";
}
constexpr const char* kThrown =
    "x_min_m_s = -5.0\nx_max_m_s = 5.0\nz_min_m_s = -5.0\nz_max_m_s = 5.0\npitch_min_rad_s = "
    "-3.0\npitch_max_rad_s = 3.0\n";

TEST(FreeStart, ARobotIsThrownAsBallisticsSays) {
  const TaskFolder folder(ThrowTask(kThrown));
  Task task = LoadTask(folder.task_file());
  const SolveOutcome outcome = Solve(task.problem, {});
  Solution best = outcome.solutions.front();
  EXPECT_EQ(best.end, SolveEnd::kConverged);
  TakeFree(task.problem, best.x);
  EXPECT_NEAR(task.problem.start_root_rates[0], 0.8 / 0.5, 1e-3);
  EXPECT_NEAR(task.problem.start_root_rates[1], 9.81 * 0.5 / 2, 1e-3);
  EXPECT_NEAR(task.problem.start_root_rates[2], 0, 1e-2);
  const auto found = FoundBesidesPaths(task.problem);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_THAT(found[1].first + " " + found[1].second,
              AllOf(HasSubstr("z rate at the start 2.45"), HasSubstr("between -5 and 5")));

  // The file says how it starts, and so does what is made of it.
  const PrimitiveFile file = MakePrimitiveFile(task, outcome, best);
  EXPECT_EQ(file.entry.root_x_m_s, task.problem.start_root_rates[0]);
  const Problem again = TaskOf(ParsePrimitive(ToToml(file), "throw.toml")).problem;
  EXPECT_EQ(again.start_root_rates, task.problem.start_root_rates);
  const std::vector<double> guess = GuessFrom(LoadTask(folder.task_file()).problem, file, "f");
  const auto first = static_cast<std::size_t>(task.problem.first_start_rate());
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(guess[first + i], task.problem.start_root_rates[i]) << i;
}

TEST(FreeStart, ABoundThatIsReachedHasAMultiplierWithAName) {
  const TaskFolder folder(ThrowTask("x_min_m_s = -5.0\nx_max_m_s = 1.0\nz_m_s = 2.45"));
  const Problem problem = LoadTask(folder.task_file()).problem;
  std::vector<double> x = RandomStarts(problem).Draw(5);
  x.back() = 0.5;  // From far below, a step promises too little of the cost to go on from a guess.
  const Solution best = SolveFromGuess(problem, x, {}).solutions.front();
  EXPECT_NEAR(best.x.back(), 1.0, 1e-9);
  ASSERT_FALSE(best.kkt.multipliers.empty());
  EXPECT_EQ(best.kkt.multipliers.front().name, "upper velocity of x at the start");
}

TEST(FreeStart, RandomStartsAreAmongTheBoundsAndDiffer) {
  const Problem problem = DroppedFreely(true);
  const RandomStarts starts(problem);
  double least = 1, most = -1;
  for (std::uint64_t sample = 0; sample < 200; ++sample) {
    const std::vector<double> x = starts.Draw(sample);
    ASSERT_EQ(static_cast<int>(x.size()), problem.parameter_count());
    const double rate = x[static_cast<std::size_t>(problem.first_start_rate())];
    EXPECT_GE(rate, -1);
    EXPECT_LE(rate, 1);
    least = std::min(least, rate);
    most = std::max(most, rate);
    EXPECT_EQ(x.back(), 1);
  }
  EXPECT_LT(least, -0.5);
  EXPECT_GT(most, 0.5);
}

std::string FreeRefusal(const std::string& task, const std::string& robot = ShippedRobot()) {
  try {
    ParseTask(task, "task.toml", robot, "robot.urdf");
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

std::string Acrobot() {
  return testing::ReadFile(testing::SourcePath("primitives/acrobot/acrobot.urdf"));
}

/// What a sequence of one motion, played again and again without a hold, comes to.
ChainOutcome Repeated(const TaskFolder& folder, const PrimitiveFile& motion, int cycles) {
  WriteFile(folder.path() / "motion.toml", ToToml(motion));
  WriteFile(folder.path() / "again.toml",
            "format = \"tumbler-sequence\"\nversion = 1\nname = \"again\"\nstart = "
            "\"motion\"\n[primitives]\nmotion = \"motion.toml\"\n[[node]]\nname = "
            "\"motion\"\nprimitive = \"motion\"\nsafe = true\nends_cycle = true\n[[edge]]\nfrom = "
            "\"motion\"\nto = \"motion\"\nsettle_s = 0.0\nwhen = \"always\"\n");
  const SequenceFile file = LoadSequence(folder.path() / "again.toml");
  for (const JoinComparison& join : CompareJoins(file)) EXPECT_TRUE(join.fits()) << join.quantity;
  ChainOptions options;
  options.cycles = cycles;
  options.last_hold_s = 0;
  return SimulateChain(SimulatedMotion(file), options);
}

TEST(FreeStart, AVelocityAtABoundIsThatBound) {
  Problem problem = DroppedFreely(true);
  std::vector<double> x = FreeMotion(problem, 1);
  const auto first = static_cast<std::size_t>(problem.first_start_rate());
  x[first] = 1 - 1e-13;
  x[first + 1] = 3e-14;
  TakeFree(problem, x);
  EXPECT_EQ(problem.start_root_rates, (std::array<double, 3>{1, -0.4, 0}));
  EXPECT_EQ(x[first], 1);
  EXPECT_EQ(x[first + 1], 0);
}

TEST(FreeStart, WhatWasFoundIsNeverShownBeyondItsBounds) {
  Problem problem = DroppedFreely(false);
  problem.free_start_rates[0] = Interval<double>{-1, 1.50049};
  problem.start_root_rates[0] = 1.50049;
  EXPECT_EQ(FoundBesidesPaths(problem).front().second, "1.50049 m/s, found between -1 and 1.50049");
  problem.free_start_rates[0]->max = problem.start_root_rates[0] = 1.5004951;
  EXPECT_EQ(FoundBesidesPaths(problem).front().second, "1.5005 m/s, found between -1 and 1.5005");
}

TEST(FreeStart, AnExitInTheAirIsTheStateThereAndNotARestBelow) {
  const TaskFolder folder(ThrowTask(kThrown));
  Task task = LoadTask(folder.task_file());
  const SolveOutcome outcome = Solve(task.problem, {});
  Solution best = outcome.solutions.front();
  TakeFree(task.problem, best.x);
  const PrimitiveFile file = MakePrimitiveFile(task, outcome, best);
  EXPECT_NEAR(file.exit.root_z_m, file.entry.root_z_m, 1e-3);
  EXPECT_NEAR(file.exit.root_z_m_s, -file.entry.root_z_m_s, 1e-2);
  // What goes on from there begins as fast.
  WriteFile(folder.path() / "tasks" / "next.toml", ThrowTask(""));
  EXPECT_EQ(LoadTask(folder.path() / "tasks" / "next.toml", file, "throw.toml")
                .problem.start_root_rates[1],
            file.exit.root_z_m_s);
}

/// An acrobot on a bar with friction, which begins and ends a swing in the same state, and looks
/// for how fast that is.
std::string FreeSwingTask() {
  return "format = \"tumbler-task\"\nversion = 1\nname = \"swing\"\nrobot = "
         "\"../robots/tumbler.urdf\"\nroot = \"hinge-y\"\nduration_s = 1.34\n[start]\njoints_rad = "
         "{ waist = 0.2 }\njoints_rad_s = { waist = 1.0 }\npitch_rad_s = 3.0\npitch_min_rad_s = "
         "1.0\npitch_max_rad_s = 6.0\n[end]\njoints_rad = { waist = 0.2 }\njoints_rad_s = { waist "
         "= "
         "1.0 }\n[bar]\nfriction_nm_s_per_rad = 0.02\n[[cost]]\nterm = \"terminal\"\nof = "
         "\"pitch\"\nfrom_start = true\nweight = 10.0\ntolerance = 0.005\n[[cost]]\nterm = "
         "\"terminal\"\nof = \"pitch_rate\"\nfrom_start = true\nweight = 1.0\ntolerance = "
         "0.02\n[[cost]]\nterm = \"effort\"\nweight = 1e-3\n";
}

TEST(FreeStart, BoundsThatMakeNoSenseAreRefusedByName) {
  EXPECT_EQ(FreeRefusal(ThrowTask(kThrown)), "accepted");
  EXPECT_THAT(FreeRefusal(ThrowTask("x_max_m_s = 1.0")),
              HasSubstr("start.x_min_m_s: is missing; allowed: both bounds of the velocity"));
  EXPECT_THAT(FreeRefusal(ThrowTask("x_min_m_s = 2.0\nx_max_m_s = 1.0")),
              HasSubstr("start.x_min_m_s: is 2 m/s, above x_max_m_s, which is 1 m/s"));
  EXPECT_THAT(FreeRefusal(ThrowTask("z_min_m_s = 1.0\nz_max_m_s = 2.0")),
              HasSubstr("start.z_min_m_s: is 1 m/s, but the task's z_m_s is 0 m/s; allowed: up to "
                        "z_m_s"));
  EXPECT_THAT(
      FreeRefusal(ThrowTask("pitch_rad_s = 3.0\npitch_min_rad_s = 1.0\npitch_max_rad_s = 2.0")),
      HasSubstr("start.pitch_max_rad_s: is 2 rad/s, but the task's pitch_rad_s is 3 rad/s; "
                "allowed: pitch_rad_s or more"));
  EXPECT_THAT(FreeRefusal(ThrowTask("x_min_m_s = -200.0\nx_max_m_s = 1.0")), HasSubstr("-100"));
  EXPECT_THAT(FreeRefusal(Replaced(FreeSwingTask(), "pitch_rad_s = 3.0",
                                   "pitch_rad_s = 3.0\nx_min_m_s = -1.0\nx_max_m_s = 1.0"),
                          Acrobot()),
              HasSubstr("start.x_min_m_s: moves what the bar holds"));
  const std::string robust =
      testing::ReadFile(testing::SourcePath("primitives/tasks/handstand.toml"));
  for (const char* const start : {"pitch_rad_s = 0.2", "z_min_m_s = -0.1\nz_max_m_s = 0.1"}) {
    EXPECT_THAT(FreeRefusal(Replaced(robust, "pitch_rad = 0.0\n",
                                     std::string("pitch_rad = 0.0\n") + start + "\n")),
                HasSubstr("start: lets the root move, and robots of [robust] begin at rest"));
  }
}

TEST(PeriodicMotion, ASwingFindsHowFastItHasToBeginAndRepeatsItselfInAChain) {
  const TaskFolder folder(FreeSwingTask(), Acrobot());
  Task task = LoadTask(folder.task_file());
  std::vector<double> x;
  for (int i = 0; i < task.problem.joints[0].free_points(); ++i) x.push_back(0.2);
  x.push_back(3.0);
  const SolveOutcome outcome = SolveFromGuess(task.problem, x, {});
  Solution best = outcome.solutions.front();
  ASSERT_TRUE(best.feasible());
  TakeFree(task.problem, best.x);
  const double found = task.problem.start_root_rates[2];
  EXPECT_GT(std::abs(found - 3.0), 0.05);
  EXPECT_EQ(task.problem.cost[1].target, found);
  const SecondLook look = LookAgain(task.problem, best.x);
  EXPECT_TRUE(look.acceptable()) << look.Objections();
  const ChainOutcome chain = Repeated(folder, MakePrimitiveFile(task, outcome, best), 3);
  ASSERT_FALSE(chain.failure) << chain.failure->text;
  EXPECT_GE(chain.cycles, 3);
  for (const PlayedNode& passage : chain.passages) {
    EXPECT_NEAR(passage.entry_pitch_error_rad, 0, 0.1);
    EXPECT_NEAR(passage.entry_speed, found, 0.3);
  }
}

TEST(PeriodicMotion, AFullTurnWhoseJointIsAtRestAtItsEndsIsRepeatedAndGoneOnFrom) {
  std::string turns = FreeSwingTask();
  for (int end = 0; end < 2; ++end) {
    turns = Replaced(turns, "joints_rad = { waist = 0.2 }\njoints_rad_s = { waist = 1.0 }",
                     "joints_rad = { waist = 0.0 }");
  }
  turns = Replaced(turns, "pitch_max_rad_s = 6.0", "pitch_max_rad_s = 14.0");
  turns =
      Replaced(turns, "from_start = true\nweight = 10.0\ntolerance = 0.005",
               "from_start = true\ntarget = 6.283185307179586\nweight = 10.0\ntolerance = 0.01");
  turns +=
      "[spline]\ncontrol_points = 24\n[limits]\nacceleration_max_rad_s2 = "
      "300.0\nrotor_inertia_kg_m2 = 0.0005\n[search]\nspread_rad = 1.0\n[solver]\n"
      "max_evaluations = 400\n";
  const TaskFolder folder(turns, Acrobot());
  Task task = LoadTask(folder.task_file());
  EXPECT_FALSE(task.problem.joint_ends_moving());
  EXPECT_TRUE(task.problem.ends_moving());
  const SolveOutcome outcome = Solve(task.problem, {});
  Solution best = outcome.solutions.front();
  TakeFree(task.problem, best.x);
  const SecondLook look = LookAgain(task.problem, best.x);
  ASSERT_TRUE(look.acceptable()) << look.Objections();
  const PrimitiveFile file = MakePrimitiveFile(task, outcome, best);
  EXPECT_NEAR(file.exit.root_pitch_rad_s, task.problem.start_root_rates[2], 0.02);
  const ChainOutcome chain = Repeated(folder, file, 2);
  ASSERT_FALSE(chain.failure) << chain.failure->text;
  for (const PlayedNode& passage : chain.passages)
    EXPECT_NEAR(passage.turned_rad, 6.283185307179586, 0.05);
  // A task that goes on from there begins as fast.
  const std::string next = Replaced(
      Replaced(turns, "\"swing\"", "\"next\""),
      "pitch_rad_s = 3.0\npitch_min_rad_s = 1.0\npitch_max_rad_s = 14.0\n", "pitch_rad = 6.28\n");
  WriteFile(folder.path() / "tasks" / "next.toml", next);
  EXPECT_EQ(LoadTask(folder.path() / "tasks" / "next.toml", file, "swing.toml")
                .problem.start_root_rates[2],
            file.exit.root_pitch_rad_s);
}

TEST(Chain, ARobotWithAPassiveJointBeginsWithTheVelocitiesOfItsMotion) {
  std::string task_text = ThrowTask("x_m_s = 1.2\nz_m_s = 2.0\npitch_rad_s = 0.7");
  task_text =
      Replaced(task_text, "[end]\njoints_rad = { leg1 = -0.5, leg2 = 0.4 }",
               "[end]\njoints_rad = { leg1 = -0.5 }\n[passive.leg2]\nstiffness_nm_per_rad = "
               "0.5\nrest_rad = 0.4");
  const TaskFolder folder(task_text);
  Task task = LoadTask(folder.task_file());
  std::vector<double> x(static_cast<std::size_t>(task.problem.parameter_count()), -0.5);
  const SolveOutcome outcome = SolveFromGuess(task.problem, x, {});
  Solution best = outcome.solutions.front();
  const PrimitiveFile file = MakePrimitiveFile(task, outcome, best);
  WriteFile(folder.path() / "motion.toml", ToToml(file));
  WriteFile(folder.path() / "once.toml",
            "format = \"tumbler-sequence\"\nversion = 1\nname = \"once\"\nstart = "
            "\"motion\"\n[primitives]\nmotion = \"motion.toml\"\n[[node]]\nname = "
            "\"motion\"\nprimitive = \"motion\"\nsafe = true\n");
  ChainOptions options;
  options.last_hold_s = 0;
  const ChainOutcome chain =
      SimulateChain(SimulatedMotion(LoadSequence(folder.path() / "once.toml")), options);
  ASSERT_EQ(chain.passages.size(), 1U);
  EXPECT_NEAR(chain.passages[0].entry_speed, 2.0, 1e-12);
  EXPECT_NEAR(chain.passages[0].travelled_m, file.exit.root_x_m - file.entry.root_x_m, 1e-5);
  EXPECT_NEAR(chain.passages[0].turned_rad, file.exit.root_pitch_rad - file.entry.root_pitch_rad,
              1e-5);
}

}  // namespace
}  // namespace tumbler
