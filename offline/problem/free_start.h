#pragma once

#include <span>
#include <vector>

#include "offline/problem/problem.h"

namespace tumbler {

/// Makes the targets absolute that a task gives from the value at the start.
void SetTargetsFromStart(Problem& problem);

/// The root's velocities at the start that are parameters of a problem, and what follows from them:
/// targets that are given from the start. Without any, nothing here does anything.
class FreeStart {
 public:
  /// A velocity that is free.
  struct Rate {
    int dof = 0;        ///< Of the root.
    int parameter = 0;  ///< That it is.
  };

  explicit FreeStart(const Problem& problem);

  [[nodiscard]] std::span<const Rate> rates() const { return rates_; }
  /// Gives the problem the start of the motion with these parameters.
  void Set(Problem& problem, std::span<const double> x) const;
  /// The derivative of a term's target by one of `rates`.
  [[nodiscard]] double TargetSlope(std::size_t term, std::size_t rate) const {
    return target_slopes_[term * rates_.size() + rate];
  }

 private:
  std::vector<Rate> rates_;
  std::vector<double> target_slopes_;  // by term, then rate
};

}  // namespace tumbler
