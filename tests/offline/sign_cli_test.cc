// A primitive that was changed by hand as a user meets it: every program refuses it, and takes it
// once tumbler sign has signed it.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Outcome;
using testing::ReadFile;
using testing::Replaced;
using testing::RunProgram;
using testing::SourcePath;
using testing::WriteFile;

/// A folder with the gait's primitives, of which the handstand says another peak torque.
class EditedPrimitive : public ::testing::Test {
 protected:
  EditedPrimitive() {
    for (const char* name : {"gait.toml", "handstand.toml", "downstand.toml"})
      WriteFile(folder_ / name, ReadFile(SourcePath(std::string("primitives/nominal/") + name)));
    WriteFile(file_, Replaced(ReadFile(file_), "\npeak_torque_nm = ", "\npeak_torque_nm = 1"));
  }

  testing::TemporaryFolder folder_;
  const std::string file_ = folder_ / "handstand.toml";
};

TEST_F(EditedPrimitive, EveryProgramRefusesItAndNamesTheWaysOut) {
  const std::string task = SourcePath("primitives/tasks/nominal/downstand.toml");
  const std::vector<std::vector<std::string>> command_lines = {
      {"tumbler run", "sim", file_},
      {"tumbler run", "sim", folder_ / "gait.toml"},
      {"tumbler optimize", task, "--start-from", file_},
      {"tumbler chain", "check", folder_ / "gait.toml"},
      {"tumbler export", file_, "--header", folder_ / "out.h"},
      {"tumbler view", file_, "--out", folder_ / "page"},
      {"tumbler twin", "can9", file_}};
  for (const auto& command_line : command_lines) {
    const Outcome outcome = RunProgram(command_line);
    EXPECT_EQ(outcome.exit_code, 1) << command_line[0];
    EXPECT_THAT(
        outcome.text,
        AllOf(HasSubstr(file_ + ":5: content_hash: is 'fnv1a64:"), HasSubstr("hash to 'fnv"),
              HasSubstr("make it again with tumbler optimize, or sign the change with "
                        "tumbler sign")))
        << command_line[0];
  }
}

TEST_F(EditedPrimitive, OnceSignedItIsPlayedWithAWarning) {
  const Outcome signed_now = RunProgram({"tumbler sign", file_, "--because", "a stronger motor"});
  ASSERT_EQ(signed_now.exit_code, 0) << signed_now.text;
  EXPECT_THAT(signed_now.text, HasSubstr("signed as changed by hand: a stronger motor"));
  EXPECT_EQ(LoadPrimitive(file_).provenance.edited, "a stronger motor");
  EXPECT_THAT(ReadFile(file_), HasSubstr("\npeak_torque_nm = 1"));
  const Outcome run = RunProgram({"tumbler run", "sim", file_});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  constexpr const char* kWarning =
      "warning: primitive 'handstand' was changed by hand after it was made and verified: a "
      "stronger motor";
  EXPECT_THAT(run.text, HasSubstr(kWarning));
  const std::string task = testing::SourcePath("primitives/tasks/nominal/downstand.toml");
  for (const std::vector<std::string>& others :
       {std::vector<std::string>{"tumbler robustness", file_, "--robots", "1", "--lanes"},
        {"tumbler optimize", task, "--start-from", file_, "--out", task}}) {
    EXPECT_THAT(RunProgram(others).text, HasSubstr(kWarning)) << others[0];
  }
  const Outcome unchanged = RunProgram({"tumbler run", "sim", folder_ / "downstand.toml"});
  EXPECT_THAT(unchanged.text, Not(HasSubstr("changed by hand")));
}

TEST_F(EditedPrimitive, WhatNoProgramCouldPlayIsNotSigned) {
  const std::string whole = ReadFile(file_);
  for (const auto& [from, to] :
       {std::pair("format = \"tumbler-task\"", "format = \"a-task\""), std::pair("<robot", "<robt"),
        std::pair("name = \"leg1\"", "name = \"leg9\"")}) {
    const std::string before = Replaced(whole, from, to);
    WriteFile(file_, before);
    const Outcome outcome = RunProgram({"tumbler sign", file_, "--because", "tried"});
    EXPECT_EQ(outcome.exit_code, 1) << to;
    EXPECT_THAT(outcome.text, ::testing::StartsWith("tumbler sign: ")) << to;
    EXPECT_EQ(ReadFile(file_), before) << to;
  }
}

TEST_F(EditedPrimitive, WhatCannotBeSignedIsLeftAsItIs) {
  const std::string untouched = folder_ / "downstand.toml";
  for (const auto& [file, reason] :
       {std::pair(untouched, "nothing was changed"), std::pair(file_, ""),
        std::pair(file_, "red \x1b[31m on a terminal"), std::pair(file_, "two\nlines")}) {
    const std::string before = ReadFile(file);
    EXPECT_EQ(RunProgram({"tumbler sign", file, "--because", reason}).exit_code, 1) << reason;
    EXPECT_EQ(ReadFile(file), before) << reason;
  }
  EXPECT_EQ(RunProgram({"tumbler sign", file_}).exit_code, 1) << "without a reason";
  WriteFile(file_, Replaced(ReadFile(file_), "torque_max_nm = 8.0", "torque_max_nm = 1.0"));
  const std::string before = ReadFile(file_);
  const Outcome outcome = RunProgram({"tumbler sign", file_, "--because", "a weaker motor"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr(" s; allowed: >= -1 N m (limits.torque_max_nm)"));
  EXPECT_EQ(ReadFile(file_), before);
}

}  // namespace
}  // namespace tumbler
