#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/primitive.h"
#include "common/status.h"
#include "firmware_interface/can/bus.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/drives/drive.h"
#include "runtime/core/faults.h"
#include "runtime/core/safety.h"

namespace tumbler {

/// What the operator, or the program that stands for one, asks in one tick.
enum class OperatorCommand : std::uint8_t {
  kNone,
  kArm,          ///< disarmed -> arming -> holding, at the measured position.
  kMoveToStart,  ///< holding -> moving to start -> holding.
  kRun,          ///< holding at the start -> running -> settling -> ... -> holding.
  kStop,    ///< Anything that moves -> stopping -> holding; the fault table's row kOperatorStop.
  kDisarm,  ///< Any state -> disarmed: torque off at once.
  kClearFaults,  ///< disarmed: forgets the latched faults, and tells the drives to forget theirs.
  kFinish,       ///< running, settling: end at the next safe node.
  kBranch,       ///< running, settling: take `TickInput::branch` where there is one.
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
  kNotAtStart,     ///< A joint's commanded position is not the primitive's first: move to the start
                   ///< [rad].
  kOutsideStartSet,  ///< A joint is measured too far from the primitive's first position [rad].
  kNoSuchBranch,     ///< The sequence has no branch of this number [the number].
  kNoHeartbeat,      ///< A drive's heartbeat has stopped [ticks since the last].
};

[[nodiscard]] const char* ToString(OperatorCommand command) noexcept;
[[nodiscard]] const char* ToString(Refusal refusal) noexcept;

/// A refusal with its numbers, in the unit of the refusal.
struct RefusalDetail {
  float value = 0;
  float limit = 0;
  Refusal refusal = Refusal::kNone;
  std::int8_t joint = -1;
};

/// All that the world tells the executor in one tick.
struct TickInput {
  std::int64_t tick = 0;  ///< Control periods since the schedule began; grows by one, and by more
                          ///< after a missed one.
  std::span<const ReceivedFrame> received;  ///< Since the tick before, in order.
  Status receive_status = Status::kOk;      ///< kOk or kWouldBlock while the link is up.
  Status send_status = Status::kOk;         ///< First failure of sending the tick before's frames.
  OperatorCommand command = OperatorCommand::kNone;
  std::int8_t branch = -1;  ///< The number that belongs to kBranch.
  CanControllerState controller = CanControllerState::kErrorActive;
};

/// What the replies of one drive in one tick are worth, as AUTOSAR's end-to-end protection has it.
/// None of the protocols numbers its frames, so this is told by counting them against the setpoints
/// (`ReplyRhythm`). Not to be known are a reply that took the place of a lost one, and, of a drive
/// that sends by its own clock, a repeated one within its rate.
enum class ReplyStatus : std::uint8_t {
  kOk,             ///< New, and as many as there should be.
  kNoNewData,      ///< None.
  kRepeated,       ///< More than setpoints are unanswered.
  kOkSomeLost,     ///< New, after ticks without.
  kWrongSequence,  ///< Those of earlier ticks came together with a newer one.
};
[[nodiscard]] const char* ToString(ReplyStatus status) noexcept;

/// What a drive measured of its joint.
struct JointMeasurement {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;
};

/// One joint in one tick: planned, limited, as encoded on the wire, and measured.
struct JointRecord {
  JointSetpoint planned;
  float planned_acceleration_rad_s2 = 0;  ///< s^2 q''(s t) while running, else zero.
  JointSetpoint limited;
  JointSetpoint encoded;
  JointMeasurement measured;  ///< From the reply to the tick before's setpoint.
  float temperature_c = 0;
  std::int32_t reply_age_ticks = -1;  ///< 0: replied since the tick before; -1: never.
  DriveState drive_state = DriveState::kUnknown;
  ReplyStatus reply_status = ReplyStatus::kOk;
  std::uint32_t drive_error = 0;  ///< The drive's own code.
  bool limit_active = false;      ///< planned was outside a limit.
};

/// Everything about one tick. Trivially copyable: it goes into rings and logs as it is.
struct TickRecord {
  std::int64_t tick = 0;
  float primitive_time_s = 0;                      ///< Position in the primitive, 0 ... duration.
  std::uint32_t faults = 0;                        ///< Latched: bit i is Fault i.
  ExecutorState state = ExecutorState::kDisarmed;  ///< In which this tick's frames were planned.
  Reaction reaction = Reaction::kIgnore;           ///< Carried out in state kFault.
  OperatorCommand command = OperatorCommand::kNone;
  std::uint8_t joint_count = 0;
  std::int8_t node = 0;     ///< Of the sequence: the one being played, or played last.
  std::int32_t cycles = 0;  ///< Complete, since kRun.
  FaultDetail first_fault;  ///< Since the last clear: the cause, not its consequences.
  RefusalDetail refusal;    ///< Of this tick's command.
  std::array<JointRecord, kMaxJoints> joints;
};

/// Frames to send and the record of the tick. What lies beyond `record.joint_count` is left as it
/// was.
struct TickOutput {
  std::array<FrameBatch, kMaxJoints> frames;
  TickRecord record;
};

}  // namespace tumbler
