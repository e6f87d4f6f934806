// What tumbler view makes of telemetry.

#include "offline/pages/viewed_run.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/files/sequence_toml.h"
#include "offline/pages/robot_paths.h"
#include "offline/pages/viewed_robot.h"
#include "tests/support/files.h"
#include "tests/support/telemetry_messages.h"

namespace tumbler {
namespace {

using testing::About;
using testing::State;

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
