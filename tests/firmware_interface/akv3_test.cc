#include "firmware_interface/devices/akv3.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "firmware_interface/can/frame_length.h"
#include "firmware_interface/devices/error_texts.h"
#include "firmware_interface/devices/simulated_akv3.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;

constexpr float kNoNumber = std::numeric_limits<float>::quiet_NaN();

CanFrame Encoded(AkV3Drive& drive, DriveRequest request, const DriveSetpoint& setpoint = {}) {
  FrameBatch batch;
  EXPECT_EQ(drive.Encode(request, setpoint, batch), Status::kOk);
  EXPECT_EQ(batch.frames().size(), 1U);
  return batch.frames().empty() ? CanFrame{} : batch.frames()[0];
}

AkV3Config ConfigWith(std::uint8_t id) {
  AkV3Config config;
  config.node_id = id;
  config.torque_constant_nm_per_a = 0.5F;
  return config;
}

AkV3Status StatusAt(std::int16_t position, std::uint8_t error = 0) {
  AkV3Status status;
  status.position = position;
  status.error = error;
  return status;
}

bool Report(AkV3Drive& drive, const AkV3Status& status) {
  return drive.Decode(EncodeAkV3Status(drive.config(), status));
}

/// A drive that follows setpoints.
void Follow(AkV3Drive& drive, const DriveSetpoint& setpoint) {
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(Report(drive, StatusAt(0)));
    Encoded(drive, DriveRequest::kEnable, setpoint);
  }
  ASSERT_EQ(drive.state(), DriveState::kEnabled);
}

// The frames are worked out by hand from the layout: kp 12, kd 12, position 16, velocity 12, torque
// 12 bits, the most significant first, with 2^n steps over +-12.56 rad, +-65 rad/s, 0 ... 500, 0
// ... 5 and +-18 N m.
TEST(AkV3Codec, AllZerosButGainsIsTheMiddleOfEveryRange) {
  const CanFrame frame = EncodeAkV3Command(ConfigWith(0x68), {0, 0, 100, 1, 0});
  EXPECT_EQ(frame.id, 0x868U);
  EXPECT_TRUE(frame.extended);
  EXPECT_EQ(frame.size, 8);
  // 100 / 500 * 4096 = 819.2 = 0x333, as 1 / 5 is; 0x8000, 0x800, 0x800.
  EXPECT_THAT(frame.data, ElementsAre(0x33, 0x33, 0x33, 0x80, 0x00, 0x80, 0x08, 0x00));
}

TEST(AkV3Codec, EachFieldHasItsOwnBits) {
  // (3.14 + 12.56) / 25.12 * 65536 = 40960 = 0xa000; (-32.5 + 65) / 130 * 4096 = 1024 = 0x400;
  // 250 / 500 * 4096 = 0x800; 1.25 / 5 * 4096 = 0x400; (9 + 18) / 36 * 4096 = 3072 = 0xc00.
  const CanFrame frame = EncodeAkV3Command(ConfigWith(2), {3.14F, -32.5F, 250, 1.25F, 9});
  EXPECT_EQ(frame.id, 0x802U);
  EXPECT_THAT(frame.data, ElementsAre(0x80, 0x04, 0x00, 0xa0, 0x00, 0x40, 0x0c, 0x00));
}

TEST(AkV3Codec, BothEndsOfEveryRangeSaturate) {
  const AkV3Config config = ConfigWith(1);
  for (const float factor : {1.0F, 1.001F, 1e30F}) {
    EXPECT_THAT(EncodeAkV3Command(
                    config, {12.56F * factor, 65 * factor, 500 * factor, 5 * factor, 18 * factor})
                    .data,
                ElementsAre(0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff));
    EXPECT_THAT(
        EncodeAkV3Command(config, {-12.56F * factor, -65 * factor, 0, -factor, -18 * factor}).data,
        ElementsAre(0, 0, 0, 0, 0, 0, 0, 0));
  }
  EXPECT_EQ(AkV3Quantise(kNoNumber, config.range.torque_nm, 12), 0);
}

TEST(AkV3Codec, EveryCodeComesBackAsItself) {
  const ImpedanceRanges range = kAkV3Ranges;
  for (unsigned code = 0; code <= 0xffff; ++code) {
    const auto value = static_cast<std::uint16_t>(code);
    ASSERT_EQ(AkV3Quantise(AkV3Dequantise(value, range.position_rad, 16), range.position_rad, 16),
              value);
    if (code > 0xfff) continue;
    for (const DriveRange& of :
         {range.velocity_rad_s, range.kp_nm_per_rad, range.kd_nm_s_per_rad, range.torque_nm}) {
      ASSERT_EQ(AkV3Quantise(AkV3Dequantise(value, of, 12), of, 12), value);
    }
  }
  EXPECT_EQ(AkV3Dequantise(0x800, range.torque_nm, 12), 0);
  EXPECT_EQ(AkV3Dequantise(0x8000, range.position_rad, 16), 0);
}

TEST(AkV3Codec, ReportsAreIntegersWithTheMostSignificantByteFirst) {
  // -90.0 degrees = -900 = 0xfc7c; 18900 ERPM = 1890 = 0x0762; -1.5 A = -150 = 0xff6a; 37 = 0x25.
  CanFrame frame;
  frame.id = 0x2968;
  frame.extended = true;
  frame.size = 8;
  frame.data = {0xfc, 0x7c, 0x07, 0x62, 0xff, 0x6a, 0x25, 0x04};
  AkV3Drive drive(ConfigWith(0x68));
  ASSERT_TRUE(drive.Decode(frame));
  const DriveFeedback feedback = drive.feedback();
  EXPECT_NEAR(feedback.position_rad, -1.5707963F, 1e-6F);
  // 18900 ERPM / 21 pole pairs / 9 of the gear are 100 turns a minute.
  EXPECT_NEAR(feedback.velocity_rad_s, 10.471976F, 1e-5F);
  EXPECT_NEAR(feedback.torque_nm, -0.75F, 1e-6F);
  EXPECT_TRUE(feedback.has_torque);
  EXPECT_EQ(feedback.temperature_c, 37);
  EXPECT_TRUE(feedback.has_temperature);
  EXPECT_EQ(feedback.error, 4U);
  EXPECT_EQ(drive.state(), DriveState::kFault);
  AkV3Status status;
  ASSERT_EQ(DecodeAkV3Status(drive.config(), frame, status), Status::kOk);
  EXPECT_EQ(EncodeAkV3Status(drive.config(), status), frame);
}

TEST(AkV3Drive, WithoutATorqueConstantTheTorqueIsNotMeasured) {
  AkV3Config config = ConfigWith(1);
  config.torque_constant_nm_per_a = 0;
  AkV3Drive drive(config);
  AkV3Status status;
  status.current = 500;
  ASSERT_TRUE(drive.Decode(EncodeAkV3Status(config, status)));
  EXPECT_FALSE(drive.feedback().has_torque);
  EXPECT_EQ(drive.feedback().torque_nm, 0);
}

TEST(AkV3Codec, OnlyItsOwnFramesOf29BitsAnd8BytesAreTaken) {
  const AkV3Config config = ConfigWith(1);
  const CanFrame report = EncodeAkV3Status(config, StatusAt(100));
  const CanFrame setpoint = EncodeAkV3Command(config, {});
  for (const auto change :
       {+[](CanFrame& f) { f.extended = false; }, +[](CanFrame& f) { f.remote = true; },
        +[](CanFrame& f) { f.size = 7; }, +[](CanFrame& f) { f.id ^= 2; },
        +[](CanFrame& f) { f.id ^= 0x100; }, +[](CanFrame& f) { f.id ^= 1U << 20; }}) {
    CanFrame spoilt = report;
    change(spoilt);
    AkV3Status status;
    EXPECT_EQ(DecodeAkV3Status(config, spoilt, status), Status::kInvalidArgument);
    EXPECT_FALSE(AkV3Drive(config).Decode(spoilt));
    spoilt = setpoint;
    change(spoilt);
    ImpedanceCommand command;
    EXPECT_EQ(DecodeAkV3Command(config, spoilt, command), Status::kInvalidArgument);
  }
}

TEST(AkV3Drive, TorqueOffIsTheFrameThatAsksForNothingInEveryTick) {
  AkV3Drive drive(ConfigWith(1));
  EXPECT_EQ(drive.state(), DriveState::kUnknown);
  for (const DriveRequest request : {DriveRequest::kDisable, DriveRequest::kClearErrors}) {
    const CanFrame off = Encoded(drive, request);
    ImpedanceCommand command;
    ASSERT_EQ(DecodeAkV3Command(drive.config(), off, command), Status::kOk);
    EXPECT_EQ(command.kp_nm_per_rad, 0);
    EXPECT_EQ(command.kd_nm_s_per_rad, 0);
    EXPECT_EQ(command.velocity_rad_s, 0);
    EXPECT_EQ(command.torque_nm, 0);
  }
  ASSERT_TRUE(Report(drive, StatusAt(0)));
  EXPECT_EQ(drive.state(), DriveState::kDisabled);
}

TEST(AkV3Drive, BeginsWhereItStandsAndOnlyWhileReportsCome) {
  AkV3Drive drive(ConfigWith(1));
  const DriveSetpoint far{2, 1, 3, 200, 4};
  ASSERT_TRUE(Report(drive, StatusAt(0)));
  // However many reports come in one tick, or ticks pass without one: four ticks have to bring one.
  for (int i = 0; i < 4; ++i) {
    for (int silent = 0; silent < 5; ++silent) {
      EXPECT_EQ(Encoded(drive, DriveRequest::kEnable, far).data[0], 0) << "no gains yet";
      EXPECT_EQ(drive.state(), DriveState::kEnabling);
    }
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(Report(drive, StatusAt(573)));  // 1.0001 rad
  }
  ImpedanceCommand command;
  const auto tick = [&] {
    return DecodeAkV3Command(drive.config(), Encoded(drive, DriveRequest::kEnable, far), command);
  };
  for (int i = 0; i < 4; ++i) {
    for (int silent = 0; silent < 5; ++silent) {
      ASSERT_EQ(tick(), Status::kOk);
      EXPECT_NEAR(command.position_rad, 1.0F, 1e-3F);
      EXPECT_NEAR(command.kp_nm_per_rad, 200, 0.1F);
      EXPECT_EQ(command.velocity_rad_s, 0);
      EXPECT_EQ(command.torque_nm, 0);
      EXPECT_EQ(drive.state(), DriveState::kEnabling);
    }
    ASSERT_TRUE(Report(drive, StatusAt(573)));
  }
  EXPECT_EQ(drive.state(), DriveState::kEnabled);
  ASSERT_EQ(tick(), Status::kOk);
  EXPECT_NEAR(command.position_rad, 2, 1e-3F);
  EXPECT_NEAR(command.torque_nm, 3, 1e-2F);
}

TEST(AkV3Drive, TheEncodedSetpointIsWhatTheDriveReads) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> any(-1.2F, 1.2F);
  for (const JointMap& joint :
       {JointMap{1, 1, 0}, JointMap{-1, 2.5F, 0.4F}, JointMap{1, 0.7F, -3}}) {
    AkV3Config config = ConfigWith(3);
    config.joint = joint;
    AkV3Drive drive(config);
    Follow(drive, {0, 0, 0, 10, 1});
    for (int i = 0; i < 1000; ++i) {
      const DriveSetpoint asked{any(random) * 13, any(random) * 60, any(random) * 18,
                                std::abs(any(random)) * 100, std::abs(any(random))};
      ImpedanceCommand command;
      ASSERT_EQ(DecodeAkV3Command(config, Encoded(drive, DriveRequest::kEnable, asked), command),
                Status::kOk);
      const DriveSetpoint seen = drive.encoded_setpoint();
      ASSERT_NEAR(seen.position_rad, joint.ToJointPosition(command.position_rad), 1e-5F);
      ASSERT_NEAR(seen.velocity_rad_s, joint.ToJointVelocity(command.velocity_rad_s), 2e-5F);
      ASSERT_NEAR(seen.torque_nm, joint.ToJointTorque(command.torque_nm), 2e-5F);
      ASSERT_NEAR(seen.kp_nm_per_rad, joint.ToJointGain(command.kp_nm_per_rad), 1e-3F);
      ASSERT_NEAR(seen.kd_nm_s_per_rad, joint.ToJointGain(command.kd_nm_s_per_rad), 1e-5F);
      // And it is the nearest that the wire carries.
      const ImpedanceCommand nearest{
          joint.ToDrivePosition(asked.position_rad), joint.ToDriveVelocity(asked.velocity_rad_s),
          joint.ToDriveGain(asked.kp_nm_per_rad), joint.ToDriveGain(asked.kd_nm_s_per_rad),
          joint.ToDriveTorque(asked.torque_nm)};
      const ImpedanceRanges& range = config.range;
      ASSERT_NEAR(command.position_rad, range.position_rad.Clamp(nearest.position_rad), 3.9e-4F);
      ASSERT_NEAR(command.velocity_rad_s, range.velocity_rad_s.Clamp(nearest.velocity_rad_s),
                  0.032F);
      ASSERT_NEAR(command.torque_nm, range.torque_nm.Clamp(nearest.torque_nm), 0.0089F);
    }
  }
}

TEST(AkV3Drive, ASetpointThatIsNoNumberTakesTheTorqueAway) {
  AkV3Drive drive(ConfigWith(1));
  Follow(drive, {0, 0, 0, 10, 1});
  FrameBatch batch;
  EXPECT_EQ(drive.Encode(DriveRequest::kEnable, {kNoNumber, 0, 0, 10, 1}, batch),
            Status::kInvalidArgument);
  ASSERT_EQ(batch.frames().size(), 1U);
  EXPECT_EQ(batch.frames()[0].data[0], 0);
  EXPECT_EQ(drive.state(), DriveState::kDisabled);
}

TEST(AkV3Drive, AnyCommandOfItsIdentifierIsSomebodyElses) {
  const AkV3Drive drive(ConfigWith(0x10));
  const auto frame = [](std::uint32_t id, bool extended) {
    return CanFrame{id, extended, false, 8, {}};
  };
  for (std::uint32_t function = 0; function <= 8; ++function)
    EXPECT_TRUE(drive.IsCommand(frame(function << 8 | 0x10, true))) << function;
  EXPECT_FALSE(drive.IsCommand(frame(0x2910, true))) << "a report";
  EXPECT_FALSE(drive.IsCommand(frame(0x811, true))) << "another drive's";
  EXPECT_FALSE(drive.IsCommand(frame(0x10, false))) << "11 bits";
}

TEST(AkV3Config, ValuesOutOfRangeAreNotValid) {
  EXPECT_EQ(AkV3Config().Validate(), Status::kOk);
  for (const auto change :
       {+[](AkV3Config& c) { c.pole_pairs = 0; }, +[](AkV3Config& c) { c.gear_inside = 0; },
        +[](AkV3Config& c) { c.gear_inside = kNoNumber; },
        +[](AkV3Config& c) { c.status_s = 0.001; },
        +[](AkV3Config& c) { c.torque_constant_nm_per_a = -1; },
        +[](AkV3Config& c) { c.range.kp_nm_per_rad.min = 1; },
        +[](AkV3Config& c) {
          c.range.torque_nm = {1, 2};
        },
        +[](AkV3Config& c) { c.joint.gear_ratio = 0; },
        +[](AkV3Config& c) { c.status_per_tick_max = 0; }}) {
    AkV3Config config;
    change(config);
    EXPECT_EQ(config.Validate(), Status::kInvalidArgument);
    AkV3Drive drive(config);
    FrameBatch batch;
    EXPECT_EQ(drive.Encode(DriveRequest::kEnable, {}, batch), Status::kInvalidArgument);
    EXPECT_TRUE(batch.frames().empty());
  }
}

TEST(AkV3Errors, HaveNames) {
  EXPECT_EQ(DescribeDriveError(AkV3Config(), 6), "0x06, transistors too hot");
  EXPECT_EQ(DescribeDriveError(AkV3Config(), 7), "0x07, motor stalled");
  EXPECT_EQ(DescribeDriveError(AkV3Config(), 8), "0x08");
}

/// A simulated drive and a host's port, without an executor.
struct Bench {
  explicit Bench(const SimulatedAkV3Config& config) : drive(config), host(bus.Attach()) {
    drive.AttachTo(bus);
  }
  void Advance(std::int64_t time_ns, double position_rad = 0) {
    for (std::int64_t t = bus.now_ns(); t <= time_ns; t += 100'000) {
      bus.AdvanceTo(t);
      torque_nm = drive.Step(t, position_rad, 0);
    }
  }
  std::vector<ReceivedFrame> Drain() {
    std::vector<ReceivedFrame> received;
    for (ReceivedFrame frame; host.Receive(frame) == Status::kOk;) received.push_back(frame);
    return received;
  }

  SimulatedBus bus;
  SimulatedAkV3Drive drive;
  SimulatedPort& host;
  double torque_nm = 0;
};

SimulatedAkV3Config Simulated(double watchdog_s) {
  SimulatedAkV3Config config;
  config.akv3 = ConfigWith(1);
  config.watchdog_s = watchdog_s;
  return config;
}

TEST(SimulatedAkV3, ReportsByItsOwnClockWithoutBeingAsked) {
  Bench bench(Simulated(0.05));
  bench.Advance(100'000'000, 1.0);
  const std::vector<ReceivedFrame> received = bench.Drain();
  EXPECT_EQ(received.size(), 50U);
  AkV3Drive host(ConfigWith(1));
  ASSERT_FALSE(received.empty());
  ASSERT_TRUE(host.Decode(received.back().frame));
  EXPECT_NEAR(host.feedback().position_rad, 1.0F, 2e-3F);
}

TEST(SimulatedAkV3, WithoutAWatchdogItHoldsItsLastSetpointForEver) {
  for (const double watchdog_s : {0.0, 0.05}) {
    Bench bench(Simulated(watchdog_s));
    ASSERT_EQ(bench.host.Send(EncodeAkV3Command(ConfigWith(1), {1, 0, 10, 0, 0})), Status::kOk);
    bench.Advance(40'000'000);
    EXPECT_NEAR(bench.torque_nm, 10, 0.1);
    bench.Advance(1'000'000'000);
    EXPECT_NEAR(bench.torque_nm, watchdog_s > 0 ? 0 : 10, 0.1);
    EXPECT_EQ(bench.drive.watchdog_expiries(), watchdog_s > 0 ? 1 : 0);
  }
}

TEST(SimulatedAkV3, TwoDrivesKeepTheBusNoBusierThanThePageSays) {
  // 4 frames of at most 160 bits in 2 ms.
  SimulatedBus bus;
  SimulatedPort& host = bus.Attach();
  SimulatedAkV3Config first = Simulated(0.05), second = Simulated(0.05);
  second.akv3.node_id = 2;
  SimulatedAkV3Drive a(first), b(second);
  a.AttachTo(bus);
  b.AttachTo(bus);
  for (std::int64_t tick = 0; tick < 1000; ++tick) {
    for (const auto& config : {first, second})
      ASSERT_EQ(host.Send(EncodeAkV3Command(config.akv3, {12, -60, 499, 4.9F, -17})), Status::kOk);
    for (int i = 0; i < 20; ++i) {
      const std::int64_t t = tick * 2'000'000 + std::int64_t{i} * 100'000;
      bus.AdvanceTo(t);
      a.Step(t, 0, 0);
      b.Step(t, 0, 0);
    }
  }
  EXPECT_LE(bus.load(), 640.0 / 2000);
  EXPECT_GE(bus.load(), 4 * 131.0 / 2000) << "131 bits without a stuff bit";
}

}  // namespace
}  // namespace tumbler
