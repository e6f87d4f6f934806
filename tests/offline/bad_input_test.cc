// Every mistake that a task, a robot or a command line can hold ends the program with a message
// that names file, line, key and what is allowed, and with nothing written.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <regex>
#include <string>
#include <vector>

#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using testing::LineOf;
using testing::Program;
using testing::Replaced;
using testing::ShippedRobot;
using testing::ShippedTask;
using testing::TaskFolder;

const char* const kProgram = TUMBLER_BINARY_DIR "/bin/tumbler-optimize";

enum class File { kTask, kRobot };

/// One mistake in the shipped files, and what the message must say of it.
struct Mistake {
  std::string name;
  File file = File::kTask;
  std::string from, to;  ///< The first `from` after `after` becomes `to`.
  std::vector<std::string> says;
  std::string at = {};     ///< The line that is named holds this; by default that of `to`.
  std::string after = {};  ///< Where to look for `from`.
};

void PrintTo(const Mistake& mistake, std::ostream* stream) { *stream << mistake.name; }

class BadInput : public ::testing::TestWithParam<Mistake> {};

void ExpectRefused(const std::string& task, const std::string& robot, const std::string& place,
                   const std::vector<std::string>& says) {
  const TaskFolder folder(task, robot);
  const auto before = folder.Listing();
  Program program({kProgram, folder.task_file(), "--out", folder / "motion.toml", "--report",
                   folder / "report", "--json", folder / "figures.json"});
  EXPECT_EQ(program.Wait(), 1) << program.text();
  EXPECT_THAT(program.text(), HasSubstr(place));
  for (const std::string& part : says) EXPECT_THAT(program.text(), HasSubstr(part));
  EXPECT_EQ(folder.Listing(), before) << "files were left behind";
}

TEST_P(BadInput, IsNamedByFileAndLineAndChangesNothing) {
  const Mistake& mistake = GetParam();
  const bool in_task = mistake.file == File::kTask;
  const std::string text =
      Replaced(in_task ? ShippedTask() : ShippedRobot(), mistake.from, mistake.to, mistake.after);
  const int line = LineOf(text, mistake.at.empty() ? mistake.to : mistake.at);
  ExpectRefused(in_task ? text : ShippedTask(), in_task ? ShippedRobot() : text,
                (in_task ? "task.toml:" : "tumbler.urdf:") + std::to_string(line) + ": ",
                mistake.says);
}

const std::vector<Mistake> kTaskMistakes = {
    {"NotToml", File::kTask, "degree = 5", "degree = = 5", {"not valid TOML"}},
    {"UnclosedTable", File::kTask, "[spline]", "[spline", {"not valid TOML"}},
    {"KeyTwice",
     File::kTask,
     "degree = 5",
     "degree = 5\ndegree = 4",
     {"not valid TOML"},
     "degree = 4"},
    {"WrongFormat",
     File::kTask,
     "tumbler-task",
     "tumbler-drives",
     {"format: allowed: \"tumbler-task\""}},
    {"NewerVersion",
     File::kTask,
     "version = 1",
     "version = 2",
     {"version: is 2; this program reads tasks up to version 1"}},
    {"VersionZero", File::kTask, "version = 1", "version = 0", {"version: is 0"}},
    {"VersionIsText",
     File::kTask,
     "version = 1",
     "version = \"1\"",
     {"is a string; expected an integer"}},
    {"EmptyName",
     File::kTask,
     "name = \"handstand\"",
     "name = \"\"",
     {"name: ", "1 ... 48 characters"}},
    {"LongName",
     File::kTask,
     "\"handstand\"",
     "\"" + std::string(49, 'h') + "\"",
     {"name: ", "1 ... 48 characters"}},
    {"MissingRobot",
     File::kTask,
     "tumbler.urdf",
     "stumbler.urdf",
     {"robot: '../robots/stumbler.urdf' does not exist"}},
    {"UnknownRoot",
     File::kTask,
     "planar-xz",
     "floating",
     {"root: is 'floating'; allowed: planar-xz, fixed"}},
    {"UnknownKeyAtTheTop",
     File::kTask,
     "settle_s = 0.3",
     "setle_s = 0.3",
     {"setle_s: is not a key"}},
    {"UnknownKeyInATable", File::kTask, "degree = 5", "degre = 5", {"spline.degre: is not a key"}},
    {"UnknownKeyInAnArrayOfTables",
     File::kTask,
     "when = \"settled\"",
     "wen = \"settled\"",
     {"cost[0].wen: is not a key"}},
    {"UnknownTable", File::kTask, "[spline]", "[splines]", {"splines: is not a key"}},
    {"LimitsOfAnUnknownJoint",
     File::kTask,
     "[[cost]]",
     "[limits.leg3]\ntorque_max_nm = 1.0\n[[cost]]",
     {"limits.leg3: is not a key"},
     "[limits.leg3]"},
    {"DurationMissing",
     File::kTask,
     "duration_s = 1.2",
     "",
     {"duration_s: is missing"},
     "# From standing"},
    {"DurationZero",
     File::kTask,
     "duration_s = 1.2",
     "duration_s = 0.0",
     {"duration_s: is 0; allowed: from 0.05 ... 20"}},
    {"DurationNegative",
     File::kTask,
     "duration_s = 1.2",
     "duration_s = -1.2",
     {"duration_s: is -1.2; allowed: from 0.05 ... 20"}},
    {"DurationIsText",
     File::kTask,
     "duration_s = 1.2",
     "duration_s = \"1.2\"",
     {"is a string; expected a number"}},
    {"SettleNegative", File::kTask, "settle_s = 0.3", "settle_s = -0.3", {"settle_s: is -0.3"}},
    {"NotAJointOfTheRobot",
     File::kTask,
     "leg2 = 1.57",
     "leg3 = 1.57",
     {"start.joints_rad.leg3: is not a joint of the robot; its joints: leg1, leg2"}},
    {"StartOfAJointMissing",
     File::kTask,
     ", leg2 = 1.5707963267948966",
     "",
     {"start.joints_rad: lacks the joint 'leg2'"},
     "leg1 = -1.57"},
    {"EndOfAJointMissing",
     File::kTask,
     ", leg2 = 0.0",
     "",
     {"end.joints_rad.leg2: is missing"},
     "leg1 = 0.0"},
    {"EndOfAnUnknownJoint",
     File::kTask,
     "leg2 = 0.0",
     "leg2 = 0.0, leg3 = 0.0",
     {"end.joints_rad.leg3: is not a joint of the robot"}},
    {"StartOutsideLimits",
     File::kTask,
     "leg1 = -1.5707963267948966",
     "leg1 = -3.0",
     {"start.joints_rad.leg1: is -3; allowed: from -2.9 ... 2.9"}},
    {"EndOutsideLimits",
     File::kTask,
     "leg2 = 0.0",
     "leg2 = 2.91",
     {"end.joints_rad.leg2: is 2.91; allowed: from -2.9 ... 2.9"}},
    {"StartThatTopplesOver",
     File::kTask,
     "pitch_rad = 0.0",
     "pitch_rad = 1.2",
     {"start: the robot does not come to rest", "give z_m"},
     "[start]"},
    {"ThreeControlPoints",
     File::kTask,
     "control_points = 12",
     "control_points = 3",
     {"spline.control_points: is 3; allowed: from 7 ... 64"}},
    {"TooManyControlPoints",
     File::kTask,
     "control_points = 12",
     "control_points = 65",
     {"spline.control_points: is 65; allowed: from 7 ... 64"}},
    {"ControlPointsOfAStrangeJoint",
     File::kTask,
     "control_points = 12",
     "control_points = { leg1 = 12, leg2 = 12, leg3 = 12 }",
     {"spline.control_points.leg3: is not a joint of the robot; its joints: leg1, leg2"}},
    {"ControlPointsOfOneJointOnly",
     File::kTask,
     "control_points = 12",
     "control_points = { leg1 = 11 }",
     {"spline.control_points.leg2: is missing"}},
    {"ThreeControlPointsForOneJoint",
     File::kTask,
     "control_points = 12",
     "control_points = { leg1 = 12, leg2 = 3 }",
     {"spline.control_points.leg2: is 3; allowed: from 7 ... 64"}},
    {"UnknownGradient",
     File::kTask,
     "[solver]",
     "[solver]\ngradient = \"symbolic\"",
     {"solver.gradient: is 'symbolic'; allowed: adjoint, forward"},
     "gradient = "},
    {"DegreeNine",
     File::kTask,
     "degree = 5",
     "degree = 9",
     {"spline.degree: is 9; allowed: from 3 ... 7"}},
    {"DegreeTwo",
     File::kTask,
     "degree = 5",
     "degree = 2",
     {"spline.degree: is 2; allowed: from 3 ... 7"}},
    {"DegreeIsAFraction",
     File::kTask,
     "degree = 5",
     "degree = 5.5",
     {"spline.degree: is a number; expected an integer"}},
    {"LooserVelocityThanTheRobots",
     File::kTask,
     "[limits]",
     "[limits]\nvelocity_max_rad_s = 21.0",
     {"limits.velocity_max_rad_s: is 21; allowed: above 0 ... 20"},
     "velocity_max_rad_s"},
    {"LooserTorqueThanTheRobots",
     File::kTask,
     "[limits]",
     "[limits]\ntorque_max_nm = 8.5",
     {"limits.torque_max_nm: is 8.5; allowed: above 0 ... 8"},
     "torque_max_nm"},
    {"RotorInertiaNegative",
     File::kTask,
     "rotor_inertia_kg_m2 = 0.001",
     "rotor_inertia_kg_m2 = -0.001",
     {"rotor_inertia_kg_m2: is -0.001; allowed: from 0"}},
    {"NegativeStiffness",
     File::kTask,
     "stiffness_n_per_m = 2.5e4",
     "stiffness_n_per_m = -2.5e4",
     {"contact.stiffness_n_per_m: is -25000; allowed: above 0"}},
    {"NegativeDamping",
     File::kTask,
     "damping_n_s_per_m = 100.0",
     "damping_n_s_per_m = -100.0",
     {"contact.damping_n_s_per_m: is -100; allowed: from 0"}},
    {"DOffAboveDOn",
     File::kTask,
     "d_off_m = 0.0075",
     "d_off_m = 0.011",
     {"contact.d_off_m: is 0.011; allowed: from 0 to below d_on_m, which is 0.01"}},
    {"DOffEqualsDOn",
     File::kTask,
     "d_off_m = 0.0075",
     "d_off_m = 0.01",
     {"contact.d_off_m: is 0.01; allowed: from 0 to below d_on_m, which is 0.01"}},
    {"NegativeFriction",
     File::kTask,
     "mu = 0.3",
     "mu = -0.3",
     {"contact.mu: is -0.3; allowed: from 0 ... 10"}},
    {"SlipSpeedZero",
     File::kTask,
     "v_max_m_per_s = 0.05",
     "v_max_m_per_s = 0.0",
     {"contact.v_max_m_per_s: is 0; allowed: >= 1e-06"}},
    {"ContactBothByIntentAndRaw",
     File::kTask,
     "mu = 0.3",
     "mu = 0.3\nstatic_penetration_m = 1.5e-3\nsettling_time_s = 0.2\nslip_speed_m_per_s = 0.05",
     {"contact.stiffness_n_per_m: is given beside static_penetration_m", "either these three, or"},
     "stiffness_n_per_m"},
    {"ContactByHalfAnIntent",
     File::kTask,
     "stiffness_n_per_m = 2.5e4\ndamping_n_s_per_m = 100.0",
     "settling_time_s = 0.2 # and",
     {"contact.v_max_m_per_s: is given beside static_penetration_m"},
     "v_max_m_per_s"},
    {"ContactWithoutPenetration",
     File::kTask,
     "stiffness_n_per_m = 2.5e4\ndamping_n_s_per_m = 100.0\nd_on_m = 0.01\nd_off_m = 0.0075\nmu = "
     "0.3\nv_max_m_per_s = 0.05",
     "settling_time_s = 0.2",
     {"contact.static_penetration_m: is missing"},
     "[contact]"},
    {"SettlingFasterThanCritical",
     File::kTask,
     "stiffness_n_per_m = 2.5e4\ndamping_n_s_per_m = 100.0\nd_on_m = 0.01\nd_off_m = 0.0075\nmu = "
     "0.3\nv_max_m_per_s = 0.05",
     "static_penetration_m = 1.0e-3\nsettling_time_s = 0.04\nslip_speed_m_per_s = 0.05",
     {"contact.settling_time_s: is 0.04; allowed: from 0.0403"},
     "settling_time_s"},
    {"LayerThinnerThanThePenetration",
     File::kTask,
     "stiffness_n_per_m = 2.5e4\ndamping_n_s_per_m = 100.0\nd_on_m = 0.01\nd_off_m = 0.0075\nmu = "
     "0.3\nv_max_m_per_s = 0.05",
     "static_penetration_m = 1.0e-3\nsettling_time_s = 0.2\nslip_speed_m_per_s = 0.05\nd_on_m = "
     "0.001",
     {"contact.d_on_m: is 0.001; allowed: above 0.001 ... 1"},
     "d_on_m"},
    {"CapsuleWithoutLength",
     File::kTask,
     "[search]",
     "[[obstacle]]\nname = \"log\"\nkind = \"capsule\"\nfrom_m = [1.0, 0.0]\nto_m = [1.0, "
     "0.0]\nradius_m = 0.1\n[search]",
     {"obstacle[1].to_m: is the same point as from_m"},
     "to_m"},
    {"BoxWithoutSize",
     File::kTask,
     "[search]",
     "[[obstacle]]\nname = \"step\"\nkind = \"box\"\ncentre_m = [1.0, 0.0]\nsize_m = [1.0, "
     "0.0]\n[search]",
     {"obstacle[1].size_m[1]: is 0; allowed: above 0 ... 1000"},
     "size_m"},
    {"RadiusOfABox",
     File::kTask,
     "[search]",
     "[[obstacle]]\nname = \"step\"\nkind = \"box\"\ncentre_m = [1.0, 0.0]\nsize_m = [1.0, "
     "0.1]\nradius_m = 0.1\n[search]",
     {"obstacle[1].radius_m: is not a key"},
     "radius_m = 0.1"},
    {"UnknownDampingLaw",
     File::kTask,
     "mu = 0.3",
     "mu = 0.3\ndamping_law = \"none\"",
     {"contact.damping_law: is 'none'; allowed: no-pull, signed, printed"},
     "damping_law"},
    {"NormalOfNoLength",
     File::kTask,
     "normal = [0.0, 1.0]",
     "normal = [0.0, 0.0]",
     {"obstacle[0].normal: has no direction"}},
    {"NormalOfThreeNumbers",
     File::kTask,
     "normal = [0.0, 1.0]",
     "normal = [0.0, 0.0, 1.0]",
     {"obstacle[0].normal: holds 3 numbers; expected 2"}},
    {"ObstacleTwice",
     File::kTask,
     "[search]",
     "[[obstacle]]\nkind = \"half-space\"\npoint_m = [0.0, 0.0]\nnormal = [0.0, 1.0]\nname = "
     "'ground'\n[search]",
     {"obstacle[1].name: 'ground' is there twice"},
     "name = 'ground'"},
    {"UnknownObstacle",
     File::kTask,
     "half-space",
     "cone",
     {"obstacle[0].kind: is 'cone'; allowed: half-space, cylinder, sphere, capsule, box"}},
    {"NoObstacle",
     File::kTask,
     "[[obstacle]]\nname = \"ground\"\nkind = \"half-space\"\npoint_m = [0.0, 0.0]\nnormal = [0.0, "
     "1.0]",
     "",
     {"obstacle: is missing"},
     "# From standing"},
    {"UnknownCostTerm",
     File::kTask,
     "term = \"effort\"",
     "term = \"energy\"",
     {"cost[2].term: is 'energy'; allowed: terminal, terminal-linear, effort"}},
    {"CostOfAnUnknownCoordinate",
     File::kTask,
     "of = \"pitch_rate\"",
     "of = \"yaw\"",
     {"cost[1].of: is 'yaw'; allowed: x, z, pitch, x_rate, z_rate, pitch_rate"}},
    {"CostAtAnUnknownTime",
     File::kTask,
     "when = \"settled\"",
     "when = \"later\"",
     {"cost[0].when: is 'later'; allowed: end, settled"}},
    {"NegativeWeight",
     File::kTask,
     "weight = 1.0e-4",
     "weight = -1.0e-4",
     {"cost[2].weight: is -0.0001; allowed"}},
    {"WeightMissing",
     File::kTask,
     "weight = 1.0e-4",
     "",
     {"cost[2].weight: is missing"},
     "[[cost]]\nterm = \"effort\""},
    {"NegativeSeed", File::kTask, "seed = 1", "seed = -1", {"search.seed: is -1; allowed: from 0"}},
    {"NoSamples",
     File::kTask,
     "seed = 1",
     "seed = 1\nmax_samples = 0",
     {"search.max_samples: is 0; allowed: from 1"},
     "max_samples = 0"},
    {"NothingToRefine",
     File::kTask,
     "seed = 1",
     "seed = 1\nrefine = 0",
     {"search.refine: is 0; allowed: from 1"},
     "refine = 0"},
    {"StepZero",
     File::kTask,
     "step_s = 1.0e-3",
     "step_s = 0.0",
     {"solver.step_s: is 0; allowed: from 1e-05 ... 0.01"}},
    {"NoEvaluations",
     File::kTask,
     "step_s = 1.0e-3",
     "step_s = 1.0e-3\nmax_evaluations = 0",
     {"solver.max_evaluations: is 0"},
     "max_evaluations = 0"},
    {"EntryToleranceZero",
     File::kTask,
     "[search]",
     "[tolerances]\nentry_rad = 0.0\n[search]",
     {"tolerances.entry_rad: is 0; allowed: above 0"},
     "entry_rad"},
};

const std::vector<Mistake> kRobotMistakes = {
    {"NotXml", File::kRobot, "</link>", "</lnk>", {"not valid XML"}},
    {"NotARobot",
     File::kRobot,
     "<robot name=\"tumbler\">",
     "<sdf name=\"tumbler\"/>\n<robot name=\"tumbler\">",
     {"not a URDF", "<robot>"},
     "<sdf"},
    {"NoRobotName", File::kRobot, "<robot name=\"tumbler\">", "<robot>", {"robot: has no name"}},
    {"MassZero",
     File::kRobot,
     "mass value=\"0.4\"",
     "mass value=\"0\"",
     {"link 'leg1_link'", "mass is 0 kg; allowed: > 0"}},
    {"MassNegative",
     File::kRobot,
     "mass value=\"0.4\"",
     "mass value=\"-0.4\"",
     {"link 'leg1_link'", "mass is -0.4 kg"}},
    {"MassWithAnUnit",
     File::kRobot,
     "mass value=\"0.4\"",
     "mass value=\"0.4kg\"",
     {"link 'leg1_link'", "'0.4kg'; allowed: a finite number"}},
    {"MassWithAComma",
     File::kRobot,
     "mass value=\"0.4\"",
     "mass value=\"0,4\"",
     {"link 'leg1_link'", "'0,4'"}},
    {"MassEmpty",
     File::kRobot,
     "mass value=\"0.4\"",
     "mass value=\"\"",
     {"link 'leg1_link'", "''"}},
    {"MassBeyondADouble",
     File::kRobot,
     "mass value=\"0.4\"",
     "mass value=\"4e999\"",
     {"link 'leg1_link'", "'4e999'"}},
    {"MassMissing",
     File::kRobot,
     "<mass value=\"1.0\"/>",
     "",
     {"link 'middle': lacks <mass>"},
     "<inertial>"},
    {"MassTwice",
     File::kRobot,
     "<mass value=\"1.0\"/>",
     "<mass value=\"1.0\"/>\n<mass value=\"2.0\"/>",
     {"link 'middle': there is a second <mass>"},
     "value=\"2.0\""},
    {"InertiaZero",
     File::kRobot,
     "iyy=\"7.5e-3\"",
     "iyy=\"0\"",
     {"link 'middle'", "principal moment 0 kg m^2; allowed: > 0"}},
    {"InertiaNegative",
     File::kRobot,
     "iyy=\"7.5e-3\"",
     "iyy=\"-7.5e-3\"",
     {"link 'middle'", "principal moment -0.0075 kg m^2; allowed: > 0"}},
    {"InertiaOfNoBody",
     File::kRobot,
     "ixx=\"5.0e-5\"",
     "ixx=\"5.0e-2\"",
     {"link 'middle'", "inertia is that of no body"}},
    {"InertiaPartMissing",
     File::kRobot,
     " ixy=\"0\"",
     "",
     {"link 'middle'", "<inertia> lacks the attribute ixy"},
     "ixx=\"5.0e-5\""},
    {"OriginOfTwoNumbers",
     File::kRobot,
     "origin xyz=\"0.15 0 0\"",
     "origin xyz=\"0.15 0\"",
     {"link 'middle'", "3 finite numbers"}},
    {"OriginOutOfReach",
     File::kRobot,
     "origin xyz=\"0.15 0 0\"",
     "origin xyz=\"1e200 0 0\"",
     {"joint 'leg1'", "out of reach"},
     "",
     "joint name=\"leg1\""},
    {"RadiusNegative",
     File::kRobot,
     "sphere radius=\"0.03\"",
     "sphere radius=\"-0.03\"",
     {"link 'middle'", "<sphere> radius is '-0.03'; allowed: a finite number, 0 or more"}},
    {"ShapeMisspelt",
     File::kRobot,
     "<sphere radius=\"0.03\"/>",
     "<spere radius=\"0.03\"/>",
     {"link 'middle'", "<geometry> holds <spere>; allowed: one of sphere, cylinder, box, mesh"}},
    {"ShapeMissing",
     File::kRobot,
     "<sphere radius=\"0.03\"/>",
     "",
     {"link 'middle'", "<geometry> holds nothing"},
     "<geometry></geometry>"},
    {"AxisOutOfThePlane",
     File::kRobot,
     "axis xyz=\"0 -1 0\"",
     "axis xyz=\"0 0 1\"",
     {"joint 'leg1'", "(0, 0, 1); allowed", "(0, 1, 0) or (0, -1, 0)"}},
    {"AxisSkew",
     File::kRobot,
     "axis xyz=\"0 -1 0\"",
     "axis xyz=\"0 -1 0.01\"",
     {"joint 'leg1'", "its axis in the robot's frame"}},
    {"AxisZero",
     File::kRobot,
     "axis xyz=\"0 -1 0\"",
     "axis xyz=\"0 0 0\"",
     {"joint 'leg1'", "no direction"}},
    {"UnknownJointType",
     File::kRobot,
     "type=\"revolute\"",
     "type=\"hinge\"",
     {"joint 'leg1'", "'hinge'; allowed: revolute, continuous, prismatic, fixed"}},
    {"UnsupportedJointType",
     File::kRobot,
     "type=\"revolute\"",
     "type=\"floating\"",
     {"joint 'leg1'", "'floating'; allowed"}},
    {"LowerAboveUpper",
     File::kRobot,
     "lower=\"-2.9\"",
     "lower=\"3.0\"",
     {"joint 'leg1'", "lower = 3 upper = 2.9; allowed: finite, lower <= upper"}},
    {"EffortZero",
     File::kRobot,
     "effort=\"8.0\"",
     "effort=\"0\"",
     {"joint 'leg1'", "limit effort = 0; allowed: > 0"}},
    {"VelocityZero",
     File::kRobot,
     "velocity=\"20.0\"",
     "velocity=\"0\"",
     {"joint 'leg1'", "limit velocity = 0; allowed: > 0"}},
    {"EffortMissing",
     File::kRobot,
     " effort=\"8.0\"",
     "",
     {"joint 'leg1'", "<limit> lacks the attribute effort"},
     "<limit"},
    {"LimitMissing",
     File::kRobot,
     "<limit lower=\"-2.9\" upper=\"2.9\" effort=\"8.0\" velocity=\"20.0\"/>",
     "",
     {"joint 'leg1': lacks <limit>"},
     "<joint name=\"leg1\""},
    {"DampingNegative",
     File::kRobot,
     "<limit",
     "<dynamics damping=\"-0.1\"/>\n<limit",
     {"joint 'leg1'", "damping = -0.1; allowed: >= 0"},
     "<dynamics"},
    {"DryFriction",
     File::kRobot,
     "<limit",
     "<dynamics friction=\"0.1\"/>\n<limit",
     {"joint 'leg1'", "not modelled; allowed: 0"},
     "<dynamics"},
    {"MimicJoint",
     File::kRobot,
     "<limit",
     "<mimic joint=\"leg2\"/>\n<limit",
     {"joint 'leg1'", "mimic joints are not supported"},
     "<mimic"},
    {"LinkNameTwice",
     File::kRobot,
     "<link name=\"leg2_link\">",
     "<link  name=\"leg1_link\">",
     {"link 'leg1_link': the name is taken by line"}},
    {"JointNameTwice",
     File::kRobot,
     "<joint name=\"leg2\"",
     "<joint  name=\"leg1\"",
     {"joint 'leg1': the name is taken by line"}},
    {"LinkWithoutAName",
     File::kRobot,
     "<link name=\"leg2_link\">",
     "<link>",
     {"link '': has no name"}},
    {"ChildThatIsNotThere",
     File::kRobot,
     "child link=\"leg2_link\"",
     "child link=\"leg3_link\"",
     {"joint 'leg2': <child> is the link 'leg3_link', which is not in the file"}},
    {"ParentThatIsNotThere",
     File::kRobot,
     "parent link=\"middle\"",
     "parent link=\"centre\"",
     {"joint 'leg1': <parent> is the link 'centre'"}},
    {"ParentMissing",
     File::kRobot,
     "<parent link=\"middle\"/>",
     "",
     {"joint 'leg1': lacks <parent>"},
     "<joint name=\"leg1\""},
    {"ChildOfTwoJoints",
     File::kRobot,
     "child link=\"leg2_link\"",
     "child  link=\"leg1_link\"",
     {"joint 'leg2'", "already that of joint 'leg1'"}},
    {"Loop",
     File::kRobot,
     "parent link=\"middle\"",
     "parent link=\"leg1_link\"",
     {"link 'leg1_link'", "lead back to itself; allowed: a tree"},
     "<link name=\"leg1_link\""},
    {"TwoRoots",
     File::kRobot,
     "<link name=\"middle\">",
     "<link name=\"base\"/>\n<link name=\"middle\">",
     {"link 'middle': no joint carries it, and none carries 'base'"},
     "<link name=\"middle\">"},
};

std::string NameOf(const ::testing::TestParamInfo<Mistake>& info) { return info.param.name; }
INSTANTIATE_TEST_SUITE_P(Task, BadInput, ::testing::ValuesIn(kTaskMistakes), NameOf);
INSTANTIATE_TEST_SUITE_P(Robot, BadInput, ::testing::ValuesIn(kRobotMistakes), NameOf);

struct Place {
  std::size_t offset, length;
};

/// Where each match of the pattern's first group is.
std::vector<Place> FindAll(const std::string& text, const std::string& pattern) {
  std::vector<Place> places;
  const std::regex regex(pattern);
  for (std::sregex_iterator i(text.begin(), text.end(), regex), end; i != end; ++i) {
    places.push_back(
        {static_cast<std::size_t>(i->position(1)), static_cast<std::size_t>(i->length(1))});
  }
  return places;
}

int LineAt(const std::string& text, std::size_t offset) {
  return 1 + static_cast<int>(std::count(text.begin(),
                                         text.begin() + static_cast<std::ptrdiff_t>(offset), '\n'));
}

/// The shipped task with every number that a task can hold.
std::string TaskWithEveryNumber() {
  std::string text = ShippedTask();
  text = Replaced(text, "pitch_rad = 0.0", "pitch_rad = 0.0\nx_m = 0.0\nz_m = 0.2", "[start]");
  text = Replaced(text, "[[cost]]",
                  "velocity_max_rad_s = 19.0\ntorque_max_nm = 7.0\nposition_min_rad = "
                  "-2.8\nposition_max_rad = 2.8\n[limits.leg2]\nvelocity_max_rad_s = "
                  "18.0\nacceleration_max_rad_s2 = 300.0\ntorque_max_nm = 6.0\nposition_min_rad = "
                  "-2.7\nposition_max_rad = 2.7\nrotor_inertia_kg_m2 = 0.002\n[[cost]]");
  text = Replaced(text, "[search]",
                  "[[obstacle]]\nname = \"bar\"\nkind = \"cylinder\"\ncentre_m = [3.0, "
                  "0.1]\nradius_m = 0.05\n[tolerances]\nentry_rad = 0.1\nfollowing_rad = "
                  "0.3\n[search]\nbatch = 8\npromising = 2\nmax_samples = 8\nrefine = 1\nmodes = "
                  "3\nspread_rad = 0.3\nbasin_rad = 0.5\ntorque_penalty = 1.0\ncore_penalty = "
                  "0.1\nstep_s = 2.0e-3");
  return Replaced(text, "[solver]",
                  "[solver]\nscreen_evaluations = 2\nfinalists = 1\nmax_evaluations = "
                  "3\nrelative_tolerance = 1.0e-7\nsharpness = 60.0");
}

TEST(BadInputEverywhere, ATaskWithEveryNumberIsRead) {
  const TaskFolder folder(TaskWithEveryNumber());
  Program program({kProgram, folder.task_file()});
  EXPECT_THAT(program.Wait(), AnyOf(0, 2)) << program.text();
}

TEST(BadInputEverywhere, NoNumberOfATaskMayBeNanOrInfinite) {
  const std::string text = TaskWithEveryNumber();
  const std::vector<Place> places =
      FindAll(text, "(?:= |= \\[|, )([-+]?[0-9][-+0-9.e]*)(?=[,\\] }\\n])");
  ASSERT_GE(places.size(), 55U);
  for (const Place& place : places) {
    for (const std::string value : {"nan", "inf", "-inf"}) {
      std::string changed = text;
      changed.replace(place.offset, place.length, value);
      const int line = LineAt(text, place.offset);
      SCOPED_TRACE("line " + std::to_string(line) + ": " + value);
      const TaskFolder folder(changed);
      const auto before = folder.Listing();
      Program program({kProgram, folder.task_file(), "--out", folder / "motion.toml"});
      EXPECT_EQ(program.Wait(), 1);
      EXPECT_THAT(program.text(), HasSubstr("task.toml:" + std::to_string(line) + ": "));
      EXPECT_THAT(program.text(),
                  AnyOf(HasSubstr("is " + value), HasSubstr("expected an integer")));
      EXPECT_EQ(folder.Listing(), before);
    }
  }
}

TEST(BadInputEverywhere, NoNumberOfARobotMayBeNanOrInfiniteOrHaveSomethingBehindIt) {
  const std::string text = ShippedRobot();
  std::vector<Place> places = FindAll(text, "=\"([-+]?[0-9][-+0-9.e]*)[\" ]");
  places.erase(places.begin());  // That of <?xml version?>.
  ASSERT_GE(places.size(), 50U);
  for (const Place& place : places) {
    for (const std::string value : {"nan", "-inf", "1.0abc"}) {
      std::string changed = text;
      changed.replace(place.offset, place.length, value);
      const int line = LineAt(text, place.offset);
      SCOPED_TRACE("line " + std::to_string(line) + ": " + value);
      const TaskFolder folder(ShippedTask(), changed);
      Program program({kProgram, folder.task_file(), "--out", folder / "motion.toml"});
      EXPECT_EQ(program.Wait(), 1);
      EXPECT_THAT(program.text(), HasSubstr("tumbler.urdf:" + std::to_string(line) + ": "));
      EXPECT_THAT(program.text(), HasSubstr("'" + value));
    }
  }
}

TEST(BadInputFiles, MissingTask) {
  const TaskFolder folder(ShippedTask());
  Program program({kProgram, folder / "absent.toml"});
  EXPECT_EQ(program.Wait(), 1);
  EXPECT_THAT(program.text(), HasSubstr("absent.toml: cannot be opened: No such file"));
}

TEST(BadInputFiles, TaskOrRobotThatIsAFolder) {
  const TaskFolder folder(Replaced(ShippedTask(), "../robots/tumbler.urdf", "../robots"));
  Program as_task({kProgram, folder / "tasks"});
  EXPECT_EQ(as_task.Wait(), 1);
  EXPECT_THAT(as_task.text(), HasSubstr("tasks: is a directory, not a file"));
  Program as_robot({kProgram, folder.task_file()});
  EXPECT_EQ(as_robot.Wait(), 1);
  EXPECT_THAT(as_robot.text(), HasSubstr("../robots: is a directory, not a file"));
}

TEST(BadInputFiles, EmptyOrForeignContent) {
  for (const std::string content : {"", "\n\n", "solid\x01\x02", "{\"robot\": 1}"}) {
    SCOPED_TRACE(content);
    const TaskFolder task(content);
    Program with_task({kProgram, task.task_file()});
    EXPECT_EQ(with_task.Wait(), 1);
    EXPECT_THAT(with_task.text(), HasSubstr("task.toml"));
    const TaskFolder robot(ShippedTask(), content);
    Program with_robot({kProgram, robot.task_file()});
    EXPECT_EQ(with_robot.Wait(), 1);
    EXPECT_THAT(with_robot.text(), HasSubstr("tumbler.urdf"));
    EXPECT_THAT(with_robot.text(), HasSubstr("not valid XML"));
  }
}

TEST(BadInputFiles, LinesAreCountedTheSameWithWindowsLineEnds) {
  const auto windows = [](const std::string& text) {
    return std::regex_replace(text, std::regex("\n"), "\r\n");
  };
  const std::string task = Replaced(ShippedTask(), "mu = 0.3", "mu = -0.3");
  ExpectRefused(windows(task), ShippedRobot(),
                "task.toml:" + std::to_string(LineOf(task, "mu = -0.3")) + ": contact.mu", {});
  const std::string robot = Replaced(ShippedRobot(), "mass value=\"1.0\"", "mass value=\"0\"");
  ExpectRefused(ShippedTask(), windows(robot),
                "tumbler.urdf:" + std::to_string(LineOf(robot, "mass value=\"0\"")) + ": ", {});
}

TEST(BadInputFiles, TaskThatAsksForNothing) {
  std::string task = ShippedTask();
  const std::size_t first = task.find("[[cost]]");
  const std::size_t last = task.find("[contact]");
  ASSERT_LT(first, last);
  task.erase(first, last - first);
  ExpectRefused(task, ShippedRobot(), "task.toml", {"cost: is missing"});
  ExpectRefused("cost = []\n" + task, ShippedRobot(), "task.toml:1: ", {"cost: asks for nothing"});
}

}  // namespace
}  // namespace tumbler
