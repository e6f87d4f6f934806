#include "offline/twin/truth_sampler.h"

#include <algorithm>
#include <iterator>
#include <limits>

#include <tumbler/space_truth_t.hpp>

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

void TruthSampler::Observe(const SimulatedRobot& robot) {
  if (!sink_) return;
  const std::int64_t now_ns = robot.now_ns();
  if (now_ns < due_ns_) return;
  due_ns_ = (now_ns / kPeriod_ns + 1) * kPeriod_ns;
  const space_truth_t message = MessageOf(robot);
  robot.state().is_in_space() ? Encode(message, bytes_) : Encode(message.truth, bytes_);
  sink_(bytes_);
}

}  // namespace tumbler
