#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "firmware_interface/can/bus.h"
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
};

/// Counts of one port since it was attached.
struct SimulatedPortStatistics {
  std::int64_t sent = 0;              ///< frames that another node acknowledged
  std::int64_t received = 0;          ///< frames taken into the receive queue, or given to the node
  std::int64_t dropped_received = 0;  ///< frames lost because the receive queue was full
  std::int64_t dropped_transmit = 0;  ///< frames lost in one-shot mode, or by the link going down
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

  /// Down: Send and Receive return kLinkDown, both queues are emptied, and the node neither hears
  /// nor acknowledges. A frame already on the wire is finished. Up: the port starts again with
  /// empty queues.
  void SetLinkDown(bool down) noexcept;

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
  void Fail() noexcept;  // The attempt to send the oldest frame failed.
  void Deliver(const ReceivedFrame& received) noexcept;

  const SimulatedBus& bus_;
  SimulatedPortConfig config_;
  SimulatedNode* node_;  // null: frames go to the receive queue
  Queue transmit_;
  Queue receive_;
  bool link_down_ = false;
  bool sending_ = false;       // takes part in the frame in flight as a sender
  bool head_on_wire_ = false;  // the oldest frame to send is the one in flight
  SimulatedPortStatistics statistics_;
};

/// Counts of the bus since it was made. A frame's bits count from its start.
struct SimulatedBusStatistics {
  std::int64_t frames = 0;          ///< acknowledged frames
  std::int64_t bits = 0;            ///< bit times not idle: frames, error frames, intermissions
  std::int64_t busy_ns = 0;         ///< the same in time
  std::int64_t collisions = 0;      ///< error frames: two nodes, one identifier, different frames
  std::int64_t unacknowledged = 0;  ///< error frames: nobody else was there
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
///   again or lost according to `auto_retransmit`. Two such ports that retransmit collide for ever;
///   error counters, which end this in a real controller, are not part of this model.
/// - A frame that no other node acknowledges ends in an error frame and is sent again (or lost): a
///   lone node keeps its bus busy, and its transmit queue fills up.
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
  void FailSenders() noexcept;
  void Occupy(Phase phase, int bits, int bits_until_free) noexcept;

  std::int64_t bit_time_ns_ = 0;
  std::int64_t now_ns_ = 0;
  Phase phase_ = Phase::kIdle;
  std::int64_t phase_end_ns_ = 0;
  std::int64_t busy_until_ns_ = 0;
  CanFrame wire_{};  // the frame in flight
  std::vector<std::unique_ptr<SimulatedPort>> ports_;
  SimulatedBusStatistics statistics_;
};

}  // namespace tumbler
