// Every fault in every state with every protocol, on the simulated bus with simulated drives. Each
// case makes something go wrong in the world and checks the frames: the fault is found, the
// reaction is that of the table, and no frame breaks the rules of tests/support/frame_checker.h.

#include <fmt/format.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <string>
#include <tuple>
#include <vector>

#include "tests/support/fault_world.h"

namespace tumbler {
namespace {

using testing::AnswerOf;
using testing::DriveOrder;
using testing::DrivesOf;
using testing::EveryProtocol;
using testing::FaultBench;
using testing::FaultCase;
using testing::FaultWorld;
using ::testing::IsEmpty;
using testing::IsPossible;
using testing::kKd;
using testing::kKp;
using testing::TestedProtocol;
using Kind = DriveOrder::Kind;

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

class FaultMatrix : public ::testing::TestWithParam<FaultCase> {
 protected:
  /// Ticks until the fault is found, or should have been. @returns the record of that tick.
  TickRecord Await(FaultWorld& world) {
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
    const FaultCase& c = GetParam();
    const bool at_rest = c.state == ExecutorState::kHolding || c.state == ExecutorState::kStopping;
    return c.fault == Fault::kOperatorStop && c.state != ExecutorState::kFault &&
           (at_rest || AnswerOf(c, table(c.fault, c.state)) == Reaction::kHold);
  }
  void ExpectAnswer(const FaultBench& bench, const TickRecord& before,
                    const TickRecord& found) const;
  static void ExpectLatched(const FaultBench& bench, const TickRecord& before,
                            const TickRecord& found, ExecutorState state);
  static void ExpectNeverMoreFreedom(FaultWorld& world, const TickRecord& found, bool plain_stop);
  static void ExpectOnlyTheOperatorClears(FaultBench& bench);

 private:
  int ticks_ = 0;
};

/// Expects that the fault was found as itself, and that the frames are the reaction of the table.
void FaultMatrix::ExpectAnswer(const FaultBench& bench, const TickRecord& before,
                               const TickRecord& found) const {
  const FaultCase& c = GetParam();
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
  const FaultCase& c = GetParam();
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
void FaultMatrix::ExpectNeverMoreFreedom(FaultWorld& world, const TickRecord& found,
                                         bool plain_stop) {
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
  FaultWorld world(GetParam());
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

std::vector<FaultCase> AllCases() {
  std::vector<FaultCase> cases;
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

std::string CaseName(const ::testing::TestParamInfo<FaultCase>& info) {
  const FaultCase& c = info.param;
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
class WayHome : public ::testing::TestWithParam<FaultCase> {};

TEST_P(WayHome, IsRefusedWhileAFaultIsAnsweredMoreStronglyAndEndsInTheAnswerToTheNextOne) {
  FaultWorld world(GetParam());
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

std::vector<FaultCase> CasesOnTheWayHome() {
  std::vector<FaultCase> cases;
  for (const FaultCase& c : AllCases()) {
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
    const FaultCase healthy{protocol, Fault::kNone, state, std::nullopt, std::nullopt};
    FaultWorld world(healthy);
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

TEST(FaultMatrixSize, IsAtLeastFiveHundredCases) { EXPECT_GE(AllCases().size(), 500U); }

}  // namespace
}  // namespace tumbler
