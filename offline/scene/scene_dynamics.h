#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "offline/model/contact_forces.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/spatial.h"
#include "offline/scene/root_chart.h"
#include "offline/scene/scene.h"
#include "offline/scene/space_scene.h"
#include "offline/scene/stepper.h"

namespace tumbler {

/// The scene that belongs to an algebra.
template <class Space>
using SceneOf = std::conditional_t<std::is_same_v<Space, Plane>, Scene, SpaceScene>;

/// The equations of motion of a scene [AB04, Eqs. 7 and 8]. The caller puts the prescribed joints
/// on their paths and gets the accelerations of the free degrees of freedom. Positions and
/// velocities of the free ones are the state that it integrates.
///
/// Order of calls:
/// 1. SetFree, and set q, qd and qdd of the prescribed degrees of freedom; a bar's x and z keep
///    their place without it;
/// 2. Touch;
/// 3. add wrenches from elsewhere (`dynamics.AddWrench`), and set tau of the free ones, without
///    springs;
/// 4. Solve.
///
/// In space the angles of a floating root are those of the chart in use (RootChart), which whoever
/// takes steps moves on after each of them.
///
/// No heap after construction.
template <class Space>
struct SceneDynamicsIn {
  static constexpr int kMaxDofs = HybridDynamics<Space>::kMaxDofs;
  /// One number for each degree of freedom.
  using Numbers = IntArray<double, kMaxDofs>;
  /// The state of the free degrees of freedom, in their order.
  using State = MechanicalState<kMaxDofs>;

  /// @param own_contact  replaces the general contact model; null: the general model.
  explicit SceneDynamicsIn(const SceneOf<Space>& scene,
                           std::unique_ptr<ContactForces<Space>> own_contact = nullptr);

  /// Sets positions and velocities of the free degrees of freedom from the numbers of a State.
  void SetFree(const double* y) {
    const double* velocity = y + free.size();
    for (const int dof : free) {
      q[dof] = *y++;
      qd[dof] = *velocity++;
    }
  }
  void SetFree(const State& y) { SetFree(y.data()); }
  /// Where a degree of freedom is among the free ones.
  /// @pre it is not prescribed.
  [[nodiscard]] int FreeIndexOf(int dof) const {
    return static_cast<int>(std::find(free.begin(), free.end(), dof) - free.begin());
  }
  /// The state at rest at these positions of all degrees of freedom.
  [[nodiscard]] State AtRest(std::span<const double> positions) const {
    State y{};
    for (std::size_t i = 0; i < free.size(); ++i)
      y[i] = positions[static_cast<std::size_t>(free[i])];
    return y;
  }

  /// Places all bodies, finds the contacts and applies their wrenches.
  void Touch() {
    dynamics.SetState({q.data(), n}, {qd.data(), n});
    contact->Apply(dynamics);
  }
  /// Adds the springs of passive joints to tau, and computes qdd of the free degrees of freedom and
  /// tau of the prescribed ones: the torques of their motors, which bear the friction, too.
  void Solve() {
    if (plain_) return dynamics.Solve({qdd.data(), n}, {tau.data(), n});
    SolveWithJoints();
  }
  /// Touch and Solve, without forces other than those of contact.
  void TouchAndSolve() {
    tau.fill(0);
    Touch();
    Solve();
  }
  /// Writes the derivatives of what Solve computed, as HybridDynamics::Differentiate does.
  void Differentiate(typename HybridDynamics<Space>::Derivatives& out) {
    contact->Differentiate(dynamics);
    dynamics.Differentiate(out);
    AddFrictionSlopes(out);
    for (const PassiveJoint& joint : springs_) {
      for (std::size_t i = 0; i < n; ++i)
        out.q[i][joint.dof] -= joint.stiffness_nm_per_rad * out.input[i][joint.dof];
    }
  }
  /// The same as HybridDynamics::DifferentiateFactored does.
  void DifferentiateFactored(typename HybridDynamics<Space>::Derivatives& out,
                             bool by_prescribed = true) {
    contact->Differentiate(dynamics);
    dynamics.DifferentiateFactored(out, by_prescribed);
    AddFrictionSlopes(out);
    for (const PassiveJoint& joint : springs_)
      out.q[joint.dof][joint.dof] += joint.stiffness_nm_per_rad;
  }
  /// Writes the derivative of the State after Solve: velocities, then accelerations.
  void TakeSlope(double* k) const {
    double* acceleration = k + free.size();
    for (const int dof : free) {
      *k++ = qd[dof];
      *acceleration++ = qdd[dof];
    }
  }

  /// Makes a chart that of the root from the next Touch on. Nothing in the plane.
  void Use(const RootChart<Space>& chart) {
    if constexpr (RootChart<Space>::kMoves) dynamics.SetRootAxes({chart.axes});
  }

  HybridDynamics<Space> dynamics;
  std::unique_ptr<ContactForces<Space>> contact;
  /// Number of degrees of freedom.
  std::size_t n;
  /// The degrees of freedom that are not prescribed.
  std::vector<int> free;
  Numbers q{}, qd{}, qdd{}, tau{};

 private:
  /// Solve where springs or dry friction act in joints.
  void SolveWithJoints();

  /// A prescribed joint whose motor has dry friction.
  struct DryJoint {
    std::size_t dof;
    double friction_nm;
  };
  /// Friction is no part of inverse dynamics but for the torque of its own joint.
  void AddFrictionSlopes(typename HybridDynamics<Space>::Derivatives& out) const {
    for (const DryJoint& joint : dry_) {
      out.qd[joint.dof][joint.dof] +=
          EvaluateDryFriction(joint.friction_nm, qd[joint.dof]).by_velocity;
    }
  }
  std::vector<DryJoint> dry_;
  std::vector<PassiveJoint> springs_;  // those with a stiffness
  bool plain_ = true;                  // neither of the two
};

using SceneDynamics = SceneDynamicsIn<Plane>;
using SpaceDynamics = SceneDynamicsIn<Spatial>;

}  // namespace tumbler
