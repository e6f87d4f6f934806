// Every mistake that a task or a robot can hold ends the program with a message that names file,
// line, key and what is allowed, and with nothing written. Mistakes are files: see
// tests/data/bad_inputs.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "offline/problem/task_toml.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AnyOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using testing::LineOf;
using testing::Program;
using testing::ReadFile;
using testing::Replaced;
using testing::ShippedRobot;
using testing::ShippedTask;
using testing::TaskFolder;

const char* const kProgram = TUMBLER_BINARY_DIR "/bin/tumbler-optimize";

/// A file of the folder of bad inputs, and the whole message that it deserves.
struct BadFile {
  std::string name;     ///< Relative to the folder, such as `tasks/duration_zero.toml`.
  std::string message;  ///< With paths relative to the folder; `good.toml` is the good task.
  [[nodiscard]] bool is_task() const { return name.starts_with("tasks/"); }
};

const std::filesystem::path kFolder = TUMBLER_SOURCE_DIR "/tests/data/bad_inputs";

/// Comments, then lines in pairs: a file's name, and its message indented by four blanks.
std::vector<BadFile> ReadMessages() {
  std::vector<BadFile> files;
  std::istringstream lines(ReadFile(kFolder / "messages.txt"));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("#")) continue;
    BadFile& file = files.emplace_back();
    file.name = line;
    std::getline(lines, file.message);
    if (!file.message.starts_with("    "))
      throw std::runtime_error("messages.txt has no message below " + line);
    file.message.erase(0, 4);
  }
  return files;
}

std::string WithoutAll(std::string text, const std::string& part) {
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part))
    text.erase(at, part.size());
  return text;
}

std::map<std::string, std::filesystem::file_time_type> FilesOf(
    const std::filesystem::path& folder) {
  std::map<std::string, std::filesystem::file_time_type> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file())
      files.emplace(std::filesystem::relative(entry.path(), folder).string(),
                    entry.last_write_time());
  }
  return files;
}

/// The good task with another robot.
std::string GoodTaskWith(const std::filesystem::path& robot) {
  return Replaced(ReadFile(kFolder / "good.toml"), "good.urdf", robot.string());
}

TEST(BadInputFolder, HasAMessageForEachFileAndNoTwoAreTheSame) {
  std::set<std::string> in_table, on_disk, said;
  for (const BadFile& file : ReadMessages()) {
    EXPECT_TRUE(in_table.insert(file.name).second) << file.name << " is listed twice";
    // The name and the line tell two files apart in any case; what is wrong must do so by itself.
    const std::size_t place = file.message.find(": ");
    ASSERT_NE(place, std::string::npos) << file.name;
    EXPECT_TRUE(said.insert(file.message.substr(place)).second)
        << file.name << " has the message of another file: " << file.message;
  }
  for (const auto& [name, time] : FilesOf(kFolder)) {
    if (name.starts_with("tasks/") || name.starts_with("robots/")) on_disk.insert(name);
  }
  EXPECT_EQ(in_table, on_disk);
  EXPECT_GE(in_table.size(), 40U);
}

TEST(BadInputFolder, TheTaskAndTheRobotThatTheOthersAreMadeFromAreGood) {
  const TaskFolder folder(
      Replaced(GoodTaskWith(kFolder / "good.urdf"), "duration_s = 1.2", "duration_s = 0.3\n"));
  const Task task = LoadTask(folder.task_file());
  EXPECT_EQ(task.problem.joints.size(), 2U);
  EXPECT_EQ(task.problem.robot.shapes.size(), 6U);
}

TEST(BadInputFolder, EveryFileEndsTheOptimiserWithItsMessageAndChangesNothing) {
  const auto before = FilesOf(kFolder);
  for (const BadFile& file : ReadMessages()) {
    SCOPED_TRACE(file.name);
    const TaskFolder folder(GoodTaskWith(kFolder / file.name));
    const auto listing = folder.Listing();
    const std::string task =
        file.is_task() ? (kFolder / file.name).string() : folder.task_file().string();
    Program program({kProgram, task, "--out", folder / "motion.toml", "--report", folder / "report",
                     "--json", folder / "figures.json"});
    EXPECT_EQ(program.Wait(), 1);
    std::string text = WithoutAll(program.text(), kFolder.string() + "/");
    if (!file.is_task()) text = WithoutAll(text, folder / "tasks/");
    const std::string message =
        file.message.starts_with("good") ? Replaced(file.message, "good", "task") : file.message;
    EXPECT_THAT(text, EndsWith("error: " + message + "\n"));
    EXPECT_EQ(folder.Listing(), listing) << "files were left behind";
  }
  EXPECT_EQ(FilesOf(kFolder), before);
}

TEST(BadInputFolder, TheChecksOfARobotSayTheSame) {
  for (const BadFile& file : ReadMessages()) {
    if (file.is_task() || !file.message.starts_with(file.name)) continue;
    SCOPED_TRACE(file.name);
    Program program({TUMBLER_BINARY_DIR "/bin/tumbler-model", "check", kFolder / file.name});
    const int status = program.Wait();
    const std::string text = WithoutAll(program.text(), kFolder.string() + "/");
    // What a robot in general may have, but none of a task, is a remark in the table of its parts.
    if (status == 0) {
      EXPECT_THAT(text, HasSubstr("tumbler-optimize does not take it: " + file.message + "\n"));
    } else {
      EXPECT_EQ(status, 1);
      EXPECT_EQ(text, "error: " + file.message + "\n");
    }
  }
}

struct Place {
  std::size_t offset, length;
};

/// Where each match of the pattern's first group is.
std::vector<Place> FindAll(const std::string& text, const std::string& pattern) {
  std::vector<Place> places;
  const std::regex regex(pattern);
  for (std::sregex_iterator i(text.begin(), text.end(), regex), end; i != end; ++i) {
    places.push_back(
        {static_cast<std::size_t>(i->position(1)), static_cast<std::size_t>(i->length(1))});
  }
  return places;
}

int LineAt(const std::string& text, std::size_t offset) {
  return 1 + static_cast<int>(std::count(text.begin(),
                                         text.begin() + static_cast<std::ptrdiff_t>(offset), '\n'));
}

/// The shipped task with every number that a task can hold.
std::string TaskWithEveryNumber() {
  std::string text = ShippedTask();
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
  const std::vector<Place> places =
      FindAll(text, "(?:= |= \\[|, )([-+]?[0-9][-+0-9.e]*)(?=[,\\] }\\n])");
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
  std::vector<Place> places = FindAll(text, "=\"([-+]?[0-9][-+0-9.e]*)[\" ]");
  places.erase(places.begin());  // That of <?xml version?>.
  ASSERT_GE(places.size(), 50U);
  for (const Place& place : places) {
    for (const std::string value : {"nan", "-inf", "1.0abc"}) {
      std::string changed = text;
      changed.replace(place.offset, place.length, value);
      const int line = LineAt(text, place.offset);
      SCOPED_TRACE("line " + std::to_string(line) + ": " + value);
      const TaskFolder folder(ShippedTask(), changed);
      Program program({kProgram, folder.task_file(), "--out", folder / "motion.toml"});
      EXPECT_EQ(program.Wait(), 1);
      EXPECT_THAT(program.text(), HasSubstr("tumbler.urdf:" + std::to_string(line) + ": "));
      EXPECT_THAT(program.text(), HasSubstr("'" + value));
    }
  }
}

TEST(BadInputFiles, MissingTask) {
  const TaskFolder folder(ShippedTask());
  Program program({kProgram, folder / "absent.toml"});
  EXPECT_EQ(program.Wait(), 1);
  EXPECT_THAT(program.text(), HasSubstr("absent.toml: cannot be opened: No such file"));
}

TEST(BadInputFiles, ATaskThatIsAFolder) {
  const TaskFolder folder(ShippedTask());
  Program program({kProgram, folder / "tasks"});
  EXPECT_EQ(program.Wait(), 1);
  EXPECT_THAT(program.text(), HasSubstr("tasks: is a directory, not a file"));
}

TEST(BadInputFiles, AFileWithoutEndIsRefused) {
  Program as_task({kProgram, "/dev/zero"});
  EXPECT_EQ(as_task.Wait(), 1);
  EXPECT_THAT(as_task.text(), HasSubstr("/dev/zero: is too large; allowed: up to 16777216 bytes"));
  const TaskFolder folder(Replaced(ShippedTask(), "../robots/tumbler.urdf", "/dev/zero"));
  Program as_robot({kProgram, folder.task_file()});
  EXPECT_EQ(as_robot.Wait(), 1);
  EXPECT_THAT(as_robot.text(), HasSubstr("/dev/zero: is too large"));
}

TEST(BadInputFiles, LinesAreCountedTheSameWithWindowsLineEnds) {
  const auto windows = [](const std::string& text) {
    return std::regex_replace(text, std::regex("\n"), "\r\n");
  };
  const auto said = [](const std::string& task, const std::string& robot) {
    const TaskFolder folder(task, robot);
    Program program({kProgram, folder.task_file()});
    EXPECT_EQ(program.Wait(), 1);
    return program.text();
  };
  const std::string task = Replaced(ShippedTask(), "mu = 0.3", "mu = -0.3");
  EXPECT_THAT(said(windows(task), ShippedRobot()),
              HasSubstr("task.toml:" + std::to_string(LineOf(task, "mu = -0.3")) + ": contact.mu"));
  const std::string robot = Replaced(ShippedRobot(), "mass value=\"1.0\"", "mass value=\"0\"");
  EXPECT_THAT(
      said(ShippedTask(), windows(robot)),
      HasSubstr("tumbler.urdf:" + std::to_string(LineOf(robot, "mass value=\"0\"")) + ": "));
}

}  // namespace
}  // namespace tumbler
