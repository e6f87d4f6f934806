#pragma once

#include <cstdint>
#include <limits>
#include <vector>

namespace tumbler {

/// The kinds of faults of a simulated bus. "Receiver", "sender" and "node" stand for the node that
/// `BusFault::node` names.
enum class BusFaultKind : std::uint8_t {
  kLoss,        ///< The receiver misses the frame after it was acknowledged, as in an overrun.
  kDuplicate,   ///< The receiver gets the frame once more.
  kDelay,       ///< The receiver gets the frame later, e.g. out of a USB adapter; order is kept.
  kReorder,     ///< The receiver gets the frame after the one that follows it.
  kFlip,        ///< One bit of the payload is inverted in the receiver's memory: no CRC sees it.
  kBitErrors,   ///< Bits are disturbed on the wire: error frames, retransmission, error counters.
  kShort,       ///< The wires are shorted: nothing gets through, and every sender goes bus-off.
  kDisconnect,  ///< The node is off the wire: it hears nobody, and nobody acknowledges.
  kStall,       ///< The sender's frames do not leave its queue, which fills up (ENOBUFS).
  kLinkDown,    ///< The node's interface is down: what waits in its queues is gone.
  kLinkGone,    ///< The node's interface does not exist any more.
};

/// A fault that lasts for a time.
struct BusFault {
  static constexpr int kEveryNode = -1;

  BusFaultKind kind = BusFaultKind::kLoss;
  std::int64_t start_ns = 0;
  std::int64_t end_ns = std::numeric_limits<std::int64_t>::max();
  int node = kEveryNode;           ///< Index of the port in the order of SimulatedBus::Attach.
  std::vector<std::uint32_t> ids;  ///< Only frames with these identifiers suffer; empty: all do.
  double probability = 1;          ///< For each frame; with kBitErrors, for each bit.
  std::int64_t delay_ns = 0;       ///< kDelay: how long; kReorder: how long a frame waits at most.
};

/// A script of faults. Random numbers decide about faults with a probability. They follow from the
/// seed and are the same on every machine.
struct BusFaultPlan {
  std::uint64_t seed = 1;
  std::vector<BusFault> faults;
};

}  // namespace tumbler
