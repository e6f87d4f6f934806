#pragma once

#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <exception>
#include <functional>
#include <thread>

namespace tumbler::testing {

/// Watches whether the machine lets this process run, with a thread that wakes up every 8
/// milliseconds.
class PauseDetector {
 public:
  PauseDetector() : thread_([this] { Watch(); }) {}
  ~PauseDetector() {
    ending_ = true;
    thread_.join();
  }
  PauseDetector(const PauseDetector&) = delete;
  PauseDetector& operator=(const PauseDetector&) = delete;

  [[nodiscard]] double longest_s() const { return longest_s_; }

 private:
  void Watch() {
    using Clock = std::chrono::steady_clock;
    auto last = Clock::now();
    while (!ending_) {
      usleep(8000);
      const auto now = Clock::now();
      const double pause_s = std::chrono::duration<double>(now - last).count();
      if (pause_s > longest_s_) longest_s_ = pause_s;
      last = now;
    }
  }

  std::atomic<bool> ending_{false};
  std::atomic<double> longest_s_{0};
  std::thread thread_;
};

/// Runs a check that depends on programs being run when they want to. If the check fails and the
/// machine stood still for longer than `pause_max_s` meanwhile, the failure proves nothing, and the
/// check is made again, up to five times. A check that fails without such a pause has failed.
inline void InSteadyTime(const std::function<void()>& check, double pause_max_s = 0.02) {
  constexpr int kAttempts = 5;
  for (int attempt = 1;; ++attempt) {
    ::testing::TestPartResultArray results;
    double pause_s = 0;
    {
      const PauseDetector detector;
      const ::testing::ScopedFakeTestPartResultReporter reporter(
          ::testing::ScopedFakeTestPartResultReporter::INTERCEPT_ALL_THREADS, &results);
      try {
        check();
      } catch (const std::exception& error) {
        ADD_FAILURE() << "exception: " << error.what();
      }
      pause_s = detector.longest_s();
    }
    if (results.size() == 0) return;
    if (pause_s > pause_max_s && attempt < kAttempts) {
      GTEST_LOG_(INFO) << "once more: the machine stood still for " << pause_s << " s; "
                       << results.GetTestPartResult(0).message();
      continue;
    }
    for (int i = 0; i < results.size(); ++i) {
      const ::testing::TestPartResult& part = results.GetTestPartResult(i);
      ADD_FAILURE_AT(part.file_name() == nullptr ? "" : part.file_name(), part.line_number())
          << part.message();
    }
    return;
  }
}

}  // namespace tumbler::testing
