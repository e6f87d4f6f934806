#include "tests/support/program.h"

#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <stdexcept>

#include "tests/support/files.h"

namespace tumbler::testing {

Program::Program(const std::vector<std::string>& arguments) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) throw std::runtime_error("pipe");
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("fork");
  if (pid_ == 0) {
    dup2(ends[1], STDOUT_FILENO);
    dup2(ends[1], STDERR_FILENO);
    close(ends[0]);
    close(ends[1]);
    execv(argv[0], argv.data());
    _exit(127);
  }
  close(ends[1]);
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
  for (int i = 0; i < 1000; ++i) {
    if (condition()) return true;
    usleep(20'000);
  }
  return false;
}

}  // namespace tumbler::testing
