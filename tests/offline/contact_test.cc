#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "offline/model/contact_model.h"
#include "offline/model/hybrid_dynamics.h"
#include "tests/support/random_robot.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {
namespace {

using Dynamics = HybridDynamics<Plane>;

std::vector<Obstacle<Plane>> GroundAndBump() {
  return {{"ground", Shape<Plane>::HalfSpace({0, 0}, {0, 1})},
          {"bump", Shape<Plane>::Sphere({0.1, 0}, 0.15)},
          {"wall", Shape<Plane>::HalfSpace({-0.5, 0}, {3, 1})}};
}

class EveryLaw : public ::testing::TestWithParam<std::tuple<ContactSmoothing, ContactDamping>> {
 protected:
  static ContactLaw Law() {
    ContactLaw law;
    law.smoothing = std::get<0>(GetParam());
    law.damping_law = std::get<1>(GetParam());
    return law;
  }
};
INSTANTIATE_TEST_SUITE_P(
    Contact, EveryLaw,
    ::testing::Combine(::testing::Values(ContactSmoothing::kCubic, ContactSmoothing::kQuintic),
                       ::testing::Values(ContactDamping::kNoPull, ContactDamping::kSigned,
                                         ContactDamping::kPrinted)));

TEST_P(EveryLaw, DerivativesOfTheNormalForceAgreeWithDifferences) {
  const ContactLaw law = Law();
  const double h = 1e-7;
  for (double d = -0.002; d < 0.006; d += 1.37e-5) {
    for (double v = -2; v < 2; v += 0.0931) {
      const NormalForce f = EvaluateNormalForce(law, d, v);
      const double by_d =
          (EvaluateNormalForce(law, d + h, v).N - EvaluateNormalForce(law, d - h, v).N) / (2 * h);
      const double by_v =
          (EvaluateNormalForce(law, d, v + h).N - EvaluateNormalForce(law, d, v - h).N) / (2 * h);
      // Second derivatives jump at d_on, d_off and lift-off, and a difference there is wrong by h
      // times the jump.
      EXPECT_NEAR(f.N_d, by_d, 1e-6 * std::abs(by_d) + 20);
      EXPECT_NEAR(f.N_v, by_v, 1e-6 * std::abs(by_v) + 1e-3);
    }
  }
}

TEST_P(EveryLaw, IsContinuousWithItsDerivativesAcrossEverySwitch) {
  const ContactLaw law = Law();
  const double tiny = 1e-12;
  const auto same = [&](double d1, double v1, double d2, double v2) {
    const NormalForce a = EvaluateNormalForce(law, d1, v1);
    const NormalForce b = EvaluateNormalForce(law, d2, v2);
    EXPECT_NEAR(a.N, b.N, 1e-6);
    EXPECT_NEAR(a.N_d, b.N_d, 1e-2);
    if (law.damping_law != ContactDamping::kPrinted || v1 * v2 > 0) {
      EXPECT_NEAR(a.N_v, b.N_v, 1e-6);
    }
  };
  for (double v = -1.01; v < 1; v += 0.1) {
    same(law.d_on_m - tiny, v, law.d_on_m + tiny, v);
    same(law.d_off_m - tiny, v, law.d_off_m + tiny, v);
  }
  for (double d = 0; d < law.d_on_m; d += 1e-4) {
    const double lift_off = law.stiffness_n_per_m * (law.d_on_m - d) / law.damping_n_s_per_m;
    const double clamp_ends =
        lift_off - law.stiffness_n_per_m * (law.d_on_m - law.d_off_m) / law.damping_n_s_per_m;
    same(d, lift_off - tiny, d, lift_off + tiny);
    same(d, clamp_ends - tiny, d, clamp_ends + tiny);
    same(d, -tiny, d, tiny);
  }
}

TEST(ContactLaw, NeverPullsByDefault) {
  const ContactLaw law;
  for (double d = -0.01; d < 0.006; d += 1e-5) {
    for (double v = -5; v < 5; v += 0.01) EXPECT_GE(EvaluateNormalForce(law, d, v).N, 0);
  }
}

TEST(ContactLaw, TheSignedLawPullsWhenItSeparatesFast) {
  ContactLaw law;
  law.damping_law = ContactDamping::kSigned;
  EXPECT_LT(EvaluateNormalForce(law, 0.0025, 1.0).N, 0);
}

TEST(ContactLaw, FrictionAlongALineIsThatOfAVectorButForRounding) {
  const ContactLaw law;
  for (double slip = -3; slip < 3; slip += 0.01) {
    const double v = slip * law.v_max_m_per_s;
    EXPECT_NEAR(FrictionShare(v / law.v_max_m_per_s), EvaluateFrictionGain(law, v * v).gain * v,
                4e-16)
        << slip;
  }
}

TEST(ContactLaw, FrictionIsContinuousWithItsDerivativeAtTheSlipSpeedAndAtRest) {
  const ContactLaw law;
  const double v2 = law.v_max_m_per_s * law.v_max_m_per_s;
  const FrictionGain below = EvaluateFrictionGain(law, v2 * (1 - 1e-12));
  const FrictionGain above = EvaluateFrictionGain(law, v2 * (1 + 1e-12));
  EXPECT_NEAR(below.gain, above.gain, 1e-9);
  EXPECT_NEAR(below.gain_s2, above.gain_s2, 1e-5);
  EXPECT_EQ(EvaluateFrictionGain(law, 0).gain, 1.5 / law.v_max_m_per_s);
  // Above the slip speed there is full Coulomb friction: |gain v_t| = 1.
  EXPECT_NEAR(EvaluateFrictionGain(law, 4.0).gain * 2.0, 1, 1e-15);
}

/// Drops a ball on the ground. @returns its highest point after the bounce.
double PeakAfterBounce(const ContactLaw& law, double drop_m, double* peak_energy) {
  Tree<Plane> tree;
  tree.gravity = {0, -9.81};
  Dof<Plane> dof;
  dof.kind = JointKind::kPrismatic;
  dof.direction = {0, 1};
  dof.mass_kg = 1;
  tree.dofs = {dof};
  ContactModel<Plane> contact(law, {{"ball/0", 0, Shape<Plane>::Sphere({0, 0}, 0.03)}},
                              {{"ground", Shape<Plane>::HalfSpace({0, 0}, {0, 1})}});
  Dynamics dynamics(tree);
  double q = 0.03 + law.d_on_m + drop_m, v = 0, peak = 0;
  const double start_energy = 9.81 * q;
  bool bounced = false;
  const double h = 2e-5;
  for (int step = 0; step < 60000; ++step) {
    const auto f = [&](double x, double xd) {
      std::array<double, 1> qq{x}, qd{xd}, qdd{0}, tau{0};
      dynamics.SetState(qq, qd);
      contact.Apply(dynamics);
      dynamics.Solve(qdd, tau);
      return qdd[0];
    };
    const double k1 = f(q, v), k2 = f(q + h / 2 * v, v + h / 2 * k1),
                 k3 = f(q + h / 2 * (v + h / 2 * k1), v + h / 2 * k2),
                 k4 = f(q + h * (v + h / 2 * k2), v + h * k3);
    q += h * v + h * h / 6 * (k1 + k2 + k3);
    v += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    if (v > 0) bounced = true;
    if (bounced) peak = std::max(peak, q);
    // Outside the layer there is only kinetic energy and that of gravity.
    if (q > 0.03 + law.d_on_m)
      *peak_energy = std::max(*peak_energy, 9.81 * q + v * v / 2 - start_energy);
    if (bounced && v < 0) break;
  }
  return peak - 0.03 - law.d_on_m;
}

TEST(Contact, APassiveBounceNeverGainsEnergy) {
  for (const double c : {0.0, 5.0, 60.0, 300.0}) {
    for (const double drop : {0.005, 0.05, 0.3}) {
      for (const auto smoothing : {ContactSmoothing::kCubic, ContactSmoothing::kQuintic}) {
        ContactLaw law;
        law.damping_n_s_per_m = c;
        law.smoothing = smoothing;
        double gained = -1;
        const double peak = PeakAfterBounce(law, drop, &gained);
        EXPECT_LE(gained, 1e-6 * drop * 9.81);
        EXPECT_LE(peak, drop * (1 + 1e-6));
        if (c == 0) {
          EXPECT_NEAR(peak, drop, 1e-4 * drop);
        }
      }
    }
  }
}

TEST(Contact, ThePrintedLawGainsEnergyOnApproachWhichIsWhyItIsNotTheDefault) {
  // In the printed law the damper acts against the spring both on approach and on rebound, so it
  // does pull the body in.
  ContactLaw law;
  law.damping_law = ContactDamping::kPrinted;
  EXPECT_LT(EvaluateNormalForce(law, 0.002, -1.0).N, EvaluateNormalForce(law, 0.002, 0.0).N);
  law.damping_law = ContactDamping::kNoPull;
  EXPECT_GT(EvaluateNormalForce(law, 0.002, -1.0).N, EvaluateNormalForce(law, 0.002, 0.0).N);
}

TEST_P(EveryLaw, DynamicsThroughContactHaveExactDerivatives) {
  const PlanarRobot robot = LoadTumbler();
  ContactModel<Plane> contact(Law(), robot.shapes, GroundAndBump());
  Dynamics dynamics(robot.tree);
  std::mt19937_64 random(31);
  const auto outputs = [&](DynamicsState s) {
    dynamics.SetState(s.q, s.qd);
    contact.Apply(dynamics);
    dynamics.Solve(s.qdd, s.tau);
    std::vector<double> out(5);
    for (std::size_t i = 0; i < 5; ++i) out[i] = i < 3 ? s.qdd[i] : s.tau[i];
    return out;
  };
  int compared = 0;
  int at_a_switch = 0;
  for (int trial = 0; trial < 40000 && compared < 300; ++trial) {
    DynamicsState s = RandomState(random, 5, 0.05);
    s.q[0] = Uniform(random, -0.6, 0.6);
    s.q[1] = Uniform(random, 0.0, 0.35);
    outputs(s);
    bool plausible = !contact.active().empty();
    for (const auto& a : contact.active())
      plausible = plausible && a.depth_m < 0.02;  // No robot gets deeper.
    if (!plausible) continue;
    DynamicsDerivatives<Plane> d;
    contact.Differentiate(dynamics);
    dynamics.Differentiate(d);
    // The law is C1, not C2. Where a switch lies within reach of the step, differences of two sizes
    // disagree, and neither is a reference.
    double worst = 0;
    bool smooth = true;
    for (std::size_t k = 0; k < 5; ++k) {
      for (int kind = 0; kind < 2; ++kind) {
        const auto central = [&](double h) {
          DynamicsState p = s, m = s;
          (kind == 0 ? p.q : p.qd)[k] += h;
          (kind == 0 ? m.q : m.qd)[k] -= h;
          auto fp = outputs(p);
          const auto fm = outputs(m);
          for (std::size_t i = 0; i < 5; ++i) fp[i] = (fp[i] - fm[i]) / (2 * h);
          return fp;
        };
        const auto wide = central(2e-6), narrow = central(1e-6);
        for (std::size_t i = 0; i < 5; ++i) {
          const double reference = (4 * narrow[i] - wide[i]) / 3;
          const double scale = 1000 + std::abs(reference);
          smooth = smooth && std::abs(wide[i] - narrow[i]) < 1e-5 * scale;
          worst = std::max(worst, std::abs((kind == 0 ? d.q : d.qd)[i][k] - reference) / scale);
        }
      }
    }
    if (!smooth) {
      ++at_a_switch;
      continue;
    }
    ++compared;
    EXPECT_LT(worst, 1e-7) << "trial " << trial << ", " << contact.active().size() << " contacts";
  }
  EXPECT_EQ(compared, 300);
  EXPECT_LT(at_a_switch, 60);
}

}  // namespace
}  // namespace tumbler
