#include "offline/certify/space_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

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

double LastDue(std::span<const DueInSpace> targets) {
  double last_s = 0;
  for (const DueInSpace& due : targets) last_s = std::max(last_s, due.time_s);
  return last_s;
}

SpaceTrial TryInSpace(const Problem& problem, const std::vector<double>& x,
                      std::span<const JointMotion<double>::Spline> feed_forward,
                      std::span<const DueInSpace> targets, const PlayedRobot<Spatial>& played,
                      double hold_s) {
  SpaceTrial trial;
  for (const DueInSpace& due : targets) trial.purpose.push_back({due.target, std::nullopt});
  const double last_s = LastDue(targets);
  const auto judge = [&](const DrivenSample& at) {
    for (std::size_t i = 0; i < targets.size(); ++i) {
      const DueInSpace& due = targets[i];
      const double until_s = due.lasts() && hold_s > 0 ? last_s + hold_s : due.time_s;
      if (at.time_s > until_s + 1e-9) continue;
      JudgedTarget& judged = trial.purpose[i];
      const double value = due.gauge.At(at.q, at.qd, *at.axes);
      const bool speed = due.target.of == PurposeTarget::Of::kSpeed;
      const bool watched = speed && at.time_s > until_s - kRestWatched_s && judged.result;
      judged.Judge(watched ? std::max(*judged.result, value) : value);
    }
    return true;
  };
  trial.finite = PlayThroughDrivesInSpace(problem, x, feed_forward, played,
                                          last_s + hold_s + problem.solver.step_s, judge);
  if (!trial.finite) {
    for (JudgedTarget& judged : trial.purpose) judged.result.reset();
  }
  return trial;
}

}  // namespace tumbler
