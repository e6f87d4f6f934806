#include "tests/flights/flight.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <stdexcept>

#include "common/core/status.h"
#include "firmware_interface/can/bus.h"
#include "firmware_interface/can/bus_faults.h"
#include "runtime/executor/tick.h"
#include "tests/flights/flight_random.h"

namespace tumbler::testing {
namespace {

constexpr std::array<std::string_view, kFlightEventKinds> kKindNames = {
    "command",      "request",        "pause",    "jump", "stutter",    "bus-fault",
    "lose-replies", "lose-heartbeat", "link",     "send", "controller", "silence",
    "drive-error",  "heat",           "displace", "push", "stranger",   "not-a-number",
    "sensor",       "fall",           "repair"};

// How often each kind happens, and how far its numbers reach.
struct Likelihood {
  FlightEventKind kind;
  int weight;
};
constexpr std::array<Likelihood, kFlightEventKinds> kLikelihoods{{
    {FlightEventKind::kCommand, 10},    {FlightEventKind::kRequest, 6},
    {FlightEventKind::kPause, 8},       {FlightEventKind::kJump, 2},
    {FlightEventKind::kStutter, 2},     {FlightEventKind::kBusFault, 14},
    {FlightEventKind::kLoseReplies, 4}, {FlightEventKind::kLoseHeartbeat, 3},
    {FlightEventKind::kLink, 4},        {FlightEventKind::kSend, 3},
    {FlightEventKind::kController, 3},  {FlightEventKind::kSilence, 4},
    {FlightEventKind::kDriveError, 4},  {FlightEventKind::kHeat, 3},
    {FlightEventKind::kDisplace, 6},    {FlightEventKind::kPush, 3},
    {FlightEventKind::kStranger, 4},    {FlightEventKind::kNotANumber, 2},
    {FlightEventKind::kSensor, 4},      {FlightEventKind::kFall, 6},
    {FlightEventKind::kRepair, 2},
}};

FlightEventKind RandomKind(FlightRandom& random) {
  int sum = 0;
  for (const Likelihood& of : kLikelihoods) sum += of.weight;
  int left = random.Below(sum);
  for (const Likelihood& of : kLikelihoods) {
    left -= of.weight;
    if (left < 0) return of.kind;
  }
  return FlightEventKind::kCommand;
}

void FillBusFault(FlightEvent& event, FlightRandom& random) {
  // All kinds but those of the link, which are events of their own.
  event.a = random.Below(static_cast<int>(BusFaultKind::kStall) + 1);
  event.b = random.Within(-1, 3);
  event.x = random.Chance(0.3) ? 1 : random.Uniform(0, 1);
  event.ticks = static_cast<int>(random.Logarithmic(1, 60));
  if (event.a == static_cast<int>(BusFaultKind::kDuplicate)) event.ticks += 20;
  if (event.a == static_cast<int>(BusFaultKind::kBitErrors)) event.x *= 0.01;
  if (event.a == static_cast<int>(BusFaultKind::kFlip)) event.x *= 0.2;
}

void FillCommand(FlightEvent& event, FlightRandom& random) {
  event.a = random.Within(1, static_cast<int>(OperatorCommand::kGoHome));
  if (random.Chance(0.25)) event.a = static_cast<int>(OperatorCommand::kStop);
  // What takes the torque off ends most of what may happen.
  if (event.a == static_cast<int>(OperatorCommand::kDisarm) && random.Chance(0.7))
    event.a = static_cast<int>(OperatorCommand::kFinish);
  event.b = random.Within(-1, 6);
}

void FillLink(FlightEvent& event, FlightRandom& random) {
  constexpr std::array<Status, 4> kLost = {Status::kBusOff, Status::kLinkDown, Status::kIoError,
                                           Status::kLinkGone};
  event.a = static_cast<int>(kLost[static_cast<std::size_t>(random.Below(4))]);
  event.ticks = static_cast<int>(random.Logarithmic(1, 300));
}

void FillSend(FlightEvent& event, FlightRandom& random) {
  constexpr std::array<Status, 5> kFailures = {
      Status::kWouldBlock, Status::kBusOff, Status::kLinkDown, Status::kIoError, Status::kLinkGone};
  event.a = static_cast<int>(
      kFailures[random.Chance(0.6) ? 0 : static_cast<std::size_t>(random.Below(5))]);
  event.ticks = static_cast<int>(random.Logarithmic(1, 40));
}

FlightEvent RandomEvent(std::int32_t tick, FlightRandom& random) {
  FlightEvent event;
  event.tick = tick;
  event.kind = RandomKind(random);
  event.a = random.Below(8);
  switch (event.kind) {
    case FlightEventKind::kCommand:
      FillCommand(event, random);
      break;
    case FlightEventKind::kRequest:
      event.a = random.Below(kFlightRequests);
      break;
    case FlightEventKind::kPause:
      // Mostly a few periods, and up to 10 s at 1 kHz.
      event.ticks = random.Chance(0.6) ? random.Within(1, 6)
                                       : static_cast<int>(random.Logarithmic(3, 10'000));
      break;
    case FlightEventKind::kJump:
      event.a = static_cast<int>(random.Logarithmic(1, 5'000));
      break;
    case FlightEventKind::kStutter:
      event.a = random.Chance(0.5) ? 0 : random.Within(1, 1000);
      break;
    case FlightEventKind::kBusFault:
      FillBusFault(event, random);
      break;
    case FlightEventKind::kLoseReplies:
    case FlightEventKind::kLoseHeartbeat:
      event.ticks = static_cast<int>(random.Logarithmic(1, 800));
      break;
    case FlightEventKind::kLink:
      FillLink(event, random);
      break;
    case FlightEventKind::kSend:
      FillSend(event, random);
      break;
    case FlightEventKind::kController:
      event.a = random.Within(0, static_cast<int>(CanControllerState::kBusOff));
      event.ticks = static_cast<int>(random.Logarithmic(1, 100));
      break;
    case FlightEventKind::kSilence:
      event.ticks = static_cast<int>(random.Logarithmic(1, 500));
      break;
    case FlightEventKind::kHeat:
      event.x = random.Uniform(60, 110);
      break;
    case FlightEventKind::kDisplace:
      event.x = random.Uniform(-1, 1);
      event.ticks = static_cast<int>(random.Logarithmic(1, 80));
      break;
    case FlightEventKind::kPush:
      event.x = random.Uniform(-12, 12);
      event.ticks = static_cast<int>(random.Logarithmic(1, 200));
      break;
    case FlightEventKind::kStranger:
      event.b = random.Below(2);
      event.x = random.Uniform(0.3, 0.9);
      break;
    case FlightEventKind::kSensor:
      event.a = random.Below(kFlightSensorFaults);
      event.ticks = static_cast<int>(random.Logarithmic(1, 1500));
      event.x = random.Uniform(-1, 1);
      break;
    case FlightEventKind::kFall:
      event.x = random.Uniform(-3.1, 3.1);
      event.b = random.Below(16);
      break;
    case FlightEventKind::kDriveError:
    case FlightEventKind::kNotANumber:
    case FlightEventKind::kRepair:
      break;
  }
  return event;
}

template <typename Number>
Number ParseNumber(std::string_view word, int line) {
  Number number{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error != std::errc{} || end != word.data() + word.size())
    throw std::invalid_argument(fmt::format("flight, line {}: '{}' is no number", line, word));
  return number;
}

std::vector<std::string_view> Words(std::string_view line) {
  std::vector<std::string_view> words;
  while (!line.empty()) {
    const std::size_t end = std::min(line.find(' '), line.size());
    if (end > 0) words.push_back(line.substr(0, end));
    line.remove_prefix(std::min(end + 1, line.size()));
  }
  return words;
}

void ParseHead(const std::vector<std::string_view>& words, Flight& flight) {
  for (std::size_t i = 1; i < words.size(); ++i) {
    const std::size_t equals = words[i].find('=');
    const std::string_view key = words[i].substr(0, equals);
    const std::string_view value =
        equals == std::string_view::npos ? std::string_view() : words[i].substr(equals + 1);
    if (key == "seed") {
      flight.seed = ParseNumber<std::uint64_t>(value, 1);
    } else if (key == "ticks") {
      flight.ticks = ParseNumber<std::int32_t>(value, 1);
    } else if (key == "without") {
      const auto* const part = std::ranges::find(kFlightParts, value);
      if (part == kFlightParts.end())
        throw std::invalid_argument(fmt::format("flight, line 1: no part is called '{}'", value));
      flight.left_out |= 1U << static_cast<unsigned>(part - kFlightParts.begin());
    } else {
      throw std::invalid_argument(fmt::format("flight, line 1: unknown key '{}'", key));
    }
  }
}

}  // namespace

Flight RandomFlight(std::uint64_t seed) {
  FlightRandom random(seed, 100);
  Flight flight;
  flight.seed = seed;
  flight.ticks = random.Within(1500, 9000);
  const double gap = random.Logarithmic(60, 1500);
  double at = random.Uniform(0, 400);
  while (at < flight.ticks) {
    const FlightEvent event = RandomEvent(static_cast<std::int32_t>(at), random);
    flight.events.push_back(event);
    // A stop is short. So what can come in it is made to.
    const bool stops = event.kind == FlightEventKind::kCommand &&
                       event.a == static_cast<std::int32_t>(OperatorCommand::kStop);
    if (stops && random.Chance(0.6)) {
      at += random.Within(1, 4);
      FlightEvent then{static_cast<std::int32_t>(at),
                       FlightEventKind::kCommand,
                       static_cast<std::int32_t>(OperatorCommand::kDisarm),
                       -1,
                       0,
                       0};
      if (random.Chance(0.4)) {
        then.kind = FlightEventKind::kPause;
        then.ticks = static_cast<std::int32_t>(random.Logarithmic(1, 10'000));
      }
      flight.events.push_back(then);
    }
    // Now and then one follows upon the other.
    at += random.Chance(0.2) ? random.Below(6) : -std::log(1 - random.Uniform(0, 1)) * gap;
  }
  return flight;
}

void SortByTick(std::vector<FlightEvent>& events) {
  // They are few and nearly in order, so each is put where it belongs: std::stable_sort would take
  // memory by a function of the library that is deprecated.
  for (auto event = events.begin(); event != events.end(); ++event) {
    const auto place =
        std::ranges::upper_bound(events.begin(), event, event->tick, {}, &FlightEvent::tick);
    std::rotate(place, event, event + 1);
  }
}

std::string ToText(const Flight& flight) {
  std::string text = fmt::format("flight seed={} ticks={}", flight.seed, flight.ticks);
  for (std::size_t i = 0; i < kFlightParts.size(); ++i) {
    if ((flight.left_out >> i & 1U) != 0) text += fmt::format(" without={}", kFlightParts[i]);
  }
  text += '\n';
  for (const FlightEvent& event : flight.events) {
    text += fmt::format("{} {} {} {} {} {}\n", event.tick,
                        kKindNames[static_cast<std::size_t>(event.kind)], event.a, event.b,
                        event.ticks, event.x);
  }
  return text;
}

Flight ParseFlight(std::string_view text) {
  Flight flight;
  int number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::vector<std::string_view> words = Words(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (words.empty()) continue;
    if (words[0] == "flight") {
      ParseHead(words, flight);
      continue;
    }
    const auto* const kind =
        words.size() == 6 ? std::ranges::find(kKindNames, words[1]) : kKindNames.end();
    if (kind == kKindNames.end()) {
      throw std::invalid_argument(
          fmt::format("flight, line {}: an event is TICK KIND A B TICKS X", number));
    }
    flight.events.push_back(
        {ParseNumber<std::int32_t>(words[0], number),
         static_cast<FlightEventKind>(kind - kKindNames.begin()),
         ParseNumber<std::int32_t>(words[2], number), ParseNumber<std::int32_t>(words[3], number),
         ParseNumber<std::int32_t>(words[4], number), ParseNumber<double>(words[5], number)});
  }
  SortByTick(flight.events);
  return flight;
}

}  // namespace tumbler::testing
