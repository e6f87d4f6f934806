#pragma once

#include <cstdint>

#include "runtime/executor/run_procedure.h"
#include "tests/flights/flight_random.h"
#include "tests/flights/flight_setting.h"

namespace tumbler::testing {

/// An operator who wants a flight to go on: he repairs, clears, arms, moves to the start and runs;
/// by himself, or with a run procedure.
class FlightOperator {
 public:
  FlightOperator(const FlightSetting& setting, std::uint64_t seed)
      : setting_(setting), random_(seed, 200), procedure_(setting.procedure) {}

  /// The command for the next tick. @param last  the record of the tick before.
  OperatorCommand Next(const TickRecord& last, ExecutorState state);
  /// Whether everything is to be set right before the tick of that command.
  [[nodiscard]] bool wants_repair() const { return wants_repair_; }
  void Request(FlightRequest request, const TickRecord& last);

 private:
  OperatorCommand NextOfProcedure(const TickRecord& last, ExecutorState state);
  OperatorCommand NextByHand(const TickRecord& last, ExecutorState state);
  OperatorCommand Ready(const TickRecord& last);

  const FlightSetting& setting_;
  FlightRandom random_;
  RunProcedure procedure_;
  bool wants_repair_ = true;
  ExecutorState state_ = ExecutorState::kDisarmed;
  std::int64_t ticks_ = 0;  ///< In the state.
  std::int64_t idle_ticks_ = 0;
  int tries_ = 0;
  bool moved_ = false;
};

}  // namespace tumbler::testing
