#include "runtime/record/foxglove_messages.h"

#include <cmath>
#include <utility>

#include "common/core/functions.h"

namespace tumbler {
namespace {

using enum ProtoKind;

const char* const kTimestamp = "google.protobuf.Timestamp";

ProtoField One(const char* name, ProtoKind kind) { return {name, kind}; }
ProtoField One(const char* name, const char* type) { return {name, kMessage, type}; }
ProtoField Many(const char* name, const char* type) { return {name, kMessage, type, true}; }

// The numbers of the fields that are written: their places in the types below.
constexpr int kX = 1, kY = 2, kZ = 3, kW = 4;
constexpr int kPosition = 1, kOrientation = 2;
constexpr int kTransforms = 1;
constexpr int kTransformTime = 1, kParent = 2, kChild = 3, kTranslation = 4, kRotation = 5;
constexpr int kLogTime = 1, kLogLevel = 2, kLogText = 3, kLogName = 4;
constexpr int kEntities = 2;
constexpr int kEntityTime = 1, kEntityFrame = 2, kEntityId = 3, kEntityLocked = 5;
constexpr int kEntityCubes = 8, kEntitySpheres = 9, kEntityCylinders = 10, kEntityTriangles = 12;
constexpr int kSolidPose = 1, kSolidSize = 2, kSolidColor = 3;
constexpr int kBottomScale = 3, kTopScale = 4, kCylinderColor = 5;
constexpr int kTrianglesPose = 1, kTrianglesPoints = 2, kTrianglesColor = 3;

std::vector<ProtoType> Geometry() {
  return {
      {"Vector3", {One("x", kDouble), One("y", kDouble), One("z", kDouble)}},
      {"Point3", {One("x", kDouble), One("y", kDouble), One("z", kDouble)}},
      {"Quaternion", {One("x", kDouble), One("y", kDouble), One("z", kDouble), One("w", kDouble)}},
      {"Pose", {One("position", "foxglove.Vector3"), One("orientation", "foxglove.Quaternion")}},
      {"Color", {One("r", kDouble), One("g", kDouble), One("b", kDouble), One("a", kDouble)}},
      {"KeyValuePair", {One("key", kString), One("value", kString)}},
      {"FrameTransform",
       {One("timestamp", kTimestamp), One("parent_frame_id", kString),
        One("child_frame_id", kString), One("translation", "foxglove.Vector3"),
        One("rotation", "foxglove.Quaternion")}},
      {"FrameTransforms", {Many("transforms", "foxglove.FrameTransform")}},
      {"Log",
       {One("timestamp", kTimestamp),
        {"level", kEnum, "foxglove.Log.Level"},
        One("message", kString),
        One("name", kString),
        One("file", kString),
        One("line", kFixed32)},
       {{"Level", {"UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"}}}},
  };
}

std::vector<ProtoType> SolidPrimitives() {
  return {
      {"ArrowPrimitive",
       {One("pose", "foxglove.Pose"), One("shaft_length", kDouble), One("shaft_diameter", kDouble),
        One("head_length", kDouble), One("head_diameter", kDouble),
        One("color", "foxglove.Color")}},
      {"CubePrimitive",
       {One("pose", "foxglove.Pose"), One("size", "foxglove.Vector3"),
        One("color", "foxglove.Color")}},
      {"SpherePrimitive",
       {One("pose", "foxglove.Pose"), One("size", "foxglove.Vector3"),
        One("color", "foxglove.Color")}},
      {"CylinderPrimitive",
       {One("pose", "foxglove.Pose"), One("size", "foxglove.Vector3"), One("bottom_scale", kDouble),
        One("top_scale", kDouble), One("color", "foxglove.Color")}},
  };
}

std::vector<ProtoType> OtherPrimitives() {
  return {
      {"LinePrimitive",
       {{"type", kEnum, "foxglove.LinePrimitive.Type"},
        One("pose", "foxglove.Pose"),
        One("thickness", kDouble),
        One("scale_invariant", kBool),
        Many("points", "foxglove.Point3"),
        One("color", "foxglove.Color"),
        Many("colors", "foxglove.Color"),
        {"indices", kFixed32, "", true}},
       {{"Type", {"LINE_STRIP", "LINE_LOOP", "LINE_LIST"}}}},
      {"TriangleListPrimitive",
       {One("pose", "foxglove.Pose"),
        Many("points", "foxglove.Point3"),
        One("color", "foxglove.Color"),
        Many("colors", "foxglove.Color"),
        {"indices", kFixed32, "", true}}},
      {"TextPrimitive",
       {One("pose", "foxglove.Pose"), One("billboard", kBool), One("font_size", kDouble),
        One("scale_invariant", kBool), One("color", "foxglove.Color"), One("text", kString)}},
      {"ModelPrimitive",
       {One("pose", "foxglove.Pose"), One("scale", "foxglove.Vector3"),
        One("color", "foxglove.Color"), One("override_color", kBool), One("url", kString),
        One("media_type", kString), One("data", kBytes)}},
  };
}

std::vector<ProtoType> Scenes() {
  return {
      {"SceneEntityDeletion",
       {One("timestamp", kTimestamp),
        {"type", kEnum, "foxglove.SceneEntityDeletion.Type"},
        One("id", kString)},
       {{"Type", {"MATCHING_ID", "ALL"}}}},
      {"SceneEntity",
       {One("timestamp", kTimestamp), One("frame_id", kString), One("id", kString),
        One("lifetime", "google.protobuf.Duration"), One("frame_locked", kBool),
        Many("metadata", "foxglove.KeyValuePair"), Many("arrows", "foxglove.ArrowPrimitive"),
        Many("cubes", "foxglove.CubePrimitive"), Many("spheres", "foxglove.SpherePrimitive"),
        Many("cylinders", "foxglove.CylinderPrimitive"), Many("lines", "foxglove.LinePrimitive"),
        Many("triangles", "foxglove.TriangleListPrimitive"),
        Many("texts", "foxglove.TextPrimitive"), Many("models", "foxglove.ModelPrimitive")}},
      {"SceneUpdate",
       {Many("deletions", "foxglove.SceneEntityDeletion"),
        Many("entities", "foxglove.SceneEntity")}},
  };
}

void AppendVector(ProtoWriter& out, int number, const std::array<double, 3>& vector) {
  out.Message(number, [&vector](ProtoWriter& w) {
    w.Double(kX, vector[0]);
    w.Double(kY, vector[1]);
    w.Double(kZ, vector[2]);
  });
}

/// A quaternion or a colour: they are written alike.
void AppendFour(ProtoWriter& out, int number, const std::array<double, 4>& four) {
  out.Message(number, [&four](ProtoWriter& w) {
    w.Double(kX, four[0]);
    w.Double(kY, four[1]);
    w.Double(kZ, four[2]);
    w.Double(kW, four[3]);
  });
}

void AppendPose(ProtoWriter& out, int number, const FramePose& pose) {
  out.Message(number, [&pose](ProtoWriter& w) {
    AppendVector(w, kPosition, pose.position_m);
    AppendFour(w, kOrientation, pose.rotation);
  });
}

void AppendSolid(ProtoWriter& out, const SceneSolid& solid) {
  const bool cylinder = solid.kind == SceneSolid::Kind::kCylinder;
  const int number = cylinder                                  ? kEntityCylinders
                     : solid.kind == SceneSolid::Kind::kSphere ? kEntitySpheres
                                                               : kEntityCubes;
  out.Message(number, [&](ProtoWriter& w) {
    AppendPose(w, kSolidPose, solid.pose);
    AppendVector(w, kSolidSize, solid.size_m);
    if (cylinder) {
      w.Double(kBottomScale, 1);
      w.Double(kTopScale, 1);
    }
    AppendFour(w, cylinder ? kCylinderColor : kSolidColor, solid.color);
  });
}

void AppendTriangles(ProtoWriter& out, const SceneTriangles& triangles) {
  out.Message(kEntityTriangles, [&triangles](ProtoWriter& w) {
    AppendPose(w, kTrianglesPose, {});
    for (const auto& point : triangles.points_m) AppendVector(w, kTrianglesPoints, point);
    AppendFour(w, kTrianglesColor, triangles.color);
  });
}

}  // namespace

std::vector<ProtoFile> WellKnownFiles() {
  const std::vector<ProtoField> fields{One("seconds", kInt64), One("nanos", kInt32)};
  return {{"google/protobuf/timestamp.proto", "google.protobuf", {}, {{"Timestamp", fields}}},
          {"google/protobuf/duration.proto", "google.protobuf", {}, {{"Duration", fields}}}};
}

std::vector<ProtoFile> FoxgloveFiles() {
  std::vector<ProtoFile> files = WellKnownFiles();
  std::vector<std::string> imports;
  imports.reserve(files.size());
  for (const ProtoFile& file : files) imports.push_back(file.name);
  std::vector<ProtoType> types;
  for (const auto& part : {Geometry(), SolidPrimitives(), OtherPrimitives(), Scenes()})
    types.insert(types.end(), part.begin(), part.end());
  files.push_back({"foxglove.proto", "foxglove", std::move(imports), std::move(types)});
  return files;
}

void AppendTime(ProtoWriter& out, int number, std::uint64_t time_ns) {
  constexpr std::uint64_t kSecond_ns = 1'000'000'000;
  out.Message(number, [time_ns](ProtoWriter& w) {
    w.Integer(1, static_cast<std::int64_t>(time_ns / kSecond_ns));
    w.Integer(2, static_cast<std::int64_t>(time_ns % kSecond_ns));
  });
}

std::array<double, 4> QuaternionAbout(const std::array<double, 3>& axis, double angle_rad) {
  const auto [s, c] = portable::SinCos(angle_rad / 2);
  return {axis[0] * s, axis[1] * s, axis[2] * s, c};
}

std::string EncodeTransforms(std::uint64_t time_ns, const std::vector<FrameTransform>& transforms) {
  std::string message;
  ProtoWriter out(message);
  for (const FrameTransform& transform : transforms) {
    out.Message(kTransforms, [&](ProtoWriter& w) {
      AppendTime(w, kTransformTime, time_ns);
      w.Bytes(kParent, transform.parent);
      w.Bytes(kChild, transform.child);
      AppendVector(w, kTranslation, transform.pose.position_m);
      AppendFour(w, kRotation, transform.pose.rotation);
    });
  }
  return message;
}

std::string EncodeLog(std::uint64_t time_ns, LogLevel level, std::string_view text,
                      std::string_view name) {
  std::string message;
  ProtoWriter out(message);
  AppendTime(out, kLogTime, time_ns);
  out.Integer(kLogLevel, static_cast<std::int64_t>(level));
  out.Bytes(kLogText, text);
  out.Bytes(kLogName, name);
  return message;
}

std::string EncodeScene(std::uint64_t time_ns, const std::vector<SceneEntity>& entities) {
  std::string message;
  ProtoWriter out(message);
  for (const SceneEntity& entity : entities) {
    out.Message(kEntities, [&](ProtoWriter& w) {
      AppendTime(w, kEntityTime, time_ns);
      w.Bytes(kEntityFrame, entity.frame);
      w.Bytes(kEntityId, entity.id);
      w.Integer(kEntityLocked, 1);
      for (const SceneSolid& solid : entity.solids) AppendSolid(w, solid);
      for (const SceneTriangles& triangles : entity.triangles) AppendTriangles(w, triangles);
    });
  }
  return message;
}

}  // namespace tumbler
