// Every fault in every state with every protocol, on the simulated bus with simulated drives. Each
// case makes something go wrong in the world and checks the frames: the fault is found, the
// reaction is that of the table, and no frame breaks the rules of tests/support/frame_checker.h.

#include <fmt/format.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "firmware_interface/can/bus_schedule.h"
#include "firmware_interface/devices/error_texts.h"
#include "tests/support/fault_bench.h"
#include "tests/support/files.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

using testing::DriveOrder;
using testing::EveryProtocol;
using testing::FaultBench;
using ::testing::IsEmpty;
using testing::LoggedFrame;
using testing::TestedProtocol;
using Kind = DriveOrder::Kind;

constexpr double kKp = 200, kKd = 4;

/// The shipped drives, with one of them mounted the other way round, behind a gear.
DrivesConfig DrivesOf(const TestedProtocol& protocol) {
  DrivesConfig drives = LoadDrives(testing::SourcePath(protocol.drives));
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
struct Motion {
  SequenceGraph<float> graph;
  std::vector<Primitive<float>> primitives;
};
Motion MakeMotion() {
  std::mt19937 random(4);
  testing::MotionShape shape;
  shape.duration_s = 0.5;
  shape.settle_s = 0.1;
  shape.amplitude_rad = 0.25;
  Motion motion;
  motion.primitives = {testing::RandomPrimitive<float>(shape, random),
                       testing::RandomPrimitive<float>(shape, random)};
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

struct Case {
  TestedProtocol protocol = EveryProtocol().front();
  Fault fault = Fault::kNone;
  ExecutorState state = ExecutorState::kDisarmed;
  std::optional<Reaction> reaction;  ///< The configured one; none: the default.
  std::optional<AbortWay> way;       ///< Of the motion's table of aborts; none: it has no table.
};

/// What the table's answer comes to.
Reaction AnswerOf(const Case& c, Reaction reaction) {
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
bool IsPossible(const DriveConfig& drive, Fault fault, ExecutorState state) {
  const testing::ProtocolSide& side = testing::SideOf(drive);
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

ExecutorConfig ConfigOf(const Case& c, const Motion& motion) {
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

class World {
 public:
  explicit World(const Case& c) : case_(c), motion_(MakeMotion()), bench(BenchConfig()) {}

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
  [[nodiscard]] const testing::ProtocolSide& Side() const { return *case_.protocol.side; }
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

  Case case_;
  Motion motion_;
  OperatorCommand command_ = OperatorCommand::kNone;
  std::function<void()> before_each_;

 public:
  FaultBench bench;
};

/// The freedom that an order gives a robot: a larger number is more freedom.
int Freedom(const DriveOrder& order) {
  return order.kind == Kind::kSetpoint ? 2 : order.kind == Kind::kPassive ? 1 : 0;
}

/// Expects the frames of a reaction. kIgnore stands for any frames.
void ExpectOrders(const FaultBench& bench, const TestedProtocol& protocol, Reaction reaction) {
  const bool with_gains = protocol.side->nature().carries_gains;
  for (std::size_t i = 0; i < 2; ++i) {
    const DriveOrder& order = bench.judge.last_order(i);
    switch (reaction) {
      case Reaction::kIgnore:
        break;
      case Reaction::kAbort:
        ADD_FAILURE() << "stands for another";
        break;
      case Reaction::kHold:
      case Reaction::kRollOut:
      case Reaction::kFold:
      case Reaction::kCollapse: {
        EXPECT_EQ(order.kind, Kind::kSetpoint) << "joint " << i;
        if (!with_gains) break;
        const double share = reaction == Reaction::kCollapse ? 0.3 : 1;
        EXPECT_NEAR(order.kp_nm_per_rad, share * kKp, 0.15) << "joint " << i;
        EXPECT_NEAR(order.kd_nm_s_per_rad, kKd, 0.002) << "joint " << i;
        break;
      }
      case Reaction::kDamp:
        EXPECT_EQ(order.kind, Kind::kPassive) << "joint " << i;
        if (!with_gains) break;
        EXPECT_NEAR(order.kd_nm_s_per_rad, 3, 0.002) << "joint " << i;
        EXPECT_NEAR(order.velocity_rad_s, 0, 0.02) << "joint " << i;
        break;
      case Reaction::kDisable:
        EXPECT_EQ(order.kind, Kind::kOff) << "joint " << i;
        break;
    }
  }
}

class FaultMatrix : public ::testing::TestWithParam<Case> {
 protected:
  /// Ticks until the fault is found, or should have been. @returns the record of that tick.
  TickRecord Await(World& world) {
    const int ticks_max = world.Provoke();
    ticks_ = 0;
    while (ticks_ < ticks_max && (world.bench.output.record.faults & Bit()) == 0) {
      world.Tick();
      ++ticks_;
    }
    return world.bench.output.record;
  }
  [[nodiscard]] static std::uint32_t Bit() { return 1U << static_cast<unsigned>(GetParam().fault); }
  /// Whether the reaction is a stop that ends in holding, which is no fault state.
  [[nodiscard]] static bool IsPlainStop(const FaultTable& table) {
    const Case& c = GetParam();
    const bool at_rest = c.state == ExecutorState::kHolding || c.state == ExecutorState::kStopping;
    return c.fault == Fault::kOperatorStop && c.state != ExecutorState::kFault &&
           (at_rest || AnswerOf(c, table(c.fault, c.state)) == Reaction::kHold);
  }
  void ExpectAnswer(const FaultBench& bench, const TickRecord& before,
                    const TickRecord& found) const;
  static void ExpectLatched(const FaultBench& bench, const TickRecord& before,
                            const TickRecord& found, ExecutorState state);
  static void ExpectNeverMoreFreedom(World& world, const TickRecord& found, bool plain_stop);
  static void ExpectOnlyTheOperatorClears(FaultBench& bench);

 private:
  int ticks_ = 0;
};

/// Expects that the fault was found as itself, and that the frames are the reaction of the table.
void FaultMatrix::ExpectAnswer(const FaultBench& bench, const TickRecord& before,
                               const TickRecord& found) const {
  const Case& c = GetParam();
  if (c.state == ExecutorState::kDisarmed) {
    EXPECT_EQ(found.faults, 0U) << "while disarmed nothing is a fault";
    ExpectOrders(bench, c.protocol, Reaction::kDisable);
    return;
  }
  if (IsPlainStop(bench.config().executor.reactions)) {
    EXPECT_EQ(found.faults, 0U);
    EXPECT_TRUE(found.state == ExecutorState::kStopping || found.state == ExecutorState::kHolding);
    ExpectOrders(bench, c.protocol, Reaction::kHold);
    return;
  }
  ASSERT_NE(found.faults & Bit(), 0U)
      << "not found in " << ticks_ << " ticks; faults " << found.faults << ", first "
      << ToString(found.first_fault.fault);
  // A stop that is over before the fault is found has ended in holding.
  const bool held_meanwhile = c.state == ExecutorState::kStopping &&
                              found.first_fault.state == ExecutorState::kHolding && ticks_ > 1;
  ExpectLatched(bench, before, found, held_meanwhile ? ExecutorState::kHolding : c.state);
}

/// Expects the latched fault and its reaction. @param state  the one in which the fault was found.
void FaultMatrix::ExpectLatched(const FaultBench& bench, const TickRecord& before,
                                const TickRecord& found, ExecutorState state) {
  const Case& c = GetParam();
  const FaultTable& table = bench.config().executor.reactions;
  if (c.state == ExecutorState::kFault) {
    EXPECT_EQ(found.first_fault.fault, Fault::kLateTick) << "the cause is kept";
  } else {
    EXPECT_EQ(ToString(found.first_fault.fault), std::string(ToString(c.fault)));
    EXPECT_EQ(ToString(found.first_fault.state), std::string(ToString(state)));
    EXPECT_EQ(found.first_fault.reaction, AnswerOf(c, table(c.fault, state)));
  }
  // Other faults found in the same tick can only make the reaction stronger.
  Reaction stated = Stronger(before.reaction, AnswerOf(c, table(c.fault, state)));
  for (const FaultInfo& info : kFaultTable) {
    const std::uint32_t other = 1U << static_cast<unsigned>(info.fault);
    if (info.fault == c.fault || (found.faults & other & ~before.faults) == 0) continue;
    stated = Stronger(stated, table(info.fault, ExecutorState::kFault));
  }
  // A drive that has an error, or is not enabled yet, takes no orders. It must not be driven.
  const bool of_a_drive = c.fault == Fault::kDriveError &&
                          !c.protocol.side->nature().follows_in_error &&
                          Reaction::kDisable != stated;
  if (found.state == ExecutorState::kFault && !of_a_drive) {
    ExpectOrders(bench, c.protocol, stated);
  }
}

/// Expects that no later tick gives a joint more freedom. Joints that hold come to rest, and joints
/// that are to be without torque have none.
void FaultMatrix::ExpectNeverMoreFreedom(World& world, const TickRecord& found, bool plain_stop) {
  FaultBench& bench = world.bench;
  std::array<int, 2> freedom{Freedom(bench.judge.last_order(0)),
                             Freedom(bench.judge.last_order(1))};
  std::array<double, 2> position_rad{};
  for (int i = 0; i < 160; ++i) {
    const TickRecord& record = world.Tick();
    for (std::size_t j = 0; i == 150 && j < 2; ++j) {
      position_rad[j] = bench.judge.last_order(j).position_rad;
    }
    EXPECT_EQ(record.faults & found.faults, found.faults) << "nothing clears itself";
    if (found.faults == 0) continue;
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_LE(Freedom(bench.judge.last_order(j)), freedom[j]) << "joint " << j << ", tick " << i;
      freedom[j] = Freedom(bench.judge.last_order(j));
    }
  }
  const bool holds = plain_stop || (bench.output.record.state == ExecutorState::kFault &&
                                    bench.output.record.reaction == Reaction::kHold);
  for (std::size_t j = 0; holds && j < 2; ++j) {
    const DriveOrder& order = bench.judge.last_order(j);
    EXPECT_NEAR(order.velocity_rad_s, 0, 0.02) << "joint " << j << " has come to rest";
    EXPECT_NEAR(order.position_rad, position_rad[j], 1e-6) << "joint " << j;
  }
  // The order or the watchdog has taken its torque away.
  if (bench.output.record.reaction != Reaction::kDisable) return;
  for (int i = 0; i < 40; ++i) world.Tick();
  for (const auto& drive : bench.drives) {
    EXPECT_TRUE(!drive->enabled() || drive->limp());
    EXPECT_EQ(drive->torque_nm(), 0);
  }
}

void FaultMatrix::ExpectOnlyTheOperatorClears(FaultBench& bench) {
  const TestedProtocol& protocol = GetParam().protocol;
  const bool latched = bench.output.record.faults != 0;
  bench.Tick(OperatorCommand::kDisarm);
  ExpectOrders(bench, protocol, Reaction::kDisable);
  bench.Tick(OperatorCommand::kArm);
  if (!latched) return;
  EXPECT_EQ(bench.output.record.refusal.refusal, Refusal::kFaultLatched);
  bench.Tick(OperatorCommand::kClearFaults);
  EXPECT_EQ(bench.output.record.faults, 0U);
  ExpectOrders(bench, protocol, Reaction::kDisable);
}

TEST_P(FaultMatrix, IsFoundAndAnsweredAsStatedAndNoFrameBreaksARule) {
  World world(GetParam());
  FaultBench& bench = world.bench;
  ASSERT_EQ(bench.configured, Status::kOk);
  ASSERT_TRUE(world.Reach()) << "in state " << ToString(bench.executor.state());
  const TickRecord before = bench.output.record;
  const TickRecord found = Await(world);
  const bool plain_stop = IsPlainStop(bench.config().executor.reactions);
  ASSERT_NO_FATAL_FAILURE(ExpectAnswer(bench, before, found));
  ExpectNeverMoreFreedom(world, found, plain_stop);
  ExpectOnlyTheOperatorClears(bench);
  EXPECT_THAT(bench.judge.report().violations, IsEmpty());
  EXPECT_EQ(bench.missing_writes, 0) << "every tick writes every drive";
}

std::vector<Case> AllCases() {
  std::vector<Case> cases;
  for (const TestedProtocol& protocol : EveryProtocol()) {
    const DriveConfig drive = DrivesOf(protocol).drives[0].config;
    for (const FaultInfo& fault : kFaultTable) {
      for (const StateInfo& state : kStateTable) {
        if (!IsPossible(drive, fault.fault, state.state)) continue;
        cases.push_back({protocol, fault.fault, state.state, std::nullopt, std::nullopt});
        for (const ReactionInfo& reaction : kReactionTable) {
          if (reaction.reaction == Reaction::kIgnore ||
              !FaultTable::IsAllowed(fault.fault, state.state, reaction.reaction) ||
              reaction.reaction == FaultTable()(fault.fault, state.state)) {
            continue;
          }
          cases.push_back({protocol, fault.fault, state.state, reaction.reaction, std::nullopt});
        }
        if (FaultTable()(fault.fault, state.state) != Reaction::kAbort) continue;
        for (const AbortWay way :
             {AbortWay::kCatch, AbortWay::kFold, AbortWay::kRollOut, AbortWay::kDamp}) {
          cases.push_back({protocol, fault.fault, state.state, std::nullopt, way});
        }
      }
    }
  }
  return cases;
}

std::string CaseName(const ::testing::TestParamInfo<Case>& info) {
  const Case& c = info.param;
  std::string name = c.protocol.name + "_" + ToString(c.fault) + "_" + ToString(c.state) +
                     (c.reaction ? std::string("_") + ToString(*c.reaction) : "") +
                     (c.way ? fmt::format("_way{}", static_cast<int>(*c.way)) : "");
  std::replace_if(
      name.begin(), name.end(), [](unsigned char x) { return std::isalnum(x) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(All, FaultMatrix, ::testing::ValuesIn(AllCases()), CaseName);

/// Every fault that can be found on the way to a safe node, after an earlier one that was answered
/// by a hold.
class WayHome : public ::testing::TestWithParam<Case> {};

TEST_P(WayHome, IsRefusedWhileAFaultIsAnsweredMoreStronglyAndEndsInTheAnswerToTheNextOne) {
  World world(GetParam());
  FaultBench& bench = world.bench;
  ASSERT_TRUE(world.Reach());
  bench.Miss(12);
  world.Tick();
  ASSERT_EQ(bench.output.record.first_fault.fault, Fault::kLateTick);
  ASSERT_EQ(bench.output.record.reaction, Reaction::kHold);
  for (int i = 0; i < 30; ++i) world.Tick();
  bench.Tick(OperatorCommand::kGoHome);
  ASSERT_EQ(bench.output.record.refusal.refusal, Refusal::kNone);
  ASSERT_EQ(bench.output.record.state, ExecutorState::kSettling);
  const std::uint32_t late = 1U << static_cast<unsigned>(Fault::kLateTick);
  EXPECT_EQ(bench.output.record.faults, late) << "it stays latched";

  const Fault fault = GetParam().fault;
  const std::uint32_t both = late | 1U << static_cast<unsigned>(fault);
  const int patience = world.Provoke();
  for (int i = 0; i < patience && (bench.output.record.faults & both) != both; ++i) world.Tick();
  EXPECT_EQ(bench.output.record.faults & both, both);
  EXPECT_EQ(bench.output.record.first_fault.fault, Fault::kLateTick) << "the cause is the first";
  const Reaction reaction = FaultTable()(fault, ExecutorState::kSettling);
  EXPECT_EQ(bench.output.record.reaction, Stronger(bench.output.record.reaction, reaction));
  for (int i = 0; i < 30; ++i) world.Tick();
  EXPECT_EQ(bench.executor.state(), ExecutorState::kFault);
  EXPECT_EQ(bench.output.record.reaction, Stronger(bench.output.record.reaction, reaction));
  if (bench.output.record.reaction != Reaction::kHold) {
    bench.Tick(OperatorCommand::kGoHome);
    EXPECT_EQ(bench.output.record.refusal.refusal, Refusal::kWrongState);
    EXPECT_EQ(bench.executor.state(), ExecutorState::kFault);
  }
  bench.Tick(OperatorCommand::kDisarm);
  bench.Tick(OperatorCommand::kArm);
  EXPECT_EQ(bench.output.record.refusal.refusal, Refusal::kFaultLatched);
  EXPECT_THAT(bench.judge.report().violations, IsEmpty());
}

std::vector<Case> CasesOnTheWayHome() {
  std::vector<Case> cases;
  for (const Case& c : AllCases()) {
    const bool apart = c.fault != Fault::kLateTick && c.fault != Fault::kOperatorStop &&
                       c.fault != Fault::kEntryMissed;
    if (apart && c.state == ExecutorState::kSettling && !c.reaction) cases.push_back(c);
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(All, WayHome, ::testing::ValuesIn(CasesOnTheWayHome()), CaseName);

/// What a bus with real adapters and other nodes does to a healthy robot, in every state.
class Nuisance : public ::testing::TestWithParam<std::tuple<TestedProtocol, ExecutorState>> {};

TEST_P(Nuisance, LateAndLostRepliesAndFramesOfOtherNodesAreNoFault) {
  const auto& [protocol, state] = GetParam();
  BusFault late;
  late.kind = BusFaultKind::kDelay;
  late.node = 0;
  late.probability = 0.2;
  late.delay_ns = 1'000'000;
  BusFault lost;
  lost.kind = BusFaultKind::kLoss;
  lost.node = 0;
  lost.probability = 0.01;
  for (const BusFault& nuisance : {late, lost}) {
    const Case healthy{protocol, Fault::kNone, state, std::nullopt, std::nullopt};
    World world(healthy);
    FaultBench& bench = world.bench;
    ASSERT_TRUE(bench.Reach(state == ExecutorState::kArming ? ExecutorState::kDisarmed : state));
    bench.Disturb(nuisance);
    if (state == ExecutorState::kArming) bench.Tick(OperatorCommand::kArm);
    for (int i = 0; i < 400; ++i) {
      CanFrame strange;
      strange.id = 0x7f1;
      strange.size = 8;
      static_cast<void>(bench.stranger.SendAfter(700'000, strange));
      bench.Tick();
      ASSERT_EQ(bench.output.record.faults, 0U)
          << ToString(bench.output.record.first_fault.fault) << " after " << i << " ticks";
    }
    if (state == ExecutorState::kArming) {
      EXPECT_EQ(bench.executor.state(), ExecutorState::kHolding);
    }
    EXPECT_EQ(bench.missing_writes, 0);
  }
}

std::string NuisanceName(
    const ::testing::TestParamInfo<std::tuple<TestedProtocol, ExecutorState>>& info) {
  std::string name = std::get<0>(info.param).name + "_" + ToString(std::get<1>(info.param));
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(
    All, Nuisance,
    ::testing::Combine(::testing::ValuesIn(EveryProtocol()),
                       ::testing::Values(ExecutorState::kDisarmed, ExecutorState::kArming,
                                         ExecutorState::kHolding, ExecutorState::kMovingToStart,
                                         ExecutorState::kRunning, ExecutorState::kSettling,
                                         ExecutorState::kStopping)),
    NuisanceName);

/// A CANSimple drive says its errors and its positions in messages of their own.
TEST(Latched, ADriveThatReportsAnErrorAndNoPositionIsNotCalledSilent) {
  for (const TestedProtocol& protocol : EveryProtocol()) {
    if (protocol.name != std::string("cansimple")) continue;
    World world(Case{protocol, Fault::kNone, ExecutorState::kDisarmed, std::nullopt, std::nullopt});
    FaultBench& bench = world.bench;
    BusFault lost;
    lost.kind = BusFaultKind::kLoss;
    lost.node = 0;
    lost.ids = {protocol.side->PositionId(bench.DriveOf(1))};
    bench.Disturb(lost);
    bench.drives[1]->RaiseError(protocol.side->nature().error);
    for (int i = 0; i < 40; ++i) bench.Tick();
    bench.Tick(OperatorCommand::kArm);
    EXPECT_EQ(bench.output.record.refusal.refusal, Refusal::kDriveError);
    EXPECT_EQ(bench.output.record.refusal.joint, 1);
    EXPECT_NE(bench.output.record.refusal.value.code(), 0U);
  }
}

/// After a crash or an emergency stop a drive has latched an error before anybody arms.
TEST(Latched, ADriveThatReportsAnErrorIsArmedOnlyAfterTheOperatorHasClearedIt) {
  for (const TestedProtocol& protocol : EveryProtocol()) {
    const Case healthy{protocol, Fault::kNone, ExecutorState::kDisarmed, std::nullopt,
                       std::nullopt};
    World world(healthy);
    FaultBench& bench = world.bench;
    ASSERT_TRUE(bench.Reach(ExecutorState::kDisarmed));
    bench.drives[1]->RaiseError(protocol.side->nature().error);
    for (int i = 0; i < 40; ++i) bench.Tick();
    bench.Tick(OperatorCommand::kArm);
    EXPECT_EQ(bench.output.record.refusal.refusal, Refusal::kDriveError) << protocol.name;
    EXPECT_EQ(bench.output.record.refusal.joint, 1);
    EXPECT_NE(bench.output.record.refusal.value.code(), 0U);
    EXPECT_EQ(bench.executor.state(), ExecutorState::kDisarmed);
    if (!protocol.side->nature().clears_errors) continue;
    bench.Tick(OperatorCommand::kClearFaults);
    for (int i = 0; i < 40; ++i) bench.Tick();
    bench.Tick(OperatorCommand::kArm);
    EXPECT_EQ(bench.output.record.refusal.refusal, Refusal::kNone) << protocol.name;
    for (int i = 0; i < 400; ++i) bench.Tick();
    EXPECT_EQ(bench.executor.state(), ExecutorState::kHolding) << protocol.name;
    EXPECT_THAT(bench.judge.report().violations, IsEmpty());
  }
}

/// The frames of a good run. Tests spoil one, and the judge of the matrix must notice.
class Judge : public ::testing::TestWithParam<TestedProtocol> {
 protected:
  Judge() : bench_(ConfigOfBench()) {
    bench_.keep_log = true;
    EXPECT_TRUE(bench_.Reach(ExecutorState::kRunning));
    for (int i = 0; i < 20; ++i) bench_.Tick();
    for (std::size_t i = 0; i < bench_.log.size(); ++i) {
      if (bench_.log[i].frame.id == SetpointId()) at_ = i;
    }
    EXPECT_THAT(bench_.judge.report().violations, IsEmpty());
    at_ -= 40;  // so that it is not the last tick
    while (bench_.log[at_].frame.id != SetpointId()) --at_;
    log_ = bench_.log;
  }
  static FaultBench::Config ConfigOfBench() {
    const Motion motion = MakeMotion();
    FaultBench::Config config;
    config.drives = DrivesOf(GetParam());
    config.graph = motion.graph;
    config.primitives = motion.primitives;
    config.executor = ConfigOf({}, motion);
    return config;
  }
  [[nodiscard]] static const testing::ProtocolSide& Side() { return *GetParam().side; }
  [[nodiscard]] std::uint32_t SetpointId() const { return Side().SetpointId(bench_.DriveOf(1)); }
  [[nodiscard]] std::uint32_t TorqueId() const { return Side().TorqueId(bench_.DriveOf(1)); }
  std::string Violations() {
    const testing::FrameReport report = CheckFrames(log_, FaultBench::RulesOf(bench_.config()));
    std::string all;
    for (const std::string& violation : report.violations) all += violation + "\n";
    return all;
  }
  CanFrame& Setpoint() { return log_[at_].frame; }

  FaultBench bench_;
  std::vector<LoggedFrame> log_;
  std::size_t at_ = 0;  // the index of a setpoint of joint 1
};

TEST_P(Judge, FindsNothingInAGoodRun) { EXPECT_EQ(Violations(), ""); }

TEST_P(Judge, NoticesAStepInPosition) {
  Side().SpoilSetpoint(Setpoint());
  EXPECT_THAT(Violations(), ::testing::AnyOf(::testing::HasSubstr("joint 1: a step of"),
                                             ::testing::HasSubstr("joint 1: position")));
}

TEST_P(Judge, NoticesATickThatLeavesADriveOut) {
  const double time_s = log_[at_].time_s;
  std::erase_if(log_, [&](const LoggedFrame& logged) {
    return logged.time_s == time_s &&
           (logged.frame.id == SetpointId() || logged.frame.id == TorqueId());
  });
  EXPECT_THAT(Violations(), ::testing::AnyOf(::testing::HasSubstr("where joint 1 is due")));
}

TEST_P(Judge, NoticesASetpointAfterTorqueOff) {
  LoggedFrame off = log_[at_];
  off.time_s -= 0.0005;
  off.frame = Side().TorqueOff(bench_.DriveOf(1));
  log_[at_] = off;
  EXPECT_THAT(Violations(), ::testing::HasSubstr("joint 1 is driven without having been started"));
}

TEST_P(Judge, NoticesATorqueBeyondItsLimit) {
  std::size_t at = at_;
  while (log_[at].frame.id != TorqueId()) ++at;
  Side().SpoilTorque(log_[at].frame);
  EXPECT_THAT(Violations(), ::testing::HasSubstr("joint 1: torque"));
}

TEST_P(Judge, NoticesAStrangersFrame) {
  log_[at_].frame.id = 0x7aa;
  EXPECT_THAT(Violations(), ::testing::HasSubstr("identifier 7AA is none of the drives'"));
}

TEST_P(Judge, NoticesAFirstSetpointFarFromWhereTheDriveIs) {
  for (LoggedFrame& logged : log_) {
    if (logged.frame.id == Side().PositionId(bench_.DriveOf(1))) Side().SpoilReply(logged.frame);
  }
  EXPECT_THAT(Violations(), ::testing::HasSubstr("joint 1: the first setpoint is"));
}

INSTANTIATE_TEST_SUITE_P(All, Judge, ::testing::ValuesIn(EveryProtocol()),
                         [](const auto& given) { return given.param.name; });

/// Motions that break the limits that they state. The last gate is there for them. The judge knows
/// only the stated limits.
class Gate : public ::testing::TestWithParam<std::tuple<TestedProtocol, int>> {};

TEST_P(Gate, KeepsEveryStatedLimitWhateverThePlan) {
  const auto [protocol, limit] = GetParam();
  Motion motion = MakeMotion();
  for (Primitive<float>& primitive : motion.primitives) {
    primitive.following_tolerance_rad = 10;
    primitive.entry_tolerance_rad = 10;
    for (std::size_t i = 0; i < 2; ++i) {
      JointMotion<float>& joint = primitive.joints[i];
      JointLimits<float>& limits = joint.limits;
      const float start = joint.position.control_points()[0];
      switch (limit) {
        case 0:
          limits.position_max_rad = std::max(start, joint.position.control_points().back()) + 0.02F;
          break;
        case 1:
          limits.position_min_rad = std::min(start, joint.position.control_points().back()) - 0.02F;
          break;
        case 2:
          limits.velocity_max_rad_s *= 0.3F;
          break;
        default:
          limits.torque_max_nm *= 0.2F;
          break;
      }
    }
  }
  FaultBench::Config config;
  config.drives = DrivesOf(protocol);
  config.graph = GraphOf(motion.primitives[0]);
  config.primitives = {motion.primitives[0]};
  config.executor = ConfigOf({}, motion);
  config.executor.collapse.configured = false;
  FaultBench bench(std::move(config));
  ASSERT_EQ(bench.configured, Status::kOk);
  ASSERT_TRUE(bench.Reach(ExecutorState::kRunning));
  int limited = 0;
  for (int i = 0; i < 1200; ++i) {
    const TickRecord& record = bench.Tick();
    limited += record.joints[0].limit_active || record.joints[1].limit_active ? 1 : 0;
  }
  EXPECT_GT(limited, 20) << "the gate has had something to do";
  EXPECT_EQ(bench.output.record.faults, 0U);
  EXPECT_THAT(bench.judge.report().violations, IsEmpty());
}

std::string GateName(const ::testing::TestParamInfo<std::tuple<TestedProtocol, int>>& given) {
  constexpr std::array kLimits{"PositionMax", "PositionMin", "Velocity", "Torque"};
  return std::get<0>(given.param).name + "_" +
         kLimits[static_cast<std::size_t>(std::get<1>(given.param))];
}

INSTANTIATE_TEST_SUITE_P(All, Gate,
                         ::testing::Combine(::testing::ValuesIn(EveryProtocol()),
                                            ::testing::Range(0, 4)),
                         GateName);

TEST(Arming, DoesNotJumpWhenTheJointIsTurnedMeanwhile) {
  for (const TestedProtocol& protocol : EveryProtocol()) {
    FaultBench::Config config;
    const Motion motion = MakeMotion();
    config.drives = DrivesOf(protocol);
    config.graph = motion.graph;
    config.primitives = motion.primitives;
    config.executor = ConfigOf({}, motion);
    FaultBench bench(std::move(config));
    ASSERT_TRUE(bench.Reach(ExecutorState::kDisarmed));
    bench.Tick(OperatorCommand::kArm);
    while (bench.executor.state() == ExecutorState::kArming && bench.tick() < 2000) {
      bench.plant->rotors()[1].position_rad += 0.004;
      bench.plant->rotors()[1].velocity_rad_s = 0;
      bench.Tick();
    }
    for (int i = 0; i < 50; ++i) bench.Tick();
    EXPECT_EQ(bench.executor.state(), ExecutorState::kHolding);
    EXPECT_THAT(bench.judge.report().violations, IsEmpty()) << protocol.name;
  }
}

/// MIT drives are an exception: they do not report their mode.
TEST(Dropout, ADriveThatSomebodyElseSwitchesOffIsADriveError) {
  int protocols = 0;
  for (const TestedProtocol& protocol : EveryProtocol()) {
    FaultBench::Config config;
    const Motion motion = MakeMotion();
    config.drives = DrivesOf(protocol);
    config.graph = motion.graph;
    config.primitives = motion.primitives;
    config.executor = ConfigOf({}, motion);
    for (const StateInfo& state : kStateTable) {  // The order itself is not looked for here.
      static_cast<void>(
          config.executor.reactions.Set(Fault::kForeignCommand, state.state, Reaction::kIgnore));
    }
    FaultBench bench(std::move(config));
    ASSERT_TRUE(bench.Reach(ExecutorState::kHolding));
    const std::optional<CanFrame> off = protocol.side->DropOut(bench.DriveOf(1));
    if (!off) continue;
    ++protocols;
    ASSERT_EQ(bench.stranger.SendAfter(500'000, *off), Status::kOk);
    for (int i = 0; i < 15; ++i) bench.Tick();
    EXPECT_EQ(ToString(bench.output.record.first_fault.fault), std::string("drive error"))
        << protocol.name;
    // A CiA 402 drive says at once that it misses its host; the others have no error.
    EXPECT_EQ(bench.output.record.first_fault.value.code(),
              protocol.name == std::string("cia402") ? 0x8130U : 0U)
        << protocol.name;
    EXPECT_EQ(bench.judge.last_order(0).kind, Kind::kPassive);
    EXPECT_EQ(bench.judge.last_order(1).kind, Kind::kOff) << "it is not to come back by itself";
  }
  EXPECT_GE(protocols, 2);
}

TEST(Arming, EndsOnlyWhenEveryDriveIsEnabledHoweverSoonItFollowsTorqueOff) {
  for (const TestedProtocol& protocol : EveryProtocol()) {
    for (int pause = 0; pause < 20; ++pause) {
      FaultBench::Config config;
      const Motion motion = MakeMotion();
      config.drives = LoadDrives(testing::SourcePath(protocol.drives));  // heartbeats 0.1 s apart
      config.graph = motion.graph;
      config.primitives = motion.primitives;
      config.executor = ConfigOf({}, motion);
      FaultBench bench(std::move(config));
      ASSERT_TRUE(bench.Reach(ExecutorState::kHolding));
      bench.Tick(OperatorCommand::kDisarm);
      for (int i = 0; i < pause; ++i) bench.Tick();
      bench.Tick(OperatorCommand::kArm);
      while (bench.executor.state() == ExecutorState::kArming) bench.Tick();
      ASSERT_EQ(bench.executor.state(), ExecutorState::kHolding) << protocol.name;
      for (const auto& drive : bench.drives) {
        EXPECT_TRUE(drive->enabled()) << protocol.name << " after " << pause << " ticks";
      }
      EXPECT_THAT(bench.judge.report().violations, IsEmpty()) << protocol.name;
    }
  }
}

/// A bench of MIT drives whose configuration `change` has changed.
template <typename Change>
FaultBench::Config MitBench(const Change& change) {
  FaultBench::Config config;
  const Motion motion = MakeMotion();
  config.drives = LoadDrives(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  for (DriveEntry& entry : config.drives.drives) change(std::get<MitConfig>(entry.config));
  config.graph = motion.graph;
  config.primitives = motion.primitives;
  config.executor = ConfigOf({}, motion);
  return config;
}

TEST(MitDialects, ADriveThatAnswersOnItsOwnIdentifierIsDriven) {
  FaultBench bench(MitBench([](MitConfig& mit) { mit.reply_id = mit.command_id; }));
  EXPECT_TRUE(bench.Reach(ExecutorState::kRunning));
  EXPECT_EQ(bench.output.record.faults, 0U);
}

TEST(MitDialects, DamiaosDrivesAreDrivenAndSayWhenTheyDropOut) {
  FaultBench bench(MitBench([](MitConfig& mit) { mit.dialect = MitDialect::kDamiao; }));
  ASSERT_TRUE(bench.Reach(ExecutorState::kRunning));
  EXPECT_EQ(bench.output.record.faults, 0U);
  bench.drives[1]->RaiseError(13);
  for (int i = 0; i < 3; ++i) bench.Tick();
  EXPECT_EQ(bench.output.record.first_fault.fault, Fault::kDriveError);
  EXPECT_EQ(bench.output.record.first_fault.value.integer(), 13);
  bench.Tick(OperatorCommand::kDisarm);
  bench.Tick(OperatorCommand::kClearFaults);
  for (int i = 0; i < 5; ++i) bench.Tick();
  EXPECT_EQ(bench.output.record.joints[1].drive_error, 0U) << "the drive has forgotten it";
}

TEST(ManyDrives, OneToAllAreArmedWhateverTheOrderOfTheirIdentifiersIs) {
  enum class Order { kRepliesAbove, kRepliesBelow, kRepliesReversed, kOwnIdentifier };
  for (int count = 1; count <= kMaxJoints; ++count) {
    for (const Order order : {Order::kRepliesAbove, Order::kRepliesBelow, Order::kRepliesReversed,
                              Order::kOwnIdentifier}) {
      std::mt19937 random(5);
      testing::MotionShape shape;
      shape.joint_count = count;
      shape.amplitude_rad = 0.25;
      FaultBench::Config config;
      config.primitives = {testing::RandomPrimitive<float>(shape, random)};
      config.graph = GraphOf(config.primitives[0]);
      std::vector<std::string> joints;
      joints.reserve(static_cast<std::size_t>(count));
      for (int i = 0; i < count; ++i) joints.push_back("joint" + std::to_string(i + 1));
      config.drives = DefaultDrives(joints);
      config.drives.rate_hz = count <= 2 ? 1000 : count <= 8 ? 400 : 3000 / count;
      config.executor.period_s = static_cast<float>(1 / config.drives.rate_hz);
      for (int i = 0; i < count; ++i) {
        auto& mit = std::get<MitConfig>(config.drives.drives[static_cast<std::size_t>(i)].config);
        const auto number = static_cast<std::uint16_t>(i);
        if (order == Order::kRepliesBelow) {
          mit.command_id = static_cast<std::uint16_t>(0x20 + number);
          mit.reply_id = static_cast<std::uint16_t>(1 + number);
        } else if (order == Order::kRepliesReversed) {
          mit.reply_id = static_cast<std::uint16_t>(40 - number);
        } else if (order == Order::kOwnIdentifier) {
          mit.reply_id = mit.command_id;
        }
      }
      config.transmit_capacity = config.drives.HostPort().transmit_capacity;
      FaultBench bench(std::move(config));
      ASSERT_EQ(bench.configured, Status::kOk);
      EXPECT_TRUE(bench.Reach(ExecutorState::kRunning))
          << count << " drives, order " << static_cast<int>(order) << ": "
          << ToString(bench.output.record.refusal.refusal) << " "
          << ToString(bench.output.record.first_fault.fault);
    }
  }
}

TEST(ManyDrives, OneToAllOfAkV3AreArmedAtARateThatTheBusBears) {
  for (int count = 1; count <= kMaxJoints; ++count) {
    std::mt19937 random(5);
    testing::MotionShape shape;
    shape.joint_count = count;
    shape.amplitude_rad = 0.25;
    FaultBench::Config config;
    config.primitives = {testing::RandomPrimitive<float>(shape, random)};
    config.graph = GraphOf(config.primitives[0]);
    // Five fit at 500 Hz, eight at 350 Hz, twelve at 240 Hz, with room for an error:
    // docs/protocols/akv3.md.
    config.drives.rate_hz = count <= 5 ? 500 : count <= 8 ? 350 : 2880 / count;
    config.executor.period_s = static_cast<float>(1 / config.drives.rate_hz);
    for (int i = 0; i < count; ++i) {
      DriveEntry entry;
      entry.joint = "joint" + std::to_string(i + 1);
      AkV3Config drive = AkV3Protocol::Example(i);
      if (count > 5) drive.status_s = 1 / config.drives.rate_hz;
      entry.config = drive;
      entry.kp_nm_per_rad = 200;
      entry.kd_nm_s_per_rad = 4;
      config.drives.drives.push_back(entry);
    }
    BusSchedule schedule;
    schedule.rate_hz = config.drives.rate_hz;
    schedule.tick_bits = config.drives.WorstCaseTickBits();
    schedule.longest_frame_bits = config.drives.LongestFrameBits();
    EXPECT_EQ(schedule.tick_bits, 320 * count);
    EXPECT_TRUE(schedule.feasible()) << schedule.Describe();
    config.transmit_capacity = config.drives.HostPort().transmit_capacity;
    FaultBench bench(std::move(config));
    ASSERT_EQ(bench.configured, Status::kOk);
    EXPECT_TRUE(bench.Reach(ExecutorState::kRunning))
        << count << " drives: " << ToString(bench.output.record.refusal.refusal) << " "
        << ToString(bench.output.record.first_fault.fault);
  }
}

TEST(ManyDrives, OfEveryProtocolOnOneBusAreArmed) {
  std::mt19937 random(5);
  testing::MotionShape shape;
  shape.joint_count = static_cast<int>(EveryProtocol().size());
  shape.amplitude_rad = 0.25;
  FaultBench::Config config;
  config.primitives = {testing::RandomPrimitive<float>(shape, random)};
  config.graph = GraphOf(config.primitives[0]);
  config.drives.rate_hz = 500;  // At 1 kHz their frames would not fit on the bus.
  config.executor.period_s = 0.002F;
  std::uint8_t node = 1;
  for (const TestedProtocol& protocol : EveryProtocol()) {
    const DrivesConfig shipped = LoadDrives(testing::SourcePath(protocol.drives));
    DriveEntry entry = shipped.drives[0];
    entry.joint = "joint" + std::to_string(config.drives.drives.size() + 1);
    if (auto* mit = std::get_if<MitConfig>(&entry.config)) mit->command_id = 0x40;
    if (auto* mit = std::get_if<MitConfig>(&entry.config)) mit->reply_id = 0x41;
    if (auto* can = std::get_if<CanSimpleConfig>(&entry.config)) {
      can->node_id = 9;
      can->estimates_per_tick_max = 3;  // of 1 ms
    }
    if (auto* csp = std::get_if<Cia402Config>(&entry.config)) {
      csp->node_id = ++node;
      csp->period_us = 2000;
    }
    config.drives.drives.push_back(entry);
  }
  FaultBench bench(std::move(config));
  ASSERT_EQ(bench.configured, Status::kOk);
  EXPECT_TRUE(bench.Reach(ExecutorState::kRunning))
      << ToString(bench.output.record.refusal.refusal) << " "
      << ToString(bench.output.record.first_fault.fault);
}

TEST(SetUp, ADriveThatRefusesAnObjectIsNotSilentAndSaysWhich) {
  FaultBench::Config config;
  const Motion motion = MakeMotion();
  config.drives = LoadDrives(testing::SourcePath("primitives/robots/tumbler_drives_cia402.toml"));
  config.graph = motion.graph;
  config.primitives = motion.primitives;
  config.executor = ConfigOf({}, motion);
  FaultBench bench(std::move(config));
  const std::uint8_t node = std::get<Cia402Config>(bench.DriveOf(0)).node_id;
  bench.drives[0]->set_silent(true);
  SdoRequest refused;
  bench.on_sent = [&](const CanFrame& frame) {
    if (DecodeSdoRequest(node, frame, refused) != Status::kOk) return;
    static_cast<void>(bench.stranger.SendAfter(
        300'000, EncodeSdoReply(
                     node, {SdoReply::Kind::kAborted, refused.index, refused.sub, 0, 0x06090011})));
  };
  for (int i = 0; i < 50; ++i) bench.Tick();
  const RefusalDetail refusal = bench.Tick(OperatorCommand::kArm).refusal;
  EXPECT_EQ(refusal.refusal, Refusal::kDriveError) << ToString(refusal.refusal);
  EXPECT_EQ(refusal.joint, 0);
  EXPECT_EQ(DescribeSetUpRefusal({refused.index, refused.sub, 0x06090011}),
            fmt::format("object {:04x}:{:02x}: 0x06090011, the sub-index does not exist",
                        refused.index, refused.sub));
}

TEST(DriveErrors, HaveTheirCodesInHexadecimalAndTheirNames) {
  MitConfig damiao;
  damiao.dialect = MitDialect::kDamiao;
  EXPECT_EQ(DescribeDriveError(MitConfig(), 4), "0x04, under-voltage");
  EXPECT_EQ(DescribeDriveError(damiao, 13), "0x0d, lost communication");
  EXPECT_EQ(DescribeDriveError(CanSimpleConfig(), 0x1000100),
            "0x01000100, dc bus over-voltage, watchdog timer expired");
  EXPECT_EQ(DescribeDriveError(Cia402Config(), 0x8611), "0x8611, following error");
  EXPECT_EQ(DescribeDriveError(Cia402Config(), 0x1234), "0x1234");
}

TEST(FaultMatrixSize, IsAtLeastFiveHundredCases) { EXPECT_GE(AllCases().size(), 500U); }

}  // namespace
}  // namespace tumbler
