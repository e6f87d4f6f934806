#include "runtime/record/record_configuration.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>

#include "common/files/json.h"
#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

std::string JsonOf(const RecordConfiguration& configuration) {
  RecordBytes bytes;
  AppendRecordHeader(bytes);
  const RecordBytes blocks = EncodeConfiguration(configuration);
  bytes.insert(bytes.end(), blocks.begin(), blocks.end());
  BlockReader reader(bytes);
  Block block;
  EXPECT_TRUE(reader.Next(block));
  EXPECT_EQ(block.kind, BlockKind::kConfiguration);
  return {block.content.begin(), block.content.end()};
}

/// The message with which a text is refused.
std::string WhyRefused(const std::string& json) {
  try {
    static_cast<void>(ParseConfiguration(json));
  } catch (const RecordError& error) {
    return error.what();
  }
  return "accepted";
}

std::string Replaced(std::string text, const std::string& what, const std::string& with) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), with);
}

TEST(RecordConfiguration, IsReadBackToTheLastBit) {
  RecordConfiguration written = testing::SmallConfiguration();
  written.procedure.attended = true;
  written.executor.collapse = {true, {0.1F, -2.3F}, 0.7F};
  written.executor.last_known[1] = {true, -0.1F, 0.7F};
  const RecordConfiguration read = ParseConfiguration(JsonOf(written));
  EXPECT_EQ(read.program, written.program);
  EXPECT_EQ(read.command_line, written.command_line);
  EXPECT_EQ(read.kernel, written.kernel);
  EXPECT_EQ(read.bus, written.bus);
  EXPECT_EQ(read.dry_run, written.dry_run);
  EXPECT_EQ(read.virtual_time, written.virtual_time);
  EXPECT_EQ(read.utime_at_zero_us, written.utime_at_zero_us);
  EXPECT_EQ(read.period_ns, written.period_ns);
  EXPECT_EQ(read.joints, written.joints);
  EXPECT_EQ(read.motion_file, written.motion_file);
  EXPECT_EQ(read.drives_file, written.drives_file);
  ASSERT_EQ(read.files.size(), written.files.size());
  EXPECT_EQ(read.files[0].path, written.files[0].path);
  // But for that array, there are only numbers up to `joints`, without padding.
  const auto same = [&](std::size_t from, std::size_t to) {
    const auto* const a = reinterpret_cast<const char*>(&read.executor);
    const auto* const b = reinterpret_cast<const char*>(&written.executor);
    return std::memcmp(a + from, b + from, to - from) == 0;
  };
  EXPECT_TRUE(same(0, offsetof(ExecutorConfig, last_known)));
  EXPECT_TRUE(same(offsetof(ExecutorConfig, cycles), offsetof(ExecutorConfig, joints)));
  const auto gains_of = [](const RecordConfiguration& of, std::size_t i) {
    const JointConfig& joint = of.executor.joints[i];
    return std::array{joint.kp_nm_per_rad, joint.kd_nm_s_per_rad, joint.damping_nm_s_per_rad,
                      joint.temperature_max_c};
  };
  for (std::size_t i = 0; i < written.joints.size(); ++i)
    EXPECT_EQ(gains_of(read, i), gains_of(written, i));
  EXPECT_EQ(std::memcmp(&read.executor.reactions, &written.executor.reactions, sizeof(FaultTable)),
            0);
  for (std::size_t i = 0; i < kMaxJoints; ++i) {
    EXPECT_EQ(read.executor.last_known[i].known, i == 1);
    EXPECT_EQ(read.executor.last_known[i].position_rad, i == 1 ? -0.1F : 0);
  }
  EXPECT_EQ(read.executor.last_known[1].turn_rad, 0.7F);
  EXPECT_TRUE(read.executor.collapse.configured);
  EXPECT_EQ(read.executor.collapse.position_rad, written.executor.collapse.position_rad);
  EXPECT_EQ(read.executor.collapse.stiffness, written.executor.collapse.stiffness);
  EXPECT_EQ(read.procedure.hold_ticks, written.procedure.hold_ticks);
  EXPECT_EQ(read.procedure.reply_ticks_max, written.procedure.reply_ticks_max);
  EXPECT_EQ(read.procedure.start_ticks_max, written.procedure.start_ticks_max);
  EXPECT_EQ(read.procedure.stop_hold_ticks, written.procedure.stop_hold_ticks);
  EXPECT_EQ(read.procedure.fault_ticks, written.procedure.fault_ticks);
  EXPECT_EQ(read.procedure.disarmed_ticks, written.procedure.disarmed_ticks);
  EXPECT_EQ(read.procedure.attended, written.procedure.attended);
  EXPECT_EQ(read.machine.kernel, written.machine.kernel);
  EXPECT_EQ(read.machine.cpu, written.machine.cpu);
  EXPECT_EQ(read.machine.adapter, written.machine.adapter);
  const ExecutorConfig defaults;
  EXPECT_NE(std::memcmp(&read.executor.reactions, &defaults.reactions, sizeof(FaultTable)), 0);
}

TEST(RecordConfiguration, SaysWhatRunsDidNotKnowWhenItWasMade) {
  std::string json = JsonOf(testing::SmallConfiguration());
  EXPECT_THAT(ParseConfiguration(json).lacks, ::testing::IsEmpty());
  json = Replaced(json, "\"get_ups_max\"", "\"of another day\"");
  json = Replaced(json, "\"clear_ticks\"", "\"of another day\"");
  json = Replaced(json, "\"fallen\"", "\"of another day\"");
  const RecordConfiguration old = ParseConfiguration(json);
  EXPECT_THAT(old.lacks, ::testing::UnorderedElementsAre("get_ups_max", "clear_ticks", "fallen"));
  EXPECT_EQ(old.executor.reactions(Fault::kFallen, ExecutorState::kRunning), Reaction::kIgnore);
}

TEST(RecordConfiguration, HasAnEntryForEachJointHoweverManyThisBuildHasRoomFor) {
  RecordConfiguration written = testing::SmallConfiguration();
  written.executor.collapse.configured = true;
  const Json json = *Json::Parse(JsonOf(written));
  const Json& executor = *json.Find("executor");
  EXPECT_EQ(executor.Find("joints")->size(), 2U);
  EXPECT_EQ(executor.Find("last_known")->size(), 2U);
  EXPECT_EQ(executor.Find("collapse")->Find("position_rad")->size(), 2U);
}

/// The text with as many entries in the arrays of joints, as records up to version 4 had 8.
std::string WithEntries(const std::string& text, std::size_t count) {
  Json json = *Json::Parse(text);
  for (const char* key : {"joints", "last_known"}) {
    Json& array = json["executor"][key];
    while (array.size() < count) array.Append(array[array.size() - 1]);
  }
  Json& pose = json["executor"]["collapse"]["position_rad"];
  while (pose.size() < count) pose.Append(0.5);
  return json.Dump(1);
}

TEST(RecordConfiguration, OfTheVersionsBeforeHasEightEntriesOfWhichTheJointsCount) {
  RecordConfiguration written = testing::SmallConfiguration();
  written.executor.collapse = {true, {0.1F, -2.3F}, 0.7F};
  written.executor.last_known[1] = {true, -0.1F, 0.7F};
  const std::string text = JsonOf(written);
  RecordConfiguration read = ParseConfiguration(WithEntries(text, 8));
  read.files = written.files;  // Their texts are in other blocks.
  EXPECT_EQ(JsonOf(read), text);
  EXPECT_THAT(WhyRefused(WithEntries(text, 7)),
              HasSubstr("configuration: joints: is not an array of 2 entries, one for each joint"));
  EXPECT_THAT(WhyRefused(WithEntries(text, 9)), HasSubstr("joints: is not an array of 2 entries"));
}

TEST(RecordConfiguration, OfMoreJointsThanThisBuildTakesIsRefusedWithTheirNumber) {
  Json json = *Json::Parse(JsonOf(testing::SmallConfiguration()));
  for (int i = 3; i <= kMaxJoints + 1; ++i) json["joints"].Append("joint" + std::to_string(i));
  EXPECT_EQ(WhyRefused(json.Dump(1)),
            "configuration: joints: are " + std::to_string(kMaxJoints + 1) +
                "; this build takes from 1 ... " + std::to_string(kMaxJoints));
}

TEST(RecordConfiguration, IsRefusedWithTheKeyThatIsWrong) {
  const std::string good = JsonOf(testing::SmallConfiguration());
  EXPECT_EQ(WhyRefused(good), "accepted");
  EXPECT_THAT(WhyRefused(good.substr(0, good.size() / 2)), HasSubstr("is not JSON"));
  EXPECT_THAT(WhyRefused("[]"), HasSubstr("format: is missing"));
  EXPECT_THAT(WhyRefused(Replaced(good, "tumbler-record", "other")),
              HasSubstr("format: is 'other'"));
  EXPECT_THAT(WhyRefused(Replaced(good, "\"speed\"", "\"spied\"")), HasSubstr("speed: is missing"));
  EXPECT_THAT(WhyRefused(Replaced(good, "\"period_ns\": 1000000", "\"period_ns\": 0")),
              HasSubstr("period_ns: is not above 0"));
  EXPECT_THAT(
      WhyRefused(Replaced(good, "\"stale_ticks_max\": 6", "\"stale_ticks_max\": 3000000000")),
      HasSubstr("stale_ticks_max: is not an integer of 32 bits"));
  EXPECT_THAT(WhyRefused(Replaced(good, "\"cycles\": 1", "\"cycles\": 1.5")),
              HasSubstr("cycles: is not an integer"));
  EXPECT_THAT(WhyRefused(Replaced(good, "\"damp\"", "\"dump\"")),
              HasSubstr("a reaction that is none"));
  EXPECT_THAT(WhyRefused(Replaced(good, "\"dry_run\": false", "\"dry_run\": 0")),
              HasSubstr("dry_run: is not true or false"));
}

TEST(RecordedAssembly, LoadsNothingButWhatWasRecorded) {
  RecordConfiguration configuration = testing::SmallConfiguration();
  EXPECT_EQ(Assemble(configuration).executor().joint_count(), 2);
  configuration.files.clear();
  try {
    const Assembly assembly = Assemble(configuration);
    FAIL();
  } catch (const RecordError& error) {
    EXPECT_THAT(error.what(), HasSubstr("'motions/motion.toml' is not among the recorded files"));
  }
}

TEST(RecordedAssembly, RefusesWhatTheExecutorDoesNotTake) {
  RecordConfiguration configuration = testing::SmallConfiguration();
  configuration.executor.speed = 7;
  EXPECT_THROW(static_cast<void>(Assemble(configuration)), RecordError);
  configuration = testing::SmallConfiguration();
  std::string& text = configuration.files[0].text;
  text = Replaced(text, "coefficients_rad = [", "coefficients_rad = [1, ");
  EXPECT_THROW(static_cast<void>(Assemble(configuration)), FileError);
}

TEST(FileKeeper, KeepsEachFileOnceAsItWasRead) {
  const testing::TemporaryFolder folder;
  std::ofstream(folder / "a") << "one";
  FileKeeper keeper;
  const FileReader read = keeper.reader();
  EXPECT_EQ(read(folder / "a"), "one");
  std::ofstream(folder / "a") << "two";
  EXPECT_EQ(read(folder / "a"), "one") << "what was checked is what is used and recorded";
  EXPECT_THROW(read(folder / "b"), FileError);
  ASSERT_EQ(keeper.files().size(), 1U);
  EXPECT_EQ(keeper.files()[0].text, "one");
}

}  // namespace
}  // namespace tumbler
