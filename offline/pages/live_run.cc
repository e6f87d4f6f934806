#include "offline/pages/live_run.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <lcm/lcm-cpp.hpp>
#include <mutex>
#include <optional>
#include <random>
#include <thread>
#include <tumbler/command_t.hpp>

#include "offline/pages/viewed_run.h"
#include "runtime/record/channels.h"
#include "runtime/record/heard_runs.h"
#include "runtime/record/lcm_link.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/rest_request.h"

namespace tumbler {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr auto kShowEvery = std::chrono::milliseconds(40);
constexpr auto kSilent = std::chrono::seconds(1);

double Seconds(SteadyClock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

const char* Name(OperatorRequest request) {
  return request == OperatorRequest::kStop ? "stop" : "torque off";
}

}  // namespace

struct LiveRun::Implementation {
  Implementation(const std::string& url, const std::string& robot_name_in,
                 std::unique_ptr<ViewedRobot> robot_in, ViewFeed& feed_in)
      : robot_name(robot_name_in),
        robot(std::move(robot_in)),
        feed(feed_in),
        lcm(url),
        run(robot.get()) {
    RequireListening(lcm, url);
    SubscribeToWholeMessages([this] {
      Subscribe<state_t>(kStateChannel);
      Subscribe<event_t>(kEventChannel);
      Subscribe<run_t>(kRunChannel);
      Subscribe<truth_t>(kTruthChannel);
    });
    thread = std::thread([this] { Listen(); });
  }

  template <typename Message>
  void Subscribe(const char* channel) {
    // UndefinedBehaviorSanitizer objects to the overload for member functions. LCM keeps at most
    // this many messages that were not handled yet.
    lcm.subscribeFunction(channel, &Implementation::Handle<Message>, this)->setQueueCapacity(2000);
  }
  template <typename Message>
  static void Handle(const lcm::ReceiveBuffer* buffer, const std::string& /*channel*/,
                     Implementation* self) {
    Message message;
    if (ReadMessage({static_cast<const std::uint8_t*>(buffer->data), buffer->data_size}, message)) {
      const std::lock_guard lock(self->mutex);
      self->Take(message);
    } else {
      ++self->unreadable;
    }
  }

  void Take(const truth_t& message) { run.Take(message); }
  void Take(const event_t& message) {
    if (message.run == selected) run.Take(message);
  }
  void Take(const run_t& message) {
    Hear(message);
    if (message.run == selected) run.Take(message);
  }
  void Take(const state_t& message) {
    Hear(message);
    if (message.run != selected) return;
    state_at = SteadyClock::now();
    run.Take(message);
  }

  template <typename Message>
  void Hear(const Message& message) {
    const auto now = SteadyClock::now();
    heard.ForgetSilent(now, kSilent);
    heard.Hear(message, now);
    if (asked) asked->Hear(message);
    if (selected && heard.runs().contains(*selected)) return;
    // Of several runs of one robot, as when a log is played, any may be shown; a request to end
    // goes to all of them.
    const auto other = heard.runs().find(message.run);
    if (other == heard.runs().end()) return;
    const bool meant = robot_name.empty() ? heard.runs().size() == 1 ||
                                                (heard.Named() && heard.Robots().size() == 1)
                                          : other->second.robot == robot_name;
    if (!meant) return;
    if (selected != message.run) {
      run.Forget();
      if (asked && asked->Over(now)) asked.reset();
    }
    selected = message.run;
  }

  /// The robot that is shown; empty: it has not said its name.
  [[nodiscard]] std::string ShownRobot() const {
    const auto shown = heard.runs().find(*selected);
    return shown == heard.runs().end() ? robot_name : shown->second.robot.value_or(robot_name);
  }

  std::string Ask(EndRequest request, const std::string& number) {
    const std::lock_guard lock(mutex);
    if (!selected) return "no run is heard";  // One whose drives are checked has no state yet.
    if (number != std::to_string(*selected)) return "another run is shown now";
    if (*selected == 0) return "a run in virtual time takes no requests";
    // The numbers have to differ from those of any other requests.
    asked.emplace(request == EndRequest::kStop ? OperatorRequest::kStop : OperatorRequest::kDisarm,
                  [this] { return std::uniform_int_distribution<std::uint32_t>(1)(random); });
    asked->AddRuns({*selected}, SteadyClock::now());
    Send();
    return "";
  }

  /// Sends what was asked for, again and again. LCM's publishing is safe for threads.
  void Send() {
    if (!asked) return;
    const auto now = SteadyClock::now();
    asked->AddRuns(heard.Of(ShownRobot()), now);
    asked->Send(now, [this](command_t& message) { lcm.publish(kCommandChannel, &message); });
  }

  /// What has become of the request: the answer of the run that is shown, or of another one, where
  /// the shown one is a log that is played.
  [[nodiscard]] std::string Answer() const {
    std::string answer;
    for (const RestRequest::Asked& one : asked->asked()) {
      if (!one.answer.empty() && (answer.empty() || one.message.run == *selected))
        answer = one.answer;
    }
    if (!answer.empty() || !asked->Over(SteadyClock::now())) return answer;
    return "no answer: use tumbler ctl, or cut the power";
  }

  void Listen() {
    auto shown = SteadyClock::now() - kShowEvery;
    while (!stop) {
      const int handled = HandleLcm(lcm, 10);
      // A link that breaks at once again must not keep a processor busy.
      if (handled < 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
      const std::lock_guard lock(mutex);
      Send();
      const auto now = SteadyClock::now();
      if (now - shown < kShowEvery) continue;
      shown = now;
      feed.Publish(Text(now));
    }
  }

  std::string Text(SteadyClock::time_point now) {
    Json json = {{"age_s", nullptr},     {"run", nullptr},        {"others", Json::Array()},
                 {"asked", nullptr},     {"unreadable", 0},       {"robot_fits", true},
                 {"frame", run.Frame()}, {"events", run.Events()}};
    if (selected) json["run"] = std::to_string(*selected);
    if (run.state()) json["age_s"] = Seconds(now - state_at);
    for (const auto& [number, entry] : heard.runs()) {
      if (number != selected && now - entry.at <= kSilent) {
        json["others"].Append(entry.robot.value_or(""));
      }
    }
    if (asked) {
      json["asked"] = {{"request", Name(asked->request())}, {"answer", Answer()}};
    }
    json["unreadable"] = unreadable.load();
    if (robot && run.run()) json["robot_fits"] = run.run()->joints == robot->joints();
    return json.Dump(-1);
  }

  std::string robot_name;
  std::unique_ptr<ViewedRobot> robot;
  ViewFeed& feed;
  lcm::LCM lcm;
  std::mutex mutex;  // guards everything below but `stop`
  ViewedRun run;
  HeardRuns heard;
  std::optional<std::int64_t> selected;
  SteadyClock::time_point state_at;
  std::optional<RestRequest> asked;
  std::atomic<std::int64_t> unreadable{0};
  std::random_device random;
  std::atomic<bool> stop{false};
  std::thread thread;
};

LiveRun::LiveRun(const std::string& url, const std::string& robot_name,
                 std::unique_ptr<ViewedRobot> robot, ViewFeed& feed)
    : implementation_(std::make_unique<Implementation>(url, robot_name, std::move(robot), feed)) {}

LiveRun::~LiveRun() {
  implementation_->stop = true;
  implementation_->thread.join();
}

std::string LiveRun::Ask(EndRequest request, const std::string& run) {
  return implementation_->Ask(request, run);
}

}  // namespace tumbler
