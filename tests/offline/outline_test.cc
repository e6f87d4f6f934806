// Compares the outlines of shapes, as pages draw them, with the shapes themselves.

#include "offline/model/outline.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "tests/support/random_shape.h"

namespace tumbler {
namespace {

/// Points of an outline: in the middle of each side and of each arc.
std::vector<Plane::Vector> PointsOf(const Outline& outline) {
  const std::size_t n = outline.corners.size();
  const auto out = [&](std::size_t k) -> Plane::Vector {
    const Plane::Vector along = outline.corners[(k + 1) % n] - outline.corners[k % n];
    return outline.radius_m * Plane::Vector(along.y(), -along.x()).normalized();
  };
  std::vector<Plane::Vector> points;
  for (std::size_t k = 0; k < n; ++k) {
    const Plane::Vector& corner = outline.corners[k];
    if (n == 1) {
      points.push_back(corner + Plane::Vector(0, outline.radius_m));
      continue;
    }
    const Plane::Vector before = out(k + n - 1), after = out(k);
    const double turn = std::atan2(Plane::Moment(before, after), before.dot(after));
    points.push_back(corner + Plane::RotationBy(1, 0.5 * std::abs(turn)) * before);
    points.push_back((corner + outline.corners[(k + 1) % n]) / 2 + after);
  }
  return points;
}

TEST(Outline, LiesOnTheSurfaceOfEveryShape) {
  constexpr std::array kKinds = {ShapeKind::kSphere, ShapeKind::kCapsule, ShapeKind::kBox};
  std::mt19937_64 random(71);
  for (std::size_t i = 0; i < 300; ++i) {
    const Shape<Plane> shape = RandomShape<Plane>(random, kKinds[i % 3], i % 2 == 0);
    const Outline outline = OutlineOf(shape);
    EXPECT_EQ(outline.corners.size(), std::size_t{1} << (i % 3));
    for (const Plane::Vector& point : PointsOf(outline))
      EXPECT_NEAR(FindNearPoint(shape, point, 0.0).d, 0, 1e-14);
  }
}

TEST(Outline, OfAHalfSpaceEndsFarFromItsPoint) {
  const Shape<Plane> slope = Shape<Plane>::HalfSpace({1, 2}, {-3, 4});
  const Outline outline = OutlineOf(slope);
  ASSERT_EQ(outline.corners.size(), 4U);
  int on_surface = 0;
  for (const Plane::Vector& corner : outline.corners) {
    const double d = FindNearPoint(slope, corner, 0.0).d;
    EXPECT_LT(d, 1e-9);
    if (d > -1e-9) ++on_surface;
    EXPECT_GE((corner - slope.centre).norm(), 1000 - 1e-9);
  }
  EXPECT_EQ(on_surface, 2);
}

TEST(Outline, OnlyGroundThatIsLevelHasAHeight) {
  EXPECT_EQ(LevelHeight(Shape<Plane>::HalfSpace({5, 0.25}, {0, 2})), 0.25);
  EXPECT_EQ(LevelHeight(Shape<Plane>::HalfSpace({5, 0.25}, {0.1, 1})), std::nullopt);
  EXPECT_EQ(LevelHeight(Shape<Plane>::HalfSpace({5, 0.25}, {0, -1})), std::nullopt);
  EXPECT_EQ(LevelHeight(Shape<Plane>::Box({0, 0}, {}, {1, 1})), std::nullopt);
}

}  // namespace
}  // namespace tumbler
