#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <stdexcept>

#include "offline/model/contact_forces.h"
#include "offline/model/contact_law.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/plane.h"

namespace tumbler {

/// The contacts of the hopping lamp (primitives/robots/lamp.urdf) with the ground z = 0, written
/// for this robot alone. The general contact model is compared with them. The lamp's measures, its
/// kinematics, the level ground and the default law are worked out by hand, component by component.
/// Only the interface, and the angles and their rates from the dynamics, are shared.
///
/// With c, s the cosine and sine of the pitch, (x, z) the ankle and w the pitch rate, a ball of the
/// foot at (l, -h) has its centre at a = (l c + h s, l s - h c) from the ankle; the head is at
/// a = L (-s1 - s2, c1 + c2), with the arms' directions in the world. A ball of radius R gives
///
///   d = z + a_z - R,   v_n = centre's v_z,   v_t = centre's v_x + w R,   p = (a_x, a_z - R)
///   F = N(d, v_n) (-mu T(v_t), 1)
///
/// and for the body displaced by (theta, u_x, u_z) about the ankle, its velocity carried along,
///
///   delta d = u_z + theta a_x,   delta v_n = theta (v_t - w R),   delta v_t = -theta v_n.
class LampContact final : public ContactForces<Plane> {
 public:
  using Dynamics = HybridDynamics<Plane>;

  /// @throws std::invalid_argument  for a law with other smoothing or damping than the default.
  explicit LampContact(const ContactLaw& law)
      : k_(law.stiffness_n_per_m),
        c_(law.damping_n_s_per_m),
        layer_(law.d_on_m),
        width_(law.d_on_m - law.d_off_m),
        mu_(law.mu),
        v_max_(law.v_max_m_per_s) {
    if (law.smoothing != ContactSmoothing::kCubic || law.damping_law != ContactDamping::kNoPull)
      throw std::invalid_argument("the lamp's contacts are worked out for the default law");
  }

  void Apply(Dynamics& dynamics) override {
    count_ = 0;
    const double z = dynamics.origin().y();  // The dynamics' origin is the ankle.
    const double vx = dynamics.velocity(kFoot).v.x(), vz = dynamics.velocity(kFoot).v.y();
    const double w = dynamics.velocity(kFoot).w;
    const double c = dynamics.rotation(kFoot).c, s = dynamics.rotation(kFoot).s;
    for (const double l : {kHalfFoot, -kHalfFoot}) {
      const double az = l * s - kAnkleHeight * c;
      const double d = z + az - kFootRadius;
      if (d >= layer_) continue;
      const double ax = l * c + kAnkleHeight * s;
      AddBall(dynamics, {kFoot, l > 0 ? 0 : 1, d, ax, az - kFootRadius, vz + w * ax, vx - w * az, w,
                         kFootRadius});
    }
    const double c1 = dynamics.rotation(kLowerArm).c, c2 = dynamics.rotation(kUpperArm).c;
    const double az = kArm * (c1 + c2);
    const double d = z + az - kHeadRadius;
    if (d >= layer_) return;
    const double s1 = dynamics.rotation(kLowerArm).s, s2 = dynamics.rotation(kUpperArm).s;
    const double w1 = dynamics.velocity(kLowerArm).w, w2 = dynamics.velocity(kUpperArm).w;
    AddBall(dynamics,
            {kUpperArm, 2, d, -kArm * (s1 + s2), az - kHeadRadius, vz - kArm * (w1 * s1 + w2 * s2),
             vx - kArm * (w1 * c1 + w2 * c2), w2, kHeadRadius});
  }

  void Differentiate(Dynamics& dynamics) const override {
    for (std::size_t i = 0; i < count_; ++i) {
      const Ball& b = balls_[i];
      Plane::WrenchMap stiffness, damping;
      const auto change = [&](double dd, double dn, double dt) {
        const double dN = b.N_d * dd + b.N_v * dn;
        const double fx = -mu_ * (dN * b.T + b.N * b.T_v * dt);
        return Plane::Wrench{b.px * dN - b.pz * fx, {fx, dN}};
      };
      // The wrench that is carried along is taken off. Sliding along the ground changes nothing.
      stiffness.columns[0] = change(b.px, b.vx, -b.vn);
      stiffness.columns[0].n -= (b.pz + b.radius) * b.N + b.px * b.fx;
      stiffness.columns[0].f += Plane::Vector(b.N, -b.fx);
      stiffness.columns[2] = change(1, 0, 0);
      damping.columns[0] = change(0, b.px, -b.pz);
      damping.columns[1] = change(0, 0, 1);
      damping.columns[2] = change(0, 1, 0);
      dynamics.AddWrenchDerivative(b.body, stiffness, damping);
    }
  }

  [[nodiscard]] std::span<const ActiveContact<Plane>> active() const override {
    return {active_.data(), count_};
  }

  [[nodiscard]] std::uint64_t Pieces() const override {
    ContactPieces pieces;
    for (std::size_t i = 0; i < count_; ++i) {
      const Ball& b = balls_[i];
      const double depth = layer_ - b.d, y = k_ * depth - c_ * b.vn;
      const unsigned normal =
          (depth < width_ ? 1U : 0U) + (y > 0 ? 2U : 0U) + (y < k_ * width_ ? 4U : 0U);
      pieces.Add(static_cast<std::uint64_t>(b.shape),
                 normal + (std::abs(b.vx + b.w * b.radius) < v_max_ ? 8U : 0U));
    }
    return pieces.number();
  }

  void AddDepthSlopes(const Dynamics& dynamics, const ActiveContact<Plane>& active, double scale,
                      std::span<double> slopes) const override {
    const double ax = active.point.x();  // How fast the ball rises with its body's angle.
    slopes[1] -= scale;
    slopes[kFoot] -= scale * ax;
    if (active.shape != 2) return;
    slopes[kLowerArm] -= scale * ax;
    slopes[kUpperArm] -= scale * (ax + kArm * dynamics.rotation(kLowerArm).s);
  }

  [[nodiscard]] double LoadedSlip() const override {
    double sum = 0;
    for (std::size_t i = 0; i < count_; ++i)
      sum += balls_[i].N * balls_[i].T * (balls_[i].vx + balls_[i].w * balls_[i].radius);
    return sum;
  }

  void AddLoadedSlipSlopes(const Dynamics& dynamics, double scale, std::span<double> by_q,
                           std::span<double> by_qd) const override {
    for (std::size_t i = 0; i < count_; ++i) {
      const Ball& b = balls_[i];
      const double vt = b.vx + b.w * b.radius;
      const double by_N = scale * b.T * vt, by_vt = scale * b.N * (b.T + vt * b.T_v);
      const double by_d = by_N * b.N_d, by_vn = by_N * b.N_v;
      const Plane::Wrench by_place{by_d * b.px + by_vn * b.vx - by_vt * b.vn, {0, by_d}};
      const Plane::Wrench by_velocity{by_vn * b.px - by_vt * b.pz, {by_vt, by_vn}};
      dynamics.AddStateSlopes(b.body, by_place, by_velocity, by_q, by_qd);
    }
  }

 private:
  // Degrees of freedom: x, z, pitch, ankle, knee.
  static constexpr int kFoot = 2, kLowerArm = 3, kUpperArm = 4;
  static constexpr double kHalfFoot = 0.07, kAnkleHeight = 0.03, kFootRadius = 0.01;
  static constexpr double kArm = 0.2, kHeadRadius = 0.05;

  /// A ball in the layer.
  struct Ball {
    int body, shape;
    double d;
    double px, pz;  // from the ankle to where it touches
    double vn, vx;  // velocity of its centre, up and along
    double w, radius;
    double N = 0, N_d = 0, N_v = 0, T = 0, T_v = 0, fx = 0;
  };

  void AddBall(Dynamics& dynamics, const Ball& ball) {
    Ball& b = balls_[count_];
    b = ball;
    // N = beta P, where P is 0 up to y = 0 and y from y = e on, y = k (d_on - d) - c v_n.
    const double depth = layer_ - b.d;
    const double e = k_ * width_;
    const double y = k_ * depth - c_ * b.vn;
    if (y > 0) {
      const double r = y / e;
      const double P = y < e ? y * r * (2 - r) : y;
      const double P_y = y < e ? r * (4 - 3 * r) : 1;
      const double t = depth / width_;
      const double beta = t < 1 ? t * t * (3 - 2 * t) : 1;
      const double beta_d = t < 1 ? -6 * t * (1 - t) / width_ : 0;
      b.N = beta * P;
      b.N_d = beta_d * P - beta * P_y * k_;
      b.N_v = -beta * P_y * c_;
    }
    const double r = (b.vx + b.w * b.radius) / v_max_;
    const bool sticks = std::abs(r) < 1;
    b.T = sticks ? r * (1.5 - 0.5 * r * r) : std::copysign(1, r);
    b.T_v = sticks ? 1.5 * (1 - r * r) / v_max_ : 0;
    b.fx = -mu_ * b.N * b.T;
    dynamics.AddWrench(b.body, {b.px * b.N - b.pz * b.fx, {b.fx, b.N}});
    active_[count_++] = {b.shape, 0, -1, depth, b.N, {b.px, b.pz}, {b.fx, b.N}, {0, 1}};
  }

  double k_, c_, layer_, width_, mu_, v_max_;
  std::array<Ball, 3> balls_;
  std::array<ActiveContact<Plane>, 3> active_;
  std::size_t count_ = 0;
};

}  // namespace tumbler
