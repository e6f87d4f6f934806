#include "runtime/executor/faults.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"
#include "tests/support/sensor_motion.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;
using testing::MotionShape;
using testing::RandomPrimitive;

constexpr std::array kStates{ExecutorState::kDisarmed,      ExecutorState::kArming,
                             ExecutorState::kHolding,       ExecutorState::kRunning,
                             ExecutorState::kMovingToStart, ExecutorState::kSettling,
                             ExecutorState::kStopping,      ExecutorState::kFault};
constexpr std::array kFaults{
    Fault::kStaleReply,    Fault::kWrongSequence,  Fault::kFollowingError,
    Fault::kDriveError,    Fault::kHeartbeatLost,  Fault::kOverTemperature,
    Fault::kBusOff,        Fault::kErrorPassive,   Fault::kInterfaceDown,
    Fault::kInterfaceGone, Fault::kLinkFailed,     Fault::kTransmitQueueFull,
    Fault::kLateTick,      Fault::kOperatorStop,   Fault::kNonFinite,
    Fault::kArmingTimeout, Fault::kForeignCommand, Fault::kSensorLost,
    Fault::kPaused};
constexpr std::array kReactions{Reaction::kIgnore,  Reaction::kHold, Reaction::kRollOut,
                                Reaction::kFold,    Reaction::kDamp, Reaction::kCollapse,
                                Reaction::kDisable, Reaction::kAbort};

Primitive<float> Motion() {
  std::mt19937 random(3);
  MotionShape shape;
  shape.settle_s = 0.2;
  return RandomPrimitive<float>(shape, random);
}

/// Puts the joints 0.3 rad from the start, so that the move takes a while.
void Displace(ExecutorRig& rig) {
  for (auto& drive : rig.drives) drive->reply.position_rad -= 0.05F;
}

/// Makes `fault` happen, at joint 1 if it concerns a joint.
/// @returns the number of ticks after which it must have been found.
int Provoke(Fault fault, ExecutorRig& rig, const ExecutorConfig& config) {
  testing::ScriptedDrive& drive = *rig.drives[1];
  switch (fault) {
    case Fault::kStaleReply:
      rig.silent[1] = true;
      return config.stale_ticks_max + 1;
    case Fault::kFollowingError:
      rig.follow = false;
      drive.reply.position_rad = drive.setpoint.position_rad + 0.3F;
      return 1;
    case Fault::kDriveError:
      drive.reply.error = 2;
      return 1;
    case Fault::kOverTemperature:
      drive.reply.has_temperature = true;
      drive.reply.temperature_c = 95;
      return 1;
    case Fault::kWrongSequence:
      rig.replies[1] = 2;
      return config.sequence_errors_max / 2 + 1;
    case Fault::kHeartbeatLost:
      drive.heartbeat_age = {30, 26};
      return 1;
    case Fault::kBusOff:
      rig.input.receive_status = Status::kBusOff;
      return 1;
    case Fault::kErrorPassive:
      rig.input.controller = CanControllerState::kErrorPassive;
      return 1;
    case Fault::kInterfaceDown:
      rig.input.send_status = Status::kLinkDown;
      return 1;
    case Fault::kInterfaceGone:
      rig.input.receive_status = Status::kLinkGone;
      return 1;
    case Fault::kLinkFailed:
      rig.input.receive_status = Status::kIoError;
      return 1;
    case Fault::kTransmitQueueFull:
      rig.input.send_status = Status::kWouldBlock;
      return 1;
    case Fault::kLateTick:
      rig.input.tick += config.late_ticks_max + 1;
      return 1;
    case Fault::kPaused:
      rig.input.tick += config.pause_ticks_max;
      return 1;
    case Fault::kEntryMissed:
    case Fault::kFallen:
    case Fault::kPitchUnknown:
      return 0;  // They belong to transitions, of executor_sequence_test.cc and beginnings_test.cc.
    case Fault::kNonFinite:
      drive.reply.velocity_rad_s = std::numeric_limits<float>::quiet_NaN();
      return 1;
    case Fault::kArmingTimeout:
      drive.stuck = true;
      return config.arming_ticks_max + 1;
    case Fault::kForeignCommand:
      rig.foreign_id = 101 + 0x100;  // a command to drive 1
      return 1;
    case Fault::kSensorLost:
      rig.sensor_frames.clear();
      return rig.sensor.settings.age_ticks_max + 2;
    case Fault::kOperatorStop:
    case Fault::kNone:
      break;
  }
  return 1;
}

/// Whether a fault can happen in a state at all.
bool IsPossible(Fault fault, ExecutorState state) {
  if (fault == Fault::kArmingTimeout) return state == ExecutorState::kArming;
  // In arming there is nothing to follow yet, and a damped joint need not follow. The state kFault
  // comes from a late tick while running.
  if (fault == Fault::kFollowingError)
    return state != ExecutorState::kArming && state != ExecutorState::kFault;
  // The fault itself led to the state kFault.
  if (fault == Fault::kLateTick) return state != ExecutorState::kFault;
  // All others are possible, also in stopping.
  return true;
}

TEST(FaultTable, AnswersEveryFaultInEveryStateAsStated) {
  // Each text has the first letters of the reactions, x for disable, in the states disarmed,
  // arming, holding, moving to start, running, settling, stopping and fault. Where the robot is in
  // mid-swing and its drives obey, the motion's table says what is done (a); where they may not,
  // joints are damped; a dead link is torque off.
  const std::vector<std::pair<Fault, std::string>> stated = {
      {Fault::kStaleReply, "ixhhahhd"},
      {Fault::kWrongSequence, "ixhhahhd"},
      {Fault::kFollowingError, "ixdddddd"},
      {Fault::kDriveError, "ixdddddd"},
      {Fault::kHeartbeatLost, "ixhhahhd"},
      {Fault::kOverTemperature, "ixdddddd"},
      {Fault::kBusOff, "ixxxxxxx"},
      {Fault::kErrorPassive, "ixhhdhhd"},
      {Fault::kInterfaceDown, "ixxxxxxx"},
      {Fault::kInterfaceGone, "ixxxxxxx"},
      {Fault::kLinkFailed, "ixxxxxxx"},
      {Fault::kTransmitQueueFull, "ixxxxxxx"},
      {Fault::kLateTick, "ixhhahhh"},
      {Fault::kOperatorStop, "ixhhahhh"},
      {Fault::kNonFinite, "ixdddddd"},
      {Fault::kArmingTimeout, "ixxxxxxx"},
      {Fault::kEntryMissed, "ixhhdhhh"},
      {Fault::kForeignCommand, "ixdddddd"},
      {Fault::kSensorLost, "iiiiiiii"},
      {Fault::kFallen, "ixhhdhhh"},
      {Fault::kPaused, "ixxxxxxx"},
      {Fault::kPitchUnknown, "ixhhdhhh"},
      {Fault::kNone, "iiiiiiii"}};
  ASSERT_EQ(stated.size(), kFaultCount);
  const FaultTable table;
  for (const auto& [fault, row] : stated) {
    std::string found;
    for (std::size_t s = 0; s < kExecutorStateCount; ++s) {
      const Reaction reaction = table(fault, static_cast<ExecutorState>(s));
      found += reaction == Reaction::kDisable ? 'x' : *ToString(reaction);
    }
    EXPECT_EQ(found, row) << ToString(fault);
  }
}

TEST(FaultTable, RefusesEntriesThatMakeNoSense) {
  FaultTable table;
  for (const Fault fault : kFaults) {
    for (const ExecutorState state : kStates) {
      for (const Reaction reaction : kReactions) {
        const Reaction before = table(fault, state);
        bool allowed = true;
        if (state == ExecutorState::kDisarmed) allowed = reaction == Reaction::kIgnore;
        if (state == ExecutorState::kArming) {
          allowed = reaction == Reaction::kIgnore || reaction == Reaction::kDisable;
        }
        if (fault == Fault::kOperatorStop && state != ExecutorState::kDisarmed) {
          allowed = allowed && reaction != Reaction::kIgnore;
        }
        if (reaction == Reaction::kAbort) allowed = state == ExecutorState::kRunning;
        if (fault == Fault::kPaused && state != ExecutorState::kDisarmed)
          allowed = reaction == Reaction::kDisable;
        if (reaction == Reaction::kRollOut || reaction == Reaction::kFold) allowed = false;
        EXPECT_EQ(table.Set(fault, state, reaction), allowed)
            << ToString(fault) << ToString(state) << ToString(reaction);
        EXPECT_EQ(table(fault, state), allowed ? reaction : before);
      }
    }
  }
  EXPECT_FALSE(table.Set(Fault::kNone, ExecutorState::kRunning, Reaction::kHold));
}

TEST(FaultTable, NeverReactsWhileDisarmed) {
  FaultTable table;
  for (const Fault fault : kFaults) {
    table.Set(fault, ExecutorState::kDisarmed, Reaction::kDamp);
    EXPECT_EQ(table(fault, ExecutorState::kDisarmed), Reaction::kIgnore);
  }
}

TEST(FaultTable, NamesAreDistinct) {
  std::set<std::string> names;
  for (const ExecutorState state : kStates) EXPECT_TRUE(names.insert(ToString(state)).second);
  for (const Fault fault : kFaults) EXPECT_TRUE(names.insert(ToString(fault)).second);
  for (const Reaction reaction : kReactions) {
    EXPECT_TRUE(names.insert(ToString(reaction)).second);
  }
}

class FaultMatrix : public ::testing::TestWithParam<std::tuple<Fault, ExecutorState, Reaction>> {
 protected:
  static ExecutorConfig ConfigOf(const Primitive<float>& motion) {
    const auto [fault, state, reaction] = GetParam();
    ExecutorConfig config;
    config.arming_ticks_max = 50;
    EXPECT_TRUE(config.reactions.Set(fault, state, reaction));
    config.collapse.configured = true;
    for (std::size_t i = 0; i < 2; ++i) {
      config.collapse.position_rad[i] = motion.joints[i].position.control_points()[0] + 0.01F;
    }
    return config;
  }
  static void ExpectCause(const FaultDetail& detail, std::int64_t seen_at, Reaction answer);
  static void ExpectOrders(ExecutorRig& rig, const ExecutorConfig& config);
};

/// Expects the detail of the provoked fault.
void FaultMatrix::ExpectCause(const FaultDetail& detail, std::int64_t seen_at, Reaction answer) {
  const auto [fault, state, reaction] = GetParam();
  EXPECT_EQ(detail.fault, fault);
  EXPECT_EQ(detail.tick, seen_at);
  EXPECT_EQ(detail.state, state);
  EXPECT_EQ(detail.reaction, answer);
  const bool of_a_joint = fault == Fault::kStaleReply || fault == Fault::kWrongSequence ||
                          fault == Fault::kHeartbeatLost || fault == Fault::kFollowingError ||
                          fault == Fault::kDriveError || fault == Fault::kOverTemperature ||
                          fault == Fault::kNonFinite || fault == Fault::kForeignCommand;
  if (of_a_joint) {
    EXPECT_EQ(detail.joint, 1);
  }
  if (fault == Fault::kOverTemperature) {
    EXPECT_EQ(detail.value.real(), 95);
    EXPECT_EQ(detail.limit.real(), 80);
  }
  if (fault == Fault::kForeignCommand) {
    EXPECT_EQ(detail.value.integer(), 101 + 0x100);
  }
}

/// Expects the reaction in the setpoints of every drive, in every tick.
void FaultMatrix::ExpectOrders(ExecutorRig& rig, const ExecutorConfig& config) {
  rig.Tick();
  for (const auto& drive : rig.drives) {
    const int encodes = drive->encodes;
    rig.Tick();
    EXPECT_EQ(drive->encodes, encodes + 1);
    switch (rig.output.record.reaction) {
      case Reaction::kDisable:
        EXPECT_EQ(drive->request, DriveRequest::kDisable);
        break;
      case Reaction::kDamp:
        EXPECT_EQ(drive->request, DriveRequest::kEnable);
        EXPECT_EQ(drive->setpoint.kp_nm_per_rad, 0);
        EXPECT_EQ(drive->setpoint.kd_nm_s_per_rad, config.joints[0].damping_nm_s_per_rad);
        EXPECT_EQ(drive->setpoint.velocity_rad_s, 0);
        EXPECT_EQ(drive->setpoint.torque_nm, 0);
        break;
      case Reaction::kHold:
        EXPECT_EQ(drive->request, DriveRequest::kEnable);
        EXPECT_EQ(drive->setpoint.kp_nm_per_rad, config.joints[0].kp_nm_per_rad);
        break;
      case Reaction::kCollapse:
        EXPECT_EQ(drive->request, DriveRequest::kEnable);
        EXPECT_EQ(drive->setpoint.kp_nm_per_rad,
                  config.collapse.stiffness * config.joints[0].kp_nm_per_rad);
        break;
      case Reaction::kIgnore:
      case Reaction::kRollOut:
      case Reaction::kFold:
      case Reaction::kAbort:
        ADD_FAILURE() << "no reaction to a latched fault, where the motion has no table of aborts";
    }
  }
}

/// The core of the matrix: for each configured reaction the executor does what the table states,
/// and nothing else.
TEST_P(FaultMatrix, TheExecutorDoesWhatTheTableSays) {
  const auto [fault, state, reaction] = GetParam();
  const Primitive<float> motion = Motion();
  const ExecutorConfig config = ConfigOf(motion);
  ExecutorRig rig(config, motion);
  ASSERT_EQ(rig.configured, Status::kOk);
  XsensMti sensor;
  if (fault == Fault::kSensorLost) {
    rig.sensor.device = &sensor;
    rig.sensor.settings.repeats_max = 0;
    rig.sensor_frames = testing::SensorFrames(0.1, 0);
    rig.Reconfigure();
  }
  if (state == ExecutorState::kMovingToStart) Displace(rig);
  if (state == ExecutorState::kArming) {
    for (auto& drive : rig.drives) drive->start_up_ticks = 30;
  }
  ASSERT_TRUE(rig.Reach(state)) << ToString(rig.executor.state());
  const std::uint32_t before = rig.output.record.faults;
  const Reaction present = rig.output.record.reaction;
  const FaultDetail cause = rig.output.record.first_fault;

  const int ticks = Provoke(fault, rig, config);
  if (fault == Fault::kArmingTimeout) rig.drives[0]->start_up_ticks = 1000;
  std::int64_t seen_at = -1;
  for (int i = 0; i < ticks; ++i) {
    rig.Tick(fault == Fault::kOperatorStop ? OperatorCommand::kStop : OperatorCommand::kNone);
    if (rig.output.record.faults != before && seen_at < 0) seen_at = rig.output.record.tick;
  }
  const TickRecord& record = rig.output.record;
  const std::uint32_t bit = 1U << static_cast<unsigned>(fault);

  Reaction answer = config.reactions(fault, state);
  if (answer == Reaction::kAbort)  // This motion has no table of aborts.
    answer = fault == Fault::kOperatorStop ? Reaction::kHold : Reaction::kDamp;
  const bool at_rest = state == ExecutorState::kHolding || state == ExecutorState::kStopping;
  const bool plain_stop = fault == Fault::kOperatorStop && (answer == Reaction::kHold || at_rest) &&
                          state != ExecutorState::kFault;
  if (answer == Reaction::kIgnore || plain_stop) {
    EXPECT_EQ(record.faults, before);
    EXPECT_EQ(record.reaction, present);
    if (plain_stop && !at_rest) {
      EXPECT_EQ(record.state, ExecutorState::kStopping);
    }
    return;
  }
  EXPECT_EQ(record.faults, before | bit);
  EXPECT_GE(seen_at, 0);
  if (fault != Fault::kArmingTimeout) {
    EXPECT_EQ(record.state, ExecutorState::kFault);
  } else {
    EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
  }
  EXPECT_EQ(record.reaction, Stronger(present, answer));
  if (state == ExecutorState::kFault) {
    EXPECT_EQ(record.first_fault.fault, cause.fault) << "the cause is kept, not its consequence";
  } else {
    ExpectCause(record.first_fault, seen_at, answer);
  }
  ExpectOrders(rig, config);
}

std::vector<std::tuple<Fault, ExecutorState, Reaction>> PossibleCases() {
  std::vector<std::tuple<Fault, ExecutorState, Reaction>> cases;
  for (const Fault fault : kFaults) {
    for (const ExecutorState state : kStates) {
      if (!IsPossible(fault, state)) continue;
      for (const Reaction reaction : kReactions) {
        if (FaultTable::IsAllowed(fault, state, reaction)) {
          cases.emplace_back(fault, state, reaction);
        }
      }
    }
  }
  return cases;
}

/// A readable name, made of fault, state and reaction without their blanks.
std::string CaseName(
    const ::testing::TestParamInfo<std::tuple<Fault, ExecutorState, Reaction>>& info) {
  std::string name = std::string(ToString(std::get<0>(info.param))) + "_" +
                     ToString(std::get<1>(info.param)) + "_" + ToString(std::get<2>(info.param));
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(AllFaultsAllStatesAllReactions, FaultMatrix,
                         ::testing::ValuesIn(PossibleCases()), CaseName);

TEST(Faults, LatchUntilTheOperatorClearsThemWhileDisarmed) {
  ExecutorRig rig({}, Motion());
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  rig.drives[0]->reply.error = 3;
  rig.Tick();
  rig.drives[0]->reply.error = 0;  // The cause goes away, but the fault stays.
  for (int i = 0; i < 100; ++i) rig.Tick();
  EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
  EXPECT_EQ(rig.Tick(OperatorCommand::kClearFaults).refusal.refusal, Refusal::kWrongState);
  EXPECT_NE(rig.output.record.faults, 0);
  rig.Tick(OperatorCommand::kDisarm);
  EXPECT_EQ(rig.executor.state(), ExecutorState::kDisarmed);
  EXPECT_EQ(rig.Tick(OperatorCommand::kArm).refusal.refusal, Refusal::kFaultLatched);
  rig.Tick(OperatorCommand::kClearFaults);
  EXPECT_EQ(rig.output.record.faults, 0);
  EXPECT_EQ(rig.Tick(OperatorCommand::kArm).refusal.refusal, Refusal::kNone);
  EXPECT_EQ(rig.executor.state(), ExecutorState::kArming);
}

TEST(Faults, ASecondFaultCanOnlyMakeTheReactionStronger) {
  ExecutorRig rig({}, Motion());
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  rig.input.tick += 50;
  EXPECT_EQ(rig.Tick().reaction, Reaction::kHold);
  rig.drives[1]->reply.error = 1;
  EXPECT_EQ(rig.Tick().reaction, Reaction::kDamp);
  rig.input.send_status = Status::kLinkDown;
  EXPECT_EQ(rig.Tick().reaction, Reaction::kDisable);
  rig.input.send_status = Status::kOk;
  rig.input.tick += 50;
  EXPECT_EQ(rig.Tick().reaction, Reaction::kDisable);
  EXPECT_EQ(rig.output.record.first_fault.fault, Fault::kLateTick);
}

TEST(Faults, OneRepeatedReplyIsNoneAndASustainedRepetitionIs) {
  ExecutorConfig config;
  for (const int every : {1, 2, 3, 4}) {
    ExecutorRig rig(config, Motion());
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    for (int i = 0; i < 100; ++i) {
      rig.replies[0] = i % every == 0 ? 2 : 1;
      rig.Tick();
      if (every == 4 || i < 5) {
        EXPECT_EQ(rig.output.record.faults, 0U) << "every " << every << ", tick " << i;
        EXPECT_EQ(rig.output.record.joints[0].reply_status,
                  i % every == 0 ? ReplyStatus::kRepeated : ReplyStatus::kOk);
      }
    }
    // With every third reply wrong, the right ones just make up for them.
    EXPECT_EQ(rig.output.record.first_fault.fault, every < 3 ? Fault::kWrongSequence : Fault::kNone)
        << every;
  }
}

TEST(Faults, RepliesOfEarlierTicksAreToldFromRepeatedOnes) {
  ExecutorRig rig({}, Motion());
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  const auto tick = [&rig](int replies) {
    rig.replies[0] = replies;
    return rig.Tick().joints[0].reply_status;
  };
  EXPECT_EQ(tick(1), ReplyStatus::kOk);
  EXPECT_EQ(tick(0), ReplyStatus::kNoNewData);
  EXPECT_EQ(tick(1), ReplyStatus::kOkSomeLost);
  EXPECT_EQ(tick(1), ReplyStatus::kOk);
  EXPECT_EQ(tick(2), ReplyStatus::kOkSomeLate) << "the one that was missing has come after all";
  EXPECT_EQ(tick(2), ReplyStatus::kRepeated);
  EXPECT_EQ(tick(0), ReplyStatus::kNoNewData);
  EXPECT_EQ(tick(3), ReplyStatus::kRepeated) << "one is owed, not two";
  for (int i = 0; i < 20; ++i) tick(1);
  EXPECT_EQ(tick(0), ReplyStatus::kNoNewData);
  for (int i = 0; i < 6; ++i) tick(1);
  EXPECT_EQ(tick(2), ReplyStatus::kRepeated) << "what was missing for so long is lost";
}

TEST(Faults, RepliesMayComeATickLateOrInBunchesForEver) {
  for (const int tick_of_bunch : {2, 3, 5}) {
    ExecutorRig rig({}, Motion());
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    for (int i = 1; i <= 1000; ++i) {
      rig.replies[0] = i % tick_of_bunch == 0 ? tick_of_bunch : 0;
      rig.Tick();
      ASSERT_EQ(rig.output.record.faults, 0U) << "every " << tick_of_bunch << ", tick " << i;
    }
  }
}

TEST(Faults, ADriveThatSendsByItsOwnClockMayDriftButNotFlood) {
  ExecutorRig rig({}, Motion());
  rig.drives[0]->rhythm = {false, 2};
  rig.Reconfigure();
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  for (int i = 0; i < 200; ++i) {
    rig.replies[0] = i % 2 == 0 ? 2 : 0;
    rig.Tick();
  }
  EXPECT_EQ(rig.output.record.faults, 0U);
  rig.replies[0] = 3;
  for (int i = 0; i < 7; ++i) rig.Tick();  // In the first one, those of the silent tick may come.
  EXPECT_EQ(rig.output.record.joints[0].reply_status, ReplyStatus::kRepeated);
  EXPECT_EQ(rig.output.record.first_fault.fault, Fault::kWrongSequence);
  EXPECT_EQ(rig.output.record.first_fault.value.integer(), 12);
  EXPECT_EQ(rig.output.record.first_fault.limit.integer(), 10);
}

TEST(Faults, ALostHeartbeatIsNotADriveErrorAndRefusesArming) {
  ExecutorRig rig({}, Motion());
  rig.drives[1]->heartbeat_age = {27, 26};
  rig.Tick();
  const RefusalDetail refusal = rig.Tick(OperatorCommand::kArm).refusal;
  EXPECT_EQ(refusal.refusal, Refusal::kNoHeartbeat);
  EXPECT_EQ(refusal.joint, 1);
  EXPECT_EQ(refusal.value.integer(), 27);
  EXPECT_EQ(refusal.limit.integer(), 26);
  rig.drives[1]->heartbeat_age = {};
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  rig.drives[1]->heartbeat_age = {27, 26};
  const TickRecord& record = rig.Tick();
  EXPECT_EQ(record.faults, 1U << static_cast<unsigned>(Fault::kHeartbeatLost));
  EXPECT_EQ(record.first_fault.value.integer(), 27);
  EXPECT_EQ(record.first_fault.limit.integer(), 26);
}

TEST(Collapse, FoldsIntoThePoseWithinTheLimitsFromWhereverItWasAndStaysThere) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> share(0.0F, 1.0F);
  for (int run = 0; run < 40; ++run) {
    const Primitive<float> motion = RandomPrimitive<float>(MotionShape{}, random);
    ExecutorConfig config;
    config.collapse.configured = true;
    ASSERT_TRUE(
        config.reactions.Set(Fault::kLateTick, ExecutorState::kRunning, Reaction::kCollapse));
    for (std::size_t i = 0; i < 2; ++i) {
      const JointLimits<float>& limits = motion.joints[i].limits;
      config.collapse.position_rad[i] =
          limits.position_min_rad +
          share(random) * (limits.position_max_rad - limits.position_min_rad);
    }
    ExecutorRig rig(config, motion);
    ASSERT_EQ(rig.configured, Status::kOk);
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    rig.Tick(OperatorCommand::kRun);
    const auto at =
        static_cast<std::int64_t>(share(random) * static_cast<float>(rig.executor.run_ticks()));
    for (std::int64_t i = 0; i < at; ++i) rig.Tick();
    std::array<JointSetpoint, 2> last{rig.output.record.joints[0].limited,
                                      rig.output.record.joints[1].limited};
    rig.input.tick += 10;  // The tick is late. Its own step may be three periods.
    rig.Tick();
    ASSERT_EQ(rig.output.record.reaction, Reaction::kCollapse);
    int ticks = 0;
    bool arrived = false;
    for (; ticks < 20000 && !arrived; ++ticks) {
      for (std::size_t i = 0; i < 2; ++i) last[i] = rig.output.record.joints[i].limited;
      rig.Tick();
      arrived = true;
      for (std::size_t i = 0; i < 2; ++i) {
        const JointRecord& joint = rig.output.record.joints[i];
        const JointLimits<float>& limits = motion.joints[i].limits;
        const float acceleration =
            (joint.limited.velocity_rad_s - last[i].velocity_rad_s) / config.period_s;
        EXPECT_LE(std::abs(acceleration), 1.001F * limits.acceleration_max_rad_s2);
        EXPECT_LE(std::abs(joint.limited.velocity_rad_s), limits.velocity_max_rad_s);
        EXPECT_GE(joint.limited.position_rad, limits.position_min_rad);
        EXPECT_LE(joint.limited.position_rad, limits.position_max_rad);
        EXPECT_FALSE(joint.limit_active && ticks > 20) << "the plan is within the limits by itself";
        EXPECT_EQ(joint.planned.torque_nm, 0);
        arrived = arrived && joint.limited == JointSetpoint{config.collapse.position_rad[i], 0, 0};
      }
    }
    EXPECT_TRUE(arrived) << "run " << run;
    for (int i = 0; i < 100; ++i) rig.Tick();
    EXPECT_EQ(rig.output.record.joints[1].limited.position_rad, config.collapse.position_rad[1]);
    EXPECT_EQ(rig.output.record.faults, 1U << static_cast<unsigned>(Fault::kLateTick));
  }
}

TEST(Collapse, IsRefusedWithoutAPoseOrWithOneBeyondTheLimits) {
  const Primitive<float> motion = Motion();
  ExecutorConfig config;
  ASSERT_TRUE(config.reactions.Set(Fault::kLateTick, ExecutorState::kRunning, Reaction::kCollapse));
  EXPECT_EQ(ExecutorRig(config, motion).configured, Status::kInvalidArgument);
  config.collapse.configured = true;
  config.collapse.position_rad = {motion.joints[0].limits.position_min_rad,
                                  motion.joints[1].limits.position_max_rad};
  EXPECT_EQ(ExecutorRig(config, motion).configured, Status::kOk);
  config.collapse.position_rad[1] += 0.001F;
  EXPECT_EQ(ExecutorRig(config, motion).configured, Status::kInvalidArgument);
  config.collapse.position_rad[1] -= 0.001F;
  for (const float stiffness : {0.0F, 1.1F, std::numeric_limits<float>::quiet_NaN()}) {
    config.collapse.stiffness = stiffness;
    EXPECT_EQ(ExecutorRig(config, motion).configured, Status::kInvalidArgument);
  }
}

TEST(Collapse, LeavesAJointAloneWhoseDriveIsNotEnabled) {
  ExecutorConfig config;
  config.collapse.configured = true;
  const Primitive<float> motion = Motion();
  for (std::size_t i = 0; i < 2; ++i) {
    config.collapse.position_rad[i] = motion.joints[i].position.control_points()[0] + 0.05F;
  }
  ASSERT_TRUE(
      config.reactions.Set(Fault::kDriveError, ExecutorState::kHolding, Reaction::kCollapse));
  ExecutorRig rig(config, motion);
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  rig.drives[0]->stuck = true;  // The drive has dropped out.
  const float before = rig.output.record.joints[0].limited.position_rad;
  for (int i = 0; i < 500; ++i) rig.Tick();
  EXPECT_EQ(rig.output.record.reaction, Reaction::kCollapse);
  EXPECT_EQ(rig.output.record.joints[0].limited.position_rad, before);
  EXPECT_EQ(rig.output.record.joints[1].limited.position_rad, config.collapse.position_rad[1]);
}

TEST(Faults, OneLostReplyIsNone) {
  ExecutorConfig config;
  ExecutorRig rig(config, Motion());
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  rig.silent[0] = true;
  for (int i = 0; i < config.stale_ticks_max; ++i) EXPECT_EQ(rig.Tick().faults, 0);
  rig.silent[0] = false;
  EXPECT_EQ(rig.Tick().faults, 0);
  EXPECT_EQ(rig.output.record.joints[0].reply_age_ticks, 0);
}

}  // namespace
}  // namespace tumbler
