#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "offline/scene/ground_spread.h"
#include "offline/scene/scene.h"
#include "offline/scene/space_scene.h"

namespace tumbler {

struct RobotPosterior;

/// By how much robots differ from the model: standard deviations, each >= 0, but for the ground,
/// whose properties may have a range. Factors are of the model's value.
struct Spreads {
  double mass = 0.05;            ///< Factor of each link's mass and inertia.
  double inertia = 0;            ///< Factor of each link's inertia, besides.
  double mass_centre_m = 0;      ///< Of each link's centre of mass, along the link's x.
  double length = 0;             ///< Factor of each link's x: joints, contacts and centre of mass.
  GroundSpread friction = 0.2;   ///< Factor of mu, or a range of it.
  GroundSpread stiffness = 0.2;  ///< Factor of the ground's stiffness, or a range of it.
  GroundSpread damping = 0.2;    ///< Factor of the ground's damping, or a range of it.
  double gain = 0;               ///< Factor of each joint's kp and kd.
  double torque_limit = 0;       ///< Factor of each motor's torque limit.
  double slope_rad = 0;          ///< Of the ground, upwards to the right.
  /// Of what setpoints are late by, besides the frames' own time: the magnitude of a normal number.
  double delay_s = 0;
  double zero_rad = 0;          ///< Of what each encoder reads at the joint's zero.
  double start_rad = 0;         ///< Of each joint's position when the first motion begins.
  double start_rate_rad_s = 0;  ///< Of the rates of pitch and joints, likewise.
  /// What is known of the one robot of which all are: its mean and covariance take the place of the
  /// deviations above, but for those of delay and start. Null: nothing.
  std::shared_ptr<const RobotPosterior> posterior = nullptr;

  /// Lets robots have the model's ground.
  void LeaveGround() { friction = stiffness = damping = 0; }
  bool operator==(const Spreads&) const = default;
};

/// One robot in numbers: by how much it departs from the model.
struct RobotVariation {
  struct Link {
    double mass = 1, inertia = 1, length = 1;  ///< Factors.
    double mass_centre_m = 0;
  };
  struct Joint {
    double gain = 1, torque_limit = 1;  ///< Factors.
    double zero_rad = 0;                ///< What the encoder reads more than the true angle.
    double torque = 1;  ///< Factor of all that the motor exerts, which its drive ignores.
    /// Added to the time constant with which its drive sees the velocity; >= 0.
    double velocity_filter_s = 0;
    double torque_lag_s = 0;   ///< Added to the time constant of its current loop; >= 0.
    double rotor_inertia = 1;  ///< Factor.
    /// Added to the friction of the joint. Neither becomes negative.
    double viscous_friction_nm_s_per_rad = 0, dry_friction_nm = 0;
    double start_rad = 0, start_rate_rad_s = 0;  ///< Added when the first motion begins.
  };
  std::vector<Link> links;    ///< In the order of the robot's bodies, the root that moves first.
  std::vector<Joint> joints;  ///< In the robot's order.
  double friction = 1, stiffness = 1, damping = 1;
  double creep_speed = 1;  ///< Factor of the speed from which on friction is full.
  double slope_rad = 0;
  double delay_s = 0;                 ///< >= 0
  double start_pitch_rate_rad_s = 0;  ///< Added when the first motion begins.

  /// What is added to the positions and rates of all degrees of freedom (x, z and pitch of the
  /// root, unless it is fixed, in space x, y, z, pitch, roll and yaw; then the joints) when the
  /// first motion begins.
  [[nodiscard]] std::vector<double> StartPositions(const PlanarRobot& robot) const;
  [[nodiscard]] std::vector<double> StartPositions(const SpaceRobot& robot) const;
  [[nodiscard]] std::vector<double> StartRates(const PlanarRobot& robot) const;
  [[nodiscard]] std::vector<double> StartRates(const SpaceRobot& robot) const;

  /// A departure by itself, in standard deviations.
  struct Deviate {
    std::string name;  ///< e.g. "mass of leg1_link"
    double sigma = 0;
  };
  std::vector<Deviate> deviates;  ///< Of every spread that is not 0, in a fixed order.
};

/// Draws robot number `index` of a study. The result depends on nothing but the arguments.
///
/// Every quantity is independent of the others. With a standard deviation it is normal, and a
/// factor below 0.05 is drawn again. Within a range friction is uniform, stiffness and damping are
/// so in their logarithms, and so is every factor either way. The departure of such a number is
/// that from its range's middle, in standard deviations.
/// @param scale  multiplies every standard deviation, and the logarithm of the factor by which what
///               is drawn from a range departs from the model: of 0 robots are the model, of 2 a
///               factor of ten is one of a hundred.
/// @pre MistakeInRanges finds none.
RobotVariation DrawRobot(const Scene& scene, const Spreads& spreads, double scale,
                         std::uint64_t seed, std::uint64_t index);

/// Why robots cannot differ from this ground by a range, which is of factors of what is not 0;
/// empty: they can.
std::string MistakeInRanges(const ContactLaw& model, const Spreads& spreads);

/// How much finer than for the model the steps of a simulation in lanes have to be, so that the
/// stiffest and most damped ground in the ranges does not shake: 1 where no property has a range.
int FinerStepsFor(const ContactLaw& model, const Spreads& spreads, double scale);
/// The same for ground with these factors of the model's.
int FinerStepsFor(double stiffness, double damping);

/// The scene with this robot and its ground. The slope is that of gravity: the ground stays where
/// it is. What joints, delay and the start have of it is no part of a scene.
Scene Varied(Scene scene, const RobotVariation& variation);

/// The same of a robot in space. It differs in the masses, inertias and centres of mass of its
/// links, and in its ground.
RobotVariation DrawRobot(const SpaceScene& scene, const Spreads& spreads, double scale,
                         std::uint64_t seed, std::uint64_t index);
SpaceScene Varied(SpaceScene scene, const RobotVariation& variation);

}  // namespace tumbler
