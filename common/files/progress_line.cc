#include "common/files/progress_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

namespace tumbler {
namespace {

/// What work still takes is not judged by its first moments.
constexpr double kJudgeAfter_s = 0.5;

}  // namespace

ProgressLine::ProgressLine() : terminal_(isatty(STDERR_FILENO) == 1) {}

bool ProgressLine::Due() const {
  return Clock::now() - shown_ >=
         (terminal_ ? std::chrono::milliseconds(100) : std::chrono::milliseconds(10'000));
}

void ProgressLine::Show(const std::string& text) {
  shown_ = Clock::now();
  if (terminal_) {
    fmt::print(stderr, "\r\x1b[K{}", text);
    std::fflush(stderr);
    open_ = true;
  } else {
    fmt::print(stderr, "{}\n", text);
  }
}

void ProgressLine::Finish() {
  if (open_) fmt::print(stderr, "\n");
  open_ = false;
}

void CountProgress::operator()(int known) {
  if (first_ < 0) {
    first_ = known;
    line_.Hasten();
  }
  if (!line_.Due()) return;
  const double elapsed_s = std::chrono::duration<double>(Clock::now() - start_).count();
  const std::string left = TimeLeft(elapsed_s, known - first_, parts_ - first_);
  line_.Show(fmt::format("{}/{} {}{}{}", known, parts_, noun_, left.empty() ? "" : "  ", left));
}

std::string TimeLeft(double elapsed_s, double done, double total) {
  if (elapsed_s < kJudgeAfter_s || done <= 0 || done >= total) return "";
  return fmt::format("at this pace at most {:.1f} s left", elapsed_s / done * (total - done));
}

}  // namespace tumbler
