// Motions that are led to where robots arrive so that they come to rest.

#include "offline/solve/capture_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "common/files/primitive_toml.h"
#include "offline/model/dense_eigen.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/guess.h"
#include "offline/solve/motion_feedback.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

/// A shipped robust task, and a motion that robots play; by default the handstand from nothing, and
/// the motion that is best for the model.
class Shipped {
 public:
  explicit Shipped(const std::string& task = "primitives/tasks/handstand_first.toml",
                   const std::string& motion = "primitives/nominal/handstand.toml")
      : task_(LoadTask(testing::SourcePath(task))) {
    TakeGuess(task_, LoadPrimitive(testing::SourcePath(motion)), motion);
  }

  [[nodiscard]] const RobustRanking& ranking() const { return ranking_; }
  [[nodiscard]] std::vector<double> motion() const { return motion_.Reduce(task_.guess); }
  /// Robots at twice the spreads, so many packets.
  [[nodiscard]] Ensemble Robots(std::size_t packets, std::uint64_t seed) const {
    std::vector<std::uint64_t> which(packets * Packet::kLanes);
    std::iota(which.begin(), which.end(), 0);
    return DrawEnsemble(robust_, {.scale = 2, .seed = seed, .steps = RobustTask::kRough}, which);
  }

 private:
  Task task_;
  SolveOptions options_;
  RobustTask robust_{task_.problem, options_, {}};
  RobustMotion motion_{robust_};
  Ensemble model_ = ModelEnsemble(robust_, RobustTask::kRough);
  MotionPlanner planner_{robust_, motion_};
  MotionFeedback feedback_{robust_, motion_, model_};
  RobustRanking ranking_{robust_, motion_, planner_, feedback_};
};

double MeanSquare(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (std::abs(a[i]) > 2) continue;  // falls anyway
    sum += (a[i] - b[i]) * (a[i] - b[i]);
    ++count;
  }
  return sum / static_cast<double>(count);
}

TEST(RobustRanking, AMotionThatCanBePlayedIsNoWorseThanOneThatCannot) {
  const Shipped shipped;
  const Ensemble robots = shipped.Robots(2, 5);
  // Motions that need too much torque and let all robots fall, and one that is beyond a limit.
  std::vector<double> beyond = shipped.motion();
  beyond[4] = 10;
  EXPECT_GE(shipped.ranking().Evaluate({beyond}, robots).front(), RobustMotion::kUnplayable);
  int hard = 0;
  for (std::size_t i = 1; i + 1 < beyond.size(); ++i) {
    for (const double change : {-0.8, -0.4, -0.2, 0.2, 0.4, 0.8}) {
      std::vector<double> x = shipped.motion();
      x[i] += change;
      x[i + 1] -= change;
      if (shipped.ranking().Arrivals({x}, robots).front().divergences.empty()) continue;
      if (shipped.ranking().Plans({x}).front().excess < 0.1) continue;
      ++hard;
      EXPECT_LT(shipped.ranking().Evaluate({x}, robots).front(), RobustMotion::kUnplayable)
          << i << ' ' << change;
    }
  }
  EXPECT_GT(hard, 3);
}

TEST(RobustRanking, RanksInSinglePrecisionAsRobotsInDoublePrecisionJudge) {
  const Shipped shipped("primitives/tasks/handstand.toml", "primitives/handstand.toml");
  for (const std::size_t packets : {std::size_t{5}, std::size_t{16}}) {  // one is filled up
    const Ensemble robots = shipped.Robots(packets, 6);
    std::vector<std::vector<double>> motions(1, shipped.motion());
    for (std::size_t i = 0; i < 6; ++i) {
      motions.push_back(motions.front());
      motions.back()[i] += 0.004;
    }
    std::vector<double> hopeless = shipped.motion();
    for (double& x : hopeless) x += 0.1;
    motions.push_back(hopeless);
    std::vector<double> beyond = shipped.motion();
    beyond[4] = 10;
    motions.push_back(beyond);
    const std::vector<double> judged = shipped.ranking().Evaluate(motions, robots);
    const std::vector<double> ranked = shipped.ranking().Rank(motions, robots);
    ASSERT_EQ(ranked.size(), motions.size());
    // At most two robots of 128 end otherwise, and none of 40.
    for (std::size_t m = 0; m < 7; ++m) EXPECT_NEAR(ranked[m], judged[m], 0.02) << m;
    EXPECT_GT(ranked[7], ranked[0] + 0.2);
    EXPECT_GE(ranked[8], RobustMotion::kUnplayable);
  }
}

TEST(RobotLoss, DivergenceIsWhatGrowsOfAPendulumsMotion) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand_first.toml"));
  const RobotLoss loss(task.problem);
  LaneState<Packet> state{};
  const auto put = [&](std::size_t lane, double off_rad, double rate_rad_s) {
    state.q[RobotLoss::kPitch].set_lane(lane, loss.target_rad() + off_rad);
    state.v[RobotLoss::kPitch].set_lane(lane, rate_rad_s);
  };
  put(0, 0, 0);
  put(1, 0.1, -0.1 * RobotLoss::kFalls_per_s);  // just fast enough to come to rest upright
  put(2, 0.1, 0);
  put(3, -0.1, 0);
  put(4, 0, std::numeric_limits<double>::quiet_NaN());
  put(5, -30, 0);
  const auto divergence = loss.Divergence(state);
  EXPECT_NEAR(divergence[0], 0, 1e-12);
  EXPECT_NEAR(divergence[1], 0, 1e-12);
  EXPECT_NEAR(divergence[2], 0.1 * RobotLoss::kFalls_per_s, 1e-12);
  EXPECT_NEAR(divergence[3], -divergence[2], 1e-12);
  EXPECT_EQ(divergence[4], 20);
  EXPECT_EQ(divergence[5], -20);
}

TEST(DivergenceTells, WhatComesOfRobotsThatArriveUprightAndNothingOfThoseThatRoll) {
  const Shipped handstand("primitives/tasks/handstand.toml", "primitives/handstand.toml");
  EXPECT_EQ(DivergenceTells(handstand.ranking(), handstand.motion(), handstand.Robots(4, 1)),
            Telling::kYes);
  // 0.1 s after the end it tells of most robots whether they will stand.
  const Ensemble many = handstand.Robots(32, 2);
  const auto losses = handstand.ranking().LossesOfRobots(handstand.motion(), many);
  const auto divergences =
      handstand.ranking().Arrivals({handstand.motion()}, many).front().divergences;
  ASSERT_EQ(divergences.size(), 2 * losses.size());
  std::size_t right = 0;
  for (std::size_t robot = 0; robot < losses.size(); ++robot) {
    const bool stands = losses[robot] < RobotLoss::kCarried;
    if ((std::abs(divergences[2 * robot]) < 0.5) == stands) ++right;
  }
  EXPECT_GE(10 * right, 9 * losses.size()) << right << " of " << losses.size();
  const Shipped roll("primitives/tasks/roll.toml", "primitives/roll.toml");
  EXPECT_EQ(DivergenceTells(roll.ranking(), roll.motion(), roll.Robots(4, 1)), Telling::kNo);
  std::vector<double> falls = handstand.motion();
  for (double& x : falls) x += 0.1;
  EXPECT_EQ(DivergenceTells(handstand.ranking(), falls, handstand.Robots(4, 1)), Telling::kUnknown);
}

TEST(ArrivalCovariance, KeepsSmallWhatChangesHowRobotsArriveAndNothingElse) {
  const Shipped handstand;
  const std::vector<double> x = handstand.motion();
  constexpr double kReach_rad = 0.2;
  const auto covariance =
      ArrivalCovariance(handstand.ranking(), x, handstand.Robots(4, 1), kReach_rad);
  ASSERT_TRUE(covariance);
  const DenseEigen eigen = DecomposeSymmetric(*covariance);
  const Eigen::VectorXd deviations = eigen.values.cwiseSqrt();
  EXPECT_LE(deviations.maxCoeff(), kReach_rad * (1 + 1e-9));
  EXPECT_GT(deviations.maxCoeff(), 0.9 * kReach_rad);
  EXPECT_LT(deviations.minCoeff(), 0.05 * kReach_rad) << "one direction fells the robot";

  // Other robots than those that it was found by, and a tenth of a deviation, where these are
  // nearly linear: none changes arrivals by much more than what most robots bear.
  const Ensemble others = handstand.Robots(4, 2);
  std::vector<std::vector<double>> motions(1, x);
  Eigen::Index stiffest = 0;
  deviations.minCoeff(&stiffest);
  for (Eigen::Index i = 0; i < deviations.size(); ++i) {
    motions.push_back(x);
    for (std::size_t k = 0; k < x.size(); ++k) {
      motions.back()[k] += 0.1 * deviations[i] * eigen.vectors(static_cast<Eigen::Index>(k), i);
    }
  }
  const std::vector<RobustRanking::Arrival> arrivals =
      handstand.ranking().Arrivals(motions, others);
  std::size_t compared = 0;
  for (std::size_t i = 1; i < motions.size(); ++i) {
    if (arrivals[i].divergences.empty()) continue;  // a limit of the path
    ++compared;
    EXPECT_LT(MeanSquare(arrivals[0].divergences, arrivals[i].divergences), 0.1 * 0.1)
        << "direction " << i - 1;
  }
  EXPECT_GE(compared, x.size() / 2);
  // A step of that size along the stiffest direction's axis with the reach of the others changes
  // them many times as much.
  std::vector<double> blind = x;
  for (std::size_t k = 0; k < x.size(); ++k) {
    blind[k] += 0.1 * kReach_rad * eigen.vectors(static_cast<Eigen::Index>(k), stiffest);
  }
  const auto fallen = handstand.ranking().Arrivals({blind}, others).front().divergences;
  ASSERT_FALSE(fallen.empty());
  EXPECT_GT(MeanSquare(arrivals[0].divergences, fallen), 0.5 * 0.5);
}

TEST(Capture, LeadsOfManyMotionsThoseWhoseRobotsArriveNearestToRest) {
  const Shipped handstand;
  std::vector<double> far = handstand.motion();
  for (double& x : far) x += 0.02;
  std::vector<std::vector<double>> from(4, far);
  from[2] = handstand.motion();
  std::vector<int> started;
  const std::vector<CapturedMotion> led = Capture(
      handstand.ranking(), from, handstand.Robots(8, 3), {.started = 1, .generations = 1}, 1,
      [&](int start, int, double) { started.push_back(start); }, [] { return false; });
  EXPECT_EQ(led.size(), 1U);
  EXPECT_EQ(started, std::vector<int>{2});
}

TEST(Capture, LeadsTheModelsHandstandToWhereMoreRobotsComeToRest) {
  const Shipped handstand;
  const std::vector<double> x = handstand.motion();
  int generations = 0;
  const std::vector<CapturedMotion> led = Capture(
      handstand.ranking(), {x}, handstand.Robots(32, 3), {.generations = 25}, 1,
      [&](int start, int motions, double) {
        EXPECT_EQ(start, 0);
        EXPECT_EQ(motions, 16);
        ++generations;
      },
      [] { return false; });
  ASSERT_EQ(led.size(), 1U);
  EXPECT_EQ(generations, 25);
  // By robots that it has not met, played until they stand or lie.
  const std::vector<double> losses =
      handstand.ranking().Evaluate({x, led.front().x}, handstand.Robots(16, 4));
  EXPECT_LT(losses[1], losses[0] - 0.3);
}

TEST(Capture, OfSeveralMotionsHalfAreLedOnUntilAsManyAreLeftAsAreWanted) {
  const Shipped handstand;
  std::vector<std::vector<double>> from(3, handstand.motion());
  for (std::size_t i = 1; i < from.size(); ++i) from[i].front() += 0.3 * static_cast<double>(i);
  std::vector<int> generations(from.size());
  const CaptureSettings settings{.wanted = 1, .generations = 31};
  const std::vector<CapturedMotion> led = Capture(
      handstand.ranking(), from, handstand.Robots(8, 3), settings, 1,
      [&](int start, int, double) { ++generations.at(Index(start)); }, [] { return false; });
  EXPECT_EQ(led.size(), 1U);
  std::ranges::sort(generations);
  EXPECT_EQ(generations, (std::vector<int>{15, 30, 31})) << "three, two, and one";
}

TEST(Capture, EndsWhereNoRobotHasAnythingLeftToGain) {
  const Shipped rise("primitives/tasks/rise.toml", "primitives/rise.toml");
  int generations = 0;
  const std::vector<CapturedMotion> led = Capture(
      rise.ranking(), {rise.motion(), rise.motion()}, rise.Robots(8, 3), {}, 1,
      [&](int, int, double) { ++generations; }, [] { return false; });
  ASSERT_EQ(led.size(), 1U);
  EXPECT_LT(led.front().loss, 0.05);
  EXPECT_LE(generations, 4) << "of 75";
}

TEST(Capture, EndsWhenItIsToldTo) {
  const Shipped handstand;
  int generations = 0;
  const std::vector<CapturedMotion> led = Capture(
      handstand.ranking(), {handstand.motion()}, handstand.Robots(8, 3), {}, 1,
      [&](int, int, double) { ++generations; }, [&] { return generations == 2; });
  EXPECT_EQ(generations, 2);
  EXPECT_EQ(led.size(), 1U) << "it hands over what it has";
}

}  // namespace
}  // namespace tumbler
