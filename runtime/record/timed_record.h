#pragma once

#include <cstdint>

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
};

}  // namespace tumbler
