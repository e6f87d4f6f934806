#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/primitive.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/drives_toml.h"

namespace tumbler::testing {

/// One line of a `candump -L` log.
struct LoggedFrame {
  double time_s = 0;
  CanFrame frame;
};

/// @throws std::runtime_error  naming the line that is not one of `candump -L`.
std::vector<LoggedFrame> ParseCandumpLog(std::string_view text);

/// The rules for the frames of a run.
struct FrameRules {
  DrivesConfig drives;                      ///< In the order of the joints, all of one protocol.
  std::vector<JointLimits<double>> limits;  ///< Of each joint.
  double torque_rise_s = 0.01;              ///< Shortest time of the feed-forward to its limit.
  int ticks_made_up_max = 3;                ///< Steps that a late tick may take at once.
  double start_jump_max_rad = 0.02;  ///< Largest jump from a measurement to the first setpoint.
  double silence_s = 0.1;  ///< After so long without a command a drive has to be started up anew.
  /// For how much of a tick further frames of a joint may follow its first: more where a bus is
  /// simulated with its bit rate, and nearly full.
  double same_tick_share = 0.5;
  /// Whether times are those of the ticks, as in a simulation, and not those on a wire. Then steps
  /// are judged tick by tick.
  bool exact_time = false;
  /// Whether replies may have been spoilt on their way to the host. Frames that are no replies are
  /// ignored then.
  bool spoilt_replies = false;
};

/// The findings in a log. A frame *drives* when it asks for torque towards a position or for
/// feed-forward. Other frames (torque off, neutral, damping, braking) cannot move a joint.
struct FrameReport {
  std::vector<std::string> violations;  ///< With line numbers from 1 on; empty if all rules hold.
  struct Joint {
    int commands = 0;
    int driving = 0;
    int starts = 0;  ///< Times that torque was asked for.
    int replies = 0;
    double step_max_rad = 0;       ///< Largest step between driving frames.
    double start_jump_rad = 0;     ///< Largest jump from a measurement to the first driving frame.
    double last_position_rad = 0;  ///< Of the last driving frame.
  };
  std::vector<Joint> joints;
  double first_command_s = 0;
  double last_command_s = 0;
  double last_driving_s = 0;
  double longest_silence_s = 0;  ///< Longest time between commands.
  double rate_hz = 0;            ///< Of ticks, where there was no silence.
};

/// The last command to a drive.
struct DriveOrder {
  enum class Kind : std::uint8_t {
    kNone,
    kOff,       ///< Torque off.
    kPassive,   ///< A setpoint that cannot move the joint: neutral, damping, braking.
    kSetpoint,  ///< A setpoint that drives.
  };
  Kind kind = Kind::kNone;
  double position_rad = 0;  ///< Of kSetpoint, at the joint.
  double velocity_rad_s = 0;
  double torque_nm = 0;
  double kp_nm_per_rad = 0;  ///< 0 where the protocol does not carry it.
  double kd_nm_s_per_rad = 0;
};

/// Judges the frames between a host and its drives, of any of the protocols. It knows nothing else,
/// and decodes as a drive does, without the host's code. It checks that
/// - nothing but commands and replies of these drives is on the bus;
/// - every tick commands every drive, in order; a broken tick is followed by silence or torque off;
/// - a drive is started up as its protocol has it before it is driven, and anew after torque off or
///   silence: no stale setpoint;
/// - the first driving setpoint is where the drive measured itself;
/// - position, velocity and feed-forward are within limits, to the rounding of the wire, and so are
///   their steps;
/// - no drive's zero is set, no emergency stop is sent, no drive that runs is set up.
///
/// It reserves memory for a few violations, and allocates nothing as long as there are none.
class FrameJudge {
 public:
  explicit FrameJudge(const FrameRules& rules);
  ~FrameJudge();
  FrameJudge(const FrameJudge&) = delete;
  FrameJudge& operator=(const FrameJudge&) = delete;

  void Take(const LoggedFrame& logged);
  [[nodiscard]] const FrameReport& report();
  [[nodiscard]] const DriveOrder& last_order(std::size_t joint) const;

 private:
  class Checker;
  std::unique_ptr<Checker> checker_;
};

/// The same for a whole log.
FrameReport CheckFrames(const std::vector<LoggedFrame>& log, const FrameRules& rules);

}  // namespace tumbler::testing
