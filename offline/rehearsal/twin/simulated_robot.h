#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/drives/drives_toml.h"
#include "firmware_interface/drives/simulated_drive.h"
#include "offline/problem/simulated_motion.h"
#include "offline/rehearsal/twin/posture.h"
#include "offline/rehearsal/twin/twin.h"

namespace tumbler {

/// The motor of a joint, seen at the joint.
struct JointMotor {
  std::optional<double> torque_max_nm;  ///< The motion's largest torque limit by default.
  /// Above the base speed the torque in the direction of motion falls, to zero at the other.
  double base_speed_rad_s = std::numeric_limits<double>::infinity();
  double no_load_speed_rad_s = std::numeric_limits<double>::infinity();
  int encoder_counts_per_turn = 16384;  ///< Of the drive's shaft; 14 bits are common. 0: exact.
  double answer_delay_s = 20e-6;        ///< See SimulatedMotorConfig::turnaround_ns.
  double torque_time_constant_s = 0;    ///< Of the current loop.
  double ambient_c = 25;
  /// Steady excess temperature per torque squared. Copper losses of 0.35 W/(N m)^2 through 2 K/W,
  /// as of a geared motor of 0.5 kg that gives 9 N m for long.
  double heating_k_per_nm2 = 0.7;
  double thermal_time_constant_s = 300;
};

/// Everything about a simulated robot that its motion and its drives do not say.
struct SimulatedRobotConfig {
  TwinConfig twin;
  std::optional<PrimitivePose> start;  ///< Where it begins, at rest; the motion's start by default.
  std::vector<JointMotor> motors;      ///< In the motion's order; those missing are as above.
  PostureConfig posture;
};

/// A robot as its bus sees it: simulated drives in front of the twin, all on one simulated bus, and
/// somebody who watches whether it falls.
class SimulatedRobot {
 public:
  /// @param motion  whose robot and ground it is.
  /// @param drives  one for each joint of the motion, found by name; others are left out.
  /// @throws std::invalid_argument  when a joint has no drive, or a value is not possible;
  /// FileError when the texts of the primitive that the motion starts with cannot be used.
  SimulatedRobot(const SimulatedMotion& motion, const DrivesConfig& drives,
                 const SimulatedRobotConfig& config);

  [[nodiscard]] SimulatedBus& bus() { return bus_; }
  /// Moves everything on to this time.
  void AdvanceTo(std::int64_t time_ns);
  /// Picks the robot up and puts it where it began.
  void PutBack();

  [[nodiscard]] std::int64_t now_ns() const { return now_ns_; }
  [[nodiscard]] TwinState state() const { return twin_->state(); }
  [[nodiscard]] std::vector<TwinContact> contacts() const { return twin_->contacts(); }
  [[nodiscard]] const PostureWatch& posture() const { return *posture_; }
  [[nodiscard]] const std::vector<std::string>& joints() const { return joints_; }
  /// Of a joint, in the motion's order.
  [[nodiscard]] const SimulatedDrive& drive(std::size_t joint) const { return *drives_[joint]; }
  [[nodiscard]] std::size_t joint_count() const { return drives_.size(); }

 private:
  SimulatedBus bus_;
  std::vector<std::string> joints_;
  std::vector<std::unique_ptr<SimulatedDrive>> drives_;
  std::unique_ptr<Twin> twin_;
  std::unique_ptr<PostureWatch> posture_;
  std::int64_t now_ns_ = 0;
};

/// Where the robot of a motion stands before it: the entry of its first node, in the robot's terms.
PrimitivePose StartOf(const SequenceFile& motion);

}  // namespace tumbler
