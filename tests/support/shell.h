#pragma once

#include <sys/wait.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <string>

namespace tumbler::testing {

/// What became of a command.
struct ShellOutcome {
  int exit_code = -1;
  std::string text;  ///< Standard output and error.
};

/// Runs a command line in a shell that finds the project's programs.
inline ShellOutcome RunInShell(const std::string& command_line) {
  const std::string command = "PATH=" TUMBLER_BINARY_DIR "/bin:$PATH; (" + command_line + ") 2>&1";
  ShellOutcome outcome;
  std::FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 4096> buffer;
  std::size_t count = 0;
  while ((count = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0) {
    outcome.text.append(buffer.data(), count);
  }
  const int status = pclose(pipe);
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

}  // namespace tumbler::testing
