#pragma once

#include <array>
#include <span>
#include <vector>

#include "common/core/index.h"
#include "offline/problem/cost_term.h"
#include "offline/scene/step_grid.h"
#include "offline/scene/tableau.h"
#include "offline/solve/free_duration.h"

namespace tumbler {

/// The steps of a scheme through motion and settle phase, and the *points* in time of their stages,
/// for which the paths of the joints are computed beforehand. Stages at the same time share a
/// point, also the last stage of a step and the first of the next one.
struct Timetable {
  /// @throws std::invalid_argument  when no step begins at an instant of the cost.
  Timetable(const Tableau& scheme, const StepGrid& grid, double duration_s,
            std::span<const CostInstant> instants);

  bool classical = true;  ///< The classical method of order 4; else that of Dormand and Prince.
  int stages = 0;         ///< Of a step.
  int points_per_step = 0;
  std::array<int, Tableau::kMaxStages> point_of_stage{};  ///< From the first one of the step.
  std::vector<double> length;                             ///< Of the steps [s].
  std::vector<double> time;                               ///< Of the motion's points [s].
  int motion_steps = 0;
  std::vector<int> step_at;  ///< For each instant of the cost, the step that begins there.

  [[nodiscard]] const Tableau& scheme() const { return classical ? kClassical : kDormandPrince; }
  [[nodiscard]] int steps() const { return static_cast<int>(length.size()); }
  [[nodiscard]] bool settles() const { return steps() > motion_steps; }
  /// The point of all stages after the motion, in which the joints are held.
  [[nodiscard]] int held() const { return static_cast<int>(time.size()); }
  /// The last stage of the motion's last step still belongs to the motion.
  [[nodiscard]] int PointOf(int step, int s) const {
    return step < motion_steps ? points_per_step * step + point_of_stage[Index(s)] : held();
  }
  /// Number of a stage among those of all steps.
  [[nodiscard]] std::size_t StageOf(int step, int s) const { return Index(step * stages + s); }
  /// The derivative of a step by the parameter that is the duration, divided by the step. 0 where
  /// the step does not become longer with it.
  [[nodiscard]] double GrowthOf(int step, const FreeDuration& duration) const {
    return duration.is_free() && step < motion_steps
               ? duration.GrowthOfStepAt(time[Index(PointOf(step, 0))])
               : 0;
  }

 private:
  void FindInstants(std::span<const CostInstant> instants, double duration_s);
};

}  // namespace tumbler
