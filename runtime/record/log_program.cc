#include "runtime/record/log_program.h"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <tumbler/event_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>
#include <vector>

#include "common/files/printable.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "runtime/executor/faults.h"
#include "runtime/record/channels.h"
#include "runtime/record/flight_recorder.h"
#include "runtime/record/lcm_log.h"
#include "runtime/record/live_view.h"
#include "runtime/record/log_mcap.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/state_csv.h"

namespace tumbler {
namespace {

struct CloseTable {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};
using TableFile = std::unique_ptr<std::FILE, CloseTable>;

struct LogContents {
  std::int64_t states = 0;
  std::int64_t missing = 0;
  std::int64_t damaged = 0;  ///< Messages on our channels that are not of our types.
  std::int64_t foreign = 0;  ///< Messages on channels that are not ours.
  LogReading reading;
  LiveView view;
};

template <typename Message>
std::optional<Message> Decode(const lcm::LogEvent& event) {
  return ReadMessage<Message>(event.data, static_cast<std::size_t>(event.datalen));
}

/// Reads a whole log. Where wanted, rows of the table go to `table`, and events to standard output.
/// @param csv  the table's name for messages.
LogContents ReadLog(const std::string& path, std::FILE* table, const std::string& csv,
                    bool events) {
  LogContents contents;
  std::string row;
  std::vector<state_t> waiting;  // rows that wait until the names of the joints are known
  bool header = false;
  const auto write = [&](const std::string& text) {
    if (std::fwrite(text.data(), 1, text.size(), table) != text.size())
      throw std::runtime_error(fmt::format("{}: could not be written whole", csv));
  };
  const auto flush = [&](bool at_end) {
    if (table == nullptr) return;
    if (!header) {
      std::vector<std::string> names;
      if (contents.view.run()) {
        names = contents.view.run()->joints;
      } else if (at_end && !waiting.empty()) {
        for (std::size_t i = 0; i < waiting[0].joints.size(); ++i)
          names.push_back(fmt::format("joint{}", i + 1));
      } else if (!at_end) {
        return;
      }
      write(StateCsvHeader(names) + '\n');
      header = true;
    }
    row.clear();
    for (const state_t& state : waiting) AppendStateCsvRow(state, row);
    write(row);
    waiting.clear();
  };
  contents.reading = ForEachLogEvent(path, [&](const lcm::LogEvent& event) {
    if (event.channel == kStateChannel) {
      const std::optional<state_t> state = Decode<state_t>(event);
      if (!state) {
        ++contents.damaged;
        return;
      }
      if (contents.states == 0) contents.missing = state->number;  // All before the first one are.
      ++contents.states;
      contents.view.Take(*state);
      if (table != nullptr) waiting.push_back(*state);
      flush(false);
    } else if (event.channel == kRunChannel) {
      const std::optional<run_t> run = Decode<run_t>(event);
      if (run) contents.view.Take(*run);
      contents.damaged += run ? 0 : 1;
    } else if (event.channel == kEventChannel) {
      const std::optional<event_t> happened = Decode<event_t>(event);
      contents.damaged += happened ? 0 : 1;
      if (happened && events) {
        fmt::print("{:10.3f} s  tick {:8}  {} -> {}{}{}\n",
                   static_cast<double>(happened->time_ns) * 1e-9, happened->tick,
                   PrintableInLine(happened->from_state), PrintableInLine(happened->to_state),
                   happened->text.empty() ? "" : ": ", PrintableInLine(happened->text));
      }
    } else if (event.channel != kTruthChannel) {
      ++contents.foreign;
    }
  });
  flush(true);
  contents.missing += contents.view.lost();
  return contents;
}

/// @param quiet  whether events and the last state are not printed, even without a table.
ExitStatus Convert(const std::string& path, const std::string& csv, bool quiet) {
  std::optional<PendingName> pending;
  TableFile table;
  std::FILE* out = nullptr;
  if (csv == "-") {
    out = stdout;
  } else if (!csv.empty()) {
    table.reset(std::fopen(pending.emplace(csv).to_open().c_str(), "w"));
    if (table == nullptr) {
      throw std::runtime_error(
          fmt::format("{}: cannot be written: {}", csv, std::generic_category().message(errno)));
    }
    out = table.get();
  }
  LogContents contents = ReadLog(path, out, csv, csv.empty() && !quiet);
  if (contents.states == 0) {
    throw std::runtime_error(
        fmt::format("{}: has no message of tumbler run on channel {}", path, kStateChannel));
  }
  if (out != nullptr && std::fflush(out) != 0)
    throw std::runtime_error(fmt::format("{}: could not be written whole", csv));
  if (pending) pending->Commit();
  std::FILE* text = csv == "-" ? stderr : stdout;
  if (csv.empty() && !quiet)
    fmt::print(text, "\nat the end:\n{}\n", Printable(contents.view.Screen()));
  const std::int64_t unrecorded = contents.view.run() ? contents.view.run()->lost_records : 0;
  fmt::print(
      text, "{} ticks; {} missing ({} of them never recorded); {} messages damaged, {} of others\n",
      contents.states, contents.missing, unrecorded, contents.damaged, contents.foreign);
  const LogReading& reading = contents.reading;
  if (reading.lost_bytes > 0) {
    fmt::print(stderr, "{}: NOT whole: {} bytes are in no whole event, the first at byte {}\n",
               path, reading.lost_bytes, reading.first_lost);
  }
  if (!csv.empty() && csv != "-") fmt::print(text, "wrote {}\n", csv);
  return contents.missing + contents.damaged + reading.lost_bytes > 0 ? ExitStatus::kAmiss
                                                                      : ExitStatus::kDone;
}

/// Writes the log as MCAP. It is known to be one, with ticks.
void ConvertToMcap(const LogExports& options, const PictureSource* pictures) {
  LogMcapConfig config;
  config.log = options.log;
  config.mcap = options.mcap;
  if (!options.motion.empty()) {
    config.robot_of = [&](const std::vector<std::string>& joints) {
      return pictures->robot_of(LoadMotion(options.motion), joints);
    };
  }
  ExportLogMcap(config);
  fmt::print(options.csv == "-" ? stderr : stdout, "wrote {}\n", options.mcap);
}

}  // namespace

ExitStatus ShowLog(const LogExports& options, const PictureSource* pictures) {
  CheckDistinct({options.log, options.motion}, {options.csv, options.mcap});
  KeepRecords(std::array{options.csv, options.mcap});
  const ExitStatus status = Convert(options.log, options.csv, !options.mcap.empty());
  if (!options.mcap.empty()) ConvertToMcap(options, pictures);
  return status;
}

}  // namespace tumbler
