#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "firmware_interface/devices/joint_map.h"
#include "tests/support/frame_checker.h"

namespace tumbler::testing {

/// Smallest steps of a drive's setpoints on the wire, at its shaft; 0 where it carries floats.
struct WireSteps {
  double position_rad = 0;
  double velocity_rad_s = 0;
  double torque_nm = 0;
  double reported_rad = 0;  ///< Of measured positions, where these are coarser.
};

/// The judge's knowledge of the bus as a whole: whose turn it is, and the findings.
class BusJudge {
 public:
  explicit BusJudge(const FrameRules& rules);

  [[nodiscard]] const FrameRules& rules() const { return rules_; }
  [[nodiscard]] const FrameReport& report();
  void NextLine() { ++line_; }
  void Fail(const std::string& what);
  /// A frame for all drives that opens a tick, such as SYNC.
  void OpenTick(const char* what, double time_s, bool off_before);

 private:
  friend class JointJudge;
  bool CheckOrder(std::size_t joint, double time_s, bool torque_off, bool several);

  FrameRules rules_;
  FrameReport report_;
  int line_ = 0;
  std::size_t current_ = 0;  // joint that had the last command
  std::size_t next_ = 0;
  double tick_begin_s_ = 0;
  double last_tick_s_ = 0;
  double rate_time_s_ = 0;
  int rate_ticks_ = 0;
};

/// The judge's knowledge of one joint. A DriveWatch tells it what the frames to and from its drive
/// mean; for frames of the host it does so between Begin and End.
class JointJudge {
 public:
  /// @param steps  of the wire, at the shaft.
  JointJudge(BusJudge& bus, std::size_t joint, const JointMap& map, const WireSteps& steps);

  /// A command. @param several  whether a tick may bring the joint more than one frame.
  /// @returns whether it is the joint's first in its tick.
  bool Begin(double time_s, bool torque_off, bool several);
  void End(double time_s);

  /// The meanings of commands.
  void Off();
  void Start();                           ///< Torque on. Changes nothing if it is on already.
  void Passive(const DriveOrder& order);  ///< A setpoint that cannot move the joint.
  void Setpoint(DriveOrder order, double time_s);
  void FeedForward(double velocity_rad_s, double torque_nm);  ///< Of the setpoint before.
  /// Checks the position with which the drive is about to begin.
  void CheckJump(double position_rad);

  /// A measured position, at the joint.
  void Reply(double position_rad);

  /// Notes a violation, with the joint's number before it.
  void Fail(const std::string& what);
  void FailUnstarted();

  /// Values of the shaft converted to the joint.
  [[nodiscard]] double Position(double shaft_rad) const;
  [[nodiscard]] double Velocity(double shaft_rad_s) const;
  [[nodiscard]] double Torque(double shaft_nm) const;
  [[nodiscard]] double Gain(double shaft_gain) const;

  [[nodiscard]] BusJudge& bus() { return bus_; }
  [[nodiscard]] bool started() const { return started_; }
  [[nodiscard]] bool passive_before() const { return passive_before_; }
  [[nodiscard]] double last_torque_nm() const { return last_torque_nm_; }
  [[nodiscard]] const DriveOrder& order() const { return order_; }
  /// The steps at the joint, as far as the judge allows for them.
  [[nodiscard]] const WireSteps& steps() const { return steps_; }

 private:
  void Within(const char* what, double value, double min, double max, double slack);
  [[nodiscard]] double TicksSince(double time_s) const;
  void CheckFeedForward(const DriveOrder& order);
  [[nodiscard]] FrameReport::Joint& report() { return bus_.report_.joints[joint_]; }

  BusJudge& bus_;
  std::size_t joint_;
  double direction_, gear_, zero_rad_;
  WireSteps steps_;
  bool commanded_ = false;  // whether there ever was a command
  bool started_ = false;
  bool passive_before_ = false;  // the last setpoint could not move the joint
  bool driven_ = false;          // since it was started
  bool measured_ = false;
  double measured_rad_ = 0;
  double last_s_ = 0;
  double ticks_ = 1;  // since the tick before
  double last_position_rad_ = 0;
  double last_torque_nm_ = 0;
  DriveOrder order_;
};

/// Reads the frames of one joint's drive for the judge, by its protocol. It decodes them itself,
/// without the host's code.
class DriveWatch {
 public:
  explicit DriveWatch(JointJudge& joint) : joint_(joint) {}
  DriveWatch(const DriveWatch&) = delete;
  DriveWatch& operator=(const DriveWatch&) = delete;
  virtual ~DriveWatch() = default;

  /// Whether the identifiers of its frames have 29 bits.
  [[nodiscard]] virtual bool extended() const { return false; }
  /// Takes a data frame with such an identifier. @returns false if it is not this drive's.
  virtual bool Take(const LoggedFrame& logged) = 0;
  /// Takes a frame of 11 bits that is for all drives of the protocol. Only the first joint's watch
  /// is asked.
  virtual bool TakeCommon(const LoggedFrame& /*logged*/) { return false; }

 protected:
  [[nodiscard]] JointJudge& joint() { return joint_; }

 private:
  JointJudge& joint_;
};

// Fields of a payload, low byte first.
[[nodiscard]] std::uint32_t UnsignedField(const CanFrame& frame, std::size_t first,
                                          std::size_t bytes);
[[nodiscard]] double SignedField(const CanFrame& frame, std::size_t first, std::size_t bytes);
[[nodiscard]] double FloatField(const CanFrame& frame, std::size_t first);

}  // namespace tumbler::testing
