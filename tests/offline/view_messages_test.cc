// Messages of telemetry that anybody may have sent, as tumbler-view reads them.

#include "offline/rehearsal/view/view_messages.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/sequence_toml.h"
#include "offline/rehearsal/flight_report/robot_paths.h"
#include "offline/rehearsal/view/viewed_robot.h"
#include "offline/rehearsal/view/viewed_run.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

template <typename Message>
std::vector<std::uint8_t> Bytes(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

state_t State(std::int64_t tick) {
  state_t state{};
  state.tick = state.number = tick;
  state.state = state_t::STATE_RUNNING;
  state.joint_count = 2;
  state.joints.resize(2);
  return state;
}

run_t About() {
  run_t run{};
  run.joint_count = 2;
  run.joints = {"left", "right"};
  run.error_codes = {"", ""};
  run.node_count = 1;
  run.nodes = {"node"};
  return run;
}

truth_t Truth() {
  truth_t truth{};
  truth.joint_count = truth.contact_count = 1;
  truth.joints.resize(1);
  truth.contacts.resize(1);
  return truth;
}

template <typename Message>
void ExpectOnlyWholeMessages(const Message& message) {
  std::vector<std::uint8_t> bytes = Bytes(message);
  Message read{};
  EXPECT_TRUE(ReadMessage(bytes, read));
  EXPECT_EQ(Bytes(read), bytes);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(ReadMessage(std::span(bytes).first(size), read)) << size;
  }
  bytes.push_back(0);
  EXPECT_FALSE(ReadMessage(bytes, read)) << "a byte too many";
  EXPECT_FALSE(ReadMessage(std::vector<std::uint8_t>(70'000, 0), read));
}

TEST(ViewMessages, AreReadOnlyWhenTheyAreWhole) {
  ExpectOnlyWholeMessages(State(1));
  ExpectOnlyWholeMessages(About());
  ExpectOnlyWholeMessages(Truth());
  event_t event{};
  event.text = "<b>";
  ExpectOnlyWholeMessages(event);
}

/// Every number of 32 bits in a message becomes one that lengths must not be.
template <typename Message>
void ExpectNoSurpriseAfterAnyLength(const Message& message) {
  const std::vector<std::uint8_t> good = Bytes(message);
  for (const std::uint32_t length : {0x7fffffffU, 0x80000000U, 0xffffffffU, 1'000'000U, 65U}) {
    for (std::size_t at = 8; at + 4 <= good.size(); ++at) {
      std::vector<std::uint8_t> bytes = good;
      for (std::size_t i = 0; i < 4; ++i) {
        bytes[at + i] = static_cast<std::uint8_t>(length >> (24 - 8 * i));
      }
      Message read{};
      if (ReadMessage(bytes, read)) {
        EXPECT_EQ(Bytes(read).size(), bytes.size());
      }
    }
  }
}

TEST(ViewMessages, SurviveAnyLength) {
  ExpectNoSurpriseAfterAnyLength(State(1));
  ExpectNoSurpriseAfterAnyLength(About());
  ExpectNoSurpriseAfterAnyLength(Truth());
}

TEST(ViewMessages, HaveStatesAndFaultsThatThereAre) {
  state_t read{};
  for (const int wrong : {-1, 8, 127, -128}) {
    state_t state = State(1);
    state.state = static_cast<std::int8_t>(wrong);
    EXPECT_FALSE(ReadMessage(Bytes(state), read));
  }
  for (const int wrong : {-1, 20, 127}) {
    state_t state = State(1);
    state.faults = 1;
    state.fault = static_cast<std::int8_t>(wrong);
    EXPECT_FALSE(ReadMessage(Bytes(state), read));
  }
}

TEST(ViewedRun, HasTheErrorToTheSetpointThatAMeasurementAnswers) {
  ViewedRun run(nullptr);
  EXPECT_TRUE(run.Frame().is_null());
  run.Take(About());
  state_t state = State(10);
  state.joints[0].limited_position_rad = 0.5F;
  run.Take(state);
  EXPECT_TRUE(run.Frame()["joints"][0]["following_error_rad"].is_null()) << "nothing was asked for";
  state = State(11);
  state.joints[0].limited_position_rad = 2;
  state.joints[0].measured_position_rad = 0.75F;
  state.joints[1].reply_age_ticks = -1;
  run.Take(state);
  const Json frame = run.Frame();
  EXPECT_EQ(frame["joints"][0]["following_error_rad"].number(), 0.25);
  EXPECT_EQ(frame["joints"][0]["name"].text(), "left");
  EXPECT_TRUE(frame["joints"][1]["following_error_rad"].is_null()) << "nothing was measured";
  run.Forget();
  EXPECT_TRUE(run.Frame().is_null());
}

TEST(ViewedRun, ShowsNumbersThatAreNotFiniteAsNone) {
  ViewedRun run(nullptr);
  state_t state = State(1);
  state.joints[0].measured_position_rad = std::numeric_limits<float>::quiet_NaN();
  state.primitive_time_s = std::numeric_limits<float>::infinity();
  run.Take(state);
  const auto shown = Json::Parse(run.Frame().Dump(-1));
  ASSERT_TRUE(shown);
  EXPECT_TRUE((*shown)["joints"][0]["measured_rad"].is_null());
  EXPECT_TRUE((*shown)["primitive_time_s"].is_null());
}

TEST(ViewedRun, KeepsTheLastEventsOnly) {
  ViewedRun run(nullptr);
  event_t event{};
  for (int i = 0; i < 1000; ++i) {
    event.time_ns = i * 1'000'000'000LL;
    run.Take(event);
  }
  EXPECT_EQ(run.Events().size(), 40U);
  EXPECT_DOUBLE_EQ(run.Events()[39]["time_s"].number(), 999);
}

TEST(ViewedRobot, StandsWhereTheSimulationHasItOrElseThePlan) {
  ViewedRobot robot(LoadMotion(testing::SourcePath("primitives/nominal/gait.toml")));
  EXPECT_EQ(robot.Scene()["links"].size(), 3U);
  EXPECT_TRUE(robot.Poses().is_null()) << "before the first state";
  state_t state = State(1);
  state.primitive_time_s = 0.5F;
  state.joints[0].measured_position_rad = 0.25F;
  robot.Take(state);
  EXPECT_FALSE(robot.RootIsTrue());
  const Json planned = robot.Poses();
  ASSERT_EQ(planned.size(), 3U);
  RobotPaths paths(LoadMotion(testing::SourcePath("primitives/nominal/gait.toml")));
  const ReportSample plan = paths.PlanAt(0, 0.5);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(planned[0][c].number(), plan.link_poses[0][c], 1e-4);
  }

  truth_t truth{};
  truth.root_x_m = 3;
  truth.root_z_m = 1;
  truth.root_pitch_rad = 0.5;
  robot.Take(truth);
  EXPECT_TRUE(robot.RootIsTrue());
  EXPECT_EQ(robot.Poses()[0], Json::Array({3.0, 1.0, 0.5}));
  truth.root_x_m = std::numeric_limits<double>::quiet_NaN();
  robot.Take(truth);
  EXPECT_EQ(robot.Poses()[0], Json::Array({3.0, 1.0, 0.5})) << "no place";
  for (int i = 0; i < 501; ++i) robot.Take(state);
  EXPECT_FALSE(robot.RootIsTrue()) << "not told for long";
  EXPECT_EQ(robot.Poses(), planned);

  state.joints[1].measured_position_rad = std::numeric_limits<float>::quiet_NaN();
  robot.Take(state);
  EXPECT_TRUE(robot.Poses().is_null());
  state.joints[1].measured_position_rad = 0;
  state.joints[1].reply_age_ticks = -1;
  robot.Take(state);
  EXPECT_TRUE(robot.Poses().is_null()) << "never measured";
  robot.Take(State(2));
  EXPECT_FALSE(robot.Poses().is_null());
  state.joints.resize(3);
  robot.Take(state);
  EXPECT_TRUE(robot.Poses().is_null()) << "another robot";
}

}  // namespace
}  // namespace tumbler
