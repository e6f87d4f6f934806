#include "common/program.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
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

}  // namespace
}  // namespace tumbler
