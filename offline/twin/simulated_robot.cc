#include "offline/twin/simulated_robot.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/core/functions.h"
#include "firmware_interface/devices/make_simulated.h"
#include "offline/problem/link_chains.h"

namespace tumbler {
namespace {

/// Time between two looks at the robot's posture. Falls and rests last longer.
constexpr std::int64_t kLook_ns = 1'000'000;

const DriveEntry& DriveOf(const DrivesConfig& drives, const std::string& joint) {
  for (const DriveEntry& entry : drives.drives) {
    if (entry.joint == joint) return entry;
  }
  throw std::invalid_argument("there is no drive for the joint '" + joint + "' of the motion");
}

/// @param of_task  what is known of the motor there.
SimulatedMotorConfig AtShaft(const JointMotor& motor, const Motor& of_task, double torque_max_nm,
                             const DriveEntry& entry) {
  const JointMap& map = JointOf(entry.config);
  const double torque_ratio = std::abs(static_cast<double>(map.ToDriveTorque(1)));
  const double speed_ratio = std::abs(static_cast<double>(map.ToDriveVelocity(1)));
  SimulatedMotorConfig shaft = MotorOf(entry);
  shaft.torque_max_nm = motor.torque_max_nm.value_or(torque_max_nm) * torque_ratio;
  shaft.base_speed_rad_s = motor.base_speed_rad_s.value_or(of_task.base_speed_rad_s) * speed_ratio;
  shaft.no_load_speed_rad_s =
      motor.no_load_speed_rad_s.value_or(of_task.no_load_speed_rad_s) * speed_ratio;
  shaft.encoder_step_rad = motor.encoder_counts_per_turn == 0
                               ? 0.0
                               : 6.2831853071795864769 / motor.encoder_counts_per_turn;
  shaft.turnaround_ns = std::llround(motor.answer_delay_s * 1e9);
  shaft.torque_time_constant_s =
      motor.torque_time_constant_s.value_or(shaft.torque_time_constant_s);
  shaft.torque_factor = motor.torque_factor.value_or(shaft.torque_factor);
  shaft.velocity_filter_s = motor.velocity_filter_s.value_or(shaft.velocity_filter_s);
  shaft.ambient_c = motor.ambient_c;
  shaft.heating_k_per_nm2 = motor.heating_k_per_nm2 / (torque_ratio * torque_ratio);
  shaft.thermal_time_constant_s = motor.thermal_time_constant_s;
  return shaft;
}

}  // namespace

double LargestTorqueLimit(const SequenceFile& motion, std::size_t joint) {
  double torque_max_nm = 0;
  for (int node = 0; node < motion.graph.node_count; ++node) {
    const auto role = static_cast<std::size_t>(motion.graph.RoleOf(node, static_cast<int>(joint)));
    torque_max_nm = std::max(torque_max_nm,
                             motion.PrimitiveOf(node).primitive.joints[role].limits.torque_max_nm);
  }
  return torque_max_nm;
}

PrimitivePose StartOf(const SequenceFile& motion, int begin) {
  const int node = begin < 0 ? motion.graph.start : begin;
  const PrimitivePose& entry = motion.PrimitiveOf(node).entry;
  PrimitivePose start = entry;
  start.root_pitch_rad = motion.RobotPitch(node, entry.root_pitch_rad);
  for (std::size_t j = 0; j < entry.joint_positions_rad.size(); ++j) {
    const auto role = static_cast<std::size_t>(motion.graph.RoleOf(node, static_cast<int>(j)));
    start.joint_positions_rad[j] = entry.joint_positions_rad[role];
  }
  return start;
}

SimulatedRobot::SimulatedRobot(const SimulatedMotion& simulated, const DrivesConfig& drives,
                               const SimulatedRobotConfig& config)
    : bus_(drives.bit_rate) {
  RequireSameGround(simulated);
  RequireOneRobot(simulated);
  const SequenceFile& motion = simulated.file();
  const Primitive<double>& first = motion.PrimitiveOf(motion.graph.start).primitive;
  const Problem& problem = simulated.problem();
  const Scene& scene = config.scene ? *config.scene : problem.scene;
  const SpaceScene* space = nullptr;
  if (problem.space) space = config.space_scene ? &*config.space_scene : &problem.space->scene;
  const std::vector<Motor>& motors = space != nullptr ? space->motors : scene.motors;
  std::vector<SimulatedDrive*> pointers;
  for (std::size_t j = 0; j < first.motions().size(); ++j) {
    const double torque_max_nm = LargestTorqueLimit(motion, j);
    joints_.emplace_back(first.joints[j].name.view());
    const DriveEntry& entry = DriveOf(drives, joints_.back());
    const JointMotor motor = j < config.motors.size() ? config.motors[j] : JointMotor{};
    const Motor of_task = j < motors.size() ? motors[j] : Motor{};
    drives_.push_back(MakeSimulatedDrive(entry, AtShaft(motor, of_task, torque_max_nm, entry)));
    drives_.back()->AttachTo(bus_);
    pointers.push_back(drives_.back().get());
  }
  const PrimitivePose start = config.start.value_or(StartOf(motion));
  if (space != nullptr) {
    if (drives.sensor) {
      throw std::invalid_argument(
          "a sensor is simulated on robots in the plane only so far; leave [sensor] out of the "
          "drives of a robot in space");
    }
    twin_ = std::make_unique<Twin>(*space, start, config.twin, bus_, pointers);
  } else {
    twin_ = std::make_unique<Twin>(scene, start, config.twin, bus_, pointers);
  }
  if (drives.sensor) {
    const std::vector<LinkChain> chains = LinkChainsOf(scene.robot);
    const auto found = std::ranges::find(chains, drives.sensor->link, &LinkChain::link);
    if (found == chains.end()) {
      throw std::invalid_argument("the sensor is on link '" + drives.sensor->link +
                                  "', which the robot does not have");
    }
    sensor_chain_ = found->joints;
    const Plane::Vector& gravity = scene.robot.tree.gravity;
    if (gravity.x() != 0) slope_rad_ = portable::Atan2(-gravity.x(), -gravity.y());
    sensor_ = std::make_unique<SimulatedSensor>(*drives.sensor, config.sensor);
    sensor_->AttachTo(bus_);
  }
  PostureWatch::Slides slides;
  const auto look = [&](const auto& robot) {
    const auto does_slide = [&robot](std::size_t dof) {
      return robot.tree.dofs[dof].kind == JointKind::kPrismatic;
    };
    for (std::size_t j = 0; j < robot.joint_count(); ++j)
      slides.joints.push_back(does_slide(robot.DofOfJoint(j)));
    for (const PassiveJoint& joint : robot.passive) {
      slides.passive.push_back(does_slide(Index(joint.dof)));
      passive_joints_.push_back(robot.tree.dofs[Index(joint.dof)].name);
    }
  };
  space != nullptr ? look(space->robot) : look(scene.robot);
  posture_ = std::make_unique<PostureWatch>(motion, config.posture, start, std::move(slides));
}

void SimulatedRobot::AdvanceTo(std::int64_t time_ns) {
  while (now_ns_ < time_ns) {
    const std::int64_t now_before = now_ns_;
    const std::int64_t look_ns = (now_ns_ / kLook_ns + 1) * kLook_ns;
    now_ns_ = std::min(look_ns, time_ns);
    if (sensor_ != nullptr) now_ns_ = std::min(now_ns_, std::max(sensor_->next_ns(), now_before));
    twin_->AdvanceTo(now_ns_);
    if (sensor_ != nullptr && sensor_->next_ns() <= now_ns_) Measure();
    if (now_ns_ != look_ns) continue;
    DrivesPosture drives{true, true};
    for (const auto& drive : drives_) {
      drives.all_enabled = drives.all_enabled && drive->enabled();
      const bool disabled = !drive->enabled() && !drive->limp();
      drives.let_go = drives.let_go && (disabled || drive->softened());
    }
    posture_->Observe(twin_->state(), twin_->contacts(), drives);
  }
}

void SimulatedRobot::Measure() {
  const TwinState& state = twin_->state();
  // A sensor measures against gravity.
  double pitch_rad = state.root_pitch_rad + slope_rad_;
  double rate_rad_s = state.root_pitch_rate_rad_s;
  for (std::size_t j = 0; j < sensor_chain_.size(); ++j) {
    pitch_rad += sensor_chain_[j] * state.joint_positions_rad[j];
    rate_rad_s += sensor_chain_[j] * state.joint_velocities_rad_s[j];
  }
  sensor_->Measure(pitch_rad, rate_rad_s, state.enabled_ns);
}

void SimulatedRobot::PutBack() { twin_->PutBack(); }

}  // namespace tumbler
