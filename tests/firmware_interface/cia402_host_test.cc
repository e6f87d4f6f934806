// The host's side of CiA 402 drives, whose answers the test gives.

#include "firmware_interface/devices/cia402.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <vector>

#include "firmware_interface/devices/wire.h"

namespace tumbler {
namespace {

/// The host of one CiA 402 drive, and hand-made frames of the drive.
class Cia402Host : public ::testing::Test {
 protected:
  explicit Cia402Host(const Cia402Config& c = Cia402Protocol::Example(0)) : config(c), host(c) {}
  std::vector<CanFrame> Tick(DriveRequest request, const DriveSetpoint& setpoint = kHold) {
    FrameBatch batch;
    EXPECT_EQ(host.Encode(request, setpoint, batch), Status::kOk);
    return {batch.frames().begin(), batch.frames().end()};
  }
  void Report(Cia402State state, std::uint16_t more = 0) {
    host.Decode(
        EncodeCia402(1, Cia402Status{static_cast<std::uint16_t>(StatuswordOf(state) | more), 10}));
  }
  void Reply(SdoReply::Kind kind, std::uint16_t index, std::uint8_t sub, std::uint32_t value) {
    EXPECT_FALSE(host.Decode(EncodeSdoReply(1, {kind, index, sub, 4, value})));
  }
  /// Answers the set-up until the drive has been asked for its mode.
  void SetUp() override {
    Tick(DriveRequest::kDisable);  // NMT
    SdoRequest request;
    for (int step = 0; Cia402SetUp(config, step, request); ++step) {
      Tick(DriveRequest::kDisable);
      Reply(SdoReply::Kind::kWritten, request.index, request.sub, 0);
    }
    Tick(DriveRequest::kDisable);  // NMT start
    Report(Cia402State::kSwitchOnDisabled);
    Tick(DriveRequest::kDisable);  // The mode is asked for.
    EXPECT_EQ(host.state(), DriveState::kUnknown);
  }
  /// Answers that the mode is the one of the set-up.
  void ConfirmMode() {
    Reply(SdoReply::Kind::kRead, 0x6061, 0, 8);
    EXPECT_EQ(host.state(), DriveState::kDisabled);
  }
  void Enable(const DriveSetpoint& setpoint = kHold) {
    for (const Cia402State state :
         {Cia402State::kSwitchOnDisabled, Cia402State::kSwitchOnDisabled, Cia402State::kReady,
          Cia402State::kSwitchedOn, Cia402State::kEnabled}) {
      Report(state);
      Tick(DriveRequest::kEnable, setpoint);
    }
    EXPECT_EQ(host.state(), DriveState::kEnabled);
  }
  static int ControlwordOf(const std::vector<CanFrame>& frames) {
    Cia402Command command;
    for (const CanFrame& frame : frames) {
      if (DecodeCia402(1, frame, command) == Status::kOk) return command.controlword;
    }
    return -1;
  }

  static constexpr DriveSetpoint kHold{0, 0, 0, 10, 1};
  static constexpr DriveSetpoint kBrake{0, 0, 0, 0, 1};
  Cia402Config config;
  Cia402Drive host;
};

TEST_F(Cia402Host, AModeThatIsNotThatOfTheSetUpIsAskedForAgain) {
  Reply(SdoReply::Kind::kRead, 0x6060, 0, 8);  // the answer to something else
  EXPECT_EQ(host.state(), DriveState::kUnknown);
  Reply(SdoReply::Kind::kWritten, 0x6061, 0, 8);
  Tick(DriveRequest::kDisable);
  Reply(SdoReply::Kind::kRead, 0x6061, 0, 1);
  EXPECT_EQ(host.state(), DriveState::kUnknown);
  const std::vector<CanFrame> frames = Tick(DriveRequest::kDisable);
  SdoRequest request;
  bool asked = false;
  for (const CanFrame& frame : frames) {
    asked =
        asked || (DecodeSdoRequest(1, frame, request) == Status::kOk && request.index == 0x6061);
  }
  EXPECT_TRUE(asked);
  ConfirmMode();
  Reply(SdoReply::Kind::kAborted, 0x6061, 0, 1);  // Nobody has asked.
  EXPECT_EQ(host.state(), DriveState::kDisabled);
}

TEST_F(Cia402Host, AModeThatIsRefusedIsAFaultWithTheAbortCodeOrAGeneralOne) {
  Reply(SdoReply::Kind::kAborted, 0x6061, 0, 0x0602'0000);
  EXPECT_EQ(host.state(), DriveState::kFault);
  EXPECT_EQ(host.feedback().error, 0x0602'0000U);
  EXPECT_EQ(host.set_up_refusal().index, 0x6061);
  Cia402Drive other(config);
  Tick(DriveRequest::kClearErrors);
  EXPECT_EQ(host.set_up_refusal().code, 0U);
  SetUp();
  Reply(SdoReply::Kind::kAborted, 0x6061, 0, 0);
  EXPECT_EQ(host.feedback().error, kEmergencyGeneric);
}

TEST(Cia402SetUpOfAHost, AnswersToOtherRequestsAreLeftAloneAndARefusalWithoutACodeHasAGeneralOne) {
  const Cia402Config config = Cia402Protocol::Example(0);
  Cia402Drive host(config);
  const auto tick = [&host] {
    FrameBatch batch;
    EXPECT_EQ(host.Encode(DriveRequest::kDisable, {}, batch), Status::kOk);
  };
  SdoRequest first;
  ASSERT_TRUE(Cia402SetUp(config, 0, first));
  tick();
  tick();
  const auto reply = [&](SdoReply::Kind kind, std::uint16_t index, std::uint8_t sub,
                         std::uint32_t value) {
    EXPECT_FALSE(host.Decode(EncodeSdoReply(1, {kind, index, sub, 4, value})));
  };
  const auto next = static_cast<std::uint16_t>(first.index + 1);
  const auto sub = static_cast<std::uint8_t>(first.sub + 1);
  reply(SdoReply::Kind::kAborted, next, first.sub, 5);
  reply(SdoReply::Kind::kAborted, first.index, sub, 5);
  EXPECT_EQ(host.feedback().error, 0U);
  EXPECT_FALSE(host.Decode(EncodeCia402(1, Cia402Status{0x40, 0}))) << "not mapped yet";
  EXPECT_FALSE(host.Decode(EncodeCia402(1, Cia402Motion{1, 1})));
  EXPECT_FALSE(host.feedback().has_torque);
  reply(SdoReply::Kind::kAborted, first.index, first.sub, 0);
  EXPECT_EQ(host.feedback().error, kEmergencyGeneric);
  EXPECT_EQ(host.set_up_refusal().index, first.index);
  FrameBatch batch;
  EXPECT_EQ(host.Encode(DriveRequest::kClearErrors, {}, batch), Status::kOk);
  tick();
  reply(SdoReply::Kind::kRead, first.index, first.sub, 7);  // Nobody has asked for a value.
  EXPECT_EQ(host.set_up_refusal().index, first.index);
}

TEST_F(Cia402Host, FramesThatAreTooShortOrOfNoKnownKindChangeNothing) {
  ConfirmMode();
  Report(Cia402State::kSwitchOnDisabled);
  const auto shortened = [this](CanFrame frame) {
    frame.size = 0;
    EXPECT_FALSE(host.Decode(frame));
  };
  shortened(EncodeCia402(1, Cia402Status{0x37, 5}));
  shortened(EncodeCia402(1, Cia402Motion{5, 5}));
  shortened(EncodeEmergency(1, {0x7305, 0, {}}));
  shortened(EncodeSdoReply(1, {SdoReply::Kind::kAborted, 0x6061, 0, 4, 5}));
  shortened(EncodeNodeState(1, NmtState::kBootUp));
  EXPECT_FALSE(host.Decode(DataFrame(0x381, 8))) << "TPDO3";
  EXPECT_FALSE(host.Decode(EncodeCia402(2, Cia402Status{0x37, 5}))) << "another node's";
  EXPECT_EQ(host.state(), DriveState::kDisabled);
  EXPECT_EQ(host.feedback().error, 0U);
}

TEST_F(Cia402Host, ANodeThatIsNoLongerOperationalIsSetUpAnew) {
  ConfirmMode();
  EXPECT_FALSE(host.Decode(EncodeNodeState(1, NmtState::kOperational)));
  EXPECT_EQ(host.state(), DriveState::kDisabled);
  EXPECT_FALSE(host.Decode(EncodeNodeState(1, NmtState::kStopped)));
  EXPECT_EQ(host.state(), DriveState::kUnknown);
}

TEST_F(Cia402Host, AFaultReactionAndAFollowingErrorAreErrors) {
  ConfirmMode();
  Enable();
  Report(Cia402State::kEnabled, kCia402FollowingError);
  EXPECT_EQ(host.feedback().error, kEmergencyFollowingError);
  Report(Cia402State::kSwitchOnDisabled, kCia402FollowingError);
  EXPECT_EQ(host.feedback().error, 0U) << "means something else there";
  Report(Cia402State::kFaultReaction);
  EXPECT_EQ(host.feedback().error, kEmergencyGeneric);
  Report(Cia402State::kFault);
  EXPECT_EQ(host.feedback().error, kEmergencyGeneric);
}

TEST_F(Cia402Host, BrakesByAQuickStopAndFollowsAgainOnceItIsEnabled) {
  ConfirmMode();
  Enable();
  EXPECT_EQ(ControlwordOf(Tick(DriveRequest::kEnable, kBrake)), cia402_control::kQuickStop);
  EXPECT_EQ(host.state(), DriveState::kEnabled);
  Report(Cia402State::kQuickStop);
  EXPECT_EQ(host.state(), DriveState::kEnabled);
  EXPECT_EQ(ControlwordOf(Tick(DriveRequest::kEnable, kHold)), cia402_control::kQuickStop);
  Report(Cia402State::kEnabled);
  EXPECT_EQ(ControlwordOf(Tick(DriveRequest::kEnable, kHold)), cia402_control::kEnable);
  Tick(DriveRequest::kEnable, kBrake);
  Report(Cia402State::kSwitchOnDisabled);
  EXPECT_EQ(host.state(), DriveState::kDisabled);
  Tick(DriveRequest::kEnable, kBrake);
  Report(Cia402State::kEnabled);
  EXPECT_EQ(host.state(), DriveState::kDisabled) << "it stays off until it was asked to disable";
}

TEST_F(Cia402Host, ADriveThatIsEnabledWhileItShouldBrakeBrakesAtOnce) {
  ConfirmMode();
  Enable(kBrake);
  EXPECT_EQ(ControlwordOf(Tick(DriveRequest::kEnable, kBrake)), cia402_control::kQuickStop);
}

TEST_F(Cia402Host, AnErrorWhileItIsBeingEnabledTakesTheTorqueAway) {
  ConfirmMode();
  Report(Cia402State::kSwitchOnDisabled);
  Tick(DriveRequest::kEnable);
  host.Decode(EncodeEmergency(1, {0x7305, 0, {}}));
  Tick(DriveRequest::kEnable);
  EXPECT_EQ(host.state(), DriveState::kFault);
  host.Decode(EncodeEmergency(1, {}));
  Tick(DriveRequest::kEnable);
  EXPECT_EQ(ControlwordOf(Tick(DriveRequest::kEnable)), cia402_control::kSwitchOn - 1);
  host.Decode(EncodeEmergency(1, {0x7305, 0, {}}));
  EXPECT_EQ(ControlwordOf(Tick(DriveRequest::kEnable)), cia402_control::kDisableVoltage);
  host.Decode(EncodeEmergency(1, {}));
  EXPECT_EQ(ControlwordOf(Tick(DriveRequest::kEnable)), cia402_control::kDisableVoltage);
}

TEST_F(Cia402Host, InAStateOutOfTheOrderOfEnablingTheTorqueIsOff) {
  ConfirmMode();
  Report(Cia402State::kSwitchOnDisabled);
  Tick(DriveRequest::kEnable);
  Tick(DriveRequest::kEnable);
  Report(Cia402State::kQuickStop);
  EXPECT_EQ(ControlwordOf(Tick(DriveRequest::kEnable)), cia402_control::kDisableVoltage);
  EXPECT_EQ(host.state(), DriveState::kEnabling);
}

TEST_F(Cia402Host, AFollowingDriveThatReportsNoMoreIsLostAndASetpointThatIsNoNumberEndsIt) {
  ConfirmMode();
  Enable();
  for (int i = 0; i < 3 * config.heartbeat_ms + 10; ++i) Tick(DriveRequest::kEnable);
  EXPECT_EQ(host.state(), DriveState::kLost);
  host.Decode(EncodeNodeState(1, NmtState::kOperational));
  EXPECT_EQ(host.state(), DriveState::kEnabled);
  FrameBatch batch;
  EXPECT_EQ(host.Encode(DriveRequest::kEnable,
                        {std::numeric_limits<float>::quiet_NaN(), 0, 0, 10, 1}, batch),
            Status::kInvalidArgument);
  Cia402Command command;
  bool off = false;
  for (const CanFrame& frame : batch.frames())
    off = off || (DecodeCia402(1, frame, command) == Status::kOk && command.controlword == 0);
  EXPECT_TRUE(off);
}

Cia402Config Bare() {
  Cia402Config config = Cia402Protocol::Example(0);
  config.feed_forward = false;
  config.watchdog_ms = 0;
  config.leader = false;
  config.following_window_rad = 0.5F;
  config.heartbeat_ms = 1;
  return config;
}
class Cia402BareHost : public Cia402Host {
 protected:
  Cia402BareHost() : Cia402Host(Bare()) {}
};

TEST_F(Cia402BareHost, WithoutFeedForwardAndNotLeadingItSendsOneFrameATick) {
  ConfirmMode();
  Enable();
  host.Decode(EncodeNodeState(1, NmtState::kOperational));
  const std::vector<CanFrame> frames = Tick(DriveRequest::kEnable, {0.5F, 1, 1, 10, 1});
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].id, canopen_id::kRpdo1 + 1);
  EXPECT_EQ(host.encoded_setpoint().velocity_rad_s, 0);
  EXPECT_NEAR(host.encoded_setpoint().position_rad, 0.5F, 1e-4F);
}

TEST(Cia402Hosts, AWatchdogOfLessThanThreeTicksIsFedInEachAndNoneIsNotFed) {
  Cia402Config config = Cia402Protocol::Example(0);
  const auto heartbeats = [&config] {
    Cia402Drive host(config);
    int count = 0;
    for (int i = 0; i < 10; ++i) {
      FrameBatch batch;
      EXPECT_EQ(host.Encode(DriveRequest::kDisable, {}, batch), Status::kOk);
      for (const CanFrame& frame : batch.frames())
        count += frame.id == canopen_id::kHeartbeat + config.host_id ? 1 : 0;
    }
    return count;
  };
  config.watchdog_ms = 2;
  EXPECT_EQ(heartbeats(), 10);
  config.watchdog_ms = 0;
  EXPECT_EQ(heartbeats(), 0);
}

}  // namespace
}  // namespace tumbler
