#include "offline/solve/motion_feedback.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "common/core/index.h"
#include "offline/problem/link_chains.h"
#include "offline/solve/tick_spline.h"

namespace tumbler {
namespace {

/// Gains of a feedback in the motion, for one of the variables that stand for them, whose standard
/// deviation is 1 at first. With a tenth of it nothing is found that is better than no feedback.
constexpr double kMotionAngleGain = 2, kMotionRateGain = 0.2;
/// The largest gains that are tried.
constexpr double kLargestAngleGain = 20, kLargestRateGain = 5;
/// When after a motion a feedback of the hold sets in, and how long it takes.
constexpr double kHoldBegins_s = 0.2, kHoldRise_s = 0.1;
/// The dead zone of a feedback that acts in the motion alone, and where it has ended: several times
/// a sensor's noise. With one of the hold it is that.
constexpr double kErrorMin_rad = 0.02, kErrorFull_rad = 0.06;
/// Where the fed-back angle is off by more, nothing is corrected, and how fast feedback fades.
constexpr double kErrorMax_rad = 0.6, kStartErrorMax_rad = 0.2, kFade_s = 0.05;
/// An angle beyond this is that of a simulation that has gone astray [rad].
constexpr double kFarthest_rad = 50;

/// Two knots more.
void AddHoldKnots(double duration_s, int knots, Feedback<double>& law) {
  law.knots_s[Index(knots)] = duration_s + kHoldBegins_s;
  law.knots_s[Index(knots + 1)] = duration_s + kHoldBegins_s + kHoldRise_s;
  law.knot_count = knots + 2;
}

/// The spline through angles of every tick, with the knots of the feed-forward, which ends at one
/// more, the last of them.
Feedback<double>::Spline FitAngle(double duration_s, const std::vector<double>& angles) {
  const TickSpline spline(duration_s, static_cast<int>(angles.size()) - 2);
  std::vector<double> points = spline.Fit({angles.begin(), angles.end() - 1});
  points.back() = angles.back();
  return spline.With(points);
}

}  // namespace

MotionFeedback::MotionFeedback(const RobustTask& task, const RobustMotion& motion,
                               const Ensemble& model)
    : task_(task), motion_(motion), model_(model) {}

std::size_t MotionFeedback::gains() const {
  return 2 * task_.joints * Index(task_.settings.feedback->knots);
}

void MotionFeedback::Add(const std::vector<std::vector<double>>& motions,
                         const Feedback<double>& hold, std::vector<MotionPlan>& plans) const {
  const int knots = task_.settings.feedback->knots;
  const std::vector<std::vector<double>> angles = Angles(motions, plans);
  for (std::size_t m = 0; m < motions.size(); ++m) {
    Feedback<double>& law = plans[m].feedback;
    const double duration_s = motion_.Duration_s(motions[m]);
    law = WithoutGains(duration_s, angles[m]);
    law.error_min_rad = hold.error_min_rad;
    law.error_full_rad = hold.error_full_rad;
    for (int k = 0; k < knots; ++k)
      law.knots_s[Index(k)] = k + 1 < knots ? duration_s * k / (knots - 1) : duration_s;
    AddHoldKnots(duration_s, knots, law);
    const double* x = motions[m].data() + motion_.count();
    const auto read = [&](double gain, double largest, auto& gains) {
      for (int k = 0; k < knots; ++k) gains[Index(k)] = std::clamp(gain * *x++, -largest, largest);
    };
    for (std::size_t j = 0; j < task_.joints; ++j) {
      JointFeedback<double>& joint = law.joints[j];
      read(kMotionAngleGain, kLargestAngleGain, joint.angle_gain);
      read(kMotionRateGain, kLargestRateGain, joint.rate_gain);
      const auto last = Index(hold.knot_count - 1);
      joint.angle_gain[Index(knots + 1)] = hold.joints[j].angle_gain[last];
      joint.rate_gain[Index(knots + 1)] = hold.joints[j].rate_gain[last];
    }
  }
}

Feedback<double> MotionFeedback::NoHold(double duration_s) {
  Feedback<double> law;
  AddHoldKnots(duration_s, 1, law);
  law.error_min_rad = kErrorMin_rad;
  law.error_full_rad = kErrorFull_rad;
  return law;
}

Feedback<double> MotionFeedback::Along(const Feedback<double>& law, const std::vector<double>& x,
                                       const MotionPlan& plan) const {
  Feedback<double> along = law;
  along.link = FixedString<32>(task_.settings.feedback->link);
  along.angle = FitAngle(motion_.Duration_s(x), Angles({x}, {&plan, 1}).front());
  return along;
}

HoldStudy MotionFeedback::StudyHold(const std::vector<double>& x, const MotionPlan& plan,
                                    const Ensemble& robots) const {
  const Problem& problem = task_.problem;
  const double duration_s = motion_.Duration_s(x);
  const int first = motion_.Ticks(x);
  LaneSteps rough = RobustTask::kRough;
  rough.per_tick *=
      FinerStepsFor(problem.scene.contact, task_.settings.spreads, task_.settings.polish_scale);
  HoldStudy study{task_.kernel,
                  task_.lanes.model,
                  rough,
                  task_.joints,
                  {},
                  {},
                  first,
                  problem.settle_s,
                  task_.loss.target_rad(),
                  problem.following_tolerance_rad,
                  *task_.settings.feedback,
                  WithoutGains(duration_s, Angles({x}, {&plan, 1}).front())};
  AddHoldKnots(duration_s, 1, study.law);
  PacketSetpoints setpoints(Index(first + 1) * task_.joints);
  motion_.Sample(x, Index(first + 1), RobustTask::kTick_s, [&](std::size_t i, const auto& at) {
    setpoints[i] = {Packet::Of(at.value), Packet::Of(at.first),
                    Packet::Of(plan.FeedForward(i, task_.joints))};
  });
  const auto split = setpoints.begin() + first * static_cast<std::ptrdiff_t>(task_.joints);
  study.setpoints.assign(split, setpoints.end());
  setpoints.erase(split, setpoints.end());
  for (std::size_t p = 0; p < robots.robots.size(); ++p) {
    HeldRobots packet{robots.robots[p], robots.states[p], robots.held};
    LaneWatch<Packet> watch;
    task_.kernel.drive(task_.lanes.model, packet.robots, robots.steps, setpoints, packet.held,
                       packet.state, watch);
    study.packets.push_back(packet);
  }
  return study;
}

/// What the link's absolute angle is of the joints' angles, beside the root's pitch.
std::vector<double> MotionFeedback::Chain() const {
  const std::vector<LinkChain> chains = LinkChainsOf(task_.problem.scene.robot);
  return std::ranges::find(chains, task_.settings.feedback->link, &LinkChain::link)->joints;
}

/// The law but for its gains, along angles of every tick.
Feedback<double> MotionFeedback::WithoutGains(double duration_s,
                                              const std::vector<double>& angles) const {
  const FeedbackSettings& settings = *task_.settings.feedback;
  const std::vector<double> chain = Chain();
  Feedback<double> law;
  law.link = FixedString<32>(settings.link);
  law.angle = FitAngle(duration_s, angles);
  law.error_max_rad = kErrorMax_rad;
  law.start_error_max_rad = kStartErrorMax_rad;
  law.fade_in_s = law.fade_out_s = kFade_s;
  for (std::size_t j = 0; j < task_.joints; ++j) {
    law.joints[j].chain = chain[j];
    law.joints[j].correction_max_rad = settings.correction_max_rad;
    law.joints[j].correction_rate_max_rad_s = settings.correction_rate_max_rad_s;
  }
  return law;
}

/// The absolute angle of the link in every tick of motions, each on the model in a lane of its own;
/// and the angle at the end of the settle phase behind them.
std::vector<std::vector<double>> MotionFeedback::Angles(
    const std::vector<std::vector<double>>& motions, std::span<const MotionPlan> plans) const {
  const std::size_t joints = task_.joints;
  const std::vector<double> chain = Chain();
  int longest = 0;
  for (const std::vector<double>& x : motions) longest = std::max(longest, motion_.Ticks(x));
  const auto count = Index(longest + RobustTask::Ticks(task_.problem.settle_s));
  PacketSetpoints setpoints(count * joints);
  for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
    const std::size_t m = std::min(lane, motions.size() - 1);
    motion_.Sample(motions[m], count, RobustTask::kTick_s, [&](std::size_t i, const auto& at) {
      setpoints[i].position.set_lane(lane, at.value);
      setpoints[i].velocity.set_lane(lane, at.first);
      setpoints[i].third.set_lane(lane, plans[m].FeedForward(i, joints));
    });
  }
  LaneState<Packet> state = model_.states.front();
  HeldSetpoints<Packet> held = model_.held;
  LaneWatch<Packet> watch;
  std::vector<std::vector<double>> angles(motions.size());
  const auto note = [&](std::size_t m) {
    double angle = state.q[RobotLoss::kPitch].lane(m);
    for (std::size_t j = 0; j < joints; ++j) angle += chain[j] * state.q[j + 3].lane(m);
    angles[m].push_back(std::isfinite(angle) ? std::clamp(angle, -kFarthest_rad, kFarthest_rad)
                                             : 0);
  };
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t m = 0; m < motions.size(); ++m) {
      if (static_cast<int>(k) <= motion_.Ticks(motions[m])) note(m);
    }
    task_.kernel.drive(task_.lanes.model, model_.robots.front(), RobustTask::kFine,
                       std::span(setpoints).subspan(k * joints, joints), held, state, watch);
  }
  for (std::size_t m = 0; m < motions.size(); ++m) note(m);
  return angles;
}

}  // namespace tumbler
