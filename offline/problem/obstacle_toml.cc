#include "offline/problem/obstacle_toml.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/file_keys.h"

namespace tumbler {
namespace {

// For each kind of obstacle, its keys and the shape that they describe.

constexpr Range kPlace{-1e3, 1e3};
constexpr Range kSize{0, 1e3, true};
using Pair = std::array<double, 2>;  // x, z

Plane::Vector ToVector(const Pair& pair) { return {pair[0], pair[1]}; }

Plane::Vector ReadPlace(TomlTable& table, std::string_view key) {
  const auto numbers = table.Numbers(key, kPlace, 2);
  return {numbers[0], numbers[1]};
}

struct HalfSpace {
  Pair point{};
  Plane::Vector normal = Plane::Vector::Zero();
};

void ReadNormal(TomlTable& table, std::string_view key, HalfSpace& half_space) {
  half_space.normal = ReadPlace(table, key);
  if (half_space.normal.norm() < 1e-6) table.Fail(key, "has no direction; allowed: any but [0, 0]");
}

constexpr std::array kHalfSpaceKeys = {
    KeyOf<&HalfSpace::point>("point_m", kPlace, "x, z of a point of its surface").Required(),
    KeyReadBy<HalfSpace>("normal", ReadNormal, "out of it; made a unit vector")
        .Schema(
            R"({"type": "array", "items": {"type": "number", "minimum": -1000, "maximum": 1000}, "minItems": 2, "maxItems": 2})")
        .Required()
        .Allowed("-1000 to 1000, not both 0"),
};

Shape<Plane> ToShape(const HalfSpace& half_space) {
  return Shape<Plane>::HalfSpace(ToVector(half_space.point), half_space.normal);
}

struct Ball {
  Pair centre{};
  double radius_m = 0;
};

constexpr std::array kBallKeys = AllRequired(std::array{
    KeyOf<&Ball::centre>("centre_m", kPlace, "x, z"),
    KeyOf<&Ball::radius_m>("radius_m", kSize, ""),
});

Shape<Plane> ToShape(const Ball& ball) {
  return Shape<Plane>::Sphere(ToVector(ball.centre), ball.radius_m);
}

struct Capsule {
  Pair from{};
  Plane::Vector to = Plane::Vector::Zero();
  double radius_m = 0;
};

void ReadEnd(TomlTable& table, std::string_view key, Capsule& capsule) {
  capsule.to = ReadPlace(table, key);
  if ((capsule.to - ToVector(capsule.from)).norm() < 1e-6)
    table.Fail(key, "is the same point as from_m; use a cylinder");
}

constexpr std::array kCapsuleKeys = {
    KeyOf<&Capsule::from>("from_m", kPlace, "x, z of the centre of a round end").Required(),
    KeyReadBy<Capsule>("to_m", ReadEnd, "of the other")
        .Schema(
            R"({"type": "array", "items": {"type": "number", "minimum": -1000, "maximum": 1000}, "minItems": 2, "maxItems": 2})")
        .Required()
        .Allowed("-1000 to 1000, 1e-6 from `from_m` or more"),
    KeyOf<&Capsule::radius_m>("radius_m", kSize, "").Required(),
};

Shape<Plane> ToShape(const Capsule& capsule) {
  const Plane::Vector from = ToVector(capsule.from);
  const double length = (capsule.to - from).norm();
  const Plane::Vector along = (capsule.to - from) / length;
  return Shape<Plane>::Capsule((from + capsule.to) / 2, Plane::Rotation{along.x(), along.y()},
                               length / 2, capsule.radius_m);
}

struct Box {
  Pair centre{}, size{};
  double pitch_rad = 0;
};

constexpr std::array kBoxKeys = {
    KeyOf<&Box::centre>("centre_m", kPlace, "x, z").Required(),
    KeyOf<&Box::size>("size_m", kSize, "whole sides").Required(),
    KeyOf<&Box::pitch_rad>("pitch_rad", kPlace, "from +x towards +z"),
};

Shape<Plane> ToShape(const Box& box) {
  return Shape<Plane>::Box(ToVector(box.centre), Plane::RotationBy(1, box.pitch_rad),
                           {box.size[0] / 2, box.size[1] / 2});
}

template <class Kind, const auto& kKeys>
Shape<Plane> Read(TomlTable& table) {
  Kind obstacle;
  ReadKeys(table, kKeys, obstacle);
  return ToShape(obstacle);
}

template <class Kind, const auto& kKeys>
std::vector<KeyRow> Rows(std::string_view kind) {
  return RowsOf(kKeys, kind);
}

struct ObstacleKind {
  std::string_view name;
  Shape<Plane> (*read)(TomlTable&);
  std::vector<KeyRow> (*rows)(std::string_view kind);
};

template <class Kind, const auto& kKeys>
constexpr ObstacleKind KindOf(std::string_view name) {
  return {name, Read<Kind, kKeys>, Rows<Kind, kKeys>};
}

/// All kinds. The first is the default.
constexpr std::array kKinds = {
    KindOf<HalfSpace, kHalfSpaceKeys>("half-space"),
    KindOf<Ball, kBallKeys>("cylinder"),
    KindOf<Ball, kBallKeys>("sphere"),
    KindOf<Capsule, kCapsuleKeys>("capsule"),
    KindOf<Box, kBoxKeys>("box"),
};
constexpr auto kKindNames = [] {
  std::array<std::string_view, kKinds.size()> names;
  std::ranges::transform(kKinds, names.begin(), &ObstacleKind::name);
  return names;
}();

/// The values that every obstacle has.
struct Entry {
  std::string name;
  std::size_t kind = 0;  ///< Index of kKinds.
};

constexpr std::array kEntryKeys = {
    KeyOf<&Entry::name>("name", "").Required().Allowed("unique"),
    KeyOf<&Entry::kind>(
        "kind", kKindNames,
        "seen in the x-z plane: a cylinder lies along y, and a sphere is the same there"),
};

}  // namespace

Obstacle<Plane> ReadObstacle(TomlTable& table) {
  Entry entry;
  ReadKeys(table, kEntryKeys, entry);
  return {entry.name, kKinds[entry.kind].read(table)};
}

KeyTable ObstacleKeyTable() {
  std::vector<KeyRow> rows = RowsOf(kEntryKeys);
  for (const ObstacleKind& kind : kKinds) {
    for (const KeyRow& row : kind.rows(kind.name)) rows.push_back(row);
  }
  return {"offline/problem/obstacle_toml.cc", "obstacle", rows};
}

}  // namespace tumbler
