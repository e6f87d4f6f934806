#include "offline/model/contact_intent.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "offline/model/hybrid_dynamics.h"
#include "offline/model/plane.h"
#include "offline/model/spatial.h"
#include "offline/model/symmetric_eigen.h"

namespace tumbler {

double ShortestSettlingTime(double static_penetration_m, double gravity_m_per_s2) {
  return 4 * std::sqrt(static_penetration_m / gravity_m_per_s2);
}

ContactLaw LawFor(const ContactIntent& intent, double mass_kg, double gravity_m_per_s2,
                  ContactLaw law) {
  const double n = intent.resting_contacts;
  law.stiffness_n_per_m = mass_kg * gravity_m_per_s2 / (n * intent.static_penetration_m);
  law.damping_n_s_per_m = 8 * mass_kg / (n * intent.settling_time_s);
  law.v_max_m_per_s = intent.slip_speed_m_per_s;
  law.d_on_m = (n + 2) * intent.static_penetration_m;
  law.d_off_m = law.d_on_m - 0.75 * intent.static_penetration_m;
  return law;
}

double AdvisableStep(const ContactLaw& law, double effective_mass_kg, double load_n) {
  const double m = effective_mass_kg;
  const double half = law.damping_n_s_per_m / (2 * m);
  const double spring = law.stiffness_n_per_m / m;
  const double fastest =
      half * half > spring ? half + std::sqrt(half * half - spring) : std::sqrt(spring);
  const double friction = 1.5 * law.mu * load_n / (law.v_max_m_per_s * m);
  return 1 / std::max(fastest, friction);
}

template <class Space>
double SmallestEffectiveMass(const Tree<Space>& tree,
                             const std::vector<ContactShape<Space>>& shapes,
                             std::span<const double> q) {
  using Vector = typename Space::Vector;
  constexpr int kDimension = Vector::RowsAtCompileTime;
  HybridDynamics<Space> dynamics(tree);
  const std::vector<double> zero(tree.dofs.size());
  const auto accelerations = [&](int body, const Vector& point, const Vector& force) {
    std::vector<double> qdd = zero, tau = zero;
    dynamics.SetState(q, zero);
    dynamics.AddWrench(body, Space::ForceAt(point, force));
    dynamics.Solve(qdd, tau);
    return qdd;
  };
  double largest = 0;
  for (const ContactShape<Space>& own : shapes) {
    dynamics.SetState(q, zero);
    const Vector point =
        dynamics.position(own.body) + dynamics.rotation(own.body) * own.shape.centre;
    const std::vector<double> rest = accelerations(own.body, point, Vector::Zero());
    SmallMatrix inverse(kDimension, kDimension);
    for (int i = 0; i < kDimension; ++i) {
      std::vector<double> change = accelerations(own.body, point, Vector::Unit(i));
      for (std::size_t j = 0; j < change.size(); ++j) change[j] -= rest[j];
      dynamics.SetState(q, change);  // With these as velocities, a point's velocity is J qdd.
      const Vector velocity = dynamics.velocity(own.body).At(point);
      for (int k = 0; k < kDimension; ++k) inverse(k, i) = velocity[k];
    }
    largest = std::max(largest, DecomposeSymmetric(inverse).values[kDimension - 1]);
  }
  return largest > 0 ? 1 / largest : std::numeric_limits<double>::infinity();
}

template double SmallestEffectiveMass(const Tree<Plane>&, const std::vector<ContactShape<Plane>>&,
                                      std::span<const double>);
template double SmallestEffectiveMass(const Tree<Spatial>&,
                                      const std::vector<ContactShape<Spatial>>&,
                                      std::span<const double>);

}  // namespace tumbler
