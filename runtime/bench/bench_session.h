#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware_interface/devices/drive_bank.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/bench/bench_world.h"
#include "runtime/executor/safety.h"

namespace tumbler {

/// Thrown when a drive or the bus does something that it must not while a motor is driven. The
/// torque is off when it is caught outside the session.
class BenchFault : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};
/// Thrown by Tick after Ctrl-C, SIGTERM or SIGHUP, and after a request towards rest.
class BenchInterrupted : public std::runtime_error {
 public:
  explicit BenchInterrupted(const OperatorWish& wish)
      : std::runtime_error("interrupted"), wish_(wish) {}
  /// What was asked for.
  [[nodiscard]] const OperatorWish& wish() const { return wish_; }

 private:
  OperatorWish wish_;
};

/// Takes what the operator wishes: all that can be wished for here is an end.
/// @throws BenchInterrupted  when it is.
void EndWhereAsked();

/// What no setpoint of the bench exceeds, at the joint. Protocols that carry no gains have those of
/// the drive; then amplitude and speed are what bounds a motion.
struct BenchBounds {
  double amplitude_rad = 0.1;  ///< Distance from where the joint was when it was enabled.
  double speed_rad_s = 0.5;
  double torque_nm = 1;  ///< Of the stiffness and of the feed-forward.
  double kp_nm_per_rad = 5;
  double kd_nm_s_per_rad = 0.2;
};

/// The exchange with a drive, for the statistics of replies.
struct ReplyTimes {
  std::vector<std::int64_t> asked_ns;    ///< When a tick's frames to the drive were given away.
  std::vector<std::int64_t> arrived_ns;  ///< When measured positions ended on the wire.
  std::vector<double> torques_nm;        ///< What the drive reported with each of them.
};

/// A value that a drive reported, and when that ended on the wire.
struct ReportedValue {
  std::int64_t time_ns = 0;
  double value = 0;
};
/// What a drive was asked for, as it reads it from the frame, and when the frame was given away.
struct AskedSetpoint {
  std::int64_t time_ns = 0;
  DriveSetpoint setpoint;
};
/// What went to and fro while a drive was driven, in the joint's units by the drives file.
struct DriveRecording {
  std::vector<AskedSetpoint> asked;
  std::vector<ReportedValue> positions_rad;
  std::vector<ReportedValue> velocities_rad_s;
  std::vector<ReportedValue> torques_nm;  ///< Empty where the drive reports none.
};

/// The drives of a file on a bench: the loop that speaks with all of them, of which at most one is
/// driven at a time.
///
/// Every tick writes every drive, so that watchdogs are fed and protocols' own frames are sent;
/// drives that are not driven are told to be off. Whatever ends the session takes the torque off.
class BenchSession {
 public:
  BenchSession(BenchWorld& world, const DrivesConfig& drives, const BenchBounds& bounds);
  ~BenchSession();
  BenchSession(const BenchSession&) = delete;
  BenchSession& operator=(const BenchSession&) = delete;

  [[nodiscard]] std::size_t size() const { return drives_.drives.size(); }
  [[nodiscard]] const DriveEntry& entry(std::size_t drive) const { return drives_.drives[drive]; }
  [[nodiscard]] const Drive& drive(std::size_t drive) const { return *bank_.drives()[drive]; }
  [[nodiscard]] double position_rad(std::size_t drive) const;
  [[nodiscard]] const BenchBounds& bounds() const { return bounds_; }
  [[nodiscard]] double period_s() const { return static_cast<double>(period_ns_) * 1e-9; }
  [[nodiscard]] std::int64_t now_ns() const { return world_.clock().now_ns(); }
  [[nodiscard]] BenchWorld& world() { return world_; }
  /// Refuses a position that is out of date. @throws BenchFault  when the drive has not reported
  /// its position for SilenceLimit_s.
  void RequireHeard(std::size_t drive) const;
  /// The longest time between two positions of a drive: 50 ms, 8 ticks, or 8 of the periods in
  /// which a drive sends by itself, whichever is longest [s].
  [[nodiscard]] double SilenceLimit_s(std::size_t drive) const;
  /// The drive in words, such as `drive mit 1 (leg1)`.
  [[nodiscard]] std::string NameOf(std::size_t drive) const;

  /// One period: writes every drive, sleeps, and takes what has come.
  /// @throws BenchInterrupted; BenchFault about the driven drive.
  void Tick();
  /// Ticks for a time.
  void Wait(double time_s);
  /// Ticks until every drive has reported its position, at most for as long as protocols need.
  /// @returns the drives that have not.
  [[nodiscard]] std::vector<std::size_t> AwaitReplies();
  /// Asks all drives to forget latched errors, for long enough that they can.
  void ClearErrors();

  /// Makes a drive the driven one, holding where it is.
  /// @throws BenchFault  when it does not become enabled, or reports an error.
  void Enable(std::size_t drive);
  /// One tick in which the driven drive is asked for this position and velocity of its joint, as
  /// far as the bounds and the joint's distance from where it began allow, and pushes with a torque
  /// besides. Stiffness times the distance from the measured position, damping times the velocity,
  /// and the push, which is a quarter of the torque at most, together stay within the torque.
  void Follow(double position_rad, double velocity_rad_s, double torque_nm = 0);
  /// One tick in which the driven drive pushes with this torque, within the bounds, and holds
  /// nothing.
  void Push(double torque_nm);
  /// Leaves the driven drive alone, sending nothing, until a time, or until it is seen not enabled
  /// or outside the amplitude.
  /// @returns when it was first seen not enabled [ns]; -1: it was not.
  [[nodiscard]] std::int64_t StaySilentUntil(std::int64_t time_ns);
  /// Whether the driven joint was last seen farther than the amplitude from where it was enabled.
  [[nodiscard]] bool Strayed() const;
  /// Tells the driven drive once to be off, and waits for the one reply to that, for a moment at
  /// most. It tells of the moment before.
  void AskOffOnce();
  /// Asks every drive once, all off, and listens without asking again: until every drive that is
  /// `awaited` has answered and `after_s` more have gone by, or for `at_most_s`. What came is in
  /// `replies`; it answers this question if nothing earlier was under way.
  void AskAllOnce(const std::vector<bool>& awaited, double after_s, double at_most_s);
  /// Listens without asking until nothing has come for a time.
  /// @returns false when something still came after `at_most_s`.
  [[nodiscard]] bool ListenUntilQuiet(double quiet_s, double at_most_s);
  /// Ends driving. Ticks until the drive reports that it is off, for a second at most.
  void TorqueOff();

  /// Lets a drive that is off take the place of its joint as its own zero.
  /// @throws Refused  where the protocol has no such command.
  void ZeroEncoder(std::size_t drive);

  /// Gains for the next Enable, in place of those of the bounds.
  void SetGains(double kp_nm_per_rad, double kd_nm_s_per_rad);
  /// The position may move by this in a tick, whatever the speed allows; for steps. Until
  /// TorqueOff.
  void AllowStep(double step_rad) { step_rad_ = step_rad; }

  /// Joint positions within which setpoints stay, where the joint's zero is known. Default: none.
  void SetLimits(std::size_t drive, double lower_rad, double upper_rad);

  /// Begins to record the driven drive, until TorqueOff or TakeRecording.
  void Record();
  /// What was recorded. Nothing is recorded any more.
  DriveRecording TakeRecording();

  /// Begins the statistics of replies anew.
  void ResetReplies();
  [[nodiscard]] const ReplyTimes& replies(std::size_t drive) const { return replies_[drive]; }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  struct Limits {
    double lower_rad = -std::numeric_limits<double>::infinity();
    double upper_rad = std::numeric_limits<double>::infinity();
  };

  void Send(DriveRequest others);
  void Receive();
  void Note(const ReceivedFrame& received, bool position);
  void SleepPeriod();
  void CheckDriven() const;
  void AwaitOff(std::size_t drive);
  void OffQuietly() noexcept;
  [[nodiscard]] SafetyLimits GateOf(std::size_t drive) const;

  BenchWorld& world_;
  DrivesConfig drives_;
  BenchBounds bounds_;
  std::int64_t period_ns_;
  std::int64_t deadline_ns_;
  DriveBank bank_;
  std::vector<Limits> limits_;
  std::vector<ReplyTimes> replies_;
  std::vector<std::int64_t> heard_ns_;  // of the last measured position; -1: never
  std::size_t driven_ = kNone;
  bool following_ = false;  // whether the driven drive was enabled, and is to stay so
  DriveSetpoint setpoint_;
  JointSetpoint previous_;
  double origin_rad_ = 0;
  double step_rad_ = 0;
  bool recording_ = false;
  DriveRecording recorded_;
  double kp_nm_per_rad_;
  double kd_nm_s_per_rad_;
};

}  // namespace tumbler
