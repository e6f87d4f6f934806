// The judge of the fault matrix notices what it is to notice, and the last gate keeps every limit
// on the wire.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "tests/support/fault_world.h"

namespace tumbler {
namespace {

using testing::ConfigOf;
using testing::DrivesOf;
using testing::EveryProtocol;
using testing::FaultBench;
using ::testing::IsEmpty;
using testing::LoggedFrame;
using testing::MakeTwoNodes;
using testing::TestedProtocol;
using testing::TwoNodes;

/// The frames of a good run. Tests spoil one, and the judge of the matrix must notice.
class Judge : public ::testing::TestWithParam<TestedProtocol> {
 protected:
  Judge() : bench_(ConfigOfBench()) {
    bench_.keep_log = true;
    EXPECT_TRUE(bench_.Reach(ExecutorState::kRunning));
    for (int i = 0; i < 20; ++i) bench_.Tick();
    for (std::size_t i = 0; i < bench_.log.size(); ++i) {
      if (bench_.log[i].frame.id == SetpointId()) at_ = i;
    }
    EXPECT_THAT(bench_.judge.report().violations, IsEmpty());
    at_ -= 40;  // so that it is not the last tick
    while (bench_.log[at_].frame.id != SetpointId()) --at_;
    log_ = bench_.log;
  }
  static FaultBench::Config ConfigOfBench() {
    const TwoNodes motion = MakeTwoNodes();
    FaultBench::Config config;
    config.drives = DrivesOf(GetParam());
    config.graph = motion.graph;
    config.primitives = motion.primitives;
    config.executor = ConfigOf({}, motion);
    return config;
  }
  [[nodiscard]] static const testing::ProtocolSide& Side() { return *GetParam().side; }
  [[nodiscard]] std::uint32_t SetpointId() const { return Side().SetpointId(bench_.DriveOf(1)); }
  [[nodiscard]] std::uint32_t TorqueId() const { return Side().TorqueId(bench_.DriveOf(1)); }
  std::string Violations() {
    const testing::FrameReport report = CheckFrames(log_, FaultBench::RulesOf(bench_.config()));
    std::string all;
    for (const std::string& violation : report.violations) all += violation + "\n";
    return all;
  }
  CanFrame& Setpoint() { return log_[at_].frame; }

  FaultBench bench_;
  std::vector<LoggedFrame> log_;
  std::size_t at_ = 0;  // the index of a setpoint of joint 1
};

TEST_P(Judge, FindsNothingInAGoodRun) { EXPECT_EQ(Violations(), ""); }

TEST_P(Judge, NoticesAStepInPosition) {
  Side().SpoilSetpoint(Setpoint());
  EXPECT_THAT(Violations(), ::testing::AnyOf(::testing::HasSubstr("joint 1: a step of"),
                                             ::testing::HasSubstr("joint 1: position")));
}

TEST_P(Judge, NoticesATickThatLeavesADriveOut) {
  const double time_s = log_[at_].time_s;
  std::erase_if(log_, [&](const LoggedFrame& logged) {
    return logged.time_s == time_s &&
           (logged.frame.id == SetpointId() || logged.frame.id == TorqueId());
  });
  EXPECT_THAT(Violations(), ::testing::AnyOf(::testing::HasSubstr("where joint 1 is due")));
}

TEST_P(Judge, NoticesASetpointAfterTorqueOff) {
  LoggedFrame off = log_[at_];
  off.time_s -= 0.0005;
  off.frame = Side().TorqueOff(bench_.DriveOf(1));
  log_[at_] = off;
  EXPECT_THAT(Violations(), ::testing::HasSubstr("joint 1 is driven without having been started"));
}

TEST_P(Judge, NoticesATorqueBeyondItsLimit) {
  std::size_t at = at_;
  while (log_[at].frame.id != TorqueId()) ++at;
  Side().SpoilTorque(log_[at].frame);
  EXPECT_THAT(Violations(), ::testing::HasSubstr("joint 1: torque"));
}

TEST_P(Judge, NoticesAStrangersFrame) {
  log_[at_].frame.id = 0x7aa;
  EXPECT_THAT(Violations(), ::testing::HasSubstr("identifier 7AA is none of the drives'"));
}

TEST_P(Judge, NoticesAFirstSetpointFarFromWhereTheDriveIs) {
  for (LoggedFrame& logged : log_) {
    if (logged.frame.id == Side().PositionId(bench_.DriveOf(1))) Side().SpoilReply(logged.frame);
  }
  EXPECT_THAT(Violations(), ::testing::HasSubstr("joint 1: the first setpoint is"));
}

INSTANTIATE_TEST_SUITE_P(All, Judge, ::testing::ValuesIn(EveryProtocol()),
                         [](const auto& given) { return given.param.name; });

/// Motions that break the limits that they state. The last gate is there for them. The judge knows
/// only the stated limits.
class Gate : public ::testing::TestWithParam<std::tuple<TestedProtocol, int>> {};

TEST_P(Gate, KeepsEveryStatedLimitWhateverThePlan) {
  const auto [protocol, limit] = GetParam();
  TwoNodes motion = MakeTwoNodes();
  for (Primitive<float>& primitive : motion.primitives) {
    primitive.following_tolerance_rad = 10;
    primitive.entry_tolerance_rad = 10;
    for (std::size_t i = 0; i < 2; ++i) {
      JointMotion<float>& joint = primitive.joints[i];
      JointLimits<float>& limits = joint.limits;
      const float start = joint.position.control_points()[0];
      switch (limit) {
        case 0:
          limits.position_max_rad = std::max(start, joint.position.control_points().back()) + 0.02F;
          break;
        case 1:
          limits.position_min_rad = std::min(start, joint.position.control_points().back()) - 0.02F;
          break;
        case 2:
          limits.velocity_max_rad_s *= 0.3F;
          break;
        default:
          limits.torque_max_nm *= 0.2F;
          break;
      }
    }
  }
  FaultBench::Config config;
  config.drives = DrivesOf(protocol);
  config.graph = GraphOf(motion.primitives[0]);
  config.primitives = {motion.primitives[0]};
  config.executor = ConfigOf({}, motion);
  config.executor.collapse.configured = false;
  FaultBench bench(std::move(config));
  ASSERT_EQ(bench.configured, Status::kOk);
  ASSERT_TRUE(bench.Reach(ExecutorState::kRunning));
  int limited = 0;
  for (int i = 0; i < 1200; ++i) {
    const TickRecord& record = bench.Tick();
    limited += record.joints[0].limit_active || record.joints[1].limit_active ? 1 : 0;
  }
  EXPECT_GT(limited, 20) << "the gate has had something to do";
  EXPECT_EQ(bench.output.record.faults, 0U);
  EXPECT_THAT(bench.judge.report().violations, IsEmpty());
}

std::string GateName(const ::testing::TestParamInfo<std::tuple<TestedProtocol, int>>& given) {
  constexpr std::array kLimits{"PositionMax", "PositionMin", "Velocity", "Torque"};
  return std::get<0>(given.param).name + "_" +
         kLimits[static_cast<std::size_t>(std::get<1>(given.param))];
}

INSTANTIATE_TEST_SUITE_P(All, Gate,
                         ::testing::Combine(::testing::ValuesIn(EveryProtocol()),
                                            ::testing::Range(0, 4)),
                         GateName);

}  // namespace
}  // namespace tumbler
