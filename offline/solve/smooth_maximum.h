#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "offline/model/contact_forces.h"
#include "offline/scene/look_points.h"

namespace tumbler {

/// The smooth maximum of penetration leaves out contacts whose share in it would be e to the power
/// of less than this.
inline constexpr double kNegligibleExponent = -40;
/// In the integral of a smooth maximum, so much below its largest exponent is nothing.
inline constexpr double kExponentOfNothing = 2 * kNegligibleExponent;

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

  /// That of steps which were added elsewhere, as to this one.
  SmoothMaximum(double sharpness, Of of, double largest, double sum)
      : rho_(sharpness), of_(of), largest_(largest), sum_(sum) {}

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
    return rho_ * std::max(largest_, expected_) + kExponentOfNothing;
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
