#pragma once

#include <array>
#include <cmath>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "offline/contact/contact_law.h"
#include "offline/dynamics/hybrid_dynamics.h"

namespace tumbler {

/// A sphere fixed to a body of the robot (a disc in the plane).
template <class Space>
struct ContactSphere {
  std::string name;                                       ///< `LINK/INDEX`
  int body = 0;                                           ///< Degree of freedom that moves it.
  typename Space::Vector centre = Space::Vector::Zero();  ///< In the body's frame [m].
  double radius_m = 0;
};

/// Something at rest in the world that the robot can touch.
template <class Space>
struct Obstacle {
  enum class Kind { kHalfSpace, kSphere };  ///< A sphere is a cylinder along y in the plane.
  std::string name;
  Kind kind = Kind::kHalfSpace;
  typename Space::Vector point =
      Space::Vector::Zero();  ///< On the surface of the half-space, or the centre [m].
  typename Space::Vector normal = Space::Vector::Zero();  ///< Unit, out of the half-space.
  double radius_m = 0;

  bool operator==(const Obstacle&) const = default;
};

/// The near points of a sphere and an obstacle, [AB04, Eq. 10], with a signed distance: the normal
/// is defined however deep the penetration, save at the centre of a spherical obstacle.
template <class Space>
struct NearPoint {
  double d = 0;                ///< Distance between the surfaces, negative inside [m].
  typename Space::Vector u_d;  ///< Unit normal, from the obstacle to the robot.
  double curvature_per_m =
      0;  ///< du_d = curvature (I - u_d u_d^T) dc for a motion dc of the sphere's centre.
};

template <class Space>
NearPoint<Space> FindNearPoint(const Obstacle<Space>& obstacle,
                               const typename Space::Vector& centre, double radius_m) {
  if (obstacle.kind == Obstacle<Space>::Kind::kHalfSpace) {
    return {obstacle.normal.dot(centre - obstacle.point) - radius_m, obstacle.normal, 0};
  }
  const typename Space::Vector r = centre - obstacle.point;
  const double length = r.norm();
  return {length - obstacle.radius_m - radius_m, r / length, 1 / length};
}

/// One contact that carries force.
template <class Space>
struct ActiveContact {
  int sphere = 0;
  int obstacle = 0;
  double depth_m = 0;  ///< Into the layer, d_on - d.
  double normal_force_n = 0;
  typename Space::Vector point;   ///< p_rob relative to the origin of the dynamics.
  typename Space::Vector normal;  ///< u_d, from the obstacle to the robot.
  typename Space::Vector force;   ///< On the robot.
};

/// All contacts of a robot with the obstacles of a task, [AB04, section III], with exact
/// derivatives that include the motion of contact points and normals.
template <class Space>
class ContactModel {
 public:
  static constexpr int kMaxActive = 32;

  ContactModel(const ContactLaw& law, std::vector<ContactSphere<Space>> spheres,
               std::vector<Obstacle<Space>> obstacles)
      : law_(law), spheres_(std::move(spheres)), obstacles_(std::move(obstacles)) {}

  /// Adds the wrench of every active contact to `dynamics`, after its SetState. At most kMaxActive
  /// contacts are kept for Differentiate; a robot of this size never has that many.
  void Apply(HybridDynamics<Space>& dynamics) {
    active_count_ = 0;
    for (int s = 0; s < static_cast<int>(spheres_.size()); ++s) {
      const ContactSphere<Space>& sphere = spheres_[static_cast<std::size_t>(s)];
      const typename Space::Vector c =
          dynamics.position(sphere.body) + dynamics.rotation(sphere.body) * sphere.centre;
      const typename Space::Vector world = dynamics.origin() + c;
      for (int o = 0; o < static_cast<int>(obstacles_.size()); ++o) {
        const NearPoint<Space> near =
            FindNearPoint(obstacles_[static_cast<std::size_t>(o)], world, sphere.radius_m);
        if (near.d >= law_.layer_m || active_count_ == kMaxActive) continue;
        Evaluation& e = evaluations_[static_cast<std::size_t>(active_count_)];
        e.near = near;
        e.body = sphere.body;
        e.radius = sphere.radius_m;
        e.c = c;
        e.p = c - sphere.radius_m * near.u_d;
        e.v = dynamics.velocity(sphere.body).At(e.p);
        const double v_d = e.v.dot(near.u_d);
        e.normal = EvaluateNormalForce(law_, near.d, v_d);
        e.v_t = e.v - v_d * near.u_d;
        e.friction = EvaluateFrictionGain(law_, e.v_t.squaredNorm());
        e.F = e.normal.N * near.u_d -
              (law_.friction * std::abs(e.normal.N) * e.friction.gain) * e.v_t;
        dynamics.AddWrench(sphere.body, Space::ForceAt(e.p, e.F));
        active_[static_cast<std::size_t>(active_count_++)] = {
            s, o, law_.layer_m - near.d, e.normal.N, e.p, near.u_d, e.F};
      }
    }
  }

  /// Adds the derivatives of the wrenches of the last Apply to `dynamics`, after its Solve.
  void Differentiate(HybridDynamics<Space>& dynamics) const {
    using Vector = typename Space::Vector;
    for (int a = 0; a < active_count_; ++a) {
      const Evaluation& e = evaluations_[static_cast<std::size_t>(a)];
      const Vector& u = e.near.u_d;
      const auto& body_v = dynamics.velocity(e.body);
      const auto W = Space::ForceAt(e.p, e.F);
      // F = N u - mu |N| gain v_t; its change for changes of distance, normal and velocity, with
      // v_d = v . u and v_t = v - v_d u.
      const double v_d = e.v.dot(u);
      const double mu_N = law_.friction * std::abs(e.normal.N);
      const double g = mu_N * e.friction.gain;
      const Vector b = (2 * mu_N * e.friction.gain_s2) * e.v_t;
      const Vector per_N = u - (std::copysign(law_.friction, e.normal.N) * e.friction.gain) * e.v_t;
      const Vector per_d = e.normal.N_d * per_N;
      const Vector per_v_d = e.normal.N_v * per_N + g * u;
      const auto velocity_change = [&](const Vector& dv) -> Vector {
        return u.dot(dv) * per_v_d - e.v_t.dot(dv) * b - g * dv;
      };
      const auto normal_change = [&](const Vector& du) -> Vector {
        return e.v.dot(du) * per_v_d + (v_d * e.v_t.dot(du)) * b + (e.normal.N + g * v_d) * du;
      };
      typename Space::WrenchMap stiffness;
      typename Space::WrenchMap damping;
      for (std::size_t m = 0; m < stiffness.columns.size(); ++m) {
        const auto S = Space::BasisMotion(m);
        const Vector dc = S.At(e.c);
        const double dd = u.dot(dc);
        Vector dp = dc;
        Vector dF = dd * per_d;
        if (e.near.curvature_per_m != 0) {
          const Vector du = e.near.curvature_per_m * (dc - dd * u);
          dp -= e.radius * du;
          dF += normal_change(du);
        }
        dF += velocity_change(Space::At(Space::Cross(S, body_v), e.p) + Space::Cross(body_v.w, dp));
        auto dW = Space::ForceAt(e.p, dF);
        dW.n += Space::Moment(dp, e.F);
        stiffness.columns[m] = dW - Space::Cross(S, W);
        damping.columns[m] = Space::ForceAt(e.p, velocity_change(S.At(e.p)));
      }
      dynamics.AddWrenchDerivative(e.body, stiffness, damping);
    }
  }

  [[nodiscard]] std::span<const ActiveContact<Space>> active() const {
    return {active_.data(), static_cast<std::size_t>(active_count_)};
  }
  [[nodiscard]] const ContactLaw& law() const { return law_; }
  [[nodiscard]] const std::vector<ContactSphere<Space>>& spheres() const { return spheres_; }
  [[nodiscard]] const std::vector<Obstacle<Space>>& obstacles() const { return obstacles_; }

 private:
  struct Evaluation {
    NearPoint<Space> near;
    int body;
    double radius;
    typename Space::Vector c, p, v, v_t, F;
    NormalForce normal;
    FrictionGain friction;
  };

  ContactLaw law_;
  std::vector<ContactSphere<Space>> spheres_;
  std::vector<Obstacle<Space>> obstacles_;
  std::array<Evaluation, kMaxActive> evaluations_;
  std::array<ActiveContact<Space>, kMaxActive> active_;
  int active_count_ = 0;
};

}  // namespace tumbler
