#include "firmware_interface/devices/akv3.h"

namespace tumbler {

namespace {

constexpr float kRadPerStep = 0.1F * 3.14159265F / 180;       // of reported positions
constexpr float kRadPerSPerErpmStep = 10 * 3.14159265F / 30;  // of the motor, by pole pairs
constexpr float kAmperePerStep = 0.01F;

CanFrame FrameOf(std::uint32_t id) noexcept {
  CanFrame frame;
  frame.id = id;
  frame.extended = true;
  frame.size = 8;
  return frame;
}

// The eight bytes of a frame as one number, the most significant byte first.
void PackWord(std::uint64_t word, std::array<std::uint8_t, 8>& data) noexcept {
  for (std::size_t i = 0; i < 8; ++i) data[i] = static_cast<std::uint8_t>(word >> (56 - 8 * i));
}
/// @returns false unless it is a data frame of 8 bytes with this function and of this drive.
bool UnpackWord(const CanFrame& frame, std::uint32_t function, std::uint8_t drive,
                std::uint64_t& word) noexcept {
  if (frame.id != AkV3Id(function, drive) || !frame.extended || frame.remote || frame.size != 8)
    return false;
  word = 0;
  for (const std::uint8_t byte : frame.data) word = word << 8 | byte;
  return true;
}
constexpr std::uint64_t GainsWord(std::uint32_t kp, std::uint32_t kd) noexcept {
  return std::uint64_t{kp} << 52 | std::uint64_t{kd} << 40;
}
constexpr std::uint64_t MotionWord(std::uint32_t p, std::uint32_t v, std::uint32_t t) noexcept {
  return std::uint64_t{p} << 24 | std::uint64_t{v} << 12 | std::uint64_t{t};
}

}  // namespace

Status AkV3Config::Validate() const noexcept {
  const bool valid = range.AreValid() && pole_pairs >= 1 && pole_pairs <= 100 &&
                     gear_inside >= 0.1F && gear_inside <= 1000 && status_s >= 0.002 &&
                     status_s <= 0.1 && torque_constant_nm_per_a >= 0 &&
                     torque_constant_nm_per_a <= 1000 && status_per_tick_max >= 1;
  return valid ? joint.Validate() : Status::kInvalidArgument;
}

std::uint16_t AkV3Quantise(float value, const DriveRange& range, int bits) noexcept {
  const auto top = static_cast<std::uint16_t>((1U << bits) - 1);
  if (!(value > range.min)) return 0;
  if (value >= range.max) return top;
  const float steps = static_cast<float>(1U << bits);
  const float code = (value - range.min) * steps / (range.max - range.min) + 0.5F;
  const auto nearest = static_cast<std::uint32_t>(code);
  return nearest < top ? static_cast<std::uint16_t>(nearest) : top;
}

float AkV3Dequantise(std::uint16_t code, const DriveRange& range, int bits) noexcept {
  return static_cast<float>(code) * (range.max - range.min) / static_cast<float>(1U << bits) +
         range.min;
}

CanFrame EncodeAkV3Command(const AkV3Config& config, const ImpedanceCommand& command) noexcept {
  const ImpedanceRanges& range = config.range;
  CanFrame frame = FrameOf(AkV3Id(kAkV3SetpointFunction, config.node_id));
  PackWord(GainsWord(AkV3Quantise(command.kp_nm_per_rad, range.kp_nm_per_rad, 12),
                     AkV3Quantise(command.kd_nm_s_per_rad, range.kd_nm_s_per_rad, 12)) |
               MotionWord(AkV3Quantise(command.position_rad, range.position_rad, 16),
                          AkV3Quantise(command.velocity_rad_s, range.velocity_rad_s, 12),
                          AkV3Quantise(command.torque_nm, range.torque_nm, 12)),
           frame.data);
  return frame;
}

Status DecodeAkV3Command(const AkV3Config& config, const CanFrame& frame,
                         ImpedanceCommand& command) noexcept {
  std::uint64_t word = 0;
  if (!UnpackWord(frame, kAkV3SetpointFunction, config.node_id, word))
    return Status::kInvalidArgument;
  const auto field = [word](int shift, unsigned mask) {
    return static_cast<std::uint16_t>(word >> shift & mask);
  };
  const ImpedanceRanges& range = config.range;
  command = {AkV3Dequantise(field(24, 0xffff), range.position_rad, 16),
             AkV3Dequantise(field(12, 0xfff), range.velocity_rad_s, 12),
             AkV3Dequantise(field(52, 0xfff), range.kp_nm_per_rad, 12),
             AkV3Dequantise(field(40, 0xfff), range.kd_nm_s_per_rad, 12),
             AkV3Dequantise(field(0, 0xfff), range.torque_nm, 12)};
  return Status::kOk;
}

CanFrame EncodeAkV3Status(const AkV3Config& config, const AkV3Status& status) noexcept {
  CanFrame frame = FrameOf(AkV3Id(kAkV3StatusFunction, config.node_id));
  const auto word = [](std::int16_t x) { return std::uint64_t{static_cast<std::uint16_t>(x)}; };
  PackWord(word(status.position) << 48 | word(status.speed) << 32 | word(status.current) << 16 |
               std::uint64_t{static_cast<std::uint8_t>(status.temperature)} << 8 | status.error,
           frame.data);
  return frame;
}

Status DecodeAkV3Status(const AkV3Config& config, const CanFrame& frame,
                        AkV3Status& status) noexcept {
  std::uint64_t word = 0;
  if (!UnpackWord(frame, kAkV3StatusFunction, config.node_id, word))
    return Status::kInvalidArgument;
  status.position = static_cast<std::int16_t>(word >> 48);
  status.speed = static_cast<std::int16_t>(word >> 32);
  status.current = static_cast<std::int16_t>(word >> 16);
  status.temperature = static_cast<std::int8_t>(word >> 8);
  status.error = static_cast<std::uint8_t>(word);
  return Status::kOk;
}

AkV3Drive::Field AkV3Drive::MakeField(const DriveRange& range, int bits, float ratio,
                                      float zero) noexcept {
  const float steps = static_cast<float>(1U << bits);
  const float per_unit = steps / (range.max - range.min);
  Field field;
  field.to_code = ratio * per_unit;
  field.zero_code = -range.min * per_unit - zero * field.to_code;
  field.top = steps - 1;
  field.to_value = 1 / field.to_code;
  field.value_of_zero = range.min / ratio + zero;
  return field;
}

AkV3Drive::AkV3Drive(const AkV3Config& config) noexcept
    : ConfiguredDrive(config, config.Validate()) {
  if (!valid_) return;
  const JointMap& joint = config.joint;
  const float ratio = joint.direction * joint.gear_ratio;
  const ImpedanceRanges& range = config.range;
  position_ = MakeField(range.position_rad, 16, ratio, joint.zero_offset_rad);
  velocity_ = MakeField(range.velocity_rad_s, 12, ratio, 0);
  torque_ = MakeField(range.torque_nm, 12, joint.direction / joint.gear_ratio, 0);
  const float gain_ratio = joint.ToDriveGain(1);
  kp_ = MakeField(range.kp_nm_per_rad, 12, gain_ratio, 0);
  kd_ = MakeField(range.kd_nm_s_per_rad, 12, gain_ratio, 0);
  position_step_ = kRadPerStep / ratio;
  velocity_step_ =
      kRadPerSPerErpmStep / (static_cast<float>(config.pole_pairs) * config.gear_inside) / ratio;
  torque_step_ = kAmperePerStep * joint.ToJointTorque(config.torque_constant_nm_per_a);
}

std::uint32_t AkV3Drive::CodeOf(const Field& field, float value) noexcept {
  const float code = value * field.to_code + field.zero_code;
  if (!(code > 0)) return 0;
  const float nearest = (code < field.top ? code : field.top) + 0.5F;
  return static_cast<std::uint32_t>(nearest);
}

float AkV3Drive::ValueOf(const Field& field, std::uint32_t code) noexcept {
  // (An integer with sign converts in one instruction.)
  return static_cast<float>(static_cast<std::int32_t>(code)) * field.to_value + field.value_of_zero;
}

CanFrame AkV3Drive::EncodeSetpoint(const DriveSetpoint& setpoint) noexcept {
  if (setpoint.kp_nm_per_rad != kp_asked_ || setpoint.kd_nm_s_per_rad != kd_asked_) {
    kp_asked_ = setpoint.kp_nm_per_rad;
    kd_asked_ = setpoint.kd_nm_s_per_rad;
    const std::uint32_t kp = CodeOf(kp_, kp_asked_);
    const std::uint32_t kd = CodeOf(kd_, kd_asked_);
    gains_word_ = GainsWord(kp, kd);
    kp_encoded_ = ValueOf(kp_, kp);
    kd_encoded_ = ValueOf(kd_, kd);
  }
  const std::uint32_t p = CodeOf(position_, setpoint.position_rad);
  const std::uint32_t v = CodeOf(velocity_, setpoint.velocity_rad_s);
  const std::uint32_t t = CodeOf(torque_, setpoint.torque_nm);
  encoded_ = {ValueOf(position_, p), ValueOf(velocity_, v), ValueOf(torque_, t), kp_encoded_,
              kd_encoded_};
  CanFrame frame = FrameOf(AkV3Id(kAkV3SetpointFunction, config_.node_id));
  PackWord(gains_word_ | MotionWord(p, v, t), frame.data);
  return frame;
}

CanFrame AkV3Drive::EncodeOff() noexcept {
  encoded_ = {};
  encoded_.position_rad = feedback_.position_rad;
  ImpedanceCommand off;
  off.position_rad = config_.joint.ToDrivePosition(feedback_.position_rad);
  return EncodeAkV3Command(config_, off);
}

DriveState AkV3Drive::state() const noexcept {
  if (!heard_) return DriveState::kUnknown;
  if (feedback_.error != 0) return DriveState::kFault;
  switch (stage_) {
    case Stage::kOff:
      return DriveState::kDisabled;
    case Stage::kBegin:
      return DriveState::kEnabling;
    case Stage::kHold:
      return IsCertain() ? DriveState::kEnabled : DriveState::kEnabling;
    case Stage::kFollow:
      return DriveState::kEnabled;
  }
  return DriveState::kUnknown;
}

void AkV3Drive::NextStage(bool enable) noexcept {
  if (enable && stage_ == Stage::kFollow) return;  // the usual
  Stage next = stage_;
  const bool certain = IsCertain();
  if (answered_) ++answered_ticks_;
  answered_ = false;
  if (!enable) {
    next = Stage::kOff;
  } else if (stage_ == Stage::kOff) {
    next = Stage::kBegin;
  } else if (certain) {
    next = stage_ == Stage::kBegin ? Stage::kHold : Stage::kFollow;
  }
  if (next == stage_) return;
  if (next == Stage::kHold) hold_rad_ = feedback_.position_rad;
  stage_ = next;
  answered_ticks_ = 0;
}

Status AkV3Drive::Encode(DriveRequest request, const DriveSetpoint& setpoint,
                         FrameBatch& batch) noexcept {
  if (!valid_) return Status::kInvalidArgument;
  if (batch.frames().size() == FrameBatch::kCapacity) return Status::kCapacityExceeded;
  const bool enable = request == DriveRequest::kEnable;
  const bool usable = !enable || setpoint.IsFinite();
  NextStage(enable && usable);
  if (stage_ == Stage::kFollow) return batch.Add(EncodeSetpoint(setpoint));
  if (stage_ == Stage::kHold) {
    return batch.Add(
        EncodeSetpoint({hold_rad_, 0, 0, setpoint.kp_nm_per_rad, setpoint.kd_nm_s_per_rad}));
  }
  const Status added = batch.Add(EncodeOff());
  return usable ? added : Status::kInvalidArgument;
}

bool AkV3Drive::Decode(const CanFrame& frame) noexcept {
  AkV3Status status;
  if (!valid_ || DecodeAkV3Status(config_, frame, status) != Status::kOk) return false;
  feedback_.position_rad =
      static_cast<float>(status.position) * position_step_ + config_.joint.zero_offset_rad;
  feedback_.velocity_rad_s = static_cast<float>(status.speed) * velocity_step_;
  feedback_.torque_nm = static_cast<float>(status.current) * torque_step_;
  feedback_.has_torque = config_.torque_constant_nm_per_a > 0;
  feedback_.temperature_c = static_cast<float>(status.temperature);
  feedback_.has_temperature = true;
  feedback_.error = status.error;
  heard_ = true;
  answered_ = true;
  return true;
}

namespace {

// Source: the manual's CAN_PACKET_ID of the servo mode (0 to 6), and 4.2, force control (8). No
// manual names 7; it is none of a drive's reports.
constexpr std::array kAkV3Frames = {
    HostFrame{0x000, "duty", false, true},
    HostFrame{0x100, "current", false, true},
    HostFrame{0x200, "brake current", false, true},
    HostFrame{0x300, "speed", false, true},
    HostFrame{0x400, "position", false, true},
    HostFrame{0x500, "origin", false, true},
    HostFrame{0x600, "position and speed", false, true},
    HostFrame{0x700, "not in the manual", false, true},
    HostFrame{0x800, "setpoint", false, true},
};
constexpr std::uint32_t kAkV3Kinds = KindBits(kAkV3Frames, 8, true);

}  // namespace

std::span<const HostFrame> AkV3Protocol::HostFrames(const Config& /*config*/) noexcept {
  return kAkV3Frames;
}

bool AkV3Drive::IsCommand(const CanFrame& frame) const noexcept {
  return frame.extended && !frame.remote && (frame.id & 0xff) == config_.node_id &&
         IsKind(kAkV3Kinds, frame.id >> 8);
}

bool AkV3Protocol::CommandedPosition(const AkV3Config& config, const CanFrame& frame,
                                     double& shaft_rad) noexcept {
  ImpedanceCommand command;
  if (DecodeAkV3Command(config, frame, command) != Status::kOk || command.kp_nm_per_rad <= 0)
    return false;
  shaft_rad = double{command.position_rad};
  return true;
}

bool AkV3Protocol::ReportedPosition(const AkV3Config& config, const CanFrame& frame,
                                    double& shaft_rad) noexcept {
  AkV3Status status;
  if (DecodeAkV3Status(config, frame, status) != Status::kOk) return false;
  shaft_rad = double{static_cast<float>(status.position) * kRadPerStep};
  return true;
}

const char* AkV3Protocol::ErrorName(std::uint32_t error) noexcept {
  constexpr std::array<const char*, 8> kNames = {
      nullptr,         "motor too hot", "over-current",        "over-voltage",
      "under-voltage", "encoder",       "transistors too hot", "motor stalled"};
  return error < kNames.size() ? kNames[error] : nullptr;
}

}  // namespace tumbler
