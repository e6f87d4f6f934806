#include "firmware_interface/can/simulated_bus.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

namespace tumbler {

namespace {

constexpr int kErrorFlagBits = 6;
constexpr int kSuperposedErrorFlagBits = 12;
constexpr int kErrorDelimiterBits = 8;
constexpr int kBitsAfterAckSlot = 8;  // ACK delimiter and end of frame

// Frames that put the same bits on the wire.
bool SameOnWire(const CanFrame& a, const CanFrame& b) noexcept {
  if (ArbitrationKey(a) != ArbitrationKey(b) || a.size != b.size) return false;
  return a.remote || std::equal(a.data.begin(), a.data.begin() + a.size, b.data.begin());
}

// The bit, counted from 1, at which two frames first differ; the frames' ends if they never do.
int FirstDifference(const CanFrame& a, const CanFrame& b) noexcept {
  const FrameBitStream first = BuildBitStream(a);
  const FrameBitStream second = BuildBitStream(b);
  const int count = std::min(first.count, second.count);
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (first.bits[k] != second.bits[k]) return i + 1;
  }
  return count;
}

}  // namespace

void SimulatedPort::Queue::Push(const Entry& entry) noexcept {
  entries[static_cast<std::size_t>(first + count) % entries.size()] = entry;
  ++count;
}

void SimulatedPort::Queue::Pop() noexcept {
  first = (first + 1) % static_cast<int>(entries.size());
  --count;
}

SimulatedPort::SimulatedPort(const SimulatedBus& bus, const SimulatedPortConfig& config,
                             SimulatedNode* node)
    : bus_(bus), config_(config), node_(node) {
  transmit_.entries.resize(static_cast<std::size_t>(config.transmit_capacity));
  receive_.entries.resize(static_cast<std::size_t>(config.receive_capacity));
}

Status SimulatedPort::Send(const CanFrame& frame) noexcept { return SendAfter(0, frame); }

Status SimulatedPort::SendAfter(std::int64_t delay_ns, const CanFrame& frame) noexcept {
  if (delay_ns < 0 || config_.listen_only || !IsValid(frame)) return Status::kInvalidArgument;
  if (link_down_) return Status::kLinkDown;
  if (transmit_.full()) {
    ++statistics_.rejected_transmit;
    return Status::kWouldBlock;
  }
  transmit_.Push({frame, bus_.now_ns() + delay_ns});
  statistics_.max_transmit_depth = std::max(statistics_.max_transmit_depth, transmit_.count);
  return Status::kOk;
}

Status SimulatedPort::Receive(ReceivedFrame& received) noexcept {
  if (link_down_) return Status::kLinkDown;
  if (receive_.count == 0) return Status::kWouldBlock;
  received = {receive_.front().frame, receive_.front().time_ns};
  receive_.Pop();
  return Status::kOk;
}

void SimulatedPort::SetLinkDown(bool down) noexcept {
  if (down == link_down_) return;
  link_down_ = down;
  statistics_.dropped_transmit += transmit_.count - (head_on_wire_ ? 1 : 0);
  head_on_wire_ = false;
  transmit_.count = 0;
  receive_.count = 0;
}

void SimulatedPort::Fail() noexcept {
  head_on_wire_ = false;
  if (config_.auto_retransmit) return;
  transmit_.Pop();
  ++statistics_.dropped_transmit;
}

void SimulatedPort::Deliver(const ReceivedFrame& received) noexcept {
  if (node_ != nullptr) {
    ++statistics_.received;
    node_->OnFrame(received, *this);
    return;
  }
  if (receive_.full()) {
    ++statistics_.dropped_received;
    return;
  }
  ++statistics_.received;
  receive_.Push({received.frame, received.time_ns});
  statistics_.max_receive_depth = std::max(statistics_.max_receive_depth, receive_.count);
}

SimulatedBus::SimulatedBus(int bit_rate) {
  if (bit_rate < 10'000 || bit_rate > 1'000'000) {
    throw std::invalid_argument("bit rate of a simulated bus is " + std::to_string(bit_rate) +
                                " bit/s; allowed: from 10000 ... 1000000");
  }
  ports_.reserve(kMaxNodes);
  bit_time_ns_ = (1'000'000'000LL + bit_rate / 2) / bit_rate;
}

SimulatedBus::~SimulatedBus() = default;

SimulatedPort& SimulatedBus::Attach(const PortConfig& config) { return Add(config, nullptr); }

SimulatedPort& SimulatedBus::Attach(SimulatedNode& node, const PortConfig& config) {
  return Add(config, &node);
}

SimulatedPort& SimulatedBus::Add(const PortConfig& config, SimulatedNode* node) {
  if (ports_.size() == kMaxNodes) throw std::length_error("a simulated bus holds at most 16 nodes");
  if (config.transmit_capacity < 1 || config.receive_capacity < 1) {
    throw std::invalid_argument("queues of a simulated port hold at least one frame");
  }
  std::unique_ptr<SimulatedPort> port(new SimulatedPort(*this, config, node));
  return *ports_.emplace_back(std::move(port));
}

double SimulatedBus::load() const noexcept {
  if (now_ns_ == 0) return 0;
  std::int64_t busy_ns = statistics_.busy_ns;
  if (phase_ != Phase::kIdle) busy_ns -= busy_until_ns_ - now_ns_;  // counted ahead
  return static_cast<double>(busy_ns) / static_cast<double>(now_ns_);
}

void SimulatedBus::AdvanceTo(std::int64_t time_ns) noexcept {
  while (now_ns_ <= time_ns) {
    if (phase_ == Phase::kIdle) {
      std::int64_t ready_ns = std::numeric_limits<std::int64_t>::max();
      for (const auto& port : ports_) {
        if (port->transmit_.count > 0)
          ready_ns = std::min(ready_ns, port->transmit_.front().time_ns);
      }
      if (ready_ns > time_ns) break;
      now_ns_ = std::max(now_ns_, ready_ns);
      Start();
    } else {
      if (phase_end_ns_ > time_ns) break;
      now_ns_ = phase_end_ns_;
      if (phase_ == Phase::kFrame) {
        Finish();
      } else {
        phase_ = Phase::kIdle;
      }
    }
  }
  now_ns_ = std::max(now_ns_, time_ns);
}

void SimulatedBus::Occupy(Phase phase, int bits, int bits_until_free) noexcept {
  phase_ = phase;
  phase_end_ns_ = now_ns_ + bits * bit_time_ns_;
  busy_until_ns_ = now_ns_ + bits_until_free * bit_time_ns_;
  statistics_.bits += bits_until_free;
  statistics_.busy_ns += bits_until_free * bit_time_ns_;
}

void SimulatedBus::Start() noexcept {
  const auto contends = [this](const std::unique_ptr<SimulatedPort>& port) {
    return port->transmit_.count > 0 && port->transmit_.front().time_ns <= now_ns_;
  };
  std::uint32_t smallest = std::numeric_limits<std::uint32_t>::max();
  for (const auto& port : ports_) {
    if (contends(port))
      smallest = std::min(smallest, ArbitrationKey(port->transmit_.front().frame));
  }
  bool first = true;
  int collision_bits = 0;
  for (const auto& port : ports_) {
    port->sending_ = false;
    if (!contends(port)) continue;
    const CanFrame& frame = port->transmit_.front().frame;
    if (ArbitrationKey(frame) != smallest) {
      port->Fail();  // Arbitration lost.
      continue;
    }
    port->sending_ = true;
    port->head_on_wire_ = true;
    if (first) {
      wire_ = frame;
      first = false;
    } else if (!SameOnWire(wire_, frame)) {
      const int difference = FirstDifference(wire_, frame);
      collision_bits = collision_bits == 0 ? difference : std::min(collision_bits, difference);
    }
  }
  if (collision_bits > 0) {
    ++statistics_.collisions;
    FailSenders();
    const int bits =
        collision_bits + kSuperposedErrorFlagBits + kErrorDelimiterBits + kIntermissionBits;
    Occupy(Phase::kRecovery, bits, bits);
    return;
  }
  const int bits = FrameBits(wire_);
  const bool acknowledged = std::any_of(ports_.begin(), ports_.end(), [](const auto& port) {
    return !port->sending_ && !port->link_down_ && !port->config_.listen_only;
  });
  // Two senders of the same frame do not acknowledge each other: neither is a receiver.
  if (!acknowledged) {
    ++statistics_.unacknowledged;
    FailSenders();
    const int error_bits = bits - kIntermissionBits - kBitsAfterAckSlot + kErrorFlagBits +
                           kErrorDelimiterBits + kIntermissionBits;
    Occupy(Phase::kRecovery, error_bits, error_bits);
    return;
  }
  Occupy(Phase::kFrame, bits - kIntermissionBits, bits);
}

void SimulatedBus::FailSenders() noexcept {
  for (const auto& port : ports_) {
    if (port->sending_) port->Fail();
  }
}

void SimulatedBus::Finish() noexcept {
  ++statistics_.frames;
  phase_ = Phase::kRecovery;
  phase_end_ns_ = busy_until_ns_;
  const ReceivedFrame received{wire_, now_ns_};
  for (const auto& port : ports_) {
    if (!port->sending_) continue;
    ++port->statistics_.sent;
    if (port->head_on_wire_) port->transmit_.Pop();
    port->head_on_wire_ = false;
  }
  for (const auto& port : ports_) {
    if (!port->sending_ && !port->link_down_) port->Deliver(received);
  }
}

}  // namespace tumbler
