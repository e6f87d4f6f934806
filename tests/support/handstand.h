#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "offline/problem/problem.h"
#include "tests/support/random_robot.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {

inline CostTerm SquareTerm(CostTerm::When when, int dof, bool of_velocity, double target,
                           double weight) {
  return {CostTerm::Kind::kSquare, when, weight, dof, of_velocity, target};
}
inline CostTerm LinearTerm(CostTerm::When when, int dof, bool of_velocity, double weight) {
  return {CostTerm::Kind::kLinear, when, weight, dof, of_velocity};
}
inline CostTerm EffortTerm(double weight) {
  return {CostTerm::Kind::kEffort, CostTerm::When::kThroughout, weight};
}

/// A problem in which the shipped robot stands at home on flat ground and its legs end as in a
/// handstand: 1.2 s of motion, 0.2 s of settling, the paper's terminal cost with an effort term.
inline Problem HandstandProblem(int control_points = 12) {
  Problem problem;
  problem.name = "handstand";
  problem.scene.robot = LoadTumbler();
  JointLimits<double> limits;
  limits.position_min_rad = -2.9;
  limits.position_max_rad = 2.9;
  limits.velocity_max_rad_s = 20;
  limits.acceleration_max_rad_s2 = 400;
  limits.torque_max_nm = 8;
  problem.joints = {{3, limits, -std::numbers::pi / 2, 0, control_points},
                    {4, limits, std::numbers::pi / 2, 0, control_points}};
  problem.scene.obstacles = {{"ground", Shape<Plane>::HalfSpace({0, 0}, {0, 1})}};
  problem.start_q = {0, 0.2125, 0, -std::numbers::pi / 2, std::numbers::pi / 2};
  problem.duration_s = 1.2;
  problem.settle_s = 0.2;
  problem.cost = {SquareTerm(CostTerm::When::kSettled, 2, false, std::numbers::pi / 2, 1),
                  SquareTerm(CostTerm::When::kEnd, 2, true, 0, 0.01), EffortTerm(1e-3)};
  return problem;
}

/// Parameters of a smooth random motion, which is the straight line from start to end plus a few
/// half sines.
inline std::vector<double> RandomMotion(const Problem& problem, std::uint64_t seed,
                                        double amplitude_rad = 1.2) {
  std::mt19937_64 random(seed);
  std::vector<double> x;
  for (const ActuatedJoint& joint : problem.joints) {
    const int points = joint.free_points();
    const std::vector<double> modes = {Uniform(random, -1, 1), Uniform(random, -1, 1) / 2,
                                       Uniform(random, -1, 1) / 3};
    for (int i = 0; i < points; ++i) {
      const double s = (i + 1.0) / (points + 1.0);
      double value = joint.start_rad + s * (joint.end_rad - joint.start_rad);
      for (std::size_t m = 0; m < modes.size(); ++m) {
        value +=
            amplitude_rad * modes[m] * std::sin(std::numbers::pi * static_cast<double>(m + 1) * s);
      }
      x.push_back(value);
    }
  }
  return x;
}

}  // namespace tumbler
