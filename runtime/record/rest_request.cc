#include "runtime/record/rest_request.h"

#include <fmt/format.h>

#include <algorithm>

#include "runtime/executor/tick.h"

namespace tumbler {
namespace {

constexpr auto kAskAgain = std::chrono::milliseconds(200);
constexpr int kAsksMax = 10;

}  // namespace

void RestRequest::AddRuns(const std::vector<std::int64_t>& runs, Clock::time_point now) {
  if (begun_ && now - *begun_ > kAsksMax * kAskAgain) return;
  if (!begun_ && !runs.empty()) begun_ = now;
  for (const std::int64_t run : runs) {
    const bool known = std::any_of(asked_.begin(), asked_.end(),
                                   [run](const Asked& asked) { return asked.message.run == run; });
    if (known) continue;
    Asked& added = asked_.emplace_back();
    added.message.id = draw_id_();
    added.message.run = run;
    added.message.command = static_cast<std::int8_t>(request_);
  }
}

void RestRequest::Send(Clock::time_point now, const std::function<void(command_t&)>& publish) {
  for (Asked& asked : asked_) {
    if (!asked.answer.empty() || asked.sent == kAsksMax || now < asked.next) continue;
    publish(asked.message);
    ++asked.sent;
    asked.next = now + kAskAgain;
  }
}

RestRequest::Asked* RestRequest::WaitingFor(std::int64_t run, std::int64_t id) {
  const auto found = std::find_if(asked_.begin(), asked_.end(), [&](const Asked& asked) {
    return asked.message.run == run && asked.message.id == id && asked.answer.empty();
  });
  return found == asked_.end() ? nullptr : &*found;
}

void RestRequest::Hear(const state_t& message) {
  Asked* const asked = WaitingFor(message.run, message.request_id);
  if (asked == nullptr) return;
  const auto refusal = static_cast<Refusal>(message.request_refusal);
  asked->answer = refusal == Refusal::kNone ? fmt::format("taken at tick {}", message.tick)
                                            : fmt::format("refused: {}", ToString(refusal));
}

void RestRequest::Hear(const run_t& message) {
  Asked* const asked = WaitingFor(message.run, message.check_request);
  if (asked != nullptr) asked->answer = "taken while the drives were checked";
}

std::size_t RestRequest::answered() const {
  return static_cast<std::size_t>(std::count_if(
      asked_.begin(), asked_.end(), [](const Asked& asked) { return !asked.answer.empty(); }));
}

bool RestRequest::Over(Clock::time_point now) const {
  return std::all_of(asked_.begin(), asked_.end(), [now](const Asked& asked) {
    return !asked.answer.empty() || (asked.sent == kAsksMax && now >= asked.next);
  });
}

}  // namespace tumbler
