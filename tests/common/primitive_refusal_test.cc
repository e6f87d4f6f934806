// What the loader of primitives refuses, and what it says.

#include "common/files/primitive_toml.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include "common/files/toml_reader.h"
#include "tests/support/complete_primitive.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

struct RefusedEdit {
  const char* name;
  std::string from;  // must occur in the text
  std::string to;
  std::vector<std::string> fragments;
};

class PrimitiveRefusal : public ::testing::TestWithParam<RefusedEdit> {};

TEST_P(PrimitiveRefusal, NamesFileLineKeyAndCause) {
  const RefusedEdit& refusal = GetParam();
  const std::string text =
      testing::Replaced(ToToml(testing::PrimitiveExample()), refusal.from, refusal.to);
  try {
    ParsePrimitive(text, "p.toml");
    FAIL() << "was accepted";
  } catch (const FileError& error) {
    const std::string message = error.what();
    EXPECT_THAT(message, ::testing::MatchesRegex("p\\.toml:[0-9]+: .+"));
    for (const std::string& fragment : refusal.fragments) EXPECT_THAT(message, HasSubstr(fragment));
  }
}

const std::string kLeftPoints = "0.125, 0.125, 0.125, 0.3125,\n  0.25, 0.25, 0.25, 0.25\n]";
const std::string kLeftKnots =
    "0.0, 0.0, 0.0, 0.0,\n  0.0, 0.0, 0.5, 0.75,\n  1.25, 1.25, 1.25, 1.25,\n  1.25, 1.25\n]";

INSTANTIATE_TEST_SUITE_P(
    PrimitiveToml, PrimitiveRefusal,
    ::testing::Values(
        RefusedEdit{"Format",
                    "tumbler-primitive",
                    "tumbler-gait",
                    {"format: is 'tumbler-gait'", "'tumbler-primitive'"}},
        RefusedEdit{"NewerVersion",
                    "version = 2",
                    "version = 3",
                    {"p.toml:4: version: is 3", "reads version 2", "newer program"}},
        RefusedEdit{"VersionOne",
                    "version = 2",
                    "version = 1",
                    {"version: is 1", "hash is of the whole file",
                     "make the file again with tumbler optimize"}},
        RefusedEdit{"ToolWithAnEscape",
                    "tool = \"",
                    "tool = \"\\u001b[31m",
                    {"tool: has an escape character, which would command the terminal"}},
        RefusedEdit{"VersionText",
                    "version = 2",
                    "version = \"2\"",
                    {"version: is a string; expected an integer"}},
        RefusedEdit{"NoVersion", "version = 2", "", {"version: is missing"}},
        RefusedEdit{
            "EmptyName", "name = \"wave\"", "name = \"\"", {"name: is ''", "from 1 ... 48"}},
        RefusedEdit{"LongName",
                    "name = \"wave\"",
                    "name = \"" + std::string(49, 'x') + "\"",
                    {"name: is", "49 bytes"}},
        RefusedEdit{"ZeroDuration",
                    "duration_s = 1.25",
                    "duration_s = 0.0",
                    {"duration_s: is 0; allowed: > 0"}},
        RefusedEdit{"NanDuration",
                    "duration_s = 1.25",
                    "duration_s = nan",
                    {"duration_s: is nan; allowed: > 0"}},
        RefusedEdit{"OtherDuration",
                    "duration_s = 1.25",
                    "duration_s = 1.5",
                    {"joint[0].position.knots_s: ends at 1.25", "duration_s, which is 1.5"}},
        RefusedEdit{"NegativeSettle",
                    "settle_s = 0.375",
                    "settle_s = -1.0",
                    {"settle_s: is -1; allowed: >= 0"}},
        RefusedEdit{"ZeroEntryTolerance",
                    "entry_tolerance_rad = 0.0625",
                    "entry_tolerance_rad = 0.0",
                    {"entry_tolerance_rad: is 0; allowed: > 0"}},
        RefusedEdit{"ZeroFollowingTolerance",
                    "following_tolerance_rad = 0.5",
                    "following_tolerance_rad = 0.0",
                    {"following_tolerance_rad: is 0; allowed: > 0"}},
        RefusedEdit{"NoJoints", "[[joint]]", "[[joimt]]", {"joint"}},
        RefusedEdit{"SameJointTwice",
                    "name = \"right\"",
                    "name = \"left\"",
                    {"joint[1].name: is 'left'", "earlier joint"}},
        RefusedEdit{"LongJointName",
                    "name = \"left\"",
                    "name = \"" + std::string(33, 'x') + "\"",
                    {"joint[0].name: is", "33 bytes"}},
        RefusedEdit{"LimitsInverted",
                    "position_max_rad = 1.0",
                    "position_max_rad = -1.0",
                    {"joint[0].limits.position_max_rad: is -1", "above position_min_rad"}},
        RefusedEdit{"ZeroVelocityLimit",
                    "velocity_max_rad_s = 10.0",
                    "velocity_max_rad_s = 0.0",
                    {"joint[0].limits.velocity_max_rad_s: is 0; allowed: > 0"}},
        RefusedEdit{"InfiniteAccelerationLimit",
                    "acceleration_max_rad_s2 = 100.0",
                    "acceleration_max_rad_s2 = inf",
                    {"acceleration_max_rad_s2: is inf"}},
        RefusedEdit{"NegativeTorqueLimit",
                    "torque_max_nm = 2.0",
                    "torque_max_nm = -2.0",
                    {"joint[0].limits.torque_max_nm: is -2"}},
        RefusedEdit{"DegreeTooLow",
                    "degree = 5",
                    "degree = 2",
                    {"joint[0].position.degree: is 2; allowed: from 3 ... 7"}},
        RefusedEdit{"DegreeTooHigh",
                    "degree = 5",
                    "degree = 8",
                    {"joint[0].position.degree: is 8; allowed: from 3 ... 7"}},
        RefusedEdit{"DegreeDoesNotFitKnots",
                    "degree = 5",
                    "degree = 4",
                    {"joint[0].position.knots_s: holds 14 numbers", "need 13"}},
        RefusedEdit{"TooFewCoefficients",
                    kLeftPoints,
                    "0.125, 0.125]",
                    {"joint[0].position.coefficients_rad: holds 2 numbers", "from 6 (degree + 1)"}},
        RefusedEdit{"TooManyCoefficients",
                    kLeftPoints,
                    [] {
                      std::string s;
                      for (int i = 0; i < 65; ++i) s += "0.1,";
                      return s + "]";
                    }(),
                    {"coefficients_rad: holds 65 numbers", "... 64"}},
        RefusedEdit{"OneCoefficientMissing",
                    kLeftPoints,
                    "0.125, 0.125, 0.125, 0.3125, 0.25, 0.25, 0.25]",
                    {"knots_s: holds 14 numbers; 7 coefficients of degree 5 need 13"}},
        RefusedEdit{
            "NanCoefficient", "0.3125", "nan", {"joint[0].position.coefficients_rad[3]: is nan"}},
        RefusedEdit{
            "InfiniteKnot", "0.5, 0.75", "0.5, inf", {"joint[0].position.knots_s[7]: is inf"}},
        RefusedEdit{"TextCoefficient",
                    "0.3125",
                    "\"0.3125\"",
                    {"coefficients_rad[3]: is a string; expected a number"}},
        RefusedEdit{"KnotsDecrease",
                    "0.5, 0.75",
                    "0.75, 0.5",
                    {"joint[0].position.knots_s: knot 7 is 0.5, less than knot 6"}},
        RefusedEdit{"KnotsStartLate",
                    kLeftKnots,
                    "0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.75, 1.25, 1.25, 1.25, 1.25, 1.25, 1.25]",
                    {"knots_s: starts at 0.1; a motion starts at 0"}},
        RefusedEdit{"KnotsNotClamped",
                    kLeftKnots,
                    "0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.5, 0.75, 1.25, 1.25, 1.25, 1.25, 1.25, 1.25]",
                    {"knots_s: must begin and end with 6 equal knots"}},
        RefusedEdit{
            "KnotAtTheEnd", "0.5, 0.75", "0.5, 1.25", {"knots_s: knot 7, 1.25, occurs too often"}},
        RefusedEdit{
            "KnotRepeatedTooOften",
            "[joint.position]\ndegree = 3\nknots_s = [\n  0.0, 0.0, 0.0, 0.0,\n  0.625, 1.25, "
            "1.25, 1.25,\n  1.25\n]\ncoefficients_rad = [\n  -0.5, -0.5,",
            "[joint.position]\ndegree = 3\nknots_s = [0.0, 0.0, 0.0, 0.0, 0.625, 0.625, 1.25, "
            "1.25, 1.25, 1.25]\ncoefficients_rad = [-0.5, -0.5, -0.5,",
            {"joint[1].position.knots_s: knot 5, 0.625, occurs too often", "1 times"}},
        RefusedEdit{"PositionAboveLimit",
                    "position_max_rad = 1.0",
                    "position_max_rad = 0.25",
                    {"joint[0].position.coefficients_rad: joint 'left': position is 0.259443",
                     " rad at ", " s; allowed: <= 0.25 rad"}},
        RefusedEdit{"PositionBelowLimit",
                    "position_min_rad = -1.0",
                    "position_min_rad = 0.2",
                    {"joint 'left': position is 0.125 rad at 0 s; allowed: >= 0.2 rad"}},
        RefusedEdit{"VelocityAboveLimit",
                    "velocity_max_rad_s = 10.0",
                    "velocity_max_rad_s = 0.2",
                    {"joint 'left': velocity is 0.353091", " rad/s at ",
                     " s; allowed: <= 0.2 rad/s (limits.velocity_max_rad_s)"}},
        RefusedEdit{
            "AccelerationAboveLimit",
            "acceleration_max_rad_s2 = 100.0",
            "acceleration_max_rad_s2 = 1.0",
            {"joint 'left': acceleration is ", "rad/s^2 at ", "limits.acceleration_max_rad_s2"}},
        RefusedEdit{
            "TorqueAboveLimit",
            "torque_max_nm = 2.0",
            "torque_max_nm = 1.0",
            {"joint[0].torque.coefficients_nm: joint 'left': feed-forward torque is 1.5 N m at "
             "0.625 s; allowed: <= 1 N m"}},
        RefusedEdit{"TorqueEndsEarly",
                    "0.0, 0.0, 0.625, 1.25,\n  1.25",
                    "0.0, 0.0, 0.625, 1.0,\n  1.0",
                    {"joint[0].torque.knots_s: ends at 1.0"}},
        RefusedEdit{
            "EntryElsewhere",
            "joint_positions_rad = [0.125, -0.5]",
            "joint_positions_rad = [0.126, -0.5]",
            {"entry.joint_positions_rad: joint 'left' is at 0.126 rad; its spline starts at "
             "0.125 rad"}},
        RefusedEdit{
            "ExitElsewhere",
            "joint_positions_rad = [0.25, -0.5]",
            "joint_positions_rad = [0.25, -0.4]",
            {"exit.joint_positions_rad: joint 'right' is at -0.4 rad; its spline ends at -0.5 "
             "rad"}},
        RefusedEdit{"EntryOfOneJoint",
                    "joint_positions_rad = [0.125, -0.5]",
                    "joint_positions_rad = [0.125]",
                    {"entry.joint_positions_rad: holds 1 numbers; expected 2"}},
        RefusedEdit{"NanPose", "root_z_m = 0.15", "root_z_m = nan", {"entry.root_z_m: is nan"}},
        RefusedEdit{"ContactEndsFirst",
                    "end_s = 0.4375",
                    "end_s = -0.0625",
                    {"contact[1].end_s: is -0.0625"}},
        RefusedEdit{"ContactReversed",
                    "start_s = 0.0\nend_s = 0.4375",
                    "start_s = 0.5\nend_s = 0.4375",
                    {"contact[1].end_s: is 0.4375; allowed: >= start_s, which is 0.5"}},
        RefusedEdit{
            "ContactAfterTheMotion",
            "end_s = 0.4375",
            "end_s = 1.75",
            {"contact[1].end_s: is 1.75; allowed: up to the end of the settle phase, 1.625"}},
        RefusedEdit{
            "PurposeMissed",
            "result = 0.26",
            "result = 0.3125",
            {"purpose[0].result: is 0.3125, 0.0625 from the target; allowed: the tolerance, "
             "0.03125"}},
        RefusedEdit{
            "PurposeWithoutAResult", "result = 0.26", "result = nan", {"purpose[0].result"}},
        RefusedEdit{"PurposeOfNothing",
                    "of = \"speed\"",
                    "of = \"haste\"",
                    {"purpose[1].of: is 'haste'; allowed: x, z, pitch, x_rate, z_rate, pitch_rate, "
                     "speed"}},
        RefusedEdit{"PurposeAtNoTime", "time_s = 0.875\n", "", {"purpose[2].time_s: is missing"}},
        RefusedEdit{"PurposeAtTwoTimes",
                    "when = \"later\"",
                    "when = \"later\"\ntime_s = 0.5",
                    {"purpose[1].time_s: is not a key that this file can hold"}},
        RefusedEdit{"PurposeOfAPointOfNoLink",
                    "link = \"leg1_link\"\n",
                    "",
                    {"purpose[3].link: is missing"}},
        RefusedEdit{"PurposeWithoutTolerance",
                    "tolerance = 0.03125",
                    "tolerance = 0.0",
                    {"purpose[0].tolerance: is 0; allowed: > 0"}},
        RefusedEdit{"NegativeForce",
                    "peak_normal_force_n = 31.5",
                    "peak_normal_force_n = -31.5",
                    {"contact[0].peak_normal_force_n: is -31.5"}},
        RefusedEdit{"CoefficientChanged",
                    "-0.4375",
                    "-0.4376",
                    {"p.toml:5: content_hash: is 'fnv1a64:",
                     "all keys and values in this file hash to", "changed after it was written",
                     "make it again with tumbler optimize", "sign the change with tumbler sign"}},
        RefusedEdit{"SettleChanged", "settle_s = 0.375", "settle_s = 0.376", {"content_hash"}},
        RefusedEdit{"ContentHashChanged",
                    "content_hash = \"fnv1a64:",
                    "content_hash = \"fnv1a64:0",
                    {"content_hash: is 'fnv1a64:0"}},
        RefusedEdit{"PositionMarginClaimed",
                    "position_margin_rad = 0.7",
                    "position_margin_rad = 0.8",
                    {"certificate.position_margin_rad: is 0.84",
                     "but the coefficients leave a margin of 0.74"}},
        RefusedEdit{"VelocityMarginClaimed",
                    "velocity_margin_rad_s = ",
                    "velocity_margin_rad_s = 1",
                    {"certificate.velocity_margin_rad_s: is 1"}},
        RefusedEdit{"AccelerationMarginClaimed",
                    "acceleration_margin_rad_s2 = ",
                    "acceleration_margin_rad_s2 = 1",
                    {"certificate.acceleration_margin_rad_s2: is 1"}},
        RefusedEdit{"TwoGradientErrors",
                    "gradient_errors = [0.0, 0.0, 0.0]",
                    "gradient_errors = [0.0, 0.0]",
                    {"certificate.gradient_errors: holds 2 numbers; expected 3"}},
        RefusedEdit{"NegativePeakTorque",
                    "peak_torque_nm = 1.5",
                    "peak_torque_nm = -1.5",
                    {"certificate.peak_torque_nm: is -1.5"}},
        RefusedEdit{"RobotChanged",
                    "<link name='a'/>",
                    "<link name='b'/>",
                    {"provenance.robot_hash", "the bytes of robot_urdf"}},
        RefusedEdit{"TaskChanged",
                    "stiffness = 1e4",
                    "stiffness = 1e5",
                    {"provenance.task_hash", "the bytes of task_toml"}},
        RefusedEdit{"NegativeSeed", "seed = 42", "seed = -42", {"provenance.seed: is -42"}},
        RefusedEdit{"UnknownKey",
                    "settle_s = 0.375",
                    "settle_s = 0.375\nsettle_ms = 375",
                    {"settle_ms: is not a key that this file can hold"}},
        RefusedEdit{"UnknownJointKey",
                    "name = \"right\"",
                    "name = \"right\"\ncolour = \"red\"",
                    {"joint[1].colour: is not a key"}},
        RefusedEdit{"UnknownSplineKey",
                    "degree = 5",
                    "degree = 5\nweights = [1.0]",
                    {"joint[0].position.weights: is not a key"}},
        RefusedEdit{"DuplicateKey",
                    "settle_s = 0.375",
                    "settle_s = 0.375\nsettle_s = 0.375",
                    {"not valid TOML"}}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace tumbler
