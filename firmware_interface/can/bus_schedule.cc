#include "firmware_interface/can/bus_schedule.h"

#include <fmt/format.h>

#include <cmath>

namespace tumbler {

std::string BusSchedule::Describe() const {
  return fmt::format(
      "{} bits a tick at worst; at {:.6g} Hz {:.1f} % of {} bit/s\n"
      "  allowed {:.1f} % ({:.0f} Hz): each tick keeps {} + {} bits for an error and the longest "
      "frame again",
      tick_bits, rate_hz, 100 * load(), bit_rate, 100 * load_allowed(), std::floor(ceiling_hz()),
      kErrorBits, longest_frame_bits);
}

}  // namespace tumbler
