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
/// steps change.
template <class Space>
struct Propagation {
  using Dynamics = SceneDynamicsIn<Space>;
  using State = typename Dynamics::State;

  /// @param contact  replaces the general contact model; null: the general one.
  Propagation(const Problem& problem, double step_s, std::unique_ptr<ContactForces<Space>> contact);
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
  void Evaluate(const State& y, int point) {
    robot.SetFree(y);
    paths.PlaceJoints(point, robot);
    robot.TouchAndSolve();
  }
  /// Moves a chart on after a step, to where the root is. Nothing in the plane.
  typename RootChart<Space>::Turn MoveOn(RootChart<Space>& chart, State& y) {
    if constexpr (RootChart<Space>::kMoves) {
      constexpr std::size_t kFirst = RootChart<Space>::kFirst;
      const auto turn = chart.MoveOn(&y[kFirst], &y[robot.free.size() + kFirst]);
      robot.Use(chart);
      return turn;
    } else {
      return {};
    }
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
    return Seen(instant_charts[instant]);
  }

  /// The robot where it is now, as the cost sees it.
  /// @param chart  has to stay while it is looked at.
  [[nodiscard]] CostPoint Seen(const RootChart<Space>& chart) const {
    if constexpr (RootChart<Space>::kMoves) return {robot.q, robot.qd, {}, &chart.axes};
    return {robot.q, robot.qd, {}};
  }

  /// A term of the cost that is an integral. `integral` is its value so far, without its weight.
  struct RunningTerm : CostTerm {
    double integral = 0;
  };

  ParametricMotion motion;
  Dynamics robot;
  MotionOutputs outputs;
  double longest_step_s;  // as asked for
  StepGrid grid;          // which a free duration stretches
  Timetable table;
  PathTable paths;
  MotionRecord<Space> record;
  StageMaxima maxima;
  std::vector<State> instant_states;
  std::vector<RootChart<Space>> instant_charts;
  std::vector<typename RootChart<Space>::Turn> turns;  // at the end of each step, in space
  std::vector<RunningTerm> running;                    // all but those of slip
  double slip_weight;                                  // of those (CostTerm::SlipWeight)
  double slip_integral = 0;                            // of what they look at
  std::vector<double> clearance_gradient;

 private:
  void Take(Timetable&& new_table);
  void MakeRoom();
  template <const Tableau& kScheme>
  RolloutResult RunScheme(std::span<const double> x, ForwardPass pass);
  template <const Tableau& kScheme>
  void StepByRungeKutta(int step, bool with_record, State& y, RolloutResult& result);
  void StepByEuler(int step, State& y, RolloutResult& result);
  void AddInstants(int step, const State& y, const RootChart<Space>& chart, std::size_t& next,
                   RolloutResult& result);
  void AddRunning(double dt, const CostPoint& here);
  [[nodiscard]] bool IsPlausible(const State& y) const;

  // What depends on the timetable is made when it is first needed: one may be followed by another,
  // and a Visit leaves nothing behind.
  bool tabulated_ = false;  // whether `paths` are
  bool has_room_ = false;   // whether `record` and `maxima` have it
};

}  // namespace tumbler
