// Live LCM by UDP multicast. CTest starts this program inside a network namespace of its own that
// has only the loopback interface, so no packet leaves the machine.

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <string>
#include <thread>
#include <tumbler/command_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>
#include <utility>
#include <vector>

#include "runtime/assembly/operator_mailbox.h"
#include "runtime/record/channels.h"
#include "runtime/record/lcm_commands.h"
#include "runtime/record/request_key.h"
#include "runtime/record/telemetry.h"

namespace tumbler {
namespace {

constexpr const char* kUrl = "udpm://239.255.76.67:7667?ttl=0";
constexpr std::int64_t kRun = 1'234'567;

TEST(LcmCommands, PutsRequestsIntoTheMailboxAndNothingElse) {
  OperatorMailbox mailbox;
  SequenceGraph<float> graph;
  graph.edge_count = 2;
  graph.edge_storage[1].when = EdgeCondition::kBranch;
  graph.edge_storage[1].branch = FixedString<32>("roll");
  const LcmCommands commands(kUrl, mailbox, graph, {kRun, 2000, {}});
  lcm::LCM remote(kUrl);
  ASSERT_TRUE(remote.good());
  std::int64_t id = 4'000'000'000;
  const auto wish_after = [&](std::int8_t code, int patience, const std::string& branch = "") {
    command_t message{};
    message.id = id++;
    message.run = kRun;
    message.seen = 0;
    message.command = code;
    message.branch = branch;
    remote.publish(kCommandChannel, &message);
    OperatorWish taken;
    for (int i = 0; i < patience && taken.request == OperatorRequest::kNone; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      taken = mailbox.Take();
    }
    return taken;
  };
  const auto take_after = [&](std::int8_t code, int patience) {
    return wish_after(code, patience).request;
  };
  EXPECT_EQ(take_after(command_t::START, 1000), OperatorRequest::kStart);
  EXPECT_EQ(take_after(command_t::STOP, 1000), OperatorRequest::kStop);
  EXPECT_EQ(take_after(command_t::DISARM, 1000), OperatorRequest::kDisarm);
  EXPECT_EQ(take_after(command_t::CLEAR_FAULTS, 1000), OperatorRequest::kClearFaults);
  EXPECT_EQ(take_after(command_t::FINISH, 1000), OperatorRequest::kFinish);
  const OperatorWish roll = wish_after(command_t::BRANCH, 1000, "roll");
  EXPECT_EQ(roll.id, id - 1);
  EXPECT_EQ(roll.request, OperatorRequest::kBranch);
  EXPECT_EQ(roll.branch, 1);
  EXPECT_EQ(wish_after(command_t::BRANCH, 1000, "rol").branch, -1) << "for the executor to refuse";
  for (const int code : {0, 7, 8, 100, -1}) {
    EXPECT_EQ(take_after(static_cast<std::int8_t>(code), 5), OperatorRequest::kNone) << code;
  }
  EXPECT_EQ(take_after(command_t::STOP, 1000), OperatorRequest::kStop) << "it still listens";
}

TEST(LcmCommands, GoesOnAfterDatagramsThatAreNoRequests) {
  OperatorMailbox mailbox;
  const SequenceGraph<float> graph;
  const LcmCommands commands(kUrl, mailbox, graph, {kRun, 2000, {}});
  lcm::LCM remote(kUrl);
  ASSERT_TRUE(remote.good());
  command_t message{};
  message.id = 7;
  message.run = kRun;
  message.seen = 0;
  message.command = command_t::STOP;
  message.branch = "a text of 20 letters";
  std::vector<std::uint8_t> good(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(good.data(), 0, message.getEncodedSize());
  std::int64_t sent = 0;
  const auto publish = [&](const std::vector<std::uint8_t>& bytes) {
    remote.publish(kCommandChannel, bytes.data(), static_cast<unsigned>(bytes.size()));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));  // few enough for the socket buffer
    ++sent;
  };
  for (std::size_t size = 1; size < good.size(); ++size) {
    publish({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)});
  }
  for (const std::uint32_t length : {0U, 1U, 20U, 22U, 0x7fffffffU, 0x80000000U, 0xffffffffU}) {
    std::vector<std::uint8_t> bytes = good;
    for (std::size_t i = 0; i < 4; ++i) {
      bytes[65 + i] = static_cast<std::uint8_t>(length >> (24 - 8 * i));
    }
    publish(bytes);
  }
  for (int i = 0; i < 500 && commands.unreadable() < sent; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(commands.unreadable(), sent);
  EXPECT_EQ(mailbox.Take().request, OperatorRequest::kNone);
  remote.publish(kCommandChannel, &message);
  OperatorWish taken;
  for (int i = 0; i < 1000 && taken.request == OperatorRequest::kNone; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    taken = mailbox.Take();
  }
  EXPECT_EQ(taken.request, OperatorRequest::kStop) << "it still listens";
}

TEST(LcmCommands, RefusesRequestsToAnotherRunAndThoseForMotionThatAreTooOld) {
  OperatorMailbox mailbox;
  LcmCommands commands(kUrl, mailbox, SequenceGraph<float>(), {kRun, 2000, {}});
  commands.NoteTick(5000);
  lcm::LCM remote(kUrl);
  ASSERT_TRUE(remote.good());
  command_t message{};
  message.command = command_t::START;
  std::int64_t refused = 0;
  const auto ask = [&](std::int64_t run, std::int64_t seen) {
    ++message.id;
    message.run = run;
    message.seen = seen;
    remote.publish(kCommandChannel, &message);
    OperatorWish taken;
    for (int i = 0;
         i < 1000 && taken.request == OperatorRequest::kNone && commands.refused() == refused;
         ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      taken = mailbox.Take();
    }
    refused = commands.refused();
    return taken.request;
  };
  EXPECT_EQ(ask(kRun, 4990), OperatorRequest::kStart);
  for (const std::int64_t id : {std::int64_t{0}, std::int64_t{-1}, std::int64_t{1} << 32}) {
    const std::int64_t before = commands.unreadable();
    message.id = id;
    message.run = kRun;
    message.seen = 4990;
    remote.publish(kCommandChannel, &message);
    for (int i = 0; i < 1000 && commands.unreadable() == before; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_EQ(commands.unreadable(), before + 1) << id;
    EXPECT_EQ(mailbox.Take().request, OperatorRequest::kNone) << id << " cannot be answered";
  }
  message.id = 10;
  EXPECT_EQ(ask(kRun + 1, 4990), OperatorRequest::kNone) << "as when a log is played again";
  EXPECT_EQ(ask(0, 4990), OperatorRequest::kNone);
  EXPECT_EQ(ask(kRun, 2999), OperatorRequest::kNone) << "too old";
  EXPECT_EQ(ask(kRun, 3000), OperatorRequest::kStart);
  EXPECT_EQ(ask(kRun, 100'000), OperatorRequest::kNone) << "of a time to come";
  EXPECT_EQ(refused, 4);
}

/// A run's listener, and somebody who sends it requests.
class Asking {
 public:
  explicit Asking(std::optional<RequestKey> key = {})
      : commands_(kUrl, mailbox_, SequenceGraph<float>(), {kRun, 2000, std::move(key)}) {
    commands_.NoteTick(5000);
  }

  /// Sends a message as it is. @returns what came of it in the mailbox; none: it was not obeyed.
  OperatorRequest Send(const command_t& message) {
    remote_.publish(kCommandChannel, &message);
    // Messages keep their order: when one behind it that is none was counted, it was looked at.
    command_t last{};
    remote_.publish(kCommandChannel, &last);
    ++unreadable_;
    for (int i = 0; i < 2000 && commands_.unreadable() < unreadable_; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_EQ(commands_.unreadable(), unreadable_) << "it does not listen any more";
    return mailbox_.Take().request;
  }
  [[nodiscard]] std::int64_t refused() const { return commands_.refused(); }
  LcmCommands& commands() { return commands_; }

 private:
  OperatorMailbox mailbox_;
  LcmCommands commands_;
  lcm::LCM remote_{kUrl};
  std::int64_t unreadable_ = 0;
};

command_t RequestFor(std::int8_t command, std::int64_t id, std::int64_t seen) {
  command_t message{};
  message.id = id;
  message.run = kRun;
  message.seen = seen;
  message.command = command;
  return message;
}

TEST(LcmCommands, ObeysRequestsTowardsRestHoweverOldTheViewOfTheirSenderIs) {
  Asking asking;
  std::int64_t id = 1;
  for (const std::int64_t seen : {std::int64_t{0}, std::int64_t{2500}, std::int64_t{100'000}}) {
    EXPECT_EQ(asking.Send(RequestFor(command_t::STOP, id++, seen)), OperatorRequest::kStop);
    EXPECT_EQ(asking.Send(RequestFor(command_t::DISARM, id++, seen)), OperatorRequest::kDisarm);
    EXPECT_EQ(asking.Send(RequestFor(command_t::START, id++, seen)), OperatorRequest::kNone);
  }
  EXPECT_EQ(asking.refused(), 3);
  command_t other = RequestFor(command_t::STOP, id++, 4990);
  other.run = kRun + 1;
  EXPECT_EQ(asking.Send(other), OperatorRequest::kNone) << "it is for another run";
}

std::array<std::uint8_t, RequestKey::kBytes> KeyBytes(std::uint8_t first) {
  std::array<std::uint8_t, RequestKey::kBytes> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(first + i);
  return bytes;
}

TEST(LcmCommands, ObeyNobodyWithoutTheKeyButWhoWantsTheRobotToRest) {
  const RequestKey key(KeyBytes(1));
  Asking asking(key);
  std::int64_t id = 1;
  for (const std::int8_t motion : {command_t::START, command_t::BRANCH, command_t::CLEAR_FAULTS}) {
    command_t message = RequestFor(motion, id++, 4990);
    EXPECT_EQ(asking.Send(message), OperatorRequest::kNone) << "not signed";
    RequestKey(KeyBytes(2)).Sign(message);
    EXPECT_EQ(asking.Send(message), OperatorRequest::kNone) << "signed with another key";
    key.Sign(message);
    const auto changed = [&](auto change) {
      command_t other = message;
      change(other);
      return asking.Send(other);
    };
    EXPECT_EQ(changed([](command_t& m) { ++m.id; }), OperatorRequest::kNone);
    EXPECT_EQ(changed([](command_t& m) { ++m.seen; }), OperatorRequest::kNone);
    EXPECT_EQ(changed([](command_t& m) { m.branch = "roll"; }), OperatorRequest::kNone);
    EXPECT_EQ(changed([](command_t& m) { m.command = m.command % 3 + 1; }), OperatorRequest::kNone);
    EXPECT_EQ(changed([](command_t& m) { m.mac[31] ^= 1; }), OperatorRequest::kNone);
    EXPECT_EQ(asking.Send(message), static_cast<OperatorRequest>(motion));
  }
  EXPECT_EQ(asking.Send(RequestFor(command_t::STOP, id++, 0)), OperatorRequest::kStop);
  EXPECT_EQ(asking.Send(RequestFor(command_t::DISARM, id++, 0)), OperatorRequest::kDisarm);
}

TEST(LcmCommands, TakesARequestForMotionOnceHoweverOftenItIsSent) {
  const RequestKey key(KeyBytes(1));
  Asking asking(key);
  command_t start = RequestFor(command_t::START, 77, 4990);
  key.Sign(start);
  EXPECT_EQ(asking.Send(start), OperatorRequest::kStart);
  EXPECT_EQ(asking.Send(start), OperatorRequest::kNone) << "its sender has not seen the answer yet";
  EXPECT_EQ(asking.Send(RequestFor(command_t::DISARM, 78, 4990)), OperatorRequest::kDisarm);
  EXPECT_EQ(asking.Send(start), OperatorRequest::kNone) << "somebody has recorded it";
  asking.commands().NoteTick(4990 + 2000);
  EXPECT_EQ(asking.Send(start), OperatorRequest::kNone) << "as long as its state is young enough";
  asking.commands().NoteTick(1'000'000);
  EXPECT_EQ(asking.Send(start), OperatorRequest::kNone) << "and later";
}

TEST(LcmCommands, SaysThatThereIsNoServer) {
  OperatorMailbox mailbox;
  EXPECT_THROW(LcmCommands("tcpq://127.0.0.1:7711", mailbox, SequenceGraph<float>(), {}),
               std::runtime_error);
}

void Collect(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/,
             const state_t* state, std::vector<std::int64_t>* ticks) {
  ticks->push_back(state->tick);
}

TEST(Telemetry, PublishesEveryRecordLive) {
  lcm::LCM subscriber(kUrl);
  std::vector<std::int64_t> ticks;
  lcm::Subscription* subscription = subscriber.subscribeFunction(kStateChannel, &Collect, &ticks);
  subscription->setQueueCapacity(0);  // 0 is unlimited. By default LCM keeps 30 messages.
  TelemetryConfig config;
  config.lcm_url = kUrl;
  Telemetry telemetry(config);
  TickFeed feed({&telemetry});
  feed.Start();
  constexpr std::int64_t kRecords = 50;  // few enough for any socket buffer
  for (std::int64_t i = 0; i < kRecords; ++i) {
    TickOutput output;
    output.record.tick = i;
    output.record.joint_count = 2;
    feed.Push({}, {}, output);
  }
  while (static_cast<std::int64_t>(ticks.size()) < kRecords && subscriber.handleTimeout(5000) > 0) {
  }
  telemetry.Stop();
  ASSERT_EQ(static_cast<std::int64_t>(ticks.size()), kRecords);
  for (std::int64_t i = 0; i < kRecords; ++i) EXPECT_EQ(ticks[static_cast<std::size_t>(i)], i);
  EXPECT_EQ(telemetry.unpublished(), 0);
}

void CollectRuns(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/,
                 const run_t* run, std::vector<run_t>* runs) {
  runs->push_back(*run);
}

TEST(Telemetry, TellsOfARunWhoseDrivesAreBeingCheckedAndWhoHasEndedThat) {
  lcm::LCM subscriber(kUrl);
  std::vector<run_t> runs;
  subscriber.subscribeFunction(kRunChannel, &CollectRuns, &runs);
  {
    TelemetryConfig config;
    config.lcm_url = kUrl;
    config.run.number = kRun;
    config.run.robot = "left";
    Telemetry telemetry(config);
    telemetry.NoteChecking();
    telemetry.Start();
    while (runs.size() < 2 && subscriber.handleTimeout(5000) > 0) {
    }
    ASSERT_EQ(runs.size(), 2U);
    for (const run_t& run : runs) {
      EXPECT_EQ(run.run, kRun);
      EXPECT_EQ(run.robot, "left");
      EXPECT_TRUE(run.checking);
      EXPECT_EQ(run.check_request, 0);
    }
    telemetry.NoteCheckEnded(4'000'000'000);
  }
  while (runs.back().check_request == 0 && subscriber.handleTimeout(5000) > 0) {
  }
  EXPECT_EQ(runs.back().check_request, 4'000'000'000);
  EXPECT_FALSE(runs.back().checking);
}

}  // namespace
}  // namespace tumbler
