#pragma once

#include <cmath>

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

/// The normal force N [N] at the distance d [m], and its derivatives. v is the normal velocity
/// [m/s], positive when separating.
struct NormalForce {
  double N = 0;
  double N_d = 0;  ///< [N/m]
  double N_v = 0;  ///< [N s/m]
};

/// N = beta(d) P(k (d_on - d) - c v), with beta of [AB04, Eqs. 14-17].
///
/// P is the C1 positive part: with e = k (d_on - d_off), P(y) = 0 for y <= 0, y^2 (2 e - y) / e^2
/// below e, and y above it. Beyond e the law is exactly the linear spring and damper.
///
/// A contact never pulls, and never gains energy: the force at rest has the potential U(d), the
/// integral of beta P(k x) over x = d_on - d, and since P is monotone the rest of the force opposes
/// the velocity.
inline NormalForce EvaluateNormalForce(const ContactLaw& law, double d, double v) {
  NormalForce out;
  const double x = law.d_on_m - d;
  if (!(x > 0)) return out;
  const double width = law.d_on_m - law.d_off_m;
  double beta = 1;
  double beta_d = 0;
  if (x < width) {
    const double s = x / width;
    if (law.smoothing == ContactSmoothing::kCubic) {
      beta = s * s * (3 - 2 * s);
      beta_d = -6 * s * (1 - s) / width;
    } else {
      beta = s * s * s * (10 + s * (6 * s - 15));
      beta_d = -30 * s * s * (1 - s) * (1 - s) / width;
    }
  }
  const double k = law.stiffness_n_per_m;
  const double c = law.damping_n_s_per_m;
  double y = k * x - c * v;
  double y_v = -c;
  double P = y;
  double P_y = 1;
  if (law.damping_law == ContactDamping::kPrinted) {
    y = k * x - c * std::abs(v);
    y_v = v < 0 ? c : -c;
    P = y;
  } else if (law.damping_law == ContactDamping::kNoPull) {
    const double e = k * width;
    if (y <= 0) return out;
    if (y < e) {
      const double r = y / e;
      P = y * r * (2 - r);
      P_y = r * (4 - 3 * r);
    }
  }
  out.N = beta * P;
  out.N_d = beta_d * P - beta * P_y * k;
  out.N_v = beta * P_y * y_v;
  return out;
}

/// Friction is -mu |N| gain(s2) v_t, with the tangential velocity v_t [m/s] and s2 = |v_t|^2. This
/// is [AB04, Eqs. 18-20] without a unit vector, so that nothing divides by zero at rest.
struct FrictionGain {
  double gain = 0;     ///< gamma(|v_t|) / |v_t| [s/m]
  double gain_s2 = 0;  ///< Derivative of `gain` by s2 [s^3/m^3].
};

inline FrictionGain EvaluateFrictionGain(const ContactLaw& law, double s2) {
  const double v_max = law.v_max_m_per_s;
  const double r2 = s2 / (v_max * v_max);
  if (r2 < 1) return {(1.5 - 0.5 * r2) / v_max, -0.5 / (v_max * v_max * v_max)};
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
