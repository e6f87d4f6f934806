#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "offline/scene/tableau.h"

namespace tumbler {

/// In the smooth maxima of torque and penetration, a peak counts as much as it is high when it
/// lasts as long as this, and more when it is longer. A landing lasts a few milliseconds.
inline constexpr double kPeakDuration_s = 1e-4;

/// The times within a step at which a quantity is looked at, each by its values at the scheme's
/// stages. They are kept in groups of six, of which the last may have times of weight zero.
struct StepPoints {
  static constexpr std::size_t kGroup = 6;
  using AtPoints = std::array<double, kGroup>;
  struct Group {
    /// Weights of the values at the stages: by stage, then point.
    std::array<AtPoints, Tableau::kMaxStages> of_stage{};
    /// Part of the step that a point stands for.
    AtPoints part{};
  };
  std::vector<Group> groups;
  /// At all points, no value is larger than so many times the largest one of a stage.
  double growth = 1;
};

/// The times within a step at which peaks are looked for: those of Gauss's quadrature with three
/// points, at most half a millisecond of the step at a time, since the peaks of exp(rho v) are much
/// narrower than a step through the air. Between the stages, quantities are the polynomials through
/// the stages that are accurate to the third order in the step: with Dormand and Prince's method
/// all but the second, with the classical one the first, the mean of both in the middle, and the
/// last.
class LookPoints {
 public:
  /// @param scheme     kClassical or kDormandPrince.
  /// @param longest_s  that of all steps.
  LookPoints(const Tableau& scheme, double longest_s);

  /// Those of a step of this length.
  [[nodiscard]] const StepPoints& In(double step_s) const;
  /// Those of a step of a method with one stage: its start.
  static const StepPoints& Start();

 private:
  std::vector<StepPoints> by_count_;
};

}  // namespace tumbler
