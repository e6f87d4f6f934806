// tumbler model as a user meets it.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/model_runner.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::LineOf;
using testing::Lines;
using testing::ModelOutcome;
using testing::ModelRunner;
using testing::Numbers;
using testing::Replaced;
using testing::ShippedRobot;

/// The robot for which several engines agree on the figures. Its legs are 0.25 m long, its boxes
/// 40 mm thick.
std::string BoxTumbler() {
  const auto inertial = [](double mass, double length, double x) {
    const double across = mass * (length * length + 0.04 * 0.04) / 12;
    return fmt::format(
        "<inertial><origin xyz='{} 0 0'/><mass value='{}'/><inertia ixx='{}' ixy='0' ixz='0' "
        "iyy='{}' iyz='0' izz='{}'/></inertial>",
        x, mass, mass * 2 * 0.04 * 0.04 / 12, across, across);
  };
  const auto leg = [](const char* name, double x) {
    return fmt::format(
        "<joint name='{0}' type='continuous'><parent link='body'/><child link='{0}_link'/><origin "
        "xyz='{1} 0 0'/><axis xyz='0 -1 0'/></joint>\n",
        name, x);
  };
  return fmt::format(
      "<robot name='boxes'>\n<link name='body'>{}</link>\n<link name='leg_a_link'>{}</link>\n"
      "<link name='leg_b_link'>{}</link>\n{}{}</robot>\n",
      inertial(1, 0.3, 0), inertial(0.4, 0.25, -0.125), inertial(0.4, 0.25, 0.125),
      leg("leg_a", -0.15), leg("leg_b", 0.15));
}
const char* const kBoxState = "0.1 0.2 0.3 0.4 0.5  1 2 3 4 5  0.1 0.2";
const char* const kLegs = "--prescribed leg_a,leg_b";

TEST(ModelHybrid, GivesTheValuePublishedByThreeOtherEngines) {
  const ModelOutcome run = ModelRunner(BoxTumbler())("hybrid", kLegs, kBoxState);
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(run.err, "");
  const std::vector<double> out = Numbers(run.out);
  const std::vector<double> published = {0.208891784734129, -9.40478201383283, 4.49958658129138,
                                         0.0871760888152076, 0.108014195159789};
  ASSERT_EQ(out.size(), published.size());
  for (std::size_t i = 0; i < out.size(); ++i) EXPECT_NEAR(out[i], published[i], 1e-12);
}

TEST(ModelHybrid, SkipsCommentsAndBlankLinesAndTakesAnEmptyInput) {
  const ModelRunner model(BoxTumbler());
  const std::string state = kBoxState;
  const ModelOutcome plain = model("hybrid", kLegs, state + "\n");
  const ModelOutcome run = model(
      "hybrid", kLegs,
      "# states\n\n  \t\r\n" + state + "\r\n   # another\n+" + state + " # the same\n" + state);
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(run.out, plain.out + plain.out + plain.out);
  const ModelOutcome none = model("hybrid", kLegs, "");
  EXPECT_EQ(none.status, 0);
  EXPECT_EQ(none.out, "");
  EXPECT_EQ(none.err, "");
}

TEST(ModelHybrid, PrintsDigitsThatReadBackToTheSameNumber) {
  const ModelOutcome run = ModelRunner(BoxTumbler())("hybrid", kLegs, kBoxState);
  std::string again;
  for (const double x : Numbers(run.out)) again += fmt::format("{:.17g} ", x);
  again.back() = '\n';
  EXPECT_EQ(run.out, again);
}

TEST(ModelHybrid, GravityCanBeAnotherOne) {
  const ModelRunner model(BoxTumbler());
  const std::string rest = "0 0 0 0 0  0 0 0 0 0  0 0\n";
  const std::vector<double> out =
      Numbers(model("hybrid", std::string(kLegs) + " --gravity 1.5 0 -2", rest).out);
  ASSERT_EQ(out.size(), 5U);
  EXPECT_NEAR(out[0], 1.5, 1e-14);
  EXPECT_NEAR(out[1], -2, 1e-14);
  const std::vector<double> ahead = Numbers(model("hybrid --gravity 1.5 0 -2", kLegs, rest).out);
  EXPECT_EQ(ahead, out) << "the robot's file follows the option";
}

TEST(ModelHybrid, ARootsCoordinateMayBePrescribedToo) {
  // Held at rest, the robot loads z with 1.8 kg and pitch with its first moment.
  const std::vector<double> out =
      Numbers(ModelRunner(BoxTumbler())("hybrid", "--prescribed leg_b,x,leg_a,pitch,z",
                                        "0 0 0 0 0  0 0 0 0 0  0 0 0 0 0")
                  .out);
  ASSERT_EQ(out.size(), 5U);
  EXPECT_NEAR(out[1], 1.8 * 9.81, 1e-13);
  EXPECT_NEAR(out[3], -0.4 * 9.81 * 0.125, 1e-13) << "leg_a";
  EXPECT_NEAR(out[4], 0.4 * 9.81 * 0.125, 1e-13) << "leg_b";
}

TEST(ModelHybrid, AMalformedLineIsNamedAndWhatCameBeforeItIsPrinted) {
  const ModelRunner model(BoxTumbler());
  const std::string state = kBoxState;
  const std::string before = model("hybrid", kLegs, state).out;
  struct Wrong {
    std::string line, says;
  };
  for (const Wrong& wrong : std::vector<Wrong>{
           {"1 2 3", "has 3 values; expected 12: 5 positions, 5 velocities, 2 prescribed"},
           {state + " 1", "has 13 values; expected 12"},
           {state + " 1 2 3 4 5 6", "7 more for each force: fx fy fz px py pz link"},
           {"0.1 0.2 0.3 0.4 x 1 2 3 4 5 0.1 0.2",
            "value 5, the position of 'leg_b', is 'x'; expected a finite number"},
           {"0.1 0.2 0.3 0.4 5 1 nan 3 4 5 0.1 0.2", "value 7, the velocity of 'z', is 'nan'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 inf", "the acceleration of 'leg_b', is 'inf'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 0x1", "is '0x1'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 1e999", "is '1e999'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 1,5", "is '1,5'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 +-1", "is '+-1'"},
           {state + " 1 2 3 4 5 body body", "value 18, the pz of force 1, is 'body'"},
           {state + " 1 2 3 4 5 6 body 1 2 3 4 5 6 leg_c",
            "value 26, the link of force 2, is 'leg_c'; expected one of: body, leg_a_link, "
            "leg_b_link"},
           {"0.1 0.2 0.3 0.4 0.5 1e200 2 1e200 4 5 0.1 0.2", "not a finite number"}}) {
    std::string input = "# first\n";
    input.append(state).append("\n").append(wrong.line).append("\n").append(state).append("\n");
    const ModelOutcome run = model("hybrid", kLegs, input);
    EXPECT_EQ(run.status, 1) << wrong.line;
    EXPECT_EQ(run.out, before) << wrong.line;
    EXPECT_THAT(run.err, HasSubstr("standard input:3: ")) << wrong.line;
    EXPECT_THAT(run.err, HasSubstr(wrong.says)) << wrong.line;
  }
}

TEST(ModelHybrid, StandardStreamsThatFailAreErrors) {
  const ModelRunner model(BoxTumbler());
  const ModelOutcome full = model("hybrid", std::string(kLegs) + " >/dev/full", kBoxState);
  EXPECT_EQ(full.status, 1);
  EXPECT_THAT(full.err, HasSubstr("standard output: "));
  const ModelOutcome folder = model("hybrid", std::string(kLegs) + " </", "");
  EXPECT_EQ(folder.status, 1);
  EXPECT_THAT(folder.err, HasSubstr("standard input: cannot be read"));
}

TEST(ModelHybrid, BadArgumentsAreNamed) {
  const ModelRunner model(BoxTumbler());
  struct Wrong {
    std::string arguments, says;
  };
  for (const Wrong& wrong : std::vector<Wrong>{
           {"--prescribed leg_a,leg_c",
            "'leg_c' is no joint that moves; allowed, separated by commas: x, z, pitch, leg_a, "
            "leg_b"},
           {"--prescribed leg_a,leg_a", "'leg_a' is there twice"},
           {"--root hanging", "hanging"},
           {"--gravity 0 0", "--gravity"},
           {"--gravity 0 0 nan", "--gravity"}}) {
    const ModelOutcome run = model("hybrid", wrong.arguments, kBoxState);
    EXPECT_EQ(run.status, 1) << wrong.arguments;
    EXPECT_EQ(run.out, "") << wrong.arguments;
    EXPECT_THAT(run.err, HasSubstr(wrong.says)) << wrong.arguments;
  }
}

TEST(ModelHybrid, TheFloatingRootsSingularityIsNamedAndVerticalPitchIsNone) {
  const ModelRunner model(BoxTumbler());
  const std::string rest = " 0 0 0 0 0 0 0 0\n";
  const ModelOutcome steep =
      model("hybrid", "--root floating", "1 2 3 1.5707963267948966 0 0.3 0.4 0.5" + rest);
  EXPECT_EQ(steep.status, 0) << steep.err;
  EXPECT_NEAR(Numbers(steep.out).at(2), -9.81, 1e-12);
  const ModelOutcome singular =
      model("hybrid", "--root floating", "1 2 3 0.2 -1.5707963267948966 0.3 0.4 0.5" + rest);
  EXPECT_EQ(singular.status, 1);
  EXPECT_EQ(singular.out, "");
  EXPECT_THAT(singular.err, HasSubstr("standard input:1: roll = -1.57079633 rad"));
}

TEST(ModelHybrid, ADegreeOfFreedomWithoutInertiaMustBePrescribed) {
  const std::string text = Replaced(BoxTumbler(), "</robot>",
                                    "<link name='tip'/>\n<joint name='wrist' type='continuous'>"
                                    "<parent link='body'/><child link='tip'/></joint>\n</robot>");
  const ModelRunner model(text);
  const ModelOutcome free = model("hybrid", kLegs, "");
  EXPECT_EQ(free.status, 1);
  EXPECT_THAT(free.err, HasSubstr(fmt::format("robot.urdf:{}: link 'tip': degree of freedom "
                                              "'wrist' moves no mass",
                                              LineOf(text, "<link name='tip'"))));
  const ModelOutcome given = model("hybrid", "--prescribed wrist", "0 0 0 0 0 0  0 0 0 0 0 0  1");
  EXPECT_EQ(given.status, 0) << given.err;
  EXPECT_EQ(Numbers(given.out).back(), 0);
  const ModelOutcome check = model("check", "");
  EXPECT_EQ(check.status, 0);
  EXPECT_THAT(check.out, HasSubstr("'wrist' moves no mass: it can only be prescribed"));
}

TEST(ModelCheck, ShowsCoordinatesMassesAndWhatIsIgnored) {
  const std::string text =
      Replaced(ShippedRobot(), "<sphere radius=\"0.03\"/>", "<mesh filename=\"a.stl\"/>");
  const ModelOutcome run = ModelRunner(text)("check", "");
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("robot 'tumbler', root link 'middle' free in the x-z plane"));
  EXPECT_THAT(run.out, HasSubstr("degrees of freedom: 5"));
  EXPECT_THAT(run.out,
              ::testing::ContainsRegex("leg1 +revolute +\\(0, -1, 0\\) +-2.9 +2.9 +20 +8"));
  EXPECT_THAT(run.out, ::testing::ContainsRegex("leg2_link +0.4 +moved by leg2"));
  EXPECT_THAT(run.out, ::testing::ContainsRegex("total, moving +1.8\n"));
  EXPECT_THAT(run.out, HasSubstr(fmt::format("robot.urdf:{}: link 'middle': note: collision shape "
                                             "middle/0 is a mesh: contact ignores it",
                                             LineOf(text, "<link name=\"middle\""))));
  EXPECT_THAT(run.out, HasSubstr("tumbler optimize takes it"));
  EXPECT_THAT(run.out, ::testing::Not(HasSubstr("passes through the ground")));
  const std::string bare = testing::ReplacedAll(ShippedRobot(), "collision>", "visual>");
  const std::string shapeless = ModelRunner(bare)("check", "").out;
  EXPECT_THAT(shapeless, HasSubstr("can be planned: only where it touches nothing"));
  EXPECT_THAT(shapeless, ::testing::Not(HasSubstr("tumbler optimize takes it")));
  const std::string half = Replaced(bare, "<visual>", "<collision>");
  EXPECT_THAT(ModelRunner(Replaced(half, "</visual>", "</collision>"))("check", "").out,
              HasSubstr("note: no collision shape, so passes through the ground: leg1_link, "
                        "leg2_link\n"));
  const ModelOutcome floating = ModelRunner(text)("check", "--root floating");
  EXPECT_EQ(floating.status, 0);
  EXPECT_THAT(floating.out, HasSubstr("degrees of freedom: 8"));
  EXPECT_THAT(floating.out, HasSubstr("can be planned: yes, tumbler optimize takes it"));
}

/// A robot of links in a row, with these joints between them.
std::string Row(const std::vector<std::string>& joints) {
  std::string text = "<robot name='row'>\n";
  for (std::size_t i = 0; i <= joints.size(); ++i) {
    text += fmt::format(
        "<link name='l{}'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' "
        "iyz='0' izz='1'/></inertial><collision><geometry><sphere radius='0.1'/></geometry>"
        "</collision></link>\n",
        i);
  }
  for (std::size_t i = 0; i < joints.size(); ++i) {
    text += fmt::format(
        "<joint name='j{0}' type='revolute'><parent link='l{0}'/><child link='l{1}'/>{2}</joint>\n",
        i, i + 1, joints[i]);
  }
  return text + "</robot>\n";
}
const std::string kInPlane =
    "<axis xyz='0 1 0'/><limit lower='-1' upper='1' effort='3' velocity='4'/>";
const std::string kAcross =
    "<axis xyz='1 0 0'/><limit lower='0.2' upper='1' effort='3' velocity='4'/>";

TEST(ModelCheck, SaysOnceWhatIsTrueOfManyShapesAndJoints) {
  std::string text =
      Row(std::vector<std::string>(9,
                                   "<origin rpy='0 0 1.5708'/><axis xyz='1 0 0'/>"
                                   "<limit lower='-1' upper='1' effort='3' velocity='4'/>"));
  text = testing::ReplacedAll(text, "<sphere radius='0.1'/>", "<mesh filename='a.stl'/>");
  const ModelOutcome run = ModelRunner(text)("check", "--root floating");
  const auto count = [](const std::string& in, const std::string& what) {
    std::size_t times = 0;
    for (std::size_t at = in.find(what); at != std::string::npos; at = in.find(what, at + 1))
      ++times;
    return times;
  };
  EXPECT_THAT(
      run.out,
      HasSubstr("link 'l0': note: collision shape l0/0 is a mesh: contact ignores it (as of 9 "
                "more: l1/0, l2/0, l3/0, ...)\n"));
  EXPECT_EQ(count(run.out, "is a mesh"), 1U);
  EXPECT_THAT(run.err, HasSubstr("joint 'j0': note: origin rpy 1.5708 is taken as pi/2 (as of 8 "
                                 "more: joint 'j1', joint 'j2', joint 'j3', ...)\n"));
  EXPECT_EQ(count(run.err, "is taken as"), 1U);
}

TEST(ModelCheck, ListsEverythingAtOnceAndTheJointsThatATaskHasToLock) {
  const ModelOutcome run = ModelRunner(
      Row({kInPlane, "<axis xyz='0 1 0'/><limit lower='-1' upper='1' effort='0' velocity='0'/>",
           "<axis xyz='0 1 0'/>", kAcross}))("check", "");
  EXPECT_EQ(run.status, 4) << run.err;
  EXPECT_THAT(run.out, HasSubstr("can be looked at: yes\ncan be planned: not yet; in the way:\n"));
  EXPECT_THAT(run.out,
              HasSubstr("    robot.urdf:8: joint 'j1': limit velocity = 0; allowed: > 0\n"));
  EXPECT_THAT(run.out, HasSubstr("    robot.urdf:8: joint 'j1': limit effort = 0; allowed: > 0\n"));
  EXPECT_THAT(run.out, HasSubstr("    robot.urdf:9: joint 'j2': lacks <limit>\n"));
  EXPECT_THAT(run.out,
              HasSubstr("    robot.urdf:10: joint 'j3': its axis in the robot's frame is (1, 0, "));
  EXPECT_THAT(run.out, HasSubstr("    locked = { j3 = 0.2 }\n"));
  EXPECT_THAT(run.out, HasSubstr("joints left with these locked: j0, j1, j2\n"));
  EXPECT_THAT(run.out, HasSubstr("it still needs another file:\n"));
  EXPECT_THAT(run.out, ::testing::Not(HasSubstr("locked: yes")));
}

TEST(ModelCheck, SaysWithWhichJointsLockedATaskTakesTheRobotAndTakesThemItself) {
  const ModelRunner run(Row({kInPlane, kAcross}));
  EXPECT_THAT(run("check", "").out, HasSubstr("can be planned with these joints locked: yes\n"));
  const ModelOutcome locked = run("check", "--locked j1=0.5");
  EXPECT_THAT(locked.out, HasSubstr("locked at 0.5\n"));
  EXPECT_THAT(locked.out, HasSubstr("can be planned: yes, tumbler optimize takes it\n"));
  const std::string bare = testing::ReplacedAll(Row({kInPlane, kAcross}), "collision>", "visual>");
  EXPECT_THAT(ModelRunner(bare)("check", "").out,
              HasSubstr("can be planned with these joints locked: only where it touches nothing"));
  EXPECT_THAT(run("check", "--locked j1=0.1").err, HasSubstr("j1 is 0.1; allowed: 0.2 ... 1"));
  EXPECT_THAT(run("check", "--locked j9=0").err, HasSubstr("'j9' is no joint"));
  EXPECT_THAT(run("check", "--locked j1").err, HasSubstr("allowed, separated by commas"));
}

TEST(ModelCheck, ItsStatusSaysWhetherATaskTakesTheRobot) {
  const ModelRunner mended(Row({kInPlane, kAcross}));
  EXPECT_EQ(mended("check", "").status, 0) << "with the joints locked that it names";
  EXPECT_EQ(mended("check", "--root floating").status, 0);
  const ModelOutcome none = ModelRunner(Row({kAcross}))("check", "");
  EXPECT_EQ(none.status, 4);
  EXPECT_THAT(none.out, HasSubstr("it needs a joint that moves in the x-z plane\n"));
}

TEST(ModelCheck, LooksAtARobotOfAnySizeAndSaysHowManyJointsATaskHasToLock) {
  const std::string text = Row(std::vector<std::string>(40, kInPlane));
  const ModelOutcome run = ModelRunner(text)("check", "");
  EXPECT_EQ(run.status, 4) << run.err;
  EXPECT_THAT(run.out, HasSubstr("degrees of freedom: 43\n"));
  EXPECT_THAT(run.out,
              HasSubstr("it needs 28 more of these 40 joints locked: a task moves up to 12"));
  const ModelOutcome hybrid = ModelRunner(text)("hybrid", "");
  EXPECT_EQ(hybrid.status, 1);
  EXPECT_THAT(hybrid.err, HasSubstr("evaluated with up to 32: lock some joints (--locked)"));
}

TEST(ModelCheck, NamesEveryMistakeOfAFileThatHoldsNoRobot) {
  const ModelOutcome run =
      ModelRunner(Row({"<axis xyz='0 1'/>", "<axis xyz='a b c'/>"}))("check", "");
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.err, HasSubstr("robot.urdf:5: joint 'j0': <axis> xyz is '0 1'"));
  EXPECT_THAT(run.err, HasSubstr("robot.urdf:6: joint 'j1': <axis> xyz is 'a b c'"));
  EXPECT_THAT(ModelRunner(Row({"<axis xyz='0 1'/>", "<axis xyz='a b c'/>"}))("hybrid", "").err,
              HasSubstr("(and 1 more: `tumbler model check` lists all)"));
}

TEST(ModelCheck, WarnsOfInertiaThatNoBodyHasWithLinkAndLine) {
  const std::string text = Replaced(ShippedRobot(), "iyy=\"7.5e-3", "iyy=\"9.5e-3");
  const ModelOutcome run = ModelRunner(text)("check", "--root floating");
  EXPECT_EQ(run.status, 4) << run.err;
  EXPECT_THAT(run.out, HasSubstr(fmt::format("robot.urdf:{}: link 'middle': warning: inertia is "
                                             "that of no body",
                                             LineOf(text, "iyy=\"9.5e-3"))));
  const std::string negative = Replaced(ShippedRobot(), "iyy=\"7.5e-3", "iyy=\"-7.5e-3");
  EXPECT_THAT(ModelRunner(negative)("check", "").out,
              HasSubstr("link 'middle': warning: inertia has the principal moment -0.0075"));
}

TEST(ModelCheck, RefusesWhatIsNoRobotWithFileLineAndElement) {
  struct Wrong {
    std::string from, to, says;
  };
  for (const Wrong& wrong : std::vector<Wrong>{
           {"<mass value=\"1.0\"", "<mass value=\"-1\"", "inertial mass is -1 kg; allowed: > 0"},
           {"lower=\"-2.9", "lower=\"29", "limit lower = 29 upper = 2.9"},
           {"<axis xyz=\"0 -1 0\"", "<axis xyz=\"0 0 0\"", "has no direction"},
           {"<mass value=\"1.0\"", "<mass value=\"heavy\"", "allowed: a finite number"},
           {"</robot>", "<link name='alone'/></robot>", "no joint carries it"}}) {
    const std::string text = Replaced(ShippedRobot(), wrong.from, wrong.to);
    for (const char* command : {"check", "hybrid"}) {
      const ModelOutcome run = ModelRunner(text)(command, "--root floating");
      EXPECT_EQ(run.status, 1) << wrong.to;
      EXPECT_EQ(run.out, "") << wrong.to;
      EXPECT_THAT(run.err, HasSubstr(fmt::format("robot.urdf:{}: ", LineOf(text, wrong.to))));
      EXPECT_THAT(run.err, HasSubstr(wrong.says));
    }
  }
}

}  // namespace
}  // namespace tumbler
