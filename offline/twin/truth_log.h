#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "offline/twin/simulated_robot.h"

namespace tumbler {

/// The outputs of a TruthLog. An empty name leaves that output out.
struct TruthLogConfig {
  std::string log_file;  ///< LCM log.
  std::string lcm_url;   ///< Live LCM.
  /// Called with every encoded message. A flight record takes them from here.
  std::function<void(std::span<const std::uint8_t>)> sink;
  /// Time from one message to the next. Impacts last some 10 ms.
  std::int64_t period_ns = 5'000'000;
  /// The log's time at the robot's time 0: 0 for virtual time, else microseconds since 1970.
  std::int64_t utime_at_zero_us = 0;
};

/// Writes and publishes the true state of a simulated robot (truth_t, or space_truth_t of a robot
/// in space). It allocates and may block, so it must not run in a loop that has deadlines.
class TruthLog {
 public:
  /// @throws std::runtime_error naming the file or URL that cannot be opened.
  explicit TruthLog(const TruthLogConfig& config);
  ~TruthLog();
  TruthLog(const TruthLog&) = delete;
  TruthLog& operator=(const TruthLog&) = delete;

  /// Publishes the state, unless less than a period has passed since the last time. A file that
  /// cannot be written is told by Finish.
  void Observe(const SimulatedRobot& robot);
  /// Writes what is still to be written. @throws std::runtime_error  when the file is not whole.
  void Finish();

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
