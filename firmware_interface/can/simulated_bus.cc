#include "firmware_interface/can/simulated_bus.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "common/core/functions.h"

namespace tumbler {

namespace {

constexpr int kErrorFlagBits = 6;
constexpr int kSuperposedErrorFlagBits = 12;
constexpr int kErrorDelimiterBits = 8;
constexpr int kBitsAfterAckSlot = 8;  // ACK delimiter and end of frame
constexpr int kSuspendBits = 8;

// ISO 11898-1, fault confinement.
constexpr int kTransmitErrorStep = 8;
constexpr int kWarningFrom = 96;
constexpr int kPassiveAbove = 127;
constexpr int kBusOffAbove = 255;
constexpr int kRecessiveSequences = 128;
constexpr int kRecessiveBits = 11;

constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

// Whether two frames put the same bits on the wire.
bool SameOnWire(const CanFrame& a, const CanFrame& b) noexcept {
  if (ArbitrationKey(a) != ArbitrationKey(b) || a.size != b.size) return false;
  return a.remote || std::equal(a.data.begin(), a.data.begin() + a.size, b.data.begin());
}

// The number, from 1, of the bit at which two frames first differ; if they never do, of their last.
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
  held_.reserve(kHeldMax);
}

Status SimulatedPort::Send(const CanFrame& frame) noexcept { return SendAfter(0, frame); }

Status SimulatedPort::SendAfter(std::int64_t delay_ns, const CanFrame& frame) noexcept {
  if (delay_ns < 0 || config_.listen_only || !IsValid(frame)) return Status::kInvalidArgument;
  if (link_ != Status::kOk) return link_;
  if (bus_off_) return Status::kBusOff;
  if (transmit_.full()) {
    ++statistics_.rejected_transmit;
    return Status::kWouldBlock;
  }
  transmit_.Push({frame, bus_.now_ns() + delay_ns, FrameBits(frame)});
  statistics_.max_transmit_depth = std::max(statistics_.max_transmit_depth, transmit_.count);
  return Status::kOk;
}

Status SimulatedPort::Receive(ReceivedFrame& received) noexcept {
  if (link_ != Status::kOk) return link_;
  if (receive_.count == 0) return bus_off_ ? Status::kBusOff : Status::kWouldBlock;
  received = {receive_.front().frame, receive_.front().time_ns};
  receive_.Pop();
  return Status::kOk;
}

CanControllerState SimulatedPort::controller_state() const noexcept {
  if (bus_off_) return CanControllerState::kBusOff;
  const int most = std::max(transmit_errors_, receive_errors_);
  if (most > kPassiveAbove) return CanControllerState::kErrorPassive;
  return most >= kWarningFrom ? CanControllerState::kErrorWarning
                              : CanControllerState::kErrorActive;
}

void SimulatedPort::Restart() noexcept {
  if (!bus_off_) return;
  restart_at_ns_ = std::min(restart_at_ns_, bus_.now_ns());
}

void SimulatedPort::DropTransmitQueue() noexcept {
  statistics_.dropped_transmit += transmit_.count - (head_on_wire_ ? 1 : 0);
  head_on_wire_ = false;
  transmit_.count = 0;
}

void SimulatedPort::SetLink(Status status) noexcept {
  if (status == link_ || link_ == Status::kLinkGone) return;
  link_ = status;
  DropTransmitQueue();
  receive_.count = 0;
  held_.clear();
  transmit_errors_ = receive_errors_ = 0;
  bus_off_ = false;
}

std::int64_t SimulatedPort::ReadyAt() const noexcept {
  return std::max(transmit_.front().time_ns, suspended_until_ns_);
}

void SimulatedPort::LoseArbitration() noexcept {
  if (config_.auto_retransmit || config_.waits_for_bus) return;
  transmit_.Pop();
  ++statistics_.dropped_transmit;
}

void SimulatedPort::FailToSend(bool unacknowledged) noexcept {
  ++statistics_.errors;
  if (!unacknowledged || transmit_errors_ <= kPassiveAbove) transmit_errors_ += kTransmitErrorStep;
  const bool was_head = head_on_wire_;  // false if the link went down in the middle of the frame
  head_on_wire_ = false;
  if (transmit_errors_ > kBusOffAbove) {
    bus_off_ = true;
    recovering_ = false;
    ++statistics_.bus_offs;
    DropTransmitQueue();
    recessive_left_ = kRecessiveSequences;
    restart_at_ns_ = config_.restart_ns < 0 ? std::numeric_limits<std::int64_t>::max()
                                            : bus_.now_ns() + config_.restart_ns;
    return;
  }
  if (config_.auto_retransmit || !was_head) return;
  transmit_.Pop();
  ++statistics_.dropped_transmit;
}

void SimulatedPort::Sent() noexcept {
  ++statistics_.sent;
  if (transmit_errors_ > 0) --transmit_errors_;
  if (head_on_wire_) transmit_.Pop();
  head_on_wire_ = false;
}

void SimulatedPort::HearError() noexcept {
  receive_errors_ = std::min(receive_errors_ + 1, kBusOffAbove);
}

void SimulatedPort::HearFrame() noexcept {
  if (receive_errors_ > kPassiveAbove) receive_errors_ = kPassiveAbove;
  if (receive_errors_ > 0) --receive_errors_;
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
  if (phase_ != Phase::kIdle) busy_ns -= busy_until_ns_ - now_ns_;  // This is still to come.
  return static_cast<double>(busy_ns) / static_cast<double>(now_ns_);
}

void SimulatedBus::SetFaults(const BusFaultPlan& plan) {
  for (const BusFault& fault : plan.faults) {
    if (fault.node < BusFault::kEveryNode || fault.node >= static_cast<int>(ports_.size())) {
      throw std::invalid_argument("a bus fault concerns node " + std::to_string(fault.node) +
                                  ", of " + std::to_string(ports_.size()));
    }
    if (!(fault.probability >= 0 && fault.probability <= 1) || fault.delay_ns < 0) {
      throw std::invalid_argument("the probability of a bus fault must be 0 ... 1, its delay >= 0");
    }
  }
  plan_ = plan;
  random_ = plan.seed;
  ApplyWindows();
}

// splitmix64: the same numbers on every machine.
double SimulatedBus::Random() noexcept {
  random_ += 0x9e37'79b9'7f4a'7c15U;
  std::uint64_t x = random_;
  x = (x ^ x >> 30) * 0xbf58'476d'1ce4'e5b9U;
  x = (x ^ x >> 27) * 0x94d0'49bb'1331'11ebU;
  x ^= x >> 31;
  return static_cast<double>(x >> 11) * 0x1p-53;
}

// Applies the faults that last for a time to the ports, as they are now, and notes when they change
// next.
void SimulatedBus::ApplyWindows() noexcept {
  next_window_ns_ = kNever;
  if (phase_ == Phase::kIdle) CountIdle();
  shorted_ = false;
  for (std::size_t i = 0; i < ports_.size(); ++i) {
    SimulatedPort& port = *ports_[i];
    bool down = false, gone = false, was_scripted = false;
    port.disconnected_ = port.stalled_ = false;
    for (const BusFault& fault : plan_.faults) {
      if (fault.start_ns > now_ns_) next_window_ns_ = std::min(next_window_ns_, fault.start_ns);
      if (fault.end_ns > now_ns_) next_window_ns_ = std::min(next_window_ns_, fault.end_ns);
      if (fault.node != BusFault::kEveryNode && fault.node != static_cast<int>(i)) continue;
      const bool active = fault.start_ns <= now_ns_ && now_ns_ < fault.end_ns;
      switch (fault.kind) {
        case BusFaultKind::kShort:
          shorted_ = shorted_ || active;
          break;
        case BusFaultKind::kDisconnect:
          port.disconnected_ = port.disconnected_ || active;
          break;
        case BusFaultKind::kStall:
          port.stalled_ = port.stalled_ || active;
          break;
        case BusFaultKind::kLinkDown:
          down = down || active;
          was_scripted = was_scripted || fault.end_ns <= now_ns_;
          break;
        case BusFaultKind::kLinkGone:
          gone = gone || active;
          break;
        default:
          break;
      }
    }
    if (gone) {
      port.SetLink(Status::kLinkGone);
    } else if (down || was_scripted) {  // Otherwise the link stays as the user has set it.
      port.SetLink(down ? Status::kLinkDown : Status::kOk);
    }
  }
}

// Counts the sequences of recessive bits since the bus became idle, for ports in bus-off.
void SimulatedBus::CountIdle() noexcept {
  const std::int64_t sequence_ns = kRecessiveBits * bit_time_ns_;
  const std::int64_t sequences = (now_ns_ - idle_since_ns_) / sequence_ns;
  if (!shorted_ && sequences > 0) {
    CountRecessive(static_cast<int>(std::min<std::int64_t>(sequences, kRecessiveSequences)));
  }
  idle_since_ns_ = shorted_ ? now_ns_ : idle_since_ns_ + sequences * sequence_ns;
}

void SimulatedBus::CountRecessive(int sequences) noexcept {
  for (const auto& port : ports_) {
    if (!port->bus_off_ || !port->recovering_) continue;
    port->recessive_left_ -= sequences;
    if (port->recessive_left_ > 0) continue;
    port->bus_off_ = false;
    port->transmit_errors_ = port->receive_errors_ = 0;
  }
}

void SimulatedBus::BeginRecovery() noexcept {
  for (const auto& port : ports_) {
    if (!port->bus_off_ || port->recovering_ || port->restart_at_ns_ > now_ns_) continue;
    if (phase_ == Phase::kIdle) CountIdle();  // Idle time before its restart does not count.
    port->recovering_ = true;
  }
}

// Lets nodes that are off the wire try to send. Nobody else sees it.
void SimulatedBus::TryAlone() noexcept {
  for (const auto& port : ports_) {
    if (!port->disconnected_ || !port->Wants() || port->ReadyAt() > now_ns_) continue;
    const int bits = port->transmit_.front().bits - kIntermissionBits - kBitsAfterAckSlot +
                     kErrorFlagBits + kErrorDelimiterBits + kIntermissionBits;
    ++statistics_.unacknowledged;
    port->suspended_until_ns_ = now_ns_ + bits * bit_time_ns_;
    port->head_on_wire_ = true;
    port->FailToSend(true);
  }
}

std::int64_t SimulatedBus::NextEvent() noexcept {
  std::int64_t next = next_window_ns_;
  if (phase_ != Phase::kIdle) next = std::min(next, phase_end_ns_);
  for (const auto& port : ports_) {
    if (!port->held_.empty()) next = std::min(next, port->held_.front().due_ns);
    if (port->Wants() && (phase_ == Phase::kIdle || port->disconnected_)) {
      next = std::min(next, port->ReadyAt());
    }
    if (port->bus_off_ && !port->recovering_) {
      next = std::min(next, port->restart_at_ns_);
    } else if (port->bus_off_ && phase_ == Phase::kIdle && !shorted_) {
      const std::int64_t left = port->recessive_left_;
      next = std::min(next, idle_since_ns_ + left * kRecessiveBits * bit_time_ns_);
    }
  }
  return next;
}

bool SimulatedBus::SomebodyHeeds(const CanFrame& frame) const noexcept {
  return std::ranges::any_of(ports_, [&frame](const auto& port) {
    return port->node_ != nullptr && port->node_->Heeds(frame);
  });
}

std::int64_t SimulatedBus::NextDelivery() const noexcept {
  return NextEnd([this](const CanFrame& frame) { return SomebodyHeeds(frame); });
}

std::int64_t SimulatedBus::NextFrameEnd() const noexcept {
  return NextEnd([](const CanFrame& /*frame*/) { return true; });
}

template <class Counts>
std::int64_t SimulatedBus::NextEnd(Counts counts) const noexcept {
  std::int64_t next = next_window_ns_;
  std::int64_t free_ns = now_ns_;
  if (phase_ == Phase::kFrame) {
    if (counts(wire_)) return std::min(next, phase_end_ns_);
    free_ns = busy_until_ns_;
  } else if (phase_ == Phase::kRecovery) {
    free_ns = phase_end_ns_;
  }
  for (const auto& port : ports_) {
    for (const SimulatedPort::Held& held : port->held_) next = std::min(next, held.due_ns);
    if (!port->Wants()) continue;
    // The frame on the wire is its sender's first one still.
    const SimulatedPort::Queue& queue = port->transmit_;
    const int waiting = port->head_on_wire_ ? 1 : 0;
    if (queue.count <= waiting) continue;
    const SimulatedPort::Entry& entry =
        queue.entries[static_cast<std::size_t>(queue.first + waiting) % queue.entries.size()];
    const bool last = queue.count == waiting + 1;
    const bool heeded = counts(entry.frame);
    if (!heeded && last) continue;
    // Where nobody heeds it, the next one may begin after it; where it may be lost, in its place.
    const bool stays = last || port->config_.auto_retransmit || port->config_.waits_for_bus;
    const int shortest = UnstuffedFrameBits(CanIdKind::kStandard, 0) - kIntermissionBits;
    const int bits = heeded ? entry.bits - kIntermissionBits : entry.bits;
    next = std::min(next, std::max({free_ns, entry.time_ns, port->suspended_until_ns_}) +
                              (stays ? bits : shortest) * bit_time_ns_);
  }
  return next;
}

void SimulatedBus::AdvanceTo(std::int64_t time_ns) noexcept {
  for (;;) {
    const std::int64_t next = NextEvent();
    if (next > time_ns) break;
    now_ns_ = std::max(now_ns_, next);
    if (next_window_ns_ <= now_ns_) ApplyWindows();
    ReleaseHeld();
    TryAlone();
    BeginRecovery();
    if (phase_ == Phase::kIdle) {
      const bool somebody = std::any_of(ports_.begin(), ports_.end(), [this](const auto& port) {
        return port->Wants() && !port->disconnected_ && port->ReadyAt() <= now_ns_;
      });
      CountIdle();
      if (somebody) Start();
    } else if (phase_end_ns_ <= now_ns_) {
      if (phase_ == Phase::kFrame) {
        Finish();
      } else {
        phase_ = Phase::kIdle;
        idle_since_ns_ = now_ns_;
        CountRecessive(1);
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
    return port->Wants() && !port->disconnected_ && port->ReadyAt() <= now_ns_;
  };
  std::uint32_t smallest = std::numeric_limits<std::uint32_t>::max();
  for (const auto& port : ports_) {
    if (contends(port))
      smallest = std::min(smallest, ArbitrationKey(port->transmit_.front().frame));
  }
  bool first = true;
  int wire_bits = 0;
  int collision_bits = 0;
  for (const auto& port : ports_) {
    port->sending_ = false;
    if (!contends(port)) continue;
    const SimulatedPort::Entry& entry = port->transmit_.front();
    const CanFrame& frame = entry.frame;
    if (ArbitrationKey(frame) != smallest) {
      port->LoseArbitration();
      continue;
    }
    port->sending_ = true;
    port->head_on_wire_ = true;
    if (first) {
      wire_ = frame;
      wire_bits = entry.bits;
      first = false;
    } else if (!SameOnWire(wire_, frame)) {
      const int difference = FirstDifference(wire_, frame);
      collision_bits = collision_bits == 0 ? difference : std::min(collision_bits, difference);
    }
  }
  if (shorted_) {  // The start bit is dominant like the short; the next recessive bit fails.
    ++statistics_.disturbed;
    return Break(2, false);
  }
  if (collision_bits > 0) {
    ++statistics_.collisions;
    return Break(collision_bits, false);
  }
  const int frame_bits = wire_bits - kIntermissionBits;
  const int disturbed = DisturbedBit(frame_bits);
  last_bit_disturbed_ = disturbed == frame_bits;
  if (disturbed > 0 && !last_bit_disturbed_) {
    ++statistics_.disturbed;
    return Break(disturbed, false);
  }
  const bool acknowledged = std::any_of(ports_.begin(), ports_.end(), [](const auto& port) {
    return !port->sending_ && port->TakesPart() && !port->config_.listen_only;
  });
  // Two senders of the same frame do not acknowledge each other: neither is a receiver.
  if (!acknowledged) {
    ++statistics_.unacknowledged;
    return Break(frame_bits - kBitsAfterAckSlot, true);
  }
  Occupy(Phase::kFrame, frame_bits, wire_bits);
}

// The number, from 1, of the first disturbed bit of a frame; 0 if there is none.
int SimulatedBus::DisturbedBit(int bits) noexcept {
  int first = 0;
  for (const BusFault& fault : plan_.faults) {
    if (fault.kind != BusFaultKind::kBitErrors || fault.start_ns > now_ns_ ||
        fault.end_ns <= now_ns_) {
      continue;
    }
    if (!fault.ids.empty() && std::ranges::find(fault.ids, wire_.id) == fault.ids.end()) continue;
    // The number of good bits before it is distributed geometrically.
    const double draw = Random();
    if (fault.probability <= 0) continue;
    const double good =
        fault.probability >= 1 ? 0 : portable::Log1p(-draw) / portable::Log1p(-fault.probability);
    if (good >= bits) continue;
    const int bit = static_cast<int>(good) + 1;
    first = first == 0 ? bit : std::min(first, bit);
  }
  return first;
}

// Ends the frame on the wire after `bits` bits by an error frame. All its senders have failed.
void SimulatedBus::Break(int bits, bool unacknowledged) noexcept {
  const int flag = unacknowledged ? kErrorFlagBits : kSuperposedErrorFlagBits;
  const int all = bits + flag + kErrorDelimiterBits + kIntermissionBits;
  const std::int64_t end_ns = now_ns_ + all * bit_time_ns_;
  for (const auto& port : ports_) {
    if (port->sending_) {
      port->FailToSend(unacknowledged);
      if (port->controller_state() == CanControllerState::kErrorPassive) {
        port->suspended_until_ns_ = end_ns + kSuspendBits * bit_time_ns_;
      }
    } else if (port->TakesPart()) {
      port->HearError();
    }
  }
  Occupy(Phase::kRecovery, all, all);
}

void SimulatedBus::Finish() noexcept {
  ++statistics_.frames;
  phase_ = Phase::kRecovery;
  phase_end_ns_ = busy_until_ns_;
  const ReceivedFrame received{wire_, now_ns_};
  const bool repeat = last_bit_disturbed_;
  last_bit_disturbed_ = false;
  if (repeat) ++statistics_.disturbed;
  for (const auto& port : ports_) {
    if (!port->sending_) continue;
    if (repeat) {
      port->FailToSend(false);
    } else {
      port->Sent();
    }
    if (port->controller_state() == CanControllerState::kErrorPassive) {
      port->suspended_until_ns_ = busy_until_ns_ + kSuspendBits * bit_time_ns_;
    }
  }
  ReceiveFrom(received);
}

void SimulatedBus::ReceiveFrom(const ReceivedFrame& received) noexcept {
  for (const auto& port : ports_) {
    if (port->sending_ || !port->TakesPart()) continue;
    port->HearFrame();
    Pass(*port, received);
  }
}

// Passes a frame from the wire to a port. The script may change it on the way.
void SimulatedBus::Pass(SimulatedPort& port, ReceivedFrame received) noexcept {
  const bool overtakes = !port.held_.empty() && port.held_.front().until_next;
  bool lost = false, until_next = false;
  int copies = 1;
  std::int64_t delay_ns = 0;
  for (const BusFault& fault : plan_.faults) {
    if (fault.start_ns > now_ns_ || fault.end_ns <= now_ns_) continue;
    if (fault.node != BusFault::kEveryNode &&
        ports_[static_cast<std::size_t>(fault.node)].get() != &port)
      continue;
    if (!fault.ids.empty() && std::ranges::find(fault.ids, received.frame.id) == fault.ids.end())
      continue;
    if (fault.kind > BusFaultKind::kFlip) continue;
    if (Random() >= fault.probability) continue;
    switch (fault.kind) {
      case BusFaultKind::kLoss:
        lost = true;
        break;
      case BusFaultKind::kDuplicate:
        ++copies;
        break;
      case BusFaultKind::kDelay:
        delay_ns = std::max(delay_ns, fault.delay_ns);
        break;
      case BusFaultKind::kReorder:
        delay_ns = std::max(delay_ns, fault.delay_ns);
        until_next = true;
        break;
      case BusFaultKind::kFlip: {
        const int bits = 8 * received.frame.size;
        if (bits == 0) break;
        const int bit = static_cast<int>(Random() * bits);
        std::uint8_t& byte = received.frame.data[static_cast<std::size_t>(bit / 8)];
        byte = static_cast<std::uint8_t>(byte ^ 1U << (bit % 8));
        break;
      }
      default:
        break;
    }
  }
  for (int left = lost ? 0 : copies; left > 0; --left) {
    if (until_next && !overtakes) {
      Hold(port, received, now_ns_ + delay_ns, true);
    } else if (delay_ns > 0 || (!port.held_.empty() && !overtakes)) {
      // The order is kept: a frame comes behind those that are still on their way.
      const std::int64_t last_ns = port.held_.empty() ? now_ns_ : port.held_.back().due_ns;
      Hold(port, received, std::max(now_ns_ + delay_ns, last_ns), false);
    } else {
      port.Deliver(received);
    }
  }
  if (overtakes) {
    for (SimulatedPort::Held& held : port.held_) {
      if (held.until_next) held.due_ns = now_ns_;
    }
    ReleaseHeld();
  }
}

void SimulatedBus::Hold(SimulatedPort& port, const ReceivedFrame& received, std::int64_t due_ns,
                        bool until_next) noexcept {
  if (port.held_.size() == SimulatedPort::kHeldMax) {
    ++port.statistics_.dropped_received;
    return;
  }
  port.held_.push_back({{received.frame, received.time_ns}, due_ns, until_next});
}

void SimulatedBus::ReleaseHeld() noexcept {
  for (const auto& port : ports_) {
    while (!port->held_.empty() && port->held_.front().due_ns <= now_ns_) {
      const SimulatedPort::Held held = port->held_.front();
      port->held_.erase(port->held_.begin());
      port->Deliver({held.entry.frame, std::max(held.entry.time_ns, held.due_ns)});
    }
  }
}

}  // namespace tumbler
