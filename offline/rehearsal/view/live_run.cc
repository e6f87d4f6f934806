#include "offline/rehearsal/view/live_run.h"

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <lcm/lcm-cpp.hpp>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <stdexcept>
#include <thread>
#include <tumbler/command_t.hpp>

#include "offline/rehearsal/view/viewed_run.h"
#include "runtime/core/tick.h"
#include "runtime/telemetry/channels.h"
#include "runtime/telemetry/lcm_link.h"
#include "runtime/telemetry/message_readers.h"

namespace tumbler {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr auto kShowEvery = std::chrono::milliseconds(40);
constexpr auto kSilent = std::chrono::seconds(1);
constexpr auto kAskEvery = std::chrono::milliseconds(200);
constexpr int kAsksMax = 10;
constexpr std::size_t kRunsMax = 16;

double Seconds(SteadyClock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

/// A run that was heard.
struct HeardRun {
  std::optional<std::string> robot;  // once it said so
  SteadyClock::time_point at;
};

/// A request on its way.
struct SentRequest {
  EndRequest request = EndRequest::kStop;
  command_t message{};
  int sent = 0;
  SteadyClock::time_point next;
  std::string answer;  // empty: none yet
};

const char* Name(EndRequest request) {
  return request == EndRequest::kStop ? "stop" : "torque off";
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
    if (!lcm.good()) {
      throw std::runtime_error(fmt::format(
          "{}: LCM cannot use this URL (udpm needs a multicast route: `ip route add 224.0.0.0/4 "
          "dev IFACE`)",
          url));
    }
    if (lcm.getFileno() < 0) {
      throw std::runtime_error(fmt::format("{}: no LCM server answers there", url));
    }
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
    Hear(message.run, message.robot);
    if (message.run == selected) run.Take(message);
  }
  void Take(const state_t& message) {
    Hear(message.run, std::nullopt);
    if (message.run != selected) return;
    state_at = SteadyClock::now();
    run.Take(message);
    if (asked && asked->answer.empty() && message.request_id == asked->message.id) {
      const auto refusal = static_cast<Refusal>(message.request_refusal);
      asked->answer = refusal == Refusal::kNone ? fmt::format("taken at tick {}", message.tick)
                                                : fmt::format("refused: {}", ToString(refusal));
    }
  }

  void Hear(std::int64_t number, const std::optional<std::string>& robot_of_run) {
    const auto now = SteadyClock::now();
    std::erase_if(heard, [&](const auto& entry) { return now - entry.second.at > kSilent; });
    if (heard.size() >= kRunsMax && !heard.contains(number)) return;
    HeardRun& entry = heard[number];
    entry.at = now;
    if (robot_of_run) entry.robot = robot_of_run;
    if (selected && heard.contains(*selected)) return;
    const auto is_meant = [this](const auto& other) {
      return robot_name.empty() || other.second.robot == robot_name;
    };
    if (!is_meant(*heard.find(number)) || (robot_name.empty() && heard.size() > 1)) return;
    if (selected != number) {
      run.Forget();
      asked.reset();
    }
    selected = number;
  }

  std::string Ask(EndRequest request, const std::string& number) {
    const std::lock_guard lock(mutex);
    if (!selected || !run.state()) return "no run is heard";
    if (number != std::to_string(*selected)) return "another run is shown now";
    if (*selected == 0) return "a run in virtual time takes no requests";
    SentRequest sent;
    sent.request = request;
    // The number has to differ from that of any other request.
    sent.message.id = std::uniform_int_distribution<std::uint32_t>(1)(random);
    sent.message.run = *selected;
    sent.message.command = request == EndRequest::kStop ? command_t::STOP : command_t::DISARM;
    sent.next = SteadyClock::now();
    asked = sent;
    Send();
    return "";
  }

  /// Sends what was asked for again, when it is time. LCM's publishing is safe for threads.
  void Send() {
    if (!asked || !asked->answer.empty() || SteadyClock::now() < asked->next) return;
    if (asked->sent == kAsksMax) {
      asked->answer = "no answer: use tumbler-ctl, or cut the power";
      return;
    }
    if (run.state() && selected == asked->message.run) asked->message.seen = run.state()->number;
    lcm.publish(kCommandChannel, &asked->message);
    ++asked->sent;
    asked->next = SteadyClock::now() + kAskEvery;
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
    for (const auto& [number, entry] : heard) {
      if (number != selected && now - entry.at <= kSilent) {
        json["others"].Append(entry.robot.value_or(""));
      }
    }
    if (asked) {
      json["asked"] = {{"request", Name(asked->request)}, {"answer", asked->answer}};
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
  std::map<std::int64_t, HeardRun> heard;
  std::optional<std::int64_t> selected;
  SteadyClock::time_point state_at;
  std::optional<SentRequest> asked;
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
