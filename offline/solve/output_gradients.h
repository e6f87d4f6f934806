#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

namespace tumbler {

/// The gradients of a rollout's outputs as a matrix with a row for each, where `Rollout::Run` and
/// `ForwardSensitivity::Run` can write them.
class OutputGradients
    : public Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> {
 public:
  using Matrix::Matrix;
  using Matrix::operator=;

  /// Those of a Rollout or ForwardSensitivity, not yet set.
  template <class Motions>
  static OutputGradients Of(const Motions& motions) {
    return OutputGradients(motions.output_count(), motions.parameter_count());
  }

  operator std::span<double>() {  // NOLINT(google-explicit-constructor): as its argument
    return {data(), static_cast<std::size_t>(size())};
  }
};

}  // namespace tumbler
