// No program lets a result replace one of its inputs, or another result, by whatever name it is
// called.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/files/held_results.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Outcome;
using testing::ReadFile;
using testing::SourcePath;
using testing::WriteFile;

/// A folder with the gait, and with a flight record and a log of its handstand.
class Outputs : public ::testing::Test {
 protected:
  Outputs() {
    for (const char* name : {"gait.toml", "handstand.toml", "downstand.toml", "roll.toml"})
      WriteFile(folder_ / name, ReadFile(SourcePath(std::string("primitives/nominal/") + name)));
    WriteFile(folder_ / "twin.toml", "format = \"tumbler-twin\"\nversion = 1\n");
    WriteFile(folder_ / "own.urdf", ReadFile(SourcePath("primitives/robots/tumbler.urdf")));
    WriteFile(folder_ / "own.toml",
              "format = \"tumbler-twin\"\nversion = 1\nrobot = \"own.urdf\"\n");
    WriteFile(folder_ / "drives.toml",
              ReadFile(SourcePath("primitives/robots/tumbler_drives.toml")));
    const Outcome run = In("tumbler run sim handstand.toml --record x.rec --log x.lcm --hold-s 0");
    EXPECT_EQ(run.exit_code, 0) << run.text;
    EXPECT_EQ(In("tumbler record x.rec --candump x.log").exit_code, 0);
    std::filesystem::create_hard_link(std::string(folder_ / "x.rec"), folder_ / "hard.rec");
    std::filesystem::create_symlink("x.rec", folder_ / "soft.rec");
  }
  /// Runs a command line in the folder.
  [[nodiscard]] Outcome In(const std::string& command_line) const {
    return testing::RunInShell("cd '" + std::string(folder_ / "") + "' && " + command_line);
  }
  /// All files of the folder and their content.
  [[nodiscard]] std::map<std::string, std::string> Content() const {
    std::map<std::string, std::string> content;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "")) {
      if (entry.is_regular_file()) content[entry.path().string()] = ReadFile(entry.path().string());
    }
    return content;
  }

  testing::TemporaryFolder folder_;
};

TEST_F(Outputs, NeverReplaceAnInput) {
  const std::map<std::string, std::string> before = Content();
  const std::string task = SourcePath("primitives/tasks/nominal/downstand.toml");
  for (const std::string& command_line : {
           std::string("tumbler record x.rec --csv x.rec"),
           std::string("tumbler record x.rec --log ./x.rec"),
           std::string("tumbler record x.rec --candump \"$PWD/x.rec\""),
           std::string("tumbler record x.rec --csv hard.rec"),
           std::string("tumbler record x.rec --csv soft.rec"),
           std::string("tumbler record soft.rec --csv x.rec"),
           std::string("tumbler record x.lcm --csv ./x.lcm"),
           std::string("tumbler replay x.rec --against hard.rec --svg x.rec"),
           std::string("tumbler replay x.rec --against soft.rec --svg soft.rec"),
           std::string("tumbler replay x.log --drives drives.toml --svg drives.toml"),
           std::string("tumbler replay x.log --drives drives.toml --svg x.log"),
           std::string("tumbler run sim handstand.toml --json ./handstand.toml"),
           std::string("tumbler run sim gait.toml --cycles 1 --csv handstand.toml"),
           std::string("tumbler run sim handstand.toml --twin twin.toml --truth twin.toml"),
           std::string("tumbler run sim handstand.toml --drives drives.toml --log drives.toml"),
           std::string("tumbler run sim handstand.toml --twin own.toml --csv own.urdf"),
           std::string(
               "tumbler robustness handstand.toml --robots 1 --twin own.toml --json own.urdf"),
           std::string("tumbler abort handstand.toml --twin own.toml --json own.urdf"),
           std::string("tumbler chain simulate gait.toml --json gait.toml"),
           std::string("tumbler chain simulate gait.toml --json downstand.toml"),
           std::string("tumbler export gait.toml --header handstand.toml"),
           "tumbler optimize " + task + " --start-from handstand.toml --out ./handstand.toml",
           std::string("tumbler twin can9 handstand.toml --drives drives.toml --json "
                       "./handstand.toml"),
           std::string("tumbler twin can9 handstand.toml --drives drives.toml --twin own.toml "
                       "--json own.urdf"),
       }) {
    const Outcome outcome = In(command_line);
    EXPECT_EQ(outcome.exit_code, 1) << command_line;
    EXPECT_THAT(outcome.text, HasSubstr("is an input; results need a file of their own"))
        << command_line;
    ASSERT_EQ(Content(), before) << command_line;
  }
}

TEST_F(Outputs, NeverReplaceAnotherOutput) {
  const std::map<std::string, std::string> before = Content();
  const std::string task = SourcePath("primitives/tasks/nominal/handstand.toml");
  for (const std::string& command_line : {
           std::string("tumbler record x.rec --csv new --log new"),
           std::string("tumbler record x.rec --csv new --candump ./new"),
           std::string("tumbler run sim handstand.toml --json j --csv j"),
           std::string("tumbler run sim handstand.toml --record j --log \"$PWD/j\""),
           "tumbler optimize " + task + " --out q --json ./q",
           "tumbler optimize " + task + " --json \"$PWD/q\" --out q",
           std::string("tumbler twin can9 handstand.toml --drives drives.toml --json j --truth j"),
       }) {
    const Outcome outcome = In(command_line);
    EXPECT_EQ(outcome.exit_code, 1) << command_line;
    EXPECT_THAT(outcome.text, HasSubstr("is named for two results; each needs its own file"))
        << command_line;
    ASSERT_EQ(Content(), before) << command_line;
  }
}

TEST_F(Outputs, AreNotBegunWhereAnotherProgramMakesThem) {
  const std::string task = SourcePath("primitives/tasks/nominal/handstand.toml");
  const auto before = Content();
  {
    const HeldResults other({folder_ / "q.toml"});
    const Outcome outcome = In("tumbler optimize " + task + " --out ./q.toml");
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_EQ(outcome.text,
              "tumbler optimize: ./q.toml: is being written by another program; wait for its end, "
              "or give this one a file of its own\n");
  }
  EXPECT_EQ(Content(), before);
}

TEST_F(Outputs, OfOneKindAreCalledByItWhereAnotherIsRead) {
  for (const auto& [command_line, says] : std::vector<std::pair<std::string, std::string>>{
           {"tumbler view x.lcm --out page",
            "tumbler view: x.lcm: is an LCM log, which tumbler record takes; allowed: flight "
            "records (`tumbler run --record`), and primitives\n"},
           {"tumbler view x.rec x.log --out page",
            "tumbler view: x.log: is a candump log, which tumbler replay takes; allowed: flight "
            "records (`tumbler run --record`), and primitives\n"},
           {"tumbler view x.lcm",
            "tumbler view: x.lcm: is not a flight record, but an LCM log, which tumbler record "
            "takes\n"},
           {"tumbler run sim x.rec",
            "tumbler run: x.rec: is a flight record, which tumbler record, replay and view take; "
            "here a TOML file is read\n"}}) {
    const Outcome outcome = In(command_line);
    EXPECT_EQ(outcome.exit_code, 1) << command_line;
    EXPECT_EQ(outcome.text, says);
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "page"));
}

TEST_F(Outputs, OfADamagedRecordShowTheRestAndEndWithStatus4) {
  std::string record = ReadFile(folder_ / "x.rec");
  record[record.size() / 2] = static_cast<char>(~record[record.size() / 2]);
  WriteFile(folder_ / "damaged.rec", record);
  const Outcome page = In("tumbler view damaged.rec --out damaged.html");
  EXPECT_EQ(page.exit_code, 4) << page.text;
  EXPECT_THAT(page.text, HasSubstr("  damaged: byte "));
  EXPECT_THAT(page.text, HasSubstr("wrote damaged.html\n"));
  EXPECT_EQ(In("tumbler view x.rec --out whole.html").exit_code, 0);
  EXPECT_EQ(In("tumbler record damaged.rec").exit_code, 4) << "the same as others say";
  testing::Program shown(
      {testing::ProgramPath("tumbler view"), folder_ / "damaged.rec", "--port", "0"});
  EXPECT_TRUE(shown.WaitFor("Ctrl-C ends it.")) << shown.text();
  shown.Signal(SIGINT);
  EXPECT_EQ(shown.Wait(), 4) << shown.text();
  EXPECT_THAT(shown.text(), HasSubstr("damaged.rec: damaged at byte "));
}

TEST_F(Outputs, MakeTheFoldersThatTheyNeed) {
  const std::string task = SourcePath("primitives/tasks/nominal/downstand.toml");
  for (const std::string& command_line : {
           "tumbler optimize " + task + " --guess downstand.toml --out a/b/m.toml --json c/m.json",
           std::string("tumbler run sim downstand.toml --hold-s 0 --json d/e/j --log f/l --csv "
                       "g/t --record h/r --truth i/t"),
           std::string("tumbler record x.rec --csv k/t --log l/l --candump m/c"),
           std::string("tumbler record x.lcm --csv n/t"),
           std::string("tumbler replay x.rec --against hard.rec --svg o/p/s.svg"),
           std::string("tumbler chain simulate gait.toml --cycles 0 --branch roll --json q/j"),
           std::string("tumbler export gait.toml --header r/s/gait.h"),
           std::string("tumbler robustness handstand.toml --robots 2 --report s/t.html"),
           std::string("tumbler view x.rec --out u/v.html"),
       }) {
    const Outcome outcome = In(command_line);
    EXPECT_EQ(outcome.exit_code, 0) << command_line << '\n' << outcome.text;
  }
  for (const char* name :
       {"a/b/m.toml", "c/m.json", "d/e/j", "f/l", "g/t", "h/r", "i/t", "k/t", "l/l", "m/c", "n/t",
        "o/p/s.svg", "q/j", "r/s/gait.h", "s/t.html", "u/v.html"}) {
    EXPECT_FALSE(ReadFile(folder_ / name).empty()) << name;
  }
}

TEST_F(Outputs, OfAFullDiskTakeNothingFromTheSummaryAndAreNoSuccess) {
  const auto before = Content();
  const std::string run = "tumbler run sim handstand.toml --hold-s 0 ";
  for (const std::string option : {"--log", "--csv", "--truth", "--json"}) {
    const Outcome outcome = In(run + option + " /dev/full");
    EXPECT_EQ(outcome.exit_code, 4) << option;
    EXPECT_THAT(outcome.text, HasSubstr("completed: handstand on sim")) << option;
    EXPECT_THAT(outcome.text, HasSubstr("NOT whole: /dev/full")) << option;
  }
  const Outcome both = In(run + "--log /dev/full --json -");
  EXPECT_THAT(both.text,
              HasSubstr("\"unwritten\": [\n    \"/dev/full: could not be written whole\""));
  EXPECT_THAT(both.text, HasSubstr("\"exit_code\": 4"));
  for (const std::string& command_line :
       {run, std::string("tumbler record x.rec"), std::string("tumbler record x.lcm"),
        std::string("tumbler chain check gait.toml"), std::string("tumbler run --help")}) {
    const Outcome outcome = In(command_line + " > /dev/full");
    EXPECT_EQ(outcome.exit_code, 1) << command_line;
    EXPECT_THAT(outcome.text, ::testing::AnyOf(HasSubstr("No space left on device"),
                                               HasSubstr("could not be written whole")))
        << command_line;
  }
  // A limit of the shell's, in blocks of 512 or 1024 bytes, is a disk that is full later.
  for (const std::string& command_line :
       {std::string("tumbler export gait.toml --header motion.h"),
        std::string(
            "tumbler chain simulate gait.toml --cycles 0 --branch roll --json chain.json")}) {
    const Outcome outcome = In("ulimit -f 1; " + command_line);
    EXPECT_EQ(outcome.exit_code, 1) << command_line;
    EXPECT_THAT(outcome.text, HasSubstr("File too large")) << command_line;
  }
  EXPECT_EQ(Content(), before);
}

TEST_F(Outputs, ShowControlCharactersInNamesAsText) {
  const std::string name = "a\x1b[31mb.toml";
  std::filesystem::copy_file(std::string(folder_ / "handstand.toml"), folder_ / name);
  for (const std::string& command_line :
       {std::string(
            "tumbler run sim $'a\\e[31mb.toml' --hold-s 0 --record y.rec --log $'y\\e.lcm'"),
        std::string("tumbler record y.rec"), std::string("tumbler view y.rec --out page"),
        std::string("tumbler record $'no\\e.lcm'")}) {
    const Outcome outcome = In("exec bash -c \"" + command_line + "\"");
    EXPECT_EQ(outcome.text.find('\x1b'), std::string::npos) << command_line;
    EXPECT_THAT(outcome.text, HasSubstr("\\x1b")) << command_line << '\n' << outcome.text;
  }
}

TEST_F(Outputs, AndOptionsThatWouldBeIgnoredAreRefused) {
  const auto before = Content();
  for (const auto& [command_line, says] : std::vector<std::pair<std::string, std::string>>{
           {"tumbler robustness handstand.toml --cycles 2", "--cycles: is for sequences"},
           {"tumbler replay x.rec --against hard.rec --drives drives.toml --svg s.svg",
            "--drives: has no use with --against"}}) {
    const Outcome outcome = In(command_line);
    EXPECT_EQ(outcome.exit_code, 1) << command_line;
    EXPECT_THAT(outcome.text, HasSubstr(says));
  }
  EXPECT_EQ(Content(), before);
}

TEST_F(Outputs, ADeviceTakesAsManyResultsAsOneLikes) {
  EXPECT_EQ(In("tumbler record x.rec --csv /dev/null --candump /dev/null").exit_code, 0);
  EXPECT_EQ(In("tumbler run sim handstand.toml --json - --csv /dev/null").exit_code, 0);
}

TEST(OutputsCli, AFileOfARunThatIsNotWholeIsNotSaidToBeWritten) {
  const testing::TemporaryFolder folder;
  const std::string motion = testing::SourcePath("primitives/nominal/handstand.toml");
  const testing::Outcome outcome =
      testing::RunInShell("cd " + folder.path().string() + " && ulimit -f 40 && tumbler run sim " +
                          motion + " --record a.rec --log a.lcm --csv a.csv");
  EXPECT_EQ(outcome.exit_code, 4) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("NOT whole: a.lcm, a.csv: "));
  EXPECT_THAT(outcome.text, HasSubstr("NOT whole: a.rec: recording stopped after "));
  EXPECT_THAT(outcome.text, ::testing::Not(HasSubstr("  wrote ")));
}

}  // namespace
}  // namespace tumbler
