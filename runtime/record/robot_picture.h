#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "runtime/record/foxglove_messages.h"

namespace tumbler {

/// A link of a robot for pictures, with what is fixed to it.
struct PictureLink {
  std::string name;
  /// Index of the link that carries it, which comes before it; -1: the root.
  int parent = -1;
  /// Index of the joint that moves it, in the order of a run's joints, after which those without a
  /// motor follow (`RobotPicture::passive`); -1: none that a run knows.
  int joint = -1;
  bool slides = false;             ///< Along the axis, in place of turning about it.
  std::array<double, 3> axis{};    ///< Unit vector, in the frames of both links.
  std::array<double, 3> offset{};  ///< Of this frame in the parent's at zero [m].
  std::vector<SceneSolid> shapes;  ///< Their colours are not used but for their opacity.
};

/// A robot and its ground, for pictures. At zero, the frames of all links have the axes of the
/// root's.
struct RobotPicture {
  bool fixed_root = false;           ///< Whether the root link stays at the world's origin.
  std::vector<std::string> passive;  ///< Names of the joints without a motor.
  std::vector<PictureLink> links;
  std::vector<SceneTriangles> ground;  ///< In the world. Empty: none is known.
};

/// Where a robot is.
struct PictureRoot {
  double x_m = 0, z_m = 0;
  double pitch_rad = 0;  ///< Turns +x towards +z. Of a robot in its plane.
  /// Of a robot in space, with the quaternion w, x, y, z.
  double y_m = 0;
  std::array<double, 4> quaternion{};
  [[nodiscard]] bool is_in_space() const { return quaternion != std::array<double, 4>{}; }
};

/// An instant of a run as it was planned.
struct PlannedInstant {
  std::int64_t time_ns = 0;  ///< On the clock of the loop.
  PictureRoot root;
  /// In the order of the run's joints, then those without a motor [rad, m].
  std::vector<double> joints;
};

}  // namespace tumbler
