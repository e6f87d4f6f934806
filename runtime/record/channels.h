#pragma once

namespace tumbler {

/// Channels of the messages in `runtime/record/lcm`.
inline constexpr const char* kStateChannel = "TUMBLER_STATE";
inline constexpr const char* kEventChannel = "TUMBLER_EVENT";
inline constexpr const char* kRunChannel = "TUMBLER_RUN";
inline constexpr const char* kCommandChannel = "TUMBLER_COMMAND";
inline constexpr const char* kTruthChannel = "TUMBLER_TRUTH";

}  // namespace tumbler
