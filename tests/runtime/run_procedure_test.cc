#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "runtime/executor/run_procedure.h"
#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"
#include "tests/support/short_run.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;

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
  RunProcedure procedure{testing::ShortRun()};
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

TEST_F(RunSequenceTest, RestsAtTheStartWhereTheMoveThereHasRockedTheRobotAndOnlyThere) {
  RunProcedureConfig config = testing::ShortRun();
  config.rest_ticks = 70;
  std::vector<float> start_rad;
  for (const auto& drive : rig.drives) start_rad.push_back(drive->reply.position_rad);
  for (const float off_rad : {0.0F, 0.0015F, 0.0025F, 0.03F, -0.0025F}) {
    SetUpAnew(config);
    for (std::size_t j = 0; j < start_rad.size(); ++j)
      rig.drives[j]->reply.position_rad = start_rad[j];
    rig.drives[1]->reply.position_rad += off_rad;
    int rested = 0;
    bool moved = false;
    Play([&] {
      const ExecutorState state = rig.output.record.state;
      moved = moved || state == ExecutorState::kMovingToStart;
      if (state == ExecutorState::kHolding && Ticks(ExecutorState::kRunning) == 0 && moved)
        ++rested;
    });
    EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
    EXPECT_NEAR(rested, std::abs(off_rad) > RunProcedure::kRocks_rad ? 71 : 1, 1) << off_rad;
  }
}

TEST_F(RunSequenceTest, AStopWhileItRestsAtTheStartIsAStop) {
  RunProcedureConfig config = testing::ShortRun();
  config.rest_ticks = 70;
  SetUpAnew(config);
  rig.drives[1]->reply.position_rad += 0.03F;
  bool moved = false;
  Play([&] {
    const ExecutorState state = rig.output.record.state;
    moved = moved || state == ExecutorState::kMovingToStart;
    if (moved && state == ExecutorState::kHolding) procedure.RequestStop();
  });
  EXPECT_EQ(procedure.outcome(), RunOutcome::kStopped);
  EXPECT_EQ(Ticks(ExecutorState::kRunning), 0);
}

TEST_F(RunSequenceTest, LowersTheRobotBeforeTorqueOffWhenItIsTo) {
  RunProcedureConfig config = testing::ShortRun();
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
  RunProcedureConfig config = testing::ShortRun();
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
  RunProcedureConfig config = testing::ShortRun();
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
  RunProcedureConfig config = testing::ShortRun();
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
  RunProcedureConfig config = testing::ShortRun();
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
  RunProcedureConfig config = testing::ShortRun();
  config.end_hold_ticks = 700;
  SetUpAnew(config);
  Play([] {});
  EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
  EXPECT_GE(Ticks(ExecutorState::kHolding), 750);
  EXPECT_LE(Ticks(ExecutorState::kHolding), 900);
}

TEST_F(RunSequenceTest, DoesNotHoldWithADriveThatIsSilentOrHasFailed) {
  RunProcedureConfig config = testing::ShortRun();
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
  RunProcedureConfig config = testing::ShortRun();
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
    SetUpAnew(testing::ShortRun());
    Play([&] {
      if (Ticks(ExecutorState::kRunning) == 200) procedure.RequestStop();
      rig.silent[1] = silent && Ticks(ExecutorState::kFault) >= 5;
    });
    EXPECT_EQ(procedure.outcome(), silent ? RunOutcome::kFault : RunOutcome::kStopped);
  }
}

TEST_F(RunSequenceTest, TakesTheTorqueOffAtOnceWhereTheRobotStandsWithoutIt) {
  RunProcedureConfig config = testing::ShortRun();
  config.end_hold_ticks = -1;
  config.safe_nodes = 1;
  SetUpAnew(config);
  Play([] {});
  EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
  EXPECT_LE(Ticks(ExecutorState::kHolding), 120);
}

TEST_F(RunSequenceTest, DrivesThatHaveLatchedAnErrorAreClearedOnRequest) {
  for (const bool clear : {false, true}) {
    RunProcedureConfig config = testing::ShortRun();
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

TEST_F(RunSequenceTest, ErrorsAreClearedOnceEveryDriveWasHeardAndNotWaitedForForEver) {
  RunProcedureConfig config = testing::ShortRun();
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

/// The end that a procedure under test has.
enum class End { kSafe, kHold, kLower, kTorqueOff };

RunProcedureConfig WithEnd(End end, std::int64_t hold_ticks) {
  RunProcedureConfig config = testing::ShortRun();
  if (end == End::kSafe || end == End::kHold) config.end_hold_ticks = hold_ticks;
  if (end == End::kLower) config.lower_ticks = 2000;
  config.go_home = end == End::kSafe;
  return config;
}

TEST_F(RunSequenceTest, AFaultInTheHoldAtTheEndNeitherEndsItNorMakesItLonger) {
  RunProcedureConfig config = testing::ShortRun();
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
  RunProcedureConfig config = testing::ShortRun();
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
  RunProcedureConfig config = testing::ShortRun();
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
    RunProcedureConfig config = testing::ShortRun();
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
