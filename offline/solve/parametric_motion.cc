#include "offline/solve/parametric_motion.h"

namespace tumbler {

ParametricMotion::ParametricMotion(const Problem& problem)
    : problem_(problem),
      start_(problem),
      duration_(problem),
      instants_(problem.instants()),
      joints_(static_cast<int>(problem.joints.size())),
      parameters_(problem.parameter_count()) {
  for (std::size_t j = 0; j < problem.joints.size(); ++j)
    first_parameter_.push_back(problem.first_parameter(j));
}

bool ParametricMotion::Set(std::span<const double> x) {
  if (duration_.is_free()) {
    const double before_s = duration_.duration_s();
    if (!duration_.Set(problem_, x)) return false;
    if (duration_.duration_s() != before_s) instants_ = problem_.instants(duration_.duration_s());
  }
  start_.Set(problem_, x);
  return true;
}

}  // namespace tumbler
