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
  SimulatedNode(const SimulatedNode&) = delete;  // The bus knows it by address.
  SimulatedNode& operator=(const SimulatedNode&) = delete;
  virtual ~SimulatedNode() = default;

  /// Called at the end of each frame that another node sent, before the bus is free again: an
  /// answer that is sent here takes part in the very next arbitration.
  virtual void OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept = 0;
};

/// Properties of one controller on the simulated bus.
struct SimulatedPortConfig {
  int transmit_capacity = 10;  ///< Frames; Linux gives a CAN interface a transmit queue of 10.
  int receive_capacity = 256;  ///< Frames; a full queue drops the newest, as a socket does.
  /// Off: a frame that loses arbitration or meets an error is gone (one-shot mode, common in drive
  /// firmware).
  bool auto_retransmit = true;
  /// On: hears everything, acknowledges nothing, and cannot send (kInvalidArgument): a logger that
  /// leaves no trace.
  bool listen_only = false;
  /// From bus-off to the attempt to take part again, as Linux's restart-ms; below 0: only when
  /// SimulatedPort::Restart is called, which is Linux's default.
  std::int64_t restart_ns = -1;
};

/// Counts of one port since it was attached.
struct SimulatedPortStatistics {
  std::int64_t sent = 0;              ///< frames that another node acknowledged
  std::int64_t received = 0;          ///< frames taken into the receive queue, or given to the node
  std::int64_t dropped_received = 0;  ///< frames lost because the receive queue was full
  std::int64_t dropped_transmit =
      0;                    ///< frames lost in one-shot mode, by bus-off, or with the link
  std::int64_t errors = 0;  ///< error frames while sending
  std::int64_t bus_offs = 0;
  std::int64_t rejected_transmit = 0;  ///< Send calls answered with kWouldBlock
  int max_transmit_depth = 0;
  int max_receive_depth = 0;
};

/// One controller on a simulated bus, with finite queues. Made by SimulatedBus::Attach; not for
/// other use. Send and Receive do not allocate. Single thread: that of the bus.
class SimulatedPort final : public CanBus {
 public:
  Status Send(const CanFrame& frame) noexcept override;
  Status Receive(ReceivedFrame& received) noexcept override;

  /// Send by a device that needs `delay_ns` >= 0 to make up its answer. Frames leave in the order
  /// of the calls.
  Status SendAfter(std::int64_t delay_ns, const CanFrame& frame) noexcept;

  /// By the error counters of ISO 11898-1. Bus-off is an error of Send, and of Receive once it has
  /// given out what had come before.
  [[nodiscard]] CanControllerState controller_state() const noexcept override;
  [[nodiscard]] int transmit_errors() const noexcept { return transmit_errors_; }
  [[nodiscard]] int receive_errors() const noexcept { return receive_errors_; }

  /// Ends bus-off: the controller takes part again after 128 times 11 recessive bits.
  void Restart() noexcept;

  /// Down: Send and Receive return kLinkDown, both queues are emptied, and the node neither hears
  /// nor acknowledges. A frame already on the wire is finished. Up: the port starts again with
  /// empty queues and error counters at zero.
  void SetLinkDown(bool down) noexcept { SetLink(down ? Status::kLinkDown : Status::kOk); }
  /// The same as kLinkGone, for good.
  void SetLinkGone() noexcept { SetLink(Status::kLinkGone); }

  [[nodiscard]] const SimulatedPortStatistics& statistics() const noexcept { return statistics_; }
  [[nodiscard]] int transmit_depth() const noexcept { return transmit_.count; }
  [[nodiscard]] int receive_depth() const noexcept { return receive_.count; }

 private:
  friend class SimulatedBus;

  struct Entry {
    CanFrame frame;
    std::int64_t time_ns = 0;  // transmit: ready from; receive: end of the frame
  };
  struct Queue {
    std::vector<Entry> entries;  // sized once, in the constructor
    int first = 0;
    int count = 0;
    [[nodiscard]] bool full() const noexcept { return count == static_cast<int>(entries.size()); }
    [[nodiscard]] Entry& front() noexcept { return entries[static_cast<std::size_t>(first)]; }
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
  [[nodiscard]] std::int64_t ReadyAt() noexcept;

  /// A received frame on its way through an adapter.
  struct Held {
    Entry entry;
    std::int64_t due_ns = 0;
    bool until_next = false;  // due with the frame that follows
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
  bool recovering_ = false;              // while bus-off: recessive bits are counted
  std::int64_t restart_at_ns_ = 0;       // while bus-off: when that begins
  int recessive_left_ = 0;               // while bus-off: sequences of 11 recessive bits to go
  std::int64_t suspended_until_ns_ = 0;  // an error-passive node lets others go first
  std::vector<Held> held_;               // capacity kHeldMax; sorted by time
  bool sending_ = false;                 // takes part in the frame in flight as a sender
  bool head_on_wire_ = false;            // the oldest frame to send is the one in flight
  SimulatedPortStatistics statistics_;
};

/// Counts of the bus since it was made. A frame's bits count from its start.
struct SimulatedBusStatistics {
  std::int64_t frames = 0;          ///< acknowledged frames
  std::int64_t bits = 0;            ///< bit times not idle: frames, error frames, intermissions
  std::int64_t busy_ns = 0;         ///< the same in time
  std::int64_t collisions = 0;      ///< error frames: two nodes, one identifier, different frames
  std::int64_t unacknowledged = 0;  ///< error frames: nobody else was there
  std::int64_t disturbed = 0;       ///< error frames: bit errors and shorts of the script
};

/// A classic CAN bus in virtual time: exact frame lengths with stuffing, arbitration,
/// acknowledgement, finite queues.
///
/// Time only passes in AdvanceTo; nothing depends on the machine, so the same calls give the same
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
///   that share the arbitration field but differ later collide: error frame, and both are sent
///   again or lost according to `auto_retransmit`, until they are bus-off.
/// - A frame that no other node acknowledges ends in an error frame and is sent again (or lost): a
///   lone node keeps its bus busy, and its transmit queue fills up.
/// - Error counters (ISO 11898-1): an error in sending adds 8, one that a receiver sees adds 1, a
///   frame sent or received takes 1 away. Above 127 a node is error-passive: it waits 8 bit times
///   more before it sends again, and a missing acknowledgement counts no further (so that a lone
///   node never goes bus-off). Above 255 errors in sending it is bus-off: its queue is lost, and it
///   neither hears nor acknowledges until it was restarted and has seen 128 sequences of 11
///   recessive bits (one between frames, or as many as fit into an idle time).
/// - A frame whose very last bit is disturbed has been taken by its receivers, while its sender
///   repeats it: the one way in which CAN itself duplicates frames.
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
  SimulatedBus(const SimulatedBus&) = delete;  // Ports know it by address.
  SimulatedBus& operator=(const SimulatedBus&) = delete;

  /// Adds a controller that is polled through CanBus, e.g. the host's. The port lives as long as
  /// the bus.
  /// @throws std::length_error beyond kMaxNodes, std::invalid_argument on a queue capacity below 1.
  Port& Attach(const PortConfig& config = {});
  /// Adds a device that acts by itself; it must outlive the bus's last AdvanceTo. Its receive queue
  /// stays unused.
  Port& Attach(SimulatedNode& node, const PortConfig& config = {});

  /// Disturbs the bus from now on by this script; the times of faults are those of the bus.
  /// Replaces an earlier one.
  /// @throws std::invalid_argument  on a node that is not attached, or a probability outside 0
  /// ... 1.
  void SetFaults(const BusFaultPlan& plan);

  /// Runs the bus up to and including this time; a time in the past changes nothing.
  void AdvanceTo(std::int64_t time_ns) noexcept;

  [[nodiscard]] std::int64_t now_ns() const noexcept { return now_ns_; }
  [[nodiscard]] std::int64_t bit_time_ns() const noexcept { return bit_time_ns_; }
  [[nodiscard]] const SimulatedBusStatistics& statistics() const noexcept { return statistics_; }
  /// Share of all time so far in which the bus was not idle, 0 ... 1.
  [[nodiscard]] double load() const noexcept;

 private:
  enum class Phase : std::uint8_t {
    kIdle,
    kFrame,     ///< up to the last bit of a frame
    kRecovery,  ///< intermission, or an error frame with its intermission
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
  std::int64_t idle_since_ns_ = 0;  // while idle: recessive bits before were counted
  BusFaultPlan plan_;
  std::uint64_t random_ = 0;
  std::int64_t next_window_ns_ = std::numeric_limits<std::int64_t>::max();
  bool shorted_ = false;
  std::vector<std::unique_ptr<SimulatedPort>> ports_;
  SimulatedBusStatistics statistics_;
};

}  // namespace tumbler
