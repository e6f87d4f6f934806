#include "firmware_interface/devices/cansimple.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "firmware_interface/devices/error_texts.h"
#include "firmware_interface/devices/simulated_cansimple.h"
#include "firmware_interface/devices/wire.h"

namespace tumbler {
namespace {

using Bytes = std::array<std::uint8_t, 8>;

TEST(CanSimple, FramesAreThoseOfTheProtocolsTable) {
  // Little-endian, identifier node << 5 | command; floats as IEEE 754: 1.5 is 3f c0 00 00.
  const CanFrame input = EncodeCanSimple(3, CanSimpleInputPos{1.5F, -2.0F, 0.25F});
  EXPECT_EQ(input.id, 0x06cU);
  EXPECT_EQ(input.size, 8);
  EXPECT_EQ(input.data, (Bytes{0x00, 0x00, 0xc0, 0x3f, 0x30, 0xf8, 0xfa, 0x00}));
  const CanFrame mode = EncodeCanSimple(3, CanSimpleControllerMode{});
  EXPECT_EQ(mode.id, 0x06bU);
  EXPECT_EQ(mode.data, (Bytes{3, 0, 0, 0, 1, 0, 0, 0}));
  const CanFrame state = EncodeCanSimple(62, CanSimpleAxisState{kCanSimpleClosedLoop});
  EXPECT_EQ(state.id, 0x7c7U);
  EXPECT_EQ(state.size, 4);
  EXPECT_EQ(state.data[0], 8);
  EXPECT_EQ(EncodeCanSimpleEstop(1).id, 0x022U);
  EXPECT_EQ(EncodeCanSimpleEstop(1).size, 0);
  EXPECT_EQ(EncodeCanSimpleClearErrors(1).id, 0x038U);
  CanFrame heartbeat = DataFrame(0x021, 8);
  heartbeat.data = {0x00, 0x00, 0x00, 0x01, 0x01, 0x03, 0x01, 0x00};
  CanSimpleHeartbeat read;
  ASSERT_EQ(DecodeCanSimple(1, heartbeat, read), Status::kOk);
  EXPECT_EQ(read.error, kCanSimpleWatchdogExpired);
  EXPECT_EQ(read.state, kCanSimpleIdle);
  EXPECT_EQ(read.procedure_result, 3);
  EXPECT_TRUE(read.trajectory_done);
}

TEST(CanSimple, OnlyItsOwnDataFramesAreTaken) {
  CanFrame frame = EncodeCanSimple(5, CanSimpleEstimates{1, 2});
  CanSimpleEstimates estimates;
  EXPECT_EQ(DecodeCanSimple(5, frame, estimates), Status::kOk);
  EXPECT_EQ(DecodeCanSimple(4, frame, estimates), Status::kInvalidArgument);
  CanSimpleTorques torques;
  EXPECT_EQ(DecodeCanSimple(5, frame, torques), Status::kInvalidArgument);
  for (const auto& spoil :
       {+[](CanFrame& f) { f.remote = true; }, +[](CanFrame& f) { f.extended = true; },
        +[](CanFrame& f) { f.size = 7; }}) {
    CanFrame bad = frame;
    spoil(bad);
    EXPECT_EQ(DecodeCanSimple(5, bad, estimates), Status::kInvalidArgument);
  }
  EXPECT_EQ(estimates.position_rev, 1);
}

TEST(CanSimple, FeedForwardsRoundToNearestAndSaturateInsteadOfWrapping) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> wide(-200, 200);
  double bias = 0;
  int inside = 0;
  for (int i = 0; i < 100000; ++i) {
    const CanSimpleInputPos asked{0, wide(random), wide(random)};
    CanSimpleInputPos read;
    ASSERT_EQ(DecodeCanSimple(0, EncodeCanSimple(0, asked), read), Status::kOk);
    for (const auto& [in, out] : {std::pair{asked.velocity_rev_s, read.velocity_rev_s},
                                  std::pair{asked.torque_nm, read.torque_nm}}) {
      if (std::abs(in) > 32.767F) {
        ASSERT_NEAR(out, std::copysign(32.767F, in), 1e-5F) << in;
      } else {
        ASSERT_NEAR(out, in, 0.0005F + 4e-6F) << in;
        bias += static_cast<double>(out) - static_cast<double>(in);
        ++inside;
      }
    }
  }
  EXPECT_LT(std::abs(bias / inside), 1e-5) << "truncation would be 5e-4 off towards zero";
  CanSimpleInputPos read;
  const float inf = std::numeric_limits<float>::infinity();
  ASSERT_EQ(DecodeCanSimple(0, EncodeCanSimple(0, CanSimpleInputPos{0, inf, -inf}), read),
            Status::kOk);
  EXPECT_GT(read.velocity_rev_s, 32);
  EXPECT_LT(read.torque_nm, -32);
}

/// A host drive, and hand-made messages of the real one.
class CanSimpleDriveTest : public ::testing::Test {
 protected:
  std::vector<CanFrame> Tick(DriveRequest request, const DriveSetpoint& setpoint = Setpoint(0.5F)) {
    FrameBatch batch;
    EXPECT_EQ(drive.Encode(request, setpoint, batch), Status::kOk);
    return {batch.frames().begin(), batch.frames().end()};
  }
  static DriveSetpoint Setpoint(float position_rad) { return {position_rad, 0, 0, 100, 2}; }
  void Estimate(float rev) {
    EXPECT_TRUE(drive.Decode(EncodeCanSimple(0, CanSimpleEstimates{rev, 0})));
  }
  void Heartbeat(std::uint8_t state, std::uint32_t error = 0) {
    CanSimpleHeartbeat heartbeat;
    heartbeat.state = state;
    heartbeat.error = error;
    EXPECT_FALSE(drive.Decode(EncodeCanSimple(0, heartbeat))) << "it brings no position";
  }
  void Enable() {
    Estimate(0.1F);
    Heartbeat(kCanSimpleIdle);
    for (int i = 0; i < 4; ++i) Tick(DriveRequest::kEnable);
    Heartbeat(kCanSimpleClosedLoop);
    Tick(DriveRequest::kEnable);
    EXPECT_EQ(drive.state(), DriveState::kEnabled);
  }
  static bool IsOnly(const std::vector<CanFrame>& frames, CanSimpleCommand command) {
    return frames.size() == 1 && frames[0].id == CanSimpleId(0, command);
  }

  CanSimpleDrive drive{CanSimpleConfig{}};
};

TEST_F(CanSimpleDriveTest, AsksForClosedLoopOnceAfterTellingWhereToStay) {
  Estimate(0.25F);
  Heartbeat(kCanSimpleIdle);
  EXPECT_TRUE(IsOnly(Tick(DriveRequest::kEnable), CanSimpleCommand::kSetAxisState));
  CanSimpleControllerMode mode{0, 0};
  CanSimpleInputPos input;
  CanSimpleAxisState state;
  for (int i = 0; i < 2; ++i) {
    const auto frames = Tick(DriveRequest::kEnable);
    ASSERT_EQ(frames.size(), 2U);
    EXPECT_EQ(DecodeCanSimple(0, frames[0], mode), Status::kOk);
    EXPECT_EQ(mode.control, kCanSimplePositionControl);
    EXPECT_EQ(DecodeCanSimple(0, frames[1], input), Status::kOk);
    EXPECT_NEAR(input.position_rev, 0.25F, 1e-6F);
    EXPECT_EQ(drive.state(), DriveState::kEnabling);
  }
  const auto frames = Tick(DriveRequest::kEnable);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(DecodeCanSimple(0, frames[0], input), Status::kOk);
  EXPECT_NEAR(input.position_rev, 0.25F, 1e-6F);
  EXPECT_EQ(DecodeCanSimple(0, frames[1], state), Status::kOk);
  EXPECT_EQ(state.state, kCanSimpleClosedLoop);
  Estimate(0.3F);  // The joint moves a little; the position that it is held at does not.
  for (int i = 0; i < 50; ++i) {
    const auto waiting = Tick(DriveRequest::kEnable);
    ASSERT_TRUE(IsOnly(waiting, CanSimpleCommand::kSetInputPos));
    ASSERT_EQ(DecodeCanSimple(0, waiting[0], input), Status::kOk);
    ASSERT_NEAR(input.position_rev, 0.25F, 1e-6F);
    EXPECT_EQ(drive.state(), DriveState::kEnabling);
  }
}

TEST_F(CanSimpleDriveTest, PreparesNothingWhileTheDriveStillSaysThatItIsOn) {
  Estimate(0.25F);
  Heartbeat(kCanSimpleClosedLoop);
  for (int i = 0; i < 50; ++i)
    ASSERT_TRUE(IsOnly(Tick(DriveRequest::kEnable), CanSimpleCommand::kSetAxisState));
  Heartbeat(kCanSimpleIdle);
  EXPECT_EQ(Tick(DriveRequest::kEnable).size(), 2U);
}

TEST_F(CanSimpleDriveTest, LeavesADriveAloneThatIsInAnotherStateThanIdleAfterTheRequest) {
  constexpr std::uint8_t kCalibrating = 3;
  Estimate(0.25F);
  Heartbeat(kCanSimpleIdle);
  for (int i = 0; i < 4; ++i) Tick(DriveRequest::kEnable);
  for (int i = 0; i < 600; ++i) {
    if (i % 10 == 0) Heartbeat(kCalibrating);
    ASSERT_TRUE(IsOnly(Tick(DriveRequest::kEnable), CanSimpleCommand::kSetInputPos)) << i;
  }
}

TEST_F(CanSimpleDriveTest, ItsFirstPositionIsWhereAMovingJointIsWhenClosedLoopIsAskedFor) {
  Heartbeat(kCanSimpleIdle);
  float measured = 0.1F;
  for (int i = 0; i < 4; ++i) {
    measured += 0.01F;
    Estimate(measured);
    CanSimpleInputPos input;
    for (const CanFrame& frame : Tick(DriveRequest::kEnable)) {
      if (DecodeCanSimple(0, frame, input) != Status::kOk) continue;
      EXPECT_NEAR(input.position_rev, measured, 1e-5F) << i;
    }
  }
  const auto held = Tick(DriveRequest::kEnable);
  CanSimpleInputPos input;
  ASSERT_EQ(DecodeCanSimple(0, held.at(0), input), Status::kOk);
  EXPECT_NEAR(input.position_rev, measured, 1e-5F);
}

TEST_F(CanSimpleDriveTest, RepeatsARequestThatGotLost) {
  Estimate(0);
  int requests = 0;
  for (int i = 0; i < 600; ++i) {
    if (i % 10 == 0) Heartbeat(kCanSimpleIdle);
    for (const CanFrame& frame : Tick(DriveRequest::kEnable)) {
      CanSimpleAxisState state;
      if (DecodeCanSimple(0, frame, state) == Status::kOk && state.state == kCanSimpleClosedLoop) {
        ++requests;
      }
    }
  }
  EXPECT_EQ(requests, 3);
}

TEST_F(CanSimpleDriveTest, SendsNothingButSetpointsWhileItFollows) {
  // Any frame feeds the watchdog: a request for telemetry would keep a dead host's drive alive.
  Enable();
  std::mt19937 random(2);
  for (int i = 0; i < 5000; ++i) {
    Estimate(std::uniform_real_distribution<float>(-1, 1)(random));
    if (i % 10 == 0) Heartbeat(kCanSimpleClosedLoop);
    if (i % 7 == 0) drive.Decode(EncodeCanSimple(0, CanSimpleTemperature{30, 40}));
    ASSERT_TRUE(IsOnly(Tick(DriveRequest::kEnable), CanSimpleCommand::kSetInputPos));
  }
}

TEST_F(CanSimpleDriveTest, ADriveThatDroppedOutStaysOffUntilDisabled) {
  for (const bool with_error : {false, true}) {
    Tick(DriveRequest::kDisable);
    Enable();
    Heartbeat(kCanSimpleIdle, with_error ? kCanSimpleEstopRequested : 0);
    EXPECT_NE(drive.state(), DriveState::kEnabled);
    for (int i = 0; i < 1000; ++i) {
      if (i % 10 == 0) Heartbeat(kCanSimpleIdle);  // Even when the error is gone.
      const auto frames = Tick(DriveRequest::kEnable);
      ASSERT_TRUE(IsOnly(frames, CanSimpleCommand::kSetAxisState));
      ASSERT_EQ(frames[0].data[0], kCanSimpleIdle);
    }
  }
  Tick(DriveRequest::kDisable);
  Enable();
}

TEST_F(CanSimpleDriveTest, IsUnknownBeforeTheFirstHeartbeatAndLostAfterTheLast) {
  Estimate(0);
  Tick(DriveRequest::kDisable);
  EXPECT_EQ(drive.state(), DriveState::kUnknown);
  Enable();
  for (int i = 0; i < drive.config().heartbeat_ticks_max + 1; ++i) {
    Estimate(0);
    Tick(DriveRequest::kEnable);
  }
  EXPECT_EQ(drive.state(), DriveState::kLost);
  EXPECT_GT(drive.heartbeat().ticks, drive.config().heartbeat_ticks_max);
  EXPECT_EQ(drive.heartbeat().limit_ticks, drive.config().heartbeat_ticks_max);
}

TEST_F(CanSimpleDriveTest, ClearsErrorsOnlyWhenAskedTo) {
  Heartbeat(kCanSimpleIdle, 0x20);
  Estimate(0);
  const auto clears = [](const std::vector<CanFrame>& frames) {
    for (const CanFrame& frame : frames) {
      if (frame.id == CanSimpleId(0, CanSimpleCommand::kClearErrors)) return true;
    }
    return false;
  };
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(clears(Tick(i % 2 == 0 ? DriveRequest::kDisable : DriveRequest::kEnable)));
  }
  EXPECT_EQ(drive.state(), DriveState::kFault);
  EXPECT_EQ(drive.feedback().error, 0x20U);
  EXPECT_TRUE(clears(Tick(DriveRequest::kClearErrors)));
}

TEST_F(CanSimpleDriveTest, TakesTheHotterSensorAndIgnoresOneThatIsNotThere) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  drive.Decode(EncodeCanSimple(0, CanSimpleTemperature{50, 70}));
  EXPECT_EQ(drive.feedback().temperature_c, 70);
  drive.Decode(EncodeCanSimple(0, CanSimpleTemperature{50, nan}));
  EXPECT_EQ(drive.feedback().temperature_c, 50);
  EXPECT_TRUE(drive.feedback().has_temperature);
  drive.Decode(EncodeCanSimple(0, CanSimpleTemperature{nan, nan}));
  EXPECT_FALSE(drive.feedback().has_temperature);
}

/// A drive that acts on each frame as it comes, as firmware does: what it would follow at the
/// moment at which it is enabled.
struct FirmwareAxis {
  CanSimpleInputPos input{7, 0, 0};  // of an earlier host
  CanSimpleControllerMode mode{kCanSimpleVelocityControl, kCanSimplePassthrough};
  bool closed_loop = false;
  bool jumped = false;

  void Take(const CanFrame& frame) {
    CanSimpleAxisState state;
    if (DecodeCanSimple(0, frame, state) == Status::kOk) {
      closed_loop = state.state == kCanSimpleClosedLoop;
    } else if (DecodeCanSimple(0, frame, input) != Status::kOk) {
      static_cast<void>(DecodeCanSimple(0, frame, mode));
    }
    jumped = jumped || (closed_loop && (std::abs(input.position_rev - 0.25F) > 1e-6F ||
                                        mode.control != kCanSimplePositionControl));
  }
};

TEST(CanSimpleStartUp, IsTheSameInWhateverOrderEitherControllerSendsTheFramesOfATick) {
  // The host's controller may send the lowest identifier first, and the drive's any mailbox.
  std::array<int, 5> order{0, 1, 2, 3, 4};
  int orders = 0;
  do {
    CanSimpleDrive drive{CanSimpleConfig{}};
    FirmwareAxis axis;
    std::vector<DriveState> states;
    for (int tick = 0; tick < 30; ++tick) {
      if (tick % 3 == 0) {
        CanSimpleHeartbeat heartbeat;
        heartbeat.state = axis.closed_loop ? kCanSimpleClosedLoop : kCanSimpleIdle;
        const std::array frames{
            EncodeCanSimple(0, heartbeat), EncodeCanSimple(0, CanSimpleEstimates{0.25F, 0}),
            EncodeCanSimple(0, CanSimpleErrors{}), EncodeCanSimple(0, CanSimpleTorques{}),
            EncodeCanSimple(0, CanSimpleTemperature{30, 40})};
        for (const int i : order) drive.Decode(frames.at(static_cast<std::size_t>(i)));
      }
      FrameBatch batch;
      ASSERT_EQ(drive.Encode(DriveRequest::kEnable, {0.25F * 6.2831853F, 0, 0, 100, 2}, batch),
                Status::kOk);
      // Of five numbers in any order, those of the frames that there are also are in any order.
      const std::span<const CanFrame> sent = batch.frames();
      for (const int i : order) {
        if (static_cast<std::size_t>(i) < sent.size()) axis.Take(sent[static_cast<std::size_t>(i)]);
      }
      states.push_back(drive.state());
      ASSERT_FALSE(axis.jumped) << "tick " << tick << ", order " << orders;
    }
    EXPECT_TRUE(axis.closed_loop);
    EXPECT_EQ(states.back(), DriveState::kEnabled);
    EXPECT_EQ(std::ranges::count(states, DriveState::kEnabling), 6) << "order " << orders;
    ++orders;
  } while (std::ranges::next_permutation(order).found);
  EXPECT_EQ(orders, 120);
}

TEST_F(CanSimpleDriveTest, KeepsTheProcedureResultOfAFailureThroughTheOrdersThatFollowIt) {
  const auto heartbeat = [this](std::uint8_t state, std::uint8_t result) {
    CanSimpleHeartbeat message;
    message.state = state;
    message.procedure_result = result;
    drive.Decode(EncodeCanSimple(0, message));
  };
  Estimate(0.1F);
  heartbeat(kCanSimpleIdle, 0);
  for (int i = 0; i < 4; ++i) Tick(DriveRequest::kEnable);
  heartbeat(kCanSimpleIdle, 14);
  for (int i = 0; i < 300; ++i) {
    heartbeat(kCanSimpleIdle, 0);
    Tick(DriveRequest::kEnable);
  }
  EXPECT_EQ(drive.report().procedure_result, 14);
  drive.Decode(EncodeCanSimple(0, CanSimpleErrors{0, kCanSimpleWatchdogExpired}));
  EXPECT_EQ(DescribeRemarks(CanSimpleConfig{}, drive),
            "; its procedure result 14, not calibrated; disarm reason 0x01000000, watchdog timer "
            "expired");
  EXPECT_EQ(DescribeReport("odrive", {16, 0}), "procedure result 16");
  Tick(DriveRequest::kDisable);
  drive.Decode(EncodeCanSimple(0, CanSimpleErrors{}));
  Enable();
  EXPECT_EQ(DescribeRemarks(CanSimpleConfig{}, drive), "");
}

TEST_F(CanSimpleDriveTest, HasNoTorqueUntilTheDriveHasReportedOne) {
  Estimate(0.1F);
  Heartbeat(kCanSimpleIdle);
  EXPECT_FALSE(drive.feedback().has_torque);
  EXPECT_FALSE(drive.Decode(EncodeCanSimple(0, CanSimpleTorques{0.5F, 0})));
  EXPECT_TRUE(drive.feedback().has_torque) << "also where it is zero";
  EXPECT_EQ(drive.feedback().torque_nm, 0);
}

TEST(SimulatedCanSimple, AnyFrameFeedsItsWatchdogAndOnlyItsHostsSetpointsShould) {
  for (const bool poll : {false, true}) {
    SimulatedBus bus;
    SimulatedPort& host = bus.Attach();
    SimulatedCanSimpleConfig config;
    config.watchdog_s = 0.025;
    SimulatedCanSimpleDrive drive(config);
    drive.AttachTo(bus);
    ASSERT_EQ(host.Send(EncodeCanSimple(0, CanSimpleAxisState{kCanSimpleClosedLoop})), Status::kOk);
    for (std::int64_t t = 0; t < 100'000'000; t += 50'000) {
      bus.AdvanceTo(t);
      drive.Step(t, 0, 0);
      if (poll && t % 10'000'000 == 0) {
        CanFrame request = DataFrame(CanSimpleId(0, CanSimpleCommand::kGetTemperature), 8);
        request.remote = true;
        ASSERT_EQ(host.Send(request), Status::kOk);
      }
    }
    EXPECT_EQ(drive.enabled(), poll);
    EXPECT_EQ(drive.error(), poll ? 0U : kCanSimpleWatchdogExpired);
  }
}

TEST(CanSimpleConfig, RejectsWhatTheProtocolCannotCarry) {
  const auto rejected = [](auto change) {
    CanSimpleConfig config;
    change(config);
    return config.Validate() == Status::kInvalidArgument;
  };
  EXPECT_FALSE(rejected([](auto&) {}));
  EXPECT_TRUE(rejected([](auto& c) { c.node_id = 63; }));
  EXPECT_TRUE(rejected([](auto& c) { c.range.velocity_rad_s.max = 206; }));
  EXPECT_TRUE(rejected([](auto& c) { c.range.torque_nm.min = -33; }));
  EXPECT_TRUE(rejected([](auto& c) { c.range.position_rad.min = 0; }));
  EXPECT_TRUE(rejected([](auto& c) { c.heartbeat_ticks_max = 0; }));
  EXPECT_TRUE(rejected([](auto& c) { c.joint.gear_ratio = 0; }));
}

}  // namespace
}  // namespace tumbler
