#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>

#include "runtime/executor/run_procedure.h"

namespace tumbler {

/// Tells the operator that the robot is held at the end of a run, and what the next request to end
/// does then: at once when the hold begins, and whenever a request was taken for the motion that
/// had just ended (`EndHold::kBegun`).
///
/// Sentences are said by a thread of its own: the loop only notes what they are about.
class HoldNotice {
 public:
  /// @param begun_s  for how long a request is taken for the motion [s].
  /// @param say      gets each sentence, on the other thread.
  HoldNotice(double begun_s, std::function<void(const std::string&)> say);
  ~HoldNotice();  ///< Says what is still to be said.
  HoldNotice(const HoldNotice&) = delete;
  HoldNotice& operator=(const HoldNotice&) = delete;

  /// To be called after every tick. Never waits.
  void Note(const RunProcedure& procedure) noexcept {
    late_requests_.store(procedure.late_requests(), std::memory_order_relaxed);
    held_.store(procedure.end_hold() != EndHold::kNone, std::memory_order_relaxed);
  }

 private:
  void SayNews();

  const double begun_s_;
  const std::function<void(const std::string&)> say_;
  std::atomic<bool> held_{false};
  std::atomic<int> late_requests_{0};
  std::atomic<bool> over_{false};
  bool said_held_ = false;
  int said_requests_ = 0;
  std::thread thread_;
};

}  // namespace tumbler
