// Contacts of every pair of shapes, in the plane and in space: derivatives, passivity, and motions
// with known ends.

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <map>

#include "offline/model/contact_model.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/near_points.h"
#include "tests/support/allocation_guard.h"
#include "tests/support/contact_simulation.h"
#include "tests/support/random_shape.h"

namespace tumbler {
namespace {

template <class Space>
constexpr int kDimensionOf = Shape<Space>::kDimension;

/// A free base with two arms: the first has two prescribed joints, the second a free one. Arms turn
/// about axes of their own.
template <class Space>
Tree<Space> TwoArms(std::mt19937_64& random) {
  Tree<Space> tree;
  const int turns = kDimensionOf<Space> == 2 ? 1 : 3;
  const auto add = [&](int parent, JointKind kind, bool massless) {
    Dof<Space> dof;
    dof.parent = parent;
    dof.kind = kind;
    dof.massless = massless;
    if (!massless) {
      dof.mass_kg = Uniform(random, 0.3, 1);
      dof.mass_centre = RandomPoint<Space>(random, 0.1);
      dof.offset = RandomPoint<Space>(random, 0.15);
      dof.direction = RandomPoint<Space>(random, 1).normalized();
      if constexpr (std::is_same_v<Space, Plane>) {
        dof.inertia_kg_m2 = Uniform(random, 0.001, 0.01);
      } else {
        dof.inertia_kg_m2 = RandomInertia(random);
        dof.axis = RandomDirection(random);
      }
    }
    tree.dofs.push_back(dof);
    return static_cast<int>(tree.dofs.size()) - 1;
  };
  int last = -1;
  for (int i = 0; i < kDimensionOf<Space>; ++i) {
    last = add(last, JointKind::kPrismatic, true);
    tree.dofs.back().direction = Space::Vector::Unit(i);
  }
  for (int i = 0; i < turns; ++i) {
    last = add(last, JointKind::kRevolute, i + 1 < turns);
    if constexpr (std::is_same_v<Space, Spatial>)
      tree.dofs.back().axis = SpaceVector::Unit((i + 2) % 3);
  }
  const int arm = add(last, JointKind::kRevolute, false);
  const int hand = add(arm, JointKind::kPrismatic, false);
  tree.dofs[static_cast<std::size_t>(arm)].prescribed = true;
  tree.dofs[static_cast<std::size_t>(hand)].prescribed = true;
  add(last, JointKind::kRevolute, false);
  return tree;
}
template <class Space>
constexpr int kBase = kDimensionOf<Space> == 2 ? 2 : 5;

/// A state with one contact at a depth within the layer.
template <class Space>
struct Scene {
  // NOLINTBEGIN(performance-unnecessary-value-param): all are moved
  Scene(std::mt19937_64& random, std::vector<ContactShape<Space>> shapes,
        std::vector<Obstacle<Space>> obstacles, std::vector<ContactPair> own)
      // NOLINTEND(performance-unnecessary-value-param)
      : tree(TwoArms<Space>(random)),
        dynamics(tree),
        contact({}, std::move(shapes), std::move(obstacles), std::move(own)),
        state(RandomState(random, tree.dofs.size(), 0.02)) {
    for (double& q : state.q) q = Uniform(random, -1, 1);
  }

  std::vector<double> Outputs(DynamicsState s) {
    dynamics.SetState(s.q, s.qd);
    contact.Apply(dynamics);
    dynamics.Solve(s.qdd, s.tau);
    for (int j = 0; j < dynamics.size(); ++j) {
      const auto i = static_cast<std::size_t>(j);
      if (!dynamics.prescribed(j)) s.tau[i] = s.qdd[i];
    }
    return s.tau;
  }
  /// Near points of shape 0 with the shape that it can touch.
  NearPoints<Space> Near(const DynamicsState& s) {
    dynamics.SetState(s.q, s.qd);
    const auto posed = [&](const ContactShape<Space>& own) {
      return PosedShape<Space>::Of(own.shape, dynamics.rotation(own.body),
                                   dynamics.origin() + dynamics.position(own.body));
    };
    const auto& shapes = contact.shapes();
    if (shapes.size() > 1) return FindNearPoints(posed(shapes[0]), posed(shapes[1]));
    return FindNearPoints(posed(shapes[0]), PosedShape<Space>::Of(contact.obstacles()[0].shape, {},
                                                                  Space::Vector::Zero()));
  }

  Tree<Space> tree;
  HybridDynamics<Space> dynamics;
  ContactModel<Space> contact;
  DynamicsState state;
};

/// Two shapes that touch, of kinds a and b: b is an obstacle (-1) or on that body.
struct Touch {
  ShapeKind a, b;
  int body = -1;
};

template <class Space>
std::vector<Touch> AllTouches() {
  std::vector<Touch> all;
  for (const ShapeKind a : {ShapeKind::kSphere, ShapeKind::kCapsule, ShapeKind::kBox}) {
    for (const ShapeKind b :
         {ShapeKind::kHalfSpace, ShapeKind::kSphere, ShapeKind::kCapsule, ShapeKind::kBox}) {
      all.push_back({a, b});
      if (b == ShapeKind::kHalfSpace) continue;
      all.push_back({a, b, kBase<Space>});      // carries the hand
      all.push_back({a, b, kBase<Space> + 3});  // the other arm
    }
  }
  return all;
}

std::string NameOf(const Touch& touch) {
  const char* const names[] = {"half-space", "sphere", "capsule", "box"};
  return std::string(names[static_cast<int>(touch.a)]) + " on " + names[static_cast<int>(touch.b)] +
         (touch.body < 0 ? "" : " of body " + std::to_string(touch.body));
}

/// Makes the hand touch at a depth in the layer: the thing that it touches, or the base, is moved
/// along the normal until it does.
template <class Space>
Scene<Space> RandomScene(std::mt19937_64& random, const Touch& touch) {
  using Vector = typename Space::Vector;
  for (;;) {
    std::vector<ContactShape<Space>> shapes = {
        {"hand/0", kBase<Space> + 2, RandomShape<Space>(random, touch.a, true)}};
    std::vector<Obstacle<Space>> obstacles;
    std::vector<ContactPair> own;
    if (touch.body < 0) {
      obstacles = {{"rock", RandomShape<Space>(random, touch.b)}};
    } else {
      shapes.push_back({"other/0", touch.body, RandomShape<Space>(random, touch.b)});
      own = {{0, 1}};
    }
    const std::mt19937_64 before = random;
    Scene<Space> scene(random, shapes, obstacles, own);
    const auto near = scene.Near(scene.state);
    if (near.overlap || near.core_distance_m < 0.001) continue;
    const double depth = Uniform(random, 0.0003, 0.003);
    const Vector move = (near.d - (scene.contact.law().d_on_m - depth)) * near.u_d;
    if (touch.body < 0) {
      for (int i = 0; i < kDimensionOf<Space>; ++i)
        scene.state.q[static_cast<std::size_t>(i)] -= move[i];
    } else {
      shapes[1].shape.centre += scene.dynamics.rotation(touch.body).Inverse(move);
      std::mt19937_64 again = before;
      const DynamicsState state = scene.state;
      Scene<Space> moved(again, shapes, obstacles, own);
      moved.state = state;
      if (moved.Near(moved.state).core_distance_m < 1e-4) continue;
      return moved;
    }
    if (touch.b != ShapeKind::kHalfSpace && scene.Near(scene.state).core_distance_m < 1e-4)
      continue;
    return scene;
  }
}

template <class Space>
class ContactPairsIn : public ::testing::Test {};
TYPED_TEST_SUITE(ContactPairsIn, Spaces, NameOfSpace);

TYPED_TEST(ContactPairsIn, HaveExactDerivativesThroughDynamics) {
  using Space = TypeParam;
  std::mt19937_64 random(91);
  for (const Touch& touch : AllTouches<Space>()) {
    int compared = 0, at_a_switch = 0, sliding = 0;
    for (int trial = 0; trial < 400 && compared < 40; ++trial) {
      Scene<Space> scene = RandomScene<Space>(random, touch);
      if (trial % 2 == 0) {
        for (double& v : scene.state.qd) v *= 10;  // beyond the slip speed
      }
      const DynamicsState s = scene.state;
      scene.Outputs(s);
      ASSERT_FALSE(scene.contact.active().empty()) << NameOf(touch);
      const auto& active = scene.contact.active()[0];
      const double slip = (active.force - active.force.dot(active.normal) * active.normal).norm();
      if (slip > 0.299 * std::abs(active.normal_force_n)) ++sliding;
      DynamicsDerivatives<Space> d;
      scene.contact.Differentiate(scene.dynamics);
      scene.dynamics.Differentiate(d);
      const auto n = s.q.size();
      double worst = 0;
      bool smooth = true;
      for (std::size_t k = 0; k < n; ++k) {
        for (int kind = 0; kind < 2; ++kind) {
          const auto central = [&](double h) {
            DynamicsState p = s, m = s;
            (kind == 0 ? p.q : p.qd)[k] += h;
            (kind == 0 ? m.q : m.qd)[k] -= h;
            auto fp = scene.Outputs(p);
            const auto fm = scene.Outputs(m);
            for (std::size_t i = 0; i < n; ++i) fp[i] = (fp[i] - fm[i]) / (2 * h);
            return fp;
          };
          const auto wide = central(1e-6), narrow = central(5e-7);
          for (std::size_t i = 0; i < n; ++i) {
            const double reference = (4 * narrow[i] - wide[i]) / 3;
            const double scale = 1e4 + std::abs(reference);
            smooth = smooth && std::abs(wide[i] - narrow[i]) < 2e-7 * scale;
            worst = std::max(worst, std::abs((kind == 0 ? d.q : d.qd)[i][k] - reference) / scale);
          }
        }
      }
      if (!smooth) {
        ++at_a_switch;
        continue;
      }
      ++compared;
      ASSERT_LT(worst, 1e-7) << NameOf(touch) << ", trial " << trial;
    }
    EXPECT_EQ(compared, 40) << NameOf(touch);
    EXPECT_LT(at_a_switch, 40) << NameOf(touch);
    EXPECT_GT(sliding, 5) << NameOf(touch);
  }
}

TYPED_TEST(ContactPairsIn, SlideUnderLoadWithTheSlopesOfTheDifferences) {
  using Space = TypeParam;
  std::mt19937_64 random(95);
  for (const Touch& touch : AllTouches<Space>()) {
    int compared = 0, at_a_switch = 0, sliding = 0;
    for (int trial = 0; trial < 200 && compared < 15; ++trial) {
      Scene<Space> scene = RandomScene<Space>(random, touch);
      if (trial % 2 == 0) {
        for (double& v : scene.state.qd) v *= 10;  // beyond the slip speed
      }
      const auto slip_at = [&scene](const DynamicsState& s) {
        scene.dynamics.SetState(s.q, s.qd);
        scene.contact.Apply(scene.dynamics);
        return scene.contact.LoadedSlip();
      };
      const DynamicsState s = scene.state;
      const auto n = s.q.size();
      // Friction turns mu times as much into heat.
      double heat = 0;
      scene.Outputs(s);
      for (const auto& active : scene.contact.active()) {
        const auto v_of = [&](int shape) {
          const int body = scene.contact.shapes()[static_cast<std::size_t>(shape)].body;
          return scene.dynamics.velocity(body).At(active.point);
        };
        typename Space::Vector v = v_of(active.shape);
        if (active.other_shape >= 0) v -= v_of(active.other_shape);
        const typename Space::Vector v_t = v - v.dot(active.normal) * active.normal;
        heat -= v_t.dot(active.force);
        if (v_t.norm() > scene.contact.law().v_max_m_per_s && active.normal_force_n > 0) ++sliding;
      }
      const double here = slip_at(s);
      EXPECT_NEAR(scene.contact.law().mu * here, heat, 1e-9 * (1 + heat)) << NameOf(touch);
      std::vector<double> by_q(n), by_qd(n);
      scene.contact.AddLoadedSlipSlopes(scene.dynamics, 1, by_q, by_qd);
      double worst = 0;
      bool smooth = true;
      for (std::size_t k = 0; k < n; ++k) {
        for (const bool of_rate : {false, true}) {
          const auto central = [&](double h) {
            DynamicsState p = s, m = s;
            (of_rate ? p.qd : p.q)[k] += h;
            (of_rate ? m.qd : m.q)[k] -= h;
            return (slip_at(p) - slip_at(m)) / (2 * h);
          };
          const double wide = central(1e-6), narrow = central(5e-7);
          const double reference = (4 * narrow - wide) / 3;
          const double scale = 1e3 + std::abs(reference);
          smooth = smooth && std::abs(wide - narrow) < 2e-7 * scale;
          worst = std::max(worst, std::abs((of_rate ? by_qd : by_q)[k] - reference) / scale);
        }
      }
      if (!smooth) {
        ++at_a_switch;
        continue;
      }
      ++compared;
      ASSERT_LT(worst, 1e-7) << NameOf(touch) << ", trial " << trial;
    }
    EXPECT_EQ(compared, 15) << NameOf(touch);
    EXPECT_LT(at_a_switch, 40) << NameOf(touch);
    EXPECT_GT(sliding, 2) << NameOf(touch);
  }
}

TYPED_TEST(ContactPairsIn, AreActionAndReaction) {
  // Without outer forces the momentum of the whole robot does not change, whatever its parts touch.
  using Space = TypeParam;
  std::mt19937_64 random(92);
  for (const Touch& touch : AllTouches<Space>()) {
    if (touch.body < 0) continue;
    for (int trial = 0; trial < 20; ++trial) {
      Scene<Space> scene = RandomScene<Space>(random, touch);
      for (auto& dof : scene.tree.dofs) dof.prescribed = false;
      HybridDynamics<Space> free(scene.tree);
      DynamicsState s = scene.state;
      std::fill(s.tau.begin(), s.tau.end(), 0.0);
      free.SetState(s.q, s.qd);
      scene.contact.Apply(free);
      ASSERT_EQ(scene.contact.active().size(), 1U);
      EXPECT_EQ(scene.contact.active()[0].obstacle, -1);
      EXPECT_EQ(scene.contact.active()[0].other_shape, 1);
      free.Solve(s.qdd, s.tau);
      const double h = 1e-6;
      const auto momentum = [&](double t) {
        DynamicsState at = s;
        for (std::size_t i = 0; i < at.q.size(); ++i) {
          at.q[i] += t * s.qd[i] + t * t / 2 * s.qdd[i];
          at.qd[i] += t * s.qdd[i];
        }
        free.SetState(at.q, at.qd);
        return free.Momentum();
      };
      const auto change = (momentum(h) - momentum(-h)) * (1 / (2 * h));
      EXPECT_LT(change.f.norm(), 1e-5 * (1 + scene.contact.active()[0].force.norm()));
      if constexpr (std::is_same_v<Space, Plane>) {
        EXPECT_NEAR(change.n, 0, 1e-5 * (1 + scene.contact.active()[0].force.norm()));
      } else {
        EXPECT_LT(change.n.norm(), 1e-5 * (1 + scene.contact.active()[0].force.norm()));
      }
    }
  }
}

TYPED_TEST(ContactPairsIn, NeverGiveMorePowerThanTheirSpringsHaveStored) {
  // Passivity: with the elastic part N_0 of the normal force and the distance's rate, the power of
  // a contact is at most N_0 d', which is what a potential gives back.
  using Space = TypeParam;
  std::mt19937_64 random(93);
  for (const Touch& touch : AllTouches<Space>()) {
    for (int trial = 0; trial < 40; ++trial) {
      Scene<Space> scene = RandomScene<Space>(random, touch);
      const double pace = trial % 3 == 0 ? 30 : 3;
      for (double& v : scene.state.qd) v *= pace;
      for (auto& dof : scene.tree.dofs) dof.prescribed = true;
      HybridDynamics<Space> inverse(scene.tree);
      DynamicsState s = scene.state;
      std::vector<double> without(s.tau.size());
      inverse.SetState(s.q, s.qd);
      inverse.Solve(s.qdd, without);
      inverse.SetState(s.q, s.qd);
      scene.contact.Apply(inverse);
      inverse.Solve(s.qdd, s.tau);
      double power = 0;
      for (std::size_t i = 0; i < s.tau.size(); ++i) power += (without[i] - s.tau[i]) * s.qd[i];
      double bound = 0;
      if (touch.b == ShapeKind::kHalfSpace) {
        // Several contacts; the rate of each distance is that of its point along the normal.
        for (const auto& a : scene.contact.active()) {
          const double rate =
              inverse.velocity(scene.contact.shapes()[0].body).At(a.point).dot(a.normal);
          const double d = scene.contact.law().d_on_m - a.depth_m;
          bound += EvaluateNormalForce(scene.contact.law(), d, 0).N * rate;
        }
      } else {
        const double h = 1e-7;
        const auto distance = [&](double t) {
          DynamicsState at = s;
          for (std::size_t i = 0; i < at.q.size(); ++i) at.q[i] += t * s.qd[i];
          return scene.Near(at).d;
        };
        bound = EvaluateNormalForce(scene.contact.law(), distance(0), 0).N *
                (distance(h) - distance(-h)) / (2 * h);
      }
      EXPECT_LE(power, bound + 1e-5 * (1 + std::abs(bound))) << NameOf(touch);
    }
  }
}

TYPED_TEST(ContactPairsIn, AgreeInClosedFormAndByTheGeneralMethod) {
  using Space = TypeParam;
  std::mt19937_64 random(94);
  for (const ShapeKind kind :
       {ShapeKind::kHalfSpace, ShapeKind::kSphere, ShapeKind::kCapsule, ShapeKind::kBox}) {
    for (int trial = 0; trial < 500; ++trial) {
      const auto shape = RandomShape<Space>(random, kind, trial % 2 == 0);
      const auto centre = RandomPoint<Space>(random, 0.4);
      const double radius = Uniform(random, 0, 0.1);
      const auto near = FindNearPoint<Space>(shape, centre, radius);
      const auto a =
          PosedShape<Space>::Of(Shape<Space>::Sphere(centre, radius), {}, Space::Vector::Zero());
      const auto b = PosedShape<Space>::Of(shape, {}, Space::Vector::Zero());
      const auto general = FindNearPoints(a, b);
      if (general.overlap) {
        EXPECT_LE(near.d, general.d + 1e-15) << "inside the core";
        EXPECT_NEAR(near.u_d.norm(), 1, 1e-14);
        continue;
      }
      EXPECT_NEAR(near.d, general.d, 1e-14);
      EXPECT_LT((near.u_d - general.u_d).norm(), 1e-12);
      const auto derivative = DifferentiateNearPoints(a, b, general);
      for (std::size_t m = 0; m < Space::kMotions; ++m) {
        const typename Space::Vector dc = Space::BasisMotion(m).At(centre);
        typename Space::Vector du = dc - near.u_d.dot(dc) * near.u_d;
        if constexpr (kDimensionOf < Space >> 2) du -= near.edge.dot(dc) * near.edge;
        du *= near.curvature_per_m;
        EXPECT_LT((du - derivative.u_d[m]).norm(), 1e-9 * (1 + near.curvature_per_m));
        EXPECT_NEAR(near.u_d.dot(dc), derivative.d[m], 1e-12);
      }
    }
  }
}

TYPED_TEST(ContactPairsIn, AllocateNothing) {
  using Space = TypeParam;
  std::mt19937_64 random(95);
  for (const Touch& touch : AllTouches<Space>()) {
    Scene<Space> scene = RandomScene<Space>(random, touch);
    DynamicsDerivatives<Space> derivatives;
    const testing::AllocationGuard guard;
    scene.dynamics.SetState(scene.state.q, scene.state.qd);
    scene.contact.Apply(scene.dynamics);
    scene.dynamics.Solve(scene.state.qdd, scene.state.tau);
    scene.contact.Differentiate(scene.dynamics);
    scene.dynamics.Differentiate(derivatives);
  }
}

TYPED_TEST(ContactPairsIn, SlideUnderNoLoadWhileTheyPartFast) {
  using Space = TypeParam;
  constexpr int kUp = kDimensionOf<Space> - 1;
  const Tree<Space> tree = Particle<Space>(9.81);
  const ContactLaw law;
  ContactModel<Space> contact(
      law, {{"ball/0", kUp, Shape<Space>::Sphere(Space::Vector::Zero(), 0.03)}},
      {{"ground", Shape<Space>::HalfSpace(Space::Vector::Zero(), Space::Vector::Unit(kUp))}});
  HybridDynamics<Space> dynamics(tree);
  std::vector<double> q(tree.dofs.size()), qd(q.size()), by_q(q.size()), by_qd(q.size());
  q.back() = 0.031;
  qd.front() = 1;
  qd.back() = 10;
  dynamics.SetState(q, qd);
  contact.Apply(dynamics);
  ASSERT_EQ(contact.active().size(), 1U);
  EXPECT_EQ(contact.LoadedSlip(), 0);
  contact.AddLoadedSlipSlopes(dynamics, 1, by_q, by_qd);
  for (std::size_t i = 0; i < q.size(); ++i) EXPECT_EQ(std::abs(by_q[i]) + std::abs(by_qd[i]), 0);
}

TYPED_TEST(ContactPairsIn, ForceAndItsDerivativesAreContinuousAcrossEverySwitchOfTheLaw) {
  using Space = TypeParam;
  constexpr int kUp = kDimensionOf<Space> - 1;
  const auto up = static_cast<std::size_t>(kUp);
  const Tree<Space> tree = Particle<Space>(9.81);
  for (const bool round : {false, true}) {
    const auto below =
        round ? Shape<Space>::Sphere(-0.2 * Space::Vector::Unit(kUp), 0.2)
              : Shape<Space>::HalfSpace(Space::Vector::Zero(), Space::Vector::Unit(kUp));
    const ContactLaw law;
    ContactModel<Space> contact(
        law, {{"ball/0", kUp, Shape<Space>::Sphere(Space::Vector::Zero(), 0.03)}},
        {{"ground", below}});
    HybridDynamics<Space> dynamics(tree);
    const auto n = tree.dofs.size();
    // The output and all its derivatives at distance d, tangential speed v_t, normal speed v_d.
    const auto all = [&](double d, double v_t, double v_d) {
      std::vector<double> q(n), qd(n), qdd(n), tau(n);
      q[up] = 0.03 + d;
      qd[0] = v_t;
      qd[up] = v_d;
      dynamics.SetState(q, qd);
      contact.Apply(dynamics);
      dynamics.Solve(qdd, tau);
      contact.Differentiate(dynamics);
      DynamicsDerivatives<Space> derivatives;
      dynamics.Differentiate(derivatives);
      std::vector<double> out = qdd;
      for (std::size_t i = 0; i < n; ++i) {
        out.insert(out.end(), derivatives.q[i].begin(), derivatives.q[i].begin() + kUp + 1);
        out.insert(out.end(), derivatives.qd[i].begin(), derivatives.qd[i].begin() + kUp + 1);
      }
      return out;
    };
    // Second derivatives are bounded by about this, so that nothing changes by more in a step of
    // 1e-9 on either side.
    const double allowed = 1e8 * 2e-9;
    const auto same = [&](double d, double v_t, double v_d, int which) {
      const double e = 1e-9;
      const auto minus =
          all(d - (which == 0 ? e : 0), v_t - (which == 1 ? e : 0), v_d - (which == 2 ? e : 0));
      const auto plus =
          all(d + (which == 0 ? e : 0), v_t + (which == 1 ? e : 0), v_d + (which == 2 ? e : 0));
      for (std::size_t i = 0; i < minus.size(); ++i) {
        EXPECT_NEAR(minus[i], plus[i], allowed) << "d " << d << ", v_t " << v_t << ", v_d " << v_d;
      }
    };
    for (const double v_t : {0.0, 0.02, 0.3}) {
      for (const double v_d : {-0.2, 0.0, 0.01}) {
        same(law.d_on_m, v_t, v_d, 0);
        same(law.d_off_m, v_t, v_d, 0);
      }
    }
    for (const double d : {0.0005, 0.0035}) {
      for (const double v_d : {-0.2, 0.0, 0.01}) {
        same(d, law.v_max_m_per_s, v_d, 1);
        same(d, -law.v_max_m_per_s, v_d, 1);
        same(d, 0, v_d, 1);
      }
      for (const double v_t : {0.0, 0.02, 0.3}) {
        const double lift_off = law.stiffness_n_per_m * (law.d_on_m - d) / law.damping_n_s_per_m;
        same(d, v_t, 0, 2);
        same(d, v_t, lift_off, 2);
      }
    }
  }
}

/// A law that is the linear spring and damper: its smoothing at the edge is too thin to matter.
ContactLaw LinearLaw(double stiffness, double damping, double layer) {
  ContactLaw law;
  law.stiffness_n_per_m = stiffness;
  law.damping_n_s_per_m = damping;
  law.d_on_m = layer;
  law.d_off_m = layer * (1 - 1e-5);
  return law;
}

TYPED_TEST(ContactPairsIn, ABallOnALinearLayerFollowsTheDampedOscillatorUntilItLiftsOff) {
  using Space = TypeParam;
  constexpr int kUp = kDimensionOf<Space> - 1;
  const double k = 1e4, c = 40, g = 9.81, speed = 0.8, layer = 0.02, radius = 0.03;
  const Tree<Space> tree = Particle<Space>(g);  // 1 kg
  ContactModel<Space> contact(
      LinearLaw(k, c, layer),
      {{"ball/0", kUp, Shape<Space>::Sphere(Space::Vector::Zero(), radius)}},
      {{"ground", Shape<Space>::HalfSpace(Space::Vector::Zero(), Space::Vector::Unit(kUp))}});
  ContactSimulation<Space> simulation(tree, contact);
  // Depth x: x'' = g - c x' - k x, x(0) = 0, x'(0) = speed.
  const double decay = c / 2, w = std::sqrt(k - decay * decay), rest = g / k;
  const double b = (speed - decay * rest) / w;
  const auto depth = [&](double t) {
    return rest + std::exp(-decay * t) * (-rest * std::cos(w * t) + b * std::sin(w * t));
  };
  const auto rate = [&](double t) {
    return std::exp(-decay * t) *
           ((decay * rest + w * b) * std::cos(w * t) + (w * rest - decay * b) * std::sin(w * t));
  };
  double lift_off = 0.02;  // where k x + c x' = 0, by bisection
  for (double low = 0.02, high = 0.04; high - low > 1e-14;) {
    lift_off = (low + high) / 2;
    (k * depth(lift_off) + c * rate(lift_off) > 0 ? low : high) = lift_off;
  }
  std::vector<double> y(2 * tree.dofs.size());
  y[kUp] = radius + layer;
  y[tree.dofs.size() + kUp] = -speed;
  const double h = 5e-6;
  double t = 0;
  while (t < lift_off - h) {
    simulation.Step(y, h);
    t += h;
    ASSERT_NEAR(radius + layer - y[kUp], depth(t), 2e-6) << t;
    ASSERT_NEAR(-y[tree.dofs.size() + kUp], rate(t), 3e-4) << t;
  }
  // From there on the flight is ballistic, although still within the layer.
  const double x_1 = depth(lift_off), v_1 = rate(lift_off);
  EXPECT_GT(x_1, 1e-4);
  while (y[kUp] < radius + layer) simulation.Step(y, h);
  EXPECT_NEAR(y[tree.dofs.size() + kUp], std::sqrt(v_1 * v_1 - 2 * g * x_1), 3e-4);
}

TEST(ContactPairs, ABoxSlidingToRestStopsWhereCoulombSaysAndAKnownBitBeyond) {
  // While faster than v_max the box is slowed down by mu g: v^2 / (2 mu g) to a stop. Below v_max
  // friction is mu N (1.5 s - 0.5 s^3), s = v / v_max, and from there to rest it takes
  //   integral v dv / (mu g (1.5 s - 0.5 s^3)) = v_max^2 / (mu g) 2 / sqrt 3 artanh(1 / sqrt 3)
  // instead of v_max^2 / (2 mu g).
  const double mu = 0.3, g = 9.81, v = 1;
  ContactLaw law;
  law.mu = mu;
  law.v_max_m_per_s = 0.1;
  Tree<Plane> tree;
  tree.gravity = {0, -g};
  for (int i = 0; i < 3; ++i) {
    Dof<Plane> dof;
    dof.parent = i - 1;
    dof.kind = i < 2 ? JointKind::kPrismatic : JointKind::kRevolute;
    if (i < 2) dof.direction[i] = 1;
    dof.massless = i < 2;
    if (i == 2) dof.mass_kg = 1, dof.inertia_kg_m2 = (0.2 * 0.2 + 0.02 * 0.02) / 12;
    tree.dofs.push_back(dof);
  }
  ContactModel<Plane> contact(law, {{"box/0", 2, Shape<Plane>::Box({0, 0}, {}, {0.1, 0.01})}},
                              {{"ground", Shape<Plane>::HalfSpace({0, 0}, {0, 1})}});
  ContactSimulation<Plane> simulation(tree, contact);
  const double sink = g / (2 * law.stiffness_n_per_m);  // Two vertices carry it.
  std::vector<double> y = {0, 0.01 + law.d_on_m - sink, 0, 0, 0, 0};
  for (int step = 0; step < 20000; ++step) simulation.Step(y, 1e-4);  // to rest, smoothing and all
  y[0] = 0;
  y[3] = v;
  double energy = 1e9;
  for (int step = 0; step < 30000; ++step) {
    simulation.Step(y, 1e-4);
    const double kinetic = y[3] * y[3] / 2;
    EXPECT_LE(kinetic, energy + 1e-12);
    energy = kinetic;
  }
  const double coulomb = v * v / (2 * mu * g);
  const double creep = law.v_max_m_per_s * law.v_max_m_per_s / (mu * g);
  const double beyond = creep * (2 / std::sqrt(3) * std::atanh(1 / std::sqrt(3)) - 0.5);
  EXPECT_NEAR(y[3], 0, 1e-6);
  EXPECT_NEAR(y[0], coulomb + beyond, 2e-4 * coulomb);
  EXPECT_GT(std::abs(beyond), 2e-3 * coulomb) << "the bit beyond is seen by this test";
}

TEST(ContactPairs, TwoBallsHeadOnExchangeTheirFinalStatesAndTheGradientsSaySo) {
  // Equal masses, no loss. After a contact of duration tau the balls have exchanged their
  // velocities, and their distance, r_0 at first, is 2 r_touch - r_0 + v (T - tau(v)), v = v_1 -
  // v_2. So, exactly but for the two entries with theta = d (v tau) / dv, which vanish with tau,
  //   d x_2 / d (x_1, x_2, v_1, v_2) = (1, 0, T - theta / 2, theta / 2)
  //   d v_2 / d (x_1, x_2, v_1, v_2) = (0, 0, 1, 0)
  // and ball 1 likewise with 1 and 2 exchanged: the rigid collision's (1, 0, T, 0), not a blend.
  const double m = 1, T = 1;
  Tree<Plane> tree;
  for (int i = 0; i < 2; ++i) {
    Dof<Plane> dof;
    dof.kind = JointKind::kPrismatic;
    dof.direction = {1, 0};
    dof.mass_kg = m;
    dof.inertia_kg_m2 = 0.01;
    tree.dofs.push_back(dof);
  }
  const auto ball = Shape<Plane>::Sphere({0, 0}, 0.05);
  ContactLaw law;
  law.stiffness_n_per_m = 1e5;
  law.damping_n_s_per_m = 0;
  law.d_on_m = 0.01;
  law.d_off_m = 0;
  law.smoothing = ContactSmoothing::kQuintic;
  ContactModel<Plane> contact(law, {{"one/0", 0, ball}, {"two/0", 1, ball}}, {}, {{0, 1}});
  ContactSimulation<Plane> simulation(tree, contact);
  const double h = 2e-5;
  const int steps = static_cast<int>(std::lround(T / h));
  double tau = 0;  // time in contact
  const auto run = [&](std::vector<double> y, Eigen::MatrixXd* sensitivity) {
    double energy = 0;
    const std::vector<double> y_0 = y;
    tau = 0;
    for (int step = 0; step < steps; ++step) {
      simulation.Step(y, h, sensitivity);
      energy = std::max(energy, simulation.dynamics().KineticEnergy());
      if (!contact.active().empty()) tau += h;
    }
    const double initial = 0.5 * m * (y_0[2] * y_0[2] + y_0[3] * y_0[3]);
    EXPECT_LE(energy, initial * (1 + 1e-10));
    return y;
  };
  const std::vector<double> start = {0, 0.5, 0.8, -0.2};  // x_1, x_2, v_1, v_2
  Eigen::MatrixXd S = Eigen::MatrixXd::Identity(4, 4);
  const auto end = run(start, &S);
  EXPECT_NEAR(end[2], start[3], 1e-9);
  EXPECT_NEAR(end[3], start[2], 1e-9);
  EXPECT_GT(tau, 0.005);
  EXPECT_LT(tau, 0.05);
  const double theta = 2 * S(0, 2);
  EXPECT_GT(theta, 0);
  EXPECT_LT(theta, tau) << "harder hits are shorter";
  Eigen::Matrix4d expected;
  expected << 0, 1, theta / 2, T - theta / 2,  // x_1
      1, 0, T - theta / 2, theta / 2,          // x_2
      0, 0, 0, 1,                              // v_1
      0, 0, 1, 0;                              // v_2
  EXPECT_LT((S - expected).cwiseAbs().maxCoeff(), 1e-8) << S;
  // The sensitivities are those of the very computation.
  for (Eigen::Index c = 0; c < 4; ++c) {
    auto plus = start, minus = start;
    const double e = 1e-5;
    plus[static_cast<std::size_t>(c)] += e;
    minus[static_cast<std::size_t>(c)] -= e;
    plus = run(plus, nullptr);
    minus = run(minus, nullptr);
    for (Eigen::Index r = 0; r < 4; ++r) {
      const auto i = static_cast<std::size_t>(r);
      EXPECT_NEAR(S(r, c), (plus[i] - minus[i]) / (2 * e), 1e-7);
    }
  }
}

}  // namespace
}  // namespace tumbler
