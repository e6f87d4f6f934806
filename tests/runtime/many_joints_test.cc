// A motion of as many joints as this build has room for, from its file to its replay, and one of
// more.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "firmware_interface/can/bus_schedule.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/rotor_plant.h"
#include "runtime/assembly/clock.h"
#include "runtime/assembly/run_checks.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/flight_recorder.h"
#include "runtime/record/recorded_assembly.h"
#include "runtime/record/replay.h"
#include "runtime/record/sentences.h"
#include "runtime/run/control_loop.h"
#include "tests/support/files.h"
#include "tests/support/primitive_file.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

/// A drives file with so many drives of the MIT kind.
std::string Drives(int count, double rate_hz) {
  std::string text = fmt::format(
      "format = \"tumbler-drives\"\nversion = 1\n[bus]\nbit_rate = 1_000_000\nrate_hz = {:.1f}\n",
      rate_hz);
  for (int i = 1; i <= count; ++i) {
    text += fmt::format(
        "[[drive]]\njoint = \"joint{0}\"\nprotocol = \"mit\"\ncommand_id = {0}\nreply_id = {1}\n"
        "direction = {2}\ngear_ratio = 1.0\nzero_offset_rad = 0.1\nkp_nm_per_rad = 100.0\n"
        "kd_nm_s_per_rad = 4.0\ntemperature_max_c = 80.0\ntemperature_encoding = \"signed\"\n"
        "watchdog_s = 0.025\n[drive.range]\nposition_rad = [-12.5, 12.5]\n"
        "velocity_rad_s = [-50.0, 50.0]\nkp_nm_per_rad = [0.0, 500.0]\n"
        "kd_nm_s_per_rad = [0.0, 5.0]\ntorque_nm = [-18.0, 18.0]\n",
        i, 100 + i, i % 2 == 0 ? 1 : -1);
  }
  return text;
}

/// The highest rate that a bus bears with so many drives.
double HighestRate(int count) {
  const DrivesConfig drives = ParseDrives(Drives(count, 100), "drives.toml");
  BusSchedule schedule;
  schedule.bit_rate = drives.bit_rate;
  schedule.tick_bits = drives.WorstCaseTickBits();
  schedule.longest_frame_bits = drives.LongestFrameBits();
  return schedule.ceiling_hz();
}

/// The text of a primitive with so many joints.
std::string Motion(int joints) {
  testing::MotionShape shape;
  shape.joint_count = std::min(joints, kMaxJoints);
  shape.duration_s = 0.6;
  shape.amplitude_rad = 0.2;
  shape.settle_s = 0.05;
  std::string text = ToToml(testing::RandomPrimitiveFile(shape, 12));
  if (joints <= kMaxJoints) return text;
  // One more, as the last.
  const std::string name = fmt::format("name = \"joint{}\"", kMaxJoints);
  const std::size_t begin = text.rfind("[[joint]]", text.find(name));
  const std::string last = text.substr(begin, text.find("\n[entry]", begin) - begin);
  return text.insert(begin, testing::Replaced(last, name, "name = \"one more\"") + "\n");
}

RecordConfiguration Configuration(int joints, double rate_hz) {
  RecordConfiguration configuration;
  configuration.program = "test 1.0";
  configuration.bus = "sim";
  configuration.virtual_time = true;
  configuration.period_ns = static_cast<std::int64_t>(std::llround(1e9 / rate_hz));
  for (int i = 1; i <= joints; ++i) configuration.joints.push_back(fmt::format("joint{}", i));
  configuration.motion_file = "motion.toml";
  configuration.drives_file = "drives.toml";
  configuration.files = {{"motion.toml", Motion(joints)}, {"drives.toml", Drives(joints, rate_hz)}};
  configuration.executor.period_s = static_cast<float>(1 / rate_hz);
  for (JointConfig& joint : configuration.executor.joints) joint.kp_nm_per_rad = 100;
  configuration.procedure.hold_ticks = 10;
  return configuration;
}

TEST(ManyJoints, AsManyAsThisBuildTakesArePlayedRecordedAndReplayed) {
  const double rate_hz = 10 * std::floor(HighestRate(kMaxJoints) / 10);
  const RecordConfiguration configuration = Configuration(kMaxJoints, rate_hz);
  Assembly assembly = Assemble(configuration);
  const DrivesConfig& drives = assembly.parts().drives;
  EXPECT_NO_THROW(CheckSchedule(drives, [](const std::string& /*sentence*/) {}));
  CheckWatchdogs(drives, false);

  SimulatedBus bus(drives.bit_rate);
  SimulatedPort& host = bus.Attach(drives.HostPort());
  std::vector<std::unique_ptr<SimulatedDrive>> simulated;
  std::vector<RotorPlant::Rotor> rotors;
  for (std::size_t i = 0; i < drives.drives.size(); ++i) {
    simulated.push_back(MakeSimulatedDrive(drives.drives[i]));
    simulated.back()->AttachTo(bus);
    RotorPlant::Rotor rotor;
    rotor.drive = simulated.back().get();
    rotor.position_rad =
        assembly.parts().sequence->primitives[0].joints[i].position.control_points()[0] + 0.05F;
    rotors.push_back(rotor);
  }
  RotorPlant plant(bus, rotors);
  VirtualClock clock([&plant](std::int64_t time_ns) { plant.AdvanceTo(time_ns); });

  const testing::TemporaryFolder folder;
  FlightRecorderConfig config;
  config.file = folder / "run.rec";
  config.configuration = EncodeConfiguration(configuration);
  FlightRecorder recorder(config);
  TickFeed feed({&recorder});
  RunProcedure procedure(configuration.procedure);
  OperatorMailbox mailbox;
  ControlLoop loop({assembly.executor(), host, clock, procedure, mailbox, &feed},
                   configuration.period_ns, 0);
  while (loop.Step()) recorder.Drain();
  recorder.Stop("completed");
  ASSERT_EQ(procedure.outcome(), RunOutcome::kCompleted)
      << Describe(loop.record().first_fault, configuration.joints);
  const LoopStatistics& statistics = loop.statistics();
  EXPECT_EQ(statistics.frames_sent, kMaxJoints * statistics.ticks);
  EXPECT_GT(statistics.run_ticks, 100);
  for (std::size_t i = 0; i < kMaxJoints; ++i) {
    EXPECT_GT(statistics.following_error_max_rad[i], 0) << i;
    EXPECT_LT(statistics.following_error_max_rad[i], 0.2F) << i;
  }
  EXPECT_EQ(host.statistics().rejected_transmit, 0);

  const std::string bytes = testing::ReadFile(config.file);
  FlightRecord record({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()},
                      "run.rec");
  EXPECT_EQ(record.configuration().joints, configuration.joints);
  const ReplayResult replayed = Replay(record);
  EXPECT_TRUE(replayed.identical()) << replayed.gap;
  EXPECT_EQ(replayed.ticks, statistics.ticks);
  EXPECT_EQ(replayed.frames_out, statistics.frames_sent);
  EXPECT_EQ(replayed.frames_in, statistics.frames_received);
}

TEST(ManyJoints, MoreThanThisBuildTakesAreRefusedWithTheAllowedRange) {
  const std::string allowed =
      fmt::format("has {} entries; allowed: from 1 ... {}", kMaxJoints + 1, kMaxJoints);
  EXPECT_EQ(ParsePrimitive(Motion(kMaxJoints), "motion.toml").primitive.joint_count, kMaxJoints);
  EXPECT_THAT([] { ParsePrimitive(Motion(kMaxJoints + 1), "motion.toml"); },
              ::testing::ThrowsMessage<FileError>(HasSubstr("joint: " + allowed)));
  EXPECT_THAT([] { ParseDrives(Drives(kMaxJoints + 1, 100), "drives.toml"); },
              ::testing::ThrowsMessage<FileError>(HasSubstr("drive: " + allowed)));
}

TEST(ManyJoints, ARateThatTheirBusDoesNotBearIsRefusedWithTheOneThatItDoes) {
  const auto refusal = [](int drives, double rate_hz) -> std::string {
    try {
      CheckSchedule(ParseDrives(Drives(drives, rate_hz), "drives.toml"),
                    [](const std::string& /*sentence*/) {});
      return "none";
    } catch (const Refused& refused) {
      return refused.what();
    }
  };
  for (const auto& [drives, most_hz] : {std::pair{2, 1416}, std::pair{4, 1416 * 706 / 1246},
                                        std::pair{8, 429}, std::pair{12, 293}}) {
    if (drives > kMaxJoints) continue;
    EXPECT_EQ(refusal(drives, most_hz), "none");
    EXPECT_THAT(refusal(drives, most_hz + 1),
                HasSubstr(fmt::format("lower rate_hz to at most {}", most_hz)));
    EXPECT_NEAR(HighestRate(drives), most_hz, 1);
  }
  if (kMaxJoints < 12) return;
  EXPECT_THAT([] { ParseDrives(Drives(12, 400), "drives.toml"); },
              ::testing::ThrowsMessage<FileError>(HasSubstr("allow at most 308 Hz")));
}

TEST(ManyJoints, AnInterfaceWhoseQueueIsShorterThanATickIsRefusedWithTheCommandThatMendsIt) {
  CanLink link;
  link.has_queue = true;
  link.queue_frames_max = kMaxJoints - 1;
  const DrivesConfig drives = ParseDrives(Drives(kMaxJoints, 100), "drives.toml");
  EXPECT_THAT([&] { CheckQueue("can0", link, drives); },
              ::testing::ThrowsMessage<Refused>(HasSubstr(
                  fmt::format("ip link set can0 txqueuelen {}", std::max(10, kMaxJoints)))));
  link.queue_frames_max = kMaxJoints;
  EXPECT_NO_THROW(CheckQueue("can0", link, drives));
  link.queue_frames_max = 1;
  link.has_queue = false;  // as vcan
  EXPECT_NO_THROW(CheckQueue("can0", link, drives));
}

}  // namespace
}  // namespace tumbler
