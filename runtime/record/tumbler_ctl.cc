// tumbler ctl: sends an operator's requests to a running tumbler run, and shows its state, over
// LCM.

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <tumbler/command_t.hpp>
#include <utility>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/executor/tick.h"
#include "runtime/record/channels.h"
#include "runtime/record/heard_runs.h"
#include "runtime/record/lcm_link.h"
#include "runtime/record/live_view.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/request_key.h"
#include "runtime/record/rest_request.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(It speaks with a tumbler run that was started with the same --lcm-url, and says what became of the request.

  start         begin a run, where tumbler run was started with --attended and waits for it
  branch NAME   take this branch of the sequence at the next chance
  finish        end at the next safe node, hold, torque off
  stop          brake at once within the limits, or abort the motion as its file says; the robot is then held where it
                would drop (tumbler run --end)
  disarm        torque off at once, also of a robot that is held
  clear         forget latched faults, and let the drives forget theirs; only while disarmed
  status        what runs, once
  watch         the same, live, until Ctrl-C; in a pipe one line a second

finish, stop and disarm go to every run of the robot that is heard, which may be a live one and logs that are played,
and are obeyed without a key. The others want to be clear about which run is meant.

Exit codes:
  0  done
  1  wrong usage, or no tumbler run answers there
  2  refused; the reason is printed
  3  a fault is latched (status)
  4  some run has taken it, but another one that is heard does not answer, as a log that is played

Whoever reaches the network of the URL can send these: keep ttl=0 (this machine only), a network of the robot's own, or
give the run a key.)";

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
  Remote(const std::string& url, const std::string& robot, std::optional<RequestKey> key)
      : url_(url), robot_(robot), key_(std::move(key)), lcm_(url) {
    RequireListening(lcm_, url);
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
  /// Waits for the state of the one run that is meant.
  void WaitForState() {
    if (!selected_ && !Wait(2, [this] { return !heard_.runs().empty(); })) throw Silent();
    if (!selected_ && robot_.empty()) Wait(0.1, [] { return false; });
    if (!selected_ && !Select()) {
      Wait(kNaming_s, [this] { return heard_.Named(); });
      if (!Select()) throw Unclear();
    }
    if (!Wait(2, [this] { return view_.state().has_value(); })) {
      if (view_.run() && view_.run()->checking)
        throw std::runtime_error("its drives are being checked: `tumbler ctl stop` ends that");
      throw Silent();
    }
  }
  /// Looks for another run of the robot after one that is over.
  void LookAgain() {
    selected_.reset();
    heard_.Forget();
    Wait(0.5, [this] { return !heard_.runs().empty() && Select(); });
  }

  /// Sends a request again and again until it is answered, since a datagram may get lost.
  /// @returns the answer.
  state_t Ask(std::int8_t command, const std::string& branch) {
    WaitForState();
    command_t message{};
    message.id = DrawId();
    message.run = *selected_;
    message.command = command;
    message.branch = branch;
    const auto answered = [&] { return view_.state()->request_id == message.id; };
    for (int i = 0; i < 10 && !answered(); ++i) {
      message.seen = view_.state()->number;
      Publish(message);
      Wait(0.2, answered);
    }
    if (answered()) return *view_.state();
    if (view_.run() && view_.run()->keyed) {
      throw std::runtime_error(
          key_ ? "no answer: the run has a key (tumbler run --key), which must be the same as here"
               : "no answer: the run obeys this only when it is signed with its key: --key FILE");
    }
    throw Silent();
  }

  /// Asks every run of the robot that is heard to come to rest, also those that turn up meanwhile.
  RestRequest AskForRest(OperatorRequest request) {
    RestRequest rest(request, [this] { return DrawId(); });
    const auto told = [&] {
      rest.AddRuns(heard_.Of(robot_), SteadyClock::now());
      rest.Send(SteadyClock::now(), [this](command_t& message) { Publish(message); });
      return !rest.asked().empty() && rest.Over(SteadyClock::now());
    };
    rest_ = &rest;
    if (!Wait(2, [this] { return !heard_.runs().empty(); })) throw Silent();
    Wait(0.1, [] { return false; });
    // Names tell whether the robots are different ones.
    if (heard_.runs().size() > 1 || !robot_.empty())
      Wait(kNaming_s, [this] { return heard_.Named(); });
    if (heard_.Of(robot_).empty()) throw Unclear();
    Wait(5, told);
    rest_ = nullptr;
    return rest;
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
    if (self->selected_ && message->run == *self->selected_) self->view_.Take(*message);
  }
  template <typename Message>
  void Note(const Message& message) {
    heard_.Hear(message, SteadyClock::now());
    if (rest_ != nullptr) rest_->Hear(message);
  }
  void Note(const event_t& /*message*/) {}
  /// Chooses the only run, or the only one of the robot that was named. @returns whether there is
  /// one.
  bool Select() {
    if (robot_.empty()) {
      if (heard_.runs().size() == 1) selected_ = heard_.runs().begin()->first;
      return selected_.has_value();
    }
    const std::vector<std::int64_t> runs = heard_.Of(robot_);
    if (runs.size() == 1) selected_ = runs.front();
    return selected_.has_value();
  }
  std::int64_t DrawId() { return std::uniform_int_distribution<std::uint32_t>(1)(random_); }
  void Publish(command_t& message) {
    if (key_) key_->Sign(message);
    lcm_.publish(kCommandChannel, &message);
  }
  /// What is wrong where no run, or more than one, is meant.
  [[nodiscard]] std::runtime_error Unclear() const {
    std::string names;
    for (const std::string& robot : heard_.Robots())
      names += fmt::format("{}'{}'", names.empty() ? "" : ", ", robot);
    if (!robot_.empty() && heard_.Of(robot_).empty()) {
      return std::runtime_error(
          fmt::format("no robot '{}' answers on {}, but {}", robot_, url_, names));
    }
    if (robot_.empty() && heard_.Robots().size() > 1) {
      return std::runtime_error(
          fmt::format("{} robots answer on {}: {}; say which one with --robot",
                      heard_.Robots().size(), url_, names));
    }
    return std::runtime_error(fmt::format(
        "{} runs of {} are heard on {}: end the log that is played there, or the other run; "
        "finish, stop and disarm go to all of them",
        heard_.runs().size(), names, url_));
  }
  [[nodiscard]] std::runtime_error Silent() const {
    return std::runtime_error(
        fmt::format("no answer on {}: is tumbler run there, with --lcm-url {}?", url_, url_));
  }

  /// A run says four times a second whose it is.
  static constexpr double kNaming_s = 0.6;

  std::string url_;
  std::string robot_;
  std::optional<RequestKey> key_;
  HeardRuns heard_;
  std::optional<std::int64_t> selected_;  // the run that is meant, once it is known
  RestRequest* rest_ = nullptr;           // hears the answers, while it is on its way
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
  fmt::print(stderr, "tumbler ctl: the run was refused: {}\n", ToString(last));
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
      stderr, "tumbler ctl: {} refused: {} (state {})\n", name,
      refusal == Refusal::kNoSuchBranch ? fmt::format("no branch '{}'", branch) : ToString(refusal),
      ToString(static_cast<ExecutorState>(answer.state)));
  return ExitStatus::kRefused;
}

/// Says what became of a request towards rest, run by run where there are several.
ExitStatus RequestRest(Remote& remote, OperatorRequest request) {
  const RestRequest rest = remote.AskForRest(request);
  const bool single = rest.asked().size() == 1;
  for (const RestRequest::Asked& asked : rest.asked()) {
    const std::string name = fmt::format("{}{}", ToString(request),
                                         single ? "" : fmt::format(", run {}", asked.message.run));
    if (!asked.answer.empty()) {
      fmt::print("{}: {}\n", name, asked.answer);
    } else {
      fmt::print(
          stderr, "tumbler ctl: {}: no answer{}\n", name,
          rest.answered() == 0 ? "; does it still run?" : "; a log that is played gives none");
    }
  }
  if (rest.answered() == 0) return ExitStatus::kUnusable;
  return rest.answered() == rest.asked().size() ? ExitStatus::kDone : ExitStatus::kAmiss;
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
  std::string key_file;
  bool json = false;
  CommandLine line("Asks a running tumbler run for something, or shows what it does.",
                   "tumbler ctl");
  line.SetFooter(kFooter);
  line.RequireSubcommand();
  line.AllowOptionsAfterSubcommand();
  line.Option("--lcm-url", url, "where tumbler run publishes").LcmUrl().ShowDefault();
  line.Option("--robot", robot, "the robot's name, where several publish there");
  line.Option(
      "--key", key_file,
      "the key of tumbler run --key, to sign requests: start, branch and clear need it there");
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
  const std::string name = line.given_subcommand();
  auto request = OperatorRequest::kNone;
  for (int command = command_t::START; command <= command_t::DISARM; ++command) {
    const auto one = static_cast<OperatorRequest>(command);
    if (name == ToString(one)) request = one;
  }
  // Requests towards rest need no key, and a lost one must not keep them from the robot.
  std::optional<RequestKey> key;
  if (!key_file.empty() && !IsTowardsRest(request)) key.emplace(key_file);
  Remote remote(url, robot, std::move(key));
  if (name == "status") return Status(remote, json);
  if (name == "watch") return Watch(remote);
  if (request == OperatorRequest::kNone) throw std::logic_error("a subcommand without a request");
  return IsTowardsRest(request) ? RequestRest(remote, request)
                                : Request(remote, static_cast<std::int8_t>(request), branch);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler ctl", argc, argv, tumbler::Main);
}
