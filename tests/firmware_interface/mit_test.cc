#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "firmware_interface/devices/mit.h"

namespace tumbler {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

CanFrame CommandFrame(std::array<std::uint8_t, 8> data) {
  CanFrame frame;
  frame.id = MitConfig().command_id;
  frame.size = 8;
  frame.data = data;
  return frame;
}

TEST(MitCodec, CommandsHaveTheBytesOfTheProtocol) {
  const MitConfig config;
  // The codes are worked out by hand: p 0x8000, v 0x800, kp 200 / 500 * 4095 = 1638 = 0x666,
  // kd 4 / 5 * 4095 = 3276 = 0xccc, t 0x800. Zero lies half a step below, and rounds up.
  const CanFrame frame = EncodeMitCommand(config, {0, 0, 200, 4, 0});
  EXPECT_EQ(frame, CommandFrame({0x80, 0x00, 0x80, 0x06, 0x66, 0xcc, 0xc8, 0x00}));
  EXPECT_EQ(EncodeMitCommand(config, {-12.5F, -50, 0, 0, -18}), CommandFrame({}));
  // p: (1.2345 + 12.5) * 65535 / 25 = 36003.7 -> 36004 = 0x8ca4. v: (-3 + 50) * 40.95 = 1924.65 ->
  // 1925 = 0x785. kp: 10 * 8.19 = 81.9 -> 82 = 0x052. kd: 0.5 * 819 = 409.5 -> 410 = 0x19a. t: (2 +
  // 18) * 113.75 = 2275 = 0x8e3.
  EXPECT_EQ(EncodeMitCommand(config, {1.2345F, -3, 10, 0.5F, 2}),
            CommandFrame({0x8c, 0xa4, 0x78, 0x50, 0x52, 0x19, 0xa8, 0xe3}));
}

TEST(MitCodec, RepliesHaveTheBytesOfTheProtocol) {
  const MitConfig config;
  MitReply reply;
  reply.sender = 1;
  reply.position_rad = 1.2345F;  // truncated: 36003 = 0x8ca3
  reply.velocity_rad_s = -3;     // truncated: 1924 = 0x784
  reply.torque_nm = 2.004F;      // (20.004) * 113.75 = 2275.455 -> 2275 = 0x8e3
  reply.temperature_c = 37;
  reply.error = 2;
  CanFrame expected;
  expected.id = 17;
  expected.size = 8;
  expected.data = {0x01, 0x8c, 0xa3, 0x78, 0x48, 0xe3, 37, 2};
  EXPECT_EQ(EncodeMitReply(config, reply), expected);
}

TEST(MitCodec, DamiaosRepliesHaveAStatusBesideTheIdentifierAndTwoTemperatures) {
  MitConfig config;
  config.dialect = MitDialect::kDamiao;
  CanFrame frame;
  frame.id = 17;
  frame.size = 8;
  frame.data = {0x11, 0x8c, 0xa3, 0x78, 0x48, 0xe3, 37, 41};
  MitReply reply;
  ASSERT_EQ(DecodeMitReply(config, frame, reply), Status::kOk);
  EXPECT_EQ(reply.sender, 1);
  EXPECT_NEAR(reply.position_rad, 1.2345F, 4e-4F);
  EXPECT_EQ(reply.temperature_c, 41) << "the hotter one";
  EXPECT_TRUE(reply.enabled);
  EXPECT_EQ(reply.error, 0);
  frame.data[0] = 0x01;
  ASSERT_EQ(DecodeMitReply(config, frame, reply), Status::kOk);
  EXPECT_FALSE(reply.enabled);
  frame.data[0] = 0xd1;
  ASSERT_EQ(DecodeMitReply(config, frame, reply), Status::kOk);
  EXPECT_EQ(reply.error, 13) << "lost communication";
  frame.data[0] = 0x12;
  EXPECT_NE(DecodeMitReply(config, frame, reply), Status::kOk) << "of another drive";
  frame.data[0] = 0x11;
  frame.size = 6;
  EXPECT_NE(DecodeMitReply(config, frame, reply), Status::kOk);
}

TEST(MitCodec, ARepliesFirstByteTellsItFromACommandWithTheSameIdentifier) {
  MitConfig config;
  config.reply_id = config.command_id;
  ASSERT_EQ(config.Validate(), Status::kOk);
  MitDrive drive(config);
  const CanFrame reply = EncodeMitReply(config, {1, 0.5F, 0, 0});
  EXPECT_TRUE(drive.Decode(reply));
  EXPECT_NEAR(drive.feedback().position_rad, 0.5F, 4e-4F);
  EXPECT_FALSE(drive.IsCommand(reply));
  const CanFrame command = EncodeMitCommand(config, {0.5F, 0, 10, 1, 0});
  EXPECT_FALSE(drive.Decode(command));
  EXPECT_TRUE(drive.IsCommand(command));
}

TEST(MitCodec, MagicFramesAreThoseOfTheProtocol) {
  const MitConfig config;
  EXPECT_EQ(MitMagicFrame(config, MitMagic::kEnter),
            CommandFrame({255, 255, 255, 255, 255, 255, 255, 0xfc}));
  EXPECT_EQ(MitMagicFrame(config, MitMagic::kExit),
            CommandFrame({255, 255, 255, 255, 255, 255, 255, 0xfd}));
  EXPECT_EQ(MitMagicFrame(config, MitMagic::kZero),
            CommandFrame({255, 255, 255, 255, 255, 255, 255, 0xfe}));
  for (const auto magic : {MitMagic::kEnter, MitMagic::kExit, MitMagic::kZero}) {
    MitMagic decoded{};
    EXPECT_TRUE(DecodeMitMagic(config, MitMagicFrame(config, magic), decoded));
    EXPECT_EQ(decoded, magic);
  }
}

TEST(MitCodec, EveryCodeOfEveryFieldRoundTrips) {
  ImpedanceRanges odd = kMitRanges;  // Its ranges are neither symmetric nor round.
  odd.position_rad = {-95.5F, 95.5F};
  odd.velocity_rad_s = {-25.64F, 25.64F};
  odd.torque_nm = {-9.7F, 31.3F};
  for (const ImpedanceRanges& ranges : {kMitRanges, odd}) {
    for (int code = 0; code <= 0xffff; ++code) {
      const float value = MitDequantise(static_cast<std::uint16_t>(code), ranges.position_rad, 16);
      ASSERT_EQ(MitQuantise(value, ranges.position_rad, 16), code);
    }
    for (const DriveRange& range :
         {ranges.velocity_rad_s, ranges.kp_nm_per_rad, ranges.kd_nm_s_per_rad, ranges.torque_nm}) {
      for (int code = 0; code <= 0xfff; ++code) {
        const float value = MitDequantise(static_cast<std::uint16_t>(code), range, 12);
        ASSERT_EQ(MitQuantise(value, range, 12), code);
      }
    }
  }
}

TEST(MitCodec, EveryCommandFrameRoundTripsThroughItsValues) {
  const MitConfig config;
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 200'000; ++trial) {
    CanFrame frame = CommandFrame({});
    for (auto& byte : frame.data) byte = static_cast<std::uint8_t>(random());
    ImpedanceCommand command;
    ASSERT_EQ(DecodeMitCommand(config, frame, command), Status::kOk);
    ASSERT_EQ(EncodeMitCommand(config, command), frame);
  }
}

TEST(MitCodec, RoundsToTheNearestCodeWithoutBias) {
  const ImpedanceRanges ranges = kMitRanges;
  std::mt19937_64 random(2);
  const auto check = [&random](const DriveRange& range, int bits) {
    const double step =
        (static_cast<double>(range.max) - static_cast<double>(range.min)) / ((1 << bits) - 1);
    std::uniform_real_distribution<float> any(range.min, range.max);
    double sum = 0;
    constexpr int kTrials = 100'000;
    for (int i = 0; i < kTrials; ++i) {
      const float value = any(random);
      const double error =
          static_cast<double>(MitDequantise(MitQuantise(value, range, bits), range, bits)) -
          static_cast<double>(value);
      ASSERT_LE(std::abs(error), 0.505 * step);
      sum += error;
    }
    // Truncation would give half a step. The mean of this many uniform errors has a standard
    // deviation of 0.001 steps.
    EXPECT_LT(std::abs(sum / kTrials), 0.01 * step);
  };
  check(ranges.position_rad, 16);
  check(ranges.velocity_rad_s, 12);
  check(ranges.kp_nm_per_rad, 12);
  check(ranges.kd_nm_s_per_rad, 12);
  check(ranges.torque_nm, 12);
}

TEST(MitCodec, ClampsAndIsDefinedForEveryFloat) {
  const DriveRange range{-50, 50};
  EXPECT_EQ(MitQuantise(50.1F, range, 12), 0xfff);
  EXPECT_EQ(MitQuantise(kInfinity, range, 12), 0xfff);
  EXPECT_EQ(MitQuantise(-1e30F, range, 12), 0);
  EXPECT_EQ(MitQuantise(-kInfinity, range, 12), 0);
  EXPECT_EQ(MitQuantise(kNan, range, 12), 0);
  EXPECT_EQ(MitQuantise(std::nextafter(50.0F, 0.0F), range, 12), 0xfff);
  EXPECT_EQ(MitQuantise(std::nextafter(12.5F, 0.0F), {-12.5F, 12.5F}, 16), 0xffff);
}

TEST(MitCodec, NoSetpointIsEverAMagicFrame) {
  const MitConfig config;
  const ImpedanceRanges& r = config.command;
  // These are the codes next to full scale, in every combination, with every torque code.
  for (int dp = 0; dp < 3; ++dp) {
    for (int low = 0; low < 8; ++low) {
      for (int t = 0; t <= 0xfff; ++t) {
        const auto near_top = [&](int bit) {
          return static_cast<std::uint16_t>((low >> bit & 1) != 0 ? 0xffe : 0xfff);
        };
        ImpedanceCommand command;
        command.position_rad =
            MitDequantise(static_cast<std::uint16_t>(0xffff - dp), r.position_rad, 16);
        command.velocity_rad_s = MitDequantise(near_top(0), r.velocity_rad_s, 12);
        command.kp_nm_per_rad = MitDequantise(near_top(1), r.kp_nm_per_rad, 12);
        command.kd_nm_s_per_rad = MitDequantise(near_top(2), r.kd_nm_s_per_rad, 12);
        command.torque_nm = MitDequantise(static_cast<std::uint16_t>(t), r.torque_nm, 12);
        const CanFrame frame = EncodeMitCommand(config, command);
        MitMagic magic{};
        ASSERT_FALSE(DecodeMitMagic(config, frame, magic));
        ImpedanceCommand decoded;
        ASSERT_EQ(DecodeMitCommand(config, frame, decoded), Status::kOk);
        // The guard costs at most one step of position, and only when it is needed.
        const bool guarded = dp == 0 && low == 0 && t >= 0xffc && t <= 0xffe;
        ASSERT_EQ(frame.data[0] << 8 | frame.data[1], 0xffff - dp - (guarded ? 1 : 0));
      }
    }
  }
}

TEST(MitCodec, RepliesOfSixSevenAndEightBytesDecode) {
  const MitConfig config;
  for (std::uint8_t size = 6; size <= 8; ++size) {
    MitReply reply;
    reply.sender = 1;
    reply.position_rad = -2.5F;
    reply.velocity_rad_s = 10;
    reply.torque_nm = -7;
    reply.size = size;
    reply.temperature_c = 41;
    reply.error = 4;
    MitReply decoded;
    ASSERT_EQ(DecodeMitReply(config, EncodeMitReply(config, reply), decoded), Status::kOk);
    EXPECT_EQ(decoded.sender, 1);
    EXPECT_EQ(decoded.size, size);
    EXPECT_NEAR(decoded.position_rad, -2.5F, 25.0F / 65535);
    EXPECT_NEAR(decoded.velocity_rad_s, 10, 100.0F / 4095);
    EXPECT_NEAR(decoded.torque_nm, -7, 36.0F / 4095);
    EXPECT_EQ(decoded.temperature_c, size == 8 ? 41.0F : 0.0F);
    EXPECT_EQ(decoded.error, size == 8 ? 4 : 0);
  }
}

TEST(MitCodec, TemperaturesRoundTripInBothEncodings) {
  for (const auto encoding : {MitTemperature::kSigned, MitTemperature::kOffset40}) {
    MitConfig config;
    config.temperature_encoding = encoding;
    const int low = encoding == MitTemperature::kSigned ? -128 : -40;
    for (int celsius = low; celsius < low + 256; ++celsius) {
      MitReply reply;
      reply.sender = 1;
      reply.temperature_c = static_cast<float>(celsius);
      MitReply decoded;
      ASSERT_EQ(DecodeMitReply(config, EncodeMitReply(config, reply), decoded), Status::kOk);
      ASSERT_EQ(decoded.temperature_c, static_cast<float>(celsius));
    }
  }
}

TEST(MitCodec, RepliesBeyondTheRangeWrapAsInFirmware) {
  const MitConfig config;
  MitReply reply;
  reply.sender = 1;
  reply.position_rad = 12.5F + 1.0F;
  MitReply decoded;
  ASSERT_EQ(DecodeMitReply(config, EncodeMitReply(config, reply), decoded), Status::kOk);
  EXPECT_NEAR(decoded.position_rad, -12.5F + 1.0F, 2 * 25.0F / 65535);
  reply.position_rad = 0;
  reply.velocity_rad_s = -51;
  ASSERT_EQ(DecodeMitReply(config, EncodeMitReply(config, reply), decoded), Status::kOk);
  EXPECT_NEAR(decoded.velocity_rad_s, 49, 2 * 100.0F / 4095);
}

TEST(MitCodec, RepliesWithAnyValueAreDefined) {
  const MitConfig config;
  for (const float value : {kNan, kInfinity, -kInfinity, 1e30F, -1e30F}) {
    MitReply reply;
    reply.sender = 1;
    reply.position_rad = reply.velocity_rad_s = reply.torque_nm = reply.temperature_c = value;
    MitReply decoded;
    EXPECT_EQ(DecodeMitReply(config, EncodeMitReply(config, reply), decoded), Status::kOk);
    EXPECT_TRUE(std::isfinite(decoded.position_rad));
  }
}

TEST(MitCodec, DecodersTakeExactlyTheirFrames) {
  MitConfig config;
  std::mt19937_64 random(3);
  int replies = 0;
  int commands = 0;
  for (int trial = 0; trial < 300'000; ++trial) {
    CanFrame frame;
    frame.id = random() % 2 == 0
                   ? 17U
                   : (random() % 2 == 0 ? 1U : static_cast<std::uint32_t>(random() % 0x800));
    frame.extended = random() % 8 == 0;
    frame.remote = random() % 8 == 0;
    frame.size = static_cast<std::uint8_t>(random() % 10);  // 9 is out of range on purpose
    for (auto& byte : frame.data) byte = static_cast<std::uint8_t>(random());
    if (random() % 2 == 0) frame.data[0] = 1;
    const bool plain = !frame.extended && !frame.remote;
    MitReply reply;
    const bool is_reply =
        plain && frame.id == 17 && frame.size >= 6 && frame.size <= 8 && frame.data[0] == 1;
    ASSERT_EQ(DecodeMitReply(config, frame, reply) == Status::kOk, is_reply);
    if (is_reply) {
      ++replies;
      ASSERT_GE(reply.position_rad, -12.5F);
      ASSERT_LE(reply.position_rad, 12.5F);
      ASSERT_LE(std::abs(reply.velocity_rad_s), 50.0F);
      ASSERT_LE(std::abs(reply.torque_nm), 18.0F);
    }
    ImpedanceCommand command;
    const bool is_command = plain && frame.id == 1 && frame.size == 8;
    ASSERT_EQ(DecodeMitCommand(config, frame, command) == Status::kOk, is_command);
    commands += is_command ? 1 : 0;
  }
  EXPECT_GT(replies, 1000);
  EXPECT_GT(commands, 1000);
}

TEST(MitConfig, ValidatesEachField) {
  EXPECT_EQ(MitConfig().Validate(), Status::kOk);
  const auto refused = [](auto change) {
    MitConfig config;
    change(config);
    return config.Validate() == Status::kInvalidArgument;
  };
  EXPECT_TRUE(refused([](MitConfig& c) { c.command_id = 0; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.command_id = 256; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.reply_id = 0x800; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.command.position_rad = {1, 2}; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.command.velocity_rad_s = {1, -1}; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.command.torque_nm = {-1, kInfinity}; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.command.kp_nm_per_rad = {-1, 500}; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.command.kd_nm_s_per_rad = {0, 0}; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.reply.torque_nm = {kNan, 1}; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.reply.position_rad = {-2e6F, 2e6F}; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.joint.direction = 0; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.joint.direction = 2; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.joint.gear_ratio = 0; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.joint.gear_ratio = kInfinity; }));
  EXPECT_TRUE(refused([](MitConfig& c) { c.joint.zero_offset_rad = kNan; }));
}

TEST(JointMap, IsItsOwnInverseAndKeepsPower) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<float> any(-3, 3);
  for (const float direction : {1.0F, -1.0F}) {
    for (const float gear : {1.0F, 0.5F, 6.0F}) {
      const JointMap map{direction, gear, 0.7F};
      for (int i = 0; i < 100; ++i) {
        const float q = any(random);
        const float w = any(random);
        const float t = any(random);
        EXPECT_NEAR(map.ToJointPosition(map.ToDrivePosition(q)), q, 1e-5F);
        EXPECT_NEAR(map.ToJointVelocity(map.ToDriveVelocity(w)), w, 1e-5F);
        EXPECT_NEAR(map.ToJointTorque(map.ToDriveTorque(t)), t, 1e-5F);
        EXPECT_NEAR(map.ToDriveTorque(t) * map.ToDriveVelocity(w), t * w, 1e-4F);
        // The law at the shaft is the law at the joint.
        const float kp = 50;
        const float at_joint = kp * (t - q);
        const float at_shaft =
            map.ToDriveGain(kp) * (map.ToDrivePosition(t) - map.ToDrivePosition(q));
        EXPECT_NEAR(map.ToJointTorque(at_shaft), at_joint, 1e-2F);
      }
    }
  }
}

}  // namespace
}  // namespace tumbler
