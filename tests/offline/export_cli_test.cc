// tumbler export as a user meets it. motion_header_test and, for the nominal gait, cortex_m_test
// compare the compiled values with those of the loader.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "common/files/motion_header.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/sequence_files.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::Outcome;
using testing::ReadFile;
using testing::Replaced;
using testing::SequenceFolder;
using testing::WriteFile;

Outcome Export(const std::string& motion, const std::string& header,
               const std::string& name = "motion") {
  return testing::RunProgram({"tumbler export", motion, "--header", header, "--namespace", name});
}

std::string Header(const SequenceFolder& folder) { return folder.file().parent_path() / "out.h"; }

TEST(TumblerExport, WritesTheHeaderOfASequence) {
  const SequenceFolder folder(testing::GaitText());
  const Outcome outcome = Export(folder.file(), Header(folder));
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.text, IsEmpty());
  EXPECT_EQ(ReadFile(Header(folder)),
            ToHeader(LoadMotion(folder.file()), ReadFile(folder.file()), "motion"));
}

TEST(TumblerExport, WritesTheHeaderOfAPrimitiveAlone) {
  const SequenceFolder folder(testing::GaitText());
  const std::string primitive = folder.file().parent_path() / "up.toml";
  EXPECT_EQ(Export(primitive, Header(folder)).exit_code, 0);
  EXPECT_EQ(ReadFile(Header(folder)),
            ToHeader(LoadMotion(primitive), ReadFile(primitive), "motion"));
}

TEST(TumblerExport, RefusesASequenceThatDoesNotFitAndLeavesTheOldHeader) {
  const SequenceFolder folder(
      Replaced(testing::GaitText(), "joints = [[\"joint1\", \"joint2\"]]", "joints = []"));
  WriteFile(Header(folder), "the old one");
  const Outcome outcome = Export(folder.file(), Header(folder));
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("gait.toml:"));
  EXPECT_EQ(ReadFile(Header(folder)), "the old one");
}

TEST(TumblerExport, NamesFileLineKeyAndValueOfABadInput) {
  const std::string text = Replaced(testing::GaitText(), "settle_s = 1.5", "settle_s = -1.5");
  const SequenceFolder folder(text);
  const Outcome outcome = Export(folder.file(), Header(folder));
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(
      outcome.text,
      AllOf(HasSubstr("gait.toml:" + std::to_string(testing::LineOf(text, "settle_s")) + ": "),
            HasSubstr("settle_s"), HasSubstr("-1.5")));
  EXPECT_FALSE(std::filesystem::exists(Header(folder)));
}

TEST(TumblerExport, RefusesFilesThatCannotBeReadOrWritten) {
  const SequenceFolder folder(testing::GaitText());
  const std::string nowhere = "/proc/no/out.h";
  EXPECT_EQ(Export(folder.file(), nowhere).exit_code, 1);
  EXPECT_THAT(Export(folder.file(), nowhere).text,
              AllOf(HasSubstr(nowhere), HasSubstr("cannot be written")));
  EXPECT_THAT(Export(nowhere, Header(folder)).text, HasSubstr(nowhere));
  EXPECT_EQ(Export(nowhere, Header(folder)).exit_code, 1);
  EXPECT_EQ(Export(folder.file(), folder.file().parent_path()).exit_code, 1);  // It is a folder.
  for (const auto& entry : std::filesystem::directory_iterator(folder.file().parent_path()))
    EXPECT_EQ(entry.path().extension(), ".toml") << entry.path();
}

TEST(TumblerExport, NeverOverwritesItsInput) {
  const SequenceFolder folder(testing::GaitText());
  const Outcome outcome = Export(folder.file(), folder.file());
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("is an input"));
  EXPECT_EQ(ReadFile(folder.file()), testing::GaitText());
}

TEST(TumblerExport, RefusesANamespaceThatIsNone) {
  const SequenceFolder folder(testing::GaitText());
  const Outcome outcome = Export(folder.file(), Header(folder), "a b");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("'a b' is not a namespace"));
  EXPECT_FALSE(std::filesystem::exists(Header(folder)));
}

}  // namespace
}  // namespace tumbler
