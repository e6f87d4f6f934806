// Hybrid dynamics in space: properties, differences, and the plane as a special case. The
// comparison with an independent engine is in dart_oracle_test.cc.

#include "offline/model/spatial.h"

#include <gtest/gtest.h>

#include <cmath>

#include "offline/model/hybrid_dynamics.h"
#include "tests/support/allocation_guard.h"
#include "tests/support/random_robot.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {
namespace {

using SpatialDynamics = HybridDynamics<Spatial>;

/// A force on a point of a body. The force is constant in world axes, and the point moves with the
/// body.
struct PointForce {
  int body = 0;
  SpaceVector point, force;  // in the body's frame; in world axes
};

template <class Space>
std::vector<double> Outputs(HybridDynamics<Space>& dynamics, DynamicsState s,
                            const std::vector<PointForce>& forces = {}) {
  dynamics.SetState(s.q, s.qd);
  if constexpr (std::is_same_v<Space, Spatial>) {
    for (const PointForce& f : forces) {
      dynamics.AddWrench(
          f.body, Spatial::ForceAt(dynamics.position(f.body) + dynamics.rotation(f.body) * f.point,
                                   f.force));
    }
  }
  dynamics.Solve(s.qdd, s.tau);
  for (int j = 0; j < dynamics.size(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    if (!dynamics.prescribed(j)) s.tau[i] = s.qdd[i];
  }
  return s.tau;
}

double SizeOf(const Spatial::Wrench& w) { return std::hypot(w.n.norm(), w.f.norm()); }

Spatial::Motion RandomMotion(std::mt19937_64& random) {
  return {RandomVector(random, 2), RandomVector(random, 2)};
}

TEST(SpatialAlgebra, TheBiasMapIsItsDefinition) {
  // 2B u = v x* I u - I (v x u) + u x* I v.
  std::mt19937_64 random(61);
  for (int trial = 0; trial < 100; ++trial) {
    const Spatial::Rotation R =
        Spatial::RotationBy(RandomDirection(random), Uniform(random, -3, 3));
    const auto I = Spatial::Inertia::OfBody(Uniform(random, 0.1, 2), RandomVector(random, 1), R,
                                            RandomInertia(random));
    const Spatial::Motion v = RandomMotion(random), u = RandomMotion(random),
                          s = RandomMotion(random);
    const auto bias = Spatial::Bias::OfBody(I, v, I * v);
    const Spatial::Wrench expected =
        Spatial::Cross(v, I * u) - I * Spatial::Cross(v, u) + Spatial::Cross(u, I * v);
    EXPECT_LT(SizeOf(bias * u - expected), 1e-13 * (1 + SizeOf(expected)));
    EXPECT_NEAR(Spatial::Apply(bias.TransposeTimes(s), u), Spatial::Dot(s, expected), 1e-12);
  }
}

TEST(SpatialAlgebra, InertiaIsThatOfTheTurnedBodyAboutTheOrigin) {
  std::mt19937_64 random(62);
  for (int trial = 0; trial < 100; ++trial) {
    const Spatial::Rotation R =
        Spatial::RotationBy(RandomDirection(random), Uniform(random, -3, 3));
    const SpaceVector c = RandomVector(random, 1);
    const SpaceMatrix i_c = RandomInertia(random);
    const double m = Uniform(random, 0.1, 2);
    const Spatial::Motion v = RandomMotion(random);
    const auto momentum = Spatial::Inertia::OfBody(m, c, R, i_c) * v;
    const SpaceVector p = m * v.At(c);
    EXPECT_LT((momentum.f - p).norm(), 1e-13);
    const SpaceVector spin = R.m * i_c * R.m.transpose() * v.w;
    EXPECT_LT((momentum.n - spin - c.cross(p)).norm(), 1e-13);
  }
}

TEST(SpatialAlgebra, ATurnIsTheRotationByItsAngle) {
  std::mt19937_64 random(62);
  const SpaceVector nearly_x{1, 1e-9, 0};  // of length 1 to rounding
  std::vector<SpaceVector> axes{nearly_x};
  for (int i = 0; i < 3; ++i) {
    axes.push_back(SpaceVector::Unit(i));
    axes.push_back(-SpaceVector::Unit(i));
    axes.push_back(RandomDirection(random));
  }
  for (const SpaceVector& axis : axes) {
    const double angle = Uniform(random, -3, 3);
    const Spatial::Rotation R =
        Spatial::RotationBy(RandomDirection(random), Uniform(random, -3, 3));
    const SpaceMatrix error =
        (R * Spatial::Turn(axis, angle)).m - (R * Spatial::RotationBy(axis, angle)).m;
    for (int k = 0; k < 3; ++k) EXPECT_LT(error.col(k).norm(), 1e-15);
  }
}

TEST(SpatialDynamics, ForwardAndInverseDynamicsUndoEachOther) {
  std::mt19937_64 random(63);
  for (int trial = 0; trial < 200; ++trial) {
    Tree<Spatial> tree = RandomSpatialTree(random);
    const std::size_t n = tree.dofs.size();
    DynamicsState s = RandomState(random, n);
    SpatialDynamics hybrid(tree);
    hybrid.SetState(s.q, s.qd);
    hybrid.Solve(s.qdd, s.tau);  // now qdd and tau belong together
    for (auto& dof : tree.dofs) dof.prescribed = true;
    std::vector<double> tau(n), qdd = s.qdd;
    SpatialDynamics inverse(tree);
    inverse.SetState(s.q, s.qd);
    inverse.Solve(qdd, tau);
    for (auto& dof : tree.dofs) dof.prescribed = false;
    SpatialDynamics forward(tree);
    std::vector<double> found(n);
    forward.SetState(s.q, s.qd);
    forward.Solve(found, s.tau);
    for (std::size_t i = 0; i < n; ++i) {
      EXPECT_NEAR(tau[i], s.tau[i], 1e-8 * (1 + std::abs(s.tau[i])));
      EXPECT_NEAR(found[i], s.qdd[i], 1e-7 * (1 + std::abs(s.qdd[i])));
    }
  }
}

/// A body on a floating root (three translations, three rotations) with three limbs.
Tree<Spatial> FloatingRobot(std::mt19937_64& random) {
  Tree<Spatial> tree;
  tree.gravity = {0, 0, -9.81};
  const SpaceVector axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, -1, 0}, {1, 0, 0}, {0, 0, 1}};
  for (int j = 0; j < 9; ++j) {
    Dof<Spatial> dof;
    dof.parent = j < 6 ? j - 1 : 5;
    dof.kind = j < 3 ? JointKind::kPrismatic : JointKind::kRevolute;
    dof.massless = j < 5;
    dof.axis = dof.direction = j < 6 ? axes[j] : RandomDirection(random);
    if (!dof.massless) {
      dof.mass_kg = Uniform(random, 0.2, 2);
      dof.mass_centre = RandomVector(random, 0.3);
      dof.inertia_kg_m2 = RandomInertia(random);
    }
    if (j > 5) dof.offset = RandomVector(random, 0.3);
    tree.dofs.push_back(dof);
  }
  return tree;
}

/// Compares all derivatives at a state, with forces on random bodies, with differences.
void CompareWithDifferences(std::mt19937_64& random, const Tree<Spatial>& tree,
                            const DynamicsState& s) {
  const std::size_t n = tree.dofs.size();
  std::vector<PointForce> forces;
  for (int k = static_cast<int>(random() % 4); k > 0; --k) {
    forces.push_back(
        {static_cast<int>(random() % n), RandomVector(random, 0.3), RandomVector(random, 20)});
  }
  SpatialDynamics dynamics(tree);
  const std::vector<double> value = Outputs(dynamics, s, forces);
  for (const PointForce& f : forces) {
    const SpaceVector p = dynamics.position(f.body) + dynamics.rotation(f.body) * f.point;
    const Spatial::Wrench W = Spatial::ForceAt(p, f.force);
    Spatial::WrenchMap stiffness;
    for (std::size_t m = 0; m < stiffness.columns.size(); ++m) {
      const Spatial::Motion u = Spatial::BasisMotion(m);
      stiffness.columns[m] =
          Spatial::Wrench{u.At(p).cross(f.force), SpaceVector::Zero()} - Spatial::Cross(u, W);
    }
    dynamics.AddWrenchDerivative(f.body, stiffness, {});
  }
  SpatialDynamics::Derivatives d;
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
        return Outputs(dynamics, t, forces);
      };
      // Fourth order: its error stays below the tolerance.
      const auto p1 = shifted(h), m1 = shifted(-h), p2 = shifted(2 * h), m2 = shifted(-2 * h);
      for (std::size_t i = 0; i < n; ++i) {
        const double difference = (8 * (p1[i] - m1[i]) - (p2[i] - m2[i])) / (12 * h);
        const auto& block = kind == 0 ? d.q : kind == 1 ? d.qd : d.input;
        EXPECT_NEAR(block[i][k], difference, 1e-7 * (scale + std::abs(difference)))
            << "kind " << kind << " row " << i << " column " << k;
      }
    }
  }
}

TEST(SpatialDynamics, DerivativesAgreeWithCentralDifferencesOnRandomTreesWithForces) {
  std::mt19937_64 random(64);
  for (int trial = 0; trial < 200; ++trial) {
    SCOPED_TRACE(trial);
    const Tree<Spatial> tree = RandomSpatialTree(random);
    const DynamicsState s = RandomState(random, tree.dofs.size());
    CompareWithDifferences(random, tree, s);
  }
}

TEST(SpatialDynamics, DerivativesAgreeWithCentralDifferencesOnAFloatingRobotWithForces) {
  std::mt19937_64 random(69);
  for (int trial = 0; trial < 50; ++trial) {
    SCOPED_TRACE(trial);
    Tree<Spatial> tree = FloatingRobot(random);
    for (Dof<Spatial>& dof : tree.dofs) {
      dof.prescribed = random() % 2 == 0;
      dof.damping_nm_s_per_rad = Uniform(random, 0, 0.5);
    }
    DynamicsState s = RandomState(random, tree.dofs.size());
    s.q[4] = Uniform(random, -1, 1);  // away from the singularity of the coordinates
    CompareWithDifferences(random, tree, s);
  }
}

/// The same robot in space. Its plane is that of x and z.
Tree<Spatial> InSpace(const Tree<Plane>& plane) {
  const auto lift = [](const PlaneVector& r) { return SpaceVector(r.x(), 0, r.y()); };
  Tree<Spatial> tree;
  tree.gravity = lift(plane.gravity);
  for (const Dof<Plane>& from : plane.dofs) {
    Dof<Spatial> dof;
    dof.parent = from.parent;
    dof.kind = from.kind;
    dof.prescribed = from.prescribed;
    dof.axis = {0, -from.axis, 0};
    dof.direction = lift(from.direction);
    dof.offset = lift(from.offset);
    dof.massless = from.massless;
    dof.mass_kg = from.mass_kg;
    dof.mass_centre = lift(from.mass_centre);
    // Only the moment about y counts.
    dof.inertia_kg_m2 = SpaceMatrix::Diagonal({0.3, 1, 0.8}) * from.inertia_kg_m2;
    dof.rotor_inertia_kg_m2 = from.rotor_inertia_kg_m2;
    dof.damping_nm_s_per_rad = from.damping_nm_s_per_rad;
    tree.dofs.push_back(dof);
  }
  return tree;
}

TEST(SpatialDynamics, APlanarRobotGivesTheSameNumbersAsInThePlane) {
  std::mt19937_64 random(65);
  for (int trial = 0; trial < 300; ++trial) {
    const Tree<Plane> tree = trial % 2 == 0 ? LoadTumbler().tree : RandomTree(random);
    const std::size_t n = tree.dofs.size();
    const DynamicsState s = RandomState(random, n);
    HybridDynamics<Plane> plane(tree);
    SpatialDynamics space(InSpace(tree));
    const std::vector<double> flat = Outputs(plane, s), full = Outputs(space, s);
    double scale = 1;
    for (const double v : flat) scale = std::max(scale, std::abs(v));
    for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(flat[i], full[i], 1e-12 * scale) << trial;
    HybridDynamics<Plane>::Derivatives d;
    SpatialDynamics::Derivatives D;
    plane.Differentiate(d);
    space.Differentiate(D);
    double d_scale = scale;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < n; ++k) {
        for (const double v : {d.q[i][k], d.qd[i][k], d.input[i][k]})
          d_scale = std::max(d_scale, std::abs(v));
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < n; ++k) {
        EXPECT_NEAR(d.q[i][k], D.q[i][k], 1e-12 * d_scale);
        EXPECT_NEAR(d.qd[i][k], D.qd[i][k], 1e-12 * d_scale);
        EXPECT_NEAR(d.input[i][k], D.input[i][k], 1e-12 * d_scale);
      }
    }
    EXPECT_NEAR(plane.KineticEnergy(), space.KineticEnergy(), 1e-12 * plane.KineticEnergy());
    EXPECT_NEAR(plane.Momentum().n, -space.Momentum().n.y(), 1e-12 * scale);
  }
}

TEST(SpatialDynamics, FreeFlightKeepsMomentumAndEnergy) {
  std::mt19937_64 random(66);
  const Tree<Spatial> tree = FloatingRobot(random);
  double mass = 0;
  for (const auto& dof : tree.dofs) mass += dof.mass_kg;
  const std::size_t n = tree.dofs.size();
  SpatialDynamics dynamics(tree);
  std::vector<double> q(n), qd(n), tau(n);
  for (std::size_t i = 0; i < n; ++i) {
    q[i] = Uniform(random, -0.5, 0.5);
    qd[i] = Uniform(random, -1.5, 1.5);
  }
  qd[4] = 0.2;  // away from the singularity of the coordinates
  dynamics.SetState(q, qd);
  const Spatial::Wrench begin = dynamics.Momentum();
  const double energy = dynamics.KineticEnergy() + dynamics.PotentialEnergy();
  // The moment of gravity about the origin needs the path of the mass centre, which is a parabola;
  // angular momentum is compared about the mass centre instead.
  const auto spin = [&](const Spatial::Wrench& momentum) {
    SpaceVector centre;
    for (int k = 0; k < 3; ++k) {
      Tree<Spatial> probe = tree;
      probe.gravity = -SpaceVector::Unit(k);
      SpatialDynamics weigh(probe);
      weigh.SetState(q, qd);
      centre[k] = weigh.PotentialEnergy() / mass;
    }
    return momentum.n - centre.cross(momentum.f);
  };
  const SpaceVector spin_begin = spin(begin);
  const double h = 1e-3;
  const int steps = 300;
  for (int step = 0; step < steps; ++step) {
    std::array<std::vector<double>, 4> k_q, k_v;
    const double c[4] = {0, 0.5, 0.5, 1};
    for (std::size_t s = 0; s < 4; ++s) {
      std::vector<double> p = q, v = qd, qdd(n);
      for (std::size_t i = 0; i < n && s > 0; ++i) {
        p[i] += h * c[s] * k_q[s - 1][i];
        v[i] += h * c[s] * k_v[s - 1][i];
      }
      dynamics.SetState(p, v);
      dynamics.Solve(qdd, tau);
      k_q[s] = v;
      k_v[s] = qdd;
    }
    for (std::size_t i = 0; i < n; ++i) {
      q[i] += h / 6 * (k_q[0][i] + 2 * k_q[1][i] + 2 * k_q[2][i] + k_q[3][i]);
      qd[i] += h / 6 * (k_v[0][i] + 2 * k_v[1][i] + 2 * k_v[2][i] + k_v[3][i]);
    }
  }
  dynamics.SetState(q, qd);
  const Spatial::Wrench end = dynamics.Momentum();
  const SpaceVector fall = mass * h * steps * tree.gravity;
  EXPECT_LT((end.f - begin.f - fall).norm(), 1e-8);
  EXPECT_LT((spin(end) - spin_begin).norm(), 1e-8);
  EXPECT_GT(spin_begin.norm(), 0.01);
  EXPECT_NEAR(dynamics.KineticEnergy() + dynamics.PotentialEnergy(), energy, 1e-8);
}

TEST(SpatialDynamics, ATumbleThroughVerticalPitchIsRegularAndTheSingularityIsFound) {
  std::mt19937_64 random(67);
  const Tree<Spatial> tree = FloatingRobot(random);
  SpatialDynamics dynamics(tree);
  DynamicsState s = RandomState(random, tree.dofs.size());
  const double quarter = std::acos(0.0);
  for (const double pitch : {quarter, -quarter, 2 * quarter}) {
    s.q[3] = pitch;
    s.q[4] = 0.1;
    dynamics.SetState(s.q, s.qd);
    dynamics.Solve(s.qdd, s.tau);
    EXPECT_EQ(dynamics.FindUndetermined(1e-3), -1) << pitch;
  }
  for (const double roll : {quarter, -quarter}) {
    s.q[4] = roll;
    dynamics.SetState(s.q, s.qd);
    dynamics.Solve(s.qdd, s.tau);
    EXPECT_EQ(dynamics.FindUndetermined(1e-12), 5) << "yaw turns about the axis of pitch";
  }
}

TEST(SpatialDynamics, ABodyWithoutInertiaIsFoundUndetermined) {
  Tree<Spatial> tree;
  tree.dofs.resize(2);
  tree.dofs[0].mass_kg = 1;
  tree.dofs[0].inertia_kg_m2 = SpaceMatrix::Identity();
  tree.dofs[1].parent = 0;
  tree.dofs[1].massless = true;
  SpatialDynamics dynamics(tree);
  DynamicsState s{{0, 0}, {0, 0}, {0, 0}, {0, 0}};
  dynamics.SetState(s.q, s.qd);
  dynamics.Solve(s.qdd, s.tau);
  EXPECT_EQ(dynamics.FindUndetermined(1e-12), 1);
}

TEST(SpatialDynamics, AsManyDegreesOfFreedomAsFitAllocateNothing) {
  std::mt19937_64 random(68);
  Tree<Spatial> tree;
  while (tree.dofs.size() != Spatial::kMaxDofs) tree = RandomSpatialTree(random, 40);
  SpatialDynamics dynamics(tree);
  SpatialDynamics::Derivatives derivatives;
  DynamicsState s = RandomState(random, tree.dofs.size());
  const testing::AllocationGuard guard;
  dynamics.SetState(s.q, s.qd);
  dynamics.AddWrench(31, {{1, 1, 1}, {1, 1, 1}});
  dynamics.Solve(s.qdd, s.tau);
  dynamics.AddWrenchDerivative(31, {}, {});
  dynamics.Differentiate(derivatives);
  for (const double a : s.qdd) EXPECT_TRUE(std::isfinite(a));
}

}  // namespace
}  // namespace tumbler
