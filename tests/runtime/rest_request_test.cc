#include "runtime/record/rest_request.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <vector>

#include "runtime/record/heard_runs.h"

namespace tumbler {
namespace {

using std::chrono::milliseconds;

constexpr RestRequest::Clock::time_point kStart{};

run_t RunOf(std::int64_t number, const std::string& robot) {
  run_t message{};
  message.run = number;
  message.robot = robot;
  return message;
}

state_t StateOf(std::int64_t number) {
  state_t message{};
  message.run = number;
  return message;
}

TEST(HeardRuns, AreThoseOfTheRobotThatIsNamedOrOfTheOnlyOne) {
  HeardRuns heard;
  heard.Hear(RunOf(11, "left"), kStart);
  heard.Hear(StateOf(12), kStart);
  EXPECT_FALSE(heard.Named());
  EXPECT_EQ(heard.Of(""), (std::vector<std::int64_t>{11, 12})) << "12 may be the robot's";
  EXPECT_EQ(heard.Of("left"), std::vector<std::int64_t>{11});
  heard.Hear(RunOf(12, "left"), kStart);
  EXPECT_TRUE(heard.Named());
  EXPECT_EQ(heard.Of("left"), (std::vector<std::int64_t>{11, 12}));
  heard.Hear(RunOf(13, "right"), kStart);
  EXPECT_TRUE(heard.Of("").empty()) << "nobody knows which robot is meant";
  EXPECT_EQ(heard.Of("right"), std::vector<std::int64_t>{13});
  heard.Hear(RunOf(0, "right"), kStart);
  EXPECT_EQ(heard.Of("right"), std::vector<std::int64_t>{13}) << "virtual time takes no requests";
}

TEST(HeardRuns, ForgetWhatWasSilent) {
  HeardRuns heard;
  heard.Hear(RunOf(11, "left"), kStart);
  heard.Hear(RunOf(12, "left"), kStart + milliseconds(900));
  heard.ForgetSilent(kStart + milliseconds(1100), milliseconds(1000));
  EXPECT_EQ(heard.Of("left"), std::vector<std::int64_t>{12});
}

class RestRequestTest : public ::testing::Test {
 protected:
  /// The runs that get a message at this time.
  std::vector<std::int64_t> SentAt(milliseconds after) {
    std::vector<std::int64_t> runs;
    request_.Send(kStart + after, [&runs](command_t& message) {
      EXPECT_EQ(message.command, command_t::DISARM);
      EXPECT_GT(message.id, 0);
      runs.push_back(message.run);
    });
    return runs;
  }
  void Answer(std::size_t index) {
    state_t answer = StateOf(request_.asked()[index].message.run);
    answer.request_id = request_.asked()[index].message.id;
    answer.tick = 400;
    request_.Hear(answer);
  }

  std::int64_t drawn_ = 0;
  RestRequest request_{OperatorRequest::kDisarm, [this] { return ++drawn_; }};
};

TEST_F(RestRequestTest, GoesToEveryRunAgainAndAgainUntilThatOneAnswers) {
  request_.AddRuns({11, 12}, kStart);
  EXPECT_EQ(SentAt(milliseconds(0)), (std::vector<std::int64_t>{11, 12}));
  EXPECT_TRUE(SentAt(milliseconds(199)).empty());
  Answer(0);
  EXPECT_EQ(request_.asked()[0].answer, "taken at tick 400");
  EXPECT_EQ(SentAt(milliseconds(200)), std::vector<std::int64_t>{12});
  EXPECT_FALSE(request_.Over(kStart + milliseconds(300)));
  for (int ms = 400; ms <= 5000; ms += 100) SentAt(milliseconds(ms));
  EXPECT_EQ(request_.asked()[1].sent, 10) << "a log that is played does not answer";
  EXPECT_TRUE(request_.Over(kStart + milliseconds(5000)));
  EXPECT_EQ(request_.answered(), 1U);
}

TEST_F(RestRequestTest, TakesTheEndOfACheckOfDrivesForAnAnswer) {
  request_.AddRuns({11}, kStart);
  SentAt(milliseconds(0));
  run_t message = RunOf(11, "left");
  request_.Hear(message);
  EXPECT_EQ(request_.answered(), 0U);
  message.check_request = request_.asked()[0].message.id;
  request_.Hear(message);
  EXPECT_EQ(request_.asked()[0].answer, "taken while the drives were checked");
}

TEST_F(RestRequestTest, DoesNotEndARunThatBeginsLater) {
  request_.AddRuns({11}, kStart);
  request_.AddRuns({11, 12}, kStart + milliseconds(1900));
  request_.AddRuns({11, 12, 13}, kStart + milliseconds(2100));
  EXPECT_EQ(SentAt(milliseconds(2100)), (std::vector<std::int64_t>{11, 12}));
}

}  // namespace
}  // namespace tumbler
