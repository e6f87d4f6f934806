#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <tumbler/command_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>

#include "runtime/assembly/operator_mailbox.h"

namespace tumbler {

/// A request towards rest (finish, stop, disarm) on its way to every run of a robot that is heard:
/// who asks for it need not find out first which of them is the live one. A message goes to each
/// run, again and again until the run answers, since a datagram may get lost.
class RestRequest {
 public:
  using Clock = std::chrono::steady_clock;
  /// What became of it in one run.
  struct Asked {
    command_t message{};
    int sent = 0;
    Clock::time_point next;
    std::string answer;  ///< Empty: none yet.
  };

  /// @param draw_id  gives each message a number, 1 ... 2^32 - 1, other than that of any other.
  RestRequest(OperatorRequest request, std::function<std::int64_t()> draw_id)
      : request_(request), draw_id_(std::move(draw_id)) {}

  /// Also asks these runs, as far as they were not asked yet, in the first two seconds: a run that
  /// turns up later is not meant.
  void AddRuns(const std::vector<std::int64_t>& runs, Clock::time_point now);
  /// Hands each message that is due to `publish`. `seen` is 0 in it, since nobody looks at it.
  void Send(Clock::time_point now, const std::function<void(command_t&)>& publish);
  void Hear(const state_t& message);
  void Hear(const run_t& message);

  [[nodiscard]] OperatorRequest request() const { return request_; }
  [[nodiscard]] const std::vector<Asked>& asked() const { return asked_; }
  /// How many runs have answered.
  [[nodiscard]] std::size_t answered() const;
  /// Whether all have answered, or were asked for two seconds in vain.
  [[nodiscard]] bool Over(Clock::time_point now) const;

 private:
  Asked* WaitingFor(std::int64_t run, std::int64_t id);

  OperatorRequest request_;
  std::function<std::int64_t()> draw_id_;
  std::optional<Clock::time_point> begun_;  // when the first run was asked
  std::vector<Asked> asked_;
};

}  // namespace tumbler
