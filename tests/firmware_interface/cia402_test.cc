#include "firmware_interface/devices/cia402.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "firmware_interface/devices/simulated_cia402.h"
#include "firmware_interface/devices/wire.h"

namespace tumbler {
namespace {

using Bytes = std::array<std::uint8_t, 8>;

TEST(CanOpen, FramesAreThoseOfTheStandard) {
  // The examples of CiA 301, as every bus analyser shows them.
  EXPECT_EQ(EncodeNmt(NmtCommand::kStart, 2).id, 0U);
  EXPECT_EQ(EncodeNmt(NmtCommand::kStart, 2).data, (Bytes{0x01, 0x02}));
  EXPECT_EQ(EncodeSync().id, 0x080U);
  EXPECT_EQ(EncodeSync().size, 0);
  EXPECT_EQ(EncodeNodeState(5, NmtState::kPreOperational).id, 0x705U);
  EXPECT_EQ(EncodeNodeState(5, NmtState::kPreOperational).data[0], 0x7f);
  const CanFrame controlword = EncodeSdoRequest(1, {true, 0x6040, 0, 2, 6});
  EXPECT_EQ(controlword.id, 0x601U);
  EXPECT_EQ(controlword.data, (Bytes{0x2b, 0x40, 0x60, 0x00, 0x06, 0x00, 0x00, 0x00}));
  EXPECT_EQ(EncodeSdoRequest(1, {true, 0x6060, 0, 1, 8}).data,
            (Bytes{0x2f, 0x60, 0x60, 0x00, 0x08, 0x00, 0x00, 0x00}));
  EXPECT_EQ(EncodeSdoRequest(1, {true, 0x1600, 1, 4, 0x60400010}).data,
            (Bytes{0x23, 0x00, 0x16, 0x01, 0x10, 0x00, 0x40, 0x60}));
  EXPECT_EQ(EncodeSdoRequest(1, {false, 0x6061, 0, 0, 0}).data, (Bytes{0x40, 0x61, 0x60}));
  CanFrame frame = DataFrame(0x581, 8);
  frame.data = {0x80, 0x60, 0x60, 0x00, 0x30, 0x00, 0x09, 0x06};
  SdoReply reply;
  ASSERT_EQ(DecodeSdoReply(1, frame, reply), Status::kOk);
  EXPECT_EQ(reply.kind, SdoReply::Kind::kAborted);
  EXPECT_EQ(reply.index, 0x6060);
  EXPECT_EQ(reply.value, 0x06090030U);
  frame.data = {0x4f, 0x61, 0x60, 0x00, 0x08, 0xaa, 0xbb, 0xcc};
  ASSERT_EQ(DecodeSdoReply(1, frame, reply), Status::kOk);
  EXPECT_EQ(reply.kind, SdoReply::Kind::kRead);
  EXPECT_EQ(reply.value, 8U) << "bytes beyond the size mean nothing";
}

TEST(CanOpen, ReadsBackWhatItWrites) {
  std::mt19937 random(3);
  for (int i = 0; i < 20000; ++i) {
    const auto node = static_cast<std::uint8_t>(1 + random() % 127);
    SdoRequest request{random() % 2 == 0, static_cast<std::uint16_t>(random()),
                       static_cast<std::uint8_t>(random()),
                       static_cast<std::uint8_t>(1 + random() % 4),
                       static_cast<std::uint32_t>(random())};
    if (!request.write) request.size = 0, request.value = 0;
    if (request.size < 4) request.value &= (1U << (8 * request.size)) - 1U;
    SdoRequest read;
    ASSERT_EQ(DecodeSdoRequest(node, EncodeSdoRequest(node, request), read), Status::kOk);
    ASSERT_EQ(read.write, request.write);
    ASSERT_EQ(read.index, request.index);
    ASSERT_EQ(read.sub, request.sub);
    ASSERT_EQ(read.size, request.size);
    ASSERT_EQ(read.value, request.value);
    const CanOpenEmergency emergency{static_cast<std::uint16_t>(random()),
                                     static_cast<std::uint8_t>(random()),
                                     {1, 2, 3, 4, static_cast<std::uint8_t>(random())}};
    CanOpenEmergency got;
    ASSERT_EQ(DecodeEmergency(node, EncodeEmergency(node, emergency), got), Status::kOk);
    ASSERT_EQ(got.code, emergency.code);
    ASSERT_EQ(got.detail, emergency.detail);
  }
}

TEST(Cia402, StatesAreReadFromTheStatuswordWhateverTheOtherBitsSay) {
  for (const auto state : {Cia402State::kSwitchOnDisabled, Cia402State::kReady,
                           Cia402State::kSwitchedOn, Cia402State::kEnabled, Cia402State::kQuickStop,
                           Cia402State::kFaultReaction, Cia402State::kFault}) {
    const std::uint16_t word = StatuswordOf(state);
    // Voltage, warning, remote, target reached and what follows; with bit 6 set, bit 5 is free.
    for (unsigned others = 0; others < 0x1000; ++others) {
      const unsigned free = (others & 1) << 4 | (others >> 1 & 1) << 7 | others >> 2 << 8;
      ASSERT_EQ(StateOf(static_cast<std::uint16_t>(word | free)), state) << std::hex << free;
    }
  }
  EXPECT_EQ(StateOf(0), Cia402State::kNotReady);
}

TEST(Cia402, WholeNumbersRoundToNearestAndSaturateInsteadOfWrapping) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> near(-1000, 1000);
  for (int i = 0; i < 100000; ++i) {
    const float x = near(random);
    ASSERT_NEAR(static_cast<float>(RoundToInt16(x)), x, 0.5F + 1e-4F);
    ASSERT_NEAR(static_cast<float>(RoundToInt32(x)), x, 0.5F + 1e-4F);
  }
  for (const float x : {33000.0F, 1e6F, 1e30F, std::numeric_limits<float>::infinity()}) {
    EXPECT_EQ(RoundToInt16(x), 32767);
    EXPECT_EQ(RoundToInt16(-x), -32767);
  }
  for (const float x : {2147483648.0F, 4e9F, 1e30F, std::numeric_limits<float>::infinity()}) {
    EXPECT_EQ(RoundToInt32(x), 2147483520);
    EXPECT_EQ(RoundToInt32(-x), -2147483520);
  }
  EXPECT_EQ(RoundToInt32(8388609.0F), 8388609) << "adding a half would make it even";
  EXPECT_EQ(RoundToInt16(std::nanf("")), 0);
  EXPECT_EQ(RoundToInt32(std::nanf("")), 0);
}

TEST(Cia402, PeriodsAreThoseOfTheInterpolationObject) {
  Cia402Period period;
  const auto is = [&](std::uint32_t us, int value, int exponent) {
    return ToInterpolationPeriod(us, period) == Status::kOk && period.value == value &&
           period.exponent == exponent;
  };
  EXPECT_TRUE(is(1000, 1, -3));
  EXPECT_TRUE(is(500, 5, -4));
  EXPECT_TRUE(is(2500, 25, -4));
  EXPECT_TRUE(is(250, 25, -5));
  EXPECT_TRUE(is(125, 125, -6));
  EXPECT_EQ(ToInterpolationPeriod(333, period), Status::kInvalidArgument);
  EXPECT_EQ(ToInterpolationPeriod(0, period), Status::kInvalidArgument);
}

/// A host and a simulated drive, whose joint stays exactly where it is held.
class Cia402Pair : public ::testing::Test {
 protected:
  explicit Cia402Pair(const Cia402Config& c = {}) : config(c), host(c), port(bus.Attach()) {
    SimulatedCia402Config simulated;
    simulated.node = c;
    drive = std::make_unique<SimulatedCia402Drive>(simulated);
    drive->AttachTo(bus);
  }
  std::vector<CanFrame> Tick(DriveRequest request,
                             const DriveSetpoint& setpoint = {0, 0, 0, 100, 2}) {
    ReceivedFrame received;
    while (port.Receive(received) == Status::kOk) host.Decode(received.frame);
    FrameBatch batch;
    EXPECT_EQ(host.Encode(request, setpoint, batch), Status::kOk);
    std::vector<CanFrame> frames(batch.frames().begin(), batch.frames().end());
    for (const CanFrame& frame : frames) {
      const bool sent = drop(frame) || port.Send(frame) == Status::kOk;
      EXPECT_TRUE(sent);
    }
    for (int i = 0; i < 20; ++i) {
      now_ns += 50'000;
      bus.AdvanceTo(now_ns);
      drive->Step(now_ns, position_rad, 0);
    }
    return frames;
  }
  bool TickUntil(DriveState state, int ticks, DriveRequest request) {
    for (int i = 0; i < ticks; ++i) {
      Tick(request);
      if (host.state() == state) return true;
    }
    return false;
  }

  Cia402Config config;
  Cia402Drive host;
  SimulatedBus bus;
  SimulatedPort& port;
  std::unique_ptr<SimulatedCia402Drive> drive;
  std::function<bool(const CanFrame&)> drop = [](const CanFrame&) { return false; };
  double position_rad = 0;
  std::int64_t now_ns = 0;
};

TEST_F(Cia402Pair, SetsTheDriveUpInAboutAsManyTicksAsObjects) {
  int objects = 0;
  SdoRequest request;
  while (Cia402SetUp(config, objects, request)) ++objects;
  int ticks = 0;
  while (host.state() != DriveState::kDisabled && ticks < 1000) {
    Tick(DriveRequest::kDisable);
    ++ticks;
  }
  EXPECT_EQ(drive->nmt_state(), NmtState::kOperational);
  EXPECT_LE(ticks, objects + 10);
  EXPECT_EQ(drive->state(), Cia402State::kSwitchOnDisabled);
}

TEST_F(Cia402Pair, ASyncBeginsEveryTickAndHeartbeatsComeOftenEnough) {
  int since = 0, longest = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto frames = Tick(i > 300 ? DriveRequest::kEnable : DriveRequest::kDisable);
    ASSERT_TRUE(IsSync(frames[0]));
    ASSERT_EQ(std::count_if(frames.begin(), frames.end(), IsSync), 1);
    ++since;
    for (const CanFrame& frame : frames) {
      if (frame.id == canopen_id::kHeartbeat + config.host_id) since = 0;
    }
    longest = std::max(longest, since);
  }
  EXPECT_LE(longest * 3, config.watchdog_ms);
}

TEST_F(Cia402Pair, ADriveThatAnswersNothingIsBegunWithAnewAndTheLossOfAnyFrameIsMadeUpFor) {
  std::mt19937 random(5);
  drop = [&](const CanFrame& frame) { return !IsSync(frame) && random() % 20 == 0; };
  EXPECT_TRUE(TickUntil(DriveState::kDisabled, 20000, DriveRequest::kDisable));
  drop = [](const CanFrame&) { return false; };
  EXPECT_TRUE(TickUntil(DriveState::kEnabled, 50, DriveRequest::kEnable));
}

TEST_F(Cia402Pair, AnObjectThatIsRefusedIsAFaultWithItsAbortCodeUntilCleared) {
  drive->Refuse(0x605a);
  ASSERT_TRUE(TickUntil(DriveState::kFault, 500, DriveRequest::kDisable));
  EXPECT_EQ(host.feedback().error, 0x06020000U);
  for (int i = 0; i < 1000; ++i) {
    Tick(DriveRequest::kEnable);
    ASSERT_EQ(host.state(), DriveState::kFault);
  }
  drive->Refuse(0);
  Tick(DriveRequest::kClearErrors);
  EXPECT_TRUE(TickUntil(DriveState::kDisabled, 500, DriveRequest::kDisable));
}

Cia402Config WithoutQuickStopOption() {
  Cia402Config config;
  config.may_lack = 1U << 2;
  return config;
}

class Cia402Lacking : public Cia402Pair {
 protected:
  Cia402Lacking() : Cia402Pair(WithoutQuickStopOption()) {}
};

TEST_F(Cia402Lacking, AnObjectThatTheDriveMayLackDoesNotStopTheSetUpAndAnyOtherDoes) {
  ASSERT_EQ(kCia402MayLack[2], 0x605a);
  drive->Refuse(0x605a);
  ASSERT_TRUE(TickUntil(DriveState::kDisabled, 500, DriveRequest::kDisable));
  EXPECT_TRUE(TickUntil(DriveState::kEnabled, 100, DriveRequest::kEnable));
  EXPECT_EQ(host.feedback().error, 0U);
  drive->PowerCycle();
  drive->Refuse(0x60c2);
  EXPECT_TRUE(TickUntil(DriveState::kFault, 1000, DriveRequest::kDisable));
  EXPECT_EQ(host.set_up_refusal().index, 0x60c2);
}

TEST(Cia402MayLack, TheReactionToSilenceOnlyWhereTheDriveWatchesNothing) {
  Cia402Config config;
  config.may_lack = 1U << 4;
  EXPECT_EQ(config.Validate(), Status::kInvalidArgument);
  config.watchdog_ms = 0;
  EXPECT_EQ(config.Validate(), Status::kOk);
  config.may_lack = 1U << 5;
  EXPECT_EQ(config.Validate(), Status::kInvalidArgument);
}

TEST_F(Cia402Pair, ADriveThatBootsWhileEnabledIsSetUpAgainAndStaysOff) {
  ASSERT_TRUE(TickUntil(DriveState::kDisabled, 500, DriveRequest::kDisable));
  ASSERT_TRUE(TickUntil(DriveState::kEnabled, 100, DriveRequest::kEnable));
  drive->PowerCycle();
  for (int i = 0; i < 1000; ++i) {
    Tick(DriveRequest::kEnable);
    ASSERT_TRUE(i < 5 || host.state() != DriveState::kEnabled);
    ASSERT_FALSE(drive->enabled());
  }
  EXPECT_EQ(host.state(), DriveState::kDisabled);
  EXPECT_EQ(drive->nmt_state(), NmtState::kOperational);
  Tick(DriveRequest::kDisable);
  EXPECT_TRUE(TickUntil(DriveState::kEnabled, 100, DriveRequest::kEnable));
}

TEST_F(Cia402Pair, TheFaultResetIsAnEdgeThatOnlyTheOperatorCauses) {
  ASSERT_TRUE(TickUntil(DriveState::kDisabled, 500, DriveRequest::kDisable));
  drive->RaiseError(0x7305);
  ASSERT_TRUE(TickUntil(DriveState::kFault, 10, DriveRequest::kDisable));
  EXPECT_EQ(host.feedback().error, 0x7305U);
  const auto controlword = [&](const std::vector<CanFrame>& frames) {
    Cia402Command command;
    for (const CanFrame& frame : frames) {
      if (DecodeCia402(config.node_id, frame, command) == Status::kOk)
        return int{command.controlword};
    }
    return -1;
  };
  for (int i = 0; i < 500; ++i) {
    const auto request = i % 3 == 0 ? DriveRequest::kEnable : DriveRequest::kDisable;
    ASSERT_EQ(controlword(Tick(request)), cia402_control::kDisableVoltage);
  }
  EXPECT_EQ(controlword(Tick(DriveRequest::kClearErrors)), cia402_control::kDisableVoltage);
  EXPECT_EQ(controlword(Tick(DriveRequest::kDisable)), cia402_control::kFaultReset);
  EXPECT_TRUE(TickUntil(DriveState::kDisabled, 10, DriveRequest::kDisable));
  EXPECT_EQ(controlword(Tick(DriveRequest::kDisable)), cia402_control::kDisableVoltage);
}

TEST_F(Cia402Pair, AFollowingErrorIsReportedWithItsCode) {
  ASSERT_TRUE(TickUntil(DriveState::kDisabled, 500, DriveRequest::kDisable));
  ASSERT_TRUE(TickUntil(DriveState::kEnabled, 100, DriveRequest::kEnable));
  for (int i = 0; i < 10; ++i) Tick(DriveRequest::kEnable, {2, 0, 0, 100, 2});
  EXPECT_EQ(host.state(), DriveState::kFault);
  EXPECT_EQ(host.feedback().error, kEmergencyFollowingError);
}

TEST_F(Cia402Pair, TheTargetIsWhereTheDriveIsUntilItIsEnabled) {
  position_rad = 0.7;
  ASSERT_TRUE(TickUntil(DriveState::kDisabled, 500, DriveRequest::kDisable));
  while (host.state() != DriveState::kEnabled) {
    position_rad += 0.0005;  // Somebody moves the joint meanwhile.
    Cia402Command command;
    const auto frames = Tick(DriveRequest::kEnable, {-2, 0, 0, 100, 2});
    if (host.state() == DriveState::kEnabled) break;  // The host learnt it before this Encode.
    for (const CanFrame& frame : frames) {
      if (DecodeCia402(config.node_id, frame, command) != Status::kOk) continue;
      ASSERT_NEAR(command.position / 65536.0 * 2 * M_PI, position_rad, 0.003);
    }
  }
}

TEST_F(Cia402Pair, TheSilenceOfTheDrivesHeartbeatIsNoticed) {
  ASSERT_TRUE(TickUntil(DriveState::kDisabled, 500, DriveRequest::kDisable));
  for (int i = 0; i < 3 * config.heartbeat_ms + 10; ++i) {
    FrameBatch batch;
    host.Decode(EncodeCia402(config.node_id, Cia402Status{0x40, 0}));
    ASSERT_EQ(host.Encode(DriveRequest::kDisable, {}, batch), Status::kOk);
  }
  EXPECT_EQ(host.state(), DriveState::kLost);
  EXPECT_EQ(host.feedback().error, 0U) << "the drive has not said that anything is wrong";
  EXPECT_GT(host.heartbeat().ticks, host.heartbeat().limit_ticks);
  EXPECT_EQ(host.heartbeat().limit_ticks, 3 * config.heartbeat_ms + 2);
  host.Decode(EncodeNodeState(config.node_id, NmtState::kOperational));
  EXPECT_EQ(host.state(), DriveState::kDisabled);
}

TEST(SimulatedCia402, RefusesWhatARealDictionaryRefuses) {
  SimulatedBus bus;
  SimulatedPort& port = bus.Attach();
  SimulatedCia402Drive drive(SimulatedCia402Config{});
  drive.AttachTo(bus);
  std::int64_t now_ns = 0;
  const auto ask = [&](const SdoRequest& request) {
    EXPECT_EQ(port.Send(EncodeSdoRequest(1, request)), Status::kOk);
    now_ns += 1'000'000;
    bus.AdvanceTo(now_ns);
    drive.Step(now_ns, 0, 0);
    bus.AdvanceTo(now_ns + 500'000);
    SdoReply reply;
    ReceivedFrame received;
    while (port.Receive(received) == Status::kOk) {
      static_cast<void>(DecodeSdoReply(1, received.frame, reply));
    }
    return reply.kind == SdoReply::Kind::kAborted ? reply.value : 0U;
  };
  drive.Step(0, 0, 0);
  EXPECT_EQ(ask({true, 0x2000, 0, 2, 1}), 0x06020000U) << "no such object";
  EXPECT_EQ(ask({true, 0x6060, 0, 2, 8}), 0x06070010U) << "wrong size";
  EXPECT_EQ(ask({true, 0x6060, 0, 1, 3}), 0x06090030U) << "a mode that it lacks";
  EXPECT_EQ(ask({true, 0x6041, 0, 2, 3}), 0x06010002U) << "read only";
  EXPECT_EQ(ask({true, 0x60c2, 3, 1, 3}), 0x06020000U);
  EXPECT_EQ(ask({true, 0x1400, 1, 4, 0x201}), 0U);
  EXPECT_EQ(ask({true, 0x1600, 0, 1, 0}), 0x08000022U) << "the PDO exists";
  EXPECT_EQ(ask({true, 0x1400, 1, 4, 0x80000201}), 0U);
  EXPECT_EQ(ask({true, 0x1600, 1, 4, 0x60400020}), 0x06040041U) << "16 bits mapped as 32";
}

TEST(Cia402Config, RejectsWhatDoesNotFitTheWire) {
  const auto rejected = [](auto change) {
    Cia402Config config;
    config.rated_torque_nm = 6;
    change(config);
    return config.Validate() == Status::kInvalidArgument;
  };
  EXPECT_FALSE(rejected([](auto&) {}));
  EXPECT_TRUE(rejected([](auto& c) { c.node_id = 0; }));
  EXPECT_TRUE(rejected([](auto& c) { c.node_id = 127; }));
  EXPECT_TRUE(rejected([](auto& c) { c.host_id = c.node_id; }));
  EXPECT_TRUE(rejected([](auto& c) { c.period_us = 333; }));
  EXPECT_TRUE(rejected([](auto& c) { c.rated_torque_nm = 0.5F; })) << "18 N m are 36 times rated";
  EXPECT_TRUE(rejected([](auto& c) { c.position_units_per_turn = 2e9F; }));
  EXPECT_TRUE(rejected([](auto& c) { c.status_every = 0; }));
  EXPECT_TRUE(rejected([](auto& c) { c.quick_stop_option = 8; }));
}

}  // namespace
}  // namespace tumbler
