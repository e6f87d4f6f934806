#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/record/proto_message.h"

namespace tumbler {

/// The files of google.protobuf.Timestamp and Duration.
[[nodiscard]] std::vector<ProtoFile> WellKnownFiles();
/// Foxglove's own types of messages, as far as they are used here: FrameTransforms, SceneUpdate and
/// Log, with all that they contain. The files come in the order of their imports.
[[nodiscard]] std::vector<ProtoFile> FoxgloveFiles();

/// Appends a google.protobuf.Timestamp.
/// @param time_ns  since 1970, or since the start of a run in virtual time.
void AppendTime(ProtoWriter& out, int number, std::uint64_t time_ns);

/// A place and an attitude in the frame of something else.
struct FramePose {
  std::array<double, 3> position_m{};
  std::array<double, 4> rotation{0, 0, 0, 1};  ///< Unit quaternion x, y, z, w.
};

/// The rotation by an angle about an axis, a unit vector.
[[nodiscard]] std::array<double, 4> QuaternionAbout(const std::array<double, 3>& axis,
                                                    double angle_rad);

/// Where a frame is in its parent's.
struct FrameTransform {
  std::string parent;
  std::string child;
  FramePose pose;
};

/// A message foxglove.FrameTransforms.
[[nodiscard]] std::string EncodeTransforms(std::uint64_t time_ns,
                                           const std::vector<FrameTransform>& transforms);

/// The level of a message foxglove.Log.
enum class LogLevel : std::uint8_t { kInfo = 2, kWarning = 3, kError = 4 };

/// A message foxglove.Log. @param name  of what speaks.
[[nodiscard]] std::string EncodeLog(std::uint64_t time_ns, LogLevel level, std::string_view text,
                                    std::string_view name);

/// Red, green, blue and opacity, each 0 ... 1.
using SceneColor = std::array<double, 4>;

/// A solid that is drawn in a frame.
struct SceneSolid {
  enum class Kind : std::uint8_t { kBox, kSphere, kCylinder };
  Kind kind = Kind::kBox;
  FramePose pose;
  /// Along its own axes [m]; a cylinder's z is its length. Of a sphere, its diameter three times.
  std::array<double, 3> size_m{};
  SceneColor color{};
};

/// Triangles in a frame, three points each.
struct SceneTriangles {
  std::vector<std::array<double, 3>> points_m;
  SceneColor color{};
};

/// Something that is drawn in a frame and moves with it.
struct SceneEntity {
  std::string frame;
  std::string id;
  std::vector<SceneSolid> solids;
  std::vector<SceneTriangles> triangles;
};

/// A message foxglove.SceneUpdate, which adds entities for good.
[[nodiscard]] std::string EncodeScene(std::uint64_t time_ns,
                                      const std::vector<SceneEntity>& entities);

}  // namespace tumbler
