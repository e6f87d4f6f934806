// tumbler replay: repeats a recorded run, at a desk or on a bus.

#include <fmt/format.h>

#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/temporary_folder.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/candump.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/recorded_assembly.h"
#include "runtime/record/replay.h"
#include "runtime/record/run_trace.h"
#include "runtime/record/trace_drawing.h"
#include "runtime/record/tracking.h"
#include "runtime/run/record_play.h"
#include "runtime/run/run_options.h"
#include "runtime/run/run_summary.h"

namespace tumbler {
namespace {

constexpr const char* kReplayFooter =
    R"(RECORD is a flight record of tumbler run, or a log of `candump -l`.

Of a record, without --bus or --against: feeds the recorded inputs to an executor with the recorded configuration, and
compares every frame and every field that comes out. A record that was cut off is replayed up to there.

--bus BUS plays the record's setpoints on a SocketCAN interface, at their times: the recorded motion on the drives
there, from where their joints are, with the operator's recorded wishes. Replies are compared with the recorded ones.
Without --arm nothing is sent: the frames are printed in the format of `candump -l`. It is armed as tumbler run is:
drives, settings of safety and the pose are those of now. A setting that was milder in the recorded run is refused
until an option says which is to hold; a stricter one holds.

Of a log, --drives says which drives sent and were sent its frames; it prints how they followed. A log of several
interfaces takes --interface.

Exit codes:
  0    identical; played, with the recorded setpoints; a log was read
  1    wrong usage, or a file or interface that cannot be used
  2    the play was refused
  3    the play was ended by a fault
  4    a tick differs, is damaged or was not recorded; other setpoints than the recorded ones were played
  130  the play was stopped by Ctrl-C)";

struct Options {
  std::string record;
  std::string against;
  std::string svg;
  std::string primitive;  ///< Played in place of the recorded motion.
  std::string interface;  ///< Of a log: the one whose frames are read.
  RunOptions run;         ///< Of a play on a bus; its drives file is also that of a log.
  std::function<bool(const std::string&)> given;
};

/// Reads a record on to its end, and says what it lacks.
/// @returns whether every tick of the run up to the end of the file could be read.
bool PrintWhatIsMissing(FlightRecord& record, std::FILE* out) {
  const auto entry = std::make_unique<TickEntry>();
  while (record.Next(*entry)) {
  }
  const bool whole = record.damages().empty() && record.lost().empty();
  if (!whole || record.cut_off() || !record.end()) {
    for (const std::string& remark : record.Remarks()) {
      fmt::print(out, "{}\n", Printable(fmt::format("{}: {}", record.name(), remark)));
    }
  }
  return whole;
}

ExitStatus ReplayOffline(FlightRecord& record) {
  const ReplayResult result = Replay(record);
  const std::string compared = fmt::format("{} ticks, {} frames in, {} frames out", result.ticks,
                                           result.frames_in, result.frames_out);
  if (result.difference) {
    const ReplayDifference& d = *result.difference;
    fmt::print("different at tick {} (byte {} of the record): {}: recorded {}, replayed {}\n",
               d.tick, record.tick_offset(), d.field, d.recorded, d.replayed);
    fmt::print("identical before: {}\n", compared);
  } else if (!result.gap.empty()) {
    fmt::print("cannot be replayed further: {}\nidentical before: {}\n", result.gap, compared);
  } else {
    fmt::print("identical: {}\n", compared);
    PrintWhatIsMissing(record, stdout);
  }
  return result.identical() ? ExitStatus::kDone : ExitStatus::kAmiss;
}

/// Prints a comparison of two runs. @returns whether their setpoints are the same.
bool PrintComparison(const RunTrace& recorded, const RunTrace& played, const Options& options,
                     std::FILE* out) {
  fmt::print(out, "{}{}{}", Describe(recorded), Describe(played),
             DescribeDifference(recorded, played));
  if (!options.svg.empty()) {
    WriteSvg(recorded, &played, options.svg);
    fmt::print(out, "wrote {}\n", options.svg);
  }
  bool same = recorded.joints == played.joints;
  for (std::size_t i = 0; same && i < recorded.joints.size(); ++i) {
    const TraceComparison c = Compare(recorded.samples[i], played.samples[i]);
    same = c.ticks > 0 && c.different_setpoints == 0;
  }
  return same;
}

RunTrace LoadTrace(FlightRecord& record) {
  const Assembly assembly = Assemble(record.configuration());
  return TraceOf(record, assembly.parts().drives);
}

ExitStatus CompareRecords(FlightRecord& record, const Options& options) {
  const MappedFile file(options.against);
  FlightRecord other(file.bytes(), options.against);
  const RunTrace played = LoadTrace(other);
  const bool same = PrintComparison(LoadTrace(record), played, options, stdout);
  // What cannot be read is not the same, and not another one either.
  const bool whole = PrintWhatIsMissing(record, stdout);
  const bool other_whole = PrintWhatIsMissing(other, stdout);
  return same && whole && other_whole ? ExitStatus::kDone : ExitStatus::kAmiss;
}

ExitStatus ReadLog(std::string_view text, const Options& options) {
  if (options.run.drives.empty()) {
    throw std::runtime_error(fmt::format(
        "{}: is not a flight record; of a candump log, say with --drives which drives are in it",
        options.record));
  }
  if (!options.run.bus.empty() || !options.against.empty()) {
    throw std::runtime_error(
        fmt::format("{}: a log has no motion and no limits that frames could be held to; play it "
                    "with `canplayer`, or name a flight record",
                    options.record));
  }
  std::int64_t skipped = 0;
  const std::vector<CandumpFrame> frames = FramesOfInterface(
      ParseCandump(text, options.record, skipped), options.record, options.interface);
  const RunTrace trace = TraceOf(frames, LoadDrives(options.run.drives), options.record);
  fmt::print("{} frames, {} more of CAN FD or errors\n{}", frames.size(), skipped, Describe(trace));
  if (!options.svg.empty()) {
    WriteSvg(trace, nullptr, options.svg);
    fmt::print("wrote {}\n", options.svg);
  }
  return ExitStatus::kDone;
}

ExitStatus PlayOnBus(FlightRecord& record, const Options& options) {
  const RunTrace recorded = LoadTrace(record);
  PrintWhatIsMissing(record, stderr);
  if (recorded.samples.empty() || recorded.samples[0].empty()) {
    throw std::runtime_error(fmt::format("{}: nothing was played in this run", options.record));
  }
  const bool whole = record.damages().empty() && record.lost().empty();
  if (!whole && options.run.arm) {
    throw Refused(fmt::format(
        "{}: ticks of it are missing, and with them perhaps requests to stop; play a record that "
        "is whole",
        options.record));
  }
  RecordToPlay to_play{
      options.record, record.configuration(), {}, options.primitive, options.given};
  if (options.primitive.empty()) to_play.wishes = WishesOf(record);
  const TemporaryFolder scratch;  // for a record that nobody asked for
  RunOptions run = options.run;
  if (run.record.empty()) run.record = (scratch.path() / "played").string();
  const std::optional<RunSummary> summary = PlayRecord(to_play, run);
  if (!summary) return ExitStatus::kInterrupted;
  const RunSummary& played = *summary;

  // Standard output is kept free for the frames of a dry run.
  std::FILE* out = run.arm ? stdout : stderr;
  fmt::print(out, "{} on {}{}{}{}\n", ToString(played.outcome), run.bus,
             run.arm ? "" : " (dry run: the replies are those of imagined drives)",
             played.reason.empty() ? "" : ": ", played.reason);
  if (played.outcome == RunOutcome::kRefused) return ExitStatus::kRefused;
  for (const std::string& problem : played.unwritten) fmt::print(stderr, "{}\n", problem);
  if (!played.record_problem.empty()) fmt::print(stderr, "{}\n", played.record_problem);
  const MappedFile file(run.record);
  FlightRecord again(file.bytes(), options.run.record.empty() ? "played" : run.record);
  const RunTrace trace = LoadTrace(again);
  const bool same = PrintComparison(recorded, trace, options, out);
  switch (played.outcome) {
    case RunOutcome::kRefused:
    case RunOutcome::kPending:
    case RunOutcome::kFault:
      return ExitStatus::kFault;
    case RunOutcome::kStopped:
      // The stop was recorded, or somebody stops it now.
      return same && !to_play.wishes.empty() ? ExitStatus::kDone : ExitStatus::kInterrupted;
    case RunOutcome::kCompleted:
      break;
  }
  if (!whole || !played.unwritten.empty() || !played.record_problem.empty())
    return ExitStatus::kAmiss;
  return same || !options.primitive.empty() ? ExitStatus::kDone : ExitStatus::kAmiss;
}

ExitStatus Run(const Options& options) {
  CheckDistinct({options.record, options.against, options.run.drives, options.primitive,
                 options.run.faults, options.run.answers},
                {options.svg, options.run.record, options.run.pose_file});
  const MappedFile file(options.record);
  if (StartOf(file.bytes()) == RecordStart::kNotARecord) {
    return ReadLog({reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size()},
                   options);
  }
  if (!options.interface.empty()) {
    throw UsageError("--interface", "is of a log of candump; a record has one bus");
  }
  FlightRecord record(file.bytes(), options.record);
  if (!options.against.empty() && !options.run.drives.empty()) {
    throw UsageError("--drives",
                     "has no use with --against: both records hold their own; leave it out");
  }
  if (!options.against.empty()) return CompareRecords(record, options);
  if (!options.run.bus.empty()) return PlayOnBus(record, options);
  for (const std::string* option : {&options.primitive, &options.run.drives, &options.svg}) {
    if (!option->empty()) {
      throw std::runtime_error(
          fmt::format("'{}': of a record, this takes --bus or --against", *option));
    }
  }
  return ReplayOffline(record);
}

ExitStatus Main(int argc, char** argv) {
  Options options;
  CommandLine line("Replays a flight record of tumbler run.", "tumbler replay");
  line.SetFooter(kReplayFooter);
  line.Option("RECORD", options.record, "flight record, or log of candump").Required();
  CommandLineOption against =
      line.Option("--against", options.against,
                  "compare setpoints and replies with those of this other record");
  const CommandLineOption bus =
      line.Option("--bus", options.run.bus, "play on this SocketCAN interface");
  against.Excludes(bus);
  line.Option(
      "--drives", options.run.drives,
      "drives file: of a log, or of the bus; a dry run takes that of the record without it");
  line.Option("--interface", options.interface,
              "of a log of several interfaces: that of the drives, such as can0");
  line.Option("--motion", options.primitive, "play this primitive instead of the recorded")
      .Needs(bus);
  line.Option("--record", options.run.record, "keep the record of the play in this file")
      .Needs(bus);
  line.Option("--svg", options.svg, "draw setpoints, replies and errors into this file");
  ArmingNames names;
  DeclareArming(line, options.run, names, &bus);
  line.Parse(argc, argv);
  TakeArming(line, names, options.run);
  options.run.program = "tumbler replay";
  options.run.command_line.assign(argv, argv + argc);
  if (options.run.simulated()) {
    throw UsageError("--bus", "is sim; a record is played on a SocketCAN interface, such as can0");
  }
  options.given = [&line](const std::string& option) { return line.Given(option); };
  return Run(options);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler replay", argc, argv, tumbler::Main);
}
