// Keys of obstacles. bad_input_test.cc has the messages about wrong ones.

#include "offline/problem/obstacle_toml.h"

#include <gtest/gtest.h>

#include <string>

#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

Shape<Plane> ShapeOf(const std::string& keys) {
  TomlTable table = TomlTable::Parse("name = \"rock\"\n" + keys, "task.toml");
  const Obstacle<Plane> obstacle = ReadObstacle(table);
  EXPECT_EQ(obstacle.name, "rock");
  table.RejectUnknownKeys();
  return obstacle.shape;
}

TEST(ObstacleToml, EveryKindIsTheShapeThatItSays) {
  EXPECT_EQ(ShapeOf("point_m = [1, 2]\nnormal = [0, 3]"), Shape<Plane>::HalfSpace({1, 2}, {0, 1}));
  EXPECT_EQ(ShapeOf("kind = \"cylinder\"\ncentre_m = [1, 2]\nradius_m = 0.5"),
            Shape<Plane>::Sphere({1, 2}, 0.5));
  EXPECT_EQ(ShapeOf("kind = \"sphere\"\ncentre_m = [1, 2]\nradius_m = 0.5"),
            Shape<Plane>::Sphere({1, 2}, 0.5));
  EXPECT_EQ(ShapeOf("kind = \"capsule\"\nfrom_m = [1, 2]\nto_m = [1, 4]\nradius_m = 0.5"),
            Shape<Plane>::Capsule({1, 3}, {0, 1}, 1, 0.5));
  EXPECT_EQ(ShapeOf("kind = \"box\"\ncentre_m = [1, 2]\nsize_m = [0.5, 4]"),
            Shape<Plane>::Box({1, 2}, {}, {0.25, 2}));
  EXPECT_EQ(ShapeOf("kind = \"box\"\ncentre_m = [1, 2]\nsize_m = [0.5, 4]\npitch_rad = 0.5"),
            Shape<Plane>::Box({1, 2}, Plane::RotationBy(1, 0.5), {0.25, 2}));
}

}  // namespace
}  // namespace tumbler
