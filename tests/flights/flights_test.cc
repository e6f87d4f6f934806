// Random flights find what is wrong, and make it short. That nothing is wrong is found by
// random_flights, in CTest for some minutes of flight and by scripts/endurance for as long as there
// is time.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/flights/flight_play.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;
using testing::Flight;
using testing::FlightOptions;
using testing::FlightOutcome;
using testing::Invariant;
using ::testing::IsEmpty;
using testing::ParseFlight;
using testing::PlayFlight;
using testing::RandomFlight;
using testing::ShrinkFlight;
using ::testing::SizeIs;
using testing::Violation;

/// The first of some seeds whose flight breaks an invariant under these options.
struct Found {
  Flight flight;
  Violation violation;
};
Found FirstBroken(const FlightOptions& options) {
  for (std::uint64_t seed = 1; seed < 60; ++seed) {
    const Flight flight = RandomFlight(seed);
    const FlightOutcome outcome = PlayFlight(flight, options);
    if (!outcome.violations.empty()) return {flight, outcome.violations[0]};
  }
  throw std::runtime_error("no flight breaks an invariant");
}

/// All invariants but these.
std::uint32_t AllBut(const std::vector<Invariant>& judged) {
  std::uint32_t ignored = ~0U;
  for (const Invariant each : judged) ignored &= ~(1U << static_cast<unsigned>(each));
  return ignored;
}

bool Breaks(const Flight& flight, Invariant invariant, const FlightOptions& options) {
  const FlightOutcome outcome = PlayFlight(flight, options);
  return std::ranges::find(outcome.violations, invariant, &Violation::invariant) !=
         outcome.violations.end();
}

TEST(Flights, AreTheSameEachTimeAndDifferByTheirSeeds) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const FlightOutcome once = PlayFlight(RandomFlight(seed));
    EXPECT_EQ(once.counts.hash, PlayFlight(RandomFlight(seed)).counts.hash) << seed;
    EXPECT_NE(once.counts.hash, PlayFlight(RandomFlight(seed + 4)).counts.hash) << seed;
  }
}

TEST(Flights, AreTheSameFromTheirText) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Flight flight = RandomFlight(seed);
    flight.left_out = static_cast<std::uint32_t>(seed) % (1U << testing::kFlightParts.size());
    ASSERT_EQ(ParseFlight(ToText(flight)), flight) << ToText(flight);
  }
}

TEST(Flights, EventsOfATextAreInTheOrderOfTheirTicksAndThoseOfATickInThatOfTheirLines) {
  const Flight flight = ParseFlight(
      "flight seed=1 ticks=100\n"
      "30 heat 0 0 0 1\n"
      "10 heat 0 0 0 2\n"
      "30 heat 0 0 0 3\n"
      "20 heat 0 0 0 4\n"
      "10 heat 0 0 0 5\n"
      "30 heat 0 0 0 6\n");
  std::vector<double> order;
  for (const testing::FlightEvent& event : flight.events) order.push_back(event.x);
  EXPECT_THAT(order, ElementsAre(2, 5, 4, 1, 3, 6));
}

TEST(Flights, TextsThatAreNoneAreRefusedByTheirLine) {
  const auto refusal = [](const char* text) -> std::string {
    try {
      static_cast<void>(ParseFlight(text));
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal("flight seed=x"), "flight, line 1: 'x' is no number");
  EXPECT_EQ(refusal("flight speed=1"), "flight, line 1: unknown key 'speed'");
  EXPECT_EQ(refusal("flight without=wings"), "flight, line 1: no part is called 'wings'");
  EXPECT_EQ(refusal("flight seed=1\n5 dive 0 0 0 0"),
            "flight, line 2: an event is TICK KIND A B TICKS X");
  EXPECT_EQ(refusal("flight seed=1\n5 pause 0 0 1.5 0"), "flight, line 2: '1.5' is no number");
}

// What an executor could do wrong, and by which invariant it is found. The mistake is made in a
// copy of what it puts out.
struct Mistake {
  const char* name;
  std::vector<Invariant> found_by;
  void (*make)(const TickInput&, TickOutput&);
};

bool Drives(const TickRecord& record) {
  return record.state == ExecutorState::kRunning || record.state == ExecutorState::kHolding;
}

void PrintTo(const Mistake& mistake, std::ostream* out) { *out << mistake.name; }

const std::vector<Mistake> kMistakes = {
    {"ADriveIsNotWritten",
     {Invariant::kWritten},
     [](const TickInput& input, TickOutput& output) {
       if (input.tick % 1000 == 999) output.frames[0].Clear();
     }},
    {"AStopIsNotObeyed",
     {Invariant::kObeyed, Invariant::kTransition},
     [](const TickInput& input, TickOutput& output) {
       if (input.command == OperatorCommand::kDisarm) output.record.state = ExecutorState::kHolding;
     }},
    {"APositionSteps",
     {Invariant::kSteps, Invariant::kLimits, Invariant::kWire},
     [](const TickInput& input, TickOutput& output) {
       if (input.tick % 500 == 499 && Drives(output.record))
         output.record.joints[0].limited.position_rad += 0.3F;
     }},
    {"ANumberIsNone",
     {Invariant::kFinite},
     [](const TickInput& input, TickOutput& output) {
       if (input.tick % 500 == 499)
         output.record.joints[0].limited.torque_nm = std::numeric_limits<float>::quiet_NaN();
     }},
    {"AFaultIsForgotten",
     {Invariant::kLatched, Invariant::kDetected, Invariant::kTransition},
     [](const TickInput& input, TickOutput& output) {
       if (input.tick % 100 == 99) output.record.faults = 0;
     }},
    {"ALateTickIsNotFound",
     {Invariant::kDetected, Invariant::kTransition, Invariant::kLatched},
     [](const TickInput& /*input*/, TickOutput& output) {
       output.record.faults &= ~(1U << static_cast<unsigned>(Fault::kLateTick));
     }},
    {"TheReactionIsTooWeak",
     {Invariant::kReaction, Invariant::kGains, Invariant::kTorqueOff, Invariant::kWire},
     [](const TickInput& /*input*/, TickOutput& output) {
       if (output.record.reaction == Reaction::kDamp) output.record.reaction = Reaction::kHold;
     }},
};

class FlightMistakes : public ::testing::TestWithParam<Mistake> {};

TEST_P(FlightMistakes, AreFoundAndMadeShort) {
  FlightOptions options;
  options.tamper = GetParam().make;
  options.ignored = AllBut(GetParam().found_by);
  const Found found = FirstBroken(options);
  const Flight shortest = ShrinkFlight(found.flight, found.violation.invariant, options, 60);
  EXPECT_TRUE(Breaks(shortest, found.violation.invariant, options));
  EXPECT_LE(shortest.ticks, found.violation.tick + 1);
  EXPECT_LE(shortest.events.size(), found.flight.events.size());
  const std::string test = ToTest(shortest, found.violation);
  const std::size_t begin = test.find("R\"(") + 3;
  EXPECT_EQ(ParseFlight(test.substr(begin, test.find(")\"") - begin)), shortest);
}

INSTANTIATE_TEST_SUITE_P(All, FlightMistakes, ::testing::ValuesIn(kMistakes),
                         [](const auto& of) { return std::string(of.param.name); });

TEST(Flights, AreMadeAsShortAsTheMistakeThatTheyShow) {
  // It takes two events: a stop, and somewhen after it a hot drive.
  FlightOptions options;
  options.ignored = AllBut({Invariant::kWritten});
  bool stopped = false;
  options.tamper = [&stopped](const TickInput& input, TickOutput& output) {
    if (input.tick == 1) stopped = false;
    stopped = stopped || input.command == OperatorCommand::kStop;
    const std::uint32_t hot = 1U << static_cast<unsigned>(Fault::kOverTemperature);
    if (stopped && (output.record.faults & hot) != 0) output.frames[0].Clear();
  };
  Flight flight = RandomFlight(4);
  flight.events.clear();
  for (std::int32_t tick = 300; tick < 3000; tick += 60)
    flight.events.push_back({tick, testing::FlightEventKind::kSilence, 0, 0, 1, 0});
  flight.events.push_back({3010, testing::FlightEventKind::kCommand,
                           static_cast<std::int32_t>(OperatorCommand::kStop), -1, 0, 0});
  flight.events.push_back({3020, testing::FlightEventKind::kHeat, 0, 0, 0, 100});
  flight.ticks = 6000;
  ASSERT_TRUE(Breaks(flight, Invariant::kWritten, options));
  const Flight shortest = ShrinkFlight(flight, Invariant::kWritten, options, 400);
  EXPECT_THAT(shortest.events, SizeIs(2)) << ToText(shortest);
  EXPECT_LT(shortest.ticks, 1000) << ToText(shortest);
}

void ExpectNothingAmiss(const char* flight) {
  const FlightOutcome outcome = PlayFlight(ParseFlight(flight));
  EXPECT_THAT(outcome.violations, IsEmpty()) << outcome.violations[0].what;
}

// Flights of which the judge asked too much. Their seeds are of random flights.

TEST(Flights, ADisarmInTheTickOfATorqueOffMayFindADriveLetGo) {  // bus-off, then the operator
  ExpectNothingAmiss(
      "flight seed=10557 ticks=199 without=sensor without=feedback without=aborts "
      "without=reactions "
      "without=collapse without=get-ups without=speed without=last-known without=spikes\n"
      "186 bus-fault 5 0 16 0.0075346191638295595\n");
}

TEST(Flights, AJointThatIsCarriedWhileItsRepliesAreLateMayBeEnabledWhereItWas) {
  ExpectNothingAmiss(
      "flight seed=7894 ticks=2485 without=sensor without=feedback "
      "without=reactions without=collapse "
      "without=get-ups without=speed without=last-known without=spikes\n"
      "2241 pause 5 0 6 0\n"
      "2481 bus-fault 3 0 1 1\n");
}

TEST(Flights, ACommandThatIsRefusedMayMeetAFaultThatWasLatchedBeforeGoingHome) {
  ExpectNothingAmiss(
      "flight seed=9468 ticks=5459 without=aborts without=reactions without=collapse "
      "without=procedure without=get-ups without=speed without=last-known without=spikes\n"
      "0 bus-fault 0 1 0 0\n"
      "0 bus-fault 2 3 0 0\n"
      "0 bus-fault 2 -1 0 0\n"
      "0 lose-replies 5 0 0 0\n"
      "0 bus-fault 5 1 0 0\n"
      "0 bus-fault 0 0 0 0\n"
      "0 bus-fault 2 2 0 0\n"
      "0 bus-fault 0 1 0 0\n"
      "0 bus-fault 4 1 0 0\n"
      "0 bus-fault 4 0 0 0\n"
      "0 bus-fault 5 2 0 0\n"
      "0 bus-fault 4 0 0 0\n"
      "0 bus-fault 8 2 0 0\n"
      "373 sensor 3 0 16 0\n"
      "1067 silence 5 0 3 0\n"
      "1181 command 4 6 0 0\n"
      "1350 stutter 0 0 0 0\n"
      "1393 stranger 2 0 0 0.8107800138789627\n"
      "1494 lose-replies 0 0 4 0\n"
      "1725 pause 4 0 5 0\n"
      "1796 silence 1 0 3 0\n"
      "2029 heat 7 0 0 109.39817552150927\n"
      "2102 link 4 0 1 0\n"
      "2162 lose-replies 2 0 744 0\n"
      "2162 bus-fault 6 3 1 0\n"
      "2993 send 4 0 1 0\n"
      "3102 stranger 3 1 0 0.50239716344299\n"
      "3811 bus-fault 7 2 4 0\n"
      "3873 lose-replies 1 0 4 0\n"
      "4445 bus-fault 0 3 7 1\n"
      "4658 drive-error 3 0 0 0\n"
      "4725 stranger 4 1 0 0\n"
      "4964 pause 3 0 3 0\n"
      "5429 bus-fault 1 2 37 0.559382889295961\n");
}

TEST(Flights, ADisarmMayNotReachWhatWasArmedPastTheProcedure) {
  ExpectNothingAmiss(
      "flight seed=15704 ticks=5817 without=feedback without=aborts without=collapse "
      "without=get-ups without=speed without=last-known without=spikes\n"
      "2967 send 5 0 1 0\n"
      "3240 lose-replies 0 0 139 0\n"
      "3321 drive-error 4 0 0 0\n"
      "3348 pause 5 0 20 0\n"
      "3614 link 5 0 1 0\n"
      "4034 controller 2 0 1 0\n"
      "4477 controller 3 0 1 0\n"
      "4705 lose-replies 5 0 5 0\n"
      "5641 pause 3 0 141 0\n"
      "5757 command 1 2 0 0\n"
      "5816 request 3 0 0 0\n");
}

TEST(Flights, AfterGoingHomeAFaultThatIsLatchedMayHideOneThatCountsForLessInFault) {
  ExpectNothingAmiss(
      "flight seed=29088 ticks=340 without=feedback without=aborts without=get-ups "
      "without=gravity without=speed without=last-known without=spikes\n"
      "208 pause 0 0 1 0\n"
      "339 pause 5 0 48 0\n");
}

TEST(Flights, ABusOffInALateTickAfterGoingHomeIsNoExceptionToThat) {
  ExpectNothingAmiss(
      "flight seed=47763 ticks=1823 without=sensor without=feedback "
      "without=aborts without=collapse without=procedure without=get-ups "
      "without=gravity without=speed without=last-known without=spikes\n"
      "960 stutter 0 0 0 0\n"
      "1822 bus-fault 6 1 1 0\n"
      "1822 stutter 0 0 0 0\n");
}

TEST(Flights, ADriveMayResistSomebodyWhoMovesItsJointWhileArming) {
  ExpectNothingAmiss(
      "flight seed=42194 ticks=2179 without=sensor without=feedback "
      "without=aborts without=reactions without=collapse without=get-ups "
      "without=gravity without=speed without=last-known without=spikes\n"
      "0 pause 0 0 53 0\n"
      "2089 lose-heartbeat 7 0 110 0\n"
      "2127 displace 1 0 1 -0.39042205619354275\n");
}

TEST(Flights, AJointThatWasFastWhenItsDriveWasEnabledMayOvershoot) {
  ExpectNothingAmiss(
      "flight seed=93770 ticks=560 without=sensor without=feedback without=aborts without=get-ups "
      "without=gravity without=speed without=last-known without=spikes\n"
      "244 link 5 0 1 0\n"
      "466 displace 2 0 13 -0.7248304595008959\n");
}

}  // namespace
}  // namespace tumbler
