#include "offline/scene/drive_damping.h"

#include <array>
#include <cmath>
#include <utility>

#include "common/core/index.h"
#include "offline/model/symmetric_eigen.h"

namespace tumbler {
namespace {

/// The robot with these joints moved by torques. What else is held, as a root by a bar, stays so.
template <class Space>
Tree<Space> MovedByTorques(Tree<Space> tree, const std::vector<int>& dofs) {
  for (const int dof : dofs) tree.dofs[Index(dof)].prescribed = false;
  return tree;
}

}  // namespace

template <class Space>
DriveDampingIn<Space>::DriveDampingIn(const SceneOf<Space>& scene, std::vector<int> dofs,
                                      std::vector<double> kd)
    : dynamics_(MovedByTorques(scene.robot.tree, dofs)),
      dofs_(std::move(dofs)),
      kd_(std::move(kd)) {}

template <class Space>
double DriveDampingIn<Space>::RateAt(std::span<const double> q) {
  using Numbers = IntArray<double, Space::kMaxDofs>;
  const auto n = static_cast<std::size_t>(dynamics_.size());
  const Numbers at_rest{};
  dynamics_.SetState(q, {at_rest.data(), n});
  // Accelerations are M^-1 times the torques, and those of gravity, which a difference leaves out.
  const auto accelerations = [&](int dof, double torque_nm) {
    Numbers qdd{}, tau{};
    if (dof >= 0) tau[dof] = torque_nm;
    dynamics_.Solve({qdd.data(), n}, {tau.data(), n});
    return qdd;
  };
  const Numbers of_gravity = accelerations(-1, 0);
  // A Kd has the eigenvalues of the symmetric sqrt(Kd) A sqrt(Kd).
  const auto count = static_cast<Eigen::Index>(dofs_.size());
  SmallMatrix rates(count, count);
  for (Eigen::Index j = 0; j < count; ++j) {
    const Numbers of_torque = accelerations(dofs_[static_cast<std::size_t>(j)], 1);
    for (Eigen::Index i = 0; i < count; ++i) {
      const int dof = dofs_[static_cast<std::size_t>(i)];
      rates(i, j) = (of_torque[dof] - of_gravity[dof]) *
                    std::sqrt(kd_[static_cast<std::size_t>(i)] * kd_[static_cast<std::size_t>(j)]);
    }
  }
  return DecomposeSymmetric(rates).values[count - 1];
}

template class DriveDampingIn<Plane>;
template class DriveDampingIn<Spatial>;

}  // namespace tumbler
