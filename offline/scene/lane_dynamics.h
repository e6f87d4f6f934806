#pragma once

#include <array>
#include <cstddef>

#include "common/core/index.h"
#include "offline/model/shape.h"
#include "offline/scene/lane_contact.h"
#include "offline/scene/lane_robot.h"
#include "offline/scene/vectors.h"

namespace tumbler {
inline namespace TUMBLER_LANES_NAMESPACE {

/// The equations of motion of planar robots with a root that is free in the plane or hinged, and
/// with revolute joints, with contact at
/// points, for one robot or a packet of them: the physics of `Twin`, in the same coordinates. No
/// branch depends on a lane's numbers, so a lane gets the bits that it would get alone.
///
///   M(q) qdd + b(q, qd) = tau + sum_c J_c^T f_c
///
/// M is that of composite bodies, factored as L^T D L along the tree's branches [F08, ch. 6.5], and
/// everything is expressed with world axes about the root's origin.
///
/// [F08] R. Featherstone, Rigid Body Dynamics Algorithms, 2008.
template <class S>
class LaneDynamics {
 public:
  using Numbers = std::array<S, LaneModel::kMaxDofs>;

  LaneDynamics(const LaneModel& model, const LaneRobot<S>& robot)
      : m_(model), r_(robot), law_(model, robot), per_d_on_(S(1) / robot.d_on) {}

  /// Accelerations of all degrees of freedom under these torques of the joints (`tau[3 + i]`).
  void Accelerate(const LaneState<S>& state, const Numbers& tau, Numbers& qdd) {
    Kinematics(state);
    ContactForces(state);
    BiasAndInertia(state);
    Numbers right;
    for (std::size_t i = 0; i < 3; ++i) right[i] = -bias_[i];
    for (std::size_t i = 3; i < dofs(); ++i) right[i] = tau[i] - bias_[i];
    Factor();
    Solve(right, qdd);
  }

  /// The same with the joints' accelerations given in `qdd[3 + i]`; the torques of their motors
  /// come out in `tau[3 + i]`.
  void AcceleratePrescribed(const LaneState<S>& state, Numbers& tau, Numbers& qdd) {
    Kinematics(state);
    ContactForces(state);
    BiasAndInertia(state);
    // The root alone is free: 3 equations.
    const auto& M = M_;
    S b[3];
    for (std::size_t i = 0; i < 3; ++i) {
      b[i] = -bias_[i];
      for (std::size_t j = 3; j < dofs(); ++j) b[i] -= M[j][i] * qdd[j];
    }
    // x and z share the mass and do not couple, so pitch is what is left after them.
    // A bar makes it infinite.
    const S inverse = m_.hinged ? S(0) : S(1) / M[0][0];
    const S left = M[2][2] - (M[2][0] * M[2][0] + M[2][1] * M[2][1]) * inverse;
    qdd[2] = (b[2] - (M[2][0] * b[0] + M[2][1] * b[1]) * inverse) / left;
    qdd[0] = (b[0] - M[2][0] * qdd[2]) * inverse;
    qdd[1] = (b[1] - M[2][1] * qdd[2]) * inverse;
    for (std::size_t i = 3; i < dofs(); ++i) {
      S sum = bias_[i];
      for (std::size_t j = 0; j <= i; ++j) sum += M[i][j] * qdd[j];
      for (std::size_t j = i + 1; j < dofs(); ++j) sum += M[j][i] * qdd[j];
      tau[i] = sum;
    }
  }

  /// The deepest contact in the last call, in thicknesses of the compliant layer.
  [[nodiscard]] const S& depth() const { return depth_; }
  /// The sum of the normal forces in the last call [N].
  [[nodiscard]] const S& normal_force() const { return normal_force_; }

 private:
  struct Body {
    S c, s;          // rotation
    S x, z;          // origin, relative to the root's
    S w, vx, vz;     // angular velocity, and velocity of the origin
    S ax, az;        // acceleration of the origin at qdd = 0, less gravity
    S m, hx, hz, I;  // composite: mass, first and second moment about the root's origin
    S fx, fz, n;     // force and moment that its acceleration takes, less those of contacts
  };

  [[nodiscard]] std::size_t dofs() const { return m_.joints + 3; }

  void Kinematics(const LaneState<S>& state) {
    std::array<S, LaneModel::kMaxBodies> angle;
    for (std::size_t i = 0; i <= m_.joints; ++i) {
      Body& b = bodies_[i];
      const auto& own = r_.bodies[i];
      if (i == 0) {
        angle[0] = state.q[2];
        b.x = b.z = S(0);
        b.w = state.v[2];
        b.vx = state.v[0];
        b.vz = state.v[1];
        b.ax = -r_.gravity_x;
        b.az = -r_.gravity_z;
      } else {
        const Body& p = bodies_[m_.parent[i]];
        const S axis(m_.axis[i]);
        angle[i] = angle[m_.parent[i]] + axis * state.q[i + 2];
        const S dx = p.c * own.offset_x - p.s * own.offset_z;
        const S dz = p.s * own.offset_x + p.c * own.offset_z;
        b.x = p.x + dx;
        b.z = p.z + dz;
        b.w = p.w + axis * state.v[i + 2];
        b.vx = p.vx - p.w * dz;
        b.vz = p.vz + p.w * dx;
        const S w2 = p.w * p.w;
        b.ax = p.ax - w2 * dx;
        b.az = p.az - w2 * dz;
      }
      const SineAndCosine<S> trigonometry(angle[i]);
      b.c = trigonometry.cosine;
      b.s = trigonometry.sine;
      const S gx = b.c * own.centre_x - b.s * own.centre_z;
      const S gz = b.s * own.centre_x + b.c * own.centre_z;
      const S cx = b.x + gx, cz = b.z + gz;
      b.m = own.mass;
      b.hx = own.mass * cx;
      b.hz = own.mass * cz;
      b.I = own.inertia + own.mass * (cx * cx + cz * cz);
      const S w2 = b.w * b.w;
      b.fx = own.mass * (b.ax - w2 * gx);
      b.fz = own.mass * (b.az - w2 * gz);
      b.n = cx * b.fz - cz * b.fx;
    }
  }

  /// Takes the forces of contacts from those of the bodies. Points that no lane touches with cost
  /// little, and are left out: their force would be zero. Never inline: registers would be short.
  [[gnu::noinline]] void ContactForces(const LaneState<S>& state) {
    depth_ = S(0);
    normal_force_ = S(0);
    for (std::size_t k = 0; k < m_.points; ++k) {
      Body& b = bodies_[m_.point_body[k]];
      const auto& point = r_.points[k];
      const S px = b.x + (b.c * point.x - b.s * point.z);
      const S pz = b.z + (b.s * point.x + b.c * point.z);
      for (std::size_t g = 0; g < m_.grounds; ++g) {
        const auto& ground = r_.grounds[g];
        const S d = ground.normal_x * (state.q[0] + px) + ground.normal_z * (state.q[1] + pz) -
                    ground.distance - point.radius;
        AddContactForce(b, {px, pz, point.radius, d, ground.normal_x, ground.normal_z});
      }
      for (std::size_t g = 0; g < m_.stones; ++g)
        AddContactForce(b, NearPointOf(r_.stones[g], state, px, pz, point.radius));
    }
  }

  /// A point with a radius that is near an obstacle.
  struct Near {
    S px, pz, radius;  ///< The point, relative to the root's origin.
    S d;               ///< Distance between the surfaces.
    S normal_x, normal_z;
  };

  using Pair = IntArray<S, 2>;

  /// As FindNearPointOfCore (model/shape.h).
  Near NearPointOf(const typename LaneRobot<S>::Stone& stone, const LaneState<S>& state,
                   const S& px, const S& pz, const S& radius) const {
    const S dx = state.q[0] + px - stone.centre_x;
    const S dz = state.q[1] + pz - stone.centre_z;
    const S x = stone.cosine * dx + stone.sine * dz;
    const S z = stone.cosine * dz - stone.sine * dx;
    const Pair point{x, z}, half{stone.half_x, stone.half_z};
    const Pair from = FromCore<2>(point, half);
    const S length = Sqrt(from[0] * from[0] + from[1] * from[1]);
    const auto outside = S(0) < length;
    const S per_length = S(1) / Select(outside, length, S(1));
    const auto side = NearestSide<2>(point, half);
    const S nx = Select(outside, from[0] * per_length, side.out[0]);
    const S nz = Select(outside, from[1] * per_length, side.out[1]);
    const S d = Select(outside, length, -side.depth) - stone.radius - radius;
    return {px,
            pz,
            radius,
            d,
            stone.cosine * nx - stone.sine * nz,
            stone.sine * nx + stone.cosine * nz};
  }

  /// Takes the force of one contact from those of a body.
  void AddContactForce(Body& b, const Near& near) {
    const S x = r_.d_on - near.d;
    if (!Any(S(0) < x)) return;
    const S cx = near.px - near.radius * near.normal_x;
    const S cz = near.pz - near.radius * near.normal_z;
    const S vx = b.vx - b.w * (cz - b.z);
    const S vz = b.vz + b.w * (cx - b.x);
    const S v_d = vx * near.normal_x + vz * near.normal_z;
    const S v_t = vz * near.normal_x - vx * near.normal_z;
    const S N = NormalForceAt(law_, x, v_d);
    const S F = law_.Friction(N, v_t);
    // The tangent is the normal turned by -90 degrees: v_t is along (-normal_z, normal_x).
    const S fx = N * near.normal_x + F * near.normal_z;
    const S fz = N * near.normal_z - F * near.normal_x;
    b.fx -= fx;
    b.fz -= fz;
    b.n -= cx * fz - cz * fx;
    depth_ = Max(depth_, x * per_d_on_);
    normal_force_ += N;
  }

  /// The forces at qdd = 0, and the joint-space inertia, of which the rows of the lower triangle
  /// are written.
  void BiasAndInertia(const LaneState<S>& state) {
    for (std::size_t i = m_.joints; i > 0; --i) {
      const Body& b = bodies_[i];
      const S axis(m_.axis[i]);
      const auto& joint = r_.joints[i - 1];
      const std::size_t row = i + 2;
      bias_[row] = axis * (b.n - (b.x * b.fz - b.z * b.fx)) + joint.viscous_friction * state.v[row];
      // The composite turns about its joint at unit rate: momentum, and its moment about the root's
      // origin.
      const S Px = axis * (b.m * b.z - b.hz);
      const S Pz = axis * (b.hx - b.m * b.x);
      const S L = axis * (b.I - (b.hx * b.x + b.hz * b.z));
      for (std::size_t j = 0; j < row; ++j) M_[row][j] = S(0);
      M_[row][0] = Px;
      M_[row][1] = Pz;
      M_[row][2] = L;
      for (std::size_t a = i; a > 0; a = m_.parent[a]) {
        const Body& above = bodies_[a];
        M_[row][a + 2] = S(m_.axis[a]) * (L - (above.x * Pz - above.z * Px));
      }
      M_[row][row] += joint.rotor_inertia;
      Body& p = bodies_[m_.parent[i]];
      p.m += b.m;
      p.hx += b.hx;
      p.hz += b.hz;
      p.I += b.I;
      p.fx += b.fx;
      p.fz += b.fz;
      p.n += b.n;
    }
    const Body& root = bodies_[0];
    bias_[0] = root.fx;
    bias_[1] = root.fz;
    bias_[2] = root.n + r_.bar_friction * state.v[2];
    M_[0][0] = M_[1][1] = root.m;
    M_[1][0] = S(0);
    M_[2][0] = -root.hz;
    M_[2][1] = root.hx;
    M_[2][2] = root.I;
  }

  /// The degree of freedom that carries `dof`, or `dof` itself for the first.
  [[nodiscard]] std::size_t Carrier(std::size_t dof) const {
    if (dof < 3) return dof == 0 ? 0 : dof - 1;
    return m_.parent[dof - 2] + 2;
  }

  /// M = L^T D L: rows of M_ then hold L, and inverse_ the inverse of D.
  void Factor() {
    for (std::size_t k = dofs(); k-- > 0;) {
      inverse_[k] = m_.hinged && k < 2 ? S(0) : S(1) / M_[k][k];  // A bar does not move.
      for (std::size_t i = Carrier(k), below = k; i != below; below = i, i = Carrier(i)) {
        const S a = M_[k][i] * inverse_[k];
        for (std::size_t j = i, last = k; j != last; last = j, j = Carrier(j))
          M_[i][j] -= M_[k][j] * a;
        M_[k][i] = a;
      }
    }
  }

  void Solve(const Numbers& right, Numbers& x) const {
    for (std::size_t i = 0; i < dofs(); ++i) x[i] = right[i];
    for (std::size_t k = dofs(); k-- > 0;) {
      for (std::size_t i = Carrier(k), below = k; i != below; below = i, i = Carrier(i))
        x[i] -= M_[k][i] * x[k];
    }
    for (std::size_t k = 0; k < dofs(); ++k) {
      x[k] = x[k] * inverse_[k];
      for (std::size_t i = Carrier(k), below = k; i != below; below = i, i = Carrier(i))
        x[k] -= M_[k][i] * x[i];
    }
  }

  const LaneModel& m_;
  const LaneRobot<S>& r_;
  LaneContact<S> law_;
  S per_d_on_;
  std::array<Body, LaneModel::kMaxBodies> bodies_;
  std::array<Numbers, LaneModel::kMaxDofs> M_;
  Numbers bias_, inverse_;
  S depth_, normal_force_;
};

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
