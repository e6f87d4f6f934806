#pragma once

#include <array>
#include <cmath>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "offline/contact/contact_law.h"
#include "offline/contact/near_points.h"
#include "offline/contact/shape.h"
#include "offline/dynamics/hybrid_dynamics.h"

namespace tumbler {

/// A shape fixed to a body of the robot.
template <class Space>
struct ContactShape {
  std::string name;    ///< `LINK/INDEX`
  int body = 0;        ///< Degree of freedom that moves it.
  Shape<Space> shape;  ///< In the body's frame. Not a half-space.
};

/// Something at rest in the world that the robot can touch.
template <class Space>
struct Obstacle {
  std::string name;
  Shape<Space> shape;  ///< In the world. In the plane a sphere is a cylinder along y.

  bool operator==(const Obstacle&) const = default;
};

/// Two shapes of the robot, on different bodies, that can touch each other.
struct ContactPair {
  int a = 0, b = 0;  ///< Indices of shapes.
};

/// The near points of a sphere with an obstacle in closed form: its core is a point c. What
/// `FindNearPoints` says of the same two, save that inside the core of the obstacle the normal and
/// the distance are those of its nearest side, so that they are defined everywhere.
template <class Space>
struct NearPoint {
  double d = 0;                ///< Distance between the surfaces, negative inside [m].
  typename Space::Vector u_d;  ///< Unit normal, from the obstacle to the sphere.
  /// du_d = curvature (I - u_d u_d^T - e e^T) dc for a motion dc of the sphere's centre.
  double curvature_per_m = 0;
  /// e: along the edge of a core, in space; zero where the near point is on a face or a vertex. The
  /// plane has no edges in this sense.
  struct None {};
  using Edge = std::conditional_t<Shape<Space>::kDimension == 2, None, typename Space::Vector>;
  [[no_unique_address]] Edge edge{};
};

template <class Space>
NearPoint<Space> FindNearPointOfCore(const Shape<Space>& obstacle,
                                     const typename Space::Vector& centre, double radius_m) {
  using Vector = typename Space::Vector;
  constexpr int kDimension = Vector::RowsAtCompileTime;
  NearPoint<Space> near;
  if constexpr (kDimension > 2) near.edge.setZero();
  const Vector c = obstacle.rotation.Inverse(centre - obstacle.centre);
  Vector rest = c;  // from the core's nearest point
  int free = -1;
  int free_count = 0;
  for (int i = 0; i < kDimension; ++i) {
    const double h = obstacle.half_extents[i];
    if (std::abs(c[i]) < h) {
      rest[i] = 0;
      free = i;
      ++free_count;
    } else {
      rest[i] -= std::copysign(h, c[i]);
    }
  }
  const double length = rest.norm();
  if (length > 0) {
    near.d = length - obstacle.radius_m - radius_m;
    near.u_d = obstacle.rotation * Vector(rest / length);
    if (free_count < kDimension - 1) {
      near.curvature_per_m = 1 / length;
      if constexpr (kDimension > 2) {
        if (free_count == 1) near.edge = obstacle.rotation * Vector(Vector::Unit(free));
      }
    }
    return near;
  }
  // Inside the core: out through the nearest side; up, of those that are equally near.
  int side = kDimension - 1;
  const auto depth = [&](int i) { return obstacle.half_extents[i] - std::abs(c[i]); };
  for (int i = kDimension - 1; i >= 0; --i) {
    if (depth(i) < depth(side)) side = i;
  }
  near.d = -depth(side) - obstacle.radius_m - radius_m;
  near.u_d = obstacle.rotation * Vector(std::copysign(1.0, c[side]) * Vector::Unit(side));
  return near;
}

template <class Space>
NearPoint<Space> FindNearPoint(const Shape<Space>& obstacle, const typename Space::Vector& centre,
                               double radius_m) {
  if (!obstacle.half_space) return FindNearPointOfCore(obstacle, centre, radius_m);
  NearPoint<Space> near;
  if constexpr (Shape<Space>::kDimension > 2) near.edge.setZero();
  near.d = obstacle.normal.dot(centre - obstacle.centre) - radius_m;
  near.u_d = obstacle.normal;
  return near;
}

/// One contact that carries force.
template <class Space>
struct ActiveContact {
  int shape = 0;         ///< On which `force` acts.
  int obstacle = -1;     ///< -1: another shape of the robot.
  int other_shape = -1;  ///< That shape; -1: an obstacle.
  double depth_m = 0;    ///< Into the layer, d_on - d.
  double normal_force_n = 0;
  typename Space::Vector point;   ///< p_rob relative to the origin of the dynamics.
  typename Space::Vector force;   ///< On the robot's shape.
  typename Space::Vector normal;  ///< Unit, towards that shape.
};

/// The forces of contact on a robot, as the integration of its motion sees them: `ContactModel`
/// does, or what is written for one robot alone.
///
/// Order of calls: those of HybridDynamics, which see.
template <class Space>
class ContactForces {
 public:
  virtual ~ContactForces() = default;

  /// Adds the wrench of every active contact to `dynamics`, after its SetState. No heap.
  virtual void Apply(HybridDynamics<Space>& dynamics) = 0;

  /// Adds the derivatives of the wrenches of the last Apply to `dynamics`, after its Solve.
  virtual void Differentiate(HybridDynamics<Space>& dynamics) const = 0;

  /// The contacts of the last Apply; valid until the next.
  [[nodiscard]] virtual std::span<const ActiveContact<Space>> active() const = 0;

  /// Adds `scale` times the derivative of the depth of an active contact by all positions.
  virtual void AddDepthSlopes(const HybridDynamics<Space>& dynamics,
                              const ActiveContact<Space>& active, double scale,
                              std::span<double> slopes) const = 0;
};

/// All contacts of a robot with the obstacles of a task, and with itself where it is asked for,
/// [AB04, section III], with exact derivatives that include the motion of contact points and
/// normals.
///
/// Each pair of shapes is one contact at its near points, save that a capsule or box touches a
/// half-space with each end or vertex by itself: the one near point of a face that lies flat jumps
/// from vertex to vertex, and with it the force.
///
/// Force is a C1 function of state for spheres with half-spaces and spheres, and for all shapes
/// with half-spaces. With other shapes the curvature of their common surface jumps where a near
/// point passes from a face to an edge or vertex: force is continuous there and its derivative
/// jumps. Between parallel edges or faces (`NearPoints::unique`) the point of attack jumps too;
/// what lies on an obstacle's face should do so with spheres.
template <class Space>
class ContactModel final : public ContactForces<Space> {
 public:
  using Vector = typename Space::Vector;

  ContactModel(const ContactLaw& law, std::vector<ContactShape<Space>> shapes,
               std::vector<Obstacle<Space>> obstacles,
               const std::vector<ContactPair>& own_pairs = {})
      : law_(law), shapes_(std::move(shapes)), obstacles_(std::move(obstacles)) {
    const auto index = [](std::size_t i) { return static_cast<int>(i); };
    for (std::size_t s = 0; s < shapes_.size(); ++s) {
      const ContactShape<Space>& shape = shapes_[s];
      if (shape.shape.kind() == ShapeKind::kSphere) {
        spheres_.push_back({index(s), shape.body, shape.shape.centre, shape.shape.radius_m});
        continue;
      }
      for (const Vector& vertex : Vertices(shape.shape)) {
        vertices_.push_back({index(s), shape.body, vertex, shape.shape.radius_m});
      }
      for (std::size_t o = 0; o < obstacles_.size(); ++o) {
        if (!obstacles_[o].shape.half_space) pairs_.push_back({index(s), index(o), -1});
      }
    }
    for (const ContactPair& pair : own_pairs) pairs_.push_back({pair.a, -1, pair.b});
    for (std::size_t o = 0; o < obstacles_.size(); ++o) {
      if (obstacles_[o].shape.half_space) half_spaces_.push_back(index(o));
    }
    const std::size_t most = spheres_.size() * obstacles_.size() +
                             vertices_.size() * half_spaces_.size() + pairs_.size();
    evaluations_.resize(most);
    active_.resize(most);
    near_.resize(pairs_.size());
  }

  void Apply(HybridDynamics<Space>& dynamics) override {
    active_count_ = 0;
    const int obstacle_count = static_cast<int>(obstacles_.size());
    for (const Point& point : spheres_) {
      const Vector c = dynamics.position(point.body) + dynamics.rotation(point.body) * point.centre;
      const Vector world = dynamics.origin() + c;
      for (int o = 0; o < obstacle_count; ++o) AddPoint(dynamics, point, c, world, o);
    }
    for (const Point& point : vertices_) {
      const Vector c = dynamics.position(point.body) + dynamics.rotation(point.body) * point.centre;
      const Vector world = dynamics.origin() + c;
      for (const int o : half_spaces_) AddPoint(dynamics, point, c, world, o);
    }
    for (std::size_t k = 0; k < pairs_.size(); ++k) AddPair(dynamics, k);
  }

  void Differentiate(HybridDynamics<Space>& dynamics) const override {
    for (std::size_t k = 0; k < active_count_; ++k) {
      const Evaluation& e = evaluations_[k];
      if (e.pair < 0) {
        DifferentiatePoint(dynamics, e);
      } else {
        DifferentiatePair(dynamics, e);
      }
    }
  }

  [[nodiscard]] std::span<const ActiveContact<Space>> active() const override {
    return {active_.data(), active_count_};
  }

  void AddDepthSlopes(const HybridDynamics<Space>& dynamics, const ActiveContact<Space>& active,
                      double scale, std::span<double> slopes) const override {
    const auto body = [&](int shape) { return shapes_[static_cast<std::size_t>(shape)].body; };
    const Vector deeper = -scale * active.normal;
    dynamics.AddJointForces(body(active.shape), Space::ForceAt(active.point, deeper), slopes);
    if (active.other_shape < 0) return;
    dynamics.AddJointForces(body(active.other_shape), Space::ForceAt(active.point, -deeper),
                            slopes);
  }

  [[nodiscard]] const ContactLaw& law() const { return law_; }
  [[nodiscard]] const std::vector<ContactShape<Space>>& shapes() const { return shapes_; }
  [[nodiscard]] const std::vector<Obstacle<Space>>& obstacles() const { return obstacles_; }

 private:
  using Motion = typename Space::Motion;
  using WrenchMap = typename Space::WrenchMap;

  /// A sphere, or a vertex of a shape with its swept radius.
  struct Point {
    int shape;
    int body;
    Vector centre;
    double radius_m;
  };
  /// Two shapes that meet at general near points: b is an obstacle or a shape of the robot.
  struct GeneralPair {
    int shape;
    int obstacle;
    int other_shape;
  };
  struct Evaluation {
    NearPoint<Space> near;
    int pair;  // of pairs_; -1 for a point
    int body;
    int other_body;  // -1: the world
    double radius;
    Vector c, p, v, v_t, F;
    NormalForce normal;
    FrictionGain friction;
  };

  /// F = N u - mu |N| gain v_t and its change for changes of distance, normal and velocity, with
  /// v_d = v . u and v_t = v - v_d u.
  struct ForceChange {
    ForceChange(const ContactLaw& law, const Evaluation& evaluation) : e(evaluation) {
      v_d = e.v.dot(e.near.u_d);
      const double mu_N = law.mu * std::abs(e.normal.N);
      g = mu_N * e.friction.gain;
      b = (2 * mu_N * e.friction.gain_s2) * e.v_t;
      const Vector per_N =
          e.near.u_d - (std::copysign(law.mu, e.normal.N) * e.friction.gain) * e.v_t;
      per_d = e.normal.N_d * per_N;
      per_v_d = e.normal.N_v * per_N + g * e.near.u_d;
    }
    [[nodiscard]] Vector ByVelocity(const Vector& dv) const {
      return e.near.u_d.dot(dv) * per_v_d - e.v_t.dot(dv) * b - g * dv;
    }
    [[nodiscard]] Vector ByNormal(const Vector& du) const {
      return e.v.dot(du) * per_v_d + (v_d * e.v_t.dot(du)) * b + (e.normal.N + g * v_d) * du;
    }
    const Evaluation& e;
    double v_d, g;
    Vector b, per_d, per_v_d;
  };

  static std::vector<Vector> Vertices(const Shape<Space>& shape) {
    std::vector<Vector> vertices = {shape.centre};
    for (int i = 0; i < Shape<Space>::kDimension; ++i) {
      if (shape.half_extents[i] == 0) continue;
      const Vector side = shape.rotation * Vector(shape.half_extents[i] * Vector::Unit(i));
      const std::vector<Vector> middles = std::exchange(vertices, {});
      for (const Vector& middle : middles) {
        vertices.push_back(middle + side);
        vertices.push_back(middle - side);
      }
    }
    return vertices;
  }

  void AddPoint(HybridDynamics<Space>& dynamics, const Point& point, const Vector& c,
                const Vector& world, int obstacle) {
    const NearPoint<Space> near = FindNearPoint<Space>(
        obstacles_[static_cast<std::size_t>(obstacle)].shape, world, point.radius_m);
    if (near.d >= law_.d_on_m) return;
    Evaluation& e = evaluations_[active_count_];
    e.near = near;
    e.pair = -1;
    e.body = point.body;
    e.radius = point.radius_m;
    e.c = c;
    e.p = c - point.radius_m * near.u_d;
    e.v = dynamics.velocity(point.body).At(e.p);
    dynamics.AddWrench(point.body, SetForce(e, point.shape, obstacle, -1));
  }

  void AddPair(HybridDynamics<Space>& dynamics, std::size_t k) {
    const GeneralPair& pair = pairs_[k];
    const int body = shapes_[static_cast<std::size_t>(pair.shape)].body;
    const NearPoints<Space> near = FindNearPoints(PosedA(dynamics, pair), PosedB(dynamics, pair));
    if (near.d >= law_.d_on_m) return;
    near_[k] = near;
    Evaluation& e = evaluations_[active_count_];
    e.near.d = near.d;
    e.near.u_d = near.u_d;
    e.pair = static_cast<int>(k);
    e.body = body;
    e.other_body =
        pair.other_shape < 0 ? -1 : shapes_[static_cast<std::size_t>(pair.other_shape)].body;
    e.p = near.p_a;
    e.v = dynamics.velocity(body).At(e.p);
    if (e.other_body >= 0) e.v -= dynamics.velocity(e.other_body).At(e.p);
    const auto W = SetForce(e, pair.shape, pair.obstacle, pair.other_shape);
    dynamics.AddWrench(body, W);
    if (e.other_body >= 0) dynamics.AddWrench(e.other_body, W * -1.0);
  }

  PosedShape<Space> PosedA(const HybridDynamics<Space>& dynamics, const GeneralPair& pair) const {
    return PosedOn(dynamics, pair.shape);
  }
  PosedShape<Space> PosedB(const HybridDynamics<Space>& dynamics, const GeneralPair& pair) const {
    if (pair.other_shape >= 0) return PosedOn(dynamics, pair.other_shape);
    return PosedShape<Space>::Of(obstacles_[static_cast<std::size_t>(pair.obstacle)].shape, {},
                                 -dynamics.origin());
  }
  PosedShape<Space> PosedOn(const HybridDynamics<Space>& dynamics, int shape) const {
    const ContactShape<Space>& own = shapes_[static_cast<std::size_t>(shape)];
    return PosedShape<Space>::Of(own.shape, dynamics.rotation(own.body),
                                 dynamics.position(own.body));
  }

  /// The force at e.near, e.p and e.v; makes it the next active contact.
  typename Space::Wrench SetForce(Evaluation& e, int shape, int obstacle, int other_shape) {
    const Vector& u = e.near.u_d;
    const double v_d = e.v.dot(u);
    e.normal = EvaluateNormalForce(law_, e.near.d, v_d);
    e.v_t = e.v - v_d * u;
    e.friction = EvaluateFrictionGain(law_, e.v_t.squaredNorm());
    e.F = e.normal.N * u - (law_.mu * std::abs(e.normal.N) * e.friction.gain) * e.v_t;
    active_[active_count_++] = {shape,      obstacle, other_shape, law_.d_on_m - e.near.d,
                                e.normal.N, e.p,      e.F,         u};
    return Space::ForceAt(e.p, e.F);
  }

  void DifferentiatePoint(HybridDynamics<Space>& dynamics, const Evaluation& e) const {
    const Vector& u = e.near.u_d;
    const auto& body_v = dynamics.velocity(e.body);
    const auto W = Space::ForceAt(e.p, e.F);
    const ForceChange change(law_, e);
    WrenchMap stiffness;
    WrenchMap damping;
    for (std::size_t m = 0; m < Space::kMotions; ++m) {
      const auto S = Space::BasisMotion(m);
      const Vector dc = S.At(e.c);
      const double dd = u.dot(dc);
      Vector dp = dc;
      Vector dF = dd * change.per_d;
      if (e.near.curvature_per_m != 0) {
        Vector across = dc - dd * u;
        if constexpr (Shape<Space>::kDimension > 2) across -= e.near.edge.dot(dc) * e.near.edge;
        const Vector du = e.near.curvature_per_m * across;
        dp -= e.radius * du;
        dF += change.ByNormal(du);
      }
      dF += change.ByVelocity(Space::At(Space::Cross(S, body_v), e.p) + Space::Cross(body_v.w, dp));
      auto dW = Space::ForceAt(e.p, dF);
      dW.n += Space::Moment(dp, e.F);
      stiffness.columns[m] = dW - Space::Cross(S, W);
      damping.columns[m] = Space::ForceAt(e.p, change.ByVelocity(S.At(e.p)));
    }
    dynamics.AddWrenchDerivative(e.body, stiffness, damping);
  }

  /// The same with general near points. Of two bodies the law sees the relative motion only: the
  /// maps are those of displacing a, or changing its velocity, with b at rest.
  void DifferentiatePair(HybridDynamics<Space>& dynamics, const Evaluation& e) const {
    const auto k = static_cast<std::size_t>(e.pair);
    const NearPointsDerivative<Space> near =
        DifferentiateNearPoints(PosedA(dynamics, pairs_[k]), PosedB(dynamics, pairs_[k]), near_[k]);
    const auto& body_v = dynamics.velocity(e.body);
    typename Space::Angular w = body_v.w;
    if (e.other_body >= 0) w -= dynamics.velocity(e.other_body).w;
    const auto W = Space::ForceAt(e.p, e.F);
    const ForceChange change(law_, e);
    WrenchMap stiffness;
    WrenchMap damping;
    for (std::size_t m = 0; m < Space::kMotions; ++m) {
      const auto S = Space::BasisMotion(m);
      const Vector& dp = near.p_a[m];
      const Vector dv = Space::At(Space::Cross(S, body_v), e.p) + Space::Cross(w, dp);
      const Vector dF =
          near.d[m] * change.per_d + change.ByNormal(near.u_d[m]) + change.ByVelocity(dv);
      auto dW = Space::ForceAt(e.p, dF);
      dW.n += Space::Moment(dp, e.F);
      stiffness.columns[m] = dW - Space::Cross(S, W);
      damping.columns[m] = Space::ForceAt(e.p, change.ByVelocity(S.At(e.p)));
    }
    if (e.other_body < 0) {
      dynamics.AddWrenchDerivative(e.body, stiffness, damping);
    } else {
      dynamics.AddPairDerivative(e.body, e.other_body, W, stiffness, damping);
    }
  }

  ContactLaw law_;
  std::vector<ContactShape<Space>> shapes_;
  std::vector<Obstacle<Space>> obstacles_;
  std::vector<Point> spheres_;    // meet all obstacles
  std::vector<Point> vertices_;   // meet half-spaces
  std::vector<int> half_spaces_;  // of obstacles_
  std::vector<GeneralPair> pairs_;
  std::vector<NearPoints<Space>> near_;  // of pairs_, where active
  // As many as there could be at once.
  std::vector<Evaluation> evaluations_;
  std::vector<ActiveContact<Space>> active_;
  std::size_t active_count_ = 0;
};

}  // namespace tumbler
