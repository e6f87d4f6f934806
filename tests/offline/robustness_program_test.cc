// tumbler robustness.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"
#include "offline/studies/study.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/robustness_study.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;
using ::testing::HasSubstr;

/// A study that the program takes, with its JSON on standard output.
std::string LaneStudy(const std::string& more) {
  return "tumbler robustness " + testing::SourcePath("primitives/handstand.toml") +
         " --lanes --scale 2.5 --seed 17 --robots 2000 --json - " + more + " 2>/dev/null";
}

TEST(RobustnessProgram, AWorkThatWasKilledAndGoesOnHasTheSameBytes) {
  const testing::TemporaryFolder folder;
  const std::string checkpoint = folder / "robots";
  const testing::Outcome whole = testing::RunInShell(LaneStudy(""));
  ASSERT_EQ(whole.exit_code, 0);
  for (int kills = 0; kills < 2; ++kills) {
    // Ended as soon as there is more in the file than there was.
    const testing::Outcome killed = testing::RunInShell(fmt::format(
        "size=$(wc -l < {0} 2>/dev/null || echo 1); {1} >/dev/null & pid=$!; "
        "while [ \"$(wc -l < {0} 2>/dev/null || echo 0)\" -le $size ]; do sleep 0.01; done; "
        "kill -9 $pid; wait $pid; echo status $?",
        checkpoint, LaneStudy("--checkpoint " + checkpoint)));
    EXPECT_NE(killed.text.find("status 137"), std::string::npos) << killed.text;
  }
  const testing::Outcome resumed = testing::RunInShell(LaneStudy("--checkpoint " + checkpoint));
  EXPECT_EQ(resumed.exit_code, 0);
  EXPECT_EQ(resumed.text, whole.text);
}

TEST(RobustnessProgram, EndsAtAnInterruptSaysHowFarItCameAndGoesOnFromThere) {
  const testing::TemporaryFolder folder;
  const std::string checkpoint = folder / "robots";
  const std::string study = testing::SourcePath("primitives/handstand.toml") +
                            " --lanes --seed 17 --checkpoint " + checkpoint;
  testing::Program endless({"/bin/sh", "-c",
                            "exec " + testing::ProgramPath("tumbler robustness") +
                                " --robots 10000000 --json " + (folder / "x.json") + " " + study});
  ASSERT_TRUE(testing::Eventually([&] {
    return std::filesystem::exists(checkpoint) && std::filesystem::file_size(checkpoint) > 10'000;
  }));
  endless.Signal(SIGINT);
  EXPECT_EQ(endless.Wait(), 130) << endless.text();
  EXPECT_THAT(endless.text(),
              ::testing::HasSubstr("of 10000000 robots are known; " + checkpoint + " has them\n"));
  EXPECT_EQ(endless.text().find('\x1b'), std::string::npos) << "no terminal, no escapes";
  EXPECT_EQ(folder.Listing(), (std::set<std::string>{"robots"}));
  const testing::Outcome quiet =
      testing::RunInShell("tumbler robustness --quiet --robots 32 " + study);
  EXPECT_EQ(quiet.exit_code, 0) << quiet.text;
  EXPECT_EQ(quiet.text.find("/32 robots"), std::string::npos) << quiet.text;
}

TEST(RobustnessProgram, APartOfTheWorkNeedsAFileAndItsNumbers) {
  const std::string motion = testing::SourcePath("primitives/handstand.toml");
  for (const std::string shard : {"0/2", "3/2", "1", "1/", "1/2x", "-1/2"}) {
    const testing::Outcome outcome =
        testing::RunProgram({"tumbler robustness", motion, "--shard=" + shard});
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.text.find("--shard"), std::string::npos) << outcome.text;
  }
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler robustness", motion, "--shard", "1/2"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.text.find("--checkpoint"), std::string::npos) << outcome.text;
}

TEST(RobustnessProgram, TellsOnHowManyLanesAndTwinAgreeAndWritesThePage) {
  const testing::TemporaryFolder folder;
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler robustness", testing::SourcePath("primitives/handstand.toml"),
                           "--robots", "4", "--compare-lanes", "--report", folder / "page"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("lanes and twin agree whether"), std::string::npos) << outcome.text;
  EXPECT_NE(testing::ReadFile(folder / "page/index.html").find("<h2>Verdicts"), std::string::npos);
}

TEST(RobustnessProgram, PlaysAnArmOnAWallAndRefusesWhatTakesARobotThatMovesAbout) {
  const testing::TemporaryFolder folder;
  const std::string arm = folder / "arm.toml";
  const testing::Outcome found =
      testing::RunProgram({"tumbler optimize", testing::SourcePath("tests/data/tasks/arm.toml"),
                           "--quiet", "--out", arm});
  ASSERT_EQ(found.exit_code, 0) << found.text;
  // Its task asks for nothing that could be missed, and a fixed root has no pitch to compare.
  const std::string before = testing::ReadFile(arm);
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler robustness", arm, "--robots", "4", "--certify", "--json", folder / "arm.json"});
  EXPECT_EQ(outcome.exit_code, 4) << outcome.text;
  EXPECT_THAT(outcome.text,
              HasSubstr("none of 4 robots was judged\n  4 robots were not judged: its "
                        "task asks for nothing"));
  EXPECT_THAT(outcome.text, HasSubstr("nothing was certified"));
  EXPECT_THAT(outcome.text, ::testing::Not(HasSubstr("100.0 %")));
  EXPECT_EQ(testing::ReadFile(arm), before);
  const std::optional<Json> json = Json::Parse(testing::ReadFile(folder / "arm.json"));
  ASSERT_TRUE(json);
  EXPECT_EQ((*json)["judged"].number(), 0);
  EXPECT_TRUE((*json)["share"].is_null());
  EXPECT_EQ((*json)["not_judged"].size(), 4U);
  for (const std::string option : {"--push=2", "--drops", "--lanes"}) {
    const testing::Outcome refused =
        testing::RunProgram({"tumbler robustness", arm, "--robots", "1", option});
    EXPECT_EQ(refused.exit_code, 2) << refused.text;
    EXPECT_THAT(refused.text,
                HasSubstr(option == "--lanes" ? "cannot be simulated in lanes: the robot's root is "
                                                "fixed"
                                              : "leave out " + option.substr(0, option.find('='))));
  }
  testing::WriteFile(folder / "wave.toml",
                     "format = \"tumbler-sequence\"\nversion = 1\nname = \"wave\"\n"
                     "start = \"wave\"\nprimitives = { wave = \"arm.toml\" }\n"
                     "[[node]]\nname = \"wave\"\nprimitive = \"wave\"\nsafe = true\n");
  const testing::Outcome chain =
      testing::RunProgram({"tumbler chain", "simulate", folder / "wave.toml", "--json", "-"});
  EXPECT_THAT(chain.text, HasSubstr("\"fixed\"")) << "it is neither level nor upright";
  EXPECT_THAT(testing::RunProgram({"tumbler run", "sim", arm}).text,
              HasSubstr("without torque, 3 s later: the robot is limp where it is fixed to the "
                        "world, its joints at "));
}

TEST(RobustnessProgram, WhatARunWouldRefuseIsRefusedOfRobotsAndAbortsToo) {
  const testing::TemporaryFolder folder;
  const std::string motion = folder / "handstand.toml";
  const std::string text = testing::ReadFile(testing::SourcePath("primitives/handstand.toml"));
  testing::WriteFile(motion, text);
  const std::string drives =
      Written(folder, "drives.toml",
              testing::ReplacedAll(
                  testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml")),
                  "torque_nm = [-18.0, 18.0]", "torque_nm = [-5.0, 5.0]"));
  testing::WriteFile(
      drives, testing::ReplacedAll(testing::ReadFile(drives), "[-12.5, 12.5]", "[-2.0, 2.0]"));
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"tumbler run", "sim", motion},
        {"tumbler robustness", motion, "--robots", "2", "--certify"},
        {"tumbler abort", motion, "--robots", "2", "--write"}}) {
    std::vector<std::string> with_drives = command;
    with_drives.insert(with_drives.end(), {"--drives", drives});
    const testing::Outcome refused = testing::RunProgram(with_drives);
    EXPECT_EQ(refused.exit_code, 2) << refused.text;
    EXPECT_THAT(refused.text, HasSubstr("torque limit is "));
    EXPECT_THAT(refused.text, HasSubstr("whose range is -5 ... 5 N m"));
    for (const char* joint : {"joint leg1: ", "joint leg2: "}) {
      for (const char* what : {"position limit is 2.9 rad", "torque limit is "})
        EXPECT_THAT(refused.text, HasSubstr(std::string(joint) + "the motion's " + what));
    }
  }
  EXPECT_EQ(testing::ReadFile(motion), text);
}

TEST(RobustnessProgram, APushTakesAModelThatStands) {
  const testing::TemporaryFolder folder;
  const std::string motion = testing::SourcePath("primitives/handstand.toml");
  const std::string twin = Written(
      folder, "twin.toml",
      fmt::format("format = \"tumbler-twin\"\nversion = 1\nmotion = \"{}\"\ndrives = \"{}\"\n"
                  "[motor]\ntorque_max_nm = 0.5\n",
                  motion, testing::SourcePath("primitives/robots/tumbler_drives.toml")));
  const testing::Outcome refused =
      testing::RunProgram({"tumbler robustness", motion, "--robots", "2", "--twin", twin, "--push",
                           "2", "--hold-s", "12"});
  EXPECT_EQ(refused.exit_code, 2) << refused.text;
  EXPECT_THAT(refused.text, HasSubstr("the model itself is not as asked, so there is no hold"));
}

TEST(RobustnessProgram, ARobotThatMayGetUpIsNotPushed) {
  const testing::Outcome refused = testing::RunProgram(
      {"tumbler robustness", testing::SourcePath("primitives/gait_sensor.toml"), "--robots", "1",
       "--cycles", "1", "--push", "2", "--get-ups", "1", "--drives",
       testing::SourcePath("primitives/robots/tumbler_drives_sensor.toml")});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.text, HasSubstr("--push: comes at a time in the model's hold"));
}

TEST(RobustnessProgram, PutsNoResultInThePlaceOfAnother) {
  const testing::TemporaryFolder folder;
  for (const auto& [json, why] :
       {std::pair(folder / "page/index.html", "is named for two results"),
        std::pair(folder / "page", "/page', which is a result, too, and no folder")}) {
    const testing::Outcome outcome =
        testing::RunProgram({"tumbler robustness", testing::SourcePath("primitives/handstand.toml"),
                             "--robots", "1", "--report", folder / "page", "--json", json});
    EXPECT_EQ(outcome.exit_code, 1) << outcome.text;
    EXPECT_NE(outcome.text.find(why), std::string::npos) << outcome.text;
    EXPECT_FALSE(std::filesystem::exists(folder / "page"));
  }
}

TEST(RobustnessProgram, PrintsShareAndIntervalAndWritesThem) {
  const testing::TemporaryFolder folder;
  const std::string json_file = folder / "figures.json";
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler robustness", testing::SourcePath("primitives/nominal/handstand.toml"), "--robots",
       "1", "--scale", "0", "--json", json_file});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("1 of 1 robots are as asked"), std::string::npos) << outcome.text;
  const std::optional<Json> json = Json::Parse(testing::ReadFile(json_file));
  ASSERT_TRUE(json);
  EXPECT_EQ((*json)["robots"].number(), 1);
  EXPECT_EQ((*json)["as_asked"].number(), 1);
  EXPECT_EQ((*json)["spreads"]["mass"].number(), 0.05);
}

/// A folder with a gait's files, which a program may change.
std::string CopyOfTheGait(const testing::TemporaryFolder& folder) {
  for (const std::string name : {"gait", "handstand", "downstand_back", "roll", "rise",
                                 "rise_from_leg1", "rise_from_leg2"}) {
    Written(folder, name + ".toml",
            testing::ReadFile(testing::SourcePath("primitives/" + name + ".toml")));
  }
  return folder / "gait.toml";
}

/// What a primitive says of robots, of those with this seed.
std::vector<RobustnessFigure> FiguresIn(const std::string& path, std::uint64_t seed) {
  std::vector<RobustnessFigure> figures = LoadPrimitive(path).robustness;
  std::erase_if(figures, [seed](const RobustnessFigure& figure) { return figure.seed != seed; });
  return figures;
}

TEST(RobustnessProgram, ACertificateGetsTheShareAndANewerOneTakesItsPlace) {
  const testing::TemporaryFolder folder;
  CopyOfTheGait(folder);
  const std::string motion = folder / "handstand.toml";
  const Primitive<double> before = LoadPrimitive(motion).primitive;
  const auto certify = [&](const std::string& robots, const std::string& seed) {
    return testing::RunProgram({"tumbler robustness", motion, "--lanes", "--robots", robots,
                                "--seed", seed, "--mass", "0.07", "--certify"});
  };
  const testing::Outcome first = certify("8", "9001");
  EXPECT_EQ(first.exit_code, 0) << first.text;
  EXPECT_NE(first.text.find("wrote the share into " + motion), std::string::npos) << first.text;
  const std::vector<RobustnessFigure> figures = FiguresIn(motion, 9001);
  ASSERT_EQ(figures.size(), 1U);
  EXPECT_EQ(figures[0].robots, 8);
  EXPECT_EQ(figures[0].cycles, 0);
  EXPECT_EQ(figures[0].where, RobustnessFigure::Where::kLanes);
  EXPECT_NE(first.text.find(std::to_string(figures[0].stand) + " of 8 robots"), std::string::npos)
      << first.text;
  EXPECT_EQ(figures[0].spreads, "--mass 0.07 --friction 0.2 --stiffness 0.2 --damping 0.2");
  EXPECT_EQ(certify("16", "9002").exit_code, 0);
  EXPECT_TRUE(FiguresIn(motion, 9001).empty());
  ASSERT_EQ(FiguresIn(motion, 9002).size(), 1U);
  EXPECT_EQ(FiguresIn(motion, 9002)[0].robots, 16);
  const Primitive<double> after = LoadPrimitive(motion).primitive;
  for (std::size_t j = 0; j < before.motions().size(); ++j) {
    const auto points = before.motions()[j].position.control_points();
    const auto same = after.motions()[j].position.control_points();
    EXPECT_TRUE(std::equal(points.begin(), points.end(), same.begin(), same.end()));
  }
}

TEST(RobustnessProgram, LanesAreRefusedWhereTheModelsOwnRunIsBrokenOff) {
  const testing::TemporaryFolder folder;
  CopyOfTheGait(folder);
  const std::string motion = folder / "handstand.toml";
  PrimitiveFile file = LoadPrimitive(motion);
  file.primitive.following_tolerance_rad = 0.01;
  PendingFile(motion, ToToml(file)).Commit();
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler robustness", motion, "--lanes", "--robots", "8"});
  EXPECT_EQ(outcome.exit_code, 2) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("the model's own run is broken off"));
}

TEST(RobustnessProgram, TheShareOfAGaitGoesIntoThePrimitivesThatItPlaysWhichTheirProgramsShow) {
  const testing::TemporaryFolder folder;
  const std::string gait = CopyOfTheGait(folder);
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler robustness", gait, "--lanes", "--robots", "1", "--scale", "0",
                           "--cycles", "1", "--seed", "9003", "--certify"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  // Neither a branch was taken, nor did a robot lie when its run began.
  for (const std::string name : {"roll", "rise", "rise_from_leg1", "rise_from_leg2"})
    EXPECT_TRUE(FiguresIn(folder / (name + ".toml"), 9003).empty()) << name;
  for (const std::string name : {"handstand", "downstand_back"}) {
    const std::vector<RobustnessFigure> figures = FiguresIn(folder / (name + ".toml"), 9003);
    ASSERT_EQ(figures.size(), 1U) << name;
    EXPECT_EQ(figures[0].motion, "gait");
    EXPECT_EQ(figures[0].cycles, 1);
    EXPECT_EQ(figures[0].stand, 1);
  }
  const testing::Outcome chain = testing::RunProgram({"tumbler chain", "check", gait});
  EXPECT_EQ(chain.exit_code, 0) << chain.text;
  EXPECT_NE(chain.text.find("downstand: robots as asked: gait, 1 cycles: 1 of 1 robots"),
            std::string::npos)
      << chain.text;
}

TEST(RobustnessProgram, NoCertificateIsWrittenOfWhatItHasNoPlaceFor) {
  const testing::TemporaryFolder folder;
  const std::string gait = CopyOfTheGait(folder);
  const std::string motion = folder / "handstand.toml";
  const std::string before = testing::ReadFile(motion);
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{motion, "--twin",
                                 testing::SourcePath("primitives/robots/tumbler_twin.toml")},
        std::vector<std::string>{gait, "--branch", "roll"}}) {
    std::vector<std::string> command = {"tumbler robustness", "--robots", "1", "--certify"};
    command.insert(command.end(), more.begin(), more.end());
    const testing::Outcome outcome = testing::RunProgram(command);
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.text.find("--certify: "), std::string::npos) << outcome.text;
  }
  EXPECT_EQ(testing::ReadFile(motion), before);
}

TEST(RobustnessProgram, ARangeOfTheGroundIsInTheCertificateAndAWrongOneRefused) {
  const testing::TemporaryFolder folder;
  CopyOfTheGait(folder);
  const std::string motion = folder / "handstand.toml";
  const testing::Outcome done = testing::RunProgram(
      {"tumbler robustness", motion, "--lanes", "--robots", "8", "--seed", "9004", "--friction",
       "0.2..0.5", "--stiffness", "x2", "--damping", "0", "--certify"});
  EXPECT_EQ(done.exit_code, 0) << done.text;
  const std::vector<RobustnessFigure> figures = FiguresIn(motion, 9004);
  ASSERT_EQ(figures.size(), 1U);
  EXPECT_EQ(figures[0].spreads, "--mass 0.05 --friction 0.2..0.5 --stiffness x2");
  for (const std::string wrong : {"0.5..0.2", "x0.5", "some", "1.5"}) {
    const testing::Outcome refused = testing::RunProgram(
        {"tumbler robustness", motion, "--lanes", "--robots", "8", "--friction", wrong});
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.text, HasSubstr("--friction: ")) << wrong;
    EXPECT_THAT(refused.text, HasSubstr("allowed: a number from 0 to 1, a range of values"));
  }
}

TEST(RobustnessProgram, AGaitWithoutCyclesIsRefused) {
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler robustness", testing::SourcePath("primitives/nominal/gait.toml")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.text.find("--cycles"), std::string::npos) << outcome.text;
}

}  // namespace
}  // namespace tumbler
