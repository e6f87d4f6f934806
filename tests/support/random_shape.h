#pragma once

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <type_traits>

#include "offline/model/shape.h"
#include "tests/support/random_robot.h"

namespace tumbler {

/// What tests of both algebras are made for, and how they are called there.
using Spaces = ::testing::Types<Plane, Spatial>;
struct NameOfSpace {
  template <class Space>
  static std::string GetName(int /*index*/) {
    return std::is_same_v<Space, Plane> ? "Plane" : "Space";
  }
};

template <class Space>
typename Space::Vector RandomPoint(std::mt19937_64& random, double size) {
  typename Space::Vector v;
  for (int i = 0; i < Shape<Space>::kDimension; ++i) v[i] = Uniform(random, -size, size);
  return v;
}

template <class Space>
typename Space::Rotation RandomRotation(std::mt19937_64& random) {
  const double angle = Uniform(random, -3.2, 3.2);
  if constexpr (std::is_same_v<Space, Plane>) {
    return Plane::RotationBy(1, angle);
  } else {
    return Spatial::RotationBy(RandomDirection(random), angle);
  }
}

/// A shape of this kind with sizes from 20 to 120 mm, turned at random. A rounded box is a box with
/// a radius.
template <class Space>
Shape<Space> RandomShape(std::mt19937_64& random, ShapeKind kind, bool rounded = false) {
  const auto centre = RandomPoint<Space>(random, 0.05);
  const auto size = [&random] { return Uniform(random, 0.02, 0.12); };
  Shape<Space> shape;
  switch (kind) {
    case ShapeKind::kHalfSpace:
      return Shape<Space>::HalfSpace(centre, RandomPoint<Space>(random, 1));
    case ShapeKind::kSphere:
      return Shape<Space>::Sphere(centre, size());
    case ShapeKind::kCapsule:
      return Shape<Space>::Capsule(centre, RandomRotation<Space>(random), size(), size());
    case ShapeKind::kBox:
      shape =
          Shape<Space>::Box(centre, RandomRotation<Space>(random), RandomPoint<Space>(random, 1));
      for (int i = 0; i < Shape<Space>::kDimension; ++i) shape.half_extents[i] = size();
      if (rounded) shape.radius_m = size();
  }
  return shape;
}

}  // namespace tumbler
