#include "firmware_interface/can/simulated_bus.h"

#include <gtest/gtest.h>

#include <random>
#include <stdexcept>
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

TEST(SimulatedBus, DeliversAFrameAfterExactlyItsLength) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  const CanFrame frame = LongFrame(0x123, 0x55);
  ASSERT_EQ(a.Send(frame), Status::kOk);
  const std::int64_t end = (FrameBits(frame) - kIntermissionBits) * kBit;
  bus.AdvanceTo(end - 1);
  EXPECT_TRUE(Drain(b).empty());
  bus.AdvanceTo(end);
  const auto received = Drain(b);
  ASSERT_EQ(received.size(), 1U);
  EXPECT_EQ(received[0].frame, frame);
  EXPECT_EQ(received[0].time_ns, end);
  EXPECT_TRUE(Drain(a).empty()) << "the sender got its own frame";
  EXPECT_EQ(bus.now_ns(), end);
}

TEST(SimulatedBus, ForetellsTheEndsOfFramesThatOnlyWaitToBeReceived) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  EXPECT_GT(bus.NextFrameEnd(), std::int64_t{1} << 60);
  for (const std::uint32_t id : List{1, 2}) ASSERT_EQ(a.Send(LongFrame(id)), Status::kOk);
  for (const std::uint32_t id : List{1, 2}) {
    const std::int64_t end_ns = bus.NextFrameEnd();
    bus.AdvanceTo(end_ns - 1);
    EXPECT_TRUE(Drain(b).empty());
    bus.AdvanceTo(end_ns);
    const auto received = Drain(b);
    ASSERT_EQ(received.size(), 1U);
    EXPECT_EQ(received[0].frame, LongFrame(id));
  }
  EXPECT_GT(bus.NextFrameEnd(), std::int64_t{1} << 60);
}

TEST(SimulatedBus, SendsBackToBackFramesWithAnIntermissionBetween) {
  SimulatedBus bus(500'000);
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  ASSERT_EQ(a.Send(LongFrame(2)), Status::kOk);
  bus.AdvanceTo(10'000'000);
  const auto received = Drain(b);
  ASSERT_EQ(received.size(), 2U);
  EXPECT_EQ(received[1].time_ns - received[0].time_ns, FrameBits(LongFrame(2)) * 2000);
  EXPECT_EQ(bus.statistics().bits, FrameBits(LongFrame(1)) + FrameBits(LongFrame(2)));
}

TEST(SimulatedBus, LowestIdentifierWinsAndTheOthersWaitTheirTurn) {
  SimulatedBus bus;
  auto& listener = bus.Attach();
  std::vector<SimulatedBus::Port*> ports;
  for (const std::uint32_t id : List{0x300, 0x100, 0x200}) {
    ports.push_back(&bus.Attach());
    ASSERT_EQ(ports.back()->Send(LongFrame(id)), Status::kOk);
  }
  bus.AdvanceTo(1'000'000);
  EXPECT_EQ(Ids(Drain(listener)), (List{0x100, 0x200, 0x300}));
}

TEST(SimulatedBus, AFrameOnTheWireIsNotInterrupted) {
  SimulatedBus bus;
  auto& listener = bus.Attach();
  auto& low = bus.Attach();
  auto& high = bus.Attach();
  ASSERT_EQ(low.Send(LongFrame(0x700)), Status::kOk);
  bus.AdvanceTo(1);
  ASSERT_EQ(high.Send(LongFrame(0x001)), Status::kOk);
  bus.AdvanceTo(1'000'000);
  EXPECT_EQ(Ids(Drain(listener)), (List{0x700, 0x001}));
}

TEST(SimulatedBus, AQueueIsFirstInFirstOutEvenIfALaterFrameIsMoreUrgent) {
  SimulatedBus bus;
  auto& listener = bus.Attach();
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  ASSERT_EQ(a.Send(LongFrame(0x700)), Status::kOk);
  ASSERT_EQ(a.Send(LongFrame(0x001)), Status::kOk);
  ASSERT_EQ(b.Send(LongFrame(0x300)), Status::kOk);
  bus.AdvanceTo(1'000'000);
  EXPECT_EQ(Ids(Drain(listener)), (List{0x300, 0x700, 0x001}));
}

TEST(SimulatedBus, StandardBeatsExtendedAndDataBeatsRemote) {
  CanFrame standard = LongFrame(0x123);
  CanFrame remote = LongFrame(0x123);
  remote.remote = true;
  CanFrame extended = LongFrame(0x123U << 18);
  extended.extended = true;
  CanFrame smaller = LongFrame(0x122U << 18 | 0x3ffff);
  smaller.extended = true;
  SimulatedBus bus;
  auto& listener = bus.Attach();
  for (const CanFrame& frame : {extended, remote, standard, smaller})
    ASSERT_EQ(bus.Attach().Send(frame), Status::kOk);
  bus.AdvanceTo(1'000'000);
  const auto received = Drain(listener);
  ASSERT_EQ(received.size(), 4U);
  EXPECT_EQ(received[0].frame, smaller);
  EXPECT_EQ(received[1].frame, standard);
  EXPECT_EQ(received[2].frame, remote);
  EXPECT_EQ(received[3].frame, extended);
}

TEST(SimulatedBus, OneShotFramesThatLoseArbitrationAreGone) {
  SimulatedBus bus;
  auto& listener = bus.Attach();
  SimulatedBus::PortConfig one_shot;
  one_shot.auto_retransmit = false;
  auto& winner = bus.Attach(one_shot);
  auto& loser = bus.Attach(one_shot);
  ASSERT_EQ(winner.Send(LongFrame(1)), Status::kOk);
  ASSERT_EQ(loser.Send(LongFrame(2)), Status::kOk);
  bus.AdvanceTo(1'000'000);
  EXPECT_EQ(Ids(Drain(listener)), (List{1}));
  EXPECT_EQ(loser.statistics().dropped_transmit, 1);
  EXPECT_EQ(loser.transmit_depth(), 0);
  // A frame that waits for a busy bus has not lost arbitration.
  ASSERT_EQ(winner.Send(LongFrame(1)), Status::kOk);
  bus.AdvanceTo(bus.now_ns() + 1000);
  ASSERT_EQ(loser.Send(LongFrame(2)), Status::kOk);
  bus.AdvanceTo(bus.now_ns() + 1'000'000);
  EXPECT_EQ(Ids(Drain(listener)), (List{1, 2}));
}

TEST(SimulatedBus, SameIdentifierWithDifferentDataCollides) {
  for (const bool retransmit : {false, true}) {
    SimulatedBus bus;
    auto& listener = bus.Attach();
    SimulatedBus::PortConfig config;
    config.auto_retransmit = retransmit;
    auto& a = bus.Attach(config);
    auto& b = bus.Attach(config);
    ASSERT_EQ(a.Send(LongFrame(5, 1)), Status::kOk);
    ASSERT_EQ(b.Send(LongFrame(5, 2)), Status::kOk);
    bus.AdvanceTo(100'000'000);
    EXPECT_TRUE(Drain(listener).empty());
    if (retransmit) {
      // Each adds 8 to the error counters; 32 times 8 is above 255.
      EXPECT_EQ(bus.statistics().collisions, 32);
      EXPECT_EQ(a.controller_state(), CanControllerState::kBusOff);
      EXPECT_EQ(b.controller_state(), CanControllerState::kBusOff);
      EXPECT_EQ(a.Send(LongFrame(5, 1)), Status::kBusOff);
      EXPECT_EQ(a.transmit_depth() + b.transmit_depth(), 0);
      EXPECT_EQ(a.statistics().dropped_transmit, 1);
    } else {
      EXPECT_EQ(bus.statistics().collisions, 1);
      EXPECT_EQ(a.transmit_depth() + b.transmit_depth(), 0);
      // The frames differ within the first data byte, after at most 1 + 11 + 3 + 4 + 8 bits and a
      // few stuff bits. The error frame adds 12 + 8 bits, the intermission 3.
      EXPECT_GE(bus.statistics().bits, 19 + 23);
      EXPECT_LE(bus.statistics().bits, 27 + 5 + 23);
    }
  }
}

TEST(SimulatedBus, IdenticalFramesFromTwoNodesAreOneFrameOnTheWire) {
  SimulatedBus bus;
  auto& listener = bus.Attach();
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  ASSERT_EQ(a.Send(LongFrame(5, 1)), Status::kOk);
  ASSERT_EQ(b.Send(LongFrame(5, 1)), Status::kOk);
  bus.AdvanceTo(1'000'000);
  EXPECT_EQ(Ids(Drain(listener)), (List{5}));
  EXPECT_TRUE(Drain(a).empty());
  EXPECT_TRUE(Drain(b).empty());
  EXPECT_EQ(a.statistics().sent, 1);
  EXPECT_EQ(b.statistics().sent, 1);
  EXPECT_EQ(bus.statistics().frames, 1);
}

TEST(SimulatedBus, WithNobodyToAcknowledgeTheBusStaysBusyAndTheQueueFills) {
  SimulatedBus bus;
  SimulatedBus::PortConfig config;
  config.transmit_capacity = 3;
  auto& lone = bus.Attach(config);
  SimulatedBus::PortConfig logger;
  logger.listen_only = true;
  auto& listener = bus.Attach(logger);
  for (int i = 0; i < 3; ++i) ASSERT_EQ(lone.Send(LongFrame(1)), Status::kOk);
  bus.AdvanceTo(50'000'000);
  EXPECT_EQ(lone.Send(LongFrame(1)), Status::kWouldBlock);
  EXPECT_EQ(lone.statistics().rejected_transmit, 1);
  EXPECT_EQ(lone.statistics().sent, 0);
  EXPECT_GT(bus.load(), 0.9) << "busy but for the 8 bits that an error-passive node waits";
  EXPECT_EQ(lone.controller_state(), CanControllerState::kErrorPassive);
  EXPECT_EQ(lone.transmit_errors(), 128) << "a missing acknowledgement alone goes no further";
  EXPECT_EQ(bus.statistics().frames, 0);
  EXPECT_GT(bus.statistics().unacknowledged, 100);
  EXPECT_TRUE(Drain(listener).empty());
  // As soon as another node is there, the old frames go out, like stale setpoints on a real bus.
  auto& other = bus.Attach();
  bus.AdvanceTo(60'000'000);
  EXPECT_EQ(Ids(Drain(other)), (List{1, 1, 1}));
}

TEST(SimulatedBus, ListenOnlyPortHearsAllAndSendsNothing) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  bus.Attach();
  SimulatedBus::PortConfig logger;
  logger.listen_only = true;
  auto& listener = bus.Attach(logger);
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  EXPECT_EQ(listener.Send(LongFrame(2)), Status::kInvalidArgument);
  bus.AdvanceTo(1'000'000);
  EXPECT_EQ(Ids(Drain(listener)), (List{1}));
}

TEST(SimulatedBus, FullReceiveQueueDropsTheNewestAndCounts) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  SimulatedBus::PortConfig config;
  config.receive_capacity = 2;
  auto& b = bus.Attach(config);
  for (std::uint32_t id = 1; id <= 5; ++id) ASSERT_EQ(a.Send(LongFrame(id)), Status::kOk);
  bus.AdvanceTo(1'000'000);
  EXPECT_EQ(Ids(Drain(b)), (List{1, 2}));
  EXPECT_EQ(b.statistics().received, 2);
  EXPECT_EQ(b.statistics().dropped_received, 3);
  EXPECT_EQ(b.statistics().max_receive_depth, 2);
  EXPECT_EQ(a.statistics().max_transmit_depth, 5);
}

TEST(SimulatedBus, RejectsFramesThatAreNotCan) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  CanFrame frame = LongFrame(0x800);
  EXPECT_EQ(a.Send(frame), Status::kInvalidArgument);
  frame = LongFrame(1);
  frame.size = 9;
  EXPECT_EQ(a.Send(frame), Status::kInvalidArgument);
  EXPECT_EQ(a.SendAfter(-1, LongFrame(1)), Status::kInvalidArgument);
  EXPECT_EQ(a.transmit_depth(), 0);
}

TEST(SimulatedBus, LinkDownEmptiesTheQueuesAndIsRepeatedUntilItIsUp) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  auto& b = bus.Attach();
  ASSERT_EQ(a.Send(LongFrame(1)), Status::kOk);
  ASSERT_EQ(a.Send(LongFrame(2)), Status::kOk);
  ASSERT_EQ(a.Send(LongFrame(3)), Status::kOk);
  bus.AdvanceTo(10'000);  // The first one is on the wire.
  a.SetLinkDown(true);
  ReceivedFrame received;
  EXPECT_EQ(a.Send(LongFrame(4)), Status::kLinkDown);
  EXPECT_EQ(a.Receive(received), Status::kLinkDown);
  a.SetLinkDown(false);
  ASSERT_EQ(a.Send(LongFrame(5)), Status::kOk);
  bus.AdvanceTo(1'000'000);
  EXPECT_EQ(Ids(Drain(b)), (List{1, 5}));
  EXPECT_EQ(a.statistics().dropped_transmit, 2);
  EXPECT_EQ(a.statistics().sent, 2);
  b.SetLinkDown(true);
  ASSERT_EQ(a.Send(LongFrame(6)), Status::kOk);
  bus.AdvanceTo(2'000'000);
  EXPECT_EQ(a.transmit_depth(), 1) << "nobody acknowledges any more";
}

TEST(SimulatedBus, AnswersOfANodeTakePartInTheNextArbitration) {
  SimulatedBus bus;
  Echo echo(0);
  auto& host = bus.Attach();
  auto& other = bus.Attach();
  bus.Attach(echo);
  ASSERT_EQ(host.Send(LongFrame(0x010)), Status::kOk);
  ASSERT_EQ(host.Send(LongFrame(0x7f0)), Status::kOk);
  bus.AdvanceTo(1'000'000);
  EXPECT_EQ(Ids(Drain(other)), (List{0x010, 0x110, 0x7f0}));
}

TEST(SimulatedBus, TurnaroundDelaysTheAnswerToTheNanosecond) {
  SimulatedBus bus;
  Echo echo(123'456);
  auto& host = bus.Attach();
  bus.Attach(echo);
  ASSERT_EQ(host.Send(LongFrame(0x010)), Status::kOk);
  bus.AdvanceTo(1'000'000);
  const auto received = Drain(host);
  ASSERT_EQ(received.size(), 1U);
  const std::int64_t heard = (FrameBits(LongFrame(0x010)) - kIntermissionBits) * kBit;
  EXPECT_EQ(received[0].time_ns,
            heard + 123'456 + (FrameBits(received[0].frame) - kIntermissionBits) * kBit);
}

TEST(SimulatedBus, LoadIsTheShareOfTimeThatFramesTake) {
  SimulatedBus bus;
  auto& a = bus.Attach();
  bus.Attach();
  ASSERT_EQ(a.Send(LongFrame(7)), Status::kOk);
  const std::int64_t length = FrameBits(LongFrame(7)) * kBit;
  bus.AdvanceTo(length / 2);
  EXPECT_DOUBLE_EQ(bus.load(), 1.0);
  bus.AdvanceTo(4 * length);
  EXPECT_DOUBLE_EQ(bus.load(), 0.25);
  EXPECT_EQ(bus.statistics().busy_ns, length);
}

/// A random but reproducible run with every feature in it. @returns the frames that a logger saw.
std::vector<ReceivedFrame> RandomRun(std::uint64_t seed, std::int64_t step_ns) {
  std::mt19937_64 random(seed);
  SimulatedBus bus;
  Echo echo(20'000);
  SimulatedBus::PortConfig logger;
  logger.listen_only = true;
  logger.receive_capacity = 100'000;
  auto& log = bus.Attach(logger);
  SimulatedBus::PortConfig one_shot;
  one_shot.auto_retransmit = false;
  SimulatedBus::Port* ports[] = {&bus.Attach(), &bus.Attach(), &bus.Attach(one_shot)};
  bus.Attach(echo);
  for (std::int64_t t = 0; t < 200'000'000; t += 500'000) {
    for (std::int64_t now = t; now < t + 500'000; now += step_ns) bus.AdvanceTo(now);
    bus.AdvanceTo(t + 500'000);
    // Identifiers of different ports differ, so that retransmitting ports never collide for ever.
    for (std::size_t i = 0; i < 3; ++i) {
      if (random() % 3 != 0) continue;
      CanFrame frame = LongFrame(static_cast<std::uint32_t>(random() % 32 * 3 + i),
                                 static_cast<std::uint8_t>(random()));
      frame.size = static_cast<std::uint8_t>(random() % 9);
      static_cast<void>(ports[i]->Send(frame));
    }
  }
  return Drain(log);
}

TEST(SimulatedBus, SameRunTwiceGivesTheSameFramesWhateverTheSteps) {
  const auto once = RandomRun(1, 500'000);
  const auto again = RandomRun(1, 500'000);
  const auto in_small_steps = RandomRun(1, 777);
  ASSERT_GT(once.size(), 500U);
  ASSERT_EQ(once.size(), again.size());
  ASSERT_EQ(once.size(), in_small_steps.size());
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].frame, again[i].frame);
    EXPECT_EQ(once[i].time_ns, again[i].time_ns);
    EXPECT_EQ(once[i].frame, in_small_steps[i].frame);
    EXPECT_EQ(once[i].time_ns, in_small_steps[i].time_ns);
  }
  EXPECT_NE(Ids(RandomRun(2, 500'000)), Ids(once));
}

TEST(SimulatedBus, ChecksItsConfiguration) {
  EXPECT_THROW(SimulatedBus(0), std::invalid_argument);
  EXPECT_THROW(SimulatedBus(2'000'000), std::invalid_argument);
  SimulatedBus bus;
  SimulatedBus::PortConfig config;
  config.transmit_capacity = 0;
  EXPECT_THROW(bus.Attach(config), std::invalid_argument);
  for (int i = 0; i < SimulatedBus::kMaxNodes; ++i) bus.Attach();
  EXPECT_THROW(bus.Attach(), std::length_error);
}

}  // namespace
}  // namespace tumbler
