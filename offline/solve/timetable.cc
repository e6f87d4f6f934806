#include "offline/solve/timetable.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace tumbler {

Timetable::Timetable(const Tableau& scheme, const StepGrid& grid, double duration_s,
                     std::span<const CostInstant> instants)
    : classical(&scheme == &kClassical),
      stages(static_cast<int>(scheme.own_stages())),
      length(grid.motion),
      motion_steps(static_cast<int>(grid.motion.size())) {
  length.insert(length.end(), grid.settling.begin(), grid.settling.end());
  std::array<double, Tableau::kMaxStages> fraction{};  // of the step, for each of its points
  for (std::size_t s = 1; s < scheme.own_stages(); ++s) {
    if (scheme.c[s] != scheme.c[s - 1]) fraction[Index(++points_per_step)] = scheme.c[s];
    point_of_stage[s] = points_per_step;
  }
  double begin = 0;
  for (const double h : grid.motion) {
    for (int k = 0; k < points_per_step; ++k) time.push_back(begin + fraction[Index(k)] * h);
    begin += h;
  }
  // The sum of the steps may be beyond the spline's end by rounding.
  for (double& t : time) t = std::min(t, duration_s);
  time.push_back(duration_s);
  FindInstants(instants, duration_s);
}

void Timetable::FindInstants(std::span<const CostInstant> instants, double duration_s) {
  int step = 0;
  double begin = 0;  // of the step
  for (const CostInstant& instant : instants) {
    const double rounding = 1e-9 * (1 + instant.time_s);
    const bool ends_phase = instant.when != CostTerm::When::kTime;
    const bool in_motion = !instant.held || instant.when == CostTerm::When::kEnd;
    const int last = in_motion ? motion_steps : steps();
    if (instant.held && step < motion_steps) step = motion_steps, begin = duration_s;
    while (step < last && (ends_phase || begin < instant.time_s - rounding))
      begin += length[Index(step++)];
    if (std::abs(begin - instant.time_s) > rounding)
      throw std::invalid_argument("the steps stride over an instant at which the cost looks");
    step_at.push_back(step);
  }
}

}  // namespace tumbler
