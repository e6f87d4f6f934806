// Flight records of runs on the CAN interfaces of a kernel: compared with candump, played by
// canplayer, on a disk that fills up, and after kill -9.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_hash.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/candump.h"
#include "tests/support/can_interface.h"
#include "tests/support/example_drives.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/recorded_run.h"
#include "tests/support/steady_time.h"

namespace tumbler {
namespace {

using testing::Eventually;
using ::testing::HasSubstr;
using testing::Program;
using testing::ProgramPath;
using testing::ReadFile;
using testing::ReplacedAll;
using testing::VirtualCan;
using testing::WriteFile;

/// The lines of a log without their times.
std::vector<std::string> FramesOf(const std::string& log) {
  std::vector<std::string> frames;
  for (std::size_t at = 0; at < log.size();) {
    const std::size_t end = std::min(log.find('\n', at), log.size());
    const std::string line = log.substr(at, end - at);
    frames.push_back(line.substr(line.find(") ") + 2));
    at = end + 1;
  }
  return frames;
}

/// The number of occurrences of each line.
std::map<std::string, int> CountsOf(const std::vector<std::string>& lines) {
  std::map<std::string, int> counts;
  for (const std::string& line : lines) ++counts[line];
  return counts;
}

class RecordOnCan : public ::testing::Test {
 protected:
  RecordOnCan() {
    testing::RequireCan();
    testing::MotionShape shape;
    shape.duration_s = 1.6;
    shape.amplitude_rad = 0.2;
    PrimitiveFile file = testing::RandomPrimitiveFile(shape, 70);
    file.primitive.following_tolerance_rad = 0.5;  // allows three late ticks at full speed
    WriteFile(Path("motion.toml"), ToToml(file));
    for (std::size_t i = 0; i < 2; ++i) {
      start_rad_.push_back(file.primitive.joints[i].position.control_points()[0]);
    }
    WriteDrives(testing::ExampleOfEveryProtocol()[0]);
  }

  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }

  /// Writes the example's drives file, for the joints of this test and a rate that the guest can
  /// keep.
  void WriteDrives(const testing::ExampleDrives& example) const {
    std::string text = ReadFile(testing::SourcePath(example.file));
    const auto replace = [&text](const std::string& what, const std::string& with) {
      ASSERT_NE(text.find(what), std::string::npos) << what;
      text = ReplacedAll(text, what, with);
    };
    replace("\"leg1\"", "\"joint1\"");
    replace("\"leg2\"", "\"joint2\"");
    text = testing::AtRate(text, 25);
    replace("watchdog_s = 0.025", "watchdog_s = 0.2");
    if (example.protocol == "cansimple") {  // Its drives send by themselves, as for 1 kHz.
      replace("heartbeat_s = 0.01", "heartbeat_s = 0.1");
      replace("torques_s = 0.01", "torques_s = 0.1");
    }
    WriteFile(Path("drives.toml"), text);
  }
  [[nodiscard]] std::unique_ptr<Program> StartDrives(const std::string& interface) const {
    auto drives = std::make_unique<Program>(std::vector<std::string>{
        ProgramPath("tumbler drives"), interface, Path("drives.toml"), "--friction", "1",
        "--position", "joint1=" + std::to_string(start_rad_[0] + 0.05), "--position",
        "joint2=" + std::to_string(start_rad_[1] - 0.05)});
    EXPECT_TRUE(drives->WaitFor("2 drives on " + interface)) << drives->text();
    return drives;
  }
  [[nodiscard]] std::unique_ptr<Program> StartRun(const std::string& interface,
                                                  const std::string& record) const {
    return std::make_unique<Program>(
        std::vector<std::string>{ProgramPath("tumbler run"), interface, Path("motion.toml"),
                                 "--drives", Path("drives.toml"), "--end", "torque-off", "--hold-s",
                                 "0.2", "--arm", "--without-realtime", "--record", record});
  }
  [[nodiscard]] std::unique_ptr<Program> StartCandump(const std::string& interface,
                                                      const std::string& log) const {
    return testing::StartCandump(interface, Path(log));
  }
  static std::string Output(const std::vector<std::string>& arguments, int expected_status = 0) {
    Program program(arguments);
    EXPECT_EQ(program.Wait(), expected_status) << program.text();
    return program.text();
  }
  static std::string Replay(const std::string& record) {
    return Output({ProgramPath("tumbler replay"), record});
  }

  testing::TemporaryFolder folder_;
  std::vector<double> start_rad_;
};

TEST_F(RecordOnCan, AnArmedRunOnARealBusReplaysIdenticallyAndHoldsTheFramesThatCandumpSaw) {
  int attempt = 0;
  testing::InSteadyTime([&] {
    const std::string record = Path("run" + std::to_string(attempt++) + ".rec");
    const VirtualCan can;
    const auto drives = StartDrives(can.name());
    const auto candump = StartCandump(can.name(), "candump.log");
    const auto run = StartRun(can.name(), record);
    ASSERT_EQ(run->Wait(), 0) << run->text();
    EXPECT_THAT(run->text(), HasSubstr("0 not recorded"));
    EXPECT_TRUE(Replay(record).starts_with("identical: "));

    Output({ProgramPath("tumbler record"), record, "--candump", Path("record.log")});
    usleep(300'000);  // The last replies need this time.
    const std::string theirs = ReadFile(Path("candump.log"));
    const std::string ours = ReadFile(Path("record.log"));
    std::vector<std::string> their_frames = FramesOf(theirs.substr(0, theirs.rfind('\n')));
    const std::vector<std::string> our_frames = FramesOf(ours.substr(0, ours.rfind('\n')));
    ASSERT_GT(our_frames.size(), 200U);
    // candump wrote every line, too, byte for byte except for the time. It may also have seen
    // replies to the last tick, which nobody took any more.
    const auto their_counts = CountsOf(their_frames);
    for (const auto& [line, count] : CountsOf(our_frames)) {
      const auto found = their_counts.find(line);
      ASSERT_NE(found, their_counts.end()) << line;
      EXPECT_LE(count, found->second) << line;
    }
    EXPECT_LE(their_frames.size(), our_frames.size() + 4);
    EXPECT_EQ(our_frames[0], their_frames[0]);
    // Both times are of the same clock, and nearly equal.
    std::int64_t skipped = 0;
    const auto our_log = ParseCandump(ours, "ours", skipped);
    const auto their_log =
        ParseCandump(theirs.substr(0, theirs.rfind('\n') + 1), "theirs", skipped);
    EXPECT_NEAR(static_cast<double>(our_log[0].received.time_ns),
                static_cast<double>(their_log[0].received.time_ns), 0.1e9);
  });
}

TEST_F(RecordOnCan, CanplayerPlaysAnExportedRecord) {
  const std::string log = Path("sim.log");
  std::ofstream(Path("small.rec"), std::ios::binary)
      << testing::RecordedBytes(testing::SmallConfiguration());
  Output({ProgramPath("tumbler record"), Path("small.rec"), "--candump", log});
  const VirtualCan can;
  const auto candump = StartCandump(can.name(), "played.log");
  Output({"/usr/bin/canplayer", "-I", log, can.name() + "=sim"});  // It plays at the log's pace.
  const std::string exported = ReadFile(log);
  const std::vector<std::string> sent = FramesOf(exported.substr(0, exported.rfind('\n')));
  std::vector<std::string> seen;
  EXPECT_TRUE(Eventually([&] {
    const std::string text = ReadFile(Path("played.log"));
    seen = FramesOf(text.substr(0, text.rfind('\n')));
    return seen.size() >= sent.size();
  }));
  ASSERT_EQ(seen.size(), sent.size());
  ASSERT_GT(sent.size(), 300U);
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_EQ(seen[i].substr(seen[i].find(' ')), sent[i].substr(sent[i].find(' '))) << i;
  }
}

TEST_F(RecordOnCan, ADiskThatFillsUpEndsTheRecordingAndNotTheRun) {
  int attempt = 0;
  testing::InSteadyTime([&] {
    const std::string disk = Path("disk" + std::to_string(attempt++));
    std::filesystem::create_directories(disk);
    ASSERT_EQ(mount("none", disk.c_str(), "tmpfs", 0, "size=32k"), 0);
    const std::string record = disk + "/run.rec";
    const VirtualCan can;
    const auto drives = StartDrives(can.name());
    const auto run = StartRun(can.name(), record);
    EXPECT_EQ(run->Wait(), 4) << run->text();  // The motion is over; its record is not whole.
    EXPECT_THAT(run->text(), HasSubstr("recording stopped after "));
    EXPECT_THAT(run->text(), HasSubstr("No space left on device"));
    EXPECT_THAT(run->text(), HasSubstr("completed: random on " + can.name()));
    EXPECT_LE(std::filesystem::file_size(record), 32'768U);
    const std::string replay = Replay(record);
    EXPECT_TRUE(replay.starts_with("identical: ")) << replay;
    EXPECT_GT(std::stoi(replay.substr(std::string("identical: ").size())), 20) << replay;
    umount(disk.c_str());
  });
}

TEST_F(RecordOnCan, KilledInMidMotionItLeavesARecordThatReplaysUpToThere) {
  int attempt = 0;
  testing::InSteadyTime([&] {
    const std::string record = Path("run" + std::to_string(attempt++) + ".rec");
    const VirtualCan can;
    const auto drives = StartDrives(can.name());
    const auto run = StartRun(can.name(), record);
    ASSERT_TRUE(Eventually([&] {
      std::error_code error;
      const auto size = std::filesystem::file_size(record, error);
      return !error && size > 26'000;  // 10 kB of configuration, and a second and a half of ticks
    }));
    run->Signal(SIGKILL);
    EXPECT_EQ(run->Wait(), 1000 + SIGKILL);
    const std::string replay = Replay(record);
    EXPECT_TRUE(replay.starts_with("identical: ")) << replay;
    EXPECT_GT(std::stoi(replay.substr(std::string("identical: ").size())), 20) << replay;
    EXPECT_THAT(replay, HasSubstr("interrupted"));
  });
}

class ReplayOnCan : public RecordOnCan,
                    public ::testing::WithParamInterface<testing::ExampleDrives> {};

TEST_P(ReplayOnCan, SendsNothingInADryRunAndPlaysTheRecordedSetpointsWhenArmed) {
  int attempt = 0;
  WriteDrives(GetParam());
  testing::InSteadyTime([&] {
    const std::string record = Path("first_" + std::to_string(attempt++) + ".rec");
    const VirtualCan can;
    auto drives = StartDrives(can.name());
    const auto run = StartRun(can.name(), record);
    ASSERT_EQ(run->Wait(), 0) << run->text();

    // The replay runs on another interface, where the drives are in other positions.
    const VirtualCan bench;
    const auto candump = StartCandump(bench.name(), "bench.log");
    std::ofstream(Path("bench.log"), std::ios::trunc).close();
    const std::string dry = Output(
        {ProgramPath("tumbler replay"), record, "--bus", bench.name(), "--end", "torque-off"});
    EXPECT_THAT(dry, HasSubstr("completed on " + bench.name() + " (dry run"));
    EXPECT_THAT(dry, HasSubstr("setpoints differ in 0, by at most 0 rad"));
    EXPECT_EQ(ReadFile(Path("bench.log")), "") << "nothing is sent without --arm";

    const auto bench_drives = StartDrives(bench.name());
    const std::string svg = Path("bench.svg");
    const std::string played_record = record + ".played";
    const std::string played =
        Output({ProgramPath("tumbler replay"), record, "--bus", bench.name(), "--arm",
                "--without-realtime", "--drives", Path("drives.toml"), "--end", "torque-off",
                "--svg", svg, "--record", played_record});
    EXPECT_THAT(played, HasSubstr("completed on " + bench.name() + "\n"));
    EXPECT_THAT(played, HasSubstr("joint2: "));
    EXPECT_THAT(played, HasSubstr("setpoints differ in 0, by at most 0 rad"));
    EXPECT_THAT(ReadFile(svg), HasSubstr("joint2: position [rad]"));
    EXPECT_GT(ReadFile(Path("bench.log")).size(), 4000U);
    EXPECT_TRUE(Replay(played_record).starts_with("identical: "));
  });
}

INSTANTIATE_TEST_SUITE_P(EveryProtocol, ReplayOnCan,
                         ::testing::ValuesIn(testing::ExampleOfEveryProtocol()),
                         [](const auto& run) { return run.param.protocol; });

TEST_F(RecordOnCan, AReplayPlaysAPrimitiveInsteadAndRefusesDrivesOfOtherJoints) {
  testing::InSteadyTime([&] {
    const std::string record = Path("sim.rec");
    std::filesystem::remove(record);
    Output({ProgramPath("tumbler run"), "sim", testing::SourcePath("primitives/handstand.toml"),
            "--record", record});
    const VirtualCan can;
    const auto drives = StartDrives(can.name());
    Program wrong({ProgramPath("tumbler replay"), record, "--bus", can.name(), "--drives",
                   Path("drives.toml")});
    EXPECT_NE(wrong.Wait(), 0);
    EXPECT_THAT(wrong.text(), HasSubstr("has no drive for joint 'leg1'"));

    const std::string run_record = Path("run.rec");
    std::filesystem::remove(run_record);
    const auto run = StartRun(can.name(), run_record);
    ASSERT_EQ(run->Wait(), 0) << run->text();
    testing::MotionShape shape;
    shape.duration_s = 0.8;
    shape.amplitude_rad = 0.1;
    PrimitiveFile other = testing::RandomPrimitiveFile(shape, 71);
    other.primitive.following_tolerance_rad = 0.5;
    std::ofstream(Path("other.toml")) << ToToml(other);
    const std::string played =
        Output({ProgramPath("tumbler replay"), run_record, "--bus", can.name(), "--arm",
                "--without-realtime", "--drives", Path("drives.toml"), "--end", "torque-off",
                "--motion", Path("other.toml")});
    EXPECT_THAT(played, HasSubstr("completed on " + can.name()));
    EXPECT_EQ(played.find("setpoints differ in 0,"), std::string::npos) << "it is another motion";
  });
}

TEST_F(RecordOnCan, AReplayArmsAsARunDoesAndKeepsThePose) {
  int attempt = 0;
  testing::InSteadyTime([&] {
    const std::string record = Path("first_" + std::to_string(attempt++) + ".rec");
    const std::string pose = record + ".pose";
    const VirtualCan can;
    const auto drives = StartDrives(can.name());
    const auto run = StartRun(can.name(), record);
    ASSERT_EQ(run->Wait(), 0) << run->text();

    const auto replay = [&](const std::vector<std::string>& more) {
      std::vector<std::string> all = {
          ProgramPath("tumbler replay"), record,   "--bus", can.name(), "--arm", "--drives",
          Path("drives.toml"),           "--pose", pose};
      all.insert(all.end(), more.begin(), more.end());
      return std::make_unique<Program>(all);
    };
    const std::vector<std::string> ends = {"--without-realtime", "--end", "torque-off"};
    const auto with = [&ends](std::vector<std::string> more) {
      more.insert(more.end(), ends.begin(), ends.end());
      return more;
    };
    // It is refused as a run is, before the bus is touched.
    const auto unscheduled = replay({"--end", "torque-off"});
    EXPECT_EQ(unscheduled->Wait(), 2) << unscheduled->text();
    EXPECT_THAT(unscheduled->text(), HasSubstr("driving motors takes --realtime"));
    const auto unasked = replay({"--without-realtime"});
    EXPECT_EQ(unasked->Wait(), 2) << unasked->text();
    EXPECT_THAT(unasked->text(), HasSubstr("choose with --end"));
    EXPECT_FALSE(std::filesystem::exists(pose));

    // Nobody knows a pose yet. Where the joints are then is known.
    const auto first = replay(with({}));
    EXPECT_EQ(first->Wait(), 0) << first->text();
    EXPECT_THAT(ReadFile(pose), HasSubstr("joint1"));
    const double end_rad = Json::Parse(ReadFile(pose)).value()["shafts_rad"]["joint2"].number();
    const auto write_pose = [&](double off_rad) {
      WriteFile(pose, "{\"format\": \"tumbler-pose\", \"shafts_rad\": {\"joint2\": " +
                          std::to_string(end_rad + off_rad) + "}}");
    };
    write_pose(-6.2831853);
    const auto lost = replay(with({}));
    EXPECT_EQ(lost->Wait(), 2) << lost->text();
    EXPECT_THAT(lost->text(), HasSubstr("whole turns of its drive"));
    EXPECT_THAT(lost->text(), HasSubstr("joint2"));
    write_pose(-0.8);
    const auto moved = replay(with({}));
    EXPECT_EQ(moved->Wait(), 2) << moved->text();
    EXPECT_THAT(moved->text(), HasSubstr("far from where it was last known"));
    EXPECT_EQ(replay(with({"--moved-within", "1"}))->Wait(), 0);
    write_pose(-6.2831853);
    EXPECT_EQ(replay(with({"--forget-pose"}))->Wait(), 0);
    const auto far = replay(with({"--start-within", "0", "--forget-pose"}));
    EXPECT_EQ(far->Wait(), 2) << far->text();
  });
}

}  // namespace
}  // namespace tumbler
