#include "runtime/record/run_mcap.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "runtime/executor/faults.h"
#include "runtime/record/foxglove_messages.h"
#include "runtime/record/run_messages.h"

namespace tumbler {
namespace {

/// How many ticks back a reply's setpoint is looked for. The executor stops long before.
constexpr std::size_t kAskedTicks = 256;

const char* const kWorld = "world";
const char* const kProgram = "tumbler " TUMBLER_VERSION;
constexpr SceneColor kTrueColor{0.23, 0.35, 0.60, 1.0};
constexpr SceneColor kMeasuredColor{0.90, 0.45, 0.10, 1.0};
constexpr SceneColor kPlannedColor{0.45, 0.45, 0.45, 0.35};

/// Whether setpoints of position take effect in this tick.
bool IsControlled(const state_t& state) {
  return ControlsPosition(static_cast<ExecutorState>(state.state),
                          static_cast<Reaction>(state.reaction));
}

/// The link's frame in its parent's, where its joint is at this position.
FramePose PoseOf(const PictureLink& link, double position) {
  FramePose pose{link.offset, {0, 0, 0, 1}};
  if (link.slides) {
    for (std::size_t i = 0; i < 3; ++i) pose.position_m[i] += position * link.axis[i];
  } else {
    pose.rotation = QuaternionAbout(link.axis, position);
  }
  return pose;
}

/// The pitch turns about -y.
FramePose PoseOf(const PictureRoot& root) {
  const auto& [w, x, y, z] = root.quaternion;
  if (root.is_in_space()) return {{root.x_m, root.y_m, root.z_m}, {x, y, z, w}};
  return {{root.x_m, 0, root.z_m}, QuaternionAbout({0, -1, 0}, root.pitch_rad)};
}

LogLevel LevelOf(const event_t& event) {
  if (event.to_state == ToString(ExecutorState::kFault)) return LogLevel::kError;
  return event.text.find(" refused: ") != std::string::npos ? LogLevel::kWarning : LogLevel::kInfo;
}

}  // namespace

RunMcap::RunMcap(const RunMcapConfig& config, OutputFile& file)
    : config_(config), file_(file, kProgram) {
  descriptors_["foxglove"] = EncodeDescriptors(FoxgloveFiles());
  descriptors_["tumbler"] = EncodeDescriptors(RunFiles());
  McapWriter::Texts about = config.about;
  about["program"] = kProgram;
  file_.AddMetadata("run", about);
  McapWriter::Texts units;
  for (const ProtoFile& described : RunFiles()) {
    for (const ProtoType& type : described.types) {
      for (const ProtoField& field : type.fields) {
        if (!field.comment.empty()) units[type.name + "." + field.name] = field.comment;
      }
    }
  }
  file_.AddMetadata("fields", units);
}

McapWriter::Channel RunMcap::ChannelOf(const std::string& topic, const std::string& type) {
  const auto found = channels_.find(topic);
  if (found != channels_.end()) return found->second;
  if (schemas_.count(type) == 0)
    schemas_[type] = file_.AddSchema(type, descriptors_.at(type.substr(0, type.find('.'))));
  return channels_[topic] = file_.AddChannel(schemas_.at(type), topic);
}

void RunMcap::Take(std::uint64_t time_ns, const state_t& state) {
  file_.Write(ChannelOf("/tick", "tumbler.Tick"), time_ns, EncodeTick(time_ns, state));
  const std::size_t count = std::min(config_.joints.size(), state.joints.size());
  AskedTick asked{state.tick, IsControlled(state), {}};
  for (std::size_t j = 0; j < count; ++j) {
    asked.limited_rad.push_back(double{state.joints[j].limited_position_rad});
    file_.Write(ChannelOf("/joint/" + config_.joints[j], "tumbler.Joint"), time_ns,
                EncodeJoint(time_ns, state.joints[j],
                            !config_.imagined_drives && state.joints[j].reply_age_ticks >= 0,
                            FollowingError(state, j)));
  }
  asked_.push_back(std::move(asked));
  if (asked_.size() > kAskedTicks) asked_.pop_front();
  TakeMeasured(time_ns, state);
}

double RunMcap::FollowingError(const state_t& state, std::size_t joint) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const joint_state_t& now = state.joints[joint];
  if (config_.imagined_drives || now.reply_age_ticks < 0 || !IsControlled(state)) return kNone;
  const std::int64_t answered = state.tick - 1 - now.reply_age_ticks;
  const auto asked = std::find_if(asked_.begin(), asked_.end(), [answered](const AskedTick& tick) {
    return tick.tick == answered;
  });
  if (asked == asked_.end() || !asked->controlled || joint >= asked->limited_rad.size())
    return kNone;
  return double{now.measured_position_rad} - asked->limited_rad[joint];
}

void RunMcap::TakeMeasured(std::uint64_t time_ns, const state_t& state) {
  if (config_.imagined_drives || !config_.robot || state.joints.size() < config_.joints.size())
    return;
  replied_ = replied_ || std::all_of(state.joints.begin(), state.joints.end(),
                                     [](const joint_state_t& j) { return j.reply_age_ticks >= 0; });
  if (!replied_) return;
  std::vector<std::optional<double>> joints;
  for (const joint_state_t& joint : state.joints)
    joints.emplace_back(double{joint.measured_position_rad});
  std::vector<FrameTransform> transforms;
  using Root = RunMcapConfig::Root;
  const bool at_world = config_.robot->fixed_root;
  const std::string elsewhere = config_.root == Root::kUnknown ? "measured"
                                : config_.root == Root::kTrue  ? "true"
                                                               : "planned";
  const std::string root = at_world ? "measured" : elsewhere;
  if (at_world) {
    transforms.push_back({kWorld, "measured/" + config_.robot->links.front().name, {}});
  }
  AppendLinks("measured", root, elsewhere, joints, transforms);
  if (transforms.empty()) return;
  file_.Write(ChannelOf("/tf", "foxglove.FrameTransforms"), time_ns,
              EncodeTransforms(time_ns, transforms));
  Draw(time_ns, "measured", kMeasuredColor);
}

void RunMcap::AppendLinks(const std::string& prefix, const std::string& root_prefix,
                          const std::string& elsewhere,
                          const std::vector<std::optional<double>>& joints,
                          std::vector<FrameTransform>& transforms) const {
  const std::vector<PictureLink>& links = config_.robot->links;
  const auto position_of = [&joints](const PictureLink& link) -> std::optional<double> {
    const auto joint = static_cast<std::size_t>(link.joint);
    return link.joint < 0 || joint >= joints.size() ? std::nullopt : joints[joint];
  };
  for (const PictureLink& link : links) {
    const std::optional<double> position = position_of(link);
    if (link.parent < 0 || !position) continue;
    const PictureLink& parent = links[static_cast<std::size_t>(link.parent)];
    const std::string& parent_prefix = link.parent == 0      ? root_prefix
                                       : position_of(parent) ? prefix
                                                             : elsewhere;
    transforms.push_back(
        {parent_prefix + "/" + parent.name, prefix + "/" + link.name, PoseOf(link, *position)});
  }
}

void RunMcap::TakeRobot(std::uint64_t time_ns, const std::string& prefix, const PictureRoot& root,
                        const std::vector<std::optional<double>>& joints, const SceneColor& color) {
  if (!config_.robot) return;
  std::vector<FrameTransform> transforms{{kWorld, prefix + "/" + config_.robot->links.front().name,
                                          config_.robot->fixed_root ? FramePose{} : PoseOf(root)}};
  AppendLinks(prefix, prefix, prefix, joints, transforms);
  file_.Write(ChannelOf("/tf", "foxglove.FrameTransforms"), time_ns,
              EncodeTransforms(time_ns, transforms));
  Draw(time_ns, prefix, color);
}

void RunMcap::Draw(std::uint64_t time_ns, const std::string& prefix, const SceneColor& color) {
  if (drawn_[prefix]) return;
  drawn_[prefix] = true;
  std::vector<SceneEntity> entities;
  for (const PictureLink& link : config_.robot->links) {
    SceneEntity entity{prefix + "/" + link.name, prefix + "/" + link.name, link.shapes, {}};
    // No measurement tells where the root is: only the links that joints move are drawn.
    if (prefix == "measured" && link.parent < 0 && !config_.robot->fixed_root &&
        config_.root != RunMcapConfig::Root::kUnknown) {
      continue;
    }
    // Nor where a joint without a motor is.
    if (prefix == "measured" && link.joint >= static_cast<int>(config_.joints.size())) continue;
    for (SceneSolid& solid : entity.solids) {
      const double opacity = solid.color[3];
      solid.color = color;
      solid.color[3] *= opacity;
    }
    if (!entity.solids.empty()) entities.push_back(std::move(entity));
  }
  file_.Write(ChannelOf("/scene/" + prefix, "foxglove.SceneUpdate"), time_ns,
              EncodeScene(time_ns, entities));
  if (config_.robot->ground.empty() || drawn_["ground"]) return;
  drawn_["ground"] = true;
  file_.Write(ChannelOf("/scene/ground", "foxglove.SceneUpdate"), time_ns,
              EncodeScene(time_ns, {{kWorld, "ground", {}, config_.robot->ground}}));
}

void RunMcap::Take(std::uint64_t time_ns, const event_t& event) {
  const std::string text = fmt::format("tick {}: {} -> {}{}{}", event.tick, event.from_state,
                                       event.to_state, event.text.empty() ? "" : ": ", event.text);
  file_.Write(ChannelOf("/log", "foxglove.Log"), time_ns,
              EncodeLog(time_ns, LevelOf(event), text, "executor"));
}

void RunMcap::Take(std::uint64_t time_ns, const run_t& run) {
  file_.Write(ChannelOf("/run", "tumbler.Run"), time_ns, EncodeRun(time_ns, run));
}

void RunMcap::Take(std::uint64_t time_ns, const space_truth_t& state) {
  const truth_t& truth = state.truth;
  const char* const type = IsInSpace(state) ? "tumbler.TruthInSpace" : "tumbler.Truth";
  file_.Write(ChannelOf("/truth", type), time_ns, EncodeTruth(time_ns, state));
  std::vector<std::optional<double>> joints;
  std::vector<std::string> names = config_.joints;
  if (config_.robot)
    names.insert(names.end(), config_.robot->passive.begin(), config_.robot->passive.end());
  for (const std::string& name : names) {
    const auto joint = std::find_if(truth.joints.begin(), truth.joints.end(),
                                    [&name](const joint_truth_t& j) { return j.name == name; });
    joints.push_back(joint == truth.joints.end() ? std::nullopt
                                                 : std::optional(joint->position_rad));
  }
  PictureRoot root{truth.root_x_m, truth.root_z_m, truth.root_pitch_rad};
  root.y_m = state.root_y_m;
  std::ranges::copy(state.root_quaternion, root.quaternion.begin());
  TakeRobot(time_ns, "true", root, joints, kTrueColor);
}

void RunMcap::TakePlan(std::uint64_t time_ns, const PictureRoot& root,
                       const std::vector<double>& joints) {
  TakeRobot(time_ns, "planned", root, {joints.begin(), joints.end()}, kPlannedColor);
}

}  // namespace tumbler
