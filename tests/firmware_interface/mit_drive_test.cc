#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "firmware_interface/devices/mit.h"

namespace tumbler {
namespace {

enum class Kind { kEnter, kExit, kZero, kSetpoint };

struct Sent {
  Status status = Status::kOk;
  Kind kind = Kind::kSetpoint;
  ImpedanceCommand command;
  CanFrame frame;
};

/// A host drive, and hand-made replies of the real one.
class MitDriveTest : public ::testing::Test {
 protected:
  Sent Tick(MitDrive& drive, DriveRequest request, const DriveSetpoint& setpoint = {}) {
    FrameBatch batch;
    Sent sent;
    sent.status = drive.Encode(request, setpoint, batch);
    EXPECT_EQ(batch.frames().size(), 1U) << "one frame a tick, always";
    if (batch.frames().empty()) return sent;
    sent.frame = batch.frames()[0];
    MitMagic magic{};
    if (DecodeMitMagic(drive.config(), sent.frame, magic)) {
      sent.kind = magic == MitMagic::kEnter  ? Kind::kEnter
                  : magic == MitMagic::kExit ? Kind::kExit
                                             : Kind::kZero;
    } else {
      EXPECT_EQ(DecodeMitCommand(drive.config(), sent.frame, sent.command), Status::kOk);
    }
    return sent;
  }

  static void Answer(MitDrive& drive, float position_rad = 0.5F, std::uint8_t error = 0) {
    MitReply reply;
    reply.sender = static_cast<std::uint8_t>(drive.config().command_id);
    reply.position_rad = drive.config().joint.ToDrivePosition(position_rad);
    reply.temperature_c = 30;
    reply.error = error;
    EXPECT_TRUE(drive.Decode(EncodeMitReply(drive.config(), reply)));
  }

  /// Runs the start-up sequence with prompt answers; returns the ticks it took.
  int Enable(MitDrive& drive) {
    for (int tick = 1; tick <= 20; ++tick) {
      Tick(drive, DriveRequest::kEnable);
      Answer(drive);
      if (drive.state() == DriveState::kEnabled) return tick;
    }
    ADD_FAILURE() << "never enabled";
    return 0;
  }
};

TEST_F(MitDriveTest, IsUnknownUntilItAnswersAndDisabledAfterTwoAnswersToExit) {
  MitDrive drive{MitConfig()};
  EXPECT_EQ(drive.state(), DriveState::kUnknown);
  EXPECT_EQ(Tick(drive, DriveRequest::kDisable).kind, Kind::kExit);
  EXPECT_EQ(Tick(drive, DriveRequest::kDisable).kind, Kind::kExit);
  EXPECT_EQ(drive.state(), DriveState::kUnknown);
  Answer(drive);
  EXPECT_EQ(drive.state(), DriveState::kUnknown);
  EXPECT_EQ(Tick(drive, DriveRequest::kDisable).kind, Kind::kExit);
  Answer(drive);
  EXPECT_EQ(drive.state(), DriveState::kDisabled);
}

TEST_F(MitDriveTest, StartsUpWithoutEverActingOnAStaleSetpoint) {
  MitDrive drive{MitConfig()};
  DriveSetpoint far_away;
  far_away.position_rad = 2;
  far_away.kp_nm_per_rad = 200;
  far_away.torque_nm = 5;
  const auto neutral = [](const Sent& sent) {
    return sent.kind == Kind::kSetpoint && sent.command.kp_nm_per_rad == 0 &&
           sent.command.kd_nm_s_per_rad == 0 && std::abs(sent.command.torque_nm) < 0.005F;
  };
  Tick(drive, DriveRequest::kDisable);
  Answer(drive, 0.5F);
  Sent sent = Tick(drive, DriveRequest::kEnable, far_away);
  EXPECT_TRUE(neutral(sent));
  EXPECT_NEAR(sent.command.position_rad, 0.5F, 4e-4F) << "the measured position";
  EXPECT_EQ(drive.state(), DriveState::kEnabling);
  Answer(drive);
  EXPECT_EQ(Tick(drive, DriveRequest::kEnable, far_away).kind, Kind::kEnter);
  Answer(drive);
  EXPECT_EQ(Tick(drive, DriveRequest::kEnable, far_away).kind, Kind::kEnter);
  EXPECT_EQ(drive.encoded_setpoint().kp_nm_per_rad, 0);
  EXPECT_NEAR(drive.encoded_setpoint().position_rad, 0.5F, 4e-4F);
  Answer(drive);
  EXPECT_EQ(drive.state(), DriveState::kEnabling);
  EXPECT_TRUE(neutral(Tick(drive, DriveRequest::kEnable, far_away)));
  Answer(drive);
  EXPECT_EQ(drive.state(), DriveState::kEnabled);
  sent = Tick(drive, DriveRequest::kEnable, far_away);
  EXPECT_NEAR(sent.command.position_rad, 2, 4e-4F);
  EXPECT_NEAR(sent.command.kp_nm_per_rad, 200, 0.1F);
  EXPECT_NEAR(sent.command.torque_nm, 5, 0.005F);
}

TEST_F(MitDriveTest, KeepsAskingUntilItIsAnswered) {
  MitDrive drive{MitConfig()};
  Tick(drive, DriveRequest::kEnable);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(Tick(drive, DriveRequest::kEnable).kind, Kind::kEnter);
  Answer(drive);
  EXPECT_EQ(Tick(drive, DriveRequest::kEnable).kind, Kind::kEnter) << "one answer may be late";
  EXPECT_EQ(Tick(drive, DriveRequest::kEnable).kind, Kind::kEnter);
  Answer(drive);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(Tick(drive, DriveRequest::kEnable).kind, Kind::kSetpoint);
    EXPECT_EQ(drive.state(), DriveState::kEnabling);
  }
  Answer(drive);
  EXPECT_EQ(drive.state(), DriveState::kEnabled);
}

TEST_F(MitDriveTest, TwoAnswersInOneTickCountOnce) {
  MitDrive drive{MitConfig()};
  Tick(drive, DriveRequest::kDisable);
  Answer(drive);
  Answer(drive);
  EXPECT_NE(drive.state(), DriveState::kDisabled);
}

TEST_F(MitDriveTest, DisablesAtOnceFromEveryStageAndStartsAfresh) {
  for (int ticks = 0; ticks < 8; ++ticks) {
    MitDrive drive{MitConfig()};
    for (int i = 0; i < ticks; ++i) {
      Tick(drive, DriveRequest::kEnable);
      Answer(drive);
    }
    EXPECT_EQ(Tick(drive, DriveRequest::kDisable).kind, Kind::kExit) << ticks;
    Answer(drive);
    EXPECT_NE(drive.state(), DriveState::kDisabled) << "one answer may be late";
    EXPECT_EQ(Tick(drive, DriveRequest::kDisable).kind, Kind::kExit);
    Answer(drive);
    EXPECT_EQ(drive.state(), DriveState::kDisabled);
    EXPECT_EQ(Enable(drive), 4) << "clear, enter twice, neutral";
  }
}

TEST_F(MitDriveTest, NonFiniteSetpointDisables) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, inf, -inf}) {
    for (int field = 0; field < 5; ++field) {
      MitDrive drive{MitConfig()};
      Enable(drive);
      DriveSetpoint setpoint;
      float* fields[] = {&setpoint.position_rad, &setpoint.velocity_rad_s, &setpoint.torque_nm,
                         &setpoint.kp_nm_per_rad, &setpoint.kd_nm_s_per_rad};
      *fields[field] = bad;
      const Sent sent = Tick(drive, DriveRequest::kEnable, setpoint);
      EXPECT_EQ(sent.status, Status::kInvalidArgument);
      EXPECT_EQ(sent.kind, Kind::kExit);
      EXPECT_EQ(Tick(drive, DriveRequest::kEnable).kind, Kind::kSetpoint);
      EXPECT_EQ(drive.state(), DriveState::kEnabling) << "it must start up again";
    }
  }
}

TEST_F(MitDriveTest, ReportsAnErrorAsAFaultUntilItIsGone) {
  MitDrive drive{MitConfig()};
  Enable(drive);
  Answer(drive, 0.5F, 3);
  EXPECT_EQ(drive.state(), DriveState::kFault);
  EXPECT_EQ(drive.feedback().error, 3);
  EXPECT_EQ(Tick(drive, DriveRequest::kEnable).kind, Kind::kSetpoint);
  Answer(drive, 0.5F, 0);
  EXPECT_EQ(drive.state(), DriveState::kEnabled);
}

TEST_F(MitDriveTest, EncodedSetpointIsWhatTheDriveWillSee) {
  MitConfig config;
  config.joint = {-1, 2, 0.25F};
  MitDrive drive{config};
  Enable(drive);
  DriveSetpoint setpoint{0.75F, 3, -2, 100, 2};
  const Sent sent = Tick(drive, DriveRequest::kEnable, setpoint);
  // At the shaft: -2 (0.75 - 0.25) = -1 rad, -6 rad/s, torque +1 N m, gains a quarter.
  EXPECT_NEAR(sent.command.position_rad, -1, 2e-4F);
  EXPECT_NEAR(sent.command.velocity_rad_s, -6, 0.013F);
  EXPECT_NEAR(sent.command.torque_nm, 1, 0.0045F);
  EXPECT_NEAR(sent.command.kp_nm_per_rad, 25, 0.062F);
  EXPECT_NEAR(sent.command.kd_nm_s_per_rad, 0.5F, 0.0007F);
  const DriveSetpoint encoded = drive.encoded_setpoint();
  EXPECT_EQ(encoded.position_rad, config.joint.ToJointPosition(sent.command.position_rad));
  EXPECT_EQ(encoded.torque_nm, config.joint.ToJointTorque(sent.command.torque_nm));
  EXPECT_EQ(encoded.kp_nm_per_rad, config.joint.ToJointGain(sent.command.kp_nm_per_rad));
  EXPECT_NEAR(encoded.position_rad, 0.75F, 1e-4F);
}

TEST_F(MitDriveTest, ClampsToTheDrivesRanges) {
  MitDrive drive{MitConfig()};
  Enable(drive);
  DriveSetpoint setpoint{1e6F, -1e6F, 1e6F, 1e6F, 1e6F};
  Tick(drive, DriveRequest::kEnable, setpoint);
  const DriveSetpoint encoded = drive.encoded_setpoint();
  EXPECT_EQ(encoded.position_rad, 12.5F);
  EXPECT_EQ(encoded.velocity_rad_s, -50);
  EXPECT_EQ(encoded.torque_nm, 18);
  EXPECT_EQ(encoded.kp_nm_per_rad, 500);
  EXPECT_EQ(encoded.kd_nm_s_per_rad, 5);
}

TEST_F(MitDriveTest, LeavesOtherFramesAlone) {
  MitDrive drive{MitConfig()};
  MitConfig other;
  other.command_id = 2;
  other.reply_id = 18;
  MitReply reply;
  reply.sender = 2;
  EXPECT_FALSE(drive.Decode(EncodeMitReply(other, reply)));
  // With the same identifier, as firmware has it by default, only the sender tells them apart.
  other.reply_id = 17;
  EXPECT_FALSE(drive.Decode(EncodeMitReply(other, reply)));
  EXPECT_EQ(drive.state(), DriveState::kUnknown);
}

TEST_F(MitDriveTest, FullBatchChangesNothing) {
  MitDrive drive{MitConfig()};
  FrameBatch batch;
  for (int i = 0; i < FrameBatch::kCapacity; ++i) ASSERT_EQ(batch.Add(CanFrame{}), Status::kOk);
  EXPECT_EQ(drive.Encode(DriveRequest::kEnable, {}, batch), Status::kCapacityExceeded);
  EXPECT_EQ(Tick(drive, DriveRequest::kEnable).kind, Kind::kSetpoint)
      << "still the first frame of the sequence";
}

TEST_F(MitDriveTest, InvalidConfigurationSendsNothing) {
  MitConfig config;
  config.joint.gear_ratio = 0;
  MitDrive drive{config};
  FrameBatch batch;
  EXPECT_EQ(drive.Encode(DriveRequest::kDisable, {}, batch), Status::kInvalidArgument);
  EXPECT_TRUE(batch.frames().empty());
}

TEST_F(MitDriveTest, FollowsAPositionThatWrapsAndTakesTheRangeAtItsWordWhenNotFollowing) {
  const MitConfig config;
  MitDrive drive(config);
  const auto reply = [&](double angle_rad) {  // as firmware packs it: unclamped, in 16 bits
    MitReply packed;
    packed.sender = 1;
    packed.position_rad = static_cast<float>(angle_rad);
    EXPECT_TRUE(drive.Decode(EncodeMitReply(config, packed)));
    return static_cast<double>(drive.feedback().position_rad);
  };
  constexpr double kStep = 25.0 / 65535;
  Enable(drive);
  Tick(drive, DriveRequest::kEnable);
  // Three ranges up, and down again below the first, at 40 rad/s.
  double angle = 0.5;
  double least = 0;
  for (int i = 0; i < 6000; ++i) {
    angle += i < 2000 ? 0.04 : -0.04;
    ASSERT_NEAR(reply(angle), angle, 5 * kStep) << i;
    least = std::min(least, angle);
  }
  EXPECT_LT(least, -50);
  Tick(drive, DriveRequest::kDisable);
  EXPECT_NEAR(reply(13), 13 - 25, 5 * kStep) << "beyond the end of the range";
}

}  // namespace
}  // namespace tumbler
