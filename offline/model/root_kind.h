#pragma once

namespace tumbler {

/// How the file's root link is held. Coordinates of the root are those of its frame in the world.
enum class RootKind {
  kPlanarXz,  ///< Free in the world's x-z plane: x [m], z [m], pitch [rad] about -y.
  kFixed,     ///< To the world.
  /// Hung from a bar along y through its frame's origin, about which it turns freely: the
  /// coordinates of `kPlanarXz`, of which x and z are prescribed and stay where they are.
  kHingeY,
  /// Free in space: x, y, z [m], then pitch about -y, roll about the turned x, and yaw about the
  /// axis z that both have turned [rad]. With y, roll and yaw at zero these are the coordinates of
  /// `kPlanarXz`, and a tumble through any pitch is regular. At roll = +-pi/2 yaw turns about the
  /// axis of pitch, and the coordinates are singular.
  kFloating,
};

}  // namespace tumbler
