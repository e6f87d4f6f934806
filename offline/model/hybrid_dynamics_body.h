#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "offline/model/hybrid_dynamics.h"

/// Bodies of the functions, for the sources that compile them for one algebra each.

namespace tumbler {

template <class Space>
HybridDynamics<Space>::HybridDynamics(const Tree<Space>& tree)
    : n_(static_cast<int>(tree.dofs.size())), first_body_(n_ - 1), gravity_(tree.gravity) {
  free_index_.fill(-1);
  for (auto& row : M_) row.fill(0);
  for (int j = 0; j < n_; ++j) {
    const Dof<Space>& dof = tree.dofs[Index(j)];
    joints_[j] = {dof.parent,
                  dof.kind,
                  dof.prescribed,
                  dof.massless,
                  dof.axis,
                  dof.direction,
                  dof.offset,
                  dof.mass_centre,
                  dof.mass_kg,
                  dof.inertia_kg_m2,
                  dof.rotor_inertia_kg_m2,
                  dof.damping_nm_s_per_rad};
    if (dof.kind == JointKind::kRevolute) bodies_[j].turn = typename Space::Turn(dof.axis, 0);
    if (!dof.massless && j < first_body_) first_body_ = j;
    if (slides_ == j && dof.massless && dof.kind == JointKind::kPrismatic && dof.parent == j - 1) {
      ++slides_;
      bodies_[j].S.v = dof.direction;
    }
    if (!dof.prescribed) {
      free_index_[j] = free_count_;
      free_[free_count_++] = j;
    } else {
      prescribed_[prescribed_count_++] = j;
    }
  }
  IntArray<std::uint32_t, kMaxDofs> related{};  // bits of degrees of freedom
  for (int j = 0; j < n_; ++j) {
    for (int i = j; i >= 0; i = joints_[i].parent) {
      related[j] |= 1U << i;
      related[i] |= 1U << j;
    }
  }
  for (int j = 0; j < n_; ++j) {
    for (int i = 0; i < n_; ++i) {
      if ((related[j] >> i & 1U) != 0) continue;
      const bool goes_on =
          !unrelated_.empty() && unrelated_.back().row == j && unrelated_.back().end == i;
      if (!goes_on) unrelated_.push_back({j, i, i});
      ++unrelated_.back().end;
    }
  }
}

template <class Space>
void HybridDynamics<Space>::SetState(std::span<const double> positions,
                                     std::span<const double> velocities) {
  const double* const q = positions.data();
  const double* const qd = velocities.data();
  touched_ = 0;
  any_pair_ = false;
  // Positions are found in world coordinates first. From then on the origin is that of the first
  // body's frame.
  Vector slid = Vector::Zero();
  for (int j = 0; j < slides_; ++j) {
    slid += joints_[j].offset + joints_[j].direction * q[j];
    bodies_[j].p = slid;
  }
  const Rotation world_R;
  const Vector world_p = Vector::Zero();
  for (int j = slides_; j < n_; ++j) {
    const Joint& joint = joints_[j];
    Body& body = bodies_[j];
    const Rotation& R = joint.parent >= 0 ? bodies_[joint.parent].R : world_R;
    const Vector& p = joint.parent >= 0 ? bodies_[joint.parent].p : world_p;
    if (joint.kind == JointKind::kRevolute) {
      // Stages of a step at the same time have the same angles on the joints' paths.
      const auto angle = std::bit_cast<std::uint64_t>(q[j]);
      if (angle != body.angle_of_turn) {
        body.angle_of_turn = angle;
        body.turn = typename Space::Turn(joint.axis, q[j]);
      }
      body.p = p + R * joint.offset;
      body.R = R * body.turn;
    } else {
      body.R = R;
      body.p = p + R * (joint.offset + joint.direction * q[j]);
    }
  }
  origin_ = bodies_[first_body_].p;
  Motion slide;
  for (int j = 0; j < slides_; ++j) {
    Body& body = bodies_[j];
    body.p -= origin_;
    body.qd = qd[j];
    slide.v += body.S.v * body.qd;
    body.v = slide;
    body.external = {};
  }
  for (int j = slides_; j < n_; ++j) {
    const Joint& joint = joints_[j];
    Body& body = bodies_[j];
    body.p -= origin_;
    const Motion parent_v = joint.parent >= 0 ? bodies_[joint.parent].v : Motion{};
    if (joint.kind == JointKind::kRevolute) {
      body.S = Space::RevoluteMotion(body.R, joint.axis, body.p);
    } else {
      body.S = {};
      body.S.v = body.R * joint.direction;
    }
    body.S_rate = Space::Cross(parent_v, body.S);
    body.qd = qd[j];
    body.v = parent_v + body.S * body.qd;
    body.external = {};
    if (!joint.massless) {
      body.own = Space::Inertia::OfBody(joint.mass, body.p + body.R * joint.mass_centre, body.R,
                                        joint.inertia);
      body.momentum = body.own * body.v;
    }
  }
}

template <class Space>
void HybridDynamics<Space>::Solve(std::span<double> accelerations, std::span<double> torques) {
  double* const qdd = accelerations.data();
  double* const tau = torques.data();
  // Inverse dynamics with the unknown accelerations set to zero.
  Motion base;
  base.v = -gravity_;
  Motion slide = base;
  for (int j = 0; j < slides_; ++j) {
    Body& body = bodies_[j];
    if (joints_[j].prescribed) slide.v += body.S.v * qdd[j];
    body.a = slide;
    body.composite = {};
    body.force = body.external * -1.0;
  }
  for (int j = slides_; j < n_; ++j) {
    const Joint& joint = joints_[j];
    Body& body = bodies_[j];
    const Motion& parent_a = joint.parent >= 0 ? bodies_[joint.parent].a : base;
    body.a = parent_a + body.S_rate * body.qd;
    if (joint.prescribed) body.a = body.a + body.S * qdd[j];
    if (joint.massless) {
      body.composite = {};
      body.force = body.external * -1.0;
    } else {
      body.composite = body.own;
      body.turned = Space::Cross(body.v, body.momentum);
      body.force = body.own * body.a + body.turned - body.external;
    }
  }
  IntArray<double, kMaxDofs> rest;  // tau at free qdd = 0
  for (int j = n_ - 1; j >= slides_; --j) {
    Body& body = bodies_[j];
    const Joint& joint = joints_[j];
    rest[j] = Space::Dot(body.S, body.force) + joint.damping * body.qd;
    if (joint.prescribed) rest[j] += joint.rotor_inertia * qdd[j];
    const Wrench composite_S = body.composite * body.S;
    body.composite_S = composite_S;
    auto& row = M_[j];
    row[j] = Space::Dot(body.S, composite_S) + joint.rotor_inertia;
    int i = joint.parent;
    for (; i >= slides_; i = joints_[i].parent)
      row[i] = M_[i][j] = Space::Dot(bodies_[i].S, composite_S);
    for (; i >= 0; --i) row[i] = M_[i][j] = bodies_[i].S.v.dot(composite_S.f);
    if (joint.parent >= 0) {
      Body& parent = bodies_[joint.parent];
      parent.composite = parent.composite + body.composite;
      parent.force = parent.force + body.force;
    }
  }
  // The root's translations move the whole mass as one, so no moments are needed.
  for (int j = slides_ - 1; j >= 0; --j) {
    const Body& body = bodies_[j];
    const Joint& joint = joints_[j];
    const Vector& direction = body.S.v;
    rest[j] = direction.dot(body.force.f) + joint.damping * body.qd;
    if (joint.prescribed) rest[j] += joint.rotor_inertia * qdd[j];
    const Vector momentum = body.composite.m * direction;
    auto& row = M_[j];
    row[j] = direction.dot(momentum) + joint.rotor_inertia;
    for (int i = 0; i < j; ++i) row[i] = M_[i][j] = bodies_[i].S.v.dot(momentum);
    if (j == 0) continue;
    bodies_[j - 1].composite.m += body.composite.m;
    bodies_[j - 1].force = bodies_[j - 1].force + body.force;
  }
  IntArray<double, kMaxDofs> x;
  WithFreeCount([&](auto count) {
    FactorFreeInertia(count);
    for (int i = 0; i < count; ++i) x[i] = tau[free_[i]] - rest[free_[i]];
    SolveFree(count, x.data());
    for (int i = 0; i < count; ++i) qdd[free_[i]] = x[i];
    for (int j = 0; j < n_; ++j) {
      bodies_[j].qdd = qdd[j];
      if (!joints_[j].prescribed) continue;
      double sum = rest[j];
      for (int i = 0; i < count; ++i) sum += M_[j][free_[i]] * x[i];
      tau[j] = sum;
    }
  });
}

template <class Space>
void HybridDynamics<Space>::Respond(std::span<const double> torques, std::span<double> qdd) const {
  IntArray<double, kMaxDofs> x;
  WithFreeCount([&](auto count) {
    for (int i = 0; i < count; ++i) x[i] = torques[Index(free_[i])];
    SolveFree(count, x.data());
    for (int i = 0; i < count; ++i) qdd[Index(free_[i])] = x[i];
  });
}

template <class Space>
template <class Count>
void HybridDynamics<Space>::FactorFreeInertia(Count count) {
  for (int i = 0; i < count; ++i) {
    const auto& row = M_[free_[i]];
    for (int k = 0; k <= i; ++k) {
      double sum = row[free_[k]];
      for (int m = 0; m < k; ++m) sum -= L_[i][m] * L_[k][m];
      L_[i][k] = i == k ? 1 / std::sqrt(sum) : sum * L_[k][k];
    }
  }
}

template <class Space>
template <class Count>
void HybridDynamics<Space>::SolveFree(Count count, double* x) const {
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < i; ++k) x[i] -= L_[i][k] * x[k];
    x[i] *= L_[i][i];
  }
  for (int i = count - 1; i >= 0; --i) {
    for (int k = i + 1; k < count; ++k) x[i] -= L_[k][i] * x[k];
    x[i] *= L_[i][i];
  }
}

/// Psi-dot and Psi-double-dot of [SRW22] are S_rate and S_rate2.
template <class Space>
void HybridDynamics<Space>::MoveBodiesAtSolution() {
  Motion base;
  base.v = -gravity_;
  Motion slide = base;
  for (int j = 0; j < slides_; ++j) {
    slide.v += bodies_[j].S.v * bodies_[j].qdd;
    bodies_[j].a = slide;
  }
  for (int j = slides_; j < n_; ++j) {
    const Joint& joint = joints_[j];
    Body& body = bodies_[j];
    if (joint.parent < 0) {
      body.S_rate2 = Space::Cross(base, body.S);
      body.a = base + body.S * body.qdd;
    } else {
      const Body& parent = bodies_[joint.parent];
      body.S_rate2 = Space::Cross(parent.a, body.S) + Space::Cross(parent.v, body.S_rate);
      body.a = parent.a + body.S_rate * body.qd + body.S * body.qdd;
    }
    if (joint.massless) {
      body.bias = {};
      body.force = body.external * -1.0;
    } else {
      body.bias = Space::Bias::OfBody(body.own, body.v, body.momentum);
      body.force = body.own * body.a + body.turned - body.external;
    }
  }
}

template <class Space>
void HybridDynamics<Space>::DifferentiateInverse(typename Derivatives::Block& d_q,
                                                 typename Derivatives::Block& d_qd) {
  MoveBodiesAtSolution();
  for (const auto& [row, begin, end] : unrelated_) {
    for (int i = begin; i < end; ++i) d_q[row][i] = d_qd[row][i] = 0;
  }
  // [SRW22, Eqs. 34-37], where the composite of the wrenches' derivatives joins that of the bias.
  Contacts contacts{};
  for (std::uint32_t touched = touched_; touched != 0; touched &= touched - 1) {
    const int j = std::countr_zero(touched);
    contacts[j] = &bodies_[j].wrench_derivative;
  }
  for (int j = n_ - 1; j >= slides_; --j) {
    const Body& body = bodies_[j];
    const int up = joints_[j].parent;
    const WrenchDerivative* const w = contacts[j];
    Wrench by_q = body.composite * body.S_rate2 + Space::BiasOfRate(body.bias, body.S_rate) +
                  Space::Cross(body.S, body.force);
    Wrench by_qd = body.bias * body.S + body.composite * (body.S_rate * 2.0);
    if (w != nullptr) {
      by_q = by_q - (w->stiffness * body.S + w->damping * body.S_rate);
      by_qd = by_qd - w->damping * body.S;
    }
    d_q[j][j] = Space::Dot(body.S, by_q);
    d_qd[j][j] = Space::Dot(body.S, by_qd) + joints_[j].damping;
    if (up < 0) continue;
    const auto z = body.bias.TransposeTimes(body.S);
    int i = up;
    for (; i >= slides_; i = joints_[i].parent) {
      const Body& above = bodies_[i];
      d_q[i][j] = Space::Dot(above.S, by_q);
      d_qd[i][j] = Space::Dot(above.S, by_qd);
      d_q[j][i] = Space::Dot(above.S_rate2, body.composite_S) + Space::Apply(z, above.S_rate);
      d_qd[j][i] = Space::Apply(z, above.S) + 2 * Space::Dot(above.S_rate, body.composite_S);
    }
    for (; i >= 0; --i) {
      const Vector& direction = bodies_[i].S.v;
      d_q[i][j] = direction.dot(by_q.f);
      d_qd[i][j] = direction.dot(by_qd.f);
      d_q[j][i] = d_qd[j][i] = 0;
    }
    Body& parent = bodies_[up];
    if (up >= slides_) {
      parent.bias = parent.bias + body.bias;
      parent.force = parent.force + body.force;
    }
    if (w == nullptr) continue;
    const Wrench k = w->stiffness.TransposeTimes(body.S);
    const Wrench d = w->damping.TransposeTimes(body.S);
    for (i = up; i >= slides_; i = joints_[i].parent) {
      const Body& above = bodies_[i];
      d_q[j][i] -= Space::Dot(above.S, k) + Space::Dot(above.S_rate, d);
      d_qd[j][i] -= Space::Dot(above.S, d);
    }
    for (; i >= 0; --i) {
      d_q[j][i] -= bodies_[i].S.v.dot(k.f);
      d_qd[j][i] -= bodies_[i].S.v.dot(d.f);
    }
    CarryContacts(j, up, contacts);
  }
  DifferentiateSlides(contacts, d_q, d_qd);
  if (any_pair_) AddPairs(d_q, d_qd);
}

template <class Space>
void HybridDynamics<Space>::CarryContacts(int body, int carrier, Contacts& contacts) {
  const WrenchDerivative& own = *contacts[body];
  if (contacts[carrier] == nullptr) {
    contacts[carrier] = &own;
    return;
  }
  WrenchDerivative& sum = bodies_[carrier].contact;
  if (contacts[carrier] != &sum) sum = *contacts[carrier];
  sum.stiffness += own.stiffness;
  sum.damping += own.damping;
  contacts[carrier] = &sum;
}

/// The root's translations, whose axes never change, among themselves: only contacts depend on
/// them.
template <class Space>
void HybridDynamics<Space>::DifferentiateSlides(Contacts& contacts,
                                                typename Derivatives::Block& d_q,
                                                typename Derivatives::Block& d_qd) {
  for (int j = slides_ - 1; j >= 0; --j) {
    for (int i = 0; i <= j; ++i) d_q[i][j] = d_q[j][i] = d_qd[i][j] = d_qd[j][i] = 0;
    d_qd[j][j] = joints_[j].damping;
    if (contacts[j] == nullptr) continue;
    const WrenchDerivative& w = *contacts[j];
    const Vector& direction = bodies_[j].S.v;
    const Vector by_q = w.stiffness.ForceOfSlide(direction);
    const Vector by_qd = w.damping.ForceOfSlide(direction);
    for (int i = 0; i <= j; ++i) {
      d_q[i][j] -= bodies_[i].S.v.dot(by_q);
      d_qd[i][j] -= bodies_[i].S.v.dot(by_qd);
    }
    for (int i = 0; i < j; ++i) {
      d_q[j][i] -= direction.dot(w.stiffness.ForceOfSlide(bodies_[i].S.v));
      d_qd[j][i] -= direction.dot(w.damping.ForceOfSlide(bodies_[i].S.v));
    }
    if (j > 0) CarryContacts(j, j - 1, contacts);
  }
}

template <class Space>
void HybridDynamics<Space>::AddPairs(typename Derivatives::Block& d_q,
                                     typename Derivatives::Block& d_qd) const {
  for (int i = 0; i < n_; ++i) {
    for (int k = 0; k < n_; ++k) {
      d_q[i][k] += pair_q_[i][k];
      d_qd[i][k] += pair_qd_[i][k];
    }
  }
}

/// Let s_k be 1 for a joint that carries a alone, -1 for one that carries b alone, and 0 for one
/// that carries both or neither. The generalised force of the pair is Q_i = s_i S_i . W. Moving a
/// and b as one turns W along. Moving b alone is the same as moving both and then moving a back:
///
///   dW/dq_k = S_k x* W + K S_k + D S_rate_k  (s_k = 1),   -(K S_k + D S_rate_k)  (s_k = -1),
///   dW/dqd_k = s_k D S_k.
///
/// DifferentiateInverse lets each wrench turn along with the body that it acts on. This is right
/// for W on a. The wrench on b changes with W instead, so s_k S_k x* W has to be taken away again
/// in everything that carries b.
template <class Space>
void HybridDynamics<Space>::AddPairDerivative(int a, int b, const Wrench& W,
                                              const WrenchMap& stiffness,
                                              const WrenchMap& damping) {
  if (!any_pair_) {
    any_pair_ = true;
    for (int i = 0; i < n_; ++i) {
      pair_q_[i].fill(0);
      pair_qd_[i].fill(0);
    }
  }
  IntArray<int, kMaxDofs> side{};  // s
  std::uint32_t carriers_of_b = 0;
  for (int i = a; i >= 0; i = joints_[i].parent) ++side[i];
  for (int i = b; i >= 0; i = joints_[i].parent) {
    --side[i];
    carriers_of_b |= 1U << i;
  }
  for (int k = 0; k < n_; ++k) {
    if (side[k] == 0) continue;
    const Body& moving = bodies_[k];
    const Wrench by_q = stiffness * moving.S + damping * moving.S_rate;
    const Wrench by_qd = damping * moving.S;
    const Wrench turned = Space::Cross(moving.S, W);
    for (int i = 0; i < n_; ++i) {
      const Motion& S = bodies_[i].S;
      if (const int sides = side[i] * side[k]; sides != 0) {
        pair_q_[i][k] -= sides * Space::Dot(S, by_q);
        pair_qd_[i][k] -= sides * Space::Dot(S, by_qd);
      }
      if ((carriers_of_b >> i & 1U) != 0) pair_q_[i][k] += side[k] * Space::Dot(S, turned);
    }
  }
}

template <class Space>
template <class Count>
void HybridDynamics<Space>::DifferentiateByInput(Count count, typename Derivatives::Block& input,
                                                 bool by_prescribed) const {
  // Inverse of the Cholesky factor, then of the free inertia.
  IntArray<IntArray<double, kMaxDofs>, kMaxDofs> inverse;
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < i; ++k) {
      double sum = 0;
      for (int m = k; m < i; ++m) sum -= L_[i][m] * inverse[m][k];
      inverse[i][k] = sum * L_[i][i];
    }
    inverse[i][i] = L_[i][i];
  }
  for (int i = 0; i < count; ++i) {
    auto& row = input[free_[i]];
    for (int k = 0; k <= i; ++k) {
      double sum = 0;
      for (int m = i; m < count; ++m) sum += inverse[m][i] * inverse[m][k];
      row[free_[k]] = sum;
      input[free_[k]][free_[i]] = sum;
    }
  }
  for (int at = 0; at < prescribed_count_; ++at) {
    const int a = prescribed_[at];
    IntArray<double, kMaxDofs> M_a;  // its entries for the free degrees of freedom
    for (int k = 0; k < count; ++k) M_a[k] = M_[a][free_[k]];
    for (int i = 0; i < count; ++i) {
      const int p = free_[i];
      double sum = 0;
      for (int k = 0; k < count; ++k) sum += input[p][free_[k]] * M_a[k];
      input[p][a] = -sum;
      input[a][p] = sum;
    }
    if (!by_prescribed) continue;
    for (int below = 0; below <= at; ++below) {
      const int b = prescribed_[below];
      double sum = M_[a][b];
      for (int k = 0; k < count; ++k) sum += M_a[k] * input[free_[k]][b];
      input[a][b] = input[b][a] = sum;
    }
  }
}

template <class Space>
void HybridDynamics<Space>::DifferentiateFactored(Derivatives& out, bool by_prescribed) {
  DifferentiateInverse(out.q, out.qd);
  WithFreeCount([&](auto count) { DifferentiateByInput(count, out.input, by_prescribed); });
}

template <class Space>
void HybridDynamics<Space>::Differentiate(Derivatives& out) {
  DifferentiateFactored(out);
  WithFreeCount([&](auto count) { MultiplyOut(count, out); });
}

/// out = R D, by rows; those of the free degrees of freedom are needed to the end.
template <class Space>
template <class Count>
void HybridDynamics<Space>::MultiplyOut(Count count, Derivatives& out) const {
  IntArray<IntArray<double, kMaxDofs>, kMaxDofs> D_q, D_qd;
  for (int p = 0; p < count; ++p) {
    auto& row_q = out.q[free_[p]];
    auto& row_qd = out.qd[free_[p]];
    for (int k = 0; k < n_; ++k) {
      D_q[p][k] = row_q[k];
      D_qd[p][k] = row_qd[k];
      row_q[k] = row_qd[k] = 0;
    }
  }
  for (int i = 0; i < n_; ++i) {
    IntArray<double, kMaxDofs> R;
    for (int p = 0; p < count; ++p) R[p] = -out.input[i][free_[p]];
    AddProducts(count, R, D_q, out.q[i]);
    AddProducts(count, R, D_qd, out.qd[i]);
  }
}

/// Adds R D to the row of a product.
template <class Space>
template <class Count>
void HybridDynamics<Space>::AddProducts(Count count, const IntArray<double, kMaxDofs>& R,
                                        const typename Derivatives::Block& D,
                                        IntArray<double, kMaxDofs>& row) const {
  constexpr int kAtOnce = 6;  // columns, which stay in registers
  int k = 0;
  for (; k + kAtOnce <= n_; k += kAtOnce) {
    IntArray<double, kAtOnce> sums;
    for (int m = 0; m < kAtOnce; ++m) sums[m] = row[k + m];
    for (int p = 0; p < count; ++p) {
      for (int m = 0; m < kAtOnce; ++m) sums[m] += R[p] * D[p][k + m];
    }
    for (int m = 0; m < kAtOnce; ++m) row[k + m] = sums[m];
  }
  for (; k < n_; ++k) {
    for (int p = 0; p < count; ++p) row[k] += R[p] * D[p][k];
  }
}

template <class Space>
double HybridDynamics<Space>::KineticEnergy() const {
  double sum = 0;
  for (int j = 0; j < n_; ++j) {
    const Body& body = bodies_[j];
    if (!joints_[j].massless) sum += 0.5 * Space::Dot(body.v, body.momentum);
  }
  return sum;
}

template <class Space>
double HybridDynamics<Space>::PotentialEnergy() const {
  double sum = 0;
  for (int j = 0; j < n_; ++j) {
    const Body& body = bodies_[j];
    if (!joints_[j].massless) sum -= gravity_.dot(body.own.h + body.own.m * origin_);
  }
  return sum;
}

template <class Space>
typename Space::Wrench HybridDynamics<Space>::Momentum() const {
  Wrench sum;
  for (int j = 0; j < n_; ++j) {
    if (!joints_[j].massless) sum = sum + bodies_[j].momentum;
  }
  sum.n += Space::Moment(origin_, sum.f);
  return sum;
}

}  // namespace tumbler
