#include "firmware_interface/devices/cansimple.h"

#include <array>
#include <bit>
#include <numbers>

#include "firmware_interface/devices/wire.h"

namespace tumbler {

namespace {

/// In how many ticks mode and position are sent before the request for closed loop.
constexpr int kPrepareTicks = 2;

constexpr float kTwoPi = 6.283185307F;
constexpr float kFeedForwardStep = 0.001F;
constexpr float kFeedForwardSteps = 1000.0F;
constexpr float kFeedForwardMax = 32.767F;
constexpr float kPositionMax_rad = 1e6F;  // Floats of turns still have steps below 0.01 turns.

CanFrame FrameOf(std::uint8_t node, CanSimpleCommand command, std::uint8_t size = 8) noexcept {
  return DataFrame(CanSimpleId(node, command), size);
}

bool Is(std::uint8_t node, const CanFrame& frame, CanSimpleCommand command,
        std::uint8_t size = 8) noexcept {
  return frame.id == CanSimpleId(node, command) && !frame.extended && !frame.remote &&
         frame.size >= size && frame.size <= 8;
}

// Messages of two little-endian numbers.
CanFrame TwoFloats(std::uint8_t node, CanSimpleCommand command, float first,
                   float second) noexcept {
  CanFrame frame = FrameOf(node, command);
  StoreFloat(frame.data, 0, first);
  StoreFloat(frame.data, 4, second);
  return frame;
}
CanFrame TwoWords(std::uint8_t node, CanSimpleCommand command, std::uint32_t first,
                  std::uint32_t second) noexcept {
  CanFrame frame = FrameOf(node, command);
  StoreLittle(frame.data, 0, 4, first);
  StoreLittle(frame.data, 4, 4, second);
  return frame;
}
Status TakeFloats(std::uint8_t node, const CanFrame& frame, CanSimpleCommand command, float& first,
                  float& second) noexcept {
  if (!Is(node, frame, command)) return Status::kInvalidArgument;
  first = LoadFloat(frame.data, 0);
  second = LoadFloat(frame.data, 4);
  return Status::kOk;
}
Status TakeWords(std::uint8_t node, const CanFrame& frame, CanSimpleCommand command,
                 std::uint32_t& first, std::uint32_t& second) noexcept {
  if (!Is(node, frame, command)) return Status::kInvalidArgument;
  first = LoadLittle(frame.data, 0, 4);
  second = LoadLittle(frame.data, 4, 4);
  return Status::kOk;
}

constexpr bool IsFinite(float x) noexcept { return 0.0F * x == 0; }

}  // namespace

CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleHeartbeat& value) noexcept {
  CanFrame frame = FrameOf(node, CanSimpleCommand::kHeartbeat);
  StoreLittle(frame.data, 0, 4, value.error);
  frame.data[4] = value.state;
  frame.data[5] = value.procedure_result;
  frame.data[6] = value.trajectory_done ? 1 : 0;
  return frame;
}
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleHeartbeat& value) noexcept {
  if (!Is(node, frame, CanSimpleCommand::kHeartbeat, 7)) return Status::kInvalidArgument;
  value = {LoadLittle(frame.data, 0, 4), frame.data[4], frame.data[5], (frame.data[6] & 1) != 0};
  return Status::kOk;
}

CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleErrors& value) noexcept {
  return TwoWords(node, CanSimpleCommand::kGetError, value.active, value.disarm_reason);
}
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame, CanSimpleErrors& value) noexcept {
  return TakeWords(node, frame, CanSimpleCommand::kGetError, value.active, value.disarm_reason);
}

CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleAxisState& value) noexcept {
  CanFrame frame = FrameOf(node, CanSimpleCommand::kSetAxisState, 4);
  StoreLittle(frame.data, 0, 4, value.state);
  return frame;
}
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleAxisState& value) noexcept {
  if (!Is(node, frame, CanSimpleCommand::kSetAxisState, 4)) return Status::kInvalidArgument;
  value.state = LoadLittle(frame.data, 0, 4);
  return Status::kOk;
}

CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleEstimates& value) noexcept {
  return TwoFloats(node, CanSimpleCommand::kGetEncoderEstimates, value.position_rev,
                   value.velocity_rev_s);
}
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleEstimates& value) noexcept {
  return TakeFloats(node, frame, CanSimpleCommand::kGetEncoderEstimates, value.position_rev,
                    value.velocity_rev_s);
}

CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleControllerMode& value) noexcept {
  return TwoWords(node, CanSimpleCommand::kSetControllerMode, value.control, value.input);
}
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleControllerMode& value) noexcept {
  return TakeWords(node, frame, CanSimpleCommand::kSetControllerMode, value.control, value.input);
}

CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleInputPos& value) noexcept {
  CanFrame frame = FrameOf(node, CanSimpleCommand::kSetInputPos);
  StoreFloat(frame.data, 0, value.position_rev);
  const auto code = [](float x) {
    return static_cast<std::uint16_t>(RoundToInt16(x * kFeedForwardSteps));
  };
  StoreLittle(frame.data, 4, 2, code(value.velocity_rev_s));
  StoreLittle(frame.data, 6, 2, code(value.torque_nm));
  return frame;
}
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleInputPos& value) noexcept {
  if (!Is(node, frame, CanSimpleCommand::kSetInputPos)) return Status::kInvalidArgument;
  value.position_rev = LoadFloat(frame.data, 0);
  value.velocity_rev_s = static_cast<float>(LoadInt16(frame.data, 4)) * kFeedForwardStep;
  value.torque_nm = static_cast<float>(LoadInt16(frame.data, 6)) * kFeedForwardStep;
  return Status::kOk;
}

CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleInputVel& value) noexcept {
  return TwoFloats(node, CanSimpleCommand::kSetInputVel, value.velocity_rev_s, value.torque_nm);
}
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleInputVel& value) noexcept {
  return TakeFloats(node, frame, CanSimpleCommand::kSetInputVel, value.velocity_rev_s,
                    value.torque_nm);
}

CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleTemperature& value) noexcept {
  return TwoFloats(node, CanSimpleCommand::kGetTemperature, value.fet_c, value.motor_c);
}
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleTemperature& value) noexcept {
  return TakeFloats(node, frame, CanSimpleCommand::kGetTemperature, value.fet_c, value.motor_c);
}

CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleTorques& value) noexcept {
  return TwoFloats(node, CanSimpleCommand::kGetTorques, value.target_nm, value.estimate_nm);
}
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame, CanSimpleTorques& value) noexcept {
  return TakeFloats(node, frame, CanSimpleCommand::kGetTorques, value.target_nm, value.estimate_nm);
}

CanFrame EncodeCanSimpleEstop(std::uint8_t node) noexcept {
  return FrameOf(node, CanSimpleCommand::kEstop, 0);
}
CanFrame EncodeCanSimpleClearErrors(std::uint8_t node) noexcept {
  return FrameOf(node, CanSimpleCommand::kClearErrors, 1);  // The byte asks for no blinking.
}

Status CanSimpleConfig::Validate() const noexcept {
  if (node_id > kCanSimpleNodeMax || heartbeat_ticks_max < 1 || estimates_per_tick_max < 1) {
    return Status::kInvalidArgument;
  }
  if (!range.position_rad.ContainsZeroWithin(kPositionMax_rad) ||
      !range.velocity_rad_s.ContainsZeroWithin(kFeedForwardMax * kTwoPi * 1.000001F) ||
      !range.torque_nm.ContainsZeroWithin(kFeedForwardMax)) {
    return Status::kInvalidArgument;
  }
  return joint.Validate();
}

CanSimpleDrive::CanSimpleDrive(const CanSimpleConfig& config) noexcept
    : ConfiguredDrive(config, config.Validate()) {
  if (!valid_) return;
  const float ratio = config.joint.direction * config.joint.gear_ratio;
  position_to_rev_ = ratio / kTwoPi;
  position_to_rad_ = kTwoPi / ratio;
  torque_to_nm_ = 1 / ratio;
  torque_from_nm_ = ratio;
  position_rev_ = {config.range.position_rad.min / kTwoPi, config.range.position_rad.max / kTwoPi};
  velocity_rev_s_ = {config.range.velocity_rad_s.min / kTwoPi,
                     config.range.velocity_rad_s.max / kTwoPi};
  velocity_codes_ = WholeSteps(velocity_rev_s_, kFeedForwardSteps);
  torque_codes_ = WholeSteps(config.range.torque_nm, kFeedForwardSteps);
}

void CanSimpleDrive::NoteError() noexcept {
  feedback_.error = heartbeat_.error != 0 ? heartbeat_.error : active_error_;
  if (feedback_.error == 0 && stage_ == Stage::kTripped) feedback_.error = disarm_reason_;
}

DriveState CanSimpleDrive::state() const noexcept {
  if (!IsStateKnown() && heartbeat_age_ < kNeverHeard) return DriveState::kLost;
  if (!has_estimates_ || !IsStateKnown()) return DriveState::kUnknown;
  if (HasError()) return DriveState::kFault;
  const bool closed = heartbeat_.state == kCanSimpleClosedLoop;
  switch (stage_) {
    case Stage::kOff:
      return closed ? DriveState::kEnabled : DriveState::kDisabled;
    case Stage::kRequest:
    case Stage::kPrepare:
      return DriveState::kEnabling;
    case Stage::kWait:
      return closed ? DriveState::kEnabled : DriveState::kEnabling;
    case Stage::kFollow:
      return closed ? DriveState::kEnabled : DriveState::kDisabled;
    case Stage::kTripped:
      return DriveState::kDisabled;
  }
  return DriveState::kUnknown;
}

bool CanSimpleDrive::IsReady() const noexcept {
  return has_estimates_ && IsStateKnown() && !HasError() && IsFinite(feedback_.position_rad) &&
         heartbeat_.state == kCanSimpleIdle;
}

void CanSimpleDrive::NextStage(bool enable) noexcept {
  if (!enable) {
    stage_ = Stage::kOff;
    return;
  }
  switch (stage_) {
    case Stage::kOff:
      failed_result_ = 0;
      stage_ = Stage::kRequest;
      break;
    case Stage::kRequest:
      if (!IsReady()) break;
      hold_rad_ = feedback_.position_rad;
      prepare_ticks_ = 0;
      stage_ = Stage::kPrepare;
      break;
    case Stage::kPrepare:
      if (!IsReady()) {
        stage_ = Stage::kRequest;
        break;
      }
      hold_rad_ = feedback_.position_rad;  // A joint that nobody holds may be moving.
      if (++prepare_ticks_ == kPrepareTicks) {
        wait_ticks_ = 0;
        idle_since_request_ = false;
        stage_ = Stage::kWait;
      }
      break;
    case Stage::kWait:
      if (HasError()) {
        stage_ = Stage::kTripped;
      } else if (heartbeat_.state == kCanSimpleClosedLoop) {
        failed_result_ = 0;
        stage_ = Stage::kFollow;
      } else if (++wait_ticks_ > config_.heartbeat_ticks_max) {
        // When heartbeats after the request still say idle, the request got lost.
        if (idle_since_request_) stage_ = Stage::kRequest;
        wait_ticks_ = 0;
      }
      break;
    case Stage::kFollow:
      if (HasError() || heartbeat_.state != kCanSimpleClosedLoop) stage_ = Stage::kTripped;
      break;
    case Stage::kTripped:
      break;
  }
}

// Sets `encoded_` to what the drive will make of the frame.
CanFrame CanSimpleDrive::EncodePosition(float joint_rad, float joint_rad_s,
                                        float joint_nm) noexcept {
  const float zero = config_.joint.zero_offset_rad;
  const float position = position_rev_.Clamp((joint_rad - zero) * position_to_rev_);
  const std::int16_t velocity_code =
      RoundToInt16(velocity_codes_.Clamp(joint_rad_s * position_to_rev_ * kFeedForwardSteps));
  const std::int16_t torque_code =
      RoundToInt16(torque_codes_.Clamp(joint_nm * torque_to_nm_ * kFeedForwardSteps));
  CanFrame frame = FrameOf(config_.node_id, CanSimpleCommand::kSetInputPos);
  frame.data = StoreWord(std::bit_cast<std::uint32_t>(position) |
                         std::uint64_t{static_cast<std::uint16_t>(velocity_code)} << 32 |
                         std::uint64_t{static_cast<std::uint16_t>(torque_code)} << 48);
  encoded_ = {position * position_to_rad_ + zero,
              static_cast<float>(velocity_code) * kFeedForwardStep * position_to_rad_,
              static_cast<float>(torque_code) * kFeedForwardStep * torque_from_nm_, 0, 0};
  return frame;
}

void CanSimpleDrive::AddSetpoint(const DriveSetpoint& setpoint, FrameBatch& batch) noexcept {
  const std::uint8_t node = config_.node_id;
  const bool brake = setpoint.kp_nm_per_rad == 0;
  if (brake || velocity_mode_) {
    CanSimpleControllerMode mode;
    if (brake) mode.control = kCanSimpleVelocityControl;
    static_cast<void>(batch.Add(EncodeCanSimple(node, mode)));
    velocity_mode_ = brake;
  }
  if (!brake) {
    static_cast<void>(batch.Add(
        EncodePosition(setpoint.position_rad, setpoint.velocity_rad_s, setpoint.torque_nm)));
    return;
  }
  const float velocity = velocity_rev_s_.Clamp(setpoint.velocity_rad_s * position_to_rev_);
  const float torque = config_.range.torque_nm.Clamp(setpoint.torque_nm * torque_to_nm_);
  static_cast<void>(batch.Add(EncodeCanSimple(node, CanSimpleInputVel{velocity, torque})));
  encoded_ = {feedback_.position_rad, velocity * position_to_rad_, torque * torque_from_nm_, 0, 0};
}

Status CanSimpleDrive::Encode(DriveRequest request, const DriveSetpoint& setpoint,
                              FrameBatch& batch) noexcept {
  constexpr std::size_t kMostFrames = 3;
  if (!valid_) return Status::kInvalidArgument;
  if (batch.frames().size() + kMostFrames > FrameBatch::kCapacity) return Status::kCapacityExceeded;
  if (heartbeat_age_ < kNeverHeard - 1) ++heartbeat_age_;
  const bool enable = request == DriveRequest::kEnable;
  const bool usable = !enable || setpoint.IsFinite();
  const Stage before = stage_;
  NextStage(enable && usable);

  const std::uint8_t node = config_.node_id;
  Status added = Status::kOk;
  encoded_ = {};
  encoded_.position_rad = feedback_.position_rad;
  if (stage_ == Stage::kFollow) {
    AddSetpoint(setpoint, batch);
  } else if (stage_ == Stage::kPrepare) {
    added = batch.Add(EncodeCanSimple(node, CanSimpleControllerMode{}));
    velocity_mode_ = false;
    static_cast<void>(batch.Add(EncodePosition(hold_rad_, 0, 0)));
  } else if (stage_ == Stage::kWait) {
    static_cast<void>(batch.Add(EncodePosition(hold_rad_, 0, 0)));
    if (before == Stage::kPrepare) {
      added = batch.Add(EncodeCanSimple(node, CanSimpleAxisState{kCanSimpleClosedLoop}));
    }
  } else {
    if (request == DriveRequest::kClearErrors) {
      static_cast<void>(batch.Add(EncodeCanSimpleClearErrors(node)));
      disarm_reason_ = 0;
    }
    added = batch.Add(EncodeCanSimple(node, CanSimpleAxisState{kCanSimpleIdle}));
    NoteError();
  }
  return usable ? added : Status::kInvalidArgument;
}

bool CanSimpleDrive::Decode(const CanFrame& frame) noexcept {
  if (!valid_ || frame.id >> 5 != config_.node_id) return false;
  const std::uint8_t node = config_.node_id;
  switch (static_cast<CanSimpleCommand>(frame.id & 0x1f)) {
    case CanSimpleCommand::kGetEncoderEstimates: {
      CanSimpleEstimates estimates;
      if (DecodeCanSimple(node, frame, estimates) != Status::kOk) return false;
      feedback_.position_rad =
          estimates.position_rev * position_to_rad_ + config_.joint.zero_offset_rad;
      feedback_.velocity_rad_s = estimates.velocity_rev_s * position_to_rad_;
      has_estimates_ = true;
      return true;
    }
    case CanSimpleCommand::kHeartbeat:
      if (DecodeCanSimple(node, frame, heartbeat_) == Status::kOk) {
        heartbeat_age_ = 0;
        if (heartbeat_.error == 0) active_error_ = 0;
        if (heartbeat_.procedure_result > kCanSimpleBusy)
          failed_result_ = heartbeat_.procedure_result;
        if (stage_ == Stage::kWait && heartbeat_.state == kCanSimpleIdle) {
          idle_since_request_ = true;
        }
        NoteError();
      }
      return false;
    case CanSimpleCommand::kGetError: {
      CanSimpleErrors errors;
      if (DecodeCanSimple(node, frame, errors) == Status::kOk) {
        active_error_ = errors.active;
        disarm_reason_ = errors.disarm_reason;
        NoteError();
      }
      return false;
    }
    case CanSimpleCommand::kGetTorques: {
      CanSimpleTorques torques;
      if (DecodeCanSimple(node, frame, torques) == Status::kOk) {
        feedback_.torque_nm = torques.estimate_nm * torque_from_nm_;
        feedback_.has_torque = true;
      }
      return false;
    }
    case CanSimpleCommand::kGetTemperature: {
      CanSimpleTemperature temperature;
      if (DecodeCanSimple(node, frame, temperature) == Status::kOk) {
        // The hotter of the two counts. A sensor that is not there reads NaN.
        const float fet = IsFinite(temperature.fet_c) ? temperature.fet_c : -273.0F;
        const float motor = IsFinite(temperature.motor_c) ? temperature.motor_c : -273.0F;
        feedback_.temperature_c = fet > motor ? fet : motor;
        feedback_.has_temperature = feedback_.temperature_c > -273.0F;
        if (!feedback_.has_temperature) feedback_.temperature_c = 0;
      }
      return false;
    }
    default:
      return false;
  }
}

namespace {

// Source: ODrive's manual, `CAN Protocol`, its table of messages (firmware 0.6).
constexpr std::array kCanSimpleFrames = {
    HostFrame{0x02, "Estop"},
    HostFrame{0x04, "RxSdo"},
    HostFrame{0x06, "Address"},
    HostFrame{0x07, "Set_Axis_State"},
    HostFrame{0x0b, "Set_Controller_Mode"},
    HostFrame{0x0c, "Set_Input_Pos"},
    HostFrame{0x0d, "Set_Input_Vel"},
    HostFrame{0x0e, "Set_Input_Torque"},
    HostFrame{0x0f, "Set_Limits"},
    HostFrame{0x11, "Set_Traj_Vel_Limit"},
    HostFrame{0x12, "Set_Traj_Accel_Limits"},
    HostFrame{0x13, "Set_Traj_Inertia"},
    HostFrame{0x16, "Reboot"},
    HostFrame{0x18, "Clear_Errors"},
    HostFrame{0x19, "Set_Absolute_Position"},
    HostFrame{0x1a, "Set_Pos_Gain"},
    HostFrame{0x1b, "Set_Vel_Gains"},
    HostFrame{0x1f, "Enter_DFU_Mode"},
};
constexpr std::uint32_t kCanSimpleKinds = KindBits(kCanSimpleFrames, 0);

}  // namespace

std::span<const HostFrame> CanSimpleProtocol::HostFrames(const Config& /*config*/) noexcept {
  return kCanSimpleFrames;
}

bool CanSimpleDrive::IsCommand(const CanFrame& frame) const noexcept {
  if (frame.extended || frame.remote || frame.id >> 5 != config_.node_id) return false;
  const std::uint32_t kind = frame.id & 0x1f;
  if (!IsKind(kCanSimpleKinds, kind)) return false;
  // A drive answers a search with its own number in this message; a host gives it another.
  const bool answer = kind == static_cast<std::uint32_t>(CanSimpleCommand::kAddress) &&
                      frame.size > 0 && frame.data[0] == config_.node_id;
  return !answer;
}

bool CanSimpleProtocol::CommandedPosition(const CanSimpleConfig& config, const CanFrame& frame,
                                          double& shaft_rad) noexcept {
  CanSimpleInputPos command;
  if (DecodeCanSimple(config.node_id, frame, command) != Status::kOk) return false;
  shaft_rad = double{command.position_rev} * (2 * std::numbers::pi);
  return true;
}

bool CanSimpleProtocol::ReportedPosition(const CanSimpleConfig& config, const CanFrame& frame,
                                         double& shaft_rad) noexcept {
  CanSimpleEstimates estimates;
  if (DecodeCanSimple(config.node_id, frame, estimates) != Status::kOk) return false;
  shaft_rad = double{estimates.position_rev} * (2 * std::numbers::pi);
  return true;
}

}  // namespace tumbler
