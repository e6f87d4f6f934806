#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/lane_sensitivity.h"
#include "offline/solve/solver.h"

namespace tumbler {

/// What SolveNear simulates motions with. Not thread-safe: one for each thread.
struct NearRollouts {
  explicit NearRollouts(const Problem& problem, const SolveOptions& options = {});

  ForwardSensitivity coarse;  ///< On the way.
  ForwardSensitivity fine;    ///< At its end, and what is returned.
  /// Where the solve stalls so near to a minimum that errors of the steps may be what holds it.
  ForwardSensitivity finest;
};

/// When a solve ends at the latest.
struct NearLimits {
  int max_evaluations = 300;  ///< Of cost and gradient; below 2, there are 2.
  /// It ends when a step promises to lower the cost by less than this part of it, and no constraint
  /// is violated. 0: only when the motion has converged, or no step helps.
  double enough = 0;
  /// So many evaluations are taken before that.
  int enough_after = 0;
  /// On the way, a motion has nearly converged at this many times the residual that is wanted.
  double nearly = 10;
  /// Whether a motion that has converged is solved on with the finest steps, until it has by these.
  bool confirm = false;
};

/// What a solve has learnt of a motion's surroundings: another goes on with it, also one that
/// computes its derivatives in another way. Empty before the first.
struct NearMemory {
  /// Radius of the trust region at first [rad].
  static constexpr double kFirstRadius_rad = 0.1;

  Eigen::MatrixXd secants;
  Eigen::VectorXd multipliers;  ///< Of the simulated constraints.
  double price = 0;
  double radius_rad = kFirstRadius_rad;
};

/// Solves from a start that is near a solution, and stays near it, by sequential quadratic
/// programming with a trust region.
///
/// In each iteration, the step p minimises a quadratic model of the cost within the box |p_i| <=
/// radius, the position limits and the limits of velocity and acceleration, which are linear, so
/// that no iterate violates them. Torque, penetration and clearance are linearised, and violating
/// them costs a price that grows until it pays to keep them as well as they can be kept within the
/// box (an exact l1 penalty with steering [Fletcher 1987, chapter 14; Byrd, Lopez-Calva and Nocedal
/// 2012]). The step is taken when cost and price together fall by enough of what the model
/// promises, and the radius follows from how well the model did: so the motion never jumps into
/// another basin, however low it is.
///
/// The model's matrix is that of Gauss and Newton for the squares of the cost, from the forward
/// sensitivities, and an SR1 matrix of secants for what that leaves out: the curvature of targets,
/// efforts and constraints, each with its own multiplier [Dennis, Gay and Welsch 1981]. A step that
/// misses its targets, or violates its constraints, because they are curved is corrected once
/// [Nocedal and Wright 2006, chapters 10 and 18].
///
/// Integration steps are chosen for each motion. They bound the error by kCoarseTolerance until the
/// motion has nearly converged or no step helps, and by `solver.tolerance` from then on: far from a
/// minimum, exact derivatives would not shorten the way. A motion has converged when its
/// KktResidual::relative is at most `solver.kkt_residual` with the latter.
///
/// A solve that stalls within a hundred times that goes on with a tolerance 100 times finer.
///
/// @param history  gets the evaluations appended; may be null.
/// @param memory   what is known already, and gets what is learnt; may be null.
Solution SolveNear(const Problem& problem, std::span<const double> start, const NearLimits& limits,
                   NearRollouts& rollouts, const SolveOptions& options,
                   std::vector<Evaluation>* history, NearMemory* memory = nullptr);
/// The same with the derivatives of lanes alone, which ends on the way: as soon as the residual is
/// within ten times what is asked for, nothing comes of it any more, or the evaluations are used
/// up.
Solution SolveNear(const Problem& problem, std::span<const double> start, const NearLimits& limits,
                   LaneSensitivity& lanes, const SolveOptions& options,
                   std::vector<Evaluation>* history, NearMemory* memory = nullptr);

/// The largest error in a step far from a minimum, as `solver.tolerance` is near it, unless that is
/// larger. With 1e-5, solves take as long, because steps mislead more often.
inline constexpr double kCoarseTolerance = 1e-6;
/// A tolerance below this is lost in rounding.
inline constexpr double kFinestTolerance = 1e-12;

}  // namespace tumbler
