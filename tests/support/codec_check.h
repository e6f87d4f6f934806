#pragma once

#include <initializer_list>

#include "common/core/status.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/can/frame_length.h"

namespace tumbler::testing {

/// Checks how a codec takes a frame of any content: a value that was decoded has to be the same
/// after encoding and decoding it again.
/// @returns the problem; null when there is none, or the frame does not decode.
template <typename Value, typename Decode, typename Encode>
const char* RoundTripProblem(const CanFrame& frame, Decode decode, Encode encode) {
  Value first{};
  if (decode(frame, first) != Status::kOk) return nullptr;
  const CanFrame again = encode(first);
  if (!IsValid(again)) return "an encoded frame is not valid";
  Value second{};
  if (decode(again, second) != Status::kOk) return "an encoded frame does not decode";
  return encode(second) == again ? nullptr : "encoding what was decoded changes it";
}

/// Returns the first problem that is not null.
inline const char* FirstProblem(std::initializer_list<const char*> problems) {
  for (const char* problem : problems) {
    if (problem != nullptr) return problem;
  }
  return nullptr;
}

}  // namespace tumbler::testing
