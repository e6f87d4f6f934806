#include "runtime/linux/dry_run_bus.h"

#include <fmt/format.h>

#include <utility>

namespace tumbler {

std::string CandumpLine(std::int64_t time_ns, const std::string& interface, const CanFrame& frame) {
  std::string line =
      fmt::format("({}.{:06}) {} ", time_ns / 1'000'000'000, time_ns / 1000 % 1'000'000, interface);
  line += frame.extended ? fmt::format("{:08X}#", frame.id) : fmt::format("{:03X}#", frame.id);
  if (frame.remote) return line + 'R';
  for (std::size_t i = 0; i < frame.size; ++i) line += fmt::format("{:02X}", frame.data[i]);
  return line;
}

DryRunBus::DryRunBus(std::string interface, const std::vector<Node>& nodes, const Clock& clock,
                     std::FILE* out)
    : interface_(std::move(interface)), clock_(clock), out_(out) {
  constexpr float kRoomTemperature_c = 25;
  for (const Node& node : nodes) {
    State state;
    state.mit = node.mit;
    state.reply.sender = static_cast<std::uint8_t>(node.mit.command_id);
    state.reply.position_rad =
        node.mit.joint.ToDrivePosition(static_cast<float>(node.position_rad));
    state.reply.temperature_c = kRoomTemperature_c;
    nodes_.push_back(state);
  }
}

Status DryRunBus::Send(const CanFrame& frame) noexcept {
  if (out_ != nullptr)
    std::fputs((CandumpLine(clock_.now_ns(), interface_, frame) + '\n').c_str(), out_);
  for (State& node : nodes_) {
    MitMagic magic{};
    MitCommand command;
    const bool is_magic = DecodeMitMagic(node.mit, frame, magic);
    if (!is_magic && DecodeMitCommand(node.mit, frame, command) != Status::kOk) continue;
    replies_.push_back({EncodeMitReply(node.mit, node.reply), clock_.now_ns()});
    if (is_magic) {
      node.enabled = magic == MitMagic::kEnter;
      node.reply.velocity_rad_s = 0;
      node.reply.torque_nm = 0;
    } else if (node.enabled && command.kp_nm_per_rad > 0) {
      node.reply.position_rad = command.position_rad;
      node.reply.velocity_rad_s = command.velocity_rad_s;
      node.reply.torque_nm = command.torque_nm;
    }
  }
  return Status::kOk;
}

Status DryRunBus::Receive(ReceivedFrame& received) noexcept {
  if (replies_.empty()) return Status::kWouldBlock;
  received = replies_.front();
  replies_.erase(replies_.begin());
  return Status::kOk;
}

}  // namespace tumbler
