#pragma once

#include <string>

#include "offline/model/shape.h"

namespace tumbler {

/// A shape fixed to a body of the robot.
template <class Space>
struct ContactShape {
  std::string name;    ///< `LINK/INDEX`
  int body = 0;        ///< Index of the degree of freedom that moves it.
  Shape<Space> shape;  ///< In the body's frame; no half-space.
};

/// Two shapes of the robot, on different bodies, that can touch each other.
struct ContactPair {
  int a = 0, b = 0;  ///< Indices of shapes.
};

}  // namespace tumbler
