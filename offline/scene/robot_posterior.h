#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "offline/scene/scene.h"
#include "offline/scene/variation.h"

namespace tumbler {

/// What can be known of one robot, or of its ground, that its task does not say.
struct RobotQuantity {
  enum class Kind : std::uint8_t {
    kMass,         ///< Of a link [kg].
    kMassCentre,   ///< Of a link: its centre of mass along the link's x [m].
    kGyration,     ///< Of a link: inertia about its centre of mass, for each kilogram [m^2].
    kFriction,     ///< mu of the ground.
    kStiffness,    ///< Of the ground [N/m].
    kDamping,      ///< Of the ground [N s/m].
    kCreepSpeed,   ///< v_max of the contact law [m/s].
    kSlope,        ///< Of the ground, upwards to the right [rad].
    kZero,         ///< Of a joint: what its encoder reads more than the true angle [rad].
    kViscous,      ///< Of a joint: friction of its motor beside the URDF's damping [N m s/rad].
    kDry,          ///< Of a joint [N m].
    kRotor,        ///< Of all motors: inertia of a rotor, behind the gear [kg m^2].
    kTorque,       ///< Of all motors: what they exert for each N m that their drives reckon with.
    kLag,          ///< Of all drives: how much later than modelled a reply is sampled [s].
    kVelocityLag,  ///< Of all drives: time constant of their velocity's filter [s].
    kTorqueLag,    ///< Of all drives: time constant of their current loop [s].
    kLength,       ///< Of a link: factor of its x, of what the model has.
  };
  static constexpr std::size_t kKinds = 17;
  Kind kind = Kind::kMass;
  std::string of;  ///< The link or joint; empty: of the ground, or of all.

  bool operator==(const RobotQuantity&) const = default;
};

/// What is the same of all quantities of a kind.
struct QuantityFacts {
  RobotQuantity::Kind kind;
  std::string_view name;  ///< In files.
  std::string_view unit;
  /// Whether its coordinate is the logarithm of its value: it is positive, and known to a part of
  /// itself. Otherwise the value is the coordinate.
  bool logarithmic;
  /// Of what is known before anything was measured, in coordinates.
  double prior_sd;
  /// Values that a robot can have. What a twin file or a task takes is not less.
  double least, most;
  /// What it is of: a link, a joint, or nothing by a name.
  enum class Of : std::uint8_t { kNothing, kLink, kJoint } of;

  /// `least` and `most` as coordinates.
  [[nodiscard]] double least_coordinate() const;
  [[nodiscard]] double most_coordinate() const;
};
[[nodiscard]] const QuantityFacts& FactsOf(RobotQuantity::Kind kind);
/// "mass of leg1_link"
[[nodiscard]] std::string NameOf(const RobotQuantity& quantity);

/// A normal distribution of robots: what is known of one of them.
///
/// Coordinates are logarithms or values (QuantityFacts::logarithmic).
struct RobotPosterior {
  std::vector<RobotQuantity> quantities;
  std::vector<double> mean;        ///< In coordinates.
  std::vector<double> covariance;  ///< Row by row.

  [[nodiscard]] std::size_t size() const { return quantities.size(); }
  /// Standard deviation of a coordinate.
  [[nodiscard]] double DeviationOf(std::size_t quantity) const;
  [[nodiscard]] double ValueOf(std::size_t quantity) const;
  /// A robot at `scale` standard deviations: mean + scale * L * (normal numbers), where the
  /// covariance is L L^T. @throws std::invalid_argument  when it is not positive semidefinite.
  [[nodiscard]] std::vector<double> Draw(double scale, std::uint64_t seed,
                                         std::uint64_t index) const;
};

/// What records say of a robot, besides where its posterior is: what a fit of further records has
/// to know to find what one fit of all of them would.
///
/// A posterior's covariance is not enough. It is that of estimates, H^-1 S H^-1, and widened: taken
/// for the inverse of the Hessian H, it weighs the earlier records against the later ones by S.
struct RobotInformation {
  /// Where the objective of the earlier fit, as a quadratic function, has its minimum: the mean, if
  /// nothing had to be positive. In coordinates.
  std::vector<double> centre;
  /// Of that objective, half the sum of squared residuals and priors: its Hessian (the information
  /// of the records and of the first prior), and the covariance of its gradient, row by row.
  std::vector<double> hessian, gradient_covariance;

  [[nodiscard]] bool empty() const { return centre.empty(); }
  bool operator==(const RobotInformation&) const = default;
};

/// The value of a coordinate.
[[nodiscard]] double ValueOfCoordinate(RobotQuantity::Kind kind, double coordinate);
/// The coordinate of a quantity in the scene, as its task has it.
/// @throws std::invalid_argument  when the scene has no such link or joint.
[[nodiscard]] double CoordinateIn(const Scene& scene, const RobotQuantity& quantity);

/// All quantities that a robot in this scene has, but for its lengths and those of its drives
/// (from kTorque on), with what is known of each before anything was measured: independent of one
/// another, about the scene's.
[[nodiscard]] RobotPosterior PriorOf(const Scene& scene);

/// The robot with these coordinates, by how much it departs from the scene's. What no quantity says
/// is the scene's. kLag, which is no part of a robot, is left out.
/// @throws std::invalid_argument  as CoordinateIn.
[[nodiscard]] RobotVariation VariationOf(const Scene& scene,
                                         std::span<const RobotQuantity> quantities,
                                         std::span<const double> coordinates);

/// The lower triangle L with L L^T = a symmetric matrix of n x n numbers, row by row, by Cholesky.
/// A pivot that is rounding below zero is zero, and so is its column. (Eigen's, which fuses
/// operations on aarch64, would draw other robots there.)
/// @throws std::invalid_argument  when it is not positive semidefinite.
[[nodiscard]] std::vector<double> LowerFactor(std::span<const double> symmetric, std::size_t n);

}  // namespace tumbler
