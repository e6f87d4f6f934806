#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>

namespace tumbler {

/// Text for people, written by a thread of its own: whoever says something never waits for a
/// terminal that was stopped (Ctrl-S), or a pipe that nobody empties. When more is said than is
/// taken, lines are left out, and their number is told as soon as something is taken again.
class OperatorVoice {
 public:
  /// @param descriptor  standard error or standard output, or the like. It has to stay open.
  /// @param lines_max   as many are kept.
  explicit OperatorVoice(int descriptor, std::size_t lines_max = 64);
  /// Waits for a second more, unless somebody has waited in vain; what was not taken then is lost.
  ~OperatorVoice();
  OperatorVoice(const OperatorVoice&) = delete;
  OperatorVoice& operator=(const OperatorVoice&) = delete;

  /// Says a line, or several. Any thread may; it never blocks.
  void Say(const std::string& text) noexcept;
  /// Waits until all that was said is written.
  /// @returns false when nothing of it was taken for this time.
  [[nodiscard]] bool Await(std::chrono::milliseconds patience);
  /// Whether the descriptor has refused something, as where a disk is full.
  [[nodiscard]] bool failed() const;

 private:
  struct State;
  std::shared_ptr<State> state_;  // A thread that is stuck in a write keeps it.
};

}  // namespace tumbler
