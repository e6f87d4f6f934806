#include "offline/problem/obstacle_toml.h"

#include <array>
#include <string>
#include <string_view>

namespace tumbler {

Obstacle<Plane> ReadObstacle(TomlTable& table) {
  Obstacle<Plane> obstacle;
  obstacle.name = table.String("name");
  constexpr std::array<std::string_view, 5> kKinds = {"half-space", "cylinder", "sphere", "capsule",
                                                      "box"};
  static constexpr Range kPlace{-1e3, 1e3};
  const std::string kind = table.Choice("kind", kKinds, "half-space");
  const auto point = [&table](std::string_view key) -> Plane::Vector {
    const auto numbers = table.Numbers(key, kPlace, 2);
    return {numbers[0], numbers[1]};
  };
  if (kind == "half-space") {
    const Plane::Vector on = point("point_m"), normal = point("normal");
    if (normal.norm() < 1e-6) table.Fail("normal", "has no direction; allowed: any but [0, 0]");
    obstacle.shape = Shape<Plane>::HalfSpace(on, normal);
  } else if (kind == "capsule") {
    const Plane::Vector from = point("from_m"), to = point("to_m");
    const double length = (to - from).norm();
    if (length < 1e-6) table.Fail("to_m", "is the same point as from_m; use a cylinder");
    const Plane::Vector along = (to - from) / length;
    obstacle.shape = Shape<Plane>::Capsule((from + to) / 2, Plane::Rotation{along.x(), along.y()},
                                           length / 2, table.Number("radius_m", {0, 1e3, true}));
  } else if (kind == "box") {
    const Plane::Vector centre = point("centre_m");
    const auto size = table.Numbers("size_m", {0, 1e3, true}, 2);
    const double pitch = table.Number("pitch_rad", kPlace, 0.0);
    obstacle.shape =
        Shape<Plane>::Box(centre, Plane::RotationBy(1, pitch), {size[0] / 2, size[1] / 2});
  } else {
    const Plane::Vector centre = point("centre_m");
    obstacle.shape = Shape<Plane>::Sphere(centre, table.Number("radius_m", {0, 1e3, true}));
  }
  return obstacle;
}

}  // namespace tumbler
