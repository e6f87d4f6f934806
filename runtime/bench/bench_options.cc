#include "runtime/bench/bench_options.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "common/files/command_line.h"
#include "common/files/program.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(BUS is a SocketCAN interface such as can0, or `sim`: simulated drives on a simulated bus, each with a rotor, on which
everything can be tried. There the questions are answered by what is true; with --ask you answer them.

Without --arm no motor turns on an interface, and no drive gets another zero of its own. Every motion is slow and small: within --amplitude of where the joint was
when its drive was enabled, at most --velocity fast and, where the drive's protocol carries gains, with at most --torque.
One drive is enabled at a time, and Ctrl-C takes its torque off at any time. Do it with the motors free of the robot, or
with the robot held in the air, and with an emergency stop at hand.

Questions are answered at the terminal, by lines on standard input, or by those of --answers.

Exit codes:
  0    done; what was found is right, or set right in the file that was written
  1    wrong usage, or a file or interface that cannot be used
  2    refused, or the way cannot be gone to its end: the message says why
  3    a fault of a drive or of the bus; the torque is off
  4    done, but something remains to be set right on the robot
  130  stopped by Ctrl-C; the torque is off)";

void DeclareBench(CommandLine& line, BenchOptions& options) {
  line.Option("BUS", options.bus, "`sim` or a SocketCAN interface").Required();
  line.Option(
      "--drives", options.drives,
      "drives file (TOML): what is thought to be on the bus; all commands but scan need it");
  line.Option("--motion", options.motion,
              "primitive or sequence file (TOML): joints, their limits, and the pose of the start, "
              "in which zeros are found");
  line.Flag("--arm", options.arm, "let motors turn on an interface");
  line.Option("--answers", options.answers,
              "file with the answers, a line for each question; # begins a comment");
  line.Flag("--yes", options.yes, "the way is clear for every motion");
  line.Flag("--ask", options.ask, "sim: ask, instead of answering by what is true");
  line.Flag("--clear", options.clear, "let the drives forget latched errors first");
  line.Option("--json", options.json, "write the results to this file, or - for standard output");
  line.Option("--actual", options.actual,
              "sim: drives file of the drives as they are; without it they are as --drives says");
  line.Option("--bus-faults", options.bus_faults, "sim: what is wrong with the bus (TOML)");
  line.Option("--position", options.positions,
              "sim: a joint's true angle at the start, JOINT=RAD; may be repeated; without it that "
              "of the motion's start, or 0")
      .TakesOneValueEachTime();
}

void DeclareBounds(CommandLine& line, BenchOptions& options) {
  BenchBounds& bounds = options.config.bounds;
  line.Option("--amplitude", bounds.amplitude_rad, "farthest way of a motion [rad]")
      .Within(0.001, 1.0)
      .ShowDefault();
  line.Option("--velocity", bounds.speed_rad_s, "fastest setpoint [rad/s]")
      .Within(0.01, 5.0)
      .ShowDefault();
  line.Option("--torque", bounds.torque_nm, "most torque that setpoints ask for [N m]")
      .Within(0.01, 50.0)
      .ShowDefault();
  line.Option("--kp", bounds.kp_nm_per_rad, "stiffness, where the protocol carries it [N m/rad]")
      .Within(0.1, 500.0)
      .ShowDefault();
  line.Option("--kd", bounds.kd_nm_s_per_rad, "damping, likewise [N m s/rad]")
      .Within(0.0, 50.0)
      .ShowDefault();
}

void DeclareAsked(CommandLine& line, ScanConfig& scan) {
  line.Option("--listen", scan.listen_s, "how long to listen first [s]")
      .Within(0.05, 60.0)
      .ShowDefault();
  line.Option("--mit-last", scan.mit_last, "MIT drives are asked for from 1 to this CAN_ID")
      .Within(1, 255)
      .ShowDefault();
}

void DeclareScan(CommandLine line, BenchOptions& options) {
  ScanConfig& scan = options.config.scan;
  line.Flag("--passive", scan.passive, "only listen");
  DeclareAsked(line, scan);
}

void DeclareStep(CommandLine& line, BenchOptions& options) {
  line.Option("--size", options.config.step.size_rad, "of the step [rad]")
      .Within(0.001, 0.5)
      .ShowDefault();
  line.Option("--report", options.page, "write a page with the drawing, an HTML file");
}

void DeclareSeconds(CommandLine& line, BenchOptions& options) {
  line.Option("--seconds", options.config.replies_s, "how long replies are measured [s]")
      .Within(0.1, 3600.0)
      .ShowDefault();
}

void DeclareWrite(CommandLine& line, BenchOptions& options) {
  line.Option("--out", options.write, "drives file to write, as it was found");
  line.Flag("--overwrite", options.overwrite, "replace it when it exists");
}

void DeclareCommands(CommandLine& line, BenchOptions& options) {
  DeclareScan(line.Subcommand("scan", "look for drives of all protocols; nothing moves"), options);
  line.Subcommand("read", "show what the drives of the file report; nothing moves");
  CommandLine dbc = line.Subcommand(
      "dbc", "describe the frames of the drives for bus analysers; the bus is not touched");
  dbc.Option("--out", options.write, "DBC file to write");
  dbc.Flag("--overwrite", options.overwrite, "replace it when it exists");
  const auto of_joint = [&](const char* name, const char* help) {
    CommandLine command = line.Subcommand(name, help);
    command.Option("JOINT", options.joint, "joint in the drives file");
    return command;
  };
  of_joint("identify", "a small motion of one drive, or of each: which joint turns?");
  CommandLine jog = of_joint("jog", "turn one joint a little, and back");
  jog.Option("--by", options.by_rad, "how far, with its sign [rad]")
      .Within(-1.0, 1.0)
      .ShowDefault();
  CommandLine zero = of_joint("zero", "find a joint's zero in a known pose; nothing moves");
  zero.Option("--at", options.at_rad, "angle of the pose [rad]; without it that of the motion")
      .TakesValues(1, "RAD");
  zero.Flag("--in-drive", options.in_drive,
            "MIT: let the drive take this place as its own zero, too; needs --out, and --arm on an "
            "interface");
  DeclareWrite(zero, options);
  of_joint("check", "direction of a joint, by a small motion, and its way, by hand");
  CommandLine step = of_joint("step", "the response of a joint to a step");
  DeclareStep(step, options);
  of_joint("watchdog", "stay silent: does the drive let go, and when?");
  CommandLine latency = line.Subcommand("latency", "times and losses of replies; nothing moves");
  DeclareSeconds(latency, options);
  CommandLine all = line.Subcommand("commission", "the whole way, and the drives file as it is");
  DeclareWrite(all, options);
  DeclareAsked(all, options.config.scan);
  DeclareSeconds(all, options);
  DeclareStep(all, options);
  all.Flag("--without-turning", options.without_turning,
           "leave out turning the joints by hand through their ways");
}

void CheckStep(const BenchOptions& options) {
  const BenchBounds& bounds = options.config.bounds;
  const StepConfig& step = options.config.step;
  if (step.size_rad > bounds.amplitude_rad) {
    throw UsageError(
        "--size", fmt::format("is {}; --amplitude allows {}", step.size_rad, bounds.amplitude_rad));
  }
  if (bounds.kp_nm_per_rad * step.size_rad > bounds.torque_nm) {
    throw UsageError("--kp", fmt::format("is {}, so that a step of {} rad asks for {} N m; "
                                         "--torque allows {}",
                                         bounds.kp_nm_per_rad, step.size_rad,
                                         bounds.kp_nm_per_rad * step.size_rad, bounds.torque_nm));
  }
}

void CheckBench(const BenchOptions& options) {
  const BenchBounds& bounds = options.config.bounds;
  for (const double at_rad : options.at_rad) {
    if (!(std::abs(at_rad) <= 1000))
      throw UsageError("--at", fmt::format("is {}; allowed: -1000 ... 1000", at_rad));
  }
  const bool needs_drives = !(options.command == "scan" && !options.simulated());
  if (needs_drives && options.drives.empty() && options.actual.empty())
    throw UsageError("--drives", "is needed: which drives are on the bus?");
  if (options.command != "scan" && options.drives.empty())
    throw UsageError("--drives", "is needed: which drives are thought to be on the bus?");
  if (!options.simulated() && (!options.actual.empty() || !options.bus_faults.empty() ||
                               !options.positions.empty() || options.ask)) {
    throw UsageError("--actual, --bus-faults, --position and --ask are for the bus sim");
  }
  const bool needs_motion = options.command == "commission" || options.command == "check" ||
                            (options.command == "zero" && options.at_rad.empty());
  if (needs_motion && options.motion.empty())
    throw UsageError("--motion", "is needed: joints, limits and the pose of the start");
  const bool of_one = options.command == "jog" || options.command == "step";
  if (of_one && options.joint.empty()) throw UsageError("JOINT", "is needed: which one?");
  if (std::abs(options.by_rad) > bounds.amplitude_rad) {
    throw UsageError(
        "--by", fmt::format("is {}; --amplitude allows {}", options.by_rad, bounds.amplitude_rad));
  }
  if (options.command == "step" || options.command == "commission") CheckStep(options);
  if (options.command == "commission" && options.write.empty())
    throw UsageError("--out", "is needed: where is the drives file to go?");
  if (options.command == "dbc" && options.write.empty())
    throw UsageError("--out", "is needed: where is the description to go?");
  if (options.in_drive && options.write.empty()) {
    throw UsageError("--out",
                     "is needed with --in-drive: the drives file does not hold any longer then");
  }
  if (options.moves() && !options.simulated() && !options.arm) {
    if (options.command == "zero") {
      throw Refused(
          fmt::format("zero --in-drive changes the zeros of drives on {}: say so with "
                      "--arm",
                      options.bus));
    }
    throw Refused(fmt::format("{} turns motors on {}: say so with --arm, when nobody is in the way",
                              options.command, options.bus));
  }
}

}  // namespace

BenchOptions ReadBenchOptions(int argc, char** argv) {
  BenchOptions options;
  CommandLine line("Commissions motor drives over CAN: from a box of drives to a drives file.",
                   "tumbler bench");
  line.SetFooter(kFooter);
  DeclareBench(line, options);
  DeclareBounds(line, options);
  line.AllowOptionsAfterSubcommand();
  DeclareCommands(line, options);
  line.RequireSubcommand();
  line.Parse(argc, argv);
  options.command = line.given_subcommand();
  options.config.step.kp_nm_per_rad = options.config.bounds.kp_nm_per_rad;
  options.config.step.kd_nm_s_per_rad = options.config.bounds.kd_nm_s_per_rad;
  options.config.turn_by_hand = !options.without_turning;
  CheckBench(options);
  return options;
}

}  // namespace tumbler
