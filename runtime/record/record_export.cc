#include "runtime/record/record_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_toml.h"
#include "common/files/result_file.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/recorded_assembly.h"
#include "runtime/record/run_description.h"
#include "runtime/record/sentences.h"
#include "runtime/record/truth_csv.h"

namespace tumbler {

namespace {

/// Whether there is a file of this name, and it says something else. (A record may name anything,
/// so only files of the same length are read.)
bool IsAnotherNow(const LoadedFile& file) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(file.path, none)) return false;
  const std::uintmax_t size = std::filesystem::file_size(file.path, none);
  if (none || size != file.text.size()) return !none;
  std::ifstream stream(file.path, std::ios::binary);
  if (!stream) return false;
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  return !stream.bad() && text != file.text;
}

/// True states as a table.
class TruthTable final : public RunExport {
 public:
  TruthTable(const std::string& path, const std::string& record, std::vector<std::string> joints)
      : RunExport(path), record_(record), joints_(std::move(joints)) {}
  [[nodiscard]] std::int64_t rows() const { return count_; }

  void Take(const TickEntry& /*entry*/, const TimedRecord& /*timed*/) override {}
  void TakeTruth(std::span<const std::uint8_t> truth) override {
    if (!ReadMessage(truth, state_) || (kind_ && KindOf(state_) != *kind_)) {
      throw RecordError(
          fmt::format("{}: the true state of the robot in it is of another version", record_));
    }
    kind_ = KindOf(state_);
    // Joints without a motor, of which the record's configuration does not know, come after the
    // others in every state.
    for (const joint_truth_t& joint : state_.truth.joints) {
      if (count_ == 0 && std::ranges::find(joints_, joint.name) == joints_.end())
        joints_.push_back(joint.name);
    }
    AppendTruthCsvRow(state_, joints_, rows_);
    ++count_;
  }
  void Finish() override {
    if (count_ > 0) return;
    throw RecordError(fmt::format(
        "{}: has no true states of the robot; only `tumbler run sim --record` records them",
        record_));
  }
  void Commit() override { WriteResult(file(), TruthCsvHeader(joints_, *kind_) + '\n' + rows_); }

 private:
  std::string record_;
  std::vector<std::string> joints_;
  std::string rows_;
  std::int64_t count_ = 0;
  space_truth_t state_;
  std::optional<TruthKind> kind_;
};

/// Of the drives of a record; none where its files cannot be used any more.
std::vector<std::string> ErrorCodesOf(const RecordConfiguration& configuration) {
  try {
    return DescribeRun(configuration).error_codes;
  } catch (const std::exception&) {
    return {};
  }
}

}  // namespace

RunDescription DescribeRun(const RecordConfiguration& configuration) {
  const Assembly assembly = Assemble(configuration);
  RunDescription run = DescribeMotion(assembly.parts().sequence->graph, assembly.parts().drives);
  run.bus = configuration.bus;
  run.mode = configuration.bus == "sim" ? "simulated" : configuration.dry_run ? "dry run" : "armed";
  run.attended = configuration.procedure.attended;
  // The record has the float nearest to the number that was given; its shortest text is that
  // number.
  run.speed = std::stod(fmt::format("{}", configuration.executor.speed));
  run.joints = configuration.joints;
  run.machine = configuration.machine;
  run.scheduling = configuration.virtual_time ? "time-shared" : "not recorded";
  return run;
}

TimedRecords TimedRecordsOf(const RecordConfiguration& configuration) {
  try {
    const FileReader read = RecordedFiles(configuration);
    return TimedRecords(
        SampleTimesOf(LoadDrivesOf(configuration.joints, configuration.drives_file, read),
                      configuration.period_ns));
  } catch (const std::exception&) {
    return TimedRecords({});  // Whoever needs the drives says what is wrong with them.
  }
}

std::int64_t ExportRecord(FlightRecord& record, const std::vector<RunExport*>& exports,
                          LiveFigures* figures) {
  TimedRecords records = TimedRecordsOf(record.configuration());
  const auto take_truths = [&] {
    for (const auto& truth : record.truths()) {
      for (RunExport* out : exports) out->TakeTruth(truth);
    }
  };
  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  std::int64_t ticks = 0;
  for (; record.Next(*entry); ++ticks) {
    take_truths();
    const TimedRecord timed = records.Next(*entry);
    for (RunExport* out : exports) out->Take(*entry, timed);
  }
  take_truths();
  if (figures != nullptr) {
    std::int64_t lost = 0;
    for (const LostTicks& gap : record.lost()) lost += gap.count;
    figures->lost = lost;
  }
  std::vector<std::string> failed;
  for (RunExport* out : exports) {
    out->Finish();
    if (out->failed()) failed.push_back(out->file());
  }
  if (!failed.empty())
    throw RecordError(fmt::format("{}: could not be written whole", fmt::join(failed, ", ")));
  for (RunExport* out : exports) out->Commit();
  return ticks;
}

RunExportConfig ExportConfigOf(const RecordConfiguration& configuration) {
  RunExportConfig config;
  config.run = DescribeRun(configuration);
  config.utime_at_zero_us = configuration.utime_at_zero_us;
  config.whole_files = true;
  config.figures->scheduling = config.run.scheduling;
  return config;
}

std::int64_t ExportCandump(FlightRecord& record, const std::string& path) {
  RunExportConfig config;
  config.run.bus = record.configuration().bus;
  config.utime_at_zero_us = record.configuration().utime_at_zero_us;
  config.whole_files = true;
  CandumpExport candump(path, config);
  ExportRecord(record, {&candump});
  return candump.frames();
}

std::int64_t ExportTelemetry(FlightRecord& record, const std::string& csv_path,
                             const std::string& lcm_path) {
  const RunExportConfig config = ExportConfigOf(record.configuration());
  std::optional<LogExport> log;
  std::optional<CsvExport> csv;
  std::vector<RunExport*> exports;
  if (!lcm_path.empty()) exports.push_back(&log.emplace(lcm_path, config));
  if (!csv_path.empty()) exports.push_back(&csv.emplace(csv_path, config));
  return ExportRecord(record, exports, config.figures.get());
}

std::int64_t ExportTruth(FlightRecord& record, const std::string& csv_path) {
  TruthTable table(csv_path, record.name(), record.configuration().joints);
  ExportRecord(record, {&table});
  return table.rows();
}

std::string Summary(FlightRecord& record) {
  const RecordConfiguration& c = record.configuration();
  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  std::int64_t ticks = 0, truths = 0, sent = 0, received = 0, first_ns = 0, last_ns = 0;
  FaultDetail fault;
  while (record.Next(*entry)) {
    if (ticks++ == 0) first_ns = entry->notes.deadline_ns;
    last_ns = entry->notes.deadline_ns;
    truths += static_cast<std::int64_t>(record.truths().size());
    sent += static_cast<std::int64_t>(entry->notes.sent_count);
    received += static_cast<std::int64_t>(entry->received_count);
    if (fault.fault == Fault::kNone) fault = entry->record.first_fault;
  }
  std::string text = fmt::format("{}: {} bytes, format version {}\n", record.name(), record.size(),
                                 record.version());
  text += fmt::format("  made by {} on {}\n", c.program, c.kernel);
  text += fmt::format("  bus {}{}{}, {:.6g} Hz, joints {}\n", c.bus, c.dry_run ? " (dry run)" : "",
                      c.virtual_time ? ", virtual time" : "",
                      1e9 / static_cast<double>(c.period_ns), fmt::join(c.joints, ", "));
  text += fmt::format("  motion {}, speed {:.3g}; drives {}\n", c.motion_file, c.executor.speed,
                      c.drives_file.empty() ? "of the simulation" : c.drives_file);
  for (const LoadedFile& file : c.files) {
    text += fmt::format("  holds {} ({} bytes, {}){}\n", file.path, file.text.size(),
                        HashOfText(file.text),
                        IsAnotherNow(file) ? "; the file there is another now" : "");
  }
  text += fmt::format("  {} ticks over {:.3f} s; {} frames sent, {} received\n", ticks,
                      static_cast<double>(last_ns - first_ns) * 1e-9, sent, received);
  truths += static_cast<std::int64_t>(record.truths().size());
  if (truths > 0) text += fmt::format("  {} true states of the simulated robot\n", truths);
  if (fault.fault != Fault::kNone)
    text += fmt::format("  {}\n", Describe(fault, c.joints, ErrorCodesOf(c)));
  for (const std::string& remark : record.Remarks()) text += fmt::format("  {}\n", remark);
  return text;
}

}  // namespace tumbler
