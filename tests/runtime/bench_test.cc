// The parts of tumbler bench on simulated drives: what they send, what they find, and how they end.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "common/files/program.h"
#include "common/files/toml_reader.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drives_draft.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/rotor_plant.h"
#include "runtime/assembly/interrupts.h"
#include "runtime/bench/arming_checks.h"
#include "runtime/bench/bench_operator.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/bench_tests.h"
#include "runtime/bench/bench_world.h"
#include "runtime/bench/bus_scan.h"
#include "runtime/bench/commission.h"
#include "runtime/bench/drive_reading.h"
#include "runtime/bench/step_page.h"
#include "tests/support/example_drives.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/protocol_side.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::Replaced;

std::string Example(const testing::ExampleDrives& example) {
  return testing::ReadFile(testing::SourcePath(example.file));
}

/// Simulated drives with rotors. Every frame that is sent can be looked at, or kept back.
class RigWorld final : public BenchWorld, private CanBus {
 public:
  explicit RigWorld(const DrivesConfig& drives)
      : bus_(drives.bit_rate), clock_([this](std::int64_t ns) {
          plant_->AdvanceTo(ns);
          if (each_tick) each_tick();
        }) {
    std::vector<RotorPlant::Rotor> rotors;
    for (const DriveEntry& entry : drives.drives) {
      simulated.push_back(MakeSimulatedDrive(entry));
      simulated.back()->AttachTo(bus_);
      RotorPlant::Rotor rotor;
      rotor.drive = simulated.back().get();
      rotor.damping_nm_s_per_rad = 0.1;
      rotors.push_back(rotor);
    }
    SimulatedPortConfig host;
    host.transmit_capacity = 64;
    host_ = &bus_.Attach(host);
    plant_ = std::make_unique<RotorPlant>(bus_, rotors);
  }
  CanBus& bus() override { return *this; }
  Clock& clock() override { return clock_; }
  [[nodiscard]] BusTrouble trouble() const override { return {}; }

  [[nodiscard]] bool AnyEnabled() const {
    bool any = false;
    for (const auto& drive : simulated) any = any || drive->enabled();
    return any;
  }
  RotorPlant::Rotor& rotor(std::size_t i) { return plant_->rotors()[i]; }
  SimulatedBus& wire() { return bus_; }

  std::vector<std::unique_ptr<SimulatedDrive>> simulated;
  std::vector<CanFrame> sent;
  std::function<void()> each_tick;
  /// Changes a received frame; may be empty.
  std::function<void(CanFrame&)> on_receive;

 private:
  Status Send(const CanFrame& frame) noexcept override {
    sent.push_back(frame);
    return host_->Send(frame);
  }
  Status Receive(ReceivedFrame& received) noexcept override {
    const Status status = host_->Receive(received);
    if (status == Status::kOk && on_receive) on_receive(received.frame);
    return status;
  }

  SimulatedBus bus_;
  std::unique_ptr<RotorPlant> plant_;
  SimulatedPort* host_ = nullptr;
  VirtualClock clock_;
};

class BenchOf : public ::testing::TestWithParam<testing::ExampleDrives> {
 protected:
  BenchOf() : drives_(ParseDrives(Example(GetParam()), "example")), world_(drives_) {}

  [[nodiscard]] const testing::ProtocolSide& side() const {
    return testing::SideOf(drives_.drives[0].config);
  }
  /// Whether a drive's silence is judged by its torque, because it does not say that it let go.
  [[nodiscard]] bool IsPushed() const { return side().HeartbeatId(drives_.drives[0].config) == 0; }
  /// The positions that frames to the drive ask for, in order.
  [[nodiscard]] std::vector<double> Asked(std::size_t drive) const {
    std::vector<double> asked;
    DriveProtocols::With(drives_.drives[drive].config, [&](auto protocol, const auto& config) {
      double shaft_rad = 0;
      for (const CanFrame& frame : world_.sent) {
        if (decltype(protocol)::CommandedPosition(config, frame, shaft_rad))
          asked.push_back(shaft_rad);
      }
      return 0;
    });
    return asked;
  }

  DrivesConfig drives_;
  RigWorld world_;
};

TEST_P(BenchOf, AJogKeepsAmplitudeAndSpeedInEveryFrameAndLeavesTheTorqueOff) {
  BenchBounds bounds;
  bounds.amplitude_rad = 0.08;
  bounds.speed_rad_s = 0.3;
  {
    BenchSession session(world_, drives_, bounds);
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    const JogResult jog = Jog(session, 0, {0.5, false}, nullptr);  // more than is allowed
    EXPECT_NEAR(jog.ways_rad[0], 0.08, 0.01);
    EXPECT_NEAR(jog.ways_rad[1], 0, 0.001);
    EXPECT_FALSE(world_.AnyEnabled());
  }
  const std::vector<double> asked = Asked(0);
  ASSERT_GT(asked.size(), 500U);
  constexpr double kRounding_rad = 5e-4;
  for (std::size_t i = 0; i < asked.size(); ++i) {
    EXPECT_LE(std::abs(asked[i]), 0.08 + kRounding_rad);
    if (i > 0) {
      EXPECT_LE(std::abs(asked[i] - asked[i - 1]), 0.3e-3 + kRounding_rad);
    }
  }
  EXPECT_NEAR(world_.rotor(0).position_rad, 0, 0.01);
}

TEST_P(BenchOf, AfterAPauseOfTheProgramNothingIsAskedOfADriveThatMayHaveLetGo) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  session.Enable(0);
  for (int i = 0; i < 20; ++i) session.Follow(0, 0);
  world_.clock().SleepUntil(session.now_ns() + 500'000'000);
  world_.rotor(0).position_rad = 1.2;  // The robot has fallen.
  const std::size_t before = world_.sent.size();
  try {
    session.Follow(0, 0);
    ADD_FAILURE() << "the pause was not noticed";
  } catch (const BenchFault& fault) {
    EXPECT_THAT(fault.what(), HasSubstr("has not replied for"));
  }
  EXPECT_EQ(world_.sent.size(), before);
}

TEST_P(BenchOf, AJointWithHardlyAnyFrictionIsAtRestWhenAJogLeavesIt) {
  for (const std::size_t joint : {0U, 1U}) world_.rotor(joint).damping_nm_s_per_rad = 0.005;
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  for (const std::size_t joint : {0U, 1U}) {
    static_cast<void>(Jog(session, joint, {0.1, false}, nullptr));
    session.Wait(1);
    // Half of what would be taken for a motion of its own while the next drive is tried.
    EXPECT_NEAR(world_.rotor(joint).position_rad, 0, 0.015);
  }
}

TEST_P(BenchOf, AnInterruptAtAnyTimeEndsWithTheTorqueOff) {
  const auto jog = [](BenchSession& session) {
    static_cast<void>(Jog(session, 0, {0.1, false}, nullptr));
  };
  const auto prove = [](BenchSession& session) { static_cast<void>(ProveWatchdog(session, 0)); };
  const auto interrupt_by = [&](const OperatorWish& wish, int tick,
                                const std::function<void(BenchSession&)>& work) {
    SCOPED_TRACE(ToString(wish.request));
    SCOPED_TRACE(tick);
    int ticks = 0;
    const auto run = [&] {
      BenchSession session(world_, drives_, {});
      ASSERT_THAT(session.AwaitReplies(), IsEmpty());
      session.ClearErrors();  // of a silence that an earlier interrupt ended
      world_.each_tick = [&] {
        if (++ticks == tick) InterruptMailbox().Put(wish);
      };
      work(session);
    };
    try {
      run();
      ADD_FAILURE() << "it goes on";
    } catch (const BenchInterrupted& end) {
      EXPECT_EQ(end.wish(), wish);
    }
    world_.each_tick = {};
    EXPECT_FALSE(world_.AnyEnabled());
  };
  const auto interrupt = [&](int tick, const std::function<void(BenchSession&)>& work) {
    interrupt_by({0, OperatorRequest::kFinish, -1, true}, tick, work);
  };
  const double ticks_in_ms = 1e-3 * drives_.rate_hz;
  for (const int tick : {1, 5, 40, 300, 700, 1000, 1150})
    interrupt(static_cast<int>(std::ceil(tick * ticks_in_ms)), jog);
  for (const int tick : {1, 10, 40, 60, 100}) interrupt(tick, prove);
  for (const OperatorRequest request :
       {OperatorRequest::kFinish, OperatorRequest::kStop, OperatorRequest::kDisarm}) {
    interrupt_by({7, request, -1, false}, 40, prove);  // by LCM
  }
}

TEST_P(BenchOf, ADriveErrorInMidMotionIsAFaultThatNamesTheDriveAndTheTorqueGoesOff) {
  int ticks = 0;
  const auto run = [&] {
    BenchSession session(world_, drives_, {});
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    world_.each_tick = [&] {
      if (++ticks == 200) world_.simulated[1]->RaiseError(GetParam().protocol == "mit" ? 2 : 0x40);
    };
    static_cast<void>(Jog(session, 1, {0.1, false}, nullptr));
  };
  try {
    run();
    FAIL() << "no fault";
  } catch (const BenchFault& fault) {
    EXPECT_THAT(fault.what(), HasSubstr("(leg2)"));
  }
  world_.each_tick = {};
  EXPECT_FALSE(world_.simulated[0]->enabled());
  constexpr std::int64_t kBraking_ns = 300'000'000;  // what a CiA 402 drive does in a fault first
  world_.clock().SleepUntil(world_.clock().now_ns() + kBraking_ns);
  EXPECT_EQ(world_.simulated[1]->torque_nm(), 0);
}

TEST_P(BenchOf, ADriveThatFallsSilentInMidMotionIsAFault) {
  int ticks = 0;
  const auto run = [&] {
    BenchSession session(world_, drives_, {});
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    world_.each_tick = [&] {
      if (++ticks == 200) world_.simulated[0]->set_silent(true);
    };
    static_cast<void>(Jog(session, 0, {0.1, false}, nullptr));
  };
  EXPECT_THROW(run(), BenchFault);
  world_.each_tick = {};
  EXPECT_FALSE(world_.simulated[0]->enabled());
}

TEST_P(BenchOf, AJointThatIsCarriedAwayIsAFault) {
  int ticks = 0;
  const auto run = [&] {
    BenchSession session(world_, drives_, {});
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    world_.each_tick = [&] {
      if (++ticks > 200) world_.rotor(0).position_rad = 0.4;
    };
    static_cast<void>(Jog(session, 0, {0.1, false}, nullptr));
  };
  EXPECT_THROW(run(), BenchFault);
  world_.each_tick = {};
  EXPECT_FALSE(world_.AnyEnabled());
}

TEST_P(BenchOf, TheWatchdogsProofFindsWhenADriveLetsGo) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const WatchdogResult watchdog = ProveWatchdog(session, 0);
  EXPECT_TRUE(watchdog.let_go);
  // CANSimple tells by its next heartbeat.
  EXPECT_NEAR(watchdog.limp_after_s, 0.025, GetParam().protocol == "cansimple" ? 0.012 : 0.004);
  EXPECT_LE(watchdog.pushed_after_s, 0.026);
  const double period_s = session.period_s();
  EXPECT_THAT(JudgeWatchdog("drive", watchdog, 0.025, period_s, {}), IsEmpty());
  EXPECT_EQ(JudgeWatchdog("drive", watchdog, 0.1, period_s, {}).at(0).kind, "watchdog-differs");
  // An interval on both sides of the expected time proves nothing.
  WatchdogResult vague;
  vague.let_go = true;
  vague.pushed_after_s = 0.012;
  vague.limp_after_s = 0.3;
  EXPECT_EQ(JudgeWatchdog("drive", vague, 0.2, period_s, {}).at(0).kind, "watchdog-unproved");
  // Only who writes the file knows whether it has it right.
  EXPECT_FALSE(JudgeWatchdog("drive", watchdog, 0.1, period_s, {}).at(0).mended);
  EXPECT_GT(world_.simulated[0]->watchdog_expiries(), 0);
  EXPECT_FALSE(world_.AnyEnabled());
}

TEST_P(BenchOf, NoOrderLeadsBeyondTheAmplitudeOnEitherSide) {
  for (const double far_rad : {-1.0, 1.0}) {
    BenchSession session(world_, drives_, {});
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    session.Enable(0);
    const double origin_rad = session.position_rad(0);
    world_.sent.clear();
    for (int i = 0; i < 1000; ++i) session.Follow(origin_rad + far_rad, 0);
    for (const double asked : Asked(0)) {
      const float zero = JointOf(drives_.drives[0].config).zero_offset_rad;
      EXPECT_LE(std::abs(asked + double{zero} - origin_rad), 0.1 + 1e-3);
    }
    EXPECT_FALSE(Asked(0).empty());
    session.TorqueOff();
    world_.rotor(0).position_rad = 0;
  }
}

TEST_P(BenchOf, APushIsNoHarderThanTheBounds) {
  if (GetParam().protocol != "mit") return;  // The others' own gains push as well.
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  for (const double torque_nm : {6.0, -6.0}) {
    session.Enable(0);
    session.Push(torque_nm);
    session.Push(torque_nm);
    EXPECT_NEAR(world_.simulated[0]->torque_nm(), std::copysign(1.0, torque_nm), 0.02);
    session.TorqueOff();
  }
}

TEST_P(BenchOf, ASilenceEndsWhenTheJointOfADriveWithAClockOfItsOwnLeavesTheAmplitude) {
  if (GetParam().protocol != "cansimple") return;  // The others say no position meanwhile.
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  session.Enable(0);
  for (int i = 0; i < 20; ++i) session.Follow(session.position_rad(0), 0);
  world_.each_tick = [this] { world_.rotor(0).position_rad = 0.12; };
  const std::int64_t begin_ns = session.now_ns();
  EXPECT_EQ(session.StaySilentUntil(begin_ns + 1'000'000'000), -1) << "the watchdog is slower";
  EXPECT_LT(session.now_ns() - begin_ns, 20'000'000);
  world_.each_tick = {};
  session.TorqueOff();
}

/// Somebody who sees what a test says, and has the way clear.
class ToldOperator final : public BenchOperator {
 public:
  bool Confirm(const std::string& /*what*/, const std::function<void()>& /*meanwhile*/) override {
    return clear;
  }
  std::string WhichTurned(const std::vector<std::string>& /*joints*/,
                          const std::function<void()>& /*meanwhile*/) override {
    return turned.at(asked++);
  }
  bool Grew(const std::string& /*joint*/, const std::function<void()>& /*meanwhile*/) override {
    return grew;
  }
  bool Place(const std::string& /*joint*/, double /*angle_rad*/,
             const std::function<void()>& /*meanwhile*/) override {
    return true;
  }
  bool TurnThrough(const std::string& /*joint*/, double /*lower_rad*/, double /*upper_rad*/,
                   const std::function<void()>& /*meanwhile*/) override {
    return true;
  }

  bool clear = true;
  std::vector<std::string> turned{"leg1", "leg2"};
  bool grew = true;
  std::size_t asked = 0;
};

/// What became of the checks before arming.
struct Checked {
  std::string refusal;  ///< Empty: the drives may be armed.
  std::vector<std::string> said;
  double farthest_rad[2] = {0, 0};  ///< Of each joint from where it was.
  double torque_nm = 0;             ///< The largest.
  bool both = false;                ///< Whether two drives were ever enabled at once.
};

Checked CheckDrives(RigWorld& world, const DrivesConfig& drives, const ArmingChecks& checks,
                    ToldOperator& somebody, const std::function<void()>& disturb = {}) {
  Checked checked;
  world.each_tick = [&] {
    if (disturb) disturb();
    for (std::size_t i = 0; i < 2; ++i) {
      checked.farthest_rad[i] =
          std::max(checked.farthest_rad[i], std::abs(world.rotor(i).position_rad));
      checked.torque_nm = std::max(checked.torque_nm, std::abs(world.simulated[i]->torque_nm()));
    }
    checked.both = checked.both || (world.simulated[0]->enabled() && world.simulated[1]->enabled());
  };
  try {
    CheckBeforeArming(world, drives, {"leg1", "leg2"}, checks, somebody,
                      [&](const std::string& line) { checked.said.push_back(line); });
  } catch (const Refused& refused) {
    checked.refusal = refused.what();
  }
  world.each_tick = {};
  EXPECT_FALSE(world.AnyEnabled());
  EXPECT_FALSE(checked.both);
  return checked;
}

TEST_P(BenchOf, BeforeArmingDrivesThatAreRightAreProvedOneAtATimeWithinTheBounds) {
  ToldOperator somebody;
  const Checked checked = CheckDrives(world_, drives_, {true, true, false, {}}, somebody);
  EXPECT_EQ(checked.refusal, "");
  ASSERT_EQ(checked.said.size(), 4U);
  EXPECT_THAT(checked.said[0], HasSubstr("(leg1) turns leg1, as the drives file says"));
  EXPECT_THAT(checked.said[1], HasSubstr("(leg2) turns leg2, as the drives file says"));
  EXPECT_THAT(checked.said[2], HasSubstr("(leg1): limp "));
  EXPECT_THAT(checked.said[3], HasSubstr("(leg2): limp "));
  for (const double way_rad : checked.farthest_rad) {
    EXPECT_GT(way_rad, 0.05);
    EXPECT_LT(way_rad, 0.15);
  }
  for (const auto& drive : world_.simulated) EXPECT_GT(drive->watchdog_expiries(), 0);
  if (GetParam().protocol == "mit") {
    EXPECT_LE(checked.torque_nm, 1.0);
  }
}

TEST_P(BenchOf, BeforeArmingExchangedDrivesAreRefusedByNameAndNothingElseMoves) {
  ToldOperator somebody;
  somebody.turned = {"leg2", "leg1"};
  const Checked checked = CheckDrives(world_, drives_, {true, true, false, {}}, somebody);
  EXPECT_THAT(checked.refusal, HasSubstr("(leg1) turns leg2, and the drives file says leg1"));
  EXPECT_EQ(checked.farthest_rad[1], 0);
  EXPECT_EQ(world_.simulated[0]->watchdog_expiries(), 0) << "no further check";
}

TEST_P(BenchOf, BeforeArmingAWrongDirectionIsRefusedByNameAndNothingElseMoves) {
  ToldOperator somebody;
  somebody.grew = false;
  const Checked checked = CheckDrives(world_, drives_, {true, true, false, {}}, somebody);
  EXPECT_THAT(checked.refusal, HasSubstr("(leg1) turns leg1 against its axis"));
  EXPECT_EQ(checked.farthest_rad[1], 0);
  EXPECT_EQ(world_.simulated[0]->watchdog_expiries(), 0);
}

TEST_P(BenchOf, BeforeArmingOnlyTheRightEncoderMayMove) {
  ToldOperator somebody;
  const Checked stuck = CheckDrives(world_, drives_, {true, false, false, {}}, somebody,
                                    [this] { world_.rotor(0).position_rad = 0; });
  EXPECT_THAT(stuck.refusal, HasSubstr("(leg1) moved by "));
  const Checked coupled = CheckDrives(world_, drives_, {true, false, false, {}}, somebody, [this] {
    world_.rotor(1).position_rad = world_.rotor(0).position_rad;
  });
  EXPECT_THAT(coupled.refusal, HasSubstr("(leg2) moved by "));
  EXPECT_THAT(coupled.refusal, HasSubstr("too, when "));
  somebody.clear = false;
  const Checked unclear = CheckDrives(world_, drives_, {true, false, false, {}}, somebody);
  EXPECT_THAT(unclear.refusal, HasSubstr("was not to move"));
  EXPECT_EQ(somebody.asked, 0U);
}

TEST_P(BenchOf, BeforeArmingADriveThatIsSilentOrReportsAnErrorIsRefused) {
  ToldOperator somebody;
  world_.simulated[1]->set_silent(true);
  EXPECT_THAT(CheckDrives(world_, drives_, {true, true, false, {}}, somebody).refusal,
              HasSubstr("(leg2) does not reply"));
  world_.simulated[1]->set_silent(false);
  const std::uint32_t code = GetParam().protocol == "cia402" ? 0x8611 : 4;
  world_.simulated[1]->RaiseError(code);
  EXPECT_THAT(CheckDrives(world_, drives_, {true, true, false, {}}, somebody).refusal,
              HasSubstr("(leg2) reports 0x"));
  EXPECT_EQ(somebody.asked, 0U);
  if (!side().nature().clears_errors) return;
  EXPECT_EQ(CheckDrives(world_, drives_, {true, true, true, {}}, somebody).refusal, "");
}

TEST_P(BenchOf, BeforeArmingADriveWithoutWatchdogIsRefusedWithTheReason) {
  std::string text = Example(GetParam());
  if (GetParam().protocol == "cia402")
    text = Replaced(text, "watchdog_reaction = \"fault\"", "watchdog_reaction = \"none\"");
  const DrivesConfig believed = ParseDrives(text, "believed");
  const std::string second = "joint = \"leg2\"";
  std::string really = Replaced(text, "watchdog_s = 0.025", "watchdog_s = 0.0", second);
  if (GetParam().protocol == "cia402")
    really = Replaced(really, "watchdog_s = 0.025", "watchdog_s = 0.0");
  RigWorld world(ParseDrives(really, "really"));
  ToldOperator somebody;
  const Checked checked = CheckDrives(world, believed, {false, true, false, {}}, somebody);
  EXPECT_THAT(checked.refusal, HasSubstr(GetParam().protocol == "cia402" ? "(leg1)" : "(leg2)"));
  EXPECT_THAT(checked.refusal, HasSubstr("still drives"));
  EXPECT_EQ(somebody.asked, 0U);
}

TEST(WatchdogProof, OfAnAkV3DriveWhoseTorqueIsUnknownIsRefusedWithWhatIsMissing) {
  DrivesConfig drives = ParseDrives(
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives_akv3.toml")), "ak");
  std::get<AkV3Config>(drives.drives[0].config).torque_constant_nm_per_a = 0;
  RigWorld world(drives);
  BenchSession session(world, drives, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  try {
    static_cast<void>(ProveWatchdog(session, 0));
    FAIL() << "not refused";
  } catch (const Refused& refused) {
    EXPECT_THAT(refused.what(), HasSubstr("torque_constant_nm_per_a is 0"));
  }
  EXPECT_FALSE(world.AnyEnabled());
}

TEST_P(BenchOf, RepliesAreTimedAndLostOnesCounted) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  std::vector<ReplyResult> replies = MeasureReplies(session, 2);
  ASSERT_EQ(replies.size(), 2U);
  EXPECT_EQ(replies[0].lost, 0);
  const double period_s = session.period_s();
  EXPECT_EQ(replies[0].answers, side().nature().answers);
  EXPECT_LE(replies[0].max_ms, 1e3 * period_s + 0.1);
  EXPECT_THAT(JudgeReplies("drive", replies[0], period_s, {}), IsEmpty());
  BusFaultPlan plan;
  plan.faults.push_back({});
  plan.faults.back().node = 2;  // the host
  plan.faults.back().probability = 0.02;
  world_.wire().SetFaults(plan);
  replies = MeasureReplies(session, 5);
  EXPECT_NEAR(replies[0].lost_share(), 0.02, 0.008);
  EXPECT_EQ(JudgeReplies("drive", replies[0], period_s, {}).at(0).kind, "noisy-bus");
}

TEST_P(BenchOf, AnswersThatAreLateByWholePeriodsAreTimedFromTheirOwnQuestion) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const std::vector<ReplyResult> prompt = MeasureReplies(session, 1);
  if (!prompt[0].answers) GTEST_SKIP() << "this drive is not asked";
  const double period_ms = 1e3 * session.period_s();
  for (const double late_ms : {0.7 * period_ms, 1.6 * period_ms, 2.5 * period_ms}) {
    BusFaultPlan plan;
    plan.faults.push_back({});
    plan.faults.back().kind = BusFaultKind::kDelay;
    plan.faults.back().node = 2;  // the host
    plan.faults.back().delay_ns = std::llround(1e6 * late_ms);
    world_.wire().SetFaults(plan);
    session.Wait(0.1);
    const std::vector<ReplyResult> replies = MeasureReplies(session, 1);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_NEAR(replies[i].median_ms, prompt[i].median_ms + late_ms, 0.15) << late_ms;
      EXPECT_EQ(replies[i].lost, 0);
      EXPECT_FALSE(replies[i].at_least);
    }
    const bool late = prompt[0].p99_ms + late_ms > period_ms;
    EXPECT_EQ(JudgeReplies("drive", replies[0], session.period_s(), {}).empty(), !late);
  }
}

TEST_P(BenchOf, AnswersThatTakeLongerThanEverySilenceAreLateByAtLeastThat) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  if (!MeasureReplies(session, 0.5)[0].answers) GTEST_SKIP() << "this drive is not asked";
  BusFaultPlan plan;
  plan.faults.push_back({});
  plan.faults.back().kind = BusFaultKind::kDelay;
  plan.faults.back().node = 2;  // the host
  plan.faults.back().delay_ns = 400'000'000;
  world_.wire().SetFaults(plan);
  session.Wait(1);
  const ReplyResult replies = MeasureReplies(session, 1)[0];
  EXPECT_TRUE(replies.at_least);
  EXPECT_EQ(JudgeReplies("drive", replies, session.period_s(), {}).back().kind, "late-replies");
}

TEST_P(BenchOf, RepeatedRepliesAreNamedAndDoNotGrowIntoLatencies) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const ReplyResult once = MeasureReplies(session, 1)[0];
  for (const double share : {0.1, 1.0}) {
    BusFaultPlan plan;
    plan.faults.push_back({});
    plan.faults.back().kind = BusFaultKind::kDuplicate;
    plan.faults.back().node = 2;  // the host
    plan.faults.back().probability = share;
    world_.wire().SetFaults(plan);
    const ReplyResult replies = MeasureReplies(session, 2)[0];
    EXPECT_GT(replies.repeated, 0);
    EXPECT_EQ(JudgeReplies("drive", replies, session.period_s(), {}).at(0).kind,
              "repeated-replies");
    if (replies.answers) {
      EXPECT_NEAR(replies.median_ms, once.median_ms, 0.15);
      EXPECT_LT(replies.max_ms, 1e3 * session.period_s());
    }
  }
}

TEST_P(BenchOf, AStepAnswersAsItsDifferentialEquationDoes) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const StepResult step = MeasureStep(session, 0, {});
  if (GetParam().protocol == "mit") {
    // 0.02 kg m^2 on 5 N m/rad with 0.2 + 0.1 N m s/rad: natural frequency 15.8 rad/s, damping
    // ratio 0.474, and so exp(-pi 0.474 / sqrt(1 - 0.474^2)) = 0.184 of overshoot.
    EXPECT_NEAR(step.overshoot, 0.184, 0.04);
    ASSERT_TRUE(step.rise_s);
    EXPECT_NEAR(*step.rise_s, 0.1, 0.015);
  }
  EXPECT_NEAR(step.remaining_rad, 0, 0.003);
  const std::string page = StepPage({{"a <drive>", {}, step}});
  EXPECT_THAT(page, HasSubstr("a &lt;drive&gt;"));
  EXPECT_THAT(page, HasSubstr("<polyline points=\""));
  EXPECT_THAT(JudgeStep("drive", {}, step), IsEmpty());
}

TEST_P(BenchOf, APositionOfADriveThatHasFallenSilentIsAFaultThatNamesIt) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  static_cast<void>(RestingPosition(session, 1));
  world_.simulated[1]->set_silent(true);
  static_cast<void>(RestingPosition(session, 0));
  try {
    static_cast<void>(RestingPosition(session, 1));
    FAIL() << "no fault";
  } catch (const BenchFault& fault) {
    EXPECT_THAT(fault.what(), HasSubstr("(leg2) has not replied for"));
  }
  // Nor can it be said that its joint has not moved.
  EXPECT_THROW(static_cast<void>(Jog(session, 0, {0.1, false}, nullptr)), BenchFault);
}

TEST_P(BenchOf, EveryReplyOfADriveThatDiedIsLostAndThoseAfterItDied) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  world_.each_tick = [&] {
    if (std::cmp_equal(session.replies(1).asked_ns.size(), std::lround(1 / session.period_s())))
      world_.simulated[1]->set_silent(true);
  };
  std::vector<ReplyResult> replies = MeasureReplies(session, 2);
  EXPECT_EQ(replies[0].lost, 0);
  EXPECT_NEAR(replies[1].lost_share(), 0.5, 0.01);
  EXPECT_EQ(JudgeReplies("drive", replies[1], 0.001, {}).at(0).kind, "noisy-bus");
  session.Wait(0.1);
  replies = MeasureReplies(session, 1);
  EXPECT_GT(replies[1].lost_share(), 0.99);
  EXPECT_EQ(JudgeReplies("drive", replies[1], 0.001, {}).at(0).kind, "noisy-bus");
}

TEST_P(BenchOf, ADriveThatLosesMostOfItsRepliesSteadilyIsFound) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  BusFaultPlan plan;
  plan.faults.push_back({});
  plan.faults.back().node = 2;  // the host
  plan.faults.back().probability = 0.7;
  world_.wire().SetFaults(plan);
  EXPECT_NEAR(MeasureReplies(session, 5)[0].lost_share(), 0.7, 0.05);
}

TEST_P(BenchOf, AJointThatIsBlockedHasNoRiseAndIsAFinding) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  world_.each_tick = [&] {
    world_.rotor(0).position_rad = 0;
    world_.rotor(0).velocity_rad_s = 0;
  };
  const StepResult step = MeasureStep(session, 0, {});
  EXPECT_FALSE(step.rise_s);
  EXPECT_EQ(ToJson(step)["rise_s"].Dump(0), "null");
  EXPECT_THAT(Describe(step), HasSubstr("not reached"));
  EXPECT_EQ(JudgeStep("drive", {}, step).at(0).kind, "step-not-followed");
}

TEST_P(BenchOf, ADriveWithoutWatchdogIsProvedForNoLongerThanItsJointStaysWithinTheAmplitude) {
  DrivesConfig actual = drives_;
  actual.drives[0].watchdog_s = 0;
  if (auto* cia402 = std::get_if<Cia402Config>(&actual.drives[0].config))
    cia402->watchdog_reaction = 0;
  RigWorld world(actual);
  double farthest_rad = 0;
  world.each_tick = [&] {
    farthest_rad = std::max(farthest_rad, std::abs(world.rotor(0).position_rad));
  };
  BenchSession session(world, actual, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const WatchdogResult watchdog = ProveWatchdog(session, 0);
  EXPECT_FALSE(watchdog.let_go);
  EXPECT_LE(farthest_rad, 0.1);
  EXPECT_GE(watchdog.pushed_after_s, IsPushed() ? 0.05 : 0.999);
  EXPECT_EQ(watchdog.longest, !IsPushed());
  const BenchFinding finding = JudgeWatchdog("drive", watchdog, 0.025, 0.001, {}).at(0);
  EXPECT_EQ(finding.kind, "no-watchdog");
  EXPECT_FALSE(finding.mended);
  EXPECT_THAT(finding.text, HasSubstr("still drives after"));
}

INSTANTIATE_TEST_SUITE_P(EveryProtocol, BenchOf,
                         ::testing::ValuesIn(testing::ExampleOfEveryProtocol()),
                         [](const auto& example) { return example.param.protocol; });

TEST(BenchTorque, StiffnessAndVelocityOfEverySetpointTogetherStayWithinTheBound) {
  const DrivesConfig drives = DefaultDrives({"leg1"});
  const auto& mit = std::get<MitConfig>(drives.drives[0].config);
  BenchBounds bounds;
  bounds.amplitude_rad = 1;
  bounds.speed_rad_s = 5;
  bounds.torque_nm = 0.5;
  bounds.kp_nm_per_rad = 20;
  bounds.kd_nm_s_per_rad = 2;
  RigWorld world(drives);
  BenchSession session(world, drives, bounds);
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  session.Enable(0);
  const double origin_rad = session.position_rad(0);
  double most_nm = 0;
  for (int i = 0; i < 600; ++i) {
    const double measured_rad = session.position_rad(0);
    const std::size_t before = world.sent.size();
    session.Follow(origin_rad + (i < 300 ? 0.8 : -0.8), i < 300 ? 5 : -5);
    for (std::size_t k = before; k < world.sent.size(); ++k) {
      ImpedanceCommand command;
      if (DecodeMitCommand(mit, world.sent[k], command) != Status::kOk) continue;
      most_nm = std::max(
          most_nm,
          double{command.kp_nm_per_rad} * std::abs(double{command.position_rad} - measured_rad) +
              double{command.kd_nm_s_per_rad} * std::abs(double{command.velocity_rad_s}));
    }
  }
  session.TorqueOff();
  EXPECT_LE(most_nm, 0.5 + 0.04);  // steps of 0.4 mrad, 0.025 rad/s, and of the gains
  EXPECT_GT(most_nm, 0.4);
}

/// Two drives of each protocol. The questions to MIT drives would be commands of the CANSimple
/// node 1, whose identifiers are 32 to 63.
DrivesConfig MixedDrives() {
  DrivesConfig mixed;
  mixed.rate_hz = 200;
  for (const testing::ExampleDrives& example : testing::ExampleOfEveryProtocol()) {
    DrivesConfig drives = ParseDrives(Example(example), "example");
    for (DriveEntry& drive : drives.drives) {
      drive.joint = example.protocol + drive.joint;
      if (auto* mit = std::get_if<MitConfig>(&drive.config))
        mit->command_id = static_cast<std::uint16_t>(mit->command_id + 9);
      if (auto* cia402 = std::get_if<Cia402Config>(&drive.config)) {
        cia402->node_id = static_cast<std::uint8_t>(cia402->node_id + 4);
        cia402->period_us = 5000;
      }
      if (auto* ak = std::get_if<AkV3Config>(&drive.config)) ak->status_s = 0.005;
      mixed.drives.push_back(drive);
    }
  }
  return mixed;
}

TEST(BusScan, FindsDrivesOfAllProtocolsOnOneBusAndMovesNone) {
  const DrivesConfig drives = MixedDrives();
  RigWorld world(drives);
  std::vector<FoundDrive> found = ScanBus(world, {});
  std::vector<std::string> names;
  names.reserve(found.size());
  for (const FoundDrive& drive : found) {
    const std::string name = drive.protocol + ' ' + std::to_string(drive.number);
    names.push_back(name);
    if (name == "ak-v3 1") {
      EXPECT_EQ(drive.details, "0.0 degrees, no error");
      EXPECT_TRUE(drive.by_itself);
    }
    if (name == "mit 10") {
      EXPECT_EQ(drive.reply_id, 17);
    }
  }
  EXPECT_THAT(names,
              ::testing::IsSupersetOf({"ak-v3 1", "ak-v3 2", "canopen-csp 5", "canopen-csp 6",
                                       "cansimple 1", "cansimple 2", "mit 10", "mit 11"}));
  EXPECT_EQ(names.size(), drives.drives.size()) << "each drive of each protocol, and no other";
  EXPECT_THAT(CompareWithDraft(found, drives), IsEmpty());
  EXPECT_FALSE(world.AnyEnabled());
  for (std::size_t i = 0; i < drives.drives.size(); ++i)
    EXPECT_EQ(world.rotor(i).position_rad, 0) << drives.drives[i].joint;
  // No question was an emergency stop, or anything else that is latched.
  BenchSession session(world, drives, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  for (std::size_t i = 0; i < session.size(); ++i)
    EXPECT_EQ(session.drive(i).state(), DriveState::kDisabled) << session.NameOf(i);
}

TEST(BusScan, TellsDamiaosDrivesByTheirRegistersWhateverTheirIdentifiers) {
  DrivesConfig drives = DefaultDrives({"leg1", "leg2", "arm"});
  for (const std::size_t i : {1U, 2U}) {
    auto& mit = std::get<MitConfig>(drives.drives[i].config);
    mit.dialect = MitDialect::kDamiao;
    mit.command_id = i == 1 ? 5 : 0x25;  // Replies carry the same low bits.
    mit.reply_id = i == 1 ? 0x55 : 0x65;
  }
  RigWorld world(drives);
  const std::vector<FoundDrive> found = ScanBus(world, {});
  ASSERT_EQ(found.size(), 3U);
  const std::vector<std::tuple<int, int, bool>> expected = {
      {1, 17, false}, {5, 0x55, true}, {0x25, 0x65, true}};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(found[i].number, std::get<0>(expected[i]));
    EXPECT_EQ(found[i].reply_id, std::get<1>(expected[i]));
    EXPECT_EQ(found[i].damiao, std::get<2>(expected[i]));
  }
  EXPECT_THAT(CompareWithDraft(found, drives), IsEmpty());
  EXPECT_FALSE(world.AnyEnabled());
  auto& mit = std::get<MitConfig>(drives.drives[1].config);
  mit.dialect = MitDialect::kMiniCheetah;
  EXPECT_EQ(CompareWithDraft(found, drives).at(0).kind, "other-dialect");
}

TEST(DriveReading, ADamiaoDriveTellsItsRangesAndOthersThanTheFilesAreAFinding) {
  DrivesConfig drives = DefaultDrives({"leg1"});
  auto& mit = std::get<MitConfig>(drives.drives[0].config);
  mit.dialect = MitDialect::kDamiao;
  RigWorld world(drives);
  const std::vector<DriveReading> readings = ReadDrive(world, drives.drives[0]);
  std::vector<std::string> texts;
  texts.reserve(readings.size());
  for (const DriveReading& reading : readings) texts.push_back(Describe(reading));
  EXPECT_THAT(
      texts,
      ElementsAre("register 7 identifier of replies: 17", "register 8 identifier of commands: 1",
                  "register 9 time-out: 500 50 us", "register 21 largest position: 12.5 rad",
                  "register 22 largest velocity: 50 rad/s", "register 23 largest torque: 18 N m"));
  EXPECT_THAT(JudgeReadings(drives.drives[0], readings).findings, IsEmpty());
  EXPECT_EQ(JudgeReadings(drives.drives[0], readings).judged.size(), 3U);
  mit.command.velocity_rad_s = {-40, 40};
  const std::vector<BenchFinding> findings = JudgeReadings(drives.drives[0], readings).findings;
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].kind, "other-range");
  EXPECT_THAT(findings[0].text, HasSubstr("largest velocity = 50, and range.velocity_rad_s"));
}

TEST(DriveReading, CanOpenAndCanSimpleDrivesTellWhatTheyHaveAndNothingMoves) {
  const DrivesConfig drives = MixedDrives();
  RigWorld world(drives);
  world.clock().SleepUntil(20'000'000);
  for (std::size_t i = 0; i < drives.drives.size(); ++i) {
    std::vector<std::string> texts;
    for (const DriveReading& reading : ReadDrive(world, drives.drives[i]))
      texts.push_back(Describe(reading));
    const DriveConfig& config = drives.drives[i].config;
    if (std::holds_alternative<Cia402Config>(config)) {
      EXPECT_THAT(texts, ::testing::IsSupersetOf(
                             {"1000h:00 device type: 0x20192", "6041h:00 statusword: 0x250"}));
    } else if (std::holds_alternative<CanSimpleConfig>(config)) {
      EXPECT_THAT(texts, ::testing::IsSupersetOf({"active errors: 0x0", "position: 0 turns"}));
    } else {
      EXPECT_THAT(texts, IsEmpty());
    }
  }
  EXPECT_FALSE(world.AnyEnabled());
}

TEST(BusScan, AsksNothingWhenSomebodyCommandsDrives) {
  const DrivesConfig drives = DefaultDrives({"leg1", "leg2"});
  RigWorld world(drives);
  SimulatedPort& other = world.wire().Attach();
  MitDrive host(std::get<MitConfig>(drives.drives[0].config));
  world.each_tick = [&] {
    FrameBatch batch;
    ASSERT_EQ(host.Encode(DriveRequest::kDisable, {}, batch), Status::kOk);
    static_cast<void>(other.Send(batch.frames()[0]) == Status::kOk);
  };
  EXPECT_THROW(static_cast<void>(ScanBus(world, {})), Refused);
  EXPECT_THAT(world.sent, IsEmpty());
  ScanConfig passive;
  passive.passive = true;
  EXPECT_THAT(ScanBus(world, passive), IsEmpty());
}

TEST(BusScan, AsksNothingWhenSomebodyCommandsDrivesWithIdentifiersOf29Bits) {
  DrivesConfig drives;
  RigWorld world(drives);
  SimulatedPort& other = world.wire().Attach();
  world.each_tick = [&] {
    static_cast<void>(other.Send(EncodeAkV3Command(AkV3Config(), {})) == Status::kOk);
  };
  try {
    static_cast<void>(ScanBus(world, {}));
    FAIL() << "not refused";
  } catch (const Refused& refused) {
    EXPECT_THAT(refused.what(), HasSubstr("(frame 0x00000801)"));
  }
  EXPECT_THAT(world.sent, IsEmpty());
}

TEST(BusScan, TellsWhatTheFileDoesNot) {
  DrivesConfig drives = DefaultDrives({"leg1", "leg2"});
  std::get<MitConfig>(drives.drives[0].config).reply_id = 0;
  std::get<MitConfig>(drives.drives[1].config).command_id = 3;
  RigWorld world(DefaultDrives({"leg1", "leg2"}));
  std::vector<std::string> kinds;
  for (const BenchFinding& finding : CompareWithDraft(ScanBus(world, {}), drives))
    kinds.push_back(finding.kind);
  EXPECT_THAT(kinds, ElementsAre("reply-identifier", "missing-drive", "unknown-drive"));
}

TEST(BusScan, OnABusWithoutAnybodySaysThatNobodyAcknowledges) {
  DrivesConfig none;
  RigWorld world(none);
  try {
    static_cast<void>(ScanBus(world, {}));
    FAIL() << "not refused";
  } catch (const Refused& refused) {
    EXPECT_THAT(refused.what(), HasSubstr("nobody acknowledges"));
  }
}

TEST(DrivesDraft, ChangesValuesAndKeepsComments) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  DrivesDraft draft(text, "draft.toml");
  EXPECT_EQ(draft.text(), text);
  draft.SetNumber(1, "zero_offset_rad", -0.25);
  draft.SetInteger(0, "direction", -1);
  draft.SetText(0, "joint", "a \"joint\" # of its own");
  draft.Check();
  EXPECT_EQ(JointOf(draft.config().drives[1].config).zero_offset_rad, -0.25F);
  EXPECT_EQ(JointOf(draft.config().drives[0].config).direction, -1);
  EXPECT_EQ(draft.config().drives[0].joint, "a \"joint\" # of its own");
  EXPECT_THAT(draft.text(), HasSubstr("# the joint's name in the robot's URDF"));
  draft.SetText(0, "joint", "leg1");
  draft.SetInteger(0, "direction", 1);
  draft.SetNumber(1, "zero_offset_rad", 0);
  EXPECT_EQ(draft.text(), text);
}

TEST(DrivesDraft, AddsAKeyThatIsMissing) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  DrivesDraft draft(Replaced(text, "direction = 1 ", "# no direction "), "draft.toml");
  draft.SetInteger(0, "direction", -1);
  draft.Check();
  EXPECT_EQ(JointOf(draft.config().drives[0].config).direction, -1);
  EXPECT_EQ(JointOf(draft.config().drives[1].config).direction, 1);
}

TEST(DrivesDraft, InAnotherFolderItsDataSheetsAreTheSame) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  DrivesDraft draft(text, "folder/draft.toml");
  draft.SetText(0, "eds", "sheets/a.eds");  // (No key of this protocol: it is not read again.)
  draft.SetText(1, "eds", "/elsewhere/b.eds");
  EXPECT_EQ(draft.TextFor("folder/other.toml"), draft.text());
  const std::string moved = draft.TextFor("written/other.toml");
  EXPECT_THAT(moved, HasSubstr("eds = \"../folder/sheets/a.eds\""));
  EXPECT_THAT(moved, HasSubstr("eds = \"/elsewhere/b.eds\""));
}

TEST(DrivesDraft, AHalfDoneFileSaysWhatIsLeftAndOnlyTheBenchReadsIt) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  DrivesDraft draft(text, "draft.toml");
  draft.SetUnfinished("zero of \"leg2\" # not set");
  draft.Check();
  EXPECT_EQ(draft.config().unfinished, "zero of \"leg2\" # not set");
  try {
    static_cast<void>(ParseDrives(draft.text(), "d.toml"));
    FAIL() << "was accepted";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("d.toml:4: unfinished: says 'zero of \"leg2\" # not set'"));
    EXPECT_THAT(error.what(), HasSubstr("finish it with tumbler bench BUS commission"));
    EXPECT_THAT(error.what(), HasSubstr("or remove this key"));
  }
  // Another draft begins with it; what is left changes, and goes.
  DrivesDraft again(draft.text(), "draft.toml");
  again.SetUnfinished("steps");
  again.Check();
  EXPECT_EQ(again.config().unfinished, "steps");
  again.SetUnfinished("");
  again.Check();
  EXPECT_EQ(again.text(), text);
  EXPECT_EQ(ParseDrives(again.text(), "d.toml").drives.size(), 2U);
}

TEST(DrivesDraft, AnUnfinishedThatCannotBeReplacedLineByLineIsRefused) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  for (const std::string key : {"unfinished = \"\"\"\nzeros\"\"\"", "\"unfinished\" = 'zeros'"}) {
    DrivesDraft draft(Replaced(text, "version = 1", "version = 1\n" + key), "draft.toml");
    EXPECT_EQ(draft.config().unfinished, "zeros");
    EXPECT_THROW(draft.SetUnfinished(""), FileError) << key;
  }
}

TEST(BenchJudgement, AWayOfAnotherLengthOrAnotherPlaceIsAFinding) {
  const BenchJoint joint{"leg1", -2.9, 2.9, 0};
  EXPECT_THAT(JudgeWay(joint, {true, -2.85, 2.95}, {}), IsEmpty());
  EXPECT_EQ(JudgeWay(joint, {true, -2.6, 3.2}, {}).size(), 1U);
  EXPECT_THAT(JudgeWay(joint, {true, -1.45, 1.45}, {}).at(0).text, HasSubstr("0.50 times the way"));
  EXPECT_EQ(JudgeWay(joint, {false, -2.9, 2.9}, {}).size(), 1U);
}

TEST(BenchJudgement, PositionsThatADriveCannotReachOrReportAreFindings) {
  DrivesConfig drives = DefaultDrives({"leg1"});
  auto& mit = std::get<MitConfig>(drives.drives[0].config);
  mit.joint.gear_ratio = 6;  // 12.5 rad of the shaft are 2.08 rad of the joint
  EXPECT_EQ(JudgeRanges("drive", drives.drives[0], {"leg1", -2.9, 2.9, 0}).size(), 2U);
  mit.joint.gear_ratio = 1;
  EXPECT_THAT(JudgeRanges("drive", drives.drives[0], {"leg1", -2.9, 2.9, 0}), IsEmpty());
}

class BenchProgram : public ::testing::Test {
 protected:
  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  const std::string drives_ = testing::SourcePath("primitives/robots/tumbler_drives.toml");
  const std::string motion_ = testing::SourcePath("primitives/nominal/handstand.toml");

 private:
  testing::TemporaryFolder folder_;
};

TEST_F(BenchProgram, RefusesToMoveMotorsWithoutArm) {
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler bench", "can99", "jog", "leg1", "--drives", drives_});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("say so with --arm"));
}

TEST_F(BenchProgram, DoesNotReplaceAFileUnlessItIsTold) {
  testing::WriteFile(Path("written.toml"), "precious");
  std::vector<std::string> arguments{"tumbler bench", "sim",   "zero",
                                     "--drives",      drives_, "--motion",
                                     motion_,         "--out", Path("written.toml")};
  testing::Outcome outcome = testing::RunProgram(arguments);
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("is there already"));
  EXPECT_EQ(testing::ReadFile(Path("written.toml")), "precious");
  arguments.emplace_back("--overwrite");
  outcome = testing::RunProgram(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_EQ(LoadDrives(Path("written.toml")).drives.size(), 2U);
}

TEST_F(BenchProgram, NoZeroIsWrittenOfADriveThatHasFallenSilent) {
  testing::WriteFile(Path("faults.toml"),
                     "format = \"tumbler-bus-faults\"\nversion = 1\n"
                     "[[fault]]\nkind = \"disconnect\"\nnode = \"leg1\"\nstart_s = 0.02\n");
  const std::vector<std::string> bench{"tumbler bench",     "sim",      "--bus-faults",
                                       Path("faults.toml"), "--drives", drives_,
                                       "--motion",          motion_};
  for (const std::string command : {"zero", "read"}) {
    std::vector<std::string> arguments = bench;
    arguments.push_back(command);
    if (command == "zero") {
      arguments.emplace_back("--out");
      arguments.push_back(Path("written.toml"));
    }
    const testing::Outcome outcome = testing::RunProgram(arguments);
    EXPECT_EQ(outcome.exit_code, 3) << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr("(leg1) has not replied for"));
  }
  EXPECT_FALSE(std::filesystem::exists(Path("written.toml")));
}

TEST_F(BenchProgram, ADriveGetsAnotherZeroOnlyWhenArmedWithAFileToWriteAndAnAngle) {
  const auto zero = [&](const std::string& bus, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"tumbler bench", bus,        "zero",
                                       "--in-drive",    "--drives", drives_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return testing::RunProgram(arguments);
  };
  testing::Outcome outcome = zero("can99", {"--at", "0", "--out", Path("written.toml")});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("say so with --arm"));
  outcome = zero("sim", {"--at", "0"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("--out"));
  for (const std::string at : {"nan", "inf", "1e5"}) {
    outcome = zero("sim", {"--at", at, "--out", Path("written.toml")});
    EXPECT_EQ(outcome.exit_code, 1) << at;
    EXPECT_THAT(outcome.text, HasSubstr("--at"));
  }
  outcome = zero("sim", {"--at", "0.2", "--out", Path("written.toml")});
  EXPECT_THAT(outcome.text, HasSubstr("holds no longer"));
  EXPECT_NEAR(JointOf(LoadDrives(Path("written.toml")).drives[1].config).zero_offset_rad, 0.2F,
              0.01F);
}

TEST_F(BenchProgram, WhenASecondDriveKeepsItsZeroTheFirstOnesNewZeroIsWritten) {
  testing::WriteFile(Path("answers"), "yes\nyes\nyes\nno\n");
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler bench", "sim", "zero", "--in-drive", "--drives", drives_, "--at", "0.2", "--out",
       Path("written.toml"), "--answers", Path("answers")});
  EXPECT_EQ(outcome.exit_code, 2) << outcome.text;
  ASSERT_TRUE(std::filesystem::exists(Path("written.toml"))) << outcome.text;
  const DrivesConfig written = LoadDrives(Path("written.toml"));
  EXPECT_NEAR(JointOf(written.drives[0].config).zero_offset_rad, 0.2F, 0.01F);
  EXPECT_EQ(JointOf(written.drives[1].config).zero_offset_rad, 0);
}

TEST_F(BenchProgram, WhenAnswersRunOutItStopsAndSaysSo) {
  testing::WriteFile(Path("answers"), "yes # the way is clear\n");
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler bench", "sim", "identify", "--drives", drives_, "--answers", Path("answers")});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("has no answer to this"));
}

TEST_F(BenchProgram, StandardInputAnswersAndTellsWhoTurned) {
  const testing::Outcome outcome = testing::RunInShell(
      "printf 'yes\\nleg1\\nyes\\nleg2\\n' | tumbler bench sim identify --ask --drives " + drives_);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("(You see leg1 turn by +0.0"));
  EXPECT_THAT(outcome.text, HasSubstr("Nothing is amiss of what was judged:"));
}

TEST_F(BenchProgram, ACommissioningThatIsInterruptedLeavesAFileThatNothingElseUses) {
  testing::WriteFile(Path("answers"), "yes\nleg1\nyes\nyes\nleg2\nyes\n");  // none for the zeros
  const testing::Outcome bench = testing::RunProgram(
      {"tumbler bench", "sim", "commission", "--drives", drives_, "--motion", motion_, "--out",
       Path("written.toml"), "--seconds", "1", "--answers", Path("answers")});
  EXPECT_EQ(bench.exit_code, 2) << bench.text;
  const std::string left = "commissioning has left to do: zeros, ways, scales, watchdogs, steps";
  EXPECT_THAT(testing::ReadFile(Path("written.toml")),
              HasSubstr("\nunfinished = \"" + left + "\"\n"));
  const testing::Outcome run =
      testing::RunProgram({"tumbler run", "sim", motion_, "--drives", Path("written.toml")});
  EXPECT_EQ(run.exit_code, 1) << run.text;
  EXPECT_THAT(run.text, HasSubstr(left));
  EXPECT_THAT(run.text, HasSubstr("finish it with tumbler bench BUS commission"));
  const testing::Outcome again =
      testing::RunProgram({"tumbler bench", "sim", "read", "--drives", Path("written.toml")});
  EXPECT_EQ(again.exit_code, 0) << again.text;
}

TEST_F(BenchProgram, TellsWhichInertiaADrivesDampingTakesWhereItsLoopIsKnown) {
  const auto told = [&](const std::string& drives) {
    return testing::RunProgram({"tumbler bench", "sim", "read", "--drives", drives}).text;
  };
  EXPECT_THAT(told(drives_), HasSubstr("(leg1): whether its kd of 5 N m s/rad is stable in the "
                                       "drive's own loop, whose rate is not known (loop_hz)"));
  testing::WriteFile(Path("fast.toml"),
                     testing::ReplacedAll(testing::ReadFile(drives_), "temperature_max_c",
                                          "loop_hz = 10000\ntemperature_max_c"));
  EXPECT_THAT(told(Path("fast.toml")),
              HasSubstr("in the drive's own loop of 10 kHz: above a least inertia of 0.00025 kg"));
}

TEST_F(BenchProgram, RefusesWhatWouldExceedItsBounds) {
  for (const std::vector<std::string>& options :
       std::vector<std::vector<std::string>>{{"jog", "leg1", "--by", "0.2"},
                                             {"step", "leg1", "--size", "0.2"},
                                             {"step", "leg1", "--kp", "100"},
                                             {"jog", "leg1", "--velocity", "nan"},
                                             {"jog", "leg3"},
                                             {"jog"}}) {
    std::vector<std::string> arguments{"tumbler bench", "sim", "--drives", drives_};
    arguments.insert(arguments.end(), options.begin(), options.end());
    EXPECT_EQ(testing::RunProgram(arguments).exit_code, 1) << ::testing::PrintToString(options);
  }
}

}  // namespace
}  // namespace tumbler
