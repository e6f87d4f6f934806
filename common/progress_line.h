#pragma once

#include <chrono>
#include <string>

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

/// `at most 12.3 s left`, from the time that a part of the work took; empty before anything can be
/// known.
std::string TimeLeft(double elapsed_s, double done, double total);

}  // namespace tumbler
