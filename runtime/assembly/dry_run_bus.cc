#include "runtime/assembly/dry_run_bus.h"

#include <algorithm>
#include <utility>

#include "firmware_interface/devices/drive.h"

namespace tumbler {
namespace {

/// A host whose queue has room for a tick's frames.
SimulatedPortConfig HostPort(int drives) {
  SimulatedPortConfig port;
  port.transmit_capacity = std::max(port.transmit_capacity, FrameBatch::kCapacity * drives);
  return port;
}

}  // namespace

DryRunBus::DryRunBus(std::string interface, int bit_rate, std::vector<Node> nodes, std::FILE* out)
    : interface_(std::move(interface)),
      bus_(bit_rate),
      host_(bus_.Attach(HostPort(static_cast<int>(nodes.size())))),
      nodes_(std::move(nodes)),
      out_(out) {
  for (Node& node : nodes_) node.drive->AttachTo(bus_);
}

void DryRunBus::AdvanceTo(std::int64_t time_ns) noexcept {
  constexpr std::int64_t kStep_ns = 50'000;  // A drive's current loop runs at 20 to 40 kHz.
  while (now_ns_ < time_ns) {
    now_ns_ = std::min(now_ns_ + kStep_ns, time_ns);
    bus_.AdvanceTo(now_ns_);
    for (Node& node : nodes_) {
      node.position_rad = node.drive->target_rad().value_or(node.position_rad);
      node.drive->Step(now_ns_, node.position_rad, 0);
    }
  }
}

Status DryRunBus::Send(const CanFrame& frame) noexcept {
  if (out_ != nullptr) {
    std::fputs((CandumpLine(now_ns_, interface_, frame) + '\n').c_str(), out_);
  }
  return host_.Send(frame);
}

Status DryRunBus::Receive(ReceivedFrame& received) noexcept { return host_.Receive(received); }

}  // namespace tumbler
