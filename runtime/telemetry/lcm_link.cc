#include "runtime/telemetry/lcm_link.h"

#include <poll.h>

namespace tumbler {

int HandleLcm(lcm::LCM& lcm, int timeout_ms) {
  pollfd wait{lcm.getFileno(), POLLIN, 0};  // Asking for the descriptor tries to mend the link.
  const bool broken = wait.fd < 0;
  const int ready = poll(&wait, broken ? 0 : 1, timeout_ms);
  if (broken) return -1;
  if (ready <= 0) return 0;
  return lcm.handle() == 0 ? 1 : -1;
}

}  // namespace tumbler
