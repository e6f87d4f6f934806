// tumbler twin: simulates the robot, with its drives on a SocketCAN interface and the physics
// behind them.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/json.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/drive_server.h"
#include "firmware_interface/devices/drives_toml.h"
#include "offline/twin/simulated_robot.h"
#include "offline/twin/truth_sampler.h"
#include "offline/twin/twin_toml.h"
#include "runtime/record/telemetry.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(The robot and the ground are those of MOTION, a primitive or a sequence; FILE of --twin says what differs, what
happens to the robot, and may name motion and drives (docs/formats.md). What is not given is as in `tumbler run sim`.

The robot is held by hand, joints and all, until every drive is enabled. From then on physics takes its course at the
pace of the clock: with the torque off it collapses. It falls when it comes to rest in a pose that no motion begins or
ends in, or touches with a link that must not; a robot that is let go in such a pose does not fall.

Prints, with the time of `candump -L`, when a drive is enabled or disabled, when its watchdog takes over, where the
robot comes to rest, and falls.

Signals:
  INT, TERM   end
  USR1        somebody picks the robot up, puts it where it began, and holds it as at the start
An interface that goes down or away is waited for.

Exit codes:
  0    the robot did not fall
  1    wrong usage, or a file or interface that cannot be used
  4    it fell, or true states are in no output, for their many contacts)";

struct Options {
  std::string interface;
  std::string motion;
  std::string config;
  std::string drives;
  std::string lcm_url;
  std::string truth;
  std::string json;
  double pace = 1;
};

volatile std::sig_atomic_t stop_wanted = 0;
volatile std::sig_atomic_t put_back_wanted = 0;
void OnStop(int /*signal*/) { stop_wanted = 1; }
void OnPutBack(int /*signal*/) { put_back_wanted = 1; }

void CatchSignals() {
  struct sigaction action {};
  action.sa_handler = OnStop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  action.sa_handler = OnPutBack;
  sigaction(SIGUSR1, &action, nullptr);
}

std::string JsonOf(const Options& options, const SimulatedRobot& robot) {
  const TwinState& state = robot.state();
  Json json;
  json["bus"] = options.interface;
  json["time_s"] = static_cast<double>(state.time_ns) / 1e9;
  json["falls"] = robot.posture().falls();
  json["overlaps"] = robot.posture().overlaps();
  json["root_x_m"] = state.root_x_m;
  json["root_z_m"] = state.root_z_m;
  if (state.is_in_space()) {
    json["root_y_m"] = state.root_y_m;
    json["root_quaternion"] = Json::Array();
    for (const double part : state.root_quaternion) json["root_quaternion"].Append(part);
  } else {
    json["root_pitch_rad"] = state.root_pitch_rad;
  }
  json["peak_penetration_m"] = state.peak_penetration_m;
  json["joints"] = Json::Array();
  for (std::size_t j = 0; j < robot.joint_count(); ++j) {
    const SimulatedDrive& drive = robot.drive(j);
    json["joints"].Append({{"name", robot.joints()[j]},
                           {"position_rad", state.joint_positions_rad[j]},
                           {"temperature_c", drive.temperature_c()},
                           {"frames_heard", drive.frames_received()},
                           {"setpoints", drive.setpoints_received()},
                           {"watchdog_expiries", drive.watchdog_expiries()}});
  }
  json["passive_joints"] = Json::Array();
  for (std::size_t i = 0; i < robot.passive_joints().size(); ++i) {
    json["passive_joints"].Append(
        {{"name", robot.passive_joints()[i]}, {"position_rad", state.passive_positions_rad[i]}});
  }
  json["events"] = Json::Array();
  for (const PostureEvent& event : robot.posture().events()) {
    constexpr std::array kNames = {"rest", "fall", "overlap"};  // of PostureEvent::Kind
    Json told = {{"event", kNames[static_cast<std::size_t>(event.kind)]},
                 {"time_s", static_cast<double>(event.time_ns) / 1e9},
                 {"pose", event.pose},
                 {"cause", event.cause},
                 {"root_x_m", event.root_x_m},
                 {"root_z_m", event.root_z_m}};
    if (event.in_space) {
      told["root_y_m"] = event.root_y_m;
      told["root_tilt_rad"] = event.tilt_rad;
      told["root_heading_rad"] = event.heading_rad;
    } else {
      told["root_pitch_rad"] = event.root_pitch_rad;
    }
    json["events"].Append(std::move(told));
  }
  return json.Dump(2) + '\n';
}

/// Returns `given`, or, when that is empty, the file that the twin file names.
std::string FileOf(const std::string& given, const std::string& named, const char* what,
                   const char* option) {
  if (!given.empty()) return given;
  if (!named.empty()) return named;
  throw std::runtime_error(
      fmt::format("which {}? Give {}, or a --twin file with `{} = \"...\"`", what, option, what));
}

std::int64_t UtimeNow() {
  const auto since_epoch = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(since_epoch).count();
}

ExitStatus Run(const Options& options) {
  TwinSources sources;
  if (!options.config.empty()) sources = ReadTwinSources(options.config);
  std::vector<std::string> inputs = FilesOfTwin(options.config);
  const SimulatedMotion motion(
      LoadMotion(FileOf(options.motion, sources.motion, "motion", "MOTION"), NotingReader(inputs)),
      TaskSpaces::kPlaneAndSpace);
  const std::string drives_file = FileOf(options.drives, sources.drives, "drives", "--drives");
  inputs.push_back(drives_file);
  const DrivesConfig drives = LoadDrives(drives_file);
  CheckDistinct(inputs, {options.truth, options.json});
  CheckResult(options.json);
  SimulatedRobotConfig config;
  if (!options.config.empty()) config = LoadTwin(options.config, motion);
  SimulatedRobot robot(motion, drives, config);
  TelemetryConfig outputs;
  outputs.truth_file = options.truth;
  outputs.lcm_url = options.lcm_url;
  outputs.utime_at_zero_us = UtimeNow();
  Telemetry telemetry(outputs);
  TickFeed feed({&telemetry});
  TruthSampler truth([&feed](std::span<const std::uint8_t> state) { feed.PushTruth(state); });

  std::vector<ServedDrive> served;
  for (std::size_t j = 0; j < robot.joint_count(); ++j)
    served.push_back({robot.joints()[j], &robot.drive(j)});
  DriveServer server(
      options.interface, drives, robot.bus(), std::move(served),
      [&](std::int64_t time_ns) {
        robot.AdvanceTo(time_ns);
        truth.Observe(robot);
        feed.Drain();
      },
      options.pace);
  fmt::print("{} with {} drives on {}, held\n", motion.file().graph.name.view(),
             robot.joint_count(), options.interface);
  std::fflush(stdout);
  CatchSignals();

  constexpr std::int64_t kPeriod_ns = 1'000'000;
  std::size_t told = 0;
  bool held = robot.state().held;
  for (std::int64_t deadline_ns = 0; stop_wanted == 0;) {
    if (deadline_ns <= server.now_ns()) deadline_ns += kPeriod_ns;
    if (deadline_ns <= server.now_ns())
      deadline_ns = (server.now_ns() / kPeriod_ns + 1) * kPeriod_ns;
    server.ServeUntil(deadline_ns);
    if (put_back_wanted != 0) {
      put_back_wanted = 0;
      robot.PutBack();
      DriveServer::Say("put back where it began");
    }
    if (robot.state().held != held) {
      held = !held;
      DriveServer::Say(held ? "held" : "let go");
    }
    const std::vector<PostureEvent>& events = robot.posture().events();
    const std::size_t left_out = robot.posture().left_out();
    for (told = std::max(told, left_out); told < left_out + events.size(); ++told)
      DriveServer::Say(Describe(events[told - left_out]));
  }
  if (!options.json.empty()) WriteResult(options.json, JsonOf(options, robot));
  telemetry.Stop();
  const bool fell = robot.posture().falls() + robot.posture().overlaps() > 0;
  const bool has_output = !(options.truth + options.lcm_url).empty();
  const std::string missing = has_output ? feed.TruthProblem() : "";
  if (!missing.empty()) fmt::print(stderr, "tumbler twin: {}\n", missing);
  return fell || !missing.empty() ? ExitStatus::kAmiss : ExitStatus::kDone;
}

ExitStatus Main(int argc, char** argv) {
  Options options;
  CommandLine line("The robot as a process: simulated drives and physics on a SocketCAN interface.",
                   "tumbler twin");
  line.SetFooter(kFooter);
  line.Option("BUS", options.interface, "SocketCAN interface, e.g. vcan0").Required();
  line.Option("MOTION", options.motion, "primitive or sequence file (TOML)");
  line.Option("--twin", options.config, "the robot as it is, with disturbances (TOML)");
  line.Option("--drives", options.drives, "drive configuration (TOML)");
  line.Option("--lcm-url", options.lcm_url,
              "publish its true state there, e.g. udpm://239.255.76.67:7667?ttl=0")
      .LcmUrl();
  line.Option("--truth", options.truth, "write its true state to this LCM log");
  line.Option("--pace", options.pace,
              "seconds of the robot in a second of the clock; tumbler run needs the same")
      .Within(0.05, 1.0)
      .ShowDefault();
  line.Option("--json", options.json,
              "at the end, write what happened to this file, or - for standard output");
  line.Parse(argc, argv);
  return Run(options);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler twin", argc, argv, tumbler::Main);
}
