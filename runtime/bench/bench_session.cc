#include "runtime/bench/bench_session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/files/program.h"
#include "firmware_interface/devices/error_texts.h"
#include "runtime/assembly/interrupts.h"

namespace tumbler {
namespace {

/// A reply that is older than this, or than a few ticks, is missed.
constexpr double kSilence_s = 0.05;
constexpr double kSilenceTicks = 8;
/// How far beyond the bounds a joint may be found before its motor counts as having run away.
constexpr double kRunAway_rad = 0.15;
constexpr double kSecond_ns = 1e9;
constexpr std::int64_t kLook_ns = 1'000'000;  // between two looks at what has come

std::int64_t Nanoseconds(double seconds) { return std::llround(seconds * kSecond_ns); }

const char* ToText(DriveState state) {
  switch (state) {
    case DriveState::kUnknown:
      return "silent";
    case DriveState::kDisabled:
      return "off";
    case DriveState::kEnabling:
      return "about to be enabled";
    case DriveState::kEnabled:
      return "enabled";
    case DriveState::kFault:
      return "in fault";
    case DriveState::kLost:
      return "without heartbeat";
  }
  return "in an unknown state";
}

/// Whether a frame of a drive brings its velocity and torque. Where the protocol sends them with
/// the position, `position` says it.
struct Brought {
  bool velocity = false;
  bool torque = false;
};
Brought BroughtBy(const DriveConfig& config, const CanFrame& frame, bool position) {
  if (const auto* can = std::get_if<CanSimpleConfig>(&config)) {
    return {position, frame.id == CanSimpleId(can->node_id, CanSimpleCommand::kGetTorques)};
  }
  if (const auto* cia402 = std::get_if<Cia402Config>(&config)) {
    const bool motion = frame.id == canopen_id::kTpdo2 + cia402->node_id;
    return {motion, motion};
  }
  return {position, position};
}

}  // namespace

BenchSession::BenchSession(BenchWorld& world, const DrivesConfig& drives, const BenchBounds& bounds)
    : world_(world),
      drives_(drives),
      bounds_(bounds),
      period_ns_(Nanoseconds(1 / drives.rate_hz)),
      deadline_ns_(world.clock().now_ns()),
      limits_(drives.drives.size()),
      replies_(drives.drives.size()),
      heard_ns_(drives.drives.size(), -1),
      kp_nm_per_rad_(bounds.kp_nm_per_rad),
      kd_nm_s_per_rad_(bounds.kd_nm_s_per_rad) {
  for (const DriveEntry& drive : drives.drives) {
    if (bank_.Add(drive.config) != Status::kOk)
      throw std::invalid_argument("a drive's configuration is not valid");
  }
}

BenchSession::~BenchSession() { OffQuietly(); }

double BenchSession::position_rad(std::size_t drive) const {
  return double{bank_.drives()[drive]->feedback().position_rad};
}

std::string BenchSession::NameOf(std::size_t drive) const {
  const DriveEntry& of = entry(drive);
  const auto number = DriveProtocols::With(of.config, [](auto /*protocol*/, const auto& config) {
    if constexpr (requires { config.command_id; }) {
      return static_cast<int>(config.command_id);
    } else {
      return static_cast<int>(config.node_id);
    }
  });
  const auto protocol = DriveProtocols::With(
      of.config, [](auto described, const auto& /*config*/) { return decltype(described)::kName; });
  return fmt::format("drive {} {} ({})", protocol, number, of.joint);
}

SafetyLimits BenchSession::GateOf(std::size_t drive) const {
  JointLimits<float> joint;
  joint.position_min_rad =
      static_cast<float>(std::max(origin_rad_ - bounds_.amplitude_rad, limits_[drive].lower_rad));
  joint.position_max_rad =
      static_cast<float>(std::min(origin_rad_ + bounds_.amplitude_rad, limits_[drive].upper_rad));
  joint.velocity_max_rad_s = static_cast<float>(bounds_.speed_rad_s);
  joint.torque_max_nm = static_cast<float>(bounds_.torque_nm);
  SafetyLimits limits =
      MakeSafetyLimits(joint, static_cast<float>(period_s()), static_cast<float>(period_s()));
  limits.position_step_rad = std::max(limits.position_step_rad, static_cast<float>(step_rad_));
  return limits;
}

void BenchSession::SetGains(double kp_nm_per_rad, double kd_nm_s_per_rad) {
  kp_nm_per_rad_ = kp_nm_per_rad;
  kd_nm_s_per_rad_ = kd_nm_s_per_rad;
}

void BenchSession::SetLimits(std::size_t drive, double lower_rad, double upper_rad) {
  limits_[drive] = {lower_rad, upper_rad};
}

void BenchSession::ResetReplies() {
  for (ReplyTimes& times : replies_) times = {};
}

void BenchSession::Send(DriveRequest others) {
  for (std::size_t i = 0; i < size(); ++i) {
    const bool driven = i == driven_;
    FrameBatch batch;
    const DriveSetpoint off;
    const Status encoded = bank_.drives()[i]->Encode(driven ? DriveRequest::kEnable : others,
                                                     driven ? setpoint_ : off, batch);
    if (encoded != Status::kOk) throw BenchFault(NameOf(i) + ": a setpoint cannot be encoded");
    std::size_t sent = 0;
    replies_[i].asked_ns.push_back(world_.clock().now_ns());
    if (driven && recording_)
      recorded_.asked.push_back({now_ns(), bank_.drives()[i]->encoded_setpoint()});
    const Status status = world_.bus().SendAll(batch.frames(), sent);
    if (status == Status::kOk || status == Status::kWouldBlock) continue;
    throw BenchFault(fmt::format("the bus is lost: {}", ToString(status)));
  }
}

void BenchSession::Receive() {
  ReceivedFrame received;
  Status status = Status::kOk;
  while ((status = world_.bus().Receive(received)) == Status::kOk) {
    for (std::size_t i = 0; i < size(); ++i) {
      const bool position = bank_.drives()[i]->Decode(received.frame);
      if (i == driven_ && recording_) Note(received, position);
      if (!position) continue;
      replies_[i].arrived_ns.push_back(received.time_ns);
      replies_[i].torques_nm.push_back(double{bank_.drives()[i]->feedback().torque_nm});
      heard_ns_[i] = received.time_ns;
    }
  }
  if (status != Status::kWouldBlock)
    throw BenchFault(fmt::format("the bus is lost: {}", ToString(status)));
}

void BenchSession::Note(const ReceivedFrame& received, bool position) {
  const DriveFeedback feedback = drive(driven_).feedback();
  const Brought brought = BroughtBy(entry(driven_).config, received.frame, position);
  const std::int64_t at_ns = received.time_ns;
  if (position) recorded_.positions_rad.push_back({at_ns, double{feedback.position_rad}});
  if (brought.velocity)
    recorded_.velocities_rad_s.push_back({at_ns, double{feedback.velocity_rad_s}});
  if (brought.torque && feedback.has_torque)
    recorded_.torques_nm.push_back({at_ns, double{feedback.torque_nm}});
}

void BenchSession::Record() {
  recorded_ = {};
  recording_ = true;
}

DriveRecording BenchSession::TakeRecording() {
  recording_ = false;
  return std::exchange(recorded_, {});
}

void BenchSession::SleepPeriod() {
  const std::int64_t now = world_.clock().now_ns();
  // After a pause the loop goes on from now: ticks that were missed are not made up for.
  deadline_ns_ = std::max(deadline_ns_ + period_ns_, now - period_ns_);
  world_.clock().SleepUntil(deadline_ns_);
}

double BenchSession::SilenceLimit_s(std::size_t drive) const {
  double limit_s = std::max(kSilence_s, kSilenceTicks * period_s());
  if (const auto* can = std::get_if<CanSimpleConfig>(&entry(drive).config))
    limit_s = std::max(limit_s, kSilenceTicks * can->messages.estimates_s);
  return limit_s;
}

void BenchSession::RequireHeard(std::size_t drive) const {
  if (heard_ns_[drive] < 0) throw BenchFault(NameOf(drive) + " has never replied");
  const double silent_s =
      static_cast<double>(world_.clock().now_ns() - heard_ns_[drive]) / kSecond_ns;
  if (silent_s <= SilenceLimit_s(drive)) return;
  throw BenchFault(fmt::format("{} has not replied for {:.0f} ms", NameOf(drive), 1e3 * silent_s));
}

bool BenchSession::Strayed() const {
  return !(std::abs(position_rad(driven_) - origin_rad_) <= bounds_.amplitude_rad);
}

void BenchSession::CheckDriven() const {
  const Drive& drive = *bank_.drives()[driven_];
  const DriveFeedback feedback = drive.feedback();
  const std::string name = NameOf(driven_);
  if (drive.state() == DriveState::kFault) {
    throw BenchFault(fmt::format("{} reports {}{}", name,
                                 DescribeDriveError(entry(driven_).config, feedback.error),
                                 DescribeRemarks(entry(driven_).config, drive)));
  }
  if (!following_) return;
  if (drive.state() != DriveState::kEnabled) {
    throw BenchFault(fmt::format("{} is {} all at once{}", name, ToText(drive.state()),
                                 DescribeRemarks(entry(driven_).config, drive)));
  }
  RequireHeard(driven_);
  const double way_rad = std::abs(double{feedback.position_rad} - origin_rad_);
  if (!(way_rad <= bounds_.amplitude_rad + kRunAway_rad)) {
    throw BenchFault(
        fmt::format("{} has run away: it is {:.3f} rad from where it was enabled, and {:.3f} was "
                    "the most that it was asked for",
                    name, way_rad, bounds_.amplitude_rad));
  }
  if (feedback.has_temperature && feedback.temperature_c > entry(driven_).temperature_max_c) {
    throw BenchFault(fmt::format("{} has {:.0f} C, and {:.0f} are allowed", name,
                                 feedback.temperature_c, entry(driven_).temperature_max_c));
  }
}

void EndWhereAsked() {
  const OperatorWish wish = InterruptMailbox().Take();
  if (wish.quit || IsTowardsRest(wish.request)) throw BenchInterrupted(wish);
}

void BenchSession::Tick() {
  EndWhereAsked();
  // After a pause of the program the drive may have let go, and the joint is elsewhere.
  if (driven_ != kNone && following_) RequireHeard(driven_);
  Send(DriveRequest::kDisable);
  SleepPeriod();
  Receive();
  if (driven_ != kNone) CheckDriven();
}

void BenchSession::Wait(double time_s) {
  const std::int64_t end_ns = now_ns() + Nanoseconds(time_s);
  while (now_ns() < end_ns) Tick();
}

std::vector<std::size_t> BenchSession::AwaitReplies() {
  // A set-up whose answers get lost on a noisy bus begins anew, a few times.
  constexpr std::int64_t kSetUps = 10;
  std::int64_t patience_ns = 0;
  for (const DriveEntry& drive : drives_.drives) {
    patience_ns = std::max(patience_ns, std::int64_t{FirstReply_ms(drive.config)} * 1'000'000);
    if (std::holds_alternative<Cia402Config>(drive.config))
      patience_ns = std::max(patience_ns, kSetUps * Cia402Drive::kAnswerTicks * period_ns_);
  }
  const std::int64_t end_ns = now_ns() + patience_ns;
  std::vector<std::size_t> silent;
  do {
    Tick();
    silent.clear();
    for (std::size_t i = 0; i < size(); ++i) {
      if (heard_ns_[i] < 0 || drive(i).state() == DriveState::kUnknown) silent.push_back(i);
    }
  } while (!silent.empty() && now_ns() < end_ns);
  return silent;
}

void BenchSession::ClearErrors() {
  constexpr double kLong_s = 0.3;
  const std::int64_t end_ns = now_ns() + Nanoseconds(kLong_s);
  while (now_ns() < end_ns) {
    EndWhereAsked();
    Send(DriveRequest::kClearErrors);
    SleepPeriod();
    Receive();
  }
  Wait(kLong_s);
}

void BenchSession::Enable(std::size_t drive) {
  constexpr double kPatience_s = 2;
  const std::int64_t end_ns = now_ns() + Nanoseconds(kPatience_s);
  Wait(4 * period_s());  // Drives have to be seen off first.
  driven_ = drive;
  following_ = false;
  while (bank_.drives()[drive]->state() != DriveState::kEnabled) {
    setpoint_ = {};
    setpoint_.position_rad = bank_.drives()[drive]->feedback().position_rad;
    setpoint_.kp_nm_per_rad = static_cast<float>(kp_nm_per_rad_);
    setpoint_.kd_nm_s_per_rad = static_cast<float>(kd_nm_s_per_rad_);
    Tick();
    if (now_ns() > end_ns) {
      const std::string name = NameOf(drive);
      const char* const state = ToText(bank_.drives()[drive]->state());
      OffQuietly();
      throw BenchFault(
          fmt::format("{} is {} {} s after it was asked to be enabled", name, state, kPatience_s));
    }
  }
  origin_rad_ = position_rad(drive);
  previous_ = {static_cast<float>(origin_rad_), 0, 0};
  following_ = true;
}

void BenchSession::Follow(double position_rad, double velocity_rad_s, double torque_nm) {
  const SafetyLimits gate = GateOf(driven_);
  JointSetpoint planned{static_cast<float>(position_rad), static_cast<float>(velocity_rad_s), 0};
  previous_ = LimitSetpoint(gate, planned, previous_, 1).setpoint;
  // Stiffness, velocity and push together ask for no more than the bound, wherever the joint is. At
  // least a quarter of it is left to the stiffness.
  const double most_nm = 0.25 * bounds_.torque_nm;
  const double push_nm = std::clamp(torque_nm, -most_nm, most_nm);
  const double fastest_rad_s = 0.5 * bounds_.torque_nm / std::max(kd_nm_s_per_rad_, 1e-9);
  const double fast_rad_s =
      std::clamp(double{previous_.velocity_rad_s}, -fastest_rad_s, fastest_rad_s);
  const double reach_rad =
      (bounds_.torque_nm - kd_nm_s_per_rad_ * std::abs(fast_rad_s) - std::abs(push_nm)) /
      std::max(kp_nm_per_rad_, 1e-9);
  const double measured_rad = this->position_rad(driven_);
  setpoint_ = {};
  setpoint_.position_rad = static_cast<float>(std::clamp(
      double{previous_.position_rad}, measured_rad - reach_rad, measured_rad + reach_rad));
  setpoint_.velocity_rad_s = static_cast<float>(fast_rad_s);
  setpoint_.torque_nm = static_cast<float>(push_nm);
  setpoint_.kp_nm_per_rad = static_cast<float>(kp_nm_per_rad_);
  setpoint_.kd_nm_s_per_rad = static_cast<float>(kd_nm_s_per_rad_);
  Tick();
}

void BenchSession::Push(double torque_nm) {
  const double bound = bounds_.torque_nm;
  setpoint_ = {};
  setpoint_.position_rad = static_cast<float>(position_rad(driven_));
  setpoint_.torque_nm = static_cast<float>(std::clamp(torque_nm, -bound, bound));
  Tick();
}

void BenchSession::ZeroEncoder(std::size_t drive) {
  const auto* mit = std::get_if<MitConfig>(&entry(drive).config);
  if (mit == nullptr) {
    throw Refused(NameOf(drive) +
                  ": only MIT drives are told to take another zero; leave --in-drive out");
  }
  constexpr double kSettle_s = 0.1;
  Wait(kSettle_s);  // Firmware obeys outside motor mode only.
  if (world_.bus().Send(MitMagicFrame(*mit, MitMagic::kZero)) != Status::kOk)
    throw BenchFault(NameOf(drive) + ": the bus does not take the command for its zero");
  Wait(kSettle_s);
}

std::int64_t BenchSession::StaySilentUntil(std::int64_t time_ns) {
  std::int64_t off_ns = -1;
  while (now_ns() < time_ns && off_ns < 0 && !Strayed()) {
    EndWhereAsked();
    world_.clock().SleepUntil(std::min(now_ns() + kLook_ns, time_ns));
    Receive();
    if (drive(driven_).state() != DriveState::kEnabled) off_ns = now_ns();
  }
  deadline_ns_ = now_ns();
  return off_ns;
}

void BenchSession::AskOffOnce() {
  constexpr double kPatience_s = 0.05;
  const std::size_t drive = driven_;
  driven_ = kNone;
  following_ = false;
  ResetReplies();
  Send(DriveRequest::kDisable);
  const std::int64_t end_ns = now_ns() + Nanoseconds(std::max(kPatience_s, 3 * period_s()));
  while (now_ns() < end_ns && replies_[drive].arrived_ns.empty()) {
    world_.clock().SleepUntil(now_ns() + kLook_ns);
    Receive();
  }
  deadline_ns_ = now_ns();
  driven_ = drive;  // TorqueOff is still to come.
}

void BenchSession::AskAllOnce(const std::vector<bool>& awaited, double after_s, double at_most_s) {
  EndWhereAsked();
  ResetReplies();
  Send(DriveRequest::kDisable);
  std::int64_t end_ns = now_ns() + Nanoseconds(at_most_s);
  for (bool all_answered = false; now_ns() < end_ns;) {
    world_.clock().SleepUntil(std::min(now_ns() + kLook_ns, end_ns));
    Receive();
    if (all_answered) continue;
    all_answered = true;
    for (std::size_t i = 0; i < size(); ++i)
      all_answered = all_answered && (!awaited[i] || !replies_[i].arrived_ns.empty());
    if (all_answered) end_ns = std::min(end_ns, now_ns() + Nanoseconds(after_s));
  }
  deadline_ns_ = now_ns();
}

bool BenchSession::ListenUntilQuiet(double quiet_s, double at_most_s) {
  const std::int64_t end_ns = now_ns() + Nanoseconds(at_most_s);
  std::int64_t quiet_since_ns = now_ns();
  std::size_t came = 0;
  for (;;) {
    std::size_t now_came = 0;
    for (const ReplyTimes& times : replies_) now_came += times.arrived_ns.size();
    if (std::exchange(came, now_came) != now_came) quiet_since_ns = now_ns();
    deadline_ns_ = now_ns();
    if (now_ns() - quiet_since_ns >= Nanoseconds(quiet_s)) return true;
    if (now_ns() >= end_ns) return false;
    world_.clock().SleepUntil(now_ns() + kLook_ns);
    Receive();
  }
}

void BenchSession::TorqueOff() {
  const std::size_t drive = driven_;
  driven_ = kNone;
  following_ = false;
  step_rad_ = 0;
  recording_ = false;
  kp_nm_per_rad_ = bounds_.kp_nm_per_rad;
  kd_nm_s_per_rad_ = bounds_.kd_nm_s_per_rad;
  if (drive == kNone) return;
  AwaitOff(drive);
}

void BenchSession::AwaitOff(std::size_t drive) {
  constexpr double kPatience_s = 1;
  const std::int64_t end_ns = now_ns() + Nanoseconds(kPatience_s);
  do {
    Tick();
    if (now_ns() <= end_ns) continue;
    throw BenchFault(fmt::format("{} is {} a second after it was asked to be off", NameOf(drive),
                                 ToText(bank_.drives()[drive]->state())));
  } while (bank_.drives()[drive]->state() == DriveState::kEnabled ||
           bank_.drives()[drive]->state() == DriveState::kEnabling);
}

void BenchSession::OffQuietly() noexcept {
  // Enough ticks that a frame or two may be lost. Whatever fails here, the next tick says it again.
  constexpr int kTicks = 10;
  driven_ = kNone;
  following_ = false;
  for (int tick = 0; tick < kTicks; ++tick) {
    try {
      Send(DriveRequest::kDisable);
      SleepPeriod();
      Receive();
    } catch (const BenchFault&) {
      continue;
    }
  }
}

}  // namespace tumbler
