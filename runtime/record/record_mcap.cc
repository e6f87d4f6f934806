#include "runtime/record/record_mcap.h"

#include <fmt/format.h>

#include <algorithm>

#include "runtime/record/message_readers.h"
#include "runtime/record/record_export.h"
#include "runtime/record/recorded_assembly.h"

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

}  // namespace

McapExport::McapExport(const std::string& path, const RunExportConfig& config,
                       const RecordConfiguration& about, bool has_truth,
                       const PictureSource* pictures, const SequenceFile& motion)
    : FileExport(path, config.whole_files),
      MessageStream(config),
      zero_ns_(config.utime_at_zero_us * 1000) {
  RunMcapConfig mcap;
  mcap.joints = about.joints;
  mcap.about = TextsAbout(about);
  mcap.imagined_drives = about.dry_run;
  if (pictures != nullptr) {
    mcap.robot = pictures->robot_of(motion, about.joints);
    planner_ = pictures->plan_of(motion, about.period_ns);
    mcap.root = has_truth             ? RunMcapConfig::Root::kTrue
                : planner_ == nullptr ? RunMcapConfig::Root::kUnknown
                                      : RunMcapConfig::Root::kPlanned;
  }
  mcap_.emplace(mcap, out());
}

void McapExport::Take(const TickEntry& entry, const TimedRecord& timed) {
  if (planner_ != nullptr) TakePlan(planner_->Take(entry));
  TakeTick(timed);
}

void McapExport::TakeTruth(std::span<const std::uint8_t> truth) {
  if (!ReadMessage(truth, truth_)) {
    throw RecordError(fmt::format("{}: the true state of the robot is of another version", file()));
  }
  mcap_->Take(TimeOf(truth_.truth.time_ns), truth_);
}

void McapExport::Finish() {
  if (planner_ != nullptr) TakePlan(planner_->Last());
  EmitLast();
  mcap_->Finish();
}

void McapExport::Put(const state_t& message, std::int64_t time_ns) {
  mcap_->Take(TimeOf(time_ns), message);
}
void McapExport::Put(const event_t& message, std::int64_t time_ns) {
  mcap_->Take(TimeOf(time_ns), message);
}
void McapExport::Put(const run_t& message, std::int64_t time_ns) {
  mcap_->Take(TimeOf(time_ns), message);
}

void McapExport::TakePlan(const std::optional<PlannedInstant>& plan) {
  if (plan) mcap_->TakePlan(TimeOf(plan->time_ns), plan->root, plan->joints);
}

std::uint64_t McapExport::TimeOf(std::int64_t time_ns) const {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(time_ns + zero_ns_, 0));
}

std::int64_t ExportMcap(FlightRecord& record, const std::string& path,
                        const PictureSource* pictures) {
  const RecordConfiguration& about = record.configuration();
  const Assembly assembly = Assemble(about);
  McapExport mcap(path, ExportConfigOf(about), about, HasTruth(record), pictures,
                  assembly.parts().file);
  return ExportRecord(record, {&mcap});
}

}  // namespace tumbler
