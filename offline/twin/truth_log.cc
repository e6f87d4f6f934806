#include "offline/twin/truth_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <iterator>
#include <limits>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <vector>

#include <lcm/lcm-cpp.hpp>
#include <tumbler/space_truth_t.hpp>

#include "common/files/result_file.h"
#include "runtime/record/channels.h"

namespace tumbler {
namespace {

space_truth_t MessageOf(const SimulatedRobot& robot) {
  const TwinState& state = robot.state();
  const PostureWatch& posture = robot.posture();
  space_truth_t in_space{};
  truth_t& message = in_space.truth;
  message.time_ns = state.time_ns;
  message.root_x_m = state.root_x_m;
  message.root_z_m = state.root_z_m;
  message.root_pitch_rad = state.root_pitch_rad;
  message.root_vx_m_s = state.root_vx_m_s;
  message.root_vz_m_s = state.root_vz_m_s;
  message.root_pitch_rate_rad_s = state.root_pitch_rate_rad_s;
  message.held = state.held ? 1 : 0;
  message.fallen = posture.fallen() ? 1 : 0;
  message.falls = posture.falls();
  message.resting_as = posture.resting_as();
  message.push_x_n = state.push_n[0];
  message.push_z_n = state.push_n[2];
  message.peak_penetration_m = state.peak_penetration_m;
  for (std::size_t j = 0; j < robot.joint_count(); ++j) {
    const SimulatedDrive& drive = robot.drive(j);
    joint_truth_t joint{};
    joint.name = robot.joints()[j];
    joint.position_rad = state.joint_positions_rad[j];
    joint.velocity_rad_s = state.joint_velocities_rad_s[j];
    joint.torque_nm = state.joint_torques_nm[j];
    joint.temperature_c = drive.temperature_c();
    joint.enabled = drive.enabled() ? 1 : 0;
    joint.limp = drive.limp() ? 1 : 0;
    message.joints.push_back(joint);
  }
  for (std::size_t i = 0; i < robot.passive_joints().size(); ++i) {
    joint_truth_t joint{};
    joint.name = robot.passive_joints()[i];
    joint.position_rad = state.passive_positions_rad[i];
    joint.velocity_rad_s = state.passive_velocities_rad_s[i];
    joint.temperature_c = std::numeric_limits<double>::quiet_NaN();
    message.joints.push_back(joint);
  }
  message.joint_count = static_cast<std::int32_t>(message.joints.size());
  for (const TwinContact& touching : robot.contacts()) {
    contact_truth_t contact{};
    contact.link = touching.link;
    contact.obstacle = touching.obstacle;
    contact.normal_force_n = touching.normal_force_n;
    message.contacts.push_back(contact);
  }
  message.contact_count = static_cast<std::int32_t>(message.contacts.size());
  if (!state.is_in_space()) return in_space;
  in_space.root_y_m = state.root_y_m;
  in_space.root_vy_m_s = state.root_vy_m_s;
  std::ranges::copy(state.root_quaternion, std::begin(in_space.root_quaternion));
  std::ranges::copy(state.root_angular_velocity_rad_s,
                    std::begin(in_space.root_angular_velocity_rad_s));
  in_space.push_y_n = state.push_n[1];
  return in_space;
}

/// A message truth_t or space_truth_t.
template <typename Message>
void Encode(const Message& message, std::vector<std::uint8_t>& bytes) {
  bytes.resize(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
}

}  // namespace

struct TruthLog::Implementation {
  explicit Implementation(const TruthLogConfig& config_in) : config(config_in) {
    if (!config.log_file.empty()) {
      log_lock.emplace(config.log_file);
      log.emplace(config.log_file, "w");
      if (!log->good()) {
        throw std::runtime_error(fmt::format("{}: cannot be written: {}", config.log_file,
                                             std::generic_category().message(errno)));
      }
    }
    if (!config.lcm_url.empty()) {
      live = std::make_unique<lcm::LCM>(config.lcm_url);
      if (!live->good())
        throw std::runtime_error(fmt::format("{}: LCM cannot use this", config.lcm_url));
    }
  }

  TruthLogConfig config;
  std::optional<WriterLock> log_lock;
  std::optional<lcm::LogFile> log;
  std::unique_ptr<lcm::LCM> live;
  std::vector<std::uint8_t> bytes;
  std::int64_t due_ns = 0;
  std::int64_t written = 0;
  bool failed = false;  // The log could not be written whole.
};

TruthLog::TruthLog(const TruthLogConfig& config)
    : implementation_(std::make_unique<Implementation>(config)) {}
TruthLog::~TruthLog() = default;

void TruthLog::Observe(const SimulatedRobot& robot) {
  Implementation& m = *implementation_;
  if (!m.log && !m.live && !m.config.sink) return;
  const std::int64_t now_ns = robot.now_ns();
  if (now_ns < m.due_ns) return;
  m.due_ns = (now_ns / m.config.period_ns + 1) * m.config.period_ns;
  const space_truth_t message = MessageOf(robot);
  robot.state().is_in_space() ? Encode(message, m.bytes) : Encode(message.truth, m.bytes);
  const int size = static_cast<int>(m.bytes.size());
  if (m.log && !m.failed) {
    lcm::LogEvent event{};
    event.eventnum = m.written++;
    event.timestamp = m.config.utime_at_zero_us + now_ns / 1000;
    event.channel = kTruthChannel;
    event.datalen = size;
    event.data = m.bytes.data();
    // The simulation goes on without its log: a robot in motion is not dropped for a full disk.
    if (m.log->writeEvent(&event) != 0) m.failed = true;
  }
  if (m.config.sink) m.config.sink(m.bytes);
  // A live message that LCM does not take is lost.
  if (m.live) {
    static_cast<void>(m.live->publish(kTruthChannel, m.bytes.data(), static_cast<unsigned>(size)));
  }
}

void TruthLog::Finish() {
  Implementation& m = *implementation_;
  if (m.log && std::fflush(m.log->getFilePtr()) != 0) m.failed = true;
  if (m.failed) {
    throw std::runtime_error(fmt::format("{}: could not be written whole", m.config.log_file));
  }
}

}  // namespace tumbler
