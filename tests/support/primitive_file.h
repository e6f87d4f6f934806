#pragma once

#include <random>
#include <vector>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_limits.h"
#include "common/files/primitive_toml.h"
#include "tests/support/motions.h"

namespace tumbler::testing {

/// The control points of its paths without the three at either end, which rest at a start and an
/// end fixes: the optimiser's parameters, joint after joint.
inline std::vector<double> FreeControlPoints(const Primitive<double>& primitive) {
  std::vector<double> free;
  for (const JointMotion<double>& motion : primitive.motions()) {
    const auto points = motion.position.control_points();
    free.insert(free.end(), points.begin() + 3, points.end() - 3);
  }
  return free;
}

/// Writes into a file how far its motion stays within its limits.
inline void SetMargins(PrimitiveFile& file) {
  const LimitMargins margins = MarginsOf(file.primitive);
  file.certificate.position_margin_rad = margins.position_rad;
  file.certificate.velocity_margin_rad_s = margins.velocity_rad_s;
  file.certificate.acceleration_margin_rad_s2 = margins.acceleration_rad_s2;
}

/// A primitive file around a random motion, complete enough to be written and loaded. It holds no
/// robot, so it cannot be simulated.
inline PrimitiveFile RandomPrimitiveFile(const MotionShape& shape, unsigned seed) {
  std::mt19937 random(seed);
  PrimitiveFile file;
  file.primitive = RandomPrimitive<double>(shape, random);
  for (const auto& motion : file.primitive.motions()) {
    file.entry.joint_positions_rad.push_back(motion.position.control_points().front());
    file.exit.joint_positions_rad.push_back(motion.position.control_points().back());
  }
  SetMargins(file);
  file.provenance.tool = "test 1.0";
  file.provenance.robot_file = "robot.urdf";
  file.provenance.task_file = "task.toml";
  file.provenance.robot_urdf = "<robot name='none'/>\n";
  file.provenance.task_toml = "version = 1\n";
  file.provenance.robot_hash = HashOfText(file.provenance.robot_urdf);
  file.provenance.task_hash = HashOfText(file.provenance.task_toml);
  return file;
}

}  // namespace tumbler::testing
