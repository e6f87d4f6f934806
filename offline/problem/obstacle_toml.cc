#include "offline/problem/obstacle_toml.h"

#include <array>
#include <string>
#include <string_view>

#include "common/file_keys.h"

namespace tumbler {
namespace {

/// An `[[obstacle]]` as the file has it.
struct ObstacleEntry {
  enum class Kind { kHalfSpace, kCylinder, kSphere, kCapsule, kBox };
  using Pair = std::array<double, 2>;  ///< x, z

  std::string name;
  Kind kind = Kind::kHalfSpace;
  Pair point_m{}, normal{};
  Pair centre_m{}, size_m{};
  double pitch_rad = 0;
  Pair from_m{}, to_m{};
  double radius_m = 0;
};
using Kind = ObstacleEntry::Kind;

bool IsHalfSpace(const ObstacleEntry& obstacle) { return obstacle.kind == Kind::kHalfSpace; }
bool IsCapsule(const ObstacleEntry& obstacle) { return obstacle.kind == Kind::kCapsule; }
bool IsBox(const ObstacleEntry& obstacle) { return obstacle.kind == Kind::kBox; }
bool IsRound(const ObstacleEntry& obstacle) { return !IsHalfSpace(obstacle) && !IsBox(obstacle); }
bool HasCentre(const ObstacleEntry& obstacle) {
  return !IsHalfSpace(obstacle) && !IsCapsule(obstacle);
}

constexpr Range kPlace{-1e3, 1e3};
constexpr Range kSize{0, 1e3, true};
constexpr const char* kOfHalfSpace = "required for a half-space";
constexpr const char* kOfCapsule = "required for a capsule";
constexpr const char* kPair = "two numbers, -1000 to 1000";
constexpr const char* kEnds = "two numbers each, -1000 to 1000, 1e-6 apart or more";
constexpr std::array<std::string_view, 5> kKinds = {"half-space", "cylinder", "sphere", "capsule",
                                                    "box"};
constexpr std::array kObstacleKeys = {
    KeyOf<&ObstacleEntry::name>("name", "").Required().Allowed("unique"),
    KeyOf<&ObstacleEntry::kind>(
        "kind", kKinds,
        "seen in the x-z plane: a cylinder lies along y, and a sphere is the same there"),
    KeyOf<&ObstacleEntry::point_m>("point_m", kPlace, "of its surface")
        .Required()
        .Default(kOfHalfSpace)
        .Allowed(kPair)
        .Where(IsHalfSpace),
    KeyOf<&ObstacleEntry::normal>("normal", kPlace, "out of it; made a unit vector")
        .Required()
        .Default(kOfHalfSpace)
        .Allowed("two numbers, -1000 to 1000, not both 0")
        .Where(IsHalfSpace),
    KeyOf<&ObstacleEntry::centre_m>("centre_m", kPlace, "")
        .Required()
        .Default("required for a cylinder, sphere and box")
        .Allowed(kPair)
        .Where(HasCentre),
    KeyOf<&ObstacleEntry::size_m>("size_m", kSize, "whole sides")
        .Required()
        .Default("required for a box")
        .Allowed("two numbers above 0, to 1000")
        .Where(IsBox),
    KeyOf<&ObstacleEntry::pitch_rad>("pitch_rad", kPlace, "of a box, from +x towards +z")
        .Where(IsBox),
    KeyOf<&ObstacleEntry::from_m>("from_m", kPlace, "centres of its round ends")
        .Required()
        .Default(kOfCapsule)
        .Allowed(kEnds)
        .Where(IsCapsule),
    KeyOf<&ObstacleEntry::to_m>("to_m", kPlace, "centres of its round ends")
        .Required()
        .Default(kOfCapsule)
        .Allowed(kEnds)
        .Where(IsCapsule),
    KeyOf<&ObstacleEntry::radius_m>("radius_m", kSize, "")
        .Required()
        .Default("required for a cylinder, sphere and capsule")
        .Where(IsRound),
};

Plane::Vector Vector(const ObstacleEntry::Pair& pair) { return {pair[0], pair[1]}; }

}  // namespace

Obstacle<Plane> ReadObstacle(TomlTable& table) {
  ObstacleEntry entry;
  ReadKeys(table, kObstacleKeys, entry);
  Obstacle<Plane> obstacle;
  obstacle.name = entry.name;
  switch (entry.kind) {
    case Kind::kHalfSpace: {
      const Plane::Vector normal = Vector(entry.normal);
      if (normal.norm() < 1e-6) table.Fail("normal", "has no direction; allowed: any but [0, 0]");
      obstacle.shape = Shape<Plane>::HalfSpace(Vector(entry.point_m), normal);
      break;
    }
    case Kind::kCapsule: {
      const Plane::Vector from = Vector(entry.from_m), to = Vector(entry.to_m);
      const double length = (to - from).norm();
      if (length < 1e-6) table.Fail("to_m", "is the same point as from_m; use a cylinder");
      const Plane::Vector along = (to - from) / length;
      obstacle.shape = Shape<Plane>::Capsule((from + to) / 2, Plane::Rotation{along.x(), along.y()},
                                             length / 2, entry.radius_m);
      break;
    }
    case Kind::kBox:
      obstacle.shape =
          Shape<Plane>::Box(Vector(entry.centre_m), Plane::RotationBy(1, entry.pitch_rad),
                            {entry.size_m[0] / 2, entry.size_m[1] / 2});
      break;
    case Kind::kCylinder:
    case Kind::kSphere:
      obstacle.shape = Shape<Plane>::Sphere(Vector(entry.centre_m), entry.radius_m);
      break;
  }
  return obstacle;
}

KeyTable ObstacleKeyTable() {
  return {"offline/problem/obstacle_toml.cc", "obstacle", RowsOf(kObstacleKeys)};
}

}  // namespace tumbler
