#include "firmware_interface/devices/mit.h"

#include <array>
#include <limits>

#include "firmware_interface/devices/damiao_registers.h"

namespace tumbler {

namespace {

constexpr std::uint8_t Low(int value) noexcept { return static_cast<std::uint8_t>(value & 0xff); }

// The firmware's conversion from float to integer. It truncates, and saturates only where the
// processor's instruction does.
std::int32_t FirmwareCode(float value, const DriveRange& range, int bits) noexcept {
  const float steps = static_cast<float>((1 << bits) - 1);
  const float code = (value - range.min) * steps / (range.max - range.min);
  if (!(code > -2147483648.0F)) return code != code ? 0 : std::numeric_limits<std::int32_t>::min();
  if (code >= 2147483648.0F) return std::numeric_limits<std::int32_t>::max();
  return static_cast<std::int32_t>(code);
}

bool IsFrameOf(const CanFrame& frame, std::uint16_t id) noexcept {
  return frame.id == id && !frame.extended && !frame.remote && frame.size <= 8;
}

// The temperature in a reply's byte [degrees C].
int DegreesOf(std::uint8_t byte, MitTemperature encoding) noexcept {
  return encoding == MitTemperature::kOffset40 ? int{byte} - 40
                                               : int{static_cast<std::int8_t>(byte)};
}

std::uint8_t EncodeTemperature(float celsius, MitTemperature encoding) noexcept {
  const float low = encoding == MitTemperature::kOffset40 ? -40.0F : -128.0F;
  const float shifted = celsius - low;
  // To round to nearest, twice the value plus one is halved in integers.
  const int steps =
      shifted >= 255.0F ? 255 : (shifted > 0 ? static_cast<int>(2 * shifted + 1) / 2 : 0);
  return Low(encoding == MitTemperature::kOffset40 ? steps : steps - 128);
}

}  // namespace

Status MitConfig::Validate() const noexcept {
  if (command_id < 1 || command_id > 0xff || reply_id > 0x7ff) {
    return Status::kInvalidArgument;
  }
  if (!command.AreValid() || !reply.AreValid()) return Status::kInvalidArgument;
  return joint.Validate();
}

std::uint16_t MitQuantise(float value, const DriveRange& range, int bits) noexcept {
  const int top = (1 << bits) - 1;
  if (!(value > range.min)) return 0;
  if (value >= range.max) return static_cast<std::uint16_t>(top);
  const float code = (value - range.min) * static_cast<float>(top) / (range.max - range.min) + 0.5F;
  const int nearest = static_cast<int>(code);
  return static_cast<std::uint16_t>(nearest < top ? nearest : top);
}

float MitDequantise(std::uint16_t code, const DriveRange& range, int bits) noexcept {
  return static_cast<float>(code) * (range.max - range.min) / static_cast<float>((1 << bits) - 1) +
         range.min;
}

namespace {

// The fields of (1) as they are on the wire.
struct Codes {
  std::uint16_t p = 0, v = 0, kp = 0, kd = 0, t = 0;
};

// The last byte of the first magic frame.
constexpr int FirstMagic(MitDialect dialect) noexcept {
  return static_cast<int>(dialect == MitDialect::kDamiao ? MitMagic::kClear : MitMagic::kEnter);
}

// Changes the one pattern that would be a magic frame.
void AvoidMagic(MitDialect dialect, Codes& codes) noexcept {
  if (codes.p == 0xffff && codes.v == 0xfff && codes.kp == 0xfff && codes.kd == 0xfff &&
      codes.t >= FirstMagic(dialect) + 0xf00 && codes.t <= 0xffe) {
    codes.p = 0xfffe;
  }
}

Codes Quantise(const MitConfig& config, const ImpedanceCommand& command) noexcept {
  const ImpedanceRanges& ranges = config.command;
  Codes codes{MitQuantise(command.position_rad, ranges.position_rad, 16),
              MitQuantise(command.velocity_rad_s, ranges.velocity_rad_s, 12),
              MitQuantise(command.kp_nm_per_rad, ranges.kp_nm_per_rad, 12),
              MitQuantise(command.kd_nm_s_per_rad, ranges.kd_nm_s_per_rad, 12),
              MitQuantise(command.torque_nm, ranges.torque_nm, 12)};
  AvoidMagic(config.dialect, codes);
  return codes;
}

ImpedanceCommand Dequantise(const ImpedanceRanges& ranges, const Codes& codes) noexcept {
  return {MitDequantise(codes.p, ranges.position_rad, 16),
          MitDequantise(codes.v, ranges.velocity_rad_s, 12),
          MitDequantise(codes.kp, ranges.kp_nm_per_rad, 12),
          MitDequantise(codes.kd, ranges.kd_nm_s_per_rad, 12),
          MitDequantise(codes.t, ranges.torque_nm, 12)};
}

// Packs (1) as one number of 64 bits, the most significant byte first.
void Pack(const Codes& codes, std::array<std::uint8_t, 8>& data) noexcept {
  const std::uint64_t word = std::uint64_t{codes.p} << 48 | std::uint64_t{codes.v} << 36 |
                             std::uint64_t{codes.kp} << 24 | std::uint64_t{codes.kd} << 12 |
                             std::uint64_t{codes.t};
  for (std::size_t i = 0; i < 8; ++i) data[i] = static_cast<std::uint8_t>(word >> (56 - 8 * i));
}

Codes Unpack(const std::array<std::uint8_t, 8>& data) noexcept {
  std::uint64_t word = 0;
  for (const std::uint8_t byte : data) word = word << 8 | byte;
  const auto field = [word](int shift) {
    return static_cast<std::uint16_t>(word >> shift & 0xfff);
  };
  return {static_cast<std::uint16_t>(word >> 48), field(36), field(24), field(12), field(0)};
}

}  // namespace

CanFrame EncodeMitCommand(const MitConfig& config, const ImpedanceCommand& command) noexcept {
  CanFrame frame;
  frame.id = config.command_id;
  frame.size = 8;
  Pack(Quantise(config, command), frame.data);
  return frame;
}

Status DecodeMitCommand(const MitConfig& config, const CanFrame& frame,
                        ImpedanceCommand& command) noexcept {
  MitMagic magic{};
  if (!IsFrameOf(frame, config.command_id) || frame.size != 8 ||
      DecodeMitMagic(config, frame, magic)) {
    return Status::kInvalidArgument;
  }
  command = Dequantise(config.command, Unpack(frame.data));
  return Status::kOk;
}

CanFrame EncodeMitReply(const MitConfig& config, const MitReply& reply) noexcept {
  const std::int32_t p = FirmwareCode(reply.position_rad, config.reply.position_rad, 16);
  const std::int32_t v = FirmwareCode(reply.velocity_rad_s, config.reply.velocity_rad_s, 12);
  const std::int32_t t = FirmwareCode(reply.torque_nm, config.reply.torque_nm, 12);
  CanFrame frame;
  frame.id = config.reply_id;
  frame.size = reply.size < 6 ? std::uint8_t{6} : (reply.size > 8 ? std::uint8_t{8} : reply.size);
  frame.data[0] = reply.sender;
  frame.data[1] = Low(p >> 8);
  frame.data[2] = Low(p);
  frame.data[3] = Low(v >> 4);
  // Firmware adds the nibbles, so that a torque beyond its range spills into the velocity.
  frame.data[4] = Low(((v & 0xf) << 4) + (t >> 8));
  frame.data[5] = Low(t);
  if (frame.size == 8) {
    frame.data[6] = EncodeTemperature(reply.temperature_c, config.temperature_encoding);
    frame.data[7] = reply.error;
  }
  if (config.dialect == MitDialect::kDamiao) {
    const int status = reply.error != 0 ? reply.error : (reply.enabled ? 1 : 0);
    frame.size = 8;
    frame.data[0] = Low(status << 4 | (reply.sender & 0xf));
    frame.data[6] = frame.data[7] =
        EncodeTemperature(reply.temperature_c, config.temperature_encoding);
  }
  return frame;
}

namespace {

bool IsReplyOf(const MitConfig& config, const CanFrame& frame) noexcept {
  if (!IsFrameOf(frame, config.reply_id) || frame.size < 6) return false;
  if (config.dialect == MitDialect::kMiniCheetah) return frame.data[0] == Low(config.command_id);
  return frame.size == 8 && ((frame.data[0] ^ config.command_id) & 0xf) == 0;
}

// What the bytes of a reply say that the dialects have each in their own place.
struct ReplyHealth {
  int temperature_c = 0;
  bool has_temperature = false;
  bool enabled = true;
  std::uint8_t error = 0;
};
ReplyHealth HealthOf(const MitConfig& config, const CanFrame& frame) noexcept {
  if (frame.size < 8) return {};
  const int first = DegreesOf(frame.data[6], config.temperature_encoding);
  if (config.dialect == MitDialect::kMiniCheetah) return {first, true, true, frame.data[7]};
  const int second = DegreesOf(frame.data[7], config.temperature_encoding);
  const auto status = static_cast<std::uint8_t>(frame.data[0] >> 4);
  return {first > second ? first : second, true, status == 1,
          status > 1 ? status : std::uint8_t{0}};
}

// Codes of the fields of (2) that every reply has.
struct ReplyCodes {
  std::uint16_t p = 0, v = 0, t = 0;
};

ReplyCodes UnpackReply(const CanFrame& frame) noexcept {
  const auto d = [&frame](std::size_t i) { return int{frame.data[i]}; };
  const auto code = [](int value) { return static_cast<std::uint16_t>(value); };
  return {code(d(1) << 8 | d(2)), code(d(3) << 4 | d(4) >> 4), code((d(4) & 0xf) << 8 | d(5))};
}

}  // namespace

Status DecodeMitReply(const MitConfig& config, const CanFrame& frame, MitReply& reply) noexcept {
  if (!IsReplyOf(config, frame)) return Status::kInvalidArgument;
  const ReplyCodes codes = UnpackReply(frame);
  reply.sender = Low(config.command_id);
  reply.position_rad = MitDequantise(codes.p, config.reply.position_rad, 16);
  reply.velocity_rad_s = MitDequantise(codes.v, config.reply.velocity_rad_s, 12);
  reply.torque_nm = MitDequantise(codes.t, config.reply.torque_nm, 12);
  const ReplyHealth health = HealthOf(config, frame);
  reply.enabled = health.enabled;
  reply.size = frame.size;
  reply.temperature_c = static_cast<float>(health.temperature_c);
  reply.error = health.error;
  return Status::kOk;
}

CanFrame MitMagicFrame(const MitConfig& config, MitMagic magic) noexcept {
  CanFrame frame;
  frame.id = config.command_id;
  frame.size = 8;
  frame.data.fill(0xff);
  frame.data[7] = static_cast<std::uint8_t>(magic);
  return frame;
}

bool DecodeMitMagic(const MitConfig& config, const CanFrame& frame, MitMagic& magic) noexcept {
  if (!IsFrameOf(frame, config.command_id) || frame.size != 8) return false;
  for (std::size_t i = 0; i < 7; ++i) {
    if (frame.data[i] != 0xff) return false;
  }
  if (frame.data[7] < FirstMagic(config.dialect) || frame.data[7] > 0xfe) return false;
  magic = static_cast<MitMagic>(frame.data[7]);
  return true;
}

MitDrive::MitDrive(const MitConfig& config) noexcept
    : ConfiguredDrive(config, config.Validate()),
      map_(MakeMap(config.joint)),
      command_range_(MakeRange(config.command)),
      reply_range_(MakeRange(config.reply)) {}

MitDrive::LaneMap MitDrive::MakeMap(const JointMap& joint) noexcept {
  const float signed_ratio = joint.direction * joint.gear_ratio;
  return {{joint.zero_offset_rad, -0.0F, -0.0F, -0.0F},
          {signed_ratio, signed_ratio, joint.direction, 1},
          {1, 1, joint.gear_ratio, 1},
          {joint.direction, joint.direction, signed_ratio, 1},
          {joint.gear_ratio, joint.gear_ratio, 1, 1}};
}

MitDrive::LaneRange MitDrive::MakeRange(const ImpedanceRanges& ranges) noexcept {
  const DriveRange& p = ranges.position_rad;
  const DriveRange& v = ranges.velocity_rad_s;
  const DriveRange& t = ranges.torque_nm;
  return {{p.min, v.min, t.min, -0.0F},
          {p.max, v.max, t.max, 1},
          {p.max - p.min, v.max - v.min, t.max - t.min, 1},
          {0xffff, 0xfff, 0xfff, 1}};
}

// MitDequantise and JointMap, lane by lane.
[[gnu::always_inline]] inline MitDrive::Lanes MitDrive::ToJoint(
    const LaneRange& range, const std::array<std::int32_t, 4>& codes) const noexcept {
  Lanes joint;
  for (std::size_t i = 0; i < 4; ++i) {
    const float drive = static_cast<float>(codes[i]) * range.width[i] / range.top[i] + range.min[i];
    joint[i] = map_.to_joint[i] * drive / map_.over_joint[i] + map_.zero[i];
  }
  return joint;
}

void MitDrive::GoTo(Stage stage) noexcept {
  stage_ = stage;
  answered_ticks_ = 0;
}

ImpedanceCommand MitDrive::ToCommand(const DriveSetpoint& setpoint) const noexcept {
  const JointMap& joint = config_.joint;
  return {joint.ToDrivePosition(setpoint.position_rad),
          joint.ToDriveVelocity(setpoint.velocity_rad_s), joint.ToDriveGain(setpoint.kp_nm_per_rad),
          joint.ToDriveGain(setpoint.kd_nm_s_per_rad), joint.ToDriveTorque(setpoint.torque_nm)};
}

// Encodes a setpoint, and sets `encoded_` to the setpoint that the drive will read from the frame.
CanFrame MitDrive::EncodeSetpoint(const DriveSetpoint& setpoint) noexcept {
  const JointMap& joint = config_.joint;
  const ImpedanceRanges& ranges = config_.command;
  if (setpoint.kp_nm_per_rad != gains_.kp_nm_per_rad ||
      setpoint.kd_nm_s_per_rad != gains_.kd_nm_s_per_rad) {
    gains_.kp_nm_per_rad = setpoint.kp_nm_per_rad;
    gains_.kd_nm_s_per_rad = setpoint.kd_nm_s_per_rad;
    const float kp = joint.ToDriveGain(setpoint.kp_nm_per_rad);
    const float kd = joint.ToDriveGain(setpoint.kd_nm_s_per_rad);
    gains_.kp_code = MitQuantise(kp, ranges.kp_nm_per_rad, 12);
    gains_.kd_code = MitQuantise(kd, ranges.kd_nm_s_per_rad, 12);
    gains_.kp_encoded_nm_per_rad =
        joint.ToJointGain(MitDequantise(gains_.kp_code, ranges.kp_nm_per_rad, 12));
    gains_.kd_encoded_nm_s_per_rad =
        joint.ToJointGain(MitDequantise(gains_.kd_code, ranges.kd_nm_s_per_rad, 12));
  }
  // JointMap and MitQuantise, lane by lane; clamping first gives the same codes.
  const Lanes asked{setpoint.position_rad, setpoint.velocity_rad_s, setpoint.torque_nm, 0};
  const LaneRange& range = command_range_;
  std::array<std::int32_t, 4> lanes;
  for (std::size_t i = 0; i < 4; ++i) {
    float x = (asked[i] - map_.zero[i]) * map_.to_drive[i] / map_.over_drive[i];
    x = x > range.min[i] ? x : range.min[i];
    x = x < range.max[i] ? x : range.max[i];
    const float code = (x - range.min[i]) * range.top[i] / range.width[i] + 0.5F;
    lanes[i] = static_cast<std::int32_t>(code < range.top[i] ? code : range.top[i]);
  }
  const auto code = [&lanes](std::size_t i) { return static_cast<std::uint16_t>(lanes[i]); };
  Codes codes{code(0), code(1), gains_.kp_code, gains_.kd_code, code(2)};
  AvoidMagic(config_.dialect, codes);
  lanes[0] = codes.p;
  const Lanes encoded = ToJoint(range, lanes);
  encoded_ = {encoded[0], encoded[1], encoded[2], gains_.kp_encoded_nm_per_rad,
              gains_.kd_encoded_nm_s_per_rad};
  CanFrame frame;
  frame.id = config_.command_id;
  frame.size = 8;
  Pack(codes, frame.data);
  return frame;
}

int MitDrive::answered_ticks() const noexcept { return answered_ticks_ + (answered_ ? 1 : 0); }

DriveState MitDrive::Inferred() const noexcept {
  switch (stage_) {
    case Stage::kStart:
      return DriveState::kUnknown;
    case Stage::kExit:
      return answered_ticks() >= kCertainTicks ? DriveState::kDisabled : before_exit_;
    case Stage::kClear:
    case Stage::kEnter:
      return DriveState::kEnabling;
    case Stage::kNeutral:
      return answered_ticks() >= 1 ? DriveState::kEnabled : DriveState::kEnabling;
    case Stage::kFollow:
      return says_enabled_ ? DriveState::kEnabled : DriveState::kDisabled;
  }
  return DriveState::kUnknown;
}

DriveState MitDrive::state() const noexcept {
  if (stage_ == Stage::kFollow && feedback_.error == 0 && says_enabled_)
    return DriveState::kEnabled;  // the usual
  if (!heard_) return DriveState::kUnknown;
  return feedback_.error != 0 ? DriveState::kFault : Inferred();
}

void MitDrive::NextStage(bool enable) noexcept {
  if (enable && stage_ == Stage::kFollow) return;
  if (!enable) {
    if (stage_ == Stage::kExit) return;
    before_exit_ = Inferred();
    GoTo(Stage::kExit);
  } else if (stage_ == Stage::kStart || stage_ == Stage::kExit) {
    GoTo(Stage::kClear);
  } else if (stage_ == Stage::kClear) {
    GoTo(Stage::kEnter);
  } else if (stage_ == Stage::kEnter && answered_ticks_ >= kCertainTicks && says_enabled_) {
    GoTo(Stage::kNeutral);
  } else if (stage_ == Stage::kNeutral && answered_ticks_ >= 1) {
    GoTo(Stage::kFollow);
  }
}

Status MitDrive::Encode(DriveRequest request, const DriveSetpoint& setpoint,
                        FrameBatch& batch) noexcept {
  if (!valid_) return Status::kInvalidArgument;
  if (batch.frames().size() == FrameBatch::kCapacity) return Status::kCapacityExceeded;
  answered_ticks_ = answered_ticks();
  answered_ = false;
  const bool enable = request == DriveRequest::kEnable;
  const bool usable = !enable || setpoint.IsFinite();
  NextStage(enable && usable);

  if (stage_ == Stage::kFollow) return batch.Add(EncodeSetpoint(setpoint));
  encoded_ = {};
  encoded_.position_rad = feedback_.position_rad;
  CanFrame frame;
  if (stage_ == Stage::kExit) {
    frame = MitMagicFrame(config_, MitMagic::kExit);
    if (request == DriveRequest::kClearErrors && config_.dialect == MitDialect::kDamiao)
      frame = MitMagicFrame(config_, MitMagic::kClear);
  } else if (stage_ == Stage::kEnter) {
    frame = MitMagicFrame(config_, MitMagic::kEnter);
  } else {
    frame = EncodeMitCommand(config_, ToCommand(encoded_));
  }
  const Status added = batch.Add(frame);
  return usable ? added : Status::kInvalidArgument;
}

bool MitDrive::Decode(const CanFrame& frame) noexcept {
  if (!valid_ || !IsReplyOf(config_, frame)) return false;
  const ReplyCodes codes = UnpackReply(frame);
  ReplyHealth health;
  if (config_.dialect == MitDialect::kMiniCheetah) {  // the usual
    health.has_temperature = frame.size == 8;
    health.temperature_c =
        health.has_temperature ? DegreesOf(frame.data[6], config_.temperature_encoding) : 0;
    health.error = health.has_temperature ? frame.data[7] : std::uint8_t{0};
  } else {
    health = HealthOf(config_, frame);
  }
  // Codes wrap modulo 2^16, and so does this difference: it is the way that the shaft has turned.
  // While the motor is off, the code may be taken as it is.
  const std::int32_t way = static_cast<std::int16_t>(codes.p - position_code_);
  position_code_ = stage_ == Stage::kFollow ? position_code_ + way : codes.p;
  const Lanes joint =
      ToJoint(reply_range_, {position_code_, codes.v, codes.t, health.temperature_c});
  feedback_ = {joint[0], joint[1], joint[2], joint[3], true, health.has_temperature, health.error};
  says_enabled_ = health.enabled;
  heard_ = true;
  answered_ = true;
  return true;
}

namespace {

// Source: CubeMars' manual of AK drives, CAN_PACKET_ID: what the same drive obeys in servo mode.
constexpr std::array kMiniCheetahFrames = {
    HostFrame{0x000, "MIT command"},
    HostFrame{0x000, "servo duty", false, true},
    HostFrame{0x100, "servo current", false, true},
    HostFrame{0x200, "servo brake current", false, true},
    HostFrame{0x300, "servo speed", false, true},
    HostFrame{0x400, "servo position", false, true},
    HostFrame{0x500, "servo origin", false, true},
    HostFrame{0x600, "servo position and speed", false, true},
};
// Source: Damiao's protocol, docs/concept/communication-protocol.md of
// github.com/jia-xie/python-damiao-driver, and DM_CAN.py of github.com/cmjang/DM_Control_Python.
constexpr std::array kDamiaoFrames = {
    HostFrame{0x000, "MIT command"},
    HostFrame{0x100, "position and velocity"},
    HostFrame{0x200, "velocity"},
    HostFrame{0x300, "position and force"},
    HostFrame{kDamiaoRegistersId, "register request", true},
};
constexpr std::uint32_t kMiniCheetahKinds = KindBits(kMiniCheetahFrames, 8);
constexpr std::uint32_t kServoKinds = KindBits(kMiniCheetahFrames, 8, true);
constexpr std::uint32_t kDamiaoKinds = KindBits(kDamiaoFrames, 8);
static_assert(KindBits(kDamiaoFrames, 8, true) == 0);

}  // namespace

std::span<const HostFrame> MitProtocol::HostFrames(const Config& config) noexcept {
  if (config.dialect == MitDialect::kDamiao) return kDamiaoFrames;
  return kMiniCheetahFrames;
}

bool MitDrive::IsCommand(const CanFrame& frame) const noexcept {
  if (frame.remote || IsReplyOf(config_, frame)) return false;
  const bool damiao = config_.dialect == MitDialect::kDamiao;
  if (damiao && frame.id == kDamiaoRegistersId && !frame.extended) {  // Its first bytes say whose.
    return frame.size >= 2 && (frame.data[0] | frame.data[1] << 8) == config_.command_id;
  }
  std::uint32_t kinds = frame.extended ? kServoKinds : kMiniCheetahKinds;
  if (damiao) kinds = frame.extended ? 0 : kDamiaoKinds;
  return (frame.id & 0xff) == config_.command_id && IsKind(kinds, frame.id >> 8);
}

bool MitProtocol::CommandedPosition(const MitConfig& config, const CanFrame& frame,
                                    double& shaft_rad) noexcept {
  ImpedanceCommand command;
  if (DecodeMitCommand(config, frame, command) != Status::kOk || command.kp_nm_per_rad <= 0) {
    return false;
  }
  shaft_rad = double{command.position_rad};
  return true;
}

bool MitProtocol::ReportedPosition(const MitConfig& config, const CanFrame& frame,
                                   double& shaft_rad) noexcept {
  MitReply reply;
  if (DecodeMitReply(config, frame, reply) != Status::kOk) return false;
  shaft_rad = double{reply.position_rad};
  return true;
}

}  // namespace tumbler
