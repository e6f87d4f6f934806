#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/core/primitive.h"
#include "common/core/status.h"
#include "firmware_interface/can/bus.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/drive.h"
#include "runtime/executor/faults.h"
#include "runtime/executor/pitch_estimate.h"
#include "runtime/executor/safety.h"

namespace tumbler {

/// A command of the operator, or of the program that stands for one, in one tick.
enum class OperatorCommand : std::uint8_t {
  kNone,
  /// disarmed -> arming -> holding, at the measured position.
  kArm,
  /// holding -> moving to start -> holding.
  kMoveToStart,
  /// holding at the start -> running -> settling -> ... -> holding.
  kRun,
  /// Any state that moves -> stopping -> holding, by the fault table's row kOperatorStop.
  kStop,
  /// Any state -> disarmed: torque off at once.
  kDisarm,
  /// In disarmed: forgets the latched faults, and tells the drives to forget theirs.
  kClearFaults,
  /// In running and settling: ends at the next safe node.
  kFinish,
  /// In running and settling: takes `TickInput::branch` as soon as a node offers it.
  kBranch,
  /// In holding, and after a fault: stiffness and feed-forward fade away. A robot that leans on
  /// something sinks then, instead of dropping when the torque is taken off.
  kLower,
  /// After a fault that is answered by a hold in the pose at a node's end: goes on to the next safe
  /// node, as kFinish does. The faults stay latched, and new ones are answered as ever.
  kGoHome,
};

/// Why a command was not followed. A refusal changes nothing.
enum class Refusal : std::uint8_t {
  kNone,
  kWrongState,
  kNotConfigured,
  kFaultLatched,   ///< Clear the faults first.
  kNoReply,        ///< A drive is silent [ticks since its last reply].
  kDriveError,     ///< A drive reports an error [its code].
  kTooHot,         ///< [degrees C]
  kOutsideLimits,  ///< A joint is measured outside its position limits [rad].
  /// A joint's commanded position is not the primitive's first one [rad]: move to the start.
  kNotAtStart,
  kOutsideStartSet,  ///< A joint is measured too far from the primitive's first position [rad].
  kNoSuchBranch,     ///< The sequence has no branch of this number [the number].
  kNoHeartbeat,      ///< A drive's heartbeat has stopped [ticks since the last].
  kFarFromStart,     ///< A joint is measured farther from the motion's start than is allowed [rad].
  kTurnsLost,      ///< A joint is whole turns of its drive away from where it was last known [rad].
  kMoved,          ///< A joint is farther than is allowed from where it was last known [rad].
  kPitchUnknown,   ///< The sensor does not tell how the robot lies [its `SensorStatus`].
  kNotAtRest,      ///< The robot turns faster than one that lies [rad/s].
  kLiesOtherwise,  ///< The measured pitch is too far from that of every allowed beginning [rad].
};

[[nodiscard]] const char* ToString(OperatorCommand command) noexcept;
[[nodiscard]] const char* ToString(Refusal refusal) noexcept;
[[nodiscard]] DetailUnit UnitOf(Refusal refusal) noexcept;

/// A refusal with its numbers, in `UnitOf(refusal)`.
struct RefusalDetail {
  DetailNumber value;
  DetailNumber limit;
  Refusal refusal = Refusal::kNone;
  std::int8_t joint = -1;
};

/// All that the world tells the executor in one tick.
struct TickInput {
  /// Control periods since the schedule began. Grows by one, and by more after missed periods.
  std::int64_t tick = 0;
  /// This tick's deadline, on the clock that frames are stamped with: how old a frame is follows
  /// from it. Where there is no such clock all are zero, and every frame counts as new.
  std::int64_t time_ns = 0;
  /// Frames received since the tick before, in order.
  std::span<const ReceivedFrame> received;
  /// kOk or kWouldBlock while the link is up.
  Status receive_status = Status::kOk;
  /// The first failure in sending the frames of the tick before.
  Status send_status = Status::kOk;
  OperatorCommand command = OperatorCommand::kNone;
  /// The branch's number for kBranch.
  std::int8_t branch = -1;
  CanControllerState controller = CanControllerState::kErrorActive;
};

/// A judgement of one drive's replies in one tick, with the terms of AUTOSAR's end-to-end
/// protection. None of the protocols numbers its frames, so replies are counted against setpoints
/// (`ReplyRhythm`). Two things cannot be noticed: a repeated reply in the place of a lost one, and
/// a repeated one within the rate of a drive that sends by its own clock.
enum class ReplyStatus : std::uint8_t {
  kOk,          ///< New, and as many as there should be.
  kNoNewData,   ///< No reply.
  kRepeated,    ///< More replies than setpoints are unanswered.
  kOkSomeLost,  ///< New, after ticks without a reply.
  kOkSomeLate,  ///< New, together with replies of earlier ticks that had not come.
};
[[nodiscard]] const char* ToString(ReplyStatus status) noexcept;

/// The measurement of a joint by its drive.
struct JointMeasurement {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;  ///< NaN where the drive has not reported it, as at first.
};

/// One joint in one tick: planned, limited, as encoded on the wire, and measured.
struct JointRecord {
  JointSetpoint planned;
  float planned_acceleration_rad_s2 = 0;  ///< s^2 q''(s t) while running, else zero.
  JointSetpoint limited;
  JointSetpoint encoded;
  JointMeasurement measured;  ///< From the reply to the setpoint of the tick before.
  float temperature_c = 0;
  std::int32_t reply_age_ticks = -1;  ///< 0: there was a reply since the tick before; -1: never.
  DriveState drive_state = DriveState::kUnknown;
  ReplyStatus reply_status = ReplyStatus::kOk;
  std::uint32_t drive_error = 0;  ///< The drive's own code.
  bool limit_active = false;      ///< Whether `planned` was outside a limit.
  float correction_rad = 0;       ///< Of the position by the feedback, in `planned`.
};

/// The inertial sensor in one tick, and what the feedback makes of it.
struct SensorRecord {
  float pitch_rad = 0;   ///< Of the sensor's link, by its last report.
  float rate_rad_s = 0;  ///< Of that pitch.
  /// Error of the absolute angle that is fed back, and of its rate: the last that were known.
  float error_rad = 0;
  float rate_error_rad_s = 0;
  float share = 0;              ///< Of the feedback that is in force, 0 ... 1.
  std::int32_t age_ticks = -1;  ///< Ticks since the last report; -1: never.
  SensorStatus status = SensorStatus::kNone;
};

/// Everything about one tick. Trivially copyable: it goes into rings and logs as it is.
struct TickRecord {
  std::int64_t tick = 0;
  float primitive_time_s = 0;                      ///< Time in the primitive, 0 ... duration.
  std::uint32_t faults = 0;                        ///< Latched faults: bit i is Fault i.
  ExecutorState state = ExecutorState::kDisarmed;  ///< In which this tick's frames were planned.
  Reaction reaction = Reaction::kIgnore;           ///< Carried out in state kFault.
  OperatorCommand command = OperatorCommand::kNone;
  std::uint8_t joint_count = 0;
  std::int8_t node = 0;     ///< The node of the sequence that is played, or was played last.
  std::int32_t cycles = 0;  ///< Complete cycles since kRun.
  FaultDetail first_fault;  ///< The first since the last clear: the cause, not a consequence.
  RefusalDetail refusal;    ///< Of this tick's command.
  SensorRecord sensor;      ///< Left as it was where there is no sensor; so are corrections.
  std::array<JointRecord, kMaxJoints> joints;
};

/// The frames to send, and the record of the tick. Entries beyond `record.joint_count` are left as
/// they were.
struct TickOutput {
  std::array<FrameBatch, kMaxJoints> frames;
  TickRecord record;
};

}  // namespace tumbler
