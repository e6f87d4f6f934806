#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "offline/contact/contact_forces.h"
#include "offline/dynamics/hybrid_dynamics.h"
#include "offline/scene/scene.h"
#include "offline/stepper/stepper.h"

namespace tumbler {

/// The equations of motion of a scene, [AB04, Eqs. 7 and 8]: whoever integrates them puts the
/// robot's prescribed joints on their paths, and gets the accelerations of the free degrees of
/// freedom, whose positions and velocities are the state.
///
/// Order of calls: SetFree, and q, qd, qdd of what is prescribed; Touch; wrenches from elsewhere
/// (`dynamics.AddWrench`), and tau of what is free; Solve. No heap after construction.
struct SceneDynamics {
  static constexpr int kMaxDofs = HybridDynamics<Plane>::kMaxDofs;
  using Numbers = std::array<double, kMaxDofs>;  ///< By degree of freedom.
  using State = MechanicalState<kMaxDofs>;       ///< Of the free ones, in their order.

  /// @param own_contact  in place of the general contact model; null: that.
  explicit SceneDynamics(const Scene& scene,
                         std::unique_ptr<ContactForces<Plane>> own_contact = nullptr);

  /// Positions of the free degrees of freedom, then their velocities: those of a State.
  void SetFree(const double* y) {
    const double* velocity = y + free.size();
    for (const int dof : free) {
      q[static_cast<std::size_t>(dof)] = *y++;
      qd[static_cast<std::size_t>(dof)] = *velocity++;
    }
  }
  void SetFree(const State& y) { SetFree(y.data()); }
  /// The state of which SetFree makes these positions, at rest.
  [[nodiscard]] State AtRest(std::span<const double> positions) const {
    State y{};
    for (std::size_t i = 0; i < free.size(); ++i)
      y[i] = positions[static_cast<std::size_t>(free[i])];
    return y;
  }

  /// Where all bodies are, and what touches: contacts and their wrenches.
  void Touch() {
    dynamics.SetState({q.data(), n}, {qd.data(), n});
    contact->Apply(dynamics);
  }
  /// qdd of what is free, tau of what is prescribed.
  void Solve() { dynamics.Solve({qdd.data(), n}, {tau.data(), n}); }
  /// Both, with no other force than those of contact.
  void TouchAndSolve() {
    tau.fill(0);
    Touch();
    Solve();
  }
  /// The slope of a State, after Solve: velocities, then accelerations.
  void TakeSlope(double* k) const {
    double* acceleration = k + free.size();
    for (const int dof : free) {
      *k++ = qd[static_cast<std::size_t>(dof)];
      *acceleration++ = qdd[static_cast<std::size_t>(dof)];
    }
  }

  HybridDynamics<Plane> dynamics;
  std::unique_ptr<ContactForces<Plane>> contact;
  std::size_t n;          ///< Degrees of freedom.
  std::vector<int> free;  ///< Those that are not prescribed.
  Numbers q{}, qd{}, qdd{}, tau{};
};

}  // namespace tumbler
