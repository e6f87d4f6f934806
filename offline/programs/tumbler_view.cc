// tumbler view: shows a run in a browser, while it happens or from its record, or writes the page
// of several.

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
#include "offline/programs/view_report.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(Open the address that it prints. The page shows a run that was started with the same --lcm-url as it happens, or plays
a record. Its buttons `Stop` and `Torque off` ask for the same as `tumbler ctl stop` and `disarm`. Nothing here begins a
motion. They are no emergency stop: have a switch that cuts the power.

Telemetry does not say what the robot looks like. --motion does: the primitive or sequence that is played.

With --out nothing is served: a page is written that needs no network, with plan, command, measurement and truth of every
joint on one axis of time, the robots of plan and truth, faults and transitions, latencies, and how runs differ.

Exit codes:
  0  done: the page is written, or it was ended by Ctrl-C
  1  wrong usage, or a file, URL or port that cannot be used; nothing was written
  4  done, but parts of a record are damaged: the page shows the rest)";

struct Arguments {
  ReportArguments report;  ///< Its files are those of the command line.
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
  const std::string& record = arguments.report.files.front();
  ViewServerConfig config;
  config.bind = arguments.bind;
  config.port = arguments.port;
  config.token = RandomToken();
  const RecordedRun run = RecordedView(record);
  config.page = FillPage(ViewPage(), record, run.data);
  for (const std::string& remark : run.remarks)
    fmt::print(stderr, "{}\n", Printable(fmt::format("{}: {}", record, remark)));
  Serve(config, record, signals);
  return run.remarks.empty() ? ExitStatus::kDone : ExitStatus::kAmiss;
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
  ReportArguments& report = arguments.report;
  CommandLine line(
      "Shows a run in a browser, while it happens or from its record, or writes a page of runs and "
      "plans.",
      "tumbler view");
  line.SetFooter(kFooter);
  auto files = line.Option("RECORD|PRIMITIVE", report.files,
                           "flight record (`tumbler run --record`); with --out several of one "
                           "robot, and primitives");
  auto url = line.Option("--lcm-url", arguments.url,
                         "where `tumbler run` publishes, e.g. udpm://239.255.76.67:7667?ttl=0")
                 .LcmUrl()
                 .Excludes(files);
  line.Option("--motion", arguments.motion,
              "the primitive or sequence that is played, for the picture")
      .Needs(url);
  line.Option("--robot", arguments.robot, "the robot's name, where several publish there")
      .Needs(url);
  auto bind =
      line.Option(
              "--bind", arguments.bind,
              "address to listen at; any other than a loopback lets other machines see and stop "
              "the run, if they know the page's address")
          .ShowDefault();
  auto port = line.Option("--port", arguments.port, "port to listen at; 0: any that is free")
                  .Within(0, 65535)
                  .ShowDefault();
  auto out = line.Option("--out", report.out,
                         "write the page of the records to this file, *.html, or into this folder "
                         "as index.html")
                 .Excludes(url)
                 .Excludes(bind)
                 .Excludes(port);
  line.Option(
          "--truth", report.truths,
          "with --out: LCM log with TUMBLER_TRUTH (`tumbler twin --truth`) of the first record; "
          "given again, of the second, ...")
      .TakesOneValueEachTime()
      .Needs(out);
  line.Option("--ticks", report.options.ticks_max,
              "with --out: how many ticks of each run the plots have, and those that stand out; "
              "figures are of all ticks")
      .Within(100, 200'000)
      .ShowDefault()
      .Needs(out);
  line.Option("--from-s", report.options.from_s,
              "with --out: show the runs from this time on only [s]; 0 is where the motion begins")
      .Needs(out);
  line.Option("--to-s", report.options.to_s, "with --out: show the runs up to this time only [s]")
      .Needs(out);
  line.Parse(argc, argv);
  if (line.Given("--out")) {
    if (report.files.empty()) throw UsageError("RECORD|PRIMITIVE", "is required");
    CheckReport(report);
    return WriteReportOfRuns(report);
  }
  if (report.files.empty() && arguments.url.empty()) {
    throw UsageError("RECORD", "is missing, and so is --lcm-url; give the one or the other");
  }
  if (report.files.size() > 1) {
    throw UsageError("RECORD",
                     "is one where it is shown in a browser; --out writes a page of several");
  }
  const sigset_t signals = HoldSignals();
  return arguments.url.empty() ? ShowRecord(arguments, signals) : ShowLive(arguments, signals);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler view", argc, argv, tumbler::Main);
}
