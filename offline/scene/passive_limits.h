#pragma once

#include <span>
#include <string>

#include "offline/model/planar_robot.h"

namespace tumbler {

/// A joint without a motor that is beyond its limits in the URDF. Solver and chains simulate no
/// stop there, so what they show from then on is no motion of the robot.
struct PassiveExcess {
  int dof = -1;   ///< -1: none is.
  double by = 0;  ///< [rad], or [m] where it is prismatic.
  double at = 0;  ///< Where it is.
};

/// The one that is farthest beyond, by more than 1e-6.
/// @param q  positions of all degrees of freedom [rad, m].
PassiveExcess FarthestPassive(const PlanarRobot& robot, std::span<const double> q);

/// "the joint without a motor 'wrist' is at 2.31 rad, beyond its limit of 2 rad"
std::string Describe(const PassiveExcess& excess, const PlanarRobot& robot);

}  // namespace tumbler
