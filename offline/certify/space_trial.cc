#include "offline/certify/space_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>

#include "offline/problem/space_task.h"
#include "offline/problem/task_frame.h"
#include "offline/scene/packet.h"

namespace tumbler {

std::vector<DueInSpace> DueTargetsInSpace(const Problem& problem,
                                          std::span<const PurposeFigure> purpose) {
  std::vector<DueInSpace> due;
  for (const PurposeFigure& figure : purpose) {
    PurposeGauge gauge(figure, problem.space->scene.robot);
    if (!gauge.obstacle().empty()) {
      throw std::invalid_argument(
          fmt::format("purpose: '{}' cannot be judged: {}", figure.name(), gauge.obstacle()));
    }
    due.push_back(
        {figure, std::move(gauge), DueTime(figure, problem.duration_s, problem.settle_s)});
  }
  return due;
}

double LastDue(const JudgedMotion& motion) {
  if (motion.targets.empty()) return motion.problem->duration_s + motion.problem->settle_s;
  return std::ranges::max(motion.targets, {}, &DueInSpace::time_s).time_s;
}

namespace {

/// Judges motions while they are played.
class SpaceJudge {
 public:
  explicit SpaceJudge(std::span<const JudgedMotion> motions) : motions_(motions) {
    for (const JudgedMotion& motion : motions) {
      first_.push_back(trial.purpose.size());
      for (const DueInSpace& due : motion.targets) trial.purpose.push_back({due.target, {}});
    }
  }

  /// @returns whether to go on.
  bool Look(std::size_t which, const DrivenSample& at) {
    if (which != now_) {
      if (std::ranges::any_of(OfNow(), &SpaceJudge::Fails)) return false;
      now_ = trial.ended_in = which;
      began_ = false;
    }
    if (!began_) Begin(at);
    bool placed = false;
    const JudgedMotion& motion = motions_[now_];
    for (std::size_t i = 0; i < motion.targets.size(); ++i) {
      const double until_s = Until(motion.targets[i]);
      if (at.time_s > until_s + 1e-9 || at.time_s <= until_s - kRestWatched_s) continue;
      if (!std::exchange(placed, true)) Place(at);
      const DueInSpace& due = motion.targets[i];
      JudgedTarget& judged = OfNow()[i];
      const double value = due.gauge.At(q_, qd_, axes_);
      const bool speed = due.target.of == PurposeTarget::Of::kSpeed;
      judged.Judge(speed && judged.result ? std::max(*judged.result, value) : value);
    }
    return true;
  }

  /// The motion's targets from now on have no result.
  void LoseNow() {
    for (JudgedTarget& judged : OfNow()) judged.result.reset();
  }

  SpaceTrial trial;

 private:
  [[nodiscard]] std::span<JudgedTarget> OfNow() {
    return std::span(trial.purpose).subspan(first_[now_], motions_[now_].targets.size());
  }

  static bool Fails(const JudgedTarget& judged) { return !judged.met().value_or(false); }

  [[nodiscard]] double Until(const DueInSpace& due) const {
    const JudgedMotion& motion = motions_[now_];
    if (now_ + 1 == motions_.size())
      return due.lasts() && motion.hold_s > 0 ? LastDue(motion) + motion.hold_s : due.time_s;
    const double end_s = motion.problem->duration_s + motion.hold_s;
    return due.lasts() ? end_s : std::min(due.time_s, end_s);
  }

  void Begin(const DrivenSample& at) {
    began_ = true;
    const Problem& problem = *motions_[now_].problem;
    const PrimitivePose entry =
        ToPrimitivePose({problem.start_q, problem.space->start_orientation});
    frame_ = TaskFrame(entry, at.q[0], at.q[1], *at.axes);
  }

  void Place(const DrivenSample& at) {
    q_.assign(at.q.begin(), at.q.end());
    qd_.assign(at.qd.begin(), at.qd.end());
    axes_ = *at.axes;
    frame_.Enter(q_, qd_, axes_);
  }

  std::span<const JudgedMotion> motions_;
  std::vector<std::size_t> first_;  // target of each motion
  std::size_t now_ = 0;             // the motion
  bool began_ = false;
  TaskFrame frame_;
  std::vector<double> q_, qd_;
  SpaceMatrix axes_ = SpaceMatrix::Identity();
};

}  // namespace

std::vector<SpaceTrial> TryInSpace(std::span<const JudgedMotion> motions,
                                   std::span<const PlayedRobot<Spatial>> played,
                                   const std::atomic<bool>* interrupt) {
  std::vector<DrivenMotion> driven;
  for (const JudgedMotion& motion : motions) {
    const double lightest_kg =
        motion.lightest_kg > 0 ? motion.lightest_kg : LightestContact(*motion.problem, *motion.x);
    driven.push_back({motion.problem, motion.x, motion.feed_forward,
                      motion.problem->duration_s + motion.hold_s, lightest_kg});
  }
  const JudgedMotion& last = motions.back();
  driven.back().until_s = LastDue(last) + last.hold_s + last.problem->solver.step_s;
  std::vector<SpaceTrial> trials;
  for (std::size_t first = 0; first < played.size(); first += Packet::kLanes) {
    const auto some = played.subspan(first, std::min(Packet::kLanes, played.size() - first));
    std::vector<SpaceJudge> judges(some.size(), SpaceJudge(motions));
    const std::vector<bool> finite = PlayThroughDrivesInSpace(
        driven, some, [&](std::size_t i, std::size_t motion, const DrivenSample& at) {
          return (interrupt == nullptr || !*interrupt) && judges[i].Look(motion, at);
        });
    for (std::size_t i = 0; i < some.size(); ++i) {
      judges[i].trial.finite = finite[i];
      if (!finite[i]) judges[i].LoseNow();
      trials.push_back(std::move(judges[i].trial));
    }
  }
  return trials;
}

std::vector<SpaceTrial> TryInSpace(const Problem& problem, const std::vector<double>& x,
                                   std::span<const JointMotion<double>::Spline> feed_forward,
                                   std::span<const DueInSpace> targets,
                                   std::span<const PlayedRobot<Spatial>> played, double hold_s) {
  const JudgedMotion motion{&problem, &x, feed_forward, targets, hold_s};
  return TryInSpace({&motion, 1}, played);
}

}  // namespace tumbler
