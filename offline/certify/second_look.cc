#include "offline/certify/second_look.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>
#include <utility>

#include "common/core/index.h"
#include "common/files/primitive_toml.h"
#include "offline/certify/driven_motion.h"
#include "offline/problem/take_free.h"
#include "offline/scene/passive_limits.h"
#include "offline/scene/self_clearance.h"

namespace tumbler {
namespace {

/// The state of all degrees of freedom at one instant.
struct Instant {
  std::vector<double> q, qd;
  SpaceMatrix axes = SpaceMatrix::Identity();  ///< Of a root in space.
  template <class Space>
  void Take(const MotionSampleIn<Space>& sample) {
    q = sample.q;
    qd = sample.qd;
    axes = sample.orientation;
  }
  [[nodiscard]] CostPoint point() const { return {q, qd, {}, &axes}; }
};

bool AsksForValue(const CostTerm& term) {
  return term.kind == CostTerm::Kind::kSquare && term.weight > 0;
}

PurposeFigure FigureOf(const CostTerm& term, const Instant& at, PurposeTarget::When when) {
  PurposeFigure figure{{term.of(), when, term.target, term.tolerance, term.time_s, term.point.link,
                        term.point.point_m},
                       term.Result(at.point())};
  if (term.quantity.present()) {
    figure.link = term.quantity.link;
    figure.in_space = term.quantity.in_link;
    figure.along = term.quantity.direction;
  }
  return figure;
}

/// @param drives  through which it was played; none: with exact joints.
std::string ToText(const SecondLook::Leaving& leaving, const std::optional<DriveGains>& drives) {
  const PurposeFigure& figure = leaving.figure;
  std::string what =
      fmt::format("the robot is not where it is asked to be {:.1f} s after the end: {}: {}",
                  leaving.after_s, PurposeTarget::kOfNames[Index(static_cast<int>(figure.of))],
                  figure.AskedAndGot(figure.result));
  if (!drives) return what;
  const Disturbance& by = leaving.disturbance;
  return fmt::format("{} and through drives of {} N m/rad and {} N m s/rad, {}",
                     by.slope_rad != 0
                         ? fmt::format("on a floor that slopes by {} mrad", 1e3 * by.slope_rad)
                         : fmt::format("from a start that leans by {} mrad", 1e3 * by.lean_rad),
                     drives->kp_nm_per_rad, drives->kd_nm_s_per_rad, what);
}

}  // namespace

bool SecondLook::acceptable() const {
  return finite && torque_excess <= 0 && peak_penetration_m < layer_m &&
         self_clearance_m >= clearance_m - kClearanceTolerance_m && passive_excess <= 0 &&
         std::ranges::all_of(purpose, &PurposeFigure::met) && !leaving;
}

std::string SecondLook::Objections() const {
  if (!finite) return "the motion leaves every plausible range";
  std::vector<std::string> reasons;
  for (const PurposeFigure& figure : purpose) {
    if (figure.met()) continue;
    reasons.push_back(fmt::format("{}: {}", figure.name(), figure.AskedAndGot(figure.result)));
  }
  if (leaving) reasons.push_back(ToText(*leaving, drives));
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
  if (!(passive_excess <= 0)) {
    reasons.push_back(
        fmt::format("at {:.3f} s, {}, where no stop is simulated", passive_time_s, passive_joint));
  }
  return fmt::format("{}", fmt::join(reasons, "; "));
}

bool EndsAtRest(const Problem& problem) {
  return problem.settle_s > 0 && !problem.in_empty_space() &&
         std::ranges::any_of(problem.cost, [](const CostTerm& term) {
           return AsksForValue(term) && term.when == CostTerm::When::kSettled && term.of_velocity &&
                  term.target == 0;
         });
}

bool PlayedThroughDrives(const Problem& problem) {
  const bool feeds_back = problem.robust && problem.robust->feedback;
  return !feeds_back || problem.robust->feedback->acts == FeedbackSettings::Acts::kMotion;
}

namespace {

/// Makes a SecondLook of a motion's samples.
class Looker {
 public:
  Looker(const Problem& problem, double step_s)
      : problem_(problem),
        root_dofs_(problem.WithScene([](const auto& scene) { return scene.robot.root_dofs; })),
        settled_s_(problem.duration_s + problem.settle_s),
        last_s_(settled_s_ + SettlingAfter(problem)) {
    look_.step_s = step_s;
    look_.layer_m = problem.contact().d_on_m;
    for (const CostInstant& instant : problem.instants()) {
      if (instant.when == CostTerm::When::kTime) times_.push_back({instant.time_s, {}});
    }
  }

  /// @param own  the nearest of the robot's own shapes; infinite where they are not nearer than
  ///             before, and after the settle phase.
  template <class Space>
  void Take(const MotionSampleIn<Space>& sample, const SelfClearance& own) {
    const double t = sample.time_s;
    if (t <= problem_.duration_s + 1e-9) end_.Take(sample);
    // The rollout stops at these times.
    for (auto& [time_s, instant] : times_) {
      if (std::abs(t - time_s) <= 1e-9) instant.Take(sample);
    }
    const bool solved = t <= settled_s_ + 1e-9;
    if (solved) {
      settled_.Take(sample);
      for (const double torque : sample.torque)
        look_.peak_torque_nm = std::max(look_.peak_torque_nm, std::abs(torque));
      for (const ActiveContact<Space>& contact : sample.contacts)
        look_.peak_penetration_m = std::max(look_.peak_penetration_m, contact.depth_m);
    }
    if (own.distance_m < nearest_.distance_m) {
      nearest_ = own;
      look_.self_clearance_time_s = t;
    }
    if constexpr (std::is_same_v<Space, Plane>) {
      TakePassive(sample);
    } else if (solved) {
      TakeSlip(sample);
    }
    double& excess = solved ? look_.torque_excess : look_.held_torque_excess;
    for (std::size_t j = 0; j < problem_.joints.size(); ++j) {
      const ActuatedJoint& joint = problem_.joints[j];
      const double lack = joint.motor.LackAt(sample.torque[j], sample.qd[Index(joint.dof)]);
      excess = std::max(excess, std::abs(sample.torque[j]) / joint.limits.torque_max_nm + lack - 1);
    }
    later_.Take(sample);
    for (int i = 0; t >= last_s_ - kRestWatched_s && i < root_dofs_; ++i)
      speed_ = std::max(speed_, std::abs(sample.qd[Index(i)]));
  }

  SecondLook Finish() {
    const auto is_number = [](double value) { return std::isfinite(value); };
    look_.finite =
        std::ranges::all_of(later_.q, is_number) && std::ranges::all_of(later_.qd, is_number);
    look_.self_clearance_m = nearest_.distance_m;
    look_.clearance_m = problem_.self_contact().clearance_m;
    if (std::isfinite(nearest_.distance_m)) {
      look_.self_clearance_of = problem_.WithScene(
          [this](const auto& scene) { return NameOf(scene.robot, nearest_.pair); });
    }
    JudgePurpose();
    return std::move(look_);
  }

 private:
  void JudgePurpose() {
    using enum PurposeTarget::When;
    const bool rests = EndsAtRest(problem_);
    // A settle phase of 2 s or more ends where the second look does.
    const bool goes_on = SettlingAfter(problem_) > 0;
    for (const CostTerm& term : problem_.cost) {
      if (!AsksForValue(term)) continue;
      if (term.when == CostTerm::When::kTime) {
        const auto at = std::ranges::find(times_, term.time_s, &std::pair<double, Instant>::first);
        look_.purpose.push_back(FigureOf(term, at->second, kTime));
        continue;
      }
      const bool at_end = term.when == CostTerm::When::kEnd;
      // A robot that still rocks when the settle phase ends has done what was asked when it then
      // comes to rest.
      const bool rest = rests && goes_on && !at_end && term.of_velocity && term.target == 0;
      if (!rest) {
        look_.purpose.push_back(FigureOf(term, at_end ? end_ : settled_, at_end ? kEnd : kSettled));
      }
      if (rests && goes_on && !at_end && (rest || !term.of_velocity))
        look_.purpose.push_back(FigureOf(term, later_, kLater));
    }
    // That a root which is fixed to the world rests says nothing.
    if (rests && root_dofs_ > 0) {
      look_.purpose.push_back(
          {{PurposeTarget::Of::kSpeed, goes_on ? kLater : kSettled, 0, kRestSpeed}, speed_});
    }
  }

  /// Adds how far shapes that carry weight slide in a step on what they touch.
  void TakeSlip(const SpaceSample& sample) {
    constexpr double kCarries = 0.02;  // of the weight
    const SpaceRobot& robot = problem_.space->scene.robot;
    const double carried_n = kCarries * robot.mass_kg() * robot.tree.gravity.norm();
    const double step_s = sample.time_s - slipped_until_s_;
    slipped_until_s_ = sample.time_s;
    if (!look_.slip_m) look_.slip_m = 0;
    for (auto& [of, slip] : slips_) slip.normal_force_n = slip.speed_m_s = 0;
    for (const ActiveContact<Spatial>& contact : sample.contacts) {
      const auto velocity_of = [&](int shape) {
        return sample.dynamics->velocity(robot.shapes[Index(shape)].body).At(contact.point);
      };
      SpaceVector v = velocity_of(contact.shape);
      if (contact.other_shape >= 0) v -= velocity_of(contact.other_shape);
      Slip& slip = slips_[{contact.shape, contact.obstacle, contact.other_shape}];
      slip.normal_force_n += contact.normal_force_n;
      slip.speed_m_s =
          std::max(slip.speed_m_s, (v - contact.normal.dot(v) * contact.normal).norm());
    }
    for (auto& [of, slip] : slips_) {
      if (slip.normal_force_n < carried_n) continue;
      slip.sum_m += step_s * slip.speed_m_s;
      if (slip.sum_m <= *look_.slip_m) continue;
      look_.slip_m = slip.sum_m;
      look_.slip_of = robot.shapes[Index(of[0])].name;
    }
  }

  void TakePassive(const MotionSample& sample) {
    const PassiveExcess passive = FarthestPassive(problem_.scene.robot, sample.q);
    if (!(passive.by > look_.passive_excess)) return;
    look_.passive_excess = passive.by;
    look_.passive_time_s = sample.time_s;
    look_.passive_joint = Describe(passive, problem_.scene.robot);
  }

  const Problem& problem_;
  int root_dofs_;
  double settled_s_, last_s_;
  SecondLook look_;
  SelfClearance nearest_;
  Instant end_, settled_, later_;
  std::vector<std::pair<double, Instant>> times_;  // at which the cost looks, too
  double speed_ = 0;
  /// Of a shape on one thing that it touches, at several points where it is a box.
  struct Slip {
    double normal_force_n = 0;  // now, of all points
    double speed_m_s = 0;       // now, of the point that slides fastest
    double sum_m = 0;
  };
  std::map<std::array<int, 3>, Slip> slips_;  // by shape, obstacle and other shape
  double slipped_until_s_ = 0;
};

/// Sees whether a robot at rest stays where it is asked to be.
class StayWatch {
 public:
  explicit StayWatch(const Problem& problem) : problem_(problem), at_rest_(problem.start_q.size()) {
    Instant start{problem.start_q, at_rest_};
    if (problem.space) start.axes = problem.space->start_orientation;
    for (const CostTerm& term : problem.cost) {
      if (!AsksForValue(term) || term.of_velocity || term.when != CostTerm::When::kSettled)
        continue;
      asked_.push_back({&term, FigureOf(term, start, PurposeTarget::When::kLater)});
    }
  }

  /// Where it does not, what it leaves; none else.
  /// @param axes  of a root in space; null in the plane.
  std::optional<SecondLook::Leaving> Leaves(double time_s, std::span<const double> q,
                                            const Disturbance& disturbance,
                                            const SpaceMatrix* axes = nullptr) {
    const double after_s = time_s - problem_.duration_s;
    if (after_s < ExitAfter(problem_)) return {};
    for (auto& [term, figure] : asked_) {
      figure.result = term->Result({q, at_rest_, {}, axes});
      if (!figure.met()) return SecondLook::Leaving{after_s, figure, disturbance};
    }
    return {};
  }

 private:
  const Problem& problem_;
  std::vector<double> at_rest_;
  std::vector<std::pair<const CostTerm*, PurposeFigure>> asked_;
};

/// Looks whether a robot at rest stays there. One that has a feedback in the hold is simulated with
/// joints that are held exactly, with the solver's step: nothing is fast any more.
/// @param torques  the plan's.
void LookWhetherItStays(const Problem& problem, const std::vector<double>& x,
                        const TorqueSamples& torques, SecondLook& look) {
  StayWatch watch(problem);
  if (!PlayedThroughDrives(problem)) {
    Rollout rollout(problem, problem.solver.step_s);
    rollout.Visit(x, kStays_s - problem.settle_s, [&](const MotionSample& sample) {
      if (!look.leaving) look.leaving = watch.Leaves(sample.time_s, sample.q, {});
    });
    return;
  }
  look.drives = problem.drive_gains();
  std::vector<JointMotion<double>::Spline> feed_forward;
  for (std::size_t j = 0; j < problem.joints.size(); ++j)
    feed_forward.push_back(FeedForward(problem, torques, j));
  const double until_s = problem.duration_s + (problem.space ? kStaysInSpace_s : kStays_s);
  // What is told is the first disturbance by which the robot does not stay.
  std::array<std::optional<SecondLook::Leaving>, kDisturbances.size()> leaving;
  std::size_t last = kDisturbances.size();  // those from here on are of no interest
  const auto stays = [&](std::size_t which, double time_s, std::span<const double> q) {
    if (which >= last) return false;
    leaving[which] = watch.Leaves(time_s, q, kDisturbances[which]);
    if (leaving[which]) last = which;
    return !leaving[which];
  };
  if (problem.space) {
    for (const Disturbance& disturbance : kDisturbances) {
      const bool plausible = PlayThroughDrivesInSpace(
          problem, x, feed_forward, NominalInSpace(problem, disturbance), until_s,
          [&](const DrivenSample& at) {
            look.leaving = watch.Leaves(at.time_s, at.q, disturbance, at.axes);
            return !look.leaving;
          });
      look.finite = look.finite && plausible;
      if (look.leaving || !plausible) return;
    }
    return;
  }
  const std::vector<bool> plausible =
      PlayThroughDrives(problem, x, feed_forward, kDisturbances, until_s, stays);
  for (std::size_t i = 0; i < kDisturbances.size(); ++i) {
    // What leaves every plausible range is nowhere that can be said.
    look.leaving = leaving[i];
    look.finite = look.finite && plausible[i];
    if (look.leaving || !plausible[i]) return;
  }
}

}  // namespace

FineLook LookFinely(Problem problem, std::vector<double> x, std::optional<double> refinement) {
  TakeFree(problem, x);
  const double finer = refinement.value_or(RefinementOf(problem));
  const double step_s = problem.solver.step_s / finer;
  Looker looker(problem, step_s);
  MotionSummarizer summarizer(problem, finer);
  VisitWithOwnDistance(problem, x, step_s,
                       [&](const auto& sample, const SelfClearance& own, double least_m) {
                         looker.Take(sample, own);
                         summarizer.Take(sample, least_m);
                       });
  FineLook fine{looker.Finish(), summarizer.Finish()};
  if (EndsAtRest(problem) && SettlingAfter(problem) > 0 && fine.look.acceptable())
    LookWhetherItStays(problem, x, fine.summary.torques, fine.look);
  return fine;
}

SecondLook LookAgain(const Problem& problem, const std::vector<double>& x,
                     std::optional<double> refinement) {
  return LookFinely(problem, x, refinement).look;
}

}  // namespace tumbler
