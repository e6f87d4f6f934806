// What the executor finds amiss, what it does about it, and what holds whatever comes in.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "firmware_interface/devices/mit.h"
#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;
using testing::Motion;
using testing::Start;

TEST(Executor, APlanThatIsNotANumberIsHeldAndAFault) {
  Primitive<float> primitive = Motion(13);
  const auto knots = primitive.joints[1].position.knots();
  const auto path = primitive.joints[1].position.control_points();
  std::vector<float> points(path.begin(), path.end());
  points[5] = 3e38F;  // Its rate is more than a float can be.
  points[6] = -3e38F;
  ASSERT_EQ(primitive.joints[1].position.Assign(5, std::vector<float>(knots.begin(), knots.end()),
                                                points),
            Status::kOk);
  ExecutorRig rig({}, primitive);
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  const float held = rig.drives[1]->setpoint.position_rad;
  rig.Tick(OperatorCommand::kRun);
  const TickRecord& record = rig.Tick();
  EXPECT_EQ(record.first_fault.fault, Fault::kNonFinite);
  EXPECT_EQ(record.first_fault.joint, 1);
  EXPECT_EQ(record.state, ExecutorState::kFault);
  EXPECT_EQ(rig.drives[1]->setpoint.position_rad, held);
}

TEST(Executor, ASetpointThatADriveCannotBeSentIsAFault) {
  ExecutorRig rig({}, Motion(13));
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  rig.drives[1]->encode_status = Status::kInvalidArgument;
  rig.Tick();
  EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
  EXPECT_EQ(rig.Tick().first_fault.fault, Fault::kNonFinite);
  EXPECT_EQ(rig.output.record.first_fault.joint, 1);
}

TEST(Executor, ADriveFromWhichOnlyOldRepliesComeIsSilent) {
  for (const int old_ticks : {0, 4}) {
    ExecutorRig rig({}, Motion(13));
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    // From now on the clock goes, and what comes is as old as that.
    for (int i = 0; i < 50; ++i) {
      rig.input.time_ns += 1'000'000;
      rig.stamp_ns = rig.input.time_ns - old_ticks * std::int64_t{1'000'000};
      rig.Tick();
    }
    EXPECT_EQ(rig.output.record.first_fault.fault,
              old_ticks == 0 ? Fault::kNone : Fault::kStaleReply);
    EXPECT_EQ(rig.output.record.joints[0].reply_age_ticks, old_ticks == 0 ? 0 : old_ticks - 1);
  }
}

TEST(Executor, AFaultOfOneJointInACollapseDoesNotStiffenTheOthers) {
  const Primitive<float> motion = Motion(13);
  ExecutorConfig config;
  config.collapse.configured = true;
  for (std::size_t i = 0; i < 2; ++i)
    config.collapse.position_rad[i] = motion.joints[i].position.control_points()[0];
  for (const ExecutorState state : {ExecutorState::kHolding, ExecutorState::kRunning})
    ASSERT_TRUE(config.reactions.Set(Fault::kLateTick, state, Reaction::kCollapse));
  ExecutorRig rig(config, motion);
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  rig.input.tick += 10;
  ASSERT_EQ(rig.Tick().reaction, Reaction::kCollapse);
  rig.Tick();
  const float soft = rig.drives[1]->setpoint.kp_nm_per_rad;
  ASSERT_LT(soft, config.joints[1].kp_nm_per_rad);
  rig.drives[0]->encode_status = Status::kInvalidArgument;
  rig.Tick();
  EXPECT_EQ(rig.drives[1]->setpoint.kp_nm_per_rad, soft);
  EXPECT_EQ(rig.Tick().reaction, Reaction::kDamp);
  EXPECT_EQ(rig.drives[1]->setpoint.kp_nm_per_rad, 0);
}

TEST(Executor, WhereADriveDoesNotSayWhatItWasSentItIsArmedAtWhatItMeasures) {
  ExecutorRig rig({}, Motion(13));
  rig.drives[1]->on_wire = DriveSetpoint{std::numeric_limits<float>::quiet_NaN(), 0, 0, 0, 0};
  rig.drives[0]->on_wire = DriveSetpoint{rig.drives[0]->reply.position_rad + 0.01F, 0, 0, 0, 0};
  const float measured = rig.drives[1]->reply.position_rad;
  rig.Tick();
  rig.follow = false;
  rig.Tick(OperatorCommand::kArm);
  EXPECT_EQ(rig.output.record.joints[1].limited.position_rad, measured);
  EXPECT_EQ(rig.output.record.joints[0].limited.position_rad, rig.drives[0]->on_wire->position_rad)
      << "a drive of which it is known is held there";
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding, 100));
  EXPECT_EQ(rig.drives[1]->setpoint.position_rad, measured);
}

TEST(Executor, ADriveThatReportsAnErrorWhileItDrivesIsAFault) {
  ExecutorRig rig({}, Motion(13));
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  rig.drives[1]->says = DriveState::kEnabled;
  rig.Tick();
  ASSERT_EQ(rig.executor.state(), ExecutorState::kRunning);
  rig.drives[1]->reply.error = 0x21;
  const TickRecord& record = rig.Tick();
  EXPECT_EQ(record.first_fault.fault, Fault::kDriveError);
  EXPECT_EQ(record.first_fault.value.code(), 0x21U);
  EXPECT_EQ(record.first_fault.joint, 1);
}

TEST(Executor, ATickThatIsNotAfterTheOneBeforeIsAFault) {
  for (const int back : {1, 50}) {
    ExecutorRig rig({}, Motion(13));
    ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
    const float before = rig.Tick().primitive_time_s;
    rig.input.tick -= back;
    const TickRecord& record = rig.Tick();
    EXPECT_EQ(record.first_fault.fault, Fault::kLateTick);
    EXPECT_EQ(record.first_fault.value.integer(), -back);
    EXPECT_EQ(record.state, ExecutorState::kFault);
    EXPECT_LE(record.primitive_time_s, before + 0.00101F) << "no time was made up for";
  }
}

TEST(Executor, AFrameOfEarlierIsOldAlsoWhereTheClockStandsStill) {
  ExecutorRig rig({}, Motion(13));
  rig.input.time_ns = 1'000'000;
  rig.Tick();  // Frames are of the time 0.
  EXPECT_EQ(rig.output.record.joints[0].reply_age_ticks, 0);
  for (int i = 0; i < 10; ++i) rig.Tick();
  EXPECT_GT(rig.output.record.joints[0].reply_age_ticks, 1000);
  EXPECT_EQ(rig.Tick(OperatorCommand::kArm).refusal.refusal, Refusal::kNoReply);
}

TEST(Executor, ErrorsOfDrivesAreClearedInOneTickByTheOperatorAndNeverOtherwise) {
  testing::ExecutorRig rig({}, Motion(31));
  ASSERT_TRUE(rig.Reach(ExecutorState::kFault));
  const auto clears = [&rig] {
    return rig.drives[0]->request == DriveRequest::kClearErrors ||
           rig.drives[1]->request == DriveRequest::kClearErrors;
  };
  rig.Tick(OperatorCommand::kClearFaults);
  EXPECT_FALSE(clears()) << "refused outside disarmed";
  rig.Tick(OperatorCommand::kDisarm);
  for (int i = 0; i < 20; ++i) {
    rig.Tick();
    ASSERT_FALSE(clears());
  }
  rig.Tick(OperatorCommand::kClearFaults);
  EXPECT_EQ(rig.drives[0]->request, DriveRequest::kClearErrors);
  EXPECT_EQ(rig.drives[1]->request, DriveRequest::kClearErrors);
  rig.Tick();
  EXPECT_EQ(rig.drives[0]->request, DriveRequest::kDisable);
  rig.Tick(OperatorCommand::kArm);
  EXPECT_EQ(rig.drives[0]->request, DriveRequest::kEnable);
}

/// Two MIT drives, and a world that answers at random from a seed: plausible replies, garbage,
/// silence, late ticks, commands.
class MitWorld {
 public:
  explicit MitWorld(unsigned seed) : primitive(Motion(30)), random(seed) {
    configs[1].command_id = 2;
    configs[1].reply_id = 18;
    for (std::size_t i = 0; i < 2; ++i) drives.emplace_back(std::make_unique<MitDrive>(configs[i]));
    const std::array<Drive*, 2> pointers{drives[0].get(), drives[1].get()};
    EXPECT_EQ(executor.Configure({}, primitive, pointers), Status::kOk);
    for (std::size_t i = 0; i < 2; ++i) position[i] = Start(primitive, i);
  }

  struct Recorded {
    TickInput input;
    std::vector<ReceivedFrame> frames;
  };

  /// The inputs of one tick; `hostile` is the share of ticks in which something odd happens.
  Recorded MakeInput(double hostile) {
    std::uniform_real_distribution<double> chance(0, 1);
    Recorded recorded;
    tick += 1;
    if (chance(random) < 0.2 * hostile) tick += static_cast<std::int64_t>(random() % 5);
    recorded.input.tick = tick;
    for (std::size_t i = 0; i < 2; ++i) {
      MitReply reply;
      reply.sender = static_cast<std::uint8_t>(i + 1);
      reply.position_rad = position[i];
      reply.temperature_c = chance(random) < 0.1 * hostile ? 100.0F : 30.0F;
      reply.error = chance(random) < 0.1 * hostile ? 2 : 0;
      CanFrame frame = EncodeMitReply(configs[i], reply);
      if (chance(random) < hostile) frame.data[random() % 8] ^= static_cast<std::uint8_t>(random());
      if (chance(random) < hostile) frame.size = static_cast<std::uint8_t>(random() % 9);
      if (chance(random) >= hostile) recorded.frames.push_back({frame, 0});
    }
    if (chance(random) < 0.05 * hostile) recorded.input.send_status = Status::kWouldBlock;
    if (chance(random) < 0.05 * hostile) recorded.input.receive_status = Status::kBusOff;
    if (chance(random) < (hostile > 0.1 ? 0.3 : 0.001)) {
      recorded.input.command = static_cast<OperatorCommand>(random() % 7);
    } else if (executor.state() == ExecutorState::kFault) {
      recorded.input.command = OperatorCommand::kDisarm;
    } else if (executor.state() == ExecutorState::kDisarmed) {
      recorded.input.command =
          chance(random) < 0.5 ? OperatorCommand::kClearFaults : OperatorCommand::kArm;
    } else if (executor.state() == ExecutorState::kHolding) {
      recorded.input.command =
          chance(random) < 0.5 ? OperatorCommand::kMoveToStart : OperatorCommand::kRun;
    }
    return recorded;
  }

  void Tick(Recorded& recorded) {
    recorded.input.received = recorded.frames;
    executor.Tick(recorded.input, output);
    for (std::size_t i = 0; i < 2; ++i) {
      ImpedanceCommand command;
      for (const CanFrame& frame : output.frames[i].frames()) {
        if (DecodeMitCommand(configs[i], frame, command) == Status::kOk &&
            command.kp_nm_per_rad > 0) {
          position[i] = command.position_rad;
        }
      }
    }
  }

  Primitive<float> primitive;
  std::mt19937 random;
  std::array<MitConfig, 2> configs;
  std::vector<std::unique_ptr<MitDrive>> drives;
  Executor executor;
  TickOutput output;
  std::array<float, 2> position{};
  std::int64_t tick = 0;
};

TEST(Executor, EveryFrameOnTheWireDecodesToASetpointWithinTheLimitsWhateverComesIn) {
  constexpr float kHalfStep_rad = 0.5F * 25.0F / 65535.0F + 1e-5F;
  constexpr float kHalfStep_rad_s = 0.5F * 100.0F / 4095.0F + 1e-4F;
  constexpr float kHalfStep_nm = 0.5F * 36.0F / 4095.0F + 1e-4F;
  int setpoints = 0;
  std::array<int, kExecutorStateCount> visits{};
  for (unsigned seed = 0; seed < 60; ++seed) {
    MitWorld world(seed);
    std::array<float, 2> last{};
    std::array<bool, 2> driven{};
    std::int64_t last_tick = 0;
    for (int i = 0; i < 4000; ++i) {
      auto input = world.MakeInput(seed % 3 == 0 ? 0.2 : (seed % 3 == 1 ? 0.005 : 0.0001));
      world.Tick(input);
      ++visits[static_cast<std::size_t>(world.output.record.state)];
      const auto elapsed = static_cast<float>(std::min<std::int64_t>(world.tick - last_tick, 3));
      last_tick = world.tick;
      for (std::size_t j = 0; j < 2; ++j) {
        ASSERT_EQ(world.output.frames[j].frames().size(), 1U) << "every tick writes every drive";
        ImpedanceCommand command;
        const bool is_setpoint =
            DecodeMitCommand(world.configs[j], world.output.frames[j].frames()[0], command) ==
                Status::kOk &&
            command.kp_nm_per_rad > 0;
        if (is_setpoint) {
          ++setpoints;
          const JointLimits<float>& limits = world.primitive.joints[j].limits;
          ASSERT_GE(command.position_rad, limits.position_min_rad - kHalfStep_rad);
          ASSERT_LE(command.position_rad, limits.position_max_rad + kHalfStep_rad);
          ASSERT_LE(std::abs(command.velocity_rad_s), limits.velocity_max_rad_s + kHalfStep_rad_s);
          ASSERT_LE(std::abs(command.torque_nm), limits.torque_max_nm + kHalfStep_nm);
          if (driven[j]) {
            ASSERT_LE(std::abs(command.position_rad - last[j]),
                      limits.velocity_max_rad_s * 0.00101F * elapsed + 2 * kHalfStep_rad);
          }
          last[j] = command.position_rad;
        }
        driven[j] = is_setpoint;
      }
    }
  }
  EXPECT_GT(setpoints, 10000);
  for (std::size_t s = 0; s < visits.size(); ++s) {
    EXPECT_GT(visits[s], 0) << "never in state " << ToString(static_cast<ExecutorState>(s));
  }
}

TEST(Executor, RecordedInputsReplayToTheSameBytes) {
  std::vector<MitWorld::Recorded> inputs;
  std::vector<CanFrame> frames;
  std::vector<TickRecord> records;
  {
    MitWorld world(5);
    for (int i = 0; i < 5000; ++i) {
      inputs.push_back(world.MakeInput(0.002));
      world.Tick(inputs.back());
      for (const FrameBatch& batch : world.output.frames) {
        frames.insert(frames.end(), batch.frames().begin(), batch.frames().end());
      }
      records.push_back(world.output.record);
    }
  }
  MitWorld replay(999);  // The seed does not matter: no random numbers are used.
  std::size_t next = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    replay.Tick(inputs[i]);
    for (const FrameBatch& batch : replay.output.frames) {
      for (const CanFrame& frame : batch.frames()) ASSERT_EQ(frame, frames[next++]) << "tick " << i;
    }
    const TickRecord& record = replay.output.record;
    ASSERT_EQ(record.state, records[i].state);
    ASSERT_EQ(record.faults, records[i].faults);
    for (std::size_t j = 0; j < 2; ++j) {
      ASSERT_EQ(record.joints[j].planned, records[i].joints[j].planned);
      ASSERT_EQ(record.joints[j].limited, records[i].joints[j].limited);
    }
  }
  EXPECT_EQ(next, frames.size());
  EXPECT_GT(next, 9000U);
}

}  // namespace
}  // namespace tumbler
