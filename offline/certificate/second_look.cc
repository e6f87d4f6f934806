#include "offline/certificate/second_look.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "common/index.h"
#include "common/primitive_toml.h"
#include "offline/scene/self_clearance.h"

namespace tumbler {
namespace {

/// The state of all degrees of freedom at one instant.
struct Instant {
  std::vector<double> q, qd;
  void Take(const MotionSample& sample) {
    q = sample.q;
    qd = sample.qd;
  }
};

bool AsksForValue(const CostTerm& term) {
  return term.kind == CostTerm::Kind::kSquare && term.weight > 0;
}

PurposeFigure FigureOf(const CostTerm& term, const Instant& at, PurposeTarget::When when) {
  return {{term.of(), when, term.target, term.tolerance},
          (term.of_velocity ? at.qd : at.q)[Index(term.dof)]};
}

}  // namespace

bool SecondLook::acceptable() const {
  return finite && torque_excess <= 0 && peak_penetration_m < layer_m &&
         self_clearance_m >= clearance_m - kClearanceTolerance_m &&
         std::ranges::all_of(purpose, &PurposeFigure::met);
}

std::string SecondLook::Objections() const {
  if (!finite) return "the motion leaves every plausible range";
  std::vector<std::string> reasons;
  for (const PurposeFigure& figure : purpose) {
    if (figure.met()) continue;
    reasons.push_back(fmt::format("{}: {}", figure.name(), figure.AskedAndGot(figure.result)));
  }
  if (!(torque_excess <= 0))
    reasons.push_back(fmt::format("a torque is {:.2g} % above its limit", 100 * torque_excess));
  if (!(peak_penetration_m < layer_m)) {
    reasons.push_back(fmt::format("a contact goes {:.2f} mm deep, through the layer of {:.2f} mm",
                                  1e3 * peak_penetration_m, 1e3 * layer_m));
  }
  if (!(self_clearance_m >= clearance_m - kClearanceTolerance_m)) {
    reasons.push_back(fmt::format(
        "the robot's own shapes {} {} {:.1f} mm at {:.3f} s, and have to stay {:.3g} mm apart",
        self_clearance_of, self_clearance_m < 0 ? "overlap by" : "come as near as",
        1e3 * std::abs(self_clearance_m), self_clearance_time_s, 1e3 * clearance_m));
  }
  return fmt::format("{}", fmt::join(reasons, "; "));
}

bool EndsAtRest(const Problem& problem) {
  return problem.settle_s > 0 && !problem.scene.obstacles.empty() &&
         std::ranges::any_of(problem.cost, [](const CostTerm& term) {
           return AsksForValue(term) && term.when == CostTerm::When::kSettled && term.of_velocity &&
                  term.target == 0;
         });
}

SecondLook LookAgain(const Problem& problem, const std::vector<double>& x, double refinement) {
  SecondLook look;
  look.step_s = problem.solver.step_s / refinement;
  look.layer_m = problem.scene.contact.d_on_m;
  Instant end, settled, later;
  double speed = 0;
  const double last_s = problem.duration_s + problem.settle_s + SettlingAfter(problem);
  const double settled_s = problem.duration_s + problem.settle_s;
  const PlanarRobot& robot = problem.scene.robot;
  SelfDistances distances(robot, problem.scene.self_contact.pairs);
  SelfClearance nearest;
  Rollout rollout(problem, look.step_s);
  rollout.Visit(x, SettlingAfter(problem), [&](const MotionSample& sample) {
    const double t = sample.time_s;
    if (t <= problem.duration_s + 1e-9) end.Take(sample);
    if (t <= settled_s + 1e-9) {
      settled.Take(sample);
      for (const double torque : sample.torque)
        look.peak_torque_nm = std::max(look.peak_torque_nm, std::abs(torque));
      for (const ActiveContact<Plane>& contact : sample.contacts)
        look.peak_penetration_m = std::max(look.peak_penetration_m, contact.depth_m);
      const SelfClearance own = distances.Nearest(sample.q);
      if (own.distance_m < nearest.distance_m) {
        nearest = own;
        look.self_clearance_time_s = t;
      }
    }
    double& excess = t <= settled_s + 1e-9 ? look.torque_excess : look.held_torque_excess;
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      excess =
          std::max(excess, std::abs(sample.torque[j]) / problem.joints[j].limits.torque_max_nm - 1);
    }
    later.Take(sample);
    for (int i = 0; t >= last_s - kRestWatched_s && i < robot.root_dofs; ++i)
      speed = std::max(speed, std::abs(sample.qd[Index(i)]));
  });
  const auto is_number = [](double value) { return std::isfinite(value); };
  look.finite = std::ranges::all_of(later.q, is_number) && std::ranges::all_of(later.qd, is_number);

  look.self_clearance_m = nearest.distance_m;
  look.clearance_m = problem.scene.self_contact.clearance_m;
  if (std::isfinite(nearest.distance_m)) look.self_clearance_of = NameOf(robot, nearest.pair);

  using enum PurposeTarget::When;
  const bool rests = EndsAtRest(problem);
  // A settle phase of 2 s or more ends where the second look does.
  const bool goes_on = SettlingAfter(problem) > 0;
  for (const CostTerm& term : problem.cost) {
    if (!AsksForValue(term)) continue;
    const bool at_end = term.when == CostTerm::When::kEnd;
    // A robot that still rocks when the settle phase ends has done what was asked when it then
    // comes to rest.
    const bool rest = rests && goes_on && !at_end && term.of_velocity && term.target == 0;
    if (!rest) {
      look.purpose.push_back(FigureOf(term, at_end ? end : settled, at_end ? kEnd : kSettled));
    }
    if (rests && goes_on && !at_end && (rest || !term.of_velocity))
      look.purpose.push_back(FigureOf(term, later, kLater));
  }
  if (rests) {
    look.purpose.push_back(
        {{PurposeTarget::Of::kSpeed, goes_on ? kLater : kSettled, 0, kRestSpeed}, speed});
  }
  return look;
}

}  // namespace tumbler
