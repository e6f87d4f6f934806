// Studies of robots and grids of tasks that several processes share.

#include <gtest/gtest.h>

#include <string>

#include "offline/studies/processes.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

std::string Mpirun(const std::string& processes) {
  // Open MPI leaves memory behind, which is not for us to find.
  return "ASAN_OPTIONS=detect_leaks=0 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 "
         "mpirun --oversubscribe -n " +
         processes + " ";
}

std::string Study(const std::string& more) {
  return "tumbler robustness " + testing::SourcePath("primitives/handstand.toml") +
         " --lanes --scale 2.5 --seed 17 --robots 1300 " + more;
}

TEST(RobustnessProcesses, OneAndTwoOfThemGiveTheBytesOfTheProgramAlone) {
  ASSERT_TRUE(Processes::Supported());
  const testing::TemporaryFolder folder;
  const std::string alone = testing::RunInShell(Study("--threads 2 --json - 2>/dev/null")).text;
  ASSERT_NE(alone.find("\"share\""), std::string::npos);
  for (const std::string processes : {"1", "2"}) {
    const std::string checkpoint = " --checkpoint " + (folder / processes);
    const testing::Outcome together =
        testing::RunInShell(Mpirun(processes) + Study("--json - 2>/dev/null" + checkpoint));
    EXPECT_EQ(together.exit_code, 0);
    EXPECT_EQ(together.text, alone) << processes;
  }
  // What two processes kept, one can go on from.
  const testing::Outcome resumed =
      testing::RunInShell(Study("--json - 2>/dev/null --checkpoint " + (folder / "2")));
  EXPECT_EQ(resumed.text, alone);
}

TEST(RobustnessProcesses, AFileThatOnlyTheFirstReadsEndsAllWhenItCannotBeUsed) {
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "notes", "some notes");
  const testing::Outcome outcome = testing::RunInShell(Mpirun("2") + "timeout 60 " +
                                                       Study("--checkpoint " + (folder / "notes")));
  EXPECT_NE(outcome.exit_code, 0);
  EXPECT_NE(outcome.text.find("is no checkpoint"), std::string::npos) << outcome.text;
}

TEST(SweepProcesses, OneAndTwoOfThemGiveTheBytesOfTheProgramAlone) {
  const testing::TemporaryFolder folder;
  const auto sweep = [&](const std::string& name) {
    return "tumbler sweep " + testing::SourcePath("primitives/tasks/nominal/handstand.toml") +
           " --over mass=0.98,1.02,30 --guess " +
           testing::SourcePath("primitives/nominal/handstand.toml") + " --out " + (folder / name) +
           " --json - 2>/dev/null";
  };
  const testing::Outcome alone = testing::RunInShell(sweep("alone"));
  ASSERT_NE(alone.text.find("\"found\": true"), std::string::npos) << alone.text;
  for (const std::string processes : {"1", "2"}) {
    const testing::Outcome together =
        testing::RunInShell(Mpirun(processes) + "timeout 100 " + sweep(processes));
    EXPECT_EQ(together.exit_code, 0);
    EXPECT_EQ(together.text, alone.text) << processes;
    EXPECT_EQ(testing::ReadFile(folder / (processes + "/handstand-0001.toml")),
              testing::ReadFile(folder / "alone/handstand-0001.toml"));
  }
}

}  // namespace
}  // namespace tumbler
