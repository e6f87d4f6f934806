// Drives of every protocol on one simulated bus: arming, drop-outs, dialects and many at once.

#include <fmt/format.h>

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "firmware_interface/devices/error_texts.h"
#include "tests/support/fault_world.h"

namespace tumbler {
namespace {

using testing::ConfigOf;
using testing::DriveOrder;
using testing::DrivesOf;
using testing::EveryProtocol;
using testing::FaultBench;
using testing::FaultCase;
using testing::FaultWorld;
using ::testing::IsEmpty;
using testing::MakeTwoNodes;
using testing::TestedProtocol;
using testing::TwoNodes;
using Kind = DriveOrder::Kind;

/// A CANSimple drive says its errors and its positions in messages of their own.
TEST(Latched, ADriveThatReportsAnErrorAndNoPositionIsNotCalledSilent) {
  for (const TestedProtocol& protocol : EveryProtocol()) {
    if (protocol.name != std::string("cansimple")) continue;
    FaultWorld world(
        FaultCase{protocol, Fault::kNone, ExecutorState::kDisarmed, std::nullopt, std::nullopt});
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
    const FaultCase healthy{protocol, Fault::kNone, ExecutorState::kDisarmed, std::nullopt,
                            std::nullopt};
    FaultWorld world(healthy);
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

TEST(Arming, DoesNotJumpWhenTheJointIsTurnedMeanwhile) {
  for (const TestedProtocol& protocol : EveryProtocol()) {
    FaultBench::Config config;
    const TwoNodes motion = MakeTwoNodes();
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
    const TwoNodes motion = MakeTwoNodes();
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
      const TwoNodes motion = MakeTwoNodes();
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
  const TwoNodes motion = MakeTwoNodes();
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
  const TwoNodes motion = MakeTwoNodes();
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

}  // namespace
}  // namespace tumbler
