#include "runtime/record/record_mcap.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <memory>

#include "runtime/record/message_readers.h"
#include "runtime/record/messages.h"
#include "runtime/record/record_export.h"
#include "runtime/record/run_mcap.h"

namespace tumbler {
namespace {

/// Time from one message about the run as a whole to the next.
constexpr std::int64_t kRunPeriod_ns = 250'000'000;

McapWriter::Texts TextsAbout(const RecordConfiguration& configuration) {
  return {{"record_made_by", configuration.program},
          {"bus", configuration.bus},
          {"dry_run", configuration.dry_run ? "yes" : "no"},
          {"virtual_time", configuration.virtual_time ? "yes" : "no"},
          {"motion", configuration.motion_file},
          {"drives", configuration.drives_file},
          {"rate_hz", fmt::format("{}", 1e9 / static_cast<double>(configuration.period_ns))},
          {"kernel", configuration.kernel}};
}

bool HasTruth(FlightRecord& record) {
  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  while (record.Next(*entry)) {
    if (!record.truths().empty()) return true;
  }
  return !record.truths().empty();
}

/// Writes the messages of a record in the order of time.
class RecordToMcap {
 public:
  RecordToMcap(FlightRecord& record, const RunMcapConfig& config, const RunDescription& run)
      : record_(record), mcap_(config), events_(run), run_(run) {
    const RecordConfiguration& configuration = record.configuration();
    zero_ns_ = configuration.utime_at_zero_us * 1000;
  }

  std::int64_t Write(const std::vector<PlannedInstant>& plan) {
    record_.Rewind();
    TimedRecords records(record_.configuration());
    const auto entry = std::make_unique<TickEntry>();
    auto planned = plan.begin();
    std::int64_t ticks = 0, last_ns = 0;
    while (record_.Next(*entry)) {
      TakeTruths();
      const TimedRecord timed = records.Next(*entry);
      last_ns = timed.time_ns;
      for (; planned != plan.end() && planned->time_ns <= last_ns; ++planned)
        mcap_.TakePlan(TimeOf(planned->time_ns), planned->root, planned->joints);
      TakeTick(timed);
      ++ticks;
    }
    TakeTruths();
    if (ticks > 0) mcap_.Take(TimeOf(last_ns), run_.At(last_ns, record_lost(), 0));
    mcap_.Finish();
    return ticks;
  }

 private:
  [[nodiscard]] std::uint64_t TimeOf(std::int64_t time_ns) const {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(time_ns + zero_ns_, 0));
  }

  [[nodiscard]] std::int64_t record_lost() const {
    std::int64_t lost = 0;
    for (const LostTicks& ticks : record_.lost()) lost += ticks.count;
    return lost;
  }

  void TakeTruths() {
    space_truth_t state;
    for (const auto& bytes : record_.truths()) {
      if (!ReadMessage(bytes, state)) {
        throw RecordError(fmt::format("{}: the true state of the robot in it is of another version",
                                      record_.name()));
      }
      mcap_.Take(TimeOf(state.truth.time_ns), state);
    }
  }

  void TakeTick(const TimedRecord& timed) {
    const std::uint64_t time_ns = TimeOf(timed.time_ns);
    FillState(timed, state_);
    mcap_.Take(time_ns, state_);
    if (const auto event = events_.Next(timed)) mcap_.Take(time_ns, *event);
    run_.Count(timed);
    if (timed.time_ns < next_run_ns_) return;
    mcap_.Take(time_ns, run_.At(timed.time_ns, record_lost(), 0));
    next_run_ns_ = timed.time_ns + kRunPeriod_ns;
  }

  FlightRecord& record_;
  RunMcap mcap_;
  EventWatch events_;
  RunMessage run_;
  std::int64_t zero_ns_ = 0;
  std::int64_t next_run_ns_ = std::numeric_limits<std::int64_t>::min();
  state_t state_{};
};

}  // namespace

std::int64_t ExportMcap(FlightRecord& record, const std::string& path, const std::string& program,
                        const std::optional<RecordPicture>& picture) {
  const RunDescription run = DescribeRun(record.configuration());
  RunMcapConfig config;
  config.path = path;
  config.program = program;
  config.joints = record.configuration().joints;
  config.about = TextsAbout(record.configuration());
  config.imagined_drives = record.configuration().dry_run;
  if (picture) {
    config.robot = picture->robot;
    config.root = HasTruth(record)        ? RunMcapConfig::Root::kTrue
                  : picture->plan.empty() ? RunMcapConfig::Root::kUnknown
                                          : RunMcapConfig::Root::kPlanned;
  }
  return RecordToMcap(record, config, run)
      .Write(picture ? picture->plan : std::vector<PlannedInstant>());
}

}  // namespace tumbler
