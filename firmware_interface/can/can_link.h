#pragma once

#include <cstdint>
#include <string>

namespace tumbler {

/// The state of a CAN interface by the kernel (rtnetlink), for checks before a loop starts.
struct CanLink {
  int index = 0;
  bool is_can = false;  ///< Whether it is a CAN interface; all below is for CAN interfaces only.
  bool up = false;
  /// Whether the driver hands a sent frame back when it has left, so that a confirmation proves it.
  /// With other drivers (slcan) the kernel hands a frame back when it is queued.
  bool confirms_on_the_wire = false;
  /// Whether frames can wait to be sent: they can with every controller, and never on vcan.
  bool has_queue = false;
  std::int64_t queue_frames_max = 0;  ///< Length of the queue: txqueuelen.
  std::int64_t waiting_frames = 0;    ///< Frames in the queue now, whoever left them there.
  std::int64_t bit_rate = 0;          ///< bit/s; 0 where it is unknown, as on vcan.
  bool listen_only = false;           ///< Whether the controller is set up to send nothing.
  /// Whether the controller reports bus errors one by one (berr-reporting).
  bool reports_bus_errors = false;
  /// After how long the kernel restarts a controller that is bus-off [ms]; 0: not by itself.
  std::int64_t restart_ms = 0;
};

/// Asks the kernel about an interface. May allocate and block.
/// @returns 0, or the errno of what failed; `link` is written only on 0.
[[nodiscard]] int ReadCanLink(const std::string& interface, CanLink& link);

/// Takes an interface down and up again, which discards every frame that waits in its queue or its
/// controller. Needs CAP_NET_ADMIN. May block for as long as the driver takes.
/// @returns 0, or the errno of what failed.
[[nodiscard]] int RestartCanLink(const std::string& interface) noexcept;

/// Whether RestartCanLink is permitted. Changes nothing.
[[nodiscard]] bool MayRestartCanLink(const std::string& interface) noexcept;

}  // namespace tumbler
