#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <stdexcept>
#include <vector>

#include "firmware_interface/can/bus_schedule.h"
#include "tests/support/fault_bench.h"
#include "tests/support/files.h"
#include "tests/support/motions.h"

namespace tumbler::testing {

/// Gains of drives that take them from the host.
inline constexpr double kKp = 200, kKd = 4;

/// The shipped drives, with one of them mounted the other way round, behind a gear.
inline DrivesConfig DrivesOf(const TestedProtocol& protocol) {
  DrivesConfig drives = LoadDrives(SourcePath(protocol.drives));
  for (DriveEntry& entry : drives.drives) {
    protocol.side->Hasten(entry.config);
    // Of the drives with gains of their own: firm enough to follow these motions, whose
    // feed-forward torques are not those of the rotors.
    entry.kp_nm_per_rad = 60;
  }
  std::visit(
      [](auto& config) {
        config.joint.direction = -1;
        config.joint.gear_ratio = 1.25F;
        config.joint.zero_offset_rad = 0.3F;
      },
      drives.drives[1].config);
  return drives;
}

/// Two nodes in a row. The second begins where the first ends.
struct TwoNodes {
  SequenceGraph<float> graph;
  std::vector<Primitive<float>> primitives;
};
inline TwoNodes MakeTwoNodes() {
  std::mt19937 random(4);
  MotionShape shape;
  shape.duration_s = 0.5;
  shape.settle_s = 0.1;
  shape.amplitude_rad = 0.25;
  TwoNodes motion;
  motion.primitives = {RandomPrimitive<float>(shape, random),
                       RandomPrimitive<float>(shape, random)};
  for (std::size_t i = 0; i < 2; ++i) {
    auto& first = motion.primitives[0].joints[i];
    auto& second = motion.primitives[1].joints[i];
    auto& path = second.position;
    std::vector<float> points(path.control_points().begin(), path.control_points().end());
    const float shift = first.position.control_points().back() - points[0];
    for (float& point : points) point += shift;
    const std::vector<float> knots(path.knots().begin(), path.knots().end());
    if (path.Assign(5, knots, points) != Status::kOk) throw std::logic_error("path");
    second.limits.position_min_rad += shift;
    second.limits.position_max_rad += shift;
    // With this limit, braking takes a while.
    first.limits.acceleration_max_rad_s2 *= 0.6F;
  }
  motion.graph = GraphOf(motion.primitives[0]);
  motion.graph.node_count = 2;
  motion.graph.node_storage[1] = motion.graph.node_storage[0];
  motion.graph.node_storage[1].primitive = 1;
  motion.graph.edge_count = 1;
  motion.graph.edge_storage[0].to = 1;
  motion.graph.edge_storage[0].settle_s = 0.2F;
  return motion;
}

struct FaultCase {
  TestedProtocol protocol = EveryProtocol().front();
  Fault fault = Fault::kNone;
  ExecutorState state = ExecutorState::kDisarmed;
  std::optional<Reaction> reaction;  ///< The configured one; none: the default.
  std::optional<AbortWay> way;       ///< Of the motion's table of aborts; none: it has no table.
};

/// What the table's answer comes to.
inline Reaction AnswerOf(const FaultCase& c, Reaction reaction) {
  if (reaction != Reaction::kAbort) return reaction;
  if (!c.way) return c.fault == Fault::kOperatorStop ? Reaction::kHold : Reaction::kDamp;
  switch (*c.way) {
    case AbortWay::kCatch:
      return Reaction::kHold;
    case AbortWay::kFold:
      return Reaction::kFold;
    case AbortWay::kRollOut:
      return Reaction::kRollOut;
    case AbortWay::kDamp:
      break;
  }
  return Reaction::kDamp;
}

/// Whether a fault can happen in a state at all.
inline bool IsPossible(const DriveConfig& drive, Fault fault, ExecutorState state) {
  const ProtocolSide& side = SideOf(drive);
  switch (fault) {
    case Fault::kNone:
    case Fault::kSensorLost:  // Drives alone have no sensor; sensor_feedback_test.cc tests it,
    case Fault::kFallen:      // and beginnings_test.cc these.
    case Fault::kPitchUnknown:
      return false;
    case Fault::kHeartbeatLost:
      return side.HeartbeatId(drive) != 0;
    case Fault::kOverTemperature:
      return side.nature().says_temperature;
    case Fault::kNonFinite:
      return side.NotANumber(drive).has_value();
    case Fault::kArmingTimeout:
      return state == ExecutorState::kArming;
    case Fault::kEntryMissed:
      return state == ExecutorState::kSettling;
    case Fault::kFollowingError:
      return state != ExecutorState::kArming;  // There is no setpoint to follow yet.
    case Fault::kLateTick:
      return state != ExecutorState::kFault;  // This very fault led there.
    default:
      return true;
  }
}

inline ExecutorConfig ConfigOf(const FaultCase& c, const TwoNodes& motion) {
  ExecutorConfig config;
  config.arming_ticks_max = 400;
  config.collapse.configured = true;
  for (std::size_t i = 0; i < 2; ++i) {
    float& pose = config.collapse.position_rad[i];
    pose = motion.primitives[0].joints[i].position.control_points().back();
    config.joints[i].kp_nm_per_rad = static_cast<float>(kKp);
    config.joints[i].kd_nm_s_per_rad = static_cast<float>(kKd);
    config.joints[i].damping_nm_s_per_rad = 3;
  }
  // MIT drives need five ticks to arm.
  if (c.state == ExecutorState::kArming) config.sequence_errors_max = 2;
  if (c.fault == Fault::kArmingTimeout) {
    config.arming_ticks_max = 30;
    config.stale_ticks_max = 100;
  }
  if (c.fault == Fault::kBusOff) {  // Error-passive comes before it, and may be seen first.
    for (const StateInfo& state : kStateTable) {
      static_cast<void>(config.reactions.Set(Fault::kErrorPassive, state.state, Reaction::kIgnore));
    }
  }
  if (c.reaction) {
    EXPECT_TRUE(config.reactions.Set(c.fault, c.state, *c.reaction));
  }
  return config;
}

class FaultWorld {
 public:
  explicit FaultWorld(const FaultCase& c)
      : case_(c), motion_(MakeTwoNodes()), bench(BenchConfig()) {}

  /// Brings the executor into the state of the case. @returns false when that failed.
  bool Reach() {
    if (case_.state == ExecutorState::kArming && case_.fault != Fault::kArmingTimeout) {
      if (!bench.Reach(ExecutorState::kDisarmed)) return false;
      // The frame that enables the first drive is lost, so that arming lasts. Where there is no
      // such frame, arming is short.
      if (EnableId(0) != 0) bench.Disturb(Of(BusFaultKind::kLoss, 1, EnableId(0)));
      bench.Tick(OperatorCommand::kArm);
      return bench.executor.state() == case_.state;
    }
    return bench.Reach(case_.state);
  }

  /// Makes the fault happen from now on. @returns the ticks after which it must have been found.
  int Provoke() {
    SimulatedDrive& drive = *bench.drives[1];
    const std::int64_t ms = 1'000'000;
    switch (case_.fault) {
      case Fault::kStaleReply:
        bench.Disturb(Of(BusFaultKind::kLoss, 0, PositionId(1)));
        return bench.config().executor.stale_ticks_max + 2;
      case Fault::kWrongSequence:
        bench.Disturb(Of(BusFaultKind::kDuplicate, 0, PositionId(1)));
        if (!Rhythm().answers) {  // Two replies in a tick may come from drift there.
          bench.Disturb(Of(BusFaultKind::kDuplicate, 0, PositionId(1)));
        }
        return Rhythm().answers ? 9 : 16;  // After silent ticks more of them are in order there.
      case Fault::kFollowingError:
        before_each_ = [this] { Displace(0.4); };
        return 4;
      case Fault::kDriveError:
        drive.RaiseError(Side().nature().error);
        return 13;  // CANSimple reports it with its heartbeat.
      case Fault::kHeartbeatLost:
        bench.Disturb(Of(BusFaultKind::kLoss, 0, Side().HeartbeatId(bench.DriveOf(1))));
        return 60;
      case Fault::kOverTemperature:
        drive.set_temperature(95);
        return 13;
      case Fault::kBusOff:
        bench.Disturb(Of(BusFaultKind::kShort), 30 * ms);
        return 3;
      case Fault::kErrorPassive: {
        // 17 attempts fail in a row, with 24 bits and 8 more for each.
        BusFault noise = Of(BusFaultKind::kBitErrors);
        bench.Disturb(noise, 409'000);
        return 3;
      }
      case Fault::kInterfaceDown:
        bench.Disturb(Of(BusFaultKind::kLinkDown, 0), 30 * ms);
        return 2;
      case Fault::kInterfaceGone:
        bench.Disturb(Of(BusFaultKind::kLinkGone, 0), 30 * ms);
        return 2;
      case Fault::kLinkFailed:
        bench.receive_status = Status::kIoError;
        return 1;
      case Fault::kTransmitQueueFull:
        bench.Disturb(Of(BusFaultKind::kStall, 0), 30 * ms);
        return 5;
      case Fault::kLateTick:
        bench.Miss(12);
        return 1;
      case Fault::kPaused:
        bench.Miss(bench.config().executor.pause_ticks_max);
        return 1;
      case Fault::kOperatorStop:
        command_ = OperatorCommand::kStop;
        return 1;
      case Fault::kNonFinite:
        before_each_ = [this] {
          const std::optional<CanFrame> frame = Side().NotANumber(bench.DriveOf(1));
          static_cast<void>(bench.stranger.SendAfter(950'000, frame.value()));
        };
        return 3;
      case Fault::kArmingTimeout:
        bench.Disturb(EnableId(1) == 0 ? Of(BusFaultKind::kLoss, 0, PositionId(1))
                                       : Of(BusFaultKind::kLoss, 2, EnableId(1)));
        return 40;
      case Fault::kEntryMissed:
        before_each_ = [this] { Displace(0.1); };
        return 250;
      case Fault::kForeignCommand:
        static_cast<void>(
            bench.stranger.SendAfter(900'000, Side().StrangersCommand(bench.DriveOf(1))));
        return 3;
      case Fault::kSensorLost:
      case Fault::kFallen:
      case Fault::kPitchUnknown:
      case Fault::kNone:
        break;
    }
    return 1;
  }

  const TickRecord& Tick() {
    if (before_each_) before_each_();
    const OperatorCommand command = command_;
    command_ = OperatorCommand::kNone;
    return bench.Tick(command);
  }

 private:
  [[nodiscard]] const ProtocolSide& Side() const { return *case_.protocol.side; }
  [[nodiscard]] std::uint32_t PositionId(std::size_t joint) const {
    return Side().PositionId(bench.DriveOf(joint));
  }
  [[nodiscard]] std::uint32_t EnableId(std::size_t joint) const {
    return Side().EnableId(bench.DriveOf(joint));
  }
  /// The rhythm of replies of both drives, whose configurations are alike.
  [[nodiscard]] ReplyRhythm Rhythm() const {
    DriveBank bank;
    static_cast<void>(bank.Add(bench.DriveOf(0)));
    return bank.drives()[0]->reply_rhythm();
  }
  static BusFault Of(BusFaultKind kind, int node = BusFault::kEveryNode, std::uint32_t id = 0) {
    BusFault fault;
    fault.kind = kind;
    fault.node = node;
    if (id != 0) fault.ids = {id};
    return fault;
  }
  /// Moves the second joint away from its setpoint, where it stays.
  void Displace(double by_rad) {
    RotorPlant::Rotor& rotor = bench.plant->rotors()[1];
    rotor.position_rad =
        static_cast<double>(bench.output.record.joints[1].limited.position_rad) + by_rad;
    rotor.velocity_rad_s = 0;
  }
  /// One way for the whole time; folds go to the end of the paths.
  void AddAborts(std::vector<Primitive<float>>& primitives) const {
    for (Primitive<float>& primitive : primitives) {
      primitive.aborts.span_count = 1;
      AbortSpan<float>& span = primitive.aborts.span_storage[0];
      span = {primitive.duration_s, *case_.way, 0.02F, 0.5F, {}};
      for (std::size_t i = 0; i < 2; ++i)
        span.position_rad[i] = primitive.joints[i].position.control_points().back();
    }
  }
  FaultBench::Config BenchConfig() {
    FaultBench::Config config;
    config.drives = DrivesOf(case_.protocol);
    config.graph = motion_.graph;
    config.primitives = motion_.primitives;
    if (case_.way) AddAborts(config.primitives);
    config.executor = ConfigOf(case_, motion_);
    config.offset_rad = case_.state == ExecutorState::kMovingToStart ? 0.09 : 0.01;
    // The queue must be full before missing replies are noticed.
    constexpr int kSmall = 6;
    const bool small =
        case_.fault == Fault::kTransmitQueueFull && config.drives.HostFramesMax() <= kSmall;
    if (small) config.transmit_capacity = kSmall;
    return config;
  }

  FaultCase case_;
  TwoNodes motion_;
  OperatorCommand command_ = OperatorCommand::kNone;
  std::function<void()> before_each_;

 public:
  FaultBench bench;
};

}  // namespace tumbler::testing
