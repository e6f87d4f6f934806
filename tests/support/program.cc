#include "tests/support/program.h"

#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <stdexcept>

#include "tests/support/files.h"

namespace tumbler::testing {

std::vector<std::string> WithCommandApart(const std::vector<std::string>& given) {
  const std::string program = ProgramPath("tumbler ");
  std::vector<std::string> arguments;
  for (const std::string& argument : given) {
    if (argument.starts_with(program) && argument.find(' ', program.size()) == std::string::npos) {
      arguments.push_back(ProgramPath("tumbler"));
      arguments.push_back(argument.substr(program.size()));
    } else {
      arguments.push_back(argument);
    }
  }
  return arguments;
}

Program::Program(const std::vector<std::string>& given) {
  const std::vector<std::string> arguments = WithCommandApart(given);
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) throw std::runtime_error("pipe");
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  // Not fork(), which copies this program's memory first: that takes long in the guest.
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  posix_spawn_file_actions_addclose(&actions, ends[0]);
  posix_spawn_file_actions_addclose(&actions, ends[1]);
  const int error = posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (error != 0) {
    close(ends[0]);
    throw std::runtime_error(arguments[0] + " cannot be started");
  }
  output_ = ends[0];
}

Program::~Program() {
  if (!waited_) {
    kill(pid_, SIGKILL);
    Wait();
  }
  close(output_);
}

bool Program::WaitFor(const std::string& part) {
  while (text_.find(part) == std::string::npos) {
    pollfd wait{output_, POLLIN, 0};
    if (poll(&wait, 1, 30'000) == 0 || !ReadSome()) return false;
  }
  return true;
}

void Program::Signal(int signal) const { kill(pid_, signal); }

int Program::Wait() {
  if (waited_) return status_;
  while (ReadSome()) {
  }
  int status = 0;
  waitpid(pid_, &status, 0);
  waited_ = true;
  status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
  return status_;
}

bool Program::ReadSome() {
  std::array<char, 4096> buffer;
  const ssize_t count = read(output_, buffer.data(), buffer.size());
  if (count > 0) text_.append(buffer.data(), static_cast<std::size_t>(count));
  return count > 0;
}

Outcome RunProgram(std::vector<std::string> arguments) {
  arguments.front() = ProgramPath(arguments.front());
  Program program(arguments);
  const int exit_code = program.Wait();
  return {exit_code, program.text()};
}

Outcome RunInShell(const std::string& command_line) {
  Program shell({"/bin/sh", "-c", "PATH=" + BuildPath("bin") + ":$PATH; " + command_line});
  const int exit_code = shell.Wait();
  return {exit_code, shell.text()};
}

bool Eventually(const std::function<bool()>& condition) {
  for (int i = 0; i < 400; ++i) {
    if (condition()) return true;
    usleep(50'000);
  }
  return false;
}

}  // namespace tumbler::testing
