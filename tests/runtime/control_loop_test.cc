#include "runtime/run/control_loop.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <tumbler/event_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/mit.h"
#include "firmware_interface/devices/rotor_plant.h"
#include "firmware_interface/devices/simulated_mit.h"
#include "runtime/assembly/dry_run_bus.h"
#include "runtime/record/channels.h"
#include "runtime/record/sentences.h"
#include "tests/support/files.h"
#include "tests/support/loop_bench.h"

namespace tumbler {
namespace {

std::string Temporary(const std::string& name) {
  const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
  return (std::filesystem::temp_directory_path() /
          (std::string("tumbler_") + info->name() + "_" + std::to_string(getpid()) + "_" + name))
      .string();
}

using testing::LoopBench;

/// A telemetry with an output: a log that is removed at the end.
struct LogInto {
  explicit LogInto(const std::string& name) { config.log_file = Temporary(name); }
  LogInto(const LogInto&) = delete;
  LogInto& operator=(const LogInto&) = delete;
  ~LogInto() { std::filesystem::remove(config.log_file); }
  TelemetryConfig config;
};

OperatorWish Wish(OperatorRequest request) { return {0, request}; }

TEST(ControlLoop, PlaysAPrimitiveOnTwoRotorsInVirtualTime) {
  const LogInto log("log");
  LoopBench bench(log.config);
  bool setpoints_reach_the_motor = true;
  bench.Run([&] {
    const TickRecord& record = bench.loop->record();
    if (record.state == ExecutorState::kRunning &&
        record.joints[0].drive_state != DriveState::kEnabled) {
      setpoints_reach_the_motor = false;
    }
  });
  const LoopStatistics& s = bench.loop->statistics();
  EXPECT_EQ(bench.procedure->outcome(), RunOutcome::kCompleted)
      << Describe(bench.loop->record().first_fault, {"leg1", "leg2"});
  EXPECT_TRUE(setpoints_reach_the_motor);
  EXPECT_EQ(s.run_ticks, bench.executor.run_ticks() + 1);
  EXPECT_EQ(s.missed_ticks, 0);
  EXPECT_EQ(s.late_ticks, 0);
  EXPECT_EQ(s.send_failures, 0);
  EXPECT_EQ(s.frames_sent, 2 * s.ticks);
  EXPECT_NEAR(static_cast<double>(s.frames_received), static_cast<double>(s.frames_sent), 4);
  EXPECT_EQ(bench.telemetry.lost(), 0);
  EXPECT_EQ(bench.telemetry.written(), s.ticks);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT(s.following_error_max_rad[i], 0.05F);
    EXPECT_GT(s.following_error_max_rad[i], 0.0F);
    EXPECT_GT(s.peak_torque_nm[i], 0.1F);
    EXPECT_NEAR(bench.plant->rotors()[i].position_rad,
                bench.primitive.joints[i].position.control_points().back(), 0.01);
    EXPECT_FALSE(bench.simulated[i]->enabled()) << "disarmed at the end";
    EXPECT_EQ(bench.simulated[i]->watchdog_expiries(), 0);
  }
  EXPECT_NEAR(bench.bus.load(), 0.5, 0.06);
}

TEST(ControlLoop, WritesALogThatLcmReadsBackAndTwoRunsWriteTheSameBytes) {
  std::array<std::string, 2> logs;
  std::array<std::string, 2> traces;
  std::int64_t ticks = 0;
  for (std::size_t run = 0; run < 2; ++run) {
    TelemetryConfig config;
    config.log_file = Temporary("log" + std::to_string(run));
    config.trace_file = Temporary("trace" + std::to_string(run));
    config.run.joints = {"leg1", "leg2"};
    LoopBench bench(config);
    bench.Run([] {});
    ticks = bench.loop->statistics().ticks;
    logs[run] = testing::ReadFile(config.log_file);
    traces[run] = testing::ReadFile(config.trace_file);
    if (run == 0) {
      lcm::LogFile log(config.log_file, "r");
      ASSERT_TRUE(log.good());
      std::int64_t states = 0;
      std::int64_t last_tick = -1;
      std::vector<std::string> visited;
      run_t run_message;
      while (const lcm::LogEvent* event = log.readNextEvent()) {
        if (event->channel == kStateChannel) {
          state_t state;
          ASSERT_EQ(state.decode(event->data, 0, event->datalen), event->datalen);
          EXPECT_EQ(state.tick, last_tick + 1);
          EXPECT_EQ(state.number, state.tick);
          EXPECT_EQ(event->timestamp, state.time_ns / 1000);
          EXPECT_EQ(state.time_ns, state.tick * 1'000'000);
          ASSERT_EQ(state.joint_count, 2);
          if (state.state == state_t::STATE_RUNNING) {
            for (const joint_state_t& joint : state.joints) {
              EXPECT_NEAR(joint.encoded_position_rad, joint.limited_position_rad, 25.0 / 65535);
              EXPECT_NEAR(joint.measured_position_rad, joint.limited_position_rad, 0.06);
            }
          }
          last_tick = state.tick;
          ++states;
        } else if (event->channel == kRunChannel) {
          ASSERT_EQ(run_message.decode(event->data, 0, event->datalen), event->datalen);
        } else {
          ASSERT_EQ(event->channel, kEventChannel);
          event_t message;
          ASSERT_EQ(message.decode(event->data, 0, event->datalen), event->datalen);
          if (message.from_state != message.to_state) visited.push_back(message.to_state);
        }
      }
      EXPECT_EQ(states, ticks);
      EXPECT_EQ(run_message.ticks, ticks) << "the last one is of the end";
      EXPECT_EQ(run_message.joints, config.run.joints);
      EXPECT_EQ(run_message.missed_ticks, 0);
      EXPECT_LE(run_message.reply_age_max_ticks, 1);
      EXPECT_NEAR(run_message.bus_load, 0.54, 0.01) << "worst case of two setpoints, two replies";
      EXPECT_EQ(visited,
                (std::vector<std::string>{"arming", "holding", "moving to start", "holding",
                                          "running", "settling", "holding", "disarmed"}));
    }
    std::filesystem::remove(config.log_file);
    std::filesystem::remove(config.trace_file);
  }
  EXPECT_GT(logs[0].size(), 100000U);
  EXPECT_TRUE(logs[0] == logs[1]);
  EXPECT_TRUE(traces[0] == traces[1]);
  EXPECT_EQ(std::count(traces[0].begin(), traces[0].end(), '\n'), ticks + 1);
}

TEST(ControlLoop, AStopFromTheMailboxBrakesAndEndsTheRun) {
  LoopBench bench({});
  bench.Run([&] {
    if (bench.loop->statistics().run_ticks == 500) bench.mailbox.Put(Wish(OperatorRequest::kStop));
  });
  EXPECT_EQ(bench.procedure->outcome(), RunOutcome::kStopped);
  EXPECT_LT(bench.loop->statistics().run_ticks, 503);
  EXPECT_EQ(bench.loop->record().faults, 0);
}

TEST(ControlLoop, ASilentDriveEndsInAFaultThatNamesIt) {
  LoopBench bench({});
  bench.Run([&] {
    if (bench.loop->statistics().run_ticks == 300) bench.simulated[1]->set_silent(true);
  });
  EXPECT_EQ(bench.procedure->outcome(), RunOutcome::kFault);
  const FaultDetail fault = bench.loop->record().first_fault;
  EXPECT_EQ(fault.fault, Fault::kStaleReply);
  EXPECT_EQ(fault.joint, 1);
  EXPECT_EQ(fault.state, ExecutorState::kRunning);
  const std::string text = Describe(fault, {"leg1", "leg2"});
  EXPECT_NE(text.find("stale reply of joint leg2: 6 ticks, limit 5"), std::string::npos) << text;
  EXPECT_NE(text.find("reaction: damp"), std::string::npos) << text;
}

TEST(ControlLoop, ALostLinkEndsInAFault) {
  LoopBench bench({});
  bench.Run([&] {
    if (bench.loop->statistics().run_ticks == 300) bench.host.SetLinkDown(true);
  });
  EXPECT_EQ(bench.procedure->outcome(), RunOutcome::kFault);
  EXPECT_EQ(bench.loop->record().first_fault.fault, Fault::kInterfaceDown);
  EXPECT_GT(bench.loop->statistics().send_failures, 0);
}

/// A clock that sometimes wakes late, as on a busy computer.
class LateClock final : public Clock {
 public:
  explicit LateClock(VirtualClock& clock) : clock_(clock) {}
  [[nodiscard]] std::int64_t now_ns() const noexcept override { return clock_.now_ns(); }
  void SleepUntil(std::int64_t time_ns) noexcept override {
    clock_.SleepUntil(time_ns + (++sleeps_ % 100 == 0 ? late_ns : 0) + once_ns_);
    once_ns_ = 0;
  }
  /// Makes the next wake-up late.
  void Delay(std::int64_t by_ns) { once_ns_ = by_ns; }
  std::int64_t late_ns = 0;  ///< Of every hundredth.

 private:
  VirtualClock& clock_;
  int sleeps_ = 0;
  std::int64_t once_ns_ = 0;
};

/// A clock of a computer that is suspended once.
class SuspendedClock final : public Clock {
 public:
  explicit SuspendedClock(VirtualClock& clock) : clock_(clock) {}
  [[nodiscard]] std::int64_t now_ns() const noexcept override { return clock_.now_ns(); }
  [[nodiscard]] std::int64_t suspended_ns() const noexcept override { return slept_ns; }
  void SleepUntil(std::int64_t time_ns) noexcept override { clock_.SleepUntil(time_ns); }
  std::int64_t slept_ns = 7'000'000'000;  // before the loop began

 private:
  VirtualClock& clock_;
};

TEST(ControlLoop, NoticesThatTheComputerWasSuspended) {
  LoopBench bench({});
  SuspendedClock clock(bench.clock);
  ControlLoop loop({bench.executor, bench.host, clock, *bench.procedure, bench.mailbox, nullptr},
                   1'000'000, 0);
  while (loop.record().state != ExecutorState::kRunning) ASSERT_TRUE(loop.Step());
  ASSERT_TRUE(loop.Step());
  EXPECT_EQ(loop.record().faults, 0);
  EXPECT_EQ(loop.statistics().missed_ticks, 0);
  const std::int64_t tick = loop.record().tick;
  clock.slept_ns += 4'500'000'000;
  ASSERT_TRUE(loop.Step());
  EXPECT_EQ(loop.record().first_fault.fault, Fault::kPaused);
  EXPECT_EQ(loop.record().reaction, Reaction::kDisable);
  EXPECT_EQ(loop.record().tick - tick, 4501);
  EXPECT_EQ(loop.statistics().missed_ticks, 4500);
  ASSERT_TRUE(loop.Step());
  EXPECT_EQ(loop.record().tick - tick, 4502) << "it is counted once";
}

TEST(ControlLoop, TakesEverySuspensionForAPauseInWhichDrivesMayHaveLetGo) {
  LoopBench bench({});
  SuspendedClock clock(bench.clock);
  ControlLoop loop({bench.executor, bench.host, clock, *bench.procedure, bench.mailbox, nullptr},
                   1'000'000, 0);
  while (loop.record().state != ExecutorState::kHolding) ASSERT_TRUE(loop.Step());
  ASSERT_GT(bench.executor.pause_ticks_max(), 110);
  clock.slept_ns += 110'000'000;
  ASSERT_TRUE(loop.Step());
  EXPECT_EQ(loop.record().first_fault.fault, Fault::kPaused);
}

TEST(ControlLoop, DropsFramesThatHaveWaitedThroughAPauseAndKnowsHowOldTheOthersAre) {
  for (const int late : {3, 150, 400}) {
    LoopBench bench({});
    LateClock clock(bench.clock);
    ControlLoop loop({bench.executor, bench.host, clock, *bench.procedure, bench.mailbox, nullptr},
                     1'000'000, 0);
    while (loop.record().state != ExecutorState::kHolding) ASSERT_TRUE(loop.Step());
    EXPECT_EQ(loop.record().joints[0].reply_age_ticks, 0);
    clock.Delay(late * std::int64_t{1'000'000});
    const std::int64_t received = loop.statistics().frames_received;
    ASSERT_TRUE(loop.Step());
    const bool paused = late >= bench.executor.pause_ticks_max();
    // The last setpoint was answered right after it, and nothing has been sent since.
    EXPECT_GE(loop.record().joints[0].reply_age_ticks, late) << late;
    EXPECT_EQ(loop.record().reaction, paused ? Reaction::kDisable : Reaction::kHold) << late;
    EXPECT_EQ(loop.statistics().frames_dropped, paused ? 2 : 0) << late;
    EXPECT_EQ(loop.statistics().frames_received - received, 2);
    ASSERT_TRUE(loop.Step());
    EXPECT_EQ(loop.record().joints[0].reply_age_ticks, 0) << "what comes now is new";
  }
}

/// A clock of a program that is stopped within a tick, after the time was read.
class StoppedInATickClock final : public Clock {
 public:
  explicit StoppedInATickClock(VirtualClock& clock) : clock_(clock) {}
  [[nodiscard]] std::int64_t now_ns() const noexcept override {
    if (countdown > 0 && --countdown == 0) stopped_ns += 500'000'000;
    return clock_.now_ns() + stopped_ns;
  }
  void SleepUntil(std::int64_t time_ns) noexcept override {
    clock_.SleepUntil(std::max(time_ns, now_ns()) - stopped_ns);
  }
  mutable int countdown = 0;  ///< Readings of the clock until it is stopped.
  mutable std::int64_t stopped_ns = 0;

 private:
  VirtualClock& clock_;
};

TEST(ControlLoop, SendsNoSetpointOfBeforeAPauseThatComesWithinATick) {
  LoopBench bench({});
  StoppedInATickClock clock(bench.clock);
  ControlLoop loop({bench.executor, bench.host, clock, *bench.procedure, bench.mailbox, nullptr},
                   1'000'000, 0);
  while (loop.record().state != ExecutorState::kHolding) ASSERT_TRUE(loop.Step());
  const std::int64_t sent = loop.statistics().frames_sent;
  clock.countdown = 3;  // when woken in SleepUntil; awake; before the frames are sent
  ASSERT_TRUE(loop.Step());
  ASSERT_EQ(clock.stopped_ns, 500'000'000);
  EXPECT_EQ(loop.record().faults, 0U) << "this tick does not know yet";
  EXPECT_EQ(loop.statistics().frames_sent, sent);
  ASSERT_TRUE(loop.Step());
  EXPECT_EQ(loop.record().first_fault.fault, Fault::kPaused);
  EXPECT_EQ(loop.record().reaction, Reaction::kDisable);
  EXPECT_GT(loop.statistics().frames_sent, sent) << "torque off";
}

TEST(ControlLoop, TakesAReadingOfTheClockThatIsOffByAFewTicksForNoSuspension) {
  LoopBench bench({});
  SuspendedClock clock(bench.clock);
  ControlLoop loop({bench.executor, bench.host, clock, *bench.procedure, bench.mailbox, nullptr},
                   1'000'000, 0);
  while (loop.record().state != ExecutorState::kRunning) ASSERT_TRUE(loop.Step());
  const std::int64_t tick = loop.record().tick;
  const std::int64_t slept_ns = clock.slept_ns;
  for (const std::int64_t off_ns : {5'000'000, 0, 12'000'000, -7'000'000}) {
    clock.slept_ns = slept_ns + off_ns;
    ASSERT_TRUE(loop.Step());
  }
  EXPECT_EQ(loop.record().faults, 0);
  EXPECT_EQ(loop.statistics().missed_ticks, 0);
  EXPECT_EQ(loop.record().tick - tick, 4);
}

TEST(ControlLoop, CountsLateAndMissedTicksAndKeepsToTheSchedule) {
  for (const std::int64_t late_ns : {600'000, 1'700'000, 4'200'000}) {
    LoopBench bench({});
    LateClock clock(bench.clock);
    clock.late_ns = late_ns;
    ControlLoop loop({bench.executor, bench.host, clock, *bench.procedure, bench.mailbox, nullptr},
                     1'000'000, 0);
    std::int64_t last_tick = -1;
    std::int64_t gaps = 0;
    while (loop.Step()) {
      gaps += loop.record().tick - last_tick - 1;
      last_tick = loop.record().tick;
      EXPECT_EQ(loop.time_ns(), last_tick * 1'000'000) << "deadlines do not drift";
    }
    EXPECT_EQ(loop.statistics().missed_ticks, gaps);
    EXPECT_GT(loop.statistics().late_ticks, 0);
    EXPECT_EQ(loop.statistics().wake_up.max_ns(), late_ns);
    if (late_ns < 4'000'000) {
      EXPECT_EQ(bench.procedure->outcome(), RunOutcome::kCompleted);
      EXPECT_EQ(gaps > 0, late_ns > 1'000'000);
    } else {
      EXPECT_EQ(bench.procedure->outcome(), RunOutcome::kFault);
      EXPECT_EQ(loop.record().first_fault.fault, Fault::kLateTick);
      EXPECT_EQ(loop.record().first_fault.value.integer(), 4);
    }
  }
}

TEST(Telemetry, CountsWhatDoesNotFit) {
  const LogInto log("log");
  Telemetry telemetry(log.config);
  TickFeed feed({&telemetry});
  constexpr std::int64_t kTicks = 200'000;
  for (std::int64_t i = 0; i < kTicks; ++i) feed.Push({}, {}, {});
  EXPECT_GT(telemetry.lost(), 0);
  telemetry.Drain();
  EXPECT_GT(telemetry.written(), 8000) << "eight seconds";
  EXPECT_EQ(telemetry.written() + telemetry.lost(), kTicks);
}

TEST(Telemetry, DrainsInItsThread) {
  const LogInto log("log");
  Telemetry telemetry(log.config);
  TickFeed feed({&telemetry});
  feed.Start();
  for (int i = 0; i < 1000; ++i) feed.Push({}, {}, {});
  telemetry.Stop();
  EXPECT_EQ(telemetry.written(), 1000);
  EXPECT_EQ(telemetry.lost(), 0);
}

TEST(Telemetry, NamesAFileThatCannotBeWritten) {
  for (const bool log : {true, false}) {
    TelemetryConfig config;
    (log ? config.log_file : config.trace_file) = "/proc/nowhere/at/all";
    try {
      const Telemetry telemetry(config);
      FAIL();
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find("/proc/nowhere/at/all: cannot be written"),
                std::string::npos);
    }
  }
}

OperatorRequest Kept(OperatorRequest first, OperatorRequest second) {
  OperatorMailbox mailbox;
  mailbox.Put(Wish(first));
  mailbox.Put(Wish(second));
  return mailbox.Take().request;
}

TEST(OperatorMailbox, IsTakenOnce) {
  OperatorMailbox mailbox;
  EXPECT_EQ(mailbox.Take(), OperatorWish{});
  mailbox.Put({7, OperatorRequest::kBranch, 3});
  EXPECT_EQ(mailbox.Take(), (OperatorWish{7, OperatorRequest::kBranch, 3}));
  EXPECT_EQ(mailbox.Take(), OperatorWish{});
}

TEST(OperatorMailbox, KeepsTheStrongerOfTwoEndsAndTheLaterOfOtherRequests) {
  using R = OperatorRequest;
  EXPECT_EQ(Kept(R::kStop, R::kClearFaults), R::kStop);
  EXPECT_EQ(Kept(R::kFinish, R::kStart), R::kFinish);
  EXPECT_EQ(Kept(R::kStop, R::kDisarm), R::kDisarm);
  EXPECT_EQ(Kept(R::kDisarm, R::kStop), R::kDisarm);
  EXPECT_EQ(Kept(R::kFinish, R::kStop), R::kStop);
  EXPECT_EQ(Kept(R::kClearFaults, R::kStart), R::kStart);
  EXPECT_EQ(Kept(R::kStart, R::kBranch), R::kBranch);
}

TEST(OperatorMailbox, NeverForgetsThatTheProgramIsToEnd) {
  OperatorMailbox mailbox;
  mailbox.Put(Wish(OperatorRequest::kStop));
  mailbox.Put({0, OperatorRequest::kFinish, -1, true});
  const OperatorWish taken = mailbox.Take();
  EXPECT_EQ(taken.request, OperatorRequest::kStop);
  EXPECT_TRUE(taken.quit);
}

TEST(ControlLoop, AnswersEachRequestOnceWithWhatBecameOfIt) {
  RunProcedureConfig config;
  config.attended = true;
  config.hold_ticks = 50;
  LoopBench bench({}, config);
  const auto ask = [&](std::uint32_t id, OperatorRequest request) {
    bench.mailbox.Put({id, request});
    bench.loop->Step();
    EXPECT_EQ(bench.loop->request().id, id);
    EXPECT_EQ(bench.loop->request().request, request);
    return bench.loop->request().refusal;
  };
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(bench.loop->Step());
  EXPECT_EQ(bench.loop->record().state, ExecutorState::kDisarmed) << "it waits";
  EXPECT_EQ(bench.procedure->runs(), 0);
  EXPECT_EQ(ask(1, OperatorRequest::kBranch), Refusal::kWrongState);
  EXPECT_EQ(ask(2, OperatorRequest::kStart), Refusal::kNone);
  EXPECT_EQ(ask(2, OperatorRequest::kStart), Refusal::kNone) << "sent twice, taken once";
  EXPECT_EQ(ask(3, OperatorRequest::kStart), Refusal::kWrongState) << "it runs already";
  for (int i = 0; i < 300; ++i) bench.loop->Step();
  EXPECT_EQ(ask(4, OperatorRequest::kClearFaults), Refusal::kWrongState);
  EXPECT_EQ(ask(5, OperatorRequest::kStop), Refusal::kNone);
  for (int i = 0; i < 2000; ++i) ASSERT_TRUE(bench.loop->Step());
  EXPECT_EQ(bench.loop->record().state, ExecutorState::kDisarmed);
  EXPECT_EQ(bench.procedure->outcome(), RunOutcome::kStopped)
      << Describe(bench.procedure->refusal(), {"leg1", "leg2"});
  EXPECT_EQ(ask(6, OperatorRequest::kStart), Refusal::kNone) << "and again";
  EXPECT_EQ(bench.procedure->runs(), 2);
  bench.mailbox.Put({0, OperatorRequest::kFinish, -1, true});
  int more = 0;
  while (bench.loop->Step() && more < 20000) ++more;
  EXPECT_LT(more, 20000) << "it is over";
}

TEST(ControlLoop, ARequestThatIsSentAgainDoesNotTakeAnInterruptWithIt) {
  RunProcedureConfig config;
  config.attended = true;
  LoopBench bench({}, config);
  bench.mailbox.Put({1, OperatorRequest::kStop});
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(bench.loop->Step());
  bench.mailbox.Put({1, OperatorRequest::kStop});              // again, in the tick
  bench.mailbox.Put({0, OperatorRequest::kFinish, -1, true});  // of the interrupt
  int more = 0;
  while (bench.loop->Step() && more < 1000) ++more;
  EXPECT_LT(more, 1000) << "it is over";
}

TEST(MeasureWakeUps, CountsEveryPeriodOnce) {
  VirtualClock virtual_clock([](std::int64_t) {});
  LateClock clock(virtual_clock);
  clock.late_ns = 2'300'000;
  OperatorMailbox mailbox;
  const LoopStatistics statistics = MeasureWakeUps(clock, mailbox, 1'000'000, 1000);
  EXPECT_EQ(statistics.ticks + statistics.missed_ticks, 1000);
  EXPECT_EQ(statistics.wake_up.count(), statistics.ticks);
  EXPECT_EQ(statistics.wake_up.max_ns(), 2'300'000);
  EXPECT_EQ(statistics.late_ticks, 9);
  EXPECT_EQ(statistics.missed_ticks, 18);
}

TEST(MeasureWakeUps, EndsWhenTheOperatorSaysSo) {
  OperatorMailbox mailbox;
  VirtualClock clock([&](std::int64_t time_ns) {
    if (time_ns > 10'000'000) mailbox.Put({0, OperatorRequest::kFinish, -1, true});
  });
  EXPECT_LE(MeasureWakeUps(clock, mailbox, 1'000'000, 1000).ticks, 12);
}

TEST(ReplyAgeHistogram, CountsAgesAndWhatWasNeverThere) {
  ReplyAgeHistogram ages;
  EXPECT_EQ(ages.max(), -1);
  for (const int age : {-1, 0, 0, 1, 14, 15, 400}) ages.Add(age);
  EXPECT_EQ(ages.never(), 1);
  EXPECT_EQ(ages.count(0), 2);
  EXPECT_EQ(ages.count(1), 1);
  EXPECT_EQ(ages.count(14), 1);
  EXPECT_EQ(ages.count(15), 2);
  EXPECT_EQ(ages.max(), 400);
}

TEST(Machine, IsDescribed) {
  const Machine machine = DescribeMachine("");
  EXPECT_NE(machine.kernel.find("Linux "), std::string::npos);
  EXPECT_NE(machine.cpu.find(" online"), std::string::npos);
  EXPECT_EQ(machine.adapter, "none");
  EXPECT_EQ(DescribeMachine("lo").adapter, "virtual");
}

TEST(DurationHistogram, GivesPercentilesAndTheLargest) {
  DurationHistogram histogram;
  EXPECT_EQ(histogram.PercentileNs(0.5), 0);
  for (int i = 1; i <= 100; ++i) histogram.Add(i * 1000 - 500);  // 0.5 us ... 99.5 us
  EXPECT_EQ(histogram.PercentileNs(0.5), 50'000);
  EXPECT_EQ(histogram.PercentileNs(0.99), 99'000);
  EXPECT_EQ(histogram.PercentileNs(1), 99'500);
  histogram.Add(7'000'000);
  EXPECT_EQ(histogram.max_ns(), 7'000'000);
  EXPECT_EQ(histogram.beyond(), 1);
  histogram.Add(-5);
  EXPECT_EQ(histogram.count(), 102);
}

TEST(CandumpLine, IsWhatCandumpWrites) {
  CanFrame frame;
  frame.id = 0x123;
  frame.size = 8;
  frame.data = {0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88};
  EXPECT_EQ(CandumpLine(1'345'212'884'318'850'000, "can0", frame),
            "(1345212884.318850) can0 123#1122334455667788");
  frame.size = 0;
  frame.extended = true;
  EXPECT_EQ(CandumpLine(5'000, "vcan0", frame), "(0000000000.000005) vcan0 00000123#");
  frame.extended = false;
  frame.remote = true;
  EXPECT_EQ(CandumpLine(0, "can0", frame), "(0000000000.000000) can0 123#R");
}

TEST(DryRunBus, CompletesARunWithoutAnyHardware) {
  LoopBench bench({});  // Only its primitive and parts are used, not its bus.
  std::vector<DryRunBus::Node> nodes;
  for (std::size_t i = 0; i < 2; ++i) {
    nodes.push_back({std::make_unique<SimulatedMitDrive>(bench.simulated[i]->config()),
                     bench.primitive.joints[i].position.control_points()[0]});
  }
  DryRunBus bus("can0", 1'000'000, std::move(nodes), nullptr);
  VirtualClock clock([&bus](std::int64_t time_ns) { bus.AdvanceTo(time_ns); });
  ControlLoop loop({bench.executor, bus, clock, *bench.procedure, bench.mailbox, nullptr},
                   1'000'000, 0);
  while (loop.Step()) {
  }
  EXPECT_EQ(bench.procedure->outcome(), RunOutcome::kCompleted)
      << Describe(loop.record().first_fault, {"leg1", "leg2"});
  EXPECT_EQ(loop.statistics().run_ticks, bench.executor.run_ticks() + 1);
}

}  // namespace
}  // namespace tumbler
