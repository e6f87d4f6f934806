#include "runtime/assembly/run_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "firmware_interface/can/bus_schedule.h"

namespace tumbler {
namespace {

/// What of the motion of a node is beyond the drives' ranges. The same is said once.
void CompareRanges(const Sequence<float>& sequence, int node, const DrivesConfig& drives,
                   std::vector<std::string>& beyond) {
  for (std::size_t i = 0; i < drives.drives.size(); ++i) {
    const DriveEntry& entry = drives.drives[i];
    const auto role = static_cast<std::size_t>(sequence.graph.RoleOf(node, static_cast<int>(i)));
    const JointLimits<float>& limits = sequence.PrimitiveOf(node).joints[role].limits;
    const JointMap& map = JointOf(entry.config);
    const ShaftRanges ranges = CommandRanges(entry.config);
    const auto compare = [&](const char* what, const char* unit, float value,
                             const DriveRange& range) {
      if (value >= range.min && value <= range.max) return;
      const std::string said = fmt::format(
          "joint {}: the motion's {} limit is {:.4g} {} at the drive, whose range is {:.4g} ... "
          "{:.4g} {}",
          entry.joint, what, value, unit, range.min, range.max, unit);
      if (std::ranges::find(beyond, said) == beyond.end()) beyond.push_back(said);
    };
    for (const DriveRange& range : {ranges.position_rad, ReportedPositions(entry.config)}) {
      compare("position", "rad", map.ToDrivePosition(limits.position_min_rad), range);
      compare("position", "rad", map.ToDrivePosition(limits.position_max_rad), range);
    }
    compare("velocity", "rad/s", map.ToDriveVelocity(limits.velocity_max_rad_s),
            ranges.velocity_rad_s);
    compare("velocity", "rad/s", map.ToDriveVelocity(-limits.velocity_max_rad_s),
            ranges.velocity_rad_s);
    compare("torque", "N m", map.ToDriveTorque(limits.torque_max_nm), ranges.torque_nm);
    compare("torque", "N m", map.ToDriveTorque(-limits.torque_max_nm), ranges.torque_nm);
  }
}

}  // namespace

void CheckRanges(const Sequence<float>& sequence, const DrivesConfig& drives) {
  std::vector<std::string> beyond;
  for (int node = 0; node < sequence.graph.node_count; ++node)
    CompareRanges(sequence, node, drives, beyond);
  if (beyond.empty()) return;
  throw Refused(fmt::format(
      "{}; correct the drives' ranges or zero offsets (in a drives file, --drives), or remake the "
      "primitive",
      fmt::join(beyond, "; ")));
}

void CheckSchedule(const DrivesConfig& drives, const std::function<void(const std::string&)>& say) {
  BusSchedule schedule;
  schedule.bit_rate = drives.bit_rate;
  schedule.rate_hz = drives.rate_hz;
  schedule.tick_bits = drives.WorstCaseTickBits();
  schedule.longest_frame_bits = drives.LongestFrameBits();
  say(fmt::format("bus schedule: {}: {}", drives.DescribeSchedule(), schedule.Describe()));
  if (!schedule.feasible()) {
    throw Refused(fmt::format(
        "{} bits a tick do not fit: lower rate_hz to at most {:.0f}, in a drives file (--drives)",
        schedule.tick_bits, std::floor(schedule.ceiling_hz())));
  }
}

void CompareGains(const SequenceFile& motion, const DrivesConfig& drives,
                  const std::function<void(const std::string&)>& say) {
  const std::optional<DriveGains> found = GainsOf(motion);
  if (!found) return;
  for (const DriveEntry& entry : drives.drives) {
    // Drives files hold single precision.
    if (entry.kp_nm_per_rad == static_cast<float>(found->kp_nm_per_rad) &&
        entry.kd_nm_s_per_rad == static_cast<float>(found->kd_nm_s_per_rad)) {
      continue;
    }
    say(
        fmt::format("joint {}: its drive has {:.6g} N m/rad and {:.6g} N m s/rad; the motion was "
                    "found for {:.6g} and {:.6g}",
                    entry.joint, entry.kp_nm_per_rad, entry.kd_nm_s_per_rad, found->kp_nm_per_rad,
                    found->kd_nm_s_per_rad));
  }
}

void CheckWatchdogs(const DrivesConfig& drives, bool may_be_none) {
  constexpr double kTicks = 3;
  const double least_s = kTicks / drives.rate_hz;
  for (const DriveEntry& drive : drives.drives) {
    if (drive.watchdog_s == 0 && !may_be_none) {
      throw Refused(
          fmt::format("joint {}: the drive has no watchdog (watchdog_s = 0), so that nothing stops "
                      "it when this program or its computer does not; set one in the drive, or "
                      "accept that with --without-watchdog",
                      drive.joint));
    }
    if (drive.watchdog_s > 0 && drive.watchdog_s < least_s * (1 - 1e-9)) {
      throw Refused(fmt::format(
          "joint {}: watchdog_s is {:.6g}, but a tick takes {:.6g} s: the drive would be let go "
          "between setpoints; allowed: at least three ticks, {:.6g} s",
          drive.joint, drive.watchdog_s, 1 / drives.rate_hz, least_s));
    }
  }
}

void CheckQueue(const std::string& interface, const CanLink& link, const DrivesConfig& drives) {
  const auto count = static_cast<std::int64_t>(drives.drives.size());
  if (!link.has_queue || link.queue_frames_max >= count) return;
  throw Refused(
      fmt::format("{0} has a transmit queue of {1} frames, and a tick sends at least one to each "
                  "of {2} drives: "
                  "ip link set {0} txqueuelen {3}",
                  interface, link.queue_frames_max, count, std::max(10, drives.HostFramesMax())));
}

}  // namespace tumbler
