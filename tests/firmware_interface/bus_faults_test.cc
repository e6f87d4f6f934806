// What goes wrong on the simulated bus: counters of errors, and scripted faults.

#include "firmware_interface/can/simulated_bus.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/support/bus_traffic.h"

namespace tumbler {
namespace {

using testing::Drain;
using testing::Echo;
using testing::Ids;
using testing::kBit;
using testing::List;
using testing::LongFrame;

constexpr std::int64_t kMs = 1'000'000;

BusFaultPlan Script(BusFaultKind kind, double probability = 1, int node = BusFault::kEveryNode) {
  BusFaultPlan plan;
  BusFault fault;
  fault.kind = kind;
  fault.probability = probability;
  fault.node = node;
  plan.faults.push_back(fault);
  return plan;
}

TEST(ErrorCounters, GoDownByOneWithEachGoodFrame) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  BusFaultPlan plan = Script(BusFaultKind::kBitErrors);
  plan.faults[0].end_ns = 1;  // The first try only.
  bus.SetFaults(plan);
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  bus.AdvanceTo(100'000);  // not yet the end of the second one
  EXPECT_EQ(a.transmit_errors(), 8);
  EXPECT_EQ(b.receive_errors(), 1);
  for (int i = 0; i < 3; ++i) ASSERT_EQ(a.Send(LongFrame(2)), Status::kOk);
  bus.AdvanceTo(10 * kMs);
  EXPECT_EQ(Ids(Drain(b)), (List{1, 2, 2, 2}));
  EXPECT_EQ(a.transmit_errors(), 4);
  EXPECT_EQ(b.receive_errors(), 0);
  EXPECT_EQ(a.statistics().errors, 1);
  EXPECT_EQ(bus.statistics().disturbed, 1);
}

TEST(ErrorCounters, AShortTakesTheSenderThroughPassiveToBusOffAndOthersToPassiveAtMost) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  bus.SetFaults(Script(BusFaultKind::kShort));
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  ASSERT_EQ(a.Send(LongFrame(2)), Status::kOk);
  std::vector<CanControllerState> seen{CanControllerState::kErrorActive};
  for (std::int64_t us = 0; us < 2000; ++us) {
    bus.AdvanceTo(us * 1000);
    if (a.controller_state() != seen.back()) seen.push_back(a.controller_state());
  }
  EXPECT_EQ(seen, (std::vector{CanControllerState::kErrorActive, CanControllerState::kErrorWarning,
                               CanControllerState::kErrorPassive, CanControllerState::kBusOff}));
  EXPECT_EQ(a.transmit_errors(), 256);
  EXPECT_EQ(a.statistics().dropped_transmit, 2) << "nothing waits to be sent later";
  EXPECT_EQ(b.receive_errors(), 32);
  EXPECT_EQ(b.controller_state(), CanControllerState::kErrorActive);
  ReceivedFrame received;
  EXPECT_EQ(a.Receive(received), Status::kBusOff);
}

TEST(ErrorCounters, RecoveryTakesARestartAnd128TimesElevenRecessiveBits) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  BusFaultPlan plan = Script(BusFaultKind::kShort);
  plan.faults[0].end_ns = 2 * kMs;
  bus.SetFaults(plan);
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  bus.AdvanceTo(100 * kMs);
  EXPECT_EQ(a.Send(LongFrame(1)), Status::kBusOff) << "nobody has restarted it";
  a.Restart();
  bus.AdvanceTo(100 * kMs + 1408 * kBit - 11 * kBit);
  EXPECT_EQ(a.Send(LongFrame(1)), Status::kBusOff);
  bus.AdvanceTo(100 * kMs + 1408 * kBit);
  EXPECT_EQ(a.controller_state(), CanControllerState::kErrorActive);
  EXPECT_EQ(a.transmit_errors(), 0);
  ASSERT_EQ(a.Send(LongFrame(3)), Status::kOk);
  bus.AdvanceTo(200 * kMs);
  EXPECT_EQ(Ids(Drain(b)), (List{3}));
}

TEST(ErrorCounters, ABusyBusGivesOneRecessiveSequenceAFrame) {
  SimulatedBus bus;
  SimulatedBus::PortConfig restarts;
  restarts.restart_ns = 0;
  auto& a = bus.Attach(restarts);
  SimulatedBus::PortConfig deep;
  deep.transmit_capacity = 300;
  auto& b = bus.Attach(deep);
  auto& c = bus.Attach();
  BusFaultPlan plan = Script(BusFaultKind::kShort);
  plan.faults[0].end_ns = 1 * kMs;
  bus.SetFaults(plan);
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  bus.AdvanceTo(1 * kMs);
  ASSERT_EQ(a.controller_state(), CanControllerState::kBusOff);
  for (int i = 0; i < 300; ++i) ASSERT_EQ(b.Send(LongFrame(7)), Status::kOk);
  std::int64_t heard = 0;
  while (a.controller_state() == CanControllerState::kBusOff && bus.now_ns() < 100 * kMs) {
    bus.AdvanceTo(bus.now_ns() + 1000);
    heard += static_cast<std::int64_t>(Drain(c).size());
  }
  EXPECT_NEAR(static_cast<double>(heard), 128, 1);
  EXPECT_EQ(a.statistics().received, 0) << "who is bus-off hears nothing";
}

TEST(ErrorCounters, BusOffNodesDoNotAcknowledge) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  auto& c = bus.Attach();
  ASSERT_EQ(a.Send(LongFrame(5, 1)), Status::kOk);
  ASSERT_EQ(b.Send(LongFrame(5, 2)), Status::kOk);
  bus.AdvanceTo(10 * kMs);
  ASSERT_EQ(b.controller_state(), CanControllerState::kBusOff);
  ASSERT_EQ(c.Send(LongFrame(1)), Status::kOk);
  bus.AdvanceTo(20 * kMs);
  EXPECT_EQ(c.statistics().sent, 0);
  EXPECT_EQ(c.controller_state(), CanControllerState::kErrorPassive);
}

TEST(ErrorCounters, AnErrorPassiveNodeLetsOthersGoFirst) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  auto& c = bus.Attach();
  BusFaultPlan plan = Script(BusFaultKind::kBitErrors);
  plan.faults[0].ids = {1};
  plan.faults[0].end_ns = 700'000;
  bus.SetFaults(plan);
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  while (a.controller_state() != CanControllerState::kErrorPassive) {
    ASSERT_LT(bus.now_ns(), 700'000);
    bus.AdvanceTo(bus.now_ns() + 1000);
  }
  // Now an error frame is under way. Both wait for its end, and the less urgent one begins 8 bits
  // earlier.
  ASSERT_EQ(b.Send(LongFrame(9)), Status::kOk);
  bus.AdvanceTo(10 * kMs);
  EXPECT_EQ(Ids(Drain(c)), (List{9, 1}));
}

TEST(BusFaults, BitErrorsHaveTheirRateAndNoFrameIsLost) {
  SimulatedBus bus;
  SimulatedBus::PortConfig deep;
  deep.transmit_capacity = 3000;
  deep.receive_capacity = 6000;
  auto& a = bus.Attach(deep);
  auto& b = bus.Attach(deep);
  bus.SetFaults(Script(BusFaultKind::kBitErrors, 1e-4));
  for (int i = 0; i < 3000; ++i) ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  bus.AdvanceTo(2000 * kMs);
  // Every broken frame is sent again. A frame that is broken at its last bit comes twice.
  const auto received = static_cast<std::int64_t>(Drain(b).size());
  EXPECT_EQ(a.statistics().sent, 3000);
  EXPECT_GE(received, 3000);
  const double expected = 3000 * (1 - std::pow(1 - 1e-4, FrameBits(LongFrame(1)) - 3));
  EXPECT_NEAR(static_cast<double>(bus.statistics().disturbed), expected, 4 * std::sqrt(expected));
  EXPECT_EQ(bus.statistics().disturbed, a.statistics().errors);
}

TEST(BusFaults, ADisturbedLastBitIsTheOneThatCanDuplicates) {
  // Every seed breaks another bit of the first try.
  int duplicates = 0;
  const int last = FrameBits(LongFrame(1)) - kIntermissionBits;
  for (std::uint64_t seed = 1; seed <= 600; ++seed) {
    SimulatedBus bus;
    auto& a = bus.Attach();
    auto& b = bus.Attach();
    BusFaultPlan plan = Script(BusFaultKind::kBitErrors, 1.0 / last);
    plan.seed = seed;
    plan.faults[0].end_ns = 1;
    bus.SetFaults(plan);
    ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
    bus.AdvanceTo(2 * kMs);
    const std::size_t received = Drain(b).size();
    ASSERT_GE(received, 1U);
    ASSERT_LE(received, 2U);
    duplicates += static_cast<int>(received) - 1;
    EXPECT_EQ(a.statistics().sent, 1);
  }
  EXPECT_GE(duplicates, 1);
  EXPECT_LE(duplicates, 10) << "one of 600 / 111 expected, times 0.37";
}

TEST(BusFaults, LossDuplicationAndFlipsConcernTheNodeAndTheFramesNamed) {
  for (const BusFaultKind kind :
       {BusFaultKind::kLoss, BusFaultKind::kDuplicate, BusFaultKind::kFlip}) {
    SimulatedBus bus;
    auto& a = bus.Attach();
    auto& b = bus.Attach();
    auto& c = bus.Attach();
    BusFaultPlan plan = Script(kind, 1, 1);
    plan.faults[0].ids = {2};
    bus.SetFaults(plan);
    for (const std::uint32_t id : List{1, 2, 3}) ASSERT_EQ(a.Send(LongFrame(id)), Status::kOk);
    bus.AdvanceTo(10 * kMs);
    EXPECT_EQ(Ids(Drain(c)), (List{1, 2, 3}));
    EXPECT_EQ(a.statistics().sent, 3);
    const auto received = Drain(b);
    if (kind == BusFaultKind::kLoss) {
      EXPECT_EQ(Ids(received), (List{1, 3}));
    } else if (kind == BusFaultKind::kDuplicate) {
      EXPECT_EQ(Ids(received), (List{1, 2, 2, 3}));
    } else {
      ASSERT_EQ(Ids(received), (List{1, 2, 3}));
      int flipped = 0;
      for (const std::uint8_t byte : received[1].frame.data) flipped += std::popcount(byte);
      EXPECT_EQ(flipped, 1);
      EXPECT_EQ(received[2].frame, LongFrame(3));
    }
  }
}

TEST(BusFaults, ProbabilitiesAreKeptAndSeedsMatter) {
  std::vector<List> runs;
  for (const std::uint64_t seed : {1U, 1U, 2U}) {
    SimulatedBus bus;
    SimulatedBus::PortConfig deep;
    deep.transmit_capacity = 1000;
    deep.receive_capacity = 1000;
    auto& a = bus.Attach(deep);
    auto& b = bus.Attach(deep);
    BusFaultPlan plan = Script(BusFaultKind::kLoss, 0.3);
    plan.seed = seed;
    bus.SetFaults(plan);
    for (std::uint32_t i = 0; i < 1000; ++i) ASSERT_EQ(a.Send(LongFrame(i)), Status::kOk);
    bus.AdvanceTo(1000 * kMs);
    runs.push_back(Ids(Drain(b)));
    EXPECT_NEAR(static_cast<double>(runs.back().size()), 700, 60);
  }
  EXPECT_EQ(runs[0], runs[1]);
  EXPECT_NE(runs[0], runs[2]);
}

TEST(BusFaults, DelayKeepsTheOrderAndReorderingChangesIt) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  BusFaultPlan plan = Script(BusFaultKind::kDelay);
  plan.faults[0].delay_ns = 2 * kMs;
  plan.faults[0].ids = {1};
  bus.SetFaults(plan);
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  ASSERT_EQ(a.Send(LongFrame(2)), Status::kOk);
  const std::int64_t end = (FrameBits(LongFrame(1)) - kIntermissionBits) * kBit;
  bus.AdvanceTo(end + 2 * kMs - 1);
  EXPECT_TRUE(Drain(b).empty());
  bus.AdvanceTo(end + 2 * kMs);
  const auto late = Drain(b);
  ASSERT_EQ(Ids(late), (List{1, 2}));
  EXPECT_EQ(late[0].time_ns, end + 2 * kMs);

  plan = Script(BusFaultKind::kReorder);
  plan.faults[0].delay_ns = 5 * kMs;
  plan.faults[0].ids = {3};
  bus.SetFaults(plan);
  for (const std::uint32_t id : List{3, 4, 5, 3}) ASSERT_EQ(a.Send(LongFrame(id)), Status::kOk);
  bus.AdvanceTo(bus.now_ns() + 2 * kMs);
  EXPECT_EQ(Ids(Drain(b)), (List{4, 3, 5}));
  bus.AdvanceTo(bus.now_ns() + 5 * kMs);
  EXPECT_EQ(Ids(Drain(b)), (List{3})) << "nothing followed it";
}

TEST(BusFaults, AStalledNodesQueueFillsUpAndADisconnectedNodeIsAlone) {
  SimulatedBus bus;
  SimulatedBus::PortConfig shallow;
  shallow.transmit_capacity = 2;
  auto& a = bus.Attach(shallow);
  auto& b = bus.Attach();
  auto& c = bus.Attach();
  BusFaultPlan plan = Script(BusFaultKind::kStall, 1, 0);
  plan.faults[0].start_ns = 1 * kMs;
  plan.faults[0].end_ns = 2 * kMs;
  plan.faults.push_back(plan.faults[0]);
  plan.faults[1].kind = BusFaultKind::kDisconnect;
  plan.faults[1].start_ns = 3 * kMs;
  plan.faults[1].end_ns = 6 * kMs;
  bus.SetFaults(plan);
  bus.AdvanceTo(1 * kMs);
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  ASSERT_EQ(a.Send(LongFrame(2)), Status::kOk);
  EXPECT_EQ(a.Send(LongFrame(3)), Status::kWouldBlock);
  bus.AdvanceTo(2 * kMs - 1);
  EXPECT_TRUE(Drain(b).empty());
  bus.AdvanceTo(3 * kMs);
  EXPECT_EQ(Ids(Drain(b)), (List{1, 2}));

  Drain(a);
  Drain(c);
  ASSERT_EQ(a.Send(LongFrame(4)), Status::kOk);
  ASSERT_EQ(b.Send(LongFrame(5)), Status::kOk);
  bus.AdvanceTo(6 * kMs - 1);
  EXPECT_EQ(Ids(Drain(c)), (List{5}));
  EXPECT_TRUE(Drain(a).empty());
  EXPECT_EQ(a.controller_state(), CanControllerState::kErrorPassive);
  bus.AdvanceTo(7 * kMs);
  EXPECT_EQ(Ids(Drain(c)), (List{4})) << "connected again, the old frame goes out";
}

TEST(BusFaults, AnInterfaceComesBackFromBeingDownButNotFromBeingGone) {
  for (const auto& [kind, status] : {std::pair{BusFaultKind::kLinkDown, Status::kLinkDown},
                                     std::pair{BusFaultKind::kLinkGone, Status::kLinkGone}}) {
    SimulatedBus bus;
    auto& a = bus.Attach();
    auto& b = bus.Attach();
    BusFaultPlan plan = Script(kind, 1, 0);
    plan.faults[0].start_ns = 1 * kMs;
    plan.faults[0].end_ns = 2 * kMs;
    bus.SetFaults(plan);
    bus.AdvanceTo(1 * kMs - 1);
    EXPECT_EQ(a.Send(LongFrame(1)), Status::kOk);
    EXPECT_EQ(a.Send(LongFrame(8)), Status::kOk);
    bus.AdvanceTo(1'500'000);
    ReceivedFrame received;
    EXPECT_EQ(a.Send(LongFrame(2)), status);
    EXPECT_EQ(a.Receive(received), status);
    bus.AdvanceTo(3 * kMs);
    const bool back = kind == BusFaultKind::kLinkDown;
    EXPECT_EQ(a.Send(LongFrame(3)), back ? Status::kOk : Status::kLinkGone);
    bus.AdvanceTo(4 * kMs);
    EXPECT_EQ(Ids(Drain(b)), back ? (List{1, 3}) : (List{1})) << "what waited is gone";
  }
}

TEST(BusFaults, AScriptedRunIsTheSameWhateverTheSteps) {
  const auto run = [](std::int64_t step_ns) {
    SimulatedBus bus;
    SimulatedBus::PortConfig log;
    log.receive_capacity = 10'000;
    auto& a = bus.Attach();
    auto& b = bus.Attach(log);
    Echo echo(20'000);
    bus.Attach(echo);
    BusFaultPlan plan;
    for (const BusFaultKind kind :
         {BusFaultKind::kLoss, BusFaultKind::kDuplicate, BusFaultKind::kDelay,
          BusFaultKind::kReorder, BusFaultKind::kFlip}) {
      BusFault fault;
      fault.kind = kind;
      fault.probability = 0.1;
      fault.delay_ns = 700'000;
      plan.faults.push_back(fault);
    }
    BusFault noise;
    noise.kind = BusFaultKind::kBitErrors;
    noise.probability = 1e-3;
    plan.faults.push_back(noise);
    BusFault cut;
    cut.kind = BusFaultKind::kShort;
    cut.start_ns = 30 * kMs;
    cut.end_ns = 35 * kMs;
    plan.faults.push_back(cut);
    bus.SetFaults(plan);
    for (std::int64_t t = 0; t < 100 * kMs; t += 500'000) {
      for (std::int64_t now = t; now < t + 500'000; now += step_ns) bus.AdvanceTo(now);
      bus.AdvanceTo(t + 500'000);
      static_cast<void>(a.Send(LongFrame(static_cast<std::uint32_t>(t / 500'000), 1)));
      if (a.controller_state() == CanControllerState::kBusOff) a.Restart();
    }
    return Drain(b);
  };
  const auto once = run(500'000);
  const auto fine = run(777);
  ASSERT_GT(once.size(), 150U);
  ASSERT_EQ(once.size(), fine.size());
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].frame, fine[i].frame);
    EXPECT_EQ(once[i].time_ns, fine[i].time_ns);
  }
}

TEST(BusFaults, ScriptsAreChecked) {
  SimulatedBus bus;
  bus.Attach();
  EXPECT_THROW(bus.SetFaults(Script(BusFaultKind::kLoss, 1.5)), std::invalid_argument);
  EXPECT_THROW(bus.SetFaults(Script(BusFaultKind::kLoss, 1, 1)), std::invalid_argument);
  BusFaultPlan plan = Script(BusFaultKind::kDelay);
  plan.faults[0].delay_ns = -1;
  EXPECT_THROW(bus.SetFaults(plan), std::invalid_argument);
}

}  // namespace
}  // namespace tumbler
