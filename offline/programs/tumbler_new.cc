// tumbler new: makes the files of a new robot.

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"
#include "offline/programs/new_robot.h"
#include "offline/programs/robot_of_urdf.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(The folder NAME gets a robot (URDF), two tasks, a sequence, drives and a twin, each with comments, and a page with the
commands that find the motions and play them in simulation. Change them into those of your robot: docs/own-robot.md.
With --urdf they are of that robot already: its joints bend a little, and back.

Exit codes:
  0  written
  1  wrong usage, a robot that no task takes, or a folder that is there already or cannot be written: nothing was
     changed)";

namespace fs = std::filesystem;

void Write(const std::string& name, const std::vector<NewFile>& files) {
  std::error_code error;
  if (fs::exists(fs::symlink_status(name, error))) {
    throw std::runtime_error(
        fmt::format("{}: is there already; nothing in it is replaced: take another name", name));
  }
  CheckFolderWritable(name);
  try {
    for (const NewFile& file : files)
      PendingFile((fs::path(name) / file.path).string(), file.text).Commit();
  } catch (...) {
    fs::remove_all(name, error);
    throw;
  }
}

ExitStatus WriteOfUrdf(const std::string& name, const std::string& urdf, const std::string& root) {
  std::optional<RootKind> held;
  if (!root.empty()) held = root == "fixed" ? RootKind::kFixed : RootKind::kPlanarXz;
  const FilesOfUrdf made = NewRobotOfUrdf(name, ReadTextFile(urdf), urdf, held);
  Write(name, made.files);
  for (const std::string& note : made.notes) fmt::print("note: {}\n", note);
  fmt::print(
      "{0}: the robot of {1}, of which these joints move: {2}. Go on with\n"
      "    cd {0}\n"
      "    tumbler optimize tasks/bend.toml --out motions/bend.toml --report report\n"
      "    tumbler optimize tasks/unbend.toml --start-from motions/bend.toml --out "
      "motions/unbend.toml\n"
      "    tumbler run sim {0}.toml --cycles 2 --twin twin.toml\n",
      name, urdf, fmt::join(made.joints, ", "));
  return ExitStatus::kDone;
}

ExitStatus Main(int argc, char** argv) {
  std::string name, urdf, root;
  int joints = 2;
  CommandLine line(
      "Makes the files of a new robot, from which motions are found and played at once.",
      "tumbler new");
  line.SetFooter(kFooter);
  line.Option("NAME", name, "of the robot, and of the folder that is made").Required();
  CommandLineOption arm = line.Option("--joints", joints, "how many motors its arm has");
  arm.Within(1, kNewRobotJointsMax).ShowDefault();
  CommandLineOption given =
      line.Option("--urdf", urdf, "take the robot of this file instead of an arm of our own");
  given.Excludes(arm);
  line.Option(
          "--root", root,
          "how its root link is held (default: free in the plane if it rests on the ground there, "
          "else fixed)")
      .OneOf({"planar-xz", "fixed"})
      .Needs(given);
  line.Parse(argc, argv);
  if (!IsRobotName(name)) {
    throw UsageError("NAME", fmt::format("is '{}'; allowed: small letters, digits and dashes, a "
                                         "letter first, at most 32",
                                         name));
  }
  if (!urdf.empty()) return WriteOfUrdf(name, urdf, root);
  Write(name, NewRobot(name, joints));
  fmt::print(
      "{0}: a robot of {1} motor{2}. Go on with\n"
      "    cd {0}\n"
      "    tumbler optimize tasks/rise.toml --out motions/rise.toml --report report\n"
      "    tumbler optimize tasks/lie.toml --start-from motions/rise.toml --out motions/lie.toml\n"
      "    tumbler run sim {0}.toml --cycles 2 --twin twin.toml\n",
      name, joints, joints == 1 ? "" : "s");
  return ExitStatus::kDone;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler new", argc, argv, tumbler::Main);
}
