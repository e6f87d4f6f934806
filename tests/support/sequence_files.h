#pragma once

#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_limits.h"
#include "common/files/sequence_toml.h"
#include "tests/support/files.h"
#include "tests/support/primitive_file.h"

namespace tumbler::testing {

/// A random motion of two joints between given ends at rest. Its root ends where the next motion
/// begins.
inline PrimitiveFile MotionBetween(const std::string& name, std::array<double, 2> start,
                                   std::array<double, 2> end, double start_pitch_rad,
                                   double end_pitch_rad, unsigned seed) {
  PrimitiveFile file = RandomPrimitiveFile({}, seed);
  file.primitive.name = FixedString<48>(name);
  for (std::size_t j = 0; j < 2; ++j) {
    JointMotion<double>& motion = file.primitive.joints[j];
    const auto knots = motion.position.knots();
    std::vector<double> points(motion.position.control_points().begin(),
                               motion.position.control_points().end());
    for (std::size_t i = 0; i < 3; ++i) {
      points[i] = start[j];
      points[points.size() - 1 - i] = end[j];
    }
    if (motion.position.Assign(5, std::vector<double>(knots.begin(), knots.end()), points) !=
        Status::kOk) {
      throw std::logic_error("no spline");
    }
    motion.limits = {-3, 3, 60, 1500, 8};
    file.entry.joint_positions_rad[j] = start[j];
    file.exit.joint_positions_rad[j] = end[j];
  }
  file.entry.root_pitch_rad = start_pitch_rad;
  file.exit.root_pitch_rad = end_pitch_rad;
  file.entry.root_z_m = std::abs(std::sin(start_pitch_rad)) > 0.5 ? 0.36 : 0.21;
  file.exit.root_z_m = std::abs(std::sin(end_pitch_rad)) > 0.5 ? 0.36 : 0.21;
  return file;
}

/// Sets hashes and margins from the motions as they are now.
inline void Complete(PrimitiveFile& file) {
  const LimitMargins margins = MarginsOf(file.primitive);
  file.certificate.position_margin_rad = margins.position_rad;
  file.certificate.velocity_margin_rad_s = margins.velocity_rad_s;
  file.certificate.acceleration_margin_rad_s2 = margins.acceleration_rad_s2;
}

/// The primitives of a gait: `up` from (-1, 1) level to (0, 0) upright, `down` from there to (1,
/// -1) upside down, and `out` from upright to (2, 2).
inline std::vector<PrimitiveFile> GaitPrimitives() {
  constexpr double kPi = std::numbers::pi;
  return {MotionBetween("up", {-1, 1}, {0, 0}, 0, kPi / 2, 1),
          MotionBetween("down", {0, 0}, {1, -1}, kPi / 2, kPi, 2),
          MotionBetween("out", {0, 0}, {2, 2}, kPi / 2, kPi, 3)};
}

/// A gait of these primitives, with an end.
inline std::string GaitText() {
  return R"(format = "tumbler-sequence"
version = 1
name = "gait"
start = "up"

[primitives]
up = "up.toml"
down = "down.toml"
out = "out.toml"

[swap]
joints = [["joint1", "joint2"]]
root_pitch_rad = 3.141592653589793

[[node]]
name = "up"
primitive = "up"
safe = true
[[node]]
name = "down"
primitive = "down"
safe = true
ends_cycle = true
[[node]]
name = "up, swapped"
primitive = "up"
swapped = true
safe = true
[[node]]
name = "down, swapped"
primitive = "down"
swapped = true
safe = true
ends_cycle = true
[[node]]
name = "out"
primitive = "out"
safe = true

[[edge]]
from = "up"
to = "down"
settle_s = 1.5
[[edge]]
from = "down"
to = "up, swapped"
[[edge]]
from = "up, swapped"
to = "down, swapped"
[[edge]]
from = "down, swapped"
to = "up"
[[edge]]
from = "up"
to = "out"
when = "branch"
branch = "leave"
)";
}

/// A folder with a sequence and its primitives.
class SequenceFolder : public TemporaryFolder {
 public:
  explicit SequenceFolder(const std::string& text,
                          std::vector<PrimitiveFile> primitives = GaitPrimitives()) {
    WriteFile(file(), text);
    for (PrimitiveFile& primitive : primitives) {
      Complete(primitive);
      WriteFile(path() / (std::string(primitive.primitive.name.view()) + ".toml"),
                ToToml(primitive));
    }
  }
  [[nodiscard]] std::filesystem::path file() const { return path() / "gait.toml"; }
};

}  // namespace tumbler::testing
