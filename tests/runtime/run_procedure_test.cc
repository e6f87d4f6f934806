#include "runtime/executor/run_procedure.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;

RunProcedureConfig Short() {
  RunProcedureConfig config;
  config.hold_ticks = 50;
  config.reply_ticks_max = 20;
  config.start_ticks_max = 30;
  config.stop_hold_ticks = 25;
  config.fault_ticks = 40;
  return config;
}

Primitive<float> Motion() {
  std::mt19937 random(50);
  return testing::RandomPrimitive<float>({}, random);
}

class RunSequenceTest : public ::testing::Test {
 protected:
  template <typename Each>
  void Play(Each each) {
    for (int i = 0; i < 50000 && !procedure.done(); ++i) {
      each();
      rig.Tick(procedure.Next(rig.output.record));
      ++ticks[static_cast<std::size_t>(rig.output.record.state)];
    }
    ASSERT_TRUE(procedure.done());
    EXPECT_EQ(rig.executor.state(), ExecutorState::kDisarmed);
    for (const auto& drive : rig.drives) EXPECT_EQ(drive->request, DriveRequest::kDisable);
  }
  void SetUpAnew(const RunProcedureConfig& config) {
    procedure = RunProcedure(config);
    rig.silent = {};
    rig.Tick(OperatorCommand::kClearFaults);
    rig.Tick();
    ticks = {};
  }
  int& Ticks(ExecutorState state) { return ticks[static_cast<std::size_t>(state)]; }

  ExecutorRig rig{{}, Motion()};
  RunProcedure procedure{Short()};
  std::array<int, kExecutorStateCount> ticks{};
  int before_settling = 0;  // ticks in holding before the motion
};

TEST_F(RunSequenceTest, CompletesARun) {
  Play([] {});
  EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
  EXPECT_EQ(Ticks(ExecutorState::kRunning), rig.executor.run_ticks() + 1);
  EXPECT_GE(Ticks(ExecutorState::kHolding), 50);
  EXPECT_GE(Ticks(ExecutorState::kDisarmed), 10);
}

TEST_F(RunSequenceTest, LowersTheRobotBeforeTorqueOffWhenItIsTo) {
  RunProcedureConfig config = Short();
  config.lower_ticks = 2500;
  for (const bool fault : {false, true}) {
    SetUpAnew(config);
    float least_kp = 1e9F, last_kp = 1e9F;
    int lowering = 0;
    Play([&] {
      if (fault && rig.output.record.state == ExecutorState::kHolding && procedure.runs() == 1 &&
          Ticks(ExecutorState::kSettling) > 0) {
        rig.silent[1] = true;  // A stale reply while holding is answered by a hold.
      }
      if (rig.drives[0]->request != DriveRequest::kEnable) return;
      const float kp = rig.drives[0]->setpoint.kp_nm_per_rad;
      if (kp < 200 && Ticks(ExecutorState::kSettling) > 0) {
        ++lowering;
        EXPECT_LE(kp, last_kp) << "it only becomes softer";
        EXPECT_GE(last_kp - kp, 0);
        EXPECT_LE(std::min(last_kp, 200.0F) - kp, 0.11F) << "slowly";
      }
      last_kp = kp;
      least_kp = std::min(least_kp, kp);
    });
    EXPECT_EQ(procedure.outcome(), fault ? RunOutcome::kFault : RunOutcome::kCompleted);
    EXPECT_GE(lowering, 2400) << fault;
    EXPECT_EQ(least_kp, 0);
  }
}

TEST_F(RunSequenceTest, HoldsARobotThatWouldDropUntilSomebodyAsksForTorqueOff) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = -1;
  for (const bool stopped : {false, true}) {
    SetUpAnew(config);
    int held = 0;
    Play([&] {
      if (stopped && Ticks(ExecutorState::kRunning) == 400 && held == 0) {
        procedure.RequestStop();
        procedure.RequestFinish();  // A nervous hand is not taken for the wish to let it drop.
      }
      const int before = stopped ? 25 : 50;  // until the robot is held on
      if (rig.output.record.state == ExecutorState::kHolding &&
          Ticks(stopped ? ExecutorState::kStopping : ExecutorState::kSettling) > 0) {
        ++held;
      }
      if (held == 5000 + before) procedure.RequestFinish();
    });
    EXPECT_EQ(procedure.outcome(), stopped ? RunOutcome::kStopped : RunOutcome::kCompleted);
    EXPECT_GE(held, 5000);
    EXPECT_LE(held, 5200);
  }
}

TEST_F(RunSequenceTest, ARequestAsTheHoldBeginsIsTakenForTheMotionAndTheNextOneTakesTheTorqueOff) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = -1;
  for (int at = 0; at < 2 * static_cast<int>(config.stop_hold_ticks); ++at) {
    SetUpAnew(config);
    int held = 0, asked_at = -1, first_late = 0;
    bool open = false;
    Play([&] {
      if (procedure.end_hold() == EndHold::kNone) return;
      if (held++ == at) {
        open = procedure.end_hold() == EndHold::kOpen;
        procedure.RequestFinish();
        asked_at = held;
      } else if (held == asked_at + 1) {
        first_late = procedure.late_requests();
      } else if (held == 500) {
        EXPECT_EQ(procedure.end_hold(), EndHold::kOpen);
        procedure.RequestStop();
      }
    });
    EXPECT_EQ(open, at + 1 >= config.stop_hold_ticks) << at;
    // What is said to the operator is what happens.
    EXPECT_EQ(held, open ? asked_at : 500) << at;
    EXPECT_EQ(first_late, open ? 0 : 1) << at;
    EXPECT_EQ(procedure.late_requests(), open ? 0 : 1) << at;
    EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted) << at;
  }
}

TEST_F(RunSequenceTest, AFaultInTheVeryTickThatTakesTheTorqueOffIsAFaultOfTheRun) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = -1;
  SetUpAnew(config);
  bool asked = false;
  Play([&] {
    if (asked || procedure.end_hold() != EndHold::kOpen) return;
    asked = true;
    procedure.RequestFinish();
    rig.input.tick += 100;  // too many periods missed
  });
  EXPECT_TRUE(asked);
  EXPECT_EQ(rig.output.record.first_fault.fault, Fault::kLateTick);
  EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
}

TEST_F(RunSequenceTest, AFaultOnTheWayHomeIsNotAnsweredByASecondWay) {
  RunProcedureConfig config = Short();
  config.go_home = true;
  config.end_hold_ticks = 100;
  procedure = RunProcedure(config);
  TickRecord record;
  record.joint_count = 1;
  record.joints[0].reply_age_ticks = 0;
  record.joints[0].drive_state = DriveState::kEnabled;
  int ways = 0;
  // What the executor would say: it arms, moves, runs into a fault, goes home and into the next.
  for (int i = 0; i < 1000 && !procedure.done(); ++i) {
    const OperatorCommand command = procedure.Next(record);
    record.command = command;
    switch (command) {
      case OperatorCommand::kArm:
      case OperatorCommand::kMoveToStart:
        record.state = ExecutorState::kHolding;
        break;
      case OperatorCommand::kRun:
        record.state = ExecutorState::kRunning;
        break;
      case OperatorCommand::kGoHome:
        ++ways;
        record.state = ExecutorState::kSettling;
        record.reaction = Reaction::kIgnore;
        break;
      case OperatorCommand::kDisarm:
        record.state = ExecutorState::kDisarmed;
        break;
      default:
        if (record.state != ExecutorState::kRunning && record.state != ExecutorState::kSettling)
          break;
        record.state = ExecutorState::kFault;
        record.reaction = Reaction::kHold;
        record.faults = 1U << static_cast<unsigned>(Fault::kStaleReply);
        record.first_fault.fault = Fault::kStaleReply;
    }
  }
  EXPECT_EQ(ways, 1);
  EXPECT_TRUE(procedure.done());
  EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
}

TEST_F(RunSequenceTest, HoldsForAWhileWhereNobodyCanAsk) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = 700;
  SetUpAnew(config);
  Play([] {});
  EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
  EXPECT_GE(Ticks(ExecutorState::kHolding), 750);
  EXPECT_LE(Ticks(ExecutorState::kHolding), 900);
}

TEST_F(RunSequenceTest, DoesNotHoldWithADriveThatIsSilentOrHasFailed) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = -1;
  for (const bool silent : {false, true}) {
    SetUpAnew(config);
    Play([&] {
      if (Ticks(ExecutorState::kSettling) != 5) return;
      rig.silent[1] = silent;
      if (!silent) rig.drives[1]->reply.error = 1;
    });
    EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
    EXPECT_LE(Ticks(ExecutorState::kFault), 60);
    rig.drives[1]->reply.error = 0;
  }
}

TEST_F(RunSequenceTest, APauseOfRepliesThatIsNoFaultDoesNotDropTheRobotWheneverItComes) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = 400;
  ExecutorConfig patient;
  patient.stale_ticks_max = 20;
  for (int begin = 30; begin <= 60; ++begin) {  // The hold after the motion takes 50 ticks.
    rig = ExecutorRig{patient, Motion()};
    rig.Reconfigure();
    SetUpAnew(config);
    Play([&] {
      const int held = Ticks(ExecutorState::kSettling) > 0 ? Ticks(ExecutorState::kHolding) : 0;
      const int since = held - before_settling;
      if (Ticks(ExecutorState::kSettling) == 0) before_settling = Ticks(ExecutorState::kHolding);
      rig.silent[1] = held > 0 && since >= begin && since < begin + 8;
    });
    EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted) << begin;
    EXPECT_GE(Ticks(ExecutorState::kHolding), 450) << begin;
  }
}

TEST_F(RunSequenceTest, AFaultAfterALatchedStopOfTheOperatorMakesTheRunFaulty) {
  ExecutorConfig executor;
  for (std::size_t state = 0; state < kExecutorStateCount; ++state) {
    executor.reactions.Set(Fault::kOperatorStop, static_cast<ExecutorState>(state),
                           Reaction::kDamp);
  }
  for (const bool silent : {false, true}) {
    rig = ExecutorRig{executor, Motion()};
    rig.Reconfigure();
    SetUpAnew(Short());
    Play([&] {
      if (Ticks(ExecutorState::kRunning) == 200) procedure.RequestStop();
      rig.silent[1] = silent && Ticks(ExecutorState::kFault) >= 5;
    });
    EXPECT_EQ(procedure.outcome(), silent ? RunOutcome::kFault : RunOutcome::kStopped);
  }
}

TEST_F(RunSequenceTest, TakesTheTorqueOffAtOnceWhereTheRobotStandsWithoutIt) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = -1;
  config.safe_nodes = 1;
  SetUpAnew(config);
  Play([] {});
  EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
  EXPECT_LE(Ticks(ExecutorState::kHolding), 120);
}

TEST_F(RunSequenceTest, DrivesThatHaveLatchedAnErrorAreClearedOnRequest) {
  for (const bool clear : {false, true}) {
    RunProcedureConfig config = Short();
    if (clear) config.clear_ticks = 15;
    rig.drives[1]->reply.error = 0;
    SetUpAnew(config);
    rig.drives[1]->reply.error = 0x20;
    int cleared_for = 0;
    Play([&] {
      cleared_for +=
          rig.drives[1]->request == DriveRequest::kClearErrors || cleared_for > 0 ? 1 : 0;
      if (cleared_for == 10) rig.drives[1]->reply.error = 0;  // It takes its time.
    });
    EXPECT_EQ(procedure.outcome(), clear ? RunOutcome::kCompleted : RunOutcome::kRefused);
    EXPECT_EQ(procedure.refusal().refusal, clear ? Refusal::kNone : Refusal::kDriveError);
  }
}

TEST_F(RunSequenceTest, AsksForNothingThatIsRefusedInAHealthyRun) {
  Play([this] { EXPECT_EQ(rig.output.record.refusal.refusal, Refusal::kNone); });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
}

TEST_F(RunSequenceTest, WaitsForRepliesAndGivesUpInTheEnd) {
  rig.silent[1] = true;
  Play([] {});
  EXPECT_EQ(procedure.outcome(), RunOutcome::kRefused);
  EXPECT_EQ(procedure.refusal().refusal, Refusal::kNoReply);
  EXPECT_EQ(procedure.refusal().joint, 1);
  EXPECT_EQ(Ticks(ExecutorState::kArming), 0);
}

TEST_F(RunSequenceTest, RefusesWhenTheJointsDoNotComeToTheStart) {
  Play([this] {
    if (rig.output.record.state == ExecutorState::kMovingToStart) {
      rig.follow = false;
      rig.drives[0]->reply.position_rad = rig.drives[0]->setpoint.position_rad + 0.1F;
    }
  });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kRefused);
  EXPECT_EQ(procedure.refusal().refusal, Refusal::kOutsideStartSet);
  EXPECT_EQ(Ticks(ExecutorState::kRunning), 0);
}

TEST_F(RunSequenceTest, StopsInMidMotionThenHoldsThenDisarms) {
  Play([this] {
    if (Ticks(ExecutorState::kRunning) == 400) procedure.RequestStop();
  });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kStopped);
  EXPECT_EQ(Ticks(ExecutorState::kRunning), 400);
  EXPECT_GT(Ticks(ExecutorState::kStopping), 0);
  EXPECT_GE(Ticks(ExecutorState::kHolding), 25);
}

TEST_F(RunSequenceTest, DisarmsAtOnceWhenAskedTo) {
  Play([this] {
    if (Ticks(ExecutorState::kRunning) == 400) procedure.RequestDisarm();
  });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kStopped);
  EXPECT_EQ(Ticks(ExecutorState::kStopping), 0);
}

TEST_F(RunSequenceTest, StopsBeforeArmingToo) {
  rig.silent[0] = true;
  Play([this] { procedure.RequestStop(); });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kStopped);
  EXPECT_EQ(Ticks(ExecutorState::kArming), 0);
}

TEST_F(RunSequenceTest, CarriesOutTheReactionToAFaultBeforeDisarming) {
  Play([this] {
    if (Ticks(ExecutorState::kRunning) == 200) rig.drives[1]->reply.error = 1;
  });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
  EXPECT_GE(Ticks(ExecutorState::kFault), 40);
  EXPECT_EQ(rig.output.record.first_fault.fault, Fault::kDriveError);
}

TEST_F(RunSequenceTest, AStopAfterAFaultStillIsAFault) {
  Play([this] {
    if (Ticks(ExecutorState::kRunning) == 200) rig.drives[1]->reply.error = 1;
    if (Ticks(ExecutorState::kFault) == 5) procedure.RequestStop();
  });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
}

/// A procedure whose executor the test plays: it writes what the executor would say.
struct SpokenTo {
  explicit SpokenTo(const RunProcedureConfig& config) : procedure(config) {
    record.joint_count = 1;
    record.joints[0].reply_age_ticks = 0;
    record.joints[0].drive_state = DriveState::kEnabled;
  }
  /// A tick, after which the executor is in this state. @returns what was asked of it.
  OperatorCommand Say(ExecutorState state, Refusal refusal = Refusal::kNone) {
    record.command = procedure.Next(record);
    record.state = state;
    record.refusal.refusal = refusal;
    return record.command;
  }
  /// The executor finds a fault.
  void Fail(Fault fault, Reaction reaction) {
    record.faults |= 1U << static_cast<unsigned>(fault);
    if (record.first_fault.fault == Fault::kNone) record.first_fault.fault = fault;
    record.reaction = reaction;
    record.state = ExecutorState::kFault;
  }
  /// To the first kRun.
  void ArmAndMove() {
    EXPECT_EQ(Say(ExecutorState::kArming), OperatorCommand::kArm);
    EXPECT_EQ(Say(ExecutorState::kHolding), OperatorCommand::kNone);
    EXPECT_EQ(Say(ExecutorState::kMovingToStart), OperatorCommand::kMoveToStart);
    EXPECT_EQ(Say(ExecutorState::kHolding), OperatorCommand::kNone);
  }
  /// To the middle of the motion.
  void Begin() {
    ArmAndMove();
    EXPECT_EQ(Say(ExecutorState::kRunning), OperatorCommand::kRun);
    EXPECT_EQ(Say(ExecutorState::kRunning), OperatorCommand::kNone);
  }
  /// Ticks in which nothing changes, until it is asked for something. @returns for what.
  OperatorCommand UntilAsked(int ticks_max = 1000) {
    OperatorCommand command = OperatorCommand::kNone;
    for (int i = 0; i < ticks_max && command == OperatorCommand::kNone && !procedure.done(); ++i)
      command = Say(record.state);
    return command;
  }

  RunProcedure procedure;
  TickRecord record;
};

TEST(RunProcedure, AStartIsTriedAgainOnlyWhereItsReasonMayPassAndNotForLong) {
  for (int number = 1; number <= static_cast<int>(Refusal::kLiesOtherwise); ++number) {
    const auto refusal = static_cast<Refusal>(number);
    const bool passes = refusal == Refusal::kOutsideStartSet || refusal == Refusal::kNotAtRest ||
                        refusal == Refusal::kLiesOtherwise || refusal == Refusal::kPitchUnknown;
    SpokenTo run(Short());
    run.ArmAndMove();
    int asked = 0;
    while (run.Say(ExecutorState::kHolding, refusal) == OperatorCommand::kRun) ++asked;
    EXPECT_EQ(asked, passes ? 31 : 1) << ToString(refusal);
    EXPECT_EQ(run.procedure.outcome(), RunOutcome::kRefused);
    EXPECT_EQ(run.procedure.refusal().refusal, refusal);
  }
}

TEST(RunProcedure, WhatSomebodyElseIsRefusedDoesNotEndTheRun) {
  SpokenTo run(Short());
  run.ArmAndMove();
  EXPECT_EQ(run.Say(ExecutorState::kHolding), OperatorCommand::kRun);
  // In that tick the operator's branch took the place of the command.
  run.record.command = OperatorCommand::kBranch;
  run.record.refusal.refusal = Refusal::kWrongState;
  EXPECT_EQ(run.Say(ExecutorState::kRunning), OperatorCommand::kRun);
  EXPECT_EQ(run.procedure.outcome(), RunOutcome::kPending);
}

TEST(RunProcedure, ADriveThatFallsSilentBeforeArmingMayAnswerAgainInItsTime) {
  for (const bool answers : {true, false}) {
    SpokenTo run(Short());
    int asked = 0;
    for (; asked < 100 &&
           run.Say(ExecutorState::kDisarmed, Refusal::kNoReply) == OperatorCommand::kArm;
         ++asked) {
      if (answers && asked == 10) break;
    }
    if (answers) {
      run.Say(ExecutorState::kHolding);
      EXPECT_EQ(run.UntilAsked(), OperatorCommand::kMoveToStart);
    } else {
      EXPECT_EQ(asked, 20) << "reply_ticks_max";
      EXPECT_EQ(run.procedure.outcome(), RunOutcome::kRefused);
      EXPECT_EQ(run.procedure.refusal().refusal, Refusal::kNoReply);
    }
  }
}

TEST(RunProcedure, ADriveThatReportsOnlyAnErrorIsHeard) {
  for (const DriveState state : {DriveState::kUnknown, DriveState::kFault}) {
    SpokenTo run(Short());
    run.record.joints[0].reply_age_ticks = -1;
    run.record.joints[0].drive_state = state;
    EXPECT_EQ(run.Say(ExecutorState::kDisarmed),
              state == DriveState::kFault ? OperatorCommand::kArm : OperatorCommand::kNone);
  }
}

TEST_F(RunSequenceTest, ErrorsAreClearedOnceEveryDriveWasHeardAndNotWaitedForForEver) {
  RunProcedureConfig config = Short();
  config.clear_ticks = 15;
  for (const int silent_ticks : {10, 1000}) {
    rig = ExecutorRig{{}, Motion()};
    rig.Reconfigure();
    procedure = RunProcedure(config);
    ticks = {};
    int tick = 0, cleared_at = -1;
    Play([&] {
      rig.silent[1] = ++tick <= silent_ticks;
      if (cleared_at < 0 && rig.drives[1]->request == DriveRequest::kClearErrors) cleared_at = tick;
    });
    if (silent_ticks == 10) {
      EXPECT_GT(cleared_at, silent_ticks);
      EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
    } else {
      EXPECT_EQ(cleared_at, -1);
      EXPECT_EQ(procedure.outcome(), RunOutcome::kRefused);
      EXPECT_EQ(procedure.refusal().refusal, Refusal::kNoReply);
      EXPECT_LE(tick, 20 + 15 + 10);
    }
  }
}

TEST_F(RunSequenceTest, AWishToFinishIsPassedOnOnceAndTheMotionEnds) {
  int asked = 0;
  Play([&] {
    if (Ticks(ExecutorState::kRunning) == 400) procedure.RequestFinish();
    if (rig.output.record.command == OperatorCommand::kFinish) ++asked;
  });
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(procedure.outcome(), RunOutcome::kStopped) << "the hold after the motion is left out";
  EXPECT_EQ(Ticks(ExecutorState::kRunning), rig.executor.run_ticks() + 1);
}

RunProcedureConfig GoingHome() {
  RunProcedureConfig config = Short();
  config.go_home = true;
  config.end_hold_ticks = 100;
  return config;
}

TEST(RunProcedure, WhereTheRobotStandsWithoutTorqueNoWayLeadsHomeAfterAFault) {
  for (const bool stands : {false, true}) {
    RunProcedureConfig config = GoingHome();
    config.safe_nodes = stands ? 1 : 0;
    SpokenTo run(config);
    run.Begin();
    run.Say(ExecutorState::kSettling);
    run.Say(ExecutorState::kSettling);
    run.Fail(Fault::kStaleReply, Reaction::kHold);
    EXPECT_EQ(run.UntilAsked(), stands ? OperatorCommand::kDisarm : OperatorCommand::kGoHome);
    EXPECT_EQ(run.procedure.outcome(), RunOutcome::kFault);
  }
}

/// One on its way to a safe node after a fault.
SpokenTo OnItsWayHome() {
  SpokenTo run(GoingHome());
  run.Begin();
  run.Fail(Fault::kStaleReply, Reaction::kHold);
  EXPECT_EQ(run.UntilAsked(), OperatorCommand::kGoHome);
  run.record.state = ExecutorState::kRunning;
  run.record.reaction = Reaction::kIgnore;
  return run;
}

TEST(RunProcedure, OnTheWayHomeAWishToFinishChangesNothingAndAStopStops) {
  for (const bool stop : {false, true}) {
    SpokenTo run = OnItsWayHome();
    stop ? run.procedure.RequestStop() : run.procedure.RequestFinish();
    EXPECT_EQ(run.UntilAsked(50), stop ? OperatorCommand::kStop : OperatorCommand::kNone);
    EXPECT_EQ(run.procedure.outcome(), RunOutcome::kFault) << "which it was before the stop";
  }
}

TEST(RunProcedure, AFaultWithoutTorqueEndsInTorqueOffAndNotInAHoldOrALowering) {
  for (const std::int64_t lower_ticks : {0, 200}) {
    for (const Reaction reaction : {Reaction::kHold, Reaction::kDisable}) {
      RunProcedureConfig config = Short();
      config.end_hold_ticks = 100;
      config.lower_ticks = lower_ticks;
      SpokenTo run(config);
      run.Begin();
      run.Fail(Fault::kDriveError, reaction);
      int waited = 0;
      OperatorCommand command = OperatorCommand::kNone;
      while (command == OperatorCommand::kNone && waited < 1000) {
        command = run.Say(run.record.state);
        ++waited;
      }
      const bool lowers = lower_ticks > 0 && reaction == Reaction::kHold;
      EXPECT_EQ(command, lowers ? OperatorCommand::kLower : OperatorCommand::kDisarm);
      EXPECT_EQ(waited > 100, !lowers && reaction == Reaction::kHold) << waited;
    }
  }
}

TEST(RunProcedure, AFaultWhileTheRobotIsLoweredIsWaitedForOnceAndOnlyWhereItIsNoHold) {
  // The reactions to two faults, and how often the first reaction is waited for.
  struct Row {
    Reaction reaction;
    bool waits;
  };
  for (const Row& row : {Row{Reaction::kHold, false}, {Reaction::kDamp, true}}) {
    RunProcedureConfig config = Short();
    config.lower_ticks = 200;
    SpokenTo run(config);
    run.Begin();
    run.Say(ExecutorState::kHolding);
    EXPECT_EQ(run.UntilAsked(), OperatorCommand::kStop);
    EXPECT_EQ(run.UntilAsked(), OperatorCommand::kLower);
    for (int i = 0; i < 100; ++i) EXPECT_EQ(run.Say(run.record.state), OperatorCommand::kNone);
    run.Fail(Fault::kStaleReply, row.reaction);
    int waited = 0;
    while (run.Say(run.record.state) != OperatorCommand::kDisarm && waited < 1000) ++waited;
    // It was lowered already: after the wait for the reaction nothing else is left to do.
    EXPECT_NEAR(waited, row.waits ? 40 : 99, 2);
    EXPECT_EQ(run.procedure.outcome(), RunOutcome::kFault);
  }
  // A fault before, whose reaction was waited for: the next does not interrupt the lowering.
  RunProcedureConfig config = Short();
  config.lower_ticks = 200;
  SpokenTo run(config);
  run.Begin();
  run.Fail(Fault::kStaleReply, Reaction::kHold);
  EXPECT_EQ(run.UntilAsked(), OperatorCommand::kLower);
  run.Fail(Fault::kWrongSequence, Reaction::kDamp);
  int lowered = 0;
  while (run.Say(run.record.state) != OperatorCommand::kDisarm && lowered < 1000) ++lowered;
  EXPECT_NEAR(lowered, 199, 2);
}

TEST(RunProcedure, AStopThatTheExecutorAnswersAsAFaultIsAFaultWhereNobodyAskedForIt) {
  SpokenTo run(Short());
  run.Begin();
  run.Fail(Fault::kOperatorStop, Reaction::kDamp);
  EXPECT_EQ(run.UntilAsked(), OperatorCommand::kDisarm);
  EXPECT_EQ(run.procedure.outcome(), RunOutcome::kFault);
}

TEST(RunProcedure, TorqueOffIsSaidUntilTheExecutorObeys) {
  SpokenTo run(Short());
  run.Begin();
  run.procedure.RequestDisarm();
  for (int i = 0; i < 5; ++i) EXPECT_EQ(run.Say(ExecutorState::kRunning), OperatorCommand::kDisarm);
  EXPECT_EQ(run.Say(ExecutorState::kDisarmed), OperatorCommand::kDisarm);
  EXPECT_EQ(run.Say(ExecutorState::kDisarmed), OperatorCommand::kNone);
}

TEST(RunProcedure, AFaultInTheTickAfterARefusalOrAfterQuittingIsNoFaultOfARun) {
  SpokenTo refused(Short());
  EXPECT_EQ(refused.Say(ExecutorState::kDisarmed, Refusal::kDriveError), OperatorCommand::kArm);
  EXPECT_EQ(refused.Say(ExecutorState::kDisarmed), OperatorCommand::kDisarm);
  refused.Fail(Fault::kDriveError, Reaction::kDisable);
  refused.Say(ExecutorState::kDisarmed);
  EXPECT_EQ(refused.procedure.outcome(), RunOutcome::kRefused);

  RunProcedureConfig config = Short();
  config.attended = true;
  SpokenTo quit(config);
  quit.Say(ExecutorState::kDisarmed);
  quit.procedure.RequestQuit();
  EXPECT_EQ(quit.Say(ExecutorState::kDisarmed), OperatorCommand::kDisarm);
  quit.Fail(Fault::kLateTick, Reaction::kHold);
  quit.Say(ExecutorState::kDisarmed);
  EXPECT_EQ(quit.procedure.outcome(), RunOutcome::kStopped);
}

/// The end that a procedure under test has.
enum class End { kSafe, kHold, kLower, kTorqueOff };

RunProcedureConfig WithEnd(End end, std::int64_t hold_ticks) {
  RunProcedureConfig config = Short();
  if (end == End::kSafe || end == End::kHold) config.end_hold_ticks = hold_ticks;
  if (end == End::kLower) config.lower_ticks = 2000;
  config.go_home = end == End::kSafe;
  return config;
}

TEST_F(RunSequenceTest, AFaultInTheHoldAtTheEndNeitherEndsItNorMakesItLonger) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = 700;
  SetUpAnew(config);
  int after = 0;
  Play([&] {
    if (Ticks(ExecutorState::kSettling) == 0 ||
        Ticks(ExecutorState::kHolding) + Ticks(ExecutorState::kFault) < 300) {
      return;
    }
    ++after;
    rig.silent[1] = after < 30;  // A short silence, after which the drive answers again.
  });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
  EXPECT_GE(after, 400);
  EXPECT_LE(after, 700);
}

TEST_F(RunSequenceTest, WhoAsksOnceMoreInTheHoldIsHeardThoughAFaultIsLatched) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = -1;
  for (const int request : {0, 1, 2}) {
    SetUpAnew(config);
    int after = 0;
    Play([&] {
      if (Ticks(ExecutorState::kSettling) == 0 ||
          Ticks(ExecutorState::kHolding) + Ticks(ExecutorState::kFault) < 300) {
        return;
      }
      ++after;
      rig.silent[1] = after < 30;
      if (after != 3000) return;
      if (request == 0) procedure.RequestFinish();
      if (request == 1) procedure.RequestStop();
      if (request == 2) procedure.RequestDisarm();
    });
    EXPECT_EQ(procedure.outcome(), RunOutcome::kFault) << request;
    EXPECT_GE(after, 3000) << request;
    EXPECT_LE(after, 3020) << request;
  }
}

TEST_F(RunSequenceTest, ADriveThatFallsSilentForGoodInTheHoldEndsItAfterTheReaction) {
  RunProcedureConfig config = Short();
  config.end_hold_ticks = -1;
  SetUpAnew(config);
  int after = 0;
  Play([&] {
    if (Ticks(ExecutorState::kSettling) == 0 || Ticks(ExecutorState::kHolding) < 300) return;
    ++after;
    rig.silent[1] = true;
  });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
  EXPECT_LE(after, 100);
}

TEST_F(RunSequenceTest, EveryEndComesAfterTheLastRequestWhateverFaultsComeWhenever) {
  std::mt19937 random(7);
  for (const End end : {End::kSafe, End::kHold, End::kLower, End::kTorqueOff}) {
    for (int trial = 0; trial < 40; ++trial) {
      rig.drives[1]->reply.error = 0;
      SetUpAnew(WithEnd(end, trial % 2 == 0 ? -1 : 600));
      // The faults begin around the end of the motion, and go on; then somebody asks, twice.
      const int fault = static_cast<int>(random() % 400);
      const int silence = static_cast<int>(10 + random() % 60);
      const int period = static_cast<int>(80 + random() % 300);
      const int request = static_cast<int>(random() % 2500);
      int settled = -1;
      bool faulty = false;
      Play([&] {
        if (Ticks(ExecutorState::kSettling) > 0) ++settled;
        if (settled < 0) return;
        rig.silent[1] = settled >= fault && (settled - fault) % period < silence;
        faulty = faulty || rig.output.record.first_fault.fault != Fault::kNone;
        // The second request comes after the first moments of any hold.
        if (settled == request || settled == request + 200) procedure.RequestStop();
      });
      EXPECT_LE(settled, request + 200 + 2000 + 3 * 40 + 100) << static_cast<int>(end) << trial;
      const bool latched = rig.output.record.first_fault.fault != Fault::kNone;
      if (faulty) {
        EXPECT_EQ(procedure.outcome(), RunOutcome::kFault) << static_cast<int>(end) << trial;
      } else if (!latched) {
        EXPECT_NE(procedure.outcome(), RunOutcome::kFault) << static_cast<int>(end) << trial;
      }
    }
  }
}

class AttendedRun : public ::testing::Test {
 protected:
  static RunProcedureConfig Attended() {
    RunProcedureConfig config = Short();
    config.attended = true;
    return config;
  }
  void Tick(int count) {
    for (int i = 0; i < count; ++i) rig.Tick(procedure.Next(rig.output.record));
  }
  /// @returns false when the state never came.
  bool TickUntil(ExecutorState state) {
    for (int i = 0; i < 20000 && rig.output.record.state != state; ++i) Tick(1);
    return rig.output.record.state == state;
  }
  Refusal Start() { return procedure.RequestStart(rig.output.record); }

  ExecutorRig rig{{}, Motion()};
  RunProcedure procedure{Attended()};
};

TEST_F(AttendedRun, NothingMovesBeforeSomebodySaysSo) {
  Tick(5000);
  EXPECT_EQ(rig.executor.state(), ExecutorState::kDisarmed);
  EXPECT_EQ(procedure.runs(), 0);
  EXPECT_FALSE(procedure.done());
}

TEST_F(AttendedRun, RunsOnceForEachStartAndEndsWhenItMayQuit) {
  for (int run = 1; run <= 3; ++run) {
    Tick(20);
    ASSERT_EQ(Start(), Refusal::kNone);
    ASSERT_TRUE(TickUntil(ExecutorState::kRunning));
    EXPECT_EQ(Start(), Refusal::kWrongState);
    ASSERT_TRUE(TickUntil(ExecutorState::kDisarmed));
    EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
    EXPECT_EQ(procedure.runs(), run);
  }
  Tick(200);
  EXPECT_FALSE(procedure.done());
  procedure.RequestQuit();
  Tick(20);
  EXPECT_TRUE(procedure.done());
  EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted) << "of the last run";
}

TEST_F(AttendedRun, AStopEndsThisRunAndNotTheNext) {
  ASSERT_EQ(Start(), Refusal::kNone);
  ASSERT_TRUE(TickUntil(ExecutorState::kRunning));
  procedure.RequestStop();
  ASSERT_TRUE(TickUntil(ExecutorState::kDisarmed));
  EXPECT_EQ(procedure.outcome(), RunOutcome::kStopped);
  Tick(20);
  procedure.RequestStop();  // Nothing runs, so the request is not kept for later.
  Tick(20);
  ASSERT_EQ(Start(), Refusal::kNone);
  ASSERT_TRUE(TickUntil(ExecutorState::kSettling));
}

TEST_F(AttendedRun, WhoeverAsksForRestInTheTickOfAStartGetsIt) {
  Tick(20);
  for (const auto rest :
       {&RunProcedure::RequestDisarm, &RunProcedure::RequestStop, &RunProcedure::RequestFinish}) {
    ASSERT_EQ(Start(), Refusal::kNone);
    (procedure.*rest)();
    Tick(200);
    EXPECT_EQ(rig.executor.state(), ExecutorState::kDisarmed);
    EXPECT_EQ(procedure.runs(), 0);
  }
  ASSERT_EQ(Start(), Refusal::kNone);
  EXPECT_TRUE(TickUntil(ExecutorState::kRunning)) << "it does not count for a later start";
}

TEST_F(AttendedRun, AfterAFaultItStartsOnlyOnceThatIsCleared) {
  ASSERT_EQ(Start(), Refusal::kNone);
  ASSERT_TRUE(TickUntil(ExecutorState::kRunning));
  rig.drives[0]->reply.error = 3;
  ASSERT_TRUE(TickUntil(ExecutorState::kDisarmed));
  EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
  rig.drives[0]->reply.error = 0;
  Tick(20);
  EXPECT_EQ(Start(), Refusal::kFaultLatched);
  Tick(2000);
  EXPECT_EQ(rig.executor.state(), ExecutorState::kDisarmed);
  EXPECT_EQ(procedure.Next(rig.output.record), OperatorCommand::kNone);
  rig.Tick(OperatorCommand::kClearFaults);
  EXPECT_EQ(Start(), Refusal::kNone);
  EXPECT_TRUE(TickUntil(ExecutorState::kRunning));
}

TEST_F(AttendedRun, WhatWasRefusedBeforeTheStartIsNotHeldAgainstIt) {
  Tick(20);
  rig.Tick(OperatorCommand::kBranch);
  ASSERT_EQ(rig.output.record.refusal.refusal, Refusal::kWrongState);
  ASSERT_EQ(Start(), Refusal::kNone);
  EXPECT_TRUE(TickUntil(ExecutorState::kRunning));
}

TEST_F(AttendedRun, QuittingWithoutARunSaysTorqueOffAndIsAStop) {
  Tick(20);
  procedure.RequestQuit();
  Tick(20);
  EXPECT_TRUE(procedure.done());
  EXPECT_EQ(procedure.outcome(), RunOutcome::kStopped);
}

}  // namespace
}  // namespace tumbler
