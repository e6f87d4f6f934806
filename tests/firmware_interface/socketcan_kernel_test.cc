// SocketCanBus against a real kernel: virtual interfaces, a shaper in front of them, and a serial
// adapter played by the test. Runs where there is CAN (`scripts/guest`).

#include <fcntl.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <string>
#include <vector>

#include "firmware_interface/can/can_link.h"
#include "firmware_interface/can/socketcan_bus.h"
#include "firmware_interface/devices/drive_bank.h"
#include "firmware_interface/devices/drives_toml.h"
#include "tests/support/allocation_guard.h"
#include "tests/support/can_interface.h"
#include "tests/support/files.h"
#include "tests/support/steady_time.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::SerialCan;
using testing::Shell;
using testing::VirtualCan;

CanFrame Frame(std::uint32_t id, std::uint8_t first = 0) {
  CanFrame frame;
  frame.id = id;
  frame.size = 8;
  frame.data[0] = first;
  return frame;
}

std::int64_t MonotonicNs() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

void Wait(int milliseconds) { usleep(static_cast<useconds_t>(milliseconds) * 1000); }

void Open(SocketCanBus& bus, const std::string& interface, const SocketCanConfig& config = {}) {
  const SocketCanBus::OpenResult result = bus.Open(interface, config);
  ASSERT_EQ(result.status, Status::kOk) << result.message;
}

/// Receives until nothing has come for `quiet_ms`.
std::vector<ReceivedFrame> ReceiveAll(SocketCanBus& bus, int quiet_ms = 50) {
  std::vector<ReceivedFrame> all;
  ReceivedFrame received;
  for (int quiet = 0; quiet < quiet_ms;) {
    const Status status = bus.Receive(received);
    if (status == Status::kOk) {
      all.push_back(received);
      quiet = 0;
    } else {
      Wait(5);
      quiet += 5;
    }
  }
  return all;
}

/// Polls until the condition holds. @returns whether it came to hold within 5 s.
template <typename Condition>
bool Eventually(Condition condition) {
  for (int i = 0; i < 500; ++i) {
    if (condition()) return true;
    Wait(10);
  }
  return condition();
}

Status Poll(SocketCanBus& bus) {
  ReceivedFrame ignored;
  Status status = Status::kOk;
  while (status == Status::kOk) status = bus.Receive(ignored);
  return status;
}

/// Takes everything that has come, confirmations included.
void Drain(SocketCanBus& bus) { static_cast<void>(Poll(bus) == Status::kOk); }

/// Waits until all that was sent is confirmed: the kernel may leave that to a thread of its own.
void AwaitConfirmations(SocketCanBus& bus) {
  for (int i = 0; i < 5000 && bus.in_flight() > 0; ++i) {
    Drain(bus);
    if (bus.in_flight() > 0) usleep(1000);
  }
}

TEST(SocketCanBusInKernel, CarriesEveryKindOfClassicFrame) {
  testing::InSteadyTime([] {
    const VirtualCan can;
    SocketCanBus a, b;
    Open(a, can.name());
    Open(b, can.name());
    std::vector<CanFrame> frames{Frame(0), Frame(0x7ff, 0xff), Frame(0x7ff), Frame(0x1fffffff, 7)};
    frames[2].extended = true;
    frames[3].extended = true;
    frames.push_back({0x123, false, true, 5, {}});
    frames.push_back({0x124, false, false, 0, {}});
    std::size_t sent = 0;
    EXPECT_EQ(a.SendAll(frames, sent), Status::kOk);
    EXPECT_EQ(sent, frames.size());
    const std::vector<ReceivedFrame> received = ReceiveAll(b);
    ASSERT_EQ(received.size(), frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) EXPECT_EQ(received[i].frame, frames[i]) << i;
  });
}

TEST(SocketCanBusInKernel, ConfirmsItsOwnFramesInsteadOfReceivingThem) {
  testing::InSteadyTime([] {
    const VirtualCan can;
    SocketCanBus bus;
    Open(bus, can.name());
    EXPECT_TRUE(bus.link().confirms_on_the_wire);
    for (std::uint8_t i = 0; i < 5; ++i) ASSERT_EQ(bus.Send(Frame(1, i)), Status::kOk);
    EXPECT_EQ(bus.in_flight(), 5);
    EXPECT_TRUE(ReceiveAll(bus).empty());
    EXPECT_EQ(bus.in_flight(), 0);
    EXPECT_EQ(bus.statistics().sent, 5);
    EXPECT_EQ(bus.statistics().confirmed, 5);
    EXPECT_EQ(bus.statistics().discarded, 0);
    EXPECT_GT(bus.statistics().confirm_time_max_ns, 0);
  });
}

TEST(SocketCanBusInKernel, ReceivesWantedIdentifiersOnlyAndCountsCommandsOfOthers) {
  testing::InSteadyTime([] {
    const VirtualCan can;
    SocketCanConfig config;
    config.send_ids = {1, 2};
    config.receive_ids = {17, 18};
    SocketCanBus bus, other;
    Open(bus, can.name(), config);
    Open(other, can.name());
    ASSERT_EQ(bus.Send(Frame(1)), Status::kOk);
    CanFrame extended = Frame(17);
    extended.extended = true;
    const CanFrame remote{18, false, true, 8, {}};
    for (const CanFrame& frame : {Frame(17, 5), Frame(19), extended, remote, Frame(2), Frame(18)}) {
      ASSERT_EQ(other.Send(frame), Status::kOk);
    }
    const std::vector<ReceivedFrame> received = ReceiveAll(bus);
    ASSERT_EQ(received.size(), 3U);
    EXPECT_EQ(received[0].frame, Frame(17, 5));
    EXPECT_EQ(received[1].frame, Frame(2));
    EXPECT_EQ(received[2].frame, Frame(18));
    EXPECT_EQ(bus.statistics().confirmed, 1);
    EXPECT_EQ(bus.statistics().foreign_commands, 1);
  });
}

TEST(SocketCanBusInKernel, TellsIdentifiersOf29BitsFromThoseOf11WithTheSameValue) {
  testing::InSteadyTime([] {
    const VirtualCan can;
    SocketCanConfig config;
    config.send_ids = {CanId(0x21, true)};
    config.receive_ids = {CanId(0x2921, true), CanId(0x22, true), 0x23};
    SocketCanBus bus, other;
    Open(bus, can.name(), config);
    Open(other, can.name());
    const auto extended = [](std::uint32_t id) {
      CanFrame frame = Frame(id);
      frame.extended = true;
      return frame;
    };
    ASSERT_EQ(bus.Send(extended(0x21)), Status::kOk);
    for (const CanFrame& frame :
         {Frame(0x21), Frame(0x22), Frame(0x23), extended(0x21), extended(0x22), extended(0x23),
          extended(0x2921), extended(0x10002921)}) {
      ASSERT_EQ(other.Send(frame), Status::kOk);
    }
    const std::vector<ReceivedFrame> received = ReceiveAll(bus);
    ASSERT_EQ(received.size(), 4U);
    EXPECT_EQ(received[0].frame, Frame(0x23));
    EXPECT_EQ(received[1].frame, extended(0x21));
    EXPECT_EQ(received[2].frame, extended(0x22));
    EXPECT_EQ(received[3].frame, extended(0x2921));
    EXPECT_EQ(bus.statistics().confirmed, 1);
    EXPECT_EQ(bus.statistics().foreign_commands, 1);
  });
}

TEST(SocketCanBusInKernel, OfADrivesFileLetsThroughEveryCommandThatSomebodyElseCanSend) {
  const auto commands_of_others = [](const DrivesConfig& drives, const std::vector<CanId>& some) {
    const VirtualCan can;
    SocketCanConfig config;
    config.send_ids = drives.HostSends();
    config.receive_ids = drives.HostReceives();
    SocketCanBus bus, other;
    Open(bus, can.name(), config);
    SocketCanConfig many;
    many.in_flight_max = SocketCanConfig::kMaxInFlight;
    many.confirm_timeout_ns = 60'000'000'000;  // A machine that stands still is no stall.
    Open(other, can.name(), many);
    DriveBank bank;
    for (const DriveEntry& entry : drives.drives) ASSERT_EQ(bank.Add(entry.config), Status::kOk);
    std::vector<CanFrame> frames;
    for (std::uint32_t id = 0; id < 0x800; ++id) frames.push_back(Frame(id, 1));
    for (std::uint32_t function = 0; function < 0x30; ++function) {
      for (std::uint32_t drive = 0; drive < 4; ++drive) {
        frames.push_back(Frame(function << 8 | drive, 1));
        frames.back().extended = true;
      }
    }
    // Names the drive 1 in the payloads of each protocol, but not as an ODrive's answer.
    for (CanFrame& frame : frames) frame.data = {1, static_cast<std::uint8_t>(frame.id == 0)};
    frames[0x026].data[0] = 9;
    std::vector<CanId> seen, expected;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const bool command = std::ranges::any_of(
          bank.drives(), [&](const Drive* drive) { return drive->IsCommand(frames[i]); });
      if (command) expected.push_back(IdOf(frames[i]));
      Status sent = other.Send(frames[i]);
      // A kernel that is late has not handed on yet what was sent.
      for (int again = 0; sent == Status::kWouldBlock && again < 1000; ++again) {
        EXPECT_TRUE(ReceiveAll(other, 1).empty());
        sent = other.Send(frames[i]);
      }
      ASSERT_EQ(sent, Status::kOk);
      // Often enough that nothing is full: frames in flight, and the socket's buffer.
      const bool last = i + 1 == frames.size();
      if (i % 60 == 0 || last) {
        EXPECT_TRUE(ReceiveAll(other, 1).empty());
      }
      if (i % 240 != 0 && !last) continue;
      for (const ReceivedFrame& received : ReceiveAll(bus, 1)) {
        if (std::ranges::any_of(bank.drives(), [&](const Drive* drive) {
              return drive->IsCommand(received.frame);
            })) {
          seen.push_back(IdOf(received.frame));
        }
      }
    }
    EXPECT_EQ(seen, expected);
    EXPECT_THAT(seen, ::testing::IsSupersetOf(some));
    EXPECT_EQ(bus.statistics().dropped, 0);
  };
  testing::InSteadyTime([&] {
    const auto file = [](const std::string& name) {
      return testing::ReadFile(testing::SourcePath("primitives/robots/" + name));
    };
    const auto wide = [](std::uint32_t id) { return CanId(id, true); };
    const std::string mit = file("tumbler_drives.toml");
    commands_of_others(ParseDrives(mit, "mit"), {0x001, wide(0x301)});
    commands_of_others(ParseDrives(testing::Replaced(mit, "command_id = 1",
                                                     "command_id = 1\ndialect = \"damiao\""),
                                   "damiao"),
                       {0x001, 0x101, 0x201, 0x301, 0x7ff});
    commands_of_others(ParseDrives(file("tumbler_drives_akv3.toml"), "akv3"),
                       {wide(0x001), wide(0x601), wide(0x801)});
    commands_of_others(ParseDrives(file("tumbler_drives_cansimple.toml"), "cansimple"),
                       {0x022, 0x024, 0x026, 0x02f, 0x036, 0x03a, 0x03f});
    commands_of_others(ParseDrives(file("tumbler_drives_cia402.toml"), "cia402"),
                       {0x000, 0x080, 0x401, 0x501, 0x601, 0x7e5});
  });
}

TEST(SocketCanBusInKernel, StampsFramesWithTheKernelsReceiveTime) {
  testing::InSteadyTime([] {
    const VirtualCan can;
    SocketCanBus a, b;
    Open(a, can.name());
    Open(b, can.name());
    const std::int64_t before_ns = MonotonicNs();
    ASSERT_EQ(a.Send(Frame(1)), Status::kOk);
    ASSERT_EQ(a.Send(Frame(2)), Status::kOk);
    const std::int64_t after_ns = MonotonicNs();
    Wait(100);  // Read much later, the stamps are those of the arrival.
    const std::vector<ReceivedFrame> received = ReceiveAll(b);
    ASSERT_EQ(received.size(), 2U);
    constexpr std::int64_t kSlack_ns = 10'000'000;  // between readings of two clocks
    EXPECT_GE(received[0].time_ns, before_ns - kSlack_ns);
    EXPECT_LE(received[1].time_ns, after_ns + kSlack_ns);
    EXPECT_LE(received[0].time_ns, received[1].time_ns);
  });
}

TEST(SocketCanBusInKernel, CountsWhatTheKernelDropped) {
  testing::InSteadyTime([] {
    const VirtualCan can;
    SocketCanBus slow, fast;
    Open(slow, can.name());
    Open(fast, can.name());
    constexpr int kFrames = 2000;
    for (int i = 0; i < kFrames; ++i) {
      ASSERT_EQ(fast.Send(Frame(1)), Status::kOk);
      AwaitConfirmations(fast);
    }
    ReceiveAll(slow);
    ASSERT_EQ(fast.Send(Frame(2)), Status::kOk);  // The kernel's count comes with the next frame.
    ReceiveAll(slow);
    EXPECT_GT(slow.statistics().dropped, 0);
    EXPECT_EQ(slow.statistics().received + slow.statistics().dropped, kFrames + 1);
    EXPECT_EQ(fast.statistics().dropped, 0);
  });
}

TEST(SocketCanBusInKernel, SaysThatTheInterfaceIsDownAndWorksAgainOnceItIsUp) {
  testing::InSteadyTime([] {
    const VirtualCan can;
    SocketCanBus bus, other;
    Open(bus, can.name());
    ASSERT_EQ(bus.Send(Frame(1)), Status::kOk);
    can.Down();
    ReceivedFrame received;
    EXPECT_EQ(Poll(bus), Status::kLinkDown);
    EXPECT_EQ(bus.last_errno(), ENETDOWN);
    EXPECT_EQ(bus.Send(Frame(2)), Status::kLinkDown);
    EXPECT_EQ(bus.Receive(received), Status::kLinkDown) << "every call repeats it";
    EXPECT_EQ(bus.in_flight(), 0);
    EXPECT_EQ(other.Open(can.name()).status, Status::kLinkDown);
    can.Up();
    Open(other, can.name());
    EXPECT_EQ(bus.Receive(received), Status::kWouldBlock);
    EXPECT_EQ(bus.Send(Frame(3)), Status::kOk);
    const std::vector<ReceivedFrame> after = ReceiveAll(other);
    ASSERT_EQ(after.size(), 1U) << "nothing from before comes late";
    EXPECT_EQ(after[0].frame, Frame(3));
  });
}

TEST(SocketCanBusInKernel, AnInterfaceThatIsRemovedStaysLostUntilItIsOpenedAnew) {
  testing::InSteadyTime([] {
    const VirtualCan can;
    SocketCanBus bus;
    Open(bus, can.name());
    can.Delete();
    EXPECT_EQ(Poll(bus), Status::kLinkGone);
    EXPECT_EQ(bus.Send(Frame(1)), Status::kLinkGone);
    EXPECT_EQ(bus.Open(can.name()).error_number, ENODEV);
    Open(bus, "vcan0");
    const VirtualCan again;
    Open(bus, again.name());
    again.Delete();
    EXPECT_EQ(bus.Send(Frame(1)), Status::kLinkGone);
    again.Create();  // another interface of the same name
    EXPECT_EQ(bus.Send(Frame(1)), Status::kLinkGone);
    EXPECT_EQ(Poll(bus), Status::kLinkGone);
    Open(bus, again.name());
    EXPECT_EQ(bus.Send(Frame(1)), Status::kOk);
    can.Create();  // for its destructor
  });
}

TEST(SocketCanBusInKernel, AStalledBusTakesNothingMoreUntilAllIsConfirmed) {
  testing::InSteadyTime([] {
    VirtualCan can;
    SocketCanBus bus, witness;
    can.Throttle(200);
    SocketCanConfig config;
    config.in_flight_max = 4;
    Open(bus, can.name(), config);
    Open(witness, can.name());
    std::vector<CanFrame> frames;
    for (std::uint8_t i = 0; i < 9; ++i) frames.push_back(Frame(1, i));
    std::size_t sent = 0;
    EXPECT_EQ(bus.SendAll(frames, sent), Status::kWouldBlock);
    EXPECT_EQ(sent, 4U);
    EXPECT_EQ(bus.statistics().stalls, 1);
    EXPECT_EQ(bus.statistics().refused, 5);
    EXPECT_TRUE(Eventually([&] {
      Drain(bus);
      return bus.in_flight() < 4;
    }));
    Wait(50);  // Some frames have left, but that makes no room until all are confirmed.
    EXPECT_EQ(bus.Send(Frame(2)), Status::kWouldBlock);
    can.Throttle(500'000);
    EXPECT_TRUE(
        Eventually([&] { return Poll(bus) == Status::kWouldBlock && bus.in_flight() == 0; }));
    EXPECT_EQ(bus.Send(Frame(3)), Status::kOk);
    const std::vector<ReceivedFrame> seen = ReceiveAll(witness, 200);
    ASSERT_EQ(seen.size(), 5U);
    for (std::uint8_t i = 0; i < 4; ++i) EXPECT_EQ(seen[i].frame, Frame(1, i));
    EXPECT_EQ(seen[4].frame, Frame(3));
    EXPECT_GE(bus.statistics().confirm_time_max_ns, 50'000'000);
  });
}

TEST(SocketCanBusInKernel, OneOldUnconfirmedFrameIsAStall) {
  testing::InSteadyTime([] {
    VirtualCan can;
    can.Throttle(1000);
    SocketCanBus bus;
    Open(bus, can.name());
    for (int i = 0; i < 4; ++i) ASSERT_EQ(bus.Send(Frame(1)), Status::kOk);  // Two leave at once.
    Wait(40);
    Drain(bus);
    EXPECT_EQ(bus.Send(Frame(1)), Status::kWouldBlock);
    EXPECT_EQ(bus.statistics().stalls, 1);
  });
}

TEST(SocketCanBusInKernel, AFullQueueOfTheKernelIsAStall) {
  testing::InSteadyTime([] {
    VirtualCan can;
    can.Throttle(1000);
    SocketCanConfig config;
    config.in_flight_max = SocketCanConfig::kMaxInFlight;
    config.confirm_timeout_ns = 60'000'000'000;
    SocketCanBus bus;
    Open(bus, can.name(), config);
    int taken = 0;
    while (taken < SocketCanConfig::kMaxInFlight && bus.Send(Frame(1)) == Status::kOk) ++taken;
    EXPECT_GE(taken, 10);
    EXPECT_LE(taken, 14) << "ten wait, and one or two have passed";
    EXPECT_EQ(bus.statistics().stalls, 1);
    EXPECT_EQ(bus.Send(Frame(1)), Status::kWouldBlock);
  });
}

TEST(SocketCanBusInKernel, DiscardsWhatWaitsOnceItStalls) {
  testing::InSteadyTime([] {
    VirtualCan can;
    can.Throttle(1000);
    SocketCanConfig config;
    config.discard_stale_frames = true;
    SocketCanBus bus, witness;
    Open(bus, can.name(), config);
    ASSERT_TRUE(bus.can_discard());
    Open(witness, can.name());
    std::uint8_t count = 0;
    while (count < 50 && bus.Send(Frame(1, count)) == Status::kOk) ++count;
    ASSERT_LT(count, 50);
    EXPECT_TRUE(Eventually([&] {
      Drain(bus);
      return bus.in_flight() == 0;
    }));
    can.Throttle(500'000);
    EXPECT_TRUE(Eventually([&] {
      Drain(bus);
      return bus.Send(Frame(2)) == Status::kOk;
    }));
    Eventually([&] { return Poll(bus) == Status::kWouldBlock; });
    std::size_t old = 0, fresh = 0;
    for (const ReceivedFrame& seen : ReceiveAll(witness, 200)) ++(seen.frame.id == 1 ? old : fresh);
    EXPECT_LE(old, 3U) << "what left before the stall was noticed";
    EXPECT_EQ(fresh, 1U);
    EXPECT_GE(bus.statistics().discarded, 5);
    EXPECT_EQ(bus.statistics().stalls, 1);
  });
}

TEST(SocketCanBusInKernel, OpeningDiscardsWhatAnEarlierProgramLeftWaiting) {
  testing::InSteadyTime([] {
    VirtualCan can;
    can.Throttle(1000);
    {
      SocketCanBus earlier;
      Open(earlier, can.name());
      for (int i = 0; i < 8; ++i) ASSERT_EQ(earlier.Send(Frame(1)), Status::kOk);
    }
    CanLink link;
    ASSERT_EQ(ReadCanLink(can.name(), link), 0);
    EXPECT_GE(link.waiting_frames, 5) << "they outlive their socket";
    // Without the privilege the interface is refused: in a process of its own, which gives it up.
    const pid_t child = fork();
    if (child == 0) {
      if (setgid(65534) != 0 || setuid(65534) != 0) _exit(3);
      SocketCanConfig config;
      config.discard_stale_frames = true;
      SocketCanBus bus;
      const SocketCanBus::OpenResult result = bus.Open(can.name(), config);
      const bool told =
          result.message.find("frames of an earlier program wait") != std::string::npos;
      _exit(result.status == Status::kWouldBlock && told ? 0 : 4);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);

    SocketCanBus witness, bus;
    Open(witness, can.name());
    SocketCanConfig config;
    config.discard_stale_frames = true;
    Open(bus, can.name(), config);
    ASSERT_EQ(ReadCanLink(can.name(), link), 0);
    EXPECT_EQ(link.waiting_frames, 0);
    can.Throttle(500'000);
    ReceiveAll(witness);  // the interface was down, and the frames that left before
    EXPECT_TRUE(ReceiveAll(witness, 200).empty());
  });
}

TEST(SocketCanBusInKernel, RefusesALongQueueWhereFramesCanWait) {
  testing::InSteadyTime([] {
    VirtualCan can;
    Shell("ip link set " + can.name() + " txqueuelen 1000");
    SocketCanConfig config;
    config.discard_stale_frames = true;
    SocketCanBus bus;
    Open(bus, can.name(), config);  // Such an interface has no queue, whatever its length says.
    can.Throttle(1000);
    const SocketCanBus::OpenResult result = bus.Open(can.name(), config);
    EXPECT_EQ(result.status, Status::kInvalidArgument);
    EXPECT_THAT(result.message, HasSubstr("1000 frames, allowed: up to 48"));
    Open(bus, can.name());
  });
}

TEST(SocketCanBusInKernel, AllocatesNothingOnceItIsOpen) {
  testing::InSteadyTime([] {
    const VirtualCan can;
    SocketCanConfig config;
    config.discard_stale_frames = true;
    SocketCanBus bus, other;
    Open(bus, can.name(), config);
    Open(other, can.name());
    int rounds = 0;
    {
      const testing::AllocationGuard guard;
      for (std::uint8_t i = 0; i < 100; ++i) {
        const std::array<CanFrame, 2> frames{Frame(1, i), Frame(2, i)};
        std::size_t sent = 0;
        if (bus.SendAll(frames, sent) == Status::kOk && other.Send(Frame(3, i)) == Status::kOk) {
          ++rounds;
        }
        AwaitConfirmations(bus);
        AwaitConfirmations(other);
      }
    }
    EXPECT_EQ(rounds, 100);
  });
}

TEST(SocketCanBusInKernel, ReadsTheBitRateOfAController) {
  testing::InSteadyTime([] {
    SerialCan can;
    SocketCanBus bus;
    Open(bus, can.name());
    EXPECT_EQ(bus.link().bit_rate, 500'000);
    EXPECT_TRUE(bus.link().has_queue);
    EXPECT_EQ(bus.link().queue_frames_max, 10);
    EXPECT_FALSE(bus.link().confirms_on_the_wire);
    ASSERT_EQ(bus.Send(Frame(0x123, 0xab)), Status::kOk);
    EXPECT_TRUE(Eventually([&] {
      return can.heard().find("t1238AB00000000000000\r") != std::string::npos;
    })) << can.heard();
    const VirtualCan virtual_can;
    Open(bus, virtual_can.name());
    EXPECT_EQ(bus.link().bit_rate, 0);
    EXPECT_FALSE(bus.link().has_queue);
  });
}

TEST(SocketCanBusInKernel, FollowsTheControllerThroughItsErrorStatesToBusOffAndBack) {
  testing::InSteadyTime([] {
    SerialCan can;
    SocketCanBus bus;
    Open(bus, can.name());
    const auto becomes = [&bus](CanControllerState state) {
      return Eventually([&] {
        Drain(bus);
        return bus.controller_state() == state;
      });
    };
    EXPECT_EQ(bus.controller_state(), CanControllerState::kErrorActive);
    can.Say("sw096128\r");
    EXPECT_TRUE(becomes(CanControllerState::kErrorWarning));
    can.Say("sp000200\r");
    EXPECT_TRUE(becomes(CanControllerState::kErrorPassive));
    EXPECT_EQ(Poll(bus), Status::kWouldBlock) << "not yet an error of the link";
    EXPECT_EQ(bus.Send(Frame(1)), Status::kOk);
    can.Say("e1a\r");
    EXPECT_TRUE(Eventually([&] {
      Drain(bus);
      return bus.statistics().unacknowledged == 1;
    }));
    can.Say("sb000255\r");
    EXPECT_TRUE(becomes(CanControllerState::kBusOff));
    ReceivedFrame received;
    EXPECT_EQ(bus.Receive(received), Status::kBusOff);
    EXPECT_EQ(bus.Send(Frame(1)), Status::kBusOff);
    EXPECT_EQ(bus.statistics().bus_offs, 1);
    EXPECT_EQ(bus.in_flight(), 0);
    can.Down();
    EXPECT_EQ(Poll(bus), Status::kLinkDown);
    can.Up();
    EXPECT_EQ(Poll(bus), Status::kWouldBlock);
    EXPECT_EQ(bus.controller_state(), CanControllerState::kErrorActive);
    EXPECT_EQ(bus.Send(Frame(0x7ab)), Status::kOk);
    EXPECT_TRUE(Eventually([&] { return can.heard().find("t7AB8") != std::string::npos; }));
  });
}

TEST(SocketCanBusInKernel, CountsWhatTheControllerItselfLost) {
  testing::InSteadyTime([] {
    SerialCan can;
    SocketCanBus bus;
    Open(bus, can.name());
    const auto lost = [&bus](std::int64_t times) {
      return Eventually([&] {
        Drain(bus);
        return bus.statistics().overflows == times;
      });
    };
    can.Say("e1o\r");  // its receive buffer has overflowed
    EXPECT_TRUE(lost(1)) << bus.statistics().overflows;
    can.Say("e1o\re1o\r");
    EXPECT_TRUE(lost(3)) << bus.statistics().overflows;
    EXPECT_EQ(bus.statistics().error_frames, 3);
    EXPECT_EQ(bus.statistics().dropped, 0) << "the kernel lost none";
    EXPECT_EQ(bus.controller_state(), CanControllerState::kErrorActive);
    EXPECT_EQ(bus.Send(Frame(1)), Status::kOk) << "no error of the link";
  });
}

TEST(SocketCanBusInKernel, ReadsThatAControllerOnlyListens) {
  testing::InSteadyTime([] {
    SerialCan can;
    can.Down();
    Shell("ip link set " + can.name() + " type can listen-only on");
    can.Up();
    SocketCanBus bus;
    Open(bus, can.name());
    EXPECT_TRUE(bus.link().listen_only);
    can.Down();
    Shell("ip link set " + can.name() + " type can listen-only off");
    can.Up();
    Open(bus, can.name());
    EXPECT_FALSE(bus.link().listen_only);
  });
}

TEST(SocketCanBusInKernel, AnAdapterThatTakesNothingMoreIsAStall) {
  testing::InSteadyTime([] {
    SerialCan can;
    SocketCanBus bus;
    Open(bus, can.name());
    can.set_draining(false);
    bool full = false;
    // The terminal's buffer (4 kB, 22 bytes a frame) comes first.
    for (int i = 0; i < 2000 && !full; ++i) {
      full = bus.Send(Frame(1)) == Status::kWouldBlock;
      Drain(bus);
    }
    EXPECT_TRUE(full);
    EXPECT_EQ(bus.statistics().stalls, 1);
  });
}

}  // namespace
}  // namespace tumbler
