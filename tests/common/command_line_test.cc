#include "common/files/command_line.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "common/files/program.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

void Parse(CommandLine& line, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "program");
  std::vector<char*> argv;
  argv.reserve(arguments.size());
  for (std::string& argument : arguments) argv.push_back(argument.data());
  line.Parse(static_cast<int>(argv.size()), argv.data());
}

/// The message about a command line that cannot be used; empty if it can.
std::string Complaint(CommandLine& line, const std::vector<std::string>& arguments) {
  try {
    Parse(line, arguments);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

std::string Help(CommandLine& line, const std::vector<std::string>& before = {}) {
  std::vector<std::string> arguments = before;
  arguments.emplace_back("--help");
  try {
    Parse(line, arguments);
  } catch (const HelpWanted& help) {
    return help.what();
  }
  return "";
}

TEST(CommandLine, SetsVariablesOfEveryTypeAndLeavesThoseThatAreNotGiven) {
  std::string motion, out = "as it was";
  std::vector<std::string> files;
  std::vector<double> gravity;
  int cycles = 0;
  std::size_t ticks = 0;
  double speed = 1;
  bool arm = false, quiet = false;
  CommandLine line("Plays.", "play");
  line.Option("MOTION", motion, "what");
  line.Option("--out", out, "where");
  line.Option("--file", files, "which").TakesOneValueEachTime();
  line.Option("--gravity", gravity, "down").TakesValues(3, "X Y Z");
  line.Option("--cycles", cycles, "how often");
  line.Option("--ticks", ticks, "how many");
  line.Option("--speed", speed, "how fast");
  line.Flag("--arm", arm, "in earnest");
  line.Flag("--quiet", quiet, "say less");
  Parse(line, {"--file", "a", "--gravity", "0", "1", "-2.5", "gait.toml", "--file=b", "--cycles",
               "-3", "--ticks", "7", "--speed=0.5", "--arm"});
  EXPECT_EQ(motion, "gait.toml");
  EXPECT_EQ(out, "as it was");
  EXPECT_THAT(files, ElementsAre("a", "b"));
  EXPECT_THAT(gravity, ElementsAre(0, 1, -2.5));
  EXPECT_EQ(cycles, -3);
  EXPECT_EQ(ticks, 7);
  EXPECT_EQ(speed, 0.5);
  EXPECT_TRUE(arm);
  EXPECT_FALSE(quiet);
}

TEST(CommandLine, NamesTheOptionOfAValueThatCannotBe) {
  int cpu = 0;
  double speed = 1;
  std::string motion;
  CommandLine line("Plays.", "play");
  line.Option("MOTION", motion, "what").Required();
  line.Option("--cpu", cpu, "which").Within(-1, 1023);
  line.Option("--speed", speed, "how fast").Within(0.1, 1.0);
  EXPECT_THAT(Complaint(line, {}), HasSubstr("MOTION is required"));
  EXPECT_THAT(Complaint(line, {"m", "--cpu", "1024"}),
              HasSubstr("--cpu: Value 1024 not in range -1 to 1023, of whole numbers"));
  EXPECT_THAT(Complaint(line, {"m", "--cpu", "2.0"}), HasSubstr("of whole numbers"));
  EXPECT_THAT(Complaint(line, {"m", "--speed", "2"}), HasSubstr("--speed: Value 2 not in range"));
  EXPECT_THAT(Complaint(line, {"m", "--speed", "nan"}),
              HasSubstr("--speed: Value nan not in range 0.1 to 1"));
  EXPECT_THAT(Complaint(line, {"m", "--speed", "fast"}), HasSubstr("--speed"));
  EXPECT_THAT(Complaint(line, {"m", "--speed"}), HasSubstr("--speed"));
  EXPECT_THAT(Complaint(line, {"m", "more"}), HasSubstr("more"));
  EXPECT_THAT(Complaint(line, {"m", "--nonsense"}), HasSubstr("--nonsense"));
  EXPECT_EQ(Complaint(line, {"m", "--cpu", "-1"}), "");
}

TEST(CommandLine, ChoosesAmongNamesThatTheHelpLists) {
  std::string scheduling = "fifo";
  CommandLine line("Plays.", "play");
  line.Option("--scheduling", scheduling, "how").OneOf({"fifo", "deadline"}).ShowDefault();
  EXPECT_THAT(Help(line),
              HasSubstr("--scheduling TEXT         how [fifo, deadline; default fifo]\n"));
  EXPECT_THAT(Complaint(line, {"--scheduling", "other"}),
              HasSubstr("--scheduling: other not in {fifo,deadline}"));
  Parse(line, {"--scheduling", "DeadLine"});
  EXPECT_EQ(scheduling, "deadline");
}

TEST(CommandLine, HelpSaysNameRangeDefaultAndFooter) {
  double speed = 0.25;
  CommandLine line("Plays a motion.", "play");
  line.Option("--speed", speed, "how fast").Within(0.1, 1.0).ShowDefault();
  line.SetFooter("And nothing else.");
  const std::string help = Help(line);
  for (const char* part : {"Plays a motion.", "Usage: play [OPTIONS]", "And nothing else.",
                           "--speed FLOAT             how fast [0.1 ... 1; default 0.25]\n"}) {
    EXPECT_THAT(help, HasSubstr(part));
  }
}

TEST(CommandLine, AsksForVersionManualPageAndCompletionInsteadOfWork) {
  std::string motion;
  CommandLine line("Plays a motion.", "play");
  line.Option("MOTION", motion, "what").Required();
  const auto text = [&line](const char* option) -> std::string {
    try {
      Parse(line, {option});
    } catch (const HelpWanted& wanted) {
      return wanted.what();
    }
    return "";
  };
  EXPECT_THAT(text("--version"), MatchesRegex("play [0-9]+\\.[0-9]+\\.[0-9]+ \\(commit .+\\)\n"));
  EXPECT_THAT(text("--man-page"), HasSubstr(".TH PLAY 1"));
  EXPECT_THAT(text("--bash-completion"), HasSubstr("complete -o default -F _play play\n"));
}

TEST(CommandLine, TellsWhichOptionsWereGiven) {
  int cycles = 3;
  bool arm = false;
  CommandLine line("Plays.", "play");
  line.Option("--cycles", cycles, "how often");
  line.Flag("--arm", arm, "in earnest");
  Parse(line, {"--cycles", "3"});
  EXPECT_TRUE(line.Given("--cycles"));
  EXPECT_FALSE(line.Given("--arm"));
}

TEST(CommandLine, RefusesAnOptionWithoutTheOneThatItNeedsOrWithOneThatItExcludes) {
  std::string bus, against;
  bool arm = false;
  CommandLine line("Plays.", "play");
  const CommandLineOption on_bus = line.Option("--bus", bus, "where");
  line.Option("--against", against, "with what").Excludes(on_bus);
  line.Flag("--arm", arm, "in earnest").Needs(on_bus);
  EXPECT_THAT(Complaint(line, {"--arm"}), HasSubstr("--arm requires --bus"));
  EXPECT_THAT(Complaint(line, {"--bus", "a", "--against", "b"}), HasSubstr("excludes"));
  EXPECT_EQ(Complaint(line, {"--bus", "a", "--arm"}), "");
}

TEST(CommandLine, SubcommandsHaveArgumentsOfTheirOwn) {
  std::string file, url = "here";
  CommandLine line("Does.", "do");
  line.RequireSubcommand();
  line.AllowOptionsAfterSubcommand();
  line.Option("--url", url, "where");
  CommandLine check = line.Subcommand("check", "looks");
  const CommandLine simulate = line.Subcommand("simulate", "plays");
  check.Option("FILE", file, "at what").Required();
  EXPECT_THAT(Complaint(line, {}), HasSubstr("subcommand is required"));
  EXPECT_THAT(Complaint(line, {"check"}), HasSubstr("FILE is required"));
  EXPECT_THAT(Help(line, {"check"}), HasSubstr("Usage: do check [OPTIONS] FILE\n"));
  Parse(line, {"check", "a.toml", "--url", "there"});
  EXPECT_TRUE(check.given());
  EXPECT_FALSE(simulate.given());
  EXPECT_EQ(line.given_subcommand(), "check");
  EXPECT_EQ(file, "a.toml");
  EXPECT_EQ(url, "there");
}

TEST(CommandLine, AnEmptyValueIsRefusedEverywhereAndNeverReadAsZeroOrAsNotGiven) {
  std::string name, file;
  double angle_rad = 1;
  std::vector<double> ways;
  CommandLine line("Does much.", "do");
  line.Option("--name", name, "of what");
  CommandLine zero = line.Subcommand("zero", "sets zeros");
  zero.Option("--at", angle_rad, "angle");
  zero.Option("--ways", ways, "ways");
  zero.Option("FILE", file, "at what");
  EXPECT_EQ(Complaint(line, {"--name", "", "zero"}), "--name: is empty");
  EXPECT_EQ(Complaint(line, {"zero", "--at", ""}), "--at: is empty");
  EXPECT_THAT(Complaint(line, {"zero", "--at="}), HasSubstr("--at"));
  EXPECT_EQ(Complaint(line, {"zero", "--ways", "1", ""}), "--ways: is empty");
  EXPECT_EQ(Complaint(line, {"zero", ""}), "FILE: is empty");
  EXPECT_EQ(angle_rad, 1);
}

TEST(CommandLine, AProgramReadsAValueItselfAndItsComplaintIsTheCommandLines) {
  std::string seed, out;
  CommandLine line("Searches.", "search");
  line.Option(
      "--seed", "INT",
      [&seed](const std::string& text) {
        if (text == "0") throw UsageError("--seed", "is 0");
        seed = text;
      },
      "of the search");
  line.Option("--out", out, "where");
  EXPECT_THAT(Help(line), HasSubstr("--seed INT"));
  EXPECT_EQ(Complaint(line, {"--seed", "0"}), "--seed: is 0");
  EXPECT_EQ(Complaint(line, {"--seed", ""}), "--seed: is empty");
  EXPECT_EQ(Complaint(line, {"--out", ""}), "--out: is empty");
  Parse(line, {"--seed", "12"});
  EXPECT_EQ(seed, "12");
}

}  // namespace
}  // namespace tumbler
