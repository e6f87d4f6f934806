#pragma once

#include <memory>
#include <span>
#include <vector>

#include "offline/model/contact_forces.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/step_grid.h"
#include "offline/solve/motion_outputs.h"
#include "offline/solve/motion_record.h"
#include "offline/solve/parametric_motion.h"
#include "offline/solve/path_table.h"
#include "offline/solve/stage_maxima.h"
#include "offline/solve/timetable.h"

namespace tumbler {

/// The simulation behind a Rollout: takes the state through the steps of a timetable, with the
/// joints on their paths, and adds up the outputs. It is also what Adjoint goes back through.
///
/// Run does all of it. The functions after it are the parts that Adjoint and Rollout::Visit need.
/// No heap in Run but for its result, after the first with ForwardPass::kGradient, unless the
/// duration changes.
struct Propagation {
  /// @param contact  replaces the general contact model; null: the general one.
  Propagation(const Problem& problem, double step_s, std::unique_ptr<ContactForces<Plane>> contact);
  Propagation(const Propagation&) = delete;  // Its parts refer to each other.
  Propagation& operator=(const Propagation&) = delete;

  RolloutResult Run(std::span<const double> x, ForwardPass pass);

  /// Takes these steps from now on, with the method of Dormand and Prince.
  /// @throws std::invalid_argument  as Rollout::Use.
  void Use(const StepGrid& new_grid);

  /// Takes start, duration and paths of the motion with these parameters.
  /// @returns false when the cost would look at a time that is not within the motion.
  bool SetMotion(std::span<const double> x);
  /// Computes the dynamics in a state, with the joints at a point of the timetable.
  void Evaluate(const SceneDynamics::State& y, int point) {
    robot.SetFree(y);
    paths.PlaceJoints(point, robot);
    robot.TouchAndSolve();
  }
  /// The point in time of an instant: at the end of the motion, the joints are held already.
  [[nodiscard]] int PointOf(std::size_t instant) const {
    return motion.instants()[instant].held ? table.held()
                                           : table.PointOf(table.step_at[instant], 0);
  }
  /// The robot at an instant, in the state of the last Run.
  CostPoint InstantAt(std::size_t instant) {
    robot.SetFree(instant_states[instant]);
    paths.PlaceJoints(PointOf(instant), robot);
    return {robot.q, robot.qd, {}};
  }

  /// A term of the cost that is an integral. `integral` is its value so far, without its weight.
  struct RunningTerm : CostTerm {
    double integral = 0;
  };

  ParametricMotion motion;
  SceneDynamics robot;
  MotionOutputs outputs;
  double longest_step_s;  // as asked for
  StepGrid grid;          // which a free duration stretches
  Timetable table;
  PathTable paths;
  MotionRecord record;
  StageMaxima maxima;
  std::vector<SceneDynamics::State> instant_states;
  std::vector<RunningTerm> running;
  std::vector<double> clearance_gradient;

 private:
  void Resize();
  template <const Tableau& kScheme>
  RolloutResult RunScheme(std::span<const double> x, ForwardPass pass);
  template <const Tableau& kScheme>
  void StepByRungeKutta(int step, bool with_record, SceneDynamics::State& y, RolloutResult& result);
  void StepByEuler(int step, SceneDynamics::State& y, RolloutResult& result);
  void AddInstants(int step, const SceneDynamics::State& y, std::size_t& next,
                   RolloutResult& result);
  void AddRunning(double dt, const CostPoint& here);
  [[nodiscard]] bool IsPlausible(const SceneDynamics::State& y) const;
};

}  // namespace tumbler
