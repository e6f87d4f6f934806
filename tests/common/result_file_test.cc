#include "common/files/result_file.h"

#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

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

}  // namespace
}  // namespace tumbler
