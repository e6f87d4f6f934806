#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "common/files/toml_reader.h"
#include "firmware_interface/devices/drive_traffic.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

const std::string kShipped = testing::SourcePath("primitives/robots/tumbler_drives.toml");
const std::string kShippedCanSimple =
    testing::SourcePath("primitives/robots/tumbler_drives_cansimple.toml");
const std::string kShippedCia402 =
    testing::SourcePath("primitives/robots/tumbler_drives_cia402.toml");
const std::string kShippedAkV3 = testing::SourcePath("primitives/robots/tumbler_drives_akv3.toml");

std::string ShippedText(const std::string& path = kShipped) { return testing::ReadFile(path); }

std::string Mutate(const std::string& text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << "the file holds no " << from;
  if (at == std::string::npos) return text;
  return text.substr(0, at) + to + text.substr(at + from.size());
}

std::string NamesOfProtocols() {
  std::string names;
  for (const std::string_view name : DriveProtocols::kNames) {
    if (!names.empty()) names += ", ";
    names += name;
  }
  return names;
}

TEST(DrivesToml, ShippedFileDescribesTheTumbler) {
  const DrivesConfig config = LoadDrives(kShipped);
  EXPECT_EQ(config.bit_rate, 1'000'000);
  EXPECT_EQ(config.rate_hz, 1000);
  ASSERT_EQ(config.drives.size(), 2U);
  EXPECT_EQ(config.drives[0].joint, "leg1");
  EXPECT_EQ(config.drives[1].joint, "leg2");
  for (std::size_t i = 0; i < 2; ++i) {
    const DriveEntry& drive = config.drives[i];
    const MitConfig& mit = std::get<MitConfig>(drive.config);
    EXPECT_EQ(mit.command_id, i + 1);
    EXPECT_EQ(mit.reply_id, i + 17);
    EXPECT_EQ(drive.kp_nm_per_rad, 40);
    EXPECT_EQ(drive.kd_nm_s_per_rad, 5);
    EXPECT_EQ(mit.command.position_rad.max, 12.5F);
    EXPECT_EQ(mit.command.velocity_rad_s.min, -50);
    EXPECT_EQ(mit.command.torque_nm.max, 18);
    EXPECT_EQ(mit.reply.torque_nm.max, 18);
    EXPECT_EQ(drive.watchdog_s, 0.025);
    EXPECT_EQ(mit.Validate(), Status::kOk);
  }
  EXPECT_EQ(config.WorstCaseTickBits(), 540);
  EXPECT_DOUBLE_EQ(config.WorstCaseLoad(), 0.54);
}

TEST(DrivesToml, AModelGivesRangesAndDialectWhereTheFileDoesNot) {
  const std::string shipped = testing::ReadFile(kShipped);
  const std::string text =
      Mutate(Mutate(shipped, "reply_id = 17", "model = \"DM4310\"\nreply_id = 1"),
             "torque_nm = [-18.0, 18.0]", "");
  const DrivesConfig config = ParseDrives(text, "d.toml");
  const MitConfig& mit = std::get<MitConfig>(config.drives[0].config);
  EXPECT_EQ(mit.dialect, MitDialect::kDamiao);
  EXPECT_EQ(mit.command.torque_nm.max, 10) << "of the model";
  EXPECT_EQ(mit.reply.torque_nm.min, -10);
  EXPECT_EQ(mit.command.velocity_rad_s.max, 50) << "the file's own";
  EXPECT_EQ(mit.reply_id, mit.command_id) << "it answers on its own identifier";
  EXPECT_EQ(std::get<MitConfig>(config.drives[1].config).dialect, MitDialect::kMiniCheetah);
}

TEST(DrivesToml, WhatIsSaidOfAMotorIsReadOfEachDriveAndSimulated) {
  const std::string leg = "joint = \"leg1\"";
  const std::string text = Mutate(
      ShippedText(), leg,
      leg + "\ntorque_factor = 1.1\ntorque_time_constant_s = 0.001\nvelocity_filter_s = 0.003");
  const DrivesConfig config = ParseDrives(text, "drives.toml");
  EXPECT_EQ(config.drives[0].motor, (MotorFacts{1.1, 0.001, 0.003}));
  EXPECT_EQ(config.drives[1].motor, MotorFacts{});
  const SimulatedMotorConfig motor = MotorOf(config.drives[0]);
  EXPECT_EQ(motor.torque_factor, 1.1);
  EXPECT_EQ(motor.torque_time_constant_s, 0.001);
  EXPECT_EQ(motor.velocity_filter_s, 0.003);
  for (const std::string wrong :
       {"torque_factor = 0.0", "torque_time_constant_s = -0.1", "velocity_filter_s = 3.0"}) {
    try {
      ParseDrives(Mutate(ShippedText(), leg, fmt::format("{}\n{}", leg, wrong)), "drives.toml");
      ADD_FAILURE() << wrong;
    } catch (const FileError& error) {
      const std::string said = error.what();
      EXPECT_NE(said.find(wrong.substr(0, wrong.find(' '))), std::string::npos) << said;
      EXPECT_NE(said.find("allowed"), std::string::npos) << said;
    }
  }
}

TEST(DrivesToml, ShippedFilesDescribeTheTumblerInEveryProtocol) {
  const DrivesConfig can = LoadDrives(kShippedCanSimple);
  ASSERT_EQ(can.drives.size(), 2U);
  const auto& second = std::get<CanSimpleConfig>(can.drives[1].config);
  EXPECT_EQ(second.node_id, 2);
  EXPECT_EQ(second.heartbeat_ticks_max, 46) << "three and a half heartbeats of 10 ms, and 10 ms";
  EXPECT_EQ(second.estimates_per_tick_max, 2) << "one a tick, and one for drift";
  EXPECT_EQ(second.range.torque_nm.max, 18);
  // Each of the two drives has setpoint and estimate in each tick, heartbeat and torques in every
  // 10th, and temperature in every 100th. Each frame has 135 bits.
  EXPECT_EQ(can.WorstCaseTickBits(), static_cast<int>(std::ceil(2 * 135 * (2 + 0.2 + 0.01))));

  const DrivesConfig cia402 = LoadDrives(kShippedCia402);
  ASSERT_EQ(cia402.drives.size(), 2U);
  const auto& first = std::get<Cia402Config>(cia402.drives[0].config);
  EXPECT_EQ(first.period_us, 1000U);
  EXPECT_EQ(first.heartbeat_ms, 100);
  EXPECT_EQ(first.watchdog_ms, 25);
  EXPECT_EQ(first.watchdog_reaction, 1);
  EXPECT_EQ(first.velocity_units_per_turn_s, 65536);
  EXPECT_TRUE(first.feed_forward);
  // SYNC has 55 bits, PDOs of 6 bytes have 115, heartbeats of 1 byte have 65.
  EXPECT_EQ(cia402.WorstCaseTickBits(),
            static_cast<int>(std::ceil(55 + 65 / 8.0 + 2 * (115 * 3.25 + 65 / 100.0))));
  for (const DrivesConfig& config : {can, cia402}) {
    for (const DriveEntry& drive : config.drives) {
      EXPECT_EQ(Validate(drive.config), Status::kOk);
      EXPECT_EQ(drive.kp_nm_per_rad, 40);
      EXPECT_EQ(drive.watchdog_s, 0.025);
    }
  }
}

TEST(DrivesToml, TheExampleOfEveryProtocolHasTheDrivesThatTheCoreHas) {
  DriveProtocols::ForEach([](auto protocol) {
    using Protocol = decltype(protocol);
    SCOPED_TRACE(Protocol::kId);
    const DrivesConfig config =
        LoadDrives(testing::SourcePath("primitives/robots/" + std::string(Protocol::kExample)));
    ASSERT_EQ(config.drives.size(), 2U);
    for (int i = 0; i < 2; ++i) {
      const DriveEntry& entry = config.drives[static_cast<std::size_t>(i)];
      EXPECT_EQ(entry.joint, "leg" + std::to_string(i + 1));
      ASSERT_TRUE(std::holds_alternative<typename Protocol::Config>(entry.config));
      const auto& read = std::get<typename Protocol::Config>(entry.config);
      const typename Protocol::Config example = Protocol::Example(i);
      EXPECT_EQ(Protocol::TrafficOf(entry, read, 1000).host_sends,
                Protocol::TrafficOf(entry, example, 1000).host_sends);
      // The same requests go out in the same bytes.
      typename Protocol::Host first(read);
      typename Protocol::Host second(example);
      for (int tick = 0; tick < 10; ++tick) {
        FrameBatch one, other;
        ASSERT_EQ(first.Encode(DriveRequest::kEnable, {0.1F, 0, 0, 10, 1}, one), Status::kOk);
        ASSERT_EQ(second.Encode(DriveRequest::kEnable, {0.1F, 0, 0, 10, 1}, other), Status::kOk);
        EXPECT_TRUE(std::ranges::equal(one.frames(), other.frames()));
      }
    }
  });
}

TEST(DrivesToml, EveryProtocolHasAPageThatSaysWhatIsTrueOfIt) {
  DriveProtocols::ForEach([](auto protocol) {
    using Protocol = decltype(protocol);
    const std::string page = testing::ReadFile(
        testing::SourcePath("docs/protocols/" + std::string(Protocol::kId) + ".md"));
    const std::string example = "primitives/robots/" + std::string(Protocol::kExample);
    EXPECT_THAT(page,
                HasSubstr("`protocol = \"" + std::string(Protocol::kName) + "\"`; `" + example));
    const DrivesConfig drives = LoadDrives(testing::SourcePath(example));
    const std::string rate =
        drives.rate_hz == 1000 ? "1 kHz" : fmt::format("{} Hz", drives.rate_hz);
    EXPECT_THAT(page, HasSubstr(fmt::format("| two drives at {}, worst case | {} bits a tick |",
                                            rate, drives.WorstCaseTickBits())));
    EXPECT_TRUE(std::filesystem::exists(
        testing::SourcePath("firmware_interface/devices/dbc/" + std::string(Protocol::kDbc))));
  });
}

TEST(DrivesToml, TheTablesOfTheDocumentsAreThoseOfTheCode) {
  testing::ExpectTables("docs/formats.md", {DrivesKeyTable()});
  DriveProtocols::ForEach([](auto protocol) {
    using Protocol = decltype(protocol);
    testing::ExpectTables("docs/protocols/" + std::string(Protocol::kId) + ".md",
                          {Protocol::Keys()});
  });
}

TEST(DrivesToml, OfAkV3TheModelGivesWhatTheFileDoesNot) {
  const DrivesConfig drives =
      ParseDrives(Mutate(ShippedText(kShippedAkV3), "model = \"AK80-9\"",
                         "model = \"AK60-6\"\ngear_inside = 5\nrange.torque_nm = [-9, 9]"),
                  "d.toml");
  const AkV3Config& first = std::get<AkV3Config>(drives.drives[0].config);
  EXPECT_EQ(first.node_id, 1);
  EXPECT_EQ(first.pole_pairs, 14);
  EXPECT_EQ(first.gear_inside, 5);
  EXPECT_EQ(first.range.torque_nm.max, 9);
  EXPECT_EQ(first.range.velocity_rad_s.max, 60);
  EXPECT_EQ(first.range.position_rad.min, -12.56F);
  const AkV3Config& second = std::get<AkV3Config>(drives.drives[1].config);
  EXPECT_EQ(second.range.velocity_rad_s.max, 65);
  EXPECT_EQ(second.status_per_tick_max, 2) << "one a tick, and one for drift";
  EXPECT_EQ(second.torque_constant_nm_per_a, 0.57F);
}

TEST(DrivesToml, IdentifiersOf29BitsAreOthersThanThoseOf11AndTakeLonger) {
  // The MIT drive's identifiers are numbers that the other drive uses in 29 bits.
  const std::string ak = ShippedText(kShippedAkV3);
  const std::string mit = ShippedText();
  const std::string text = ak.substr(0, ak.find("[[drive]]\njoint = \"leg2\"")) +
                           Mutate(Mutate(mit.substr(mit.find("[[drive]]\njoint = \"leg2\"")),
                                         "reply_id = 18", "reply_id = 0x301"),
                                  "command_id = 2", "command_id = 1");
  const DrivesConfig mixed = ParseDrives(text, "d.toml");
  EXPECT_EQ(mixed.WorstCaseTickBits(), 2 * 160 + 2 * 135);
  EXPECT_EQ(mixed.LongestFrameBits(), 160);
  EXPECT_EQ(LoadDrives(kShipped).LongestFrameBits(), 135);
  EXPECT_THAT(mixed.HostSends(), ::testing::IsSupersetOf({CanId(0x801, true), CanId(1)}));
  EXPECT_THAT(mixed.HostReceives(), ::testing::ElementsAre(CanId(0x2901, true), CanId(0x301)));
  EXPECT_EQ(mixed.DescribeSchedule(),
            "1 setpoints of 8 bytes with 29-bit identifiers, 1 reports of 8 bytes with 29-bit "
            "identifiers, 1 setpoints of 8 bytes, 1 replies of 8 bytes");
}

TEST(DrivesToml, OneFileHoldsAnyMixtureOfProtocols) {
  // The second MIT drive takes the place of the second ODrive.
  const std::string can = ShippedText(kShippedCanSimple);
  const std::string mit = ShippedText();
  const std::string mixed =
      can.substr(0, can.find("[[drive]]\njoint = \"leg2\"")) +
      Mutate(mit.substr(mit.find("[[drive]]\njoint = \"leg2\"")), "reply_id = 18", "reply_id = 20");
  const DrivesConfig config = ParseDrives(mixed, "d.toml");
  ASSERT_EQ(config.drives.size(), 2U);
  EXPECT_TRUE(std::holds_alternative<CanSimpleConfig>(config.drives[0].config));
  EXPECT_TRUE(std::holds_alternative<MitConfig>(config.drives[1].config));
}

struct ProtocolRefusal {
  const char* name;
  const std::string* file;
  std::string from;
  std::string to;
  std::vector<std::string> fragments;
};

class ProtocolRefusals : public ::testing::TestWithParam<ProtocolRefusal> {};

TEST_P(ProtocolRefusals, NamesFileLineKeyAndCause) {
  const ProtocolRefusal& refusal = GetParam();
  try {
    ParseDrives(Mutate(ShippedText(*refusal.file), refusal.from, refusal.to), "d.toml");
    FAIL() << "was accepted";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), MatchesRegex("d\\.toml:[0-9]+: .+"));
    for (const std::string& fragment : refusal.fragments)
      EXPECT_THAT(error.what(), HasSubstr(fragment));
  }
}

INSTANTIATE_TEST_SUITE_P(
    DrivesToml, ProtocolRefusals,
    ::testing::Values(
        ProtocolRefusal{"AkV3RateBeyondTheReports",
                        &kShippedAkV3,
                        "rate_hz = 500.0",
                        "rate_hz = 2500.0",
                        {"drive[0].status_s: is 0.002, 5 ticks", "or lower rate_hz"}},
        ProtocolRefusal{"AkV3RateBeyondTheBus",
                        &kShippedAkV3,
                        "bit_rate = 1_000_000",
                        "bit_rate = 250_000",
                        {"bus.rate_hz: is 500", "640 bits", "250000 bit/s allow at most 390 Hz"}},
        ProtocolRefusal{"AkV3Model",
                        &kShippedAkV3,
                        "model = \"AK80-9\"",
                        "model = \"AK80-8\"",
                        {"drive[0].model: is 'AK80-8'", "AK10-9, AK60-6, AK80-9"}},
        ProtocolRefusal{"AkV3WithoutModel",
                        &kShippedAkV3,
                        "model = \"AK80-9\"",
                        "",
                        {"drive[0].pole_pairs: is missing"}},
        ProtocolRefusal{"AkV3IdTwice",
                        &kShippedAkV3,
                        "drive_id = 2",
                        "drive_id = 1",
                        {"drive[1].drive_id: is 1", "the frames 0x00000001", "'leg1'"}},
        ProtocolRefusal{"AkV3ReportsTooOften",
                        &kShippedAkV3,
                        "status_s = 0.002",
                        "status_s = 0.001",
                        {"drive[0].status_s: is 0.001; allowed: from 0.002 ... 0.1"}},
        ProtocolRefusal{"AkV3ReportsTooRare",
                        &kShippedAkV3,
                        "status_s = 0.002",
                        "status_s = 0.01",
                        {"drive[0].status_s: is 0.01, 5 ticks", "at most 4", "feedback rate"}},
        ProtocolRefusal{"AkV3GainBeyondTheWire",
                        &kShippedAkV3,
                        "kp_nm_per_rad = 40.0",
                        "kp_nm_per_rad = 501.0",
                        {"drive[0].kp_nm_per_rad: is 501", "at most 500"}},
        ProtocolRefusal{"CanSimpleNode",
                        &kShippedCanSimple,
                        "node_id = 1 ",
                        "node_id = 63 ",
                        {"drive[0].node_id: is 63; allowed: from 0 ... 62"}},
        ProtocolRefusal{"CanSimpleNodeTwice",
                        &kShippedCanSimple,
                        "node_id = 2",
                        "node_id = 1",
                        {"drive[1].node_id: is 1", "0x020", "'leg1'"}},
        ProtocolRefusal{"CanSimpleVelocityBeyondTheWire",
                        &kShippedCanSimple,
                        "velocity_rad_s = [-50.0, 50.0]",
                        "velocity_rad_s = [-210.0, 210.0]",
                        {"drive[0].range.velocity_rad_s: is [-210, 210]", "205.88"}},
        ProtocolRefusal{"CanSimpleEstimatesTooRare",
                        &kShippedCanSimple,
                        "estimates_s = 0.001",
                        "estimates_s = 0.01",
                        {"drive[0].estimates_s: is 0.01, 10 ticks", "at most 4"}},
        ProtocolRefusal{"CanSimpleTorquesTooOften",
                        &kShippedCanSimple,
                        "torques_s = 0.01",
                        "torques_s = 0.0001",
                        {"drive[0].torques_s: is 0.0001", "0 (not sent)"}},
        ProtocolRefusal{"CanSimpleWithoutGain",
                        &kShippedCanSimple,
                        "kp_nm_per_rad = 40.0",
                        "kp_nm_per_rad = 0.0",
                        {"drive[0].kp_nm_per_rad: is 0"}},
        ProtocolRefusal{"CanSimpleHasNoCommandId",
                        &kShippedCanSimple,
                        "direction = 1 ",
                        "command_id = 1 ",
                        {"drive[0].command_id: is not a key"}},
        ProtocolRefusal{"Cia402Node",
                        &kShippedCia402,
                        "node_id = 1 ",
                        "node_id = 127 ",
                        {"drive[0].node_id: is 127; allowed: from 1 ... 126"}},
        ProtocolRefusal{"Cia402NodeTwice",
                        &kShippedCia402,
                        "node_id = 2",
                        "node_id = 1",
                        {"drive[1].node_id: is 1", "'leg1'"}},
        ProtocolRefusal{"Cia402TwoHosts",
                        &kShippedCia402,
                        "host_id = 127 ",
                        "host_id = 126 ",
                        {"drive[1].host_id: is 127", "is 126; there is one host"}},
        ProtocolRefusal{"Cia402HostIsADrive",
                        &kShippedCia402,
                        "host_id = 127 ",
                        "host_id = 1 ",
                        {"drive[0].host_id: is 1, as node_id"}},
        ProtocolRefusal{"Cia402Rate",
                        &kShippedCia402,
                        "rate_hz = 1000.0",
                        "rate_hz = 600.0",
                        {"bus.rate_hz: is 600", "500, 400 or 250 Hz"}},
        ProtocolRefusal{"Cia402RateBeyondTheBus",
                        &kShippedCia402,
                        "rate_hz = 1000.0",
                        "rate_hz = 1250.0",
                        {"bus.rate_hz: is 1250", "at most"}},
        ProtocolRefusal{"Cia402Torque",
                        &kShippedCia402,
                        "rated_torque_nm = 6.0",
                        "rated_torque_nm = 0.5",
                        {"drive[0].range.torque_nm: is [-18, 18]", "at most +-16.38"}},
        ProtocolRefusal{"Cia402Watchdog",
                        &kShippedCia402,
                        "watchdog_s = 0.025",
                        "watchdog_s = 0.002",
                        {"drive[0].watchdog_s: is 0.002", "3 periods"}},
        ProtocolRefusal{"Cia402WatchdogsDiffer",
                        &kShippedCia402,
                        "watchdog_s = 0.025",
                        "watchdog_s = 0.05",
                        {"drive[1].watchdog_s: is not that of joint 'leg1'"}},
        ProtocolRefusal{"Cia402Reaction",
                        &kShippedCia402,
                        "\"fault\"",
                        "\"limp\"",
                        {"drive[0].watchdog_reaction: is 'limp'; allowed: none, fault, disable"}},
        ProtocolRefusal{
            "Cia402MayLackWhatItNeeds",
            &kShippedCia402,
            "watchdog_s = 0.025",
            "may_lack = [\"1016h\"]\nwatchdog_s = 0.025",
            {"drive[0].may_lack", "'1016h' is no object that a drive may lack", "60C2h"}},
        ProtocolRefusal{"Cia402MayLackItsReaction",
                        &kShippedCia402,
                        "watchdog_s = 0.025",
                        "may_lack = [\"60C2h\", \"6007h\"]\nwatchdog_s = 0.025",
                        {"drive[0].may_lack", "6007h", "watchdog_s = 0"}}),
    [](const auto& instance) { return instance.param.name; });

TEST(DrivesToml, ReadsOptionalKeys) {
  std::string text = Mutate(ShippedText(), "  [drive.range]",
                            "  [drive.reply_range]\n  torque_nm = [-20.0, 20.0]\n  [drive.range]");
  text = Mutate(text, "direction = 1 ", "direction = -1 ");
  text = Mutate(text, "gear_ratio = 1.0 ", "gear_ratio = 1.5 ");
  text = Mutate(text, "\"signed\"", "\"offset-40\"");
  const DrivesConfig config = ParseDrives(text, "d.toml");
  EXPECT_EQ(std::get<MitConfig>(config.drives[0].config).reply.torque_nm.max, 20);
  EXPECT_EQ(std::get<MitConfig>(config.drives[0].config).command.torque_nm.max, 18);
  EXPECT_EQ(std::get<MitConfig>(config.drives[0].config).reply.position_rad.max, 12.5F);
  EXPECT_EQ(std::get<MitConfig>(config.drives[0].config).joint.direction, -1);
  EXPECT_EQ(std::get<MitConfig>(config.drives[0].config).joint.gear_ratio, 1.5F);
  EXPECT_EQ(std::get<MitConfig>(config.drives[0].config).temperature_encoding,
            MitTemperature::kOffset40);
  EXPECT_EQ(std::get<MitConfig>(config.drives[1].config).temperature_encoding,
            MitTemperature::kSigned);
}

TEST(DrivesToml, RateAtTheCeilingOfTheBusIsAccepted) {
  EXPECT_EQ(
      ParseDrives(Mutate(ShippedText(), "rate_hz = 1000.0", "rate_hz = 1851"), "d.toml").rate_hz,
      1851);
}

struct Refusal {
  const char* name;
  std::string from;
  std::string to;
  std::vector<std::string> fragments;
};

class DrivesRefusal : public ::testing::TestWithParam<Refusal> {};

TEST_P(DrivesRefusal, NamesFileLineKeyAndCause) {
  const Refusal& refusal = GetParam();
  try {
    ParseDrives(Mutate(ShippedText(), refusal.from, refusal.to), "d.toml");
    FAIL() << "was accepted";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), MatchesRegex("d\\.toml:[0-9]+: .+"));
    for (const std::string& fragment : refusal.fragments)
      EXPECT_THAT(error.what(), HasSubstr(fragment));
  }
}

INSTANTIATE_TEST_SUITE_P(
    DrivesToml, DrivesRefusal,
    ::testing::Values(
        Refusal{"Format", "tumbler-drives", "tumbler-motors", {"format: is not 'tumbler-drives'"}},
        Refusal{"Version", "version = 1", "version = 2", {"version: is 2; allowed: from 1 ... 1"}},
        Refusal{"HalfDone",
                "version = 1",
                "version = 1\nunfinished = \"zero of leg2 not set\"",
                {"unfinished: says 'zero of leg2 not set'", "tumbler bench BUS commission"}},
        Refusal{"HalfDoneWithoutReason",
                "version = 1",
                "version = 1\nunfinished = \"\"",
                {"unfinished: is empty"}},
        Refusal{"BitRate",
                "bit_rate = 1_000_000",
                "bit_rate = 2_000_000",
                {"bus.bit_rate: is 2000000; allowed: from 10000 ... 1000000"}},
        Refusal{"RateZero",
                "rate_hz = 1000.0",
                "rate_hz = 0.0",
                {"bus.rate_hz: is 0; allowed: from 10 ... 10000"}},
        Refusal{"RateBeyondTheBus",
                "rate_hz = 1000.0",
                "rate_hz = 1852.0",
                {"bus.rate_hz: is 1852", "540 bits", "at most 1851 Hz"}},
        Refusal{"SlowBus",
                "bit_rate = 1_000_000",
                "bit_rate = 500_000",
                {"bus.rate_hz: is 1000", "500000 bit/s allow at most 925 Hz"}},
        Refusal{"NoJoint", "joint = \"leg1\"", "", {"drive[0].joint: is missing"}},
        Refusal{"EmptyJoint",
                "joint = \"leg1\"",
                "joint = \"\"",
                {"drive[0].joint: is ''; allowed: 1 to 32 bytes"}},
        Refusal{"Protocol",
                "protocol = \"mit\"",
                "protocol = \"odrive\"",
                {"drive[0].protocol: is 'odrive'; allowed: " + NamesOfProtocols()}},
        Refusal{"NoProtocol", "protocol = \"mit\"", "", {"drive[0].protocol: is missing"}},
        Refusal{"CommandIdZero",
                "command_id = 1 ",
                "command_id = 0 ",
                {"drive[0].command_id: is 0; allowed: from 1 ... 255"}},
        Refusal{"ReplyIdTooLarge",
                "reply_id = 17",
                "reply_id = 2048",
                {"drive[0].reply_id: is 2048; allowed: from 0 ... 2047"}},
        Refusal{"ReplyOnTheCommandOfAnother",
                "reply_id = 17",
                "reply_id = 2",
                {"drive[1].command_id: is 2, which is the reply_id of joint 'leg1'"}},
        Refusal{"UnknownModel",
                "reply_id = 17",
                "reply_id = 17\nmodel = \"AK8\"",
                {"drive[0].model: is 'AK8'", "AK60-6", "DM4310"}},
        Refusal{"NoRangeAndNoModel",
                "torque_nm = [-18.0, 18.0]",
                "",
                {"drive[0].range.torque_nm", "missing"}},
        Refusal{"JointTwice",
                "joint = \"leg2\"",
                "joint = \"leg1\"",
                {"drive[1].joint: is 'leg1', which another drive moves"}},
        Refusal{"CommandIdTwice",
                "command_id = 2",
                "command_id = 1",
                {"drive[1].command_id: is 1", "joint 'leg1'", "both drives would obey"}},
        Refusal{"ReplyIdTwice",
                "reply_id = 18",
                "reply_id = 17",
                {"drive[1].reply_id: is 17", "replies would collide"}},
        Refusal{"ReplyIsACommand",
                "reply_id = 18",
                "reply_id = 1",
                {"drive[1].reply_id: is 1", "its drive would obey replies"}},
        Refusal{"CommandIsAReply",
                "command_id = 2",
                "command_id = 17",
                {"drive[1].command_id: is 17", "the drive would obey replies"}},
        Refusal{"DirectionZero",
                "direction = 1 ",
                "direction = 0 ",
                {"drive[0].direction: is 0; allowed: 1 or -1"}},
        Refusal{"DirectionTwo", "direction = 1 ", "direction = 2 ", {"drive[0].direction: is 2"}},
        Refusal{"GearZero",
                "gear_ratio = 1.0 ",
                "gear_ratio = 0.0 ",
                {"drive[0].gear_ratio: is 0; allowed: from 0.001 ... 1000"}},
        Refusal{"OffsetNan",
                "zero_offset_rad = 0.0 ",
                "zero_offset_rad = nan ",
                {"drive[0].zero_offset_rad: is nan"}},
        Refusal{"KpNegative",
                "kp_nm_per_rad = 40.0",
                "kp_nm_per_rad = -1.0",
                {"drive[0].kp_nm_per_rad: is -1; allowed: >= 0"}},
        Refusal{"KpBeyondTheProtocol",
                "kp_nm_per_rad = 40.0",
                "kp_nm_per_rad = 501.0",
                {"drive[0].kp_nm_per_rad: is 501; the drive carries at most 500 at the joint"}},
        Refusal{"KdBeyondTheProtocol",
                "kd_nm_s_per_rad = 5.0",
                "kd_nm_s_per_rad = 5.5",
                {"drive[0].kd_nm_s_per_rad: is 5.5; the drive carries at most 5"}},
        Refusal{"TemperatureZero",
                "temperature_max_c = 80.0",
                "temperature_max_c = 0.0",
                {"drive[0].temperature_max_c: is 0; allowed: above 0 ... 200"}},
        Refusal{"TemperatureEncoding",
                "\"signed\"",
                "\"kelvin\"",
                {"drive[0].temperature_encoding: is 'kelvin'; allowed: signed, offset-40"}},
        Refusal{"WatchdogNegative",
                "watchdog_s = 0.025",
                "watchdog_s = -0.025",
                {"drive[0].watchdog_s: is -0.025; allowed: from 0 ... 10"}},
        Refusal{"WatchdogMissing", "watchdog_s = 0.025", "", {"drive[0].watchdog_s: is missing"}},
        Refusal{"RangeReversed",
                "position_rad = [-12.5, 12.5]",
                "position_rad = [12.5, -12.5]",
                {"drive[0].range.position_rad: is [12.5, -12.5]; the first number must be below"}},
        Refusal{"RangeWithoutZero",
                "torque_nm = [-18.0, 18.0]",
                "torque_nm = [1.0, 18.0]",
                {"drive[0].range.torque_nm: is [1, 18]; the range must contain 0"}},
        Refusal{"GainRangeFromOne",
                "kp_nm_per_rad = [0.0, 500.0]",
                "kp_nm_per_rad = [1.0, 500.0]",
                {"drive[0].range.kp_nm_per_rad: is [1, 500]; a gain's range must start at 0"}},
        Refusal{"RangeOfThree",
                "torque_nm = [-18.0, 18.0]",
                "torque_nm = [-18.0, 0.0, 18.0]",
                {"drive[0].range.torque_nm: holds 3 numbers; expected 2"}},
        Refusal{"RangeInfinite",
                "torque_nm = [-18.0, 18.0]",
                "torque_nm = [-inf, 18.0]",
                {"drive[0].range.torque_nm[0]: is -inf"}},
        Refusal{"NoRange", "[drive.range]", "[drive.ranges]", {"drive[0].range: is missing"}},
        Refusal{"UnknownKey",
                "direction = 1 ",
                "direktion = 1 ",
                {"drive[0].direktion: is not a key that this file can hold"}},
        Refusal{"UnknownBusKey",
                "rate_hz = 1000.0",
                "rate_hz = 1000.0\nrate_khz = 1",
                {"bus.rate_khz: is not a key"}}),
    [](const auto& instance) { return instance.param.name; });

TEST(DrivesToml, AMissingFileIsNamed) {
  try {
    LoadDrives("/nonexistent/drives.toml");
    FAIL();
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/nonexistent/drives.toml"));
  }
}

}  // namespace
}  // namespace tumbler
