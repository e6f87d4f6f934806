#pragma once

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <vector>

namespace tumbler {

/// Frames of one kind that a drive and its host exchange while the robot runs.
struct DriveFrames {
  std::string_view what;    ///< e.g. `setpoints`
  int size = 0;             ///< bytes
  double period_ticks = 1;  ///< of the control loop, >= 1
  bool common = false;      ///< once for all drives of the protocol
};

/// The identifiers on the bus that one key of a drives file decides on.
struct DriveIdentifiers {
  std::string_view key;     ///< of the file
  std::uint32_t value = 0;  ///< of that key
  bool to_drive = false;    ///< sent by the host and obeyed by the drive
  bool common = false;      ///< to all drives of the protocol
  std::vector<std::uint32_t> ids;
};

/// What one drive has on the bus.
struct DriveTraffic {
  std::vector<DriveFrames> schedule;
  std::vector<DriveIdentifiers> identifiers;  ///< No other drive may have one of them.
  std::vector<std::uint32_t> host_sends;      ///< Identifiers of all frames that the host sends,
  std::vector<std::uint32_t> host_receives;   ///< and of those that it wants.
  int host_frames_max = 1;                    ///< In one tick, starting up included.
};

/// The ticks to a period, at least one.
inline double PeriodTicks(double period_s, double rate_hz) {
  return std::max(1.0, period_s * rate_hz);
}

}  // namespace tumbler
