// The distances between a robot's own shapes, which pairs count, and the limit that the optimiser
// keeps.

#include "offline/scene/self_clearance.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "common/files/toml_reader.h"
#include "offline/model/outline.h"
#include "offline/model/signed_distance.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/clearance_constraint.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"
#include "offline/solve/smooth_maximum.h"
#include "tests/support/crossing_legs.h"
#include "tests/support/handstand.h"
#include "tests/support/random_shape.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::QuickTask;
using testing::Replaced;
using testing::ShippedRobot;

constexpr double kPi = std::numbers::pi;

std::set<std::string> NamesOf(const PlanarRobot& robot, const std::vector<OwnPair>& pairs) {
  std::set<std::string> names;
  for (const OwnPair& pair : pairs) names.insert(NameOf(robot, pair));
  return names;
}

Scene SceneOfTask(const std::string& task, const std::string& robot = ShippedRobot()) {
  return ParseTask(task, "task.toml", robot, "robot.urdf").problem.scene;
}

std::string WithSelfContact(const std::string& keys) {
  return Replaced(QuickTask(), "[[obstacle]]", "[self_contact]\n" + keys + "\n[[obstacle]]");
}

std::string ErrorOf(const std::string& task) {
  try {
    SceneOfTask(task);
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

// ---- Distances of two shapes --------------------------------------------------------------------

PosedShape<Plane> Posed(const Shape<Plane>& shape) {
  return PosedShape<Plane>::Of(shape, {}, {0, 0});
}

TEST(SignedDistance, CapsulesThatCrossAreAsFarInsideEachOtherAsTheShortestWayOut) {
  // A bar along x from -1 to 1, and one along z whose lower end is 0.2 below it.
  const auto bar = Shape<Plane>::Capsule({0, 0}, {}, 1, 0.01);
  const auto post = Shape<Plane>::Capsule({0.3, 0.8}, Plane::RotationBy(1, kPi / 2), 1, 0.02);
  const SignedDistance<Plane> crossing = FindSignedDistance(Posed(post), Posed(bar));
  EXPECT_NEAR(crossing.d, -0.2 - 0.03, 1e-12);
  EXPECT_NEAR(crossing.u.x(), 0, 1e-12);
  EXPECT_NEAR(crossing.u.y(), 1, 1e-12) << "up and out";
}

TEST(SignedDistance, IsContinuousWhereCoresBeginToOverlap) {
  const auto bar = Shape<Plane>::Capsule({0, 0}, {}, 1, 0.01);
  double before = 0;
  for (int i = -20; i <= 20; ++i) {
    const auto post =
        Shape<Plane>::Capsule({0.3, 1 + 1e-4 * i}, Plane::RotationBy(1, kPi / 2), 1, 0.02);
    const double d = FindSignedDistance(Posed(bar), Posed(post)).d;
    EXPECT_NEAR(d, 1e-4 * i - 0.03, 1e-12);
    if (i > -20) {
      EXPECT_NEAR(d - before, 1e-4, 1e-12);
    }
    before = d;
  }
}

TEST(SignedDistance, MovingAShapeOutByTheDepthFreesIt) {
  std::mt19937_64 random(3);
  int crossing = 0;
  for (int i = 0; i < 500; ++i) {
    Shape<Plane> a = Shape<Plane>::Box({Uniform(random, -1, 1), Uniform(random, -1, 1)},
                                       Plane::RotationBy(1, Uniform(random, -3, 3)),
                                       {Uniform(random, 0.1, 1), i % 2 == 0 ? 0 : 0.3});
    const Shape<Plane> b =
        Shape<Plane>::Box({0, 0}, Plane::RotationBy(1, Uniform(random, -3, 3)), {0.8, 0.2});
    a.radius_m = 0.05;
    const SignedDistance<Plane> inside = FindSignedDistance(Posed(a), Posed(b));
    if (inside.d >= -0.05) continue;
    ++crossing;
    a.centre += (-inside.d + 1e-9) * inside.u;
    EXPECT_NEAR(FindSignedDistance(Posed(a), Posed(b)).d, 0, 1e-8);
    // No other direction is shorter.
    for (int k = 0; k < 36; ++k) {
      Shape<Plane> other = a;
      const double angle = k * kPi / 18;
      other.centre += (inside.d - 1e-9) * inside.u;
      other.centre += 0.98 * -inside.d * Plane::Vector(std::cos(angle), std::sin(angle));
      EXPECT_LT(FindSignedDistance(Posed(other), Posed(b)).d, 0);
    }
  }
  EXPECT_GT(crossing, 100);
}

// ---- Pairs --------------------------------------------------------------------------------------

TEST(SeparatePairs, AreAllOfTheLegsAndWhatEachLegCouldReachOfTheMiddle) {
  const PlanarRobot robot = LoadTumbler();
  const auto names = NamesOf(robot, SeparatePairs(robot, OwnShapes::kAll, 0.005));
  EXPECT_THAT(names, Contains("leg1_link/0 and leg2_link/1"));
  EXPECT_THAT(names, Contains("leg1_link/visual/0 and leg2_link/visual/0"));
  EXPECT_THAT(names, Contains("middle/visual/0 and leg1_link/visual/1")) << "the foot's bar";
  EXPECT_THAT(names, Not(Contains("middle/visual/0 and leg1_link/visual/0")))
      << "the rods meet at the joint, whatever its angle";
  EXPECT_THAT(names, Not(Contains("leg1_link/0 and leg1_link/1"))) << "on one link";
  EXPECT_EQ(names.size(), 16U + 14U);
}

TEST(SeparatePairs, OfCollisionShapesAreTheFeetsSpheresAndTheMiddlesEnds) {
  const PlanarRobot robot = LoadTumbler();
  const auto names = NamesOf(robot, SeparatePairs(robot, OwnShapes::kCollision, 0.005));
  EXPECT_EQ(names.size(), 4U + 4U);
  EXPECT_THAT(names, Not(Contains(HasSubstr("visual"))));
  EXPECT_TRUE(SeparatePairs(robot, OwnShapes::kNone, 0.005).empty());
}

TEST(SeparatePairs, LinksThatPassBesideEachOtherNeedNoDistance) {
  PlanarRobot robot = LoadTumbler();
  const auto legs = [&robot] {
    const auto names = NamesOf(robot, SeparatePairs(robot, OwnShapes::kCollision, 0.005));
    return std::ranges::count_if(names, [](const std::string& name) {
      return name.starts_with("leg1_link") && name.find("leg2_link") != std::string::npos;
    });
  };
  EXPECT_EQ(legs(), 4);
  for (OwnShape& shape : robot.own_shapes) {
    if (shape.link != "leg2_link") continue;
    shape.y_min_m += 0.024;
    shape.y_max_m += 0.024;
  }
  EXPECT_EQ(legs(), 4) << "4 mm beside each other is less than the clearance";
  for (OwnShape& shape : robot.own_shapes) {
    if (shape.link == "leg2_link") shape.y_min_m += 0.002, shape.y_max_m += 0.002;
  }
  EXPECT_EQ(legs(), 0);
}

TEST(OwnShapes, KnowHowFarTheyReachAcrossThePlane) {
  const std::string text = Replaced(
      ShippedRobot(), "<origin xyz=\"0.20 0 0.04\"/>\n      <geometry><sphere radius=\"0.01\"/>",
      "<origin xyz=\"0.20 0.5 0.04\" rpy=\"1.5707963267948966 0 0\"/>\n      "
      "<geometry><cylinder length=\"0.08\" radius=\"0.01\"/>");
  const PlanarRobot robot = ParsePlanarRobot(text, "robot.urdf", RootKind::kPlanarXz);
  const auto shape = std::ranges::find(robot.own_shapes, "leg1_link/0", &OwnShape::name);
  ASSERT_NE(shape, robot.own_shapes.end());
  EXPECT_NEAR(shape->y_min_m, 0.46, 1e-9);
  EXPECT_NEAR(shape->y_max_m, 0.54, 1e-9);
}

TEST(OwnShapes, AreWhereTheirJointsAreAcrossThePlane) {
  const auto extent_of_foot = [](const std::string& joint_y, const std::string& foot_y) {
    std::string text = Replaced(ShippedRobot(), "<origin xyz=\"0.15 0 0\"/>\n    <axis",
                                "<origin xyz=\"0.15 " + joint_y + " 0\"/>\n    <axis");
    text = Replaced(text, "<origin xyz=\"0.20 0 0.04\"/>",
                    "<origin xyz=\"0.20 " + foot_y + " 0.04\"/>");
    const PlanarRobot robot = ParsePlanarRobot(text, "robot.urdf", RootKind::kPlanarXz);
    const auto shape = std::ranges::find(robot.own_shapes, "leg1_link/0", &OwnShape::name);
    if (shape == robot.own_shapes.end()) throw std::logic_error("there is no foot");
    return std::pair(shape->y_min_m, shape->y_max_m);
  };
  const auto [low, high] = extent_of_foot("0.06", "0");
  EXPECT_NEAR(low, 0.05, 1e-12);
  EXPECT_NEAR(high, 0.07, 1e-12);
  const auto [back_low, back_high] = extent_of_foot("0.06", "-0.06");
  EXPECT_NEAR(back_low, -0.01, 1e-12) << "as in the plane of the other leg";
  EXPECT_NEAR(back_high, 0.01, 1e-12);
}

TEST(OwnShapes, OfAnyCylinderOrBoxReachAsFarAsItsOutline) {
  const auto outline_of = [](const std::string& origin, const std::string& geometry) {
    const std::string text = Replaced(
        ShippedRobot(), "<origin xyz=\"0.20 0 0.04\"/>\n      <geometry><sphere radius=\"0.01\"/>",
        "<origin xyz=\"0.20 0 0.04\" rpy=\"" + origin + "\"/>\n      <geometry>" + geometry);
    const PlanarRobot robot = ParsePlanarRobot(text, "robot.urdf", RootKind::kPlanarXz);
    const auto shape = std::ranges::find(robot.own_shapes, "leg1_link/0", &OwnShape::name);
    if (shape == robot.own_shapes.end()) throw std::logic_error("the foot does not count");
    const Outline outline = OutlineOf(shape->shape);
    std::array<double, 4> reach = {1, -1, 1, -1};  // least and greatest x, and z
    for (const Plane::Vector& corner : outline.corners) {
      reach[0] = std::min(reach[0], corner.x() - outline.radius_m);
      reach[1] = std::max(reach[1], corner.x() + outline.radius_m);
      reach[2] = std::min(reach[2], corner.y() - outline.radius_m);
      reach[3] = std::max(reach[3], corner.y() + outline.radius_m);
    }
    return reach;
  };
  const auto near = [](const std::array<double, 4>& reach, double half_x, double half_z) {
    EXPECT_NEAR(reach[0], 0.20 - half_x, 1e-12);
    EXPECT_NEAR(reach[1], 0.20 + half_x, 1e-12);
    EXPECT_NEAR(reach[2], 0.04 - half_z, 1e-12);
    EXPECT_NEAR(reach[3], 0.04 + half_z, 1e-12);
  };
  // A puck with its axis along z: seen from the side it is as long as wide, and as high as long.
  near(outline_of("0 0 0", "<cylinder length=\"0.04\" radius=\"0.03\"/>"), 0.03, 0.02);
  // A bar that stands on its edge: seen from the side it is as high as its diagonal.
  near(outline_of("0.7853981633974483 0 0", "<box size=\"0.12 0.07 0.07\"/>"), 0.06,
       0.07 / std::sqrt(2.0));
}

// ---- Distances of a robot's shapes --------------------------------------------------------------

TEST(SelfDistances, FindTheNearestPairThatGeometryByHandFinds) {
  const PlanarRobot robot = LoadTumbler();
  SelfDistances distances(robot, SeparatePairs(robot, OwnShapes::kCollision, 0.005));
  // At home both legs hang straight down, 0.3 m apart; the inner spheres of the feet are 40 mm
  // further in and have 10 mm radius.
  const std::vector<double> home = {7, 8, 0.3, -kPi / 2, kPi / 2};
  const SelfClearance nearest = distances.Nearest(home);
  EXPECT_NEAR(nearest.distance_m, 0.3 - 2 * 0.04 - 2 * 0.01, 1e-12);
  EXPECT_THAT(NameOf(robot, nearest.pair), AllOf(HasSubstr("leg1_link/"), HasSubstr("leg2_link/")));
}

TEST(SelfDistances, LeaveOutOnlyWhatCannotBeNearYet) {
  // Paths in small steps, over which most pairs are left alone most of the time, against an object
  // that looks at all pairs.
  const PlanarRobot robot = LoadTumbler();
  const std::vector<OwnPair> pairs = SeparatePairs(robot, OwnShapes::kAll, 0.005);
  std::mt19937_64 random(4);
  for (int path = 0; path < 20; ++path) {
    SelfDistances distances(robot, pairs), finder(robot, pairs);
    std::vector<double> q(robot.tree.dofs.size(), 0.0), rate(q.size());
    for (std::size_t j = 3; j < q.size(); ++j) {
      q[j] = Uniform(random, -2.5, 2.5);
      rate[j] = Uniform(random, -0.02, 0.02);
    }
    double least = std::numeric_limits<double>::infinity(), true_least = least;
    for (int k = 0; k < 200; ++k) {
      for (std::size_t j = 3; j < q.size(); ++j) q[j] += rate[j];
      SelfDistances fresh(robot, pairs);
      true_least = std::min(true_least, fresh.Nearest(q).distance_m);
      least = std::min(least, distances.Nearest(q, least).distance_m);
      EXPECT_EQ(least, true_least);
      SelfDistances other(robot, pairs);
      const auto found = finder.FindNearer(q, 0.007);
      const auto all = other.FindNearer(q, 0.007);
      ASSERT_EQ(found.size(), all.size()) << path << " " << k;
      for (std::size_t i = 0; i < all.size(); ++i) {
        EXPECT_EQ(found[i].distance_m, all[i].distance_m);
        EXPECT_EQ(found[i].slopes, all[i].slopes);
      }
    }
  }
}

TEST(SelfDistances, DerivativesAgreeWithDifferencesAlsoWhereLegsCross) {
  const PlanarRobot robot = LoadTumbler();
  SelfDistances distances(robot, SeparatePairs(robot, OwnShapes::kAll, 0.005));
  std::mt19937_64 random(5);
  int compared = 0, crossing = 0;
  for (int i = 0; i < 3000; ++i) {
    std::vector<double> q = {0, 0, 0, Uniform(random, -2.9, 2.9), Uniform(random, -2.9, 2.9)};
    const auto found = distances.FindNearer(q, 0.05);
    const std::vector<SelfDistances::Near> pairs(found.begin(), found.end());
    for (const SelfDistances::Near& pair : pairs) {
      SelfDistances one(robot, std::span(&pair.pair, 1));
      for (const std::size_t j : {3U, 4U}) {
        const auto at = [&](double step) {
          std::vector<double> moved = q;
          moved[j] += step;
          return one.Nearest(moved).distance_m;
        };
        constexpr double kStep = 1e-7;
        const double left = (at(0) - at(-kStep)) / kStep, right = (at(kStep) - at(0)) / kStep;
        if (std::abs(left - right) > 1e-4) continue;  // the nearest points jump here
        EXPECT_NEAR(pair.slopes[j], (left + right) / 2, 1e-5) << NameOf(robot, pair.pair);
        ++compared;
        if (pair.distance_m < -0.03) ++crossing;
      }
    }
  }
  EXPECT_GT(compared, 3000);
  EXPECT_GT(crossing, 50);
}

// ---- The limit ----------------------------------------------------------------------------------

Problem RollProblem() {
  return LoadTask(testing::SourcePath("tests/data/tasks/long_roll.toml")).problem;
}

/// Parameters with which the legs come near each other: a mixture of the crossing roll and of the
/// straight line.
std::vector<double> Between(const Problem& problem, double share) {
  std::vector<double> x = CrossingRoll();
  std::size_t i = 0;
  for (const ActuatedJoint& joint : problem.joints) {
    const int free = joint.free_points();
    for (int k = 1; k <= free; ++k, ++i) {
      const double line = joint.start_rad + k * (joint.end_rad - joint.start_rad) / (free + 1);
      x[i] = share * x[i] + (1 - share) * line;
    }
  }
  return x;
}

TEST(ClearanceConstraint, IsViolatedByLegsThatGoThroughEachOther) {
  const Problem problem = RollProblem();
  // 5 mm are missing, and 19.3 mm.
  EXPECT_GT(ClearanceConstraint(problem, 1e-3).Evaluate(CrossingRoll()), 2.43);
  EXPECT_EQ(ClearanceConstraint(problem, 1e-3).Evaluate(Between(problem, 0)), -1);
}

/// The same with a smooth maximum of this sharpness: the lower, the farther it sees.
Problem RollProblem(double sharpness) {
  Problem problem = RollProblem();
  problem.solver.sharpness = sharpness;
  return problem;
}
const double kShippedSharpness = SolverSettings().sharpness;

TEST(ClearanceConstraint, IsNeverBelowTheTrueMaximumAndHardlyDependsOnTheStep) {
  const Problem problem = RollProblem();
  int seen = 0;
  for (const double share : {0.92, 0.94, 0.96, 0.98, 1.0}) {
    const std::vector<double> x = Between(problem, share);
    SelfDistances distances(problem.scene.robot, problem.scene.self_contact.pairs);
    double nearest = 1;
    std::vector<double> q(5);
    const auto leg1 = PositionSpline(problem, x, 0), leg2 = PositionSpline(problem, x, 1);
    for (int k = 0; k <= 20000; ++k) {
      q[3] = leg1.Evaluate(1e-4 * k).value;
      q[4] = leg2.Evaluate(1e-4 * k).value;
      nearest = std::min(nearest, distances.Nearest(q).distance_m);
    }
    const double truth =
        std::max(-1.0, (problem.scene.self_contact.clearance_m - nearest) / kClearanceScale_m);
    ASSERT_GT(truth, -0.6) << "else too far away to count";
    for (const double sharpness : {60.0, kShippedSharpness}) {
      const Problem sharp = RollProblem(sharpness);
      const double value = ClearanceConstraint(sharp, 1e-3).Evaluate(x);
      if (truth < kNegligibleExponent / sharpness) {
        EXPECT_EQ(value, -1) << share << ": it is beyond what the maximum sees";
        continue;
      }
      ++seen;
      EXPECT_GE(value, truth) << share;
      EXPECT_LT(value, truth + 0.15) << share;
      EXPECT_NEAR(value, ClearanceConstraint(sharp, 0.25e-3).Evaluate(x), 2e-3) << share;
    }
  }
  EXPECT_GE(seen, 7) << "all five with the soft one, and the near ones with the sharp one";
}

TEST(ClearanceConstraint, ItsGradientAgreesWithDifferences) {
  for (const auto& [sharpness, share] :
       {std::pair(60.0, 0.92), std::pair(60.0, 0.95), std::pair(60.0, 0.98), std::pair(60.0, 1.0),
        std::pair(kShippedSharpness, 0.98), std::pair(kShippedSharpness, 1.0)}) {
    const Problem problem = RollProblem(sharpness);
    ClearanceConstraint constraint(problem, 1e-3);
    std::vector<double> x = Between(problem, share);
    std::vector<double> gradient(x.size());
    ASSERT_GT(constraint.Evaluate(x, gradient), -1) << share;
    double largest = 0;
    for (const double slope : gradient) largest = std::max(largest, std::abs(slope));
    ASSERT_GT(largest, 0.1);
    for (std::size_t i = 0; i < x.size(); ++i) {
      constexpr double kStep = 1e-6;
      const double middle = x[i];
      x[i] = middle + kStep;
      const double above = constraint.Evaluate(x);
      x[i] = middle - kStep;
      const double below = constraint.Evaluate(x);
      x[i] = middle;
      EXPECT_NEAR(gradient[i], (above - below) / (2 * kStep), 1e-6 * largest) << share << " " << i;
    }
  }
}

TEST(ClearanceConstraint, IsAnOutputOfTheRolloutByBothGradients) {
  Problem problem = RollProblem();
  const std::vector<double> x = Between(problem, 0.95);
  std::vector<double> gradient(x.size());
  const double value = ClearanceConstraint(problem, 2e-3).Evaluate(x, gradient);
  for (const auto method :
       {SolverSettings::Gradient::kAdjoint, SolverSettings::Gradient::kForward}) {
    problem.solver.gradient = method;
    Rollout rollout(problem, 2e-3);
    auto all = OutputGradients::Of(rollout);
    EXPECT_EQ(rollout.Run(x, all).clearance_excess, value);
    for (std::size_t i = 0; i < x.size(); ++i)
      EXPECT_EQ(all(all.rows() - 1, static_cast<Eigen::Index>(i)), gradient[i]);
    EXPECT_EQ(rollout.Run(x).clearance_excess, value);
    EXPECT_EQ(rollout.Estimate(x).clearance_excess, value);
  }
}

// ---- The keys -----------------------------------------------------------------------------------

TEST(SelfContactKeys, WithoutThemAllShapesKeepFiveMillimetres) {
  const Scene scene = SceneOfTask(QuickTask());
  EXPECT_EQ(scene.self_contact.clearance_m, 0.005);
  EXPECT_EQ(scene.self_contact.pairs, SeparatePairs(scene.robot, OwnShapes::kAll, 0.005));
}

TEST(SelfContactKeys, PairsCanBeLeftOutAndAdded) {
  const Scene scene = SceneOfTask(WithSelfContact(
      "clearance_m = 0.002\nshapes = \"collision\"\n"
      "leave_out = [[\"leg1_link/0\", \"leg2_link\"]]\n"
      "add = [[\"leg2_link/visual/1\", \"leg1_link/1\"], [\"leg1_link/1\", \"leg2_link/0\"]]"));
  EXPECT_EQ(scene.self_contact.clearance_m, 0.002);
  const auto names = NamesOf(scene.robot, scene.self_contact.pairs);
  EXPECT_THAT(names, Not(Contains("leg1_link/0 and leg2_link/0")));
  EXPECT_THAT(names, Not(Contains("leg1_link/0 and leg2_link/1")));
  EXPECT_THAT(names, Contains("leg1_link/1 and leg2_link/1"));
  EXPECT_THAT(names, Contains("leg1_link/1 and leg2_link/visual/1"));
  EXPECT_EQ(names.size(), 8U - 2U + 1U) << "one that is there already is not there twice";
  EXPECT_TRUE(SceneOfTask(WithSelfContact("shapes = \"none\"")).self_contact.pairs.empty());
}

TEST(SelfContactKeys, WrongNamesAreRefusedWithThoseThatThereAre) {
  EXPECT_THAT(ErrorOf(WithSelfContact("leave_out = [[\"leg1_link\", \"tail\"]]")),
              AllOf(HasSubstr("self_contact.leave_out"), HasSubstr("'tail'"),
                    HasSubstr("leg2_link/visual/1")));
  EXPECT_THAT(ErrorOf(WithSelfContact("leave_out = [[\"leg1_link\"]]")),
              HasSubstr("an entry of 1 names; allowed: two"));
  EXPECT_THAT(ErrorOf(WithSelfContact("add = [[\"middle/0\", \"middle/1\"]]")),
              HasSubstr("do not move against each other"));
}

TEST(SelfContactKeys, AClearanceThatTheStartDoesNotKeepIsRefusedWithThePair) {
  EXPECT_THAT(ErrorOf(WithSelfContact("clearance_m = 0.25")),
              AllOf(HasSubstr("self_contact.clearance_m"), HasSubstr("is 0.25"),
                    HasSubstr("starts"), HasSubstr("0.2 m apart")));
  const std::string crossed =
      Replaced(QuickTask(), "leg1 = -1.2, leg2 = 1.3", "leg1 = -2.7, leg2 = 2.7");
  EXPECT_THAT(ErrorOf(crossed), AllOf(HasSubstr("self_contact.clearance_m"), HasSubstr("ends"),
                                      HasSubstr("leave_out")));
}

}  // namespace
}  // namespace tumbler
