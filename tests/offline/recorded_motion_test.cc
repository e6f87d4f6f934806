// How a flight record is read as a motion to be fitted.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "offline/studies/recorded_motion.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/flight_recorder.h"
#include "tests/support/files.h"
#include "tests/support/hidden_robot.h"
#include "tests/support/identification.h"

namespace tumbler {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

/// The record of a robot that swings its legs, made once.
const std::string& Usual() {
  static const testing::TemporaryFolder folder;
  static const std::string file = [] {
    const std::string drives = testing::SourcePath("primitives/robots/tumbler_drives.toml");
    const testing::HiddenRuns run(testing::ExcitationFiles().front(), drives);
    EXPECT_TRUE(run.Record(testing::DrawHiddenRobot(run.scene(), 11, 2), folder / "usual.rec"));
    return folder / "usual.rec";
  }();
  return file;
}

/// Writes a record again with what `change` makes of its configuration and ticks.
template <class Change>
void Rewrite(const std::string& from, const std::string& to, const Change& change) {
  const std::string bytes = testing::ReadFile(from);
  FlightRecord record({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, from);
  RecordConfiguration configuration = record.configuration();
  const auto entry = std::make_unique<TickEntry>();
  change(configuration, *entry);
  FlightRecorderConfig config;
  config.file = to;
  config.configuration = EncodeConfiguration(configuration);
  FlightRecorder recorder(config);
  TickFeed feed({&recorder});
  while (record.Next(*entry)) {
    change(configuration, *entry);
    feed.Push(entry->notes, entry->input(), {entry->frames, entry->record});
    recorder.Drain();
  }
  recorder.Stop("completed");
}

TEST(RecordedMotion, ARecordOfASlowerPaceIsReadInTheTimeOfItsRobot) {
  constexpr std::int64_t kSlower = 20;
  const testing::TemporaryFolder folder;
  const std::string file = folder / "slow.rec";
  bool begun = false;
  Rewrite(Usual(), file, [&begun](RecordConfiguration& configuration, TickEntry& entry) {
    if (!begun) configuration.period_ns *= kSlower;
    begun = true;
    TickNotes& notes = entry.notes;
    for (std::int64_t* time_ns :
         {&notes.deadline_ns, &notes.due_ns, &notes.awake_ns, &notes.send_ns, &notes.done_ns})
      *time_ns *= kSlower;
    for (std::size_t i = 0; i < entry.received_count; ++i) entry.received[i].time_ns *= kSlower;
  });
  const RecordedMotion usual = ReadRecordedMotion(Usual());
  const RecordedMotion slow = ReadRecordedMotion(file);
  EXPECT_NEAR(slow.tick_s, usual.tick_s, 1e-12);
  EXPECT_NEAR(slow.late_s, usual.late_s, 1e-9);
  EXPECT_GT(usual.late_s, 1e-5);
  EXPECT_EQ(slow.begins, usual.begins);
  ASSERT_EQ(slow.ticks.size(), usual.ticks.size());
  for (std::size_t k = 0; k < usual.ticks.size(); ++k)
    EXPECT_NEAR(slow.ticks[k][1].arrival_s, usual.ticks[k][1].arrival_s, 1e-6);
}

TEST(RecordedMotion, ARunInRealTimeIsReadByTheTimeStampsOfItsReplies) {
  // The robot stands still while it is simulated, and the clock goes on: setpoints are sent later
  // by it than they reach the robot, by another time in each tick.
  const testing::TemporaryFolder folder;
  const std::string file = folder / "real.rec";
  Rewrite(Usual(), file, [](RecordConfiguration& configuration, TickEntry& entry) {
    configuration.virtual_time = false;
    entry.notes.send_ns += 60'000 + 10'000 * (entry.tick % 17);
    entry.notes.done_ns = std::max(entry.notes.done_ns, entry.notes.send_ns);
  });
  const RecordedMotion usual = ReadRecordedMotion(Usual());
  const RecordedMotion real = ReadRecordedMotion(file);
  EXPECT_TRUE(usual.periods_with_ticks);
  EXPECT_FALSE(real.periods_with_ticks);
  ASSERT_EQ(real.ticks.size(), usual.ticks.size());
  for (std::size_t k = 0; k + 1 < usual.ticks.size(); ++k) {
    for (std::size_t j = 0; j < 2; ++j) {
      const RecordedJoint &a = real.ticks[k][j], &b = usual.ticks[k][j];
      ASSERT_EQ(a.reading_rad, b.reading_rad) << k << ": a reply answers its own tick";
      EXPECT_NEAR(a.arrival_s, b.arrival_s, 1e-6) << k;
      EXPECT_NEAR(a.sampled_s, b.sampled_s, 1e-6) << k;
    }
  }
}

TEST(RecordedMotion, RepliesThatComeLateDoNotTellWhenTheirSetpointsCame) {
  const testing::TemporaryFolder folder;
  const std::string file = folder / "late.rec";
  const auto late = [](std::int64_t tick) { return tick % 3 == 1; };
  Rewrite(Usual(), file, [&](RecordConfiguration& configuration, TickEntry& entry) {
    configuration.bus = "can0";
    configuration.virtual_time = false;
    const std::int64_t more_ns = late(entry.tick) ? 150'000 : 3'000 * (entry.tick % 5);
    for (std::size_t i = 0; i < entry.received_count; ++i) entry.received[i].time_ns += more_ns;
  });
  const RecordedMotion usual = ReadRecordedMotion(Usual());
  const RecordedMotion with_late = ReadRecordedMotion(file);
  EXPECT_NEAR(with_late.late_s, usual.late_s, 5e-6);
  EXPECT_THAT(with_late.remarks, Contains(HasSubstr("replies came later by more than 0.03 ms")));
  ASSERT_EQ(with_late.ticks.size(), usual.ticks.size());
  std::size_t left_out = 0, readings = 0;
  for (std::size_t k = 0; k + 1 < usual.ticks.size(); ++k) {
    for (std::size_t j = 0; j < usual.joint_count(); ++j) {
      const RecordedJoint &a = with_late.ticks[k][j], &b = usual.ticks[k][j];
      EXPECT_NEAR(a.arrival_s, b.arrival_s, 20e-6) << k;
      EXPECT_NEAR(a.sampled_s, b.sampled_s, 20e-6) << k;
      ++readings;
      if (std::isnan(a.reading_rad)) {
        ++left_out;
      } else {
        EXPECT_EQ(a.reading_rad, b.reading_rad) << k;
      }
    }
  }
  EXPECT_NEAR(static_cast<double>(left_out), static_cast<double>(readings) / 3, 4);
}

}  // namespace
}  // namespace tumbler
