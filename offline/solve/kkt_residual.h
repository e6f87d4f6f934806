#pragma once

#include <optional>
#include <string>
#include <vector>

namespace tumbler {

/// A limit that holds a motion back, and how much the cost would fall if it yielded.
struct Multiplier {
  /// As in WorstConstraint; of a position or the duration also which of its limits, `lower` or
  /// `upper`.
  std::string name;
  /// Cost per part of the limit of a velocity, acceleration or torque, per rad of a position's,
  /// per part of the task's duration, per part of the usable layer, per mm of the clearance. It
  /// means nothing for a motion that is not at a minimum.
  double value = 0;
};

/// How far a motion is from the Kuhn-Tucker condition g + A^T lambda = 0, lambda >= 0, where g is
/// the cost's gradient, and the rows of A are the gradients of the constraints that are active:
/// those within 1e-5 of zero. The multipliers are those of least squares.
struct KktResidual {
  /// The largest component of g + A^T lambda [cost per rad]. The projected gradient, in one number.
  double absolute = 0;
  /// The largest component as a part of what it is made of. For the squares of the cost this is the
  /// cosine of the angle between what is squared and its derivative in one parameter, as MINPACK
  /// measures convergence (`gtol`) [More 1978]: it depends neither on the unit of the parameter nor
  /// on that of the cost. None: the cost's Gauss-Newton matrix was not known.
  std::optional<double> relative;
  /// Those of the constraints that are active, the larger ones first.
  std::vector<Multiplier> multipliers;
};

}  // namespace tumbler
