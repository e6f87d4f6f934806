// Every mistake in a task or a robot ends the program with a message that names file, line, key and
// what is allowed, and nothing is written. The mistakes are in tests/data/bad_inputs.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "offline/problem/task_toml.h"
#include "tests/support/bad_inputs.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AnyOf;
using testing::BadInput;
using testing::BadInputs;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using testing::LineOf;
using testing::LongHandstandTask;
using testing::Program;
using testing::ReadFile;
using testing::Replaced;
using testing::ShippedRobot;
using testing::TaskFolder;

const std::string kProgram = testing::ProgramPath("tumbler optimize");

std::string WithoutAll(const std::string& text, const std::string& part) {
  return testing::ReplacedAll(text, part, "");
}

std::map<std::string, std::filesystem::file_time_type> FilesOf(
    const std::filesystem::path& folder) {
  std::map<std::string, std::filesystem::file_time_type> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files.emplace(std::filesystem::relative(entry.path(), folder).string(),
                    entry.last_write_time());
    }
  }
  return files;
}

/// The bad inputs as files.
class BadInputFolder : public ::testing::Test {
 protected:
  BadInputFolder() { testing::WriteBadInputs(folder_.path()); }
  /// The good task with another robot.
  [[nodiscard]] std::string GoodTaskWith(const std::string& robot) const {
    return Replaced(testing::GoodTask(), "good.urdf", folder_ / robot);
  }
  [[nodiscard]] std::string WithoutFolder(const std::string& text) const {
    return WithoutAll(text, folder_.path().string() + "/");
  }

  testing::TemporaryFolder folder_;
};

TEST_F(BadInputFolder, HasSome200AndNoTwoAreTheSame) {
  std::set<std::string> names, texts{testing::GoodTask(), testing::GoodRobot()}, said;
  for (const BadInput& input : BadInputs()) {
    EXPECT_TRUE(names.insert(input.name).second) << input.name << " is listed twice";
    EXPECT_TRUE(texts.insert(input.text).second || input.text.empty())
        << input.name << " has the text of another";
    // Names and lines differ in any case, so the problem in the message must differ, too.
    const std::size_t place = input.message.find(": ");
    ASSERT_NE(place, std::string::npos) << input.name;
    EXPECT_TRUE(said.insert(input.message.substr(place)).second)
        << input.name << " has the message of another: " << input.message;
  }
  EXPECT_GE(names.size(), 190U);
}

TEST_F(BadInputFolder, TheTaskAndTheRobotThatTheOthersAreMadeFromAreGood) {
  const TaskFolder folder(
      Replaced(GoodTaskWith("good.urdf"), "duration_s = 1.2", "duration_s = 0.3\n"));
  const Task task = LoadTask(folder.task_file());
  EXPECT_EQ(task.problem.joints.size(), 2U);
  EXPECT_EQ(task.problem.scene.robot.shapes.size(), 6U);
}

/// The message with the names that a key may have in the place of {TABLE.KEY}.
std::string WithNames(std::string message) {
  for (const KeyTable& table : TaskKeyTables()) {
    for (const KeyRow& row : table.rows) {
      const std::string place = "{" + table.name + "." + WithoutAll(row.key, "`") + "}";
      const std::size_t at = message.find(place);
      if (at == std::string::npos) continue;
      message.replace(at, place.size(), WithoutAll(WithoutAll(row.allowed, "`"), "\""));
    }
  }
  return message;
}

TEST_F(BadInputFolder, EveryFileEndsTheOptimiserWithItsMessageAndChangesNothing) {
  const auto before = FilesOf(folder_.path());
  for (const BadInput& input : BadInputs()) {
    SCOPED_TRACE(input.name);
    const TaskFolder folder(GoodTaskWith(input.name));
    const auto listing = folder.Listing();
    const std::string task = input.is_task() ? folder_ / input.name : folder.task_file().string();
    Program program({kProgram, task, "--out", folder / "motion.toml", "--report", folder / "report",
                     "--json", folder / "figures.json"});
    EXPECT_EQ(program.Wait(), 1);
    std::string text = WithoutFolder(program.text());
    if (!input.is_task()) text = WithoutAll(text, folder / "tasks/");
    const bool of_task = !input.is_task() && input.message.starts_with("good");
    const std::string message =
        WithNames(of_task ? Replaced(input.message, "good", "task") : input.message);
    EXPECT_THAT(text, EndsWith("tumbler optimize: " + message + "\n"));
    EXPECT_EQ(folder.Listing(), listing) << "files were left behind";
  }
  EXPECT_EQ(FilesOf(folder_.path()), before);
}

TEST_F(BadInputFolder, TheChecksOfARobotSayTheSame) {
  for (const BadInput& input : BadInputs()) {
    if (input.is_task() || !input.message.starts_with(input.name)) continue;
    SCOPED_TRACE(input.name);
    Program program({testing::ProgramPath("tumbler model"), "check", folder_ / input.name});
    const int status = program.Wait();
    const std::string text = WithoutFolder(program.text());
    // Where robots in general may have something that those of tasks may not, the table of the
    // robot's parts has a remark about it.
    if (status == 0 || status == 4) {  // where joints can be locked, or cannot
      const bool many = input.name == "too_many_joints.urdf";
      EXPECT_THAT(text, HasSubstr(many ? "can be planned: not yet\n  it needs 4 more of these 16 "
                                         "joints locked"
                                       : "can be planned: not yet; in the way:\n    " +
                                             input.message + "\n"));
    } else {
      EXPECT_EQ(status, 1);
      EXPECT_EQ(text, "tumbler model: " + input.message + "\n");
    }
  }
}

struct Place {
  std::size_t offset, length;
};

/// The places of numbers between one of the texts `before` and one of the characters `behind`.
std::vector<Place> FindNumbers(const std::string& text, const std::vector<std::string>& before,
                               const std::string& behind) {
  std::vector<Place> places;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const std::string_view rest = std::string_view(text).substr(at);
    const auto stands = [&](const std::string& part) { return rest.starts_with(part); };
    const auto part = std::find_if(before.begin(), before.end(), stands);
    if (part == before.end()) continue;
    const std::size_t first = at + part->size();
    const std::size_t digit = text.find_first_not_of("-+", first);
    const std::size_t end = text.find_first_not_of("-+0123456789.e", first);
    if (digit > first + 1 || !std::isdigit(static_cast<unsigned char>(text.at(digit)))) continue;
    if (behind.find(text.at(end)) != std::string::npos) places.push_back({first, end - first});
  }
  return places;
}

int LineAt(const std::string& text, std::size_t offset) {
  return 1 + static_cast<int>(std::count(text.begin(),
                                         text.begin() + static_cast<std::ptrdiff_t>(offset), '\n'));
}

/// The shipped task with every number that a task can have.
std::string TaskWithEveryNumber() {
  std::string text = LongHandstandTask();
  text = Replaced(text, "pitch_rad = 0.0", "pitch_rad = 0.0\nx_m = 0.0\nz_m = 0.25", "[start]");
  text = Replaced(text, "[[cost]]",
                  "velocity_max_rad_s = 19.0\ntorque_max_nm = 7.0\nposition_min_rad = "
                  "-2.8\nposition_max_rad = 2.8\n[limits.leg2]\nvelocity_max_rad_s = "
                  "18.0\nacceleration_max_rad_s2 = 300.0\ntorque_max_nm = 6.0\nposition_min_rad = "
                  "-2.7\nposition_max_rad = 2.7\nrotor_inertia_kg_m2 = 0.002\n[[cost]]");
  text = Replaced(text, "[search]",
                  "[[obstacle]]\nname = \"bar\"\nkind = \"cylinder\"\ncentre_m = [3.0, "
                  "0.1]\nradius_m = 0.05\n[tolerances]\nentry_rad = 0.1\nfollowing_rad = "
                  "0.3\n[search]\nbatch = 8\npromising = 2\nmax_samples = 8\nrefine = 1\nmodes = "
                  "3\nspread_rad = 0.3\nbasin_rad = 0.5\ntorque_penalty = 1.0\ncore_penalty = "
                  "0.1\nstep_s = 2.0e-3");
  return Replaced(text, "[solver]",
                  "[solver]\nscreen_evaluations = 2\nfinalists = 1\nmax_evaluations = "
                  "3\nrelative_tolerance = 1.0e-7\nsharpness = 60.0");
}

TEST(BadInputEverywhere, ATaskWithEveryNumberIsRead) {
  const TaskFolder folder(TaskWithEveryNumber());
  Program program({kProgram, folder.task_file()});
  EXPECT_THAT(program.Wait(), AnyOf(0, 2)) << program.text();
}

TEST(BadInputEverywhere, NoNumberOfATaskMayBeNanOrInfinite) {
  const std::string text = TaskWithEveryNumber();
  const std::vector<Place> places = FindNumbers(text, {"= [", "= ", ", "}, ",] }\n");
  ASSERT_GE(places.size(), 55U);
  for (const Place& place : places) {
    for (const std::string value : {"nan", "inf", "-inf"}) {
      std::string changed = text;
      changed.replace(place.offset, place.length, value);
      const int line = LineAt(text, place.offset);
      SCOPED_TRACE("line " + std::to_string(line) + ": " + value);
      const TaskFolder folder(changed);
      const auto before = folder.Listing();
      Program program({kProgram, folder.task_file(), "--out", folder / "motion.toml"});
      EXPECT_EQ(program.Wait(), 1);
      EXPECT_THAT(program.text(), HasSubstr("task.toml:" + std::to_string(line) + ": "));
      EXPECT_THAT(program.text(),
                  AnyOf(HasSubstr("is " + value), HasSubstr("expected an integer")));
      EXPECT_EQ(folder.Listing(), before);
    }
  }
}

TEST(BadInputEverywhere, NoNumberOfARobotMayBeNanOrInfiniteOrHaveSomethingBehindIt) {
  const std::string text = ShippedRobot();
  std::vector<Place> places = FindNumbers(text, {"=\""}, "\" ");
  places.erase(places.begin());  // The first number is that of <?xml version?>.
  ASSERT_GE(places.size(), 50U);
  for (const Place& place : places) {
    for (const std::string value : {"nan", "-inf", "1.0abc"}) {
      std::string changed = text;
      changed.replace(place.offset, place.length, value);
      const int line = LineAt(text, place.offset);
      SCOPED_TRACE("line " + std::to_string(line) + ": " + value);
      const TaskFolder folder(LongHandstandTask(), changed);
      Program program({kProgram, folder.task_file(), "--out", folder / "motion.toml"});
      EXPECT_EQ(program.Wait(), 1);
      EXPECT_THAT(program.text(), HasSubstr("tumbler.urdf:" + std::to_string(line) + ": "));
      EXPECT_THAT(program.text(), HasSubstr("'" + value));
    }
  }
}

TEST(BadInputFiles, MissingTask) {
  const TaskFolder folder(LongHandstandTask());
  Program program({kProgram, folder / "absent.toml"});
  EXPECT_EQ(program.Wait(), 1);
  EXPECT_THAT(program.text(), HasSubstr("absent.toml: cannot be opened: No such file"));
}

TEST(BadInputFiles, ATaskThatIsAFolder) {
  const TaskFolder folder(LongHandstandTask());
  Program program({kProgram, folder / "tasks"});
  EXPECT_EQ(program.Wait(), 1);
  EXPECT_THAT(program.text(), HasSubstr("tasks: is a directory, not a file"));
}

TEST(BadInputFiles, AFileWithoutEndIsRefused) {
  Program as_task({kProgram, "/dev/zero"});
  EXPECT_EQ(as_task.Wait(), 1);
  EXPECT_THAT(as_task.text(), HasSubstr("/dev/zero: is too large; allowed: up to 16777216 bytes"));
  const TaskFolder folder(Replaced(LongHandstandTask(), "../robots/tumbler.urdf", "/dev/zero"));
  Program as_robot({kProgram, folder.task_file()});
  EXPECT_EQ(as_robot.Wait(), 1);
  EXPECT_THAT(as_robot.text(), HasSubstr("/dev/zero: is too large"));
}

TEST(BadInputFiles, LinesAreCountedTheSameWithWindowsLineEnds) {
  const auto windows = [](const std::string& text) {
    return testing::ReplacedAll(text, "\n", "\r\n");
  };
  const auto said = [](const std::string& task, const std::string& robot) {
    const TaskFolder folder(task, robot);
    Program program({kProgram, folder.task_file()});
    EXPECT_EQ(program.Wait(), 1);
    return program.text();
  };
  const std::string task = Replaced(LongHandstandTask(), "mu = 0.3", "mu = -0.3");
  EXPECT_THAT(said(windows(task), ShippedRobot()),
              HasSubstr("task.toml:" + std::to_string(LineOf(task, "mu = -0.3")) + ": contact.mu"));
  const std::string robot = Replaced(ShippedRobot(), "mass value=\"1.0\"", "mass value=\"0\"");
  EXPECT_THAT(
      said(LongHandstandTask(), windows(robot)),
      HasSubstr("tumbler.urdf:" + std::to_string(LineOf(robot, "mass value=\"0\"")) + ": "));
}

}  // namespace
}  // namespace tumbler
