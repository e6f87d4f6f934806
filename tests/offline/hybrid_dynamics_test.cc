#include "offline/model/hybrid_dynamics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/random_robot.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {
namespace {

using PlanarDynamics = HybridDynamics<Plane>;

/// The outputs of hybrid dynamics: accelerations of free, torques of prescribed degrees of freedom.
std::vector<double> Outputs(PlanarDynamics& dynamics, DynamicsState s,
                            const std::vector<Plane::Wrench>& wrenches = {}) {
  dynamics.SetState(s.q, s.qd);
  for (std::size_t j = 0; j < wrenches.size(); ++j)
    dynamics.AddWrench(static_cast<int>(j), wrenches[j]);
  dynamics.Solve(s.qdd, s.tau);
  for (int j = 0; j < dynamics.size(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    if (!dynamics.prescribed(j)) s.tau[i] = s.qdd[i];
  }
  return s.tau;
}

TEST(HybridDynamics, GivesTheValuePublishedByThreeOtherEngines) {
  // A tumbler with 0.25 m legs made of boxes 40 mm thick: leg_a hinged at -0.15, pointing along -x
  // at zero, leg_b at +0.15 along +x. DART, Pinocchio and MuJoCo agree on this value to 1e-11.
  Tree<Plane> tree;
  tree.gravity = {0, -9.81};
  for (int j = 0; j < 5; ++j) {
    Dof<Plane> dof;
    dof.parent = j < 3 ? j - 1 : 2;
    dof.kind = j < 2 ? JointKind::kPrismatic : JointKind::kRevolute;
    if (j < 2) dof.direction[j] = 1;
    dof.massless = j < 2;
    if (j == 2) {
      dof.mass_kg = 1;
      dof.inertia_kg_m2 = (0.3 * 0.3 + 0.04 * 0.04) / 12;
    }
    if (j > 2) {
      const double side = j == 3 ? -1 : 1;
      dof.prescribed = true;
      dof.offset = {0.15 * side, 0};
      dof.mass_kg = 0.4;
      dof.mass_centre = {0.125 * side, 0};
      dof.inertia_kg_m2 = 0.4 * (0.25 * 0.25 + 0.04 * 0.04) / 12;
    }
    tree.dofs.push_back(dof);
  }
  PlanarDynamics dynamics(tree);
  const std::vector<double> out = Outputs(
      dynamics, {{.1, .2, .3, .4, .5}, {1, 2, 3, 4, 5}, {0, 0, 0, .1, .2}, std::vector<double>(5)});
  EXPECT_NEAR(out[0], 0.208891784734129, 1e-12);
  EXPECT_NEAR(out[1], -9.40478201383283, 1e-12);
  EXPECT_NEAR(out[2], 4.49958658129138, 1e-12);
  EXPECT_NEAR(out[3], 0.0871760888152076, 1e-12);
  EXPECT_NEAR(out[4], 0.108014195159789, 1e-12);
}

TEST(HybridDynamics, ForwardAndInverseDynamicsUndoEachOther) {
  std::mt19937_64 random(21);
  for (int trial = 0; trial < 200; ++trial) {
    Tree<Plane> tree = RandomTree(random);
    const std::size_t n = tree.dofs.size();
    DynamicsState s = RandomState(random, n);
    PlanarDynamics hybrid(tree);
    hybrid.SetState(s.q, s.qd);
    hybrid.Solve(s.qdd, s.tau);  // now qdd and tau belong together
    for (Dof<Plane>& dof : tree.dofs) dof.prescribed = true;
    std::vector<double> tau(n), qdd = s.qdd;
    PlanarDynamics inverse(tree);
    inverse.SetState(s.q, s.qd);
    inverse.Solve(qdd, tau);
    for (Dof<Plane>& dof : tree.dofs) dof.prescribed = false;
    PlanarDynamics forward(tree);
    std::vector<double> found(n);
    forward.SetState(s.q, s.qd);
    forward.Solve(found, s.tau);
    for (std::size_t i = 0; i < n; ++i) {
      EXPECT_NEAR(tau[i], s.tau[i], 1e-8 * (1 + std::abs(s.tau[i])));
      EXPECT_NEAR(found[i], s.qdd[i], 1e-7 * (1 + std::abs(s.qdd[i])));
    }
  }
}

TEST(HybridDynamics, DerivativesAgreeWithCentralDifferencesOnRandomTrees) {
  std::mt19937_64 random(22);
  for (int trial = 0; trial < 300; ++trial) {
    const Tree<Plane> tree = RandomTree(random);
    const std::size_t n = tree.dofs.size();
    const DynamicsState s = RandomState(random, n);
    PlanarDynamics dynamics(tree);
    const std::vector<double> value = Outputs(dynamics, s);
    DynamicsDerivatives<Plane> d;
    dynamics.Differentiate(d);
    double scale = 1;
    for (const double v : value) scale = std::max(scale, std::abs(v));
    const double h = 1e-5;
    for (std::size_t k = 0; k < n; ++k) {
      for (int kind = 0; kind < 3; ++kind) {
        const auto shifted = [&](double step) {
          DynamicsState t = s;
          if (kind == 0) t.q[k] += step;
          if (kind == 1) t.qd[k] += step;
          if (kind == 2) (tree.dofs[k].prescribed ? t.qdd : t.tau)[k] += step;
          return Outputs(dynamics, t);
        };
        // A difference of fourth order has an error below the tolerance.
        const auto p1 = shifted(h), m1 = shifted(-h), p2 = shifted(2 * h), m2 = shifted(-2 * h);
        for (std::size_t i = 0; i < n; ++i) {
          const double difference = (8 * (p1[i] - m1[i]) - (p2[i] - m2[i])) / (12 * h);
          const auto& block = kind == 0 ? d.q : kind == 1 ? d.qd : d.input;
          EXPECT_NEAR(block[i][k], difference, 1e-7 * (scale + std::abs(difference)))
              << "trial " << trial << " kind " << kind << " row " << i << " column " << k;
        }
      }
    }
  }
}

TEST(HybridDynamics, FreeFlightKeepsMomentum) {
  PlanarRobot robot = LoadTumbler();
  PlanarDynamics dynamics(robot.tree);
  std::mt19937_64 random(23);
  std::vector<double> q(5), qd(5), qdd(5), tau(5);
  for (std::size_t i = 0; i < 5; ++i) {
    q[i] = Uniform(random, -1, 1);
    qd[i] = Uniform(random, -2, 2);
  }
  const double m = 1.8, g = 9.81, h = 1e-3;
  dynamics.SetState(q, qd);
  const Plane::Wrench start = dynamics.Momentum();
  const double x_start = start.f.x() / m;
  // The legs swing on a sinusoid; the free part is integrated with RK4.
  const double leg[2] = {q[3], q[4]};
  const auto legs = [&](double t, std::vector<double>& p, std::vector<double>& v) {
    for (std::size_t i = 0; i < 2; ++i) {
      const double w = 7 + 3 * static_cast<double>(i);
      p[3 + i] = leg[i] + 0.8 * (1 - std::cos(w * t));
      v[3 + i] = 0.8 * w * std::sin(w * t);
      qdd[3 + i] = 0.8 * w * w * std::cos(w * t);
    }
  };
  std::vector<double> dummy_q = q, dummy_qd = qd;
  legs(0, q, qd);
  dynamics.SetState(q, qd);
  const Plane::Wrench begin = dynamics.Momentum();
  for (int step = 0; step < 500; ++step) {
    std::array<std::array<double, 6>, 4> k{};
    const double c[4] = {0, 0.5, 0.5, 1};
    for (std::size_t s = 0; s < 4; ++s) {
      std::vector<double> p = q, v = qd;
      for (std::size_t i = 0; i < 3; ++i) {
        if (s > 0) p[i] += h * c[s] * k[s - 1][i];
        if (s > 0) v[i] += h * c[s] * k[s - 1][3 + i];
      }
      legs((step + c[s]) * h, p, v);
      dynamics.SetState(p, v);
      std::fill(tau.begin(), tau.begin() + 3, 0.0);
      dynamics.Solve(qdd, tau);
      for (std::size_t i = 0; i < 3; ++i) {
        k[s][i] = v[i];
        k[s][3 + i] = qdd[i];
      }
    }
    for (std::size_t i = 0; i < 3; ++i) {
      q[i] += h / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
      qd[i] += h / 6 * (k[0][3 + i] + 2 * k[1][3 + i] + 2 * k[2][3 + i] + k[3][3 + i]);
    }
  }
  legs(0.5, q, qd);
  dynamics.SetState(q, qd);
  const Plane::Wrench end = dynamics.Momentum();
  EXPECT_NEAR(end.f.x(), begin.f.x(), 1e-9);
  EXPECT_NEAR(end.f.y(), begin.f.y() - m * g * 0.5, 1e-9);
  // About the world's origin, gravity has the moment -m g x(t) with x(t) = x0 + vx t.
  const double vx = begin.f.x() / m;
  (void)x_start;
  dynamics.SetState(q, qd);
  double x_end = 0;  // from the potential energy of a sideways gravity
  {
    PlanarRobot sideways = LoadTumbler();
    sideways.tree.gravity = {-1, 0};
    PlanarDynamics probe(sideways.tree);
    probe.SetState(q, qd);
    x_end = probe.PotentialEnergy() / m;
  }
  const double x_begin = x_end - vx * 0.5;
  EXPECT_NEAR(end.n, begin.n - m * g * (x_begin * 0.5 + vx * 0.125), 1e-9);
}

TEST(HybridDynamics, DoesNotDependOnWhereTheRobotIs) {
  std::mt19937_64 random(24);
  PlanarRobot robot = LoadTumbler();
  PlanarDynamics dynamics(robot.tree);
  DynamicsState s = RandomState(random, 5);
  const std::vector<double> here = Outputs(dynamics, s);
  s.q[0] += 1e6;
  s.q[1] -= 1e6;
  const std::vector<double> there = Outputs(dynamics, s);
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_NEAR(here[i], there[i], 1e-8 * (1 + std::abs(here[i])));
}

}  // namespace
}  // namespace tumbler
