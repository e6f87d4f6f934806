#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "offline/model/contact_model.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/spatial.h"

namespace tumbler {

/// A body that moves freely without turning.
template <class Space>
Tree<Space> Particle(double gravity) {
  Tree<Space> tree;
  tree.gravity[Shape<Space>::kDimension - 1] = -gravity;
  for (int i = 0; i < Shape<Space>::kDimension; ++i) {
    Dof<Space> dof;
    dof.parent = i - 1;
    dof.kind = JointKind::kPrismatic;
    dof.direction = Space::Vector::Unit(i);
    dof.massless = i + 1 < Shape<Space>::kDimension;
    if (!dof.massless) {
      dof.mass_kg = 1;
      if constexpr (std::is_same_v<Space, Spatial>) {
        dof.inertia_kg_m2 = SpaceMatrix::Identity() * 0.01;
      } else {
        dof.inertia_kg_m2 = 0.01;
      }
    }
    tree.dofs.push_back(dof);
  }
  return tree;
}

/// Classical Runge-Kutta over all degrees of freedom, all free.
template <class Space>
class ContactSimulation {
 public:
  ContactSimulation(const Tree<Space>& tree, ContactModel<Space>& contact)
      : dynamics_(tree), contact_(contact), n_(tree.dofs.size()) {}

  std::vector<double> Rates(const std::vector<double>& y) {
    const std::vector<double> q(y.begin(), y.begin() + N()), qd(y.begin() + N(), y.end());
    std::vector<double> qdd(n_), tau(n_);
    dynamics_.SetState(q, qd);
    contact_.Apply(dynamics_);
    dynamics_.Solve(qdd, tau);
    std::vector<double> out = qd;
    out.insert(out.end(), qdd.begin(), qdd.end());
    return out;
  }
  /// The derivative of Rates' last result in y, by rows: Eigen keeps it short.
  Eigen::MatrixXd Jacobian() {
    contact_.Differentiate(dynamics_);
    DynamicsDerivatives<Space> d;
    dynamics_.Differentiate(d);
    const auto n = static_cast<Eigen::Index>(n_);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2 * n, 2 * n);
    J.topRightCorner(n, n).setIdentity();
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t k = 0; k < n_; ++k) {
        const auto row = n + static_cast<Eigen::Index>(i), column = static_cast<Eigen::Index>(k);
        J(row, column) = d.q[i][k];
        J(row, n + column) = d.qd[i][k];
      }
    }
    return J;
  }
  /// One step; also of the sensitivities where there are any.
  void Step(std::vector<double>& y, double h, Eigen::MatrixXd* sensitivity = nullptr) {
    constexpr double kA[] = {0, 0.5, 0.5, 1}, kB[] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
    std::vector<double> k(y.size()), sum(y.size());
    Eigen::MatrixXd K, total;
    if (sensitivity != nullptr) K = total = 0 * *sensitivity;
    for (int s = 0; s < 4; ++s) {
      std::vector<double> at = y;
      for (std::size_t i = 0; i < y.size(); ++i) at[i] += h * kA[s] * k[i];
      k = Rates(at);
      for (std::size_t i = 0; i < y.size(); ++i) sum[i] += kB[s] * k[i];
      if (sensitivity != nullptr) {
        K = Jacobian() * (*sensitivity + h * kA[s] * K);
        total += kB[s] * K;
      }
    }
    for (std::size_t i = 0; i < y.size(); ++i) y[i] += h * sum[i];
    if (sensitivity != nullptr) *sensitivity += h * total;
  }
  HybridDynamics<Space>& dynamics() { return dynamics_; }

 private:
  [[nodiscard]] std::ptrdiff_t N() const { return static_cast<std::ptrdiff_t>(n_); }
  HybridDynamics<Space> dynamics_;
  ContactModel<Space>& contact_;
  std::size_t n_;
};

}  // namespace tumbler
