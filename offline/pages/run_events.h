#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/core/sequence.h"
#include "offline/pages/run_data.h"
#include "runtime/executor/tick_entry.h"

#include <tumbler/space_truth_t.hpp>

namespace tumbler {

/// Whether a primitive plays, or is held after its end.
bool InMotion(ExecutorState state);

/// Whether a node begins with this tick.
/// @param before  the tick before it; null for the first of a run.
bool BeginsNode(const RunTick& tick, const RunTick* before);

/// What happens in a run, as people are told of it.
class RunEvents {
 public:
  /// Both have to outlive this.
  /// @param error_codes  of the joints' drives, as `ErrorCodesOf` gives them.
  RunEvents(const SequenceGraph<double>& graph, const std::vector<std::string>& joints,
            std::vector<std::string> error_codes)
      : graph_(graph), joints_(joints), error_codes_(std::move(error_codes)) {}

  /// @param before   the tick before; null for the first.
  /// @param missing  how many ticks between the two were not recorded.
  void TakeTick(const TickEntry& entry, const RunTick& tick, const RunTick* before,
                std::int64_t missing);
  /// In the plane or in space.
  void TakeTruth(double time_s, const space_truth_t& state);

  /// All events in the order of time.
  [[nodiscard]] std::vector<RunEvent> Take();

 private:
  void Add(double time_s, RunEvent::Kind kind, std::string text);
  void AddRequests(const TickEntry& entry, double time_s);
  void AddFaults(const TickRecord& record, double time_s);

  const SequenceGraph<double>& graph_;
  const std::vector<std::string>& joints_;
  std::vector<std::string> error_codes_;
  std::vector<RunEvent> events_;
  // What was seen last.
  FaultDetail first_fault_;
  std::uint32_t faults_ = 0;
  std::uint32_t request_id_ = 0;
  std::uint8_t request_ = 0;
  std::string resting_as_;
  bool fallen_ = false;
  bool pushed_ = false;
};

}  // namespace tumbler
