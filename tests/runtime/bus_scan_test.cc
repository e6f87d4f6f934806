// Which drives are on a bus, and what they tell of themselves.

#include "runtime/bench/bus_scan.h"

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

#include "common/files/program.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/bench_tests.h"
#include "runtime/bench/commission.h"
#include "runtime/bench/drive_reading.h"
#include "tests/support/bench_rig.h"
#include "tests/support/example_drives.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

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

}  // namespace
}  // namespace tumbler
