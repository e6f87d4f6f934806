#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "firmware_interface/can/frame.h"

namespace tumbler {

/// One line of a `candump -l` log without its line feed:
/// `(0000000012.345678) can0 001#7FFF7FF0CCD337FF`.
/// @param time_ns  not negative.
std::string CandumpLine(std::int64_t time_ns, std::string_view interface, const CanFrame& frame);

/// A frame of a log.
struct CandumpFrame {
  ReceivedFrame received;  ///< Its time is that of the log.
  std::string interface;
};

/// Reads a log of `candump -l` or `-L`, of one or several interfaces. CAN FD frames and error
/// frames are skipped, since the runtime uses neither.
/// @param skipped  gets how many frames were skipped.
/// @throws std::runtime_error  with name, line and what is wrong with it.
std::vector<CandumpFrame> ParseCandump(std::string_view text, const std::string& name,
                                       std::int64_t& skipped);

/// The frames of one interface of a log. The drives of a file are on one bus: what an identifier
/// means on another one is not known.
/// @param interface  its name; empty: the only one.
/// @throws std::runtime_error  naming the interfaces, when there are several and none was named, or
/// the one that was named has no frame.
std::vector<CandumpFrame> FramesOfInterface(std::vector<CandumpFrame> frames,
                                            const std::string& name, const std::string& interface);

}  // namespace tumbler
