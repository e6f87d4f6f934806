#include "firmware_interface/can/bus_schedule.h"

#include <fmt/format.h>

namespace tumbler {

std::string BusSchedule::Describe() const {
  return fmt::format(
      "{} bits a tick at worst; at {:.6g} Hz {:.1f} % of {} bit/s (allowed {:.1f} %: each tick "
      "keeps {} + {} bits for an error and the longest frame again; ceiling {:.0f} Hz)",
      tick_bits, rate_hz, 100 * load(), bit_rate, 100 * load_allowed(), kErrorBits,
      longest_frame_bits, ceiling_hz());
}

}  // namespace tumbler
