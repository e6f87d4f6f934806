#pragma once

#include <span>

#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/protocols.h"

namespace tumbler::testing {

/// Judging is done in double precision.
[[nodiscard]] constexpr double Wide(float x) noexcept { return static_cast<double>(x); }

/// What the frames of one tick ask of one drive, in the joint's units.
struct WireOrder {
  enum class Kind {
    kNothing,   ///< There is no frame for the drive.
    kOff,       ///< Torque off, or a frame that does not change that it is off.
    kPrepare,   ///< The torque is to come on, or what has to be said before.
    kSetpoint,  ///< A setpoint that a drive that is on follows.
    kBrake,     ///< Only the motion is to be resisted.
    kForbidden  ///< What no host may send: another zero, an emergency stop, an unknown command.
  };
  Kind kind = Kind::kNothing;
  double position_rad = 0, velocity_rad_s = 0, torque_nm = 0;
  double kp_nm_per_rad = 0, kd_nm_s_per_rad = 0;  ///< Zero where the protocol does not carry them.
  bool has_feed_forward = true;

  /// Whether it draws the joint to its position.
  [[nodiscard]] bool is_stiff(bool carries_gains) const {
    return kind == Kind::kSetpoint && (!carries_gains || kp_nm_per_rad > 0);
  }
};

/// Steps of the numbers on the wire, at the joint; 0: as fine as floats.
struct WireGrid {
  double position_rad = 0, velocity_rad_s = 0, torque_nm = 0;
  double kp_nm_per_rad = 0, kd_nm_s_per_rad = 0;
};

/// Reads what one drive is sent, as the drive does and without the host's code.
class WireReader {
 public:
  explicit WireReader(const DriveConfig& config);

  [[nodiscard]] WireOrder Read(std::span<const CanFrame> frames);
  [[nodiscard]] const WireGrid& grid() const { return grid_; }
  [[nodiscard]] bool carries_gains() const { return carries_gains_; }
  /// Whether a frame has a measured position of this drive.
  [[nodiscard]] bool IsPosition(const CanFrame& frame) const;

 private:
  void ReadMit(const MitConfig& mit, const CanFrame& frame, WireOrder& order) const;
  void ReadAkV3(const AkV3Config& ak, const CanFrame& frame, WireOrder& order) const;
  void ReadCanSimple(const CanSimpleConfig& can, const CanFrame& frame, WireOrder& order);
  void ReadCia402(const Cia402Config& node, const CanFrame& frame, WireOrder& order) const;
  void ToJoint(WireOrder& order) const;

  DriveConfig config_;
  JointMap map_;
  WireGrid grid_;
  bool carries_gains_ = false;
  bool on_ = false;  // CANSimple: whether closed loop was asked for since the last idle
};

}  // namespace tumbler::testing
