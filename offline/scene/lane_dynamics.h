#pragma once

#include <array>
#include <cstddef>

#include "common/core/index.h"
#include "offline/model/shape.h"
#include "offline/scene/lane_contact.h"
#include "offline/scene/lane_robot.h"
#include "offline/scene/lane_tree.h"
#include "offline/scene/vectors.h"

namespace tumbler {
inline namespace TUMBLER_LANES_NAMESPACE {

/// The equations of motion of planar robots with a root that is free in the plane or hinged, and
/// with revolute joints, with contact at
/// points, for one robot or lanes of a packet of them: the physics of `Twin`, in the same
/// coordinates. No branch depends on a lane's numbers, but for those that leave out what adds
/// nothing in any, so a lane gets the bits that it would get alone.
///
///   M(q) qdd + b(q, qd) = tau + sum_c J_c^T f_c
///
/// M is that of composite bodies, factored as L^T D L along the tree's branches [F08, ch. 6.5], and
/// everything is expressed with world axes about the root's origin.
///
/// S is what is computed with, P what the robots' numbers are in: a double, or a packet. They are
/// read where they are. Tree is AnyTree, or the model's own KnownTree.
///
/// [F08] R. Featherstone, Rigid Body Dynamics Algorithms, 2008.
template <class S, class P = S, class Tree = AnyTree>
class LaneDynamics {
 public:
  using Model = LaneModel;
  using Robot = LaneRobot<P>;
  using State = LaneState<S>;
  using StoredState = LaneState<P>;
  using Numbers = std::array<S, LaneModel::kMaxDofs>;
  /// x, z and pitch of the root.
  static constexpr std::size_t kRootDofs = 3;
  /// Whether plans add up the work of motors and the slip under load.
  static constexpr bool kHasWorkAndSlip = false;

  /// @param lanes  of the robots, as many as S has.
  LaneDynamics(const LaneModel& model, const LaneRobot<P>& robot,
               LanesFrom<S> lanes = LanesFrom<S>(0))
      : m_(model), r_(robot), lanes_(lanes), tree_(model), law_(model, robot, lanes) {}

  /// A state of the robots, as it is stored, and back; without what drives see and exert.
  [[nodiscard]] LaneState<S> Taken(const LaneState<P>& stored) const {
    LaneState<S> state{};
    for (std::size_t d = 0; d < m_.joints + kRootDofs; ++d) {
      state.q[d] = lanes_(stored.q[d]);
      state.v[d] = lanes_(stored.v[d]);
    }
    return state;
  }
  void Store(const LaneState<S>& state, LaneState<P>& stored) const {
    for (std::size_t d = 0; d < m_.joints + kRootDofs; ++d) {
      lanes_.Put(state.q[d], stored.q[d]);
      lanes_.Put(state.v[d], stored.v[d]);
    }
  }
  /// How many; known where the tree is.
  [[nodiscard, gnu::always_inline]] std::size_t joints() const { return tree_.joints(); }
  /// Calls f(j) for every joint, outwards.
  template <class F>
  [[gnu::always_inline]] void ForEachJoint(const F& f) const {
    tree_.Outwards([&](auto body) __attribute__((always_inline)) { f(body - 1); });
  }
  /// Nothing: the chart of a root in the plane is the world's (RootChart).
  static void MoveOn(const LaneState<S>& /*state*/) {}

  /// Accelerations of all degrees of freedom under these torques of the joints (`tau[3 + i]`).
  [[gnu::always_inline]] void Accelerate(const LaneState<S>& state, const Numbers& tau,
                                         Numbers& qdd) {
    Bodies bodies;
    Forces forces;
    Inertia M;
    Numbers bias, inverse;
    Kinematics(state, bodies, forces);
    BiasAndInertia(state, bodies, forces, bias, M);
    for (std::size_t i = 0; i < 3; ++i) qdd[i] = -bias[i];
    tree_.Outwards([&](auto i)
                       __attribute__((always_inline)) { qdd[i + 2] = tau[i + 2] - bias[i + 2]; });
    Factor(M, inverse);
    Solve(M, inverse, qdd);
  }

  /// The same with the joints' accelerations given in `qdd[3 + i]`; the torques of their motors
  /// come out in `tau[3 + i]`.
  [[gnu::always_inline]] void AcceleratePrescribed(const LaneState<S>& state, Numbers& tau,
                                                   Numbers& qdd) {
    Bodies bodies;
    Forces forces;
    Inertia M;
    Numbers bias;
    tree_.Outwards([&](auto body) __attribute__((always_inline)) {
      for (std::size_t j = 3; j < body + 2; ++j) M[body + 2][j] = S(0);
    });
    Kinematics(state, bodies, forces);
    BiasAndInertia(state, bodies, forces, bias, M);
    // The root alone is free: 3 equations.
    S b[3];
    for (std::size_t i = 0; i < 3; ++i) {
      b[i] = -bias[i];
      tree_.Outwards([&](auto j)
                         __attribute__((always_inline)) { b[i] -= M[j + 2][i] * qdd[j + 2]; });
    }
    // x and z share the mass and do not couple, so pitch is what is left after them.
    // A bar makes it infinite.
    const S inverse = m_.hinged ? S(0) : S(1) / M[0][0];
    const S left = M[2][2] - (M[2][0] * M[2][0] + M[2][1] * M[2][1]) * inverse;
    qdd[2] = (b[2] - (M[2][0] * b[0] + M[2][1] * b[1]) * inverse) / left;
    qdd[0] = (b[0] - M[2][0] * qdd[2]) * inverse;
    qdd[1] = (b[1] - M[2][1] * qdd[2]) * inverse;
    tree_.Outwards([&](auto body) __attribute__((always_inline)) {
      const std::size_t i = body + 2;
      S sum = bias[i];
      for (std::size_t j = 0; j <= i; ++j) sum += M[i][j] * qdd[j];
      for (std::size_t j = i + 1; j < tree_.joints() + 3; ++j) sum += M[j][i] * qdd[j];
      tau[i] = sum;
    });
  }

  /// The deepest contact in the last call, in thicknesses of the compliant layer.
  [[nodiscard]] const S& depth() const { return depth_; }
  /// The sum of the normal forces in the last call [N].
  [[nodiscard]] const S& normal_force() const { return normal_force_; }

 private:
  /// Where a body is and how it moves.
  struct Body {
    S c, s;          // rotation
    S x, z;          // origin, relative to the root's
    S w, vx, vz;     // angular velocity, and velocity of the origin
    S ax, az;        // acceleration of the origin at qdd = 0, less gravity
    S m, hx, hz, I;  // composite: mass, first and second moment about the root's origin
  };
  /// Force and moment that its acceleration takes, less those of contacts.
  struct Force {
    S fx, fz, n;
  };
  using Bodies = std::array<Body, LaneModel::kMaxBodies>;
  using Forces = std::array<Force, LaneModel::kMaxBodies>;
  using Inertia = std::array<Numbers, LaneModel::kMaxDofs>;

  [[gnu::always_inline]] void Kinematics(const LaneState<S>& state, Bodies& bodies,
                                         Forces& forces) {
    depth_ = S(0);
    normal_force_ = S(0);
    std::array<S, LaneModel::kMaxBodies> angle;
    Body& root = bodies[0];
    angle[0] = state.q[2];
    root.x = root.z = S(0);
    root.w = state.v[2];
    root.vx = state.v[0];
    root.vz = state.v[1];
    root.ax = -lanes_(r_.gravity_x);
    root.az = -lanes_(r_.gravity_z);
    MoveBody(state, 0, angle[0], root, forces[0]);
    tree_.Outwards([&](auto i) __attribute__((always_inline)) {
      const std::size_t above = tree_.parent(i);
      const Body& p = bodies[above];
      Body& b = bodies[i];
      const S offset_x = lanes_(r_.bodies[i].offset_x), offset_z = lanes_(r_.bodies[i].offset_z);
      angle[i] = angle[above] + tree_.AboutAxis(i, state.q[i + 2]);
      const S dx = p.c * offset_x - p.s * offset_z;
      const S dz = p.s * offset_x + p.c * offset_z;
      b.x = p.x + dx;
      b.z = p.z + dz;
      b.w = p.w + tree_.AboutAxis(i, state.v[i + 2]);
      b.vx = p.vx - p.w * dz;
      b.vz = p.vz + p.w * dx;
      const S w2 = p.w * p.w;
      b.ax = p.ax - w2 * dx;
      b.az = p.az - w2 * dz;
      MoveBody(state, i, angle[i], b, forces[i]);
    });
  }

  /// What follows from a body's angle, and from where its origin is and how that moves.
  [[gnu::always_inline]] void MoveBody(const LaneState<S>& state, std::size_t i, const S& angle,
                                       Body& b, Force& force) {
    const auto& own = r_.bodies[i];
    const SineAndCosine<S> trigonometry(angle);
    b.c = trigonometry.cosine;
    b.s = trigonometry.sine;
    const S mass = lanes_(own.mass);
    const S centre_x = lanes_(own.centre_x), centre_z = lanes_(own.centre_z);
    const S gx = b.c * centre_x - b.s * centre_z;
    const S gz = b.s * centre_x + b.c * centre_z;
    const S cx = b.x + gx, cz = b.z + gz;
    b.m = mass;
    b.hx = mass * cx;
    b.hz = mass * cz;
    b.I = lanes_(own.inertia) + mass * (cx * cx + cz * cz);
    const S w2 = b.w * b.w;
    force.fx = mass * (b.ax - w2 * gx);
    force.fz = mass * (b.az - w2 * gz);
    force.n = cx * force.fz - cz * force.fx;
    for (std::size_t k = m_.first_point[i]; k < m_.first_point[i + 1]; ++k)
      AddContactForces(state, k, b, force);
  }

  /// Takes the forces of a point's contacts from those of its body. A point that no lane touches
  /// with costs little, and is left out: its force would be zero.
  [[gnu::always_inline]] void AddContactForces(const LaneState<S>& state, std::size_t k,
                                               const Body& b, Force& force) {
    const auto& point = r_.points[k];
    const S x = lanes_(point.x), z = lanes_(point.z), radius = lanes_(point.radius);
    const S px = b.x + (b.c * x - b.s * z);
    const S pz = b.z + (b.s * x + b.c * z);
    for (std::size_t g = 0; g < m_.grounds; ++g) {
      const auto& ground = r_.grounds[g];
      const S normal_x = lanes_(ground.normal_x), normal_z = lanes_(ground.normal_z);
      const S d = normal_x * (state.q[0] + px) + normal_z * (state.q[1] + pz) -
                  lanes_(ground.distance) - radius;
      if (Any(S(0) < law_.d_on() - d))
        AddContactForce(b, {px, pz, radius, d, normal_x, normal_z}, force);
    }
    for (std::size_t g = 0; g < m_.stones; ++g) {
      const Near near = NearPointOf(r_.stones[g], state, px, pz, radius);
      if (Any(S(0) < law_.d_on() - near.d)) AddContactForce(b, near, force);
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
  [[gnu::noinline]] Near NearPointOf(const typename LaneRobot<P>::Stone& stone,
                                     const LaneState<S>& state, const S& px, const S& pz,
                                     const S& radius) const {
    const S cosine = lanes_(stone.cosine), sine = lanes_(stone.sine);
    const S dx = state.q[0] + px - lanes_(stone.centre_x);
    const S dz = state.q[1] + pz - lanes_(stone.centre_z);
    const S x = cosine * dx + sine * dz;
    const S z = cosine * dz - sine * dx;
    const Pair point{x, z}, half{lanes_(stone.half_x), lanes_(stone.half_z)};
    const Pair from = FromCore<2>(point, half);
    const S length = Sqrt(from[0] * from[0] + from[1] * from[1]);
    const auto outside = S(0) < length;
    const S per_length = S(1) / Select(outside, length, S(1));
    const auto side = NearestSide<2>(point, half);
    const S nx = Select(outside, from[0] * per_length, side.out[0]);
    const S nz = Select(outside, from[1] * per_length, side.out[1]);
    const S d = Select(outside, length, -side.depth) - lanes_(stone.radius) - radius;
    return {px, pz, radius, d, cosine * nx - sine * nz, sine * nx + cosine * nz};
  }

  /// Takes the force of one contact from those of a body.
  [[gnu::always_inline]] void AddContactForce(const Body& b, const Near& near, Force& force) {
    const S x = law_.d_on() - near.d;
    const S cx = near.px - near.radius * near.normal_x;
    const S cz = near.pz - near.radius * near.normal_z;
    const S vx = b.vx - b.w * (cz - b.z);
    const S vz = b.vz + b.w * (cx - b.x);
    const S v_d = vx * near.normal_x + vz * near.normal_z;
    const S v_t = vz * near.normal_x - vx * near.normal_z;
    // Where a lane is not near, the force is zero: so is its smoothing.
    const S N = NormalForceAt(law_, x, v_d);
    const S F = law_.Friction(N, v_t);
    // The tangent is the normal turned by -90 degrees: v_t is along (-normal_z, normal_x).
    const S fx = N * near.normal_x + F * near.normal_z;
    const S fz = N * near.normal_z - F * near.normal_x;
    force.fx -= fx;
    force.fz -= fz;
    force.n -= cx * fz - cz * fx;
    depth_ = Max(depth_, x * law_.per_d_on());
    normal_force_ += N;
  }

  /// The forces at qdd = 0, and the joint-space inertia: of the rows of its lower triangle, what
  /// couples a joint with the root and the joints that carry it.
  [[gnu::always_inline]] void BiasAndInertia(const LaneState<S>& state, Bodies& bodies,
                                             Forces& forces, Numbers& bias, Inertia& M) {
    tree_.Inwards([&](auto i) __attribute__((always_inline)) {
      const Body& b = bodies[i];
      const Force& force = forces[i];
      const auto& joint = r_.joints[i - 1];
      const std::size_t row = i + 2;
      bias[row] = tree_.AboutAxis(i, force.n - (b.x * force.fz - b.z * force.fx)) +
                  lanes_(joint.viscous_friction) * state.v[row];
      // The composite turns about its joint at unit rate: momentum, and its moment about the root's
      // origin.
      const S Px = tree_.AboutAxis(i, b.m * b.z - b.hz);
      const S Pz = tree_.AboutAxis(i, b.hx - b.m * b.x);
      const S L = tree_.AboutAxis(i, b.I - (b.hx * b.x + b.hz * b.z));
      M[row][0] = Px;
      M[row][1] = Pz;
      M[row][2] = L;
      tree_.UpFrom(
          i, [&](auto a) __attribute__((always_inline)) {
            const Body& above = bodies[a];
            M[row][a + 2] = tree_.AboutAxis(a, L - (above.x * Pz - above.z * Px));
          });
      M[row][row] += lanes_(joint.rotor_inertia);
      Body& p = bodies[tree_.parent(i)];
      Force& carried = forces[tree_.parent(i)];
      p.m += b.m;
      p.hx += b.hx;
      p.hz += b.hz;
      p.I += b.I;
      carried.fx += force.fx;
      carried.fz += force.fz;
      carried.n += force.n;
    });
    const Body& root = bodies[0];
    bias[0] = forces[0].fx;
    bias[1] = forces[0].fz;
    bias[2] = forces[0].n + lanes_(r_.bar_friction) * state.v[2];
    M[0][0] = M[1][1] = root.m;
    M[1][0] = S(0);
    M[2][0] = -root.hz;
    M[2][1] = root.hx;
    M[2][2] = root.I;
  }

  /// Calls f(dof) for the degrees of freedom that carry that of a body's joint, from the next one
  /// on: those of the bodies that carry it, and the root's pitch, z and x.
  template <class Body, class F>
  [[gnu::always_inline]] void Carriers(Body body, const F& f) const {
    tree_.UpFrom(
        body, [&](auto a) __attribute__((always_inline)) {
          if (a != body) f(a + 2);
        });
    f(2);
    f(1);
    f(0);
  }

  /// M = L^T D L: rows of M then hold L, and `inverse` the inverse of D.
  [[gnu::always_inline]] void Factor(Inertia& M, Numbers& inverse) const {
    tree_.Inwards([&](auto body) __attribute__((always_inline)) {
      const std::size_t k = body + 2;
      inverse[k] = S(1) / M[k][k];
      tree_.UpFrom(
          body, [&](auto above) __attribute__((always_inline)) {
            if (above == body) return;
            const S a = M[k][above + 2] * inverse[k];
            M[above + 2][above + 2] -= M[k][above + 2] * a;
            Carriers(
                above, [&](std::size_t j)
                           __attribute__((always_inline)) { M[above + 2][j] -= M[k][j] * a; });
            M[k][above + 2] = a;
          });
      for (std::size_t i = 3; i-- > 0;) {
        const S a = M[k][i] * inverse[k];
        for (std::size_t j = i + 1; j-- > 0;) M[i][j] -= M[k][j] * a;
        M[k][i] = a;
      }
    });
    for (std::size_t k = 3; k-- > 0;) {
      inverse[k] = m_.hinged && k < 2 ? S(0) : S(1) / M[k][k];  // A bar does not move.
      for (std::size_t i = k; i-- > 0;) {
        const S a = M[k][i] * inverse[k];
        for (std::size_t j = i + 1; j-- > 0;) M[i][j] -= M[k][j] * a;
        M[k][i] = a;
      }
    }
  }

  /// @param x  the right side, and then the solution.
  [[gnu::always_inline]] void Solve(const Inertia& M, const Numbers& inverse, Numbers& x) const {
    tree_.Inwards([&](auto body) __attribute__((always_inline)) {
      const std::size_t k = body + 2;
      Carriers(
          body, [&](std::size_t i) __attribute__((always_inline)) { x[i] -= M[k][i] * x[k]; });
    });
    for (std::size_t k = 3; k-- > 0;)
      for (std::size_t i = k; i-- > 0;) x[i] -= M[k][i] * x[k];
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = x[k] * inverse[k];
      for (std::size_t i = k; i-- > 0;) x[k] -= M[k][i] * x[i];
    }
    tree_.Outwards([&](auto body) __attribute__((always_inline)) {
      const std::size_t k = body + 2;
      x[k] = x[k] * inverse[k];
      Carriers(
          body, [&](std::size_t i) __attribute__((always_inline)) { x[k] -= M[k][i] * x[i]; });
    });
  }

  const LaneModel& m_;
  const LaneRobot<P>& r_;
  LanesFrom<S> lanes_;
  Tree tree_;
  LaneContact<S> law_;
  S depth_, normal_force_;
};

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
