// The shipped cartwheel in virtual time with each protocol, for very many ticks in which everything
// goes wrong at random. No frame breaks a rule, no tick leaves a drive out, nothing allocates, and
// the same run made twice sends the same bytes. TUMBLER_SOAK_TICKS sets the number of ticks, which
// is 100 000 by default, and 1 000 000 for the full test.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <random>
#include <string>

#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/record/sentences.h"
#include "tests/support/allocation_guard.h"
#include "tests/support/fault_bench.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using testing::AllocationGuard;
using testing::FaultBench;
using ::testing::IsEmpty;

std::optional<AllocationGuard>& Guard() {
  static std::optional<AllocationGuard> guard;
  return guard;
}

/// The shipped cartwheel on these drives.
FaultBench::Config GaitConfig(const std::string& drives_file) {
  const SequenceFile file = LoadMotion(testing::SourcePath("primitives/cartwheel.toml"));
  const Sequence<float> sequence = ToRuntime(file);
  FaultBench::Config config;
  config.drives = LoadDrives(drives_file);
  config.graph = sequence.graph;
  config.primitives.assign(sequence.primitives.begin(),
                           sequence.primitives.begin() + sequence.primitive_count);
  config.plant_step_ns = 200'000;
  return config;
}

struct Outcome {
  std::uint64_t hash = 14695981039346656037ULL;  // FNV-1a
  std::int64_t frames = 0;
  std::int64_t ticks = 0;
  std::int64_t running = 0;
  std::int64_t runs = 0;
  std::int64_t disturbances = 0;
  std::array<std::int64_t, kFaultCount> first_faults{};
  std::array<std::int64_t, kReactionCount> aborts{};  ///< First reactions to faults in a motion.
  std::vector<std::string> violations;
  std::int64_t missing_writes = 0;
  std::int64_t starts = 0;
};

class Soak {
 public:
  Soak(const std::string& drives_file, std::uint64_t seed, bool collapse)
      : random_(seed), bench_(ConfigOf(drives_file, collapse)) {
    bench_.on_sent = [this](const CanFrame& frame) {
      Mix(frame.id);
      Mix(frame.size);
      for (std::size_t i = 0; i < frame.size; ++i) Mix(frame.data[i]);
      ++outcome_.frames;
    };
    bench_.enter_loop = [] { Guard().emplace(); };
    bench_.leave_loop = [] { Guard().reset(); };
    for (const RotorPlant::Rotor& rotor : bench_.plant->rotors()) {
      home_rad_.push_back(rotor.position_rad);
    }
  }

  Outcome Run(std::int64_t ticks) {
    EXPECT_EQ(bench_.configured, Status::kOk);
    ExecutorState last = ExecutorState::kDisarmed;
    Fault last_fault = Fault::kNone;
    while (outcome_.ticks < ticks) {
      if (Draw(600) == 0) GoWrong();
      if (displaced_ticks_ > 0 && --displaced_ticks_ >= 0) Displace();
      if (silent_ticks_ > 0 && --silent_ticks_ == 0) {
        for (const auto& drive : bench_.drives) drive->set_silent(false);
      }
      const TickRecord& record = bench_.Tick(Operator(), branch_);
      ++outcome_.ticks;
      outcome_.running += record.state == ExecutorState::kRunning ? 1 : 0;
      if (record.state == ExecutorState::kRunning && last != ExecutorState::kRunning) {
        ++outcome_.runs;
      }
      last = record.state;
      const Fault fault = record.first_fault.fault;
      if (fault != last_fault) {
        ++outcome_.first_faults[static_cast<std::size_t>(fault)];
        if (record.first_fault.state == ExecutorState::kRunning)
          ++outcome_.aborts[static_cast<std::size_t>(record.first_fault.reaction)];
      }
      last_fault = fault;
    }
    outcome_.violations = bench_.judge.report().violations;
    outcome_.missing_writes = bench_.missing_writes;
    for (const auto& joint : bench_.judge.report().joints) outcome_.starts += joint.starts;
    return outcome_;
  }

 private:
  static FaultBench::Config ConfigOf(const std::string& drives_file, bool collapse) {
    FaultBench::Config config = GaitConfig(drives_file);
    config.spoilt_replies = true;
    if (collapse) {
      config.executor.collapse.configured = true;
      config.executor.collapse.position_rad = {-1.5707964F, 1.5707964F};
      for (const FaultInfo& fault : kFaultTable) {
        for (const StateInfo& state : kStateTable) {
          if (FaultTable()(fault.fault, state.state) == Reaction::kDamp) {
            static_cast<void>(
                config.executor.reactions.Set(fault.fault, state.state, Reaction::kCollapse));
          }
        }
      }
    }
    return config;
  }

  // This is no distribution of the standard library, as they differ between libraries.
  std::uint64_t Draw(std::uint64_t below) { return random_() % below; }
  void Mix(std::uint64_t byte) { outcome_.hash = (outcome_.hash ^ byte) * 1099511628211ULL; }

  [[nodiscard]] std::uint32_t HeartbeatId(std::size_t joint) const {
    return bench_.SideOfDrive(joint).HeartbeatId(bench_.DriveOf(joint));
  }
  [[nodiscard]] std::uint32_t PositionId(std::size_t joint) const {
    return bench_.SideOfDrive(joint).PositionId(bench_.DriveOf(joint));
  }
  bool WithHeartbeat(std::size_t joint) { return Draw(2) == 0 && HeartbeatId(joint) != 0; }

  void Displace() {
    RotorPlant::Rotor& rotor = bench_.plant->rotors()[displaced_];
    rotor.position_rad += 0.01;
    rotor.velocity_rad_s = 0;
  }

  void GoWrong() {
    ++outcome_.disturbances;
    const std::int64_t ms = 1'000'000;
    const bool running = bench_.executor.state() == ExecutorState::kRunning;
    const auto joint = static_cast<std::size_t>(Draw(bench_.drives.size()));
    BusFault fault;
    fault.node = static_cast<int>(Draw(4)) - 1;
    if (fault.node == 3) fault.node = 0;
    fault.probability = static_cast<double>(1 + Draw(100)) / 100;
    fault.delay_ns = static_cast<std::int64_t>(1 + Draw(5000)) * 1000;
    std::int64_t duration_ns = static_cast<std::int64_t>(1 + Draw(30)) * ms;
    switch (Draw(18)) {
      case 0:
        fault.kind = BusFaultKind::kLoss;
        break;
      case 1:
        fault.kind = BusFaultKind::kDuplicate;
        break;
      case 2:
        fault.kind = BusFaultKind::kDelay;
        break;
      case 3:
        fault.kind = BusFaultKind::kReorder;
        break;
      case 4:  // Bits flipped while a drive is set up are not the subject here.
        if (!running) return;
        fault.kind = BusFaultKind::kFlip;
        fault.probability *= 0.2;
        duration_ns = 5 * ms;
        break;
      case 5:
        fault.kind = BusFaultKind::kBitErrors;
        fault.probability *= 0.01;
        break;
      case 6:
        fault.kind = BusFaultKind::kBitErrors;
        fault.probability = 1;
        duration_ns = 300'000 + static_cast<std::int64_t>(Draw(300'000));
        break;
      case 7:
        fault.kind = BusFaultKind::kShort;
        break;
      case 8:
        fault.kind = BusFaultKind::kDisconnect;
        break;
      case 9:
        fault.kind = BusFaultKind::kStall;
        break;
      case 10:
        fault.kind = BusFaultKind::kLinkDown;
        fault.node = 0;
        break;
      case 11:
        bench_.drives[joint]->set_silent(true);
        silent_ticks_ = 1 + static_cast<int>(Draw(20));
        return;
      case 12:
        bench_.drives[joint]->RaiseError(1 + static_cast<std::uint32_t>(Draw(6)));
        return;
      case 13:
        bench_.drives[joint]->set_temperature(70 + static_cast<double>(Draw(30)));
        return;
      case 14:
      case 15:
        bench_.Miss(1 + static_cast<int>(Draw(5)));
        return;
      case 16:
        displaced_ = joint;
        displaced_ticks_ = 1 + static_cast<int>(Draw(60));
        return;
      default:
        fault.kind = BusFaultKind::kLoss;
        fault.probability = 1;
        fault.ids = {WithHeartbeat(joint) ? HeartbeatId(joint) : PositionId(joint)};
        fault.node = 0;
        duration_ns *= 15;
        break;
    }
    bench_.Disturb(fault, duration_ns);
  }

  // An operator who wants the gait to go on: repairs, clears, arms, moves to the start and runs,
  // and sometimes stops or branches.
  OperatorCommand Operator() {
    const TickRecord& last = bench_.output.record;
    ++ticks_in_state_;
    if (bench_.executor.state() != state_) {
      state_ = bench_.executor.state();
      ticks_in_state_ = 0;
      patience_ = 20 + static_cast<int>(Draw(80));
    }
    if (Draw(20'000) == 0) return OperatorCommand::kDisarm;
    if (Draw(10'000) == 0) return OperatorCommand::kStop;
    switch (state_) {
      case ExecutorState::kDisarmed:
        if (ticks_in_state_ % patience_ != patience_ - 1) break;
        if (last.faults != 0 || ticks_in_state_ > 500) {
          if (ticks_in_state_ > 500) ticks_in_state_ = 0;
          Repair();
          return OperatorCommand::kClearFaults;
        }
        moved_ = false;
        return OperatorCommand::kArm;
      case ExecutorState::kHolding:
        if (ticks_in_state_ % patience_ != patience_ - 1) break;
        moved_ = !moved_;
        return moved_ ? OperatorCommand::kMoveToStart : OperatorCommand::kRun;
      case ExecutorState::kRunning:
      case ExecutorState::kSettling:
        if (Draw(8000) == 0) return OperatorCommand::kFinish;
        branch_ = static_cast<std::int8_t>(bench_.executor.graph().FindBranch("roll"));
        if (Draw(8000) == 0) return OperatorCommand::kBranch;
        break;
      case ExecutorState::kFault:
        if (ticks_in_state_ == patience_) return OperatorCommand::kDisarm;
        break;
      case ExecutorState::kArming:
      case ExecutorState::kMovingToStart:
      case ExecutorState::kStopping:
        break;
    }
    return OperatorCommand::kNone;
  }

  void Repair() {
    bench_.host.Restart();
    for (std::size_t i = 0; i < bench_.drives.size(); ++i) {
      SimulatedDrive& drive = *bench_.drives[i];
      drive.set_temperature(30);
      if (!bench_.SideOfDrive(i).nature().clears_errors) {
        drive.RaiseError(0);  // It is switched off and on, as the protocol has no order for that.
      }
      bench_.plant->rotors()[i].position_rad = home_rad_[i];
      bench_.plant->rotors()[i].velocity_rad_s = 0;
    }
  }

  std::mt19937_64 random_;
  FaultBench bench_;
  Outcome outcome_;
  std::vector<double> home_rad_;
  ExecutorState state_ = ExecutorState::kDisarmed;
  std::int64_t ticks_in_state_ = 0;
  int patience_ = 50;
  bool moved_ = false;
  std::int8_t branch_ = -1;
  int silent_ticks_ = 0;
  int displaced_ticks_ = 0;
  std::size_t displaced_ = 0;
};

std::int64_t Ticks() {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): no other thread changes the environment.
  const char* given = std::getenv("TUMBLER_SOAK_TICKS");
  return given == nullptr ? 100'000 : std::atoll(given);
}

class GaitSoak : public ::testing::TestWithParam<testing::TestedProtocol> {};

TEST_P(GaitSoak, BreaksNoRuleAllocatesNothingAndIsTheSameEachTime) {
  const std::string file = testing::SourcePath(GetParam().drives);
  const std::int64_t ticks = Ticks();
  for (const bool collapse : {false, true}) {
    const Outcome once = Soak(file, 2004, collapse).Run(ticks);
    const Outcome again = Soak(file, 2004, collapse).Run(ticks);
    EXPECT_THAT(once.violations, IsEmpty());
    EXPECT_EQ(once.missing_writes, 0);
    EXPECT_EQ(once.frames, again.frames);
    EXPECT_EQ(once.hash, again.hash);
    EXPECT_NE(once.hash, Soak(file, 2005, collapse).Run(ticks / 20).hash);
    // The gait must have run at all.
    EXPECT_GT(once.running, ticks / 50);
    EXPECT_GT(once.disturbances, ticks / 2000);
    std::int64_t kinds = 0, all = 0;
    std::string seen;
    for (std::size_t i = 1; i < kFaultCount; ++i) {
      kinds += once.first_faults[i] > 0 ? 1 : 0;
      all += once.first_faults[i];
      seen += std::string(i > 1 ? ", " : "") + ToString(static_cast<Fault>(i)) + " " +
              std::to_string(once.first_faults[i]);
    }
    EXPECT_GE(kinds, ticks < 100'000 ? 6 : 8) << seen;
    const auto aborts = [&once](Reaction reaction) {
      return once.aborts[static_cast<std::size_t>(reaction)];
    };
    const std::int64_t early = aborts(Reaction::kHold) + aborts(Reaction::kFold);
    EXPECT_GT(early + aborts(Reaction::kRollOut), 0);
    if (ticks >= 100'000) {
      EXPECT_GT(early, 0);
      EXPECT_GT(aborts(Reaction::kRollOut), 0);
    }
    std::printf("aborted: %lld caught, %lld folded, %lld rolled out\n",
                static_cast<long long>(aborts(Reaction::kHold)),
                static_cast<long long>(aborts(Reaction::kFold)),
                static_cast<long long>(aborts(Reaction::kRollOut)));
    std::printf(
        "%s%s: %lld ticks, %lld frames, hash %016llx; running %lld ticks of %lld passages, drives "
        "started %lld times; %lld disturbances, %lld first faults: %s\n",
        GetParam().name.c_str(), collapse ? ", collapse" : "", static_cast<long long>(once.ticks),
        static_cast<long long>(once.frames), static_cast<unsigned long long>(once.hash),
        static_cast<long long>(once.running), static_cast<long long>(once.runs),
        static_cast<long long>(once.starts), static_cast<long long>(once.disturbances),
        static_cast<long long>(all), seen.c_str());
  }
}

TEST_P(GaitSoak, BearsRepliesThatAnAdapterBringsLateOrInBunchesOrNotAtAll) {
  FaultBench::Config config = GaitConfig(testing::SourcePath(GetParam().drives));
  config.executor.cycles = 10;
  // A gap may meet with a reply that is lost. The default of programs bears that.
  config.executor.stale_ticks_max =
      ExecutorConfigOf({}, LoadDrives(testing::SourcePath(GetParam().drives))).stale_ticks_max;
  FaultBench bench(std::move(config));
  ASSERT_EQ(bench.configured, Status::kOk);
  BusFault late;
  late.kind = BusFaultKind::kDelay;
  late.node = 0;
  late.probability = 0.2;
  late.delay_ns = 1'000'000;
  BusFault lost = late;
  lost.kind = BusFaultKind::kLoss;
  lost.probability = 0.01;
  BusFault gap = late;
  gap.probability = 1;
  gap.delay_ns = 5'000'000;
  bench.Disturb(late);
  bench.Disturb(lost);
  ASSERT_TRUE(bench.Reach(ExecutorState::kHolding));
  bench.Tick(OperatorCommand::kMoveToStart);
  ASSERT_TRUE(bench.TickUntil(ExecutorState::kHolding, 5000));
  bench.Tick(OperatorCommand::kRun);
  std::int64_t together = 0, ticks = 0;
  while (bench.executor.state() == ExecutorState::kRunning ||
         bench.executor.state() == ExecutorState::kSettling) {
    if (++ticks % 1000 == 0) bench.Disturb(gap, 1'000'000);
    const TickRecord& record = bench.Tick();
    together += record.joints[0].reply_status == ReplyStatus::kOkSomeLate ? 1 : 0;
  }
  EXPECT_EQ(bench.executor.state(), ExecutorState::kHolding)
      << Describe(bench.output.record.first_fault, {"leg1", "leg2"});
  EXPECT_EQ(bench.output.record.cycles, 10);
  EXPECT_GT(ticks, 50'000);
  if (GetParam().name == "mit") {
    EXPECT_GT(together, ticks / 10);
  }
  EXPECT_THAT(bench.judge.report().violations, IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Protocols, GaitSoak, ::testing::ValuesIn(testing::EveryProtocol()),
                         [](const auto& given) { return given.param.name; });

}  // namespace
}  // namespace tumbler
