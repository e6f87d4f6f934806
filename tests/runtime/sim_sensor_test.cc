// The simulated robot with an inertial sensor, as a user meets it.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/problem/link_chains.h"
#include "offline/twin/simulated_robot.h"
#include "runtime/assembly/assembly.h"
#include "runtime/assembly/clock.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/run/control_loop.h"
#include "tests/runtime/sim_twin.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const std::string kSensorDrives =
    testing::ReadFile(kPrimitives + "robots/tumbler_drives.toml") +
    "\n[sensor]\nprotocol = \"xsens-mti\"\nlink = \"middle\"\ntime_rate_hz = 100\n";

/// The robust handstand with a weak feedback on leg 2, whose plan is what the twin does.
std::string HandstandWithFeedback() {
  PrimitiveFile file = LoadPrimitive(kPrimitives + "handstand.toml");
  const std::string motion = kPrimitives + "handstand.toml";
  RunParts parts = LoadRunMotion(motion);
  parts.drives =
      LoadDrivesOf(JointsOf(parts.file), kPrimitives + "robots/tumbler_drives.toml", ReadTextFile);
  const DrivesConfig drives = parts.drives;
  const SimulatedMotion simulated(parts.file);
  SimulatedRobot robot(simulated, drives, {});
  Assembly assembly(std::move(parts));
  EXPECT_EQ(assembly.Configure(ExecutorConfigOf({}, drives)), Status::kOk);
  SimulatedPort& host = robot.bus().Attach();
  VirtualClock clock([&robot](std::int64_t time_ns) { robot.AdvanceTo(time_ns); });
  RunProcedure procedure(ProcedureConfigOf({}, drives, assembly.parts().sequence->graph));
  OperatorMailbox mailbox;
  ControlLoop loop({assembly.executor(), host, clock, procedure, mailbox}, 1'000'000, 0);
  std::vector<double> angles;
  while (loop.Step()) {
    if (loop.record().state != ExecutorState::kRunning) continue;
    const TwinState& truth = robot.state();
    angles.push_back(truth.root_pitch_rad + truth.joint_positions_rad[1]);
  }
  Feedback<double>& feedback = file.primitive.feedback;
  feedback.link = FixedString<32>("leg2_link");
  feedback.knot_count = 3;
  feedback.knots_s = {0, 0.4, file.primitive.duration_s};
  const auto& torque = file.primitive.joints[0].torque;
  std::vector<double> points;
  const int degree = torque.degree();
  for (std::size_t i = 0; i < torque.control_points().size(); ++i) {
    double time_s = 0;  // where this control point has its greatest weight
    for (int k = 1; k <= degree; ++k)
      time_s += torque.knots()[i + static_cast<std::size_t>(k)] / degree;
    const auto tick = static_cast<std::size_t>(time_s * 1000);
    points.push_back(angles[std::min(tick, angles.size() - 1)]);
  }
  EXPECT_EQ(feedback.angle.Assign(degree, torque.knots(), points), Status::kOk);
  feedback.error_max_rad = 0.6;
  feedback.start_error_max_rad = 0.2;
  feedback.fade_in_s = 0.05;
  feedback.fade_out_s = 0.05;
  file.chains = LinkChainsOf(simulated.scene().robot);
  for (std::size_t j = 0; j < 2; ++j) {
    JointFeedback<double>& joint = feedback.joints[j];
    joint.chain = j == 1 ? 1 : 0;
    joint.angle_gain = {0, 0.1, 0.1};
    joint.rate_gain = {0, 0.005, 0.005};
    joint.correction_max_rad = 0.2;
    joint.correction_rate_max_rad_s = 5;
  }
  return ToToml(file);
}

/// Plays it with noise of 5 mrad and 20 mrad/s, 10 mrad of bias and 1 ms of delay.
struct SensorRun {
  int exit_code = 0;
  std::string text;
  std::vector<std::vector<std::string>> rows;  ///< Of the trace.
  std::vector<std::string> header;
  [[nodiscard]] double At(std::size_t row, const std::string& column) const {
    const auto found = std::find(header.begin(), header.end(), column);
    if (found == header.end()) throw std::logic_error(column);
    return std::stod(rows[row][static_cast<std::size_t>(found - header.begin())]);
  }
  [[nodiscard]] double Largest(const std::string& column) const {
    double largest = 0;
    for (std::size_t row = 0; row < rows.size(); ++row)
      largest = std::max(largest, std::abs(At(row, column)));
    return largest;
  }
};

constexpr const char* kNoise =
    "[sensor]\nnoise_rad = 0.005\nrate_noise_rad_s = 0.02\nbias_rad = 0.01\ndelay_s = 0.001\n";

std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

SensorRun PlayWithSensor(const std::filesystem::path& folder, const std::string& twin) {
  testing::WriteFile(folder / "handstand.toml", HandstandWithFeedback());
  testing::WriteFile(folder / "drives.toml", kSensorDrives);
  testing::WriteFile(folder / "twin.toml", kHead + twin);
  std::filesystem::remove(folder / "run.rec");
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler run", "sim", folder / "handstand.toml", "--drives",
                           folder / "drives.toml", "--twin", folder / "twin.toml", "--csv",
                           folder / "run.csv", "--record", folder / "run.rec"});
  SensorRun run{outcome.exit_code, outcome.text, {}, {}};
  std::istringstream csv(testing::ReadFile(folder / "run.csv"));
  std::string line;
  std::getline(csv, line);
  run.header = Cells(line);
  while (std::getline(csv, line)) run.rows.push_back(Cells(line));
  return run;
}

TEST_F(SimTwin, AMotionWithFeedbackIsPlayedBySensorAndEncodersAndReplayedBitForBit) {
  const std::filesystem::path folder = std::filesystem::path(Path("x")).parent_path();
  const SensorRun run = PlayWithSensor(folder, kNoise);
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_EQ(run.Largest("feedback_share"), 1);
  EXPECT_LT(run.Largest("feedback_error_rad"), 0.2) << "the plan is what the twin does";
  EXPECT_GT(run.Largest("leg1_correction_rad"), 0.001);
  EXPECT_GT(run.Largest("leg2_correction_rad"), 0.001);
  EXPECT_EQ(run.At(run.rows.size() - 1, "sensor_status"), 1);
  const testing::Outcome replay = testing::RunProgram({"tumbler replay", folder / "run.rec"});
  EXPECT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_THAT(replay.text, HasSubstr("identical"));
}

TEST_F(SimTwin, EveryFailureOfTheSensorIsSeenAndTheMotionGoesOn) {
  const std::filesystem::path folder = std::filesystem::path(Path("x")).parent_path();
  const std::vector<std::pair<std::string, double>> failures = {
      {"silent", 3}, {"frozen", 5}, {"offset", 9}, {"swapped-axis", 9}, {"late", 4}};
  for (const auto& [fault, status] : failures) {
    const SensorRun run =
        PlayWithSensor(folder, std::string(kNoise) + "[[sensor_failure]]\nfault = \"" + fault +
                                   "\"\nstart_s = 0.3\nsince = \"start\"\noffset_rad = 0.3\n");
    EXPECT_EQ(run.exit_code, 0) << fault << run.text;
    EXPECT_EQ(run.At(run.rows.size() - 1, "sensor_status"), status) << fault;
    EXPECT_EQ(run.At(run.rows.size() - 1, "feedback_share"), 0) << fault;
  }
}

// Its gains are those that a wrong angle before the jump would fell the robot with.
TEST_F(SimTwin, TheShippedHandstandStandsWhenItsSensorsAxesAreExchangedOrItFreezesBeforeTheJump) {
  const std::string errors = testing::ReadFile(kPrimitives + "robots/tumbler_twin_sensor.toml");
  for (const char* fault : {"swapped-axis", "frozen"}) {
    for (const char* start_s : {"0.1", "0.15", "0.2", "0.25", "0.3", "0.4", "0.5"}) {
      const std::string twin = Write("twin.toml", errors + "[[sensor_failure]]\nfault = \"" +
                                                      fault + "\"\nstart_s = " + start_s + "\n");
      const testing::Outcome outcome = testing::RunProgram(
          {"tumbler run", "sim", kPrimitives + "handstand_sensor.toml", "--drives",
           kPrimitives + "robots/tumbler_drives_sensor.toml", "--twin", twin});
      EXPECT_EQ(outcome.exit_code, 0) << fault << " at " << start_s << outcome.text;
    }
  }
}

// Pushed over in its second handstand. Only the simulation knows of the push.
constexpr const char* kPushedOverLater =
    "[[push]]\nlink = \"middle\"\nstart_s = 9.5\nduration_s = 0.2\nforce_n = [25.0, 0.0]\n";

TEST_F(SimTwin, ARobotThatIsPushedOverGetsUpFinishesItsCyclesAndIsReplayedBitForBit) {
  const std::string sensor = testing::ReadFile(kPrimitives + "robots/tumbler_twin_sensor.toml");
  const std::string twin = Write("twin.toml", sensor + kPushedOverLater);
  const auto run = [&](const std::string& get_ups) {
    std::filesystem::remove(Path("run.json"));
    std::filesystem::remove(Path("run.rec"));
    const testing::Outcome outcome = testing::RunProgram(
        {"tumbler run", "sim", kPrimitives + "gait_sensor.toml", "--cycles", "2", "--drives",
         kPrimitives + "robots/tumbler_drives_sensor.toml", "--twin", twin, "--get-ups", get_ups,
         "--json", Path("run.json"), "--record", Path("run.rec")});
    EXPECT_EQ(outcome.exit_code, get_ups == "0" ? 3 : 4) << outcome.text;
    const testing::Outcome replay = testing::RunProgram({"tumbler replay", Path("run.rec")});
    EXPECT_THAT(replay.text, HasSubstr("identical"));
    return Outcome{outcome, Json::Parse(testing::ReadFile(Path("run.json"))).value()};
  };
  const Outcome falls = run("0");
  EXPECT_EQ(falls.json["outcome"].text(), "fault");
  EXPECT_THAT(falls.json["reason"].text(), HasSubstr("fallen: "));
  EXPECT_EQ(falls.json["cycles"].integer(), 1);
  EXPECT_EQ(falls.json["sensor"]["get_ups"].integer(), 0);

  const Outcome gets_up = run("1");
  EXPECT_EQ(gets_up.json["outcome"].text(), "completed") << gets_up.text;
  EXPECT_EQ(gets_up.json["cycles"].integer(), 2);
  EXPECT_EQ(gets_up.json["sensor"]["get_ups"].integer(), 1);
  EXPECT_EQ(gets_up.json["falls"].size(), 1U);
  EXPECT_EQ(gets_up.json["as_planned_2_s_later"], true) << "of the last motion";
  EXPECT_THAT(gets_up.text,
              HasSubstr("by its sensor the robot fell, and began to get up: 1 time\n"));
}

TEST_F(SimTwin, ARobotThatFallsIntoAPoseOfItsMotionsAndGetsUpIsNotSaidToHaveDoneWell) {
  // In its handstand it is pushed onto its back, where a motion begins. Only its sensor tells of
  // it.
  const std::string twin = Write(
      "twin.toml", testing::ReadFile(kPrimitives + "robots/tumbler_twin_sensor.toml") +
                       "[[push]]\nlink = \"middle\"\nstart_s = 3.0\nduration_s = 0.2\nforce_n "
                       "= [-40.0, 0.0]\n");
  const testing::Outcome run =
      testing::RunProgram({"tumbler run", "sim", kPrimitives + "gait_sensor.toml", "--cycles", "2",
                           "--drives", kPrimitives + "robots/tumbler_drives_sensor.toml", "--twin",
                           twin, "--get-ups", "1", "--json", Path("run.json")});
  const Json json = Json::Parse(testing::ReadFile(Path("run.json"))).value();
  EXPECT_EQ(json["outcome"].text(), "completed");
  EXPECT_EQ(json["falls"].size(), 0U);
  EXPECT_EQ(json["sensor"]["get_ups"].integer(), 1);
  EXPECT_EQ(run.exit_code, 4) << run.text;
  EXPECT_EQ(json["exit_code"].integer(), 4);
  EXPECT_THAT(run.text, HasSubstr("NOT where it should be after 1 ('handstand' before 'rise')"));
  EXPECT_THAT(run.text, Not(HasSubstr("where it should be after each")));
}

TEST_F(SimTwin, NobodyGetsUpWhoCannotTellHowItLies) {
  const auto refused = [&](const std::string& motion, const std::string& drives) {
    const testing::Outcome run =
        testing::RunProgram({"tumbler run", "sim", kPrimitives + motion, "--drives",
                             kPrimitives + "robots/" + drives, "--get-ups", "1"});
    EXPECT_EQ(run.exit_code, 1) << run.text;
    EXPECT_THAT(run.text, HasSubstr("--get-ups"));
    return run.text;
  };
  EXPECT_THAT(refused("get_up.toml", "tumbler_drives.toml"), HasSubstr("[sensor]"));
  EXPECT_THAT(refused("handstand_sensor.toml", "tumbler_drives_sensor.toml"), HasSubstr("[begin]"));
}

TEST_F(SimTwin, ASensorOnALinkThatNoPrimitiveKnowsIsRefused) {
  const std::string motion = Write("handstand.toml", HandstandWithFeedback());
  const std::string drives =
      Write("drives.toml", testing::Replaced(kSensorDrives, "link = \"middle\"", "link = \"hat\""));
  const testing::Outcome run =
      testing::RunProgram({"tumbler run", "sim", motion, "--drives", drives});
  EXPECT_NE(run.exit_code, 0);
  EXPECT_THAT(run.text, HasSubstr("'hat'"));
}

}  // namespace
}  // namespace tumbler
