#pragma once

#include <span>
#include <vector>

#include "offline/model/contact_law.h"
#include "offline/model/contact_shape.h"
#include "offline/model/plane.h"
#include "offline/model/tree.h"

namespace tumbler {

/// The intended effect of contact on a robot. It stands for k, c and v_max of the law.
struct ContactIntent {
  /// n: how many contacts the other values are about, each with an equal part of the weight. In the
  /// plane a box that stands on a side has two.
  int resting_contacts = 1;
  /// x_s: how deep the robot sinks with all its weight on n contacts. On fewer, m, it sinks n/m
  /// times as deep; on more by less, but not by n/m: below 3/4 x_s the smoothing makes the layer
  /// softer.
  double static_penetration_m = 1.5e-3;
  /// t_s: the time after which 2 % of a bounce on n contacts are left.
  double settling_time_s = 0.1;
  /// v_max of the law: slower creep counts as sticking.
  double slip_speed_m_per_s = 0.05;
};

/// The shortest settling time [s] that spring and damper can have. It takes critical damping; with
/// more damping they settle more slowly again.
///
///   c <= 2 sqrt(k m)   <=>   t_s >= 4 sqrt(x_s / g)
double ShortestSettlingTime(double static_penetration_m, double gravity_m_per_s2);

/// The law that has the effect `intent` on a robot of mass m under gravity g. Friction and the
/// form of the law are those of `law`.
///
///   k = m g / (n x_s)      rest where n k x_s = m g
///   c = 8 m / (n t_s)      m x'' + n c x' + n k x = 0 decays as exp(-n c t / 2m), to exp(-4) in
///   t_s v_max = slip speed d_on = (n + 2) x_s, d_off = d_on - 3/4 x_s
///
/// The layer leaves room for a stand on one contact, n x_s deep, and for impacts: the whole mass at
/// speed v goes v sqrt(x_s / g) deep on n contacts, less with damping.
ContactLaw LawFor(const ContactIntent& intent, double mass_kg, double gravity_m_per_s2,
                  ContactLaw law = {});

/// The longest integration step [s] that is advisable with a law, for a contact that meets the mass
/// m_e and carries the load N_0:
///
///   h = 1 / max( |lambda|, 1.5 mu N_0 / (v_max m_e) ),   m_e lambda^2 + c lambda + k = 0
///
/// This is the time constant of the spring and damper, or of the friction of a sticking foot if
/// that is shorter. The Runge-Kutta method of order 4 is stable up to 2.78 times the step; the
/// difference is for loads above N_0 in impacts.
double AdvisableStep(const ContactLaw& law, double effective_mass_kg, double load_n);

/// The smallest mass [kg] that a force of any direction on any of the shapes meets at positions q:
/// the inverse of the largest eigenvalue of J M^-1 J^T at the shape's centre, over the free degrees
/// of freedom, in the root's own axes where it floats. Infinite if none of the shapes can move
/// freely.
template <class Space>
double SmallestEffectiveMass(const Tree<Space>& tree,
                             const std::vector<ContactShape<Space>>& shapes,
                             std::span<const double> q);

}  // namespace tumbler
