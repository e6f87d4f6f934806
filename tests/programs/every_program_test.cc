// What the programs of all commands have in common: help, version, wrong usage, manual page and
// completion.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using testing::Outcome;
using testing::RunInShell;
using testing::RunProgram;

std::vector<std::string> AllPrograms() {
  std::vector<std::string> names;
  std::istringstream list(TUMBLER_PROGRAMS);
  for (std::string name; std::getline(list, name, ',');) {
    std::replace(name.begin(), name.end(), '-', ' ');  // the target tumbler-run is `tumbler run`
    names.push_back(name);
  }
  return names;
}

class EveryProgram : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryProgram, TellsItsNameVersionAndCommit) {
  const Outcome outcome = RunProgram({GetParam(), "--version"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.text, MatchesRegex(GetParam() + " [0-9]+\\.[0-9]+\\.[0-9]+ \\(commit "
                                                      "(unknown|[0-9a-f]+(, changed)?)\\)\n"));
}

TEST_P(EveryProgram, ExplainsItselfAndItsExitStatuses) {
  const Outcome outcome = RunProgram({GetParam(), "--help"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.text, HasSubstr("Usage: " + GetParam() + " "));
  EXPECT_THAT(outcome.text, HasSubstr("\nExit codes:\n  0"));
  EXPECT_THAT(outcome.text, ::testing::Not(HasSubstr("{")));
}

/// Whether the first word of the line would have had room at the end of the line before.
bool EndsEarly(const std::string& before, const std::string& line) {
  const auto indent = [](const std::string& of) { return of.find_first_not_of(' '); };
  if (before.empty() || line.empty() || indent(line) != 0 || indent(before) != 0) return false;
  return before.size() + 1 + std::min(line.find(' '), line.size()) <= 100;
}

TEST_P(EveryProgram, BreaksTheLinesOfItsHelpWhereTheyAreFullAndKeepsItsListsIndented) {
  const std::string help = RunProgram({GetParam(), "--help"}).text;
  std::istringstream lines(help);
  std::string before;
  for (std::string line; std::getline(lines, line); before = line) {
    EXPECT_LE(line.size(), 100U) << line;
    EXPECT_FALSE(EndsEarly(before, line)) << before << '\n' << line;
  }
  const std::string statuses = help.substr(help.find("\nExit codes:\n") + 13);
  std::istringstream list(statuses.substr(0, statuses.find("\n\n")));
  std::size_t count = 0;
  for (std::string line; std::getline(list, line); ++count)
    EXPECT_TRUE(line.starts_with("  ")) << line;
  EXPECT_GE(count, 2U);
}

TEST_P(EveryProgram, EndsWithStatus1AfterAWrongCommandLine) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{}, {"--nonsense"}, {"a", "b", "c", "d", "e", "f", "g"}}) {
    std::vector<std::string> all = {GetParam()};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Outcome outcome = RunProgram(all);
    EXPECT_EQ(outcome.exit_code, 1) << outcome.text;
    EXPECT_FALSE(outcome.text.empty());
  }
}

TEST_P(EveryProgram, HasAManualPageThatTroffTakesWithoutAComplaint) {
  const Outcome outcome =
      RunInShell(GetParam() + " --man-page | groff -man -ww -Tascii 2>&1 >/dev/null");
  EXPECT_EQ(outcome.text, "");
  const Outcome page = RunInShell(GetParam() + " --man-page | groff -man -Tascii -P-cbou");
  const std::string help = RunProgram({GetParam(), "--help"}).text;
  const auto options = testing::MatchesOf("\n  (-[a-z], )?(--[a-z-]+)", help);
  EXPECT_GE(options.size(), 2U) << "--help and --version at least";
  for (const auto& option : options) EXPECT_THAT(page.text, HasSubstr(option[2]));
}

/// What bash offers for a word: names, a line each.
std::string Offered(const std::string& program, const std::string& words) {
  return RunInShell("bash -c 'source <(tumbler --bash-completion); COMP_WORDS=(" + program + " " +
                    words +
                    "); COMP_CWORD=$((${#COMP_WORDS[@]}-1)); _tumbler 2>/dev/null; "
                    "printf \"%s\\n\" \"${COMPREPLY[@]}\"'")
      .text;
}

TEST_P(EveryProgram, CompletesItsOptions) {
  EXPECT_THAT(Offered(GetParam(), "--vers"), "--version\n");
  EXPECT_THAT(Offered(GetParam(), "--"), HasSubstr("--help\n"));
}

TEST(Completion, OffersSubcommandsTheirOptionsAndNamesToChooseFrom) {
  EXPECT_EQ(Offered("tumbler ctl", "st"), "start\nstop\nstatus\n");
  EXPECT_EQ(Offered("tumbler ctl", "status --js"), "--json\n");
  EXPECT_EQ(Offered("tumbler ctl", "start --js"), "\n");
  EXPECT_EQ(Offered("tumbler run", "--scheduling d"), "deadline\n");
  EXPECT_EQ(Offered("tumbler run", "--scheduling = f"), "fifo\n");
  EXPECT_EQ(Offered("tumbler run", "--cpu \"\""), "\n");
  EXPECT_EQ(Offered("tumbler bench", "scan --pass"), "--passive\n");
}

TEST(Completion, OffersCommandsFirst) {
  EXPECT_EQ(Offered("tumbler", "re"), "replay\nrecord\n");
  EXPECT_EQ(Offered("tumbler", "help re"), "replay\nrecord\n");
  EXPECT_EQ(Offered("tumbler", "h"), "help\n");
  EXPECT_EQ(Offered("tumbler", "--v"), "--version\n");
  EXPECT_EQ(Offered("tumbler", "nonsense --"), "\n");
}

TEST(Tumbler, ListsEveryCommandInFiveGroups) {
  const Outcome alone = RunProgram({"tumbler"});
  EXPECT_EQ(alone.exit_code, 0);
  EXPECT_EQ(RunProgram({"tumbler", "--help"}).text, alone.text);
  EXPECT_EQ(RunProgram({"tumbler", "help"}).text, alone.text);
  std::vector<std::string> listed;
  for (const auto& command : testing::MatchesOf("\n  ([a-z]+) +[A-Z][^\n]+", alone.text))
    listed.push_back("tumbler " + command[1]);
  EXPECT_THAT(listed, ::testing::UnorderedElementsAreArray(AllPrograms()));
  std::size_t at = 0;
  for (const char* const group : {"Find", "Play", "Look", "Bench", "Study"}) {
    const std::size_t next = alone.text.find(std::string("\n\n") + group, at);
    ASSERT_NE(next, std::string::npos) << group;
    at = next;
  }
}

TEST(Tumbler, ShowsTheHelpOfACommandInThreeWays) {
  const std::string help = RunProgram({"tumbler", "run", "--help"}).text;
  EXPECT_EQ(RunProgram({"tumbler", "help", "run"}).text, help);
  EXPECT_EQ(RunProgram({"tumbler", "run", "-h"}).text, help);
}

TEST(Tumbler, SaysWhereCommandsAreThatHadANameOfTheirOwn) {
  for (const auto& [word, now] : std::vector<std::pair<std::string, std::string>>{
           {"report", "`tumbler view --out`"}, {"log", "`tumbler record`"}}) {
    const Outcome outcome = RunProgram({"tumbler", word});
    EXPECT_EQ(outcome.exit_code, 1) << word;
    EXPECT_THAT(outcome.text, HasSubstr(now));
  }
}

TEST(Tumbler, ACommandSaysWhoseItsMessagesAre) {
  for (const std::vector<std::string>& command :
       std::vector<std::vector<std::string>>{{"chain", "check", "absent.toml"},
                                             {"export", "absent.toml", "--header", "-"},
                                             {"identify", "fit", "absent.rec"},
                                             {"model", "check", "absent.urdf"},
                                             {"optimize", "absent.toml"},
                                             {"record", "absent.rec"},
                                             {"robustness", "absent.toml"}}) {
    std::vector<std::string> all = {"tumbler"};
    all.insert(all.end(), command.begin(), command.end());
    const Outcome outcome = RunProgram(all);
    EXPECT_EQ(outcome.exit_code, 1) << command.front();
    EXPECT_THAT(outcome.text, HasSubstr("tumbler " + command.front() + ": ")) << command.front();
    EXPECT_THAT(outcome.text, HasSubstr("absent")) << command.front();
  }
}

TEST(Tumbler, APageThatIsWrittenHasNoAddress) {
  for (const std::string option : {"--port=1", "--bind=::1"}) {
    const Outcome outcome = RunProgram({"tumbler", "view", "run.rec", "--out", "page", option});
    EXPECT_EQ(outcome.exit_code, 1) << option;
    EXPECT_THAT(outcome.text, HasSubstr("excludes --out"));
  }
}

TEST(Tumbler, TheUsageOfACommandsCommandHasWhatComesBeforeIt) {
  EXPECT_THAT(RunProgram({"tumbler", "bench", "--help"}).text,
              HasSubstr("`tumbler bench BUS COMMAND --help`"));
  EXPECT_THAT(RunProgram({"tumbler", "bench", "sim", "scan", "--help"}).text,
              HasSubstr("Usage: tumbler bench BUS scan"));
}

TEST(Tumbler, ProposesTheCommandThatMayHaveBeenMeantAndEndsWithStatus1) {
  for (const auto& [word, meant] :
       std::vector<std::pair<std::string, std::string>>{{"optimise", "optimize"},
                                                        {"opt", "optimize"},
                                                        {"rnu", "run"},
                                                        {"recrod", "record"},
                                                        {"robust", "robustness"},
                                                        {"veiw", "view"},
                                                        {"Run", "run"}}) {
    const Outcome outcome = RunProgram({"tumbler", word, "--help"});
    EXPECT_EQ(outcome.exit_code, 1) << word;
    EXPECT_THAT(outcome.text, HasSubstr(std::string("'")
                                            .append(word)
                                            .append("' is no command; did you mean ")
                                            .append(meant)
                                            .append("?")));
  }
  for (const std::string word : {"xylophone", "", "../run", "\x1b[31m"}) {
    const Outcome outcome = RunProgram({"tumbler", word});
    EXPECT_EQ(outcome.exit_code, 1) << word;
    EXPECT_THAT(outcome.text, HasSubstr("is no command; `tumbler` alone lists them"));
    EXPECT_THAT(outcome.text, ::testing::Not(HasSubstr("\x1b")));
  }
  EXPECT_EQ(RunProgram({"tumbler", "help", "rnu"}).exit_code, 1);
  EXPECT_EQ(RunProgram({"tumbler", "help", "run", "now"}).exit_code, 1);
  EXPECT_EQ(RunProgram({"tumbler", "--nonsense"}).exit_code, 1);
}

TEST(Tumbler, SaysItsVersionAndHasAManualPage) {
  EXPECT_THAT(RunProgram({"tumbler", "--version"}).text,
              MatchesRegex("tumbler [0-9]+\\.[0-9]+\\.[0-9]+ \\(commit [^)]+\\)\n"));
  EXPECT_EQ(RunInShell("tumbler --man-page | groff -man -ww -Tascii 2>&1 >/dev/null").text, "");
}

TEST(Tumbler, BecomesTheProgramOfACommandWithItsInputItsNumberAndItsStatus) {
  // Nothing stands between a command and who started it: a signal reaches the program itself.
  const testing::TemporaryFolder folder;
  const Outcome outcome = RunInShell(
      "cd '" + std::string(folder / "") + "' || exit 1; tumbler robustness " +
      testing::SourcePath("primitives/handstand.toml") +
      " --lanes --robots 10000000 --checkpoint robots >/dev/null 2>&1 & run=$!; "
      "until [ -s robots ]; do sleep 0.05; done; cat /proc/$run/comm; kill -TERM $run; wait $run");
  EXPECT_EQ(outcome.text, "tumbler robustn\n") << "15 characters are the kernel's most";
  EXPECT_EQ(outcome.exit_code, 130);
  EXPECT_EQ(
      RunInShell("tumbler model hybrid " + testing::SourcePath("primitives/robots/tumbler.urdf") +
                 " --prescribed leg1 </dev/null")
          .text,
      "");
}

TEST(Tumbler, IsFoundThroughALinkAndSaysWhatBringsACommandThatIsMissing) {
  const testing::TemporaryFolder folder;
  namespace fs = std::filesystem;
  fs::create_symlink(testing::ProgramPath("tumbler"), folder / "t");
  testing::Program linked({folder / "t", "run", "--version"});
  EXPECT_EQ(linked.Wait(), 0) << linked.text();
  fs::create_directory(folder / "bin");
  fs::copy_file(testing::ProgramPath("tumbler"), folder / "bin/tumbler");
  for (const auto& [command, part] : std::vector<std::pair<std::string, std::string>>{
           {"optimize", "-DTUMBLER_BUILD_OFFLINE=ON"}, {"run", "--target tumbler-run"}}) {
    testing::Program alone({folder / "bin/tumbler", command});
    EXPECT_EQ(alone.Wait(), 1);
    EXPECT_THAT(alone.text(), HasSubstr("tumbler: " + command + " is not installed here"));
    EXPECT_THAT(alone.text(), HasSubstr("package tumbler"));
    EXPECT_THAT(alone.text(), HasSubstr(part));
  }
}

INSTANTIATE_TEST_SUITE_P(Programs, EveryProgram, ::testing::ValuesIn(AllPrograms()),
                         [](const auto& tested) {
                           std::string name = tested.param;
                           name.erase(std::remove(name.begin(), name.end(), ' '), name.end());
                           return name;
                         });

}  // namespace
}  // namespace tumbler
