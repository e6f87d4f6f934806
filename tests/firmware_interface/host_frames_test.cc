// What a host takes frames for, by their identifiers. The expected answers are written out by hand
// from the sources that the protocols' pages name, for a drive with the number 5.

#include "firmware_interface/devices/host_frames.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "firmware_interface/devices/damiao_registers.h"
#include "firmware_interface/devices/drive_entry.h"
#include "firmware_interface/devices/drive_traffic.h"
#include "firmware_interface/devices/drives_toml.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

enum class Meaning : std::uint8_t {
  kNothing,  ///< Not of this drive, or not of interest: the socket need not let it through.
  kReply,    ///< The drive's, and taken.
  kOurs,     ///< Of a host, and this one sends it.
  kForeign,  ///< Of a host, and this one never sends it.
};

/// A drive with the number 5, and what frames mean to its host.
struct Case {
  std::string name;
  DriveConfig config;
  std::map<CanId, Meaning> expected;      ///< kNothing where there is no entry.
  std::array<std::uint8_t, 8> payload{};  ///< Names the drive where a payload does.
};

MitConfig MitWith(MitDialect dialect) {
  MitConfig config;
  config.command_id = 5;
  config.reply_id = 0x15;
  config.dialect = dialect;
  return config;
}

template <typename Config>
Config Numbered() {
  Config config;
  config.node_id = 5;
  return config;
}

std::vector<Case> Cases() {
  constexpr Meaning kReply = Meaning::kReply, kOurs = Meaning::kOurs, kForeign = Meaning::kForeign;
  const auto wide = [](std::uint32_t id) { return CanId(id, true); };
  std::vector<Case> cases;
  cases.push_back({"mini-cheetah",
                   MitWith(MitDialect::kMiniCheetah),
                   {{0x005, kOurs},
                    {0x015, kReply},
                    {wide(0x005), kForeign},
                    {wide(0x105), kForeign},
                    {wide(0x205), kForeign},
                    {wide(0x305), kForeign},
                    {wide(0x405), kForeign},
                    {wide(0x505), kForeign},
                    {wide(0x605), kForeign}},
                   {}});
  cases.push_back({"Damiao",
                   MitWith(MitDialect::kDamiao),
                   {{0x005, kOurs},
                    {0x015, kReply},
                    {0x105, kForeign},
                    {0x205, kForeign},
                    {0x305, kForeign},
                    {0x7ff, kForeign}},
                   {0x05, 0x00, 0x55, 0x0a}});
  cases.push_back({"AK V3",
                   Numbered<AkV3Config>(),
                   {{wide(0x005), kForeign},
                    {wide(0x105), kForeign},
                    {wide(0x205), kForeign},
                    {wide(0x305), kForeign},
                    {wide(0x405), kForeign},
                    {wide(0x505), kForeign},
                    {wide(0x605), kForeign},
                    {wide(0x705), kForeign},
                    {wide(0x805), kOurs},
                    {wide(0x2905), kReply}},
                   {}});
  cases.push_back({"CANSimple",
                   Numbered<CanSimpleConfig>(),
                   {{0x0a1, kReply},   {0x0a2, kForeign}, {0x0a3, kReply},   {0x0a4, kForeign},
                    {0x0a6, kForeign}, {0x0a7, kOurs},    {0x0a9, kReply},   {0x0ab, kOurs},
                    {0x0ac, kOurs},    {0x0ad, kOurs},    {0x0ae, kForeign}, {0x0af, kForeign},
                    {0x0b1, kForeign}, {0x0b2, kForeign}, {0x0b3, kForeign}, {0x0b5, kReply},
                    {0x0b6, kForeign}, {0x0b8, kOurs},    {0x0b9, kForeign}, {0x0ba, kForeign},
                    {0x0bb, kForeign}, {0x0bc, kReply},   {0x0bf, kForeign}},
                   {9}});
  Cia402Config cia402 = Numbered<Cia402Config>();
  cia402.host_id = 126;
  cases.push_back({"CiA 402",
                   cia402,
                   {{0x000, kOurs},
                    {0x080, kOurs},
                    {0x085, kReply},
                    {0x185, kReply},
                    {0x205, kOurs},
                    {0x285, kReply},
                    {0x305, kOurs},
                    {0x405, kForeign},
                    {0x505, kForeign},
                    {0x585, kReply},
                    {0x605, kOurs},
                    {0x705, kReply},
                    {0x77e, kOurs},
                    {0x7e5, kForeign}},
                   {0x02, 5}});
  return cases;
}

std::unique_ptr<Drive> HostOf(const DriveConfig& config) {
  return DriveProtocols::With(config, [](auto protocol, const auto& of) -> std::unique_ptr<Drive> {
    return std::make_unique<typename decltype(protocol)::Host>(of);
  });
}
DriveTraffic TrafficOf(const DriveConfig& config) {
  return DriveProtocols::With(config, [](auto protocol, const auto& of) {
    return decltype(protocol)::TrafficOf({}, of, 1000);
  });
}

bool Has(const std::vector<CanId>& ids, const CanId& id) {
  return std::ranges::find(ids, id) != ids.end();
}

/// All identifiers of 11 bits; of 29, all that name a function of up to 7 bits, and each of these
/// with one more bit.
std::vector<CanId> AllIds() {
  std::vector<CanId> ids;
  for (std::uint32_t id = 0; id <= 0x7ff; ++id) ids.emplace_back(id);
  for (std::uint32_t id = 0; id <= 0x7fff; ++id) {
    ids.emplace_back(id, true);
    for (int bit = 15; bit < 29; ++bit) ids.emplace_back(id | 1U << bit, true);
  }
  return ids;
}

CanFrame FrameOf(const CanId& id, const std::array<std::uint8_t, 8>& payload) {
  return {id.value, id.extended, false, 8, payload};
}

TEST(HostFrames, EveryIdentifierMeansWhatTheProtocolSaysAndTheSocketLetsThroughWhatMeansAnything) {
  const std::vector<CanId> ids = AllIds();
  for (const Case& drive : Cases()) {
    SCOPED_TRACE(drive.name);
    const std::unique_ptr<Drive> host = HostOf(drive.config);
    const DriveTraffic traffic = TrafficOf(drive.config);
    for (const CanId& id : ids) {
      const auto found = drive.expected.find(id);
      const Meaning expected = found == drive.expected.end() ? Meaning::kNothing : found->second;
      const bool command = expected == Meaning::kOurs || expected == Meaning::kForeign;
      const auto of_id = [&id] { return fmt::format("{:x} {}", id.value, id.extended); };
      ASSERT_EQ(host->IsCommand(FrameOf(id, drive.payload)), command) << of_id();
      ASSERT_EQ(Has(traffic.host_sends, id), command) << of_id();
      ASSERT_EQ(Has(traffic.host_receives, id), expected == Meaning::kReply) << of_id();
      CanFrame remote = FrameOf(id, drive.payload);
      remote.remote = true;
      ASSERT_FALSE(host->IsCommand(remote)) << of_id();
    }
  }
}

TEST(HostFrames, AllThatThisHostSendsIsAmongThem) {
  for (const Case& drive : Cases()) {
    SCOPED_TRACE(drive.name);
    const std::unique_ptr<Drive> host = HostOf(drive.config);
    int sent = 0;
    for (const DriveRequest request :
         {DriveRequest::kDisable, DriveRequest::kEnable, DriveRequest::kClearErrors}) {
      for (int tick = 0; tick < 600; ++tick) {
        FrameBatch batch;
        ASSERT_EQ(host->Encode(request, {0, 0, 0, 10, 1}, batch), Status::kOk);
        for (const CanFrame& frame : batch.frames()) {
          ++sent;
          const auto found = drive.expected.find(IdOf(frame));
          ASSERT_NE(found, drive.expected.end()) << std::hex << frame.id;
          ASSERT_EQ(found->second, Meaning::kOurs) << std::hex << frame.id;
          ASSERT_TRUE(host->IsCommand(frame)) << std::hex << frame.id;
        }
      }
    }
    EXPECT_GE(sent, 1800);
  }
}

TEST(HostFrames, FramesToOtherDrivesOnAnIdentifierOfAllAreNoCommands) {
  const Cia402Drive node(Numbered<Cia402Config>());
  const auto nmt = [](std::uint8_t to, std::uint8_t size = 2) {
    return CanFrame{0, false, false, size, {0x81, to}};
  };
  EXPECT_TRUE(node.IsCommand(nmt(5)));
  EXPECT_TRUE(node.IsCommand(nmt(0))) << "to all nodes";
  EXPECT_TRUE(node.IsCommand(nmt(5, 8)));
  EXPECT_FALSE(node.IsCommand(nmt(6)));
  EXPECT_FALSE(node.IsCommand(nmt(5, 1))) << "names nobody";

  const MitDrive damiao(MitWith(MitDialect::kDamiao));
  const auto request = [](std::uint16_t to, std::uint8_t size = 8) {
    CanFrame frame = EncodeDamiao(kDamiaoRegistersId, {to, kDamiaoTimeOut, 0});
    frame.size = size;
    return frame;
  };
  EXPECT_TRUE(damiao.IsCommand(request(5)));
  EXPECT_TRUE(damiao.IsCommand(request(5, 2)));
  EXPECT_FALSE(damiao.IsCommand(request(6)));
  EXPECT_FALSE(damiao.IsCommand(request(0x105)));
  EXPECT_FALSE(damiao.IsCommand(request(5, 1))) << "names nobody";
  CanFrame wide = request(5);
  wide.extended = true;
  EXPECT_FALSE(damiao.IsCommand(wide));
}

TEST(HostFrames, AnOdrivesAnswerToASearchIsNoCommandAndANewNumberForItIs) {
  const CanSimpleDrive drive(Numbered<CanSimpleConfig>());
  const auto address = [](std::uint8_t first, std::uint8_t size = 8) {
    return CanFrame{0x0a6, false, false, size, {first, 1, 2, 3}};
  };
  EXPECT_FALSE(drive.IsCommand(address(5)));
  EXPECT_TRUE(drive.IsCommand(address(6)));
  EXPECT_TRUE(drive.IsCommand(address(0)));
  EXPECT_TRUE(drive.IsCommand(address(5, 0))) << "without a number";
  for (std::uint32_t kind = 0; kind < 32; ++kind) {
    EXPECT_FALSE(drive.IsCommand({0x3fU << 5 | kind, false, false, 8, {}}))
        << "what is said to all ODrives names one by its serial number";
  }
}

TEST(HostFrames, AReplyOnADrivesOwnIdentifiersIsNoCommand) {
  MitConfig config = MitWith(MitDialect::kDamiao);
  for (const std::uint16_t reply_id : std::array<std::uint16_t, 3>{0x005, 0x105, 0x7ff}) {
    config.reply_id = reply_id;
    const MitDrive drive(config);
    EXPECT_FALSE(drive.IsCommand(EncodeMitReply(config, {5, 1, 0.5F, 0}))) << reply_id;
  }
}

TEST(HostFrames, ThePagesOfTheProtocolsListThem) {
  for (const Case& drive : Cases()) {
    DriveProtocols::With(drive.config, [](auto protocol, const auto& config) {
      using Protocol = decltype(protocol);
      const std::string page = testing::ReadFile(
          testing::SourcePath("docs/protocols/" + std::string(Protocol::kId) + ".md"));
      for (const HostFrame& frame : Protocol::HostFrames(config))
        EXPECT_THAT(page, HasSubstr(fmt::format("\n| 0x{:03x} | {} |", frame.id, frame.name)));
    });
  }
}

TEST(HostFrames, ADrivesFileWhoseDrivesWouldTakeEachOthersFramesForCommandsIsRefused) {
  const std::string shipped =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  const std::string damiao =
      testing::Replaced(shipped, "command_id = 1", "command_id = 1\ndialect = \"damiao\"");
  EXPECT_NO_THROW(ParseDrives(damiao, "d.toml"));
  EXPECT_NO_THROW(
      ParseDrives(testing::Replaced(shipped, "reply_id = 18", "reply_id = 0x101"), "d.toml"));
  try {
    ParseDrives(testing::Replaced(damiao, "reply_id = 18", "reply_id = 0x101"), "d.toml");
    ADD_FAILURE() << "was read";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("reply_id: is 257, so that the frames 0x101 would be those "
                                        "of joint 'leg1' (command_id = 1), too"));
  }
}

}  // namespace
}  // namespace tumbler
