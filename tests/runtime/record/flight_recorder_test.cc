#include "runtime/record/flight_recorder.h"

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "runtime/record/replay.h"
#include "tests/support/allocation_guard.h"
#include "tests/support/program.h"
#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

using testing::AsBytes;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::ReadFile;

class FlightRecorderTest : public ::testing::Test {
 protected:
  FlightRecorderTest() {
    config_.file = folder_ / "run.rec";
    config_.configuration = EncodeConfiguration(configuration_);
    config_.say = [this](const std::string& text) { said_.push_back(text); };
  }
  testing::TemporaryFolder folder_;
  RecordConfiguration configuration_ = testing::SmallConfiguration();
  FlightRecorderConfig config_;
  std::vector<std::string> said_;
};

TEST_F(FlightRecorderTest, RecordsARunThatReplaysIdentically) {
  FlightRecorder recorder(config_);
  TickFeed feed({&recorder});
  testing::RecordRun(configuration_, feed, [&](std::int64_t) { recorder.Drain(); });
  recorder.Stop("completed");
  EXPECT_THAT(said_, IsEmpty());
  EXPECT_EQ(recorder.lost(), 0);
  EXPECT_EQ(recorder.recorded(), recorder.pushed());
  EXPECT_GT(recorder.recorded(), 80);
  const std::string bytes = ReadFile(config_.file);
  FlightRecord record(AsBytes(bytes), "run.rec");
  const ReplayResult report = Replay(record);
  EXPECT_TRUE(report.identical()) << report.difference->field << report.gap;
  EXPECT_EQ(report.ticks, recorder.pushed());
  ASSERT_TRUE(record.end());
  EXPECT_EQ(record.end()->ticks, report.ticks);
  EXPECT_EQ(record.end()->lost, 0);
  EXPECT_EQ(record.end()->outcome, "completed");
}

TEST_F(FlightRecorderTest, WritesTheSameBytesWithAThreadOfItsOwn) {
  FlightRecorder recorder(config_);
  TickFeed feed({&recorder});
  recorder.Start();
  testing::RecordRun(configuration_, feed);
  recorder.Stop("completed");
  EXPECT_EQ(ReadFile(config_.file), testing::RecordedBytes(configuration_));
}

TEST_F(FlightRecorderTest, DoesNotAllocateInTheLoop) {
  if (!testing::AllocationGuard::kActive) GTEST_SKIP() << "the sanitizer owns malloc";
  config_.ring_bytes = 4096;  // A full ring, after a few ticks, must not allocate either.
  FlightRecorder recorder(config_);
  TickFeed feed({&recorder});
  std::vector<ReceivedFrame> received(TickEntry::kReceivedMax / 8);
  TickInput input;
  input.received = received;
  TickOutput output;
  output.record.joint_count = 2;
  {
    testing::AllocationGuard guard;
    const std::array<std::uint8_t, 300> truth{};
    for (int i = 0; i < 20; ++i) {
      feed.Push({}, input, output);
      feed.PushTruth(truth);
    }
  }
  EXPECT_GT(recorder.lost(), 5);
}

TEST_F(FlightRecorderTest, CountsSaysAndMarksTicksThatTheRingHasNoRoomFor) {
  config_.ring_bytes = 4096;
  FlightRecorder recorder(config_);
  TickFeed feed({&recorder});
  // The recorder is drained only at tick 50 and at the end.
  testing::RecordRun(configuration_, feed, [&](std::int64_t tick) {
    if (tick == 50) recorder.Drain();
  });
  recorder.Stop("completed");
  EXPECT_GT(recorder.lost(), 20);
  EXPECT_EQ(recorder.recorded() + recorder.lost(), recorder.pushed());
  ASSERT_EQ(said_.size(), 2U);
  EXPECT_THAT(said_[0], HasSubstr("ticks could not be recorded"));

  const std::string bytes = ReadFile(config_.file);
  FlightRecord record(AsBytes(bytes), "run.rec");
  const auto entry = std::make_unique<TickEntry>();
  std::int64_t ticks = 0, last = -1, missing = 0;
  while (record.Next(*entry)) {
    missing += entry->index - last - 1;
    last = entry->index;
    ++ticks;
  }
  EXPECT_EQ(ticks, recorder.recorded());
  ASSERT_EQ(record.lost().size(), 2U);
  EXPECT_EQ(record.lost()[0].count, missing);
  EXPECT_EQ(record.lost()[0].count + record.lost()[1].count, recorder.lost());
  EXPECT_EQ(record.lost()[1].first_index, last + 1);
  EXPECT_THAT(record.damages(), IsEmpty());
  EXPECT_EQ(record.end()->lost, recorder.lost());

  // A record that cannot be replayed is not called identical.
  const ReplayResult report = Replay(record);
  EXPECT_FALSE(report.identical());
  EXPECT_THAT(report.gap, HasSubstr("ticks were not recorded"));
  EXPECT_EQ(report.ticks, record.lost()[0].first_index);
}

/// Until the end of the scope, no file of this process can become longer than this.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(std::size_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    EXPECT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  }
  ~FileSizeLimit() { setrlimit(RLIMIT_FSIZE, &before_); }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
};

TEST_F(FlightRecorderTest, StopsAndSaysSoWhenTheDiskIsFullAndKeepsWhatIsWhole) {
  const std::string whole = testing::RecordedBytes(configuration_);
  // The disk is full at several places, within a block and between blocks.
  for (const std::size_t room :
       {whole.size() - 1, whole.size() - 3000, whole.size() / 2 + 1111, whole.size() / 2 + 1300}) {
    said_.clear();
    config_.file = folder_ / ("run" + std::to_string(room));
    FlightRecorder recorder(config_);
    TickFeed feed({&recorder});
    std::int64_t ticks_after = 0;
    {
      const FileSizeLimit limit(room);
      testing::RecordRun(configuration_, feed, [&](std::int64_t) {
        recorder.Drain();
        ticks_after += recorder.problem().empty() ? 0 : 1;
      });
      recorder.Stop("completed");
    }
    const bool in_the_end_block = room == whole.size() - 1;
    EXPECT_EQ(ticks_after > 0, !in_the_end_block) << "the loop goes on";
    ASSERT_EQ(said_.size(), 1U);
    EXPECT_EQ(said_[0], recorder.problem());
    EXPECT_THAT(said_[0], HasSubstr("File too large"));
    EXPECT_THAT(said_[0], HasSubstr("recording stopped after " +
                                    std::to_string(recorder.recorded()) + " ticks"));
    const std::string bytes = ReadFile(config_.file);
    EXPECT_LE(bytes.size(), room);
    EXPECT_EQ(bytes, whole.substr(0, bytes.size()));
    FlightRecord record(AsBytes(bytes), "run.rec");
    const ReplayResult report = Replay(record);
    EXPECT_TRUE(report.identical());
    EXPECT_EQ(report.ticks, recorder.recorded());
    EXPECT_FALSE(record.cut_off()) << "cut back to whole blocks";
    EXPECT_THAT(record.Remarks(), ElementsAre(HasSubstr("interrupted")));
  }
}

TEST_F(FlightRecorderTest, LeavesNoFileWhenThereIsNoRoomForTheConfiguration) {
  const FileSizeLimit limit(100);
  try {
    const FlightRecorder recorder(config_);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("run.rec: cannot be written: File too large"));
  }
  EXPECT_FALSE(std::filesystem::exists(config_.file));
}

TEST_F(FlightRecorderTest, HasRoomForEightSecondsInWhichTheDiskTakesNothing) {
  config_.ring_bytes = RingBytes(2, 1000);
  configuration_.procedure.hold_ticks = 10'000;
  FlightRecorder recorder(config_);
  TickFeed feed({&recorder});
  testing::RecordRun(
      configuration_, feed,
      [&](std::int64_t tick) {
        if (tick % 5 == 0) feed.PushTruth(std::vector<std::uint8_t>(300));
      },
      8000);
  EXPECT_EQ(recorder.lost(), 0);
  testing::RecordRun(
      configuration_, feed, [](std::int64_t /*tick*/) {}, 8000);
  EXPECT_GT(recorder.lost(), 0) << "and not for twice as many";
}

TEST_F(FlightRecorderTest, TheRoomOfAnOutputIsAMatterOfTheRateAndNeverMoreThanCanBeLocked) {
  constexpr std::size_t kMiB = std::size_t{1} << 20U;
  EXPECT_EQ(RingBytes(2, 1000), 4 * kMiB);
  EXPECT_EQ(RingBytes(2, 10'000), 32 * kMiB);
  EXPECT_EQ(RingBytes(2, 100'000), 64 * kMiB);
  EXPECT_EQ(RingBytes(kMaxJoints, 100'000), 64 * kMiB);
}

TEST_F(FlightRecorderTest, KeepsATrueStateOfTheGreatestLengthAndALongerOneIsSaid) {
  FlightRecorder recorder(config_);
  TickFeed feed({&recorder});
  static_assert(kTruthBytesMax > kTickEntryBytesMax);
  const std::vector<std::uint8_t> longest(kTruthBytesMax, 7);
  testing::RecordRun(
      configuration_, feed,
      [&](std::int64_t /*tick*/) {
        feed.PushTruth(longest);
        recorder.Drain();
      },
      3);
  EXPECT_EQ(feed.TruthProblem(), "");
  for (int i = 0; i < 2; ++i) feed.PushTruth(std::vector<std::uint8_t>(kTruthBytesMax + 1));
  EXPECT_THAT(feed.TruthProblem(), HasSubstr("2 of more than 16384 bytes are in no output"));
  recorder.Stop("completed");
  const std::string bytes = ReadFile(config_.file);
  FlightRecord record(AsBytes(bytes), "run.rec");
  const auto entry = std::make_unique<TickEntry>();
  std::size_t truths = 0;
  const auto take = [&] {
    for (const auto& truth : record.truths()) {
      EXPECT_TRUE(std::ranges::equal(truth, longest));
      ++truths;
    }
  };
  while (record.Next(*entry)) take();
  take();
  EXPECT_EQ(truths, 3U);
}

TEST_F(FlightRecorderTest, KeepsTheTruthBetweenTheTicks) {
  FlightRecorder recorder(config_);
  TickFeed feed({&recorder});
  testing::RecordRun(
      configuration_, feed,
      [&](std::int64_t tick) {
        const std::array<std::uint8_t, 3> truth = {1, 2, static_cast<std::uint8_t>(tick)};
        if (tick % 5 == 0) feed.PushTruth(truth);
        recorder.Drain();
      },
      23);
  recorder.Stop("completed");
  const std::string bytes = ReadFile(config_.file);
  FlightRecord record(AsBytes(bytes), "run.rec");
  const auto entry = std::make_unique<TickEntry>();
  std::int64_t ticks = 0;
  while (record.Next(*entry)) {
    // Each tick is preceded by the truth after the tick before it.
    const bool expected = ticks > 0 && (ticks - 1) % 5 == 0;
    ASSERT_EQ(record.truths().size(), expected ? 1U : 0U) << ticks;
    if (expected) {
      ASSERT_EQ(record.truths()[0].size(), 3U);
      EXPECT_EQ(record.truths()[0][2], ticks - 1);
    }
    ++ticks;
  }
  EXPECT_EQ(ticks, 23);
  EXPECT_THAT(record.damages(), IsEmpty());
  ASSERT_TRUE(record.end());
  EXPECT_EQ(record.end()->ticks, 23);
  EXPECT_EQ(record.end()->lost, 0);
}

TEST_F(FlightRecorderTest, AThreadThatComesToNoEndIsLeftBehindAndSaidToBe) {
  config_.ring_bytes = 4096;  // It loses ticks, which is said by its thread.
  std::atomic<bool> stuck{true}, entered{false};
  config_.say = [&](const std::string&) {
    entered = true;
    while (stuck) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  };
  {
    FlightRecorder recorder(config_);
    TickFeed feed({&recorder});
    testing::RecordRun(configuration_, feed);
    recorder.Start();
    while (!entered) {
      testing::RecordRun(configuration_, feed);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    recorder.Stop("completed", [] { return std::chrono::milliseconds(1); });
    EXPECT_THAT(recorder.problem(),
                HasSubstr(config_.file + ": could not be written whole: after "));
  }
  // It ends by itself once it can, and uses nothing that is gone.
  stuck = false;
  EXPECT_TRUE(testing::Eventually([this] {
    const std::string bytes = ReadFile(config_.file);
    FlightRecord record(AsBytes(bytes), "run.rec");
    TickEntry entry;
    while (record.Next(entry)) {
    }
    return record.end().has_value();
  }));
}

TEST_F(FlightRecorderTest, OverwritesNothing) {
  std::ofstream(config_.file) << "precious";
  try {
    const FlightRecorder recorder(config_);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("exists, and a record is never overwritten"));
  }
  EXPECT_EQ(ReadFile(config_.file), "precious");
  config_.file = "/proc/absent/run.rec";
  EXPECT_THROW(FlightRecorder{config_}, std::runtime_error);
}

TEST_F(FlightRecorderTest, RemovesARecordOfNothing) {
  { const FlightRecorder recorder(config_); }
  EXPECT_FALSE(std::filesystem::exists(config_.file));
}

TEST_F(FlightRecorderTest, WithoutStopTheRecordLacksItsEndAlone) {
  {
    FlightRecorder recorder(config_);
    TickFeed feed({&recorder});
    testing::RecordRun(configuration_, feed);
  }
  const std::string whole = testing::RecordedBytes(configuration_);
  const std::string bytes = ReadFile(config_.file);
  ASSERT_LT(bytes.size(), whole.size());
  EXPECT_EQ(bytes, whole.substr(0, bytes.size()));
  FlightRecord record(AsBytes(bytes), "run.rec");
  EXPECT_TRUE(Replay(record).identical());
}

}  // namespace
}  // namespace tumbler
