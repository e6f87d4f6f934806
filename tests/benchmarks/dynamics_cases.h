#pragma once

#include <numbers>
#include <random>
#include <vector>

#include "offline/model/contact_model.h"
#include "offline/model/hybrid_dynamics.h"
#include "tests/support/random_robot.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {

/// The measured case: hybrid dynamics of the shipped robot (three passive root coordinates, two
/// prescribed legs), in the air or with two spheres of a foot on the ground.
class DynamicsCase {
 public:
  explicit DynamicsCase(bool on_the_ground)
      : robot_(LoadTumbler()),
        dynamics_(robot_.tree),
        contact_({}, robot_.shapes, Ground()),
        in_contact_(on_the_ground) {
    std::mt19937_64 random(51);
    for (int i = 0; i < 64; ++i) {
      DynamicsState s = RandomState(random, 5);
      if (on_the_ground) {  // Upside down on leg 2: its two spheres touch.
        s.q = {Uniform(random, -1, 1), 0.3575, std::numbers::pi / 2 + Uniform(random, -.01, .01),
               Uniform(random, -1, 1), Uniform(random, -.01, .01)};
        for (double& v : s.qd) v *= 0.05;
      }
      std::fill(s.tau.begin(), s.tau.begin() + 3, 0.0);
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
  [[nodiscard]] const DynamicsDerivatives<Plane>& derivatives() const { return derivatives_; }
  [[nodiscard]] const std::vector<DynamicsState>& states() const { return states_; }

 private:
  static std::vector<Obstacle<Plane>> Ground() {
    return {{"ground", Shape<Plane>::HalfSpace({0, 0}, {0, 1})}};
  }

  PlanarRobot robot_;
  HybridDynamics<Plane> dynamics_;
  ContactModel<Plane> contact_;
  bool in_contact_;
  std::vector<DynamicsState> states_;
  std::size_t next_ = 0;
  DynamicsDerivatives<Plane> derivatives_{};
};

}  // namespace tumbler
