// tumbler optimize: what it refuses, and how it ends when it is interrupted.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "common/files/primitive_toml.h"
#include "tests/support/files.h"
#include "tests/support/optimize_program.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::Optimize;

using testing::EndlessSearch;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Program;
using testing::QuickTask;
using testing::ReadFile;
using testing::Replaced;
using testing::TaskFolder;

/// The quick task with so many starts, all of them hard to finish, that it runs until it is
/// stopped.
std::string EndlessLocalSolves() {
  std::string text = Replaced(QuickTask(), "batch = 8\nmax_samples = 8\nrefine = 2",
                              "batch = 30\nmax_samples = 30\nrefine = 30");
  return Replaced(text, "screen_evaluations = 10\nfinalists = 2\nmax_evaluations = 25",
                  "screen_evaluations = 100000\nmax_evaluations = 100000\nrelative_tolerance = "
                  "1e-300");
}

TEST(OptimizeCli, WrongCommandLinesAreRefused) {
  const TaskFolder folder(QuickTask());
  const auto before = folder.Listing();
  const std::string out = folder / "motion.toml";
  const struct {
    std::vector<std::string> arguments;
    std::string says;
  } kCases[] = {
      {{"--threads", "0"}, "--threads: Value 0 not in range"},
      {{"--threads", "-1"}, "--threads: Value -1 not in range"},
      {{"--seed", "-1"}, "--seed: is '-1'; allowed: from 0 ..."},
      {{"--seed", "1.5"}, "--seed: is '1.5'; allowed"},
      {{"--seed", "9223372036854775808"}, "--seed: is '9223372036854775808'; allowed"},
      {{"--out", ""}, "--out: is empty"},
      {{"--minima", "0"}, "--minima: Value 0 not in range"},
      {{folder.task_file()}, "tasks that are ranked need different names"},
      {{"--nonsense"}, "--nonsense"},
      {{"--out", out, "--json", out}, "is named for two results"},
      {{"--out", folder / "x/index.html", "--report", folder / "x"}, "is named for two results"},
      {{"--out", folder.task_file()}, "task.toml: is an input"},
      {{"--json", folder.robot_file()}, "tumbler.urdf: is an input"},
  };
  for (const auto& c : kCases) {
    Program program = Optimize(folder, c.arguments);
    EXPECT_EQ(program.Wait(), 1) << c.says;
    EXPECT_THAT(program.text(), HasSubstr(c.says));
  }
  Program nothing({testing::ProgramPath("tumbler optimize")});
  EXPECT_EQ(nothing.Wait(), 1);
  EXPECT_EQ(folder.Listing(), before);
}

// Permission bits do not bind the super-user, so these are places where nobody can write.
TEST(OptimizeCli, ATaskThatTakesSomethingOfAGuessNeedsOne) {
  const std::string task =
      ReadFile(testing::SourcePath("primitives/tasks/handstand_sensor_mirrored.toml"));
  for (const std::string key : {"robust.feedback.from_guess", "mirror"}) {
    const TaskFolder folder(key == "mirror" ? Replaced(task, "from_guess = true", "") : task);
    Program program = Optimize(folder, {"--out", folder / "m.toml"});
    EXPECT_EQ(program.Wait(), 1);
    EXPECT_THAT(program.text(),
                HasSubstr(key + ": is for a task with a guess; name a primitive with --guess"));
    EXPECT_FALSE(std::filesystem::exists(folder / "m.toml"));
  }
}

TEST(OptimizeCli, AMotionWithoutTheFeedbackThatTheTaskAsksForIsNotWritten) {
  // Beyond a limit by less than counts as a violation, but by more than a file's digits.
  const std::string task =
      Replaced(ReadFile(testing::SourcePath("primitives/tasks/handstand_sensor.toml")), "[limits]",
               "[limits.leg2]\nposition_max_rad = 2.69896590\n[limits]");
  const TaskFolder folder(task);
  Program program = Optimize(folder, {"--guess", testing::SourcePath("primitives/handstand.toml"),
                                      "--out", folder / "m.toml"});
  EXPECT_EQ(program.Wait(), 2);
  EXPECT_THAT(program.text(),
              HasSubstr("the guess, whose path is taken as it is, exceeds a limit"));
  EXPECT_FALSE(std::filesystem::exists(folder / "m.toml"));
}

TEST(OptimizeCli, SeveralGuessesAreForARobotThatWasIdentified) {
  const TaskFolder folder(EndlessSearch());
  const auto before = folder.Listing();
  const std::string guess = testing::SourcePath("primitives/nominal/handstand.toml");
  Program program = Optimize(folder, {"--guess", guess, "--guess", guess});
  EXPECT_EQ(program.Wait(), 1);
  EXPECT_THAT(program.text(), HasSubstr("give one, or --posterior"));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCli, StandardOutputIsNoFolderForPages) {
  const TaskFolder folder(EndlessSearch());
  const auto before = folder.Listing();
  Program program = Optimize(folder, {"--report", "-"});
  EXPECT_EQ(program.Wait(), 1);
  EXPECT_THAT(program.text(), HasSubstr("tumbler optimize: -: a page cannot be written to standard "
                                        "output; './-' is a folder"));
  EXPECT_FALSE(std::filesystem::exists("-"));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCli, OutputThatCannotBeWrittenIsFoundBeforeTheWork) {
  const TaskFolder folder(EndlessSearch());
  testing::WriteFile(folder / "file", "keep me");
  const auto before = folder.Listing();
  const std::string below_a_file = folder / "file/motion.toml";
  const std::string in_no_folder = "/proc/absent/motion.toml";
  const std::string in_proc = "/proc/tumbler_motion.toml";
  for (const char* option : {"--out", "--json"}) {
    for (const std::string& path : {below_a_file, in_no_folder, in_proc,
                                    std::string(folder / "tasks"), std::string("/dev/full")}) {
      Program program = Optimize(folder, {option, path});
      EXPECT_EQ(program.Wait(), 1) << path;
      EXPECT_THAT(program.text(), HasSubstr("tumbler optimize: " + path + ": "));
      EXPECT_THAT(program.text(), Not(HasSubstr("search "))) << "the work had begun";
    }
  }
  for (const std::string& path : {std::string(folder / "file"), std::string(folder / "file/report"),
                                  std::string("/proc/report")}) {
    Program program = Optimize(folder, {"--report", path});
    EXPECT_EQ(program.Wait(), 1) << path;
    EXPECT_THAT(program.text(), HasSubstr("tumbler optimize: " + path + ": "));
    EXPECT_THAT(program.text(), Not(HasSubstr("search ")));
  }
  EXPECT_EQ(folder.Listing(), before);
  EXPECT_EQ(ReadFile(folder / "file"), "keep me");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(OptimizeCli, SaysNothingWhileItWorksWhenItIsToBeQuiet) {
  const TaskFolder folder(QuickTask());
  Program told = Optimize(folder, {"--out", folder / "a.toml"});
  EXPECT_EQ(told.Wait(), 0);
  EXPECT_THAT(told.text(), HasSubstr("search "));
  EXPECT_THAT(told.text(), Not(HasSubstr("at most -")));
  Program quiet = Optimize(folder, {"--out", folder / "b.toml", "--quiet"});
  EXPECT_EQ(quiet.Wait(), 0);
  EXPECT_THAT(quiet.text(), Not(HasSubstr("search ")));
  EXPECT_THAT(quiet.text(), Not(HasSubstr("solve ")));
  EXPECT_THAT(quiet.text(), HasSubstr("  primitive "));
  EXPECT_EQ(ReadFile(folder / "a.toml"), ReadFile(folder / "b.toml"));
}

TEST(OptimizeCli, ReplacesTheFileBehindASymbolicLinkAndKeepsTheLink) {
  const TaskFolder folder(QuickTask());
  testing::WriteFile(folder / "real.toml", "old");
  std::filesystem::create_symlink(folder / "real.toml", folder / "link.toml");
  Program program = Optimize(folder, {"--out", folder / "link.toml"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.toml"));
  EXPECT_EQ(LoadPrimitive(folder / "real.toml").primitive.name.view(), "handstand");
}

TEST(OptimizeCli, FailureOfOneOutputLeavesNoOther) {
  const TaskFolder folder(QuickTask());
  // A folder has the name of the page, which shows only when the page is renamed.
  std::filesystem::create_directories(folder / "report/index.html/x");
  const auto before = folder.Listing();
  Program program = Optimize(folder, {"--out", folder / "motion.toml", "--json",
                                      folder / "figures.json", "--report", folder / "report"});
  EXPECT_EQ(program.Wait(), 1) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("index.html"));
  // But what was written while the work went on, which is a motion as asked.
  EXPECT_THAT(program.text(), HasSubstr("the interim motion in " + (folder / "motion.toml")));
  EXPECT_TRUE(std::filesystem::remove(folder / "motion.toml"));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCli, AnEndThatNoSpeedLimitAllowsIsRefusedByTheLimitsName) {
  // From home to the handstand are 1.57 rad. In 0.06 s at 20 rad/s only 1.2 rad are possible.
  const TaskFolder folder(
      Replaced(testing::LongHandstandTask(), "duration_s = 1.2", "duration_s = 0.06"));
  const auto before = folder.Listing();
  Program program = Optimize(folder, {"--out", folder / "motion.toml"});
  EXPECT_EQ(program.Wait(), 2) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("no motion was found: the best motion exceeds a limit: "));
  EXPECT_THAT(program.text(), ::testing::ContainsRegex("(velocity|acceleration) of leg[12] by"));
  EXPECT_THAT(program.text(), HasSubstr("duration_s"));
  EXPECT_THAT(program.text(), HasSubstr("no file was written"));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCliInterrupt, DuringTheSearchNothingIsKept) {
  const TaskFolder folder(EndlessSearch());
  const auto before = folder.Listing();
  for (const char* threads : {"1", "2"}) {
    Program program = Optimize(folder, {"--out", folder / "motion.toml", "--threads", threads});
    ASSERT_TRUE(program.WaitFor("search ")) << program.text();
    program.Signal(SIGINT);
    EXPECT_EQ(program.Wait(), 130) << program.text();
    EXPECT_THAT(program.text(), HasSubstr("interrupted: "));
    EXPECT_THAT(program.text(), HasSubstr("no file was written"));
    EXPECT_EQ(folder.Listing(), before);
  }
}

TEST(OptimizeCliInterrupt, DuringTheLocalSolvesNothingIsKeptUnlessAskedFor) {
  const TaskFolder folder(EndlessLocalSolves());
  const auto before = folder.Listing();
  Program program = Optimize(folder, {"--out", folder / "motion.toml", "--report",
                                      folder / "report", "--json", folder / "figures.json"});
  ASSERT_TRUE(program.WaitFor("solve ")) << program.text();
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait(), 130) << program.text();
  EXPECT_THAT(program.text(),
              HasSubstr("interrupted: what was found so far is dropped (--keep-best keeps a "
                        "motion that is as asked); no file was written"));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCliInterrupt, AMotionThatIsAsAskedIsThereWhileAProofIsLookedForAndStaysThere) {
  const TaskFolder folder(EndlessLocalSolves());
  const std::string out = folder / "motion.toml";
  Program program = Optimize(folder, {"--out", out, "--json", folder / "figures.json", "--prove"});
  ASSERT_TRUE(program.WaitFor("interim: objective ")) << program.text();
  const PrimitiveFile meanwhile = LoadPrimitive(out);
  EXPECT_EQ(meanwhile.certificate.constraint_violation, 0);
  EXPECT_TRUE(meanwhile.certificate.kkt_residual.has_value());
  for (const PurposeFigure& figure : meanwhile.purpose) EXPECT_TRUE(figure.met()) << figure.name();
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait(), 130) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("the interim motion in " + out + " stands"));
  EXPECT_LE(LoadPrimitive(out).provenance.objective, meanwhile.provenance.objective);
  EXPECT_FALSE(std::filesystem::exists(folder / "figures.json"));
}

TEST(OptimizeCliInterrupt, KeepBestWritesAWholePrimitiveWhicheverSignalEndsIt) {
  const TaskFolder folder(EndlessLocalSolves());
  for (const auto& [threads, signal] : {std::pair{"1", SIGINT}, {"2", SIGTERM}, {"3", SIGHUP}}) {
    const std::string out = folder / ("motion" + std::string(threads) + ".toml");
    Program program = Optimize(folder, {"--out", out, "--keep-best", "--threads", threads});
    ASSERT_TRUE(program.WaitFor("violation 0.0e+00")) << program.text();
    program.Signal(signal);
    EXPECT_EQ(program.Wait(), 130) << program.text();
    EXPECT_THAT(program.text(), HasSubstr("interrupted: the best motion so far is kept"));
    EXPECT_THAT(program.text(), HasSubstr("primitive " + out));
    const PrimitiveFile file = LoadPrimitive(out);
    EXPECT_EQ(file.certificate.constraint_violation, 0);
    EXPECT_GT(file.certificate.torque_margin_nm, 0);
  }
}

TEST(OptimizeCliInterrupt, KeepBestWritesAWholePrimitiveWhenItsTerminalGoes) {
  const TaskFolder folder(EndlessLocalSolves());
  const std::string out = folder / "motion.toml", task = folder.task_file();
  const std::string program = testing::ProgramPath("tumbler");
  int terminal = -1;
  const pid_t child = forkpty(&terminal, nullptr, nullptr, nullptr);
  ASSERT_GE(child, 0);
  if (child == 0) {
    execl(program.c_str(), program.c_str(), "optimize", task.c_str(), "--out", out.c_str(),
          "--keep-best", nullptr);
    _exit(127);
  }
  std::string text;
  std::array<char, 4096> buffer{};
  while (text.find("violation 0.0e+00") == std::string::npos) {
    const ssize_t count = read(terminal, buffer.data(), buffer.size());
    ASSERT_GT(count, 0) << text;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  close(terminal);  // The kernel tells the program.
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 130) << status << text;
  EXPECT_EQ(LoadPrimitive(out).certificate.constraint_violation, 0);
}

TEST(OptimizeCliInterrupt, KeepBestDuringTheSearchEndsWithoutACrash) {
  const TaskFolder folder(Replaced(testing::LongHandstandTask(), "seed = 1",
                                   "seed = 1\nbatch = 1000000\nmax_samples = 1000000"));
  for (const char* threads : {"1", "2"}) {
    const std::string out = folder / ("motion" + std::string(threads) + ".toml");
    Program program = Optimize(folder, {"--out", out, "--keep-best", "--threads", threads});
    ASSERT_TRUE(program.WaitFor("search ")) << program.text();
    program.Signal(SIGINT);
    EXPECT_EQ(program.Wait(), 130) << program.text();
    if (std::filesystem::exists(out)) {
      EXPECT_EQ(LoadPrimitive(out).certificate.constraint_violation, 0);
      EXPECT_THAT(program.text(), HasSubstr("is kept"));
    } else {
      EXPECT_THAT(program.text(), HasSubstr("interrupted: no motion was found so far: "));
      EXPECT_THAT(program.text(), HasSubstr("; no file was written"));
    }
  }
}

}  // namespace
}  // namespace tumbler
