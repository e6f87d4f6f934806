#include "runtime/run/run_program.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "firmware_interface/can/can_link.h"
#include "runtime/assembly/assembly.h"
#include "runtime/assembly/clock.h"
#include "runtime/assembly/doctor.h"
#include "runtime/assembly/file_keeper.h"
#include "runtime/assembly/interrupts.h"
#include "runtime/assembly/operator_voice.h"
#include "runtime/assembly/realtime_thread.h"
#include "runtime/assembly/run_checks.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/bench/arming_checks.h"
#include "runtime/record/lcm_commands.h"
#include "runtime/record/record_configuration.h"
#include "runtime/record/record_mcap.h"
#include "runtime/record/request_key.h"
#include "runtime/record/run_description.h"
#include "runtime/record/telemetry.h"
#include "runtime/run/hold_notice.h"
#include "runtime/run/interface_world.h"
#include "runtime/run/known_pose.h"
#include "runtime/run/play.h"
#include "runtime/run/repeated_settings.h"
#include "runtime/run/run_options.h"
#include "runtime/run/run_summary.h"

namespace tumbler {
namespace {

/// Says what machine and interface lack.
ExitStatus Examine(const RunOptions& options) {
  const std::vector<HostFinding> findings = Diagnose(GatherHostFacts(options.doctor));
  fmt::print("{}", Describe(findings));
  const bool missing = std::any_of(
      findings.begin(), findings.end(),
      [](const HostFinding& finding) { return finding.level == HostFinding::Level::kMissing; });
  return missing ? ExitStatus::kRefused : ExitStatus::kDone;
}

/// Measures how late this machine wakes a loop that does nothing else.
ExitStatus TestLatency(const RunOptions& options) {
  const auto period_ns = static_cast<std::int64_t>(std::llround(1e9 / options.rate_hz));
  const RealtimeGrant realtime = options.without_realtime
                                     ? RealtimeGrant{true, true, "time-shared", ""}
                                     : EnterRealtime(options.SchedulingAt(period_ns));
  if (!realtime.problems.empty()) fmt::print(stderr, "warning: {}\n", realtime.problems);
  CatchInterrupts();
  MonotonicClock clock;
  const LoopStatistics statistics = MeasureWakeUps(
      clock, InterruptMailbox(), period_ns,
      static_cast<std::int64_t>(std::ceil(options.latency_test_s * options.rate_hz)));
  const Machine machine = DescribeMachine("");
  if (!options.json.empty())
    WriteResult(options.json, TimingToJson(statistics, machine, realtime.scheduling));
  std::FILE* out = options.json == "-" ? stderr : stdout;
  fmt::print(out,
             "{} wake-ups at {:.6g} Hz, {} late by more than half a period, {} periods missed\n{}",
             statistics.ticks, options.rate_hz, statistics.late_ticks, statistics.missed_ticks,
             DescribeTiming(statistics, machine, realtime.scheduling));
  return ExitStatus::kDone;
}

/// Tells how slow the drives' own loops may be for their damping.
void TellDamping(const RunOptions& options, const Simulation& simulation, const RunParts& parts) {
  SimulatedWorldConfig config;
  config.twin_file = options.twin;
  try {
    for (const std::string& note : simulation.damping_notes(
             parts.file, parts.drives, options.simulated() ? &config : nullptr))
      fmt::print(stderr, "{}\n", note);
  } catch (const FileError& error) {
    // A simulation cannot do without the robot's texts, and refuses them itself.
    if (options.simulated()) return;
    fmt::print(stderr, "note: whether the drives' damping is stable is not known: {}\n",
               error.what());
  }
}

/// Says which of a file's drives the motion has no joint for: nothing enables them, and what they
/// hold is limp.
void TellUnusedDrives(const RunOptions& options, const std::vector<std::string>& joints,
                      const FileReader& read) {
  if (options.drives.empty()) return;
  std::vector<std::string> unused;
  const DrivesConfig given =
      ParseDrives(read(options.drives), options.drives, DrivesUse::kRun, read);
  for (const DriveEntry& drive : given.drives) {
    if (std::ranges::find(joints, drive.joint) == joints.end()) unused.push_back(drive.joint);
  }
  if (unused.empty()) return;
  fmt::print(stderr, "{}: note: the motion has no joint for the drives of {}, which stay off\n",
             options.drives, fmt::join(unused, ", "));
}

/// Loads motion and drives, and checks whether they fit each other and the options.
/// @param options  gets the drives file that a twin file names.
RunParts LoadParts(RunOptions& options, const Simulation* simulation, const FileReader& read,
                   const FileReader& read_drives) {
  RunParts parts = LoadRunMotion(options.motion, read);
  fmt::print(stderr, "{}", EditNotes(options.motion, parts.file.primitives));
  if (simulation != nullptr && options.drives.empty() && !options.twin.empty())
    options.drives = simulation->drives_file_of(options.twin);
  CheckOptions(options, parts.file);
  try {
    parts.drives =
        LoadDrivesOf(JointsOf(parts.file), options.drives, read_drives, GainsOf(parts.file));
  } catch (const FileError&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw Refused(fmt::format("{} of {}", error.what(), options.motion));
  }
  TellUnusedDrives(options, JointsOf(parts.file), read_drives);
  CheckRanges(*parts.sequence, parts.drives);
  CompareGains(parts.file, parts.drives, [&options](const std::string& text) {
    fmt::print(stderr, "{}: note: {}\n", options.drives, text);
  });
  CheckSchedule(parts.drives, [](const std::string& text) { fmt::print(stderr, "{}\n", text); });
  CheckWatchdogs(parts.drives, !options.drives_motors() || options.without_watchdog);
  if (simulation != nullptr) TellDamping(options, *simulation, parts);
  return parts;
}

/// The file that keeps the pose of the robot on this interface; empty: none is kept.
std::string PoseFileOf(const RunOptions& options) {
  if (!options.drives_motors() || !options.pose_file.empty()) return options.pose_file;
  CanLink link;
  const bool real = ReadCanLink(options.bus, link) == 0 && link.bit_rate != 0;
  return real ? DefaultPoseFile(options.robot, options.bus) : std::string();
}

/// Checks that no output would replace another one, or a file that the run reads.
void CheckOutputs(const RunOptions& options, const Simulation* simulation, const FileKeeper& read) {
  std::vector<std::string> inputs = {options.drives, options.faults, options.bus_faults,
                                     options.twin, options.key};
  if (simulation != nullptr && !options.twin.empty())
    inputs.push_back(simulation->robot_file_of(options.twin));
  for (const LoadedFile& file : read.files()) inputs.push_back(file.path);
  std::vector<std::string> outputs = options.files();
  outputs.insert(outputs.end(), {options.json, options.pose_file});
  CheckDistinct(inputs, outputs);
  if (!options.record.empty()) RequireNewRecord(options.record);
  KeepRecords(outputs);
  CheckResult(options.json);
}

/// The number of the branch that --branch names; -1 without one.
int BranchNumber(const RunOptions& options, const SequenceGraph<float>& graph) {
  if (options.branch.empty()) return -1;
  const int number = graph.FindBranch(options.branch);
  if (number >= 0) return number;
  const std::vector<std::string> names = BranchNames(graph);
  throw std::runtime_error(fmt::format(
      "--branch: {} has no branch '{}'; its branches: {}", options.motion, options.branch,
      names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
}

/// The node that --from names; -1 without one.
int BeginningNumber(const RunOptions& options, const SequenceGraph<float>& graph) {
  try {
    return BeginningNamed(graph, options.from);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(fmt::format("--from: {}: {}", options.motion, error.what()));
  }
}

RunSettings SettingsOf(const RunOptions& options, const RunParts& parts) {
  const SequenceGraph<float>& graph = parts.sequence->graph;
  try {
    CheckGetUps(options.get_ups, graph.beginning_count, parts.drives);
  } catch (const std::invalid_argument& error) {
    throw UsageError("--get-ups", fmt::format("{}: {}", options.motion, error.what()));
  }
  RunSettings settings;
  settings.speed = options.speed;
  settings.cycles = options.cycles;
  settings.branch = BranchNumber(options, graph);
  settings.begin = BeginningNumber(options, graph);
  settings.get_ups = options.get_ups;
  settings.hold_s = options.hold_s;
  settings.attended = options.attended;
  settings.end = options.end;
  settings.clear = options.clear;
  settings.operated = !options.virtual_time();
  settings.start_within_rad = options.start_within_rad;
  return settings;
}

/// Makes the world of the run.
/// @param feed  gets the true states of a simulated robot.
std::unique_ptr<World> MakeWorld(const RunOptions& options, const Simulation* simulation,
                                 const RunParts& parts, TickFeed& feed) {
  if (options.simulated()) {
    const bool truth_wanted =
        !(options.record + options.truth + options.mcap + options.lcm_url).empty();
    const TruthSink truth_sink = [&feed](std::span<const std::uint8_t> truth) {
      feed.PushTruth(truth);
    };
    if (simulation == nullptr) {
      throw std::runtime_error(
          "this build has no simulation (TUMBLER_BUILD_OFFLINE is OFF); name a CAN interface");
    }
    return simulation->make_world(
        parts.file, parts.drives,
        {options.twin, options.bus_faults, truth_wanted ? truth_sink : TruthSink(),
         BeginningNumber(options, parts.sequence->graph), options.realtime});
  }
  const InterfaceName name{options.bus, options.drives, options.pace};
  if (options.dry_run()) return MakeDryRunWorld(name, parts.drives, parts.StartPositions());
  return MakeInterfaceWorld(name, parts.drives);
}

RunDescription DescribeRun(const RunOptions& options, const RunParts& parts, const World& world) {
  RunDescription run = DescribeMotion(parts.sequence->graph, parts.drives);
  // Runs in virtual time write the same bytes each time, and nobody can ask them for anything.
  if (world.real_time()) {
    std::random_device random;
    run.number = static_cast<std::int64_t>(std::uint64_t{random()} << 31 | random() | 1);
    run.robot = options.robot;
  }
  run.bus = options.bus;
  run.mode = options.simulated() ? "simulated" : options.dry_run() ? "dry run" : "armed";
  run.attended = options.attended;
  run.keyed = !options.key.empty();
  run.speed = options.speed;
  run.machine = DescribeMachine(options.drives_motors() ? options.bus : "");
  return run;
}

/// @param about     the run, as its flight record has it.
/// @param pictures  of its robot; may be null.
TelemetryConfig TelemetryOf(const RunOptions& options, const RunParts& parts,
                            const RunDescription& description, const RecordConfiguration& about,
                            const PictureSource* pictures) {
  TelemetryConfig config;
  config.log_file = options.log;
  config.lcm_url = options.lcm_url;
  config.trace_file = options.trace;
  config.truth_file = options.truth;
  config.candump_file = options.candump;
  if (!options.mcap.empty()) {
    // What cannot be drawn is refused before any file is touched.
    const auto drawn =
        std::make_shared<McapPictures>(PicturesOf(about, pictures, parts, options.mcap));
    config.another = [&, drawn](const RunExportConfig& exports) {
      return std::make_unique<McapExport>(options.mcap, exports, about, options.simulated(),
                                          std::move(*drawn));
    };
  }
  config.run = description;
  config.utime_at_zero_us = about.utime_at_zero_us;
  config.replies = SampleTimesOf(parts.drives, about.period_ns);
  return config;
}

/// The run as its flight record describes it.
/// @param files  those that the run has read.
RecordConfiguration DescribeForRecord(const RunOptions& options, World& world,
                                      const RunDescription& description, const FileKeeper& files,
                                      const RepeatedSettings& settings, std::int64_t period_ns) {
  RecordConfiguration configuration;
  configuration.program = options.program + " " TUMBLER_VERSION;
  configuration.command_line = options.command_line;
  configuration.kernel = DescribeKernel();
  configuration.machine = description.machine;
  configuration.bus = options.bus;
  configuration.dry_run = options.dry_run();
  configuration.virtual_time = !world.real_time();
  configuration.utime_at_zero_us = UtimeAtZero(world);
  configuration.joints = description.joints;
  configuration.motion_file = options.motion;
  configuration.drives_file = options.drives;
  configuration.files = files.files();
  configuration.period_ns = period_ns;
  configuration.executor = settings.executor;
  configuration.procedure = settings.procedure;
  return configuration;
}

/// Puts this thread under the scheduling that the options ask for, if any.
/// @param enter  EnterRealtime, or TryRealtime to learn of a refusal before anything is touched.
/// @throws Refused  when motors are to be driven and the scheduling is not in force.
std::optional<RealtimeGrant> Schedule(const RunOptions& options, std::int64_t period_ns,
                                      RealtimeGrant (*enter)(const RealtimeConfig&),
                                      OperatorVoice& voice) {
  const bool needed = options.drives_motors() && !options.without_realtime;
  if (!options.realtime) {
    if (!needed) return std::nullopt;
    throw Refused(
        "driving motors takes --realtime (or --without-realtime, and patience with late ticks)");
  }
  RealtimeGrant grant = enter(options.SchedulingAt(period_ns));
  if (!grant.in_force()) {
    if (needed) throw Refused(grant.problems + "; or accept late ticks with --without-realtime");
    voice.Say("warning: " + grant.problems);
  }
  return grant;
}

/// Begins a summary with the facts from the options and the parts of the run.
RunSummary BeginSummary(const RunOptions& options, const RunParts& parts,
                        const RunDescription& description) {
  RunSummary summary;
  summary.bus = options.bus;
  summary.primitive = description.motion;
  summary.speed = options.speed;
  summary.rate_hz = parts.drives.rate_hz;
  summary.dry_run = options.dry_run();
  summary.simulated = options.simulated();
  summary.attended = options.attended;
  summary.joints = description.joints;
  summary.machine = description.machine;
  summary.worst_case_tick_bits = parts.drives.WorstCaseTickBits();
  summary.worst_case_load = parts.drives.WorstCaseLoad();
  for (const std::string& path : options.files()) {
    if (!path.empty()) summary.files.push_back(path);
  }
  if (!options.json.empty() && options.json != "-") summary.files.push_back(options.json);
  return summary;
}

/// Adds the outcome of the run to the summary.
/// @param commands  nothing: the run took no requests by LCM.
void EndSummary(const Play& play, const Telemetry& telemetry,
                const std::optional<LcmCommands>& commands, RunSummary& summary) {
  play.Conclude(summary);
  summary.lost_records = telemetry.lost();
  summary.unpublished_messages = telemetry.unpublished();
  if (commands) {
    summary.unreadable_messages = commands->unreadable();
    summary.refused_messages = commands->refused();
  }
}

/// Text for people, and files, that take nothing for so long are given up where the operator has
/// stopped the run, and waits for the program to end.
constexpr std::chrono::seconds kPatienceOfStopped(1);

/// For how long files may take nothing at the end. Where the operator has stopped the run, or asks
/// once more for the end, he does not wait for long.
class EndPatience {
 public:
  explicit EndPatience(bool stopped) : stopped_(stopped) {}
  std::chrono::milliseconds operator()() {
    constexpr std::chrono::seconds kPatience(10);
    stopped_ = stopped_ || InterruptMailbox().Take().quit;
    return stopped_ ? kPatienceOfStopped : kPatience;
  }

 private:
  bool stopped_;
};

/// Takes those that are not whole out of the list of files that were written. What could not be
/// written begins with the files' names, as in `a.log, a.csv: could not be written whole`.
void LeaveOutUnwritten(RunSummary& summary) {
  std::erase_if(summary.files, [&summary](const std::string& file) {
    return std::any_of(
        summary.unwritten.begin(), summary.unwritten.end(), [&file](const std::string& problem) {
          const std::string names = ", " + problem.substr(0, problem.find(": ")) + ", ";
          return names.find(", " + file + ", ") != std::string::npos;
        });
  });
}

/// Prints a text. A terminal that was stopped is waited for, unless the run was stopped as well, or
/// until somebody asks for the end.
void Print(const std::string& text, std::FILE* out, bool stopped) {
  std::fflush(out);
  OperatorVoice voice(fileno(out));
  voice.Say(text);
  while (!voice.Await(kPatienceOfStopped)) {
    if (stopped || InterruptMailbox().Take().quit) return;
  }
  // The stream that refuses the same is what RunProgram looks at.
  if (voice.failed()) std::fputs(text.c_str(), out);
}

/// Prints the summary. A run that is over is told of whatever could not be written.
void Say(RunSummary& summary, const RunOptions& options) {
  if (!summary.record_problem.empty()) summary.unwritten.push_back(summary.record_problem);
  LeaveOutUnwritten(summary);
  if (!options.json.empty()) {
    try {
      WriteResult(options.json, ToJson(summary));
    } catch (const std::exception& error) {
      summary.unwritten.emplace_back(error.what());
      LeaveOutUnwritten(summary);
    }
  }
  // Standard output is kept free for frames or JSON, where they were asked for there.
  std::FILE* out = options.json == "-" || options.dry_run() ? stderr : stdout;
  std::string text = Printable(ToText(summary));
  if (text.ends_with('\n')) text.pop_back();
  Print(text, out, summary.outcome == RunOutcome::kStopped);
}

/// @param pose_file  holds where the joints were in the end of the last run. Empty: not kept.
ExecutorConfig ConfigOf(const RunOptions& options, const RunSettings& settings,
                        const RunParts& parts, const std::string& pose_file) {
  ExecutorConfig config = ExecutorConfigOf(settings, parts.drives);
  if (!pose_file.empty() && !options.forget_pose) {
    config.moved_max_rad = static_cast<float>(options.moved_within_rad);
    config.last_known = ReadKnownPose(pose_file, parts.drives);
  }
  if (!options.faults.empty()) LoadFaultsOf(parts, options.faults, config);
  return config;
}

/// The run has ended, so that a file that cannot be written is only told.
void KeepPose(const std::string& file, const TickRecord& last, const DrivesConfig& drives,
              OperatorVoice& voice) {
  try {
    WriteKnownPose(file, last, drives);
  } catch (const std::exception& error) {
    voice.Say(fmt::format("warning: where the joints are is not kept: {}", error.what()));
  }
}

/// The bus of an opened world, for what the bench does with the drives.
class BenchOfWorld final : public BenchWorld {
 public:
  explicit BenchOfWorld(World& world) : world_(world) {}
  CanBus& bus() override { return world_.bus(); }
  Clock& clock() override { return world_.clock(); }
  [[nodiscard]] BusTrouble trouble() const override { return {}; }

 private:
  World& world_;
};

/// Proves of the drives what the options ask for. Telemetry tells of it, so that others can end it.
/// @returns whether the run goes on: false when somebody has ended the proofs. The torque is off.
/// @throws Refused.
bool CheckDrives(const RunOptions& options, const RunParts& parts, World& world,
                 Telemetry& telemetry, OperatorVoice& voice) {
  if (!options.checks_drives()) return true;
  telemetry.NoteChecking();
  telemetry.Start();
  BenchOfWorld bench(world);
  const std::unique_ptr<BenchOperator> somebody =
      MakeAskedOperator({options.answers, false, nullptr});
  ArmingChecks checks;
  checks.identity = options.check_identity;
  checks.watchdog = options.prove_watchdog;
  checks.clear = options.clear;
  try {
    CheckBeforeArming(bench, parts.drives, JointsOf(parts.file), checks, *somebody,
                      [&options, &voice](const std::string& line) {
                        voice.Say(fmt::format("{}: {}", options.program, line));
                      });
  } catch (const BenchInterrupted& end) {
    telemetry.NoteCheckEnded(end.wish().id);
    voice.Say(fmt::format("{}: {} while the drives were checked: torque off", options.program,
                          end.wish().id == 0 ? "interrupted" : "stopped by a request"));
    return false;
  }
  return true;
}

/// Takes requests by LCM, where the run has it.
void Listen(const RunOptions& options, const SequenceGraph<float>& graph, std::int64_t run,
            std::int64_t period_ns, OperatorVoice& voice, std::optional<LcmCommands>& commands) {
  if (options.lcm_url.empty()) return;
  constexpr double kAgeMax_s = 2;
  const double age_max = std::ceil(kAgeMax_s * 1e9 / static_cast<double>(period_ns));
  CommandAddress address{run, static_cast<std::int64_t>(age_max), std::nullopt};
  if (!options.key.empty()) address.key.emplace(options.key);
  commands.emplace(options.lcm_url, InterruptMailbox(), graph, address,
                   [&voice](const std::string& text) { voice.Say(text); });
}

/// Tells the operator from now on when the robot is held at the end.
void NoteHolds(const std::string& program, const RunProcedureConfig& procedure,
               std::int64_t period_ns, OperatorVoice& voice, std::optional<HoldNotice>& notice) {
  notice.emplace(static_cast<double>(procedure.stop_hold_ticks * period_ns) * 1e-9,
                 [program, &voice](const std::string& text) {
                   voice.Say(fmt::format("{}: {}", program, text));
                 });
}

/// Writes the rest of the telemetry. What could not be written stands in the summary.
/// @param stopped  whether the operator has stopped the run.
void StopTelemetry(Telemetry& telemetry, bool stopped, RunSummary& summary) {
  try {
    telemetry.Stop(EndPatience(stopped));
  } catch (const std::exception& error) {
    summary.unwritten.emplace_back(error.what());
  }
}

/// Says what ends a hold at the end that has no time of its own.
void NoteHoldWithoutEnd(const RunOptions& options, const RunProcedureConfig& procedure,
                        OperatorVoice& voice) {
  if (options.virtual_time() || procedure.end_hold_ticks >= 0 || options.attended) return;
  const bool writes =
      std::ranges::any_of(options.files(), [](const std::string& file) { return !file.empty(); });
  voice.Say(fmt::format(
      "note: where the robot would drop without torque, it is held at the end until Ctrl-C "
      "or `tumbler ctl disarm` (--end torque-off does without){}",
      writes ? "; the files of the run grow until then" : ""));
}

/// How long a tick takes by the clock.
std::int64_t PeriodOf(const RunOptions& options, const DrivesConfig& drives) {
  return static_cast<std::int64_t>(std::llround(1e9 / (drives.rate_hz * options.pace)));
}

/// Checks that the ticks of a repetition are those of the record.
void CheckPeriod(std::int64_t period_ns, const RunOptions& options, const RunSource& source) {
  if (source.recorded->period_ns == period_ns) return;
  throw Refused(fmt::format(
      "{}: rate_hz gives {:.6g} ticks a second, but the record has {:.6g}: its setpoints belong to "
      "its ticks (a run on tumbler twin with --pace is repeated with the same --pace)",
      options.drives, 1e9 / static_cast<double>(period_ns),
      1e9 / static_cast<double>(source.recorded->period_ns)));
}

/// The settings of the run: those of the options, or those of the run that is repeated as far as
/// they allow it. @throws Refused.
RepeatedSettings SettingsInForce(const RunOptions& options, const RunParts& parts,
                                 const RunSource& source, const std::string& pose_file) {
  const RunSettings settings = SettingsOf(options, parts);
  const ExecutorConfig executor = ConfigOf(options, settings, parts, pose_file);
  if (source.recorded == nullptr) {
    return {executor, ProcedureConfigOf(settings, parts.drives, parts.sequence->graph), {}, {}};
  }
  CheckPeriod(PeriodOf(options, parts.drives), options, source);
  RepeatedSettings repeated =
      SettingsToRepeat(*source.recorded, executor, settings, parts, source.given);
  for (const std::string& note : repeated.notes) fmt::print(stderr, "note: {}\n", note);
  if (!repeated.milder.empty()) throw Refused(DescribeMilder(source.record_name, repeated.milder));
  return repeated;
}

/// Says that a recording of a build that cannot read robot files is without the robot.
void NotePictureless(const RunOptions& options, OperatorVoice& voice) {
  if (options.mcap.empty()) return;
  voice.Say(fmt::format("note: {} is without the robot, as this build cannot read robot files",
                        options.mcap));
}

}  // namespace

std::optional<RunSummary> PlayRun(RunOptions options, const Simulation* simulation,
                                  const RunSource& source, const PictureSource* pictures) {
  FileKeeper files;
  Assembly assembly(
      LoadParts(options, simulation, files.reader(source.motion), files.reader(source.drives)));
  CheckOutputs(options, simulation, files);
  const RunParts& parts = assembly.parts();
  const SequenceGraph<float>& graph = parts.sequence->graph;
  const std::string pose_file = PoseFileOf(options);
  const RepeatedSettings settings = SettingsInForce(options, parts, source, pose_file);
  const RunProcedureConfig& procedure_config = settings.procedure;
  if (assembly.Configure(settings.executor) != Status::kOk) {
    throw Refused(fmt::format(
        "{}: the executor does not take this motion: it has to start at rest, last at most "
        "10000 s and run at 1 Hz ... 100 kHz",
        options.motion));
  }

  const std::int64_t period_ns = PeriodOf(options, parts.drives);
  // A recorder's thread that had to be left behind keeps it.
  const auto shared_voice = std::make_shared<OperatorVoice>(STDERR_FILENO);
  OperatorVoice& voice = *shared_voice;
  if (options.drives_motors() && !options.without_realtime)
    static_cast<void>(Schedule(options, period_ns, TryRealtime, voice));

  TickFeed feed;
  const std::unique_ptr<World> world = MakeWorld(options, simulation, parts, feed);
  const RunDescription description = DescribeRun(options, parts, *world);
  const RecordConfiguration about =
      DescribeForRecord(options, *world, description, files, settings, period_ns);
  Telemetry telemetry(TelemetryOf(options, parts, description, about, pictures));
  feed.Add(&telemetry);
  std::optional<LcmCommands> commands;
  Listen(options, graph, description.number, period_ns, voice, commands);
  std::unique_ptr<FlightRecorder> recorder;
  if (!options.record.empty()) {
    recorder = OpenRecorder(options.record, about,
                            [shared_voice, program = options.program](const std::string& text) {
                              shared_voice->Say(program + ": " + text);
                            });
    feed.Add(recorder.get());
  }

  NoteHoldWithoutEnd(options, procedure_config, voice);
  if (pictures == nullptr) NotePictureless(options, voice);

  world->Open();
  CatchInterrupts();
  if (!CheckDrives(options, parts, *world, telemetry, voice)) return std::nullopt;
  Play play(assembly, *world, feed);
  RunSummary summary = BeginSummary(options, parts, description);
  std::optional<CpuAwake> awake;
  if (options.realtime) awake.emplace();
  summary.realtime = Schedule(options, period_ns, EnterRealtime, voice);
  if (awake && awake->held()) summary.realtime->scheduling += ", processors kept awake";
  telemetry.SetScheduling(summary.realtime ? summary.realtime->scheduling : "time-shared");
  bool armed = false;
  std::optional<HoldNotice> notice;
  if (world->real_time() && !options.dry_run())
    NoteHolds(options.program, procedure_config, period_ns, voice, notice);
  play.Run(procedure_config, period_ns, [&](const ControlLoop& loop) {
    if (notice) notice->Note(play.procedure());
    if (commands) commands->NoteTick(loop.statistics().ticks - 1);
    armed = armed || loop.record().state == ExecutorState::kHolding;
    if (source.each_tick) source.each_tick(loop);
  });
  notice.reset();
  // Whatever a run ends with: who has asked for its end does not wait for a disk.
  const bool stopped =
      play.procedure().outcome() == RunOutcome::kStopped || play.procedure().quits();
  StopTelemetry(telemetry, stopped, summary);
  if (std::string problem = feed.TruthProblem(); !problem.empty())
    summary.unwritten.push_back(std::move(problem));
  // What was found by a run that was refused is what it was refused for.
  if (!pose_file.empty() && armed) KeepPose(pose_file, play.loop().record(), parts.drives, voice);

  EndSummary(play, telemetry, commands, summary);
  world->Summarize(summary);
  if (recorder != nullptr) StopRecorder(*recorder, summary, EndPatience(stopped));
  return summary;
}

ExitStatus PlayMotion(int argc, char** argv, const Simulation* simulation,
                      const PictureSource* pictures) {
  const RunOptions options = ReadRunOptions(argc, argv);
  if (!options.doctor.empty()) return Examine(options);
  if (options.latency_test_s > 0) return TestLatency(options);
  std::optional<RunSummary> summary = PlayRun(options, simulation, {}, pictures);
  if (!summary) return ExitStatus::kInterrupted;
  Say(*summary, options);
  return StatusOf(*summary);
}

}  // namespace tumbler
