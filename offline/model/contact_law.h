#pragma once

#include <cmath>

#include "common/core/scalar.h"

namespace tumbler {

/// How the force fades in over the outer part of the compliant layer.
enum class ContactSmoothing {
  kCubic,    ///< [AB04, Eqs. 14-17]: C1.
  kQuintic,  ///< Its second derivative is zero at both ends too: C2, which helps BFGS.
};

/// How the damper enters the normal force.
enum class ContactDamping {
  /// k x - c v with a C1 clamp that keeps the force from pulling.
  kNoPull,
  /// k x - c v with the signed normal velocity: the force pulls when bodies separate fast.
  kSigned,
  /// k x - c |v|, as printed in [AB04, Eq. 13]: adds energy on approach. For comparison only.
  kPrinted,
};

/// The contact law of [AB04, section III], with the paper's names: the parameters of a task's
/// `[contact]`. All pairs of a body and an obstacle share it.
struct ContactLaw {
  /// k > 0. A robot of 1.8 kg on two feet sinks about 1 mm.
  double stiffness_n_per_m = 1e4;
  /// c >= 0.
  double damping_n_s_per_m = 60;
  /// > 0: the distance at which the force begins, which is the thickness of the compliant layer.
  double d_on_m = 4e-3;
  /// 0 <= d_off < d_on: the smoothing is 1 below this distance.
  double d_off_m = 3e-3;
  /// >= 0: the coefficient of friction [AB04, after Eq. 18].
  double mu = 0.3;
  /// > 0: friction is full at this slip speed. Slower creep stands for sticking.
  double v_max_m_per_s = 0.05;
  ContactSmoothing smoothing = ContactSmoothing::kCubic;
  ContactDamping damping_law = ContactDamping::kNoPull;

  bool operator==(const ContactLaw&) const = default;
};

/// The numbers of a law with its quotients and products, as one robot computes them: it divides,
/// and branches.
///
/// How a quotient is made, and in which order factors are multiplied, decides how a force is
/// rounded, and with it every bit of a motion that was found. So the formulas below ask for it:
/// for one robot this class, for robots in lanes LaneContact (scene/lane_contact.h), which
/// multiplies by inverses and cannot branch.
class OneContact {
 public:
  explicit OneContact(const ContactLaw& law) : law_(law) {}

  [[nodiscard]] ContactSmoothing smoothing() const { return law_.smoothing; }
  [[nodiscard]] ContactDamping damping_law() const { return law_.damping_law; }
  [[nodiscard]] double k() const { return law_.stiffness_n_per_m; }
  [[nodiscard]] double c() const { return law_.damping_n_s_per_m; }
  [[nodiscard]] double width() const { return law_.d_on_m - law_.d_off_m; }

  /// Whether the force may still fade in at the depth x, so that the formula for it is needed.
  [[nodiscard]] bool MayFade(double x) const { return x < width(); }
  /// x in widths of the part of the layer in which the force fades in, 0 to 1.
  [[nodiscard]] double FadingAt(double x) const { return x / width(); }
  /// Whether the force y may be in the part where the clamp against pulling is bent.
  [[nodiscard]] bool MayBend(double y) const { return y < k() * width(); }
  /// y in units of the force where that part ends, 0 to 1.
  [[nodiscard]] double BendAt(double y) const { return y / (k() * width()); }
  [[nodiscard]] static double Product(double x, double y, double z) { return (x * y) * z; }

 private:
  const ContactLaw& law_;
};

/// The formulas of the normal force [N]
///
///   N = beta(d) P(k (d_on - d) - c v),
///
/// with beta of [AB04, Eqs. 14-17], at the distance d [m], x = d_on - d > 0, and the normal
/// velocity v [m/s], positive when separating.
///
/// P is the C1 positive part: with e = k (d_on - d_off), P(y) = 0 for y <= 0, y^2 (2 e - y) / e^2
/// below e, and y above it. Beyond e the law is exactly the linear spring and damper.
///
/// A contact never pulls, and never gains energy: the force at rest has the potential U(d), the
/// integral of beta P(k x) over x, and since P is monotone the rest of the force opposes the
/// velocity.
///
/// Law is OneContact with doubles S, or LaneContact with lanes.

/// beta
template <class Law, class S>
[[gnu::always_inline]] inline S Smoothing(const Law& law, const S& x) {
  if (!law.MayFade(x)) return S(1);
  const S s = law.FadingAt(x);
  if (law.smoothing() == ContactSmoothing::kCubic) return s * s * (S(3) - S(2) * s);
  return s * s * s * (S(10) + s * (S(6) * s - S(15)));
}
/// Its derivative by d.
inline double SmoothingSlope(const OneContact& law, double x) {
  if (!law.MayFade(x)) return 0;
  const double s = law.FadingAt(x);
  if (law.smoothing() == ContactSmoothing::kCubic) return -6 * s * (1 - s) / law.width();
  return -30 * s * s * (1 - s) * (1 - s) / law.width();
}

/// y, of spring and damper.
template <class Law, class S>
[[gnu::always_inline]] inline S SpringAndDamper(const Law& law, const S& x, const S& v) {
  if (law.damping_law() == ContactDamping::kPrinted) [[unlikely]]
    return law.k() * x - law.c() * Max(v, -v);
  return law.k() * x - law.c() * v;
}
/// Its derivative by v.
inline double SpringAndDamperSlope(const OneContact& law, double v) {
  return law.damping_law() == ContactDamping::kPrinted && v < 0 ? law.c() : -law.c();
}

/// P
template <class Law, class S>
[[gnu::always_inline]] inline S WithoutPull(const Law& law, const S& y) {
  if (law.damping_law() != ContactDamping::kNoPull || !law.MayBend(y)) return y;
  const S r = law.BendAt(y);
  return law.Product(y, r, S(2) - r);
}
/// Its derivative.
inline double WithoutPullSlope(const OneContact& law, double y) {
  if (law.damping_law() != ContactDamping::kNoPull || !law.MayBend(y)) return 1;
  const double r = law.BendAt(y);
  return r * (4 - 3 * r);
}

/// N
template <class Law, class S>
[[gnu::always_inline]] inline S NormalForceAt(const Law& law, const S& x, const S& v) {
  return Smoothing(law, x) * WithoutPull(law, SpringAndDamper(law, x, v));
}

/// N and its derivatives.
struct NormalForce {
  double N = 0;
  double N_d = 0;  ///< [N/m]
  double N_v = 0;  ///< [N s/m]
};

inline NormalForce EvaluateNormalForce(const ContactLaw& contact, double d, double v) {
  const double x = contact.d_on_m - d;
  if (!(x > 0)) return {};
  const OneContact law(contact);
  const double y = SpringAndDamper(law, x, v);
  if (law.damping_law() == ContactDamping::kNoPull && y <= 0) return {};
  const double beta = Smoothing(law, x);
  const double P = WithoutPull(law, y);
  const double P_y = WithoutPullSlope(law, y);
  return {beta * P, SmoothingSlope(law, x) * P - beta * P_y * law.k(),
          beta * P_y * SpringAndDamperSlope(law, v)};
}

/// Friction is -mu |N| gamma(v_t / v_max) against the slip v_t [AB04, Eqs. 18-20]. Of a slip in
/// units of v_max, of the size 1 at most, this is gamma over the slip, from the slip's square.
template <class S>
[[gnu::always_inline]] inline S FrictionPerSlip(const S& square) {
  return S(1.5) - S(0.5) * square;
}
/// Its derivative.
inline constexpr double kFrictionPerSlip_square = -0.5;

/// gamma of a slip in units of v_max: -1 to 1.
template <class S>
[[gnu::always_inline]] inline S FrictionShare(const S& slip) {
  const S part = Clamp(slip, S(-1), S(1));
  return part * FrictionPerSlip(part * part);
}

/// Friction as a vector is -mu |N| gain(s2) v_t, with the tangential velocity v_t [m/s] and s2 =
/// |v_t|^2: without a unit vector, so that nothing divides by zero at rest.
struct FrictionGain {
  double gain = 0;     ///< gamma(|v_t| / v_max) / |v_t| [s/m]
  double gain_s2 = 0;  ///< Derivative of `gain` by s2 [s^3/m^3].
};

inline FrictionGain EvaluateFrictionGain(const ContactLaw& law, double s2) {
  const double v_max = law.v_max_m_per_s;
  const double r2 = s2 / (v_max * v_max);
  if (r2 < 1)
    return {FrictionPerSlip(r2) / v_max, kFrictionPerSlip_square / (v_max * v_max * v_max)};
  const double inverse = 1 / std::sqrt(s2);
  return {inverse, -0.5 * inverse * inverse * inverse};
}

/// Which formulas of the law hold at the distance d [m], the normal velocity v [m/s] and the square
/// of the tangential one, as a number. Forces are smooth functions of the three while it stays the
/// same.
inline unsigned PieceOf(const ContactLaw& law, double d, double v, double s2) {
  const double x = law.d_on_m - d;
  const double width = law.d_on_m - law.d_off_m;
  const double k = law.stiffness_n_per_m;
  const double y = k * x - law.damping_n_s_per_m * v;
  unsigned piece = 0;
  const auto add = [&](bool holds) { piece = 2 * piece + (holds ? 1 : 0); };
  add(x > 0);
  add(x < width);
  add(s2 < law.v_max_m_per_s * law.v_max_m_per_s);
  switch (law.damping_law) {
    case ContactDamping::kNoPull:
      add(y > 0);
      add(y < k * width);
      break;
    case ContactDamping::kPrinted:
      add(v < 0);
      break;
    case ContactDamping::kSigned:
      break;
  }
  return piece;
}

}  // namespace tumbler
