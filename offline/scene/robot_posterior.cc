#include "offline/scene/robot_posterior.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/scene/motor.h"
#include "offline/scene/normal.h"

namespace tumbler {
namespace {

using Kind = RobotQuantity::Kind;

/// In the order of the kinds. Deviations are those by which robots that were built from one drawing
/// are commonly off: a scale and a ruler would know masses and centres better, and nobody knows the
/// ground.
using Of = QuantityFacts::Of;
constexpr std::array<QuantityFacts, RobotQuantity::kKinds> kFacts = {{
    {Kind::kMass, "mass", "kg", true, 0.10, 1e-6, 1e5, Of::kLink},
    {Kind::kMassCentre, "mass_centre", "m", false, 4e-3, -100, 100, Of::kLink},
    {Kind::kGyration, "gyration", "m^2", true, 0.05, 1e-9, 1e4, Of::kLink},
    {Kind::kFriction, "friction", "", true, 0.4, 1e-6, 10, Of::kNothing},
    {Kind::kStiffness, "stiffness", "N/m", true, 0.4, 1e-3, 1e8, Of::kNothing},
    {Kind::kDamping, "damping", "N s/m", true, 0.4, 1e-6, 1e6, Of::kNothing},
    {Kind::kCreepSpeed, "creep_speed", "m/s", true, 0.2, 1e-6, 10, Of::kNothing},
    {Kind::kSlope, "slope", "rad", false, 5e-3, -1.5, 1.5, Of::kNothing},
    {Kind::kZero, "zero", "rad", false, 5e-3, -3.2, 3.2, Of::kJoint},
    {Kind::kViscous, "viscous_friction", "N m s/rad", true, 0.5, 1e-9, 10, Of::kJoint},
    {Kind::kDry, "dry_friction", "N m", false, 0.04, 0, 5, Of::kJoint},
    {Kind::kRotor, "rotor_inertia", "kg m^2", true, 0.1, 1e-12, 10, Of::kNothing},
    {Kind::kTorque, "torque_factor", "", true, 0.05, 0.1, 10, Of::kNothing},
    {Kind::kLag, "reply_lag", "s", false, 1e-4, -0.1, 0.1, Of::kNothing},
    {Kind::kVelocityLag, "velocity_filter", "s", false, 2e-3, 0, 0.1, Of::kNothing},
    {Kind::kTorqueLag, "torque_lag", "s", false, 5e-4, 0, 0.1, Of::kNothing},
    {Kind::kLength, "length", "", true, 0.01, 0.5, 2, Of::kLink},
}};

std::size_t DofOfLink(const PlanarRobot& robot, const std::string& link) {
  for (std::size_t dof = Index(robot.first_body()); dof < robot.body_names.size(); ++dof) {
    if (robot.body_names[dof] == link) return dof;
  }
  throw std::invalid_argument("the robot has no link '" + link + "'");
}

std::size_t JointNamed(const PlanarRobot& robot, const std::string& joint) {
  for (std::size_t j = 0; j < robot.joint_count(); ++j) {
    if (robot.tree.dofs[robot.DofOfJoint(j)].name == joint) return j;
  }
  throw std::invalid_argument("the robot has no joint '" + joint + "'");
}

/// What motors lose in a scene, beside the URDF's damping.
double ViscousOf(const Scene& scene, std::size_t joint) {
  return scene.motors.empty() ? kUsualViscousFriction_nm_s_per_rad
                              : scene.motors[joint].viscous_friction_nm_s_per_rad;
}
double DryOf(const Scene& scene, std::size_t joint) {
  return scene.motors.empty() ? scene.robot.dry_friction_nm[scene.robot.DofOfJoint(joint)]
                              : scene.motors[joint].dry_friction_nm;
}

/// The value of a quantity in a scene; 0 where a logarithm has nothing to be a factor of.
double ValueIn(const Scene& scene, const RobotQuantity& quantity) {
  const PlanarRobot& robot = scene.robot;
  const auto dof = [&] { return robot.tree.dofs[DofOfLink(robot, quantity.of)]; };
  switch (quantity.kind) {
    case Kind::kMass:
      return dof().mass_kg;
    case Kind::kMassCentre:
      return dof().mass_centre.x();
    case Kind::kGyration:
      return dof().inertia_kg_m2 / dof().mass_kg;
    case Kind::kFriction:
      return scene.contact.mu;
    case Kind::kStiffness:
      return scene.contact.stiffness_n_per_m;
    case Kind::kDamping:
      return scene.contact.damping_n_s_per_m;
    case Kind::kCreepSpeed:
      return scene.contact.v_max_m_per_s;
    case Kind::kViscous:
      return ViscousOf(scene, JointNamed(robot, quantity.of));
    case Kind::kDry:
      return DryOf(scene, JointNamed(robot, quantity.of));
    case Kind::kRotor:
      return robot.tree.dofs[robot.DofOfJoint(0)].rotor_inertia_kg_m2;
    case Kind::kZero:
      static_cast<void>(JointNamed(robot, quantity.of));
      return 0;
    case Kind::kLength:
      static_cast<void>(DofOfLink(robot, quantity.of));
      return 1;
    case Kind::kTorque:
      return 1;
    case Kind::kSlope:
    case Kind::kLag:
    case Kind::kVelocityLag:
    case Kind::kTorqueLag:
      return 0;
  }
  return 0;
}

}  // namespace

const QuantityFacts& FactsOf(RobotQuantity::Kind kind) {
  return kFacts[static_cast<std::size_t>(kind)];
}

double QuantityFacts::least_coordinate() const {
  return logarithmic ? portable::Log(least) : least;
}
double QuantityFacts::most_coordinate() const { return logarithmic ? portable::Log(most) : most; }

std::string NameOf(const RobotQuantity& quantity) {
  std::string name(FactsOf(quantity.kind).name);
  std::ranges::replace(name, '_', ' ');
  return quantity.of.empty() ? name : name + " of " + quantity.of;
}

double ValueOfCoordinate(Kind kind, double coordinate) {
  return FactsOf(kind).logarithmic ? portable::Exp(coordinate) : coordinate;
}

double RobotPosterior::DeviationOf(std::size_t quantity) const {
  return std::sqrt(std::max(0.0, covariance[quantity * size() + quantity]));
}

double RobotPosterior::ValueOf(std::size_t quantity) const {
  return ValueOfCoordinate(quantities[quantity].kind, mean[quantity]);
}

std::vector<double> LowerFactor(std::span<const double> symmetric, std::size_t n) {
  std::vector<double> lower(n * n, 0.0);
  for (std::size_t j = 0; j < n; ++j) {
    double pivot = symmetric[j * n + j];
    for (std::size_t k = 0; k < j; ++k) pivot -= lower[j * n + k] * lower[j * n + k];
    const double rounding = 1e-9 * std::abs(symmetric[j * n + j]);
    if (!(pivot >= -rounding)) {
      throw std::invalid_argument(
          fmt::format("the covariance is not positive semidefinite, from its row {} on", j + 1));
    }
    const double root = pivot > rounding ? std::sqrt(pivot) : 0.0;
    lower[j * n + j] = root;
    if (root == 0) continue;
    for (std::size_t i = j + 1; i < n; ++i) {
      double sum = symmetric[i * n + j];
      for (std::size_t k = 0; k < j; ++k) sum -= lower[i * n + k] * lower[j * n + k];
      lower[i * n + j] = sum / root;
    }
  }
  return lower;
}

std::vector<double> RobotPosterior::Draw(double scale, std::uint64_t seed,
                                         std::uint64_t index) const {
  const std::size_t n = size();
  const std::vector<double> lower = LowerFactor(covariance, n);
  Normal normal(seed, index);
  std::vector<double> numbers, coordinates = mean;
  for (std::size_t i = 0; i < n; ++i) numbers.push_back(scale * normal.Draw());
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k <= i; ++k) coordinates[i] += lower[i * n + k] * numbers[k];
  }
  return coordinates;
}

double CoordinateIn(const Scene& scene, const RobotQuantity& quantity) {
  const double value = ValueIn(scene, quantity);
  if (!FactsOf(quantity.kind).logarithmic) return value;
  if (!(value > 0)) {
    throw std::invalid_argument(
        fmt::format("the {} is 0 in the task; it has to be above, to be a factor of something",
                    NameOf(quantity)));
  }
  return portable::Log(value);
}

RobotPosterior PriorOf(const Scene& scene) {
  RobotPosterior prior;
  const PlanarRobot& robot = scene.robot;
  const auto add = [&](Kind kind, const std::string& of) {
    const RobotQuantity quantity{kind, of};
    if (FactsOf(kind).logarithmic && !(ValueIn(scene, quantity) > 0)) return;
    prior.quantities.push_back(quantity);
  };
  std::vector<std::string> links, joints;
  for (std::size_t dof = Index(robot.first_body()); dof < robot.body_names.size(); ++dof)
    links.push_back(robot.body_names[dof]);
  for (std::size_t j = 0; j < robot.joint_count(); ++j)
    joints.push_back(robot.tree.dofs[robot.DofOfJoint(j)].name);
  for (const Kind kind : {Kind::kMass, Kind::kMassCentre, Kind::kGyration}) {
    for (const std::string& link : links) add(kind, link);
  }
  // A link without mass has no gyration, and a robot in the air no ground.
  if (!scene.obstacles.empty()) {
    for (const Kind kind :
         {Kind::kFriction, Kind::kStiffness, Kind::kDamping, Kind::kCreepSpeed, Kind::kSlope}) {
      add(kind, "");
    }
  }
  for (const Kind kind : {Kind::kZero, Kind::kViscous, Kind::kDry}) {
    for (const std::string& joint : joints) add(kind, joint);
  }
  if (!joints.empty()) add(Kind::kRotor, "");
  const std::size_t n = prior.size();
  prior.covariance.assign(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    const double sd = FactsOf(prior.quantities[i].kind).prior_sd;
    prior.covariance[i * n + i] = sd * sd;
    prior.mean.push_back(CoordinateIn(scene, prior.quantities[i]));
  }
  return prior;
}

RobotVariation VariationOf(const Scene& scene, std::span<const RobotQuantity> quantities,
                           std::span<const double> coordinates) {
  const PlanarRobot& robot = scene.robot;
  const std::size_t first = Index(robot.first_body());
  RobotVariation v;
  v.links.resize(robot.body_names.size() - first);
  v.joints.resize(robot.joint_count());
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const RobotQuantity& quantity = quantities[i];
    const double value = ValueOfCoordinate(quantity.kind, coordinates[i]);
    const auto link = [&]() -> RobotVariation::Link& {
      return v.links[DofOfLink(robot, quantity.of) - first];
    };
    const auto joint = [&]() -> RobotVariation::Joint& {
      return v.joints[JointNamed(robot, quantity.of)];
    };
    const auto factor = [&] { return value / ValueIn(scene, quantity); };
    switch (quantity.kind) {
      case Kind::kMass:
        link().mass = factor();
        break;
      case Kind::kMassCentre:
        link().mass_centre_m += value - ValueIn(scene, quantity);
        break;
      case Kind::kGyration:
        link().inertia = factor();
        break;
      case Kind::kFriction:
        v.friction = factor();
        break;
      case Kind::kStiffness:
        v.stiffness = factor();
        break;
      case Kind::kDamping:
        v.damping = factor();
        break;
      case Kind::kCreepSpeed:
        v.creep_speed = factor();
        break;
      case Kind::kSlope:
        v.slope_rad = value;
        break;
      case Kind::kZero:
        joint().zero_rad = value;
        break;
      case Kind::kViscous:
        joint().viscous_friction_nm_s_per_rad = value - ValueIn(scene, quantity);
        break;
      case Kind::kDry:
        joint().dry_friction_nm = std::max(0.0, value) - ValueIn(scene, quantity);
        break;
      case Kind::kRotor:
        for (RobotVariation::Joint& each : v.joints) each.rotor_inertia = factor();
        break;
      case Kind::kVelocityLag:
        for (RobotVariation::Joint& each : v.joints) each.velocity_filter_s = std::max(0.0, value);
        break;
      case Kind::kTorqueLag:
        for (RobotVariation::Joint& each : v.joints) each.torque_lag_s = std::max(0.0, value);
        break;
      case Kind::kLength:
        link().length = value;
        // The centre of mass is where its own quantity says.
        link().mass_centre_m -=
            (value - 1) * robot.tree.dofs[DofOfLink(robot, quantity.of)].mass_centre.x();
        break;
      case Kind::kTorque:
        for (RobotVariation::Joint& each : v.joints) each.torque = value;
        break;
      case Kind::kLag:
        break;
    }
  }
  return v;
}

}  // namespace tumbler
