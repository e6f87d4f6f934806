#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>

namespace tumbler {

/// The runs that publish at one URL, by what was heard of them. One robot may have several: one
/// that is live, and logs of earlier ones that are played. From here they look alike.
class HeardRuns {
 public:
  using Clock = std::chrono::steady_clock;
  struct Run {
    std::optional<std::string> robot;  ///< Once it has said so, in a run_t.
    Clock::time_point at;              ///< When it was heard last.
  };

  void Hear(const state_t& message, Clock::time_point now) { Hear(message.run, now); }
  void Hear(const run_t& message, Clock::time_point now) {
    if (Run* run = Hear(message.run, now)) run->robot = message.robot;
  }
  /// Forgets those that were silent for longer.
  void ForgetSilent(Clock::time_point now, Clock::duration patience);
  void Forget() { runs_.clear(); }

  [[nodiscard]] const std::map<std::int64_t, Run>& runs() const { return runs_; }
  /// Whether all have said whose they are.
  [[nodiscard]] bool Named() const;
  /// The names of the robots, each once.
  [[nodiscard]] std::vector<std::string> Robots() const;
  /// The runs of a robot that take requests: those in virtual time, whose number is 0, do not.
  /// @param robot  empty: of the only one; those that have not said whose they are, too. Where
  /// there
  ///               are several robots, none.
  [[nodiscard]] std::vector<std::int64_t> Of(const std::string& robot) const;

 private:
  static constexpr std::size_t kMost = 64;

  /// @returns null when there are too many.
  Run* Hear(std::int64_t number, Clock::time_point now);

  std::map<std::int64_t, Run> runs_;
};

}  // namespace tumbler
