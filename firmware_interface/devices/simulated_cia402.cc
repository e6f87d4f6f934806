#include "firmware_interface/devices/simulated_cia402.h"

#include <algorithm>
#include <cmath>

#include "firmware_interface/devices/drive_entry.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/wire.h"

namespace tumbler {

namespace {

constexpr double kRest_rad_s = 0.05;

// SDO abort codes (CiA 301).
constexpr std::uint32_t kReadOnly = 0x0601'0002;
constexpr std::uint32_t kNoObject = 0x0602'0000;
constexpr std::uint32_t kNotMappable = 0x0604'0041;
constexpr std::uint32_t kWrongLength = 0x0607'0010;
constexpr std::uint32_t kNoSubIndex = 0x0609'0011;
constexpr std::uint32_t kWrongValue = 0x0609'0030;
constexpr std::uint32_t kWrongState = 0x0800'0022;

constexpr std::uint32_t kPdoInvalid = 0x8000'0000;

constexpr std::uint32_t Key(std::uint16_t index, std::uint8_t sub) noexcept {
  return std::uint32_t{index} << 8 | sub;
}

}  // namespace

SimulatedCia402Drive::SimulatedCia402Drive(const SimulatedCia402Config& config)
    : SimulatedDrive(config, config.node.joint), config_(config) {
  Require(config.node.Validate() == Status::kOk, "its protocol configuration is not valid");
  Require(config.kp_nm_per_rad >= 0 && std::isfinite(config.kp_nm_per_rad),
          "kp_nm_per_rad must be 0 or more");
  Require(config.kd_nm_s_per_rad >= 0 && std::isfinite(config.kd_nm_s_per_rad),
          "kd_nm_s_per_rad must be 0 or more");
  Require(config.sync_timeout_s >= 0 && config.sync_timeout_s <= 3600,
          "sync_timeout_s must be 0 ... 3600");
  Require(config.following_window_rad >= 0 && std::isfinite(config.following_window_rad),
          "following_window_rad must be 0 or more");
  Boot();
}

SimulatedPortConfig SimulatedCia402Drive::port_config() const noexcept {
  SimulatedPortConfig config;
  config.transmit_capacity = 8;
  config.restart_ns = 0;  // Firmware lets its controller recover from bus-off by itself.
  return config;
}

void SimulatedCia402Drive::Boot() noexcept {
  const std::uint32_t node = config_.node.node_id;
  rpdo_ = {};
  tpdo_ = {};
  rpdo_[0].id = canopen_id::kRpdo1 + node;
  rpdo_[1].id = canopen_id::kRpdo2 + node;
  tpdo_[0].id = canopen_id::kTpdo1 + node;
  tpdo_[1].id = canopen_id::kTpdo2 + node;
  booted_ = false;
  nmt_ = NmtState::kPreOperational;
  heartbeat_ms_ = 0;
  consumer_ = 0;
  connection_option_ = 1;
  quick_stop_option_ = 2;
  period_value_ = 1;
  period_exponent_ = -2;
  mode_ = 0;
  window_ = static_cast<std::uint32_t>(
      std::llround(config_.following_window_rad / kTwoPi *
                   static_cast<double>(config_.node.position_units_per_turn)));
  controlword_ = 0;
  velocity_offset_ = 0;
  torque_offset_ = 0;
  state_ = Cia402State::kSwitchOnDisabled;
  error_code_ = 0;
  following_error_ = false;
  host_seen_ = false;
}

void SimulatedCia402Drive::PowerCycle() noexcept { Boot(); }

double SimulatedCia402Drive::FromPositionUnits(std::int32_t units) const noexcept {
  return static_cast<double>(units) * kTwoPi /
         static_cast<double>(config_.node.position_units_per_turn);
}

std::int32_t SimulatedCia402Drive::position_units() const noexcept {
  const double units =
      Measured(0) / kTwoPi * static_cast<double>(config_.node.position_units_per_turn);
  return static_cast<std::int32_t>(static_cast<std::int64_t>(std::floor(units)));
}

std::uint16_t SimulatedCia402Drive::statusword() const noexcept {
  std::uint16_t word = StatuswordOf(state_);
  word = static_cast<std::uint16_t>(word | 0x0210);  // remote, voltage
  if (following_error_) word = static_cast<std::uint16_t>(word | kCia402FollowingError);
  if (state_ == Cia402State::kEnabled) word = static_cast<std::uint16_t>(word | 1U << 12);
  return word;
}

std::optional<double> SimulatedCia402Drive::target_rad() const noexcept {
  if (state_ != Cia402State::kEnabled) return std::nullopt;
  return ToJoint(target_rad_);
}

void SimulatedCia402Drive::Fault(std::uint16_t code) noexcept {
  if (state_ == Cia402State::kFault || state_ == Cia402State::kFaultReaction) return;
  error_code_ = code;
  const bool was_enabled = enabled();
  state_ = was_enabled ? Cia402State::kFaultReaction : Cia402State::kFault;
  reaction_end_ns_ = now_ns_ + static_cast<std::int64_t>(kFaultReaction_s * 1e9);
  Say(EncodeEmergency(config_.node.node_id, {code, 1, {}}));
}

void SimulatedCia402Drive::RaiseError(std::uint32_t code) noexcept {
  Fault(static_cast<std::uint16_t>(code));
}

void SimulatedCia402Drive::CheckTimeouts() noexcept {
  const auto overdue = [this](std::int64_t since_ns, double timeout_s) {
    return static_cast<double>(now_ns_ - since_ns) > timeout_s * 1e9;
  };
  const std::uint32_t consumer_ms = consumer_ & 0xffff;
  if (host_seen_ && consumer_ms != 0 && overdue(host_ns_, consumer_ms * 1e-3)) {
    host_seen_ = false;
    CountExpiry();
    if (connection_option_ == 1) {
      Fault(kEmergencyHeartbeat);
    } else if (connection_option_ == 2 && enabled()) {
      state_ = Cia402State::kSwitchOnDisabled;
    } else if (connection_option_ == 3 && state_ == Cia402State::kEnabled) {
      state_ = Cia402State::kQuickStop;
    }
  }
  if (state_ == Cia402State::kEnabled && config_.sync_timeout_s > 0 &&
      overdue(sync_ns_, config_.sync_timeout_s)) {
    CountExpiry();
    Fault(kEmergencyHeartbeat);
  }
  if (state_ == Cia402State::kEnabled && window_ != 0 &&
      std::abs(target_rad_ - Measured(0)) > FromPositionUnits(1) * static_cast<double>(window_)) {
    following_error_ = true;
    Fault(kEmergencyFollowingError);
  }
}

double SimulatedCia402Drive::TargetAt(std::int64_t time_ns) const noexcept {
  double period_s = period_value_;
  for (int i = 0; i < period_exponent_; ++i) period_s *= 10;
  double parts = 1;
  for (int i = 0; i > period_exponent_; --i) parts *= 10;
  period_s /= parts;
  const double share = std::min(1.0, static_cast<double>(time_ns - sync_ns_) * 1e-9 / period_s);
  return from_rad_ + share * (to_rad_ - from_rad_);
}

void SimulatedCia402Drive::Act(std::int64_t time_ns) noexcept {
  now_ns_ = time_ns;
  if (!booted_) {
    booted_ = true;
    heartbeat_due_ns_ = time_ns;
    Say(EncodeNodeState(config_.node.node_id, NmtState::kBootUp));
  }
  if (heartbeat_ms_ != 0 && time_ns >= heartbeat_due_ns_) {
    heartbeat_due_ns_ = time_ns + std::int64_t{heartbeat_ms_} * 1'000'000;
    Say(EncodeNodeState(config_.node.node_id, nmt_));
  }
  target_rad_ = TargetAt(time_ns);
  CheckTimeouts();
  const bool rests = std::abs(shaft().velocity_rad_s) < kRest_rad_s;
  // With the options 5 ... 7 the drive stays in the quick stop; with the others the torque goes
  // off.
  if (state_ == Cia402State::kQuickStop && quick_stop_option_ < 5 && rests)
    state_ = Cia402State::kSwitchOnDisabled;
  if (state_ == Cia402State::kFaultReaction && (rests || time_ns >= reaction_end_ns_))
    state_ = Cia402State::kFault;
}

double SimulatedCia402Drive::Law(std::int64_t time_ns, const Shaft& shaft) const noexcept {
  const double velocity = shaft.velocity_rad_s;
  switch (state_) {
    case Cia402State::kEnabled: {
      const double per_unit = kTwoPi / static_cast<double>(config_.node.velocity_units_per_turn_s);
      return config_.kp_nm_per_rad * (TargetAt(time_ns) - shaft.Measured(0)) +
             config_.kd_nm_s_per_rad * (velocity_offset_ * per_unit - velocity) +
             torque_offset_ * 0.001 * static_cast<double>(config_.node.rated_torque_nm);
    }
    case Cia402State::kQuickStop:
    case Cia402State::kFaultReaction:
      return -config_.kd_nm_s_per_rad * velocity;
    default:
      return 0;
  }
}

void SimulatedCia402Drive::OnControlword(std::uint16_t controlword) noexcept {
  const bool reset_edge = (controlword & cia402_control::kFaultReset) != 0 &&
                          (controlword_ & cia402_control::kFaultReset) == 0;
  controlword_ = controlword;
  if (state_ == Cia402State::kFaultReaction) return;
  if (state_ == Cia402State::kFault) {
    if (!reset_edge) return;
    state_ = Cia402State::kSwitchOnDisabled;
    error_code_ = 0;
    following_error_ = false;
    Say(EncodeEmergency(config_.node.node_id, {0, 0, {}}));
    return;
  }
  const unsigned command = controlword & 0x0fU;
  const bool disable_voltage = (command & 0x2) == 0;
  const bool quick_stop = (command & 0x6) == 0x2;
  const bool shutdown = (command & 0x7) == 0x6;
  const bool switch_on = command == 0x7;
  const bool enable = command == 0xf;
  if (disable_voltage) {
    state_ = Cia402State::kSwitchOnDisabled;
    return;
  }
  switch (state_) {
    case Cia402State::kSwitchOnDisabled:
      if (shutdown) state_ = Cia402State::kReady;
      break;
    case Cia402State::kReady:
      if (quick_stop) state_ = Cia402State::kSwitchOnDisabled;
      if (switch_on) state_ = Cia402State::kSwitchedOn;
      break;
    case Cia402State::kSwitchedOn:
      if (quick_stop) state_ = Cia402State::kSwitchOnDisabled;
      if (shutdown) state_ = Cia402State::kReady;
      if (enable && mode_ == kCia402Csp) state_ = Cia402State::kEnabled;
      break;
    case Cia402State::kEnabled:
      if (quick_stop) state_ = Cia402State::kQuickStop;
      if (shutdown) state_ = Cia402State::kReady;
      if (switch_on) state_ = Cia402State::kSwitchedOn;
      break;
    default:
      break;
  }
}

void SimulatedCia402Drive::OnSync(SimulatedPort& port) noexcept {
  if (nmt_ != NmtState::kOperational) return;
  const Cia402State before = state_;
  for (Pdo& pdo : rpdo_) {
    if (!pdo.pending) continue;
    pdo.pending = false;
    std::size_t at = 0;
    for (std::size_t i = 0; i < pdo.count; ++i) {
      const auto bytes = static_cast<std::uint8_t>((pdo.entries[i] & 0xff) / 8);
      static_cast<void>(WriteValue(static_cast<std::uint16_t>(pdo.entries[i] >> 16),
                                   static_cast<std::uint8_t>(pdo.entries[i] >> 8), bytes,
                                   LoadLittle(pdo.received.data, at, bytes)));
      at += bytes;
    }
  }
  sync_ns_ = now_ns_;
  const double to = FromPositionUnits(target_);
  // Interpolation begins where the last one ended. When the drive was just enabled there was none.
  from_rad_ = before == Cia402State::kEnabled ? to_rad_ : to;
  to_rad_ = to;
  for (Pdo& pdo : tpdo_) {
    if (!pdo.exists || pdo.count == 0 || ++pdo.syncs < pdo.type) continue;
    pdo.syncs = 0;
    CanFrame frame = DataFrame(pdo.id, 0);
    for (std::size_t i = 0; i < pdo.count; ++i) {
      const auto bytes = static_cast<std::uint8_t>((pdo.entries[i] & 0xff) / 8);
      const Object object = Read(static_cast<std::uint16_t>(pdo.entries[i] >> 16),
                                 static_cast<std::uint8_t>(pdo.entries[i] >> 8));
      StoreLittle(frame.data, frame.size, bytes, static_cast<std::uint32_t>(object.value));
      frame.size = static_cast<std::uint8_t>(frame.size + bytes);
    }
    Say(port, frame);
  }
}

void SimulatedCia402Drive::OnNmt(NmtCommand command) noexcept {
  switch (command) {
    case NmtCommand::kStart:
      nmt_ = NmtState::kOperational;
      sync_ns_ = now_ns_;
      for (Pdo& pdo : tpdo_) pdo.syncs = 0;
      return;
    case NmtCommand::kStop:
    case NmtCommand::kPreOperational:
      nmt_ = command == NmtCommand::kStop ? NmtState::kStopped : NmtState::kPreOperational;
      // Leaving operational while enabled is a loss of the connection.
      if (enabled()) Fault(kEmergencyHeartbeat);
      for (Pdo& pdo : rpdo_) pdo.pending = false;
      return;
    case NmtCommand::kResetNode:
    case NmtCommand::kResetCommunication:
      Boot();
      return;
  }
}

SimulatedCia402Drive::Object SimulatedCia402Drive::Read(std::uint16_t index,
                                                        std::uint8_t sub) const noexcept {
  const auto& node = config_.node;
  switch (Key(index, sub)) {
    case Key(0x1000, 0):
      return {0x0002'0192, 4};  // servo drive, CiA 402
    case Key(0x1006, 0):
      return {sync_period_us_, 4};
    case Key(0x1016, 1):
      return {consumer_, 4};
    case Key(0x1017, 0):
      return {heartbeat_ms_, 2};
    case Key(0x6007, 0):
      return {connection_option_, 2};
    case Key(0x603f, 0):
      return {error_code_, 2};
    case Key(0x6040, 0):
      return {controlword_, 2};
    case Key(0x6041, 0):
      return {statusword(), 2};
    case Key(0x605a, 0):
      return {quick_stop_option_, 2};
    case Key(0x6060, 0):
    case Key(0x6061, 0):
      return {mode_, 1};
    case Key(0x6064, 0):
      return {position_units(), 4};
    case Key(0x6065, 0):
      return {window_, 4};
    case Key(0x606c, 0):
      return {std::llround(shaft().velocity_rad_s / kTwoPi *
                           static_cast<double>(node.velocity_units_per_turn_s)),
              4};
    case Key(0x6076, 0):
      return {std::llround(static_cast<double>(node.rated_torque_nm) * 1000), 4};
    case Key(0x6077, 0):
      return {std::clamp<std::int64_t>(
                  std::llround(torque_nm() * 1000 / static_cast<double>(node.rated_torque_nm)),
                  -32768, 32767),
              2};
    case Key(0x607a, 0):
      return {target_, 4};
    case Key(0x60b1, 0):
      return {velocity_offset_, 4};
    case Key(0x60b2, 0):
      return {torque_offset_, 2};
    case Key(0x60c2, 1):
      return {period_value_, 1};
    case Key(0x60c2, 2):
      return {period_exponent_, 1};
    default:
      return {};
  }
}

std::uint32_t SimulatedCia402Drive::WriteValue(std::uint16_t index, std::uint8_t sub,
                                               std::uint8_t size, std::uint32_t value) noexcept {
  const Object object = Read(index, sub);
  if (object.size == 0) return Read(index, 0).size != 0 ? kNoSubIndex : kNoObject;
  if (size != object.size) return kWrongLength;
  const auto signed16 = static_cast<std::int16_t>(value);
  switch (Key(index, sub)) {
    case Key(0x1006, 0):
      sync_period_us_ = value;
      return 0;
    case Key(0x1016, 1):
      consumer_ = value;
      host_seen_ = false;
      return 0;
    case Key(0x1017, 0):
      heartbeat_ms_ = static_cast<std::uint16_t>(value);
      heartbeat_due_ns_ = now_ns_;
      return 0;
    case Key(0x6007, 0):
      if (signed16 < 0 || signed16 > 3) return kWrongValue;
      connection_option_ = signed16;
      return 0;
    case Key(0x6040, 0):
      OnControlword(static_cast<std::uint16_t>(value));
      return 0;
    case Key(0x605a, 0):
      if (signed16 < 0 || signed16 > 7) return kWrongValue;
      quick_stop_option_ = signed16;
      return 0;
    case Key(0x6060, 0):
      if (value != static_cast<std::uint32_t>(kCia402Csp)) return kWrongValue;
      mode_ = kCia402Csp;
      return 0;
    case Key(0x6065, 0):
      window_ = value;
      return 0;
    case Key(0x607a, 0):
      target_ = static_cast<std::int32_t>(value);
      return 0;
    case Key(0x60b1, 0):
      velocity_offset_ = static_cast<std::int32_t>(value);
      return 0;
    case Key(0x60b2, 0):
      torque_offset_ = signed16;
      return 0;
    case Key(0x60c2, 1):
      if (value == 0) return kWrongValue;
      period_value_ = static_cast<std::uint8_t>(value);
      return 0;
    case Key(0x60c2, 2):
      period_exponent_ = static_cast<std::int8_t>(value);
      return 0;
    default:
      return kReadOnly;
  }
}

SimulatedCia402Drive::Pdo* SimulatedCia402Drive::PdoAt(std::uint16_t index,
                                                       bool& mapping) noexcept {
  mapping = (index & 0x0200) != 0;
  const auto number = static_cast<std::size_t>(index & 0xff);
  if (number > 1) return nullptr;
  switch (index & 0xff00) {
    case 0x1400:
    case 0x1600:
      return &rpdo_[number];
    case 0x1800:
    case 0x1a00:
      return &tpdo_[number];
    default:
      return nullptr;
  }
}

std::uint32_t SimulatedCia402Drive::WritePdo(Pdo& pdo, bool mapping,
                                             const SdoRequest& request) noexcept {
  if (nmt_ != NmtState::kPreOperational) return kWrongState;
  if (!mapping && request.sub == 1) {
    if (request.size != 4) return kWrongLength;
    const bool exists = (request.value & kPdoInvalid) == 0;
    if (exists && (request.value & 0x7ff) == 0) return kWrongValue;
    pdo.exists = exists;
    pdo.id = request.value & 0x7ff;
    return 0;
  }
  if (!mapping && request.sub == 2) {
    if (request.size != 1) return kWrongLength;
    if (request.value < 1 || request.value > 240) return kWrongValue;  // synchronous only
    if (pdo.exists) return kWrongState;
    pdo.type = static_cast<std::uint8_t>(request.value);
    return 0;
  }
  if (!mapping) return kNoSubIndex;
  if (pdo.exists) return kWrongState;
  if (request.sub == 0) {
    if (request.size != 1) return kWrongLength;
    if (request.value > kPdoEntries) return kWrongValue;
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < request.value; ++i) bits += pdo.entries[i] & 0xff;
    if (bits > 64) return kNotMappable;
    pdo.count = static_cast<std::uint8_t>(request.value);
    return 0;
  }
  if (request.sub > kPdoEntries) return kNoSubIndex;
  if (request.size != 4) return kWrongLength;
  if (pdo.count != 0) return kWrongState;
  const Object object = Read(static_cast<std::uint16_t>(request.value >> 16),
                             static_cast<std::uint8_t>(request.value >> 8));
  if (object.size == 0 || (request.value & 0xff) != 8U * object.size) return kNotMappable;
  pdo.entries[request.sub - 1U] = request.value;
  return 0;
}

std::uint32_t SimulatedCia402Drive::Write(const SdoRequest& request) noexcept {
  if (request.index == refused_index_) return kNoObject;
  bool mapping = false;
  Pdo* pdo = PdoAt(request.index, mapping);
  if (pdo != nullptr) return WritePdo(*pdo, mapping, request);
  return WriteValue(request.index, request.sub, request.size, request.value);
}

void SimulatedCia402Drive::Answer(const SdoRequest& request, SimulatedPort& port) noexcept {
  SdoReply reply;
  reply.index = request.index;
  reply.sub = request.sub;
  std::uint32_t abort = 0;
  if (request.write) {
    abort = Write(request);
  } else {
    const Object object = Read(request.index, request.sub);
    if (object.size == 0) abort = kNoObject;
    reply.kind = SdoReply::Kind::kRead;
    reply.size = object.size;
    reply.value = static_cast<std::uint32_t>(object.value);
  }
  if (abort != 0) {
    reply.kind = SdoReply::Kind::kAborted;
    reply.value = abort;
  }
  Say(port, EncodeSdoReply(config_.node.node_id, reply));
}

void SimulatedCia402Drive::OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept {
  now_ns_ = received.time_ns;
  if (!booted_) return;
  const CanFrame& frame = received.frame;
  const std::uint8_t node = config_.node.node_id;
  NmtCommand command{};
  if (DecodeNmt(node, frame, command) == Status::kOk) return OnNmt(command);
  if (IsSync(frame)) return OnSync(port);
  SdoRequest request;
  if (nmt_ != NmtState::kStopped && DecodeSdoRequest(node, frame, request) == Status::kOk) {
    CountFrame();
    return Answer(request, port);
  }
  const auto host = static_cast<std::uint8_t>(consumer_ >> 16 & 0x7f);
  NmtState state{};
  if (host != 0 && DecodeNodeState(host, frame, state) == Status::kOk) {
    host_seen_ = true;
    host_ns_ = now_ns_;
    return;
  }
  for (Pdo& pdo : rpdo_) {
    if (!pdo.exists || nmt_ != NmtState::kOperational || frame.extended || frame.remote ||
        frame.id != pdo.id) {
      continue;
    }
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < pdo.count; ++i) bits += pdo.entries[i] & 0xff;
    if (frame.size * 8U < bits) {
      Fault(0x8210);  // PDO not processed: too short
      continue;
    }
    CountFrame();
    if (&pdo == &rpdo_[0]) CountSetpoint(now_ns_);
    pdo.pending = true;
    pdo.received = frame;
  }
}

OwnedDrive Cia402Protocol::Simulate(const DriveEntry& entry, const Cia402Config& cia402,
                                    const SimulatedMotorConfig& motor) {
  SimulatedCia402Config config;
  static_cast<SimulatedMotorConfig&>(config) = motor;
  config.node = cia402;
  config.kp_nm_per_rad = GainAtShaft(cia402.joint, entry.kp_nm_per_rad);
  config.kd_nm_s_per_rad = GainAtShaft(cia402.joint, entry.kd_nm_s_per_rad);
  config.sync_timeout_s = entry.watchdog_s;
  return {std::make_unique<SimulatedCia402Drive>(config)};
}

}  // namespace tumbler
