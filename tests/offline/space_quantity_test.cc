// What terms of a cost take of a link in space.

#include "offline/problem/space_quantity.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "offline/model/robot.h"
#include "offline/problem/purpose_gauge.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/quaternion.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using Of = SpaceQuantity::Of;
using Triple = std::array<double, 3>;

constexpr double kHalfTurn = std::numbers::pi;

const SpaceRobot& TumblerInSpace() {
  static const SpaceRobot robot =
      ReduceToSpace(ParseRobot(testing::ShippedRobot(), "tumbler.urdf", RootKind::kFloating));
  return robot;
}
std::string RootLink() { return TumblerInSpace().body_names[Index(TumblerInSpace().first_body())]; }

SpaceQuantity HeadingOf(const Triple& axis, const Triple& along,
                        const std::string& link = RootLink()) {
  return QuantityOfLink(TumblerInSpace(), Of::kHeading, link, axis, along);
}

/// The value of a root that is turned so, with all else at 0.
double At(const SpaceQuantity& quantity, const SpaceMatrix& axes) {
  const std::vector<double> at_rest(TumblerInSpace().tree.dofs.size());
  return quantity.Value(at_rest, at_rest, axes);
}

TEST(Heading, IsTheAngleByWhichAnAxisIsTurnedAboutADirectionByTheRightHand) {
  const SpaceQuantity of_x = HeadingOf({2, 0, 0}, {0, 0, 5});
  for (const double angle : {-3.1, -1.5, 0.0, 0.4, 2.0, 3.1}) {
    const SpaceMatrix turned = Spatial::RotationBy(SpaceVector::UnitZ(), angle).m;
    EXPECT_NEAR(At(of_x, turned), angle, 1e-14);
    // Tilting the axis up does not turn it.
    const SpaceMatrix tilted = turned * Spatial::RotationBy(SpaceVector::UnitY(), -0.9).m;
    EXPECT_NEAR(At(of_x, tilted), angle, 1e-14);
    EXPECT_NEAR(At(HeadingOf({1, 0, 0}, {0, 0, -1}), turned), -angle, 1e-14);
    // About another direction: of y from x, and of z from y where the direction is x itself.
    const SpaceMatrix about_y = Spatial::RotationBy(SpaceVector::UnitY(), angle).m;
    EXPECT_NEAR(At(HeadingOf({1, 0, 0}, {0, 1, 0}), about_y), angle, 1e-14);
    const SpaceMatrix about_x = Spatial::RotationBy(SpaceVector::UnitX(), angle).m;
    EXPECT_NEAR(At(HeadingOf({0, 1, 0}, {1, 0, 0}), about_x), angle, 1e-14);
  }
  EXPECT_EQ(At(of_x, Spatial::RotationBy(SpaceVector::UnitZ(), kHalfTurn).m), kHalfTurn);
}

TEST(Heading, IsThatOfItsAnglesWhichIsNearestToATarget) {
  const SpaceQuantity heading = HeadingOf({1, 0, 0}, {0, 0, 1});
  EXPECT_NEAR(heading.Near(3, -3), 2 * kHalfTurn - 3, 1e-14);
  EXPECT_NEAR(heading.Near(-3, 3), 3 - 2 * kHalfTurn, 1e-14);
  EXPECT_NEAR(heading.Near(14, 1.5), 1.5 + 4 * kHalfTurn, 1e-14);
  EXPECT_EQ(heading.Near(0.5, 0.3), 0.3);
  for (const double target : {-5.0, -0.1, 0.0, 2.2, 4.7}) {
    for (double value = -3.1; value < 3.2; value += 0.1) {
      const double off = heading.Near(target, value) - target;
      EXPECT_GT(off, -kHalfTurn - 1e-12);
      EXPECT_LE(off, kHalfTurn + 1e-12);
      EXPECT_NEAR(std::remainder(off - (value - target), 2 * kHalfTurn), 0, 1e-12);
    }
  }
  // Nothing else goes round.
  const SpaceQuantity place =
      QuantityOfLink(TumblerInSpace(), Of::kPosition, RootLink(), {}, {1, 0, 0});
  EXPECT_EQ(place.Near(3, -3), -3);
}

TEST(Heading, IsANumberAndHasFiniteSlopesWhereTheAxisIsAlongTheDirectionAndIsNotDefinedThere) {
  const std::size_t dofs = TumblerInSpace().tree.dofs.size();
  const std::vector<double> at_rest(dofs);
  const SpaceQuantity heading = HeadingOf({1, 0, 0}, {0, 0, 1});
  for (const double off : {0.0, 1e-12, 1e-7, 1e-3, 0.015}) {
    const SpaceMatrix axes = Spatial::RotationBy(SpaceVector::UnitY(), off - kHalfTurn / 2).m;
    EXPECT_TRUE(std::isfinite(At(heading, axes))) << off;
    EXPECT_FALSE(heading.IsDefined(at_rest, axes)) << off;
    std::vector<double> by_q(dofs), by_qd(dofs);
    heading.AddSlopes(1, at_rest, at_rest, axes, by_q, by_qd);
    for (const double slope : by_q) EXPECT_LT(std::abs(slope), 1e10) << off;
  }
  EXPECT_TRUE(heading.IsDefined(at_rest,
                                Spatial::RotationBy(SpaceVector::UnitY(), 0.03 - kHalfTurn / 2).m));
  PurposeTarget target{PurposeTarget::Of::kHeading};
  target.link = RootLink();
  target.in_space = {1, 0, 0};
  target.along = {0, 0, 1};
  const PurposeGauge gauge(target, TumblerInSpace());
  const SpaceMatrix up = Spatial::RotationBy(SpaceVector::UnitY(), -kHalfTurn / 2).m;
  EXPECT_TRUE(std::isnan(gauge.At(at_rest, at_rest, up)));
  JudgedTarget judged{target, {}};
  judged.Judge(gauge.At(at_rest, at_rest, up));
  EXPECT_FALSE(judged.met());
  EXPECT_THAT(judged.Verdict(), HasSubstr("not judged, the axis points along the direction"));
  judged.Judge(0.01);
  EXPECT_TRUE(judged.obstacle.empty());
  EXPECT_EQ(judged.result, 0.01);
}

TEST(SpaceQuantity, OfEveryKindHasTheSlopesOfItsDifferences) {
  std::mt19937_64 random(11);
  const auto draw = [&random] {
    return static_cast<double>(random() >> 11) * 0x1p-52 - 1;  // in [-1, 1)
  };
  const std::size_t dofs = TumblerInSpace().tree.dofs.size();
  for (const Of of :
       {Of::kPosition, Of::kVelocity, Of::kAngularVelocity, Of::kMisalignment, Of::kHeading}) {
    for (int i = 0; i < 20; ++i) {
      const SpaceQuantity quantity = QuantityOfLink(
          TumblerInSpace(), of, "leg2_link", {draw(), draw(), draw()}, {draw(), draw(), draw()});
      const SpaceMatrix axes = Spatial::RotationBy(SpaceVector::UnitX(), 3 * draw()).m *
                               Spatial::RotationBy(SpaceVector::UnitZ(), 3 * draw()).m;
      std::vector<double> q(dofs), qd(dofs), by_q(dofs), by_qd(dofs);
      for (std::size_t k = 0; k < dofs; ++k) q[k] = draw(), qd[k] = draw();
      if (!quantity.IsDefined(q, axes)) continue;
      quantity.AddSlopes(2, q, qd, axes, by_q, by_qd);
      for (std::size_t k = 0; k < dofs; ++k) {
        const auto difference = [&](std::vector<double>& moved) {
          constexpr double h = 1e-6;
          const double at = moved[k];
          moved[k] = at + h;
          const double plus = quantity.Value(q, qd, axes);
          moved[k] = at - h;
          const double minus = quantity.Value(q, qd, axes);
          moved[k] = at;
          return (quantity.Near(minus, plus) - minus) / h;
        };
        const double scale = 1 + std::abs(by_q[k]);
        EXPECT_NEAR(difference(q), by_q[k], 1e-7 * scale * scale) << static_cast<int>(of);
        EXPECT_NEAR(difference(qd), by_qd[k], 1e-7) << static_cast<int>(of);
      }
    }
  }
}

/// A robot that starts turned by 2.5 rad about the vertical and is asked for a heading.
std::string Turning(const std::string& cost) {
  return R"(format = "tumbler-task"
version = 1
name = "turning"
robot = "tumbler.urdf"
root = "floating"
duration_s = 0.6
settle_s = 0.4
obstacle = []
[start]
z_m = 1.0
quaternion = [0.3153223623952687, 0.0, 0.0, 0.9489846193555862]
joints_rad = { leg1 = -1.5, leg2 = 1.5 }
[end]
joints_rad = { leg1 = -1.2, leg2 = 1.3 }
[[cost]]
of = "heading"
weight = 4.0
when = "end"
)" + cost;
}
Problem ProblemOfTurn(const std::string& cost) {
  return ParseTask(Turning(cost), "task.toml", testing::ShippedRobot(), "tumbler.urdf",
                   TaskSpaces::kPlaneAndSpace)
      .problem;
}
std::string MistakeInTurn(const std::string& cost) {
  try {
    ProblemOfTurn(cost);
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}
/// How the cost's first term sees the robot turned by this angle about the vertical.
struct Turned {
  explicit Turned(const Problem& problem, double angle)
      : axes(Spatial::RotationBy(SpaceVector::UnitZ(), angle).m), at_rest(problem.start_q.size()) {}
  [[nodiscard]] CostPoint point() const { return {at_rest, at_rest, {}, &axes}; }
  SpaceMatrix axes;
  std::vector<double> at_rest;
};

constexpr const char* kForward = "axis = [1.0, 0.0, 0.0]\nalong = [0.0, 0.0, 1.0]\n";

TEST(HeadingOfATask, FromTheStartIsATurnToTheLeftWhateverTheHeadingWas) {
  const Problem problem = ProblemOfTurn(
      std::string(kForward) + "term = \"terminal\"\nfrom_start = true\ntarget = 1.5708\n");
  const CostTerm& term = problem.cost.at(0);
  EXPECT_EQ(term.of(), PurposeTarget::Of::kHeading);
  EXPECT_EQ(term.tolerance, CostTerm::kAngleTolerance_rad);
  EXPECT_NEAR(term.target, 2.5 + 1.5708, 1e-12);
  const Turned there(problem, 2.5 + 1.5708 + 0.01), back(problem, 2.5 - 1.0);
  EXPECT_NEAR(term.Residual(there.point()), 2 * 0.01, 1e-12);
  EXPECT_NEAR(term.Result(there.point()), term.target + 0.01, 1e-12);
  EXPECT_NEAR(term.Residual(back.point()), -2 * 2.5708, 1e-12);
}

TEST(HeadingOfATask, AsALinearTermGrowsUpToHalfATurnFromTheStart) {
  const Problem problem = ProblemOfTurn(std::string(kForward) + "term = \"terminal-linear\"\n");
  const CostTerm& term = problem.cost.at(0);
  for (const double by : {-3.1, -1.0, 0.0, 0.7, 3.1}) {
    const Turned turned(problem, 2.5 + by);
    EXPECT_NEAR(term.Accumulate(0, 1, turned.point()), by, 1e-12);
  }
}

TEST(HeadingOfATask, IsRefusedWhereNoMotionCouldBeJudgedByIt) {
  const std::string square = "term = \"terminal\"\n";
  EXPECT_THAT(MistakeInTurn(square + kForward + "target = 6.3\n"),
              HasSubstr("is 6.3 rad of a heading, of which angles that are whole turns apart are "
                        "the same; allowed: -3.15 to 3.15"));
  EXPECT_THAT(MistakeInTurn(square + kForward + "tolerance = 3.2\n"),
              HasSubstr("which no heading misses; allowed: below pi"));
  EXPECT_THAT(MistakeInTurn(square + "along = [0.0, 0.0, 1.0]\n"), HasSubstr("axis"));
  EXPECT_THAT(MistakeInTurn(square + "along = [0.0, 0.0, 1.0]\naxis = [0.0, 0.0, 0.0]\n"),
              HasSubstr("axis: has no direction"));
  const std::string upward = "axis = [0.0, 0.0, 1.0]\nalong = [0.0, 0.0, 1.0]\n";
  EXPECT_THAT(MistakeInTurn(square + upward + "from_start = true\n"),
              HasSubstr("axis: points along `along` where the robot starts"));
  EXPECT_EQ(MistakeInTurn(square + upward), "");
  const std::string again = "[[cost]]\nterm = \"terminal\"\nof = \"heading\"\nweight = 1.0\n";
  EXPECT_THAT(
      MistakeInTurn(square + kForward + "target = 3.1\n" + again + kForward + "target = 1.0\n"),
      HasSubstr("no motion is within the tolerances of both"));
  EXPECT_EQ(
      MistakeInTurn(square + kForward + "target = 3.14\n" + again + kForward + "target = -3.14\n"),
      "");
}

}  // namespace
}  // namespace tumbler
