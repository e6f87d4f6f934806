#include "offline/scene/variation.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/scene/motor.h"
#include "offline/scene/normal.h"
#include "offline/scene/robot_posterior.h"

namespace tumbler {
namespace {

/// base^exponent, exactly base where the exponent is 1.
double Raised(double base, double exponent) {
  return exponent == 1 ? base : portable::Power(base, exponent);
}

/// Draws departures and notes them.
struct Drawer {
  Normal normal;
  double scale;
  std::vector<RobotVariation::Deviate>& deviates;

  double Shift(double spread, const std::string& name) {
    if (spread == 0) return 0;
    const double sigma = scale * normal.Draw();
    deviates.push_back({name, sigma});
    return spread * sigma;
  }
  double Factor(double spread, const std::string& name) {
    if (spread == 0) return 1;
    while (true) {
      const double sigma = scale * normal.Draw();
      if (1 + spread * sigma < 0.05) continue;
      deviates.push_back({name, sigma});
      return 1 + spread * sigma;
    }
  }
  /// @param model        the model's value.
  /// @param logarithmic  whether it is the logarithms of a range that are uniform.
  double Ground(const GroundSpread& spread, double model, bool logarithmic,
                const std::string& name) {
    if (const double* deviation = spread.deviation()) return Factor(*deviation, name);
    const double part = normal.DrawUniform();
    deviates.push_back({name, scale * std::sqrt(3.0) * (2 * part - 1)});
    if (const GroundSpread::EitherWay* either = spread.either_way())
      return Raised(either->most, scale * (2 * part - 1));
    const auto [from, to] = *spread.between();
    const double value = logarithmic ? from * Raised(to / from, part) : from + part * (to - from);
    return Raised(value / model, scale);
  }
};

}  // namespace

namespace {

constexpr std::size_t kPitchInPlane = 2, kPitchInSpace = 3;

std::vector<double> PositionsOf(const RobotVariation& variation, int root_dofs) {
  std::vector<double> q(Index(root_dofs), 0.0);
  for (const RobotVariation::Joint& joint : variation.joints) q.push_back(joint.start_rad);
  return q;
}

std::vector<double> RatesOf(const RobotVariation& variation, int root_dofs, std::size_t pitch) {
  std::vector<double> v(Index(root_dofs), 0.0);
  if (!v.empty()) v[pitch] = variation.start_pitch_rate_rad_s;
  for (const RobotVariation::Joint& joint : variation.joints) v.push_back(joint.start_rate_rad_s);
  return v;
}

}  // namespace

std::vector<double> RobotVariation::StartPositions(const PlanarRobot& robot) const {
  return PositionsOf(*this, robot.root_dofs);
}
std::vector<double> RobotVariation::StartPositions(const SpaceRobot& robot) const {
  return PositionsOf(*this, robot.root_dofs);
}
std::vector<double> RobotVariation::StartRates(const PlanarRobot& robot) const {
  return RatesOf(*this, robot.root_dofs, kPitchInPlane);
}
std::vector<double> RobotVariation::StartRates(const SpaceRobot& robot) const {
  return RatesOf(*this, robot.root_dofs, kPitchInSpace);
}

namespace {

/// A robot of which something is known, with the delay and the start of another that is drawn.
RobotVariation DrawKnown(const Scene& scene, const Spreads& spreads, double scale,
                         std::uint64_t seed, std::uint64_t index) {
  const RobotPosterior& known = *spreads.posterior;
  Spreads others;
  others.mass = 0;
  others.LeaveGround();
  others.delay_s = spreads.delay_s;
  others.torque_limit = spreads.torque_limit;
  others.start_rad = spreads.start_rad;
  others.start_rate_rad_s = spreads.start_rate_rad_s;
  const RobotVariation other = DrawRobot(scene, others, scale, seed, index);
  constexpr std::uint64_t kOtherSeed = 0x5bd1e995;  // so that the numbers are no longer the same
  const std::vector<double> coordinates = known.Draw(scale, seed ^ kOtherSeed, index);
  RobotVariation v = VariationOf(scene, known.quantities, coordinates);
  v.delay_s = other.delay_s;
  v.start_pitch_rate_rad_s = other.start_pitch_rate_rad_s;
  for (std::size_t j = 0; j < v.joints.size(); ++j) {
    v.joints[j].torque_limit = other.joints[j].torque_limit;
    v.joints[j].start_rad = other.joints[j].start_rad;
    v.joints[j].start_rate_rad_s = other.joints[j].start_rate_rad_s;
  }
  for (std::size_t i = 0; i < known.size(); ++i) {
    const double deviation = known.DeviationOf(i);
    if (deviation > 0) {
      v.deviates.push_back(
          {NameOf(known.quantities[i]), (coordinates[i] - known.mean[i]) / deviation});
    }
  }
  return v;
}

}  // namespace

namespace {

/// @param robot  in the plane or in space.
template <class Robot>
RobotVariation DrawAny(const Robot& robot, const ContactLaw& contact, const Spreads& spreads,
                       double scale, std::uint64_t seed, std::uint64_t index) {
  RobotVariation v;
  Drawer draw{Normal(seed, index), scale, v.deviates};
  for (std::size_t dof = Index(robot.first_body()); dof < robot.body_names.size(); ++dof) {
    const std::string of = " of " + robot.body_names[dof];
    RobotVariation::Link& link = v.links.emplace_back();
    link.mass = draw.Factor(spreads.mass, "mass" + of);
    link.inertia = draw.Factor(spreads.inertia, "inertia" + of);
    link.length = draw.Factor(spreads.length, "length" + of);
    link.mass_centre_m = draw.Shift(spreads.mass_centre_m, "mass centre" + of);
  }
  for (std::size_t j = 0; j < robot.joint_count(); ++j) {
    const std::string of = " of " + robot.tree.dofs[robot.DofOfJoint(j)].name;
    RobotVariation::Joint& joint = v.joints.emplace_back();
    joint.gain = draw.Factor(spreads.gain, "gains" + of);
    joint.torque_limit = draw.Factor(spreads.torque_limit, "torque limit" + of);
  }
  v.friction = draw.Ground(spreads.friction, contact.mu, false, "friction");
  v.stiffness = draw.Ground(spreads.stiffness, contact.stiffness_n_per_m, true, "stiffness");
  v.damping = draw.Ground(spreads.damping, contact.damping_n_s_per_m, true, "damping");
  v.slope_rad = draw.Shift(spreads.slope_rad, "slope");
  // What is drawn last leaves everything before as it is.
  v.delay_s = std::abs(draw.Shift(spreads.delay_s, "delay"));
  for (std::size_t j = 0; j < robot.joint_count(); ++j) {
    const std::string of = " of " + robot.tree.dofs[robot.DofOfJoint(j)].name;
    RobotVariation::Joint& joint = v.joints[j];
    joint.zero_rad = draw.Shift(spreads.zero_rad, "zero" + of);
    joint.start_rad = draw.Shift(spreads.start_rad, "start" + of);
    joint.start_rate_rad_s = draw.Shift(spreads.start_rate_rad_s, "start rate" + of);
  }
  if (robot.root_dofs > 0)
    v.start_pitch_rate_rad_s = draw.Shift(spreads.start_rate_rad_s, "start rate of pitch");
  return v;
}

}  // namespace

RobotVariation DrawRobot(const Scene& scene, const Spreads& spreads, double scale,
                         std::uint64_t seed, std::uint64_t index) {
  if (spreads.posterior != nullptr) return DrawKnown(scene, spreads, scale, seed, index);
  return DrawAny(scene.robot, scene.contact, spreads, scale, seed, index);
}

RobotVariation DrawRobot(const SpaceScene& scene, const Spreads& spreads, double scale,
                         std::uint64_t seed, std::uint64_t index) {
  return DrawAny(scene.robot, scene.contact, spreads, scale, seed, index);
}

std::string MistakeInRanges(const ContactLaw& model, const Spreads& spreads) {
  const auto mistake = [](const GroundSpread& spread, double value, const char* name) {
    if (spread.deviation() != nullptr || value != 0) return std::string();
    return fmt::format(
        "{} has a range, {}, but the contact law's is 0, of which nothing is a factor; give the "
        "task another one, or robots no range",
        name, ToText(spread));
  };
  std::string text = mistake(spreads.friction, model.mu, "friction");
  if (text.empty()) text = mistake(spreads.damping, model.damping_n_s_per_m, "damping");
  return text;
}

int FinerStepsFor(double stiffness, double damping) {
  // Usual steps take robots that differ by usual spreads at twice their size.
  constexpr double kUsual = 2.5;
  const double finer = std::max(std::sqrt(stiffness / kUsual), damping / kUsual);
  return std::max(1, static_cast<int>(std::ceil(finer)));
}

int FinerStepsFor(const ContactLaw& model, const Spreads& spreads, double scale) {
  const auto most = [scale](const GroundSpread& spread, double value) {
    if (const GroundSpread::EitherWay* either = spread.either_way())
      return Raised(either->most, scale);
    if (const GroundSpread::Between* between = spread.between())
      return Raised(std::max(between->to / value, 1.0), scale);
    return 1.0;
  };
  if (spreads.posterior != nullptr) {
    double stiffness = 1, damping = 1;
    for (std::size_t i = 0; i < spreads.posterior->size(); ++i) {
      const RobotQuantity::Kind kind = spreads.posterior->quantities[i].kind;
      constexpr double kFar = 3;
      const double at_most = ValueOfCoordinate(
          kind, spreads.posterior->mean[i] + kFar * scale * spreads.posterior->DeviationOf(i));
      if (kind == RobotQuantity::Kind::kStiffness) stiffness = at_most / model.stiffness_n_per_m;
      if (kind == RobotQuantity::Kind::kDamping) damping = at_most / model.damping_n_s_per_m;
    }
    return FinerStepsFor(stiffness, damping);
  }
  return FinerStepsFor(most(spreads.stiffness, model.stiffness_n_per_m),
                       most(spreads.damping, model.damping_n_s_per_m));
}

namespace {

void VaryGround(const RobotVariation& v, ContactLaw& contact) {
  contact.mu *= v.friction;
  contact.v_max_m_per_s *= v.creep_speed;
  contact.stiffness_n_per_m *= v.stiffness;
  contact.damping_n_s_per_m *= v.damping;
}

}  // namespace

Scene Varied(Scene scene, const RobotVariation& v) {
  PlanarRobot& robot = scene.robot;
  const std::size_t first = Index(robot.first_body());
  // What is fixed to the world is as in the file.
  const auto length_of = [&v, first](int body) {
    return body < static_cast<int>(first) ? 1.0 : v.links[Index(body) - first].length;
  };
  for (std::size_t i = first; i < robot.tree.dofs.size(); ++i) {
    Dof<Plane>& dof = robot.tree.dofs[i];
    const RobotVariation::Link& link = v.links[i - first];
    dof.mass_kg *= link.mass;
    dof.inertia_kg_m2 *= link.mass * link.inertia;
    dof.mass_centre.x() = link.length * dof.mass_centre.x() + link.mass_centre_m;
    dof.offset.x() *= length_of(dof.parent);
  }
  for (PlanarLink& link : robot.links) {
    const double length = length_of(link.body);
    for (std::array<double, 2>* place : {&link.origin_m, &link.x_axis, &link.z_axis})
      (*place)[0] *= length;
  }
  for (ContactShape<Plane>& shape : robot.shapes) shape.shape.centre.x() *= length_of(shape.body);
  for (OwnShape& own : robot.own_shapes) own.shape.centre.x() *= length_of(own.body);
  for (std::size_t j = 0; j < v.joints.size(); ++j) {
    const RobotVariation::Joint& joint = v.joints[j];
    const std::size_t place = robot.DofOfJoint(j);
    Dof<Plane>& dof = robot.tree.dofs[place];
    dof.rotor_inertia_kg_m2 *= joint.rotor_inertia;
    // What the motor has by default comes to this later, and stays.
    dof.damping_nm_s_per_rad =
        std::max(dof.damping_nm_s_per_rad + joint.viscous_friction_nm_s_per_rad,
                 -kUsualViscousFriction_nm_s_per_rad);
    double& dry =
        scene.motors.empty() ? robot.dry_friction_nm[place] : scene.motors[j].dry_friction_nm;
    dry = std::max(0.0, dry + joint.dry_friction_nm);
  }
  VaryGround(v, scene.contact);
  Tilt(robot, v.slope_rad);
  return scene;
}

SpaceScene Varied(SpaceScene scene, const RobotVariation& v) {
  SpaceRobot& robot = scene.robot;
  const std::size_t first = Index(robot.first_body());
  for (std::size_t i = first; i < robot.tree.dofs.size(); ++i) {
    Dof<Spatial>& dof = robot.tree.dofs[i];
    const RobotVariation::Link& link = v.links[i - first];
    dof.mass_kg *= link.mass;
    dof.inertia_kg_m2 = dof.inertia_kg_m2 * (link.mass * link.inertia);
    dof.mass_centre[0] += link.mass_centre_m;
  }
  VaryGround(v, scene.contact);
  Tilt(robot, v.slope_rad);
  return scene;
}

}  // namespace tumbler
