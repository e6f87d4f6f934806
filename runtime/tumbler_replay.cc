// tumbler-replay: repeats a recorded run, at a desk or on a bus.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/command_line.h"
#include "common/program.h"
#include "runtime/assembly/run_checks.h"
#include "runtime/linux/candump.h"
#include "runtime/linux/interrupts.h"
#include "runtime/linux/realtime_thread.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/flight_recorder.h"
#include "runtime/record/replay.h"
#include "runtime/record/run_trace.h"
#include "runtime/run/control_loop.h"
#include "runtime/run/interface_world.h"
#include "runtime/run/run_summary.h"
#include "runtime/telemetry/telemetry.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(RECORD is a flight record of tumbler-run, or a log of `candump -l`.

Of a record, without --bus or --against: feeds the recorded inputs to an executor with the recorded configuration, and
compares every frame and every field that comes out. A record that was cut off is replayed up to there.

--bus BUS plays the record's setpoints on a SocketCAN interface, at their times: the recorded configuration on the
drives there, from where their joints are, with the operator's recorded wishes. Replies are compared with the
recorded ones. Without --arm nothing is sent: the frames are printed in the format of `candump -l`.

Of a log, --drives says which drives sent and were sent its frames; it prints how they followed.

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
  std::string bus;
  std::string primitive;
  std::string drives;
  std::string svg;
  std::string record_to;
  bool arm = false;
  bool realtime = false;
  bool without_realtime = false;
};

ExitStatus ReplayOffline(FlightRecord& record) {
  const ReplayResult report = Replay(record);
  const std::string compared = fmt::format("{} ticks, {} frames in, {} frames out", report.ticks,
                                           report.frames_in, report.frames_out);
  if (report.difference) {
    const ReplayDifference& d = *report.difference;
    fmt::print("different at tick {} (byte {} of the record): {}: recorded {}, replayed {}\n",
               d.tick, record.tick_offset(), d.field, d.recorded, d.replayed);
    fmt::print("identical before: {}\n", compared);
  } else if (!report.gap.empty()) {
    fmt::print("cannot be replayed further: {}\nidentical before: {}\n", report.gap, compared);
  } else {
    fmt::print("identical: {}\n", compared);
    if (record.cut_off() || !record.end()) {
      for (const std::string& remark : record.Remarks()) fmt::print("{}\n", remark);
    }
  }
  return report.identical() ? ExitStatus::kDone : ExitStatus::kAmiss;
}

/// Prints how two runs compare. @returns whether their setpoints are the same.
bool ReportComparison(const RunTrace& recorded, const RunTrace& played, const Options& options,
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
  const ConfiguredExecutor configured(record.configuration());
  return TraceOf(record, configured.drives());
}

ExitStatus CompareRecords(FlightRecord& record, const Options& options) {
  const MappedFile file(options.against);
  FlightRecord other(file.bytes(), options.against);
  const RunTrace played = LoadTrace(other);
  const bool same = ReportComparison(LoadTrace(record), played, options, stdout);
  return same ? ExitStatus::kDone : ExitStatus::kAmiss;
}

ExitStatus ReadLog(std::string_view text, const Options& options) {
  if (options.drives.empty()) {
    throw std::runtime_error(fmt::format(
        "{}: is not a flight record; of a candump log, say with --drives which drives are in it",
        options.record));
  }
  if (!options.bus.empty() || !options.against.empty()) {
    throw std::runtime_error(
        fmt::format("{}: a log has no motion and no limits that frames could be held to; play it "
                    "with `canplayer`, or name a flight record",
                    options.record));
  }
  std::int64_t skipped = 0;
  const std::vector<CandumpFrame> frames = ParseCandump(text, options.record, skipped);
  const RunTrace trace = TraceOf(frames, LoadDrives(options.drives), options.record);
  fmt::print("{} frames, {} more of CAN FD or errors\n{}", frames.size(), skipped, Describe(trace));
  if (!options.svg.empty()) {
    WriteSvg(trace, nullptr, options.svg);
    fmt::print("wrote {}\n", options.svg);
  }
  return ExitStatus::kDone;
}

/// A wish of the operator while the motion was played, with its tick since the motion's first.
struct RecordedWish {
  std::int64_t offset = 0;
  OperatorWish wish;
};

/// The operator's request that leads to a command; kNone for commands that the run procedure gives
/// by itself.
OperatorRequest RequestOf(OperatorCommand command) {
  switch (command) {
    case OperatorCommand::kFinish:
      return OperatorRequest::kFinish;
    case OperatorCommand::kStop:
      return OperatorRequest::kStop;
    case OperatorCommand::kDisarm:
      return OperatorRequest::kDisarm;
    case OperatorCommand::kBranch:
      return OperatorRequest::kBranch;
    default:
      return OperatorRequest::kNone;
  }
}

std::vector<RecordedWish> WishesOf(FlightRecord& record) {
  std::vector<RecordedWish> wishes;
  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  std::optional<std::int64_t> first_tick;
  ExecutorState before = ExecutorState::kDisarmed;
  while (record.Next(*entry)) {
    const bool in_motion = before == ExecutorState::kRunning || before == ExecutorState::kSettling;
    before = entry->record.state;
    if (!first_tick && before == ExecutorState::kRunning) first_tick = entry->tick;
    if (!first_tick || !in_motion) continue;
    const OperatorRequest request = RequestOf(entry->command);
    if (request == OperatorRequest::kNone) continue;
    RecordedWish& recorded = wishes.emplace_back();
    recorded.offset = entry->tick - *first_tick;
    recorded.wish.request = request;
    recorded.wish.branch = entry->branch;
  }
  return wishes;
}

/// The record's configuration, with the changes of the command line.
RecordConfiguration ConfigurationToPlay(const RecordConfiguration& recorded,
                                        const Options& options) {
  RecordConfiguration configuration = recorded;
  configuration.procedure.attended = false;  // One run, which starts by itself.
  FileKeeper keeper;
  const FileReader read = keeper.reader();
  if (!options.primitive.empty()) {
    const SequenceFile motion = LoadMotion(options.primitive, read);
    if (motion.graph.edge_count > 0) {
      throw std::runtime_error(
          fmt::format("{}: is a sequence; --primitive takes a primitive", options.primitive));
    }
    configuration.motion_file = options.primitive;
    configuration.executor.cycles = 0;
    configuration.executor.branch = -1;
  }
  if (options.drives.empty() && configuration.drives_file.empty()) {
    throw std::runtime_error(
        "the record is of a simulation without a drives file: say with --drives which drives are "
        "on the bus");
  }
  if (!options.drives.empty()) {
    const DrivesConfig drives = DrivesOf(ParseDrives(read(options.drives), options.drives),
                                         configuration.joints, options.drives);
    if (std::llround(1e9 / drives.rate_hz) != configuration.period_ns) {
      throw std::runtime_error(fmt::format(
          "{}: rate_hz is {:.6g}, but the record's is {:.6g}: its setpoints belong to its ticks",
          options.drives, drives.rate_hz, 1e9 / static_cast<double>(configuration.period_ns)));
    }
    configuration.drives_file = options.drives;
    for (std::size_t i = 0; i < drives.drives.size(); ++i) {
      const DriveEntry& entry = drives.drives[i];
      configuration.executor.joints[i] = {entry.kp_nm_per_rad, entry.kd_nm_s_per_rad,
                                          entry.kd_nm_s_per_rad, entry.temperature_max_c};
    }
  }
  // A file that the command line names replaces the one that was recorded under that name.
  for (const RecordedFile& file : keeper.files()) {
    std::erase_if(configuration.files,
                  [&file](const RecordedFile& other) { return other.path == file.path; });
    configuration.files.push_back(file);
  }
  return configuration;
}

/// A file for a record that nobody asked for. It is removed at the end.
class ScratchFile {
 public:
  ScratchFile() {
    std::string name = (std::filesystem::temp_directory_path() / "tumbler-replay-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw std::runtime_error(fmt::format("{}: no folder can be made here", name));
    }
    folder_ = name;
  }
  ~ScratchFile() {
    std::error_code error;
    std::filesystem::remove_all(folder_, error);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  [[nodiscard]] std::string path() const { return (folder_ / "played").string(); }

 private:
  std::filesystem::path folder_;
};

struct Played {
  RunOutcome outcome = RunOutcome::kPending;
  std::string reason;
};

/// Runs the configuration on the bus and records it.
Played Play(const RecordConfiguration& configuration, const std::vector<RecordedWish>& wishes,
            const Options& options, const std::string& record_file) {
  ConfiguredExecutor configured(configuration);
  CheckRanges(configured.motions(), configured.drives());
  CheckSchedule(configured.drives());
  std::vector<double> start_rad;
  const SequenceGraph<float>& graph = configured.motions().graph;
  for (int i = 0; i < configured.executor().joint_count(); ++i) {
    const auto role = static_cast<std::size_t>(graph.RoleOf(graph.start, i));
    const auto& motion = configured.motions().PrimitiveOf(graph.start).joints[role];
    start_rad.push_back(double{motion.position.control_points()[0]});
  }
  const InterfaceName name{options.bus, configuration.drives_file};
  const std::unique_ptr<World> world = options.arm
                                           ? MakeInterfaceWorld(name, configured.drives())
                                           : MakeDryRunWorld(name, configured.drives(), start_rad);
  Clock& clock = world->clock();

  RecordConfiguration of_play = configuration;
  of_play.program = "tumbler-replay " TUMBLER_VERSION;
  of_play.kernel = DescribeKernel();
  of_play.machine = DescribeMachine(options.arm ? options.bus : "");
  of_play.bus = options.bus;
  of_play.dry_run = !options.arm;
  of_play.virtual_time = !world->real_time();
  of_play.utime_at_zero_us = 0;
  if (world->real_time()) {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    of_play.utime_at_zero_us =
        std::chrono::duration_cast<std::chrono::microseconds>(now).count() - clock.now_ns() / 1000;
  }
  std::signal(SIGXFSZ, SIG_IGN);  // A limit on the size of files ends the recording only.
  FlightRecorder recorder(
      {record_file, EncodeConfiguration(of_play), std::size_t{4} << 20U,
       [](const std::string& text) { fmt::print(stderr, "tumbler-replay: {}\n", text); }});
  if (world->real_time()) recorder.Start();  // Its thread must not inherit SCHED_FIFO.
  CatchInterrupts();
  if (options.arm) {
    if (!options.realtime && !options.without_realtime) {
      throw Refused("driving motors takes --realtime (or --without-realtime, and late ticks)");
    }
    if (options.realtime) {
      RealtimeConfig scheduling;
      scheduling.period_ns = configuration.period_ns;
      const RealtimeGrant report = EnterRealtime(scheduling);
      if (!report.in_force() && !options.without_realtime) throw Refused(report.problems);
    }
  }

  RunProcedure procedure(configuration.procedure);
  const std::int64_t start_ns = world->real_time() ? clock.now_ns() + configuration.period_ns : 0;
  ControlLoop loop({configured.executor(), world->bus(), clock, procedure, InterruptMailbox(),
                    nullptr, &recorder},
                   configuration.period_ns, start_ns);
  std::optional<std::int64_t> first_tick;
  auto wish = wishes.begin();
  while (loop.Step()) {
    const TickRecord& record = loop.record();
    if (!first_tick && record.state == ExecutorState::kRunning) first_tick = record.tick;
    if (first_tick && wish != wishes.end() && record.tick + 1 >= *first_tick + wish->offset) {
      InterruptMailbox().Put(wish->wish);
      ++wish;
    }
    if (!world->real_time()) recorder.Drain();
  }
  recorder.Stop(ToString(procedure.outcome()));
  RunSummary ignored;
  world->Summarize(ignored);  // This discards frames that are still to be sent.

  Played played{procedure.outcome(), {}};
  if (loop.record().first_fault.fault != Fault::kNone) {
    played.reason = Describe(loop.record().first_fault, configuration.joints);
  } else if (played.outcome == RunOutcome::kRefused) {
    played.reason = Describe(procedure.refusal(), configuration.joints);
  }
  return played;
}

ExitStatus PlayOnBus(FlightRecord& record, const Options& options) {
  const RecordConfiguration configuration = ConfigurationToPlay(record.configuration(), options);
  const RunTrace recorded = LoadTrace(record);
  if (recorded.samples.empty() || recorded.samples[0].empty()) {
    throw std::runtime_error(fmt::format("{}: nothing was played in this run", options.record));
  }
  std::vector<RecordedWish> wishes;
  if (options.primitive.empty()) wishes = WishesOf(record);
  const ScratchFile scratch;
  const std::string file_name = options.record_to.empty() ? scratch.path() : options.record_to;
  const Played played = Play(configuration, wishes, options, file_name);

  // Standard output belongs to the frames of a dry run.
  std::FILE* out = options.arm ? stdout : stderr;
  fmt::print(out, "{} on {}{}{}{}\n", ToString(played.outcome), options.bus,
             options.arm ? "" : " (dry run: the replies are those of imagined drives)",
             played.reason.empty() ? "" : ": ", played.reason);
  const MappedFile file(file_name);
  FlightRecord again(file.bytes(), options.record_to.empty() ? "played" : options.record_to);
  const RunTrace trace = LoadTrace(again);
  const bool same = ReportComparison(recorded, trace, options, out);
  switch (played.outcome) {
    case RunOutcome::kRefused:
      return ExitStatus::kRefused;
    case RunOutcome::kPending:
    case RunOutcome::kFault:
      return ExitStatus::kFault;
    case RunOutcome::kStopped:
      // The stop was recorded, or somebody stops it now.
      return same && !wishes.empty() ? ExitStatus::kDone : ExitStatus::kInterrupted;
    case RunOutcome::kCompleted:
      break;
  }
  return same || !options.primitive.empty() ? ExitStatus::kDone : ExitStatus::kAmiss;
}

ExitStatus Run(const Options& options) {
  const MappedFile file(options.record);
  if (StartOf(file.bytes()) == RecordStart::kNotARecord) {
    return ReadLog({reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size()},
                   options);
  }
  FlightRecord record(file.bytes(), options.record);
  if (!options.against.empty()) return CompareRecords(record, options);
  if (!options.bus.empty()) return PlayOnBus(record, options);
  for (const std::string* option : {&options.primitive, &options.drives, &options.svg}) {
    if (!option->empty()) {
      throw std::runtime_error(
          fmt::format("'{}': of a record, this takes --bus or --against", *option));
    }
  }
  return ReplayOffline(record);
}

ExitStatus Main(int argc, char** argv) {
  Options options;
  CommandLine line("Replays a flight record of tumbler-run.", "tumbler-replay");
  line.SetFooter(kFooter);
  line.Option("RECORD", options.record, "flight record, or log of candump").Required();
  CommandLineOption against =
      line.Option("--against", options.against,
                  "compare setpoints and replies with those of this other record");
  const CommandLineOption bus =
      line.Option("--bus", options.bus, "play on this SocketCAN interface");
  against.Excludes(bus);
  line.Flag("--arm", options.arm, "drive the motors; without it this is a dry run").Needs(bus);
  line.Flag("--realtime", options.realtime, "SCHED_FIFO and locked memory").Needs(bus);
  line.Flag("--without-realtime", options.without_realtime, "arm even though they are not in force")
      .Needs(bus);
  line.Option("--primitive", options.primitive, "play this primitive instead of the recorded")
      .Needs(bus);
  line.Option("--record", options.record_to, "keep the record of the play in this file").Needs(bus);
  line.Option("--drives", options.drives,
              "drives file: of a log, or of the bus where it is not that of the record");
  line.Option("--svg", options.svg, "draw setpoints, replies and errors into this file");
  line.Parse(argc, argv);
  return Run(options);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler-replay", argc, argv, tumbler::Main);
}
