// What all programs have in common: help, version, wrong usage, manual page and completion.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>
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
  for (std::string name; std::getline(list, name, ',');) names.push_back(name);
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
  std::string function = "_" + program;
  std::replace(function.begin(), function.end(), '-', '_');
  return RunInShell("bash -c 'source <(" + program + " --bash-completion); COMP_WORDS=(" + program +
                    " " + words + "); COMP_CWORD=$((${#COMP_WORDS[@]}-1)); " + function +
                    " 2>/dev/null; printf \"%s\\n\" \"${COMPREPLY[@]}\"'")
      .text;
}

TEST_P(EveryProgram, CompletesItsOptions) {
  EXPECT_THAT(Offered(GetParam(), "--vers"), "--version\n");
  EXPECT_THAT(Offered(GetParam(), "--"), HasSubstr("--help\n"));
}

TEST(Completion, OffersSubcommandsTheirOptionsAndNamesToChooseFrom) {
  EXPECT_EQ(Offered("tumbler-ctl", "st"), "start\nstop\nstatus\n");
  EXPECT_EQ(Offered("tumbler-ctl", "status --js"), "--json\n");
  EXPECT_EQ(Offered("tumbler-ctl", "start --js"), "\n");
  EXPECT_EQ(Offered("tumbler-run", "--scheduling d"), "deadline\n");
  EXPECT_EQ(Offered("tumbler-run", "--scheduling = f"), "fifo\n");
  EXPECT_EQ(Offered("tumbler-run", "--cpu \"\""), "\n");
  EXPECT_EQ(Offered("tumbler-bench", "scan --pass"), "--passive\n");
}

INSTANTIATE_TEST_SUITE_P(Programs, EveryProgram, ::testing::ValuesIn(AllPrograms()),
                         [](const auto& tested) {
                           std::string name = tested.param;
                           name.erase(std::remove(name.begin(), name.end(), '-'), name.end());
                           return name;
                         });

}  // namespace
}  // namespace tumbler
