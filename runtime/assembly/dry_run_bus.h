#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "firmware_interface/can/bus.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/simulated_drive.h"
#include "runtime/assembly/candump.h"

namespace tumbler {

/// A bus for dry runs, which sends nothing. It prints every frame in candump's log format, and
/// simulated drives answer. Their joints are imagined to be exactly where the drives hold them, at
/// rest. So the whole sequence can be looked at before a motor turns.
class DryRunBus final : public CanBus {
 public:
  /// One imagined drive and its joint.
  struct Node {
    std::unique_ptr<SimulatedDrive> drive;
    double position_rad = 0;  ///< Of the joint at the start.
  };

  /// @param interface  name to print, e.g. `can0`.
  /// @param bit_rate   as SimulatedBus.
  /// @param out        where to print; null prints nothing.
  DryRunBus(std::string interface, int bit_rate, std::vector<Node> nodes, std::FILE* out);

  /// Moves bus and drives on to this time. Printed frames carry it.
  void AdvanceTo(std::int64_t time_ns) noexcept;

  Status Send(const CanFrame& frame) noexcept override;
  Status Receive(ReceivedFrame& received) noexcept override;

 private:
  std::string interface_;
  SimulatedBus bus_;
  SimulatedPort& host_;
  std::vector<Node> nodes_;
  std::int64_t now_ns_ = 0;
  std::FILE* out_;
};

}  // namespace tumbler
