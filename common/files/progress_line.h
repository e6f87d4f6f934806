#pragma once

#include <chrono>
#include <string>
#include <utility>

namespace tumbler {

/// The progress of a long command on standard error: one line that rewrites itself on a terminal,
/// plain lines in a pipe, where each of them stays.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine() { Finish(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// Whether the next text is due: 0.1 s after the last one on a terminal, 10 s in a pipe.
  [[nodiscard]] bool Due() const;
  /// Makes the next text due.
  void Hasten() { shown_ = {}; }
  void Show(const std::string& text);
  /// Ends the line that rewrites itself.
  void Finish();

 private:
  using Clock = std::chrono::steady_clock;

  bool terminal_;
  bool open_ = false;
  Clock::time_point shown_ = Clock::now();
};

/// The progress of a work of equal parts, told how many of them are known: `3/9 points  at most
/// 12.3 s left`. Those that are known at first cost no time.
class CountProgress {
 public:
  CountProgress(int parts, std::string noun) : parts_(parts), noun_(std::move(noun)) {}
  void operator()(int known);

 private:
  using Clock = std::chrono::steady_clock;

  int parts_;
  std::string noun_;
  int first_ = -1;
  Clock::time_point start_ = Clock::now();
  ProgressLine line_;
};

/// `at most 12.3 s left`, from the time that a part of the work took; empty before anything can be
/// known.
std::string TimeLeft(double elapsed_s, double done, double total);

}  // namespace tumbler
