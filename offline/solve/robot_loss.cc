#include "offline/solve/robot_loss.h"

#include <algorithm>
#include <cmath>

#include "common/core/index.h"

namespace tumbler {

RobotLoss::RobotLoss(const Problem& problem) : target_rad_(*problem.target_pitch_rad) {
  for (const CostTerm& term : problem.cost) {
    if (term.targets_pitch() && term.when == CostTerm::When::kSettled)
      tolerance_rad_ = term.tolerance;
  }
  for (const CostTerm& term : problem.cost) {
    const bool place = term.kind == CostTerm::Kind::kSquare && !term.of_velocity &&
                       term.dof < static_cast<int>(kPitch);
    if (!place || term.when != CostTerm::When::kSettled || term.weight <= 0) continue;
    places_.push_back({Index(term.dof), term.target, tolerance_rad_ / term.tolerance});
  }
}

template <class P>
std::array<double, P::kLanes> RobotLoss::Off(const LaneState<P>& state) const {
  std::array<double, P::kLanes> off;
  for (std::size_t lane = 0; lane < off.size(); ++lane) {
    off[lane] = std::abs(state.q[kPitch].lane(lane) - target_rad_);
    for (const Place& place : places_) {
      const double error_m = state.q[place.dof].lane(lane) - place.target_m;
      off[lane] = std::max(off[lane], std::abs(error_m) * place.rad_per_m);
    }
    if (!std::isfinite(off[lane])) off[lane] = 1e3;
  }
  return off;
}

template std::array<double, Packet::kLanes> RobotLoss::Off(const LaneState<Packet>&) const;
template std::array<double, WidePacket::kLanes> RobotLoss::Off(const LaneState<WidePacket>&) const;

template <class P>
std::array<double, P::kLanes> RobotLoss::Divergence(const LaneState<P>& state) const {
  constexpr double kMost_rad_s = 20;
  std::array<double, P::kLanes> divergence;
  for (std::size_t lane = 0; lane < divergence.size(); ++lane) {
    const double off_rad = state.q[kPitch].lane(lane) - target_rad_;
    const double rate_rad_s = kFalls_per_s * off_rad + state.v[kPitch].lane(lane);
    divergence[lane] =
        std::isfinite(rate_rad_s) ? std::clamp(rate_rad_s, -kMost_rad_s, kMost_rad_s) : kMost_rad_s;
  }
  return divergence;
}
template std::array<double, Packet::kLanes> RobotLoss::Divergence(const LaneState<Packet>&) const;
template std::array<double, WidePacket::kLanes> RobotLoss::Divergence(
    const LaneState<WidePacket>&) const;

double RobotLoss::Of(double settled, double off, double speed, double astray) const {
  const double t = 0.96 * tolerance_rad_, w = 1.2 * CostTerm::kRateTolerance;
  if (off < t && settled < t && speed < w) {
    const double still = settled / tolerance_rad_, slow = speed / w;
    return 0.1 * (still * still) + 0.1 * (slow * slow);
  }
  if (off < 1.7 * tolerance_rad_ && speed < 1)
    return 0.35 + 0.15 * std::min(1.0, settled / (2 * tolerance_rad_)) + 0.15 * speed;
  // A robot that stays near for a while is better than one that never came near.
  return 1 + 0.2 * astray + 0.1 * std::min(1.0, off / 3);
}

}  // namespace tumbler
