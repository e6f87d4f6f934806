#pragma once

#include <vector>

#include "offline/stepper/even_steps.h"

namespace tumbler {

/// The lengths of the steps through a motion and through the settle phase after it, in their order
/// [s].
struct StepGrid {
  std::vector<double> motion;
  std::vector<double> settling;
};

/// Equal steps in each of the two, no longer than `longest_s`.
inline StepGrid EvenGrid(double motion_s, double settle_s, double longest_s) {
  const EvenSteps motion(motion_s, longest_s, 1), settling(settle_s, longest_s);
  return {std::vector<double>(static_cast<std::size_t>(motion.count), motion.step_s),
          std::vector<double>(static_cast<std::size_t>(settling.count), settling.step_s)};
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
