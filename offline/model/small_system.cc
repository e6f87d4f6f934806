#include "offline/model/small_system.h"

#include <Eigen/LU>

namespace tumbler {

SmallSystem::SmallSystem(const SmallMatrix& regular) {
  const Eigen::PartialPivLU<SmallMatrix> lu(regular);
  factors_ = lu.matrixLU();
  rows_ = lu.permutationP();
}

SmallVector SmallSystem::Solve(const SmallVector& right) const {
  SmallVector x = rows_ * right;
  factors_.triangularView<Eigen::UnitLower>().solveInPlace(x);
  factors_.triangularView<Eigen::Upper>().solveInPlace(x);
  return x;
}

}  // namespace tumbler
