// Twin files: their content, and the messages about wrong ones.

#include "offline/twin/twin_toml.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <string>

#include "common/files/toml_reader.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"
#include "tests/support/nominal_gait.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using testing::Gait;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const std::string kShipped = testing::SourcePath("primitives/robots/tumbler_twin.toml");
const std::string kHead = "format = \"tumbler-twin\"\nversion = 1\n";

SimulatedRobotConfig Parse(const std::string& text) {
  return ParseTwin(kHead + text, "twin.toml", Gait());
}
std::string ErrorOf(const std::string& text) {
  try {
    ParseTwin(text, "twin.toml", Gait());
  } catch (const FileError& error) {
    return error.what();
  }
  return "no error";
}

TEST(TwinToml, TheShippedFileIsTheDefaultsWrittenOut) {
  const SimulatedRobotConfig shipped = LoadTwin(kShipped, Gait());
  const SimulatedRobotConfig none = Parse("");
  EXPECT_EQ(shipped.twin.step_ns, none.twin.step_ns);
  EXPECT_EQ(shipped.twin.held, none.twin.held);
  EXPECT_EQ(shipped.twin.stop_stiffness_nm_per_rad, none.twin.stop_stiffness_nm_per_rad);
  EXPECT_EQ(shipped.twin.stop_damping_nm_s_per_rad, none.twin.stop_damping_nm_s_per_rad);
  EXPECT_EQ(shipped.start->root_z_m, StartOf(Gait().file()).root_z_m);
  EXPECT_EQ(shipped.start->joint_positions_rad, StartOf(Gait().file()).joint_positions_rad);
  ASSERT_EQ(shipped.motors.size(), 2U);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_EQ(shipped.motors[j].torque_max_nm, 8);
    EXPECT_EQ(shipped.motors[j].encoder_counts_per_turn, none.motors[j].encoder_counts_per_turn);
    EXPECT_EQ(shipped.motors[j].answer_delay_s, none.motors[j].answer_delay_s);
    EXPECT_EQ(shipped.motors[j].torque_time_constant_s, 0);
    EXPECT_FALSE(none.motors[j].torque_time_constant_s) << "that of the drives file, which is 0";
    EXPECT_EQ(shipped.motors[j].ambient_c, none.motors[j].ambient_c);
    EXPECT_EQ(shipped.motors[j].heating_k_per_nm2, none.motors[j].heating_k_per_nm2);
    EXPECT_EQ(shipped.motors[j].thermal_time_constant_s, none.motors[j].thermal_time_constant_s);
    EXPECT_EQ(shipped.motors[j].base_speed_rad_s, none.motors[j].base_speed_rad_s);
    EXPECT_EQ(shipped.twin.joints[j].viscous_friction_nm_s_per_rad,
              kUsualViscousFriction_nm_s_per_rad);
    EXPECT_FALSE(none.twin.joints[j].viscous_friction_nm_s_per_rad) << "the task's, or as usual";
    EXPECT_EQ(shipped.twin.joints[j].dry_friction_nm, 0);
    EXPECT_EQ(shipped.twin.joints[j].rotor_inertia_kg_m2, 0.001) << "the tasks'";
  }
  const TwinSources sources = ReadTwinSources(kShipped);
  EXPECT_EQ(sources.motion, testing::SourcePath("primitives/robots/../gait.toml"));
  EXPECT_EQ(sources.drives, testing::SourcePath("primitives/robots/tumbler_drives.toml"));
}

/// Takes the suggestions at the end of the shipped file, which are comments, as part of it.
TEST(TwinToml, TheShippedFilesSuggestionsAreValid) {
  std::ifstream stream(kShipped);
  std::string text, line;
  bool suggestions = false;
  while (std::getline(stream, line)) {
    if (suggestions && line.starts_with("#")) line.erase(0, std::min<std::size_t>(2, line.size()));
    if (line.find("Some to try") != std::string::npos) suggestions = true;
    text += line + "\n";
  }
  const SimulatedRobotConfig config = ParseTwin(text, "twin.toml", Gait());
  EXPECT_EQ(config.twin.contact->mu, 0.25);
  EXPECT_EQ(config.twin.contact->stiffness_n_per_m, 2.5e4) << "the tasks'";
  ASSERT_EQ(config.twin.obstacles.size(), 1U);
  EXPECT_EQ(config.twin.obstacles[0].name, "plank");
  ASSERT_EQ(config.twin.patches.size(), 2U);
  EXPECT_EQ(config.twin.patches[0].obstacle, "plank");
  EXPECT_TRUE(std::isinf(config.twin.patches[0].from_x_m));
  EXPECT_EQ(config.twin.patches[1].mu, 0.05);
  EXPECT_EQ(config.twin.patches[1].to_x_m, -0.1);
  ASSERT_EQ(config.twin.pushes.size(), 1U);
  EXPECT_TRUE(config.twin.pushes[0].since_enabled);
  EXPECT_EQ(config.twin.pushes[0].force_n[0], 10);
}

TEST(TwinToml, AJointsOwnMotorGoesBeforeThatOfAll) {
  const SimulatedRobotConfig config = Parse(
      "[motor]\ntorque_max_nm = 5.0\ndry_friction_nm = 0.1\n[motor.leg2]\ntorque_max_nm = 3.0\n"
      "base_speed_rad_s = 10.0\nno_load_speed_rad_s = 20.0\n");
  EXPECT_EQ(config.motors[0].torque_max_nm, 5);
  EXPECT_EQ(config.motors[1].torque_max_nm, 3);
  EXPECT_EQ(config.twin.joints[1].dry_friction_nm, 0.1);
  EXPECT_FALSE(config.motors[0].base_speed_rad_s) << "the task's";
  EXPECT_EQ(config.motors[1].no_load_speed_rad_s, 20);
}

TEST(TwinToml, ARobotThatStartsOtherwiseIsLoweredOnTheGround) {
  const SimulatedRobotConfig config =
      Parse("[start]\nx_m = 0.3\npitch_rad = 1.6\njoints_rad = { leg1 = 0.0, leg2 = 0.0 }\n");
  EXPECT_NEAR(config.start->root_z_m, 0.374, 0.002);
  EXPECT_NEAR(config.start->root_pitch_rad, M_PI / 2, 0.01) << "it came to rest";
  EXPECT_NEAR(config.start->root_x_m, 0.3, 0.02);
  const SimulatedRobotConfig aloft = Parse("[start]\nz_m = 2.0\npitch_rad = 1.0\nheld = false\n");
  EXPECT_EQ(aloft.start->root_z_m, 2);
  EXPECT_EQ(aloft.start->root_pitch_rad, 1);
  EXPECT_FALSE(aloft.twin.held);
  EXPECT_EQ(aloft.start->joint_positions_rad, StartOf(Gait().file()).joint_positions_rad);
}

TEST(TwinToml, TheSlipSpeedOfContactHasTheRangeThatItHasInATask) {
  EXPECT_EQ(Parse("[contact]\nv_max_m_per_s = 2000.0\n").twin.contact->v_max_m_per_s, 2000);
  EXPECT_THAT(ErrorOf(kHead + "[contact]\nv_max_m_per_s = 0.0\n"),
              HasSubstr("contact.v_max_m_per_s: is 0; allowed: >= 1e-06"));
}

TEST(TwinToml, AWrongFileIsRefusedWithFileLineKeyValueAndWhatIsAllowed) {
  const struct {
    const char* text;  ///< Follows the two lines of the head.
    const char* line;
    const char* key;
    const char* value;
    const char* allowed;
  } cases[] = {
      {"step_s = 0.1\n", "3", "step_s", "0.1", "1e-06 ... 0.001"},
      {"stepp_s = 1e-5\n", "3", "stepp_s", "not a key", "did you mean 'step_s'"},
      {"motion = 3\n", "3", "motion", "3", "string"},
      {"robot = \"\"\n", "3", "robot", "''", "a file's name"},
      {"drives = \"\"\n", "3", "drives", "''", "a file's name"},
      {"[motor]\ntorque_max_nm = -1.0\n", "4", "motor.torque_max_nm", "-1", "0.001 ... 10000"},
      {"[motor]\ntorque_max = 1.0\n", "4", "motor.torque_max", "not a key",
       "did you mean 'torque_max_nm'"},
      {"[motor.leg3]\ntorque_max_nm = 1.0\n", "3", "motor.leg3", "leg3", "leg1, leg2"},
      {"[motor]\ndry_friction_nm = 9.0\n", "4", "motor.dry_friction_nm", "9", "0 ... 5"},
      {"[motor]\nthermal_time_constant_s = 0.0\n", "4", "motor.thermal_time_constant_s", "0",
       "0.1 ... 100000"},
      {"[motor]\nencoder_counts_per_turn = 1.5\n", "4", "motor.encoder_counts_per_turn",
       "is a number", "an integer; allowed: from 0"},
      {"[motor]\nbase_speed_rad_s = 5.0\n", "4", "motor.base_speed_rad_s", "5", "both or neither"},
      {"[motor.leg1]\nbase_speed_rad_s = 5.0\nno_load_speed_rad_s = 4.0\n", "5",
       "motor.leg1.no_load_speed_rad_s", "4", "the second above the first"},
      {"[start]\nheld = 1\n", "4", "start.held", "an integer", "true or false"},
      {"[start]\nx_m = 1e9\n", "4", "start.x_m", "1e+09", "-1000 ... 1000"},
      {"[start]\njoints_rad = { leg4 = 0.0 }\n", "4", "start.joints_rad.leg4", "leg4",
       "leg1, leg2"},
      {"[start]\npitch = 1.0\n", "4", "start.pitch", "not a key", "did you mean 'pitch_rad'"},
      {"[mass_factor]\ntail = 2.0\n", "4", "mass_factor.tail", "tail",
       "middle, leg1_link, leg2_link"},
      {"[mass_factor]\nmiddle = 0.0\n", "4", "mass_factor.middle", "0", "0.1 ... 10"},
      {"[contact]\nmu = -0.1\n", "4", "contact.mu", "-0.1", "0 ... 10"},
      {"[[obstacle]]\nname = \"ground\"\npoint_m = [0, 0]\nnormal = [0, 1]\n", "4", "name",
       "ground", "a name besides ground"},
      {"[[obstacle]]\nname = \"wall\"\nkind = \"cone\"\n", "5", "kind", "cone", "half-space"},
      {"[[obstacle]]\nname = \"a\"\npoint_m = [0, 0]\nnormal = [0, 1]\nmu = 11\n", "7", "mu", "11",
       "0 ... 10"},
      {"[[patch]]\nobstacle = \"lake\"\nmu = 0.1\nfrom_x_m = 0\nto_x_m = 1\n", "4", "obstacle",
       "lake", "ground"},
      {"[[patch]]\nobstacle = \"ground\"\nmu = 0.1\nfrom_x_m = 2\nto_x_m = 1\n", "7", "to_x_m", "1",
       "2"},
      {"[[push]]\nlink = \"arm\"\n", "4", "link", "arm", "middle, leg1_link, leg2_link"},
      {"[[push]]\nlink = \"middle\"\nstart_s = 1\nduration_s = 0\nforce_n = [1, 0]\n", "6",
       "duration_s", "is 0", "above 0"},
      {"[[push]]\nlink = \"middle\"\nstart_s = 1\nduration_s = 1\nforce_n = [1]\n", "7", "force_n",
       "1", "2"},
      {"[[push]]\nlink = \"middle\"\nsince = \"noon\"\nstart_s = 1\nduration_s = 1\nforce_n = [1, "
       "0]\n",
       "5", "since", "noon", "start"},
      {"[stop]\nstiffness_nm_per_rad = -5\n", "4", "stop.stiffness_nm_per_rad", "-5",
       "0 ... 10000"},
      {"[fall]\nclear_links = [\"head\"]\n", "4", "fall.clear_links", "head",
       "middle, leg1_link, leg2_link"},
      {"[fall]\nrest_s = 0\n", "4", "fall.rest_s", "0", "0.01 ... 10"},
  };
  for (const auto& bad : cases) {
    const std::string error = ErrorOf(kHead + bad.text);
    EXPECT_THAT(error, AllOf(StartsWith(std::string("twin.toml:") + bad.line + ": "),
                             HasSubstr(bad.key), HasSubstr(bad.value), HasSubstr(bad.allowed)))
        << bad.text;
  }
  EXPECT_THAT(ErrorOf("format = \"tumbler-task\"\nversion = 1\n"),
              HasSubstr("twin.toml:1: format: is 'tumbler-task'; allowed: 'tumbler-twin'"));
  EXPECT_THAT(ErrorOf("format = \"tumbler-twin\"\nversion = 2\n"),
              HasSubstr("twin.toml:2: version"));
}

TEST(TwinToml, AStartThatComesToNoRestIsNamedWithItsLine) {
  // At any height, the robot is in the ground or in the lid.
  const std::string text = kHead +
                           "[start]\npitch_rad = 1.5\n[[obstacle]]\nname = \"lid\"\n"
                           "point_m = [0, 5]\nnormal = [0, -1]\n";
  EXPECT_THAT(ErrorOf(text),
              AllOf(StartsWith("twin.toml:3: start: "), HasSubstr("'lid'"), HasSubstr("give z_m")));
}

TEST(TwinToml, ARobotThatBeginsInsideAnObstacleIsRefusedByNameAndDepth) {
  const auto refusal = [](const std::string& rest) -> std::string {
    try {
      Parse(rest);
    } catch (const FileError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(
      refusal("[start]\nz_m = 0.05\n"),
      AllOf(StartsWith("twin.toml:3: start: collision shape "), HasSubstr("inside 'ground'")));
  EXPECT_THAT(refusal("[[obstacle]]\nname = \"wall\"\npoint_m = [-0.1, 0.0]\n"
                      "normal = [-1.0, 0.0]\n"),
              HasSubstr("inside 'wall'"));
  EXPECT_EQ(refusal("[start]\nz_m = 2.0\n"), "accepted");
  EXPECT_EQ(refusal("[start]\nstand_m = 0.3\n"), "accepted");
}

TEST(TwinToml, TheTablesOfTheDocumentAreThoseOfTheCode) {
  testing::ExpectTables("docs/formats.md", TwinKeyTables());
  testing::ExpectTables("docs/space.md", SpaceTwinKeyTables());
}

}  // namespace
}  // namespace tumbler
