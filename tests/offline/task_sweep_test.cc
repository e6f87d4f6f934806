// tumbler sweep as a user meets it.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "offline/problem/task_toml.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Program;
using testing::QuickTask;
using testing::ReadFile;
using testing::TaskFolder;

Program Sweep(const TaskFolder& folder, const std::string& out, std::vector<std::string> more) {
  more.insert(more.begin(),
              {testing::ProgramPath("tumbler sweep"), folder.task_file(), "--out", folder / out});
  return Program(more);
}

const std::vector<std::string> kTwoByTwo = {"--over", "contact.mu=0.3,0.5", "--over", "mass=1,1.1"};

std::vector<std::string> TwoByTwo(std::vector<std::string> more = {}) {
  more.insert(more.begin(), kTwoByTwo.begin(), kTwoByTwo.end());
  return more;
}

/// All files of a library but the list from which it goes on, whose lines have no order.
std::string BytesOf(const TaskFolder& folder, const std::string& out) {
  std::string bytes;
  for (const char* name : {"library.json", "handstand-0000.toml", "handstand-0001.toml",
                           "handstand-0002.toml", "handstand-0003.toml"}) {
    const std::string path = folder / (out + "/" + name);
    bytes += std::filesystem::exists(path) ? ReadFile(path) : std::string("none: ") + name;
  }
  return bytes;
}

TEST(SweepCli, MakesALibraryWhosePrimitivesSayWhatTheyWereMadeFor) {
  const TaskFolder folder(QuickTask());
  Program program = Sweep(folder, "library", TwoByTwo());
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("4 of 4 points have a motion"));
  const auto library = Json::Parse(ReadFile(folder / "library/library.json")).value();
  ASSERT_EQ(library["points"].size(), 4U);
  for (const Json& point : library["points"].elements()) {
    ASSERT_TRUE(point["found"].boolean());
    const PrimitiveFile file = LoadPrimitive(folder / ("library/" + point["file"].text()));
    const Task task = TaskOf(file);
    EXPECT_EQ(task.problem.scene.contact.mu, point["values"][0].number());
    EXPECT_NEAR(task.problem.scene.robot.tree.dofs.back().mass_kg,
                0.4 * point["values"][1].number(), 1e-12);
    EXPECT_EQ(file.primitive.duration_s, point["duration_s"].number());
    EXPECT_EQ(file.certificate.peak_torque_nm, point["peak_torque_nm"].number());
  }
  // Any program takes them.
  EXPECT_EQ(
      testing::RunProgram({"tumbler run", "sim", folder / "library/handstand-0003.toml"}).exit_code,
      0);
}

TEST(SweepCli, APointIsWhatTheOptimiserMakesOfItsTask) {
  const TaskFolder folder(QuickTask());
  ASSERT_EQ(Sweep(folder, "library", {"--over", "contact.mu=0.5"}).Wait(), 0);
  testing::WriteFile(folder.task_file(), testing::Replaced(QuickTask(), "mu = 0.3", "mu = 0.5"));
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler optimize", folder.task_file(), "--out", folder / "motion.toml"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_TRUE(ReadFile(folder / "library/handstand-0000.toml") == ReadFile(folder / "motion.toml"));
}

TEST(SweepCli, ThreadsAndInterruptionsChangeNoByte) {
  const TaskFolder folder(QuickTask());
  ASSERT_EQ(Sweep(folder, "one", TwoByTwo()).Wait(), 0);
  ASSERT_EQ(Sweep(folder, "two", TwoByTwo({"--threads", "2"})).Wait(), 0);
  const std::string bytes = BytesOf(folder, "one");
  EXPECT_EQ(BytesOf(folder, "two"), bytes);
  // What is missing or was changed is made again, and nothing else.
  const std::string points = ReadFile(folder / "two/points.jsonl");
  const std::size_t second = points.find('\n', points.find('\n') + 1) + 1;
  testing::WriteFile(folder / "two/points.jsonl", points.substr(0, second) + "{\"point\": 1, \"fo");
  std::filesystem::remove(folder / "two/handstand-0002.toml");
  std::filesystem::remove(folder / "two/library.json");
  Program again = Sweep(folder, "two", TwoByTwo());
  ASSERT_EQ(again.Wait(), 0) << again.text();
  EXPECT_THAT(again.text(), HasSubstr("1/4 points"));
  EXPECT_EQ(BytesOf(folder, "two"), bytes);
  testing::WriteFile(folder / "two/handstand-0001.toml", "edited");
  Program mended = Sweep(folder, "two", TwoByTwo());
  ASSERT_EQ(mended.Wait(), 0) << mended.text();
  EXPECT_THAT(mended.text(), HasSubstr("3/4 points"));
  EXPECT_EQ(BytesOf(folder, "two"), bytes);
}

TEST(SweepCli, CtrlCKeepsWhatIsKnownAndTheSameCommandGoesOn) {
  const TaskFolder folder(testing::EndlessSearch());
  Program program = Sweep(folder, "library", {"--over", "mass=1,1.1"});
  ASSERT_TRUE(program.WaitFor("0/2 points"));
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait(), 130) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("the same command goes on"));
  EXPECT_FALSE(std::filesystem::exists(folder / "library/library.json"));
}

TEST(SweepCli, TwoAtOnceDoNotWriteIntoOneLibrary) {
  const TaskFolder folder(testing::EndlessSearch());
  Program first = Sweep(folder, "library", {"--over", "mass=1,1.1"});
  ASSERT_TRUE(first.WaitFor("0/2 points"));
  Program second = Sweep(folder, "library", {"--over", "mass=1,1.1"});
  EXPECT_EQ(second.Wait(), 1) << second.text();
  EXPECT_THAT(second.text(), HasSubstr("library: is being written by another program"));
  first.Signal(SIGINT);
  EXPECT_EQ(first.Wait(), 130) << first.text();
}

TEST(SweepCli, APointWithoutAMotionSaysWhy) {
  // Motors cannot hold legs of 50 times their mass.
  const TaskFolder folder(QuickTask());
  Program program =
      Sweep(folder, "library", {"--over", "contact.mu=0.3,0.5", "--over", "mass=1,50"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("no motion: "));
  EXPECT_THAT(program.text(), HasSubstr("2 of 4 points have a motion"));
  const auto library = Json::Parse(ReadFile(folder / "library/library.json")).value();
  EXPECT_FALSE(library["points"][1]["found"].boolean());
  EXPECT_NE(library["points"][1]["cause"].text(), "");
}

TEST(SweepCli, RefusesAFolderOfOtherThingsAndALibraryOfOtherPoints) {
  const TaskFolder folder(QuickTask());
  std::filesystem::create_directories(folder / "notes");
  testing::WriteFile(folder / "notes/diary.txt", "dear diary");
  Program other = Sweep(folder, "notes", {"--over", "mass=1"});
  EXPECT_EQ(other.Wait(), 1);
  EXPECT_THAT(other.text(), HasSubstr("is no library of tumbler sweep"));
  EXPECT_EQ(folder.Listing().count("notes/points.jsonl"), 0U);
  ASSERT_EQ(Sweep(folder, "library", {"--over", "mass=1"}).Wait(), 0);
  const std::string before = ReadFile(folder / "library/library.json");
  for (const std::vector<std::string>& changed : std::vector<std::vector<std::string>>{
           {"--over", "mass=1,1.1"}, {"--over", "mass=1.1"}, {"--over", "mass=1", "--seed", "5"}}) {
    Program program = Sweep(folder, "library", changed);
    EXPECT_EQ(program.Wait(), 1);
    EXPECT_THAT(program.text(), HasSubstr("is about other points"));
  }
  EXPECT_EQ(ReadFile(folder / "library/library.json"), before);
}

TEST(SweepCli, RefusesWhatItCannotDoBeforeAnyWork) {
  const TaskFolder folder(QuickTask());
  const auto refused = [&](std::vector<std::string> more, const std::string& part) {
    Program program = Sweep(folder, "library", std::move(more));
    EXPECT_EQ(program.Wait(), 1) << program.text();
    EXPECT_THAT(program.text(), HasSubstr(part));
    EXPECT_FALSE(std::filesystem::exists(folder / "library"));
  };
  refused({}, "--over");
  refused({"--over", "mass"}, "--over: 'mass' names no key");
  refused({"--over", "contact.mu=0.3,-0.3"}, "contact.mu: is -0.3");
  refused({"--over", "mass=1", "--guess", folder / "no.toml"}, "cannot be opened");
  refused({"--over", "mass=1", "--guess", folder / "no.toml", "--seed", "1"}, "--guess");
  refused({"--over", "mass=1", "--json", folder.task_file()}, "task.toml");
  const std::string guess = testing::SourcePath("primitives/nominal/handstand.toml");
  refused({"--over", "mass=1", "--json", guess, "--guess", guess}, "nominal/handstand.toml");
  refused({"--over", "mass=1", "--json", folder / "library/library.json"}, "library.json");
}

}  // namespace
}  // namespace tumbler
