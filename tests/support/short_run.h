#pragma once

#include "runtime/executor/run_procedure.h"

namespace tumbler::testing {

/// Short times, so that a run is soon over.
inline RunProcedureConfig ShortRun() {
  RunProcedureConfig config;
  config.hold_ticks = 50;
  config.reply_ticks_max = 20;
  config.start_ticks_max = 30;
  config.stop_hold_ticks = 25;
  config.fault_ticks = 40;
  return config;
}

}  // namespace tumbler::testing
