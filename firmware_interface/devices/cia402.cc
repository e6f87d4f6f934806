#include "firmware_interface/devices/cia402.h"

#include <numbers>

#include "firmware_interface/devices/wire.h"

namespace tumbler {

namespace {

constexpr float kTwoPi = 6.283185307F;
constexpr float kLargestInt32 = 2147483520.0F;
constexpr float kLargestInt16 = 32767.0F;

bool Is(const CanFrame& frame, std::uint32_t id) noexcept {
  return frame.id == id && !frame.extended && !frame.remote && frame.size >= 6 && frame.size <= 8;
}

// Frames of 16 bits and 32 bits, in either order.
void Set(CanFrame& frame, std::uint32_t id, std::uint64_t payload) noexcept {
  frame.id = id;
  frame.extended = frame.remote = false;
  frame.size = 6;
  frame.data = StoreWord(payload);
}
void SetWordFirst(CanFrame& frame, std::uint32_t id, std::uint16_t word,
                  std::int32_t number) noexcept {
  Set(frame, id, std::uint64_t{static_cast<std::uint32_t>(number)} << 16 | word);
}
void SetNumberFirst(CanFrame& frame, std::uint32_t id, std::int32_t number,
                    std::int16_t word) noexcept {
  Set(frame, id,
      std::uint64_t{static_cast<std::uint16_t>(word)} << 32 | static_cast<std::uint32_t>(number));
}
CanFrame WordFirst(std::uint32_t id, std::uint16_t word, std::int32_t number) noexcept {
  CanFrame frame;
  SetWordFirst(frame, id, word, number);
  return frame;
}
CanFrame NumberFirst(std::uint32_t id, std::int32_t number, std::int16_t word) noexcept {
  CanFrame frame;
  SetNumberFirst(frame, id, number, word);
  return frame;
}

constexpr bool IsPositive(float x) noexcept { return x > 0 && 0.0F * x == 0; }

}  // namespace

CanFrame EncodeCia402(std::uint8_t node, const Cia402Command& value) noexcept {
  return WordFirst(canopen_id::kRpdo1 + node, value.controlword, value.position);
}
CanFrame EncodeCia402(std::uint8_t node, const Cia402FeedForward& value) noexcept {
  return NumberFirst(canopen_id::kRpdo2 + node, value.velocity, value.torque);
}
CanFrame EncodeCia402(std::uint8_t node, const Cia402Status& value) noexcept {
  return WordFirst(canopen_id::kTpdo1 + node, value.statusword, value.position);
}
CanFrame EncodeCia402(std::uint8_t node, const Cia402Motion& value) noexcept {
  return NumberFirst(canopen_id::kTpdo2 + node, value.velocity, value.torque);
}

Status DecodeCia402(std::uint8_t node, const CanFrame& frame, Cia402Command& value) noexcept {
  if (!Is(frame, canopen_id::kRpdo1 + node)) return Status::kInvalidArgument;
  value = {static_cast<std::uint16_t>(LoadLittle(frame.data, 0, 2)), LoadInt32(frame.data, 2)};
  return Status::kOk;
}
Status DecodeCia402(std::uint8_t node, const CanFrame& frame, Cia402FeedForward& value) noexcept {
  if (!Is(frame, canopen_id::kRpdo2 + node)) return Status::kInvalidArgument;
  value = {LoadInt32(frame.data, 0), LoadInt16(frame.data, 4)};
  return Status::kOk;
}
Status DecodeCia402(std::uint8_t node, const CanFrame& frame, Cia402Status& value) noexcept {
  if (!Is(frame, canopen_id::kTpdo1 + node)) return Status::kInvalidArgument;
  value = {static_cast<std::uint16_t>(LoadLittle(frame.data, 0, 2)), LoadInt32(frame.data, 2)};
  return Status::kOk;
}
Status DecodeCia402(std::uint8_t node, const CanFrame& frame, Cia402Motion& value) noexcept {
  if (!Is(frame, canopen_id::kTpdo2 + node)) return Status::kInvalidArgument;
  value = {LoadInt32(frame.data, 0), LoadInt16(frame.data, 4)};
  return Status::kOk;
}

Cia402State StateOf(std::uint16_t statusword) noexcept {
  switch (statusword & 0x4f) {
    case 0x40:
      return Cia402State::kSwitchOnDisabled;
    case 0x0f:
      return Cia402State::kFaultReaction;
    case 0x08:
      return Cia402State::kFault;
    default:
      break;
  }
  switch (statusword & 0x6f) {
    case 0x21:
      return Cia402State::kReady;
    case 0x23:
      return Cia402State::kSwitchedOn;
    case 0x27:
      return Cia402State::kEnabled;
    case 0x07:
      return Cia402State::kQuickStop;
    default:
      return Cia402State::kNotReady;
  }
}

std::uint16_t StatuswordOf(Cia402State state) noexcept {
  switch (state) {
    case Cia402State::kNotReady:
      return 0x00;
    case Cia402State::kSwitchOnDisabled:
      return 0x40;
    case Cia402State::kReady:
      return 0x21;
    case Cia402State::kSwitchedOn:
      return 0x23;
    case Cia402State::kEnabled:
      return 0x27;
    case Cia402State::kQuickStop:
      return 0x07;
    case Cia402State::kFaultReaction:
      return 0x0f;
    case Cia402State::kFault:
      return 0x08;
  }
  return 0;
}

Status ToInterpolationPeriod(std::uint32_t period_us, Cia402Period& period) noexcept {
  std::int8_t exponent = -6;
  std::uint32_t value = period_us;
  while (value != 0 && value % 10 == 0 && exponent < 0) {
    value /= 10;
    ++exponent;
  }
  if (value == 0 || value > 255) return Status::kInvalidArgument;
  period = {static_cast<std::uint8_t>(value), exponent};
  return Status::kOk;
}

namespace {

/// Whether an abort of the set-up says that there is no such object, and there need not be.
bool MayLack(const Cia402Config& config, const SdoReply& reply) noexcept {
  constexpr std::uint32_t kNoObject = 0x0602'0000, kNoSubIndex = 0x0609'0011;
  if (reply.kind != SdoReply::Kind::kAborted ||
      (reply.value != kNoObject && reply.value != kNoSubIndex)) {
    return false;
  }
  for (std::size_t i = 0; i < kCia402MayLack.size(); ++i) {
    if (kCia402MayLack[i] == reply.index) return (config.may_lack >> i & 1U) != 0;
  }
  return false;
}

}  // namespace

Status Cia402Config::Validate() const noexcept {
  Cia402Period period;
  if (node_id < 1 || node_id > 126 || host_id < 1 || host_id > kCanOpenNodeMax ||
      host_id == node_id || period_us < 100 || period_us > 100'000 ||
      ToInterpolationPeriod(period_us, period) != Status::kOk || heartbeat_ms < 1 ||
      heartbeat_ms > 10'000 || watchdog_ms > 10'000 || status_every < 1 || status_every > 240 ||
      watchdog_reaction < 0 || watchdog_reaction > 3 || quick_stop_option < 1 ||
      quick_stop_option > 7 || may_lack >> kCia402MayLack.size() != 0 ||
      (watchdog_ms != 0 && (may_lack >> 4 & 1U) != 0)) {
    return Status::kInvalidArgument;
  }
  if (!IsPositive(position_units_per_turn) || !IsPositive(velocity_units_per_turn_s) ||
      !IsPositive(rated_torque_nm) || !(following_window_rad >= 0) ||
      !(following_window_rad * position_units_per_turn / kTwoPi <= kLargestInt32)) {
    return Status::kInvalidArgument;
  }
  if (!range.position_rad.ContainsZeroWithin(kLargestInt32 / position_units_per_turn * kTwoPi) ||
      !range.velocity_rad_s.ContainsZeroWithin(kLargestInt32 / velocity_units_per_turn_s *
                                               kTwoPi) ||
      !range.torque_nm.ContainsZeroWithin(kLargestInt16 * 0.001F * rated_torque_nm)) {
    return Status::kInvalidArgument;
  }
  return joint.Validate();
}

[[gnu::cold]] bool Cia402SetUp(const Cia402Config& config, int step, SdoRequest& request) noexcept {
  constexpr std::uint32_t kInvalidPdo = 0x8000'0000;       // bit 31: the PDO does not exist
  constexpr std::uint32_t kNoRemoteRequest = 0x4000'0000;  // bit 30
  int next = 0;
  bool found = false;
  const auto write = [&](std::uint16_t index, std::uint8_t sub, std::uint8_t size,
                         std::uint32_t value) {
    if (next++ != step) return;
    request = {true, index, sub, size, value};
    found = true;
  };
  // A PDO may only be changed while it does not exist, its mapping only while it has no entries.
  const auto map = [&](std::uint16_t parameter, std::uint16_t mapping, std::uint32_t id,
                       std::uint8_t type, std::uint32_t first, std::uint32_t second) {
    write(parameter, 1, 4, kInvalidPdo | id);
    write(parameter, 2, 1, type);
    write(mapping, 0, 1, 0);
    write(mapping, 1, 4, first);
    write(mapping, 2, 4, second);
    write(mapping, 0, 1, 2);
    write(parameter, 1, 4, id);
  };
  const std::uint32_t node = config.node_id;
  const auto word = [](std::int16_t value) { return static_cast<std::uint16_t>(value); };
  Cia402Period period;
  static_cast<void>(ToInterpolationPeriod(config.period_us, period));

  write(0x1017, 0, 2, config.heartbeat_ms);
  write(0x1016, 1, 4, std::uint32_t{config.host_id} << 16 | config.watchdog_ms);
  write(0x6007, 0, 2, word(config.watchdog_reaction));
  write(0x1006, 0, 4, config.period_us);
  write(0x60c2, 1, 1, period.value);
  write(0x60c2, 2, 1, static_cast<std::uint8_t>(period.exponent));
  map(0x1400, 0x1600, canopen_id::kRpdo1 + node, 1, 0x6040'0010, 0x607a'0020);
  if (config.feed_forward) {
    map(0x1401, 0x1601, canopen_id::kRpdo2 + node, 1, 0x60b1'0020, 0x60b2'0010);
  } else {
    write(0x1401, 1, 4, kInvalidPdo | (canopen_id::kRpdo2 + node));
  }
  map(0x1800, 0x1a00, kNoRemoteRequest | (canopen_id::kTpdo1 + node), 1, 0x6041'0010, 0x6064'0020);
  map(0x1801, 0x1a01, kNoRemoteRequest | (canopen_id::kTpdo2 + node), config.status_every,
      0x606c'0020, 0x6077'0010);
  write(0x605a, 0, 2, word(config.quick_stop_option));
  if (config.following_window_rad > 0) {
    const float window = config.following_window_rad * config.position_units_per_turn / kTwoPi;
    write(0x6065, 0, 4, static_cast<std::uint32_t>(RoundToInt32(window)));
  }
  write(0x6060, 0, 1, static_cast<std::uint8_t>(kCia402Csp));
  return found;
}

Cia402Drive::Cia402Drive(const Cia402Config& config) noexcept
    : ConfiguredDrive(config, config.Validate()) {
  if (!valid_) return;
  const float ratio = config.joint.direction * config.joint.gear_ratio;
  const float position = config.position_units_per_turn / kTwoPi;
  const float velocity = config.velocity_units_per_turn_s / kTwoPi;
  const float torque = 1000.0F / config.rated_torque_nm;
  position_to_units_ = ratio * position;
  position_to_rad_ = 1 / position_to_units_;
  velocity_to_units_ = ratio * velocity;
  velocity_to_rad_s_ = 1 / velocity_to_units_;
  torque_to_units_ = torque / ratio;
  torque_to_nm_ = 1 / torque_to_units_;
  position_units_ = WholeSteps(config.range.position_rad, position);
  velocity_units_ = WholeSteps(config.range.velocity_rad_s, velocity);
  torque_units_ = WholeSteps(config.range.torque_nm, torque);
  const auto ticks = [&config](std::uint32_t time_ms) {
    return static_cast<int>(time_ms * 1000U / config.period_us);
  };
  heartbeat_ticks_max_ = 3 * ticks(config.heartbeat_ms) + 2;
  host_heartbeat_ticks_ = ticks(config.watchdog_ms) / 3;
  if (host_heartbeat_ticks_ < 1) host_heartbeat_ticks_ = 1;
}

std::uint32_t Cia402Drive::FindError() const noexcept {
  if (refusal_ != 0) return refusal_;
  if (emergency_ != 0) return emergency_;
  if (link_ != Link::kRunning) return 0;
  if (power_ == Cia402State::kFault || power_ == Cia402State::kFaultReaction) {
    return kEmergencyGeneric;
  }
  if (power_ == Cia402State::kEnabled && (statusword_ & kCia402FollowingError) != 0) {
    return kEmergencyFollowingError;
  }
  return 0;
}

DriveState Cia402Drive::FindState() const noexcept {
  if (feedback_.error != 0) return DriveState::kFault;
  if (IsHeartbeatLost() && link_ == Link::kRunning) return DriveState::kLost;
  if (!heard_ || link_ != Link::kRunning) return DriveState::kUnknown;
  switch (follow_) {
    case Follow::kOff:
      return power_ == Cia402State::kEnabled ? DriveState::kEnabled : DriveState::kDisabled;
    case Follow::kWaitOff:
      return DriveState::kEnabling;
    case Follow::kSequence:
      return power_ == Cia402State::kEnabled ? DriveState::kEnabled : DriveState::kEnabling;
    case Follow::kFollow:
      return power_ == Cia402State::kEnabled ? DriveState::kEnabled : DriveState::kDisabled;
    case Follow::kBrake:
      return power_ == Cia402State::kEnabled || power_ == Cia402State::kQuickStop
                 ? DriveState::kEnabled
                 : DriveState::kDisabled;
    case Follow::kTripped:
      return DriveState::kDisabled;
  }
  return DriveState::kUnknown;
}

[[gnu::noinline]] void Cia402Drive::Refresh() noexcept {
  feedback_.error = FindError();
  state_ = FindState();
}

void Cia402Drive::Restart() noexcept {
  link_ = Link::kReset;
  heard_ = false;
  statusword_ = 0;
  power_ = Cia402State::kNotReady;
  if (follow_ != Follow::kOff && follow_ != Follow::kWaitOff) follow_ = Follow::kTripped;
}

void Cia402Drive::AddCommon(FrameBatch& batch) noexcept {
  static_cast<void>(batch.Add(EncodeSync()));
  if (config_.watchdog_ms == 0) return;
  if (--host_heartbeat_due_ > 0) return;
  host_heartbeat_due_ = host_heartbeat_ticks_;
  static_cast<void>(batch.Add(EncodeNodeState(config_.host_id, NmtState::kOperational)));
}

// Adds an NMT or SDO frame, at most one a tick. Returns whether there was one.
bool Cia402Drive::AddService(FrameBatch& batch) noexcept {
  if (waiting_ && ++wait_ticks_ > kAnswerTicks) Restart();
  SdoRequest request;
  switch (link_) {
    case Link::kReset:
      static_cast<void>(batch.Add(EncodeNmt(NmtCommand::kPreOperational, config_.node_id)));
      link_ = Link::kSetUp;
      step_ = 0;
      waiting_ = false;
      return true;
    case Link::kSetUp:
      if (waiting_) return false;
      waiting_ = true;
      wait_ticks_ = 0;
      if (Cia402SetUp(config_, step_, request)) {
        static_cast<void>(batch.Add(EncodeSdoRequest(config_.node_id, request)));
      } else {
        static_cast<void>(batch.Add(EncodeNmt(NmtCommand::kStart, config_.node_id)));
        link_ = Link::kStart;
      }
      return true;
    case Link::kReadMode:
      if (waiting_) return false;
      waiting_ = true;
      static_cast<void>(batch.Add(EncodeSdoRequest(config_.node_id, {false, 0x6061, 0, 0, 0})));
      return true;
    case Link::kRefused:
    case Link::kStart:
    case Link::kRunning:
      return false;
  }
  return false;
}

void Cia402Drive::TakeReply(const SdoReply& reply) noexcept {
  if (!waiting_) return;
  if (link_ == Link::kSetUp) {
    SdoRequest request;
    if (!Cia402SetUp(config_, step_, request) || reply.index != request.index ||
        reply.sub != request.sub) {
      return;
    }
    waiting_ = false;
    if (reply.kind == SdoReply::Kind::kWritten || MayLack(config_, reply)) {
      ++step_;
    } else {
      link_ = Link::kRefused;
      refusal_ = reply.value != 0 ? reply.value : kEmergencyGeneric;
      refused_index_ = reply.index;
      refused_sub_ = reply.sub;
    }
  } else if (link_ == Link::kReadMode && reply.index == 0x6061) {
    if (reply.kind == SdoReply::Kind::kRead &&
        reply.value == static_cast<std::uint32_t>(kCia402Csp)) {
      link_ = Link::kRunning;
      heartbeat_age_ = 0;
      waiting_ = false;
    } else if (reply.kind == SdoReply::Kind::kAborted) {
      link_ = Link::kRefused;
      refusal_ = reply.value != 0 ? reply.value : kEmergencyGeneric;
      refused_index_ = reply.index;
      refused_sub_ = reply.sub;
      waiting_ = false;
    } else {
      waiting_ = false;  // The drive is not in the mode yet: ask again, while wait_ticks_ goes on.
    }
  }
}

void Cia402Drive::NextFollow(bool enable, bool brake) noexcept {
  if (!enable) {
    follow_ = Follow::kOff;
    return;
  }
  const bool off = power_ == Cia402State::kSwitchOnDisabled || power_ == Cia402State::kReady ||
                   power_ == Cia402State::kSwitchedOn;
  const bool error = feedback_.error != 0;
  switch (follow_) {
    case Follow::kOff:
      follow_ = Follow::kWaitOff;
      break;
    case Follow::kWaitOff:
      // The drive has to be seen off first, so that an old report does not pass for being enabled.
      if (link_ == Link::kRunning && heard_ && off && !error) follow_ = Follow::kSequence;
      break;
    case Follow::kSequence:
      if (error) {
        follow_ = Follow::kTripped;
      } else if (power_ == Cia402State::kEnabled) {
        follow_ = brake ? Follow::kBrake : Follow::kFollow;
      }
      break;
    case Follow::kFollow:
    case Follow::kBrake: {
      const bool stopped = follow_ == Follow::kBrake && power_ == Cia402State::kQuickStop;
      if (error || (power_ != Cia402State::kEnabled && !stopped)) {
        follow_ = Follow::kTripped;
      } else if (brake) {
        follow_ = Follow::kBrake;
      } else if (power_ == Cia402State::kEnabled) {
        follow_ = Follow::kFollow;
      }
      break;
    }
    case Follow::kTripped:
      break;
  }
}

std::uint16_t Cia402Drive::Controlword() noexcept {
  switch (follow_) {
    case Follow::kSequence:
      if (power_ == Cia402State::kSwitchOnDisabled) return cia402_control::kShutdown;
      if (power_ == Cia402State::kReady) return cia402_control::kSwitchOn;
      if (power_ == Cia402State::kSwitchedOn) return cia402_control::kEnable;
      return cia402_control::kDisableVoltage;
    case Follow::kFollow:
      return cia402_control::kEnable;
    case Follow::kBrake:
      return cia402_control::kQuickStop;
    case Follow::kOff:
      if (reset_ticks_ > 0) {
        --reset_ticks_;
        // A rising edge resets the fault, so a tick without the bit comes first.
        if (power_ != Cia402State::kFault) reset_ticks_ = 0;
        if (reset_ticks_ < kResetTicks - 1 && reset_ticks_ > 0) return cia402_control::kFaultReset;
      }
      return cia402_control::kDisableVoltage;
    case Follow::kWaitOff:
    case Follow::kTripped:
      return cia402_control::kDisableVoltage;
  }
  return cia402_control::kDisableVoltage;
}

// Adds RPDO1 and RPDO2, and sets `encoded_` to the setpoint that the drive will read from them.
// Without a setpoint the target is exactly the drive's position.
void Cia402Drive::AddPdos(std::uint16_t controlword, const DriveSetpoint* setpoint,
                          FrameBatch& batch) noexcept {
  const float zero = config_.joint.zero_offset_rad;
  Cia402Command command{controlword, position_};
  Cia402FeedForward feed_forward;
  encoded_ = {};
  if (setpoint != nullptr) {
    command.position =
        RoundToInt32(position_units_.Clamp((setpoint->position_rad - zero) * position_to_units_));
    if (config_.feed_forward) {
      feed_forward.velocity =
          RoundToInt32(velocity_units_.Clamp(setpoint->velocity_rad_s * velocity_to_units_));
      feed_forward.torque =
          RoundToInt16(torque_units_.Clamp(setpoint->torque_nm * torque_to_units_));
      encoded_.velocity_rad_s = static_cast<float>(feed_forward.velocity) * velocity_to_rad_s_;
      encoded_.torque_nm = static_cast<float>(feed_forward.torque) * torque_to_nm_;
    }
    encoded_.position_rad = static_cast<float>(command.position) * position_to_rad_ + zero;
  } else {
    encoded_.position_rad = feedback_.position_rad;
  }
  if (CanFrame* const frame = batch.AddPlace()) {
    SetWordFirst(*frame, canopen_id::kRpdo1 + config_.node_id, command.controlword,
                 command.position);
  }
  if (!config_.feed_forward || link_ != Link::kRunning) return;
  if (CanFrame* const frame = batch.AddPlace()) {
    SetNumberFirst(*frame, canopen_id::kRpdo2 + config_.node_id, feed_forward.velocity,
                   feed_forward.torque);
  }
}

Status Cia402Drive::Encode(DriveRequest request, const DriveSetpoint& setpoint,
                           FrameBatch& batch) noexcept {
  if (!valid_) return Status::kInvalidArgument;
  if (!batch.frames().empty()) return Status::kCapacityExceeded;
  if (request != DriveRequest::kEnable || !IsSteady(setpoint))
    return EncodeChange(request, setpoint, batch);
  // What EncodeChange comes to where nothing changes, as in nearly all ticks.
  ++heartbeat_age_;
  reset_ticks_ = 0;
  if (config_.leader) AddCommon(batch);
  AddPdos(cia402_control::kEnable, &setpoint, batch);
  return Status::kOk;
}

// Whether a drive that follows goes on to do so with this setpoint.
bool Cia402Drive::IsSteady(const DriveSetpoint& setpoint) const noexcept {
  return follow_ == Follow::kFollow && link_ == Link::kRunning && power_ == Cia402State::kEnabled &&
         feedback_.error == 0 && heartbeat_age_ < heartbeat_ticks_max_ &&
         setpoint.kp_nm_per_rad != 0 && setpoint.IsFinite();
}

// Not inlined, so that the usual tick does not pay for its registers.
[[gnu::noinline]] Status Cia402Drive::EncodeChange(DriveRequest request,
                                                   const DriveSetpoint& setpoint,
                                                   FrameBatch& batch) noexcept {
  const bool enable = request == DriveRequest::kEnable;
  const bool usable = !enable || setpoint.IsFinite();
  const Follow before = follow_;
  // In this tick the drive's silence becomes a fault.
  if (heartbeat_age_ <= heartbeat_ticks_max_ && ++heartbeat_age_ > heartbeat_ticks_max_) Refresh();
  if (request == DriveRequest::kClearErrors) {
    emergency_ = 0;
    reset_ticks_ = kResetTicks;
    if (link_ == Link::kRefused || IsHeartbeatLost()) Restart();
    refusal_ = 0;
    Refresh();
  } else if (enable) {
    reset_ticks_ = 0;
  }
  if (config_.leader) AddCommon(batch);
  const bool service = link_ != Link::kRunning && AddService(batch);
  NextFollow(enable && usable, setpoint.kp_nm_per_rad == 0);
  if (!service || link_ == Link::kReadMode) {
    const bool follows = follow_ == Follow::kFollow;
    AddPdos(Controlword(), follows ? &setpoint : nullptr, batch);
  } else {
    encoded_ = {};
    encoded_.position_rad = feedback_.position_rad;
  }
  if (follow_ != before || link_ != Link::kRunning) Refresh();
  return usable ? Status::kOk : Status::kInvalidArgument;
}

bool Cia402Drive::Decode(const CanFrame& frame) noexcept {
  if (!valid_ || (frame.id & 0x7f) != config_.node_id) return false;
  const std::uint8_t node = config_.node_id;
  switch (frame.id & ~0x7fU) {
    case canopen_id::kTpdo1: {
      Cia402Status status;
      // Until the set-up is done, the mapping of the PDO is not known.
      if (link_ < Link::kStart || DecodeCia402(node, frame, status) != Status::kOk) return false;
      if (link_ == Link::kStart) {
        link_ = Link::kReadMode;
        waiting_ = false;
        wait_ticks_ = 0;
      }
      if (!heard_ || status.statusword != statusword_ || link_ != Link::kRunning) {
        heard_ = true;
        statusword_ = status.statusword;
        power_ = StateOf(status.statusword);
        Refresh();
      }
      position_ = status.position;
      feedback_.position_rad =
          static_cast<float>(status.position) * position_to_rad_ + config_.joint.zero_offset_rad;
      return true;
    }
    case canopen_id::kTpdo2: {
      Cia402Motion motion;
      if (link_ < Link::kStart || DecodeCia402(node, frame, motion) != Status::kOk) return false;
      feedback_.velocity_rad_s = static_cast<float>(motion.velocity) * velocity_to_rad_s_;
      feedback_.torque_nm = static_cast<float>(motion.torque) * torque_to_nm_;
      feedback_.has_torque = true;
      return false;
    }
    case canopen_id::kEmergency: {
      CanOpenEmergency emergency;
      if (DecodeEmergency(node, frame, emergency) == Status::kOk) emergency_ = emergency.code;
      Refresh();
      return false;
    }
    case canopen_id::kSdoReply: {
      SdoReply reply;
      if (DecodeSdoReply(node, frame, reply) == Status::kOk) TakeReply(reply);
      Refresh();
      return false;
    }
    case canopen_id::kHeartbeat: {
      NmtState state{};
      if (DecodeNodeState(node, frame, state) != Status::kOk) return false;
      heartbeat_age_ = 0;
      const bool lost = link_ == Link::kRunning && state != NmtState::kOperational;
      if (state == NmtState::kBootUp || lost) Restart();
      Refresh();
      return false;
    }
    default:
      return false;
  }
}

namespace {

// Source: CiA 301, predefined connection set; CiA 305 for LSS. TIME (0x100) is not here: drives do
// not move by it, and a clock may send it.
constexpr std::array kCia402Frames = {
    HostFrame{canopen_id::kNmt, "NMT", true},
    HostFrame{canopen_id::kSync, "SYNC", true},
    HostFrame{canopen_id::kRpdo1, "RPDO1"},
    HostFrame{canopen_id::kRpdo2, "RPDO2"},
    HostFrame{canopen_id::kRpdo3, "RPDO3"},
    HostFrame{canopen_id::kRpdo4, "RPDO4"},
    HostFrame{canopen_id::kSdoRequest, "SDO request"},
    HostFrame{canopen_id::kLssRequest, "LSS request", true},
};
constexpr std::uint32_t kCia402Kinds = KindBits(kCia402Frames, 7);

}  // namespace

std::span<const HostFrame> Cia402Protocol::HostFrames(const Config& /*config*/) noexcept {
  return kCia402Frames;
}

bool Cia402Drive::IsCommand(const CanFrame& frame) const noexcept {
  if (frame.extended || frame.remote) return false;
  if ((frame.id & 0x7f) == config_.node_id && IsKind(kCia402Kinds, frame.id >> 7)) return true;
  if (frame.id == canopen_id::kNmt) {  // It names one node, or with 0 all of them.
    return frame.size >= 2 && (frame.data[1] == 0 || frame.data[1] == config_.node_id);
  }
  return frame.id == canopen_id::kSync || frame.id == canopen_id::kLssRequest ||
         frame.id == canopen_id::kHeartbeat + config_.host_id;
}

bool Cia402Protocol::CommandedPosition(const Cia402Config& config, const CanFrame& frame,
                                       double& shaft_rad) noexcept {
  Cia402Command command;
  if (DecodeCia402(config.node_id, frame, command) != Status::kOk ||
      command.controlword != cia402_control::kEnable) {
    return false;
  }
  shaft_rad = command.position * (2 * std::numbers::pi) / double{config.position_units_per_turn};
  return true;
}

bool Cia402Protocol::ReportedPosition(const Cia402Config& config, const CanFrame& frame,
                                      double& shaft_rad) noexcept {
  Cia402Status status;
  if (DecodeCia402(config.node_id, frame, status) != Status::kOk) return false;
  shaft_rad = status.position * (2 * std::numbers::pi) / double{config.position_units_per_turn};
  return true;
}

}  // namespace tumbler
