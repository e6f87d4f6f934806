#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/simulated_drive.h"
#include "firmware_interface/devices/simulated_sensor.h"
#include "offline/problem/simulated_motion.h"
#include "offline/twin/posture.h"
#include "offline/twin/twin.h"

namespace tumbler {

/// The motor of a joint. All quantities are at the joint, behind the gear.
struct JointMotor {
  /// None: the largest torque limit in the motion.
  std::optional<double> torque_max_nm;
  /// Above the base speed, the torque in the direction of motion falls. It is zero at the no-load
  /// speed. None: the speeds of the task's motor.
  std::optional<double> base_speed_rad_s;
  std::optional<double> no_load_speed_rad_s;
  /// Counts for a turn of the drive's shaft; 14 bits are common. 0: the position is exact.
  int encoder_counts_per_turn = 16384;
  /// Sets SimulatedMotorConfig::turnaround_ns.
  double answer_delay_s = 20e-6;
  /// As MotorFacts; none: as the drives file says.
  std::optional<double> torque_time_constant_s, torque_factor, velocity_filter_s;
  double ambient_c = 25;
  /// Excess temperature per torque squared, when it is steady. The default stands for copper losses
  /// of 0.35 W/(N m)^2 through 2 K/W: a geared motor of 0.5 kg that gives 9 N m for long.
  double heating_k_per_nm2 = 0.7;
  double thermal_time_constant_s = 300;
};

/// Settings of a simulated robot, beyond its motion and its drives.
struct SimulatedRobotConfig {
  TwinConfig twin;
  /// The robot and its ground, which the configuration of the twin changes. None: those of the
  /// motion. Joints and obstacles are as many, in the same order.
  std::optional<Scene> scene;
  /// The same of a robot in space.
  std::optional<SpaceScene> space_scene;
  /// The pose in which the robot begins, at rest. None: the start of the motion.
  std::optional<PrimitivePose> start;
  /// In the order of the motion's joints. Joints without an entry have the defaults.
  std::vector<JointMotor> motors;
  PostureConfig posture;
  /// Errors of the drives file's sensor, where there is one.
  SimulatedSensorConfig sensor;
};

/// A robot as its bus sees it: simulated drives in front of a twin, all on one simulated bus. A
/// PostureWatch sees whether it falls.
class SimulatedRobot {
 public:
  /// @param motion  has the robot and the ground.
  /// @param drives  one for each joint of the motion, found by name; others are left out.
  /// @throws std::invalid_argument  when a joint has no drive, or a value is not possible.
  /// @throws FileError              when the texts of the motion's first primitive cannot be used.
  SimulatedRobot(const SimulatedMotion& motion, const DrivesConfig& drives,
                 const SimulatedRobotConfig& config);

  [[nodiscard]] SimulatedBus& bus() { return bus_; }
  /// Advances bus, drives, sensor and robot to this time.
  void AdvanceTo(std::int64_t time_ns);
  /// As Twin::Displace.
  void Displace(std::span<const double> q, std::span<const double> v) { twin_->Displace(q, v); }
  /// As Twin::ForgetImpacts.
  void ForgetImpacts() { twin_->ForgetImpacts(); }
  /// Puts the robot back into the pose in which it began.
  void PutBack();

  [[nodiscard]] std::int64_t now_ns() const { return now_ns_; }
  /// Valid until the robot moves.
  [[nodiscard]] const TwinState& state() const { return twin_->state(); }
  [[nodiscard]] std::vector<TwinContact> contacts() const { return twin_->contacts(); }
  [[nodiscard]] const PostureWatch& posture() const { return *posture_; }
  [[nodiscard]] const std::vector<std::string>& joints() const { return joints_; }
  /// The joints without a motor, in the order of their true states.
  [[nodiscard]] const std::vector<std::string>& passive_joints() const { return passive_joints_; }
  /// The drive of a joint, in the motion's order.
  [[nodiscard]] const SimulatedDrive& drive(std::size_t joint) const { return *drives_[joint]; }
  [[nodiscard]] std::size_t joint_count() const { return drives_.size(); }

 private:
  void Measure();

  SimulatedBus bus_;
  std::vector<std::string> joints_, passive_joints_;
  std::vector<std::unique_ptr<SimulatedDrive>> drives_;
  std::unique_ptr<SimulatedSensor> sensor_;  ///< Null: there is none.
  std::vector<double> sensor_chain_;         ///< By how much its link turns with each joint.
  double slope_rad_ = 0;                     ///< Of the ground, to which the twin's pitch refers.
  std::unique_ptr<Twin> twin_;
  std::unique_ptr<PostureWatch> posture_;
  std::int64_t now_ns_ = 0;
};

/// The largest torque limit that a joint has in any node of the motion [N m].
double LargestTorqueLimit(const SequenceFile& motion, std::size_t joint);

/// The pose of the robot before a motion: the entry of its first node, or of another with which a
/// run may begin. Where that node exchanges the roles of legs, the pose is that of the robot, not
/// of the roles.
/// @param begin  the node; -1: the first.
PrimitivePose StartOf(const SequenceFile& motion, int begin = -1);

}  // namespace tumbler
