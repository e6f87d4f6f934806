#include "runtime/record/run_trace.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "firmware_interface/devices/logged_position.h"
#include "runtime/record/record_export.h"
#include "runtime/record/trace_drawing.h"
#include "runtime/record/tracking.h"
#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

using testing::AsBytes;
using ::testing::HasSubstr;

RunTrace SmallTrace(const std::string& bytes) {
  FlightRecord record(AsBytes(bytes), "run.rec");
  return TraceOf(record, DefaultDrives({"joint1", "joint2"}));
}

std::vector<TraceSample> Samples(const std::vector<double>& errors) {
  std::vector<TraceSample> samples;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const double setpoint = 0.5 * static_cast<double>(i);
    samples.push_back({static_cast<std::int64_t>(i), 0.001 * static_cast<double>(i), setpoint,
                       setpoint + errors[i], 0.0001 * static_cast<double>(i + 1)});
  }
  return samples;
}

TEST(RunTrace, FiguresAreThoseOfTheSamples) {
  std::vector<TraceSample> samples = Samples({0.3, -0.4, 0, 0});
  TrackingFigures figures = FiguresOf(samples);
  EXPECT_EQ(figures.setpoints, 4);
  EXPECT_EQ(figures.missing_replies, 0);
  EXPECT_NEAR(figures.error_rms_rad, 0.25, 1e-12);
  EXPECT_NEAR(figures.error_max_rad, 0.4, 1e-12);
  EXPECT_NEAR(figures.delay_p50_s, 0.0002, 1e-12);
  EXPECT_NEAR(figures.delay_max_s, 0.0004, 1e-12);
  samples[1].reply_rad.reset();
  samples[1].delay_s.reset();
  samples[3].reply_rad.reset();  // The last setpoint need not have a reply yet.
  figures = FiguresOf(samples);
  EXPECT_EQ(figures.missing_replies, 1);
  EXPECT_NEAR(figures.error_max_rad, 0.3, 1e-12);
}

TEST(RunTrace, ComparesTheSameTicks) {
  const std::vector<TraceSample> a = Samples({0, 0, 0, 0});
  std::vector<TraceSample> b = Samples({0.3, 0.3, -0.1, 0.3});
  b.erase(b.begin() + 1);  // This run missed a tick.
  b[2].setpoint_rad += 0.01;
  b[2].reply_rad.reset();
  const TraceComparison comparison = Compare(a, b);
  EXPECT_EQ(comparison.ticks, 3);
  EXPECT_EQ(comparison.different_setpoints, 1);
  EXPECT_NEAR(comparison.setpoint_max_rad, 0.01, 1e-12);
  EXPECT_EQ(comparison.replies, 2);
  EXPECT_NEAR(comparison.reply_max_rad, 0.3, 1e-12);
  EXPECT_NEAR(comparison.reply_rms_rad, std::sqrt(0.1 / 2), 1e-12);
}

TEST(RunTrace, OfARecordFollowsTheMotionAndItsReplies) {
  const RecordConfiguration configuration = testing::SmallConfiguration();
  const RunTrace trace = SmallTrace(testing::RecordedBytes(configuration));
  const Assembly assembly = Assemble(configuration);
  ASSERT_EQ(trace.samples.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const auto& spline = assembly.parts().sequence->primitives[0].joints[i].position;
    const std::vector<TraceSample>& samples = trace.samples[i];
    // There are 56 ticks of motion at speed 0.9, 10 of settling, 11 of holding, and those between.
    EXPECT_NEAR(static_cast<double>(samples.size()), 78, 3);
    EXPECT_EQ(samples[0].tick, 0);
    for (std::size_t k = 0; k < 50; ++k) {
      const auto expected = spline.Evaluate(0.9F * 0.001F * static_cast<float>(k));
      EXPECT_NEAR(samples[k].setpoint_rad, expected.value, 1e-4);
    }
    // The drives here are at their setpoints at once, so that only rounding is left.
    const TrackingFigures figures = FiguresOf(samples);
    EXPECT_EQ(figures.missing_replies, 0);
    EXPECT_LT(figures.error_max_rad, 6e-4);
    EXPECT_GT(figures.error_max_rad, 0);
    EXPECT_NEAR(figures.delay_p50_s, 0.0003 - 20e-9 + 0.0001 * static_cast<double>(i), 1e-9);
  }
  const TraceComparison same = Compare(trace.samples[0], trace.samples[0]);
  EXPECT_EQ(same.different_setpoints, 0);
  EXPECT_EQ(same.reply_max_rad, 0);
}

TEST(RunTrace, OfTheFramesAloneSaysTheSame) {
  const std::string bytes = testing::RecordedBytes(testing::SmallConfiguration());
  const RunTrace of_record = SmallTrace(bytes);
  const testing::TemporaryFolder folder;
  FlightRecord record(AsBytes(bytes), "run.rec");
  ExportCandump(record, folder / "run.log");
  std::int64_t skipped = 0;
  const auto frames = ParseCandump(testing::ReadFile(folder / "run.log"), "run.log", skipped);
  const RunTrace of_frames = TraceOf(frames, DefaultDrives({"joint1", "joint2"}), "run.log");
  for (std::size_t i = 0; i < 2; ++i) {
    // The log also has the way to the start, so the ends are compared.
    const auto& a = of_record.samples[i];
    const auto& b = of_frames.samples[i];
    ASSERT_GT(b.size(), a.size());
    for (std::size_t k = 1; k <= 70; ++k) {
      const TraceSample& from_record = a[a.size() - k];
      const TraceSample& from_frames = b[b.size() - k];
      EXPECT_NEAR(from_frames.setpoint_rad, from_record.setpoint_rad, 2e-4)
          << "half a step of 16 bits";
      ASSERT_EQ(from_frames.reply_rad.has_value(), from_record.reply_rad.has_value());
      if (!from_frames.reply_rad) continue;
      EXPECT_NEAR(*from_frames.reply_rad, *from_record.reply_rad, 1e-6);
      EXPECT_NEAR(*from_frames.delay_s, *from_record.delay_s, 2e-6);
    }
  }
}

TEST(RunTrace, OfFramesOfOtherDrivesIsRefused) {
  CandumpFrame frame;
  frame.received.frame.id = 0x55;
  try {
    TraceOf({frame}, DefaultDrives({"knee"}), "run.log");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("run.log: has no setpoint for joint 'knee'"));
  }
}

TEST(RunTrace, DrawsEveryCurveAndNoPeakIsLost) {
  const testing::TemporaryFolder folder;
  std::vector<double> errors(10'000, 0.0);
  errors[3333] = 1;  // one tick of ten thousand, in a drawing of a thousand points
  RunTrace trace{"a & <b>", {"knee"}, {Samples(errors)}};
  WriteSvg(trace, &trace, folder / "out.svg");
  const std::string svg = testing::ReadFile(folder / "out.svg");
  EXPECT_THAT(svg, HasSubstr("a &amp; &lt;b>"));
  EXPECT_THAT(svg, HasSubstr("knee: reply less setpoint [rad]"));
  // The peak is at the upper padding of the lower panel.
  const double top = 50 + 220 + 50 + 220 * 0.05 / 1.1;
  EXPECT_THAT(svg, HasSubstr(" " + std::to_string(top).substr(0, 5)));
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_LT(svg.size(), 300'000U);
  EXPECT_THROW(WriteSvg(trace, nullptr, "/proc/absent/out.svg"), FileError);
}

TEST(LoggedPosition, IsThatOfTheProtocolAtTheJoint) {
  JointMap joint;
  joint.direction = -1;
  joint.gear_ratio = 2;
  joint.zero_offset_rad = 0.25F;
  const double joint_rad = 0.7;
  const float shaft_rad = joint.ToDrivePosition(static_cast<float>(joint_rad));

  MitConfig mit;
  mit.joint = joint;
  ImpedanceCommand command;
  command.position_rad = shaft_rad;
  command.kp_nm_per_rad = 10;
  EXPECT_NEAR(CommandedPosition(mit, EncodeMitCommand(mit, command)).value(), joint_rad, 1e-3);
  command.kp_nm_per_rad = 0;
  EXPECT_FALSE(CommandedPosition(mit, EncodeMitCommand(mit, command)));
  EXPECT_FALSE(CommandedPosition(mit, MitMagicFrame(mit, MitMagic::kEnter)));
  MitReply reply;
  reply.sender = 1;
  reply.position_rad = shaft_rad;
  EXPECT_NEAR(ReportedPosition(mit, EncodeMitReply(mit, reply)).value(), joint_rad, 1e-3);

  CanSimpleConfig cansimple;
  cansimple.node_id = 3;
  cansimple.joint = joint;
  const float turns = shaft_rad / 6.2831853F;
  EXPECT_NEAR(
      CommandedPosition(cansimple, EncodeCanSimple(3, CanSimpleInputPos{turns, 0, 0})).value(),
      joint_rad, 1e-6);
  EXPECT_NEAR(ReportedPosition(cansimple, EncodeCanSimple(3, CanSimpleEstimates{turns, 0})).value(),
              joint_rad, 1e-6);
  EXPECT_FALSE(ReportedPosition(cansimple, EncodeCanSimple(4, CanSimpleEstimates{turns, 0})));

  Cia402Config cia402;
  cia402.node_id = 5;
  cia402.joint = joint;
  const auto units = static_cast<std::int32_t>(std::lround(turns * 65536));
  EXPECT_NEAR(
      CommandedPosition(cia402, EncodeCia402(5, Cia402Command{cia402_control::kEnable, units}))
          .value(),
      joint_rad, 1e-4);
  EXPECT_FALSE(
      CommandedPosition(cia402, EncodeCia402(5, Cia402Command{cia402_control::kShutdown, units})));
  EXPECT_NEAR(ReportedPosition(cia402, EncodeCia402(5, Cia402Status{0, units})).value(), joint_rad,
              1e-4);
}

}  // namespace
}  // namespace tumbler
