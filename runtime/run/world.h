#pragma once

#include "firmware_interface/can/bus.h"
#include "runtime/assembly/clock.h"
#include "runtime/run/control_loop.h"
#include "runtime/run/run_summary.h"

namespace tumbler {

/// The world of a control loop: the bus that takes its frames, and the clock that gives it time.
class World {
 public:
  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  virtual ~World() = default;
  /// Called once, after everything that can refuse the run and before `bus()` is used. Only here is
  /// a bus touched that others may be using. @throws std::runtime_error.
  virtual void Open() {}
  virtual CanBus& bus() = 0;
  virtual Clock& clock() = 0;
  /// Whether time is real, not virtual, so that telemetry needs a thread of its own.
  [[nodiscard]] virtual bool real_time() const = 0;
  /// Called after every tick.
  virtual void Observe(const ControlLoop& loop) = 0;
  /// Called when the run is over. Adds the facts about it that only this world knows.
  virtual void Summarize(RunSummary& summary) = 0;
};

}  // namespace tumbler
