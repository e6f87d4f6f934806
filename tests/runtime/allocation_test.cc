#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "runtime/executor/run_procedure.h"
#include "tests/support/allocation_guard.h"
#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

using testing::AllocationGuard;

/// Keeps a pointer, and so the allocation behind it, from being optimised away.
void Keep(void* pointer) { asm volatile("" : : "g"(pointer) : "memory"); }

TEST(AllocationGuardDeathTest, CatchesEachWayToAllocateAndToLock) {
  if (!AllocationGuard::kActive) GTEST_SKIP() << "the sanitizer owns malloc";
  const auto guarded = [](auto allocate) {
    AllocationGuard guard;
    allocate();
  };
  EXPECT_DEATH(guarded([] { Keep(std::malloc(8)); }), "malloc: called");
  EXPECT_DEATH(guarded([] { Keep(std::calloc(1, 8)); }), "calloc: called");
  EXPECT_DEATH(guarded([] { Keep(std::aligned_alloc(64, 64)); }), "aligned_alloc: called");
  EXPECT_DEATH(guarded([] { Keep(new int); }), "malloc: called");
  struct alignas(64) Wide {
    char bytes[64];
  };
  EXPECT_DEATH(guarded([] { Keep(new Wide); }), "alloc: called|memalign: called");
  std::vector<int> vector;
  EXPECT_DEATH(guarded([&vector] { vector.push_back(1); }), "malloc: called");
  void* block = std::malloc(8);
  Keep(block);
  EXPECT_DEATH(guarded([block] { Keep(std::realloc(block, 1000)); }), "realloc: called");
  EXPECT_DEATH(guarded([block] { std::free(block); }), "free: called");
  std::free(block);
  std::mutex mutex;
  EXPECT_DEATH(guarded([&mutex] { const std::lock_guard<std::mutex> lock(mutex); }),
               "pthread_mutex_lock: called");
}

TEST(AllocationGuard, LeavesOtherCodeAlone) {
  { AllocationGuard guard; }
  const auto text = std::make_unique<std::string>(1000, 'x');
  EXPECT_EQ(text->size(), 1000U);
}

TEST(ExecutorAllocation, NoTickOfARunStopFaultAndRearmAllocates) {
  std::mt19937 random(40);
  const Primitive<float> primitive = testing::RandomPrimitive<float>({}, random);
  std::vector<std::unique_ptr<testing::ScriptedDrive>> drives;
  std::vector<Drive*> pointers;
  std::vector<ReceivedFrame> replies;
  for (std::uint32_t i = 0; i < 2; ++i) {
    drives.push_back(std::make_unique<testing::ScriptedDrive>(i));
    drives[i]->reply.position_rad = primitive.joints[i].position.control_points()[0];
    pointers.push_back(drives[i].get());
    replies.push_back({drives[i]->Answer(), 0});
  }
  Executor executor;
  ASSERT_EQ(executor.Configure({}, primitive, pointers), Status::kOk);
  RunProcedure procedure{RunProcedureConfig{}};
  TickOutput output;
  std::int64_t tick = 0;
  bool faulted = false;
  {
    AllocationGuard guard;
    for (; tick < 20000 && !procedure.done(); ++tick) {
      if (tick > 500 && output.record.state == ExecutorState::kHolding && tick == 2500)
        drives[0]->reply.error = 4;
      executor.Tick({tick, 0, replies, Status::kOk, Status::kOk, procedure.Next(output.record)},
                    output);
      faulted = faulted || output.record.state == ExecutorState::kFault;
      for (auto& drive : drives) {
        if (drive->setpoint.kp_nm_per_rad > 0)
          drive->reply.position_rad = drive->setpoint.position_rad;
      }
    }
  }
  EXPECT_TRUE(procedure.done());
  EXPECT_TRUE(faulted);
  EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
}

}  // namespace
}  // namespace tumbler
