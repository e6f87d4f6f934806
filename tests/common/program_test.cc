#include "common/files/program.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace tumbler {
namespace {

struct Ended {
  int status = -1;
  std::string out;
  std::string error;
};

Ended EndOf(ExitStatus (*run)(int argc, char** argv)) {
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  Ended ended;
  ended.status = RunProgram("tumbler-test", 0, nullptr, run);
  std::fflush(stdout);
  ended.out = ::testing::internal::GetCapturedStdout();
  ended.error = ::testing::internal::GetCapturedStderr();
  return ended;
}

TEST(RunProgram, EndsAsTheProgramSays) {
  const Ended ended = EndOf([](int, char**) { return ExitStatus::kAmiss; });
  EXPECT_EQ(ended.status, 4);
  EXPECT_EQ(ended.out + ended.error, "");
  EXPECT_EQ(EndOf([](int, char**) { return ExitStatus::kInterrupted; }).status, 130);
}

TEST(RunProgram, SaysWhatCannotBeUsedAndEndsWithStatus1) {
  const Ended ended =
      EndOf([](int, char**) -> ExitStatus { throw std::runtime_error("a.toml: is empty"); });
  EXPECT_EQ(ended.status, 1);
  EXPECT_EQ(ended.out, "");
  EXPECT_EQ(ended.error, "tumbler-test: a.toml: is empty\n");
}

TEST(RunProgram, PointsToTheHelpAfterAWrongCommandLine) {
  const Ended ended =
      EndOf([](int, char**) -> ExitStatus { throw UsageError("--speed", "is too much"); });
  EXPECT_EQ(ended.status, 1);
  EXPECT_EQ(ended.error, "--speed: is too much\nRun with --help for more information.\n");
}

TEST(RunProgram, ARefusalIsStatus2) {
  const Ended ended = EndOf([](int, char**) -> ExitStatus { throw Refused("the bus is full"); });
  EXPECT_EQ(ended.status, 2);
  EXPECT_EQ(ended.error, "tumbler-test: refused: the bus is full\n");
}

TEST(RunProgram, HelpIsNoError) {
  const Ended ended = EndOf([](int, char**) -> ExitStatus { throw HelpWanted("Usage: ...\n"); });
  EXPECT_EQ(ended.status, 0);
  EXPECT_EQ(ended.out, "Usage: ...\n");
  EXPECT_EQ(ended.error, "");
}

TEST(RunProgram, ShowsControlCharactersOfNamesAsText) {
  const Ended ended = EndOf([](int, char**) -> ExitStatus {
    throw std::runtime_error("a\x1b[31m\u009b.toml: is gone,\n\tü\x7f");
  });
  EXPECT_EQ(ended.error, "tumbler-test: a\\x1b[31m\\x9b.toml: is gone,\n\tü\\x7f\n");
}

/// The status of a process that prints on a device that is always full.
int StatusOnAFullDisk(ExitStatus (*run)(int argc, char** argv)) {
  if (std::freopen("/dev/full", "w", stdout) == nullptr) return -1;
  return RunProgram("tumbler-test", 0, nullptr, run);
}

TEST(RunProgramDeathTest, AnOutputThatIsNotWrittenWholeIsNoSuccess) {
  const auto print = [](int, char**) {
    std::fputs("one line\n", stdout);
    return ExitStatus::kDone;
  };
  EXPECT_EXIT(std::_Exit(StatusOnAFullDisk(print)), ::testing::ExitedWithCode(1),
              "standard output could not be written whole: No space left on device");
  const auto flushed = [](int, char**) {
    std::fputs("one line\n", stdout);
    std::fflush(stdout);
    return ExitStatus::kAmiss;
  };
  EXPECT_EXIT(std::_Exit(StatusOnAFullDisk(flushed)), ::testing::ExitedWithCode(4),
              "standard output could not be written whole");
  const auto help = [](int, char**) -> ExitStatus { throw HelpWanted("Usage: ...\n"); };
  EXPECT_EXIT(std::_Exit(StatusOnAFullDisk(help)), ::testing::ExitedWithCode(1), "written whole");
}

}  // namespace
}  // namespace tumbler
