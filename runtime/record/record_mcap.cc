#include "runtime/record/record_mcap.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

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

/// The node with which the run begins, where that is known beforehand: of several beginnings the
/// sensor chooses, unless the operator has.
std::optional<int> BeginOf(const RecordConfiguration& about, const RunParts& parts) {
  if (about.executor.begin >= 0) return about.executor.begin;
  if (parts.drives.sensor && parts.file.graph.beginning_count > 1) return std::nullopt;
  return parts.file.graph.start;
}

}  // namespace

McapPictures PicturesOf(const RecordConfiguration& about, const PictureSource* pictures,
                        const RunParts& parts, const std::string& path) {
  if (pictures == nullptr) return {};
  McapPictures made;
  made.robot = pictures->robot_of(parts.file, about.joints);
  try {
    made.planner = pictures->plan_of(parts.file, about.period_ns, BeginOf(about, parts));
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format(
        "{}: cannot be written, since the plan cannot be drawn: {}", path, error.what()));
  }
  return made;
}

McapExport::McapExport(const std::string& path, const RunExportConfig& config,
                       const RecordConfiguration& about, bool has_truth, McapPictures pictures)
    : FileExport(path, config.whole_files),
      MessageStream(config),
      zero_ns_(config.utime_at_zero_us * 1000),
      planner_(std::move(pictures.planner)) {
  RunMcapConfig mcap;
  mcap.joints = about.joints;
  mcap.about = TextsAbout(about);
  mcap.imagined_drives = about.dry_run;
  if (pictures.robot) {
    mcap.robot = std::move(pictures.robot);
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
  const RunExportConfig config = ExportConfigOf(about);
  McapExport mcap(path, config, about, HasTruth(record),
                  PicturesOf(about, pictures, assembly.parts(), path));
  return ExportRecord(record, {&mcap}, config.figures.get());
}

}  // namespace tumbler
