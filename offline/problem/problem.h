#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "common/primitive.h"
#include "offline/problem/cost_term.h"
#include "offline/scene/scene.h"

namespace tumbler {

/// Limits, end conditions and size of the path of one actuated joint.
struct ActuatedJoint {
  int dof = 0;
  JointLimits<double> limits;
  double start_rad = 0;
  double end_rad = 0;
  int control_points = 12;  ///< At least 6: the first and last three are fixed by the ends.

  [[nodiscard]] int free_points() const { return control_points - 6; }
};

/// How global search is done: random splines, ranked by cost alone.
struct SearchSettings {
  std::uint64_t seed = 1;
  int batch = 150;         ///< Random starts at a time, until ...
  int promising = 3;       ///< ... so many stand out from the rest (in rank, and none of them ends
                           ///< further than `basin_rad` from its target pitch) ...
  int max_samples = 3000;  ///< ... or so many have been tried.
  int refine = 4;          ///< How many of the best go to the local solver. When none of them leads
                           ///< anywhere, as many again stand out and are refined, and so on.
  int modes =
      3;  ///< Half-sine modes of a random departure from the straight line from start to end.
  double spread_rad = 3.2;    ///< Largest amplitude of the first mode; mode m has it divided by m.
  double torque_penalty = 1;  ///< Weight of (|tau| / limit - 1)^2 in the ranking.
  double core_penalty =
      0.1;  ///< Weight of penetration beyond the compliant layer, in layers, in the ranking.
  double basin_rad = 0.5;  ///< A motion that ends this far from its target pitch rests otherwise:
                           ///< a local solver would not bring it there.
  double step_s = 2e-3;    ///< Of the semi-implicit Euler method: ranking needs little accuracy.
};

/// How the local solver (SLSQP) is run.
struct SolverSettings {
  /// How gradients are computed; to rounding both give the same.
  enum class Gradient {
    kAdjoint,  ///< Backwards through the steps: the price hardly depends on the number of
               ///< parameters.
    kForward,  ///< The paper's gradient equations, integrated with the states [AB04, section V].
  };
  Gradient gradient = Gradient::kAdjoint;
  double step_s = 1e-3;              ///< Integration step of cost and gradient.
  double screen_step_s = 2e-3;       ///< The same for screening, which comes first.
  int screen_evaluations = 24;       ///< Of cost and gradient, for each start of the search.
  int finalists = 1;                 ///< How many of those go on ...
  int max_evaluations = 90;          ///< ... to this many evaluations in all.
  double relative_tolerance = 1e-7;  ///< Of the cost.
  /// Of the torque limit, kept free for what happens between samples: a tenth of a step of 1 ms
  /// finds up to 0.8 % of the limit more through a hard landing.
  double torque_margin = 0.02;
  double core_margin = 0.1;  ///< Part of the compliant layer that a motion leaves unused, so that a
                             ///< slightly different start does not reach the core.
  double sharpness = 60;  ///< Of the smooth maxima (Kreisselmeier-Steinhauser) that stand for the
                          ///< limits of torque and penetration.
};

/// An optimal control problem of [AB04, Eqs. 1-6] in numbers.
struct Problem {
  std::string name;
  Scene scene;                        ///< With the robot's actuated joints prescribed.
  std::vector<ActuatedJoint> joints;  ///< In the order of the robot's degrees of freedom.
  /// The longest integration step that contact allows (`AdvisableStep`); infinite in a flight.
  double advisable_step_s = std::numeric_limits<double>::infinity();

  std::vector<double> start_q;  ///< All degrees of freedom; at rest.
  double duration_s = 1;
  double settle_s = 0;
  int degree = 5;
  std::vector<CostTerm> cost;
  double target_pitch_rad = 0;  ///< What the settled pitch is compared with.

  double entry_tolerance_rad = 0.1;  ///< The runtime starts only this near to the first positions.
  double following_tolerance_rad =
      0.35;  ///< ... and calls it a fault when a joint is further behind.

  SearchSettings search;
  SolverSettings solver;

  /// Parameters are the free control points of the first joint, then those of the second, ...
  [[nodiscard]] int parameter_count() const { return first_parameter(joints.size()); }
  /// Index of the first parameter of a joint.
  [[nodiscard]] int first_parameter(std::size_t joint) const {
    int first = 0;
    for (std::size_t j = 0; j < joint; ++j) first += joints[j].free_points();
    return first;
  }
  /// The joint whose path a parameter belongs to.
  [[nodiscard]] std::size_t joint_of_parameter(int parameter) const {
    std::size_t joint = 0;
    while (parameter >= first_parameter(joint + 1)) ++joint;
    return joint;
  }
};

}  // namespace tumbler
