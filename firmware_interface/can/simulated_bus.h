#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "firmware_interface/can/bus.h"
#include "firmware_interface/can/bus_faults.h"
#include "firmware_interface/can/frame_length.h"

namespace tumbler {

class SimulatedBus;
class SimulatedPort;

/// A device of the simulated bus that acts by itself, e.g. a drive.
class SimulatedNode {
 public:
  SimulatedNode() = default;
  SimulatedNode(const SimulatedNode&) = delete;  // The bus holds its address.
  SimulatedNode& operator=(const SimulatedNode&) = delete;
  virtual ~SimulatedNode() = default;

  /// Called at the end of each frame that another node sent, before the bus is free again. An
  /// answer that is sent here takes part in the very next arbitration.
  virtual void OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept = 0;
  /// Whether OnFrame may do anything with such a frame.
  [[nodiscard]] virtual bool Heeds(const CanFrame& /*frame*/) const noexcept { return true; }
};

/// Properties of one controller on the simulated bus.
struct SimulatedPortConfig {
  int transmit_capacity = 10;  ///< Frames; Linux gives a CAN interface a transmit queue of 10.
  int receive_capacity = 256;  ///< Frames; a full queue drops the newest, as a socket does.
  /// Whether a frame that loses arbitration or meets an error is sent again. If not (one-shot mode,
  /// common in drive firmware), the frame is lost.
  bool auto_retransmit = true;
  /// In one-shot mode: whether a frame that loses arbitration waits for the bus all the same, and
  /// only one that meets an error is lost.
  bool waits_for_bus = false;
  /// Whether the controller only listens, as a logger does that leaves no trace: it hears
  /// everything, acknowledges nothing, and Send answers kInvalidArgument.
  bool listen_only = false;
  /// Time from bus-off to the attempt to take part again, like Linux's restart-ms. Below 0 (Linux's
  /// default) only SimulatedPort::Restart makes the attempt.
  std::int64_t restart_ns = -1;
};

/// Counts of one port since it was attached.
struct SimulatedPortStatistics {
  std::int64_t sent = 0;              ///< Frames that another node acknowledged.
  std::int64_t received = 0;          ///< Frames put into the receive queue or given to the node.
  std::int64_t dropped_received = 0;  ///< Frames lost because the receive queue was full.
  /// Frames lost in one-shot mode, by bus-off, or with the link.
  std::int64_t dropped_transmit = 0;
  std::int64_t errors = 0;             ///< Error frames while sending.
  std::int64_t bus_offs = 0;           ///< Times that the controller went bus-off.
  std::int64_t rejected_transmit = 0;  ///< Calls of Send that were answered with kWouldBlock.
  int max_transmit_depth = 0;          ///< The most frames that the transmit queue held.
  int max_receive_depth = 0;           ///< The most frames that the receive queue held.
};

/// One controller on a simulated bus, with finite queues. SimulatedBus::Attach makes it. Send and
/// Receive do not allocate. Only the thread of the bus may use it.
class SimulatedPort final : public CanBus {
 public:
  Status Send(const CanFrame& frame) noexcept override;
  Status Receive(ReceivedFrame& received) noexcept override;

  /// Sends after `delay_ns` >= 0, as a device does that needs time to make up its answer. Frames
  /// leave in the order of the calls.
  Status SendAfter(std::int64_t delay_ns, const CanFrame& frame) noexcept;

  /// The state by the error counters of ISO 11898-1. In bus-off Send fails, and so does Receive
  /// once it has given out the frames that had come before.
  [[nodiscard]] CanControllerState controller_state() const noexcept override;
  [[nodiscard]] int transmit_errors() const noexcept { return transmit_errors_; }
  [[nodiscard]] int receive_errors() const noexcept { return receive_errors_; }

  /// Ends bus-off: the controller takes part again after 128 times 11 recessive bits.
  void Restart() noexcept;

  /// Takes the link down or up. While it is down, Send and Receive return kLinkDown, both queues
  /// are empty, and the node neither hears nor acknowledges; a frame already on the wire is
  /// finished. When it comes up, the port starts again with empty queues and error counters at
  /// zero.
  void SetLinkDown(bool down) noexcept { SetLink(down ? Status::kLinkDown : Status::kOk); }
  /// Takes the link away for good: Send and Receive return kLinkGone.
  void SetLinkGone() noexcept { SetLink(Status::kLinkGone); }

  [[nodiscard]] const SimulatedPortStatistics& statistics() const noexcept { return statistics_; }
  [[nodiscard]] int transmit_depth() const noexcept { return transmit_.count; }
  [[nodiscard]] int receive_depth() const noexcept { return receive_.count; }

 private:
  friend class SimulatedBus;

  struct Entry {
    CanFrame frame;
    std::int64_t time_ns = 0;  // to transmit: ready from then on; received: end of the frame
    int bits = 0;              // to transmit: length on the wire
  };
  struct Queue {
    std::vector<Entry> entries;  // sized once, in the constructor
    int first = 0;
    int count = 0;
    [[nodiscard]] bool full() const noexcept { return count == static_cast<int>(entries.size()); }
    [[nodiscard]] Entry& front() noexcept { return entries[static_cast<std::size_t>(first)]; }
    [[nodiscard]] const Entry& front() const noexcept {
      return entries[static_cast<std::size_t>(first)];
    }
    void Push(const Entry& entry) noexcept;
    void Pop() noexcept;
  };

  SimulatedPort(const SimulatedBus& bus, const SimulatedPortConfig& config, SimulatedNode* node);
  void SetLink(Status status) noexcept;
  void DropTransmitQueue() noexcept;
  void LoseArbitration() noexcept;
  void FailToSend(bool unacknowledged) noexcept;  // Counts errors, up to bus-off.
  void Sent() noexcept;
  void HearError() noexcept;
  void HearFrame() noexcept;
  void Deliver(const ReceivedFrame& received) noexcept;
  [[nodiscard]] bool TakesPart() const noexcept {
    return link_ == Status::kOk && !bus_off_ && !disconnected_;
  }
  [[nodiscard]] bool Wants() const noexcept {
    return transmit_.count > 0 && link_ == Status::kOk && !bus_off_ && !stalled_;
  }
  /// When the oldest frame may be sent. @pre Wants().
  [[nodiscard]] std::int64_t ReadyAt() const noexcept;

  /// A received frame on its way through an adapter.
  struct Held {
    Entry entry;
    std::int64_t due_ns = 0;
    bool until_next = false;  // due as soon as another frame was received
  };
  static constexpr std::size_t kHeldMax = 256;

  const SimulatedBus& bus_;
  SimulatedPortConfig config_;
  SimulatedNode* node_;  // null: frames go to the receive queue
  Queue transmit_;
  Queue receive_;
  Status link_ = Status::kOk;
  bool disconnected_ = false;
  bool stalled_ = false;
  int transmit_errors_ = 0;
  int receive_errors_ = 0;
  bool bus_off_ = false;
  bool recovering_ = false;              // while bus-off: whether recessive bits are counted
  std::int64_t restart_at_ns_ = 0;       // while bus-off: when the count begins
  int recessive_left_ = 0;               // while bus-off: sequences of 11 recessive bits to go
  std::int64_t suspended_until_ns_ = 0;  // an error-passive node lets others go first
  std::vector<Held> held_;               // capacity kHeldMax; sorted by time
  bool sending_ = false;                 // takes part in the frame in flight as a sender
  bool head_on_wire_ = false;            // the oldest frame to send is the one in flight
  SimulatedPortStatistics statistics_;
};

/// Counts of the bus since it was made. All bits of a frame are counted when it starts.
struct SimulatedBusStatistics {
  std::int64_t frames = 0;      ///< Acknowledged frames.
  std::int64_t bits = 0;        ///< Bit times not idle: frames, error frames, intermissions.
  std::int64_t busy_ns = 0;     ///< The same as time.
  std::int64_t collisions = 0;  ///< Error frames after different frames with one identifier met.
  std::int64_t unacknowledged = 0;  ///< Error frames because no other node was there.
  std::int64_t disturbed = 0;       ///< Error frames because of scripted bit errors and shorts.
};

/// A classic CAN bus in virtual time: exact frame lengths with stuffing, arbitration,
/// acknowledgement, finite queues.
///
/// Time passes in AdvanceTo only, and nothing depends on the machine: the same calls give the same
/// frames at the same nanosecond. Between calls of AdvanceTo the user may Send and Receive on any
/// port.
///
/// Rules:
/// - When the bus is idle and some port's oldest frame is ready, the frame with the smallest
///   ArbitrationKey is sent; the others wait (or are lost, in one-shot mode). Later frames of a
///   port wait behind its oldest one.
/// - Receivers get the frame at its last bit, 3 bit times before the bus is free again; the sender
///   does not get it.
/// - Two ports that send identical frames at once both succeed, with one frame on the wire. Frames
///   that share the arbitration field but differ later collide in an error frame. Both are sent
///   again (or lost, without `auto_retransmit`), until their senders are bus-off.
/// - A frame that no other node acknowledges ends in an error frame and is sent again (or lost): a
///   lone node keeps its bus busy, and its transmit queue fills up.
/// - Error counters (ISO 11898-1): an error in sending adds 8, one that a receiver sees adds 1, a
///   frame sent or received takes 1 away. Above 127 a node is error-passive: it waits 8 bit times
///   more before it sends again, and a missing acknowledgement counts no further (so that a lone
///   node never goes bus-off). Above 255 errors in sending it is bus-off: its queue is lost, and it
///   neither hears nor acknowledges until it was restarted and has seen 128 sequences of 11
///   recessive bits (one between frames, or as many as fit into an idle time).
/// - When the very last bit of a frame is disturbed, the receivers have already taken the frame,
///   but the sender repeats it. In no other way does CAN itself duplicate frames.
/// - An error frame is counted as flag (6 bits when only the sender sees the error, 12 when flags
///   superpose) and delimiter (8 bits), followed by intermission.
///
/// All memory is allocated by the constructor and Attach. Single thread.
class SimulatedBus {
 public:
  using Port = SimulatedPort;
  using PortConfig = SimulatedPortConfig;
  static constexpr int kMaxNodes = 16;

  /// @param bit_rate  10 000 ... 1 000 000 bit/s; a bit time is rounded to whole nanoseconds.
  /// @throws std::invalid_argument otherwise.
  explicit SimulatedBus(int bit_rate = 1'000'000);
  ~SimulatedBus();
  SimulatedBus(const SimulatedBus&) = delete;  // Ports hold its address.
  SimulatedBus& operator=(const SimulatedBus&) = delete;

  /// Adds a controller that is polled through CanBus, e.g. the host's. The port lives as long as
  /// the bus.
  /// @throws std::length_error beyond kMaxNodes, std::invalid_argument on a queue capacity below 1.
  Port& Attach(const PortConfig& config = {});
  /// Adds a device that acts by itself; it must outlive the bus's last AdvanceTo. Its receive queue
  /// stays unused.
  Port& Attach(SimulatedNode& node, const PortConfig& config = {});

  /// Disturbs the bus by this script from now on. Times in the script are times of the bus. The
  /// script replaces an earlier one.
  /// @throws std::invalid_argument  on a node that is not attached, or a probability outside [0,
  /// 1].
  void SetFaults(const BusFaultPlan& plan);

  /// Runs the bus up to and including this time; a time in the past changes nothing.
  void AdvanceTo(std::int64_t time_ns) noexcept;

  [[nodiscard]] std::int64_t now_ns() const noexcept { return now_ns_; }
  /// A time before which no node gets a frame that it heeds unless something is sent until then:
  /// the end of the frame that is on the wire or could be next. The largest number where there is
  /// none.
  [[nodiscard]] std::int64_t NextDelivery() const noexcept;
  /// The same of frames that nobody may heed, such as those that only wait in a port to be
  /// received.
  [[nodiscard]] std::int64_t NextFrameEnd() const noexcept;
  [[nodiscard]] std::int64_t bit_time_ns() const noexcept { return bit_time_ns_; }
  [[nodiscard]] const SimulatedBusStatistics& statistics() const noexcept { return statistics_; }
  /// Share of all time so far in which the bus was not idle, 0 ... 1.
  [[nodiscard]] double load() const noexcept;

 private:
  enum class Phase : std::uint8_t {
    kIdle,
    kFrame,     ///< Up to the last bit of a frame.
    kRecovery,  ///< Intermission, or an error frame with its intermission.
  };

  Port& Add(const PortConfig& config, SimulatedNode* node);
  void Start() noexcept;
  void Finish() noexcept;
  void Break(int bits, bool unacknowledged) noexcept;
  void ReceiveFrom(const ReceivedFrame& received) noexcept;
  void Pass(SimulatedPort& port, ReceivedFrame received) noexcept;
  void Hold(SimulatedPort& port, const ReceivedFrame& received, std::int64_t due_ns,
            bool until_next) noexcept;
  void ReleaseHeld() noexcept;
  void ApplyWindows() noexcept;
  void CountIdle() noexcept;
  void CountRecessive(int sequences) noexcept;
  void TryAlone() noexcept;
  void BeginRecovery() noexcept;
  [[nodiscard]] std::int64_t NextEvent() noexcept;
  [[nodiscard]] bool SomebodyHeeds(const CanFrame& frame) const noexcept;
  /// The earliest end of a frame that counts.
  template <class Counts>
  [[nodiscard]] std::int64_t NextEnd(Counts counts) const noexcept;
  [[nodiscard]] int DisturbedBit(int bits) noexcept;
  [[nodiscard]] double Random() noexcept;  // 0 <= x < 1
  void Occupy(Phase phase, int bits, int bits_until_free) noexcept;

  std::int64_t bit_time_ns_ = 0;
  std::int64_t now_ns_ = 0;
  Phase phase_ = Phase::kIdle;
  std::int64_t phase_end_ns_ = 0;
  std::int64_t busy_until_ns_ = 0;
  CanFrame wire_{};  // the frame in flight
  bool last_bit_disturbed_ = false;
  std::int64_t idle_since_ns_ = 0;  // while idle: recessive bits before this time were counted
  BusFaultPlan plan_;
  std::uint64_t random_ = 0;
  std::int64_t next_window_ns_ = std::numeric_limits<std::int64_t>::max();
  bool shorted_ = false;
  std::vector<std::unique_ptr<SimulatedPort>> ports_;
  SimulatedBusStatistics statistics_;
};

}  // namespace tumbler
