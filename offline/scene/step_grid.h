#pragma once

#include <span>
#include <vector>

#include "offline/scene/even_steps.h"

namespace tumbler {

/// The lengths of the steps through a motion and through the settle phase after it, in their order
/// [s].
struct StepGrid {
  std::vector<double> motion;
  std::vector<double> settling;
};

/// Equal steps in each of these parts of a motion and of the settle phase, no longer than
/// `longest_s`.
inline StepGrid EvenGrid(std::span<const double> motion_s, std::span<const double> settle_s,
                         double longest_s) {
  const auto steps_in = [longest_s](std::span<const double> parts_s, int fewest) {
    std::vector<double> steps;
    for (const double part_s : parts_s) {
      const EvenSteps even(part_s, longest_s, fewest);
      steps.insert(steps.end(), static_cast<std::size_t>(even.count), even.step_s);
    }
    return steps;
  };
  return {steps_in(motion_s, 1), steps_in(settle_s, 0)};
}
inline StepGrid EvenGrid(double motion_s, double settle_s, double longest_s) {
  return EvenGrid({&motion_s, 1}, {&settle_s, 1}, longest_s);
}

/// The grid with each step in two halves.
inline StepGrid Halved(const StepGrid& grid) {
  const auto halved = [](const std::vector<double>& steps) {
    std::vector<double> halves;
    for (const double h : steps) halves.insert(halves.end(), 2, h / 2);
    return halves;
  };
  return {halved(grid.motion), halved(grid.settling)};
}

}  // namespace tumbler
