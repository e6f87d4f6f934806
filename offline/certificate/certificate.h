#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <vector>

#include "common/primitive_toml.h"
#include "offline/problem/task_toml.h"
#include "offline/solver/solver.h"

namespace tumbler {

/// How far an analytic gradient is from differences of the same computation.
struct GradientCheck {
  /// Steps of the central differences [rad]: curvature spoils large ones, rounding small ones.
  static constexpr std::array<double, 3> kSteps = {1e-5, 1e-6, 1e-7};
  /// Of each step: largest component of the difference over the largest component of either
  /// gradient. Infinite where a difference is not finite.
  std::array<double, 3> errors{};

  /// The best agreement.
  [[nodiscard]] double relative_error() const {
    return *std::min_element(errors.begin(), errors.end());
  }
};

/// A larger gradient error than this is worth a warning. Where the cost is smooth the differences
/// agree to 1e-6 and better, and SLSQP's line search takes its slope from the gradient: a
/// thousandth says that the cost does not follow its own slope over 1e-5 rad, because a cliff is
/// near, such as a contact that is made or missed by a hair.
inline constexpr double kDoubtfulGradient = 1e-3;

/// Compares a gradient with central differences of three steps.
GradientCheck CompareGradient(const std::function<double(const std::vector<double>&)>& cost,
                              std::vector<double> at, const std::vector<double>& gradient);

/// The same for the gradient of a problem's cost. The point is `x` moved by 0.001 rad in every
/// parameter, alternating in sign: at the optimum itself the gradient is zero, and a relative error
/// says nothing.
GradientCheck CheckGradient(const Problem& problem, const std::vector<double>& x);

/// Relative change of the cost's gradient at the same point when the integration step is halved:
/// what the step leaves out, as GradientCheck is what the differentiation leaves out.
double GradientStepHalvingChange(const Problem& problem, const std::vector<double>& x);

/// How long a motion is played on past its settle phase [s], until its exit.
double SettlingAfter(const Problem& problem);

/// What a motion is found to do when it is played on past its end.
struct MotionSummary {
  PrimitivePose entry;
  PrimitivePose exit;            ///< 2 s after the end, legs held.
  double final_pitch_rad = 0;    ///< At the end of the motion.
  double settled_pitch_rad = 0;  ///< 2 s after the end, legs held.
  double settled_speed = 0;      ///< Largest of root velocities then [m/s, rad/s].
  double peak_torque_nm = 0;     ///< Of any joint, at every integration step.
  double torque_margin_nm = 0;   ///< Smallest limit less |torque|, likewise.
  /// Largest of |torque| over its limit and of penetration over the compliant layer, less 1, in
  /// the motion and its settle phase: what the solver is answerable for.
  double excess = -1;
  double peak_penetration_m = 0;
  std::vector<ContactInterval> contacts;
  bool core_reached = false;  ///< A contact went through the whole compliant layer.
};
MotionSummary Summarize(const Problem& problem, const std::vector<double>& x);

/// Makes the primitive: splines, a feed-forward torque fitted to the plan's within the limits,
/// entry, exit, contact timeline, certificate, provenance.
PrimitiveFile MakePrimitiveFile(const Task& task, const SolveOutcome& outcome,
                                const Solution& solution);

}  // namespace tumbler
