// Plays random flights and judges them.
//   random_flights FIRST COUNT [--ignore INVARIANT]... [--only PROTOCOL] [--complete] [--no-shrink]
//   random_flights --play FILE [--ignore INVARIANT]...
//
// FIRST is the seed of the first flight. Prints what has happened as one JSON object. Exits with 1
// when an invariant was broken, having said which, with the shortest flight that breaks it as a
// test; and, with --complete, when a fault was never the first with a protocol, or a transition was
// never taken.

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "tests/flights/flight_play.h"
#include "tests/support/files.h"
#include "tests/support/protocol_side.h"

namespace tumbler::testing {
namespace {

constexpr std::uint64_t kReplayed = 16;  // Of so many flights one is played twice.

struct Arguments {
  std::uint64_t first = 1, count = 0;
  FlightOptions options;
  std::string play;
  int protocol = -1;
  bool complete = false, shrink = true;
};

std::uint32_t BitOfInvariant(std::string_view name) {
  const auto* const found = std::ranges::find(kInvariantNames, name);
  if (found == kInvariantNames.end())
    throw std::invalid_argument(fmt::format("no invariant is called '{}'", name));
  return 1U << static_cast<unsigned>(found - kInvariantNames.begin());
}

Arguments Parse(std::span<char* const> words) {
  Arguments arguments;
  std::vector<std::string> numbers;
  for (std::size_t i = 1; i < words.size(); ++i) {
    const std::string_view word = words[i];
    const auto value = [&]() -> std::string {
      if (++i == words.size()) throw std::invalid_argument(fmt::format("{} needs a value", word));
      return words[i];
    };
    if (word == "--ignore") {
      arguments.options.ignored |= BitOfInvariant(value());
    } else if (word == "--only") {
      const std::string name = value();
      for (std::size_t p = 0; p < EveryProtocol().size(); ++p) {
        if (EveryProtocol()[p].name == name) arguments.protocol = static_cast<int>(p);
      }
      if (arguments.protocol < 0)
        throw std::invalid_argument(fmt::format("no protocol is called '{}'", name));
    } else if (word == "--play") {
      arguments.play = value();
    } else if (word == "--complete") {
      arguments.complete = true;
    } else if (word == "--no-shrink") {
      arguments.shrink = false;
    } else {
      numbers.emplace_back(word);
    }
  }
  if (numbers.size() != (arguments.play.empty() ? 2U : 0U))
    throw std::invalid_argument("usage: random_flights FIRST COUNT, or random_flights --play FILE");
  if (numbers.size() == 2) {
    arguments.first = std::stoull(numbers[0]);
    arguments.count = std::stoull(numbers[1]);
  }
  return arguments;
}

std::string Quoted(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '\n') {
      quoted += "\\n";
    } else {
      if (c == '"' || c == '\\') quoted += '\\';
      quoted += c;
    }
  }
  return quoted + '"';
}

/// An object of the numbers of an array, by the names that `name` gives; empty names are left out.
template <typename Array, typename Name>
std::string Named(const Array& numbers, const Name& name) {
  std::string text;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::string key = name(i);
    if (!key.empty())
      text += fmt::format("{}{}:{}", text.empty() ? "" : ",", Quoted(key), numbers[i]);
  }
  return "{" + text + "}";
}

std::string NameOfFault(std::size_t i) { return i == 0 ? "" : ToString(static_cast<Fault>(i)); }
std::string NameOfState(std::size_t i) { return ToString(static_cast<ExecutorState>(i)); }
std::string NameOfTransition(std::size_t i) {
  return fmt::format("{} -> {}", ToString(kTransitionTable[i].from),
                     ToString(kTransitionTable[i].to));
}
template <typename Rows, typename Name>
std::string ByProtocol(const Rows& rows, const Name& name) {
  std::string text;
  for (std::size_t p = 0; p < rows.size(); ++p) {
    text += fmt::format("{}{}:{}", p == 0 ? "" : ",", Quoted(EveryProtocol()[p].name),
                        Named(rows[p], name));
  }
  return "{" + text + "}";
}

/// Whether drives of a protocol can have a fault: not all say their temperature, or have
/// heartbeats.
bool CanHave(std::size_t protocol, Fault fault) {
  const ProtocolSide& side = *EveryProtocol()[protocol].side;
  if (fault == Fault::kOverTemperature) return side.nature().says_temperature;
  if (fault != Fault::kHeartbeatLost) return true;
  bool has = false;
  std::size_t number = 0;
  DriveProtocols::ForEach([&](auto listed) {
    if (number++ == protocol) has = side.HeartbeatId(decltype(listed)::Example(0)) != 0;
  });
  return has;
}

std::string Impossible() {
  std::string text;
  for (std::size_t p = 0; p < EveryProtocol().size(); ++p) {
    std::string faults;
    for (std::size_t f = 1; f < kFaultCount; ++f) {
      if (!CanHave(p, static_cast<Fault>(f)))
        faults += fmt::format("{}{}", faults.empty() ? "" : ",", Quoted(NameOfFault(f)));
    }
    text += fmt::format("{}{}:[{}]", p == 0 ? "" : ",", Quoted(EveryProtocol()[p].name), faults);
  }
  return "{" + text + "}";
}

std::string ToJson(const FlightCounts& counts, double cpu_s, const std::string& broken) {
  const auto reaction = [](std::size_t i) -> std::string {
    return ToString(static_cast<Reaction>(i));
  };
  std::string latched;
  for (std::size_t f = 1; f < kFaultCount; ++f) {
    latched += fmt::format("{}{}:{}", f == 1 ? "" : ",", Quoted(NameOfFault(f)),
                           Named(counts.latched_in[f], NameOfState));
  }
  return fmt::format(
      "{{\"flights\":{},\"ticks\":{},\"frames\":{},\"runs\":{},\"events\":{},\"cpu_s\":{:.3f},"
      "\"hash\":\"{:016x}\",\n\"cannot\":{},\n\"first_faults\":{},\n\"transitions\":{},"
      "\n\"disarmed_from\":{},\n"
      "\"fault_from\":{},\n\"latched_in\":{{{}}},\n\"reactions\":{},\n\"reactions_in_running\":{},"
      "\n"
      "\"refusals\":{},\n\"sensor_ticks\":{},\n\"state_ticks\":{},\n\"pauses\":{},\n\"let_go\":{},"
      "\n"
      "\"stiff_after_pause_ticks\":{},\"snap_max_rad\":{:.4f},\n\"broken\":[{}]}}\n",
      counts.flights, counts.ticks, counts.frames, counts.runs, counts.events, cpu_s, counts.hash,
      Impossible(), ByProtocol(counts.first_faults, NameOfFault),
      Named(counts.transitions, NameOfTransition), Named(counts.disarmed_from, NameOfState),
      Named(counts.fault_from, NameOfState), latched, Named(counts.reactions, reaction),
      Named(counts.abort_reactions, reaction),
      Named(std::span(counts.refusals).first(20),
            [](std::size_t i) -> std::string {
              return i == 0 ? "" : ToString(static_cast<Refusal>(i));
            }),
      Named(counts.sensor_ticks,
            [](std::size_t i) -> std::string { return ToString(static_cast<SensorStatus>(i)); }),
      Named(counts.state_ticks, NameOfState), ByProtocol(counts.pauses, NameOfState),
      ByProtocol(counts.let_go, NameOfState), counts.stiff_after_pause_ticks, counts.snap_max_rad,
      broken);
}

/// Plays a flight; now and then twice.
FlightOutcome PlayWhole(const Flight& flight, const FlightOptions& options) {
  FlightOutcome outcome = PlayFlight(flight, options);
  if (flight.seed % kReplayed != 0 || !outcome.violations.empty()) return outcome;
  const FlightOutcome again = PlayFlight(flight, options);
  if (again.counts.hash != outcome.counts.hash)
    outcome.violations.push_back({Invariant::kReplay, flight.ticks, "played again, it differs"});
  return outcome;
}

/// Says how a flight has failed, and returns it as JSON.
std::string Tell(const Flight& flight, const Violation& violation, const Arguments& arguments) {
  const std::string_view name = kInvariantNames[static_cast<std::size_t>(violation.invariant)];
  fmt::print(stderr, "seed {}, tick {}: {}: {}\n", flight.seed, violation.tick, name,
             violation.what);
  Flight shortest = flight;
  Violation last = violation;
  if (arguments.shrink && violation.invariant != Invariant::kReplay) {
    shortest = ShrinkFlight(flight, violation.invariant, arguments.options);
    const FlightOutcome outcome = PlayFlight(shortest, arguments.options);
    for (const Violation& each : outcome.violations) {
      if (each.invariant == violation.invariant) last = each;
    }
    fmt::print(stderr, "{}", ToTest(shortest, last));
  }
  return fmt::format("{{\"seed\":{},\"invariant\":{},\"what\":{},\"flight\":{}}}", flight.seed,
                     Quoted(name), Quoted(last.what), Quoted(ToText(shortest)));
}

/// Names what never happened. @returns whether all has.
bool IsComplete(const FlightCounts& counts) {
  bool complete = true;
  const auto need = [&complete](std::int64_t count, const std::string& what) {
    if (count > 0) return;
    complete = false;
    fmt::print(stderr, "never: {}\n", what);
  };
  for (std::size_t p = 0; p < counts.first_faults.size(); ++p) {
    for (std::size_t f = 1; f < kFaultCount; ++f) {
      if (!CanHave(p, static_cast<Fault>(f))) continue;
      need(counts.first_faults[p][f],
           fmt::format("{} as the first fault with {}", NameOfFault(f), EveryProtocol()[p].name));
    }
  }
  for (std::size_t i = 0; i < counts.transitions.size(); ++i)
    need(counts.transitions[i], NameOfTransition(i));
  for (std::size_t s = 1; s < kExecutorStateCount; ++s) {
    need(counts.disarmed_from[s], fmt::format("{} -> disarmed", NameOfState(s)));
    if (static_cast<ExecutorState>(s) != ExecutorState::kFault)
      need(counts.fault_from[s], fmt::format("{} -> fault", NameOfState(s)));
  }
  return complete;
}

int Main(const Arguments& arguments) {
  FlightCounts counts;
  std::string broken;
  int failures = 0;
  const auto take = [&](const Flight& flight) {
    const FlightOutcome outcome = PlayWhole(flight, arguments.options);
    counts.Add(outcome.counts);
    if (outcome.violations.empty()) return;
    if (failures++ > 0) broken += ",\n";
    broken += Tell(flight, outcome.violations[0], arguments);
  };
  constexpr int kMostFailures = 5;
  if (!arguments.play.empty()) take(ParseFlight(ReadFile(arguments.play)));
  for (std::uint64_t i = 0; i < arguments.count && failures < kMostFailures; ++i) {
    const std::uint64_t seed = arguments.first + i;
    if (arguments.protocol >= 0 &&
        static_cast<int>(seed % DriveProtocols::kCount) != arguments.protocol) {
      continue;
    }
    take(RandomFlight(seed));
  }
  const double cpu_s = static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
  fmt::print("{}", ToJson(counts, cpu_s, broken));
  const bool complete = !arguments.complete || IsComplete(counts);
  return failures == 0 && complete ? 0 : 1;
}

}  // namespace
}  // namespace tumbler::testing

int main(int argc, char** argv) {
  try {
    return tumbler::testing::Main(tumbler::testing::Parse({argv, static_cast<std::size_t>(argc)}));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "random_flights: %s\n", error.what());
    return 2;
  }
}
