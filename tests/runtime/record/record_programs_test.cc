// tumbler run --record, tumbler record and tumbler replay as a user meets them.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "runtime/record/lcm_log.h"
#include "runtime/record/record_blocks.h"
#include "tests/support/example_drives.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::Outcome;
using testing::Program;
using testing::ReadFile;

class RecordPrograms : public ::testing::Test {
 protected:
  [[nodiscard]] static Outcome Run(const std::string& command_line) {
    return testing::RunInShell(command_line);
  }
  /// Plays the nominal handstand and records it.
  [[nodiscard]] Outcome Record(const std::string& more = "") const {
    return Run("tumbler run sim " + kHandstand + " --hold-s 0.1 --record " + record_ + " " + more);
  }

  const std::string kHandstand = testing::SourcePath("primitives/nominal/handstand.toml");
  testing::TemporaryFolder folder_;
  std::string record_ = folder_ / "run.rec";
};

class RecordOfProtocol : public RecordPrograms,
                         public ::testing::WithParamInterface<testing::ExampleDrives> {};

TEST_P(RecordOfProtocol, ReplaysIdentically) {
  const std::string drives = testing::SourcePath(GetParam().file);
  const Outcome run = Run("tumbler run sim " + testing::SourcePath("primitives/nominal/gait.toml") +
                          " --cycles 1 --branch roll --drives " + drives + " --record " + record_);
  ASSERT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text, HasSubstr("0 not recorded"));
  const Outcome replay = Run("tumbler replay " + record_);
  EXPECT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_TRUE(replay.text.starts_with("identical: ")) << replay.text;
  const Outcome info = Run("tumbler record " + record_);
  EXPECT_EQ(info.exit_code, 0);
  EXPECT_THAT(info.text, HasSubstr("complete: completed; 4 motions, 1 complete cycles; the robot "
                                   "where it should be after each\n"));
  EXPECT_THAT(info.text, HasSubstr("holds " + drives));
}

TEST_P(RecordOfProtocol, OfAMotionThatWasRolledOutAndWentHomeReplaysIdentically) {
  // When the motion begins depends on how long drives take to be armed.
  Outcome run;
  for (int tenths = 3; tenths < 40 && run.text.find("reaction: roll out") == std::string::npos;
       ++tenths) {
    std::filesystem::remove(record_);
    testing::WriteFile(folder_ / "faults.toml",
                       "format = \"tumbler-bus-faults\"\nversion = 1\n[[fault]]\nkind = \"loss\"\n"
                       "node = \"host\"\nduration_s = 0.03\nstart_s = " +
                           std::to_string(0.1 * tenths) + "\n");
    run = Run("tumbler run sim " + testing::SourcePath("primitives/gait.toml") +
              " --cycles 1 --drives " + testing::SourcePath(GetParam().file) + " --bus-faults " +
              (folder_ / "faults.toml") + " --record " + record_);
  }
  EXPECT_EQ(run.exit_code, 3) << run.text;
  EXPECT_THAT(run.text, HasSubstr("(running); reaction: roll out"));
  EXPECT_THAT(run.text, HasSubstr("as after downstand")) << "it has gone home";
  EXPECT_THAT(run.text, Not(HasSubstr("broken off")));
  const Outcome replay = Run("tumbler replay " + record_);
  EXPECT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_TRUE(replay.text.starts_with("identical: ")) << replay.text;
}

INSTANTIATE_TEST_SUITE_P(Protocols, RecordOfProtocol,
                         ::testing::ValuesIn(testing::ExampleOfEveryProtocol()),
                         [](const auto& test) { return test.param.protocol; });

TEST_F(RecordPrograms, ARecordIsOneOfTheRunThatWasPlayedWhateverBecomesOfItsFiles) {
  std::filesystem::copy_file(kHandstand, folder_ / "motion.toml");
  const Outcome run =
      Run("tumbler run sim " + (folder_ / "motion.toml") + " --hold-s 0.1 --record " + record_);
  ASSERT_EQ(run.exit_code, 0) << run.text;
  std::filesystem::remove(folder_ / "motion.toml");
  EXPECT_EQ(Run("tumbler replay " + record_).exit_code, 0);
}

TEST_F(RecordPrograms, OfDrivesWithADataSheetHoldsItAndNamesItWhenItIsAnotherNow) {
  const std::string sheet = ReadFile(testing::SourcePath("tests/data/cia402_drive.eds"));
  testing::WriteFile(folder_ / "drive.eds", sheet);
  testing::WriteFile(
      folder_ / "drives.toml",
      testing::ReplacedAll(
          ReadFile(testing::SourcePath("primitives/robots/tumbler_drives_cia402.toml")),
          "protocol = \"canopen-csp\"", "protocol = \"canopen-csp\"\neds = \"drive.eds\""));
  const Outcome run = Record("--drives " + (folder_ / "drives.toml"));
  ASSERT_EQ(run.exit_code, 0) << run.text;
  const std::string holds = "holds " + (folder_ / "drive.eds") + " (";
  Outcome info = Run("tumbler record " + record_);
  EXPECT_THAT(info.text, HasSubstr(holds + std::to_string(sheet.size()) + " bytes"));
  EXPECT_THAT(info.text, Not(HasSubstr("another now")));
  // With a drive whose target position cannot be written, a run is refused. The record holds the
  // sheet of its day.
  testing::WriteFile(folder_ / "drive.eds",
                     testing::Replaced(sheet, "AccessType=rww", "AccessType=ro", "[607A]"));
  const Outcome refused =
      Run("tumbler run sim " + kHandstand + " --drives " + (folder_ / "drives.toml"));
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.text, HasSubstr("607Ah:00"));
  EXPECT_THAT(refused.text,
              HasSubstr("drive.eds:" + std::to_string(testing::LineOf(sheet, "[607A]"))));
  const Outcome replay = Run("tumbler replay " + record_);
  EXPECT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_TRUE(replay.text.starts_with("identical: ")) << replay.text;
  info = Run("tumbler record " + record_);
  EXPECT_EQ(info.exit_code, 0);
  EXPECT_THAT(
      testing::MatchesOf("holds [^\n]*drive.eds [^\n]*; the file there is another now", info.text),
      ::testing::SizeIs(1));
  EXPECT_THAT(testing::MatchesOf("another now", info.text), ::testing::SizeIs(1));
  std::filesystem::remove(folder_ / "drive.eds");
  EXPECT_EQ(Run("tumbler replay " + record_).exit_code, 0);
  EXPECT_THAT(Run("tumbler record " + record_).text, Not(HasSubstr("another now")));
}

TEST_F(RecordPrograms, ADamagedByteIsNamedAndEndsWithStatus4) {
  ASSERT_EQ(Record().exit_code, 0);
  std::string bytes = ReadFile(record_);
  BlockReader reader(testing::AsBytes(bytes));
  Block block;
  for (int ticks = 0; ticks <= 1000 && reader.Next(block);) {
    if (block.kind == BlockKind::kTick) ++ticks;
  }
  bytes[block.offset + 100] ^= 0x10;
  std::ofstream(record_, std::ios::binary) << bytes;
  const Outcome replay = Run("tumbler replay " + record_);
  EXPECT_EQ(replay.exit_code, 4);
  EXPECT_THAT(replay.text,
              HasSubstr("cannot be replayed further: byte " + std::to_string(block.offset)));
  EXPECT_THAT(replay.text, HasSubstr("(tick): its content does not have the CRC it had"));
  EXPECT_THAT(replay.text, HasSubstr("identical before: 1000 ticks"));
  const Outcome info = Run("tumbler record " + record_);
  EXPECT_EQ(info.exit_code, 4);
  EXPECT_THAT(info.text, HasSubstr("damaged at byte "));
  EXPECT_THAT(info.text, HasSubstr("has no end block that is whole and fits what is before it"));
  EXPECT_THAT(info.text, ::testing::Not(HasSubstr("interrupted")));
  // A stop may have been in that tick.
  const std::string play = "tumbler replay " + record_ + " --bus can9 --drives " +
                           testing::SourcePath("primitives/robots/tumbler_drives.toml");
  const Outcome armed = Run(play + " --arm --without-realtime");
  EXPECT_EQ(armed.exit_code, 2) << armed.text;
  EXPECT_THAT(armed.text, HasSubstr("ticks of it are missing"));
  EXPECT_EQ(Run(play).exit_code, 4) << "a dry run says that it is not as it should be";
}

TEST_F(RecordPrograms, AChangedByteWithAMatchingCrcIsNamedWithTickAndField) {
  ASSERT_EQ(Record().exit_code, 0);
  const std::string bytes = ReadFile(record_);
  RecordBytes changed;
  AppendRecordHeader(changed);
  BlockReader reader(testing::AsBytes(bytes));
  int ticks = 0;
  for (Block block; reader.Next(block);) {
    RecordBytes content(block.content.begin(), block.content.end());
    // In tick 1000, this flips the lowest bit of the position in leg2's reply.
    if (block.kind == BlockKind::kTick && ticks++ == 1000) content[71 + 21 + 8 + 5 + 2] ^= 1;
    AppendBlock(block.kind, block.number, content, changed);
  }
  std::ofstream(record_, std::ios::binary)
      .write(reinterpret_cast<const char*>(changed.data()),
             static_cast<std::streamsize>(changed.size()));
  const Outcome replay = Run("tumbler replay " + record_);
  EXPECT_EQ(replay.exit_code, 4);
  EXPECT_THAT(replay.text, HasSubstr("different at tick 1000 "));
  EXPECT_THAT(replay.text, HasSubstr("joint leg2: measured.position_rad: recorded "));
  EXPECT_THAT(replay.text, HasSubstr("identical before: 1000 ticks"));
}

TEST_F(RecordPrograms, KilledInMidRunItLeavesARecordThatReplaysUpToThere) {
  {
    Program run({testing::ProgramPath("tumbler run"), "sim", kHandstand, "--realtime", "--record",
                 record_});
    // The loop waits until the record has about a second of ticks.
    for (int i = 0; i < 2000; ++i) {
      std::error_code error;
      const auto size = std::filesystem::file_size(record_, error);
      if (!error && size > 300'000) break;
      usleep(10'000);
    }
    run.Signal(SIGKILL);
    EXPECT_EQ(run.Wait(), 1000 + SIGKILL) << run.text();
  }
  const Outcome replay = Run("tumbler replay " + record_);
  EXPECT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_TRUE(replay.text.starts_with("identical: ")) << replay.text;
  EXPECT_THAT(replay.text, HasSubstr("the recording was interrupted: it has no end block"));
  EXPECT_GT(std::stoi(replay.text.substr(std::string("identical: ").size())), 500);
  const Outcome info = Run("tumbler record " + record_ + " --candump " + (folder_ / "out.log"));
  EXPECT_EQ(info.exit_code, 0) << info.text;
  EXPECT_GT(std::filesystem::file_size(folder_ / "out.log"), 50'000U);
}

TEST_F(RecordPrograms, AFullDiskEndsTheRecordingAndNotTheRun) {
  const Outcome run = Run(std::string("ulimit -f 200; tumbler run sim ") + kHandstand +
                          " --hold-s 0.1 --record " + record_);
  EXPECT_EQ(run.exit_code, 4) << run.text;
  EXPECT_THAT(run.text, HasSubstr("recording stopped after "));
  EXPECT_THAT(run.text, HasSubstr("File too large"));
  EXPECT_THAT(run.text, HasSubstr("completed: handstand on sim"));
  const Outcome replay = Run("tumbler replay " + record_);
  EXPECT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_TRUE(replay.text.starts_with("identical: ")) << replay.text;
}

TEST_F(RecordPrograms, AnExistingRecordIsKeptAndNothingIsRun) {
  std::ofstream(record_) << "precious";
  const Outcome run = Record("--csv " + (folder_ / "a.csv") + " --log " + (folder_ / "a.lcm"));
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.text, HasSubstr("exists, and a record is never overwritten"));
  EXPECT_EQ(ReadFile(record_), "precious");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.csv")) << "no other file is begun";
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.lcm"));
}

TEST_F(RecordPrograms, ARecordIsKeptWhateverElseIsToHaveItsName) {
  ASSERT_EQ(Record("--log " + (folder_ / "run.lcm")).exit_code, 0);
  const std::string kept = folder_ / "kept.rec";
  std::filesystem::copy_file(record_, kept);
  const std::string run = "tumbler run sim " + kHandstand + " --hold-s 0.1 ";
  std::vector<std::string> commands;
  for (const std::string kind : {"--json", "--csv", "--log", "--mcap", "--candump", "--truth"})
    commands.push_back(run + kind + " " + kept);
  for (const std::string kind : {"--csv", "--log", "--mcap", "--candump"})
    commands.push_back("tumbler record " + record_ + " " + kind + " " + kept);
  for (const std::string kind : {"--csv", "--mcap"})
    commands.push_back("tumbler record " + (folder_ / "run.lcm") + " " + kind + " " + kept);
  for (const std::string& command : commands) {
    const Outcome refused = Run(command);
    EXPECT_EQ(refused.exit_code, 1) << command;
    EXPECT_THAT(refused.text, HasSubstr(kept + ": is ")) << command;
    ASSERT_EQ(ReadFile(kept), ReadFile(record_)) << command;
  }
}

TEST_F(RecordPrograms, ExportsWhatTheRunWroteItself) {
  const auto files = [this](const std::string& name) {
    std::string options;
    for (const std::string kind : {"csv", "log", "mcap", "candump"})
      options += " --" + kind + " " + (folder_ / (name + "." + kind));
    return options;
  };
  // The second of them goes round and branches; of the third no plan is drawn.
  const std::vector<std::string> runs = {
      kHandstand + " --hold-s 0.1",
      testing::SourcePath("primitives/nominal/gait.toml") + " --cycles 1 --branch roll",
      testing::SourcePath("primitives/solo12/turn.toml") + " --drives " +
          testing::SourcePath("primitives/solo12/drives.toml")};
  for (const std::string& run : runs) {
    std::filesystem::remove(record_);
    const Outcome played = Run("tumbler run sim " + run + " --record " + record_ + files("run"));
    ASSERT_EQ(played.exit_code, 0) << played.text;
    const Outcome exported = Run("tumbler record " + record_ + files("record"));
    EXPECT_EQ(exported.exit_code, 0) << exported.text;
    for (const std::string kind : {"csv", "log", "mcap", "candump"}) {
      const std::string of_run = ReadFile(folder_ / ("run." + kind));
      EXPECT_TRUE(of_run == ReadFile(folder_ / ("record." + kind))) << kind << " of " << run;
      EXPECT_GT(of_run.size(), 50'000U) << kind << " of " << run;
    }
  }
}

TEST_F(RecordPrograms, ARunWhosePlanCannotBeDrawnIsRefusedBeforeAnyFileIsTouched) {
  // The ground of the second is another one. The executor does not mind.
  testing::WriteFile(folder_ / "two.toml",
                     "format = \"tumbler-sequence\"\nversion = 1\nname = \"two\"\n"
                     "start = \"up\"\n[primitives]\nup = \"" +
                         kHandstand + "\"\ndown = \"" +
                         testing::SourcePath("primitives/downstand.toml") +
                         "\"\n[[node]]\nname = \"up\"\nprimitive = \"up\"\n"
                         "[[node]]\nname = \"down\"\nprimitive = \"down\"\nsafe = true\n"
                         "[[edge]]\nfrom = \"up\"\nto = \"down\"\n"
                         "[tolerances]\njoint_position_rad = 0.01\njoint_velocity_rad_s = 0.1\n"
                         "joint_acceleration_rad_s2 = 10.0\nroot_z_m = 1.0\n"
                         "root_pitch_rad = 1.5\nroot_m_s = 10.0\nroot_rad_s = 10.0\n");
  const std::string command = "tumbler run can0 --cycles 1 " + (folder_ / "two.toml") +
                              " --drives " +
                              testing::SourcePath("primitives/robots/tumbler_drives.toml") +
                              " --csv " + (folder_ / "run.csv");
  const Outcome refused = Run(command + " --mcap " + (folder_ / "run.mcap"));
  EXPECT_EQ(refused.exit_code, 1) << refused.text;
  EXPECT_THAT(refused.text, HasSubstr("run.mcap: cannot be written, since the plan cannot be "
                                      "drawn: "));
  EXPECT_THAT(refused.text, HasSubstr("primitives.down"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "run.mcap"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "run.csv"));
  EXPECT_EQ(Run(command).exit_code, 0) << "without the picture it can be played";
}

TEST_F(RecordPrograms, TheLogOfTrueStatesHasThoseOfTheRecordInTheirOrder) {
  ASSERT_EQ(Record("--truth " + (folder_ / "truth.lcm")).exit_code, 0);
  std::vector<std::string> logged, recorded;
  ForEachLogEvent(folder_ / "truth.lcm", [&logged](const lcm::LogEvent& event) {
    EXPECT_EQ(event.channel, "TUMBLER_TRUTH");
    logged.emplace_back(static_cast<const char*>(event.data),
                        static_cast<std::size_t>(event.datalen));
  });
  const MappedFile file(record_);
  FlightRecord record(file.bytes(), record_);
  const auto take = [&] {
    for (const auto& truth : record.truths()) recorded.emplace_back(truth.begin(), truth.end());
  };
  const auto entry = std::make_unique<TickEntry>();
  while (record.Next(*entry)) take();
  take();
  EXPECT_GT(recorded.size(), 100U);
  EXPECT_TRUE(logged == recorded);
}

TEST_F(RecordPrograms, AnExportThatDoesNotFitLeavesTheFileThatWasThere) {
  ASSERT_EQ(Record().exit_code, 0);
  for (const std::string option : {"--candump", "--csv", "--log", "--mcap", "--truth-csv"}) {
    const std::string path = folder_ / "kept/x";
    std::filesystem::create_directory(folder_.path() / "kept");
    std::ofstream(path) << "precious";
    std::string command = "tumbler record ";
    command.append(record_).append(" ").append(option).append(" ").append(path);
    const Outcome full = Run("ulimit -f 50; trap '' XFSZ; " + command);
    EXPECT_EQ(full.exit_code, 1) << option << full.text;
    EXPECT_THAT(full.text, HasSubstr("written")) << option;
    EXPECT_EQ(ReadFile(path), "precious") << option;
    // A signal that ends the program at once may leave a file of another name, never a part here.
    EXPECT_NE(Run("ulimit -f 50; " + command).exit_code, 0);
    EXPECT_EQ(ReadFile(path), "precious") << option;
    std::filesystem::remove_all(folder_.path() / "kept");
    EXPECT_EQ(Run("tumbler record " + record_ + " " + option + " -").exit_code, 1) << option;
  }
}

TEST_F(RecordPrograms, ComparesTwoRunsOfAMotionAndDrawsThem) {
  ASSERT_EQ(Record().exit_code, 0);
  const std::string other = folder_ / "other.rec";
  ASSERT_EQ(Run("tumbler run sim " + kHandstand + " --hold-s 0.1 --drives " +
                testing::SourcePath("primitives/robots/tumbler_drives_cia402.toml") + " --record " +
                other)
                .exit_code,
            0);
  const Outcome same =
      Run("tumbler replay " + record_ + " --against " + other + " --svg " + (folder_ / "a.svg"));
  EXPECT_EQ(same.exit_code, 0) << same.text;
  EXPECT_THAT(same.text, HasSubstr("setpoints differ in 0, by at most 0 rad"));
  EXPECT_THAT(ReadFile(folder_ / "a.svg"), HasSubstr("leg2: reply less setpoint [rad]"));
  // It takes the width that a page has, and no more than its own.
  EXPECT_THAT(
      ReadFile(folder_ / "a.svg"),
      ::testing::StartsWith("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 1400 620' "
                            "style='max-width:1400px' "));

  const std::string slow = folder_ / "slow.rec";
  ASSERT_EQ(Run("tumbler run sim " + kHandstand + " --speed 0.98 --hold-s 0.1 --record " + slow)
                .exit_code,
            0);
  EXPECT_EQ(Run("tumbler replay " + record_ + " --against " + slow).exit_code, 4);
}

TEST_F(RecordPrograms, AComparisonSaysWhatOfARecordCannotBeRead) {
  ASSERT_EQ(Record().exit_code, 0);
  const std::string other = folder_ / "other.rec";
  std::string bytes = ReadFile(record_);
  testing::WriteFile(other, bytes.substr(0, bytes.size() - 7));
  const Outcome cut_off = Run("tumbler replay " + record_ + " --against " + other);
  EXPECT_EQ(cut_off.exit_code, 0) << cut_off.text;
  EXPECT_THAT(cut_off.text, HasSubstr(other + ": cut off: "));
  EXPECT_THAT(cut_off.text, Not(HasSubstr(record_ + ": ")));

  BlockReader reader(testing::AsBytes(bytes));
  Block block;
  for (int ticks = 0; ticks <= 1000 && reader.Next(block);) {
    if (block.kind == BlockKind::kTick) ++ticks;
  }
  bytes[block.offset + 100] ^= 0x10;
  testing::WriteFile(other, bytes);
  for (const std::string& command : {"tumbler replay " + record_ + " --against " + other,
                                     "tumbler replay " + other + " --against " + record_}) {
    const Outcome damaged = Run(command);
    EXPECT_EQ(damaged.exit_code, 4) << damaged.text;
    EXPECT_THAT(damaged.text, HasSubstr("setpoints differ in 0, by at most 0 rad"));
    EXPECT_THAT(damaged.text,
                HasSubstr(other + ": damaged at byte " + std::to_string(block.offset)));
  }
}

TEST_F(RecordPrograms, ReadsALogOfCandumpByADrivesFile) {
  const std::string drives = testing::SourcePath("primitives/robots/tumbler_drives_cansimple.toml");
  ASSERT_EQ(Record("--drives " + drives).exit_code, 0);
  const std::string log = folder_ / "run.log";
  ASSERT_EQ(Run("tumbler record " + record_ + " --candump " + log).exit_code, 0);
  const Outcome read =
      Run("tumbler replay " + log + " --drives " + drives + " --svg " + (folder_ / "log.svg"));
  EXPECT_EQ(read.exit_code, 0) << read.text;
  EXPECT_THAT(read.text, HasSubstr("leg1: "));
  EXPECT_THAT(read.text, HasSubstr(" setpoints, 0 replies missing; tracking error 0.00"));
  EXPECT_THAT(ReadFile(folder_ / "log.svg"), HasSubstr("</svg>"));
  const Outcome without = Run("tumbler replay " + log);
  EXPECT_EQ(without.exit_code, 1);
  EXPECT_THAT(without.text, HasSubstr("say with --drives which drives are in it"));
  const Outcome on_bus = Run("tumbler replay " + log + " --bus can9 --drives " + drives);
  EXPECT_EQ(on_bus.exit_code, 1);
  EXPECT_THAT(on_bus.text, HasSubstr("play it with `canplayer`"));
}

TEST_F(RecordPrograms, APlayOnABusNeedsTheBusAndItsDrives) {
  ASSERT_EQ(Record().exit_code, 0);
  const Outcome without = Run("tumbler replay " + record_ + " --bus can9");
  EXPECT_EQ(without.exit_code, 1);
  EXPECT_THAT(without.text, HasSubstr("say with --drives which drives are on the bus"));
  const Outcome absent = Run("tumbler replay " + record_ + " --bus can9 --drives " +
                             testing::SourcePath("primitives/robots/tumbler_drives.toml") +
                             " --arm --without-realtime");
  EXPECT_EQ(absent.exit_code, 1);
  EXPECT_THAT(absent.text, HasSubstr("can9"));
  EXPECT_EQ(Run("tumbler replay " + record_ + " --arm").exit_code, 1);
  EXPECT_EQ(Run("tumbler replay " + record_ + " --svg " + (folder_ / "x.svg")).exit_code, 1);
}

TEST_F(RecordPrograms, WhatARecordHasMilderIsRefusedByNameUntilAnOptionSaysWhatHolds) {
  const std::string drives = testing::SourcePath("primitives/robots/tumbler_drives.toml");
  const std::string header = "format = \"tumbler-faults\"\nversion = 1\n";
  testing::WriteFile(folder_ / "mild.toml", header +
                                                "[limits]\nstale_ticks_max = 500\n[reactions]\n"
                                                "following_error = \"ignore\"\n");
  testing::WriteFile(folder_ / "default.toml", header);
  ASSERT_EQ(Record("--drives " + drives + " --start-within 100 --end torque-off --faults " +
                   (folder_ / "mild.toml"))
                .exit_code,
            4)
      << "without torque 2 s later, what the motion is for is not judged";
  EXPECT_EQ(Run("tumbler replay " + record_).exit_code, 0) << "at a desk nothing moves";
  const std::string play = "tumbler replay " + record_ + " --bus can9 --drives " + drives;
  const Outcome refused = Run(play);
  EXPECT_EQ(refused.exit_code, 2) << refused.text;
  EXPECT_THAT(refused.text, HasSubstr(record_ + ": the run that was recorded had milder settings"));
  for (const char* line :
       {"start_way_max_rad: 100 in the record, 1 now; choose with --start-within",
        "stale_ticks_max: 500 in the record, 10 now; choose with --faults",
        "reactions: following error: ignore while arming, ignore while holding",
        "now; choose with --faults", "damp while running",
        "end of the run: torque-off in the record, hold now; choose with --end"}) {
    EXPECT_THAT(refused.text, HasSubstr(line));
  }
  EXPECT_EQ(Run(play + " --arm --without-realtime").exit_code, 2);
  // Each of them is chosen for itself.
  const Outcome some = Run(play + " --start-within 1 --end hold");
  EXPECT_EQ(some.exit_code, 2);
  EXPECT_THAT(some.text, Not(HasSubstr("start_way_max_rad")));
  EXPECT_THAT(some.text, Not(HasSubstr("end of the run")));
  EXPECT_THAT(some.text, HasSubstr("following error"));
  for (const std::string faults : {"mild.toml", "default.toml"}) {
    const Outcome chosen =
        Run(play + " --start-within 1 --end torque-off --faults " + (folder_ / faults));
    EXPECT_EQ(chosen.exit_code, 0) << chosen.text;
    EXPECT_THAT(chosen.text, HasSubstr("setpoints differ in 0, by at most 0 rad"));
  }
}

TEST_F(RecordPrograms, ARecordOfARobotThatGetsUpDoesNotGetUpUnasked) {
  const std::string drives = testing::SourcePath("primitives/robots/tumbler_drives_sensor.toml");
  const Outcome run = Run("tumbler run sim " + testing::SourcePath("primitives/gait.toml") +
                          " --cycles 1 --get-ups 3 --drives " + drives + " --record " + record_);
  ASSERT_EQ(run.exit_code, 0) << run.text;
  const std::string play = "tumbler replay " + record_ + " --bus can9 --drives " + drives;
  const Outcome refused = Run(play);
  EXPECT_EQ(refused.exit_code, 2) << refused.text;
  EXPECT_THAT(refused.text,
              HasSubstr("get_ups_max: 3 in the record, 0 now; choose with --get-ups"));
  const Outcome chosen = Run(play + " --get-ups 0");
  EXPECT_EQ(chosen.text.find("get_ups_max"), std::string::npos) << chosen.text;
}

TEST_F(RecordPrograms, ADryRunOfASequenceThatNothingInTheRecordEndsIsRefused) {
  // Slow enough for a machine that is busy.
  const std::string drives = folder_ / "slow.toml";
  std::string text = ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  text = testing::Replaced(text, "rate_hz = 1000.0", "rate_hz = 200.0");
  for (const char* const end : {" ", "\n"}) {
    text = testing::Replaced(text, std::string("watchdog_s = 0.025") + end,
                             std::string("watchdog_s = 0.2") + end);
  }
  std::ofstream(drives) << text;
  for (const bool ended : {false, true}) {
    std::filesystem::remove(record_);
    Program run({testing::ProgramPath("tumbler run"), "sim",
                 testing::SourcePath("primitives/nominal/gait.toml"), "--realtime", "--drives",
                 drives, "--record", record_});
    ASSERT_TRUE(testing::Eventually([&] {
      std::error_code error;
      const auto size = std::filesystem::file_size(record_, error);
      return !error && size > 750'000;  // well in its motion
    }));
    run.Signal(ended ? SIGINT : SIGKILL);
    run.Wait();
    const Outcome play = Run("tumbler replay " + record_ + " --bus can9 --drives " + drives);
    if (ended) {
      EXPECT_THAT(play.text, HasSubstr("stopped on can9 (dry run"));
    } else {
      EXPECT_EQ(play.exit_code, 1) << play.text;
      EXPECT_THAT(play.text, HasSubstr("a dry run would have no end"));
    }
  }
}

TEST_F(RecordPrograms, WhatTheDrivesOfNowHaveOtherwiseIsSaid) {
  const std::string drives = testing::SourcePath("primitives/robots/tumbler_drives.toml");
  ASSERT_EQ(Record("--drives " + drives).exit_code, 0);
  const Outcome armed = Run("tumbler replay " + record_ + " --bus can9 --arm --without-realtime");
  EXPECT_EQ(armed.exit_code, 1);
  EXPECT_THAT(armed.text, HasSubstr("say with --drives which drives are on the bus"));
  EXPECT_EQ(Run("tumbler replay " + record_ + " --bus can9").exit_code, 0)
      << "a dry run takes the drives of the record";
  std::string text = ReadFile(drives);
  text = testing::ReplacedAll(text, "kp_nm_per_rad = 40.0", "kp_nm_per_rad = 30.0");
  text = testing::ReplacedAll(text, "watchdog_s = 0.025", "watchdog_s = 0.05");
  text = testing::ReplacedAll(text, "temperature_max_c = 80.0", "temperature_max_c = 90.0");
  text = testing::ReplacedAll(text, "zero_offset_rad = 0.0", "zero_offset_rad = 0.1");
  testing::WriteFile(folder_ / "now.toml", text);
  const Outcome now =
      Run("tumbler replay " + record_ + " --bus can9 --drives " + (folder_ / "now.toml"));
  for (const char* line : {"joint leg2: zero_offset_rad is 0.1; it was 0 ",
                           "joint leg1: watchdog_s is 0.05; it was 0.025 ",
                           "joint leg1: kp_nm_per_rad is 30; it was 40 ",
                           "joint leg2: temperature_max_c is 90; it was 80 "}) {
    EXPECT_THAT(now.text, HasSubstr(line));
  }
}

TEST_F(RecordPrograms, ALogOfSeveralInterfacesIsReadForTheOneThatIsNamed) {
  const std::string drives = testing::SourcePath("primitives/robots/tumbler_drives.toml");
  ASSERT_EQ(Record("--drives " + drives).exit_code, 0);
  ASSERT_EQ(Run("tumbler record " + record_ + " --candump " + (folder_ / "one.log")).exit_code, 0);
  const std::string one = ReadFile(folder_ / "one.log");
  const Outcome alone = Run("tumbler replay " + (folder_ / "one.log") + " --drives " + drives);
  ASSERT_EQ(alone.exit_code, 0) << alone.text;
  // As `candump any` logs two buses: on the other one the same drives hold still.
  std::string both;
  for (std::size_t at = 0; at < one.size();) {
    const std::size_t end = one.find('\n', at) + 1;
    const std::string line = one.substr(at, end - at);
    at = end;
    both += testing::ReplacedAll(line, " sim ", " can0 ");
    const std::size_t hash = line.find('#');
    both += testing::ReplacedAll(line.substr(0, hash), " sim ", " can1 ") + "#7FFF7FF0CCD337FF\n";
  }
  testing::WriteFile(folder_ / "both.log", both);
  const std::string read = "tumbler replay " + (folder_ / "both.log") + " --drives " + drives;
  const Outcome merged = Run(read);
  EXPECT_EQ(merged.exit_code, 1);
  EXPECT_THAT(merged.text, HasSubstr("has frames of several interfaces: can0 ("));
  EXPECT_THAT(merged.text, HasSubstr("), can1 ("));
  EXPECT_THAT(merged.text, HasSubstr("say with --interface on which the drives are"));
  const Outcome named = Run(read + " --interface can0");
  EXPECT_EQ(named.exit_code, 0) << named.text;
  EXPECT_EQ(testing::ReplacedAll(named.text, "both.log", "one.log"), alone.text);
  EXPECT_NE(Run(read + " --interface can1").text, named.text);
  const Outcome absent = Run(read + " --interface can2");
  EXPECT_EQ(absent.exit_code, 1);
  EXPECT_THAT(absent.text, HasSubstr("has no frame of 'can2'; it has those of can0 ("));
  EXPECT_EQ(Run("tumbler replay " + record_ + " --interface can0").exit_code, 1);
}

TEST_F(RecordPrograms, WrongUseEndsWithStatus1) {
  for (const std::string program : {"tumbler record", "tumbler replay"}) {
    EXPECT_EQ(Run(program).exit_code, 1);
    EXPECT_EQ(Run(program + " --nonsense x").exit_code, 1);
    const Outcome absent = Run(program + " " + (folder_ / "absent"));
    EXPECT_EQ(absent.exit_code, 1);
    EXPECT_THAT(absent.text, HasSubstr("absent: cannot be read: No such file"));
    std::ofstream(folder_ / "other") << "something else, which is no record";
    EXPECT_EQ(Run(program + " " + (folder_ / "other")).exit_code, 1);
    EXPECT_EQ(Run(program + " --help").exit_code, 0);
  }
}

}  // namespace
}  // namespace tumbler
