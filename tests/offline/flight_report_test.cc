// The report of runs, compared with the flight records themselves, the simulated robot's own log
// and the primitives; and the program as a user meets it.

#include "offline/pages/flight_report.h"

#include <fmt/format.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/record/flight_record.h"
#include "tests/offline/sample_runs.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::Outcome;
using testing::ReadFile;
using testing::RunInShell;

const std::string kHandstand = testing::SourcePath("primitives/nominal/handstand.toml");
const std::string kGait = testing::SourcePath("primitives/nominal/gait.toml");

/// Flight records of the simulated robot, made once for all tests of this process.
struct Records {
  Records() {
    const auto simulate = [](const std::string& arguments, int exit_code) {
      const Outcome outcome = RunInShell("tumbler run sim " + arguments);
      EXPECT_EQ(outcome.exit_code, exit_code) << outcome.text;
    };
    simulate(std::string(kHandstand) + " --hold-s 0.1 --record " + handstand + " --truth " + truth,
             0);
    simulate(std::string(kGait) + " --cycles 1 --branch roll --record " + gait, 0);
    std::ofstream(weak_twin) << "format = \"tumbler-twin\"\nversion = 1\n"
                                "[motor]\ntorque_max_nm = 2.0\n";
    simulate(std::string(kHandstand) + " --record " + weak + " --twin " + weak_twin, 3);
  }
  testing::TemporaryFolder folder;
  std::string handstand = folder / "handstand.rec";
  std::string truth = folder / "handstand.lcm";
  std::string gait = folder / "gait.rec";
  std::string weak = folder / "weak.rec";
  std::string weak_twin = folder / "weak.toml";
};

const Records& Recorded() {
  static const Records records;
  return records;
}

std::vector<TickEntry> EntriesOf(const std::string& path) {
  const std::string bytes = ReadFile(path);
  FlightRecord record(testing::AsBytes(bytes), path);
  std::vector<TickEntry> entries;
  const auto entry = std::make_unique<TickEntry>();
  while (record.Next(*entry)) entries.push_back(*entry);
  return entries;
}

std::vector<std::string> TextsOf(const RunData& run, RunEvent::Kind kind) {
  std::vector<std::string> texts;
  for (const RunEvent& event : run.events) {
    if (event.kind == kind) texts.push_back(event.text);
  }
  return texts;
}

TEST(FlightReport, EveryNumberOfAShownTickIsTheRecordsBitForBit) {
  const std::vector<TickEntry> entries = EntriesOf(Recorded().handstand);
  const auto running = std::find_if(entries.begin(), entries.end(), [](const TickEntry& entry) {
    return entry.record.state == ExecutorState::kRunning;
  });
  ASSERT_NE(running, entries.end());
  std::map<double, const TickEntry*> by_time;
  for (const TickEntry& entry : entries) {
    by_time[static_cast<double>(entry.notes.deadline_ns - running->notes.deadline_ns) / 1e9] =
        &entry;
  }

  const Json json = FlightReportJson({ReadRun(Recorded().handstand, "")}, {.ticks_max = 200'000});
  // The page, too, reads the numbers from text.
  const Json ticks = Json::Parse(json.Dump(-1)).value()["runs"][0]["ticks"];
  ASSERT_EQ(ticks["times_s"].size(), entries.size());
  int compared = 0;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const TickEntry& entry = *by_time.at(ticks["times_s"][i].number());
    EXPECT_EQ(ticks["states"][i], ToString(entry.record.state));
    for (std::size_t j = 0; j < 2; ++j) {
      const JointRecord& joint = entry.record.joints[j];
      const Json& shown = ticks["joints"][j];
      const auto same = [&](const char* kind, const char* quantity, float value, bool there) {
        const Json& number = shown[kind][quantity][i];
        ++compared;
        if (!there) return number.is_null();
        return std::bit_cast<std::uint32_t>(static_cast<float>(number.number())) ==
               std::bit_cast<std::uint32_t>(value);
      };
      const bool on = entry.record.state != ExecutorState::kDisarmed;
      EXPECT_TRUE(same("plan", "position_rad", joint.planned.position_rad, on));
      EXPECT_TRUE(same("plan", "velocity_rad_s", joint.planned.velocity_rad_s, on));
      EXPECT_TRUE(same("plan", "torque_nm", joint.planned.torque_nm, on));
      EXPECT_TRUE(same("command", "position_rad", joint.encoded.position_rad, on));
      EXPECT_TRUE(same("command", "velocity_rad_s", joint.encoded.velocity_rad_s, on));
      EXPECT_TRUE(same("command", "torque_nm", joint.encoded.torque_nm, on));
      const bool replied = joint.reply_age_ticks >= 0;
      EXPECT_TRUE(same("measured", "position_rad", joint.measured.position_rad, replied));
      EXPECT_TRUE(same("measured", "velocity_rad_s", joint.measured.velocity_rad_s, replied));
      EXPECT_TRUE(same("measured", "torque_nm", joint.measured.torque_nm, replied));
      EXPECT_EQ(shown["reply_age_ticks"][i].is_null(), !replied);
    }
    if (::testing::Test::HasFailure()) break;
  }
  EXPECT_GT(compared, 10'000);
}

TEST(FlightReport, TheFollowingErrorIsWhatWasMeasuredLessTheSetpointItAnswers) {
  const std::vector<TickEntry> entries = EntriesOf(Recorded().handstand);
  const RunData run = ReadRun(Recorded().handstand, "");
  int compared = 0;
  for (std::size_t i = 1; i < entries.size(); ++i) {
    if (entries[i].record.state != ExecutorState::kRunning) {
      if (entries[i].record.state == ExecutorState::kDisarmed) {
        EXPECT_FALSE(run.FollowingError(i, 0));
      }
      continue;
    }
    for (std::size_t j = 0; j < 2; ++j) {
      ASSERT_EQ(entries[i].record.joints[j].reply_age_ticks, 0);
      ASSERT_TRUE(run.FollowingError(i, j));
      EXPECT_DOUBLE_EQ(*run.FollowingError(i, j),
                       double{entries[i].record.joints[j].measured.position_rad} -
                           double{entries[i - 1].record.joints[j].limited.position_rad});
      ++compared;
    }
  }
  EXPECT_GT(compared, 1000);
}

TEST(FlightReport, TheTruthInTheRecordIsThatOfTheSimulatedRobotsOwnLog) {
  const RunData recorded = ReadRun(Recorded().handstand, "");
  const RunData logged = ReadRun(Recorded().handstand, Recorded().truth);
  ASSERT_GT(recorded.truth.size(), 250U);
  ASSERT_EQ(recorded.truth.size(), logged.truth.size());
  for (std::size_t i = 0; i < logged.truth.size(); ++i) {
    // The log keeps its times in microseconds.
    EXPECT_NEAR(recorded.truth[i].time_s, logged.truth[i].time_s, 1e-6);
    EXPECT_EQ(recorded.truth[i].link_poses, logged.truth[i].link_poses);
    EXPECT_EQ(recorded.truth[i].joint_torques_nm, logged.truth[i].joint_torques_nm);
  }
}

TEST(FlightReport, TheTruthIsWhatTheDrivesMeasuredToTheirResolutionAndOneTick) {
  const RunData run = ReadRun(Recorded().gait, "");
  ASSERT_GT(run.truth.size(), 2500U);
  std::size_t i = 0;
  double apart = 0;
  for (const ReportSample& truth : run.truth) {
    while (i + 1 < run.ticks.size() && run.ticks[i].time_s < truth.time_s) ++i;
    for (std::size_t j = 0; j < 2; ++j) {
      if (run.joint(i, j).reply_age_ticks != 0) continue;
      apart = std::max(apart, std::abs(double{run.joint(i, j).measured.position_rad} -
                                       truth.joint_positions_rad[j]));
    }
  }
  // Joints move at up to 13 rad/s, and a measurement is up to a tick old.
  EXPECT_LT(apart, 0.014);
  EXPECT_GT(apart, 0);
}

TEST(FlightReport, LinksAreWhereTheRobotsGeometryPutsThem) {
  const RunData run = ReadRun(Recorded().handstand, "");
  ASSERT_EQ(run.scene.links.size(), 3U);
  for (const auto* samples : {&run.truth, &run.plan}) {
    for (const ReportSample& sample : *samples) {
      const auto [x, z, pitch] = sample.link_poses[0];
      EXPECT_NEAR(pitch, sample.root_pitch_rad, 1e-12);
      for (std::size_t j = 0; j < 2; ++j) {
        const double side = j == 0 ? 0.15 : -0.15;  // The hinges are 0.30 m apart.
        EXPECT_NEAR(sample.link_poses[j + 1][0], x + side * std::cos(pitch), 1e-3);
        EXPECT_NEAR(sample.link_poses[j + 1][1], z + side * std::sin(pitch), 1e-3);
      }
      EXPECT_NEAR(sample.link_poses[1][2], pitch + sample.joint_positions_rad[0], 1e-6);
    }
  }
}

TEST(FlightReport, ThePlannedRobotGoesFromEntryToExitAndOnFromThere) {
  const RunData run = ReadRun(Recorded().gait, "");
  const PrimitiveFile handstand = LoadPrimitive(kHandstand);
  ASSERT_EQ(run.bands.size(), 4U);
  EXPECT_EQ(run.bands[0].name, "handstand");
  EXPECT_DOUBLE_EQ(run.bands[0].from_s, 0);
  const auto at = [&run](double t) -> const ReportSample& {
    return *std::find_if(run.plan.begin(), run.plan.end(),
                         [t](const ReportSample& sample) { return sample.time_s >= t; });
  };
  EXPECT_NEAR(at(0).root_pitch_rad, handstand.entry.root_pitch_rad, 1e-6);
  EXPECT_NEAR(at(0).link_poses[0][1], handstand.entry.root_z_m, 1e-6);
  const double after = handstand.primitive.duration_s + 2;
  EXPECT_NEAR(at(after).root_pitch_rad, handstand.exit.root_pitch_rad, 1e-3);
  EXPECT_NEAR(at(after).link_poses[0][0], handstand.exit.root_x_m, 1e-3);
  for (std::size_t i = 1; i < run.plan.size(); ++i) {  // Nothing jumps, not even between nodes.
    const double dt = run.plan[i].time_s - run.plan[i - 1].time_s;
    EXPECT_LT(std::abs(run.plan[i].link_poses[0][0] - run.plan[i - 1].link_poses[0][0]),
              3 * dt + 1e-3);
    EXPECT_LT(std::abs(run.plan[i].root_pitch_rad - run.plan[i - 1].root_pitch_rad),
              15 * dt + 0.02);
  }
  // Handstand, downstand, handstand and a roll make three quarter turns and three more.
  EXPECT_NEAR(run.plan.back().root_pitch_rad, 3 * std::numbers::pi, 0.03);
  EXPECT_NEAR(run.truth.back().root_pitch_rad, 3 * std::numbers::pi, 0.03);
}

TEST(FlightReport, ThePlannedJointsOfTheRobotAreThoseOfTheRecord) {
  const RunData run = ReadRun(Recorded().gait, "");  // The gait exchanges roles on its way.
  std::size_t i = 0;
  int compared = 0;
  for (const ReportSample& plan : run.plan) {
    while (run.ticks[i].time_s < plan.time_s) ++i;
    if (run.ticks[i].state != ExecutorState::kRunning) continue;
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_NEAR(plan.joint_positions_rad[j], double{run.joint(i, j).planned.position_rad}, 1e-3);
      ++compared;
    }
  }
  EXPECT_GT(compared, 1000);
}

TEST(FlightReport, RequestsAndStatesAreEventsInTheOrderOfTheRun) {
  const RunData run = ReadRun(Recorded().gait, "");
  const std::vector<std::string> states = TextsOf(run, RunEvent::Kind::kState);
  ASSERT_GE(states.size(), 8U);
  EXPECT_EQ(states.front(), "disarmed");
  const auto first = std::find(states.begin(), states.end(), "running: handstand");
  ASSERT_NE(first, states.end());
  EXPECT_EQ(*(first + 1), "settling: handstand");
  EXPECT_EQ(*(first + 2), "running: downstand");
  EXPECT_THAT(TextsOf(run, RunEvent::Kind::kRequest),
              ::testing::IsSupersetOf({"arm", "move to start", "run", "disarm"}));
  EXPECT_THAT(TextsOf(run, RunEvent::Kind::kTruth), Contains("the robot rests as after handstand"));
  EXPECT_THAT(TextsOf(run, RunEvent::Kind::kFault), IsEmpty());
  EXPECT_TRUE(std::is_sorted(run.events.begin(), run.events.end(),
                             [](const auto& a, const auto& b) { return a.time_s < b.time_s; }));
}

TEST(FlightReport, AFaultIsAnEventAtItsTickAndEndsTheNode) {
  const std::vector<TickEntry> entries = EntriesOf(Recorded().weak);
  const RunData run = ReadRun(Recorded().weak, "");
  const auto fault = std::find_if(entries.begin(), entries.end(), [](const TickEntry& entry) {
    return entry.record.first_fault.fault != Fault::kNone;
  });
  ASSERT_NE(fault, entries.end());
  const auto event = std::find_if(run.events.begin(), run.events.end(), [](const RunEvent& e) {
    return e.kind == RunEvent::Kind::kFault;
  });
  ASSERT_NE(event, run.events.end());
  EXPECT_THAT(event->text, HasSubstr("following error of joint leg2"));
  const auto index = static_cast<std::size_t>(fault - entries.begin());
  EXPECT_DOUBLE_EQ(event->time_s, run.ticks[index].time_s);
  ASSERT_EQ(run.bands.size(), 1U);
  EXPECT_DOUBLE_EQ(run.bands[0].to_s, run.ticks[index].time_s);
  EXPECT_THAT(TextsOf(run, RunEvent::Kind::kState), Contains("fault: damp"));
  EXPECT_THAT(TextsOf(run, RunEvent::Kind::kTruth), Contains("the robot has fallen"));
  // From then on the motors only resist motion, so that there is no position to follow.
  EXPECT_FALSE(run.FollowingError(index + 5, 1));
}

TEST(FlightReport, DifferencesAreTheLargestOfAllCommonTicks) {
  const RunData a = ReadRun(Recorded().handstand, "");
  const RunData b = ReadRun(Recorded().weak, "");
  for (const RunDifference& difference : Compare(a, a)) {
    EXPECT_EQ(difference.max, 0) << difference.quantity;
    EXPECT_GT(difference.ticks, 1000);
  }
  std::map<std::int64_t, double> position_of_a;  // by nanoseconds since the motion began
  for (std::size_t i = 0; i < a.ticks.size(); ++i) {
    position_of_a[std::llround(a.ticks[i].time_s * 1e9)] =
        double{a.joint(i, 1).measured.position_rad};
  }
  double max = 0, at_s = 0;
  std::int64_t ticks = 0;
  for (std::size_t i = 0; i < b.ticks.size(); ++i) {
    const auto found = position_of_a.find(std::llround(b.ticks[i].time_s * 1e9));
    if (b.ticks[i].time_s < 0 || found == position_of_a.end()) continue;
    ++ticks;
    const double apart = std::abs(double{b.joint(i, 1).measured.position_rad} - found->second);
    if (apart > max) {
      max = apart;
      at_s = b.ticks[i].time_s;
    }
  }
  const std::vector<RunDifference> differences = Compare(a, b);
  const auto found = std::find_if(differences.begin(), differences.end(), [](const auto& d) {
    return d.joint == "leg2" && d.quantity == "measured position";
  });
  ASSERT_NE(found, differences.end());
  EXPECT_EQ(found->ticks, ticks);
  EXPECT_GT(found->max, 0.3);
  EXPECT_DOUBLE_EQ(found->max, max);
  EXPECT_DOUBLE_EQ(found->max_at_s, at_s);
}

TEST(FlightReport, RunsOfOtherRatesAreNotComparedTickByTick) {
  RunData other = SampleRun();
  other.period_s = 0.02;
  EXPECT_THAT(Compare(SampleRun(), other), IsEmpty());
}

TEST(FlightReport, LatenciesCountEveryTickAndFrame) {
  const std::vector<TickEntry> entries = EntriesOf(Recorded().handstand);
  const RunData run = ReadRun(Recorded().handstand, "");
  std::size_t frames = 0;
  std::vector<std::int64_t> ages;
  for (const TickEntry& entry : entries) {
    frames += entry.received_count;
    for (const ReceivedFrame& received : entry.input().received) {
      ages.push_back(entry.notes.awake_ns - received.time_ns);
    }
  }
  std::sort(ages.begin(), ages.end());
  ASSERT_EQ(run.latencies.size(), 4U);
  EXPECT_EQ(run.latencies[0].values_ns.size(), entries.size());
  EXPECT_THAT(run.latencies[0].values_ns, Each(0)) << "virtual time is never late";
  EXPECT_EQ(run.latencies[3].values_ns, ages);
  // Each of two drives answers each setpoint within the tick.
  EXPECT_EQ(run.latencies[2].values_ns.size(), frames);
  EXPECT_GT(run.latencies[2].values_ns.front(), 100'000) << "a setpoint takes longer on the bus";
  EXPECT_LT(run.latencies[2].values_ns.back(), 1'000'000);
  EXPECT_EQ(run.latencies[3].PercentileNs(1), ages.back());
  EXPECT_EQ(run.latencies[3].PercentileNs(0.5), ages[(ages.size() + 1) / 2 - 1]);
}

TEST(FlightReport, WhatTheOperatorAskedIsAnEventAndLatenciesAreThoseThatTheLoopCounts) {
  // The recorded handstand gets other notes of the loop: a request from its 500th tick on, and
  // other times in every tick.
  const std::string bytes = ReadFile(Recorded().handstand);
  RecordBytes changed;
  AppendRecordHeader(changed);
  BlockReader reader(testing::AsBytes(bytes));
  int ticks = 0;
  for (Block block; reader.Next(block);) {
    RecordBytes content(block.content.begin(), block.content.end());
    const auto entry = std::make_unique<TickEntry>();
    if (block.kind == BlockKind::kTick && DecodeTick(block.content, *entry)) {
      entry->notes.due_ns = entry->notes.deadline_ns - 300'000;
      entry->notes.awake_ns = entry->notes.deadline_ns;
      entry->notes.done_ns = entry->notes.awake_ns + 70'000;
      if (ticks++ >= 500) {
        entry->notes.request_id = 7;
        entry->notes.request = static_cast<std::uint8_t>(OperatorRequest::kBranch);
        entry->notes.request_refusal = Refusal::kNoSuchBranch;
      }
      content.resize(kTickEntryBytesMax);
      content.resize(EncodeTick(entry->index, entry->notes, entry->input(),
                                {entry->frames, entry->record}, content));
    }
    if (block.kind != BlockKind::kEnd) AppendBlock(block.kind, block.number, content, changed);
  }
  const testing::TemporaryFolder folder;
  const std::string path = folder / "changed.rec";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(changed.data()),
             static_cast<std::streamsize>(changed.size()));
  const RunData run = ReadRun(path, "");
  const auto asked = std::count_if(run.events.begin(), run.events.end(), [&run](const auto& e) {
    return e.text ==
               std::string("operator: branch, refused: ") + ToString(Refusal::kNoSuchBranch) &&
           e.time_s == run.ticks[500].time_s;
  });
  EXPECT_EQ(asked, 1);
  EXPECT_THAT(run.latencies[0].values_ns, Each(300'000));
  EXPECT_THAT(run.latencies[1].values_ns, Each(70'000));
}

TEST(FlightReport, APrimitiveAloneIsItsSplinesAndNothingElse) {
  const PrimitiveFile file = LoadPrimitive(kHandstand);
  const RunData plan = ReadPlan(kHandstand);
  EXPECT_FALSE(plan.recorded);
  EXPECT_THAT(plan.ticks, IsEmpty());
  EXPECT_THAT(plan.truth, IsEmpty());
  ASSERT_GT(plan.plan.size(), 200U);
  for (const ReportSample& sample : plan.plan) {
    if (sample.time_s > file.primitive.duration_s) break;
    for (std::size_t j = 0; j < 2; ++j) {
      const auto position = file.primitive.joints[j].position.Evaluate(sample.time_s);
      EXPECT_DOUBLE_EQ(sample.joint_positions_rad[j], position.value);
      EXPECT_DOUBLE_EQ(sample.joint_velocities_rad_s[j], position.first);
    }
  }
  EXPECT_NEAR(plan.plan.back().root_pitch_rad, file.exit.root_pitch_rad, 1e-3);
  const Json json = FlightReportJson({plan});
  EXPECT_TRUE(json["runs"][0]["ticks"].is_null());
  EXPECT_TRUE(json["runs"][0]["truth"].is_null());
}

TEST(FlightReport, OfALongRunTheTicksThatStandOutAreShown) {
  const RunData run = ReadRun(Recorded().gait, "");
  const Json ticks = FlightReportJson({run}, {.ticks_max = 100})["runs"][0]["ticks"];
  EXPECT_LT(ticks["times_s"].size(), 600U);
  std::vector<double> times;
  for (const Json& time_s : ticks["times_s"].elements()) times.push_back(time_s.number());
  EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
  for (std::size_t j = 0; j < 2; ++j) {
    double largest = 0, largest_s = 0;
    for (std::size_t i = 0; i < run.ticks.size(); ++i) {
      const double error = std::abs(run.FollowingError(i, j).value_or(0));
      if (error > largest) {
        largest = error;
        largest_s = run.ticks[i].time_s;
      }
    }
    EXPECT_THAT(times, Contains(largest_s));
  }
  for (std::size_t i = 1; i < run.ticks.size(); ++i) {
    if (run.ticks[i].state == run.ticks[i - 1].state) continue;
    EXPECT_THAT(times, Contains(run.ticks[i].time_s));
  }
}

TEST(FlightReport, OfAPartEveryTickIsShownAndNothingElse) {
  const RunData run = ReadRun(Recorded().gait, "");
  FlightReportOptions options;
  options.from_s = 0.5;
  options.to_s = 1.5;
  const Json shown = FlightReportJson({run}, options)["runs"][0];
  EXPECT_EQ(shown["ticks"]["times_s"].size(), 1001U);
  EXPECT_DOUBLE_EQ(shown["ticks"]["times_s"].elements().front().number(), 0.5);
  EXPECT_DOUBLE_EQ(shown["ticks"]["times_s"].elements().back().number(), 1.5);
  EXPECT_EQ(shown["bands"].size(), 1U);
  for (const Json& event : shown["events"].elements()) {
    EXPECT_TRUE(options.Shows(event["time_s"].number())) << event;
  }
  EXPECT_GE(shown["truth"]["times_s"].elements().front().number(), 0.5);
  EXPECT_LE(shown["truth"]["times_s"].elements().back().number(), 1.5);
}

TEST(FlightReport, RunsOfDifferentRobotsAreRefused) {
  RunData other = SampleRun();
  other.name = "other.rec";
  other.robot_hash = "fnv1a64:1";
  try {
    FlightReportJson({SampleRun(), other});
    FAIL() << "no error";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("other.rec: is of another robot"));
  }
}

class ReportProgram : public ::testing::Test {
 protected:
  [[nodiscard]] Outcome Report(const std::string& arguments) const {
    return RunInShell("tumbler view " + arguments + " --out " + out_);
  }
  /// Expects a refusal with this in its message, and nothing written.
  void ExpectRefused(const std::string& arguments, const std::string& part) const {
    const Outcome outcome = Report(arguments);
    EXPECT_EQ(outcome.exit_code, 1) << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr(part));
    EXPECT_FALSE(std::filesystem::exists(out_));
  }
  testing::TemporaryFolder folder_;
  std::string out_ = folder_ / "page";
};

TEST_F(ReportProgram, WritesOnePageOfRecordsAndPrimitives) {
  const Outcome outcome = Report(Recorded().handstand + " " + Recorded().weak + " " + kHandstand);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("fault at"));
  EXPECT_THAT(outcome.text, HasSubstr("leg2, measured position: at most"));
  const std::string page = ReadFile(out_ + "/index.html");
  EXPECT_THAT(page, HasSubstr("<title>" + Recorded().handstand));
  EXPECT_THAT(page, Not(HasSubstr("{{")));
  EXPECT_THAT(page, Not(HasSubstr("src=\"http")));
  // The same files give the same page.
  EXPECT_EQ(Report(Recorded().handstand + " " + Recorded().weak + " " + kHandstand).exit_code, 0);
  EXPECT_EQ(ReadFile(out_ + "/index.html"), page);
}

TEST_F(ReportProgram, WritesAPageOfTheNameThatItIsGiven) {
  ASSERT_EQ(Report(Recorded().handstand).exit_code, 0);
  const std::string named = folder_ / "new/run.html";
  const Outcome outcome = RunInShell("tumbler view " + Recorded().handstand + " --out " + named);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("wrote " + named));
  EXPECT_EQ(ReadFile(named), ReadFile(out_ + "/index.html"));
}

TEST_F(ReportProgram, WantsOneRecordInABrowserAndTakesOptionsOfThePageOnlyWithOne) {
  const std::string& record = Recorded().handstand;
  for (const std::string& arguments :
       {fmt::format("{0} {0}", record), record + " --from-s 1",
        fmt::format("{} --truth {}", record, Recorded().truth),
        std::string("--lcm-url 'udpm://239.255.76.67:7667?ttl=0' --out ") + out_, std::string()}) {
    EXPECT_EQ(RunInShell(fmt::format("tumbler view {}", arguments)).exit_code, 1) << arguments;
  }
}

TEST_F(ReportProgram, ARecordThatWasCutOffIsShownUpToThere) {
  const std::string cut = folder_ / "cut.rec";
  const std::string whole = ReadFile(Recorded().handstand);
  std::ofstream(cut, std::ios::binary) << whole.substr(0, whole.size() / 2);
  const Outcome outcome = Report(cut);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("the recording was interrupted"));
  EXPECT_THAT(outcome.text, HasSubstr("cut off: after byte"));
}

TEST_F(ReportProgram, NamesFileAndReasonAndWritesNothing) {
  const std::string empty = folder_ / "empty.rec";
  std::ofstream(empty).flush();
  const std::string head = folder_ / "head.rec";
  std::ofstream(head, std::ios::binary) << ReadFile(Recorded().handstand).substr(0, 500);
  const std::string& record = Recorded().handstand;
  ExpectRefused("/nowhere/run.rec", "/nowhere/run.rec: cannot be read: No such file");
  ExpectRefused(empty, empty);
  ExpectRefused(head, head + ": is cut off within its configuration");
  ExpectRefused(kGait, "gait.toml: is a sequence");
  ExpectRefused(record + " --truth /nowhere.lcm", "/nowhere.lcm: cannot be read");
  ExpectRefused(record + " --truth " + record, "is no LCM log");
  ExpectRefused(std::string(kHandstand) + " --truth " + Recorded().truth,
                "--truth is given 1 times, for 0 records");
  ExpectRefused(Recorded().weak + " --truth " + Recorded().truth,
                Recorded().truth + ": is of another run than " + Recorded().weak);
  ExpectRefused(record + " --ticks 3", "--ticks");
  ExpectRefused(record + " --from-s 2 --to-s 1", "--from-s: is 2, must be before --to-s, 1");
  ExpectRefused(record + " --from-s 500", record + ": has 0 ticks from 500 s");
  ExpectRefused("", "RECORD|PRIMITIVE");
}

TEST_F(ReportProgram, SaysWhenThePageCannotBeWritten) {
  std::ofstream(out_) << "a file, not a folder";
  const Outcome outcome = Report(Recorded().handstand);
  EXPECT_EQ(outcome.exit_code, 1) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr(out_ + "/index.html: cannot be written: "));
  EXPECT_EQ(ReadFile(out_), "a file, not a folder");
}

}  // namespace
}  // namespace tumbler
