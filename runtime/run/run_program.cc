#include "runtime/run/run_program.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/command_line.h"
#include "common/program.h"
#include "common/sequence_toml.h"
#include "common/toml_reader.h"
#include "firmware_interface/drives/drive_bank.h"
#include "firmware_interface/drives/drives_toml.h"
#include "runtime/assembly/faults_toml.h"
#include "runtime/assembly/run_checks.h"
#include "runtime/core/executor.h"
#include "runtime/core/run_procedure.h"
#include "runtime/linux/clock.h"
#include "runtime/linux/interrupts.h"
#include "runtime/linux/realtime_thread.h"
#include "runtime/record/flight_recorder.h"
#include "runtime/record/record_configuration.h"
#include "runtime/run/control_loop.h"
#include "runtime/run/interface_world.h"
#include "runtime/run/run_summary.h"
#include "runtime/run/world.h"
#include "runtime/telemetry/lcm_commands.h"
#include "runtime/telemetry/telemetry.h"

namespace tumbler {
namespace {

constexpr const char* kSimulation = "sim";

constexpr const char* kFooter =
    R"(BUS is `sim`, a simulated robot on a simulated bus, or a SocketCAN interface such as can0.
On an interface nothing is sent without --arm: the frames of an imagined run are printed instead, in the format of
`candump -l`.

With --attended each run waits for `tumbler-ctl start`; Ctrl-C ends the program. With --latency-test there is neither
BUS nor MOTION: the loop only sleeps and wakes, and how late it wakes is printed.

In order: load, check, arm, move to the start, run, settle, hold, stop, disarm.
Ctrl-C: go on to the next safe node, hold for a moment, disarm. A second one: brake at once within the limits, hold,
disarm. A third one: torque off.

Exit codes:
  0    the motion was completed
  1    wrong usage, or a file or interface that cannot be used
  2    refused: a check before arming or running failed
  3    a fault during the run
  4    the motion was completed, but the simulated robot fell, or is not where the primitive says 2 s later
  130  stopped by Ctrl-C or a message)";

struct Options {
  std::string bus;
  std::string motion;
  std::string drives;
  std::string faults;
  std::string bus_faults;
  bool arm = false;
  bool realtime = false;
  bool without_realtime = false;
  RealtimeConfig scheduling;
  double latency_test_s = 0;
  double rate_hz = 1000;  ///< Of the latency test.
  bool attended = false;
  double speed = 1;
  double pace = 1;
  double hold_s = 2;
  int cycles = 0;
  std::string branch;
  std::string log;
  std::string lcm_url;
  std::string json;
  std::string trace;
  std::string twin;
  std::string truth;
  std::string record;
  std::vector<std::string> command_line;

  [[nodiscard]] bool simulated() const { return bus == kSimulation; }
  [[nodiscard]] bool dry_run() const { return !simulated() && !arm; }
};

/// The drives of the primitive's joints, in its order.
DrivesConfig DrivesFor(const Options& options, const Primitive<double>& primitive,
                       const FileReader& read) {
  std::vector<std::string> joints;
  for (const JointMotion<double>& motion : primitive.motions())
    joints.emplace_back(motion.name.view());
  if (options.drives.empty()) return DefaultDrives(joints);  // Said in the help of --drives.
  const DrivesConfig given = ParseDrives(read(options.drives), options.drives);
  try {
    return DrivesOf(given, joints, options.drives);
  } catch (const std::runtime_error& error) {
    throw Refused(fmt::format("{} of {}", error.what(), options.motion));
  }
}

/// The names that `--branch` may have.
std::set<std::string> BranchNames(const SequenceGraph<float>& graph) {
  std::set<std::string> names;
  for (const auto& edge : graph.edges()) {
    if (edge.when == EdgeCondition::kBranch) names.emplace(edge.branch.view());
  }
  return names;
}

/// The number of the branch that is asked for; -1 without one.
int BranchNumber(const Options& options, const SequenceGraph<float>& graph) {
  if (options.branch.empty()) return -1;
  const int number = graph.FindBranch(options.branch);
  if (number >= 0) return number;
  const std::set<std::string> names = BranchNames(graph);
  throw std::runtime_error(fmt::format(
      "--branch: {} has no branch '{}'; its branches: {}", options.motion, options.branch,
      names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
}

ExecutorConfig MakeExecutorConfig(const Options& options, const DrivesConfig& drives,
                                  const SequenceGraph<float>& graph) {
  ExecutorConfig config;
  config.cycles = options.cycles;
  config.branch = BranchNumber(options, graph);
  config.period_s = static_cast<float>(1 / drives.rate_hz);
  config.speed = static_cast<float>(options.speed);
  const auto ticks = [&drives](double time_s) {
    return static_cast<int>(std::ceil(time_s * drives.rate_hz));
  };
  config.arming_ticks_max = ticks(0.5);
  for (std::size_t i = 0; i < drives.drives.size(); ++i) {
    const DriveEntry& entry = drives.drives[i];
    config.joints[i].kp_nm_per_rad = entry.kp_nm_per_rad;
    config.joints[i].kd_nm_s_per_rad = entry.kd_nm_s_per_rad;
    config.joints[i].damping_nm_s_per_rad = entry.kd_nm_s_per_rad;
    config.joints[i].temperature_max_c = entry.temperature_max_c;
  }
  return config;
}

/// Reads the faults file, where one is given, over what `config` holds.
void ReadFaults(const Options& options, const Sequence<float>& sequence, const DrivesConfig& drives,
                ExecutorConfig& config) {
  if (options.faults.empty()) return;
  std::vector<FaultsJoint> joints;
  for (std::size_t i = 0; i < drives.drives.size(); ++i) {
    FaultsJoint joint{drives.drives[i].joint, -1e9, 1e9};
    for (int p = 0; p < sequence.primitive_count; ++p) {
      const JointLimits<float>& limits =
          sequence.primitives[static_cast<std::size_t>(p)].joints[i].limits;
      joint.position_min_rad =
          std::max(joint.position_min_rad, static_cast<double>(limits.position_min_rad));
      joint.position_max_rad =
          std::min(joint.position_max_rad, static_cast<double>(limits.position_max_rad));
    }
    joints.push_back(joint);
  }
  LoadFaults(options.faults, joints, config);
}

RunProcedureConfig MakeProcedureConfig(const Options& options, const DrivesConfig& drives) {
  const double rate_hz = drives.rate_hz;
  int first_reply_ms = 0;
  for (const DriveEntry& drive : drives.drives) {
    first_reply_ms = std::max(first_reply_ms, FirstReply_ms(drive.config));
  }
  const auto ticks = [rate_hz](double time_s) {
    return static_cast<std::int64_t>(std::llround(time_s * rate_hz));
  };
  RunProcedureConfig config;
  config.hold_ticks = ticks(options.hold_s);
  config.reply_ticks_max = ticks(first_reply_ms / 1000.0);
  config.start_ticks_max = ticks(1);
  config.stop_hold_ticks = ticks(0.5);
  config.fault_ticks = ticks(1);
  config.attended = options.attended;
  return config;
}

InterfaceName Interface(const Options& options) {
  return {options.bus, options.drives, options.pace};
}

/// Positions of the joints at the start of a motion [rad].
std::vector<double> StartPositions(const SequenceFile& file) {
  std::vector<double> positions;
  const int start = file.graph.start;
  const Primitive<double>& primitive = file.PrimitiveOf(start).primitive;
  for (int i = 0; i < primitive.joint_count; ++i) {
    const auto role = static_cast<std::size_t>(file.graph.RoleOf(start, i));
    positions.push_back(primitive.joints[role].position.control_points()[0]);
  }
  return positions;
}

std::unique_ptr<World> MakeWorld(const Options& options, const Simulation* simulation,
                                 const SequenceFile& file, const DrivesConfig& drives,
                                 const TruthSink& truth_sink) {
  if (options.simulated()) {
    if (simulation == nullptr) {
      throw std::runtime_error(
          "this build has no simulation (TUMBLER_BUILD_OFFLINE is OFF); name a CAN interface");
    }
    return simulation->make_world(
        file, drives,
        {options.twin, options.bus_faults, options.truth, options.lcm_url,
         options.record.empty() ? TruthSink() : truth_sink, options.realtime});
  }
  if (options.dry_run()) return MakeDryRunWorld(Interface(options), drives, StartPositions(file));
  return MakeInterfaceWorld(Interface(options), drives);
}

/// @param path  `-` for standard output.
void WriteFile(const std::string& text, const std::string& path) {
  if (path == "-") {
    std::cout << text << std::flush;
    return;
  }
  std::ofstream stream(path);
  stream << text << std::flush;
  if (!stream) throw std::runtime_error(fmt::format("{}: cannot be written", path));
}

/// Of the loop's clock, in microseconds since 1970; 0 in virtual time.
std::int64_t UtimeAtZero(World& world) {
  if (!world.real_time()) return 0;
  const auto since_epoch = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(since_epoch).count() -
         world.clock().now_ns() / 1000;
}

RecordConfiguration DescribeForRecord(const Options& options, World& world,
                                      const std::vector<std::string>& joints,
                                      const FileKeeper& files) {
  RecordConfiguration configuration;
  configuration.program = "tumbler-run " TUMBLER_VERSION;
  configuration.command_line = options.command_line;
  configuration.kernel = DescribeKernel();
  configuration.bus = options.bus;
  configuration.dry_run = options.dry_run();
  configuration.virtual_time = !world.real_time();
  configuration.utime_at_zero_us = UtimeAtZero(world);
  configuration.joints = joints;
  configuration.motion_file = options.motion;
  configuration.drives_file = options.drives;
  configuration.files = files.files();
  return configuration;
}

std::unique_ptr<FlightRecorder> OpenRecorder(const Options& options,
                                             const RecordConfiguration& configuration) {
  // A limit on the size of files is a full disk: the recording stops, not the program.
  std::signal(SIGXFSZ, SIG_IGN);
  FlightRecorderConfig config;
  config.file = options.record;
  config.configuration = EncodeConfiguration(configuration);
  config.say = [](const std::string& text) { fmt::print(stderr, "tumbler-run: {}\n", text); };
  return std::make_unique<FlightRecorder>(config);
}

RealtimeConfig SchedulingFor(const Options& options, std::int64_t period_ns) {
  RealtimeConfig config = options.scheduling;
  config.period_ns = period_ns;
  return config;
}

RunDescription DescribeRun(const Options& options, const DrivesConfig& drives,
                           const SequenceGraph<float>& graph) {
  RunDescription run;
  run.motion = std::string(graph.name.view());
  run.bus = options.bus;
  run.mode = options.simulated() ? "simulated" : options.dry_run() ? "dry run" : "armed";
  run.attended = options.attended;
  run.rate_hz = drives.rate_hz;
  run.bit_rate = drives.bit_rate;
  run.speed = options.speed;
  for (const DriveEntry& entry : drives.drives) run.joints.push_back(entry.joint);
  for (const SequenceNode& node : graph.nodes()) run.nodes.emplace_back(node.name.view());
  const std::set<std::string> branches = BranchNames(graph);
  run.branches.assign(branches.begin(), branches.end());
  run.machine = DescribeMachine(options.simulated() || options.dry_run() ? "" : options.bus);
  return run;
}

/// Measures how late this machine wakes the loop, with nothing else in it.
ExitStatus TestLatency(const Options& options) {
  const auto period_ns = static_cast<std::int64_t>(std::llround(1e9 / options.rate_hz));
  const RealtimeGrant realtime = options.without_realtime
                                     ? RealtimeGrant{true, true, "time-shared", ""}
                                     : EnterRealtime(SchedulingFor(options, period_ns));
  if (!realtime.problems.empty()) fmt::print(stderr, "warning: {}\n", realtime.problems);
  CatchInterrupts();
  MonotonicClock clock;
  const LoopStatistics statistics = MeasureWakeUps(
      clock, InterruptMailbox(), period_ns,
      static_cast<std::int64_t>(std::ceil(options.latency_test_s * options.rate_hz)));
  const Machine machine = DescribeMachine("");
  if (!options.json.empty())
    WriteFile(TimingToJson(statistics, machine, realtime.scheduling), options.json);
  std::FILE* out = options.json == "-" ? stderr : stdout;
  fmt::print(out,
             "{} wake-ups at {:.6g} Hz, {} late by more than half a period, {} periods missed\n{}",
             statistics.ticks, options.rate_hz, statistics.late_ticks, statistics.missed_ticks,
             DescribeTiming(statistics, machine, realtime.scheduling));
  return ExitStatus::kDone;
}

ExitStatus Run(Options options, const Simulation* simulation) {
  FileKeeper files;
  const SequenceFile file = LoadMotion(options.motion, files.reader());
  const auto motions = std::make_unique<const Sequence<float>>(ToRuntime(file));
  const SequenceGraph<float>& graph = motions->graph;
  if (simulation != nullptr && options.drives.empty() && !options.twin.empty())
    options.drives = simulation->drives_file_of(options.twin);
  if (options.drives.empty() && !options.simulated()) {
    throw std::runtime_error(
        fmt::format("{} is a real bus: say with --drives which drives are on it", options.bus));
  }
  if (!options.bus_faults.empty() && !options.simulated()) {
    throw std::runtime_error("--bus-faults is for the simulated bus: sim");
  }
  if (!options.simulated() && !(options.twin.empty() && options.truth.empty())) {
    throw std::runtime_error(fmt::format(
        "--twin and --truth are about the simulated robot of `sim`; on {} run tumbler-twin",
        options.bus));
  }
  if (options.pace != 1 && (options.simulated() || options.dry_run())) {
    throw std::runtime_error("--pace is for an armed run on tumbler-twin");
  }
  const bool virtual_time = options.dry_run() || (options.simulated() && !options.realtime);
  if (options.attended && (virtual_time || options.lcm_url.empty())) {
    throw std::runtime_error(
        "--attended waits for somebody: it takes --lcm-url, and real time (`sim --realtime`, or an "
        "interface with --arm)");
  }
  if (virtual_time && graph.edge_count > 0 && options.cycles == 0 && options.branch.empty()) {
    throw std::runtime_error(fmt::format(
        "{} goes round until it is stopped, and time here is not real: say with --cycles how often",
        options.motion));
  }
  const DrivesConfig drives = DrivesFor(options, file.primitives[0].primitive, files.reader());
  CheckRanges(*motions, drives);
  CheckSchedule(drives);

  DriveBank bank;
  RunSummary summary;
  for (const DriveEntry& entry : drives.drives) {
    if (bank.Add(entry.config) != Status::kOk) {
      throw Refused(fmt::format("joint {}: its drive cannot be used as configured", entry.joint));
    }
    summary.joints.push_back(entry.joint);
  }
  Executor executor;
  const std::span<const Primitive<float>> primitives(
      motions->primitives.data(), static_cast<std::size_t>(motions->primitive_count));
  ExecutorConfig executor_config = MakeExecutorConfig(options, drives, graph);
  ReadFaults(options, *motions, drives, executor_config);
  if (executor.Configure(executor_config, graph, primitives, bank.drives()) != Status::kOk) {
    throw Refused(fmt::format(
        "{}: the executor does not take this motion: it has to start at rest, last at most "
        "10000 s and run at 1 Hz ... 100 kHz",
        options.motion));
  }

  std::unique_ptr<FlightRecorder> recorder;
  const std::unique_ptr<World> world = MakeWorld(options, simulation, file, drives,
                                                 [&recorder](std::span<const std::uint8_t> truth) {
                                                   if (recorder != nullptr)
                                                     recorder->PushTruth(truth);
                                                 });
  TelemetryConfig telemetry_config;
  telemetry_config.log_file = options.log;
  telemetry_config.lcm_url = options.lcm_url;
  telemetry_config.trace_file = options.trace;
  telemetry_config.run = DescribeRun(options, drives, graph);
  telemetry_config.utime_at_zero_us = UtimeAtZero(*world);
  Telemetry telemetry(telemetry_config);
  std::optional<LcmCommands> commands;
  if (!options.lcm_url.empty()) commands.emplace(options.lcm_url, InterruptMailbox(), graph);
  const auto period_ns =
      static_cast<std::int64_t>(std::llround(1e9 / (drives.rate_hz * options.pace)));
  const RunProcedureConfig procedure_config = MakeProcedureConfig(options, drives);
  RunProcedure procedure(procedure_config);
  if (!options.record.empty()) {
    RecordConfiguration configuration = DescribeForRecord(options, *world, summary.joints, files);
    configuration.machine = telemetry_config.run.machine;
    configuration.period_ns = period_ns;
    configuration.executor = executor_config;
    configuration.procedure = procedure_config;
    recorder = OpenRecorder(options, configuration);
  }
  if (world->real_time()) {  // Before SCHED_FIFO, which their threads must not inherit.
    telemetry.Start();
    if (recorder != nullptr) recorder->Start();
  }

  CatchInterrupts();
  if (options.realtime) {
    summary.realtime = EnterRealtime(SchedulingFor(options, period_ns));
    if (!summary.realtime->in_force()) {
      if (!options.simulated() && !options.dry_run() && !options.without_realtime) {
        throw Refused(summary.realtime->problems +
                      "; or accept late ticks with --without-realtime");
      }
      fmt::print(stderr, "warning: {}\n", summary.realtime->problems);
    }
  } else if (!options.simulated() && !options.dry_run() && !options.without_realtime) {
    throw Refused(
        "driving motors takes --realtime (or --without-realtime, and patience with late ticks)");
  }
  telemetry.SetScheduling(summary.realtime ? summary.realtime->scheduling : "time-shared");

  Clock& clock = world->clock();
  const std::int64_t start_ns = world->real_time() ? clock.now_ns() + period_ns : 0;
  ControlLoop loop(
      {executor, world->bus(), clock, procedure, InterruptMailbox(), &telemetry, recorder.get()},
      period_ns, start_ns);
  while (loop.Step()) {
    world->Observe(loop);
    if (world->real_time()) continue;
    telemetry.Drain();
    if (recorder != nullptr) recorder->Drain();
  }
  telemetry.Stop();

  summary.bus = options.bus;
  summary.primitive = std::string(graph.name.view());
  summary.cycles = loop.record().cycles;
  summary.speed = options.speed;
  summary.rate_hz = drives.rate_hz;
  summary.dry_run = options.dry_run();
  summary.simulated = options.simulated();
  summary.attended = options.attended;
  summary.runs = procedure.runs();
  summary.machine = telemetry_config.run.machine;
  summary.outcome = procedure.outcome();
  if (summary.outcome == RunOutcome::kRefused)
    summary.reason = Describe(procedure.refusal(), summary.joints);
  if (loop.record().first_fault.fault != Fault::kNone) {
    summary.reason = Describe(loop.record().first_fault, summary.joints);
  } else if (summary.outcome == RunOutcome::kStopped) {
    summary.reason = "stopped by the operator";
  }
  if (recorder != nullptr) {
    recorder->Stop(summary.reason.empty()
                       ? ToString(summary.outcome)
                       : fmt::format("{}: {}", ToString(summary.outcome), summary.reason));
    summary.recorded_ticks = recorder->recorded();
    summary.unrecorded_ticks = recorder->pushed() - recorder->recorded();
    summary.record_problem = recorder->problem();
  }
  summary.statistics = loop.statistics();
  summary.worst_case_tick_bits = drives.WorstCaseTickBits();
  summary.worst_case_load = drives.WorstCaseLoad();
  summary.lost_records = telemetry.lost();
  summary.unpublished_messages = telemetry.unpublished();
  world->Summarize(summary);
  for (const std::string& path : {options.log, options.trace, options.record, options.truth}) {
    if (!path.empty()) summary.files.push_back(path);
  }
  if (!options.json.empty() && options.json != "-") summary.files.push_back(options.json);
  if (!options.json.empty()) WriteFile(ToJson(summary), options.json);
  // Standard output belongs to whoever asked for frames or JSON there.
  std::FILE* out = options.json == "-" || options.dry_run() ? stderr : stdout;
  fmt::print(out, "{}", ToText(summary));
  return StatusOf(summary);
}

/// What no option by itself can get wrong.
void CheckTogether(const Options& options) {
  // The checks of ranges let "nan" through: it is neither below nor above anything.
  for (const auto& [name, value] : {std::pair{"--speed", options.speed},
                                    {"--hold-s", options.hold_s},
                                    {"--pace", options.pace},
                                    {"--rate-hz", options.rate_hz},
                                    {"--latency-test", options.latency_test_s}}) {
    if (!std::isfinite(value))
      throw std::runtime_error(fmt::format("{}: is {}, which is not a number to use", name, value));
  }
  const bool test = options.latency_test_s > 0;
  if (test && !options.bus.empty()) {
    throw std::runtime_error(
        "--latency-test has no bus and plays no motion: leave BUS and MOTION out");
  }
  if (!test && (options.bus.empty() || options.motion.empty()))
    throw std::runtime_error("BUS and MOTION are needed (see --help)");
  if (options.scheduling.scheduling == Scheduling::kDeadline && options.scheduling.cpu >= 0) {
    throw std::runtime_error(
        "--cpu: the kernel does not pin threads under SCHED_DEADLINE; use fifo");
  }
}

}  // namespace

ExitStatus PlayMotion(int argc, char** argv, const Simulation* simulation) {
  Options options;
  CommandLine line("Plays a motion primitive on motor drives over CAN, or on a simulated robot.",
                   "tumbler-run");
  line.SetFooter(kFooter);
  line.Option("BUS", options.bus, "`sim` or a SocketCAN interface");
  line.Option("MOTION", options.motion, "primitive or sequence file (TOML)");
  line.Option(
      "--drives", options.drives,
      "drive configuration (TOML). Needed on a real interface; for sim the default is MIT drives "
      "with ids 1, "
      "2, ... in the order of the joints, replies on 17, 18, ..., kp 200, kd 4, 1000 Hz, 1 Mbit/s");
  line.Option("--faults", options.faults,
              "reactions to faults and their limits (TOML), where they are not the defaults");
  line.Option("--bus-faults", options.bus_faults,
              "sim only: what is wrong with the bus, and when (TOML)");
  line.Flag("--arm", options.arm,
            "drive the motors; without it a real interface only sees a dry run");
  line.Flag("--realtime", options.realtime,
            "SCHED_FIFO and locked memory; a simulation then runs at the pace of the clock");
  line.Flag("--without-realtime", options.without_realtime,
            "arm a real bus even though they are not in force");
  std::string scheduling = "fifo";
  line.Option("--scheduling", scheduling,
              "of --realtime: fifo (SCHED_FIFO) or deadline (SCHED_DEADLINE)")
      .OneOf({"fifo", "deadline"})
      .ShowDefault();
  line.Option("--priority", options.scheduling.priority, "of SCHED_FIFO")
      .Within(1, 99)
      .ShowDefault();
  line.Option("--cpu", options.scheduling.cpu,
              "of --realtime: the processor that the loop runs on; -1: any. Not with deadline")
      .Within(-1, 1023)
      .ShowDefault();
  line.Option("--latency-test", options.latency_test_s,
              "measure for so long how late this machine wakes a loop [s]; no BUS, no MOTION")
      .Within(0.01, 1e6);
  line.Option("--rate-hz", options.rate_hz, "of --latency-test; a run's rate is its drives'")
      .Within(1.0, 1e5)
      .ShowDefault();
  line.Flag("--attended", options.attended,
            "wait for `tumbler-ctl start` before each run, until Ctrl-C; needs --lcm-url");
  line.Option("--speed", options.speed, "playback speed; feed-forward is scaled by its square")
      .Within(0.1, 1.0)
      .ShowDefault();
  line.Option("--pace", options.pace,
              "for tumbler-twin with the same --pace on a virtual interface: seconds of the "
              "robot in a second of the clock")
      .Within(0.05, 1.0)
      .ShowDefault();
  line.Option("--hold-s", options.hold_s, "how long to hold after settling [s]")
      .Within(0.0, 3600.0)
      .ShowDefault();
  line.Option("--cycles", options.cycles,
              "of a sequence: end after so many, or take the branch then; 0: the branch at the "
              "first chance, or on until stopped")
      .Within(0, 1'000'000)
      .ShowDefault();
  line.Option("--branch", options.branch, "of a sequence: take this branch after the cycles");
  line.Option("--log", options.log, "write every tick to this LCM log");
  line.Option("--lcm-url", options.lcm_url,
              "publish live and take commands there, e.g. udpm://239.255.76.67:7667?ttl=0");
  line.Option("--json", options.json,
              "write the summary as JSON to this file, or - for standard output");
  line.Option("--trace", options.trace, "write every tick to this CSV file");
  line.Option("--record", options.record,
              "record the whole run in this file, which must not exist (see tumbler-record and "
              "tumbler-replay)");
  line.Option("--twin", options.twin,
              "sim: the simulated robot as it is, with disturbances (TOML); without it, as the "
              "motion has it");
  line.Option("--truth", options.truth,
              "sim: write what is true of the simulated robot to this LCM log");
  options.command_line.assign(argv, argv + argc);
  line.Parse(argc, argv);
  if (scheduling == "deadline") options.scheduling.scheduling = Scheduling::kDeadline;
  CheckTogether(options);
  return options.latency_test_s > 0 ? TestLatency(options) : Run(options, simulation);
}

}  // namespace tumbler
