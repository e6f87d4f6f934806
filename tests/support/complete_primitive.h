#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_limits.h"
#include "common/files/primitive_toml.h"

namespace tumbler::testing {

using MotionSpline = JointMotion<double>::Spline;

inline MotionSpline MakeSpline(int degree, const std::vector<double>& interior_knots,
                               double duration, const std::vector<double>& points) {
  std::vector<double> knots(static_cast<std::size_t>(degree) + 1, 0.0);
  knots.insert(knots.end(), interior_knots.begin(), interior_knots.end());
  knots.insert(knots.end(), static_cast<std::size_t>(degree) + 1, duration);
  MotionSpline spline;
  EXPECT_EQ(spline.Assign(degree, knots, points), Status::kOk);
  return spline;
}

/// Sets everything in the file that follows from the motions.
inline void CompletePrimitive(PrimitiveFile& file) {
  file.entry.joint_positions_rad.clear();
  file.exit.joint_positions_rad.clear();
  for (const auto& motion : file.primitive.motions()) {
    file.entry.joint_positions_rad.push_back(motion.position.control_points().front());
    file.exit.joint_positions_rad.push_back(motion.position.control_points().back());
  }
  const LimitMargins margins = MarginsOf(file.primitive);
  file.certificate.position_margin_rad = margins.position_rad;
  file.certificate.velocity_margin_rad_s = margins.velocity_rad_s;
  file.certificate.acceleration_margin_rad_s2 = margins.acceleration_rad_s2;
  file.provenance.robot_hash = HashOfText(file.provenance.robot_urdf);
  file.provenance.task_hash = HashOfText(file.provenance.task_toml);
}

/// A primitive of two joints with numbers that are easy to find in the text.
inline PrimitiveFile PrimitiveExample() {
  PrimitiveFile file;
  Primitive<double>& primitive = file.primitive;
  primitive.name = FixedString<48>("wave");
  primitive.duration_s = 1.25;
  primitive.settle_s = 0.375;
  primitive.entry_tolerance_rad = 0.0625;
  primitive.following_tolerance_rad = 0.5;
  primitive.joint_count = 2;
  auto& left = primitive.joints[0];
  left.name = FixedString<32>("left");
  left.position =
      MakeSpline(5, {0.5, 0.75}, 1.25, {0.125, 0.125, 0.125, 0.3125, 0.25, 0.25, 0.25, 0.25});
  left.torque = MakeSpline(1, {0.625}, 1.25, {0.0, 1.5, -0.75});
  left.limits = {-1.0, 1.0, 10.0, 100.0, 2.0};
  auto& right = primitive.joints[1];
  right.name = FixedString<32>("right");
  right.position = MakeSpline(3, {0.625}, 1.25, {-0.5, -0.5, -0.4375, -0.5, -0.5});
  right.torque = MakeSpline(0, {}, 1.25, {0.375});
  right.limits = {-2.0, 2.0, 12.0, 120.0, 3.0};
  file.entry.root_z_m = 0.15;
  file.exit.root_pitch_rad = 1.5;
  file.contacts = {{"leg2/0", "ground", 0.0, 1.25, 31.5}, {"leg1/1", "ground", 0.0, 0.4375, 12.0}};
  file.purpose = {{{PurposeTarget::Of::kX, PurposeTarget::When::kEnd, 0.25, 0.03125}, 0.26},
                  {{PurposeTarget::Of::kSpeed, PurposeTarget::When::kLater, 0.0, 0.1}, 0.01},
                  {{PurposeTarget::Of::kPitch, PurposeTarget::When::kTime, 1.0, 0.05, 0.875}, 1.01},
                  {{PurposeTarget::Of::kPointZRate,
                    PurposeTarget::When::kSettled,
                    0.5,
                    0.1,
                    0,
                    "leg1_link",
                    {0.1875, -0.25}},
                   0.45}};
  file.certificate.peak_torque_nm = 1.5;
  file.certificate.settled_pitch_error_rad = -0.001;
  file.provenance.tool = "test 1.0";
  file.provenance.seed = 42;
  file.provenance.objective = 0.21;
  file.provenance.evaluations = 1234;
  file.provenance.robot_file = "robot.urdf";
  file.provenance.task_file = "task.toml";
  file.provenance.robot_urdf = "<robot name=\"r\">\n\t<link name='a'/>\n</robot>\n";
  file.provenance.task_toml = "[contact]\nstiffness = 1e4\n";
  CompletePrimitive(file);
  return file;
}

}  // namespace tumbler::testing
