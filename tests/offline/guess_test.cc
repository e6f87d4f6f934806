// Starts from the paths of a known motion: paths over other control points, and motions that are
// solved again after the robot, the ground or the duration has changed.

#include "offline/solve/guess.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "common/files/spline_extent.h"
#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "offline/certify/second_look.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/robust_search.h"
#include "offline/solve/solve_near.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"
#include "tests/support/primitive_file.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::Replaced;
using testing::ShippedRobot;

using Path = JointMotion<double>::Spline;

/// A path of 12 control points that moves much.
Path SomePath() {
  const Problem problem = HandstandProblem();
  return PositionSpline(problem, RandomMotion(problem, 5), 0);
}

double LargestDifference(const Path& a, const Path& b) {
  double largest = 0;
  for (int k = 0; k <= 1000; ++k) {
    const double s = k / 1000.0;
    largest = std::max(largest,
                       std::abs(a.Evaluate(s * a.end_s()).value - b.Evaluate(s * b.end_s()).value));
  }
  return largest;
}

TEST(Resampled, IsTheSamePathWhereTheNewKnotsContainTheOldOnes) {
  const Path path = SomePath();
  for (const int points : {12, 19, 26, 33, 40, 61}) {
    const Path finer = Resampled(path, 5, points, path.end_s());
    ASSERT_EQ(finer.control_points().size(), static_cast<std::size_t>(points));
    for (int k = 0; k <= 500; ++k) {
      const double t = k * path.end_s() / 500;
      const Path::Sample a = path.Evaluate(t), b = finer.Evaluate(t);
      EXPECT_NEAR(a.value, b.value, 1e-13) << points;
      EXPECT_NEAR(a.first, b.first, 1e-11) << points;
      EXPECT_NEAR(a.second, b.second, 1e-8) << points;
    }
  }
}

TEST(Resampled, StretchesThePathToAnotherDuration) {
  const Path path = SomePath();
  for (const int points : {12, 19, 26}) {
    const Path longer = Resampled(path, 5, points, 1.1 * path.end_s());
    EXPECT_DOUBLE_EQ(longer.end_s(), 1.1 * path.end_s());
    EXPECT_LT(LargestDifference(path, longer), 1e-13);
  }
}

double SumOfSquares(const Path& a, const Path& b) {
  double sum = 0;
  for (int k = 0; k < 2000; ++k) {
    const double t = (k + 0.5) * a.end_s() / 2000;
    const double difference = a.Evaluate(t).value - b.Evaluate(t).value;
    sum += difference * difference;
  }
  return sum;
}

TEST(Resampled, HasTheLeastSquaresOfDifferencesWhereTheKnotsDiffer) {
  const Path path = SomePath();
  for (const int points : {10, 13, 24, 64}) {
    const Path other = Resampled(path, 5, points, path.end_s());
    EXPECT_LT(LargestDifference(path, other), points == 10 ? 0.2 : 0.03) << points;
    // At rest at both ends, like the path.
    const auto c = other.control_points();
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(c[i], path.control_points().front());
      EXPECT_EQ(c[c.size() - 1 - i], path.control_points().back());
    }
    const std::vector<double> knots(other.knots().begin(), other.knots().end());
    const double least = SumOfSquares(path, other);
    for (std::size_t i = 3; i + 3 < c.size(); ++i) {
      for (const double step : {-0.01, 0.01}) {
        std::vector<double> moved(c.begin(), c.end());
        moved[i] += step;
        Path worse;
        ASSERT_EQ(worse.Assign(5, knots, moved), Status::kOk);
        EXPECT_GT(SumOfSquares(path, worse), least) << points << " " << i;
      }
    }
  }
}

/// The shipped handstand, and the task that it was made from.
const PrimitiveFile& Known() {
  static const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  return file;
}
Task KnownTask(const std::string& from = "", const std::string& to = "") {
  const std::string& text = Known().provenance.task_toml;
  return ParseTask(from.empty() ? text : Replaced(text, from, to), "task.toml",
                   Known().provenance.robot_urdf, "robot.urdf");
}

TEST(Guess, IsThePrimitiveItselfForItsOwnTask) {
  EXPECT_THAT(GuessFrom(KnownTask().problem, Known(), "known.toml"),
              ::testing::Pointwise(::testing::DoubleNear(1e-12),
                                   testing::FreeControlPoints(Known().primitive)));
}

TEST(Guess, FadesFromOneEndToTheOther) {
  const Task task = KnownTask("joints_rad = { leg1 = 0.0, leg2 = 0.0 }",
                              "joints_rad = { leg1 = 0.2, leg2 = 0.0 }");
  const std::vector<double> own = testing::FreeControlPoints(Known().primitive);
  const std::vector<double> guess = GuessFrom(task.problem, Known(), "known.toml");
  ASSERT_EQ(guess.size(), own.size());
  for (std::size_t i = 0; i < guess.size(); ++i) {
    const double moved = guess[i] - own[i];
    if (i >= guess.size() / 2) {
      EXPECT_NEAR(moved, 0, 1e-12) << "the other leg ends where it did";
    } else {
      EXPECT_GT(moved, 0);
      EXPECT_LT(moved, 0.2);
      EXPECT_GT(moved, i > 0 ? guess[i - 1] - own[i - 1] : 0);
    }
  }
}

TEST(Guess, OfATaskForRobotsThatDifferTakesAsLongAsThePrimitiveWhereTheDurationIsFree) {
  const PrimitiveFile shipped = LoadPrimitive(testing::SourcePath("primitives/handstand.toml"));
  Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  ASSERT_NE(task.problem.duration_s, shipped.primitive.duration_s);
  TakeGuess(task, shipped, "handstand.toml");
  EXPECT_EQ(task.problem.duration_s, shipped.primitive.duration_s);
  EXPECT_THAT(task.guess, ::testing::Pointwise(::testing::DoubleNear(1e-12),
                                               testing::FreeControlPoints(shipped.primitive)));
  task.problem.robust->duration_min_s = 0.8;
  TakeGuess(task, shipped, "handstand.toml");
  EXPECT_EQ(task.problem.duration_s, 0.8);
}

TEST(Guess, NeedsAPathForEveryJoint) {
  PrimitiveFile other = Known();
  other.primitive.joints[1].name = FixedString<32>("tail");
  try {
    GuessFrom(KnownTask().problem, other, "other.toml");
    FAIL() << "accepted";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("other.toml"), HasSubstr("has no joint 'leg2'")));
  }
}

/// A number after each occurrence of a text, times a factor.
std::string Scaled(std::string text, const std::string& before, double factor) {
  for (std::size_t at = text.find(before); at != std::string::npos; at = text.find(before, at)) {
    at += before.size();
    char* end = nullptr;
    const double value = std::strtod(text.c_str() + at, &end);
    text.replace(at, static_cast<std::size_t>(end - text.c_str()) - at,
                 fmt::format("{}", value * factor));
  }
  return text;
}

struct Change {
  const char* name;
  double mass = 1, friction = 1, duration = 1;
};

class SolveFromGuessAfter : public ::testing::TestWithParam<Change> {};
INSTANTIATE_TEST_SUITE_P(Changes, SolveFromGuessAfter,
                         ::testing::Values(Change{"Heavier", 1.1}, Change{"Lighter", 0.9},
                                           Change{"Rougher", 1, 1.1}, Change{"Smoother", 1, 0.9},
                                           Change{"Longer", 1, 1, 1.1},
                                           Change{"Shorter", 1, 1, 0.9}),
                         [](const auto& change) { return change.param.name; });

TEST_P(SolveFromGuessAfter, FindsTheSameMotionAgainWithinAFewEvaluations) {
  const Change& change = GetParam();
  std::string urdf = Known().provenance.robot_urdf;
  for (const char* key : {"mass value=\"", "ixx=\"", "iyy=\"", "izz=\""})
    urdf = Scaled(urdf, key, change.mass);
  std::string text = Scaled(Known().provenance.task_toml, "mu = ", change.friction);
  text = Scaled(text, "duration_s = ", change.duration);
  const Problem problem = ParseTask(text, "task.toml", urdf, "robot.urdf").problem;

  SolveOptions options;
  options.accept = [&](const Solution& solution) {
    return LookAgain(problem, solution.x).acceptable();
  };
  const SolveOutcome outcome =
      SolveFromGuess(problem, GuessFrom(problem, Known(), "known.toml"), options);
  ASSERT_FALSE(outcome.solutions.empty());
  const Solution& best = outcome.solutions.front();
  EXPECT_TRUE(best.feasible() && !best.refused);
  // The search that found the known motion took more than a thousand. A few evaluations are enough,
  // but for what takes longer: from there a solve of some steps leads back to the targets.
  EXPECT_LE(outcome.evaluations, change.duration > 1 ? Known().provenance.evaluations / 40 : 5);
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    EXPECT_LT(
        LargestDifference(PositionSpline(problem, best.x, j), Known().primitive.joints[j].position),
        0.4)
        << "no other motion is this near";
  }
}

TEST(SolveFromGuess, TellsTheStepsOfItsMotionWhichNobodyHasToChooseAgain) {
  const std::string text = Scaled(Known().provenance.task_toml, "mu = ", 1.1);
  const Problem problem =
      ParseTask(text, "task.toml", Known().provenance.robot_urdf, "robot.urdf").problem;
  const std::vector<double> guess = GuessFrom(problem, Known(), "known.toml");
  const Solution found = SolveFromGuess(problem, guess, {}).solutions.front();
  const StepGrid chosen = StepsFor(problem, found.x);
  ASSERT_TRUE(found.steps);
  EXPECT_EQ(found.steps->motion, chosen.motion);
  EXPECT_EQ(found.steps->settling, chosen.settling);
}

TEST(SolveFromGuess, GoesOnToTheMinimumWhereAProofIsAskedFor) {
  const std::string text = Scaled(Known().provenance.task_toml, "mu = ", 1.1);
  Problem problem =
      ParseTask(text, "task.toml", Known().provenance.robot_urdf, "robot.urdf").problem;
  const std::vector<double> guess = GuessFrom(problem, Known(), "known.toml");
  const Solution near = SolveFromGuess(problem, guess, {}).solutions.front();
  EXPECT_EQ(near.end, SolveEnd::kEnough);
  problem.solver.prove = true;
  const Solution proved = SolveFromGuess(problem, guess, {}).solutions.front();
  EXPECT_EQ(proved.end, SolveEnd::kConverged);
  EXPECT_LT(proved.kkt.absolute, 1e-3 * near.kkt.absolute);
  EXPECT_LT(proved.rollout.cost, near.rollout.cost);
}

TEST(SolveFromGuess, FarFromAMinimumFinerStepsSayTheSameAndTheCertificateHasWhatTheSolveFound) {
  const std::string text = Scaled(Known().provenance.task_toml, "mu = ", 1.1);
  const Task task = ParseTask(text, "task.toml", Known().provenance.robot_urdf, "robot.urdf");
  const SolveOutcome outcome =
      SolveFromGuess(task.problem, GuessFrom(task.problem, Known(), "known.toml"), {});
  const Solution& enough = outcome.solutions.front();
  ASSERT_TRUE(IsFarFromMinimum(task.problem, enough));
  EXPECT_EQ(MakePrimitiveFile(task, outcome, enough).certificate.kkt_residual, enough.kkt.relative);
  EXPECT_NEAR(
      FinerKktResidual(task.problem, enough.x)->relative.value() / enough.kkt.relative.value(), 1,
      0.01);
}

PrimitiveFile ShippedMotion(const std::string& name) {
  return LoadPrimitive(testing::SourcePath("primitives/" + name + ".toml"));
}
Task MirroredTask() {
  return LoadTask(testing::SourcePath("primitives/tasks/handstand_sensor_mirrored.toml"));
}
/// The same after a change of its text.
Task MirroredTask(const std::string& from, const std::string& to) {
  return ParseTask(Replaced(MirroredTask().task_text, from, to), "task.toml", ShippedRobot(),
                   "robot.urdf");
}
std::string RefusalOfMirroredTask(const std::string& from, const std::string& to) {
  try {
    MirroredTask(from, to);
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(TakeGuess, TheMirrorImageOfAMotionGoesToTheOtherSideWithTheLegsExchanged) {
  const PrimitiveFile guess = ShippedMotion("handstand_sensor");
  Task task = MirroredTask();
  TakeGuess(task, guess, "handstand_sensor.toml");
  const Problem& problem = task.problem;
  ASSERT_TRUE(task.guess_feedback);
  const SolveOutcome outcome = SolveRobust(problem, {}, task.guess, &*task.guess_feedback);
  ASSERT_EQ(outcome.solutions.size(), 1U);
  const Solution& solution = outcome.solutions.front();
  EXPECT_EQ(solution.x, task.guess);
  EXPECT_EQ(solution.end, SolveEnd::kTaken);
  const Feedback<double>& law = solution.feedback;
  const Feedback<double>& before = guess.primitive.feedback;
  // The guess as it is, simulated anew: the shipped one has the angle of another feed-forward.
  Task same = LoadTask(testing::SourcePath("primitives/tasks/handstand_sensor.toml"));
  TakeGuess(same, guess, "handstand_sensor.toml");
  const SolveOutcome anew = SolveRobust(same.problem, {}, same.guess, &before);
  ASSERT_EQ(anew.solutions.size(), 1U);
  const Feedback<double>& unmirrored = anew.solutions.front().feedback;
  EXPECT_EQ(law.link.view(), "leg1_link");
  const PrimitiveFile shipped = ShippedMotion("handstand_sensor_mirrored");
  EXPECT_EQ(law.knot_count, before.knot_count);
  EXPECT_EQ(law.knots_s, before.knots_s);
  EXPECT_EQ(law.error_min_rad, before.error_min_rad);
  EXPECT_EQ(law.error_full_rad, before.error_full_rad);
  for (std::size_t j = 0; j < 2; ++j) {
    const Path path = PositionSpline(problem, solution.x, j);
    const Path& other = guess.primitive.joints[1 - j].position;
    EXPECT_EQ(LargestDifference(path, shipped.primitive.joints[j].position), 0);
    EXPECT_EQ(law.joints[j].angle_gain, shipped.primitive.feedback.joints[j].angle_gain);
    EXPECT_EQ(law.joints[j].chain, before.joints[1 - j].chain);
    EXPECT_EQ(law.joints[j].angle_gain, before.joints[1 - j].angle_gain);
    EXPECT_EQ(law.joints[j].rate_gain, before.joints[1 - j].rate_gain);
    for (int k = 0; k <= 100; ++k) {
      const double t = k * problem.duration_s / 100;
      EXPECT_NEAR(path.Evaluate(t).value, -other.Evaluate(t).value, 1e-12);
      // By mirrored forces, and so the same but for their rounding.
      EXPECT_NEAR(law.angle.Evaluate(t).value, -unmirrored.angle.Evaluate(t).value, 1e-6);
    }
  }
}

/// It has no gains to be taken `from_guess`. That nothing is searched is for its task's [robust].
TEST(TakeGuess, TheShippedDownstandToTheOtherSideIsItsGuessWithTheLegsExchanged) {
  const PrimitiveFile guess = ShippedMotion("downstand_back");
  const PrimitiveFile shipped = ShippedMotion("downstand_back_mirrored");
  ASSERT_EQ(shipped.primitive.duration_s, guess.primitive.duration_s);
  for (std::size_t j = 0; j < 2; ++j) {
    const Path& path = shipped.primitive.joints[j].position;
    const Path& other = guess.primitive.joints[1 - j].position;
    for (int k = 0; k <= 100; ++k) {
      const double t = k * guess.primitive.duration_s / 100;
      EXPECT_NEAR(path.Evaluate(t).value, -other.Evaluate(t).value, 1e-12);
    }
  }
}

TEST(TakeGuess, GainsAreTakenOfAGuessThatHasThemForThisLinkAndDurationOnly) {
  const auto refusal = [](Task task, const std::string& guess) -> std::string {
    try {
      TakeGuess(task, ShippedMotion(guess), guess);
    } catch (const FileError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal(MirroredTask(), "handstand_sensor"), "accepted");
  EXPECT_THAT(refusal(MirroredTask(), "handstand"), HasSubstr("feedback: is missing"));
  Task as_it_is = MirroredTask();
  as_it_is.problem.guess_mirror.clear();
  EXPECT_THAT(refusal(as_it_is, "handstand_sensor"),
              HasSubstr("feedback.link: is 'leg2_link', and the task's robust.feedback.link "
                        "'leg1_link'; its gains"));
  as_it_is.problem.robust->feedback->link = "leg2_link";
  EXPECT_EQ(refusal(as_it_is, "handstand_sensor"), "accepted");
  as_it_is.problem.duration_s = 0.8;
  EXPECT_THAT(refusal(as_it_is, "handstand_sensor"),
              HasSubstr("duration_s: is 0.723, and the task's 0.8"));
  EXPECT_THAT(
      refusal(MirroredTask("kp_nm_per_rad = 40.0", "kp_nm_per_rad = 200.0"), "handstand_sensor"),
      HasSubstr("drives: are 40 N m/rad and 5 N m s/rad, and the task's kp_nm_per_rad and "
                "kd_nm_s_per_rad in [robust] 200 and 5"));
  EXPECT_THAT(
      refusal(MirroredTask("control_points = 12", "control_points = 16"), "handstand_sensor"),
      HasSubstr("has a path that the task's differs from by 0.00"));
  EXPECT_THAT(refusal(MirroredTask("joints_rad = { leg1 = 0.0, leg2 = 0.0 }",
                                   "joints_rad = { leg1 = 0.0, leg2 = -0.02 }"),
                      "handstand_sensor"),
              HasSubstr("joint: 'leg2' has a path that the task's differs from by 0.02 rad"));
  EXPECT_EQ(refusal(MirroredTask("control_points = 12", "control_points = 19"), "handstand_sensor"),
            "accepted")
      << "the same path";
}

TEST(TakeGuess, WhoTakesGainsDoesNotSayHowToFindThem) {
  for (const std::string key : {"acts = \"hold\"", "knots = 9", "correction_max_rad = 0.5",
                                "correction_rate_max_rad_s = 30.0", "noise_rad = 0.01",
                                "bias_rad = 0.01", "push_n = 3.0"}) {
    const std::string name = key.substr(0, key.find(' '));
    EXPECT_THAT(RefusalOfMirroredTask("from_guess = true", key + "\nfrom_guess = true"),
                HasSubstr("robust.feedback." + name + ": is about a feedback that is found"));
  }
  EXPECT_THAT(
      RefusalOfMirroredTask("[robust.feedback]",
                            "duration_min_s = 0.7\nduration_max_s = 0.8\n[robust.feedback]"),
      HasSubstr("robust.duration_max_s: does not go with robust.feedback.from_guess"));
}

TEST(TakeGuess, TheJointsOfAMirrorAreThoseOfTheTaskEachOnce) {
  const auto refusal = [](const std::string& joints) {
    return RefusalOfMirroredTask("[[\"leg1\", \"leg2\"]]", joints);
  };
  EXPECT_EQ(refusal("[]"), "accepted") << "each joint is its own partner";
  EXPECT_THAT(refusal("[[\"leg1\"]]"), HasSubstr("mirror.joints: has an entry of 1 names"));
  EXPECT_THAT(refusal("[[\"leg1\", \"leg3\"]]"), HasSubstr("names 'leg3'; allowed: leg1, leg2"));
  EXPECT_THAT(refusal("[[\"leg1\", \"leg1\"]]"), HasSubstr("exchanges 'leg1' with itself"));
  EXPECT_THAT(refusal("[[\"leg1\", \"leg2\"], [\"leg2\", \"leg1\"]]"),
              HasSubstr("names 'leg2' twice"));
}

TEST(SolveNear, StaysInItsBasinThoughAnotherIsNear) {
  // Around the handstand, the robot falls when a control point moves by a few hundredths of a
  // radian: a cost of 25 where the handstand has a thousandth.
  const Problem problem = KnownTask().problem;
  NearRollouts rollouts(problem);
  std::vector<double> start = testing::FreeControlPoints(Known().primitive);
  for (std::size_t i = 0; i < start.size(); ++i) start[i] += i % 2 == 0 ? 2e-3 : -2e-3;
  std::vector<Evaluation> history;
  const Solution solution = SolveNear(problem, start, {30, 1e-4}, rollouts, {}, &history);
  EXPECT_TRUE(solution.feasible());
  EXPECT_LE(solution.rollout.cost, solution.start_cost);
  EXPECT_LT(solution.rollout.cost, 1.1 * Known().provenance.objective);
  EXPECT_EQ(history.size(), static_cast<std::size_t>(solution.evaluations));
}

TEST(SolveNear, KeepsTheLimitsOfPathsFromAStartThatBreaksThem) {
  constexpr double kLimit = 80;
  const Problem problem =
      KnownTask("acceleration_max_rad_s2 = 400.0", "acceleration_max_rad_s2 = 80.0").problem;
  NearRollouts rollouts(problem);
  const Solution solution = SolveNear(problem, testing::FreeControlPoints(Known().primitive),
                                      {20, 1e-3}, rollouts, {}, nullptr);
  double largest_before = 0;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const Extent before = ExtentOf(Known().primitive.joints[j].position, 2);
    largest_before = std::max({largest_before, before.max, -before.min});
    const auto path = PositionSpline(problem, solution.x, j);
    const Extent acceleration = ExtentOf(path, 2);
    EXPECT_LE(std::max(acceleration.max, -acceleration.min), kLimit);
  }
  EXPECT_GT(largest_before, 1.05 * kLimit) << "or there was nothing to mend";
}

TEST(SolveNear, ThatEndsOnItsBudgetOnTheWayHandsOverAMotionWithinItsLimits) {
  // The way down leads along the least distance of the legs, a little beyond it here and there.
  const Problem problem = KnownTask("control_points = 9", "control_points = 24").problem;
  const std::vector<double> start = GuessFrom(problem, Known(), "known.toml");
  NearRollouts rollouts(problem);
  for (const int budget : {9, 12, 20, 40, 60, 90, 120}) {
    const Solution solution = SolveNear(problem, start, {budget, 0}, rollouts, {}, nullptr);
    EXPECT_EQ(solution.end, SolveEnd::kEvaluations) << budget;
    EXPECT_TRUE(solution.feasible())
        << budget << ": " << solution.worst_constraint << " by " << solution.constraint_violation;
    EXPECT_LT(solution.rollout.cost, solution.start_cost) << budget;
    EXPECT_LE(solution.evaluations, budget);
  }
}

}  // namespace
}  // namespace tumbler
