#include "runtime/run/run_options.h"

#include <fmt/format.h>

#include <unistd.h>

#include <array>
#include <functional>
#include <initializer_list>
#include <stdexcept>
#include <string_view>

#include "common/files/command_line.h"
#include "common/files/planned_passages.h"
#include "common/files/program.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(BUS is `sim`, a simulated robot on a simulated bus, or a SocketCAN interface such as can0.
On an interface nothing is sent without --arm: the frames of an imagined run are printed instead, in the format of
`candump -l`.

With --attended each run waits for `tumbler ctl start`; Ctrl-C ends the program. With --latency-test there is neither
BUS nor MOTION: the loop only sleeps and wakes, and how late it wakes is printed.

In order: load, check, arm, move to the start, run, settle, hold, stop, disarm.
Ctrl-C: go on to the next safe node, hold for a moment, disarm. A second one: brake at once within the limits, or abort
the motion as its file says. A third one: torque off. Where the robot would drop without torque it is held until one
more Ctrl-C (--end).

Exit codes:
  0    the motion was completed
  1    wrong usage, or a file or interface that cannot be used
  2    refused: a check before arming or running failed
  3    a fault during the run
  4    the motion was completed, but the robot fell and got up, or the simulated robot fell, missed a target of the
       motion's purpose, or has another pitch than the plan 2 s later, or when it has settled; or a file of the run
       could not be written whole (the text and `unwritten` say which)
  130  stopped by Ctrl-C or a message)";

/// Declares the options about the motion, and those that play none.
void DeclareMotion(CommandLine& line, RunOptions& options) {
  line.Option("BUS", options.bus, "`sim` or a SocketCAN interface");
  line.Option("MOTION", options.motion, "primitive or sequence file (TOML)");
  line.Option(
      "--drives", options.drives,
      "drive configuration (TOML). Needed on a real interface; for sim the default is MIT drives "
      "with ids 1, "
      "2, ... in the order of the joints, replies on 17, 18, ..., 1000 Hz, 1 Mbit/s, and the gains "
      "with which the motion was found; where its file says none, kp 200, kd 4");
  line.Option("--bus-faults", options.bus_faults,
              "sim only: what is wrong with the bus, and when (TOML)");
  line.Option("--latency-test", options.latency_test_s,
              "measure for so long how late this machine wakes a loop [s]; no BUS, no MOTION")
      .Within(0.01, 1e6);
  line.Option("--doctor", options.doctor,
              "say what this machine and this SocketCAN interface lack for driving motors; sends "
              "nothing; no BUS, no MOTION");
  line.Option("--rate-hz", options.rate_hz, "of --latency-test; a run's rate is its drives'")
      .Within(1.0, 1e5)
      .ShowDefault();
}

/// Declares the options about how it is played, and about outputs.
void DeclareRun(CommandLine& line, RunOptions& options) {
  line.Flag("--attended", options.attended,
            "wait for `tumbler ctl start` before each run, until Ctrl-C; needs --lcm-url");
  line.Option("--speed", options.speed, "playback speed; feed-forward is scaled by its square")
      .Within(0.1, 1.0)
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
  line.Option("--json", options.json,
              "write the summary as JSON to this file, or - for standard output");
  line.Option("--csv", options.trace, "write every tick to this CSV file");
  line.Option(
      "--mcap", options.mcap,
      "write the run as MCAP for Foxglove and PlotJuggler, as `tumbler record --mcap` does");
  line.Option("--candump", options.candump,
              "write every frame as `candump -l` logs it, as `tumbler record --candump` does");
  line.Option("--record", options.record,
              "record the whole run in this file, which must not exist (see tumbler record and "
              "tumbler replay)");
  line.Option("--twin", options.twin,
              "sim: the simulated robot as it is, with disturbances (TOML); without it, as the "
              "motion has it");
  line.Option("--truth", options.truth,
              "sim: write what is true of the simulated robot to this LCM log");
}

/// Declares how the thread of the loop is scheduled.
/// @param one  is told of each option.
void DeclareScheduling(CommandLine& line, RunOptions& options, ArmingNames& names,
                       const std::function<CommandLineOption(CommandLineOption)>& one) {
  one(line.Flag("--realtime", options.realtime,
                "SCHED_FIFO and locked memory; a simulation then runs at the pace of the clock, "
                "and ends as on an interface (--end)"));
  one(line.Flag("--without-realtime", options.without_realtime,
                "arm a real bus even though they are not in force"));
  one(line.Option("--scheduling", names.scheduling,
                  "of --realtime: fifo (SCHED_FIFO) or deadline (SCHED_DEADLINE)"))
      .OneOf({"fifo", "deadline"})
      .ShowDefault();
  one(line.Option("--priority", options.scheduling.priority, "of SCHED_FIFO"))
      .Within(1, 99)
      .ShowDefault();
  one(line.Option("--cpu", options.scheduling.cpu,
                  "of --realtime: the processor that the loop runs on; -1: any. Not with deadline"))
      .Within(-1, 1023)
      .ShowDefault();
  one(line.Option("--pace", options.pace,
                  "for tumbler twin with the same --pace on a virtual interface: seconds of the "
                  "robot in a second of the clock"))
      .Within(0.05, 1.0)
      .ShowDefault();
}

/// Declares what is checked and proved before the drives are armed.
void DeclareChecks(CommandLine& line, RunOptions& options,
                   const std::function<CommandLineOption(CommandLineOption)>& one) {
  one(line.Flag("--without-watchdog", options.without_watchdog,
                "arm drives that have no watchdog (watchdog_s = 0)"));
  one(line.Flag(
      "--check-identity", options.check_identity,
      "with --arm, before arming: each drive turns its joint by at most 0.1 rad, with at most "
      "1 N m, and back, one at a time; refused unless its encoder alone moves, and it is the "
      "right joint and direction, which you are asked. The robot has to be held in the air"));
  one(line.Flag("--prove-watchdog", options.prove_watchdog,
                "with --arm, before arming: each drive is left alone, pushing with at most "
                "0.2 N m; refused unless it lets go in its watchdog_s. The robot has to be held in "
                "the air"));
  one(line.Option(
      "--answers", options.answers,
      "of --check-identity: a file with a line for each answer, in place of the terminal"));
  one(line.Option(
          "--moved-within", options.moved_within_rad,
          "refuse to arm when a joint is farther than this from where it was last known, or whole "
          "turns of its drive [rad]"))
      .Within(0.0, 1e6)
      .ShowDefault();
  one(line.Option(
      "--pose", options.pose_file,
      "the file that keeps where the joints were last; by default one for robot and interface "
      "below ~/.local/state/tumbler, and none on virtual interfaces"));
  one(line.Flag(
      "--forget-pose", options.forget_pose,
      "the joints were moved on purpose, and their zeros are right: arm where they are now"));
  one(line.Option(
          "--start-within", options.start_within_rad,
          "refuse to arm when a joint is farther than this from the start of the motion [rad]"))
      .Within(0.0, 1e6)
      .ShowDefault();
  one(line.Flag(
      "--clear", options.clear,
      "before arming tell the drives to forget latched errors, as after a crash of the program "
      "or an emergency stop"));
}

/// Checks that concern several options together.
void CheckTogether(const RunOptions& options) {
  if (!options.key.empty() && options.lcm_url.empty())
    throw UsageError("--key", "is for requests, which come by --lcm-url: give both");
  const bool test = options.latency_test_s > 0 || !options.doctor.empty();
  if (test && !options.bus.empty()) {
    throw std::runtime_error(
        "--latency-test and --doctor play no motion: leave BUS and MOTION out");
  }
  if (!test && (options.bus.empty() || options.motion.empty()))
    throw std::runtime_error("BUS and MOTION are needed (see --help)");
}

/// Refuses options that this run would ignore: who gives one believes that it does something.
void RefuseIgnored(const CommandLine& line, const RunOptions& options) {
  const auto refuse = [&line](std::initializer_list<const char*> names, const std::string& why) {
    for (const char* const name : names) {
      if (line.Given(name)) throw UsageError(name, why);
    }
  };
  if (!options.doctor.empty())
    refuse({"--json", "--latency-test"}, "--doctor has no use for it; leave it out");
  const bool latency_test = options.latency_test_s > 0;
  if (latency_test || !options.doctor.empty()) {
    refuse(
        {"--drives", "--faults", "--bus-faults", "--arm",     "--attended", "--speed", "--pace",
         "--hold-s", "--cycles", "--branch",     "--from",    "--get-ups",  "--log",   "--lcm-url",
         "--key",    "--csv",    "--mcap",       "--candump", "--record",   "--twin",  "--truth"},
        "is about playing a motion, which --latency-test and --doctor do not");
  }
  if (!latency_test) {
    refuse({"--rate-hz"}, "is for --latency-test; a run's rate is rate_hz of its drives file");
  }
  if (options.simulated()) {
    refuse({"--arm", "--without-realtime", "--without-watchdog", "--moved-within", "--forget-pose"},
           "is about motors on an interface; sim drives none");
  }
}

}  // namespace

void DeclareArming(CommandLine& line, RunOptions& options, ArmingNames& names,
                   const CommandLineOption* needed) {
  const auto one = [needed](CommandLineOption option) {
    if (needed != nullptr) option.Needs(*needed);
    return option;
  };
  one(line.Flag("--arm", options.arm,
                "drive the motors; without it a real interface only sees a dry run"));
  DeclareScheduling(line, options, names, one);
  DeclareChecks(line, options, one);
  one(line.Option("--faults", options.faults,
                  "reactions to faults and their limits (TOML), where they are not the defaults"));
  one(line.Option(
          "--end", names.end,
          "what is done at the end with a robot that would drop without torque: safe (the way "
          "to a safe node, else hold), lower (the stiffness fades away in 2 s), hold (until told "
          "to disarm: Ctrl-C, tumbler ctl disarm) or torque-off; by default what the motion's "
          "file says, and safe where it says nothing"))
      .OneOf({kRunEndNames.begin(), kRunEndNames.end()});
  one(line.Option("--from", options.from,
                  "of a sequence with [begin]: the robot lies as at the start of this node, with "
                  "which the run begins; without it the sensor says how it lies, and without a "
                  "sensor it is at the sequence's start"));
  one(line.Option("--get-ups", options.get_ups,
                  "of a sequence with [begin], with a sensor: how often in a run a robot that has "
                  "fallen gets up and goes on; the next fall is a fault"))
      .Within(0, 1000)
      .ShowDefault();
  one(line.Option("--lcm-url", options.lcm_url,
                  "publish live and take commands there, e.g. udpm://239.255.76.67:7667?ttl=0"))
      .LcmUrl();
  one(line.Option("--key", options.key,
                  "of --lcm-url: a file with a key; start, branch and clear have to be signed with "
                  "it (tumbler ctl --key)"));
  one(line.Option(
      "--robot", options.robot,
      "the robot's name in messages, for tumbler ctl --robot; by default this computer's"));
}

void TakeArming(const CommandLine& line, const ArmingNames& names, RunOptions& options) {
  if (options.robot.empty()) {
    std::array<char, 65> name{};
    if (gethostname(name.data(), name.size() - 1) == 0) options.robot = name.data();
  }
  if (names.scheduling == "deadline") options.scheduling.scheduling = Scheduling::kDeadline;
  for (std::size_t i = 0; i < kRunEndNames.size(); ++i) {
    if (names.end == kRunEndNames[i]) options.end = static_cast<RunEnd>(i);
  }
  if (options.scheduling.scheduling == Scheduling::kDeadline && options.scheduling.cpu >= 0) {
    throw std::runtime_error(
        "--cpu: the kernel does not pin threads under SCHED_DEADLINE; use fifo");
  }
  if (options.realtime || options.latency_test_s > 0) return;
  for (const char* const name : {"--scheduling", "--priority", "--cpu"}) {
    if (line.Given(name)) throw UsageError(name, "says how --realtime schedules; give both");
  }
}

RunOptions ReadRunOptions(int argc, char** argv) {
  RunOptions options;
  CommandLine line("Plays a motion primitive on motor drives over CAN, or on a simulated robot.",
                   "tumbler run");
  line.SetFooter(kFooter);
  ArmingNames names;
  DeclareMotion(line, options);
  DeclareArming(line, options, names);
  DeclareRun(line, options);
  options.command_line.assign(argv, argv + argc);
  line.Parse(argc, argv);
  CheckTogether(options);
  TakeArming(line, names, options);
  RefuseIgnored(line, options);
  return options;
}

void CheckOptions(const RunOptions& options, const SequenceFile& file) {
  const SequenceGraph<double>& graph = file.graph;
  if (options.drives.empty() && !options.simulated()) {
    throw std::runtime_error(
        fmt::format("{} is a real bus: say with --drives which drives are on it", options.bus));
  }
  if (!options.bus_faults.empty() && !options.simulated()) {
    throw std::runtime_error("--bus-faults is for the simulated bus: sim");
  }
  if (!options.simulated() && !(options.twin.empty() && options.truth.empty())) {
    throw std::runtime_error(fmt::format(
        "--twin and --truth are about the simulated robot of `sim`; on {} run tumbler twin",
        options.bus));
  }
  if (!options.pose_file.empty() && !options.drives_motors())
    throw std::runtime_error("--pose is for an armed run on an interface");
  if (options.pace != 1 && (options.simulated() || options.dry_run())) {
    throw std::runtime_error("--pace is for an armed run on tumbler twin");
  }
  if (options.cycles != 0 && graph.edge_count == 0) {
    throw UsageError("--cycles", fmt::format("is for sequences that go round; {} ends by itself",
                                             options.motion));
  }
  if (options.checks_drives() && !options.drives_motors()) {
    throw std::runtime_error(
        "--check-identity and --prove-watchdog move the motors: they take an interface and --arm "
        "(simulated drives: tumbler bench sim)");
  }
  if (options.checks_drives() && options.pace != 1)
    throw std::runtime_error("--check-identity and --prove-watchdog keep the drives' own pace");
  if (options.check_identity && options.json == "-")
    throw std::runtime_error("--check-identity asks on standard output: write --json to a file");
  if (!options.answers.empty() && !options.check_identity)
    throw std::runtime_error("--answers is for --check-identity");
  if (options.attended && (options.virtual_time() || options.lcm_url.empty())) {
    throw std::runtime_error(
        "--attended waits for somebody: it takes --lcm-url, and real time (`sim --realtime`, or an "
        "interface with --arm)");
  }
  if (options.virtual_time() && graph.edge_count > 0 && options.cycles == 0 &&
      options.branch.empty() && !options.ended_by_record) {
    throw std::runtime_error(fmt::format(
        "{} goes round until it is stopped, and time here is not real: say with --cycles how often",
        options.motion));
  }
  if (options.virtual_time() && !options.ended_by_record)
    RequireEnd(file, options.cycles, options.branch);
}

}  // namespace tumbler
