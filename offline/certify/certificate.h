#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/motion_sample.h"
#include "offline/scene/self_clearance.h"
#include "offline/scene/step_grid.h"
#include "offline/solve/constraints.h"
#include "offline/solve/solver.h"

namespace tumbler {

/// How far an analytic gradient is from differences of the same computation.
struct GradientCheck {
  /// Steps of the central differences [rad]: curvature spoils large ones, rounding small ones.
  static constexpr std::array<double, 3> kSteps = {1e-5, 1e-6, 1e-7};
  /// For each step: the largest difference along any direction, divided by the largest component of
  /// the gradient (of either, where they are compared component by component). Infinite where a
  /// difference is not finite.
  std::array<double, 3> errors{};

  /// The best agreement.
  [[nodiscard]] double relative_error() const {
    return *std::min_element(errors.begin(), errors.end());
  }
};

/// A larger gradient error than this is worth a warning. Where the cost is smooth, the differences
/// agree to 1e-6 and better. An error of a thousandth says that the cost does not follow its own
/// slope over 1e-5 rad, because a cliff is near, such as a contact that is made or missed by a
/// hair; and SLSQP's line search relies on that slope.
inline constexpr double kDoubtfulGradient = 1e-3;

/// Computes the costs of points.
using CostsOf = std::function<std::vector<double>(std::span<const std::vector<double>>)>;

/// Compares a gradient with central differences of three steps: along each component where there
/// are up to four, else along four directions in which every component goes forwards or backwards
/// by the step.
/// @param costs  is called once, with all points.
GradientCheck CompareGradient(const CostsOf& costs, const std::vector<double>& at,
                              const std::vector<double>& gradient);

/// The gradient of a problem's cost beside a motion, and what differences say of it.
struct GradientBeside {
  /// The motion, with each parameter moved by 0.001 rad, with alternating sign. At the optimum
  /// itself the gradient is zero, and a relative error would say nothing.
  std::vector<double> at;
  std::vector<double> gradient;
  std::optional<StepGrid> grid;  ///< Of the steps that are chosen there; none in space: equal ones.
  GradientCheck check;
};

/// The gradient is the adjoint's. Costs for the differences are simulated with the same steps, in
/// lanes where these cover the problem.
GradientBeside DifferentiateBeside(const Problem& problem, const std::vector<double>& x);

/// Relative change of the cost's gradient when the integration step is halved. It measures the
/// error of the step, as GradientCheck does that of the differentiation.
double GradientStepHalvingChange(const Problem& problem, const GradientBeside& beside);

/// Shapes that are nearer than the clearance by less than this are not: so much is rounding.
inline constexpr double kClearanceTolerance_m = 1e-6;

/// How long after a motion's end its exit is taken [s]: kExitAfter_s; on a bar, where nothing comes
/// to rest by itself, when the settle phase ends; and at once when joints move at the end.
double ExitAfter(const Problem& problem);

/// How long a motion is played on past its settle phase [s], until its exit.
double SettlingAfter(const Problem& problem);

/// How much finer certificate and second look integrate than `solver.step_s` says: by the classical
/// Runge-Kutta method with equal steps, where the solver takes another method and adaptive steps.
inline constexpr double kRefinement = 16;
/// The same in space, where the solver takes equal steps of the same method, of which the error
/// falls with the fourth power, and where an evaluation is dearer.
inline constexpr double kSpaceRefinement = 4;
inline double RefinementOf(const Problem& problem) {
  return problem.space ? kSpaceRefinement : kRefinement;
}
/// After the settle phase, where joints are held and a robot rocks or comes to rest, steps in the
/// plane are so many times as long as before: a quarter of `solver.step_s`, as long as those of a
/// foot that lands where drives play the motion.
inline constexpr double kHeldLonger = 4;

/// Calls visit(sample, own, least) at every step of a motion, until SettlingAfter its end.
/// @param visit  gets a MotionSample or a SpaceSample, the nearest of the robot's own shapes
///               (infinite where they are not nearer than before, and after the settle phase), and
///               their least distance so far [m].
template <class Visit>
void VisitWithOwnDistance(const Problem& problem, const std::vector<double>& x, double step_s,
                          Visit&& visit) {
  const double settled_s = problem.duration_s + problem.settle_s + 1e-9;
  double least_m = std::numeric_limits<double>::infinity();
  Rollout rollout(problem, step_s);
  const auto with = [&](auto&& distances) {
    return [&, distances](const auto& sample) mutable {
      SelfClearance own;
      if (sample.time_s <= settled_s) own = distances.Nearest(sample.q, least_m);
      least_m = std::min(least_m, own.distance_m);
      visit(sample, own, least_m);
    };
  };
  if (problem.space) {
    const SpaceScene& scene = problem.space->scene;
    rollout.VisitInSpace(x, SettlingAfter(problem),
                         with(SpaceSelfDistances(scene.robot, scene.self_contact.All())));
  } else {
    rollout.Visit(x, SettlingAfter(problem),
                  with(SelfDistances(problem.scene.robot, problem.scene.self_contact.All())),
                  kHeldLonger * step_s);
  }
}

/// The torques of a motion, at the solver's steps.
struct TorqueSamples {
  std::vector<double> time_s;
  std::vector<std::vector<double>> torque_nm;  ///< By joint.
  std::vector<double> rest_nm;                 ///< Of each joint, at the end of the settle phase.
};

/// A primitive's feed-forward for a joint: the least-squares spline through the plan's torques,
/// with its control points within the limit. The last of them, which is held after the motion, is
/// the torque at rest where the problem says so: feet that still slide as a motion ends make the
/// fit's a wrong one, by which legs would press against the ground until the next motion.
JointMotion<double>::Spline FeedForward(const Problem& problem, const TorqueSamples& samples,
                                        std::size_t joint);

/// Figures of a motion that is played on past its end, with the joints held.
struct MotionSummary {
  PrimitivePose entry;
  /// The pose ExitAfter the end.
  PrimitivePose exit;
  /// The root's pitch at the end of the motion.
  double final_pitch_rad = 0;
  /// The root's pitch 2 s after the end.
  double settled_pitch_rad = 0;
  /// The largest of the root's velocities 2 s after the end [m/s, rad/s].
  double settled_speed = 0;
  /// The largest |torque| of any joint's motor at any integration step.
  double peak_torque_nm = 0;
  /// The smallest limit at its speed less |torque| of any joint's motor at any integration step.
  double torque_margin_nm = 0;
  /// The smallest distance between the robot's own shapes that are to stay apart, in the motion and
  /// its settle phase; none without such shapes.
  std::optional<double> self_clearance_m;
  /// The largest of |torque| / limit and penetration / thickness of the compliant layer, less 1, in
  /// the motion and its settle phase, and of what lacks to the clearance of the robot's own shapes,
  /// in units of kClearanceScale_m. The solver has to keep it at 0 or below.
  double excess = -1;
  double peak_penetration_m = 0;
  std::vector<ContactInterval> contacts;
  /// Whether a contact went through the whole compliant layer.
  bool core_reached = false;
  /// The plan's torques, from which the feed-forward is fitted.
  TorqueSamples torques;
};

/// How far a motion is from a minimum, by sensitivities whose steps bound the error 100 times finer
/// than the solver's do. None for a motion that leaves every plausible range, and for one that was
/// found by robots that differ, whose cost is another.
std::optional<KktResidual> FinerKktResidual(const Problem& problem, const std::vector<double>& x);

/// Whether a motion's residual, by the solver's own steps, is more than 100 times what is asked of
/// a minimum. Then finer steps would not make it one, and are not taken.
bool IsFarFromMinimum(const Problem& problem, const Solution& solution);

/// Makes a MotionSummary of a motion's samples.
class MotionSummarizer {
 public:
  /// @param problem     must outlive this object.
  /// @param refinement  how many samples there are in a step of the solver.
  MotionSummarizer(const Problem& problem, double refinement);
  /// Takes the samples in their order, from the start of the motion to SettlingAfter its end.
  /// @param own_distance_m  of the robot's own shapes that are to stay apart: the least so far, to
  ///                        the end of the settle phase.
  template <class Space>
  void Take(const MotionSampleIn<Space>& sample, double own_distance_m);
  MotionSummary Finish();

 private:
  template <class Space>
  void TakeTorques(const MotionSampleIn<Space>& sample);
  template <class Space>
  void TakeContacts(const MotionSampleIn<Space>& sample, bool solved);
  template <class Space>
  void TakeRoot(const MotionSampleIn<Space>& sample);

  const Problem& problem_;
  int every_;
  int count_ = 0;
  MotionSummary summary_;
  // By shape, and obstacle or other shape.
  std::map<std::array<int, 3>, std::vector<ContactInterval>> intervals_;
};

/// @param x  parameters of the motion.
MotionSummary Summarize(Problem problem, std::vector<double> x);

/// Makes the primitive: splines, a feed-forward torque fitted to the plan's within the limits,
/// entry, exit, contact timeline, certificate, provenance.
PrimitiveFile MakePrimitiveFile(const Task& task, const SolveOutcome& outcome,
                                const Solution& solution);
/// The same with what DifferentiateBeside and a look at the motion have found.
PrimitiveFile MakePrimitiveFile(const Task& task, const SolveOutcome& outcome,
                                const Solution& solution, const MotionSummary& summary,
                                const GradientBeside& beside);

}  // namespace tumbler
