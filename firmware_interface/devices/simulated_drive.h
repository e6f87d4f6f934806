#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/joint_map.h"

namespace tumbler {

/// A turn of a shaft [rad].
inline constexpr double kTwoPi = 2 * std::numbers::pi;

/// The motor of a simulated drive. All values are those at the drive's shaft, as data sheets give
/// them.
struct SimulatedMotorConfig {
  double torque_max_nm = 18;  ///< > 0: the current limit.
  /// Above this speed the supply voltage limits the torque in the direction of motion, linearly
  /// down to zero at `no_load_speed_rad_s`. Infinite: no such limit.
  double base_speed_rad_s = std::numeric_limits<double>::infinity();
  double no_load_speed_rad_s = std::numeric_limits<double>::infinity();
  double encoder_step_rad = 6.2831853071795864769 / 16384;  ///< >= 0: 14 bits a turn; 0 is exact.
  /// Time from the end of a frame to the moment when its answer is ready in the controller. An
  /// interrupt on a Cortex-M4 takes about this long. The host's next frame, which waits behind the
  /// intermission, has started by then.
  std::int64_t turnaround_ns = 20'000;
  /// >= 0: time constant of the current loop, which the torque follows in the first order. 0 is at
  /// once; real loops are tuned to 0.1 to 1 ms.
  double torque_time_constant_s = 0;
  /// > 0: what the motor exerts for each newton metre that its drive reckons with. A torque
  /// constant that is 3 % larger than the drive's is 1.03.
  double torque_factor = 1;
  /// >= 0: time constant of the first-order filter through which the drive's law and its replies
  /// see the velocity, which is a difference of encoder counts. 0: the true velocity.
  double velocity_filter_s = 0;
  /// The winding starts at the ambient temperature and approaches ambient + heating torque^2 in the
  /// first order, with the time constant below. An infinite one keeps its temperature as it is.
  double ambient_c = 25;
  double heating_k_per_nm2 = 0;                                              ///< >= 0
  double thermal_time_constant_s = std::numeric_limits<double>::infinity();  ///< > 0
};

/// What a drive knows of its shaft when it computes a torque.
struct Shaft {
  double angle_rad = 0;            ///< The true angle.
  double velocity_rad_s = 0;       ///< As the drive measures it.
  double true_velocity_rad_s = 0;  ///< That which limits the motor's voltage.
  double encoder_step_rad = 0;     ///< 0: the encoder is exact.

  /// The angle that the encoder reads [rad], where it reads zero at the true angle `zero_rad`.
  [[nodiscard]] double Measured(double zero_rad) const noexcept {
    const double angle = angle_rad - zero_rad;
    if (encoder_step_rad <= 0) return angle;
    return std::floor(angle / encoder_step_rad) * encoder_step_rad;
  }
};

/// The drive side of a protocol, with a motor: a node of a simulated bus that turns setpoints into
/// torque. The behaviour of each protocol's drives is in a header of its own,
/// simulated_NAME.h.
class SimulatedDrive : public SimulatedNode {
 public:
  /// Puts the drive on the bus, with the kind of controller that such drives have. May be called
  /// once. Drive and bus must outlive the bus's last AdvanceTo.
  void AttachTo(SimulatedBus& bus);

  /// One step of the drive's current loop: measures the joint, and returns the torque that acts on
  /// it [N m] until the next call. Times must not decrease.
  double Step(std::int64_t time_ns, double joint_position_rad,
              double joint_velocity_rad_s) noexcept;
  /// The torque that this loop would have on the joint [N m] at a time after the last step, if the
  /// joint were there. What the encoder does not resolve stays as it was in that step, so that the
  /// torque is smooth. For steps of the physics that are longer than the loop's.
  [[nodiscard]] double TorqueAt(std::int64_t time_ns, double joint_position_rad,
                                double joint_velocity_rad_s) const noexcept;
  /// When the drive does something of its own accord next, at the earliest; the largest number: not
  /// before a frame comes.
  [[nodiscard]] virtual std::int64_t next_act_ns() const noexcept { return kNever; }

  /// Whether the torque is on.
  [[nodiscard]] virtual bool enabled() const noexcept = 0;
  /// The position that the drive holds the joint to, or nothing where it holds none.
  [[nodiscard]] virtual std::optional<double> target_rad() const noexcept = 0;
  /// The torque that the drive reckons to act at the shaft.
  [[nodiscard]] double torque_nm() const noexcept { return torque_nm_; }
  /// Whether the host's silence has taken the torque away. (Some drives brake first.)
  [[nodiscard]] virtual bool limp() const noexcept = 0;
  /// Whether the host takes the drive's stiffness away little by little, or has done so.
  [[nodiscard]] virtual bool softened() const noexcept { return false; }
  /// How many frames came for this drive, and how many of them were setpoints.
  [[nodiscard]] std::int64_t frames_received() const noexcept { return frames_received_; }
  [[nodiscard]] std::int64_t setpoints_received() const noexcept { return setpoints_received_; }
  [[nodiscard]] std::int64_t last_setpoint_ns() const noexcept { return last_setpoint_ns_; }
  /// How often the watchdog noticed the host's silence.
  [[nodiscard]] std::int64_t watchdog_expiries() const noexcept { return watchdog_expiries_; }

  /// Injects a fault: a silent drive hears, acknowledges and obeys, but sends nothing.
  void set_silent(bool silent) noexcept { silent_ = silent; }
  /// Sets the winding's temperature.
  void set_temperature(double celsius) noexcept { temperature_c_ = celsius; }
  [[nodiscard]] double temperature_c() const noexcept { return temperature_c_; }
  /// Raises the drive's own error with this code, as if its hardware had found one.
  virtual void RaiseError(std::uint32_t code) noexcept = 0;

 protected:
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

  /// @throws std::invalid_argument  naming the value that is not allowed.
  SimulatedDrive(const SimulatedMotorConfig& motor, const JointMap& joint);

  static void Require(bool condition, const char* what);

  /// The configuration of such a drive's controller.
  [[nodiscard]] virtual SimulatedPortConfig port_config() const noexcept = 0;
  /// What the drive does of its own accord: called once a step, after the shaft was measured.
  virtual void Act(std::int64_t time_ns) noexcept = 0;
  /// The torque that the drive's law asks for at the shaft, before the motor's limits.
  [[nodiscard]] virtual double Law(std::int64_t time_ns, const Shaft& shaft) const noexcept = 0;

  /// Sends unless silent. When every mailbox is taken the message is lost, as in firmware, and the
  /// port counts it.
  void Say(SimulatedPort& port, const CanFrame& frame) const noexcept;
  /// The same on the port of AttachTo; without one nothing is sent.
  void Say(const CanFrame& frame) const noexcept {
    if (port_ != nullptr) Say(*port_, frame);
  }

  /// The shaft in the last step.
  [[nodiscard]] const Shaft& shaft() const noexcept { return shaft_; }
  [[nodiscard]] double Measured(double zero_rad) const noexcept {
    return shaft_.Measured(zero_rad);
  }
  [[nodiscard]] double ToJoint(double shaft_angle_rad) const noexcept;
  void CountExpiry() noexcept { ++watchdog_expiries_; }
  void CountFrame() noexcept { ++frames_received_; }
  void CountSetpoint(std::int64_t time_ns) noexcept {
    ++setpoints_received_;
    last_setpoint_ns_ = time_ns;
  }

 private:
  /// The shaft at a time not before the last step, its encoder exact.
  [[nodiscard]] Shaft ShaftAt(std::int64_t time_ns, double joint_position_rad,
                              double joint_velocity_rad_s) const noexcept;
  [[nodiscard]] double LimitedLaw(std::int64_t time_ns, const Shaft& shaft) const noexcept;

  SimulatedMotorConfig motor_;
  double ratio_;  // shaft turns per turn of the joint, with its sign
  double zero_offset_rad_;
  SimulatedPort* port_ = nullptr;
  bool silent_ = false;
  double temperature_c_;
  std::int64_t stepped_ns_ = -1;  // time of the last step; -1: none yet
  Shaft shaft_;
  double wanted_nm_ = 0;  // what the law asked for in the last step
  double torque_nm_ = 0;
  std::int64_t watchdog_expiries_ = 0;
  std::int64_t frames_received_ = 0;
  std::int64_t setpoints_received_ = 0;
  std::int64_t last_setpoint_ns_ = 0;
};

}  // namespace tumbler
