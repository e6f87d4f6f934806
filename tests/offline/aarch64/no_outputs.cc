// A run without its outputs, whose libraries (LCM, zlib) are not at hand for other machines: nobody
// asks for them there.

#include <cstdlib>

#include "runtime/record/flight_recorder.h"
#include "runtime/record/telemetry.h"

namespace tumbler {

void Telemetry::Push(const TimedRecord& /*record*/) noexcept { std::abort(); }

void FlightRecorder::Push(const TickNotes& /*notes*/, const TickInput& /*input*/,
                          const TickOutput& /*output*/) noexcept {
  std::abort();
}

}  // namespace tumbler
