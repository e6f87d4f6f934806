#pragma once

#include <functional>
#include <memory>
#include <span>

#include "offline/model/contact_forces.h"
#include "offline/problem/problem.h"
#include "offline/scene/motion_sample.h"
#include "offline/scene/step_grid.h"
#include "offline/solve/free_duration.h"
#include "offline/solve/joint_paths.h"
#include "offline/solve/rollout_result.h"

namespace tumbler {

/// Integrates [AB04, Eq. 8] by single shooting and differentiates the result exactly.
///
/// Steps end at every instant at which the cost looks (`Problem::instants`). The scheme is the
/// classical Runge-Kutta method of order 4 with equal steps between these, until `Use` gives it
/// other steps, which are those of Dormand and Prince's method of order 5. The gradient is the
/// derivative of that very computation, by the discrete adjoint (Adjoint): the price of a gradient
/// hardly depends on the number of parameters, and it agrees with differences of the cost to
/// rounding. A task may ask for the paper's forward gradient instead (ForwardSensitivity, with
/// equal steps).
///
/// Its parts, in the order in which numbers go through them:
///
/// | part | |
/// |---|---|
/// | ParametricMotion | from x to start, duration and instants |
/// | Timetable | the steps, and the points in time of their stages |
/// | PathTable | the joints' paths at these points, and back from them to x |
/// | Propagation | the state through the steps |
/// | MotionOutputs | from the robot at one time to what cost and constraints are made of |
/// | MotionRecord | all of it, stage by stage |
/// | StageMaxima | smooth maxima over the stages, and their derivatives |
/// | Adjoint | back through the record |
///
/// A problem in space (Problem::space) goes through the same parts, compiled for its algebra, and
/// its root through one chart of orientations a step (RootChart). Its gradients are the adjoint's.
///
/// ForwardSensitivity shares ParametricMotion and MotionOutputs with it, and none of the others.
///
/// Not thread-safe: one object per thread. After the first gradient, only the returned vectors
/// allocate.
class Rollout {
 public:
  /// @param contact  replaces the general contact model of the problem; null: the general model.
  /// @throws std::invalid_argument when `contact` is given and the problem asks for the paper's
  /// forward gradient, which knows only the general model; about an instant of the cost that the
  /// motion does not have (InstantsOf).
  Rollout(const Problem& problem, double step_s,
          std::unique_ptr<ContactForces<Plane>> contact = nullptr);
  ~Rollout();
  Rollout(Rollout&&) noexcept;

  [[nodiscard]] int parameter_count() const;
  /// Number of outputs with a gradient (OutputRows).
  [[nodiscard]] int output_count() const;

  /// Cost, torques and penetration for the parameters x: the free control points [rad] of the first
  /// joint, then those of the second, and so on.
  RolloutResult Run(std::span<const double> x);

  /// The same, with gradients.
  /// @param gradient  gets a row for each output (OutputRows), one after the other, with a number
  /// for each parameter.
  /// @throws std::invalid_argument when `gradient` has another size.
  RolloutResult Run(std::span<const double> x, std::span<double> gradient);

  /// Takes these steps from now on, by the method of Dormand and Prince. Gradients are then those
  /// of the adjoint, whatever the problem asks for.
  /// @throws std::invalid_argument when they do not add up to the problem's times, or stride over
  /// an instant at which its cost looks.
  void Use(const StepGrid& grid);

  /// Cost, torques and penetration by the semi-implicit Euler method with the same step: a quarter
  /// of the price, and good enough to tell promising motions from others.
  RolloutResult Estimate(std::span<const double> x);

  /// Visits the motion step by step, from 0 to the end of the settle phase and `extra_s` beyond.
  /// After the motion itself the joints are held at their ends.
  /// @param extra_step_s  the longest step after the settle phase; 0: as in it.
  /// @pre the problem is one in the plane.
  void Visit(std::span<const double> x, double extra_s,
             const std::function<void(const MotionSample&)>& visitor, double extra_step_s = 0);
  /// The same of a problem in space.
  void VisitInSpace(std::span<const double> x, double extra_s,
                    const std::function<void(const SpaceSample&)>& visitor);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
