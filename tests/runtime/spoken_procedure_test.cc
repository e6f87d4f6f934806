// What RunProcedure asks of an executor whose words the test chooses.

#include "runtime/executor/run_procedure.h"

#include <gtest/gtest.h>

#include "tests/support/short_run.h"

namespace tumbler {
namespace {

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
    SpokenTo run(testing::ShortRun());
    run.ArmAndMove();
    int asked = 0;
    while (run.Say(ExecutorState::kHolding, refusal) == OperatorCommand::kRun) ++asked;
    EXPECT_EQ(asked, passes ? 31 : 1) << ToString(refusal);
    EXPECT_EQ(run.procedure.outcome(), RunOutcome::kRefused);
    EXPECT_EQ(run.procedure.refusal().refusal, refusal);
  }
}

TEST(RunProcedure, WhatSomebodyElseIsRefusedDoesNotEndTheRun) {
  SpokenTo run(testing::ShortRun());
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
    SpokenTo run(testing::ShortRun());
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
    SpokenTo run(testing::ShortRun());
    run.record.joints[0].reply_age_ticks = -1;
    run.record.joints[0].drive_state = state;
    EXPECT_EQ(run.Say(ExecutorState::kDisarmed),
              state == DriveState::kFault ? OperatorCommand::kArm : OperatorCommand::kNone);
  }
}

RunProcedureConfig GoingHome() {
  RunProcedureConfig config = testing::ShortRun();
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
      RunProcedureConfig config = testing::ShortRun();
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
    RunProcedureConfig config = testing::ShortRun();
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
  RunProcedureConfig config = testing::ShortRun();
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
  SpokenTo run(testing::ShortRun());
  run.Begin();
  run.Fail(Fault::kOperatorStop, Reaction::kDamp);
  EXPECT_EQ(run.UntilAsked(), OperatorCommand::kDisarm);
  EXPECT_EQ(run.procedure.outcome(), RunOutcome::kFault);
}

TEST(RunProcedure, TorqueOffIsSaidUntilTheExecutorObeys) {
  SpokenTo run(testing::ShortRun());
  run.Begin();
  run.procedure.RequestDisarm();
  for (int i = 0; i < 5; ++i) EXPECT_EQ(run.Say(ExecutorState::kRunning), OperatorCommand::kDisarm);
  EXPECT_EQ(run.Say(ExecutorState::kDisarmed), OperatorCommand::kDisarm);
  EXPECT_EQ(run.Say(ExecutorState::kDisarmed), OperatorCommand::kNone);
}

TEST(RunProcedure, AFaultInTheTickAfterARefusalOrAfterQuittingIsNoFaultOfARun) {
  SpokenTo refused(testing::ShortRun());
  EXPECT_EQ(refused.Say(ExecutorState::kDisarmed, Refusal::kDriveError), OperatorCommand::kArm);
  EXPECT_EQ(refused.Say(ExecutorState::kDisarmed), OperatorCommand::kDisarm);
  refused.Fail(Fault::kDriveError, Reaction::kDisable);
  refused.Say(ExecutorState::kDisarmed);
  EXPECT_EQ(refused.procedure.outcome(), RunOutcome::kRefused);

  RunProcedureConfig config = testing::ShortRun();
  config.attended = true;
  SpokenTo quit(config);
  quit.Say(ExecutorState::kDisarmed);
  quit.procedure.RequestQuit();
  EXPECT_EQ(quit.Say(ExecutorState::kDisarmed), OperatorCommand::kDisarm);
  quit.Fail(Fault::kLateTick, Reaction::kHold);
  quit.Say(ExecutorState::kDisarmed);
  EXPECT_EQ(quit.procedure.outcome(), RunOutcome::kStopped);
}

}  // namespace
}  // namespace tumbler
