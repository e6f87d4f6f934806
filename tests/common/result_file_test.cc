#include "common/files/result_file.h"

#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "common/files/held_results.h"
#include "common/files/toml_reader.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

// A program that is ended by Ctrl-C between two instructions leaves what is there between them.
TEST(ResultFile, ACheckOfAFolderLeavesNothingBehindWheneverTheProgramIsEnded) {
  const testing::TemporaryFolder folder;
  const int watch = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
  ASSERT_GE(watch, 0);
  ASSERT_GE(inotify_add_watch(watch, folder.path().c_str(), IN_CREATE | IN_MOVED_TO), 0);
  CheckWritable(folder / "result.json");
  CheckFolderWritable(folder.path());
  std::array<char, 4096> events{};
  EXPECT_LE(read(watch, events.data(), events.size()), 0) << "a name appeared in the folder";
  std::filesystem::create_directory(folder.path() / "seen");
  EXPECT_GT(read(watch, events.data(), events.size()), 0) << "the watch sees nothing";
  close(watch);
}

TEST(ResultFile, ANameThatCannotBeAFilesIsRefusedBeforeAnythingIsDone) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(CheckWritable(folder / "motion/"), FileError);
  const std::string motion = folder / "out/motion.toml";
  for (const std::vector<std::string>& outputs :
       {std::vector{motion, motion + "/page/index.html"},
        std::vector{motion + "/page/index.html", motion}}) {
    EXPECT_THROW(CheckDistinct({}, outputs), FileError);
  }
  CheckDistinct({}, {motion, folder / "out/motion.html", folder / "out/motion.toml.json"});
  EXPECT_TRUE(folder.Listing().empty());
}

TEST(ResultFile, ATextDoesNotTakeThePlaceOfAFileOfBytes) {
  const testing::TemporaryFolder folder;
  const std::string record = folder / "run.rec", text = folder / "result.json";
  const std::string bytes("REC\0\1", 5);
  testing::WriteFile(record, bytes);
  testing::WriteFile(text, "of before");
  EXPECT_THROW(CheckResult(record), FileError);
  EXPECT_THROW(WriteResult(record, "{}"), FileError);
  EXPECT_EQ(testing::ReadFile(record), bytes);
  CheckResult(text);
  WriteResult(text, "{}");
  EXPECT_EQ(testing::ReadFile(text), "{}");
  WriteResult(record, bytes + bytes);
  EXPECT_EQ(testing::ReadFile(record), bytes + bytes) << "bytes take the place of bytes";
}

TEST(ResultFile, FilesThatBelongTogetherAppearAllOrNone) {
  const testing::TemporaryFolder folder;
  const std::string first = folder / "out/first", last = folder / "out/last";
  const auto write = [&] {
    PendingFiles files;
    files.Add(first, "new");
    files.Add(folder / "out/second", "new");
    files.Add(last, "new");
    files.Commit();
  };
  std::filesystem::create_directories(last);
  testing::WriteFile(first, "old");
  EXPECT_THROW(write(), FileError) << "a folder is in the place of the last";
  EXPECT_EQ(testing::ReadFile(first), "old");
  EXPECT_EQ(folder.Listing(), (std::set<std::string>{"out", "out/first", "out/last"}));
  std::filesystem::remove_all(folder / "out");
  {
    PendingFiles files;
    files.Add(first, "new");
    files.Add(last, "new");
  }
  EXPECT_TRUE(folder.Listing().empty()) << "the folder that was made goes, too";
  write();
  EXPECT_EQ(testing::ReadFile(first), "new");
  EXPECT_EQ(folder.Listing(),
            (std::set<std::string>{"out", "out/first", "out/last", "out/second"}));
}

TEST(ResultFile, OneThatIsBeingWrittenIsNotGivenToAnotherWriterAndKeepsWhatIsInIt) {
  const testing::TemporaryFolder folder;
  const std::string path = folder / "new/run.log";
  {
    const WriterLock first(path);
    testing::WriteFile(path, "a tick");
    try {
      const WriterLock second(path);
      FAIL() << "two write the same file";
    } catch (const FileError& error) {
      EXPECT_NE(std::string(error.what()).find("run.log: is being written by another program"),
                std::string::npos)
          << error.what();
    }
    const WriterLock other(folder / "new/other.log");
    EXPECT_EQ(testing::ReadFile(path), "a tick");
  }
  const WriterLock next(path);
  EXPECT_EQ(testing::ReadFile(path), "a tick");
  const WriterLock device("/dev/null"), again("/dev/null");
}

TEST(ResultFile, OneThatIsHeldIsNotGivenToAnotherProgramUnderAnyOfItsNames) {
  const testing::TemporaryFolder folder;
  std::filesystem::create_directory(folder / "real");
  std::filesystem::create_directory_symlink("real", folder / "link");
  const auto refusal = [](const std::string& path) -> std::string {
    try {
      const HeldResults second({path});
    } catch (const FileError& error) {
      return error.what();
    }
    return "given";
  };
  const std::string path = folder / "real/motion.toml";
  const std::set<std::string> before = folder.Listing();
  {
    const HeldResults first({path, folder / "new/page.html", "", "-", "/dev/null"});
    EXPECT_NE(refusal(path).find("motion.toml: is being written by another program"),
              std::string::npos);
    EXPECT_NE(refusal(folder / "link/../real/./motion.toml"), "given");
    EXPECT_NE(refusal(folder / "link/motion.toml"), "given");
    EXPECT_NE(refusal(folder / "new/page.html"), "given");
    EXPECT_EQ(refusal(folder / "real/other.toml"), "given");
    EXPECT_EQ(refusal("/dev/null"), "given");
    EXPECT_EQ(folder.Listing(), before) << "no file says so";
    // What was held before one that is not given is free again.
    EXPECT_THROW(HeldResults({folder / "free.toml", path}), FileError);
    EXPECT_EQ(refusal(folder / "free.toml"), "given");
  }
  EXPECT_EQ(refusal(path), "given");
}

TEST(ResultFile, AKilledProgramHoldsNothing) {
  const testing::TemporaryFolder folder;
  const std::string path = folder / "motion.toml";
  std::array<int, 2> ready{};
  ASSERT_EQ(pipe(ready.data()), 0);
  const pid_t child = fork();
  if (child == 0) {
    const HeldResults held({path});
    static_cast<void>(!write(ready[1], "x", 1));
    for (;;) pause();
  }
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  EXPECT_THROW(HeldResults({path}), FileError);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_NO_THROW(HeldResults({path}));
  close(ready[0]);
  close(ready[1]);
}

}  // namespace
}  // namespace tumbler
