#include "runtime/assembly/run_parts.h"

namespace tumbler {

std::vector<double> RunParts::StartPositions() const {
  std::vector<double> positions;
  const int start = file.graph.start;
  const Primitive<double>& primitive = file.PrimitiveOf(start).primitive;
  for (int i = 0; i < primitive.joint_count; ++i) {
    const auto role = static_cast<std::size_t>(file.graph.RoleOf(start, i));
    positions.push_back(primitive.joints[role].position.control_points()[0]);
  }
  return positions;
}

RunParts LoadRunMotion(const std::string& path, const FileReader& read) {
  RunParts parts;
  parts.file = LoadMotion(path, read);
  parts.sequence = std::make_unique<const Sequence<float>>(ToRuntime(parts.file));
  return parts;
}

std::vector<std::string> JointsOf(const SequenceFile& motion) {
  std::vector<std::string> names;
  for (const JointMotion<double>& joint : motion.primitives[0].primitive.motions()) {
    names.emplace_back(joint.name.view());
  }
  return names;
}

DrivesConfig LoadDrivesOf(const std::vector<std::string>& joints, const std::string& path,
                          const FileReader& read, const std::optional<DriveGains>& gains) {
  if (path.empty()) {
    return gains ? DefaultDrives(joints, gains->kp_nm_per_rad, gains->kd_nm_s_per_rad)
                 : DefaultDrives(joints);
  }
  return DrivesOf(ParseDrives(read(path), path, DrivesUse::kRun, read), joints, path);
}

}  // namespace tumbler
