#pragma once

namespace tumbler {

/// How slow a drive's loop may be for its damping.
///
/// A drive computes torque = kp (setpoint - q) + kd (its velocity - qd) + ... once in a period h of
/// its own loop, and holds it until the next. Between two samples the robot's joints move as
/// M(q) qdd = torque, and what else acts is slow. With kd alone a sample makes of the velocities
///
///   qd <- (I - h A Kd) qd,   A = the rows and columns of M^-1 that belong to driven joints,
///
/// where M has the rotors' inertia, and all other degrees of freedom, such as the root, are free:
/// ground that holds them only makes A smaller. The error shrinks where every eigenvalue of
/// I - h A Kd is between -1 and 1, so where
///
///   h lambda < 2,   lambda = the largest eigenvalue of A Kd.
///
/// This is the bound for the exact motion under torque that is held, with kp too: for one joint the
/// characteristic polynomial is z^2 - (2 - h d - h^2 k / 2) z + (1 - h d + h^2 k / 2), d = kd / J,
/// k = kp / J, whose roots are within the unit circle (Jury) exactly where h d < 2 and
/// h < 2 kd / kp. With one gain kd for all joints it reads kd h / J < 2, J = 1 / (largest
/// eigenvalue of A): the least inertia that the drives see. A drive that works with the velocity of
/// the sample before has z^2 - z + h lambda, which is stable only where h lambda < 1: so half of
/// the bound is what should be kept.
///
/// @param rate_per_s  lambda [1/s], 0 or more.
/// @returns the longest stable period of the loop [s]; infinite without damping.
constexpr double LongestDampedPeriod(double rate_per_s) { return 2 / rate_per_s; }

/// The least inertia J at a joint with which a drive's damping kd is stable where its loop takes h:
/// kd h / J = 2.
constexpr double LeastDampedInertia(double kd_nm_s_per_rad, double period_s) {
  return kd_nm_s_per_rad * period_s / 2;
}

/// The part of LongestDampedPeriod that leaves room for a velocity which is a sample old.
inline constexpr double kDampedPart = 0.5;

}  // namespace tumbler
