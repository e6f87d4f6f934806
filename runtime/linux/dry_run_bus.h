#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "firmware_interface/can/bus.h"
#include "firmware_interface/drives/mit.h"
#include "runtime/linux/clock.h"

namespace tumbler {

/// Stands for a real bus without touching it: every frame is printed in candump's log format, and
/// each drive is imagined to follow perfectly, so that the whole sequence can be looked at before a
/// motor turns.
class DryRunBus final : public CanBus {
 public:
  /// One imagined drive.
  struct Node {
    MitConfig mit;
    double position_rad = 0;  ///< of the joint, at the start
  };

  /// @param interface  name to print, e.g. `can0`.
  /// @param clock      gives the printed times; must outlive the bus.
  /// @param out        where to print; null prints nothing.
  DryRunBus(std::string interface, const std::vector<Node>& nodes, const Clock& clock,
            std::FILE* out);

  Status Send(const CanFrame& frame) noexcept override;
  Status Receive(ReceivedFrame& received) noexcept override;

 private:
  struct State {
    MitConfig mit;
    MitReply reply;
    bool enabled = false;
  };

  std::string interface_;
  std::vector<State> nodes_;
  std::vector<ReceivedFrame> replies_;  // oldest first
  const Clock& clock_;
  std::FILE* out_;
};

/// One line of a `candump -l` log without its line feed: `(12.345678) can0 001#7FFF7FF0CCD337FF`.
std::string CandumpLine(std::int64_t time_ns, const std::string& interface, const CanFrame& frame);

}  // namespace tumbler
