#include "offline/twin/posture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "common/core/functions.h"
#include "offline/scene/quaternion.h"

namespace tumbler {

std::string Describe(const PostureEvent& event) {
  const std::string where =
      event.in_space
          ? fmt::format(
                "tilted by {:.4f} rad, z {:.4f} m, x {:.3f} m, y {:.3f} m, heading {:.3f} "
                "rad",
                event.tilt_rad, event.root_z_m, event.root_x_m, event.root_y_m, event.heading_rad)
          : fmt::format("pitch {:.4f} rad, z {:.4f} m, x {:.3f} m", event.root_pitch_rad,
                        event.root_z_m, event.root_x_m);
  if (event.kind == PostureEvent::Kind::kFall) {
    return fmt::format("FELL: {}; {}", event.cause, where);
  }
  if (event.kind == PostureEvent::Kind::kOverlap)
    return fmt::format("GOES THROUGH ITSELF: {}; {}", event.cause, where);
  return fmt::format("rests {}; {}", event.pose.empty() ? "in no known pose" : event.pose, where);
}

PostureWatch::PostureWatch(const SequenceFile& motion, const PostureConfig& config,
                           const PrimitivePose& start, Slides slides)
    : config_(config), slides_(std::move(slides)) {
  const auto add = [&](int node, const char* when, const PrimitivePose& pose, double tolerance) {
    const std::string name = fmt::format("as {} {}", when, motion.graph.node(node).name.view());
    KnownPose known{name,
                    pose.root_z_m,
                    motion.RobotPitch(node, pose.root_pitch_rad),
                    std::max(tolerance, config.pitch_tolerance_rad),
                    {},
                    pose.passive_positions_rad,
                    pose.root_quaternion};
    for (std::size_t j = 0; j < pose.joint_positions_rad.size(); ++j) {
      const auto role = static_cast<std::size_t>(motion.graph.RoleOf(node, static_cast<int>(j)));
      known.joints_rad.push_back(pose.joint_positions_rad[role]);
    }
    poses_.push_back(std::move(known));
  };
  for (int node = 0; node < motion.graph.node_count; ++node) {
    add(node, "after", motion.PrimitiveOf(node).exit,
        motion.exit_pitch_tolerance_rad[static_cast<std::size_t>(node)]);
  }
  for (int node = 0; node < motion.graph.node_count; ++node) {
    add(node, "before", motion.PrimitiveOf(node).entry, 0);
  }
  poses_.push_back({"as it was started", start.root_z_m, start.root_pitch_rad,
                    config.pitch_tolerance_rad, start.joint_positions_rad,
                    start.passive_positions_rad, start.root_quaternion});
}

bool PostureWatch::Slow(const TwinState& state) const {
  const auto fast = [this](double rate) { return std::abs(rate) > config_.rate_max_rad_s; };
  if (fast(state.root_pitch_rate_rad_s) ||
      std::ranges::any_of(state.root_angular_velocity_rad_s, fast) ||
      std::ranges::any_of(state.joint_velocities_rad_s, fast) ||
      std::ranges::any_of(state.passive_velocities_rad_s, fast)) {
    return false;
  }
  const double in_plane = portable::Length(state.root_vx_m_s, state.root_vz_m_s);
  return (state.is_in_space() ? portable::Length(in_plane, state.root_vy_m_s) : in_plane) <=
         config_.speed_max_m_s;
}

const PostureWatch::KnownPose* PostureWatch::FindPose(const TwinState& state, bool passive) const {
  const auto fits = [&](const KnownPose& pose) {
    // The height allows for the pitch: the root turns about a foot, some 0.3 m away.
    const double z_tolerance = config_.z_tolerance_m + 0.3 * pose.pitch_tolerance_rad;
    if (std::abs(state.root_z_m - pose.z_m) > z_tolerance) return false;
    const double turned = state.is_in_space()
                              ? TiltBetween(state.root_quaternion, pose.quaternion)
                              : std::abs(NearestTurn(state.root_pitch_rad - pose.pitch_rad));
    if (turned > pose.pitch_tolerance_rad) return false;
    for (std::size_t j = 0; j < pose.joints_rad.size(); ++j) {
      const bool slides = j < slides_.joints.size() && slides_.joints[j];
      const double tolerance = slides ? config_.z_tolerance_m : config_.joint_tolerance_rad;
      if (std::abs(state.joint_positions_rad[j] - pose.joints_rad[j]) > tolerance) return false;
    }
    for (std::size_t i = 0; passive && i < pose.passive_rad.size(); ++i) {
      const bool slides = i < slides_.passive.size() && slides_.passive[i];
      const double tolerance = slides ? config_.z_tolerance_m : config_.joint_tolerance_rad;
      const double off = state.passive_positions_rad[i] - pose.passive_rad[i];
      if (std::abs(slides ? off : NearestTurn(off)) > tolerance) return false;
    }
    return true;
  };
  const auto found = std::find_if(poses_.begin(), poses_.end(), fits);
  return found == poses_.end() ? nullptr : &*found;
}

PostureEvent PostureWatch::EventAt(const TwinState& state, PostureEvent::Kind kind) {
  PostureEvent event;
  event.kind = kind;
  event.time_ns = state.time_ns;
  event.root_x_m = state.root_x_m;
  event.root_z_m = state.root_z_m;
  event.root_pitch_rad = state.root_pitch_rad;
  event.in_space = state.is_in_space();
  if (!event.in_space) return event;
  const SpaceMatrix R = ToRotation(state.root_quaternion);
  event.root_y_m = state.root_y_m;
  event.tilt_rad = TiltBetween(state.root_quaternion, {1, 0, 0, 0});
  event.heading_rad = portable::Atan2(R(1, 0), R(0, 0));
  return event;
}

PostureEvent& PostureWatch::Add(const TwinState& state, PostureEvent::Kind kind) {
  if (events_.size() >= kKept) {
    auto oldest = std::ranges::find(events_, PostureEvent::Kind::kRest, &PostureEvent::kind);
    if (oldest == events_.end()) oldest = events_.begin() + kKept / 2;
    events_.erase(oldest);
    ++left_out_;
  }
  return events_.emplace_back(EventAt(state, kind));
}

void PostureWatch::Fall(const TwinState& state, std::string cause) {
  if (!watched_ || fallen_) return;
  fallen_ = true;
  ++falls_;
  Add(state, PostureEvent::Kind::kFall).cause = std::move(cause);
}

void PostureWatch::Observe(const TwinState& state, const std::vector<TwinContact>& contacts,
                           const DrivesPosture& drives) {
  if (state.held) {
    watched_ = fallen_ = resting_ = false;
    resting_as_.clear();
    slow_since_ns_ = -1;
    return;
  }
  if (state.self_overlap_m > 0 && !overlapping_) {
    ++overlaps_;
    Add(state, PostureEvent::Kind::kOverlap).cause = fmt::format("{} overlap", state.overlapping);
  }
  overlapping_ = state.self_overlap_m > 0;
  if (drives.all_enabled && !drives.let_go) watched_ = true;
  if (drives.let_go && !let_go_ && FindPose(state, false) != nullptr) watched_ = false;
  if (!drives.let_go || !let_go_) sinking_max_m_s_ = 0;
  if (drives.let_go) sinking_max_m_s_ = std::max(sinking_max_m_s_, -state.root_vz_m_s);
  let_go_ = drives.let_go;
  for (const TwinContact& contact : contacts) {
    if (std::find(config_.clear_links.begin(), config_.clear_links.end(), contact.link) !=
        config_.clear_links.end()) {
      Fall(state, fmt::format("{} touches {}", contact.link, contact.obstacle));
    }
  }
  if (!Slow(state)) {
    resting_ = false;
    resting_as_.clear();
    slow_since_ns_ = -1;
    return;
  }
  if (slow_since_ns_ < 0) slow_since_ns_ = state.time_ns;
  if (static_cast<double>(state.time_ns - slow_since_ns_) * 1e-9 < config_.rest_s) return;
  const KnownPose* pose = FindPose(state, true);
  const std::string_view name = pose == nullptr ? "" : std::string_view(pose->name);
  if (resting_ && name == resting_as_) return;
  resting_ = true;
  resting_as_ = name;
  Add(state, PostureEvent::Kind::kRest).pose = resting_as_;
  if (FindPose(state, false) != nullptr) {
    fallen_ = false;
  } else {
    Fall(state, "rests in a pose that no motion begins or ends in");
  }
}

}  // namespace tumbler
