#pragma once

#include <array>
#include <cstddef>

#include "offline/scene/lane_contact.h"
#include "offline/scene/space_lanes.h"
#include "offline/scene/vectors.h"

namespace tumbler {
inline namespace TUMBLER_LANES_NAMESPACE {

/// x, y, z in lanes.
template <class S>
struct LaneTriple {
  S x, y, z;

  friend LaneTriple operator+(const LaneTriple& a, const LaneTriple& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend LaneTriple operator-(const LaneTriple& a, const LaneTriple& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend LaneTriple operator*(const S& k, const LaneTriple& a) {
    return {k * a.x, k * a.y, k * a.z};
  }
  LaneTriple& operator+=(const LaneTriple& b) { return *this = *this + b; }
  LaneTriple& operator-=(const LaneTriple& b) { return *this = *this - b; }
  [[nodiscard]] S Dot(const LaneTriple& b) const { return x * b.x + y * b.y + z * b.z; }
  [[nodiscard]] LaneTriple Cross(const LaneTriple& b) const {
    return {y * b.z - z * b.y, z * b.x - x * b.z, x * b.y - y * b.x};
  }
};

/// A rotation in lanes, by its columns.
template <class S>
struct LaneRotation {
  using Triple = LaneTriple<S>;
  Triple x, y, z;

  friend Triple operator*(const LaneRotation& R, const Triple& r) {
    return r.x * R.x + r.y * R.y + r.z * R.z;
  }
  [[nodiscard]] Triple Inverse(const Triple& r) const { return {x.Dot(r), y.Dot(r), z.Dot(r)}; }

  /// This rotation, and then one about an axis of its own, by Rodrigues' formula. No branch depends
  /// on the angle.
  [[nodiscard]] LaneRotation Turned(const std::array<double, 3>& axis, const S& angle) const {
    const SineAndCosine<S> turn(angle);
    const S& c = turn.cosine;
    const S& s = turn.sine;
    for (std::size_t kept = 0; kept < 3; ++kept) {
      if (axis[(kept + 1) % 3] == 0 && axis[(kept + 2) % 3] == 0)
        return Keeping(kept, c, axis[kept] > 0 ? s : -s);
    }
    const Triple a{S(axis[0]), S(axis[1]), S(axis[2])};
    const S v = S(1) - c;
    const Triple av = v * a, as = s * a;
    return {*this * Triple{c + av.x * a.x, av.x * a.y + as.z, av.x * a.z - as.y},
            *this * Triple{av.x * a.y - as.z, c + av.y * a.y, av.y * a.z + as.x},
            *this * Triple{av.x * a.z + as.y, av.y * a.z - as.x, c + av.z * a.z}};
  }

 private:
  /// Turned about an axis of coordinates: its column stays, and the others are mixed.
  [[nodiscard]] LaneRotation Keeping(std::size_t axis, const S& c, const S& s) const {
    switch (axis) {
      case 0:
        return {x, c * y + s * z, c * z - s * y};
      case 1:
        return {c * x - s * z, y, c * z + s * x};
      default:
        return {c * x + s * y, c * y - s * x, z};
    }
  }
};

/// A symmetric matrix in lanes.
template <class S>
struct LaneSymmetric {
  S xx, yy, zz, xy, xz, yz;

  LaneSymmetric& operator+=(const LaneSymmetric& b) {
    xx += b.xx;
    yy += b.yy;
    zz += b.zz;
    xy += b.xy;
    xz += b.xz;
    yz += b.yz;
    return *this;
  }
  friend LaneTriple<S> operator*(const LaneSymmetric& a, const LaneTriple<S>& r) {
    return {a.xx * r.x + a.xy * r.y + a.xz * r.z, a.xy * r.x + a.yy * r.y + a.yz * r.z,
            a.xz * r.x + a.yz * r.y + a.zz * r.z};
  }
  /// k (|r|^2 1 - r r^T): the inertia of a point at r.
  static LaneSymmetric OfPoint(const S& k, const LaneTriple<S>& r) {
    const LaneTriple<S> m = k * r;
    const S x2 = m.x * r.x, y2 = m.y * r.y, z2 = m.z * r.z;
    return {y2 + z2, x2 + z2, x2 + y2, -(m.x * r.y), -(m.x * r.z), -(m.y * r.z)};
  }
  friend LaneSymmetric operator-(const LaneSymmetric& a, const LaneSymmetric& b) {
    return {a.xx - b.xx, a.yy - b.yy, a.zz - b.zz, a.xy - b.xy, a.xz - b.xz, a.yz - b.yz};
  }
  /// R a R^T
  [[nodiscard]] LaneSymmetric TurnedBy(const LaneRotation<S>& R) const {
    // The columns of R a.
    const LaneTriple<S> u = xx * R.x + xy * R.y + xz * R.z;
    const LaneTriple<S> v = xy * R.x + yy * R.y + yz * R.z;
    const LaneTriple<S> w = xz * R.x + yz * R.y + zz * R.z;
    return {u.x * R.x.x + v.x * R.y.x + w.x * R.z.x, u.y * R.x.y + v.y * R.y.y + w.y * R.z.y,
            u.z * R.x.z + v.z * R.y.z + w.z * R.z.z, u.x * R.x.y + v.x * R.y.y + w.x * R.z.y,
            u.x * R.x.z + v.x * R.y.z + w.x * R.z.z, u.y * R.x.z + v.y * R.y.z + w.y * R.z.z};
  }
  /// The inverse where it is positive definite, by cofactors.
  [[nodiscard]] LaneSymmetric Inverse() const {
    const S c_xx = yy * zz - yz * yz, c_xy = xz * yz - xy * zz, c_xz = xy * yz - xz * yy;
    const S k = S(1) / (xx * c_xx + xy * c_xy + xz * c_xz);
    return {k * c_xx, k * (xx * zz - xz * xz), k * (xx * yy - xy * xy), k * c_xy,
            k * c_xz, k * (xy * xz - xx * yz)};
  }
  /// Less k u u^T.
  void TakeSquare(const S& k, const LaneTriple<S>& u) {
    const LaneTriple<S> ku = k * u;
    xx -= ku.x * u.x;
    yy -= ku.y * u.y;
    zz -= ku.z * u.z;
    xy -= ku.x * u.y;
    xz -= ku.x * u.z;
    yz -= ku.y * u.z;
  }
};

/// The equations of motion of robots with a floating root in space and revolute joints, with
/// contact of points with half-spaces, for one robot or lanes of a packet of them: what
/// SpaceDynamics computes, in the same coordinates. As in LaneDynamics, no branch depends on a
/// lane's numbers but those that leave out what adds nothing in any.
///
/// Forces are those of Newton and Euler without the accelerations that are looked for. Where joints
/// are prescribed, the root's 6 equations give its acceleration, with composite inertias [F08, ch.
/// 9.3], and the torques follow; where they are driven, accelerations come from articulated
/// inertias [F08, ch. 7.3], outwards. Everything is expressed with world axes about the root's
/// origin, where it is now.
///
/// S is what is computed with, P what the robots' numbers are in, as in LaneDynamics.
///
/// [F08] R. Featherstone, Rigid Body Dynamics Algorithms, 2008.
template <class S, class P = S>
class SpaceLaneDynamics {
 public:
  using Model = SpaceLaneModel;
  using Robot = SpaceLaneRobot<P>;
  using State = SpaceLaneState<S>;
  using StoredState = SpaceLaneState<P>;
  using Numbers = std::array<S, SpaceLaneModel::kMaxDofs>;
  static constexpr std::size_t kRootDofs = SpaceLaneModel::kRootDofs;
  static constexpr bool kHasWorkAndSlip = true;

  /// @param lanes  of the robots, as many as S has.
  SpaceLaneDynamics(const SpaceLaneModel& model, const SpaceLaneRobot<P>& robot,
                    LanesFrom<S> lanes = LanesFrom<S>(0))
      : m_(model), r_(robot), lanes_(lanes), law_(model, robot, lanes) {}

  /// A state of the robots, as it is stored, and back.
  [[nodiscard]] State Taken(const StoredState& stored) const {
    State state{};
    for (std::size_t d = 0; d < m_.joints + kRootDofs; ++d) {
      state.q[d] = lanes_(stored.q[d]);
      state.v[d] = lanes_(stored.v[d]);
    }
    for (std::size_t i = 0; i < state.axes.size(); ++i) state.axes[i] = lanes_(stored.axes[i]);
    return state;
  }
  void Store(const State& state, StoredState& stored) const {
    for (std::size_t d = 0; d < m_.joints + kRootDofs; ++d) {
      lanes_.Put(state.q[d], stored.q[d]);
      lanes_.Put(state.v[d], stored.v[d]);
    }
    for (std::size_t i = 0; i < state.axes.size(); ++i) lanes_.Put(state.axes[i], stored.axes[i]);
  }

  [[nodiscard]] std::size_t joints() const { return m_.joints; }
  /// Calls f(j) for every joint, outwards.
  template <class F>
  void ForEachJoint(const F& f) const {
    for (std::size_t j = 0; j < m_.joints; ++j) f(j);
  }

  /// Accelerations of the root, with those of the joints given in `qdd[6 + i]`; the torques of
  /// their motors come out in `tau[6 + i]`.
  void AcceleratePrescribed(const State& state, Numbers& tau, Numbers& qdd) {
    const Chart chart(state);
    Bodies bodies;
    Move(state, chart, bodies, [&qdd](std::size_t dof) -> const S& { return qdd[dof]; });
    for (std::size_t i = m_.joints; i > 0; --i) {
      const Body& b = bodies[i];
      Body& p = bodies[m_.parent[i]];
      p.f += b.f;
      p.n += b.n;
      p.m += b.m;
      p.h += b.h;
      p.J += b.J;
    }
    // f + m a + alpha x h = 0, n + h x a + J alpha = 0, about the centre of all mass.
    const Body& root = bodies[0];
    const S per_m = S(1) / root.m;
    const Triple n_c = root.n - per_m * root.h.Cross(root.f);
    const Triple alpha = (root.J - Symmetric::OfPoint(per_m, root.h)).Inverse() * (S(-1) * n_c);
    const Triple a = S(-1) * (per_m * (root.f + alpha.Cross(root.h)));
    SetRoot(chart, a, alpha, qdd);
    for (std::size_t i = 1; i <= m_.joints; ++i) {
      const Body& b = bodies[i];
      const auto& joint = r_.joints[i - 1];
      const std::size_t dof = i + kRootDofs - 1;
      const Triple f = b.f + b.m * a + alpha.Cross(b.h);
      const Triple n = b.n + b.h.Cross(a) + b.J * alpha;
      tau[dof] = b.axis.Dot(n - b.p.Cross(f)) + lanes_(joint.rotor_inertia) * qdd[dof] +
                 lanes_(joint.viscous_friction) * state.v[dof];
    }
  }

  /// Accelerations of all degrees of freedom under these torques of the joints (`tau[6 + i]`), and
  /// SpaceLaneRobot::push.
  void Accelerate(const State& state, const Numbers& tau, Numbers& qdd) {
    const Chart chart(state);
    const S none(0);
    Bodies bodies;
    Move(state, chart, bodies, [&none](std::size_t /*dof*/) -> const S& { return none; });
    bodies[0].f -= At(r_.push);
    std::array<Articulated, SpaceLaneModel::kMaxBodies> articulated;
    for (std::size_t i = 0; i <= m_.joints; ++i) articulated[i].Begin(bodies[i]);
    for (std::size_t i = m_.joints; i > 0; --i) {
      const Body& b = bodies[i];
      const auto& joint = r_.joints[i - 1];
      const std::size_t dof = i + kRootDofs - 1;
      Articulated& own = articulated[i];
      own.slide = b.p.Cross(b.axis);
      own.U_n = own.J * b.axis + own.H.Times(own.slide);
      own.U_f = own.H.TransposeTimes(b.axis) + own.M * own.slide;
      own.per_D =
          S(1) / (b.axis.Dot(own.U_n) + own.slide.Dot(own.U_f) + lanes_(joint.rotor_inertia));
      own.u = tau[dof] - lanes_(joint.viscous_friction) * state.v[dof] -
              (b.axis.Dot(b.n) + own.slide.Dot(b.f));
      own.J.TakeSquare(own.per_D, own.U_n);
      own.M.TakeSquare(own.per_D, own.U_f);
      own.H.TakeProduct(own.per_D * own.U_n, own.U_f);
      const S share = own.per_D * own.u;
      const std::size_t above = m_.parent[i];
      bodies[above].n += b.n + share * own.U_n;
      bodies[above].f += b.f + share * own.U_f;
      articulated[above].Add(own);
    }
    // n + J alpha + H a = 0, f + H^T alpha + M a = 0.
    const Articulated& root = articulated[0];
    const Symmetric per_M = root.M.Inverse();
    const Triple alpha = root.H.SchurComplement(root.J, per_M).Inverse() *
                         (root.H.Times(per_M * bodies[0].f) - bodies[0].n);
    const Triple a = S(-1) * (per_M * (bodies[0].f + root.H.TransposeTimes(alpha)));
    SetRoot(chart, a, alpha, qdd);
    bodies[0].alpha = alpha;
    bodies[0].a = a;
    for (std::size_t i = 1; i <= m_.joints; ++i) {
      Body& b = bodies[i];
      const Body& p = bodies[m_.parent[i]];
      const Articulated& own = articulated[i];
      S& rate = qdd[i + kRootDofs - 1];
      rate = own.per_D * (own.u - (own.U_n.Dot(p.alpha) + own.U_f.Dot(p.a)));
      b.alpha = p.alpha + rate * b.axis;
      b.a = p.a + rate * own.slide;
    }
  }

  /// Moves the chart of the root on after a step, as RootChart::MoveOn.
  static void MoveOn(State& state) {
    const Chart chart(state);
    // By a step of Newton's method for the orthogonal factor, R (3 - R^T R) / 2.
    const LaneRotation<S>& R = chart.R;
    const S half(0.5), xy = half * R.x.Dot(R.y), xz = half * R.x.Dot(R.z), yz = half * R.y.Dot(R.z);
    const auto own = [](const Triple& c) { return S(1.5) - S(0.5) * c.Dot(c); };
    const Triple x = own(R.x) * R.x - xy * R.y - xz * R.z;
    const Triple y = own(R.y) * R.y - xy * R.x - yz * R.z;
    const Triple z = own(R.z) * R.z - xz * R.x - yz * R.y;
    state.axes = {x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z};
    const Triple w = R.Inverse(chart.w);
    for (std::size_t i = 3; i < kRootDofs; ++i) state.q[i] = S(0);
    state.v[3] = -w.y;
    state.v[4] = w.x;
    state.v[5] = w.z;
  }

  /// The deepest contact in the last call, in thicknesses of the compliant layer.
  [[nodiscard]] const S& depth() const { return depth_; }
  /// ContactForces::LoadedSlip in the last call [N m/s].
  [[nodiscard]] const S& loaded_slip() const { return loaded_slip_; }

 private:
  using Triple = LaneTriple<S>;
  using Symmetric = LaneSymmetric<S>;

  /// The root's orientation, R0 Rp(a0) Rx(a1) Rz(a2), and how it turns.
  struct Chart {
    explicit Chart(const State& state) {
      const auto& o = state.axes;
      const LaneRotation<S> R0{{o[0], o[3], o[6]}, {o[1], o[4], o[7]}, {o[2], o[5], o[8]}};
      const LaneRotation<S> pitched = R0.Turned({0, -1, 0}, state.q[3]);
      const LaneRotation<S> rolled = pitched.Turned({1, 0, 0}, state.q[4]);
      R = rolled.Turned({0, 0, 1}, state.q[5]);
      pitch_axis = S(-1) * R0.y;
      roll_axis = pitched.x;
      yaw_axis = rolled.z;
      const Triple pitch = state.v[3] * pitch_axis, roll = state.v[4] * roll_axis,
                   yaw = state.v[5] * yaw_axis;
      w = pitch + roll + yaw;
      bias = pitch.Cross(roll) + (pitch + roll).Cross(yaw);
    }
    /// Second derivatives of the angles that give this angular acceleration, less the bias.
    void Accelerations(const Triple& alpha, Numbers& qdd) const {
      const Triple across = roll_axis.Cross(yaw_axis);
      const S per_volume = S(1) / pitch_axis.Dot(across);
      qdd[3] = per_volume * alpha.Dot(across);
      qdd[4] = per_volume * alpha.Dot(yaw_axis.Cross(pitch_axis));
      qdd[5] = per_volume * alpha.Dot(pitch_axis.Cross(roll_axis));
    }
    LaneRotation<S> R;
    Triple pitch_axis, roll_axis, yaw_axis;
    Triple w;     ///< Angular velocity.
    Triple bias;  ///< Angular acceleration while the rates of the angles do not change.
  };

  /// Where a body is and how it moves, what its motion takes, and its inertia.
  struct Body {
    LaneRotation<S> R;
    Triple p;         // origin, relative to the root's
    Triple axis;      // of its joint
    Triple w, v;      // angular velocity, and velocity of the origin
    Triple alpha, a;  // likewise accelerations without those looked for, less gravity
    Triple f, n;      // force and moment that these take, less those of contacts
    S m;              // mass, first and second moment about the root's origin, then composite
    Triple h;
    Symmetric J;
  };

  /// The coupling of moments with accelerations of a point, and of forces with angular ones, by
  /// columns.
  struct Coupling {
    Triple x, y, z;
    [[nodiscard]] Triple Times(const Triple& a) const { return a.x * x + a.y * y + a.z * z; }
    [[nodiscard]] Triple TransposeTimes(const Triple& b) const {
      return {x.Dot(b), y.Dot(b), z.Dot(b)};
    }
    /// Less a b^T.
    void TakeProduct(const Triple& a, const Triple& b) {
      x -= b.x * a;
      y -= b.y * a;
      z -= b.z * a;
    }
    /// J - H per_M H^T
    [[nodiscard]] Symmetric SchurComplement(const Symmetric& J, const Symmetric& per_M) const {
      const Triple u = per_M.xx * x + per_M.xy * y + per_M.xz * z;
      const Triple v = per_M.xy * x + per_M.yy * y + per_M.yz * z;
      const Triple w = per_M.xz * x + per_M.yz * y + per_M.zz * z;
      return J - Symmetric{u.x * x.x + v.x * y.x + w.x * z.x, u.y * x.y + v.y * y.y + w.y * z.y,
                           u.z * x.z + v.z * y.z + w.z * z.z, u.x * x.y + v.x * y.y + w.x * z.y,
                           u.x * x.z + v.x * y.z + w.x * z.z, u.y * x.z + v.y * y.z + w.y * z.z};
    }
  };
  /// The articulated inertia of a body about the root's origin, n = J alpha + H a and f = H^T alpha
  /// + M a, and what its joint makes of it, with the names of [F08, Table 7.1].
  struct Articulated {
    Symmetric J, M;
    Coupling H;
    Triple slide;     // of the body's point at the root's origin, when its joint turns at unit rate
    Triple U_n, U_f;  // moment and force
    S per_D, u;

    void Begin(const Body& b) {
      const S none(0);
      J = b.J;
      M = {b.m, b.m, b.m, none, none, none};
      H = {{none, b.h.z, -b.h.y}, {-b.h.z, none, b.h.x}, {b.h.y, -b.h.x, none}};
    }
    void Add(const Articulated& b) {
      J += b.J;
      M += b.M;
      H.x += b.H.x;
      H.y += b.H.y;
      H.z += b.H.z;
    }
  };
  using Bodies = std::array<Body, SpaceLaneModel::kMaxBodies>;

  [[nodiscard]] Triple At(const typename Robot::Triple& numbers) const {
    return {lanes_(numbers[0]), lanes_(numbers[1]), lanes_(numbers[2])};
  }

  /// Places all bodies, and computes what their motion takes.
  /// @param acceleration  of a degree of freedom of a joint.
  template <class Acceleration>
  void Move(const State& state, const Chart& chart, Bodies& bodies,
            const Acceleration& acceleration) {
    depth_ = loaded_slip_ = S(0);
    Body& root = bodies[0];
    root.R = chart.R;
    root.p = {S(0), S(0), S(0)};
    root.w = chart.w;
    root.v = {state.v[0], state.v[1], state.v[2]};
    root.alpha = chart.bias;
    root.a = S(-1) * At(r_.gravity);
    AddForces(state, 0, root);
    for (std::size_t i = 1; i <= m_.joints; ++i) {
      const Body& p = bodies[m_.parent[i]];
      Body& b = bodies[i];
      const std::size_t dof = i + kRootDofs - 1;
      const Triple axis{S(m_.axis[i][0]), S(m_.axis[i][1]), S(m_.axis[i][2])};
      const Triple d = p.R * At(r_.bodies[i].offset);
      b.R = p.R.Turned(m_.axis[i], state.q[dof]);
      b.p = p.p + d;
      b.axis = p.R * axis;
      const Triple rate = state.v[dof] * b.axis;
      b.w = p.w + rate;
      b.v = p.v + p.w.Cross(d);
      b.alpha = p.alpha + acceleration(dof) * b.axis + p.w.Cross(rate);
      b.a = p.a + p.alpha.Cross(d) + p.w.Cross(p.w.Cross(d));
      AddForces(state, i, b);
    }
  }

  static void SetRoot(const Chart& chart, const Triple& a, const Triple& alpha, Numbers& qdd) {
    qdd[0] = a.x;
    qdd[1] = a.y;
    qdd[2] = a.z;
    chart.Accelerations(alpha, qdd);
  }

  /// What follows from how a body moves.
  void AddForces(const State& state, std::size_t i, Body& b) {
    const auto& own = r_.bodies[i];
    const Symmetric inertia =
        Symmetric{lanes_(own.inertia[0]), lanes_(own.inertia[1]), lanes_(own.inertia[2]),
                  lanes_(own.inertia[3]), lanes_(own.inertia[4]), lanes_(own.inertia[5])}
            .TurnedBy(b.R);
    const Triple g = b.R * At(own.centre);
    const Triple c = b.p + g;
    b.m = lanes_(own.mass);
    b.h = b.m * c;
    b.J = inertia;
    b.J += Symmetric::OfPoint(b.m, c);
    b.f = b.m * (b.a + b.alpha.Cross(g) + b.w.Cross(b.w.Cross(g)));
    b.n = c.Cross(b.f) + inertia * b.alpha + b.w.Cross(inertia * b.w);
    for (std::size_t k = m_.first_point[i]; k < m_.first_point[i + 1]; ++k)
      AddContactForces(state, k, b);
  }

  /// Takes the forces of a point's contacts from those of its body, as in LaneDynamics.
  void AddContactForces(const State& state, std::size_t k, Body& b) {
    const auto& point = r_.points[k];
    const S radius = lanes_(point.radius);
    const Triple p = b.p + b.R * At(point.at);
    const Triple world = p + Triple{state.q[0], state.q[1], state.q[2]};
    for (std::size_t g = 0; g < m_.grounds; ++g) {
      const Triple u = At(r_.grounds[g].normal);
      const S d = u.Dot(world) - lanes_(r_.grounds[g].distance) - radius;
      if (!Any(S(0) < law_.d_on() - d)) continue;
      const S x = law_.d_on() - d;
      const Triple c = p - radius * u;
      const Triple v = b.v + b.w.Cross(c - b.p);
      const S v_d = v.Dot(u);
      // Where a lane is not near, the force is zero: so is its smoothing.
      const S N = NormalForceAt(law_, x, v_d);
      const Triple v_t = v - v_d * u;
      const S s2 = v_t.Dot(v_t);
      const S share = law_.Size(N) * law_.SlipGain(s2);
      const Triple F = N * u - law_.mu() * share * v_t;
      loaded_slip_ += share * s2;
      b.f -= F;
      b.n -= c.Cross(F);
      depth_ = Max(depth_, x * law_.per_d_on());
    }
  }

  const SpaceLaneModel& m_;
  const SpaceLaneRobot<P>& r_;
  LanesFrom<S> lanes_;
  LaneContact<S> law_;
  S depth_, loaded_slip_;
};

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
