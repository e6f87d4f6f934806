// tumbler: the one command on the path. `tumbler NAME ...` becomes the program of that command,
// which lies in libexec/tumbler beside the folder that this one lies in.

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "common/files/build_version.h"
#include "common/files/command_text.h"
#include "common/files/printable.h"
#include "common/files/program.h"

namespace tumbler {
namespace {

namespace fs = std::filesystem;

/// Which half of the software has a command.
enum class Half { kOffline, kRuntime };

struct Command {
  std::string_view group;
  std::string_view name;
  std::string_view line;  ///< For the list of all.
  Half half = Half::kOffline;
};

constexpr std::array kCommands = {
    Command{"find", "new", "Make the files of a new robot"},
    Command{"find", "model", "Check a robot file, and evaluate its equations of motion"},
    Command{"find", "optimize", "Find a motion for a task, and write it as a primitive"},
    Command{"find", "sweep", "Find a motion for every point of a grid of a task's numbers"},
    Command{"find", "chain", "Check whether motions fit together, and simulate them"},
    Command{"find", "sign", "Sign a primitive that was changed by hand"},
    Command{"play", "run", "Play a motion on motors, or on a simulated robot", Half::kRuntime},
    Command{"play", "ctl", "Start, stop and watch a run that is on", Half::kRuntime},
    Command{"play", "replay", "Repeat a recorded run, at a desk or on a bus", Half::kRuntime},
    Command{"play", "twin", "Simulate the robot on a CAN interface, in another process"},
    Command{"look", "view", "Show runs in a browser, or write their page"},
    Command{"look", "record", "Say what a record or a log of a run holds, and export it",
            Half::kRuntime},
    Command{"look", "export", "Write a motion for others: a C++ header, MJCF, setpoints"},
    Command{"bench", "bench", "Commission motor drives", Half::kRuntime},
    Command{"bench", "drives", "Simulate motor drives on a CAN interface", Half::kRuntime},
    Command{"study", "identify", "From a robot's records to its model"},
    Command{"study", "robustness", "How many robots that are not the model survive a motion"},
    Command{"study", "abort", "What hurts a robot least when its motion cannot go on"},
};

/// A group of commands, and what they are for.
struct Group {
  std::string_view name;
  std::string_view title;
};
constexpr std::array kGroups = {
    Group{"find", "Find a motion"},
    Group{"play", "Play it"},
    Group{"look", "Look at it"},
    Group{"bench", "Bench: before motors are driven"},
    Group{"study", "Study how much it withstands"},
};

std::string Overview() {
  std::string text;
  for (const Group& group : kGroups) {
    text += fmt::format("{}:\n", group.title);
    for (const Command& command : kCommands) {
      if (command.group == group.name)
        text += fmt::format("  {:<12}{}\n", command.name, command.line);
    }
    text += '\n';
  }
  return text;
}

OptionDescription Flag(std::vector<std::string> names, std::string help) {
  OptionDescription option;
  option.names = std::move(names);
  option.help = std::move(help);
  return option;
}

CommandDescription Description() {
  CommandDescription description;
  description.name = "tumbler";
  description.description =
      "Finds motions of robots that touch the ground, and plays them on motors or in simulation.";
  OptionDescription command;
  command.names = {"COMMAND"};
  command.help = "one of those below, or `help COMMAND`; what follows is for it";
  command.positional = command.required = true;
  OptionDescription arguments;
  arguments.names = {"ARGUMENT"};
  arguments.help = "of the command: `tumbler COMMAND --help`";
  arguments.positional = arguments.several = true;
  description.options = {command, arguments, Flag({"-h", "--help"}, "Print this text"),
                         Flag({"--version"}, "Print version and commit")};
  description.footer =
      Overview() +
      "Exit codes:\n"
      "  0  done\n"
      "  1  no such command, or one that is not installed; else that of the command";
  return description;
}

/// Completes the commands, and asks the program of a command for its own completion.
std::string Completion() {
  std::string names;
  for (const Command& command : kCommands) names += fmt::format("{} ", command.name);
  return fmt::format(
      R"bash(# Completion of tumbler for bash: commands, then what each says of its own options.
_tumbler() {{
  local cur=${{COMP_WORDS[COMP_CWORD]}} name=${{COMP_WORDS[1]}} function
  COMPREPLY=()
  if ((COMP_CWORD == 1)) || {{ ((COMP_CWORD == 2)) && [[ $name == help ]]; }}; then
    local words='{0}'
    ((COMP_CWORD == 2)) || words+=' help'
    [[ $cur == -* ]] && words='--help --version'
    COMPREPLY=($(compgen -W "$words" -- "$cur"))
    return
  fi
  case " {0}" in *" $name "*) ;; *) return ;; esac
  function=_tumbler_$name
  if ! declare -F "$function" >/dev/null; then
    source <("${{COMP_WORDS[0]/#\~/$HOME}}" "$name" --bash-completion 2>/dev/null)
  fi
  if declare -F "$function" >/dev/null; then "$function"; fi
}}
complete -o default -F _tumbler tumbler
)bash",
      names);
}

/// How many letters have to be put in, left out, exchanged for others or swapped with their
/// neighbour, to make the one word of the other.
std::size_t Distance(std::string_view from, std::string_view to) {
  std::vector<std::size_t> before(to.size() + 1), row(to.size() + 1), next(to.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= from.size(); ++i) {
    next[0] = i;
    for (std::size_t j = 1; j <= to.size(); ++j) {
      const std::size_t exchange = from[i - 1] == to[j - 1] ? 0 : 1;
      next[j] = std::min({row[j] + 1, next[j - 1] + 1, row[j - 1] + exchange});
      if (i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1])
        next[j] = std::min(next[j], before[j - 2] + 1);
    }
    before = row;
    row = next;
  }
  return row.back();
}

/// The commands that an unknown word may have been meant for, nearest first.
std::vector<std::string_view> Meant(std::string_view word) {
  constexpr std::size_t kFar = 100;
  const auto distance = [word](std::string_view name) {
    if (word.size() >= 2 && (name.starts_with(word) || word.starts_with(name)))
      return std::size_t{0};
    const std::size_t apart = Distance(word, name);
    return apart <= std::max<std::size_t>(1, name.size() / 3) ? apart : kFar;
  };
  std::vector<std::string_view> names;
  std::size_t nearest = kFar;
  for (const Command& command : kCommands) {
    const std::size_t apart = distance(command.name);
    if (apart >= kFar || apart > nearest) continue;
    if (apart < nearest) names.clear();
    nearest = apart;
    names.push_back(command.name);
  }
  return names;
}

[[noreturn]] void FailUnknown(const std::string& word) {
  // What had a name of its own once.
  if (word == "report") {
    throw UsageError(
        "tumbler: 'report' is no command any more; its page is that of `tumbler view "
        "--out`");
  }
  if (word == "log")
    throw UsageError("tumbler: 'log' is no command any more; `tumbler record` reads logs, too");
  const std::vector<std::string_view> meant = Meant(word);
  throw UsageError(fmt::format("tumbler: '{}' is no command{}", word,
                               meant.empty()
                                   ? "; `tumbler` alone lists them"
                                   : fmt::format("; did you mean {}?", fmt::join(meant, " or "))));
}

/// Becomes the program of a command. @param arguments  those of `tumbler`, from the command's name
/// on.
[[noreturn]] void Become(const std::string& name, char** arguments) {
  const auto* const command = std::find_if(kCommands.begin(), kCommands.end(),
                                           [&](const Command& c) { return c.name == name; });
  if (command == kCommands.end()) FailUnknown(name);
  // The link leads to the file itself, whatever links to it.
  const fs::path self = fs::read_symlink("/proc/self/exe");
  const fs::path program = self.parent_path().parent_path() / "libexec/tumbler" / name;
  std::string shown = "tumbler " + name;  // in lists of processes
  arguments[0] = shown.data();
  execv(program.c_str(), arguments);
  if (errno != ENOENT) {
    throw std::system_error(errno, std::generic_category(), program.string());
  }
  throw std::runtime_error(fmt::format(
      "{} is not installed here ({}): {}", name, program.string(),
      command->half == Half::kOffline
          ? "it is of the offline half, which the package tumbler has, and a build with "
            "-DTUMBLER_BUILD_OFFLINE=ON"
          : "the package tumbler has it, and every build: cmake --build FOLDER --target tumbler-" +
                name));
}

ExitStatus Main(int argc, char** argv) {
  const std::string word = argc > 1 ? argv[1] : "";
  if (argc == 1) throw HelpWanted(HelpText(Description(), WidthOfHelp()));
  if (word == "--version") throw HelpWanted(fmt::format("tumbler {}\n", BuildVersion()));
  if (word == "--man-page") throw HelpWanted(ManPage(Description(), BuildVersion()));
  if (word == "--bash-completion") throw HelpWanted(Completion());
  if (word == "--help" || word == "-h" || word == "help") {
    if (argc == 2) throw HelpWanted(HelpText(Description(), WidthOfHelp()));
    if (argc > 3) throw UsageError("tumbler help: takes one command, such as `tumbler help run`");
    std::string help = "--help";
    std::array<char*, 3> arguments = {argv[2], help.data(), nullptr};
    Become(argv[2], arguments.data());
  }
  if (word.starts_with('-')) throw UsageError(fmt::format("tumbler: '{}' is no option", word));
  Become(word, argv + 1);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler", argc, argv, tumbler::Main);
}
