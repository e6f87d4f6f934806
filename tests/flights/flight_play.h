#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "tests/flights/flight.h"
#include "tests/flights/flight_judge.h"

namespace tumbler::testing {

struct FlightOptions {
  std::uint32_t ignored = 0;  ///< Bits of Invariant that are not judged.
  /// Changes what the executor puts out, before it is sent and judged: a planted mistake, to try
  /// whether judge and shrinking find it.
  std::function<void(const TickInput&, TickOutput&)> tamper;
};

struct FlightOutcome {
  std::vector<Violation> violations;
  FlightCounts counts;
};

/// Plays a flight until it is over, or an invariant is broken.
[[nodiscard]] FlightOutcome PlayFlight(const Flight& flight, const FlightOptions& options = {});
/// The same of a text, for tests.
[[nodiscard]] FlightOutcome PlayFlight(std::string_view text);

/// The shortest flight that can be found which breaks the same invariant.
/// @param plays_max  after so many plays the best one so far is taken.
[[nodiscard]] Flight ShrinkFlight(const Flight& flight, Invariant broken,
                                  const FlightOptions& options = {}, int plays_max = 2000);

/// A flight as a test that fails as long as the invariant is broken.
[[nodiscard]] std::string ToTest(const Flight& flight, const Violation& violation);

}  // namespace tumbler::testing
