#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace tumbler::testing {

/// What happens to a flight at a tick. The operator who wants it to go on is no event: he is part
/// of every flight (`FlightSetting`).
enum class FlightEventKind : std::uint8_t {
  kCommand,        ///< Command `a` of OperatorCommand, in place of the operator's; branch `b`.
  kRequest,        ///< Request `a` of FlightRequest to the run procedure, where there is one.
  kPause,          ///< `ticks` periods pass without a tick, while everything else goes on.
  kJump,           ///< The tick's number jumps ahead by `a` periods; no time passes.
  kStutter,        ///< The tick's number is that of the tick before, less `a`.
  kBusFault,       ///< BusFaultKind `a` at node `b` for `ticks`, with probability `x`.
  kLoseReplies,    ///< The measured positions of joint `a` do not reach the host for `ticks`.
  kLoseHeartbeat,  ///< The heartbeats of joint `a` do not reach the host for `ticks`.
  kLink,           ///< The host's link answers Status `a` to everything for `ticks`.
  kSend,           ///< Sending fails with Status `a` for `ticks`.
  kController,     ///< The controller is in CanControllerState `a` for `ticks`.
  kSilence,        ///< Drive `a` sends nothing for `ticks`.
  kDriveError,     ///< Drive `a` raises an error.
  kHeat,           ///< Drive `a` has `x` degrees Celsius from now on.
  kDisplace,       ///< Joint `a` is moved by `x` rad over `ticks`.
  kPush,           ///< Joint `a` is pushed with `x` N m for `ticks`.
  kStranger,    ///< Somebody else sends a command to drive `a`; `b` 1: one that makes it drop out.
  kNotANumber,  ///< A measured position of drive `a` that is no number, where the wire can have it.
  kSensor,      ///< The sensor fails in way `a` of FlightSensorFault for `ticks`.
  kFall,        ///< The robot falls or is put down at `x` rad of pitch.
  kRepair,      ///< Everything is set right: drives, link, temperatures, and joints at the start.
};
inline constexpr int kFlightEventKinds = 21;

/// The ways in which a flight's sensor fails.
enum class FlightSensorFault : std::uint8_t {
  kSilent,
  kFrozen,
  kNoRotation,
  kTilted,
  kTooFast,
  kInconsistent,
  kLate,
};
inline constexpr int kFlightSensorFaults = 7;

/// Requests of the operator to the run procedure.
enum class FlightRequest : std::uint8_t { kStart, kFinish, kStop, kDisarm, kQuit };
inline constexpr int kFlightRequests = 5;

struct FlightEvent {
  std::int32_t tick = 0;  ///< Executed ticks since the flight began.
  FlightEventKind kind = FlightEventKind::kCommand;
  std::int32_t a = 0, b = 0, ticks = 0;
  double x = 0;

  bool operator==(const FlightEvent&) const = default;
};

/// Parts of a flight's setting that can be left out, to see whether a failure needs them: a bit for
/// each.
inline constexpr std::array<std::string_view, 11> kFlightParts = {
    "sensor",  "feedback", "aborts", "reactions",  "collapse", "procedure",
    "get-ups", "gravity",  "speed",  "last-known", "spikes"};

/// A flight: random files and settings from a seed, and what happens to them.
struct Flight {
  std::uint64_t seed = 1;
  std::int32_t ticks = 4000;        ///< How many are executed.
  std::uint32_t left_out = 0;       ///< Bits of kFlightParts.
  std::vector<FlightEvent> events;  ///< By their ticks.

  bool operator==(const Flight&) const = default;
};

/// The flight of a seed.
[[nodiscard]] Flight RandomFlight(std::uint64_t seed);

/// Puts events in the order of their ticks; those of a tick keep theirs.
void SortByTick(std::vector<FlightEvent>& events);

/// A flight as a text, one event a line, and back.
[[nodiscard]] std::string ToText(const Flight& flight);
/// @throws std::invalid_argument  naming the line.
[[nodiscard]] Flight ParseFlight(std::string_view text);

}  // namespace tumbler::testing
