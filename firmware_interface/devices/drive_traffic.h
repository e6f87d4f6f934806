#pragma once

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <vector>

#include "firmware_interface/can/frame.h"

namespace tumbler {

/// Frames of one kind that a drive and its host exchange while the robot runs.
struct DriveFrames {
  std::string_view what;    ///< e.g. `setpoints`
  int size = 0;             ///< Bytes of payload.
  double period_ticks = 1;  ///< Ticks of the control loop from one frame to the next, >= 1.
  bool common = false;      ///< Whether one frame serves all drives of the protocol.
  bool extended = false;    ///< Whether its identifier has 29 bits.
};

/// The identifiers on the bus that follow from one key of a drives file.
struct DriveIdentifiers {
  std::string_view key;     ///< The key in the file.
  std::uint32_t value = 0;  ///< The key's value.
  bool to_drive = false;    ///< Whether the host sends such frames and the drive obeys them.
  bool common = false;      ///< Whether all drives of the protocol share them.
  std::vector<CanId> ids;
};

/// The frames of one drive on the bus.
struct DriveTraffic {
  std::vector<DriveFrames> schedule;
  std::vector<DriveIdentifiers> identifiers;  ///< No other drive may have one of them.
  /// Identifiers of all frames that only a host sends to the drive: this one, or somebody else.
  std::vector<CanId> host_sends;
  std::vector<CanId> host_receives;  ///< Identifiers of the drive's frames that the host takes.
  int host_frames_max = 1;  ///< The most frames of the host in one tick, starting up included.
};

/// A period in ticks, at least one.
inline double PeriodTicks(double period_s, double rate_hz) {
  return std::max(1.0, period_s * rate_hz);
}

}  // namespace tumbler
