#include "runtime/record/record_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_toml.h"
#include "common/files/result_file.h"
#include "firmware_interface/can/frame_length.h"
#include "runtime/assembly/candump.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/recorded_assembly.h"
#include "runtime/record/run_description.h"
#include "runtime/record/sentences.h"
#include "runtime/record/telemetry.h"
#include "runtime/record/truth_csv.h"

namespace tumbler {

namespace {

/// The most bits that such a frame can take on the wire, as the loop counts it.
std::int32_t LongestBits(const CanFrame& frame) {
  return WorstCaseFrameBits(frame.extended ? CanIdKind::kExtended : CanIdKind::kStandard,
                            frame.remote ? 0 : frame.size);
}

/// The frames of a tick that the bus took, in their order.
std::vector<CanFrame> SentFrames(const TickEntry& entry) {
  std::vector<CanFrame> frames;
  for (std::size_t i = 0; i < entry.record.joint_count; ++i) {
    for (const CanFrame& frame : entry.frames[i].frames()) {
      if (frames.size() < entry.notes.sent_count) frames.push_back(frame);
    }
  }
  return frames;
}

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

TimedRecords::TimedRecords(const RecordConfiguration& configuration) {
  try {
    const FileReader read = RecordedFiles(configuration);
    replies_ = SampleTimesOf(LoadDrivesOf(configuration.joints, configuration.drives_file, read),
                             configuration.period_ns);
  } catch (const std::exception&) {
    // Whoever needs the drives says what is wrong with them.
  }
}

TimedRecord TimedRecords::Next(const TickEntry& entry) {
  TimedRecord timed;
  timed.time_ns = entry.notes.deadline_ns;
  timed.number = entry.index;
  timed.wake_up_ns = static_cast<float>(entry.notes.awake_ns - entry.notes.due_ns);
  timed.tick_ns = static_cast<float>(entry.notes.done_ns - entry.notes.awake_ns);
  for (const ReceivedFrame& received : entry.input().received) {
    timed.bus_bits += LongestBits(received.frame);
  }
  const std::vector<CanFrame> sent = SentFrames(entry);
  for (const CanFrame& frame : sent) timed.bus_bits += LongestBits(frame);
  timed.request = {entry.notes.request_id, static_cast<OperatorRequest>(entry.notes.request),
                   entry.notes.request_refusal};
  timed.record = entry.record;
  // What was sent in a tick that was not recorded is not known.
  if (entry.index != index_) replies_.Send(entry.notes.send_ns, {});
  index_ = entry.index + 1;
  replies_.Receive(entry.input().received);
  replies_.Send(entry.notes.send_ns, sent);
  timed.TakeSampleTimes(replies_);
  return timed;
}

std::int64_t ExportCandump(FlightRecord& record, const std::string& path) {
  const RecordConfiguration& configuration = record.configuration();
  struct CloseFile {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };
  PendingName pending(path);
  const std::unique_ptr<std::FILE, CloseFile> file(std::fopen(pending.to_open().c_str(), "w"));
  const auto fail = [&path] {
    throw RecordError(
        fmt::format("{}: cannot be written: {}", path, std::generic_category().message(errno)));
  };
  if (file == nullptr) fail();

  // A frame that arrives while a tick's frames are sent belongs to the next tick. So frames are
  // kept until no older one can come.
  std::vector<ReceivedFrame> frames;
  std::int64_t count = 0;
  const auto write_before = [&](std::int64_t time_ns) {
    std::stable_sort(frames.begin(), frames.end(),
                     [](const auto& a, const auto& b) { return a.time_ns < b.time_ns; });
    auto next = frames.begin();
    for (; next != frames.end() && next->time_ns < time_ns; ++next) {
      const std::string line =
          CandumpLine(
              std::max<std::int64_t>(next->time_ns + configuration.utime_at_zero_us * 1000, 0),
              configuration.bus, next->frame) +
          '\n';
      if (std::fwrite(line.data(), 1, line.size(), file.get()) != line.size()) fail();
      ++count;
    }
    frames.erase(frames.begin(), next);
  };

  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  std::int64_t awake_before_ns = std::numeric_limits<std::int64_t>::min();
  while (record.Next(*entry)) {
    frames.insert(frames.end(), entry->received.begin(),
                  entry->received.begin() + static_cast<std::ptrdiff_t>(entry->received_count));
    for (const CanFrame& frame : SentFrames(*entry)) {
      frames.push_back({frame, entry->notes.send_ns});
    }
    write_before(awake_before_ns);
    awake_before_ns = entry->notes.awake_ns;
  }
  write_before(std::numeric_limits<std::int64_t>::max());
  if (std::fflush(file.get()) != 0) fail();
  pending.Commit();
  return count;
}

std::int64_t ExportTelemetry(FlightRecord& record, const std::string& csv_path,
                             const std::string& lcm_path) {
  const RecordConfiguration& configuration = record.configuration();
  TelemetryConfig config;
  config.trace_file = csv_path;
  config.log_file = lcm_path;
  config.whole_files = true;
  config.run = DescribeRun(configuration);
  config.utime_at_zero_us = configuration.utime_at_zero_us;
  Telemetry telemetry(config);
  TimedRecords timed(configuration);
  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  while (record.Next(*entry)) {
    telemetry.Push(timed.Next(*entry));
    telemetry.Drain();
  }
  telemetry.Stop();
  return telemetry.written();
}

std::int64_t ExportTruth(FlightRecord& record, const std::string& csv_path) {
  // Joints without a motor, of which the record's configuration does not know, come after the
  // others in every state.
  std::vector<std::string> joints = record.configuration().joints;
  std::string rows;
  std::int64_t count = 0;
  space_truth_t state;
  std::optional<TruthKind> kind;
  const auto take = [&] {
    for (const auto& bytes : record.truths()) {
      if (!ReadMessage(bytes, state) || (kind && KindOf(state) != *kind)) {
        throw RecordError(fmt::format("{}: the true state of the robot in it is of another version",
                                      record.name()));
      }
      kind = KindOf(state);
      for (const joint_truth_t& joint : state.truth.joints) {
        if (count == 0 && std::ranges::find(joints, joint.name) == joints.end())
          joints.push_back(joint.name);
      }
      AppendTruthCsvRow(state, joints, rows);
      ++count;
    }
  };
  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  while (record.Next(*entry)) take();
  take();
  if (count == 0) {
    throw RecordError(fmt::format(
        "{}: has no true states of the robot; only `tumbler run sim --record` records them",
        record.name()));
  }
  WriteResult(csv_path, TruthCsvHeader(joints, *kind) + '\n' + rows);
  return count;
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
