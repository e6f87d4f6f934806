#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "tests/flights/flight_play.h"

namespace tumbler::testing {
namespace {

/// Makes a flight shorter as long as it breaks the same invariant.
class Shrinking {
 public:
  Shrinking(Flight flight, Invariant broken, const FlightOptions& options, int plays_max)
      : best_(std::move(flight)), broken_(broken), options_(options), plays_left_(plays_max) {}

  Flight Run() {
    if (!Try(best_)) return best_;
    for (bool better = true; better && plays_left_ > 0;) {
      const Flight before = best_;
      DropEvents();
      LeaveOutParts();
      Lessen();
      better = !(best_ == before);
    }
    return best_;
  }

 private:
  // Takes a flight in place of the best if it breaks the invariant, cut off where it does.
  bool Try(Flight flight) {
    if (plays_left_ <= 0) return false;
    --plays_left_;
    const FlightOutcome outcome = PlayFlight(flight, options_);
    const auto found = std::ranges::find(outcome.violations, broken_, &Violation::invariant);
    if (found == outcome.violations.end()) return false;
    flight.ticks = found->tick + 1;
    std::erase_if(flight.events,
                  [&flight](const FlightEvent& event) { return event.tick >= flight.ticks; });
    best_ = std::move(flight);
    return true;
  }

  // Delta debugging: drops halves of the events, then quarters, and so on.
  void DropEvents() {
    for (std::size_t size = (best_.events.size() + 1) / 2; size >= 1; size /= 2) {
      for (std::size_t first = 0; first < best_.events.size();) {
        Flight fewer = best_;
        const auto begin = fewer.events.begin() + static_cast<std::ptrdiff_t>(first);
        fewer.events.erase(begin, begin + static_cast<std::ptrdiff_t>(
                                              std::min(size, fewer.events.size() - first)));
        if (!Try(fewer)) first += size;
      }
    }
  }

  void LeaveOutParts() {
    for (std::size_t i = 0; i < kFlightParts.size(); ++i) {
      Flight simpler = best_;
      simpler.left_out |= 1U << i;
      if (simpler.left_out != best_.left_out) Try(simpler);
    }
  }

  // Shorter times and smaller numbers, and events that come earlier.
  void Lessen() {
    for (std::size_t i = 0; i < best_.events.size(); ++i) {
      const auto change = [&](auto&& how) {
        for (;;) {
          if (i >= best_.events.size()) return;
          Flight less = best_;
          how(less.events[i]);
          SortByTick(less.events);
          if (less == best_ || !Try(less)) return;
        }
      };
      change([](FlightEvent& event) { event.ticks /= 2; });
      change([](FlightEvent& event) { event.x = 0; });
      change([](FlightEvent& event) { event.tick /= 2; });
      change([](FlightEvent& event) { event.tick -= event.tick > 0 ? 1 + event.tick / 16 : 0; });
    }
  }

  Flight best_;
  Invariant broken_;
  const FlightOptions& options_;
  int plays_left_;
};

}  // namespace

Flight ShrinkFlight(const Flight& flight, Invariant broken, const FlightOptions& options,
                    int plays_max) {
  return Shrinking(flight, broken, options, plays_max).Run();
}

std::string ToTest(const Flight& flight, const Violation& violation) {
  return fmt::format(
      "TEST(Flights, Seed{}) {{  // {}: {}\n"
      "  const FlightOutcome outcome = PlayFlight(R\"({})\");\n"
      "  EXPECT_THAT(outcome.violations, IsEmpty()) << outcome.violations[0].what;\n"
      "}}\n",
      flight.seed, kInvariantNames[static_cast<std::size_t>(violation.invariant)], violation.what,
      ToText(flight));
}

}  // namespace tumbler::testing
