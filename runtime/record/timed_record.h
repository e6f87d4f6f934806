#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/core/primitive.h"
#include "firmware_interface/devices/sample_times.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/executor/tick_entry.h"

namespace tumbler {

/// The operator's last request and what became of it.
struct RequestAnswer {
  std::uint32_t id = 0;
  OperatorRequest request = OperatorRequest::kNone;
  Refusal refusal = Refusal::kNone;
};

/// The record of a tick, with the operator's request, times, and what follows from frames: all that
/// messages and tables say of a tick.
struct TimedRecord {
  std::int64_t time_ns = 0;  ///< Deadline of the tick, on the clock of the loop.
  std::int64_t number = 0;   ///< Number of this record: 0, 1, 2, ...
  float wake_up_ns = 0;      ///< Time from the deadline until the loop runs.
  float tick_ns = 0;         ///< Time from then until all frames are sent.
  /// Bits of the frames received and sent, each counted with the most stuff bits that it can have.
  std::int32_t bus_bits = 0;
  RequestAnswer request;
  TickRecord record;
  /// When the measured position of each joint was sampled, from `time_ns` on [us]; NaN: not known.
  std::array<float, kMaxJoints> reply_sampled_us = NotKnown();

 private:
  static constexpr std::array<float, kMaxJoints> NotKnown() noexcept {
    std::array<float, kMaxJoints> none{};
    for (float& value : none) value = std::numeric_limits<float>::quiet_NaN();
    return none;
  }
};

/// Makes them of the ticks of a run, in their order.
class TimedRecords {
 public:
  /// @param replies  of the run's drives; of none: it is not known when replies were sampled.
  explicit TimedRecords(const SampleTimes& replies) : replies_(replies) {}
  [[nodiscard]] TimedRecord Next(const TickEntry& entry);

 private:
  SampleTimes replies_;
  std::int64_t index_ = 0;  ///< Of the tick after the last one.
};

/// The frames of a tick that the bus took, in their order.
[[nodiscard]] std::vector<CanFrame> SentFrames(const TickEntry& entry);

}  // namespace tumbler
