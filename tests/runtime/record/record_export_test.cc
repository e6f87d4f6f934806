#include "runtime/record/record_export.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>

#include "runtime/assembly/candump.h"
#include "runtime/record/telemetry.h"
#include "tests/support/program.h"
#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

using testing::AsBytes;
using ::testing::HasSubstr;
using testing::ReadFile;

class RecordExport : public ::testing::Test {
 protected:
  RecordExport() {
    configuration_.utime_at_zero_us = 1'436'509'052'249'713;
    bytes_ = testing::RecordedBytes(configuration_);
    record_ = std::make_unique<FlightRecord>(AsBytes(bytes_), "run.rec");
  }
  testing::TemporaryFolder folder_;
  RecordConfiguration configuration_ = testing::SmallConfiguration();
  std::string bytes_;
  std::unique_ptr<FlightRecord> record_;
};

TEST_F(RecordExport, WritesEveryFrameByTime) {
  const std::int64_t count = ExportCandump(*record_, folder_ / "out.log");
  const std::string text = ReadFile(folder_ / "out.log");
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), count);
  EXPECT_TRUE(
      text.starts_with("(1436509052.249713) sim 001#FFFFFFFFFFFFFFFD\n"
                       "(1436509052.249713) sim 002#FFFFFFFFFFFFFFFD\n"
                       "(1436509052.250013) sim 011#01"))
      << text.substr(0, 200);
  std::int64_t skipped = 0;
  const auto frames = ParseCandump(text, "out.log", skipped);
  record_->Rewind();
  const auto entry = std::make_unique<TickEntry>();
  std::int64_t expected = 0, ticks = 0;
  while (record_->Next(*entry)) {
    expected += 2 + static_cast<std::int64_t>(entry->received_count);
    ++ticks;
  }
  EXPECT_EQ(count, expected);
  EXPECT_GT(ticks, 80);
  EXPECT_TRUE(std::is_sorted(frames.begin(), frames.end(), [](const auto& a, const auto& b) {
    return a.received.time_ns < b.received.time_ns;
  }));
}

TEST_F(RecordExport, IsReadByTheToolsOfCanUtils) {
  ExportCandump(*record_, folder_ / "out.log");
  // log2asc reads with canplayer's parser, and asc2log counts times from the present.
  const std::string command = "log2asc -I " + (folder_ / "out.log") + " sim | asc2log >" +
                              (folder_ / "again.log") + " 2>/dev/null";
  // NOLINTNEXTLINE(concurrency-mt-unsafe): a test of one thread.
  ASSERT_EQ(std::system(command.c_str()), 0);
  std::int64_t skipped = 0;
  const auto ours = ParseCandump(ReadFile(folder_ / "out.log"), "out.log", skipped);
  const auto theirs = ParseCandump(ReadFile(folder_ / "again.log"), "again.log", skipped);
  ASSERT_EQ(theirs.size(), ours.size());
  ASSERT_GT(ours.size(), 300U);
  for (std::size_t i = 0; i < ours.size(); ++i) {
    EXPECT_EQ(theirs[i].received.frame, ours[i].received.frame) << i;
    EXPECT_EQ(theirs[i].received.time_ns - theirs[0].received.time_ns,
              ours[i].received.time_ns - ours[0].received.time_ns)
        << i;
  }
}

TEST_F(RecordExport, WritesTheTicksAsTelemetryDoes) {
  const std::int64_t ticks = ExportTelemetry(*record_, folder_ / "out.csv", folder_ / "out.lcm");
  const std::string csv = ReadFile(folder_ / "out.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), ticks + 1);
  EXPECT_TRUE(csv.starts_with("number,tick,time_s,state,node,")) << csv.substr(0, 100);
  EXPECT_NE(csv.find(",joint2_measured_torque_nm,"), std::string::npos);
  EXPECT_NE(csv.find("\n60,60,0.060000,running,0,"), std::string::npos);

  lcm::LogFile log(folder_ / "out.lcm", "r");
  std::int64_t states = 0;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    if (event->channel != "TUMBLER_STATE") continue;
    state_t state;
    ASSERT_GT(state.decode(event->data, 0, event->datalen), 0);
    EXPECT_EQ(state.tick, states);
    EXPECT_EQ(event->timestamp, 1'436'509'052'249'713 + 1000 * states);
    ++states;
  }
  EXPECT_EQ(states, ticks);
}

TEST_F(RecordExport, SaysOfARecordOfVersionFourWhenRepliesWereSampled) {
  const std::string former = ReadFile(testing::SourcePath("tests/data/records/version_4.rec"));
  FlightRecord record(AsBytes(former), "version_4.rec");
  TimedRecords records = TimedRecordsOf(record.configuration());
  const auto entry = std::make_unique<TickEntry>();
  std::int64_t known = 0, sent_ns = 0;
  while (record.Next(*entry)) {
    const TimedRecord timed = records.Next(*entry);
    const double asked_us = 1e-3 * static_cast<double>(sent_ns - timed.time_ns);
    sent_ns = entry->notes.send_ns;
    for (std::size_t j = 0; j < timed.record.joint_count; ++j) {
      if (timed.record.joints[j].reply_age_ticks != 0) {
        EXPECT_TRUE(std::isnan(timed.reply_sampled_us[j])) << "the first tick";
        continue;
      }
      EXPECT_GT(timed.reply_sampled_us[j], asked_us);
      EXPECT_LT(timed.reply_sampled_us[j], 0);
      ++known;
    }
  }
  EXPECT_EQ(known, 2 * 237);
}

TEST_F(RecordExport, AReplyToASetpointThatWasNotRecordedWasSampledBeforeItBegan) {
  TimedRecords all = TimedRecordsOf(configuration_), some = TimedRecordsOf(configuration_);
  const auto entry = std::make_unique<TickEntry>();
  record_->Rewind();
  for (std::int64_t tick = 0; tick < 20 && record_->Next(*entry); ++tick) {
    const TimedRecord whole = all.Next(*entry);
    if (tick == 9) continue;  // lost
    const TimedRecord with_loss = some.Next(*entry);
    for (std::size_t j = 0; j < 2 && tick > 0; ++j) {
      if (tick == 10) {
        EXPECT_GE(with_loss.reply_sampled_us[j], whole.reply_sampled_us[j]);
      } else {
        EXPECT_EQ(with_loss.reply_sampled_us[j], whole.reply_sampled_us[j]) << tick;
      }
    }
  }
}

TEST_F(RecordExport, SummaryNamesWhatThereIs) {
  const std::string summary = Summary(*record_);
  for (const char* part : {"made by test 1.0 on Linux", "bus sim, virtual time, 1000 Hz",
                           "joints joint1, joint2", "motion motions/motion.toml, speed 0.9",
                           "holds motions/motion.toml", "fnv1a64:", "complete: completed"}) {
    EXPECT_THAT(summary, HasSubstr(part));
  }
}

TEST_F(RecordExport, TheLastMessageOfARunTellsOfTicksThatWereLostAtItsEnd) {
  FlightRecorderConfig config;
  config.file = folder_ / "cut.rec";
  config.configuration = EncodeConfiguration(configuration_);
  config.ring_bytes = std::size_t{1} << 14U;
  FlightRecorder recorder(config);
  TickFeed feed({&recorder});
  testing::RecordRun(configuration_, feed, [&recorder](std::int64_t tick) {
    if (tick < 30) recorder.Drain();
  });
  recorder.Stop("completed");
  ASSERT_GT(recorder.lost(), 0);
  const std::string bytes = ReadFile(config.file);
  FlightRecord record(AsBytes(bytes), "cut.rec");
  ExportTelemetry(record, "", folder_ / "out.lcm");
  lcm::LogFile log(folder_ / "out.lcm", "r");
  run_t run;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    if (event->channel != "TUMBLER_RUN") continue;
    ASSERT_GT(run.decode(event->data, 0, event->datalen), 0);
  }
  EXPECT_EQ(run.lost_records, recorder.lost());
}

/// Throws at its third tick.
class BrokenExport final : public RunExport {
 public:
  using RunExport::RunExport;
  void Take(const TickEntry& /*entry*/, const TimedRecord& /*timed*/) override {
    if (++ticks_ >= 3) throw std::runtime_error("no plan of node 2");
  }

 private:
  int ticks_ = 0;
};

TEST_F(RecordExport, OfARunThatThrowsEndsAloneAndTheRunIsToldWhyInTheEnd) {
  for (const bool threads : {false, true}) {
    TelemetryConfig config;
    config.run = DescribeRun(configuration_);
    config.trace_file = folder_ / "out.csv";
    config.another = [](const RunExportConfig& /*exports*/) {
      return std::make_unique<BrokenExport>("out.mcap");
    };
    Telemetry telemetry(config);
    if (threads) telemetry.Start();
    TickFeed feed({&telemetry});
    std::int64_t ticks = 0;
    testing::RecordRun(configuration_, feed, [&](std::int64_t /*tick*/) {
      if (!threads) telemetry.Drain();
      ++ticks;
    });
    try {
      telemetry.Stop();
      FAIL();
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(),
                   "out.mcap: could not be written whole; out.mcap: no plan of node 2");
    }
    const std::string csv = ReadFile(folder_ / "out.csv");
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), ticks + 1) << "the others are whole";
  }
}

TEST_F(RecordExport, NamesAFileThatCannotBeWritten) {
  EXPECT_THROW(ExportCandump(*record_, "/proc/absent/out.log"), FileError);
  EXPECT_THROW(ExportCandump(*record_, "/dev/full"), RecordError);
  EXPECT_THROW(ExportTelemetry(*record_, "/proc/absent/out.csv", ""), std::runtime_error);
}

}  // namespace
}  // namespace tumbler
