#pragma once

#include <poll.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <stdexcept>
#include <string>
#include <vector>

namespace tumbler::testing {

/// A program that runs beside the test. Its standard output and error are collected in one text.
class Program {
 public:
  /// @param arguments  the program's path first.
  explicit Program(const std::vector<std::string>& arguments) {
    std::array<int, 2> ends{};
    if (pipe(ends.data()) != 0) throw std::runtime_error("pipe");
    std::vector<char*> argv;
    argv.reserve(arguments.size() + 1);
    for (const std::string& argument : arguments)
      argv.push_back(const_cast<char*>(argument.c_str()));
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
  ~Program() {
    if (!waited_) {
      kill(pid_, SIGKILL);
      Wait();
    }
    close(output_);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// Reads until the output holds `part`. @returns false when the program ended without it, or
  /// said nothing for 30 s.
  bool WaitFor(const std::string& part) {
    while (text_.find(part) == std::string::npos) {
      pollfd wait{output_, POLLIN, 0};
      if (poll(&wait, 1, 30'000) == 0 || !ReadSome()) return false;
    }
    return true;
  }
  void Signal(int signal) const { kill(pid_, signal); }

  /// @returns the exit status; 1000 and the signal's number if a signal ended it.
  int Wait() {
    if (waited_) return status_;
    while (ReadSome()) {
    }
    int status = 0;
    waitpid(pid_, &status, 0);
    waited_ = true;
    status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
    return status_;
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  bool ReadSome() {
    std::array<char, 4096> buffer;
    const ssize_t count = read(output_, buffer.data(), buffer.size());
    if (count > 0) text_.append(buffer.data(), static_cast<std::size_t>(count));
    return count > 0;
  }

  pid_t pid_ = -1;
  int output_ = -1;
  bool waited_ = false;
  int status_ = -1;
  std::string text_;
};

}  // namespace tumbler::testing
