// tumbler-view: shows a run in a browser, while it happens or from its record.

#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <memory>
#include <random>
#include <string>

#include "common/files/command_line.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/sequence_toml.h"
#include "offline/pages/live_run.h"
#include "offline/pages/page_file.h"
#include "offline/pages/recorded_view.h"
#include "offline/pages/report_page.h"
#include "offline/pages/view_feed.h"
#include "offline/pages/view_server.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(Open the address that it prints. The page shows a run that was started with the same --lcm-url as it happens, or plays
a record. Its buttons `Stop` and `Torque off` ask for the same as `tumbler-ctl stop` and `disarm`. Nothing here begins a
motion. They are no emergency stop: have a switch that cuts the power.

Telemetry does not say what the robot looks like. --motion does: the primitive or sequence that is played.

Exit codes:
  0  done: ended by Ctrl-C
  1  wrong usage, or a file, URL or port that cannot be used)";

struct Arguments {
  std::string record;
  std::string url;
  std::string motion;
  std::string robot;
  std::string bind = "127.0.0.1";
  int port = 7580;
};

/// 128 bits that nobody guesses.
std::string RandomToken() {
  std::random_device random;
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", random());
  return token;
}

/// Holds back the signals that end the program, from all threads.
sigset_t HoldSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, signal);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

/// Serves the page until a signal ends the program.
void Serve(const ViewServerConfig& config, const std::string& what, const sigset_t& signals) {
  const ViewServer server(config);
  fmt::print("{}: {}\nCtrl-C ends it.\n", Printable(what), server.url());
  std::fflush(stdout);
  int signal = 0;
  sigwait(&signals, &signal);
}

ExitStatus ShowRecord(const Arguments& arguments, const sigset_t& signals) {
  ViewServerConfig config;
  config.bind = arguments.bind;
  config.port = arguments.port;
  config.token = RandomToken();
  config.page = FillPage(ViewPage(), arguments.record, RecordedView(arguments.record));
  Serve(config, arguments.record, signals);
  return ExitStatus::kDone;
}

ExitStatus ShowLive(const Arguments& arguments, const sigset_t& signals) {
  std::unique_ptr<ViewedRobot> robot;
  Json data = {{"mode", "live"}, {"name", arguments.url}, {"scene", nullptr}};
  if (!arguments.motion.empty()) {
    robot = std::make_unique<ViewedRobot>(LoadMotion(arguments.motion));
    data["scene"] = robot->Scene();
  }
  ViewFeed feed;
  LiveRun run(arguments.url, arguments.robot, std::move(robot), feed);
  ViewServerConfig config;
  config.bind = arguments.bind;
  config.port = arguments.port;
  config.token = RandomToken();
  config.page = FillPage(ViewPage(), arguments.url, data);
  config.feed = &feed;
  config.end_motion = [&run](bool disarm, const std::string& number) {
    return run.Ask(disarm ? EndRequest::kDisarm : EndRequest::kStop, number);
  };
  Serve(config, arguments.url, signals);
  return ExitStatus::kDone;
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line("Shows a run in a browser, while it happens or from its record.",
                   "tumbler-view");
  line.SetFooter(kFooter);
  auto record = line.Option("RECORD", arguments.record, "flight record (tumbler-run --record)");
  auto url = line.Option("--lcm-url", arguments.url,
                         "where tumbler-run publishes, e.g. udpm://239.255.76.67:7667?ttl=0")
                 .LcmUrl()
                 .Excludes(record);
  line.Option("--motion", arguments.motion,
              "the primitive or sequence that is played, for the picture")
      .Needs(url);
  line.Option("--robot", arguments.robot, "the robot's name, where several publish there")
      .Needs(url);
  line.Option(
          "--bind", arguments.bind,
          "address to listen at; any other than a loopback lets other machines see and stop the "
          "run, if they know the page's address")
      .ShowDefault();
  line.Option("--port", arguments.port, "port to listen at; 0: any that is free")
      .Within(0, 65535)
      .ShowDefault();
  line.Parse(argc, argv);
  if (arguments.record.empty() && arguments.url.empty()) {
    throw UsageError("RECORD", "is missing, and so is --lcm-url; give the one or the other");
  }
  const sigset_t signals = HoldSignals();
  return arguments.url.empty() ? ShowRecord(arguments, signals) : ShowLive(arguments, signals);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler-view", argc, argv, tumbler::Main);
}
