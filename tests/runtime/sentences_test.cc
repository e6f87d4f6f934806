// What people read about faults and refusals, and the numbers that messages carry for it.

#include "runtime/record/sentences.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "common/core/status.h"
#include "runtime/record/live_view.h"
#include "runtime/record/messages.h"
#include "runtime/record/state_csv.h"

namespace tumbler {
namespace {

const std::vector<std::string> kTwoLegs{"leg1", "leg2"};
const std::vector<std::string> kCodes{"odrive", "damiao"};

/// A tick in which a fault was found.
TimedRecord TickWith(Fault fault, DetailNumber value, DetailNumber limit, std::int8_t joint) {
  TimedRecord timed;
  timed.record.joint_count = 2;
  timed.record.state = ExecutorState::kFault;
  timed.record.reaction = Reaction::kDamp;
  timed.record.faults = 1U << static_cast<unsigned>(fault);
  timed.record.first_fault = {
      12, value, limit, fault, joint, ExecutorState::kRunning, Reaction::kDamp};
  return timed;
}

/// The sentence that somebody far away makes of the message about a tick.
std::string SentenceFromMessage(const TimedRecord& timed) {
  state_t state;
  FillState(timed, state);
  LiveView view;
  view.Take(state);
  RunDescription about;
  about.joints = kTwoLegs;
  about.error_codes = kCodes;
  RunMessage run(about);
  view.Take(run.At(0, 0, 0));
  const std::string line = view.Line();
  return line.substr(line.find("faults: ") + 8);
}

TEST(Sentences, ADrivesCodeKeepsAllOfIts32BitsAndHasItsNames) {
  // The nearest float to this code is another code.
  const std::uint32_t code = 0x41000101;
  ASSERT_NE(static_cast<std::uint32_t>(static_cast<float>(code)), code);
  const TimedRecord timed = TickWith(Fault::kDriveError, DetailNumber::Code(code), {}, 0);
  const std::string sentence = Describe(timed.record.first_fault, kTwoLegs, kCodes);
  EXPECT_EQ(sentence,
            "drive error of joint leg1: code 0x41000101, initializing, dc bus over-voltage, "
            "watchdog timer expired, calibration error at tick 12 (running); reaction: damp");
  EXPECT_EQ(SentenceFromMessage(timed), sentence);
  EXPECT_EQ(Describe(timed.record.first_fault, kTwoLegs),
            "drive error of joint leg1: code 0x41000101 at tick 12 (running); reaction: damp");
  EXPECT_EQ(Describe(RefusalDetail{DetailNumber::Code(13), {}, Refusal::kDriveError, 1}, kTwoLegs,
                     kCodes),
            "a drive reports an error (joint leg2: code 0x0d, lost communication)");
}

TEST(Sentences, AFaultWhoseReactionIsOverIsToldWithoutOne) {
  TimedRecord timed = TickWith(Fault::kLateTick, DetailNumber::Integer(104), {}, -1);
  EXPECT_THAT(SentenceFromMessage(timed), ::testing::EndsWith("; reaction: damp"));
  // On the way home nothing is reacted to any more, and the fault is still latched.
  timed.record.state = ExecutorState::kRunning;
  timed.record.reaction = Reaction::kIgnore;
  const std::string sentence = SentenceFromMessage(timed);
  EXPECT_THAT(sentence, ::testing::StartsWith("late tick: 104"));
  EXPECT_THAT(sentence, ::testing::Not(::testing::HasSubstr("reaction")));
}

TEST(Sentences, AnEventOfAFurtherFaultNamesIt) {
  EventWatch events{RunDescription{}};
  TimedRecord timed = TickWith(Fault::kLateTick, DetailNumber::Integer(104), {}, -1);
  ASSERT_TRUE(events.Next(timed));
  timed.record.faults |= 1U << static_cast<unsigned>(Fault::kFollowingError) |
                         1U << static_cast<unsigned>(Fault::kDriveError);
  const auto further = events.Next(timed);
  ASSERT_TRUE(further);
  EXPECT_THAT(further->text, ::testing::AllOf(::testing::StartsWith("further fault: "),
                                              ::testing::HasSubstr("following error"),
                                              ::testing::HasSubstr("drive error"),
                                              ::testing::Not(::testing::HasSubstr("late tick"))));
}

TEST(Sentences, TheSmallestAndLargestNumbersComeBackFromAMessageExactly) {
  using Limits = std::numeric_limits<std::int32_t>;
  for (const DetailUnit unit :
       {DetailUnit::kTicks, DetailUnit::kCode, DetailUnit::kIdentifier, DetailUnit::kRadians}) {
    for (const DetailNumber number :
         {DetailNumber::Integer(Limits::max()), DetailNumber::Integer(16'777'217),
          DetailNumber::Real(0.1F), DetailNumber()}) {
      EXPECT_EQ(FromDouble(ToDouble(number, unit), unit), number) << static_cast<int>(unit);
    }
  }
  EXPECT_EQ(ToDouble(DetailNumber::Code(0xffffffff), DetailUnit::kCode), 4294967295.0);
  EXPECT_EQ(FromDouble(4294967295.0, DetailUnit::kCode).code(), 0xffffffffU);
  EXPECT_EQ(ToDouble(DetailNumber::Integer(-1), DetailUnit::kTicks), -1.0);
  EXPECT_EQ(FromDouble(-1, DetailUnit::kTicks).integer(), -1);
  EXPECT_EQ(DetailNumber::Integer(std::int64_t{1} << 40).integer(), Limits::max());
  for (const double nonsense :
       {std::numeric_limits<double>::quiet_NaN(), 1e300, -1e300, 4294967296.0})
    EXPECT_EQ(FromDouble(nonsense, DetailUnit::kCode), DetailNumber());
}

TEST(Sentences, NumbersThatAreCountedAreWrittenAsIntegers) {
  const TimedRecord late =
      TickWith(Fault::kLateTick, DetailNumber::Integer(20'000'001), DetailNumber::Integer(2), -1);
  EXPECT_EQ(Describe(late.record.first_fault, kTwoLegs),
            "late tick: 20000001 ticks, limit 2 at tick 12 (running); reaction: damp");
  EXPECT_EQ(SentenceFromMessage(late), Describe(late.record.first_fault, kTwoLegs));
  const TimedRecord foreign =
      TickWith(Fault::kForeignCommand, DetailNumber::Code(0x1fffffff), {}, 1);
  EXPECT_EQ(Describe(foreign.record.first_fault, kTwoLegs),
            "foreign command of joint leg2: a frame of somebody else with identifier 0x1fffffff at "
            "tick 12 (running); reaction: damp");
  const TimedRecord lost = TickWith(
      Fault::kInterfaceDown, DetailNumber::Integer(static_cast<int>(Status::kLinkDown)), {}, -1);
  EXPECT_NE(Describe(lost.record.first_fault, kTwoLegs).find(ToString(Status::kLinkDown)),
            std::string::npos);
  const TimedRecord off =
      TickWith(Fault::kFollowingError, DetailNumber::Real(0.51F), DetailNumber::Real(0.5F), 0);
  EXPECT_EQ(Describe(off.record.first_fault, kTwoLegs),
            "following error of joint leg1: 0.51 rad, limit 0.5 at tick 12 (running); reaction: "
            "damp");
  state_t state;
  std::string row;
  FillState(late, state);
  AppendStateCsvRow(state, row);
  EXPECT_NE(row.find(",12,20000001,2,"), std::string::npos) << row;
  row.clear();
  FillState(off, state);
  AppendStateCsvRow(state, row);
  EXPECT_NE(row.find(",12,0.51,0.5,"), std::string::npos) << row;
}

TEST(LiveView, TextsOfMessagesCannotPassForLinesOfItsOwn) {
  state_t state;
  FillState(TickWith(Fault::kDriveError, DetailNumber::Code(1), {}, 0), state);
  LiveView view;
  view.Take(state);
  RunDescription about;
  about.joints = {"leg1\nfaults  none", "leg2"};
  about.motion = "gait\nfaults  none";
  RunMessage run(about);
  view.Take(run.At(0, 0, 0));
  event_t event{};
  event.from_state = "running\nfaults  none";
  event.to_state = "fault";
  event.text = "late\nfaults  none\r\tok";
  view.Take(event);
  std::istringstream lines(view.Screen());
  int of_faults = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("faults")) continue;
    ++of_faults;
    EXPECT_THAT(line, ::testing::HasSubstr("drive error"));
  }
  EXPECT_EQ(of_faults, 1) << view.Screen();
  EXPECT_THAT(view.Screen(), ::testing::HasSubstr("late\\x0afaults  none\\x0d\\x09ok"));
}

TEST(LiveView, StateFaultsAndJointsStayOnASmallTerminal) {
  const TimedRecord timed = TickWith(Fault::kDriveError, DetailNumber::Code(0x41000101), {}, 0);
  state_t state;
  FillState(timed, state);
  LiveView view;
  view.Take(state);
  RunDescription about;
  about.joints = kTwoLegs;
  about.error_codes = kCodes;
  RunMessage run(about);
  view.Take(run.At(0, 0, 0));
  for (const auto& [columns, rows] : {std::pair(50, 16), {80, 24}, {60, 14}, {120, 10}}) {
    const std::string screen = Fitted(view.Screen(columns), columns, rows);
    std::istringstream lines(screen);
    int count = 0;
    for (std::string line; std::getline(lines, line); ++count) {
      std::size_t characters = 0;
      for (const char c : line)
        characters += (static_cast<unsigned char>(c) & 0xC0U) != 0x80U ? 1 : 0;
      EXPECT_LE(characters, static_cast<std::size_t>(columns)) << line;
    }
    EXPECT_LE(count, rows);
    std::string words;  // of the lines, wherever they were broken
    std::istringstream split(screen);
    for (std::string word; split >> word;) words += word + ' ';
    for (const char* part :
         {"state ", "faults ", "drive error of joint leg1", "reaction: damp", "leg2 "}) {
      EXPECT_THAT(words, ::testing::HasSubstr(part)) << columns << " x " << rows << '\n' << screen;
    }
  }
  const std::string wide = Fitted(view.Screen(), 200, 200);
  EXPECT_EQ(wide, view.Screen());
}

}  // namespace
}  // namespace tumbler
