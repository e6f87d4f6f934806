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
class McapExport final : public RunExport {
 public:
  McapExport(const FlightRecord& record, const RunMcapConfig& config, const RunDescription& run,
             const std::vector<PlannedInstant>& plan)
      : RunExport(config.path),
        record_(record),
        mcap_(config),
        events_(run),
        run_(run),
        zero_ns_(record.configuration().utime_at_zero_us * 1000),
        planned_(plan.begin()),
        planned_end_(plan.end()) {}

  void Take(const TickEntry& /*entry*/, const TimedRecord& timed) override {
    last_ns_ = timed.time_ns;
    for (; planned_ != planned_end_ && planned_->time_ns <= timed.time_ns; ++planned_)
      mcap_.TakePlan(TimeOf(planned_->time_ns), planned_->root, planned_->joints);
    const std::uint64_t time_ns = TimeOf(timed.time_ns);
    FillState(timed, state_);
    mcap_.Take(time_ns, state_);
    if (const auto event = events_.Next(timed)) mcap_.Take(time_ns, *event);
    run_.Count(timed);
    if (timed.time_ns < next_run_ns_) return;
    TakeRun(timed.time_ns);
    next_run_ns_ = timed.time_ns + kRunPeriod_ns;
  }
  void TakeTruth(std::span<const std::uint8_t> truth) override {
    if (!ReadMessage(truth, truth_)) {
      throw RecordError(fmt::format("{}: the true state of the robot in it is of another version",
                                    record_.name()));
    }
    mcap_.Take(TimeOf(truth_.truth.time_ns), truth_);
  }
  void Finish() override {
    if (last_ns_) TakeRun(*last_ns_);
  }
  void Commit() override { mcap_.Finish(); }

 private:
  [[nodiscard]] std::uint64_t TimeOf(std::int64_t time_ns) const {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(time_ns + zero_ns_, 0));
  }
  void TakeRun(std::int64_t time_ns) {
    std::int64_t lost = 0;
    for (const LostTicks& ticks : record_.lost()) lost += ticks.count;
    mcap_.Take(TimeOf(time_ns), run_.At(time_ns, lost, 0));
  }

  const FlightRecord& record_;
  RunMcap mcap_;
  EventWatch events_;
  RunMessage run_;
  std::int64_t zero_ns_;
  std::vector<PlannedInstant>::const_iterator planned_, planned_end_;
  std::int64_t next_run_ns_ = std::numeric_limits<std::int64_t>::min();
  std::optional<std::int64_t> last_ns_;
  state_t state_{};
  space_truth_t truth_;
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
  const std::vector<PlannedInstant> unplanned;
  McapExport mcap(record, config, run, picture ? picture->plan : unplanned);
  return ExportRecord(record, {&mcap});
}

}  // namespace tumbler
