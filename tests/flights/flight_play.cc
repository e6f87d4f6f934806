#include "tests/flights/flight_play.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <type_traits>

#include "common/core/feedback.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/simulated_mit.h"
#include "firmware_interface/devices/xsens_mti.h"
#include "runtime/executor/tick_entry.h"
#include "tests/flights/flight_operator.h"
#include "tests/flights/flight_random.h"
#include "tests/flights/flight_sensor.h"
#include "tests/support/protocol_side.h"

namespace tumbler::testing {
namespace {

std::unique_ptr<SimulatedDrive> MakeDrive(const DriveEntry& entry, const FlightJoint& joint) {
  const auto* const mit = std::get_if<MitConfig>(&entry.config);
  if (mit == nullptr || mit->dialect == MitDialect::kDamiao) return MakeSimulatedDrive(entry);
  SimulatedMitConfig config;
  config.mit = *mit;
  config.watchdog_s = entry.watchdog_s;
  config.reply_size = static_cast<std::uint8_t>(joint.reply_size);
  return std::make_unique<SimulatedMitDrive>(config);
}

/// Something that lasts until a tick of the flight.
template <typename Value>
struct Lasting {
  Value value{};
  std::int32_t until = 0;
  [[nodiscard]] bool On(std::int32_t tick) const { return tick < until; }
};

/// Bus, drives, joints, sensor, operator and executor of one flight.
class World {
 public:
  World(const Flight& flight, const FlightOptions& options)
      : flight_(flight),
        options_(options),
        setting_(MakeSetting(flight.seed, flight.left_out)),
        bus_(setting_.drives.bit_rate),
        host_(bus_.Attach(HostPort())),
        sensor_(setting_),
        operator_(setting_, flight.seed),
        judge_(setting_, options.ignored),
        step_ns_(std::min<std::int64_t>(setting_.period_ns / 2, 1'000'000)) {
    for (std::size_t i = 0; i < joint_count(); ++i) {
      const DriveEntry& entry = setting_.drives.drives[i];
      drives_.push_back(MakeDrive(entry, setting_.joints[i]));
      drives_.back()->AttachTo(bus_);
      joints_[i].position_rad = static_cast<double>(setting_.StartOf(static_cast<int>(i)));
      if (bank_.Add(entry.config) != Status::kOk) throw std::logic_error("a drive is not valid");
    }
    SimulatedPortConfig port;
    port.receive_capacity = 1;
    stranger_ = &bus_.Attach(port);
    if (setting_.has_sensor) sensor_.AttachTo(bus_);
    xsens_.Configure(setting_.sensor_ids);
    if (setting_.has_sensor) pitch_ = SensorWatch(xsens_, setting_.sensor);
    if (executor_.Configure(setting_.executor, setting_.graph, setting_.primitives, bank_.drives(),
                            setting_.has_sensor ? &pitch_ : nullptr) != Status::kOk) {
      throw std::logic_error("a random flight cannot be played");
    }
    received_.reserve(TickEntry::kReceivedMax);
  }

  FlightOutcome Play() {
    bool good = true;
    std::size_t next = 0;
    for (tick_ = 0; tick_ < flight_.ticks && good; ++tick_) {
      begun_ns_ = now_ns_;
      while (next < flight_.events.size() && flight_.events[next].tick <= tick_)
        Happen(flight_.events[next++]);
      now_ns_ += setting_.period_ns;
      number_ += 1;
      AdvanceTo(now_ns_);
      good = Tick();
    }
    FlightOutcome outcome{judge_.violations(), judge_.counts()};
    outcome.counts.flights = 1;
    outcome.counts.events = static_cast<std::int64_t>(next);
    outcome.counts.hash = hash_;
    return outcome;
  }

 private:
  struct Joint {
    double position_rad = 0, velocity_rad_s = 0;
    Lasting<double> push_nm, displace_rad;
    std::int32_t silent_until = 0;
  };

  [[nodiscard]] std::size_t joint_count() const {
    return static_cast<std::size_t>(setting_.joint_count());
  }
  [[nodiscard]] SimulatedPortConfig HostPort() const {
    SimulatedPortConfig port;
    port.transmit_capacity = setting_.transmit_capacity;
    port.receive_capacity = setting_.receive_capacity;
    return port;
  }

  // Lets the bus, the drives and the joints go on.
  void AdvanceTo(std::int64_t time_ns) {
    const double step_s = static_cast<double>(step_ns_) * 1e-9;
    while (world_ns_ + step_ns_ <= time_ns) {
      world_ns_ += step_ns_;
      bus_.AdvanceTo(world_ns_);
      for (std::size_t i = 0; i < joint_count(); ++i) MoveJoint(i, step_s);
      if (setting_.has_sensor) {
        double turned = 0;
        double rate = 0;
        for (std::size_t i = 0; i < joint_count(); ++i) {
          const double chain = static_cast<double>(setting_.sensor.chain[i]);
          if (chain == 0) continue;
          turned += chain * joints_[i].position_rad;
          rate += chain * joints_[i].velocity_rad_s;
        }
        sensor_.AdvanceTo(world_ns_, turned, rate);
      }
    }
    bus_.AdvanceTo(time_ns);
  }

  void MoveJoint(std::size_t i, double step_s) {
    Joint& joint = joints_[i];
    const FlightJoint& of = setting_.joints[i];
    double torque = drives_[i]->Step(world_ns_, joint.position_rad, joint.velocity_rad_s);
    if (held_) {
      joint.velocity_rad_s = 0;
      return;
    }
    torque += of.gravity_nm;
    if (joint.push_nm.On(tick_)) torque += joint.push_nm.value;
    joint.velocity_rad_s +=
        step_s * (torque - of.friction_nm_s_per_rad * joint.velocity_rad_s) / of.inertia_kg_m2;
    joint.position_rad += step_s * joint.velocity_rad_s;
    if (joint.position_rad < of.stop_min_rad || joint.position_rad > of.stop_max_rad) {
      joint.position_rad = std::clamp(joint.position_rad, of.stop_min_rad, of.stop_max_rad);
      joint.velocity_rad_s = 0;
    }
  }

  void Disturb(BusFaultKind kind, int node, double probability, std::int32_t ticks,
               std::uint32_t id = kNoId) {
    std::erase_if(plan_.faults, [this](const BusFault& old) { return old.end_ns < bus_.now_ns(); });
    ++plan_.seed;
    BusFault fault;
    fault.kind = kind;
    fault.node = node < static_cast<int>(joint_count()) + 1 ? node : 0;
    fault.probability = std::clamp(probability, 0.0, 1.0);
    fault.delay_ns = 1 + static_cast<std::int64_t>(static_cast<double>(setting_.period_ns) * 3 *
                                                   fault.probability);
    if (id != kNoId) fault.ids = {id};
    fault.start_ns = bus_.now_ns();
    fault.end_ns = fault.start_ns + ticks * setting_.period_ns;
    // One copy more for each, as a repeater with an echo has it.
    const int copies = kind == BusFaultKind::kDuplicate ? 1 + ticks % 3 : 1;
    for (int i = 0; i < copies; ++i) plan_.faults.push_back(fault);
    bus_.SetFaults(plan_);
    if (kind == BusFaultKind::kFlip) spoilt_until_ = tick_ + ticks + 20;
  }

  void Happen(const FlightEvent& event) {
    const auto joint = static_cast<std::size_t>(event.a) % joint_count();
    const DriveConfig& drive = setting_.drives.drives[joint].config;
    const std::int32_t until = tick_ + event.ticks;
    switch (event.kind) {
      case FlightEventKind::kCommand:
        command_ = static_cast<OperatorCommand>(event.a);
        branch_ = static_cast<std::int8_t>(event.b);
        break;
      case FlightEventKind::kRequest:
        disarms_ = disarms_ || (setting_.by_procedure &&
                                static_cast<FlightRequest>(event.a) == FlightRequest::kDisarm);
        operator_.Request(static_cast<FlightRequest>(event.a), record());
        break;
      case FlightEventKind::kPause:
        now_ns_ += event.ticks * setting_.period_ns;
        number_ += event.ticks;
        paused_ = paused_ || event.ticks > 0;
        break;
      case FlightEventKind::kJump:
        number_ += event.a;
        break;
      case FlightEventKind::kStutter:
        stutter_ = event.a;
        break;
      case FlightEventKind::kBusFault:
        Disturb(static_cast<BusFaultKind>(event.a), event.b, event.x, event.ticks);
        break;
      case FlightEventKind::kLoseReplies:
        Disturb(BusFaultKind::kLoss, 0, 1, event.ticks, SideOf(drive).PositionId(drive));
        break;
      case FlightEventKind::kLoseHeartbeat:
        if (SideOf(drive).HeartbeatId(drive) != 0)
          Disturb(BusFaultKind::kLoss, 0, 1, event.ticks, SideOf(drive).HeartbeatId(drive));
        break;
      case FlightEventKind::kLink:
        link_ = {static_cast<Status>(event.a), until};
        break;
      case FlightEventKind::kSend:
        send_ = {static_cast<Status>(event.a), until};
        break;
      case FlightEventKind::kController:
        controller_ = {static_cast<CanControllerState>(event.a), until};
        break;
      case FlightEventKind::kSilence:
        joints_[joint].silent_until = until;
        drives_[joint]->set_silent(true);
        break;
      case FlightEventKind::kDriveError:
        drives_[joint]->RaiseError(SideOf(drive).nature().error);
        break;
      case FlightEventKind::kHeat:
        drives_[joint]->set_temperature(event.x);
        break;
      case FlightEventKind::kDisplace:
        moved_until_ = std::max(moved_until_, until + 50);
        joints_[joint].displace_rad = {event.x / std::max(event.ticks, 1), until};
        break;
      case FlightEventKind::kPush:
        moved_until_ = std::max(moved_until_, until + 50);
        joints_[joint].push_nm = {event.x, until};
        break;
      case FlightEventKind::kStranger:
        SendAsStranger(drive, event.b == 1, event.x);
        break;
      case FlightEventKind::kNotANumber:
        if (const std::optional<CanFrame> frame = SideOf(drive).NotANumber(drive))
          static_cast<void>(stranger_->Send(*frame));
        break;
      case FlightEventKind::kSensor:
        sensor_.Fail(static_cast<FlightSensorFault>(event.a), event.ticks * setting_.period_ns);
        break;
      case FlightEventKind::kFall:
        Fall(event.b, event.x);
        break;
      case FlightEventKind::kRepair:
        Repair();
        break;
    }
  }

  // Somebody else commands a drive, or makes it drop out, that share of a period from now: not
  // together with the host's frames, or neither would get through.
  void SendAsStranger(const DriveConfig& drive, bool drops_out, double share) {
    const std::optional<CanFrame> drop = drops_out ? SideOf(drive).DropOut(drive) : std::nullopt;
    CanFrame& frame = foreign_[foreign_next_++ % foreign_.size()];
    frame = drop ? *drop : SideOf(drive).StrangersCommand(drive);
    static_cast<void>(stranger_->SendAfter(
        static_cast<std::int64_t>(share * static_cast<double>(setting_.period_ns)), frame));
  }

  // The robot comes to lie near a beginning of the graph, or, where it has no such, at an angle.
  void Fall(std::int32_t beginning, double pitch_rad) {
    const auto beginnings = setting_.graph.beginnings();
    const auto number = static_cast<std::size_t>(beginning);
    sensor_.Fall(number < beginnings.size()
                     ? static_cast<double>(beginnings[number].pitch_rad) + 0.02 * pitch_rad
                     : pitch_rad);
  }

  void Repair() {
    moved_until_ = std::max(moved_until_, tick_ + 50);
    host_.Restart();
    link_.until = send_.until = controller_.until = 0;
    for (std::size_t i = 0; i < joint_count(); ++i) {
      const DriveConfig& drive = setting_.drives.drives[i].config;
      drives_[i]->set_temperature(30);
      drives_[i]->set_silent(false);
      // It is switched off and on, as the protocol has no order for that.
      if (!SideOf(drive).nature().clears_errors) drives_[i]->RaiseError(0);
      joints_[i].position_rad = static_cast<double>(setting_.StartOf(static_cast<int>(i)));
      joints_[i].velocity_rad_s = 0;
      joints_[i].silent_until = 0;
      joints_[i].push_nm.until = joints_[i].displace_rad.until = 0;
    }
    held_ = executor_.state() == ExecutorState::kDisarmed;
    sensor_.PutDown();
  }

  [[nodiscard]] const TickRecord& record() const { return output_.record; }

  void Receive(TickInput& input, WorldTick& tick) {
    received_.clear();
    Status status = Status::kOk;
    ReceivedFrame received;
    if (link_.On(tick_)) {
      status = link_.value;
      while (host_.Receive(received) == Status::kOk) continue;  // Nothing comes in.
    } else {
      while (received_.size() < TickEntry::kReceivedMax &&
             (status = host_.Receive(received)) == Status::kOk) {
        received_.push_back(received);
        for (const CanFrame& foreign : foreign_) {
          if (foreign.size > 0 && foreign == received.frame) tick.foreign = true;
        }
      }
    }
    input.received = received_;
    input.receive_status = status;
    input.controller = controller_.On(tick_) ? controller_.value : host_.controller_state();
  }

  void Send() {
    send_status_ = Status::kOk;
    if (link_.On(tick_)) send_status_ = link_.value;
    if (send_.On(tick_)) send_status_ = send_.value;
    for (std::size_t i = 0; i < joint_count(); ++i) {
      for (const CanFrame& frame : output_.frames[i].frames()) {
        Mix(std::uint64_t{frame.id} << 8 | frame.size);
        std::uint64_t word = 0;
        for (std::size_t k = 0; k < frame.size; ++k) word = word << 8 | frame.data[k];
        Mix(word);
        if (send_status_ == Status::kOk) send_status_ = host_.Send(frame);
      }
    }
    VisitFields(record(), [this](const char* /*name*/, const auto& field) { MixField(field); });
    for (std::size_t i = 0; i < joint_count(); ++i) {
      VisitFields(record().joints[i],
                  [this](const char* /*name*/, const auto& field) { MixField(field); });
    }
  }

  void Mix(std::uint64_t word) {
    hash_ = (hash_ ^ word) * 1099511628211ULL;
    hash_ ^= hash_ >> 29;
  }

  template <typename Field>
  void MixField(const Field& field) {
    std::uint64_t word = 0;
    static_assert(std::is_trivially_copyable_v<Field> && sizeof field <= sizeof word);
    std::memcpy(&word, &field, sizeof field);
    Mix(word);
  }

  bool Tick() {
    for (std::size_t i = 0; i < joint_count(); ++i) {
      Joint& joint = joints_[i];
      if (joint.silent_until != 0 && joint.silent_until <= tick_) {
        joint.silent_until = 0;
        drives_[i]->set_silent(false);
      }
      if (joint.displace_rad.On(tick_)) {
        joint.position_rad += joint.displace_rad.value;
        joint.velocity_rad_s = 0;
      }
    }
    TickInput input;
    WorldTick tick;
    Receive(input, tick);
    input.tick = stutter_ >= 0 ? last_number_ - stutter_ : number_;
    stutter_ = -1;
    last_number_ = input.tick;
    input.time_ns = now_ns_;
    input.send_status = send_status_;
    const OperatorCommand asked = operator_.Next(record(), executor_.state());
    if (operator_.wants_repair() && setting_.repairs) Repair();
    input.command = command_ != OperatorCommand::kNone ? command_ : asked;
    input.branch = branch_;
    // A procedure that waits or is over does not know of what was armed past it.
    armed_past_procedure_ =
        command_ == OperatorCommand::kArm ||
        (armed_past_procedure_ && executor_.state() != ExecutorState::kDisarmed);
    tick.disarms = disarms_ && command_ == OperatorCommand::kNone && !armed_past_procedure_;
    disarms_ = false;
    command_ = OperatorCommand::kNone;
    tick.before = executor_.state();
    executor_.Tick(input, output_);
    if (options_.tamper) options_.tamper(input, output_);
    Send();
    tick.after = executor_.state();
    if (held_ && (tick.after != ExecutorState::kDisarmed && tick.after != ExecutorState::kArming))
      held_ = false;
    sensor_.Follow(record(), tick.after);
    std::int64_t expiries = 0;
    for (std::size_t i = 0; i < joint_count(); ++i) {
      expiries += drives_[i]->watchdog_expiries();
      tick.position_rad[i] = joints_[i].position_rad;
      tick.enabled[i] = drives_[i]->enabled();
    }
    tick.let_go = expiries != expiries_;
    expiries_ = expiries;
    tick.input = &input;
    tick.output = &output_;
    tick.number = tick_;
    tick.now_ns = now_ns_;
    tick.gap_ns = now_ns_ - begun_ns_;
    tick.paused = paused_;
    tick.moved = tick_ < moved_until_;
    // A drive that was enabled before somebody moved its joint resists him, and may not be heard.
    if (tick.moved && tick.after == ExecutorState::kArming) moved_until_ = tick_ + 50;
    tick.spoilt = tick_ < spoilt_until_;
    paused_ = false;
    return judge_.Take(tick);
  }

  static constexpr std::uint32_t kNoId = 0xffff'ffff;

  const Flight& flight_;
  const FlightOptions& options_;
  FlightSetting setting_;
  SimulatedBus bus_;
  SimulatedPort& host_;
  SimulatedPort* stranger_ = nullptr;
  std::vector<std::unique_ptr<SimulatedDrive>> drives_;
  DriveBank bank_;
  XsensMti xsens_;
  SensorWatch pitch_;
  FlightSensor sensor_;
  FlightOperator operator_;
  Executor executor_;
  TickOutput output_;
  FlightJudge judge_;
  std::array<Joint, kMaxJoints> joints_;
  BusFaultPlan plan_;
  std::vector<ReceivedFrame> received_;
  std::int64_t step_ns_;
  std::int64_t world_ns_ = 0, now_ns_ = 0, begun_ns_ = 0;
  std::int64_t number_ = 0, last_number_ = 0;
  std::int32_t tick_ = 0;
  std::int32_t spoilt_until_ = 0, moved_until_ = 0;
  bool paused_ = false, disarms_ = false;
  bool held_ = true;
  bool armed_past_procedure_ = false;
  std::int32_t stutter_ = -1;
  OperatorCommand command_ = OperatorCommand::kNone;
  std::int8_t branch_ = -1;
  Lasting<Status> link_, send_;
  Lasting<CanControllerState> controller_;
  Status send_status_ = Status::kOk;
  std::array<CanFrame, 4> foreign_{};
  std::size_t foreign_next_ = 0;
  std::int64_t expiries_ = 0;
  std::uint64_t hash_ = 14695981039346656037ULL;
};

}  // namespace

FlightOutcome PlayFlight(const Flight& flight, const FlightOptions& options) {
  return std::make_unique<World>(flight, options)->Play();
}

FlightOutcome PlayFlight(std::string_view text) { return PlayFlight(ParseFlight(text)); }

}  // namespace tumbler::testing
