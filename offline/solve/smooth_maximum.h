#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "offline/model/contact_forces.h"
#include "offline/scene/tableau.h"

namespace tumbler {

/// The smooth maximum of penetration leaves out contacts whose share in it would be e to the power
/// of less than this.
inline constexpr double kNegligibleExponent = -40;

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

/// The smooth maximum over time of a quantity v, as the integral of [KS79]
///
///   1 / rho ln( integral exp(rho v) dt / kPeakDuration_s ).
///
/// It is at or above the true one when a peak lasts as long as kPeakDuration_s, and it does not
/// depend on the steps: it is a property of v(t).
class SmoothMaximum {
 public:
  enum class Of {
    kSize,       ///< That of |v|.
    kAboveZero,  ///< That of max(0, v), with exp(rho v) - 1: times at which v is 0 do not count.
  };
  SmoothMaximum(double sharpness, Of of) : rho_(sharpness), of_(of) {}

  void Reset() { *this = SmoothMaximum(rho_, of_); }

  /// Says that a step with these values will be among those that are added. What is too small to
  /// count beside it, to the last bit, is left out from now on, also before that step.
  void Expect(const StepPoints& points, std::span<const double> values);

  /// Whether a step can count in which no |v| at a stage is above `highest`. Else it need not be
  /// added.
  [[nodiscard]] bool Counts(const StepPoints& points, double highest) const {
    return rho_ * (highest * points.growth) >= LeastExponent();
  }

  /// Adds a step.
  /// @param points  those of the step.
  /// @param values  v at its stages.
  /// @param slopes  gets the derivatives of the integral by `values`, divided by rho and by the
  /// same power of e as the integral, whose exponent `largest()` decides; or is empty.
  /// @returns what the integral and all slopes of earlier steps are to be multiplied by for that.
  double Add(const StepPoints& points, double step_s, std::span<const double> values,
             std::span<double> slopes);

  /// The largest v looked at, and at least 0.
  [[nodiscard]] double largest() const { return largest_; }
  /// The integral, divided by kPeakDuration_s and exp(rho largest()).
  [[nodiscard]] double sum() const { return sum_; }
  /// The smooth maximum; without limit below when nothing was added.
  [[nodiscard]] double value() const;

 private:
  /// @param share  the length of the step over kPeakDuration_s.
  template <Of kOf>
  void AddGroup(const StepPoints::Group& group, const StepPoints::AtPoints& at_point, double share,
                std::span<double> slopes);
  /// Anything whose exponent is less does not change the integral in double precision, however
  /// short the steps are in which it is at its largest.
  [[nodiscard]] double LeastExponent() const {
    return rho_ * std::max(largest_, expected_) + 2 * kNegligibleExponent;
  }

  double rho_;
  Of of_;
  double largest_ = 0;
  double expected_ = 0;
  double sum_ = 0;
};

/// The smooth maximum of the depths of all contacts at one time, relative to the usable part of the
/// layer, above `least`: 1 / rho ln( 1 + sum exp(rho (depth / usable - least)) ).
class SmoothDepth {
 public:
  SmoothDepth(double sharpness, double usable_m) : rho_(sharpness), usable_m_(usable_m) {
    constexpr std::size_t kUsualContacts = 64;  // So many need no heap.
    slopes_.reserve(kUsualContacts);
  }

  [[nodiscard]] double least() const { return 1 + kNegligibleExponent / rho_; }
  /// @returns the value, 0 without contacts. The derivatives by the depths are `slopes` then.
  template <class Space>
  double Evaluate(std::span<const ActiveContact<Space>> active);
  /// For each of the contacts of the last Evaluate [1/m]; none where its value was 0.
  [[nodiscard]] std::span<const double> slopes() const { return slopes_; }

 private:
  double rho_, usable_m_;
  std::vector<double> slopes_;
};

}  // namespace tumbler
