#pragma once

#include <string>

#include "offline/model/shape.h"

namespace tumbler {

/// Something at rest in the world that the robot can touch.
template <class Space>
struct Obstacle {
  std::string name;
  Shape<Space> shape;  ///< In the world. In the plane, a sphere stands for a cylinder along y.

  bool operator==(const Obstacle&) const = default;
};

}  // namespace tumbler
