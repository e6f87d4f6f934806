#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <tumbler/event_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>

#include "runtime/record/run_description.h"
#include "runtime/record/run_fields.h"
#include "runtime/record/timed_record.h"

namespace tumbler {

/// Sets every field of the message about one tick.
void FillState(const TimedRecord& timed, state_t& message);

/// Finds the events of a run. It is shown every record, in order.
class EventWatch {
 public:
  /// @param about  has the names for the texts.
  explicit EventWatch(const RunDescription& about);

  /// The event of this tick: another state, a fault, a refusal, or the next node of the sequence.
  [[nodiscard]] std::optional<event_t> Next(const TimedRecord& timed);

 private:
  std::vector<std::string> joints_;
  std::vector<std::string> nodes_;
  std::vector<std::string> error_codes_;
  ExecutorState last_state_ = ExecutorState::kDisarmed;
  std::uint32_t last_faults_ = 0;
  std::uint32_t last_request_id_ = 0;
  Refusal last_refusal_ = Refusal::kNone;
  std::int8_t last_node_ = -1;
};

/// The message about a run as a whole, with figures of all its records so far.
class RunMessage {
 public:
  explicit RunMessage(const RunDescription& about);

  void SetScheduling(const std::string& scheduling) { run_.about.scheduling = scheduling; }
  /// @param checking  whether drives are being checked before the first record.
  /// @param request   that ended the check; 0: none.
  void SetCheck(bool checking, std::int64_t request) {
    run_.checking = checking;
    run_.check_request = request;
  }
  /// Adds one record to the figures.
  void Count(const TimedRecord& timed) { run_.Count(timed); }
  /// The message at this time. Its bus load counts from the message before.
  /// @param lost, unpublished  as Telemetry counts them.
  [[nodiscard]] const run_t& At(std::int64_t time_ns, std::int64_t lost, std::int64_t unpublished);

 private:
  RunSoFar run_;
  run_t message_{};
};

}  // namespace tumbler
