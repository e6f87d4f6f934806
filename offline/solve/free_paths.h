#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "offline/problem/problem.h"
#include "offline/solve/constraints.h"
#include "offline/solve/gauss_newton.h"
#include "offline/solve/output_gradients.h"

namespace tumbler {

/// What a search may change of a problem's parameters x: those of the joints that are tied to none
/// (Problem::tied). In their place stand y, of which x = T y: each parameter is one of y, or minus
/// that. Without ties y are the parameters themselves.
class FreePaths {
 public:
  explicit FreePaths(const Problem& problem);

  /// Whether joints are tied, so that y are fewer than the parameters.
  [[nodiscard]] bool any_tied() const { return count() < sources_.size(); }
  /// How many y there are.
  [[nodiscard]] std::size_t count() const { return bounds_.size(); }
  /// What each of them may be, for every joint that it moves.
  [[nodiscard]] Interval<double> bounds(std::size_t i) const { return bounds_[i]; }
  /// The nearest y within those bounds.
  [[nodiscard]] std::vector<double> Inside(std::vector<double> y) const;
  /// The parameters that y stands for. Those of a tied joint have the bits of the other one's, or
  /// minus these.
  [[nodiscard]] std::vector<double> Expand(std::span<const double> y) const;
  /// The y of parameters, as the joints that are tied to none have them.
  [[nodiscard]] std::vector<double> Reduce(std::span<const double> x) const;
  /// The parameters in which the joints that are tied follow the others of x, within the bounds of
  /// both; x itself where none is tied.
  [[nodiscard]] std::vector<double> Tied(std::vector<double> x) const;
  /// A row of slopes by x as one by y.
  [[nodiscard]] std::vector<double> ReduceSlopes(std::span<const double> by_x) const;
  /// The gradients as such by y.
  [[nodiscard]] OutputGradients ReduceSlopes(OutputGradients by_x) const;
  /// The model of a cost by x as one by y.
  [[nodiscard]] GaussNewton Reduce(GaussNewton by_x) const;
  /// Constraints by y, those that say the same but once.
  [[nodiscard]] std::vector<LinearRow> Reduce(std::span<const LinearRow> rows) const;

 private:
  struct Source {
    std::size_t of = 0;  // which y
    double factor = 1;
  };
  std::vector<Source> sources_;   // by parameter
  std::vector<std::size_t> own_;  // by y: the parameter that it is itself
  std::vector<Interval<double>> bounds_;
};

}  // namespace tumbler
