// tumbler-ctl: sends an operator's requests to a running tumbler-run, and shows its state, over
// LCM.

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <tumbler/command_t.hpp>

#include "common/command_line.h"
#include "common/printable.h"
#include "common/program.h"
#include "runtime/core/tick.h"
#include "runtime/linux/operator_mailbox.h"
#include "runtime/telemetry/channels.h"
#include "runtime/telemetry/lcm_link.h"
#include "runtime/telemetry/live_view.h"
#include "runtime/telemetry/message_readers.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(It speaks with a tumbler-run that was started with the same --lcm-url, and says what became of the request.

  start         begin a run, where tumbler-run was started with --attended and waits for it
  branch NAME   take this branch of the sequence at the next chance
  finish        end at the next safe node, hold, torque off
  stop          brake at once within the limits, or abort the motion as its file says; the robot is then held where it
                would drop (tumbler-run --end)
  disarm        torque off at once, also of a robot that is held
  clear         forget latched faults, and let the drives forget theirs; only while disarmed
  status        what runs, once
  watch         the same, live, until Ctrl-C; in a pipe one line a second

Exit codes:
  0  done
  1  wrong usage, or no tumbler-run answers there
  2  refused; the reason is printed
  3  a fault is latched (status)

Whoever reaches the network of the URL can send these: keep ttl=0 (this machine only), or a network of the robot's own.)";

using SteadyClock = std::chrono::steady_clock;

volatile std::sig_atomic_t interrupted = 0;
void OnInterrupt(int /*signal*/) { interrupted = 1; }

/// While an object of this class lives, the terminal shows its other screen.
class Screen {
 public:
  Screen() { fmt::print("\x1b[?1049h\x1b[?25l"); }
  ~Screen() {
    fmt::print("\x1b[?25h\x1b[?1049l");
    std::fflush(stdout);
  }
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  static void Draw(const std::string& text) {
    fmt::print("\x1b[H\x1b[2J{}", text);
    std::fflush(stdout);
  }
};

class Remote {
 public:
  /// @param robot  its name; empty where there is only one.
  Remote(const std::string& url, const std::string& robot) : url_(url), robot_(robot), lcm_(url) {
    if (!lcm_.good()) {
      throw std::runtime_error(
          fmt::format("{}: LCM cannot use this URL (udpm needs a multicast route: `ip route add "
                      "224.0.0.0/4 dev IFACE`)",
                      url));
    }
    if (lcm_.getFileno() < 0)
      throw std::runtime_error(fmt::format("{}: no LCM server answers there", url));
    SubscribeToWholeMessages([this] {
      Subscribe<state_t>(kStateChannel);
      Subscribe<event_t>(kEventChannel);
      Subscribe<run_t>(kRunChannel);
    });
  }

  [[nodiscard]] const LiveView& view() const { return view_; }

  /// Takes messages until `done`, but for at most `patience_s`. @returns done().
  bool Wait(double patience_s, const std::function<bool()>& done) {
    const auto until = SteadyClock::now() + std::chrono::duration<double>(patience_s);
    while (!done()) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(until - SteadyClock::now()).count();
      if (left <= 0 || interrupted != 0) return false;
      HandleLcm(lcm_, static_cast<int>(std::min<long>(left, 100)));
    }
    return true;
  }
  /// Waits for the state of the one robot that is meant.
  void WaitForState() {
    if (selected_ == 0 && !Wait(2, [this] { return !robots_.empty(); })) throw Silent();
    if (selected_ == 0 && robot_.empty()) Wait(0.1, [] { return false; });
    if (selected_ == 0 &&
        !Wait(robot_.empty() && robots_.size() == 1 ? 0 : 1, [this] { return Select(); })) {
      throw std::runtime_error(
          robot_.empty()
              ? fmt::format("{} robots answer on {}: {}; say which one with --robot",
                            robots_.size(), url_, Robots())
              : fmt::format("no robot '{}' answers on {}, but {}", robot_, url_, Robots()));
    }
    if (!Wait(2, [this] { return view_.state().has_value(); })) throw Silent();
  }
  /// Looks for another run of the robot after one that is over.
  void LookAgain() {
    selected_ = 0;
    robots_.clear();
    Wait(0.5, [this] { return !robots_.empty() && Select(); });
  }

  /// Sends a request again and again until it is answered, since a datagram may get lost.
  /// @returns the answer.
  state_t Ask(std::int8_t command, const std::string& branch) {
    WaitForState();
    command_t message;
    // The number has to differ from that of any other request.
    message.id = std::uniform_int_distribution<std::uint32_t>(1)(random_);
    message.run = selected_;
    message.command = command;
    message.branch = branch;
    const auto answered = [&] { return view_.state()->request_id == message.id; };
    for (int i = 0; i < 10 && !answered(); ++i) {
      message.seen = view_.state()->number;
      lcm_.publish(kCommandChannel, &message);
      Wait(0.2, answered);
    }
    if (!answered()) throw Silent();
    return *view_.state();
  }

 private:
  template <typename Message>
  void Subscribe(const char* channel) {
    // UndefinedBehaviorSanitizer objects to the overload for member functions.
    lcm_.subscribeFunction(channel, &Remote::Handle<Message>, this)->setQueueCapacity(0);
  }
  template <typename Message>
  static void Handle(const lcm::ReceiveBuffer* buffer, const std::string& /*channel*/,
                     Remote* self) {
    const auto message = ReadMessage<Message>(buffer->data, buffer->data_size);
    if (!message) return;
    self->Note(*message);
    if (self->selected_ != 0 && message->run == self->selected_) self->view_.Take(*message);
  }
  void Note(const state_t& message) { robots_.try_emplace(message.run); }
  void Note(const run_t& message) { robots_[message.run] = message.robot; }
  void Note(const event_t& /*message*/) {}
  /// Chooses the only run, or that of the robot that was named. @returns whether there is one.
  bool Select() {
    if (robot_.empty()) {
      if (robots_.size() == 1) selected_ = robots_.begin()->first;
      return selected_ != 0;
    }
    for (const auto& [run, robot] : robots_) {
      if (robot == robot_) selected_ = run;
    }
    return selected_ != 0;
  }
  /// The robots that answer, by their names.
  [[nodiscard]] std::string Robots() const {
    std::string names;
    for (const auto& [run, robot] : robots_) {
      names += fmt::format("{}'{}'", names.empty() ? "" : ", ", robot);
    }
    return names;
  }
  [[nodiscard]] std::runtime_error Silent() const {
    return std::runtime_error(
        fmt::format("no answer on {}: is tumbler-run there, with --lcm-url {}?", url_, url_));
  }

  std::string url_;
  std::string robot_;
  std::map<std::int64_t, std::string> robots_;  // the runs that were heard, with their robots
  std::int64_t selected_ = 0;                   // the run that is meant; 0: not known yet
  lcm::LCM lcm_;
  LiveView view_;
  std::random_device random_;
};

/// Waits until a run that was started is armed, or refused after all.
ExitStatus Armed(Remote& remote) {
  constexpr double kPatience_s = 10;  // Drives may have to be set up first.
  Refusal last = Refusal::kNone;
  auto refused_at = SteadyClock::now();
  const bool decided = remote.Wait(kPatience_s, [&] {
    const state_t& state = *remote.view().state();
    if (state.state != state_t::STATE_DISARMED) return true;
    const auto now = SteadyClock::now();
    if (state.refusal != 0) {
      last = static_cast<Refusal>(state.refusal);
      refused_at = now;
    }
    return last != Refusal::kNone && now - refused_at > std::chrono::milliseconds(500);
  });
  if (!decided || last == Refusal::kNone ||
      remote.view().state()->state != state_t::STATE_DISARMED) {
    return ExitStatus::kDone;
  }
  fmt::print(stderr, "tumbler-ctl: the run was refused: {}\n", ToString(last));
  return ExitStatus::kRefused;
}

ExitStatus Request(Remote& remote, std::int8_t command, const std::string& branch) {
  const char* name = ToString(static_cast<OperatorRequest>(command));
  const state_t answer = remote.Ask(command, branch);
  const auto refusal = static_cast<Refusal>(answer.request_refusal);
  if (refusal == Refusal::kNone) {
    fmt::print("{}: taken at tick {}\n", name, answer.tick);
    return command == command_t::START ? Armed(remote) : ExitStatus::kDone;
  }
  fmt::print(
      stderr, "tumbler-ctl: {} refused: {} (state {})\n", name,
      refusal == Refusal::kNoSuchBranch ? fmt::format("no branch '{}'", branch) : ToString(refusal),
      ToString(static_cast<ExecutorState>(answer.state)));
  return ExitStatus::kRefused;
}

ExitStatus Status(Remote& remote, bool json) {
  remote.WaitForState();
  remote.Wait(1.5, [&] { return remote.view().run().has_value(); });
  fmt::print("{}", json ? remote.view().ToJson() : Printable(remote.view().Screen()));
  return remote.view().state()->faults == 0 ? ExitStatus::kDone : ExitStatus::kFault;
}

/// Columns and rows of the terminal; where it does not say, those of the oldest.
std::pair<int, int> TerminalSize() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0)
    return {80, 24};
  return {size.ws_col, size.ws_row};
}

ExitStatus Watch(Remote& remote) {
  const bool terminal = isatty(STDOUT_FILENO) != 0;
  remote.WaitForState();
  std::optional<Screen> screen;
  if (terminal) screen.emplace();
  auto heard = SteadyClock::now();
  std::int64_t number = -1;
  while (interrupted == 0) {
    remote.Wait(terminal ? 0.1 : 1, [] { return false; });
    const LiveView& view = remote.view();
    if (view.state()->number != number) heard = SteadyClock::now();
    number = view.state()->number;
    const double silent_s = std::chrono::duration<double>(SteadyClock::now() - heard).count();
    if (silent_s > 1) remote.LookAgain();
    const std::string silence =
        silent_s > 1 ? fmt::format("NOTHING RECEIVED for {:.0f} s", silent_s) : "";
    if (terminal) {
      const auto [columns, rows] = TerminalSize();
      const std::string first = silence.empty() ? "" : silence + "\n";
      // The cursor needs the last row, since a line's end there would scroll.
      Screen::Draw(Fitted(first + Printable(view.Screen(columns)), columns, rows - 1));
    } else {
      fmt::print("{}\n", silence.empty() ? Printable(view.Line()) : silence);
      std::fflush(stdout);
    }
  }
  return ExitStatus::kDone;
}

ExitStatus Main(int argc, char** argv) {
  std::string url = "udpm://239.255.76.67:7667?ttl=0";
  std::string robot;
  std::string branch;
  bool json = false;
  CommandLine line("Asks a running tumbler-run for something, or shows what it does.",
                   "tumbler-ctl");
  line.SetFooter(kFooter);
  line.RequireSubcommand();
  line.AllowOptionsAfterSubcommand();
  line.Option("--lcm-url", url, "where tumbler-run publishes").LcmUrl().ShowDefault();
  line.Option("--robot", robot, "the robot's name, where several publish there");
  line.Subcommand("start", "begin a run");
  line.Subcommand("branch", "take a branch").Option("NAME", branch, "of it").Required();
  line.Subcommand("finish", "end at the next safe node");
  line.Subcommand("stop", "brake at once");
  line.Subcommand("disarm", "torque off at once");
  line.Subcommand("clear", "forget latched faults");
  line.Subcommand("status", "what runs, once").Flag("--json", json, "as JSON");
  line.Subcommand("watch", "what runs, live");
  line.Parse(argc, argv);
  struct sigaction action {};
  action.sa_handler = OnInterrupt;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  Remote remote(url, robot);
  const std::string name = line.given_subcommand();
  if (name == "status") return Status(remote, json);
  if (name == "watch") return Watch(remote);
  for (int command = command_t::START; command <= command_t::DISARM; ++command) {
    if (name == ToString(static_cast<OperatorRequest>(command)))
      return Request(remote, static_cast<std::int8_t>(command), branch);
  }
  throw std::logic_error("a subcommand without a request");
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler-ctl", argc, argv, tumbler::Main);
}
