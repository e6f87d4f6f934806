#pragma once

#include <cmath>
#include <type_traits>
#include <utility>

#include "offline/model/contact_model.h"
#include "offline/model/hybrid_dynamics.h"

/// Bodies of the functions, for the sources that compile them for one algebra each.
namespace tumbler {

/// F = N u - mu |N| gain v_t and its change for changes of distance, normal and velocity, with
/// v_d = v . u and v_t = v - v_d u.
template <class Space>
struct ContactModel<Space>::ForceChange {
  ForceChange(const ContactLaw& law, const Evaluation& evaluation) : e(evaluation) {
    v_d = e.v.dot(e.near.u_d);
    const double mu_N = law.mu * std::abs(e.normal.N);
    g = mu_N * e.friction.gain;
    b = (2 * mu_N * e.friction.gain_s2) * e.v_t;
    const Vector per_N = e.near.u_d - (std::copysign(law.mu, e.normal.N) * e.friction.gain) * e.v_t;
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

template <class Space>
ContactModel<Space>::ContactModel(const ContactLaw& law, std::vector<ContactShape<Space>> shapes,
                                  std::vector<Obstacle<Space>> obstacles,
                                  const std::vector<ContactPair>& own_pairs)
    : law_(law), shapes_(std::move(shapes)), obstacles_(std::move(obstacles)) {
  const auto index = [](std::size_t i) { return static_cast<int>(i); };
  for (std::size_t s = 0; s < shapes_.size(); ++s) {
    const ContactShape<Space>& shape = shapes_[s];
    if (shape.shape.kind() == ShapeKind::kSphere) {
      spheres_.push_back({index(s), shape.body, shape.shape.centre, shape.shape.radius_m});
      continue;
    }
    for (const Vector& vertex : CoreVertices(shape.shape)) {
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
  const std::size_t most =
      spheres_.size() * obstacles_.size() + vertices_.size() * half_spaces_.size() + pairs_.size();
  evaluations_.resize(most);
  active_.resize(most);
  near_.resize(pairs_.size());
}

template <class Space>
inline void ContactModel<Space>::AddPoint(HybridDynamics<Space>& dynamics, const Point& point,
                                          const Vector& c, const Vector& world, int obstacle) {
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

template <class Space>
void ContactModel<Space>::Apply(HybridDynamics<Space>& dynamics) {
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

template <class Space>
void ContactModel<Space>::Differentiate(HybridDynamics<Space>& dynamics) const {
  for (std::size_t k = 0; k < active_count_; ++k) {
    const Evaluation& e = evaluations_[k];
    if (e.pair < 0) {
      DifferentiatePoint(dynamics, e);
    } else {
      DifferentiatePair(dynamics, e);
    }
  }
}

template <class Space>
std::uint64_t ContactModel<Space>::Pieces() const {
  ContactPieces pieces;
  for (std::size_t k = 0; k < active_count_; ++k) {
    const ActiveContact<Space>& a = active_[k];
    const Evaluation& e = evaluations_[k];
    // Of the vertices of one shape it counts how many are active, not which.
    const auto shape = static_cast<std::uint64_t>(a.shape);
    const auto other = a.other_shape >= 0
                           ? obstacles_.size() + static_cast<std::size_t>(a.other_shape)
                           : static_cast<std::size_t>(a.obstacle);
    pieces.Add(shape * (obstacles_.size() + shapes_.size()) + other,
               PieceOf(law_, e.near.d, e.v.dot(e.near.u_d), e.v_t.squaredNorm()));
  }
  return pieces.number();
}

template <class Space>
void ContactModel<Space>::AddDepthSlopes(const HybridDynamics<Space>& dynamics,
                                         const ActiveContact<Space>& active, double scale,
                                         std::span<double> slopes) const {
  const auto body = [&](int shape) { return shapes_[static_cast<std::size_t>(shape)].body; };
  const Vector deeper = -scale * active.normal;
  dynamics.AddJointForces(body(active.shape), Space::ForceAt(active.point, deeper), slopes);
  if (active.other_shape < 0) return;
  dynamics.AddJointForces(body(active.other_shape), Space::ForceAt(active.point, -deeper), slopes);
}

template <class Space>
double ContactModel<Space>::LoadedSlip() const {
  double sum = 0;
  for (std::size_t k = 0; k < active_count_; ++k) {
    const Evaluation& e = evaluations_[k];
    sum += std::abs(e.normal.N) * e.friction.gain * e.v_t.squaredNorm();
  }
  return sum;
}

/// With s2 = |v_t|^2 a contact adds |N| gain(s2) s2, of which
///
///   d(s2) = 2 v_t . dv - 2 v_d v_t . du_d,   dN = N_d dd + N_v (u_d . dv + v . du_d).
///
/// A body that is displaced by S with its velocity carried along changes the velocity of its point
/// of attack by that of S x v_body there, and by w x dp as the point moves by dp.
template <class Space>
void ContactModel<Space>::AddLoadedSlipSlopes(const HybridDynamics<Space>& dynamics, double scale,
                                              std::span<double> by_q,
                                              std::span<double> by_qd) const {
  for (std::size_t k = 0; k < active_count_; ++k) {
    const Evaluation& e = evaluations_[k];
    const Vector& u = e.near.u_d;
    const double s2 = e.v_t.squaredNorm();
    const double by_N = scale * std::copysign(e.friction.gain * s2, e.normal.N);
    const double by_s2 = scale * std::abs(e.normal.N) * (e.friction.gain + s2 * e.friction.gain_s2);
    const double by_d = by_N * e.normal.N_d, by_v_d = by_N * e.normal.N_v;
    const Vector by_v = by_v_d * u + (2 * by_s2) * e.v_t;
    const Vector by_u = by_v_d * e.v - (2 * by_s2 * e.v.dot(u)) * e.v_t;
    const auto& body_v = dynamics.velocity(e.body);
    const auto by_velocity = Space::ForceAt(e.p, by_v);
    auto by_place = Space::Cross(body_v, by_velocity);
    if (e.pair < 0) {
      const Vector by_p = -Space::Cross(body_v.w, by_v);
      Vector by_centre = by_d * u + by_p;
      if (e.near.curvature_per_m != 0) {
        const Vector turning = by_u - e.radius * by_p;
        Vector across = turning - u.dot(turning) * u;
        if constexpr (Shape<Space>::kDimension > 2)
          across -= e.near.edge.dot(turning) * e.near.edge;
        by_centre += e.near.curvature_per_m * across;
      }
      by_place = by_place + Space::ForceAt(e.c, by_centre);
      dynamics.AddStateSlopes(e.body, by_place, by_velocity, by_q, by_qd);
      continue;
    }
    auto w = body_v.w;
    if (e.other_body >= 0) w -= dynamics.velocity(e.other_body).w;
    const Vector by_p = -Space::Cross(w, by_v);
    const auto index = static_cast<std::size_t>(e.pair);
    const NearPointsDerivative<Space> near = DifferentiateNearPoints(
        PosedA(dynamics, pairs_[index]), PosedB(dynamics, pairs_[index]), near_[index]);
    for (std::size_t m = 0; m < Space::kMotions; ++m) {
      const auto S = Space::BasisMotion(m);
      by_place = by_place + typename Space::Wrench{S.w, S.v} *
                                (by_d * near.d[m] + by_u.dot(near.u_d[m]) + by_p.dot(near.p_a[m]));
    }
    dynamics.AddStateSlopes(e.body, by_place, by_velocity, by_q, by_qd);
    if (e.other_body < 0) continue;
    // It depends on the motion of one body relative to the other.
    dynamics.AddStateSlopes(e.other_body, by_place * -1.0, by_velocity * -1.0, by_q, by_qd);
  }
}

template <class Space>
void ContactModel<Space>::AddPair(HybridDynamics<Space>& dynamics, std::size_t k) {
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

template <class Space>
PosedShape<Space> ContactModel<Space>::PosedOn(const HybridDynamics<Space>& dynamics,
                                               int shape) const {
  const ContactShape<Space>& own = shapes_[static_cast<std::size_t>(shape)];
  return PosedShape<Space>::Of(own.shape, dynamics.rotation(own.body), dynamics.position(own.body));
}

template <class Space>
PosedShape<Space> ContactModel<Space>::PosedA(const HybridDynamics<Space>& dynamics,
                                              const GeneralPair& pair) const {
  return PosedOn(dynamics, pair.shape);
}

template <class Space>
PosedShape<Space> ContactModel<Space>::PosedB(const HybridDynamics<Space>& dynamics,
                                              const GeneralPair& pair) const {
  if (pair.other_shape >= 0) return PosedOn(dynamics, pair.other_shape);
  return PosedShape<Space>::Of(obstacles_[static_cast<std::size_t>(pair.obstacle)].shape, {},
                               -dynamics.origin());
}

template <class Space>
typename Space::Wrench ContactModel<Space>::SetForce(Evaluation& e, int shape, int obstacle,
                                                     int other_shape) {
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

template <class Space>
void ContactModel<Space>::DifferentiatePoint(HybridDynamics<Space>& dynamics,
                                             const Evaluation& e) const {
  const Vector& u = e.near.u_d;
  const auto& body_v = dynamics.velocity(e.body);
  const ForceChange change(law_, e);
  typename Space::WrenchMap stiffness;
  typename Space::WrenchMap damping;
  if constexpr (Shape<Space>::kDimension > 2) {
    MapsInSpace(change, body_v, stiffness, damping);
  } else {
    const auto W = Space::ForceAt(e.p, e.F);
    for (std::size_t m = 0; m < Space::kMotions; ++m) {
      const auto S = Space::BasisMotion(m);
      const Vector dc = S.At(e.c);
      const double dd = u.dot(dc);
      Vector dp = dc;
      Vector dF = dd * change.per_d;
      if (e.near.curvature_per_m != 0) {
        const Vector du = e.near.curvature_per_m * (dc - dd * u);
        dp -= e.radius * du;
        dF += change.ByNormal(du);
      }
      dF += change.ByVelocity(Space::At(Space::Cross(S, body_v), e.p) + Space::Cross(body_v.w, dp));
      auto dW = Space::ForceAt(e.p, dF);
      dW.n += Space::Moment(dp, e.F);
      stiffness.columns[m] = dW - Space::Cross(S, W);
      damping.columns[m] = Space::ForceAt(e.p, change.ByVelocity(S.At(e.p)));
    }
  }
  dynamics.AddWrenchDerivative(e.body, stiffness, damping);
}

/// In space the same with less arithmetic. What is carried along with the body cancels out of
/// dW - S x* W: where S turns by w about p, and then moves p by J, there remains
///
///   ForceAt(p, dF - w x F) + (a x F, 0),   dF by dv = w x v_p + w_body x a,
///
/// with the velocity v_p of the body's point at p, and the way a of the point of attack along the
/// body. A basis motion that turns about the origin is one about p, and J = e_m x p.
template <class Space>
template <class Motion, class WrenchMap>
void ContactModel<Space>::MapsInSpace(const ForceChange& change, const Motion& body_v,
                                      WrenchMap& stiffness, WrenchMap& damping) {
  const Evaluation& e = change.e;
  const Vector& u = e.near.u_d;
  const Vector v_p = body_v.At(e.p), to_centre = e.c - e.p;
  const auto turn = [](int m) { return static_cast<std::size_t>(m); };
  const auto slide = [](int m) { return static_cast<std::size_t>(m) + 3; };
  // The cross product of the m-th unit vector, without its products with 0 and 1.
  const auto turned_about = [](int m, const Vector& v) {
    Vector product = Vector::Zero();
    product[(m + 1) % 3] = -v[(m + 2) % 3];
    product[(m + 2) % 3] = v[(m + 1) % 3];
    return product;
  };
  const auto set_columns = [&](auto axis) {
    constexpr int m = axis;
    const Vector along = Vector::Unit(m);
    Vector by_slide = u[m] * change.per_d;
    Vector by_turn = -turned_about(m, e.F);
    Vector attack = turned_about(m, to_centre);
    Vector moment = Vector::Zero();
    if (e.near.curvature_per_m != 0) {
      const auto bent = [&](const Vector& dc) -> Vector {
        return e.near.curvature_per_m * (dc - u.dot(dc) * u - e.near.edge.dot(dc) * e.near.edge);
      };
      const Vector slid = bent(along), turned = bent(attack);
      by_slide +=
          change.ByNormal(slid) - change.ByVelocity(Space::Cross(body_v.w, e.radius * slid));
      moment = Space::Moment(-e.radius * slid, e.F);
      by_turn += change.ByNormal(turned);
      attack -= e.radius * turned;
    }
    by_turn += change.ByVelocity(turned_about(m, v_p) + Space::Cross(body_v.w, attack));
    stiffness.columns[slide(m)] = Space::ForceAt(e.p, by_slide);
    stiffness.columns[slide(m)].n += moment;
    stiffness.columns[turn(m)] = Space::ForceAt(e.p, by_turn);
    stiffness.columns[turn(m)].n += Space::Moment(attack, e.F);
    damping.columns[slide(m)] = Space::ForceAt(e.p, change.ByVelocity(along));
  };
  set_columns(std::integral_constant<int, 0>());
  set_columns(std::integral_constant<int, 1>());
  set_columns(std::integral_constant<int, 2>());
  for (int m = 0; m < 3; ++m) {
    const int next = (m + 1) % 3, last = (m + 2) % 3;
    const auto carried = [&](const WrenchMap& map) {
      return map.columns[slide(last)] * e.p[next] - map.columns[slide(next)] * e.p[last];
    };
    stiffness.columns[turn(m)] = stiffness.columns[turn(m)] + carried(stiffness);
    damping.columns[turn(m)] = carried(damping);
  }
}

/// The same with general near points. The law depends only on the relative motion of the two
/// bodies, so the maps are those of displacing a, or changing its velocity, with b at rest.
template <class Space>
void ContactModel<Space>::DifferentiatePair(HybridDynamics<Space>& dynamics,
                                            const Evaluation& e) const {
  const auto k = static_cast<std::size_t>(e.pair);
  const NearPointsDerivative<Space> near =
      DifferentiateNearPoints(PosedA(dynamics, pairs_[k]), PosedB(dynamics, pairs_[k]), near_[k]);
  const auto& body_v = dynamics.velocity(e.body);
  typename Space::Angular w = body_v.w;
  if (e.other_body >= 0) w -= dynamics.velocity(e.other_body).w;
  const auto W = Space::ForceAt(e.p, e.F);
  const ForceChange change(law_, e);
  typename Space::WrenchMap stiffness;
  typename Space::WrenchMap damping;
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

}  // namespace tumbler
