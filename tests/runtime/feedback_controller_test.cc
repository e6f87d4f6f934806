// The feedback without an executor: when it begins, fades, holds and ends, by any estimate of the
// pitch. That its corrections are those of the law is tested in sensor_feedback_test.cc.

#include "runtime/executor/feedback_controller.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "tests/support/motions.h"

namespace tumbler {
namespace {

/// A pitch that is what the test says.
class SaidPitch final : public PitchEstimate {
 public:
  SaidPitch() { age_ticks_max_ = 5; }
  void Start(float /*period_s*/) noexcept override {}
  [[nodiscard]] bool IsValid() const noexcept override { return true; }
  void Trust() noexcept override {}
  bool Take(const CanFrame& /*frame*/, std::int32_t /*age_ticks*/) noexcept override {
    return false;
  }
  void EndTick(int /*elapsed*/, std::span<const Joint> /*joints*/) noexcept override {}

  void Say(float pitch_rad, float rate_rad_s, SensorStatus status = SensorStatus::kOk) {
    pitch_rad_ = pitch_rad;
    rate_rad_s_ = rate_rad_s;
    status_ = status;
    age_ticks_ = 0;
  }
  void Age() { ++age_ticks_; }
  void Listen(const std::array<std::uint32_t, 3>& ids) { ids_ = ids; }
  void Doubt(bool doubtful) { is_doubtful_ = doubtful; }
};

constexpr float kPeriod_s = 0.001F;

/// A controller of a motion of two joints whose feedback is about the root's own pitch, which is to
/// be zero.
class FeedbackControllerTest : public ::testing::Test {
 protected:
  FeedbackControllerTest() {
    std::mt19937 random(1);
    motion = testing::RandomPrimitive<float>({}, random);
    Feedback<float>& feedback = motion.feedback;
    feedback.link = FixedString<32>("root");
    const auto& torque = motion.joints[0].torque;
    const std::vector<float> zeros(torque.control_points().size());
    EXPECT_EQ(feedback.angle.Assign(torque.degree(), torque.knots(), zeros), Status::kOk);
    feedback.knot_count = 2;
    feedback.knots_s[1] = motion.duration_s;
    feedback.error_min_rad = 0;
    feedback.error_full_rad = 1e-6F;
    feedback.error_max_rad = 0.5F;
    feedback.start_error_max_rad = 0.2F;
    feedback.fade_in_s = 0.01F;
    feedback.fade_out_s = 0.02F;
    for (JointFeedback<float>& joint : feedback.joints) {
      joint.angle_gain.fill(2);
      joint.correction_max_rad = 1;
      joint.correction_rate_max_rad_s = 1e3F;
    }
    graph = GraphOf(motion);
    controller.SetMotion(motion, graph, 0, pitch.chain(), kJoints);
    for (Joint& joint : joints) joint.motion = &motion.joints[0];
  }

  /// A tick at a time in the motion. @returns the correction of joint 0.
  float Tick(bool moving = true, float time_s = 0.1F) {
    for (Joint& joint : joints) {
      joint.motion->torque.EvaluateBasis(time_s, joint.torque_basis);
      joint.commanded.position_rad = joint.measured.position_rad = 0;
    }
    for (JointRecord& joint : record.joints) joint.planned = {};
    controller.Correct(pitch, joints, moving, time_s, kPeriod_s, record);
    return record.joints[0].correction_rad;
  }

  static constexpr int kJoints = 2;
  Primitive<float> motion;
  SequenceGraph<float> graph;
  SaidPitch pitch;
  FeedbackController controller;
  std::array<Joint, kJoints> joints;
  TickRecord record;
};

TEST_F(FeedbackControllerTest, APitchListensToFramesWithEachOfItsIdentifiersAndToNoOthers) {
  SaidPitch said;
  said.Listen({0x101, 0x102, 0x103});
  CanFrame frame{};
  for (std::uint32_t id = 0xff; id <= 0x105; ++id) {
    frame.id = id;
    EXPECT_EQ(said.Owns(frame), id >= 0x101 && id <= 0x103) << id;
  }
}

TEST_F(FeedbackControllerTest, FadesInWhileTheErrorIsKnownAndCorrectsByTheGain) {
  pitch.Say(0.1F, 0);
  controller.Begin();
  for (int n = 1; n <= 10; ++n) {
    const float correction = Tick();
    EXPECT_NEAR(controller.share(), 0.1 * n, 1e-5);
    EXPECT_NEAR(correction, 0.1 * n * 0.2, 1e-5);
    EXPECT_EQ(record.joints[0].planned.position_rad, correction);
    EXPECT_EQ(controller.correction_rad(0), correction);
  }
  EXPECT_NEAR(controller.error_rad(), 0.1, 1e-6);
}

TEST_F(FeedbackControllerTest, AMotionThatBeginsTooFarFromItsPlanIsPlayedWithoutFeedback) {
  pitch.Say(0.3F, 0);
  controller.Begin();
  EXPECT_EQ(Tick(), 0);
  pitch.Say(0.1F, 0);
  for (int n = 0; n < 20; ++n) EXPECT_EQ(Tick(), 0) << n;
  controller.Begin();
  EXPECT_NE(Tick(), 0) << "the next motion begins where it should";
}

TEST_F(FeedbackControllerTest, FadesOutWhereTheErrorIsLostAndInAgainWhereItIsFound) {
  pitch.Say(0.1F, 0);
  controller.Begin();
  for (int n = 0; n < 20; ++n) Tick();
  EXPECT_EQ(controller.share(), 1);
  pitch.Say(0.1F, 0, SensorStatus::kStale);
  Tick();
  EXPECT_NEAR(controller.share(), 0.95, 1e-5);
  pitch.Say(0.6F, 0);
  Tick();
  EXPECT_NEAR(controller.share(), 0.90, 1e-5) << "more than error_max_rad";
  EXPECT_NEAR(controller.error_rad(), 0.1, 1e-6) << "as it was known last";
  pitch.Say(0.1F, 0);
  pitch.Doubt(true);
  Tick();
  EXPECT_NEAR(controller.share(), 0.85, 1e-5);
  pitch.Doubt(false);
  Tick();
  EXPECT_NEAR(controller.share(), 0.95, 1e-5);
}

TEST_F(FeedbackControllerTest, WithoutNewsTheErrorStaysKnownOrUnknownAsItWas) {
  pitch.Say(0.1F, 0);
  controller.Begin();
  Tick();
  pitch.Age();
  Tick();
  EXPECT_NEAR(controller.share(), 0.2, 1e-5);
  pitch.Say(0.6F, 0);
  Tick();
  pitch.Say(0.1F, 0);
  pitch.Age();
  Tick();
  EXPECT_NEAR(controller.share(), 0.1, 1e-5) << "no news, and not known before";
}

TEST_F(FeedbackControllerTest, TheRateOfThePlanCountsWhileTheMotionGoesOnAndNotInTheHold) {
  motion.feedback.angle = motion.joints[0].torque;
  motion.feedback.error_max_rad = motion.feedback.start_error_max_rad = 10;
  controller = FeedbackController(0.5F);
  controller.SetMotion(motion, graph, 0, pitch.chain(), kJoints);
  pitch.Say(0, 0.25F);
  controller.Begin();
  Tick(true, 0.4F);
  Joint::Basis basis;
  motion.feedback.angle.EvaluateBasis(0.4F, basis);
  EXPECT_NEAR(controller.rate_error_rad_s(), 0.25F - 0.5F * motion.feedback.angle.Slope(basis),
              1e-5);
  Tick(false, 0.4F);
  EXPECT_EQ(controller.rate_error_rad_s(), 0.25F);
}

TEST_F(FeedbackControllerTest, AHoldKeepsCorrectingAndRestEndsItAtOnce) {
  EXPECT_FALSE(controller.acts());
  pitch.Say(0.1F, 0);
  controller.Begin();
  EXPECT_TRUE(controller.acts());
  for (int n = 0; n < 10; ++n) Tick();
  EXPECT_NEAR(Tick(false), 0.2, 1e-5);
  EXPECT_TRUE(controller.acts());
  controller.Rest(kJoints, record);
  EXPECT_FALSE(controller.acts());
  EXPECT_EQ(controller.share(), 0);
  EXPECT_EQ(controller.correction_rad(0), 0);
  EXPECT_EQ(record.joints[1].correction_rad, 0);
}

TEST_F(FeedbackControllerTest, InAMotionWithoutFeedbackACorrectionIsReleasedSlowly) {
  pitch.Say(0.1F, 0);
  controller.Begin();
  for (int n = 0; n < 10; ++n) Tick();
  motion.feedback = {};
  controller.SetMotion(motion, graph, 0, pitch.chain(), kJoints);
  controller.Begin();
  EXPECT_NEAR(Tick(), 0.2 - 0.001, 1e-5) << "by 1 rad/s";
  EXPECT_EQ(controller.share(), 0);
  EXPECT_EQ(controller.error_rad(), 0);
}

TEST_F(FeedbackControllerTest, AJointBetweenSensorAndLinkHasToBeKnownAndCounts) {
  for (JointFeedback<float>& joint : motion.feedback.joints) joint.chain = 1;
  controller.SetMotion(motion, graph, 0, pitch.chain(), kJoints);
  pitch.Say(0.1F, 0);
  controller.Begin();
  EXPECT_EQ(Tick(), 0) << "no joint has replied";
  for (Joint& joint : joints) {
    joint.replies.Count(0);
    joint.replies.EndTick(1, 5);
  }
  controller.Begin();
  EXPECT_NE(Tick(), 0);
}

TEST_F(FeedbackControllerTest, WhereRolesAreExchangedThePitchIsTurnedBack) {
  graph.node_storage[0].swapped = true;
  graph.partner = {1, 0};
  graph.swap_pitch_rad = 3;
  controller.SetMotion(motion, graph, 0, pitch.chain(), kJoints);
  pitch.Say(3.1F, 0);
  controller.Begin();
  Tick();
  EXPECT_NEAR(controller.error_rad(), 0.1, 1e-6);
}

}  // namespace
}  // namespace tumbler
