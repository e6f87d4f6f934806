// Files that are no files, or far too large, disks that are full, and numbers without sense: every
// program says what is wrong, leaves nothing behind, and needs little memory for it.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::Outcome;
using testing::ReadFile;
using testing::Replaced;
using testing::SourcePath;
using testing::WriteFile;

struct BadSurrounding {
  std::string command_line;
  std::string says;
  int status = 1;
};

constexpr const char* kLoop = "loop: cannot be opened: Too many levels of symbolic links";
constexpr const char* kTooLarge = ": is too large; allowed: up to 16777216 bytes";
constexpr const char* kFull = "No space left on device";

const std::vector<BadSurrounding> kBadSurroundings = {
    // A directory in place of a file.
    {"tumbler run sim dir", "dir: is a directory, not a file"},
    {"tumbler run sim handstand.toml --drives dir", "dir: is a directory, not a file"},
    {"tumbler run sim handstand.toml --faults dir", "dir: is a directory, not a file"},
    {"tumbler run sim handstand.toml --json dir", "dir: is a directory, not a file"},
    {"tumbler optimize dir", "dir: is a directory, not a file"},
    {"tumbler model check dir", "dir: is a directory, not a file"},
    {"tumbler model hybrid tumbler.urdf --prescribed leg1 <dir", "standard input: cannot be read"},
    {"tumbler chain simulate gait.toml --json dir", "dir: is a directory, not a file"},
    {"tumbler record dir", "dir: cannot be read: Is a directory"},
    {"tumbler record good.lcm --csv dir", "dir: is a directory, not a file"},
    {"tumbler replay dir", "dir: cannot be read: Is a directory"},
    {"tumbler robustness dir", "dir: is a directory, not a file"},
    {"tumbler export handstand.toml --header dir", "dir: cannot be written: Is a directory"},
    {"tumbler sign dir --because x", "dir: is a directory, not a file"},
    // Links that lead round in a circle.
    {"tumbler run sim loop", kLoop},
    {"tumbler run sim there", "there: cannot be opened: Too many levels of symbolic links"},
    {"tumbler run sim handstand.toml --drives loop", kLoop},
    {"tumbler run sim handstand.toml --bus-faults loop", kLoop},
    {"tumbler run sim handstand.toml --record loop",
     "loop: cannot be written: Too many levels of symbolic links"},
    {"tumbler record good.rec --csv loop",
     "loop: cannot be written: Too many levels of symbolic links"},
    {"tumbler optimize task.toml --out loop/x.toml",
     "loop/x.toml: cannot be written: Too many levels of symbolic links"},
    {"tumbler chain check loop", kLoop},
    {"tumbler bench sim read --drives loop", kLoop},
    // 100 MB of nothing, and of one line.
    {"tumbler run sim zeros", kTooLarge},
    {"tumbler run sim handstand.toml --twin letters", kTooLarge},
    {"tumbler optimize letters", kTooLarge},
    {"tumbler optimize task.toml --start-from zeros", kTooLarge},
    {"tumbler model check zeros", kTooLarge},
    {"tumbler model hybrid tumbler.urdf --prescribed leg1 <letters",
     "standard input:1: has 1 values; expected 11"},
    {"tumbler record letters", "letters: is neither a flight record nor an LCM log"},
    {"tumbler record zeros", "zeros: is neither a flight record nor an LCM log"},
    {"tumbler replay letters --drives drives.toml --svg x.svg",
     "letters:1: is not a line of `candump -l`"},
    {"tumbler view zeros --out page", kTooLarge},
    {"tumbler drives nosuch letters", kTooLarge},
    {"tumbler twin nosuch --twin zeros", kTooLarge},
    {"tumbler sign letters --because x", kTooLarge},
    // Bytes of other editors, and of none.
    {"tumbler run sim handstand.toml --drives nul.toml",
     "nul.toml:12: not valid TOML: there is a byte 0, so this is no text"},
    {"tumbler optimize utf16.toml", "utf16.toml:1: not valid TOML"},
    {"tumbler model check utf16.toml", "utf16.toml:1: not valid XML"},
    {"tumbler replay crlf.log --drives drives.toml --svg x.svg",
     "has no setpoint for joint 'leg1'"},
    // Records that end early.
    {"tumbler record cut.rec", "cut.rec: is cut off within its configuration"},
    {"tumbler view cut.rec --out page", "cut.rec: is cut off within its configuration"},
    {"tumbler replay empty", "empty: is cut off within its first 16 bytes"},
    {"tumbler record empty", "empty: is cut off within its first 16 bytes"},
    // Numbers without sense.
    {"tumbler run sim handstand.toml --drives huge.toml",
     "huge.toml:7: bus.rate_hz: is 1e+308; allowed: from 10 ... 10000"},
    {"tumbler run sim handstand.toml --speed nan", "--speed: Value nan not in range 0.1 to 1"},
    {"tumbler robustness handstand.toml --robots 2 --seed 99999999999999999999",
     "--seed: is '99999999999999999999'; allowed: from 0 ... 9223372036854775807"},
    {"tumbler run sim gait.toml --cycles 1e308", "--cycles: Value 1e308 not in range"},
    {"tumbler optimize task.toml --threads 99999999999999999999", "--threads: "},
    {"tumbler chain simulate gait.toml --cycles 99999999999", "--cycles: Value 99999999999"},
    {"tumbler new robot --joints 4294967297", "--joints: "},
    // Where nothing can be written.
    {"tumbler run sim handstand.toml --csv /proc/x --hold-s 0", "/proc/x: cannot be written"},
    {"tumbler view good.rec --out /proc/page", "/proc/page/index.html: cannot be written: "},
    {"tumbler optimize task.toml --report handstand.toml", "handstand.toml is not a folder"},
    // Disks that are full.
    {"tumbler run sim handstand.toml --hold-s 0 >full", kFull},
    {"tumbler run sim handstand.toml --hold-s 0 --json full", kFull, 4},
    {"tumbler run sim handstand.toml --hold-s 0 --log full", "full", 4},
    {"tumbler record good.rec --csv full", "full: could not be written whole"},
    {"tumbler record good.lcm --csv full", "full: could not be written whole"},
    {"tumbler record good.lcm --mcap full", "full: "},
    {"tumbler record good.rec --mcap full", "full: "},
    {"tumbler record good.rec --mcap dir", "dir: "},
    {"tumbler robustness handstand.toml --robots 4 --json full", "full: "},
    {"tumbler model check tumbler.urdf >full", kFull},
    {"tumbler ctl --man-page >full", kFull},
    {"tumbler export handstand.toml --header full", kFull},
    {"ulimit -f 1; tumbler view good.rec --out page", "File too large"},
    {"ulimit -f 1; tumbler new robot", "File too large"},
};

/// A folder with good files, and with everything that is no file, or a bad one.
class Surroundings : public ::testing::Test {
 protected:
  Surroundings() {
    for (const char* name : {"gait.toml", "handstand.toml", "downstand.toml", "roll.toml"})
      WriteFile(folder_ / name, ReadFile(SourcePath(std::string("primitives/nominal/") + name)));
    const std::string drives = ReadFile(SourcePath("primitives/robots/tumbler_drives.toml"));
    WriteFile(folder_ / "drives.toml", drives);
    WriteFile(folder_ / "nul.toml", Replaced(drives, "\"leg1\"", std::string("\"leg1\0\"", 7)));
    WriteFile(folder_ / "huge.toml", Replaced(drives, "rate_hz = 1000.0", "rate_hz = 1e308"));
    WriteFile(folder_ / "tumbler.urdf", ReadFile(SourcePath("primitives/robots/tumbler.urdf")));
    WriteFile(folder_ / "task.toml",
              Replaced(ReadFile(SourcePath("primitives/tasks/nominal/handstand.toml")),
                       "../../robots/tumbler.urdf", "tumbler.urdf"));
    std::string wide = "\xff\xfe";
    for (const char c : std::string("format = \"x\"\n")) (wide += c) += '\0';
    WriteFile(folder_ / "utf16.toml", wide);
    WriteFile(folder_ / "crlf.log", "(1436509052.249713) vcan0 044#2A366C2BBA\r\n");
    WriteFile(folder_ / "empty", "");
    WriteFile(folder_ / "letters", std::string(std::size_t{100} << 20U, 'a'));
    WriteFile(folder_ / "zeros", "");
    fs::resize_file(folder_ / "zeros", std::size_t{100} << 20U);
    fs::create_directory(folder_ / "dir");
    fs::create_symlink("loop", folder_ / "loop");
    fs::create_symlink("back", folder_ / "there");
    fs::create_symlink("there", folder_ / "back");
    // A device of its own where that is allowed: who may make one could also put a file in the
    // place of the machine's.
    if (mknod((folder_ / "full").c_str(), S_IFCHR | 0666, makedev(1, 7)) != 0)
      fs::create_symlink("/dev/full", folder_ / "full");
    const Outcome run =
        In("tumbler run sim handstand.toml --record good.rec --log good.lcm --hold-s 0");
    EXPECT_EQ(run.exit_code, 0) << run.text;
    WriteFile(folder_ / "cut.rec", ReadFile(folder_ / "good.rec").substr(0, 1000));
  }
  [[nodiscard]] Outcome In(const std::string& command_line) const {
    return testing::RunInShell("cd '" + std::string(folder_ / "") + "' && " + command_line);
  }

  /// What is in the folder; a link counts as itself.
  [[nodiscard]] std::set<std::string> Listing() const {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path()))
      names.insert(entry.path().string());
    return names;
  }

  testing::TemporaryFolder folder_;
};

/// The most memory of any program that has ended [MB].
long PeakMemory() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  return usage.ru_maxrss / 1024;
}

TEST_F(Surroundings, ThatAreBadAreSaidAndLeaveNothingBehind) {
  const std::set<std::string> before = Listing();
  std::set<std::string> programs;
  for (const BadSurrounding& bad : kBadSurroundings) {
    SCOPED_TRACE(bad.command_line);
    const Outcome outcome = In(bad.command_line);
    EXPECT_EQ(outcome.exit_code, bad.status) << outcome.text.substr(0, 1000);
    EXPECT_THAT(outcome.text, HasSubstr(bad.says));
    EXPECT_LT(outcome.text.size(), 4000U);
    EXPECT_EQ(Listing(), before);
    EXPECT_TRUE(fs::is_character_file(folder_ / "full")) << "a file is in place of a device";
#ifdef TUMBLER_MEASURES_MEMORY
    ASSERT_LT(PeakMemory(), 300);  // of which 100 are those of the largest file
#endif
    const std::size_t name = bad.command_line.find("tumbler ") + 8;
    programs.insert(bad.command_line.substr(name, bad.command_line.find(' ', name) - name));
  }
  EXPECT_GE(programs.size(), 14U);
  EXPECT_GT(PeakMemory(), 0);
}

}  // namespace
}  // namespace tumbler
