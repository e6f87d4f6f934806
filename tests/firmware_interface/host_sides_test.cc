#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "firmware_interface/devices/drive_bank.h"
#include "firmware_interface/devices/wire.h"

namespace tumbler {
namespace {

constexpr float kNoNumber = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfiniteFloat = std::numeric_limits<float>::infinity();

/// The frame with one property changed at a time, so that it is another frame.
std::vector<CanFrame> NearlyRight(const CanFrame& frame, std::uint8_t least_size,
                                  bool longer_is_right) {
  std::vector<CanFrame> frames(5, frame);
  frames[0].extended = !frame.extended;
  frames[1].remote = true;
  frames[2].id = frame.id ^ 0x40;
  frames[3].size = longer_is_right ? std::uint8_t{9} : static_cast<std::uint8_t>(frame.size + 1);
  frames[4].size = static_cast<std::uint8_t>(least_size - 1);
  return frames;
}

TEST(Codecs, EachTakesDataFramesOfItsOwnKindAndLengthOnly) {
  struct Codec {
    std::string name;
    CanFrame frame;
    std::uint8_t least_size;
    bool longer_is_right;
    std::function<bool(const CanFrame&)> takes;
  };
  std::vector<Codec> codecs;
  const auto cansimple = [&codecs]<typename Value>(const std::string& name, const Value& value,
                                                   std::uint8_t least) {
    codecs.push_back({name, EncodeCanSimple(5, value), least, true, [](const CanFrame& frame) {
                        Value read;
                        return DecodeCanSimple(5, frame, read) == Status::kOk;
                      }});
  };
  cansimple("heartbeat", CanSimpleHeartbeat{}, 7);
  cansimple("errors", CanSimpleErrors{}, 8);
  cansimple("axis state", CanSimpleAxisState{}, 4);
  cansimple("estimates", CanSimpleEstimates{}, 8);
  cansimple("controller mode", CanSimpleControllerMode{}, 8);
  cansimple("input position", CanSimpleInputPos{}, 8);
  cansimple("input velocity", CanSimpleInputVel{}, 8);
  cansimple("temperature", CanSimpleTemperature{}, 8);
  cansimple("torques", CanSimpleTorques{}, 8);
  const auto cia402 = [&codecs]<typename Value>(const std::string& name, const Value& value) {
    codecs.push_back({name, EncodeCia402(5, value), 6, true, [](const CanFrame& frame) {
                        Value read;
                        return DecodeCia402(5, frame, read) == Status::kOk;
                      }});
  };
  cia402("RPDO1", Cia402Command{});
  cia402("RPDO2", Cia402FeedForward{});
  cia402("TPDO1", Cia402Status{});
  cia402("TPDO2", Cia402Motion{});
  codecs.push_back({"NMT", EncodeNmt(NmtCommand::kStop, 5), 2, false, [](const CanFrame& frame) {
                      NmtCommand read{};
                      return DecodeNmt(5, frame, read) == Status::kOk;
                    }});
  codecs.push_back(
      {"node state", EncodeNodeState(5, NmtState::kStopped), 1, false, [](const CanFrame& frame) {
         NmtState read{};
         return DecodeNodeState(5, frame, read) == Status::kOk;
       }});
  codecs.push_back({"EMCY", EncodeEmergency(5, {}), 8, false, [](const CanFrame& frame) {
                      CanOpenEmergency read;
                      return DecodeEmergency(5, frame, read) == Status::kOk;
                    }});
  codecs.push_back({"SDO request", EncodeSdoRequest(5, {true, 0x6060, 0, 1, 8}), 8, false,
                    [](const CanFrame& frame) {
                      SdoRequest read;
                      return DecodeSdoRequest(5, frame, read) == Status::kOk;
                    }});
  codecs.push_back({"SDO reply", EncodeSdoReply(5, {SdoReply::Kind::kWritten, 0x6060, 0, 0, 0}), 8,
                    false, [](const CanFrame& frame) {
                      SdoReply read;
                      return DecodeSdoReply(5, frame, read) == Status::kOk;
                    }});
  for (const Codec& codec : codecs) {
    SCOPED_TRACE(codec.name);
    EXPECT_TRUE(codec.takes(codec.frame));
    const std::vector<CanFrame> others =
        NearlyRight(codec.frame, codec.least_size, codec.longer_is_right);
    for (std::size_t i = 0; i < others.size(); ++i) EXPECT_FALSE(codec.takes(others[i])) << i;
  }
}

TEST(CanOpen, EveryServiceOfNmtIsReadAndNoOther) {
  NmtCommand command{};
  for (const NmtCommand of : {NmtCommand::kStart, NmtCommand::kStop, NmtCommand::kPreOperational,
                              NmtCommand::kResetNode, NmtCommand::kResetCommunication}) {
    for (const std::uint8_t to : std::array<std::uint8_t, 2>{0, 5}) {
      ASSERT_EQ(DecodeNmt(5, EncodeNmt(of, to), command), Status::kOk);
      EXPECT_EQ(command, of);
    }
    EXPECT_NE(DecodeNmt(5, EncodeNmt(of, 6), command), Status::kOk) << "another node's";
  }
  EXPECT_NE(DecodeNmt(5, EncodeNmt(static_cast<NmtCommand>(0x77), 5), command), Status::kOk);
  NmtState state{};
  for (const NmtState of :
       {NmtState::kBootUp, NmtState::kStopped, NmtState::kOperational, NmtState::kPreOperational}) {
    ASSERT_EQ(DecodeNodeState(5, EncodeNodeState(5, of), state), Status::kOk);
    EXPECT_EQ(state, of);
  }
  EXPECT_NE(DecodeNodeState(5, EncodeNodeState(5, static_cast<NmtState>(0x55)), state),
            Status::kOk);
  CanFrame sync = EncodeSync();
  EXPECT_TRUE(IsSync(sync));
  sync.size = 1;
  EXPECT_TRUE(IsSync(sync)) << "with a counter";
  sync.size = 2;
  EXPECT_FALSE(IsSync(sync));
}

TEST(CanOpen, OfSdoOnlyExpeditedTransfersAreRead) {
  CanFrame request = EncodeSdoRequest(5, {true, 0x6060, 0, 1, 8});
  CanFrame reply = EncodeSdoReply(5, {SdoReply::Kind::kRead, 0x6061, 0, 1, 8});
  SdoRequest asked;
  SdoReply answer;
  request.data[0] = 1 << 5 | 1;  // segmented
  EXPECT_NE(DecodeSdoRequest(5, request, asked), Status::kOk);
  request.data[0] = 3 << 5;
  EXPECT_NE(DecodeSdoRequest(5, request, asked), Status::kOk);
  reply.data[0] = 2 << 5 | 1;
  EXPECT_NE(DecodeSdoReply(5, reply, answer), Status::kOk);
  reply.data[0] = 7 << 5;
  EXPECT_NE(DecodeSdoReply(5, reply, answer), Status::kOk);
}

/// Of each protocol: a host, one whose configuration is not valid, and frames of its drive.
struct Side {
  std::string name;
  std::unique_ptr<Drive> host;
  std::unique_ptr<Drive> invalid;
  CanFrame report;
};
std::vector<Side> Sides() {
  std::vector<Side> sides;
  DriveProtocols::ForEach([&sides](auto protocol) {
    using Protocol = decltype(protocol);
    auto config = Protocol::Example(0);
    auto host = std::make_unique<typename Protocol::Host>(config);
    config.joint.gear_ratio = 0;
    EXPECT_NE(config.Validate(), Status::kOk);
    sides.push_back({std::string(Protocol::kName),
                     std::move(host),
                     std::make_unique<typename Protocol::Host>(config),
                     {}});
  });
  const auto report = [&sides](std::string_view name, const CanFrame& frame) {
    for (Side& side : sides) {
      if (side.name == name) side.report = frame;
    }
  };
  report(MitProtocol::kName, EncodeMitReply(MitProtocol::Example(0), {1, 0.5F, 0, 0}));
  report(AkV3Protocol::kName, EncodeAkV3Status(AkV3Protocol::Example(0), {100, 0, 0, 20, 0}));
  report(CanSimpleProtocol::kName, EncodeCanSimple(1, CanSimpleEstimates{0.1F, 0}));
  report(Cia402Protocol::kName, EncodeCia402(1, Cia402Status{0x40, 100}));
  return sides;
}

TEST(HostSides, AnInvalidConfigurationSendsNothingAndTakesNothing) {
  for (const Side& side : Sides()) {
    SCOPED_TRACE(side.name);
    FrameBatch batch;
    EXPECT_EQ(side.invalid->Encode(DriveRequest::kDisable, {}, batch), Status::kInvalidArgument);
    EXPECT_TRUE(batch.frames().empty());
    EXPECT_FALSE(side.invalid->Decode(side.report));
  }
}

TEST(HostSides, ABatchWithoutRoomIsRefused) {
  for (const Side& side : Sides()) {
    SCOPED_TRACE(side.name);
    FrameBatch batch;
    for (int i = 0; i < FrameBatch::kCapacity; ++i) EXPECT_EQ(batch.Add({}), Status::kOk);
    EXPECT_EQ(batch.Add({}), Status::kCapacityExceeded);
    EXPECT_EQ(batch.AddPlace(), nullptr);
    EXPECT_EQ(side.host->Encode(DriveRequest::kDisable, {}, batch), Status::kCapacityExceeded);
    EXPECT_EQ(batch.frames().size(), std::size_t{FrameBatch::kCapacity});
  }
}

TEST(HostSides, OnlySetpointsAndReportsOfTheDriveHavePositions) {
  double position_rad = 0;
  const CanFrame other = DataFrame(0x123, 8);
  DriveProtocols::ForEach([&](auto protocol) {
    using Protocol = decltype(protocol);
    SCOPED_TRACE(Protocol::kName);
    const auto config = Protocol::Example(0);
    EXPECT_FALSE(Protocol::CommandedPosition(config, other, position_rad));
    EXPECT_FALSE(Protocol::ReportedPosition(config, other, position_rad));
  });
  const AkV3Config ak = AkV3Protocol::Example(0);
  EXPECT_FALSE(
      AkV3Protocol::CommandedPosition(ak, EncodeAkV3Command(ak, {1, 0, 0, 1, 0}), position_rad))
      << "without stiffness";
  EXPECT_TRUE(
      AkV3Protocol::CommandedPosition(ak, EncodeAkV3Command(ak, {1, 0, 10, 1, 0}), position_rad));
  EXPECT_NEAR(position_rad, 1, 1e-3);
  const MitConfig mit = MitProtocol::Example(0);
  EXPECT_FALSE(
      MitProtocol::CommandedPosition(mit, EncodeMitCommand(mit, {1, 0, 0, 1, 0}), position_rad));
  EXPECT_FALSE(
      MitProtocol::CommandedPosition(mit, MitMagicFrame(mit, MitMagic::kEnter), position_rad));
  EXPECT_TRUE(
      MitProtocol::CommandedPosition(mit, EncodeMitCommand(mit, {1, 0, 9, 1, 0}), position_rad));
  const Cia402Config cia402 = Cia402Protocol::Example(0);
  EXPECT_FALSE(Cia402Protocol::CommandedPosition(
      cia402, EncodeCia402(1, Cia402Command{cia402_control::kQuickStop, 100}), position_rad));
  EXPECT_TRUE(Cia402Protocol::CommandedPosition(
      cia402, EncodeCia402(1, Cia402Command{cia402_control::kEnable, 65536}), position_rad));
  EXPECT_NEAR(position_rad, 6.2831853, 1e-6);
}

TEST(HostSides, ThePositionsOfReportsAndSetpointsAreThoseOfTheShaft) {
  double position_rad = 0;
  const std::vector<Side> sides = Sides();
  std::size_t i = 0;
  DriveProtocols::ForEach([&](auto protocol) {
    using Protocol = decltype(protocol);
    SCOPED_TRACE(Protocol::kName);
    EXPECT_TRUE(Protocol::ReportedPosition(Protocol::Example(0), sides[i].report, position_rad));
    ++i;
  });
  EXPECT_TRUE(CanSimpleProtocol::ReportedPosition(CanSimpleProtocol::Example(0),
                                                  EncodeCanSimple(1, CanSimpleEstimates{0.5F, 0}),
                                                  position_rad));
  EXPECT_NEAR(position_rad, 3.14159265, 1e-6);
  EXPECT_TRUE(CanSimpleProtocol::CommandedPosition(
      CanSimpleProtocol::Example(0), EncodeCanSimple(1, CanSimpleInputPos{1, 0, 0}), position_rad));
  EXPECT_NEAR(position_rad, 6.2831853, 1e-6);
}

TEST(DriveBank, TakesAsManyDrivesAsThereMayBeJointsAndNoneThatIsNotValid) {
  DriveBank bank;
  MitConfig invalid;
  invalid.command_id = 0;
  EXPECT_EQ(bank.Add(invalid), Status::kInvalidArgument);
  for (int i = 0; i < kMaxJoints; ++i) EXPECT_EQ(bank.Add(MitProtocol::Example(i)), Status::kOk);
  EXPECT_EQ(bank.Add(MitProtocol::Example(kMaxJoints)), Status::kCapacityExceeded);
  EXPECT_EQ(bank.drives().size(), std::size_t{kMaxJoints});
}

TEST(Configurations, EachEndOfEachRangeIsKept) {
  for (const auto change :
       {+[](AkV3Config& c) { c.pole_pairs = 101; }, +[](AkV3Config& c) { c.gear_inside = 1001; },
        +[](AkV3Config& c) { c.status_s = 0.11; },
        +[](AkV3Config& c) { c.status_per_tick_max = 0; },
        +[](AkV3Config& c) { c.torque_constant_nm_per_a = 1001; },
        +[](AkV3Config& c) {
          c.range.kp_nm_per_rad = {0, kInfiniteFloat};
        },
        +[](AkV3Config& c) {
          c.range.position_rad = {-1, 0};
        }}) {
    AkV3Config config;
    change(config);
    EXPECT_NE(config.Validate(), Status::kOk);
  }
  CanSimpleConfig cansimple;
  cansimple.estimates_per_tick_max = 0;
  EXPECT_NE(cansimple.Validate(), Status::kOk);
  int number = 0;
  for (const auto change : {+[](Cia402Config& c) { c.node_id = 0; },
                            +[](Cia402Config& c) { c.node_id = 127; },
                            +[](Cia402Config& c) { c.host_id = 0; },
                            +[](Cia402Config& c) { c.host_id = 128; },
                            +[](Cia402Config& c) { c.host_id = c.node_id; },
                            +[](Cia402Config& c) { c.period_us = 99; },
                            +[](Cia402Config& c) { c.period_us = 100'001; },
                            +[](Cia402Config& c) { c.period_us = 333; },
                            +[](Cia402Config& c) { c.heartbeat_ms = 0; },
                            +[](Cia402Config& c) { c.heartbeat_ms = 10'001; },
                            +[](Cia402Config& c) { c.watchdog_ms = 10'001; },
                            +[](Cia402Config& c) { c.status_every = 0; },
                            +[](Cia402Config& c) { c.status_every = 241; },
                            +[](Cia402Config& c) { c.watchdog_reaction = -1; },
                            +[](Cia402Config& c) { c.watchdog_reaction = 4; },
                            +[](Cia402Config& c) { c.quick_stop_option = 0; },
                            +[](Cia402Config& c) { c.quick_stop_option = 8; },
                            +[](Cia402Config& c) { c.may_lack = 1U << 5; },
                            +[](Cia402Config& c) { c.may_lack = 1U << 4; },
                            +[](Cia402Config& c) { c.position_units_per_turn = 0; },
                            +[](Cia402Config& c) { c.position_units_per_turn = kInfiniteFloat; },
                            +[](Cia402Config& c) { c.velocity_units_per_turn_s = kNoNumber; },
                            +[](Cia402Config& c) { c.rated_torque_nm = -1; },
                            +[](Cia402Config& c) { c.following_window_rad = -1; },
                            +[](Cia402Config& c) { c.following_window_rad = 1e6F; },
                            +[](Cia402Config& c) {
                              c.range.position_rad = {-1e6F, 1};
                            },
                            +[](Cia402Config& c) {
                              c.range.position_rad = {-1, 0};
                            },
                            +[](Cia402Config& c) {
                              c.range.velocity_rad_s = {0, 1};
                            },
                            +[](Cia402Config& c) {
                              c.range.torque_nm = {-1, 1e6F};
                            }}) {
    Cia402Config config = Cia402Protocol::Example(0);
    change(config);
    EXPECT_NE(config.Validate(), Status::kOk) << number;
    ++number;
  }
  Cia402Period period;
  EXPECT_EQ(ToInterpolationPeriod(200'000'000, period), Status::kOk);
  EXPECT_EQ(period.value, 200);
  EXPECT_EQ(period.exponent, 0);
  EXPECT_EQ(StatuswordOf(Cia402State::kNotReady), 0);
}

/// A Damiao drive's host, and hand-made replies.
class DamiaoHost : public ::testing::Test {
 protected:
  static MitConfig Config() {
    MitConfig config;
    config.dialect = MitDialect::kDamiao;
    return config;
  }
  void Answer(bool enabled, std::uint8_t error = 0) {
    MitReply reply{1, 0.25F, 0, 0, enabled};
    reply.error = error;
    reply.temperature_c = 30;
    EXPECT_TRUE(host.Decode(EncodeMitReply(Config(), reply)));
  }
  CanFrame Tick(DriveRequest request) {
    FrameBatch batch;
    EXPECT_EQ(host.Encode(request, {0.25F, 0, 0, 10, 1}, batch), Status::kOk);
    EXPECT_EQ(batch.frames().size(), 1U);
    return batch.frames()[0];
  }
  MitDrive host{Config()};
};

TEST_F(DamiaoHost, IsAskedToEnableUntilItSaysThatItIsAndHasDroppedOutWhenItSaysThatItIsNot) {
  const CanFrame enter = MitMagicFrame(Config(), MitMagic::kEnter);
  Tick(DriveRequest::kEnable);
  for (int i = 0; i < 10; ++i) {
    Answer(false);
    EXPECT_EQ(Tick(DriveRequest::kEnable), enter);
    EXPECT_EQ(host.state(), DriveState::kEnabling);
  }
  Answer(true);
  EXPECT_NE(Tick(DriveRequest::kEnable), enter);
  Answer(true);
  Tick(DriveRequest::kEnable);
  Answer(true);
  EXPECT_EQ(host.state(), DriveState::kEnabled);
  EXPECT_EQ(host.feedback().temperature_c, 30);
  Answer(false);
  EXPECT_EQ(host.state(), DriveState::kDisabled);
  Answer(false, 9);
  EXPECT_EQ(host.state(), DriveState::kFault);
  EXPECT_EQ(host.feedback().error, 9U);
  Tick(DriveRequest::kDisable);
  EXPECT_EQ(Tick(DriveRequest::kClearErrors), MitMagicFrame(Config(), MitMagic::kClear));
}

TEST_F(DamiaoHost, TheHotterOfItsTemperaturesCounts) {
  CanFrame reply = EncodeMitReply(Config(), {1, 0, 0, 0});
  for (const auto& [transistors, rotor] :
       {std::pair<std::uint8_t, std::uint8_t>{40, 50}, {60, 50}}) {
    reply.data[6] = transistors;
    reply.data[7] = rotor;
    EXPECT_TRUE(host.Decode(reply));
    EXPECT_EQ(host.feedback().temperature_c, std::max(transistors, rotor));
  }
}

TEST(MitHost, RepliesOfSixBytesHaveNoTemperatureAndFramesOfOtherLengthsAreNoMagicOnes) {
  const MitConfig config;
  MitDrive host(config);
  MitReply reply{1, 0.25F, 0, 0};
  reply.size = 3;  // As few as a reply can have.
  EXPECT_EQ(EncodeMitReply(config, reply).size, 6);
  EXPECT_TRUE(host.Decode(EncodeMitReply(config, reply)));
  EXPECT_FALSE(host.feedback().has_temperature);
  reply.size = 12;
  EXPECT_EQ(EncodeMitReply(config, reply).size, 8);
  CanFrame enter = MitMagicFrame(config, MitMagic::kEnter);
  MitMagic magic{};
  EXPECT_TRUE(DecodeMitMagic(config, enter, magic));
  ImpedanceCommand command;
  EXPECT_NE(DecodeMitCommand(config, enter, command), Status::kOk);
  enter.size = 7;
  EXPECT_FALSE(DecodeMitMagic(config, enter, magic));
}

TEST(AkV3Host, AChangeOfDampingAloneReachesTheDrive) {
  const AkV3Config config = AkV3Protocol::Example(0);
  AkV3Drive host(config);
  ImpedanceCommand command;
  float kd = 0.5F;
  for (int i = 0; i < 20; ++i) {
    EXPECT_TRUE(host.Decode(EncodeAkV3Status(config, {0, 0, 0, 20, 0})));
    if (i >= 15) kd += 0.5F;
    FrameBatch batch;
    ASSERT_EQ(host.Encode(DriveRequest::kEnable, {0, 0, 0, 10, kd}, batch), Status::kOk);
    ASSERT_EQ(DecodeAkV3Command(config, batch.frames()[0], command), Status::kOk);
    if (i >= 14) {
      EXPECT_NEAR(command.kd_nm_s_per_rad, kd, 2e-3F) << i;
    }
  }
}

/// The host of one ODrive, and hand-made messages.
class OdriveHost : public ::testing::Test {
 protected:
  std::vector<CanFrame> Tick(DriveRequest request, float kp = 100) {
    FrameBatch batch;
    EXPECT_EQ(host.Encode(request, {0.1F, 0, 0, kp, 2}, batch), Status::kOk);
    return {batch.frames().begin(), batch.frames().end()};
  }
  void Estimate(float rev) { host.Decode(EncodeCanSimple(1, CanSimpleEstimates{rev, 0})); }
  void Heartbeat(std::uint8_t state, std::uint32_t error = 0) {
    host.Decode(EncodeCanSimple(1, CanSimpleHeartbeat{error, state, 0, false}));
  }
  void Enable() {
    Estimate(0.1F);
    Heartbeat(kCanSimpleIdle);
    for (int i = 0; i < 4; ++i) Tick(DriveRequest::kEnable);
    Heartbeat(kCanSimpleClosedLoop);
    Tick(DriveRequest::kEnable);
    EXPECT_EQ(host.state(), DriveState::kEnabled);
  }
  CanSimpleConfig config = OfNode<CanSimpleConfig>(1);
  CanSimpleDrive host{config};
};

TEST_F(OdriveHost, MessagesThatAreTooShortOrOfNoKnownKindChangeNothing) {
  Estimate(0.1F);
  Heartbeat(kCanSimpleIdle);
  const auto shortened = [this](CanFrame frame) {
    frame.size = 2;
    EXPECT_FALSE(host.Decode(frame));
  };
  shortened(EncodeCanSimple(1, CanSimpleEstimates{5, 5}));
  shortened(EncodeCanSimple(1, CanSimpleHeartbeat{1, 8, 0, true}));
  shortened(EncodeCanSimple(1, CanSimpleErrors{1, 1}));
  shortened(EncodeCanSimple(1, CanSimpleTorques{1, 1}));
  shortened(EncodeCanSimple(1, CanSimpleTemperature{99, 99}));
  EXPECT_FALSE(host.Decode(DataFrame(0x20, 8))) << "Get_Version";
  EXPECT_FALSE(host.Decode(EncodeCanSimple(2, CanSimpleEstimates{5, 5}))) << "another node's";
  EXPECT_EQ(host.state(), DriveState::kDisabled);
  EXPECT_FALSE(host.feedback().has_torque);
  EXPECT_FALSE(host.feedback().has_temperature);
  CanSimpleHeartbeat read;
  ASSERT_EQ(DecodeCanSimple(1, EncodeCanSimple(1, CanSimpleHeartbeat{0, 1, 0, true}), read),
            Status::kOk);
  EXPECT_TRUE(read.trajectory_done);
}

TEST_F(OdriveHost, IsNotPreparedWhereItsPositionIsNoNumberOrItsHeartbeatIsOld) {
  Estimate(kNoNumber);
  Heartbeat(kCanSimpleIdle);
  for (int i = 0; i < 5; ++i) {
    for (const CanFrame& frame : Tick(DriveRequest::kEnable))
      EXPECT_EQ(frame.id, CanSimpleId(1, CanSimpleCommand::kSetAxisState));
  }
  Estimate(0.1F);
  for (int i = 0; i <= config.heartbeat_ticks_max; ++i) Tick(DriveRequest::kDisable);
  for (int i = 0; i < 5; ++i) {
    for (const CanFrame& frame : Tick(DriveRequest::kEnable))
      EXPECT_EQ(frame.id, CanSimpleId(1, CanSimpleCommand::kSetAxisState));
  }
  EXPECT_EQ(host.state(), DriveState::kLost);
}

TEST_F(OdriveHost, ADriveThatIsNotReadyAnyMoreIsPreparedAnew) {
  Estimate(0.1F);
  Heartbeat(kCanSimpleIdle);
  Tick(DriveRequest::kEnable);
  Tick(DriveRequest::kEnable);  // the first tick of the preparation
  Heartbeat(kCanSimpleIdle, 1);
  const std::vector<CanFrame> frames = Tick(DriveRequest::kEnable);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].id, CanSimpleId(1, CanSimpleCommand::kSetAxisState));
  EXPECT_EQ(host.state(), DriveState::kFault);
  Heartbeat(kCanSimpleIdle);
  Enable();
}

TEST_F(OdriveHost, AnErrorWhileClosedLoopIsAwaitedOrHeldTripsIt) {
  Estimate(0.1F);
  Heartbeat(kCanSimpleIdle);
  for (int i = 0; i < 4; ++i) Tick(DriveRequest::kEnable);
  host.Decode(EncodeCanSimple(1, CanSimpleErrors{1, 0}));
  Tick(DriveRequest::kEnable);
  EXPECT_EQ(host.state(), DriveState::kFault);
  host.Decode(EncodeCanSimple(1, CanSimpleErrors{0, 0}));
  EXPECT_EQ(host.state(), DriveState::kDisabled) << "off until it was asked to disable";
  Tick(DriveRequest::kDisable);
  Enable();
  Heartbeat(kCanSimpleClosedLoop, 1);
  Tick(DriveRequest::kEnable);
  EXPECT_EQ(host.state(), DriveState::kFault);
}

TEST_F(OdriveHost, AfterBrakingItIsToldThatPositionsAreToBeFollowedAgain) {
  Enable();
  const auto mode = [](const std::vector<CanFrame>& frames) {
    CanSimpleControllerMode read;
    for (const CanFrame& frame : frames) {
      if (DecodeCanSimple(1, frame, read) == Status::kOk) return read.control;
    }
    return 0U;
  };
  EXPECT_EQ(mode(Tick(DriveRequest::kEnable, 0)), kCanSimpleVelocityControl);
  EXPECT_EQ(mode(Tick(DriveRequest::kEnable, 0)), kCanSimpleVelocityControl);
  EXPECT_EQ(mode(Tick(DriveRequest::kEnable)), kCanSimplePositionControl);
  EXPECT_EQ(mode(Tick(DriveRequest::kEnable)), 0U) << "once is enough";
}

}  // namespace
}  // namespace tumbler
