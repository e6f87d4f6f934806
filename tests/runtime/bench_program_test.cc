// tumbler bench, and the drives file that it writes.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "common/files/program.h"
#include "common/files/toml_reader.h"
#include "firmware_interface/devices/drives_draft.h"
#include "firmware_interface/devices/drives_toml.h"
#include "tests/support/example_drives.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Replaced;

TEST(DrivesDraft, ChangesValuesAndKeepsComments) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  DrivesDraft draft(text, "draft.toml");
  EXPECT_EQ(draft.text(), text);
  draft.SetNumber(1, "zero_offset_rad", -0.25);
  draft.SetInteger(0, "direction", -1);
  draft.SetText(0, "joint", "a \"joint\" # of its own");
  draft.Check();
  EXPECT_EQ(JointOf(draft.config().drives[1].config).zero_offset_rad, -0.25F);
  EXPECT_EQ(JointOf(draft.config().drives[0].config).direction, -1);
  EXPECT_EQ(draft.config().drives[0].joint, "a \"joint\" # of its own");
  EXPECT_THAT(draft.text(), HasSubstr("# the joint's name in the robot's URDF"));
  draft.SetText(0, "joint", "leg1");
  draft.SetInteger(0, "direction", 1);
  draft.SetNumber(1, "zero_offset_rad", 0);
  EXPECT_EQ(draft.text(), text);
}

TEST(DrivesDraft, AddsAKeyThatIsMissing) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  DrivesDraft draft(Replaced(text, "direction = 1 ", "# no direction "), "draft.toml");
  draft.SetInteger(0, "direction", -1);
  draft.Check();
  EXPECT_EQ(JointOf(draft.config().drives[0].config).direction, -1);
  EXPECT_EQ(JointOf(draft.config().drives[1].config).direction, 1);
}

TEST(DrivesDraft, InAnotherFolderItsDataSheetsAreTheSame) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  DrivesDraft draft(text, "folder/draft.toml");
  draft.SetText(0, "eds", "sheets/a.eds");  // (No key of this protocol: it is not read again.)
  draft.SetText(1, "eds", "/elsewhere/b.eds");
  EXPECT_EQ(draft.TextFor("folder/other.toml"), draft.text());
  const std::string moved = draft.TextFor("written/other.toml");
  EXPECT_THAT(moved, HasSubstr("eds = \"../folder/sheets/a.eds\""));
  EXPECT_THAT(moved, HasSubstr("eds = \"/elsewhere/b.eds\""));
}

TEST(DrivesDraft, AHalfDoneFileSaysWhatIsLeftAndOnlyTheBenchReadsIt) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  DrivesDraft draft(text, "draft.toml");
  draft.SetUnfinished("zero of \"leg2\" # not set");
  draft.Check();
  EXPECT_EQ(draft.config().unfinished, "zero of \"leg2\" # not set");
  try {
    static_cast<void>(ParseDrives(draft.text(), "d.toml"));
    FAIL() << "was accepted";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("d.toml:4: unfinished: says 'zero of \"leg2\" # not set'"));
    EXPECT_THAT(error.what(), HasSubstr("finish it with tumbler bench BUS commission"));
    EXPECT_THAT(error.what(), HasSubstr("or remove this key"));
  }
  // Another draft begins with it; what is left changes, and goes.
  DrivesDraft again(draft.text(), "draft.toml");
  again.SetUnfinished("steps");
  again.Check();
  EXPECT_EQ(again.config().unfinished, "steps");
  again.SetUnfinished("");
  again.Check();
  EXPECT_EQ(again.text(), text);
  EXPECT_EQ(ParseDrives(again.text(), "d.toml").drives.size(), 2U);
}

TEST(DrivesDraft, AnUnfinishedThatCannotBeReplacedLineByLineIsRefused) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  for (const std::string key : {"unfinished = \"\"\"\nzeros\"\"\"", "\"unfinished\" = 'zeros'"}) {
    DrivesDraft draft(Replaced(text, "version = 1", "version = 1\n" + key), "draft.toml");
    EXPECT_EQ(draft.config().unfinished, "zeros");
    EXPECT_THROW(draft.SetUnfinished(""), FileError) << key;
  }
}

class BenchProgram : public ::testing::Test {
 protected:
  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  const std::string drives_ = testing::SourcePath("primitives/robots/tumbler_drives.toml");
  const std::string motion_ = testing::SourcePath("primitives/nominal/handstand.toml");

 private:
  testing::TemporaryFolder folder_;
};

TEST_F(BenchProgram, RefusesToMoveMotorsWithoutArm) {
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler bench", "can99", "jog", "leg1", "--drives", drives_});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("say so with --arm"));
}

TEST_F(BenchProgram, DoesNotReplaceAFileUnlessItIsTold) {
  testing::WriteFile(Path("written.toml"), "precious");
  std::vector<std::string> arguments{"tumbler bench", "sim",   "zero",
                                     "--drives",      drives_, "--motion",
                                     motion_,         "--out", Path("written.toml")};
  testing::Outcome outcome = testing::RunProgram(arguments);
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("is there already"));
  EXPECT_EQ(testing::ReadFile(Path("written.toml")), "precious");
  arguments.emplace_back("--overwrite");
  outcome = testing::RunProgram(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_EQ(LoadDrives(Path("written.toml")).drives.size(), 2U);
}

TEST_F(BenchProgram, NoZeroIsWrittenOfADriveThatHasFallenSilent) {
  testing::WriteFile(Path("faults.toml"),
                     "format = \"tumbler-bus-faults\"\nversion = 1\n"
                     "[[fault]]\nkind = \"disconnect\"\nnode = \"leg1\"\nstart_s = 0.02\n");
  const std::vector<std::string> bench{"tumbler bench",     "sim",      "--bus-faults",
                                       Path("faults.toml"), "--drives", drives_,
                                       "--motion",          motion_};
  for (const std::string command : {"zero", "read"}) {
    std::vector<std::string> arguments = bench;
    arguments.push_back(command);
    if (command == "zero") {
      arguments.emplace_back("--out");
      arguments.push_back(Path("written.toml"));
    }
    const testing::Outcome outcome = testing::RunProgram(arguments);
    EXPECT_EQ(outcome.exit_code, 3) << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr("(leg1) has not replied for"));
  }
  EXPECT_FALSE(std::filesystem::exists(Path("written.toml")));
}

TEST_F(BenchProgram, ADriveGetsAnotherZeroOnlyWhenArmedWithAFileToWriteAndAnAngle) {
  const auto zero = [&](const std::string& bus, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"tumbler bench", bus,        "zero",
                                       "--in-drive",    "--drives", drives_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return testing::RunProgram(arguments);
  };
  testing::Outcome outcome = zero("can99", {"--at", "0", "--out", Path("written.toml")});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("say so with --arm"));
  outcome = zero("sim", {"--at", "0"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("--out"));
  for (const std::string at : {"nan", "inf", "1e5"}) {
    outcome = zero("sim", {"--at", at, "--out", Path("written.toml")});
    EXPECT_EQ(outcome.exit_code, 1) << at;
    EXPECT_THAT(outcome.text, HasSubstr("--at"));
  }
  outcome = zero("sim", {"--at", "0.2", "--out", Path("written.toml")});
  EXPECT_THAT(outcome.text, HasSubstr("holds no longer"));
  EXPECT_NEAR(JointOf(LoadDrives(Path("written.toml")).drives[1].config).zero_offset_rad, 0.2F,
              0.01F);
}

TEST_F(BenchProgram, WhenASecondDriveKeepsItsZeroTheFirstOnesNewZeroIsWritten) {
  testing::WriteFile(Path("answers"), "yes\nyes\nyes\nno\n");
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler bench", "sim", "zero", "--in-drive", "--drives", drives_, "--at", "0.2", "--out",
       Path("written.toml"), "--answers", Path("answers")});
  EXPECT_EQ(outcome.exit_code, 2) << outcome.text;
  ASSERT_TRUE(std::filesystem::exists(Path("written.toml"))) << outcome.text;
  const DrivesConfig written = LoadDrives(Path("written.toml"));
  EXPECT_NEAR(JointOf(written.drives[0].config).zero_offset_rad, 0.2F, 0.01F);
  EXPECT_EQ(JointOf(written.drives[1].config).zero_offset_rad, 0);
}

TEST_F(BenchProgram, WhenAnswersRunOutItStopsAndSaysSo) {
  testing::WriteFile(Path("answers"), "yes # the way is clear\n");
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler bench", "sim", "identify", "--drives", drives_, "--answers", Path("answers")});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("has no answer to this"));
}

TEST_F(BenchProgram, StandardInputAnswersAndTellsWhoTurned) {
  const testing::Outcome outcome = testing::RunInShell(
      "printf 'yes\\nleg1\\nyes\\nleg2\\n' | tumbler bench sim identify --ask --drives " + drives_);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("(You see leg1 turn by +0.0"));
  EXPECT_THAT(outcome.text, HasSubstr("Nothing is amiss of what was judged:"));
}

TEST_F(BenchProgram, ACommissioningThatIsInterruptedLeavesAFileThatNothingElseUses) {
  testing::WriteFile(Path("answers"), "yes\nleg1\nyes\nyes\nleg2\nyes\n");  // none for the zeros
  const testing::Outcome bench = testing::RunProgram(
      {"tumbler bench", "sim", "commission", "--drives", drives_, "--motion", motion_, "--out",
       Path("written.toml"), "--seconds", "1", "--answers", Path("answers")});
  EXPECT_EQ(bench.exit_code, 2) << bench.text;
  const std::string left = "commissioning has left to do: zeros, ways, scales, watchdogs, steps";
  EXPECT_THAT(testing::ReadFile(Path("written.toml")),
              HasSubstr("\nunfinished = \"" + left + "\"\n"));
  const testing::Outcome run =
      testing::RunProgram({"tumbler run", "sim", motion_, "--drives", Path("written.toml")});
  EXPECT_EQ(run.exit_code, 1) << run.text;
  EXPECT_THAT(run.text, HasSubstr(left));
  EXPECT_THAT(run.text, HasSubstr("finish it with tumbler bench BUS commission"));
  const testing::Outcome again =
      testing::RunProgram({"tumbler bench", "sim", "read", "--drives", Path("written.toml")});
  EXPECT_EQ(again.exit_code, 0) << again.text;
}

TEST_F(BenchProgram, TellsWhichInertiaADrivesDampingTakesWhereItsLoopIsKnown) {
  const auto told = [&](const std::string& drives) {
    return testing::RunProgram({"tumbler bench", "sim", "read", "--drives", drives}).text;
  };
  EXPECT_THAT(told(drives_), HasSubstr("(leg1): whether its kd of 5 N m s/rad is stable in the "
                                       "drive's own loop, whose rate is not known (loop_hz)"));
  testing::WriteFile(Path("fast.toml"),
                     testing::ReplacedAll(testing::ReadFile(drives_), "temperature_max_c",
                                          "loop_hz = 10000\ntemperature_max_c"));
  EXPECT_THAT(told(Path("fast.toml")),
              HasSubstr("in the drive's own loop of 10 kHz: above a least inertia of 0.00025 kg"));
}

TEST_F(BenchProgram, RefusesWhatWouldExceedItsBounds) {
  for (const std::vector<std::string>& options :
       std::vector<std::vector<std::string>>{{"jog", "leg1", "--by", "0.2"},
                                             {"step", "leg1", "--size", "0.2"},
                                             {"step", "leg1", "--kp", "100"},
                                             {"jog", "leg1", "--velocity", "nan"},
                                             {"jog", "leg3"},
                                             {"jog"}}) {
    std::vector<std::string> arguments{"tumbler bench", "sim", "--drives", drives_};
    arguments.insert(arguments.end(), options.begin(), options.end());
    EXPECT_EQ(testing::RunProgram(arguments).exit_code, 1) << ::testing::PrintToString(options);
  }
}

}  // namespace
}  // namespace tumbler
