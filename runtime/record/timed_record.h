#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "common/core/primitive.h"
#include "firmware_interface/devices/sample_times.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/executor/tick.h"

namespace tumbler {

/// The operator's last request and what became of it.
struct RequestAnswer {
  std::uint32_t id = 0;
  OperatorRequest request = OperatorRequest::kNone;
  Refusal refusal = Refusal::kNone;
};

/// The record of a tick, with times and the operator's request, which the loop adds.
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

  /// Sets them for the joints of the record, whose time is set.
  void TakeSampleTimes(const SampleTimes& replies) noexcept {
    for (std::size_t j = 0; j < record.joint_count; ++j) {
      const auto sampled_ns = replies.sampled_ns(j);
      reply_sampled_us[j] = sampled_ns ? static_cast<float>(*sampled_ns - time_ns) * 1e-3F
                                       : std::numeric_limits<float>::quiet_NaN();
    }
  }

 private:
  static constexpr std::array<float, kMaxJoints> NotKnown() noexcept {
    std::array<float, kMaxJoints> none{};
    for (float& value : none) value = std::numeric_limits<float>::quiet_NaN();
    return none;
  }
};

}  // namespace tumbler
