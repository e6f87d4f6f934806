#include "runtime/faults.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <limits>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"

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
    Fault::kStaleReply, Fault::kFollowingError,    Fault::kDriveError, Fault::kOverTemperature,
    Fault::kLinkLost,   Fault::kTransmitQueueFull, Fault::kLateTick,   Fault::kOperatorStop,
    Fault::kNonFinite,  Fault::kArmingTimeout};

Primitive<float> Motion() {
  std::mt19937 random(3);
  MotionShape shape;
  shape.settle_s = 0.2;
  return RandomPrimitive<float>(shape, random);
}

/// Joints 0.3 rad from the start, so that the move takes a while.
void Displace(ExecutorRig& rig) {
  for (auto& drive : rig.drives) drive->reply.position_rad -= 0.05F;
}

/// Makes `fault` happen; joint 1 where one is concerned. @returns ticks that it takes until it must
/// be seen.
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
    case Fault::kLinkLost:
      rig.input.receive_status = Status::kBusOff;
      return 1;
    case Fault::kTransmitQueueFull:
      rig.input.send_status = Status::kWouldBlock;
      return 1;
    case Fault::kLateTick:
      rig.input.tick += config.late_ticks_max + 1;
      return 1;
    case Fault::kEntryMissed:
      return 0;  // Belongs to a transition: executor_sequence_test.cc.
    case Fault::kNonFinite:
      drive.reply.velocity_rad_s = std::numeric_limits<float>::quiet_NaN();
      return 1;
    case Fault::kArmingTimeout:
      drive.stuck = true;
      return config.arming_ticks_max + 1;
    case Fault::kOperatorStop:
    case Fault::kNone:
      break;
  }
  return 1;
}

/// Faults that cannot happen in a state, whatever the world does.
bool IsPossible(Fault fault, ExecutorState state) {
  if (fault == Fault::kArmingTimeout) return state == ExecutorState::kArming;
  // Nothing follows yet in arming, and what is damped need not follow; it is kFault by a late tick
  // while running.
  if (fault == Fault::kFollowingError)
    return state != ExecutorState::kArming && state != ExecutorState::kFault;
  if (fault == Fault::kLateTick)
    return state != ExecutorState::kFault;  // It is the one that led there.
  // A stop that brakes is a state of its own, and in stopping there is nothing left to do.
  return true;
}

TEST(FaultTable, AnswersEveryFaultInEveryStateAsStated) {
  using R = Reaction;
  // disarmed, arming, holding, moving to start, running, settling, stopping, fault
  const std::array<std::array<R, kExecutorStateCount>, 10> stated{{
      {R::kIgnore, R::kDisable, R::kHold, R::kHold, R::kDamp, R::kHold, R::kHold, R::kDamp},
      {R::kIgnore, R::kDisable, R::kDamp, R::kDamp, R::kDamp, R::kDamp, R::kDamp, R::kDamp},
      {R::kIgnore, R::kDisable, R::kDamp, R::kDamp, R::kDamp, R::kDamp, R::kDamp, R::kDamp},
      {R::kIgnore, R::kDisable, R::kDamp, R::kDamp, R::kDamp, R::kDamp, R::kDamp, R::kDamp},
      {R::kIgnore, R::kDisable, R::kDisable, R::kDisable, R::kDisable, R::kDisable, R::kDisable,
       R::kDisable},
      {R::kIgnore, R::kDisable, R::kDisable, R::kDisable, R::kDisable, R::kDisable, R::kDisable,
       R::kDisable},
      {R::kIgnore, R::kDisable, R::kHold, R::kHold, R::kDamp, R::kHold, R::kHold, R::kHold},
      {R::kIgnore, R::kDisable, R::kHold, R::kHold, R::kHold, R::kHold, R::kHold, R::kHold},
      {R::kIgnore, R::kDisable, R::kDamp, R::kDamp, R::kDamp, R::kDamp, R::kDamp, R::kDamp},
      {R::kIgnore, R::kDisable, R::kDisable, R::kDisable, R::kDisable, R::kDisable, R::kDisable,
       R::kDisable},
  }};
  const FaultTable table;
  for (std::size_t f = 0; f < kFaults.size(); ++f) {
    for (const ExecutorState state : kStates) {
      EXPECT_EQ(table(kFaults[f], state), stated[f][static_cast<std::size_t>(state)])
          << ToString(kFaults[f]) << " while " << ToString(state);
    }
  }
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
  for (const Reaction reaction :
       {Reaction::kIgnore, Reaction::kHold, Reaction::kDamp, Reaction::kDisable}) {
    EXPECT_TRUE(names.insert(ToString(reaction)).second);
  }
}

class FaultMatrix : public ::testing::TestWithParam<std::tuple<Fault, ExecutorState, Reaction>> {};

/// The core of the matrix: for each configured reaction the executor does what the table says, and
/// nothing else.
TEST_P(FaultMatrix, TheExecutorDoesWhatTheTableSays) {
  const auto [fault, state, reaction] = GetParam();
  ExecutorConfig config;
  config.arming_ticks_max = 50;
  config.reactions.Set(fault, state, reaction);
  ExecutorRig rig(config, Motion());
  ASSERT_EQ(rig.configured, Status::kOk);
  if (state == ExecutorState::kMovingToStart) Displace(rig);
  if (state == ExecutorState::kArming) {
    for (auto& drive : rig.drives) drive->start_up_ticks = 30;
  }
  ASSERT_TRUE(rig.Reach(state)) << ToString(rig.executor.state());
  const std::uint16_t before = rig.output.record.faults;
  const Reaction present = rig.output.record.reaction;
  const FaultReport cause = rig.output.record.first_fault;

  const int ticks = Provoke(fault, rig, config);
  if (fault == Fault::kArmingTimeout) rig.drives[0]->start_up_ticks = 1000;
  std::int64_t seen_at = -1;
  for (int i = 0; i < ticks; ++i) {
    rig.Tick(fault == Fault::kOperatorStop ? OperatorCommand::kStop : OperatorCommand::kNone);
    if (rig.output.record.faults != before && seen_at < 0) seen_at = rig.output.record.tick;
  }
  const TickRecord& record = rig.output.record;
  const auto bit = static_cast<std::uint16_t>(1U << static_cast<unsigned>(fault));

  const Reaction answer = config.reactions(fault, state);
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
  EXPECT_EQ(record.reaction, std::max(present, answer));
  if (state == ExecutorState::kFault) {
    EXPECT_EQ(record.first_fault.fault, cause.fault) << "the cause is kept, not its consequence";
  } else {
    EXPECT_EQ(record.first_fault.fault, fault);
    EXPECT_EQ(record.first_fault.tick, seen_at);
    EXPECT_EQ(record.first_fault.state, state);
    EXPECT_EQ(record.first_fault.reaction, answer);
    const bool of_a_joint = fault == Fault::kStaleReply || fault == Fault::kFollowingError ||
                            fault == Fault::kDriveError || fault == Fault::kOverTemperature ||
                            fault == Fault::kNonFinite;
    if (of_a_joint) {
      EXPECT_EQ(record.first_fault.joint, 1);
    }
  }
  if (fault == Fault::kOverTemperature && state != ExecutorState::kFault) {
    EXPECT_EQ(record.first_fault.value, 95);
    EXPECT_EQ(record.first_fault.limit, 80);
  }

  // What the drives are told is what the reaction means; every drive, every tick.
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
      case Reaction::kIgnore:
        ADD_FAILURE() << "a latched fault without a reaction";
    }
  }
}

std::vector<std::tuple<Fault, ExecutorState, Reaction>> PossibleCases() {
  std::vector<std::tuple<Fault, ExecutorState, Reaction>> cases;
  for (const Fault fault : kFaults) {
    for (const ExecutorState state : kStates) {
      if (!IsPossible(fault, state)) continue;
      for (const Reaction reaction :
           {Reaction::kIgnore, Reaction::kHold, Reaction::kDamp, Reaction::kDisable}) {
        cases.emplace_back(fault, state, reaction);
      }
    }
  }
  return cases;
}

/// A readable name: fault, state and reaction without their blanks.
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
  rig.drives[0]->reply.error = 0;  // The cause goes away; the fault does not.
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
