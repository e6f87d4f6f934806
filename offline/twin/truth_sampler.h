#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "offline/twin/simulated_robot.h"

namespace tumbler {

/// Makes messages of the true state of a simulated robot: truth_t, or space_truth_t of a robot in
/// space. It allocates, so it must not run in a loop that has deadlines.
class TruthSampler {
 public:
  /// Time from one message to the next. Impacts last some 10 ms.
  static constexpr std::int64_t kPeriod_ns = 5'000'000;

  /// @param sink  called with every encoded message.
  explicit TruthSampler(std::function<void(std::span<const std::uint8_t>)> sink)
      : sink_(std::move(sink)) {}

  /// Hands over the state, unless less than a period has passed since the last time.
  void Observe(const SimulatedRobot& robot);

 private:
  std::function<void(std::span<const std::uint8_t>)> sink_;
  std::vector<std::uint8_t> bytes_;
  std::int64_t due_ns_ = 0;
};

}  // namespace tumbler
