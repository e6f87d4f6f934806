#pragma once

#include <random>
#include <vector>

#include "common/core/index.h"
#include "offline/model/contact_model.h"
#include "offline/model/contact_shapes.h"
#include "offline/model/hybrid_dynamics.h"
#include "tests/support/random_robot.h"
#include "tests/support/solo_robot.h"

namespace tumbler {

/// The measured case in space: hybrid dynamics of Solo12, in the air or on its four feet.
class SpaceCase {
 public:
  /// @param driven  whether its joints are given torques instead of accelerations.
  SpaceCase(bool on_the_ground, bool driven)
      : robot_(Load(driven)),
        dynamics_(robot_.tree),
        contact_({}, SpatialContactShapes(robot_).shapes, Ground()),
        in_contact_(on_the_ground) {
    std::mt19937_64 random(51);
    const std::size_t n = robot_.tree.dofs.size();
    for (int i = 0; i < 64; ++i) {
      DynamicsState s = RandomState(random, n, on_the_ground ? 0.05 : 1);
      s.q[4] = Uniform(random, -1, 1);  // of roll, away from the singularity
      if (on_the_ground) Stand(random, s);
      std::fill(s.tau.begin(), s.tau.begin() + kFloatingDofs, 0.0);
      states_.push_back(s);
    }
  }

  /// Evaluates g at the next of some states.
  void Solve() {
    DynamicsState& s = states_[next_++ % states_.size()];
    dynamics_.SetState(s.q, s.qd);
    if (in_contact_) contact_.Apply(dynamics_);
    dynamics_.Solve(s.qdd, s.tau);
  }
  /// Evaluates dg at the state of the last Solve.
  void Differentiate() {
    if (in_contact_) contact_.Differentiate(dynamics_);
    dynamics_.Differentiate(derivatives_);
  }

  [[nodiscard]] std::size_t contacts() const { return contact_.active().size(); }

 private:
  static Robot Load(bool driven) {
    Robot robot = LoadSolo("solo12");
    if (!driven) PrescribeJoints(robot);
    return robot;
  }

  static std::vector<Obstacle<Spatial>> Ground() {
    return {{"ground", Shape<Spatial>::HalfSpace({0, 0, 0}, {0, 0, 1})}};
  }

  /// On bent legs, the knees backwards, all feet some tenths of a millimetre deep.
  static void Stand(std::mt19937_64& random, DynamicsState& s) {
    constexpr double kBend = 0.8, kUpper_m = 0.16, kFoot_m = 0.0175;
    s.q[0] = Uniform(random, -1, 1);
    s.q[1] = Uniform(random, -1, 1);
    s.q[2] = 2 * kUpper_m * std::cos(kBend) + kFoot_m;
    for (const std::size_t turn : {3U, 4U}) s.q[turn] = Uniform(random, -1e-3, 1e-3);
    s.q[5] = Uniform(random, -3, 3);
    for (std::size_t leg = 0; leg < 4; ++leg) {
      const double noise = Uniform(random, -1e-3, 1e-3);
      s.q[6 + 3 * leg] = noise;
      s.q[7 + 3 * leg] = kBend + noise;
      s.q[8 + 3 * leg] = -2 * kBend + noise;
    }
  }

  Robot robot_;
  HybridDynamics<Spatial> dynamics_;
  ContactModel<Spatial> contact_;
  bool in_contact_;
  std::vector<DynamicsState> states_;
  std::size_t next_ = 0;
  DynamicsDerivatives<Spatial> derivatives_{};
};

}  // namespace tumbler
