#pragma once

#include <cstdint>
#include <string>

namespace tumbler {

/// What the kernel knows of a CAN interface (rtnetlink), for checks before a loop starts.
struct CanLink {
  int index = 0;
  bool is_can = false;  ///< Nothing below is known of interfaces of another kind.
  bool up = false;
  /// The driver hands a sent frame back when it has left, so that a confirmation proves it. Without
  /// (slcan), the kernel hands it back when it is queued.
  bool confirms_on_the_wire = false;
  bool has_queue = false;             ///< Frames can wait: a controller's always, vcan's never.
  std::int64_t queue_frames_max = 0;  ///< txqueuelen
  std::int64_t waiting_frames = 0;    ///< In the queue now, whoever left them there.
  std::int64_t bit_rate = 0;          ///< bit/s; 0 is unknown, as it is of vcan.
  bool listen_only = false;           ///< The controller is set up to send nothing.
};

/// @returns 0, or the errno of what failed; `link` is written only on 0. May allocate and block.
[[nodiscard]] int ReadCanLink(const std::string& interface, CanLink& link);

/// Takes an interface down and up again, which discards every frame that waits in its queue or its
/// controller. Needs CAP_NET_ADMIN. May block for as long as the driver takes.
/// @returns 0, or the errno of what failed.
[[nodiscard]] int RestartCanLink(const std::string& interface) noexcept;

/// Whether RestartCanLink is permitted. Changes nothing.
[[nodiscard]] bool MayRestartCanLink(const std::string& interface) noexcept;

}  // namespace tumbler
