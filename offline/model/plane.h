#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/core/capacity.h"
#include "common/core/functions.h"
#include "offline/model/plane_vector.h"

namespace tumbler {

/// The algebra of rigid motions of the x-z plane, SE(2): x right, z up, angles positive from +x
/// towards +z (axis -y).
///
/// The dynamics (`hybrid_dynamics.h`) and the contact model are templates over a `Space`; this is
/// one, and `Spatial` is the other. All quantities of one computation are expressed in one frame at
/// rest: world axes and an origin of the caller's choice. Units: SI.
///
/// Two properties make the plane cheap: the cross product of two motions has no angular part
/// (`Rate`), and the bias map 2B of a body acts on the angular velocity alone (`Bias`).
struct Plane {
  using Vector = PlaneVector;  ///< (x, z)
  using Angular = double;      ///< about -y

  /// The most degrees of freedom of a tree: the joints that a primitive moves, the root, and one
  /// joint without a motor. Matrices have this size, so a planar robot keeps it small.
  static constexpr int kMaxDofs = kMaxJoints + 4;
  static constexpr std::size_t kMotions = 3;  ///< Dimension of the space of motions.
  /// Numbers of free degrees of freedom that are common: those of a root, and of one with two
  /// joints that are driven by torques.
  using CommonFreeCounts = std::integer_sequence<int, 3, 5>;

  /// Angular velocity w applied to the point r.
  static Vector Cross(double w, const Vector& r) { return {-w * r.y(), w * r.x()}; }
  /// Moment about the origin of the force f at the point r.
  static double Moment(const Vector& r, const Vector& f) { return r.x() * f.y() - r.y() * f.x(); }

  /// A rotation by its cosine and sine.
  struct Rotation {
    double c = 1, s = 0;
    [[nodiscard]] Vector operator*(const Vector& r) const {
      return {c * r.x() - s * r.y(), s * r.x() + c * r.y()};
    }
    [[nodiscard]] Rotation operator*(const Rotation& b) const {
      return {c * b.c - s * b.s, s * b.c + c * b.s};
    }
    [[nodiscard]] Vector Inverse(const Vector& r) const {
      return {c * r.x() + s * r.y(), c * r.y() - s * r.x()};
    }
    [[nodiscard]] double angle() const { return portable::Atan2(s, c); }
    bool operator==(const Rotation&) const = default;
  };
  /// Axis of a revolute joint: +1 about -y, -1 about +y.
  using Axis = double;
  static Axis DefaultAxis() { return 1; }
  static Rotation RotationBy(Axis axis, double angle) {
    const auto [sine, cosine] = portable::SinCos(angle);
    return {cosine, axis * sine};
  }

  /// The turn of a joint.
  struct Turn : Rotation {
    Turn() = default;
    Turn(Axis axis, double angle) : Rotation(RotationBy(axis, angle)) {}
  };

  /// The derivative of a motion that is carried along by another: a pure translation.
  struct Rate {
    Vector v = Vector::Zero();
    friend Rate operator+(const Rate& a, const Rate& b) { return {a.v + b.v}; }
    friend Rate operator*(const Rate& a, double k) { return {a.v * k}; }
  };

  /// Velocity of a body: angular velocity, and the velocity of the body's point that is now at the
  /// origin.
  struct Motion {
    double w = 0;
    Vector v = Vector::Zero();
    friend Motion operator+(const Motion& a, const Motion& b) { return {a.w + b.w, a.v + b.v}; }
    friend Motion operator+(const Motion& a, const Rate& b) { return {a.w, a.v + b.v}; }
    friend Motion operator*(const Motion& a, double k) { return {a.w * k, a.v * k}; }
    /// Velocity of the body's point at r.
    [[nodiscard]] Vector At(const Vector& r) const { return v + Cross(w, r); }
  };

  /// The motion of a body with rotation R that turns at unit rate about an axis of its own through
  /// the point p.
  static Motion RevoluteMotion(const Rotation& /*R*/, Axis axis, const Vector& p) {
    return {axis, -Cross(axis, p)};
  }

  /// Moment about the origin [N m], and force [N].
  struct Wrench {
    double n = 0;
    Vector f = Vector::Zero();
    friend Wrench operator+(const Wrench& a, const Wrench& b) { return {a.n + b.n, a.f + b.f}; }
    friend Wrench operator-(const Wrench& a, const Wrench& b) { return {a.n - b.n, a.f - b.f}; }
    friend Wrench operator*(const Wrench& a, double k) { return {a.n * k, a.f * k}; }
  };
  /// A linear map from motions to wrenches, by its columns.
  struct WrenchMap {
    std::array<Wrench, 3> columns;  ///< Images of `BasisMotion(0)`, (1), (2).
    WrenchMap& operator+=(const WrenchMap& a) {
      for (std::size_t m = 0; m < columns.size(); ++m) columns[m] = columns[m] + a.columns[m];
      return *this;
    }
    friend Wrench operator*(const WrenchMap& a, const Rate& u) {
      return a.columns[1] * u.v.x() + a.columns[2] * u.v.y();
    }
    friend Wrench operator*(const WrenchMap& a, const Motion& u) {
      return a.columns[0] * u.w + a.columns[1] * u.v.x() + a.columns[2] * u.v.y();
    }
    /// The force of the image of a translation.
    [[nodiscard]] Vector ForceOfSlide(const Vector& v) const {
      return columns[1].f * v[0] + columns[2].f * v[1];
    }
    /// The covector z with z . u = s . (A u) for every motion u, to be applied by `Dot`.
    [[nodiscard]] Wrench TransposeTimes(const Motion& s) const {
      return {Dot(s, columns[0]), {Dot(s, columns[1]), Dot(s, columns[2])}};
    }
  };
  /// Turning at unit rate about the origin; unit velocity along x; along z.
  static Motion BasisMotion(std::size_t m) {
    return {m == 0 ? 1.0 : 0.0, {m == 1 ? 1.0 : 0.0, m == 2 ? 1.0 : 0.0}};
  }
  static Vector At(const Rate& rate, const Vector& /*r*/) { return rate.v; }
  /// The wrench of the force f at the point r.
  static Wrench ForceAt(const Vector& r, const Vector& f) { return {Moment(r, f), f}; }

  /// Power of a wrench on a motion [W].
  static double Dot(const Motion& m, const Wrench& f) { return m.w * f.n + m.v.dot(f.f); }
  static double Dot(const Rate& m, const Wrench& f) { return m.v.dot(f.f); }

  /// a x b: how b changes when it is carried along with a.
  static Rate Cross(const Motion& a, const Motion& b) {
    return {Cross(a.w, b.v) - Cross(b.w, a.v)};
  }
  static Rate Cross(const Motion& a, const Rate& b) { return {Cross(a.w, b.v)}; }
  /// a x* f: how the wrench f changes when it is carried along with a.
  static Wrench Cross(const Motion& a, const Wrench& f) {
    return {Moment(a.v, f.f), Cross(a.w, f.f)};
  }

  /// Inertia of a body about its mass centre [kg m^2].
  using BodyInertia = double;
  static BodyInertia NoInertia() { return 0; }

  /// Inertia about the origin: mass, first moment h = m c of the mass centre c, second moment i.
  struct Inertia {
    double m = 0;
    Vector h = Vector::Zero();
    double i = 0;
    /// The inertia of a body of mass m, mass centre c and inertia i_c about the mass centre.
    /// Rotating a planar body changes only c.
    static Inertia OfBody(double m, const Vector& c, const Rotation& /*R*/, BodyInertia i_c) {
      return {m, m * c, i_c + m * c.squaredNorm()};
    }
    friend Inertia operator+(const Inertia& a, const Inertia& b) {
      return {a.m + b.m, a.h + b.h, a.i + b.i};
    }
    friend Wrench operator*(const Inertia& a, const Motion& b) {
      return {a.i * b.w + Moment(a.h, b.v), a.m * b.v + Cross(b.w, a.h)};
    }
    friend Wrench operator*(const Inertia& a, const Rate& b) {
      return {Moment(a.h, b.v), a.m * b.v};
    }
  };

  /// The bias map 2B(I, v) u = v x* I u - I (v x u) + u x* I v. It is the part of the derivative of
  /// I a + v x* I v by v that is left once motions are differentiated along the body [SRW22, Eq.
  /// 29]. In the plane, with momentum p, it is 2 u.w (h . v, w x p): a wrench times the angular
  /// part of u.
  struct Bias {
    Wrench b;
    static Bias OfBody(const Inertia& inertia, const Motion& v, const Wrench& momentum) {
      return {{2 * inertia.h.dot(v.v), Cross(2.0, momentum.f)}};
    }
    friend Bias operator+(const Bias& a, const Bias& c) { return {a.b + c.b}; }
    friend Wrench operator*(const Bias& a, const Motion& u) { return a.b * u.w; }
    /// The covector z with z . u = s . (2B u) for every motion u, to be applied by `Apply`.
    [[nodiscard]] double TransposeTimes(const Motion& s) const { return Dot(s, b); }
  };
  static double Apply(double z, const Motion& u) { return z * u.w; }
  static double Apply(double /*z*/, const Rate& /*u*/) { return 0; }
  static Wrench BiasOfRate(const Bias& /*bias*/, const Rate& /*u*/) { return {}; }
};

}  // namespace tumbler
