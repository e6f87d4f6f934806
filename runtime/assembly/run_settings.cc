#include "runtime/assembly/run_settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <variant>
#include <vector>

#include "runtime/assembly/faults_toml.h"

namespace tumbler {

int BeginningNamed(const SequenceGraph<float>& graph, const std::string& name) {
  if (name.empty()) return -1;
  const int node = graph.FindNode(name);
  if (node >= 0 && graph.MayBegin(node)) return node;
  std::string names(graph.node(graph.start).name.view());
  for (const SequenceBeginning<float>& beginning : graph.beginnings()) {
    if (beginning.node != graph.start)
      names += fmt::format(", {}", graph.node(beginning.node).name.view());
  }
  throw std::invalid_argument(fmt::format("a run of {} cannot begin with '{}'; allowed: {}",
                                          graph.name.view(), name, names));
}

void CheckGetUps(int get_ups, int beginnings, const DrivesConfig& drives) {
  if (get_ups == 0) return;
  if (beginnings == 0) {
    throw std::invalid_argument(
        "a robot that falls gets up with one of the beginnings of its sequence, and this motion "
        "has none; give it [begin], or leave the option out");
  }
  if (!drives.sensor) {
    throw std::invalid_argument(
        "only a sensor tells how a robot lies that has fallen, and there is none; take a drives "
        "file with [sensor], or leave the option out");
  }
}

JointConfig JointConfigOf(const DriveEntry& entry) {
  JointConfig config;
  config.kp_nm_per_rad = entry.kp_nm_per_rad;
  config.kd_nm_s_per_rad = entry.kd_nm_s_per_rad;
  config.damping_nm_s_per_rad = entry.kd_nm_s_per_rad;
  config.temperature_max_c = entry.temperature_max_c;
  return config;
}

int PauseTicksMax(const DrivesConfig& drives) {
  constexpr double kUnattended_s = 0.2;  // A robot that balanced has fallen by then.
  double shortest_s = kUnattended_s;
  for (const DriveEntry& drive : drives.drives) {
    if (drive.watchdog_s > 0) shortest_s = std::min<double>(shortest_s, drive.watchdog_s);
  }
  // A setpoint leaves within a period of its tick. Two that are as many ticks apart as the watchdog
  // takes may be one period farther apart.
  constexpr double kRounding = 1e-6;
  return std::max(1, static_cast<int>(std::floor(shortest_s * drives.rate_hz + kRounding)) - 1);
}

ExecutorConfig ExecutorConfigOf(const RunSettings& settings, const DrivesConfig& drives) {
  ExecutorConfig config;
  config.cycles = settings.cycles;
  config.branch = settings.branch;
  config.begin = settings.begin;
  config.get_ups_max = settings.get_ups;
  config.period_s = static_cast<float>(1 / drives.rate_hz);
  config.start_way_max_rad = static_cast<float>(settings.start_within_rad);
  config.speed = static_cast<float>(settings.speed);
  // Five replies in a row are not lost by chance, and adapters on USB pause for some milliseconds.
  // Watchdogs of drives take 25 ms and more.
  constexpr double kPause_s = 0.01;
  config.stale_ticks_max =
      std::max(config.stale_ticks_max, static_cast<int>(std::ceil(kPause_s * drives.rate_hz)));
  config.arming_ticks_max = static_cast<int>(std::ceil(0.5 * drives.rate_hz));
  config.pause_ticks_max = PauseTicksMax(drives);
  for (std::size_t i = 0; i < drives.drives.size(); ++i) {
    config.joints[i] = JointConfigOf(drives.drives[i]);
  }
  return config;
}

void LoadFaultsOf(const RunParts& parts, const std::string& path, ExecutorConfig& config) {
  const Sequence<float>& sequence = *parts.sequence;
  std::vector<FaultsJoint> joints;
  for (std::size_t i = 0; i < parts.drives.drives.size(); ++i) {
    FaultsJoint joint{parts.drives.drives[i].joint, -1e9, 1e9};
    for (int p = 0; p < sequence.primitive_count; ++p) {
      const JointLimits<float>& limits =
          sequence.primitives[static_cast<std::size_t>(p)].joints[i].limits;
      joint.position_min_rad =
          std::max(joint.position_min_rad, static_cast<double>(limits.position_min_rad));
      joint.position_max_rad =
          std::min(joint.position_max_rad, static_cast<double>(limits.position_max_rad));
    }
    joints.push_back(joint);
  }
  LoadFaults(path, joints, config);
}

RunProcedureConfig ProcedureConfigOf(const RunSettings& settings, const DrivesConfig& drives,
                                     const SequenceGraph<float>& graph) {
  int first_reply_ms = 0;
  for (const DriveEntry& drive : drives.drives) {
    first_reply_ms = std::max(first_reply_ms, FirstReply_ms(drive.config));
  }
  const auto ticks = [&drives](double time_s) {
    return static_cast<std::int64_t>(std::llround(time_s * drives.rate_hz));
  };
  RunProcedureConfig config;
  config.hold_ticks = ticks(settings.hold_s);
  config.reply_ticks_max = ticks(first_reply_ms / 1000.0);
  config.start_ticks_max = ticks(1);
  config.rest_ticks = ticks(settings.rest_s);
  config.stop_hold_ticks = ticks(0.5);
  config.fault_ticks = ticks(1);
  const RunEnd end = settings.end.value_or(graph.end);
  const bool softens = std::ranges::all_of(
      drives.drives, [](const DriveEntry& drive) { return CarriesGains(drive.config); });
  for (int i = 0; i < graph.node_count; ++i) {
    if (graph.node(i).safe) config.safe_nodes |= 1U << static_cast<unsigned>(i);
  }
  config.go_home = end == RunEnd::kSafe && config.safe_nodes != 0;
  if (end == RunEnd::kLower && softens) {
    config.lower_ticks = ticks(2.5);
  } else if (end != RunEnd::kTorqueOff) {
    config.end_hold_ticks = settings.operated ? -1 : ticks(2);
  }
  if (settings.clear) config.clear_ticks = ticks(0.5);
  config.attended = settings.attended;
  return config;
}

}  // namespace tumbler
