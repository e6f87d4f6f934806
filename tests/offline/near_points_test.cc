#include "offline/model/near_points.h"

#include <gtest/gtest.h>

#include <map>

#include "offline/model/least_squares.h"
#include "tests/support/allocation_guard.h"
#include "tests/support/random_shape.h"
#include "tests/support/to_eigen.h"

namespace tumbler {
namespace {

template <class Space>
struct Body {
  Shape<Space> shape;
  typename Space::Rotation R;
  typename Space::Vector p;
  [[nodiscard]] PosedShape<Space> Posed() const { return PosedShape<Space>::Of(shape, R, p); }
  /// Displaced by the motion S, by the amount t.
  [[nodiscard]] Body Displaced(const typename Space::Motion& S, double t) const {
    Body out = *this;
    typename Space::Rotation turn;
    if constexpr (std::is_same_v<Space, Plane>) {
      turn = Plane::RotationBy(1, S.w * t);
    } else {
      if (S.w.norm() > 0) turn = Spatial::RotationBy(S.w.normalized(), S.w.norm() * t);
    }
    out.R = turn * R;
    out.p = turn * p + S.v * t;
    return out;
  }
};

template <class Space>
struct Pair {
  Body<Space> a, b;
  [[nodiscard]] NearPoints<Space> Near() const { return FindNearPoints(a.Posed(), b.Posed()); }
};

struct Kinds {
  ShapeKind a, b;
  bool rounded = false;
};

std::string NameOf(const Kinds& kinds) {
  const char* const names[] = {"half-space", "sphere", "capsule", "box"};
  return std::string(names[static_cast<int>(kinds.a)]) + " and " +
         names[static_cast<int>(kinds.b)] + (kinds.rounded ? ", rounded" : "");
}

/// All pairs of the contact model: every shape of a robot with every kind of obstacle.
std::vector<Kinds> AllPairs() {
  std::vector<Kinds> pairs;
  for (const ShapeKind a : {ShapeKind::kSphere, ShapeKind::kCapsule, ShapeKind::kBox}) {
    for (const ShapeKind b :
         {ShapeKind::kHalfSpace, ShapeKind::kSphere, ShapeKind::kCapsule, ShapeKind::kBox}) {
      pairs.push_back({a, b});
    }
  }
  pairs.push_back({ShapeKind::kBox, ShapeKind::kBox, true});
  return pairs;
}

template <class Space>
Pair<Space> RandomPair(std::mt19937_64& random, const Kinds& kinds, double apart = 0.35) {
  return {{RandomShape<Space>(random, kinds.a, kinds.rounded), RandomRotation<Space>(random),
           RandomPoint<Space>(random, apart)},
          {RandomShape<Space>(random, kinds.b), RandomRotation<Space>(random),
           RandomPoint<Space>(random, apart)}};
}

/// The vertices of a core.
template <class Space>
std::vector<typename Space::Vector> Vertices(const PosedShape<Space>& shape) {
  std::vector<typename Space::Vector> vertices = {shape.centre};
  for (int i = 0; i < PosedShape<Space>::kDimension; ++i) {
    if (shape.half_extents[i] == 0) continue;
    const auto before = vertices;
    vertices.clear();
    for (const auto& v : before) {
      vertices.push_back(v + shape.half_extents[i] * shape.axis(i));
      vertices.push_back(v - shape.half_extents[i] * shape.axis(i));
    }
  }
  return vertices;
}

template <class Space>
class NearPointsIn : public ::testing::Test {};
TYPED_TEST_SUITE(NearPointsIn, Spaces, NameOfSpace);

TYPED_TEST(NearPointsIn, ShapesAreNamedByTheirCore) {
  std::mt19937_64 random(70);
  for (const ShapeKind kind :
       {ShapeKind::kHalfSpace, ShapeKind::kSphere, ShapeKind::kCapsule, ShapeKind::kBox}) {
    EXPECT_EQ(RandomShape<TypeParam>(random, kind).kind(), kind);
  }
}

/// The optimum of a convex problem has a certificate: the planes through x_a and x_b across the
/// normal have all of a on one side and all of b on the other.
TYPED_TEST(NearPointsIn, ArePartedByPlanesThroughThemSoThatNoOtherPointsAreNearer) {
  std::mt19937_64 random(71);
  for (const Kinds& kinds : AllPairs()) {
    int apart = 0;
    for (int trial = 0; trial < 1000; ++trial) {
      const auto pair = RandomPair<TypeParam>(random, kinds);
      const auto a = pair.a.Posed(), b = pair.b.Posed();
      const auto near = pair.Near();
      if (near.overlap) continue;
      ++apart;
      ASSERT_NEAR(near.u_d.norm(), 1, 1e-14);
      EXPECT_LT((near.p_a - near.p_b - near.d * near.u_d).norm(), 1e-14);
      const typename TypeParam::Vector x_a = near.p_a + a.radius_m * near.u_d;
      for (const auto& v : Vertices(a)) EXPECT_GT((v - x_a).dot(near.u_d), -1e-13) << NameOf(kinds);
      for (int i = 0; i < a.kDimension; ++i)
        EXPECT_LE(std::abs(a.axis(i).dot(x_a - a.centre)), a.half_extents[i] + 1e-14);
      if (b.half_space) {
        EXPECT_NEAR((near.p_b - b.centre).dot(b.normal), 0, 1e-14);
        EXPECT_LT((near.u_d - b.normal).norm(), 1e-15);
        continue;
      }
      const typename TypeParam::Vector x_b = near.p_b - b.radius_m * near.u_d;
      for (const auto& v : Vertices(b)) EXPECT_LT((v - x_b).dot(near.u_d), 1e-13) << NameOf(kinds);
      for (int i = 0; i < b.kDimension; ++i)
        EXPECT_LE(std::abs(b.axis(i).dot(x_b - b.centre)), b.half_extents[i] + 1e-14);
    }
    EXPECT_GT(apart, 500) << NameOf(kinds);
  }
}

/// Near points by brute force: tries every active set with a general least squares solver, and
/// takes the nearest feasible pair.
template <class Space>
auto NearestByTryingAll(const PosedShape<Space>& a, const PosedShape<Space>& b) {
  constexpr int kDimension = PosedShape<Space>::kDimension;
  constexpr int n = 2 * kDimension;
  using Vector = Eigen::Matrix<double, kDimension, 1>;
  const Vector centre_a = ToEigen(a.centre), centre_b = ToEigen(b.centre);
  Eigen::Matrix<double, kDimension, n> M;
  M << AxesOf(a), -AxesOf(b);
  Eigen::Matrix<double, n, 1> h;
  h << ToEigen(a.half_extents), ToEigen(b.half_extents);
  int sets = 1;
  for (int i = 0; i < n; ++i) sets *= 3;
  double least = std::numeric_limits<double>::infinity();
  Eigen::Matrix<double, n, 1> best;
  for (int set = 0; set < sets; ++set) {
    Eigen::Matrix<double, n, 1> y;
    std::vector<int> free;
    bool needed = true;
    for (int i = 0, code = set; i < n; ++i, code /= 3) {
      const int at = code % 3 - 1;
      needed = needed && (h[i] > 0 || at == 1);
      y[i] = at * h[i];
      if (at == 0) free.push_back(i);
    }
    if (!needed || free.size() > kDimension) continue;
    Eigen::MatrixXd F(kDimension, static_cast<Eigen::Index>(free.size()));
    for (std::size_t k = 0; k < free.size(); ++k)
      F.col(static_cast<Eigen::Index>(k)) = M.col(free[k]);
    if (!free.empty()) {
      const Eigen::VectorXd rest = -(centre_a - centre_b + M * y);
      const Eigen::VectorXd z = SolveLeastSquares(F, rest);
      for (std::size_t k = 0; k < free.size(); ++k) y[free[k]] = z[static_cast<Eigen::Index>(k)];
    }
    if ((y.cwiseAbs().array() > h.array() + 1e-13).any()) continue;
    const double distance = (centre_a - centre_b + M * y).norm();
    if (distance < least) least = distance, best = y;
  }
  return std::pair<Vector, Vector>(centre_a + AxesOf(a) * best.template head<kDimension>(),
                                   centre_b + AxesOf(b) * best.template tail<kDimension>());
}

TYPED_TEST(NearPointsIn, AreThoseFoundByTryingEveryActiveSet) {
  std::mt19937_64 random(72);
  for (const Kinds& kinds : AllPairs()) {
    if (kinds.b == ShapeKind::kHalfSpace) continue;
    int apart = 0;
    for (int trial = 0; trial < 60; ++trial) {
      const auto pair = RandomPair<TypeParam>(random, kinds);
      const auto a = pair.a.Posed(), b = pair.b.Posed();
      const auto near = pair.Near();
      const auto [x_a, x_b] = NearestByTryingAll(a, b);
      EXPECT_NEAR(near.core_distance_m, (x_a - x_b).norm(), 1e-12) << NameOf(kinds);
      if (near.overlap) continue;
      ++apart;
      EXPECT_LT((ToEigen(near.p_a + a.radius_m * near.u_d) - x_a).norm(), 1e-9) << NameOf(kinds);
      EXPECT_LT((ToEigen(near.p_b - b.radius_m * near.u_d) - x_b).norm(), 1e-9) << NameOf(kinds);
    }
    EXPECT_GT(apart, 30) << NameOf(kinds);
  }
}

TYPED_TEST(NearPointsIn, DoNotDependOnTheOrderOfTheShapes) {
  std::mt19937_64 random(73);
  for (const Kinds& kinds : AllPairs()) {
    for (int trial = 0; trial < 300; ++trial) {
      const auto pair = RandomPair<TypeParam>(random, kinds);
      const auto near = pair.Near();
      const auto swapped = Pair<TypeParam>{pair.b, pair.a}.Near();
      EXPECT_EQ(near.overlap, swapped.overlap);
      EXPECT_NEAR(near.d, swapped.d, 1e-14) << NameOf(kinds);
      if (near.overlap) continue;
      EXPECT_LT((near.u_d + swapped.u_d).norm(), 1e-12) << NameOf(kinds);
      EXPECT_LT((near.p_a - swapped.p_b).norm() + (near.p_b - swapped.p_a).norm(), 1e-11);
      EXPECT_EQ(near.active_a, swapped.active_b);
      EXPECT_EQ(near.active_b, swapped.active_a);
    }
  }
}

TYPED_TEST(NearPointsIn, MoveWithTheShapesWhenBothMoveAsOne) {
  std::mt19937_64 random(74);
  for (const Kinds& kinds : AllPairs()) {
    for (int trial = 0; trial < 300; ++trial) {
      const auto pair = RandomPair<TypeParam>(random, kinds);
      const auto R = RandomRotation<TypeParam>(random);
      const auto p = RandomPoint<TypeParam>(random, 1);
      auto moved = pair;
      for (auto* body : {&moved.a, &moved.b}) {
        body->p = p + R * body->p;
        body->R = R * body->R;
      }
      const auto near = pair.Near(), far = moved.Near();
      EXPECT_NEAR(near.d, far.d, 1e-13);
      if (near.overlap) continue;
      EXPECT_LT((R * near.u_d - far.u_d).norm(), 1e-11) << NameOf(kinds);
      EXPECT_LT((p + R * near.p_a - far.p_a).norm(), 1e-11) << NameOf(kinds);
      EXPECT_LT((p + R * near.p_b - far.p_b).norm(), 1e-11) << NameOf(kinds);
    }
  }
}

TYPED_TEST(NearPointsIn, HaveTheDerivativesOfTheKuhnTuckerSystem) {
  using Space = TypeParam;
  using Vector = typename Space::Vector;
  std::mt19937_64 random(75);
  // How many near points lay inside edges and faces of both cores: [pair][free of a, free of b].
  std::map<std::string, std::map<std::pair<long, long>, int>> met;
  for (const Kinds& kinds : AllPairs()) {
    int compared = 0, at_a_switch = 0;
    while (compared < 1000) {
      const auto pair = RandomPair<Space>(random, kinds);
      const auto near = pair.Near();
      // Where cores nearly touch, the normal turns too fast for differences.
      if (near.overlap || std::abs(near.core_distance_m) < 0.02) continue;
      ASSERT_TRUE(near.unique);
      const auto derivative = DifferentiateNearPoints(pair.a.Posed(), pair.b.Posed(), near);
      bool smooth = true;
      double worst = 0;
      for (std::size_t m = 0; m < Space::kMotions; ++m) {
        const auto at = [&](double t) {
          const auto n = Pair<Space>{pair.a.Displaced(Space::BasisMotion(m), t), pair.b}.Near();
          Eigen::Matrix<double, 3 * Vector::RowsAtCompileTime + 1, 1> all;
          all << ToEigen(n.p_a), ToEigen(n.p_b), ToEigen(n.u_d), n.d;
          return all;
        };
        const auto central = [&](double h) { return ((at(h) - at(-h)) / (2 * h)).eval(); };
        const auto wide = central(4e-6), narrow = central(2e-6);
        const auto reference = ((4 * narrow - wide) / 3).eval();
        auto found = reference;
        found << ToEigen(derivative.p_a[m]), ToEigen(derivative.p_b[m]), ToEigen(derivative.u_d[m]),
            derivative.d[m];
        const double scale = 1 + reference.norm();
        smooth = smooth && (wide - narrow).norm() < 1e-6 * scale;
        worst = std::max(worst, (found - reference).norm() / scale);
      }
      if (!smooth) {
        ++at_a_switch;  // The active set changes within the step.
        continue;
      }
      ++compared;
      ASSERT_LT(worst, 1e-7) << NameOf(kinds);
      ++met[NameOf(kinds)][{std::count(near.active_a.begin(), near.active_a.end(), 0),
                            std::count(near.active_b.begin(), near.active_b.end(), 0)}];
    }
    EXPECT_LT(at_a_switch, 20) << NameOf(kinds);
  }
  const auto expect_met = [&](ShapeKind a, ShapeKind b, long free_a, long free_b) {
    const std::string pair = NameOf(Kinds{a, b});
    EXPECT_GT((met[pair][{free_a, free_b}]), 20)
        << pair << ": near points inside " << free_a << "- and " << free_b << "-dimensional faces";
  };
  constexpr ShapeKind kCapsule = ShapeKind::kCapsule, kBox = ShapeKind::kBox;
  for (const ShapeKind a : {kCapsule, kBox}) {
    expect_met(a, ShapeKind::kHalfSpace, 0, 0);
    expect_met(a, ShapeKind::kSphere, 0, 0);  // vertex or end
    expect_met(a, ShapeKind::kSphere, 1, 0);  // edge or side
    for (const ShapeKind b : {kCapsule, kBox}) {
      expect_met(a, b, 0, 0);
      expect_met(a, b, 0, 1);
      expect_met(a, b, 1, 0);
      if (std::is_same_v<Space, Spatial>) expect_met(a, b, 1, 1);  // crossing edges
    }
  }
  if (std::is_same_v<Space, Spatial>) {  // faces against ends and vertices
    expect_met(kBox, ShapeKind::kSphere, 2, 0);
    expect_met(kBox, kCapsule, 2, 0);
    expect_met(kCapsule, kBox, 0, 2);
    expect_met(kBox, kBox, 0, 2);
    expect_met(kBox, kBox, 2, 0);
  }
}

TYPED_TEST(NearPointsIn, AHalfSpaceMayAlsoBeTheOneThatMoves) {
  using Space = TypeParam;
  std::mt19937_64 random(76);
  for (int trial = 0; trial < 300; ++trial) {
    auto pair = RandomPair<Space>(random, {ShapeKind::kBox, ShapeKind::kHalfSpace, true});
    std::swap(pair.a, pair.b);
    const auto derivative = DifferentiateNearPoints(pair.a.Posed(), pair.b.Posed(), pair.Near());
    for (std::size_t m = 0; m < Space::kMotions; ++m) {
      const double h = 1e-6;
      const auto plus = Pair<Space>{pair.a.Displaced(Space::BasisMotion(m), h), pair.b}.Near();
      const auto minus = Pair<Space>{pair.a.Displaced(Space::BasisMotion(m), -h), pair.b}.Near();
      if (plus.active_b != minus.active_b) continue;
      EXPECT_NEAR(derivative.d[m], (plus.d - minus.d) / (2 * h), 1e-8);
      EXPECT_LT((derivative.u_d[m] - (plus.u_d - minus.u_d) / (2 * h)).norm(), 1e-8);
      EXPECT_LT((derivative.p_a[m] - (plus.p_a - minus.p_a) / (2 * h)).norm(), 1e-8);
      EXPECT_LT((derivative.p_b[m] - (plus.p_b - minus.p_b) / (2 * h)).norm(), 1e-8);
    }
  }
}

TEST(NearPoints, OfParallelSidesAreTheOnesNearestToTheCentresAndAreMarked) {
  using S = Shape<Plane>;
  const Plane::Rotation none;
  const auto at = [&](const S& shape) { return PosedShape<Plane>::Of(shape, none, {0, 0}); };
  // Two bars that overlap from 0.1 to 0.3: |y|^2 is least in the middle between the centres.
  const auto near = FindNearPoints(at(S::Box({0, 0.5}, none, {0.3, 0.1})),
                                   at(S::Box({0.4, 0}, none, {0.3, 0.1})));
  EXPECT_FALSE(near.unique);
  EXPECT_NEAR(near.d, 0.3, 1e-15);
  EXPECT_LT((near.p_a - Plane::Vector(0.2, 0.4)).norm(), 1e-12);
  EXPECT_LT((near.p_b - Plane::Vector(0.2, 0.1)).norm(), 1e-12);
  // A short bar above the end of a long one: its own centre is nearest.
  const auto end = FindNearPoints(at(S::Capsule({0.9, 0.5}, none, 0.05, 0.1)),
                                  at(S::Box({0, 0}, none, {1, 0.1})));
  EXPECT_FALSE(end.unique);
  EXPECT_GT(end.p_a.x(), 0.85 - 1e-12);
  EXPECT_LT(end.p_a.x(), 0.95 + 1e-12);
  EXPECT_NEAR(end.d, 0.3, 1e-15);
  // Level on the ground: the middle.
  const auto flat =
      FindNearPoints(at(S::Box({0.2, 0.5}, none, {0.3, 0.1})), at(S::HalfSpace({0, 0}, {0, 1})));
  EXPECT_FALSE(flat.unique);
  EXPECT_LT((flat.p_a - Plane::Vector(0.2, 0.4)).norm(), 1e-15);
}

TEST(NearPoints, OfParallelFacesInSpaceAreOneConsistentPairWithFiniteDerivatives) {
  using S = Shape<Spatial>;
  const Spatial::Rotation none;
  std::mt19937_64 random(77);
  for (int trial = 0; trial < 200; ++trial) {
    // Turned about the common normal: polygons that overlap in any way.
    const auto R = Spatial::RotationBy(SpaceVector::UnitZ(), Uniform(random, -3, 3));
    const auto a = PosedShape<Spatial>::Of(
        S::Box({Uniform(random, -.2, .2), Uniform(random, -.2, .2), 0.5}, R, {0.2, 0.1, 0.05}),
        none, {0, 0, 0});
    const auto b =
        PosedShape<Spatial>::Of(S::Box({0, 0, 0}, none, {0.15, 0.25, 0.1}), none, {0, 0, 0});
    const auto near = FindNearPoints(a, b);
    EXPECT_FALSE(near.unique);
    EXPECT_NEAR(near.d, 0.35, 1e-13);
    EXPECT_LT((near.p_a - near.p_b - SpaceVector(0, 0, 0.35)).norm(), 1e-9);
    const auto within = [](const PosedShape<Spatial>& box, const SpaceVector& point) {
      bool inside = true;
      for (int i = 0; i < 3; ++i) {
        const double along = box.axis(i).dot(point - box.centre);
        inside = inside && std::abs(along) <= box.half_extents[i] + 1e-9;
      }
      return inside;
    };
    EXPECT_TRUE(within(a, near.p_a));
    EXPECT_TRUE(within(b, near.p_b));
    // No other common point has a smaller sum of squares: a fine grid.
    const auto norm = [&](const SpaceVector& p) {
      const SpaceVector off = p - a.centre;
      return off.x() * off.x() + off.y() * off.y() + p.x() * p.x() + p.y() * p.y();
    };
    for (int x = -15; x <= 15; ++x) {
      for (int y = -25; y <= 25; ++y) {
        const SpaceVector p(0.01 * x, 0.01 * y, 0.45);
        if (!within(a, p)) continue;
        EXPECT_GE(norm(p), norm(near.p_a) - 1e-9);
      }
    }
    const auto derivative = DifferentiateNearPoints(a, b, near);
    for (std::size_t m = 0; m < 6; ++m) {
      EXPECT_TRUE(derivative.p_a[m].allFinite() && derivative.u_d[m].allFinite());
    }
    EXPECT_NEAR(derivative.d[5], 1, 1e-9);  // up
    EXPECT_LT(derivative.u_d[3].norm() + derivative.u_d[5].norm(), 1e-9);
  }
}

TYPED_TEST(NearPointsIn, OfOverlappingCoresAreMarkedAndFinite) {
  using S = Shape<TypeParam>;
  using Vector = typename TypeParam::Vector;
  std::mt19937_64 random(78);
  const typename TypeParam::Rotation none;
  int overlapping = 0;
  for (int trial = 0; trial < 300; ++trial) {
    auto pair = RandomPair<TypeParam>(random, {ShapeKind::kBox, ShapeKind::kBox}, 0.05);
    if (trial % 10 == 0) pair.b = pair.a;  // centre in centre
    const auto near = pair.Near();
    const auto derivative = DifferentiateNearPoints(pair.a.Posed(), pair.b.Posed(), near);
    EXPECT_TRUE(near.u_d.allFinite() && near.p_a.allFinite() && std::isfinite(near.d));
    for (const Vector& v : derivative.u_d) EXPECT_TRUE(v.allFinite());
    if (!near.overlap) continue;
    ++overlapping;
    EXPECT_NEAR(near.d, 0, 1e-12);
    EXPECT_NEAR(near.u_d.norm(), 1, 1e-12);
  }
  EXPECT_GT(overlapping, 150);
  // Swept surfaces that intersect while the cores do not: an ordinary penetration.
  const auto a =
      PosedShape<TypeParam>::Of(S::Sphere(Vector::Unit(1) * 0.15, 0.1), none, Vector::Zero());
  const auto b = PosedShape<TypeParam>::Of(S::Sphere(Vector::Zero(), 0.1), none, Vector::Zero());
  const auto near = FindNearPoints(a, b);
  EXPECT_FALSE(near.overlap);
  EXPECT_NEAR(near.d, -0.05, 1e-15);
  EXPECT_LT((near.u_d - Vector::Unit(1)).norm(), 1e-15);
}

TYPED_TEST(NearPointsIn, AllocateNothing) {
  std::mt19937_64 random(79);
  for (const Kinds& kinds : AllPairs()) {
    for (int trial = 0; trial < 50; ++trial) {
      const auto pair = RandomPair<TypeParam>(random, kinds);
      const testing::AllocationGuard guard;
      const auto a = pair.a.Posed(), b = pair.b.Posed();
      const auto near = FindNearPoints(a, b);
      DifferentiateNearPoints(a, b, near);
    }
  }
  const Shape<TypeParam> box = RandomShape<TypeParam>(random, ShapeKind::kBox);
  auto above = box;
  above.centre += box.rotation * typename TypeParam::Vector(TypeParam::Vector::Unit(1) * 0.5);
  const testing::AllocationGuard guard;
  const typename TypeParam::Rotation none;
  const auto a = PosedShape<TypeParam>::Of(above, none, TypeParam::Vector::Zero());
  const auto b = PosedShape<TypeParam>::Of(box, none, TypeParam::Vector::Zero());
  const auto near = FindNearPoints(a, b);
  EXPECT_FALSE(near.unique);
  DifferentiateNearPoints(a, b, near);
}

}  // namespace
}  // namespace tumbler
