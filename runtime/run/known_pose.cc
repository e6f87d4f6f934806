#include "runtime/run/known_pose.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "common/files/json.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

constexpr std::string_view kFormat = "tumbler-pose";

[[noreturn]] void FailPose(const std::string& path, const std::string& problem) {
  throw std::runtime_error(
      fmt::format("{}: {}; where the joints were last is not known then: look at the robot, delete "
                  "the file, or "
                  "arm with --forget-pose",
                  path, problem));
}

}  // namespace

std::string DefaultPoseFile(const std::string& robot, const std::string& interface) {
  // Nobody changes the environment of these programs.
  const char* state = std::getenv("XDG_STATE_HOME");  // NOLINT(concurrency-mt-unsafe)
  const char* home = std::getenv("HOME");             // NOLINT(concurrency-mt-unsafe)
  std::filesystem::path folder;
  if (state != nullptr && *state == '/') {
    folder = state;
  } else if (home != nullptr && *home == '/') {
    folder = std::filesystem::path(home) / ".local" / "state";
  } else {
    return "";
  }
  std::string name = robot + "." + interface;
  for (char& c : name) c = c == '/' ? '_' : c;
  return folder / "tumbler" / (name + ".json");
}

std::array<KnownPosition, kMaxJoints> ReadKnownPose(const std::string& path,
                                                    const DrivesConfig& drives) {
  std::array<KnownPosition, kMaxJoints> known;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return known;
  const std::optional<Json> json = Json::Parse(ReadTextFile(path));
  if (!json) FailPose(path, "is not JSON");
  const Json* const format = json->Find("format");
  if (format == nullptr || !format->is_text() || format->text() != kFormat)
    FailPose(path, fmt::format("is no {}", kFormat));
  const Json* const shafts = json->Find("shafts_rad");
  if (shafts == nullptr || !shafts->is_object()) FailPose(path, "has no shafts_rad");
  for (std::size_t i = 0; i < drives.drives.size(); ++i) {
    const DriveEntry& drive = drives.drives[i];
    const Json* const shaft = shafts->Find(drive.joint);
    if (shaft == nullptr) continue;
    if (!shaft->is_number() || !std::isfinite(static_cast<float>(shaft->number())))
      FailPose(path, fmt::format("shafts_rad: {} is not a number", drive.joint));
    const JointMap& map = JointOf(drive.config);
    known[i].known = true;
    known[i].position_rad = map.ToJointPosition(static_cast<float>(shaft->number()));
    known[i].turn_rad = 2 * std::numbers::pi_v<float> / map.gear_ratio;
  }
  return known;
}

void WriteKnownPose(const std::string& path, const TickRecord& record, const DrivesConfig& drives) {
  constexpr int kHeard = 100;  // ticks
  Json json = {{"format", kFormat}};
  json["shafts_rad"] = Json::Object();
  for (std::size_t i = 0; i < drives.drives.size() && i < record.joint_count; ++i) {
    const JointRecord& joint = record.joints[i];
    const bool heard = joint.reply_age_ticks >= 0 && joint.reply_age_ticks <= kHeard;
    if (!heard || !std::isfinite(joint.measured.position_rad)) continue;
    json["shafts_rad"][drives.drives[i].joint] =
        JointOf(drives.drives[i].config).ToDrivePosition(joint.measured.position_rad);
  }
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty()) std::filesystem::create_directories(folder);
  PendingFile file(path, json.Dump(2) + '\n');
  file.Commit();
}

}  // namespace tumbler
