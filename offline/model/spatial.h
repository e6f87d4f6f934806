#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "offline/model/plane_vector.h"
#include "offline/model/space_vector.h"

namespace tumbler {

/// The algebra of rigid motions of space, SE(3): x right, z up, y away from the viewer of the x-z
/// plane; angles follow the right hand about their axis. It has the same members as `Plane`, so
/// that the dynamics can be templates over both.
///
/// All quantities of one computation are expressed in one frame at rest: world axes and an origin
/// of the caller's choice. Units: SI.
struct Spatial {
  using Vector = SpaceVector;   ///< (x, y, z)
  using Angular = SpaceVector;  ///< About the world axes.

  /// The most degrees of freedom of a tree, those of the root included.
  static constexpr int kMaxDofs = 32;
  static constexpr std::size_t kMotions = 6;  ///< Dimension of the space of motions.
  /// Numbers of free degrees of freedom that are common: those of a root.
  using CommonFreeCounts = std::integer_sequence<int, 6>;

  /// Angular velocity w applied to the point r.
  static Vector Cross(const Vector& w, const Vector& r) { return w.cross(r); }
  /// Moment about the origin of the force f at the point r.
  static Vector Moment(const Vector& r, const Vector& f) { return Cross(r, f); }

  /// A rotation by its matrix.
  struct Rotation {
    SpaceMatrix m = SpaceMatrix::Identity();
    [[nodiscard]] Vector operator*(const Vector& r) const { return m * r; }
    [[nodiscard]] Rotation operator*(const Rotation& b) const { return {m * b.m}; }
    [[nodiscard]] Vector Inverse(const Vector& r) const { return m.TransposeTimes(r); }
    bool operator==(const Rotation&) const = default;
  };
  /// Axis of a revolute joint: a unit vector.
  using Axis = Vector;
  static Axis DefaultAxis() { return Vector::UnitZ(); }
  static Rotation RotationBy(const Axis& axis, double angle);

  /// The turn of a joint. Most joints turn about an axis of coordinates: then R times the turn has
  /// one column of R, and two mixed of the others.
  class Turn {
   public:
    Turn() = default;
    Turn(const Axis& axis, double angle) : turn_(RotationBy(axis, angle)) {
      for (int i = 0; i < 3; ++i) {
        if (axis[(i + 1) % 3] == 0 && axis[(i + 2) % 3] == 0) kept_ = i;
      }
    }
    friend Rotation operator*(const Rotation& R, const Turn& turn) {
      switch (turn.kept_) {
        case 0:
          return turn.Keeping<0>(R.m);
        case 1:
          return turn.Keeping<1>(R.m);
        case 2:
          return turn.Keeping<2>(R.m);
        default:
          return R * turn.turn_;
      }
    }

   private:
    template <int kKept>
    [[nodiscard]] Rotation Keeping(const SpaceMatrix& R) const {
      constexpr int kNext = (kKept + 1) % 3, kLast = (kKept + 2) % 3;
      const double c = turn_.m(kNext, kNext), s = turn_.m(kLast, kNext);
      Rotation product;
      product.m.col(kKept) = R.col(kKept);
      product.m.col(kNext) = c * R.col(kNext) + s * R.col(kLast);
      product.m.col(kLast) = c * R.col(kLast) - s * R.col(kNext);
      return product;
    }
    Rotation turn_;
    int kept_ = -1;  // the axis of coordinates; -1: none
  };

  /// Velocity of a body: angular velocity, and the velocity of the body's point that is now at the
  /// origin.
  struct Motion {
    Vector w = Vector::Zero();
    Vector v = Vector::Zero();
    friend Motion operator+(const Motion& a, const Motion& b) { return {a.w + b.w, a.v + b.v}; }
    friend Motion operator*(const Motion& a, double k) { return {a.w * k, a.v * k}; }
    /// Velocity of the body's point at r.
    [[nodiscard]] Vector At(const Vector& r) const { return v + Cross(w, r); }
  };
  /// The derivative of a motion that is carried along by another. Unlike in the plane, it is a
  /// motion like any other.
  using Rate = Motion;

  /// The motion of a body with rotation R that turns at unit rate about an axis of its own through
  /// the point p.
  static Motion RevoluteMotion(const Rotation& R, const Axis& axis, const Vector& p) {
    const Vector w = R * axis;
    return {w, Cross(p, w)};
  }

  /// Moment about the origin [N m], and force [N].
  struct Wrench {
    Vector n = Vector::Zero();
    Vector f = Vector::Zero();
    friend Wrench operator+(const Wrench& a, const Wrench& b) { return {a.n + b.n, a.f + b.f}; }
    friend Wrench operator-(const Wrench& a, const Wrench& b) { return {a.n - b.n, a.f - b.f}; }
    friend Wrench operator*(const Wrench& a, double k) { return {a.n * k, a.f * k}; }
  };
  /// A sum of wrenches, two numbers with which the processor computes at once in each register.
  class Pairs {
   public:
    static Pairs Of(const Wrench& a, double k) { return Pairs(a, k); }
    void Add(const Wrench& a, double k) {
      const Pairs more(a, k);
      for (int i = 0; i < 3; ++i) v_[i] += more.v_[i];
    }
    [[nodiscard]] Wrench wrench() const {
      return {{v_[0][0], v_[0][1], v_[1][0]}, {v_[1][1], v_[2][0], v_[2][1]}};
    }

   private:
    using Pair [[gnu::vector_size(16)]] = double;
    Pairs(const Wrench& a, double k)
        : v_{Pair{a.n[0], a.n[1]} * k, Pair{a.n[2], a.f[0]} * k, Pair{a.f[1], a.f[2]} * k} {}
    IntArray<Pair, 3> v_;
  };
  /// A linear map from motions to wrenches, by its columns.
  struct WrenchMap {
    std::array<Wrench, 6> columns;  ///< Images of `BasisMotion(0)` ... `BasisMotion(5)`.
    WrenchMap& operator+=(const WrenchMap& a) {
      for (std::size_t m = 0; m < columns.size(); ++m) columns[m] = columns[m] + a.columns[m];
      return *this;
    }
    // A call would pass its numbers through memory, here and for inertias.
    [[gnu::always_inline]] friend Wrench operator*(const WrenchMap& a, const Motion& u) {
      Pairs sum = Pairs::Of(a.columns[0], u.w[0]);
      sum.Add(a.columns[1], u.w[1]);
      sum.Add(a.columns[2], u.w[2]);
      sum.Add(a.columns[3], u.v[0]);
      sum.Add(a.columns[4], u.v[1]);
      sum.Add(a.columns[5], u.v[2]);
      return sum.wrench();
    }
    /// The force of the image of a translation.
    [[nodiscard]] Vector ForceOfSlide(const Vector& v) const {
      return columns[3].f * v[0] + columns[4].f * v[1] + columns[5].f * v[2];
    }
    /// The covector z with z . u = s . (A u) for every motion u, to be applied by `Dot`.
    [[nodiscard]] Wrench TransposeTimes(const Motion& s) const {
      return {{Dot(s, columns[0]), Dot(s, columns[1]), Dot(s, columns[2])},
              {Dot(s, columns[3]), Dot(s, columns[4]), Dot(s, columns[5])}};
    }
  };
  /// Turning at unit rate about x, y, z through the origin; unit velocity along x, y, z.
  static Motion BasisMotion(std::size_t m) {
    const int i = static_cast<int>(m);
    Motion motion;
    (m < 3 ? motion.w[i] : motion.v[i - 3]) = 1;
    return motion;
  }
  static Vector At(const Motion& motion, const Vector& r) { return motion.At(r); }
  /// The wrench of the force f at the point r.
  static Wrench ForceAt(const Vector& r, const Vector& f) { return {Cross(r, f), f}; }

  /// Power of a wrench on a motion [W].
  static double Dot(const Motion& m, const Wrench& f) { return m.w.dot(f.n) + m.v.dot(f.f); }

  /// a x b: how b changes when it is carried along with a.
  static Motion Cross(const Motion& a, const Motion& b) {
    return {Cross(a.w, b.w), Cross(a.w, b.v) + Cross(a.v, b.w)};
  }
  /// a x* f: how the wrench f changes when it is carried along with a.
  static Wrench Cross(const Motion& a, const Wrench& f) {
    return {Cross(a.w, f.n) + Cross(a.v, f.f), Cross(a.w, f.f)};
  }

  /// Inertia of a body about its mass centre, in the body's frame [kg m^2].
  using BodyInertia = SpaceMatrix;
  static BodyInertia NoInertia() { return SpaceMatrix::Zero(); }

  /// Inertia about the origin: mass m, first moment h = m c, and the matrix of second moments
  /// Sigma, the integral of r r^T dm. The usual inertia matrix is tr(Sigma) 1 - Sigma; Sigma moves
  /// to another point without the cross terms, and gives `Bias` its short form.
  struct Inertia {
    double m = 0;
    Vector h = Vector::Zero();
    SpaceMatrix sigma = SpaceMatrix::Zero();
    /// The inertia of a body of mass m, mass centre c, rotation R, and inertia i_c about the mass
    /// centre in its own frame.
    static Inertia OfBody(double m, const Vector& c, const Rotation& R, const BodyInertia& i_c) {
      const double half = 0.5 * i_c.trace();
      const SpaceVector h = m * c;
      // sigma = R (half 1 - i_c) R^T + h c^T, which is symmetric.
      const SpaceMatrix turned = R.m * i_c;
      const auto sigma = [&](int i, int k) {
        return (i == k ? half : 0) - turned.row(i).dot(R.m.row(k)) + h[i] * c[k];
      };
      const double xy = sigma(0, 1), xz = sigma(0, 2), yz = sigma(1, 2);
      return {m, h, {{sigma(0, 0), xy, xz}, {xy, sigma(1, 1), yz}, {xz, yz, sigma(2, 2)}}};
    }
    friend Inertia operator+(const Inertia& a, const Inertia& b) {
      return {a.m + b.m, a.h + b.h, a.sigma + b.sigma};
    }
    [[gnu::always_inline]] friend Wrench operator*(const Inertia& a, const Motion& b) {
      const double xx = a.sigma(0, 0), yy = a.sigma(1, 1), zz = a.sigma(2, 2);
      const double xy = a.sigma(0, 1), xz = a.sigma(0, 2), yz = a.sigma(1, 2);
      const Vector spin{(yy + zz) * b.w[0] - xy * b.w[1] - xz * b.w[2],
                        (xx + zz) * b.w[1] - xy * b.w[0] - yz * b.w[2],
                        (xx + yy) * b.w[2] - xz * b.w[0] - yz * b.w[1]};
      return {spin + Cross(a.h, b.v), a.m * b.v + Cross(b.w, a.h)};
    }
  };

  /// The bias map 2B(I, v) u = v x* I u - I (v x u) + u x* I v [SRW22, Eq. 29]. With v = (w, v_o),
  /// the momentum (n, p) = I v and Jacobi's identity, all terms in the linear part of u cancel.
  /// This remains:
  ///
  ///   2B u = (A u.w, 2 u.w x p),   A = 2 (h . v_o) 1 - 2 v_o h^T - 2 [w] Sigma,
  ///
  /// where [w] is the matrix of the cross product. Both parts add up over bodies.
  struct Bias {
    SpaceMatrix A = SpaceMatrix::Zero();
    Vector twice_p = Vector::Zero();
    static Bias OfBody(const Inertia& inertia, const Motion& v, const Wrench& momentum) {
      const Vector v2 = 2 * v.v;
      SpaceMatrix A = SpaceMatrix::Outer(-v2, inertia.h);
      for (int k = 0; k < 3; ++k) {
        A(k, k) += inertia.h.dot(v2);
        A.col(k) -= 2 * Cross(v.w, inertia.sigma.col(k));
      }
      return {A, 2 * momentum.f};
    }
    friend Bias operator+(const Bias& a, const Bias& c) {
      return {a.A + c.A, a.twice_p + c.twice_p};
    }
    friend Wrench operator*(const Bias& a, const Motion& u) {
      return {a.A * u.w, Cross(u.w, a.twice_p)};
    }
    /// The covector z on angular velocities with z . u.w = s . (2B u) for every motion u, to be
    /// applied by `Apply`.
    [[nodiscard]] Vector TransposeTimes(const Motion& s) const {
      return A.TransposeTimes(s.w) + Cross(twice_p, s.v);
    }
  };
  static double Apply(const Vector& z, const Motion& u) { return z.dot(u.w); }
  static Wrench BiasOfRate(const Bias& bias, const Motion& u) { return bias * u; }
};

/// What the x-z plane keeps of a vector in space.
inline PlaneVector InPlane(const Spatial::Vector& r) { return {r.x(), r.z()}; }

}  // namespace tumbler
