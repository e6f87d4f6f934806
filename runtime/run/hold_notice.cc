#include "runtime/run/hold_notice.h"

#include <fmt/format.h>

#include <chrono>
#include <utility>

namespace tumbler {

HoldNotice::HoldNotice(double begun_s, std::function<void(const std::string&)> say)
    : begun_s_(begun_s), say_(std::move(say)), thread_([this] {
        constexpr std::chrono::milliseconds kPause(20);
        while (!over_.load()) {
          SayNews();
          std::this_thread::sleep_for(kPause);
        }
        SayNews();
      }) {}

HoldNotice::~HoldNotice() {
  over_.store(true);
  thread_.join();
}

void HoldNotice::SayNews() {
  const bool held = held_.load(std::memory_order_relaxed);
  if (held && !said_held_) {
    say_(
        fmt::format("the motion is over, and the robot is held where it would drop without torque; "
                    "in {:.3g} s and later, Ctrl-C takes the torque off",
                    begun_s_));
  }
  said_held_ = held;
  const int requests = late_requests_.load(std::memory_order_relaxed);
  if (requests != said_requests_) {
    said_requests_ = requests;
    say_(
        "that request came when the motion had just ended, and is taken for it: the robot is still "
        "held, and the next Ctrl-C takes the torque off");
  }
}

}  // namespace tumbler
