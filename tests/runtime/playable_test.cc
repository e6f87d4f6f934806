// What the executor plays: every number of a configuration, a sequence and a primitive has its
// range, and one beyond is refused before anything moves. And the names and units of what it says.

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "runtime/executor/executor_config.h"
#include "runtime/executor/faults.h"
#include "runtime/executor/numbers.h"
#include "runtime/executor/sensor_watch.h"
#include "runtime/executor/tick.h"
#include "tests/support/sensor_motion.h"

namespace tumbler {
namespace {

constexpr float kUndefined = std::numeric_limits<float>::quiet_NaN();
constexpr float kWithoutEnd = std::numeric_limits<float>::infinity();

struct PlayableCase {
  ExecutorConfig config;
  SequenceGraph<float> graph;
  std::vector<Primitive<float>> primitives;
  int joint_count = 2;

  [[nodiscard]] bool Is() const { return IsPlayable(config, graph, primitives, joint_count); }
};

/// A sequence with an edge back to its only node, a beginning, and a motion with feedback.
PlayableCase PlayableGood() {
  PlayableCase good;
  good.primitives = {testing::MotionWithFeedback(3)};
  good.graph = GraphOf(good.primitives[0]);
  good.graph.edge_count = 1;
  good.graph.edge_storage[0] = {};
  good.graph.edge_storage[0].from = good.graph.edge_storage[0].to = 0;
  good.graph.beginning_count = 1;
  good.graph.beginning_storage[0].node = 0;
  good.graph.beginning_storage[0].pitch_rad = 0;
  good.graph.beginning_within_rad = 0.5F;
  return good;
}

TEST(IsPlayable, EveryNumberOfAConfigurationHasItsRange) {
  ASSERT_TRUE(PlayableGood().Is());
  int number = 0;
  for (const auto change :
       {+[](PlayableCase& p) { p.joint_count = 0; },
        +[](PlayableCase& p) { p.joint_count = kMaxJoints + 1; },
        +[](PlayableCase& p) { p.joint_count = 1; },
        +[](PlayableCase& p) { p.config.period_s = 0; },
        +[](PlayableCase& p) { p.config.period_s = 2; },
        +[](PlayableCase& p) { p.config.speed = 0; },
        +[](PlayableCase& p) { p.config.move_fraction = 2; },
        +[](PlayableCase& p) { p.config.torque_rise_s = 0; },
        +[](PlayableCase& p) { p.config.torque_rise_s = 2e3F; },
        +[](PlayableCase& p) { p.config.stale_ticks_max = 0; },
        +[](PlayableCase& p) { p.config.sequence_errors_max = 0; },
        +[](PlayableCase& p) { p.config.late_ticks_max = -1; },
        +[](PlayableCase& p) { p.config.get_ups_max = -1; },
        +[](PlayableCase& p) { p.config.start_way_max_rad = kUndefined; },
        +[](PlayableCase& p) { p.config.moved_max_rad = -1; },
        +[](PlayableCase& p) { p.config.arming_ticks_max = 0; },
        +[](PlayableCase& p) { p.config.branch = 1; },
        +[](PlayableCase& p) { p.config.begin = 1; },
        +[](PlayableCase& p) { p.config.joints[1].kp_nm_per_rad = -1; },
        +[](PlayableCase& p) { p.config.joints[1].kd_nm_s_per_rad = kWithoutEnd; },
        +[](PlayableCase& p) { p.config.joints[1].damping_nm_s_per_rad = kUndefined; },
        +[](PlayableCase& p) { p.config.joints[1].temperature_max_c = kUndefined; },
        +[](PlayableCase& p) {
          p.config.last_known[1] = {true, kUndefined, 6.28F};
        },
        +[](PlayableCase& p) {
          p.config.last_known[1] = {true, 0, 0};
        },
        +[](PlayableCase& p) {
          p.config.last_known[1] = {true, 0, kWithoutEnd};
        }}) {
    PlayableCase bad = PlayableGood();
    change(bad);
    EXPECT_FALSE(bad.Is()) << number;
    ++number;
  }
  PlayableCase known = PlayableGood();
  known.config.last_known[1] = {true, 0.5F, 6.28F};
  EXPECT_TRUE(known.Is());
}

TEST(IsPlayable, EveryNumberOfASequenceHasItsRange) {
  int number = 0;
  for (const auto change :
       {+[](PlayableCase& p) { p.graph.node_count = kMaxSequenceNodes + 1; },
        +[](PlayableCase& p) { p.graph.edge_count = kMaxSequenceEdges + 1; },
        +[](PlayableCase& p) { p.graph.edge_count = -1; },
        +[](PlayableCase& p) { p.graph.start = -1; }, +[](PlayableCase& p) { p.graph.start = 1; },
        +[](PlayableCase& p) { p.graph.beginning_count = -1; },
        +[](PlayableCase& p) { p.graph.beginning_count = kMaxSequenceNodes + 1; },
        +[](PlayableCase& p) { p.graph.beginning_storage[0].node = 1; },
        +[](PlayableCase& p) { p.graph.beginning_storage[0].pitch_rad = kUndefined; },
        +[](PlayableCase& p) { p.graph.beginning_within_rad = 4; },
        +[](PlayableCase& p) { p.graph.swap_pitch_rad = kUndefined; },
        +[](PlayableCase& p) { p.graph.last_pitch_rad[0] = kWithoutEnd; },
        +[](PlayableCase& p) { p.graph.node_storage[0].primitive = 1; },
        +[](PlayableCase& p) { p.graph.node_storage[0].primitive = -1; },
        +[](PlayableCase& p) { p.graph.node_storage[0].after_fall = 1; },
        +[](PlayableCase& p) { p.graph.edge_storage[0].from = 1; },
        +[](PlayableCase& p) { p.graph.edge_storage[0].to = -1; },
        +[](PlayableCase& p) { p.graph.edge_storage[0].settle_s = kUndefined; }}) {
    PlayableCase bad = PlayableGood();
    change(bad);
    EXPECT_FALSE(bad.Is()) << number;
    ++number;
  }
}

TEST(IsPlayable, EveryNumberOfAPrimitiveHasItsRange) {
  int number = 0;
  for (const auto change :
       {+[](Primitive<float>& p) { p.duration_s = 0; },
        +[](Primitive<float>& p) { p.duration_s = 2e4F; },
        +[](Primitive<float>& p) { p.settle_s = -1; },
        +[](Primitive<float>& p) { p.entry_tolerance_rad = 0; },
        +[](Primitive<float>& p) { p.following_tolerance_rad = kWithoutEnd; },
        +[](Primitive<float>& p) { p.joints[1].limits.position_min_rad = -kWithoutEnd; },
        +[](Primitive<float>& p) { p.joints[1].limits.position_max_rad = kWithoutEnd; },
        +[](Primitive<float>& p) {
          p.joints[1].limits.position_max_rad = p.joints[1].limits.position_min_rad;
        },
        +[](Primitive<float>& p) { p.joints[1].limits.velocity_max_rad_s = 0; },
        +[](Primitive<float>& p) { p.joints[1].limits.acceleration_max_rad_s2 = kUndefined; },
        +[](Primitive<float>& p) { p.joints[1].limits.torque_max_nm = 0; },
        +[](Primitive<float>& p) {
          p.joints[1].limits.position_min_rad = p.joints[1].position.control_points()[0] + 0.1F;
          p.joints[1].limits.position_max_rad = p.joints[1].limits.position_min_rad + 1;
        }}) {
    PlayableCase bad = PlayableGood();
    change(bad.primitives[0]);
    EXPECT_FALSE(bad.Is()) << number;
    ++number;
  }
}

TEST(IsPlayable, EveryNumberOfAFeedbackHasItsRange) {
  int number = 0;
  for (const auto change :
       {+[](Feedback<float>& f) { f.knot_count = 1; },
        +[](Feedback<float>& f) { f.knot_count = kMaxGainKnots + 1; },
        +[](Feedback<float>& f) { f.error_min_rad = -1; },
        +[](Feedback<float>& f) { f.error_full_rad = f.error_max_rad + 1; },
        +[](Feedback<float>& f) { f.error_min_rad = f.error_full_rad = f.error_max_rad = 0; },
        +[](Feedback<float>& f) { f.start_error_max_rad = 0; },
        +[](Feedback<float>& f) { f.fade_in_s = 0; }, +[](Feedback<float>& f) { f.fade_out_s = 0; },
        +[](Feedback<float>& f) { f.knots_s[0] = kUndefined; },
        +[](Feedback<float>& f) { f.knots_s[1] = kWithoutEnd; },
        +[](Feedback<float>& f) { f.knots_s[1] = f.knots_s[0]; },
        +[](Feedback<float>& f) { f.joints[1].angle_gain[0] = kUndefined; },
        +[](Feedback<float>& f) { f.joints[1].rate_gain[0] = kUndefined; },
        +[](Feedback<float>& f) { f.joints[1].chain = kUndefined; },
        +[](Feedback<float>& f) { f.joints[1].correction_max_rad = -1; },
        +[](Feedback<float>& f) { f.joints[1].correction_rate_max_rad_s = 0; }}) {
    PlayableCase bad = PlayableGood();
    change(bad.primitives[0].feedback);
    EXPECT_FALSE(bad.Is()) << number;
    ++number;
  }
}

TEST(SensorSettings, EveryNumberHasItsRangeAndAMountingIsARotation) {
  EXPECT_TRUE(SensorSettings{}.IsValid());
  int number = 0;
  for (const auto change : {+[](SensorSettings& s) { s.age_ticks_max = 0; },
                            +[](SensorSettings& s) { s.tilt_sine_max = 0; },
                            +[](SensorSettings& s) { s.rate_max_rad_s = kUndefined; },
                            +[](SensorSettings& s) { s.twist_max_rad = -1; },
                            +[](SensorSettings& s) { s.jump_max_rad = 0; },
                            +[](SensorSettings& s) { s.late_max_s = kWithoutEnd; },
                            +[](SensorSettings& s) { s.chain[0] = 0.5F; }}) {
    SensorSettings bad;
    change(bad);
    EXPECT_FALSE(bad.IsValid()) << number;
    ++number;
  }
  for (const float turn : {-1.0F, 0.0F, 1.0F}) {
    SensorSettings settings;
    settings.chain[0] = turn;
    EXPECT_TRUE(settings.IsValid());
  }
}

/// Counts the names of the enumerators from the first to the last: each has one of its own.
template <typename Enum>
void ExpectNames(Enum last) {
  std::set<std::string> names;
  for (int i = 0; i <= static_cast<int>(last); ++i) names.insert(ToString(static_cast<Enum>(i)));
  EXPECT_EQ(names.size(), static_cast<std::size_t>(last) + 1);
  EXPECT_FALSE(names.contains(""));
}

TEST(Names, EveryEnumeratorOfTheCoreHasItsOwn) {
  ExpectNames(ReplyStatus::kOkSomeLate);
  ExpectNames(OperatorCommand::kGoHome);
  ExpectNames(Refusal::kLiesOtherwise);
  ExpectNames(static_cast<Fault>(kFaultCount - 1));
  ExpectNames(static_cast<ExecutorState>(kExecutorStateCount - 1));
  ExpectNames(static_cast<Reaction>(kReactionCount - 1));
  EXPECT_STREQ(ToString(static_cast<Fault>(kFaultCount)), "unknown fault");
  EXPECT_STREQ(ToString(static_cast<ExecutorState>(kExecutorStateCount)), "unknown state");
  EXPECT_STREQ(ToString(static_cast<Reaction>(kReactionCount)), "unknown reaction");
}

TEST(Units, OfEveryFaultAndRefusalAreWhatTheirTextsSay) {
  for (const FaultInfo& info : kFaultTable) {
    SCOPED_TRACE(info.name);
    const std::string unit(info.value);
    switch (UnitOf(info.fault)) {
      case DetailUnit::kTicks:
        EXPECT_EQ(unit, "ticks");
        break;
      case DetailUnit::kCelsius:
        EXPECT_NE(unit.find("degrees C"), std::string::npos) << unit;
        break;
      case DetailUnit::kIdentifier:
        EXPECT_EQ(unit, "identifier, or 0");
        break;
      default:
        EXPECT_NE(unit, "ticks");
    }
  }
  std::set<DetailUnit> units;
  for (int i = 0; i <= static_cast<int>(Refusal::kLiesOtherwise); ++i)
    units.insert(UnitOf(static_cast<Refusal>(i)));
  EXPECT_TRUE(units.contains(DetailUnit::kRadians));
  EXPECT_TRUE(units.contains(DetailUnit::kNone));
  for (const DetailUnit unit :
       {DetailUnit::kRadians, DetailUnit::kRadiansPerSecond, DetailUnit::kCelsius})
    EXPECT_FALSE(IsInteger(unit));
  EXPECT_TRUE(IsInteger(DetailUnit::kTicks));
}

TEST(Numbers, OnlyFiniteOnesArePositive) {
  EXPECT_TRUE(IsPositive(1e-30F));
  EXPECT_FALSE(IsPositive(0));
  EXPECT_FALSE(IsPositive(kWithoutEnd));
  EXPECT_FALSE(IsPositive(kUndefined));
}

}  // namespace
}  // namespace tumbler
