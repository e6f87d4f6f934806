#pragma once

#include <cstdint>
#include <limits>
#include <vector>

namespace tumbler {

/// What can be wrong with a simulated bus. "Receiver" and "sender" are the nodes that
/// `BusFault::node` names.
enum class BusFaultKind : std::uint8_t {
  kLoss,        ///< The receiver misses the frame, which was acknowledged: an overrun.
  kDuplicate,   ///< The receiver gets the frame once more.
  kDelay,       ///< The receiver gets the frame later, e.g. out of a USB adapter; order is kept.
  kReorder,     ///< The receiver gets the frame after the one that follows it.
  kFlip,        ///< One bit of the payload is inverted in the receiver's memory: no CRC sees it.
  kBitErrors,   ///< Bits are disturbed on the wire: error frames, retransmission, error counters.
  kShort,       ///< The wires are shorted: nothing gets through, and who tries goes bus-off.
  kDisconnect,  ///< The node is off the wire: it hears nobody, and nobody acknowledges.
  kStall,       ///< The sender's frames do not leave its queue, which fills up (ENOBUFS).
  kLinkDown,    ///< The node's interface is down: what waits in its queues is gone.
  kLinkGone,    ///< The node's interface does not exist any more.
};

/// One of them, for a time.
struct BusFault {
  static constexpr int kEveryNode = -1;

  BusFaultKind kind = BusFaultKind::kLoss;
  std::int64_t start_ns = 0;
  std::int64_t end_ns = std::numeric_limits<std::int64_t>::max();
  int node = kEveryNode;           ///< The port, by the order of SimulatedBus::Attach.
  std::vector<std::uint32_t> ids;  ///< Frames with these identifiers only; empty: all.
  double probability = 1;          ///< Of each frame; of kBitErrors: of each bit.
  std::int64_t delay_ns = 0;       ///< kDelay; kReorder: after which it waits no longer.
};

/// A script of them. The seed decides what probabilities leave open, the same on every machine.
struct BusFaultPlan {
  std::uint64_t seed = 1;
  std::vector<BusFault> faults;
};

}  // namespace tumbler
