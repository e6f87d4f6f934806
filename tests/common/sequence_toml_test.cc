// Sequence files: what the loader reads, what every edge has to keep, and the message about each
// wrong file.

#include "common/files/sequence_toml.h"
#include "common/files/spline_extent.h"

#include <fmt/format.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "common/files/primitive_hash.h"
#include "common/files/toml_reader.h"
#include "tests/support/docs_tables.h"
#include "tests/support/sequence_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using testing::Complete;
using testing::GaitPrimitives;
using testing::GaitText;
using ::testing::HasSubstr;
using testing::LineOf;
using testing::Replaced;
using testing::SequenceFolder;

constexpr double kPi = std::numbers::pi;

std::string Refusal(const std::string& text,
                    const std::vector<PrimitiveFile>& primitives = GaitPrimitives()) {
  const SequenceFolder folder(text, primitives);
  try {
    LoadSequence(folder.file());
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(SequenceToml, ReadsTheGraph) {
  const SequenceFolder folder(GaitText());
  const SequenceFile file = LoadSequence(folder.file());
  const SequenceGraph<double>& graph = file.graph;
  EXPECT_EQ(graph.name.view(), "gait");
  EXPECT_EQ(graph.start, 0);
  ASSERT_EQ(graph.node_count, 5);
  EXPECT_EQ(graph.node(2).name.view(), "up, swapped");
  EXPECT_TRUE(graph.node(2).swapped);
  EXPECT_FALSE(graph.node(2).ends_cycle);
  EXPECT_TRUE(graph.node(3).ends_cycle);
  EXPECT_EQ(file.PrimitiveOf(3).primitive.name.view(), "down");
  ASSERT_EQ(graph.edge_count, 5);
  EXPECT_EQ(graph.edge(0).settle_s, 1.5);
  EXPECT_EQ(graph.edge(1).settle_s, 0.05) << "the primitive's own, without another";
  EXPECT_EQ(graph.edge(4).when, EdgeCondition::kBranch);
  EXPECT_EQ(graph.edge(4).branch.view(), "leave");
  EXPECT_EQ(graph.RoleOf(2, 0), 1);
  EXPECT_EQ(graph.RoleOf(1, 0), 0);
  EXPECT_EQ(file.RobotPitch(2, 0.25), 0.25 + kPi);
}

TEST(SequenceToml, ToRuntimeKeepsGraphAndPrimitives) {
  const SequenceFolder folder(GaitText());
  const SequenceFile file = LoadSequence(folder.file());
  const Sequence<float> sequence = ToRuntime(file);
  EXPECT_EQ(sequence.primitive_count, 3);
  EXPECT_EQ(sequence.PrimitiveOf(4).name.view(), "out");
  EXPECT_EQ(sequence.graph.edge(0).settle_s, 1.5F);
  EXPECT_EQ(sequence.graph.edge(4).branch.view(), "leave");
  EXPECT_EQ(sequence.graph.RoleOf(3, 1), 0);
  // Seams stay closed: the same double at both sides is the same float.
  for (const auto& edge : sequence.graph.edges()) {
    for (int j = 0; j < 2; ++j) {
      const auto end = sequence.PrimitiveOf(edge.from)
                           .joints[static_cast<std::size_t>(sequence.graph.RoleOf(edge.from, j))];
      const auto begin = sequence.PrimitiveOf(edge.to)
                             .joints[static_cast<std::size_t>(sequence.graph.RoleOf(edge.to, j))];
      EXPECT_EQ(end.position.control_points().back(), begin.position.control_points().front());
    }
  }
}

/// Evaluates the splines that the joints of the robot follow on both sides of every edge.
TEST(SequenceToml, AnAcceptedSequenceIsContinuousAlongEveryEdge) {
  const SequenceFolder folder(GaitText());
  const SequenceFile file = LoadSequence(folder.file());
  for (const auto& edge : file.graph.edges()) {
    for (int j = 0; j < 2; ++j) {
      const auto& from = file.PrimitiveOf(edge.from).primitive;
      const auto& to = file.PrimitiveOf(edge.to).primitive;
      const auto end =
          from.joints[static_cast<std::size_t>(file.graph.RoleOf(edge.from, j))].position.Evaluate(
              from.duration_s);
      const auto begin =
          to.joints[static_cast<std::size_t>(file.graph.RoleOf(edge.to, j))].position.Evaluate(0);
      EXPECT_NEAR(end.value, begin.value, 1e-6);
      EXPECT_NEAR(end.first, 0, 1e-6);
      EXPECT_NEAR(begin.first, 0, 1e-6);
      EXPECT_NEAR(end.second, 0, 1e-6);
      EXPECT_NEAR(begin.second, 0, 1e-6);
    }
  }
}

/// Random ends are accepted exactly when every joint, exchanged or not, meets its path again.
TEST(SequenceToml, AcceptsExactlyTheJoinsThatMeet) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> coin(0, 1);
  int accepted = 0;
  for (int trial = 0; trial < 60; ++trial) {
    // Each end is either exact or off by a large amount.
    const double off1 = coin(random) == 0 ? 0.01 : 0.0;
    const double off2 = coin(random) == 0 ? -0.02 : 0.0;
    const bool swapped = coin(random) == 1;
    const std::array<double, 2> meet = {0.3, -0.4};
    const std::vector<PrimitiveFile> primitives = {
        testing::MotionBetween("up", {-1, 1}, meet, 0, kPi / 2, 1),
        testing::MotionBetween("down",
                               swapped ? std::array{meet[1] + off1, meet[0] + off2}
                                       : std::array{meet[0] + off1, meet[1] + off2},
                               {1, -1}, swapped ? -kPi / 2 : kPi / 2, kPi, 2)};
    std::string text = GaitText();
    text = Replaced(text, "out = \"out.toml\"\n", "");
    text.resize(text.find("[[node]]"));
    text += R"([[node]]
name = "up"
primitive = "up"
safe = true
[[node]]
name = "next"
primitive = "down"
safe = true
)" + std::string(swapped ? "swapped = true\n" : "") +
            R"([[edge]]
from = "up"
to = "next"
)";
    const std::string said = Refusal(text, primitives);
    const bool meets = off1 == 0 && off2 == 0;
    accepted += meets ? 1 : 0;
    if (meets) {
      EXPECT_EQ(said, "accepted");
    } else {
      // The message names the joint of the robot, not that of the path.
      const std::string joint =
          (off1 != 0) == swapped && !(off1 != 0 && off2 != 0) ? "joint2" : "joint1";
      EXPECT_THAT(said, HasSubstr(fmt::format("joint '{}', position", joint)))
          << off1 << " " << off2;
    }
  }
  EXPECT_GT(accepted, 5);
  EXPECT_LT(accepted, 30);
}

TEST(SequenceToml, AJointThatDoesNotMeetIsNamedWithTheAmount) {
  auto primitives = GaitPrimitives();
  primitives[1] = testing::MotionBetween("down", {0.125, 0}, {1, -1}, kPi / 2, kPi, 2);
  const std::string text = GaitText();
  EXPECT_THAT(
      Refusal(text, primitives),
      AllOf(HasSubstr("gait.toml:" + std::to_string(LineOf(text, "[[edge]]") + 1) + ": edge[0]"),
            HasSubstr("up -> down: joint 'joint1', position: 0 rad at the end of 'up' against "
                      "0.125 rad at the start of 'down': 0.125 rad apart; allowed: 1e-06 rad")));
}

TEST(SequenceToml, TheGainsOfASequenceAreThoseOfItsStartElseOfTheFirstMotionThatSaysThem) {
  auto primitives = GaitPrimitives();
  EXPECT_EQ(GainsOf(LoadSequence(SequenceFolder(GaitText(), primitives).file())), std::nullopt);
  primitives[2].drives = DriveGains{80, 5};
  EXPECT_EQ(GainsOf(LoadSequence(SequenceFolder(GaitText(), primitives).file())),
            (DriveGains{80, 5}));
  primitives[0].drives = DriveGains{60, 4};
  EXPECT_EQ(GainsOf(LoadSequence(SequenceFolder(GaitText(), primitives).file())),
            (DriveGains{60, 4}));
  const std::string later = Replaced(GaitText(), "start = \"up\"", "start = \"down\"");
  primitives[1].drives = DriveGains{70, 3};
  EXPECT_EQ(GainsOf(LoadSequence(SequenceFolder(later, primitives).file())), (DriveGains{70, 3}));
}

TEST(SequenceToml, AMotionThatEndsInMovementCannotBeHeld) {
  auto primitives = GaitPrimitives();
  auto& motion = primitives[0].primitive.joints[1];
  std::vector<double> points(motion.position.control_points().begin(),
                             motion.position.control_points().end());
  const auto knots = motion.position.knots();
  points[points.size() - 2] = -0.01;
  points[points.size() - 3] = -0.02;
  ASSERT_EQ(motion.position.Assign(5, std::vector<double>(knots.begin(), knots.end()), points),
            Status::kOk);
  const double speed = motion.position.Evaluate(1.2).first;
  EXPECT_GT(speed, 0.1);
  EXPECT_THAT(Refusal(GaitText(), primitives),
              AllOf(HasSubstr("joint 'joint2', velocity before the hold: " + MessageNumber(speed)),
                    HasSubstr("at the end of 'up' against 0 rad/s at the hold")));
  // Without a hold the next primitive would have to begin with that velocity.
  for (PrimitiveFile& file : primitives) file.primitive.settle_s = 0;
  EXPECT_THAT(Refusal(Replaced(GaitText(), "settle_s = 1.5", "settle_s = 0"), primitives),
              HasSubstr("joint 'joint2', velocity: " + MessageNumber(speed)));
}

TEST(SequenceToml, ACurvedEndIsAnAccelerationThatDoesNotFit) {
  auto primitives = GaitPrimitives();
  auto& motion = primitives[1].primitive.joints[0];
  std::vector<double> points(motion.position.control_points().begin(),
                             motion.position.control_points().end());
  const auto knots = motion.position.knots();
  points[2] = 0.02;
  ASSERT_EQ(motion.position.Assign(5, std::vector<double>(knots.begin(), knots.end()), points),
            Status::kOk);
  EXPECT_THAT(Refusal(GaitText(), primitives),
              HasSubstr("up -> down: joint 'joint1', acceleration after the hold"));
}

TEST(SequenceToml, TheRootsPoseMeetsWithinTheTolerances) {
  auto primitives = GaitPrimitives();
  primitives[0].exit.root_z_m += 0.003;
  EXPECT_THAT(Refusal(GaitText(), primitives),
              AllOf(HasSubstr("up -> down: root, height: 0.363 m at the end of 'up' against 0.36 m "
                              "at the start of 'down': 0.003 m apart"),
                    HasSubstr("allowed: 0.002 m")));
  primitives = GaitPrimitives();
  primitives[0].exit.root_pitch_rad -= 0.05;
  EXPECT_THAT(Refusal(GaitText(), primitives),
              AllOf(HasSubstr("up -> down: root, pitch:"), HasSubstr("0.05 rad apart")));
  EXPECT_EQ(Refusal(GaitText() + "[tolerances]\nroot_pitch_rad = 0.06\n", primitives), "accepted");
  // A whole turn is no difference.
  primitives[0].exit.root_pitch_rad += 0.05 + 6 * kPi;
  EXPECT_EQ(Refusal(GaitText(), primitives), "accepted");
}

/// A sequence of two motions in space, the second of which begins turned by half an angle about an
/// axis: "x", or "z".
std::string RefusalInSpace(double half_angle_rad, char axis, const std::string& more = "") {
  auto primitives = GaitPrimitives();
  for (PrimitiveFile& primitive : primitives) {
    for (PrimitivePose* pose : {&primitive.entry, &primitive.exit}) {
      pose->root_pitch_rad = 0;
      pose->root_quaternion = {1, 0, 0, 0};
    }
  }
  const double w = std::cos(half_angle_rad), s = std::sin(half_angle_rad);
  primitives[1].entry.root_quaternion = {w, axis == 'x' ? s : 0, 0, axis == 'z' ? s : 0};
  return Refusal(R"(format = "tumbler-sequence"
version = 1
name = "in space"
start = "up"
[primitives]
up = "up.toml"
down = "down.toml"
[[node]]
name = "up"
primitive = "up"
[[node]]
name = "down"
primitive = "down"
safe = true
[[edge]]
from = "up"
to = "down"
when = "always"
settle_s = 1.0
)" + more,
                 primitives);
}

TEST(SequenceToml, InSpaceWhatIsVerticalMeetsAndTheHeadingDoesNotCount) {
  EXPECT_EQ(RefusalInSpace(0, 'x'), "accepted");
  EXPECT_EQ(RefusalInSpace(0.6, 'z'), "accepted");
  EXPECT_THAT(RefusalInSpace(0.025, 'x'),
              AllOf(HasSubstr("up -> down: root, tilt: 0.05 rad"), HasSubstr("allowed: 0.02 rad")));
  EXPECT_EQ(RefusalInSpace(0.025, 'x', "[tolerances]\nroot_pitch_rad = 0.06\n"), "accepted");
}

TEST(SequenceToml, InSpaceNothingIsToldApartByAPitch) {
  EXPECT_THAT(RefusalInSpace(0, 'x', "[begin]\nnodes = [\"up\"]\nlink = \"base\"\n"),
              HasSubstr("begin: tells poses apart by a pitch, and is for robots in the plane"));
  EXPECT_THAT(
      RefusalInSpace(0, 'x', "[swap]\njoints = [[\"joint1\", \"joint2\"]]\nroot_pitch_rad = 0.0\n"),
      HasSubstr("swap: turns the root by a pitch, and is for robots in the plane"));
  auto primitives = GaitPrimitives();
  primitives[1].entry.root_pitch_rad = primitives[1].exit.root_pitch_rad = 0;
  primitives[1].entry.root_quaternion = primitives[1].exit.root_quaternion = {1, 0, 0, 0};
  EXPECT_THAT(Refusal(GaitText(), primitives),
              HasSubstr("primitives.down: 'down.toml' is of a robot in space, 'up' of one in the "
                        "plane"));
}

TEST(SequenceToml, WithoutTheTurnOfTheRootRolesCannotBeExchanged) {
  EXPECT_THAT(Refusal(Replaced(GaitText(), "root_pitch_rad = 3.14", "root_pitch_rad = 0.14")),
              AllOf(HasSubstr("down -> up, swapped: root, pitch"), HasSubstr("3 rad apart")));
}

TEST(SequenceToml, AJointKeepsItsOwnLimitsOnTheOthersPath) {
  auto primitives = GaitPrimitives();
  // The slower joint of "down" may not move as fast as the other joint does.
  auto& joints = primitives[1].primitive.joints;
  const auto fastest = [&joints](std::size_t j) {
    const Extent velocity = ExtentOf(joints[j].position, 1);
    return std::max(-velocity.min, velocity.max);
  };
  const std::size_t slow = fastest(0) < fastest(1) ? 0 : 1;
  joints[slow].limits.velocity_max_rad_s = 0.5 * (fastest(0) + fastest(1));
  const std::string name(joints[slow].name.view()), other(joints[1 - slow].name.view());
  EXPECT_THAT(Refusal(GaitText(), primitives),
              AllOf(HasSubstr("node[3]: primitive 'down', joint '" + name + "' on the path of '" +
                              other + "': velocity is"),
                    HasSubstr(" rad/s at "), HasSubstr("too much")));
}

TEST(SequenceToml, ComparesEveryQuantityAtEveryEdge) {
  const SequenceFolder folder(GaitText());
  const SequenceFile file = ReadSequence(folder.file());
  const auto comparisons = CompareJoins(file);
  EXPECT_EQ(comparisons.size(), 5U * (2 * 5 + 2)) << "two joints, held, and the root";
  for (const JoinComparison& c : comparisons) EXPECT_TRUE(c.fits()) << Describe(file, c);
}

/// The gait with "up" to the other side (1), which ends on the other leg, after a fall.
std::string WithAnotherWay(const std::string& after_fall = "up to the other side") {
  std::string text =
      Replaced(GaitText(), "out = \"out.toml\"\n", "out = \"out.toml\"\nother = \"other.toml\"\n");
  text = Replaced(text, "name = \"up\"\nprimitive = \"up\"\n",
                  "name = \"up\"\nprimitive = \"up\"\nafter_fall = \"" + after_fall + "\"\n");
  return text +
         "[[node]]\nname = \"up to the other side\"\nprimitive = \"other\"\nsafe = true\n"
         "[[node]]\nname = \"out, swapped\"\nprimitive = \"out\"\nswapped = true\nsafe = true\n"
         "[[edge]]\nfrom = \"up to the other side\"\nto = \"down, swapped\"\n"
         "[[edge]]\nfrom = \"up to the other side\"\nto = \"out, swapped\"\n"
         "when = \"branch\"\nbranch = \"leave\"\n"
         "[begin]\nnodes = []\nlink = \"base\"\n";
}
std::vector<PrimitiveFile> GaitPrimitivesWithAnotherWay(double leg1_rad = -1,
                                                        double pitch_rad = 0) {
  auto primitives = GaitPrimitives();
  primitives.push_back(
      testing::MotionBetween("other", {leg1_rad, 1}, {0, 0}, pitch_rad, -kPi / 2, 4));
  return primitives;
}

TEST(SequenceToml, ANodeMayBePlayedInPlaceOfAnotherAfterAFall) {
  const SequenceFolder folder(WithAnotherWay(), GaitPrimitivesWithAnotherWay());
  const SequenceFile file = LoadSequence(folder.file());
  const int up = file.graph.FindNode("up"), other = file.graph.FindNode("up to the other side");
  EXPECT_EQ(file.graph.node(up).after_fall, other);
  EXPECT_EQ(file.graph.node(other).after_fall, -1);
  EXPECT_EQ(ToRuntime(file).graph.node(up).after_fall, other);
  int in_its_place = 0;
  for (const JoinComparison& c : CompareJoins(file)) {
    if (file.graph.edge(c.edge).to == c.to) continue;
    EXPECT_EQ(file.graph.edge(c.edge).to, up);
    EXPECT_EQ(c.to, other);
    EXPECT_THAT(Describe(file, c), HasSubstr("-> up to the other side: "));
    ++in_its_place;
  }
  EXPECT_EQ(in_its_place, 2 * 5 + 2) << "along the one edge to \"up\"";
}

TEST(SequenceToml, WhatIsPlayedInPlaceOfANodeBeginsLikeIt) {
  const auto refusal = [](const std::string& text, double leg1_rad = -1, double pitch_rad = 0) {
    return Refusal(text, GaitPrimitivesWithAnotherWay(leg1_rad, pitch_rad));
  };
  EXPECT_EQ(refusal(WithAnotherWay()), "accepted");
  EXPECT_THAT(
      refusal(WithAnotherWay("nowhere")),
      HasSubstr("node[0].after_fall: is no node; allowed: another node that has none itself: "
                "down, up, swapped, down, swapped, out, up to the other side, out, swapped"));
  EXPECT_THAT(refusal(WithAnotherWay("")), HasSubstr("node[0].after_fall: is no node"));
  EXPECT_THAT(refusal(WithAnotherWay("up")), HasSubstr("after_fall: is 'up'; allowed: another"));
  EXPECT_THAT(
      refusal(Replaced(WithAnotherWay(), "primitive = \"other\"\n",
                       "primitive = \"other\"\nafter_fall = \"down\"\n")),
      HasSubstr("node[0].after_fall: is 'up to the other side'; allowed: another node that has"));
  EXPECT_THAT(
      refusal(Replaced(WithAnotherWay(), "[begin]\nnodes = []\nlink = \"base\"\n", "")),
      HasSubstr("after_fall: is for robots that get up, and the sequence does not say how"));
  EXPECT_THAT(refusal(WithAnotherWay(), -0.9),
              HasSubstr("begins with joint 'joint1' 0.1 rad away"));
  EXPECT_THAT(refusal(WithAnotherWay(), -1, 0.1),
              HasSubstr("begins with the root's pitch 0.1 rad away; allowed: 0.02 rad"));
}

TEST(SequenceToml, WhatIsPlayedInPlaceOfANodeLeadsOnLikeIt) {
  const auto refusal = [](const std::string& from, const std::string& to) {
    return Refusal(Replaced(WithAnotherWay(), from, to), GaitPrimitivesWithAnotherWay());
  };
  EXPECT_THAT(
      refusal("primitive = \"other\"\nsafe = true\n", "primitive = \"other\"\n"),
      HasSubstr("node[0].after_fall: is 'up to the other side', which has another safe or"));
  EXPECT_THAT(refusal("primitive = \"other\"\n", "primitive = \"other\"\nends_cycle = true\n"),
              HasSubstr("which has another safe or ends_cycle"));
  EXPECT_THAT(refusal("to = \"out, swapped\"\nwhen = \"branch\"\nbranch = \"leave\"\n",
                      "to = \"out, swapped\"\nwhen = \"branch\"\nbranch = \"go\"\n"),
              HasSubstr("of both only 'up' has an edge with when = \"branch\" of the branch "
                        "'leave'; allowed: edges for the same"));
  EXPECT_THAT(refusal("[[edge]]\nfrom = \"up to the other side\"\nto = \"down, swapped\"\n", ""),
              HasSubstr("of both only 'up' has an edge with when = \"always\"; allowed"));
}

TEST(SequenceToml, AStopEndsAlsoWhereOtherNodesArePlayedAfterFalls) {
  // From "second" a stop ends; from the node in its place it comes back to "first".
  const auto text = [](const std::string& leads_to) {
    std::string all =
        "format = \"tumbler-sequence\"\nversion = 1\nname = \"s\"\nstart = \"first\"\n"
        "[primitives]\nstay = \"stay.toml\"\n[begin]\nnodes = []\nlink = \"base\"\n";
    for (const std::string name : {"first", "second", "in its place", "last"}) {
      all.append("[[node]]\nname = \"").append(name).append("\"\nprimitive = \"stay\"\n");
      if (name == "second") all += "after_fall = \"in its place\"\n";
      if (name == "last") all += "safe = true\n";
    }
    const std::vector<std::pair<std::string, std::string>> edges{
        {"first", "second"}, {"second", "last"}, {"in its place", leads_to}};
    for (const auto& [from, to] : edges) {
      all.append("[[edge]]\nfrom = \"").append(from);
      all.append("\"\nto = \"").append(to).append("\"\n");
    }
    return all;
  };
  const std::vector<PrimitiveFile> stays{testing::MotionBetween("stay", {0, 0}, {0, 0}, 0, 0, 1)};
  EXPECT_EQ(Refusal(text("last"), stays), "accepted");
  EXPECT_THAT(Refusal(text("first"), stays), HasSubstr("a stop at 'first' never ends"));
}

TEST(SequenceToml, ComparesHowTheRootMovesAndWhereJointsWithoutAMotorAre) {
  const SequenceFolder folder(GaitText());
  SequenceFile file = ReadSequence(folder.file());
  const auto misfits = [&file] {
    std::vector<std::string> said;
    for (const JoinComparison& c : CompareJoins(file))
      if (!c.fits()) said.push_back(Describe(file, c));
    return said;
  };
  ASSERT_THAT(misfits(), ::testing::IsEmpty());
  const SequenceEdge<double>& edge = file.graph.edge(0);
  PrimitiveFile& before = file.primitives[Index(file.graph.node(edge.from).primitive)];
  PrimitiveFile& after = file.primitives[Index(file.graph.node(edge.to).primitive)];
  before.exit.root_z_m_s = 0.5;
  EXPECT_THAT(misfits(), ::testing::Contains(HasSubstr("root, velocity along z: 0.5 m/s at the")));
  after.entry.root_z_m_s = 0.49;
  before.exit.root_pitch_rad_s = 0.3;
  EXPECT_THAT(misfits(), ::testing::Contains(HasSubstr("root, pitch rate: 0.3 rad/s")));
  before.exit.root_pitch_rad_s = 0;
  before.exit.passive_positions_rad = {0.1};
  after.entry.passive_positions_rad = {0.15};
  EXPECT_THAT(misfits(),
              ::testing::Contains(HasSubstr("joint 'no. 1', position without a motor: 0.1 rad")));
}

TEST(SequenceToml, NotANumberNeverFits) {
  JoinComparison comparison;
  comparison.tolerance = 1;
  comparison.difference = std::nan("");
  EXPECT_FALSE(comparison.fits());
}

struct Bad {
  const char* from;
  const char* to;
  const char* after;
  const char* said;
};

TEST(SequenceToml, EachWrongFileIsToldWhatIsWrong) {
  const Bad cases[] = {
      {"tumbler-sequence", "tumbler-task", "", "format: is 'tumbler-task'; a sequence says"},
      {"tumbler-sequence", "tumbler-primitive", "",
       "format: is 'tumbler-primitive', which is one motion; a sequence says 'tumbler-sequence' "
       "and names the primitives that it plays. What a motion alone does is shown by tumbler run "
       "sim"},
      {"version = 1", "version = 2", "", "version: is 2; this program reads versions up to 1"},
      {"version = 1", "version = 0", "", "version: is 0"},
      {"name = \"gait\"", "name = \"\"", "", "name: is '', 0 bytes; allowed: from 1 ... 48"},
      {"start = \"up\"", "start = \"left\"", "",
       "start: is 'left', which is no node; allowed: up, down, up, swapped, down, swapped, out"},
      {"start = \"up\"", "", "", "start: is missing"},
      {"up = \"up.toml\"", "up = \"nowhere.toml\"", "", "primitives.up: 'nowhere.toml' does not"},
      {"up = \"up.toml\"", "up = 3", "", "primitives.up: is an integer; expected a string"},
      {"up = \"up.toml\"", "up = \"gait.toml\"", "", "a primitive says"},
      {"up = \"up.toml\"", "", "", "node[0].primitive: is 'up'; allowed: down, out"},
      {"[[\"joint1\", \"joint2\"]]", "[\"joint1\", \"joint2\"]", "",
       "swap.joints: is a string; expected an array of strings"},
      {"[[\"joint1\", \"joint2\"]]", "[[\"joint1\"]]", "", "swap.joints: has an entry of 1 names"},
      {"[[\"joint1\", \"joint2\"]]", "[[\"joint1\", \"leg\"]]", "",
       "swap.joints: 'leg' is not a joint of the primitives; their joints: joint1, joint2"},
      {"[[\"joint1\", \"joint2\"]]", "[[\"joint1\", \"joint1\"]]", "", "'joint1' with itself"},
      {"[[\"joint1\", \"joint2\"]]", "[[\"joint1\", \"joint2\"], [\"joint2\", \"joint1\"]]", "",
       "names 'joint2' twice; a joint has one partner"},
      {"root_pitch_rad = 3.14", "root_pitch_rad = 13.14", "", "swap.root_pitch_rad: is 13.1"},
      {"root_pitch_rad = 3.141592653589793", "", "", "swap.root_pitch_rad: is missing"},
      {"name = \"down\"", "name = \"up\"", "", "node[1].name: 'up' is there twice"},
      {"primitive = \"out\"", "primitive = \"ou\"", "", "allowed: up, down, out (of [primitives])"},
      {"swapped = true", "swapped = 1", "", "node[2].swapped: is an integer; expected true or"},
      {"safe = true", "safe = false", "name = \"out\"",
       "node[4]: 'out' is not safe, but a sequence can end there"},
      {"to = \"down\"", "to = \"dwon\"", "", "edge[0].to: is 'dwon', which is no node; allowed:"},
      {"from = \"up\"", "from = \"pu\"", "", "edge[0].from: is 'pu', which is no node"},
      {"settle_s = 1.5", "settle_s = -1", "", "edge[0].settle_s: is -1; allowed: from 0 ... 60"},
      {"settle_s = 1.5", "settle_s = 0.01", "", "is 0.01; allowed: from 0.05 (the settle time of"},
      {"settle_s = 1.5", "settle_s = nan", "", "edge[0].settle_s: is nan"},
      {"when = \"branch\"", "when = \"never\"", "", "allowed: always, branch, cycles-done"},
      {"branch = \"leave\"", "", "", "edge[4].branch: is missing"},
      {"when = \"branch\"\n", "", "", "edge[4].branch: belongs to an edge with when = \"branch\""},
      {"when = \"branch\"\nbranch = \"leave\"", "", "",
       "edge[4].from: 'up' has two edges for when = \"always\""},
      {"settle_s = 1.5", "setle_s = 1.5", "", "setle_s: is not a key that this file can hold"},
      {"from = \"up\"\nto = \"out\"", "from = \"down\"\nto = \"up\"", "",
       "node[4]: no edge leads to 'out' from the start, 'up'"},
  };
  for (const Bad& bad : cases) {
    const std::string text = Replaced(GaitText(), bad.from, bad.to, bad.after);
    EXPECT_THAT(Refusal(text), AllOf(HasSubstr(bad.said), HasSubstr(".toml")))
        << bad.from << " -> " << bad.to;
  }
  EXPECT_THAT(Refusal(GaitText() + "[tolerances]\nroot_z_m = 0\n"),
              HasSubstr("tolerances.root_z_m: is 0; allowed: above 0 ... 1"));
  EXPECT_THAT(Refusal(GaitText() + "[tolerances]\njoint_position_rad = 0.1\n"),
              HasSubstr("tolerances.joint_position_rad: is 0.1; allowed: from 0 ... 0.01"));
  EXPECT_THAT(
      Refusal(GaitText() + "[[edge]]\nfrom = \"out\"\nto = \"up\"\nwhen = \"branch\"\nbranch = \"a "
                           "name that is longer than thirty-two bytes\"\n"),
      HasSubstr("edge[5].branch:"));
  // A swapped node needs the table [swap].
  std::string text = Replaced(GaitText(), "[swap]\njoints = [[\"joint1\", \"joint2\"]]\n", "");
  EXPECT_THAT(Refusal(Replaced(text, "root_pitch_rad = 3.141592653589793\n", "")),
              HasSubstr("node[2].swapped: is true, but the file does not say which joints"));
}

TEST(SequenceToml, ARunMayBeginWithSeveralNodesIfTheirJointsBeginAlikeAndTheirPitchesApart) {
  const SequenceFile file = LoadSequence(testing::SourcePath("primitives/get_up.toml"));
  const SequenceGraph<double>& graph = file.graph;
  ASSERT_EQ(graph.beginning_count, 4);
  EXPECT_EQ(graph.beginnings()[0].node, graph.start);
  EXPECT_EQ(file.begin_link, "middle");
  const SequenceBeginning<double>& rise = graph.beginnings()[1];
  EXPECT_EQ(graph.node(rise.node).name.view(), "rise");
  EXPECT_EQ(rise.pitch_rad, file.PrimitiveOf(rise.node).entry.root_pitch_rad);
  const Sequence<float> sequence = ToRuntime(file);
  EXPECT_EQ(sequence.graph.beginning_count, 4);
  EXPECT_EQ(sequence.graph.beginnings()[1].pitch_rad, static_cast<float>(rise.pitch_rad));
  EXPECT_EQ(sequence.graph.beginning_within_rad, 0.4F);
  // Where each node leaves the robot: by the exit of its primitive, turned with the roles.
  for (int i = 0; i < graph.node_count; ++i) {
    const double exit_rad = file.PrimitiveOf(i).exit.root_pitch_rad;
    const double turned_rad = graph.node(i).swapped ? file.swap_root_pitch_rad : 0;
    EXPECT_EQ(graph.last_pitch_rad[static_cast<std::size_t>(i)], exit_rad + turned_rad);
    EXPECT_EQ(sequence.graph.last_pitch_rad[static_cast<std::size_t>(i)],
              static_cast<float>(exit_rad + turned_rad));
  }

  const auto with = [](const std::string& keys) { return GaitText() + "[begin]\n" + keys; };
  const std::string link = "link = \"middle\"\n";
  EXPECT_THAT(Refusal(with(link)), HasSubstr("begin.nodes: is missing"));
  EXPECT_THAT(Refusal(with("nodes = [\"out\"]\n")), HasSubstr("begin.link: is missing"));
  EXPECT_THAT(Refusal(with(link + "nodes = [\"our\"]\n")),
              HasSubstr("begin.nodes: has 'our', which is no node"));
  EXPECT_THAT(Refusal(with(link + "nodes = [\"up\"]\n")),
              HasSubstr("'up' twice, or it is `start`"));
  EXPECT_THAT(Refusal(with(link + "nodes = [\"down\"]\n")),
              HasSubstr("begin.nodes: has 'down', in which joint 'joint1' begins at"));
  EXPECT_THAT(Refusal(with(link + "nodes = [\"out\"]\nwithin_rad = 2\n")),
              HasSubstr("begin.within_rad: is 2; allowed: above 0 ... 1.57"));
  const std::string again = "[[node]]\nname = \"again\"\nprimitive = \"up\"\nsafe = true\n";
  EXPECT_THAT(Refusal(GaitText() + again), HasSubstr("no edge leads to 'again'"));
  EXPECT_THAT(Refusal(GaitText() + again + "[begin]\n" + link + "nodes = [\"again\"]\n"),
              HasSubstr("has 'again', which begins 0 rad of pitch from 'up'"));
}

TEST(SequenceToml, AStopThatWouldNeverEndIsRefused) {
  std::string text = GaitText();
  for (const char* node :
       {"name = \"up\"", "name = \"down\"", "name = \"up, swapped\"", "name = \"down, swapped\""}) {
    text = Replaced(text, "safe = true", "safe = false", node);
  }
  EXPECT_THAT(Refusal(text), HasSubstr("node[0]: a stop at 'up' never ends"));
}

TEST(SequenceToml, WaitingForCyclesThatNothingEndsIsRefused) {
  std::string text =
      Replaced(GaitText(), "when = \"branch\"\nbranch = \"leave\"", "when = \"cycles-done\"");
  EXPECT_EQ(Refusal(text), "accepted");
  text = Replaced(text, "ends_cycle = true\n", "");
  text = Replaced(text, "ends_cycle = true\n", "");
  EXPECT_THAT(Refusal(text), HasSubstr("edge: waits for cycles to be done, but no node says"));
}

TEST(SequenceToml, PrimitivesOfOtherJointsOrRobotsAreRefused) {
  auto primitives = GaitPrimitives();
  std::swap(primitives[1].primitive.joints[0], primitives[1].primitive.joints[1]);
  std::swap(primitives[1].entry.joint_positions_rad[0], primitives[1].entry.joint_positions_rad[1]);
  std::swap(primitives[1].exit.joint_positions_rad[0], primitives[1].exit.joint_positions_rad[1]);
  EXPECT_THAT(Refusal(GaitText(), primitives),
              HasSubstr("primitives.down: joint 0 of 'down.toml' is 'joint2', of 'up' it is "
                        "'joint1'"));
  primitives = GaitPrimitives();
  primitives[2].provenance.robot_urdf += "<!-- another -->";
  primitives[2].provenance.robot_hash = HashOfText(primitives[2].provenance.robot_urdf);
  EXPECT_THAT(Refusal(GaitText(), primitives),
              HasSubstr("primitives.out: 'out.toml' was made for another robot"));
}

TEST(SequenceToml, AMissingFileIsNamed) {
  EXPECT_THROW(LoadSequence("/nowhere/gait.toml"), FileError);
}

TEST(SequenceToml, TheTablesOfTheDocumentAreThoseOfTheCode) {
  testing::ExpectTables("docs/formats.md", SequenceKeyTables());
}

}  // namespace
}  // namespace tumbler
