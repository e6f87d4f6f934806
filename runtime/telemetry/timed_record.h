#pragma once

#include <cstdint>

#include "runtime/core/tick.h"
#include "runtime/linux/operator_mailbox.h"

namespace tumbler {

/// The operator's last request and what became of it.
struct RequestAnswer {
  std::uint32_t id = 0;
  OperatorRequest request = OperatorRequest::kNone;
  Refusal refusal = Refusal::kNone;
};

/// A tick's record, and what the loop adds to it.
struct TimedRecord {
  std::int64_t time_ns = 0;   ///< Deadline of the tick, on the clock of the loop.
  std::int64_t number = 0;    ///< Of this record: 0, 1, 2, ...
  float wake_up_ns = 0;       ///< From the deadline to running.
  float tick_ns = 0;          ///< From running to all sent.
  std::int32_t bus_bits = 0;  ///< Of the frames received and sent, each as long as frames can be.
  RequestAnswer request;
  TickRecord record;
};

}  // namespace tumbler
