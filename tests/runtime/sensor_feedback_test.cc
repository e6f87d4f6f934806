// Feedback in the executor: the law, against a reference in double precision that is written down
// here by its definition alone, and what becomes of it when the sensor fails.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/executor/executor.h"
#include "runtime/executor/sensor_watch.h"
#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"
#include "tests/support/sensor_motion.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;
using testing::MotionWithFeedback;
using testing::SensorFrames;

constexpr double kPi = std::numbers::pi;

Primitive<float> FedBackMotion(unsigned seed) {
  testing::MotionShape shape;
  shape.duration_s = 0.6;
  shape.settle_s = 0.2;
  shape.amplitude_rad = 0.5;
  Primitive<float> motion = MotionWithFeedback(seed, shape);
  motion.feedback.fade_out_s = 0.04F;
  return motion;
}

/// The plan's angle and rate, by de Boor's recursion in double precision.
double BasisFunction(std::span<const float> knots, int i, int degree, double t) {
  const auto u = [&](int k) { return static_cast<double>(knots[static_cast<std::size_t>(k)]); };
  if (degree == 0) return t >= u(i) && t < u(i + 1) ? 1 : 0;
  const double left = u(i + degree) - u(i), right = u(i + degree + 1) - u(i + 1);
  double sum = 0;
  if (left > 0) sum += (t - u(i)) / left * BasisFunction(knots, i, degree - 1, t);
  if (right > 0)
    sum += (u(i + degree + 1) - t) / right * BasisFunction(knots, i + 1, degree - 1, t);
  return sum;
}
double PlanAngle(const Feedback<float>& feedback, double t) {
  const auto points = feedback.angle.control_points();
  if (t >= static_cast<double>(feedback.angle.end_s())) return static_cast<double>(points.back());
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    sum += static_cast<double>(points[i]) *
           BasisFunction(feedback.angle.knots(), static_cast<int>(i), feedback.angle.degree(), t);
  }
  return sum;
}
double PlanRate(const Feedback<float>& feedback, double t) {
  const auto points = feedback.angle.control_points();
  const std::span<const float> knots = feedback.angle.knots();
  const int degree = feedback.angle.degree();
  const double at = std::min(t, static_cast<double>(feedback.angle.end_s()) - 1e-9);
  const auto width = [&](std::size_t from, std::size_t to) {
    return static_cast<double>(knots[to]) - static_cast<double>(knots[from]);
  };
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto p = static_cast<std::size_t>(degree);
    const auto c = static_cast<double>(points[i]) * degree;
    const double left = width(i, i + p), right = width(i + 1, i + p + 1);
    const int k = static_cast<int>(i);
    if (left > 0) sum += c / left * BasisFunction(knots, k, degree - 1, at);
    if (right > 0) sum -= c / right * BasisFunction(knots, k + 1, degree - 1, at);
  }
  return sum;
}
double GainByHand(const Feedback<float>& feedback, const std::array<float, kMaxGainKnots>& gain,
                  double t) {
  for (std::size_t k = 1; k < feedback.knots().size(); ++k) {
    const auto a = static_cast<double>(feedback.knots_s[k - 1]);
    const auto b = static_cast<double>(feedback.knots_s[k]);
    if (t > b && k + 1 < feedback.knots().size()) continue;
    const double share = std::clamp((t - a) / (b - a), 0.0, 1.0);
    return (1 - share) * static_cast<double>(gain[k - 1]) + share * static_cast<double>(gain[k]);
  }
  return 0;
}

/// A rig whose sensor sits on the root and reports what the test says.
class Rig : public ExecutorRig {
 public:
  Rig(const Primitive<float>& primitive, const ExecutorConfig& config = {})
      : Rig(config, GraphOf(primitive), {primitive}) {}
  Rig(const ExecutorConfig& config, const SequenceGraph<float>& graph,
      std::vector<Primitive<float>> primitives)
      : ExecutorRig(config, graph, std::move(primitives)) {
    sensor.device = &device;
    sensor.settings.repeats_max = 0;
    sensor.settings.jump_max_rad = 10;
    sensor.settings.rate_max_rad_s = 60;
    Reconfigure();
  }
  XsensMti device;
};

/// What a sensor's frames say, to the wire's resolution.
double OnWire(double x, double steps) { return std::round(x * steps) / steps; }

TEST(Feedback, TheCorrectionIsThatOfTheLawInDoublePrecision) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const Primitive<float> motion = FedBackMotion(seed);
    const Feedback<float>& feedback = motion.feedback;
    ExecutorConfig config;
    if (seed % 2 == 0) config.speed = 0.5F;
    const auto speed = static_cast<double>(config.speed);
    Rig rig(motion, config);
    ASSERT_EQ(rig.configured, Status::kOk);
    // The true error that the sensor is to show: a slow wave, and its own rate.
    const auto wave = [&](double t) { return 0.2 * std::sin(9 * t + seed); };
    double time = 0;  // in the primitive
    double share = 0;
    std::array<double, 2> correction{};
    double worst = 0, largest = 0;
    int compared = 0;
    rig.sensor_frames = SensorFrames(PlanAngle(feedback, 0), 0);
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    rig.Tick(OperatorCommand::kMoveToStart);
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
    for (int n = 0; n < 2000; ++n) {
      // What the joints will have been measured at, when this tick's replies are decoded.
      const double q = static_cast<double>(rig.drives[1]->setpoint.position_rad);
      const double pitch = PlanAngle(feedback, time) + wave(time) - q;
      const double rate = OnWire(1.5 * std::cos(3.0 * n * 1e-3), 512);
      rig.sensor_frames = SensorFrames(pitch, rate);
      const ExecutorState before = rig.executor.state();
      rig.Tick(n == 0 ? OperatorCommand::kRun : OperatorCommand::kNone);
      const TickRecord& record = rig.output.record;
      if (record.state == ExecutorState::kHolding && before == ExecutorState::kHolding) break;
      const double t = static_cast<double>(record.primitive_time_s);
      const bool moving = record.state == ExecutorState::kRunning;
      const double e = std::remainder(pitch + q - PlanAngle(feedback, t), 2 * kPi);
      const double e_rate = rate - (moving ? speed * PlanRate(feedback, t) : 0.0);
      share = std::min(1.0, share + 1e-3 / static_cast<double>(feedback.fade_in_s));
      EXPECT_NEAR(static_cast<double>(record.sensor.error_rad), e, 2e-4);
      EXPECT_NEAR(static_cast<double>(record.sensor.rate_error_rad_s), e_rate, 2e-3);
      const auto least = static_cast<double>(feedback.error_min_rad);
      const auto whole = static_cast<double>(feedback.error_full_rad);
      const double asked = std::clamp((std::abs(e) - least) / (whole - least), 0.0, 1.0);
      for (std::size_t j = 0; j < 2; ++j) {
        const JointFeedback<float>& joint = feedback.joints[j];
        const auto most = static_cast<double>(joint.correction_max_rad);
        const double wanted = share * asked *
                              std::clamp(GainByHand(feedback, joint.angle_gain, t) * e +
                                             GainByHand(feedback, joint.rate_gain, t) * e_rate,
                                         -most, most);
        const double step = static_cast<double>(joint.correction_rate_max_rad_s) * 1e-3;
        correction[j] += std::clamp(wanted - correction[j], -step, step);
        worst = std::max(
            worst, std::abs(correction[j] - static_cast<double>(record.joints[j].correction_rad)));
        largest = std::max(largest, std::abs(correction[j]));
        ++compared;
      }
      time = t + (moving ? speed * 1e-3 : 0);
      time = std::min(time, static_cast<double>(motion.duration_s));
    }
    EXPECT_GT(compared, 1400);
    EXPECT_GT(largest, 0.05) << "the test has to correct something";
    EXPECT_LT(worst, 6e-4) << "seed " << seed;
  }
}

/// Plays the motion and returns the orders of every tick.
std::vector<std::array<DriveSetpoint, 2>> Orders(Rig& rig,
                                                 const std::function<void(int)>& each = {}) {
  std::vector<std::array<DriveSetpoint, 2>> orders;
  EXPECT_TRUE(rig.Reach(ExecutorState::kHolding));
  rig.Tick(OperatorCommand::kMoveToStart);
  EXPECT_TRUE(rig.TickUntil(ExecutorState::kHolding));
  if (each) each(0);
  rig.Tick(OperatorCommand::kRun);
  for (int n = 1; n < 900; ++n) {
    if (each) each(n);
    rig.Tick();
    orders.push_back({rig.drives[0]->setpoint, rig.drives[1]->setpoint});
  }
  return orders;
}

bool SameBits(const DriveSetpoint& a, const DriveSetpoint& b) {
  return std::bit_cast<std::array<std::uint32_t, 5>>(a) ==
         std::bit_cast<std::array<std::uint32_t, 5>>(b);
}

TEST(Feedback, WithoutASensorOrWithoutFeedbackTheOrdersAreThoseOfThePlanAlone) {
  const Primitive<float> motion = FedBackMotion(3);
  Primitive<float> plain = motion;
  plain.feedback = {};
  Rig reference(plain);
  reference.sensor.device = nullptr;
  reference.Reconfigure();
  const auto expected = Orders(reference);
  Rig no_sensor(motion);
  no_sensor.sensor.device = nullptr;
  no_sensor.Reconfigure();
  Rig no_feedback(plain);
  no_feedback.sensor_frames = SensorFrames(1, 2);
  Rig silent(motion);
  for (Rig* rig : {&no_sensor, &no_feedback, &silent}) {
    const auto orders = Orders(*rig);
    ASSERT_EQ(orders.size(), expected.size());
    for (std::size_t n = 0; n < orders.size(); ++n) {
      for (std::size_t j = 0; j < 2; ++j)
        ASSERT_TRUE(SameBits(orders[n][j], expected[n][j])) << n << ", joint " << j;
    }
  }
  EXPECT_EQ(silent.output.record.sensor.status, SensorStatus::kNoData);
  EXPECT_EQ(silent.output.record.faults, 0U) << "a lost sensor is ignored by default";
}

/// Frames with a constant error of the fed-back angle.
std::vector<CanFrame> WithError(const Rig& rig, const Primitive<float>& motion, double error) {
  const double t = std::min(static_cast<double>(rig.output.record.primitive_time_s) + 1e-3,
                            static_cast<double>(motion.duration_s));
  const double q = static_cast<double>(rig.drives[1]->setpoint.position_rad);
  return SensorFrames(PlanAngle(motion.feedback, t) + error - q, 0);
}

/// A motion whose joints are corrected by the angle's error itself, without a dead zone.
Primitive<float> MotionWithUnitGain() {
  Primitive<float> motion = FedBackMotion(4);
  motion.feedback.error_min_rad = motion.feedback.error_full_rad = 0;
  for (JointFeedback<float>& joint : motion.feedback.joints) {
    joint.angle_gain.fill(1);
    joint.rate_gain.fill(0);
    joint.correction_rate_max_rad_s = 20;
  }
  return motion;
}

TEST(Feedback, ASensorThatFallsSilentLetsTheCorrectionFadeAndTheMotionGoOn) {
  const Primitive<float> motion = MotionWithUnitGain();
  Rig rig(motion);
  std::vector<float> corrections;
  constexpr int kSilent = 300;
  const auto each = [&](int n) {
    rig.sensor_frames = n < kSilent ? WithError(rig, motion, 0.1) : std::vector<CanFrame>{};
    corrections.push_back(rig.output.record.joints[0].correction_rad);
  };
  rig.sensor_frames = WithError(rig, motion, 0.1);
  (void)Orders(rig, each);
  const auto at = [&](int n) { return corrections[static_cast<std::size_t>(n)]; };
  EXPECT_NEAR(static_cast<double>(at(kSilent)), 0.1, 2e-3);
  EXPECT_NEAR(static_cast<double>(at(kSilent + 5)), 0.1, 2e-3) << "five ticks are no silence";
  const int faded = kSilent + 5 + 40 + 2;  // fade_out_s is 0.04
  EXPECT_EQ(at(faded), 0);
  for (int n = kSilent + 5; n < faded; ++n) {
    EXPECT_LE(at(n + 1), at(n) + 1e-6F);
    EXPECT_GT(at(n + 1), at(n) - 0.004F) << "it fades, and does not drop";
  }
  EXPECT_EQ(rig.executor.state(), ExecutorState::kHolding) << "the motion went on to its end";
  EXPECT_EQ(rig.output.record.sensor.status, SensorStatus::kStale);
  EXPECT_EQ(rig.output.record.sensor.share, 0);
  EXPECT_EQ(rig.output.record.faults, 0U);
}

TEST(Feedback, ASensorThatTellsOfATurnOutOfThePlaneIsNotActedOnForAWhile) {
  const Primitive<float> motion = MotionWithUnitGain();
  Rig rig(motion);
  const XsensMtiConfig ids;
  std::vector<float> shares;
  constexpr int kDoubted = 300;
  const auto each = [&](int n) {
    rig.sensor_frames = WithError(rig, motion, 0.1);
    // A second rate in one tick takes the place of the first.
    if (n >= kDoubted && n < kDoubted + 15)
      rig.sensor_frames.push_back(XsensRateFrame(ids, {0, 0, 1.5}));
    shares.push_back(rig.output.record.sensor.share);
  };
  rig.sensor_frames = WithError(rig, motion, 0.1);
  rig.sensor_frames.push_back(XsensRateFrame(ids, {0, 0, 1.5}));  // a start is no time for doubts
  (void)Orders(rig, each);
  const auto at = [&](int n) { return shares[static_cast<std::size_t>(n)]; };
  EXPECT_EQ(at(kDoubted), 1);
  EXPECT_EQ(at(kDoubted + 70), 0) << "fade_out_s is 0.04";
  EXPECT_EQ(at(kDoubted + 350), 1) << "and it comes back";
  EXPECT_EQ(rig.output.record.sensor.status, SensorStatus::kOk);
  EXPECT_EQ(rig.output.record.faults, 0U);
}

TEST(Feedback, AStartIsNoTimeForDoubts) {
  const Primitive<float> motion = MotionWithUnitGain();
  for (const bool doubted_later : {false, true}) {
    Rig rig(motion);
    float share = 0;
    (void)Orders(rig, [&](int n) {
      rig.sensor_frames = WithError(rig, motion, 0.1);
      // One report of a turn out of the plane: in the tick of the start, or twenty later.
      if (n == (doubted_later ? 20 : 0)) {
        rig.sensor_frames.push_back(XsensRateFrame({}, {0, 0, 3}));
        return;
      }
      if (n == (doubted_later ? 21 : 1)) share = rig.output.record.sensor.share;
      if (n == 600) {
        EXPECT_EQ(rig.output.record.sensor.share, 1);
      }
    });
    const float step = 0.001F / motion.feedback.fade_in_s;
    EXPECT_NEAR(share, doubted_later ? 20 * step - 0.001F / motion.feedback.fade_out_s : step,
                1e-4F);
  }
}

TEST(Feedback, InTheHoldARobotThatIsPushedAskewIsHeldOn) {
  const Primitive<float> motion = MotionWithUnitGain();
  Rig rig(motion);
  (void)Orders(rig, [&](int) { rig.sensor_frames = WithError(rig, motion, 0); });
  ASSERT_EQ(rig.executor.state(), ExecutorState::kHolding);
  for (int n = 0; n < 40; ++n) {
    rig.sensor_frames = WithError(rig, motion, 0.1);
    rig.sensor_frames.push_back(XsensRateFrame({}, {0, 0, 1.5}));
    rig.Tick();
  }
  EXPECT_EQ(rig.output.record.sensor.status, SensorStatus::kOk);
  EXPECT_EQ(rig.output.record.sensor.share, 1);
  EXPECT_NEAR(rig.output.record.joints[0].correction_rad, 0.1F, 2e-3F);
}

TEST(Feedback, ARobotThatIsLoweredIsNotBalancedAnyMore) {
  const Primitive<float> motion = MotionWithUnitGain();
  Rig rig(motion);
  (void)Orders(rig, [&](int) { rig.sensor_frames = WithError(rig, motion, 0.1); });
  ASSERT_EQ(rig.executor.state(), ExecutorState::kHolding);
  ASSERT_NEAR(rig.output.record.joints[0].correction_rad, 0.1F, 2e-3F);
  const float held = rig.output.record.joints[0].limited.position_rad;
  rig.Tick(OperatorCommand::kLower);
  for (const double error : {0.1, -0.3, 0.3}) {
    rig.sensor_frames = WithError(rig, motion, error);
    for (int n = 0; n < 20; ++n) rig.Tick();
    EXPECT_EQ(rig.output.record.joints[0].correction_rad, 0);
    EXPECT_EQ(rig.output.record.sensor.share, 0);
    EXPECT_NEAR(rig.output.record.joints[0].limited.position_rad, held, 1e-5F);
  }
}

TEST(Feedback, TheHoldAfterTheMotionKeepsTheLastGains) {
  Primitive<float> motion = FedBackMotion(5);
  for (JointFeedback<float>& joint : motion.feedback.joints) {
    joint.angle_gain.fill(0);
    joint.angle_gain[4] = 0.5F;  // the last knot
    joint.rate_gain.fill(0);
  }
  Rig rig(motion);
  rig.sensor_frames = WithError(rig, motion, 0);
  (void)Orders(rig, [&](int) { rig.sensor_frames = WithError(rig, motion, 0); });
  ASSERT_EQ(rig.executor.state(), ExecutorState::kHolding);
  const auto& path = motion.joints[0].position.control_points();
  for (const double target : {0.2, -0.3, 0.0}) {
    for (int n = 0; n < 500; ++n) {
      rig.sensor_frames = WithError(rig, motion, target);
      rig.Tick();
    }
    EXPECT_NEAR(static_cast<double>(rig.output.record.joints[0].limited.position_rad),
                static_cast<double>(path.back()) + 0.5 * target, 2e-4);
  }
  // A stop leaves the setpoint where it is, and a move starts from there without a jump.
  for (int n = 0; n < 200; ++n) {
    rig.sensor_frames = WithError(rig, motion, 0.2);
    rig.Tick();
  }
  const float held = rig.output.record.joints[0].limited.position_rad;
  rig.Tick(OperatorCommand::kMoveToStart);
  EXPECT_NEAR(rig.output.record.joints[0].limited.position_rad, held, 1e-5F);
  EXPECT_EQ(rig.output.record.joints[0].correction_rad, 0);
}

TEST(Feedback, AStartFarFromThePlanIsPlayedOpenLoop) {
  const Primitive<float> motion =
      FedBackMotion(6);  // start_error_max_rad is 0.25, error_max_rad 0.75
  for (const double error : {0.2, 0.3}) {
    Rig rig(motion);
    rig.sensor_frames = SensorFrames(PlanAngle(motion.feedback, 0) + error -
                                         static_cast<double>(rig.drives[1]->reply.position_rad),
                                     0);
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    rig.Tick(OperatorCommand::kMoveToStart);
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
    rig.sensor_frames = SensorFrames(PlanAngle(motion.feedback, 0) + error -
                                         static_cast<double>(rig.drives[1]->setpoint.position_rad),
                                     0);
    rig.Tick(OperatorCommand::kRun);
    float share = 0;
    for (int n = 0; n < 400; ++n) {
      rig.sensor_frames = WithError(rig, motion, 0.1);
      rig.Tick();
      share = std::max(share, rig.output.record.sensor.share);
    }
    EXPECT_EQ(share, error < 0.25 ? 1.0F : 0.0F);
  }
}

TEST(Feedback, AnErrorIsTheSameInANodeWithExchangedRoles) {
  Primitive<float> motion = FedBackMotion(7);
  motion.feedback.error_min_rad = motion.feedback.error_full_rad = 0;
  for (JointFeedback<float>& joint : motion.feedback.joints) joint.rate_gain.fill(0.05F);
  SequenceGraph<float> graph = GraphOf(motion);
  graph.node_storage[0].swapped = true;
  graph.partner = {1, 0, 2, 3, 4, 5, 6, 7};
  graph.swap_pitch_rad = static_cast<float>(kPi);
  Rig straight(motion);
  Rig swapped({}, graph, {motion});
  const auto play = [&](Rig& rig, std::size_t role_1, double turned) {
    std::vector<std::array<float, 3>> seen;
    const auto frames = [&] {
      const double t = std::min(static_cast<double>(rig.output.record.primitive_time_s) + 1e-3,
                                static_cast<double>(motion.duration_s));
      const double q = static_cast<double>(rig.drives[role_1]->setpoint.position_rad);
      return SensorFrames(PlanAngle(motion.feedback, t) + 0.1 + turned - q, 0.3);
    };
    rig.sensor_frames = frames();
    (void)Orders(rig, [&](int) {
      rig.sensor_frames = frames();
      const TickRecord& record = rig.output.record;
      seen.push_back({record.sensor.error_rad, record.joints[role_1].correction_rad,
                      record.joints[1 - role_1].correction_rad});
    });
    return seen;
  };
  const auto a = play(straight, 1, 0);
  const auto b = play(swapped, 0, kPi);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t n = 0; n < a.size(); ++n) {
    for (std::size_t i = 0; i < 3; ++i) ASSERT_NEAR(a[n][i], b[n][i], 2e-4F) << n;
  }
  EXPECT_GT(std::abs(a[500][1]), 0.01F);
}

TEST(Feedback, AMotionWithoutItSaysSoAlsoAfterOneWithIt) {
  const Primitive<float> fed = FedBackMotion(7);
  Primitive<float> plain = fed;
  plain.feedback = {};
  plain.entry_tolerance_rad = 10;  // It begins elsewhere than the one before ends.
  SequenceGraph<float> graph = GraphOf(fed);
  graph.node_count = 2;
  graph.node_storage[1] = graph.node_storage[0];
  graph.node_storage[1].primitive = 1;
  graph.edge_count = 1;
  graph.edge_storage[0] = {0, 1, 0.3F, EdgeCondition::kAlways, {}};
  Rig rig({}, graph, {fed, plain});
  ASSERT_EQ(rig.configured, Status::kOk);
  rig.sensor_frames = WithError(rig, fed, 0.1);
  int with = 0, without = 0;
  const auto look = [&](int /*tick*/) {
    rig.sensor_frames = WithError(rig, fed, 0.1);
    const TickRecord& record = rig.output.record;
    if (record.state != ExecutorState::kRunning) return;
    if (record.node == 0 && record.sensor.share > 0) ++with;
    if (record.node != 1) return;
    ++without;
    EXPECT_EQ(record.sensor.share, 0);
    EXPECT_EQ(record.sensor.error_rad, 0);
    EXPECT_EQ(record.sensor.rate_error_rad_s, 0);
  };
  (void)Orders(rig, look);
  for (int n = 0; n < 800; ++n) {
    rig.Tick();
    look(n);
  }
  EXPECT_GT(with, 100);
  EXPECT_GT(without, 100);
}

TEST(Feedback, NoSensorHoweverHostileTakesASetpointBeyondItsBounds) {
  std::mt19937 random(11);
  std::uniform_int_distribution<int> byte(0, 255), choice(0, 9);
  for (unsigned seed = 1; seed <= 12; ++seed) {
    Primitive<float> motion = FedBackMotion(seed);
    for (JointFeedback<float>& joint : motion.feedback.joints) {
      for (float& gain : joint.angle_gain) gain *= 20;
      for (float& gain : joint.rate_gain) gain *= 20;
      joint.correction_max_rad = 1;
      joint.correction_rate_max_rad_s = 100;
    }
    Rig rig(motion);
    rig.Reconfigure();
    std::array<JointSetpoint, 2> before{};
    bool corrected = false;
    rig.sensor_frames = WithError(rig, motion, 0);
    int started = 0;
    (void)Orders(rig, [&](int n) {
      if (n < 100) {
        rig.sensor_frames = WithError(rig, motion, 0.1);
      } else if (n < 400 && choice(random) < 5) {
        rig.sensor_frames =
            SensorFrames(0.7 * (choice(random) - 4.5), 12.0 * (choice(random) - 4.5));
      } else if (n >= 400 && choice(random) == 0) {
        rig.sensor_frames = SensorFrames(0, 0);
        for (CanFrame& frame : rig.sensor_frames) {
          for (std::uint8_t& b : frame.data) b = static_cast<std::uint8_t>(byte(random));
        }
      } else {
        rig.sensor_frames = WithError(rig, motion, 0.07 * (choice(random) - 4.5));
      }
      const TickRecord& record = rig.output.record;
      for (std::size_t j = 0; j < 2; ++j) {
        const JointLimits<float>& limits = motion.joints[j].limits;
        const JointSetpoint& limited = record.joints[j].limited;
        corrected = corrected || std::abs(record.joints[j].correction_rad) > 0.01F;
        EXPECT_LE(std::abs(record.joints[j].correction_rad), 1.0001F);
        EXPECT_GE(limited.position_rad, limits.position_min_rad);
        EXPECT_LE(limited.position_rad, limits.position_max_rad);
        EXPECT_LE(std::abs(limited.velocity_rad_s), limits.velocity_max_rad_s);
        EXPECT_LE(std::abs(limited.torque_nm), limits.torque_max_nm);
        if (started > 0) {
          EXPECT_LE(std::abs(limited.position_rad - before[j].position_rad),
                    limits.velocity_max_rad_s * 1.0011e-3F + 1e-6F);
        }
        before[j] = limited;
      }
      started = n + 1;
    });
    EXPECT_TRUE(corrected) << seed;
  }
}

TEST(Feedback, ALateReplyOfAJointBetweenCountsAsNotKnown) {
  Primitive<float> motion = FedBackMotion(9);
  Rig rig(motion);
  rig.sensor_frames = WithError(rig, motion, 0.1);
  float share = 1;
  (void)Orders(rig, [&](int n) {
    rig.sensor_frames = WithError(rig, motion, 0.1);
    // The joint between sensor and link is silent for ten ticks, fewer than would be a fault here.
    rig.silent[1] = n >= 300 && n < 305;
    rig.sensor.settings.age_ticks_max = 5;
    if (n == 307) share = rig.output.record.sensor.share;
  });
  EXPECT_EQ(share, 1) << "five ticks are borne";
  ExecutorConfig config;
  config.stale_ticks_max = 100;
  Rig patient(motion, config);
  patient.sensor_frames = WithError(patient, motion, 0.1);
  (void)Orders(patient, [&](int n) {
    patient.sensor_frames = WithError(patient, motion, 0.1);
    patient.silent[1] = n >= 300 && n < 340;
    if (n == 325) share = patient.output.record.sensor.share;
  });
  EXPECT_LT(share, 0.7F);
  EXPECT_EQ(patient.output.record.faults, 0U);
}

TEST(Feedback, AJointBetweenThatMeasuresNoNumberCountsAsNotKnown) {
  Primitive<float> motion = FedBackMotion(9);
  ExecutorConfig config;
  ASSERT_TRUE(config.reactions.Set(Fault::kNonFinite, ExecutorState::kRunning, Reaction::kIgnore));
  Rig rig(motion, config);
  rig.sensor_frames = WithError(rig, motion, 0.1);
  std::vector<float> shares;
  (void)Orders(rig, [&](int n) {
    rig.sensor_frames = WithError(rig, motion, 0.1);
    rig.drives[1]->reply.velocity_rad_s =
        n >= 300 && n < 340 ? std::numeric_limits<float>::quiet_NaN() : 0;
    shares.push_back(rig.output.record.sensor.share);
  });
  EXPECT_EQ(shares[300], 1);
  EXPECT_LT(shares[325], 0.7F);
  EXPECT_TRUE(std::ranges::all_of(shares, [](float x) { return x >= 0 && x <= 1; }));
  EXPECT_EQ(shares[500], 1) << "and it comes back";
  EXPECT_EQ(rig.output.record.faults, 0U);
}

TEST(Feedback, ExecutorsRefuseAFeedbackOrASensorThatMakesNoSense) {
  const auto configured = [](const std::function<void(Primitive<float>&)>& damage,
                             const std::function<void(SensorSettings&)>& settings = {}) {
    Primitive<float> motion = FedBackMotion(2);
    if (damage) damage(motion);
    Rig rig(motion);
    if (settings) settings(rig.sensor.settings);
    rig.Reconfigure();
    return rig.configured;
  };
  EXPECT_EQ(configured({}), Status::kOk);
  constexpr auto kNan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<std::function<void(Primitive<float>&)>> damages = {
      [](auto& m) { m.feedback.knot_count = 1; },
      [](auto& m) { m.feedback.knot_count = kMaxGainKnots + 1; },
      [](auto& m) { m.feedback.knot_count = -1; },
      [](auto& m) { m.feedback.knots_s[1] = 0; },
      [](auto& m) { m.feedback.joints[1].rate_gain[2] = kNan; },
      [](auto& m) { m.feedback.joints[0].correction_rate_max_rad_s = 0; },
      [](auto& m) { m.feedback.joints[0].correction_max_rad = -1; },
      [](auto& m) { m.feedback.fade_out_s = 0; },
      [](auto& m) { m.feedback.error_max_rad = kNan; },
      [](auto& m) { m.feedback.error_min_rad = kNan; },
      [](auto& m) { m.feedback.error_min_rad = 0.2F; },
      [](auto& m) { m.feedback.error_full_rad = 0.8F; }};
  for (std::size_t i = 0; i < damages.size(); ++i)
    EXPECT_EQ(configured(damages[i]), Status::kInvalidArgument) << i;
  EXPECT_EQ(configured({}, [](SensorSettings& s) { s.tilt_sine_max = 0; }),
            Status::kInvalidArgument);
}

}  // namespace
}  // namespace tumbler
