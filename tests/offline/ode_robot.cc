#include "tests/offline/ode_robot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "common/core/index.h"
#include "common/files/sequence_toml.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/programs/mjcf.h"

namespace tumbler::testing {
namespace {

constexpr std::size_t kRoot = 2;  ///< The degree of freedom that moves the root: its pitch.

/// The engine begins once, and ends with the program.
void BeginOde() {
  static const int begun = dInitODE2(0);
  if (begun == 0) throw std::runtime_error("ODE does not begin");
}

/// An angle of a body about z.
double AngleOf(dBodyID body) {
  const dReal* q = dBodyGetQuaternion(body);
  return 2 * std::atan2(q[3], q[0]);
}

}  // namespace

OdeRobot::OdeRobot(const SimulatedMotion& motion, const DriveGains& gains, const OdeGround& ground,
                   const std::vector<double>& mass_factors, double step_s)
    : robot_(motion.scene().robot), gains_(gains), step_s_(step_s) {
  BeginOde();
  const Scene& scene = motion.scene();
  const Problem& problem = motion.ProblemAt(motion.file().graph.start);
  if (robot_.root_dofs != 3 || robot_.hinged() || !robot_.passive.empty() || !scene.motors.empty())
    throw std::invalid_argument("only a free robot with plain motors is built in ODE");

  world_.reset(dWorldCreate());
  contacts_.reset(dJointGroupCreate(0));
  const Plane::Vector& gravity = robot_.tree.gravity;
  dWorldSetGravity(world_.get(), gravity.x(), gravity.y(), 0);
  // Constraints between links are rigid, and mend at once what a step leaves of them.
  dWorldSetCFM(world_.get(), 0);
  dWorldSetERP(world_.get(), 1);

  bodies_.assign(robot_.tree.dofs.size(), nullptr);
  for (std::size_t dof = kRoot; dof < robot_.tree.dofs.size(); ++dof)
    AddLink(dof, mass_factors.empty() ? 1 : mass_factors.at(dof - kRoot));
  dJointID in_plane = dJointCreatePlane2D(world_.get(), nullptr);
  dJointAttach(in_plane, bodies_[kRoot], nullptr);
  for (const ActuatedJoint& joint : problem.joints)
    AddJoint(Index(joint.dof), joint.limits.torque_max_nm);

  for (const ContactShape<Plane>& shape : robot_.shapes) {
    if (shape.shape.kind() != ShapeKind::kSphere)
      throw std::invalid_argument("only spheres touch the ground in ODE");
    const Plane::Vector at = shape.shape.centre - robot_.tree.dofs[Index(shape.body)].mass_centre;
    Geom& sphere = shapes_.emplace_back(dCreateSphere(nullptr, shape.shape.radius_m));
    dGeomSetBody(sphere.get(), bodies_[Index(shape.body)]);
    dGeomSetOffsetPosition(sphere.get(), at.x(), at.y(), 0);
  }
  for (const Obstacle<Plane>& obstacle : scene.obstacles) {
    if (!obstacle.shape.half_space)
      throw std::invalid_argument("only half-spaces are obstacles in ODE");
    const Plane::Vector& n = obstacle.shape.normal;
    ground_.emplace_back(
        dCreatePlane(nullptr, n.x(), n.y(), 0,
                     n.x() * obstacle.shape.centre.x() + n.y() * obstacle.shape.centre.y()));
  }
  // Friction acts in the plane alone, and is as large as mu allows for the force of the same step.
  // Two spheres of a foot that hold against the same slip would make it undetermined which of them
  // does, but for a slip that is far too slow to be seen: 1e-7 m/s for each newton.
  surface_.mode = dContactMu2 | dContactFDir1 | dContactApprox1 | dContactSlip1 | dContactSoftERP |
                  dContactSoftCFM;
  surface_.mu = ground.mu;
  surface_.mu2 = 0;
  surface_.slip1 = 1e-7;
  if (ground.stiffness_n_per_m > 0) {
    const double push = step_s_ * ground.stiffness_n_per_m;
    surface_.soft_erp = push / (push + ground.damping_n_s_per_m);
    surface_.soft_cfm = 1 / (push + ground.damping_n_s_per_m);
  } else {
    surface_.soft_erp = 0.2;
    surface_.soft_cfm = 1e-8;
  }

  start_ = PositionsIn(motion.file().PrimitiveOf(motion.file().graph.start).entry, robot_);
  start_[1] -= ClearanceAt(scene, start_);
  Begin();
}

void OdeRobot::AddLink(std::size_t dof, double mass_factor) {
  const Dof<Plane>& link = robot_.tree.dofs[dof];
  dBodyID body = dBodyCreate(world_.get());
  dMass mass;
  const double inertia = link.inertia_kg_m2 * mass_factor;
  dMassSetParameters(&mass, link.mass_kg * mass_factor, 0, 0, 0, inertia, inertia, inertia, 0, 0,
                     0);
  dBodySetMass(body, &mass);
  dBodySetFiniteRotationMode(body, 1);  // turns by the whole angle, not its tangent
  bodies_[dof] = body;
}

void OdeRobot::AddJoint(std::size_t dof, double torque_max_nm) {
  const Dof<Plane>& of = robot_.tree.dofs[dof];
  Joint joint;
  joint.dof = dof;
  joint.link = bodies_[dof];
  joint.parent = bodies_[Index(of.parent)];
  joint.rotor_inertia_kg_m2 = of.rotor_inertia_kg_m2;
  joint.damping_nm_s_per_rad = of.damping_nm_s_per_rad;
  if (!(joint.rotor_inertia_kg_m2 > 0))
    throw std::invalid_argument("a joint without a rotor has no motor in ODE");
  joint.torque_max_nm = torque_max_nm;
  joint.axis = of.axis;
  // The links stand as at q = 0 when the hinge takes its anchor.
  const auto put = [this](std::size_t link, const Plane::Vector& frame) {
    const Plane::Vector at = frame + robot_.tree.dofs[link].mass_centre;
    dBodySetPosition(bodies_[link], at.x(), at.y(), 0);
  };
  put(Index(of.parent), Plane::Vector::Zero());
  put(dof, of.offset);
  dJointID hinge = dJointCreateHinge(world_.get(), nullptr);
  dJointAttach(hinge, joint.link, joint.parent);
  dJointSetHingeAnchor(hinge, of.offset.x(), of.offset.y(), 0);
  dJointSetHingeAxis(hinge, 0, 0, 1);
  joint.motor = dJointCreateAMotor(world_.get(), nullptr);
  dJointAttach(joint.motor, joint.link, joint.parent);
  dJointSetAMotorMode(joint.motor, dAMotorUser);
  dJointSetAMotorNumAxes(joint.motor, 1);
  dJointSetAMotorAxis(joint.motor, 0, 0, 0, 0, of.axis);
  dJointSetAMotorParam(joint.motor, dParamFMax, dInfinity);
  joints_.push_back(joint);
}

void OdeRobot::Begin() {
  const std::vector<double> rest(start_.size(), 0.0);
  Set(start_, rest);
  time_s_ = 0;
}

void OdeRobot::Set(std::span<const double> q, std::span<const double> qd) {
  HybridDynamics<Plane> kinematics(robot_.tree);
  kinematics.SetState(q, qd);
  for (std::size_t dof = kRoot; dof < bodies_.size(); ++dof) {
    const int j = static_cast<int>(dof);
    const Plane::Vector centre = kinematics.rotation(j) * robot_.tree.dofs[dof].mass_centre;
    const Plane::Vector at = kinematics.origin() + kinematics.position(j) + centre;
    dBodySetPosition(bodies_[dof], at.x(), at.y(), 0);
    const double half = kinematics.rotation(j).angle() / 2;
    const dQuaternion turned = {std::cos(half), 0, 0, std::sin(half)};
    dBodySetQuaternion(bodies_[dof], turned);
    const auto velocity = kinematics.velocity(j).At(kinematics.position(j) + centre);
    dBodySetLinearVel(bodies_[dof], velocity.x(), velocity.y(), 0);
    dBodySetAngularVel(bodies_[dof], 0, 0, kinematics.velocity(j).w);
  }
  pitch_rad_ = q[kRoot];
  for (Joint& joint : joints_) joint.position_rad = q[joint.dof];
}

double OdeRobot::AngleOf(const Joint& joint) {
  return joint.axis * (testing::AngleOf(joint.link) - testing::AngleOf(joint.parent));
}

double OdeRobot::VelocityOf(const Joint& joint) {
  return joint.axis * (dBodyGetAngularVel(joint.link)[2] - dBodyGetAngularVel(joint.parent)[2]);
}

void OdeRobot::AddContacts() {
  dJointGroupEmpty(contacts_.get());
  constexpr int kMost = 4;
  std::array<dContactGeom, kMost> found{};
  for (const Geom& shape : shapes_) {
    for (const Geom& ground : ground_) {
      const int count = dCollide(shape.get(), ground.get(), kMost, found.data(), sizeof found[0]);
      for (int i = 0; i < count; ++i) {
        dContact contact{};
        contact.surface = surface_;
        contact.geom = found[Index(i)];
        contact.fdir1[0] = contact.geom.normal[1];
        contact.fdir1[1] = -contact.geom.normal[0];
        dJointID joint = dJointCreateContact(world_.get(), contacts_.get(), &contact);
        dJointAttach(joint, dGeomGetBody(shape.get()), nullptr);
      }
    }
  }
}

void OdeRobot::Step(const std::vector<double>& ctrl) {
  AddContacts();
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const Joint& joint = joints_[i];
    const double velocity = VelocityOf(joint);
    const double drive = std::clamp(
        ctrl[i] - gains_.kp_nm_per_rad * joint.position_rad - gains_.kd_nm_s_per_rad * velocity,
        -joint.torque_max_nm, joint.torque_max_nm);
    const double rotor = joint.rotor_inertia_kg_m2 / step_s_;
    const double softness = 1 / (rotor + joint.damping_nm_s_per_rad);
    dJointSetAMotorParam(joint.motor, dParamCFM, softness);
    dJointSetAMotorParam(joint.motor, dParamVel, softness * (drive + rotor * velocity));
  }
  dWorldStep(world_.get(), step_s_);
  pitch_rad_ += NearestTurn(testing::AngleOf(bodies_[kRoot]) - pitch_rad_);
  for (Joint& joint : joints_)
    joint.position_rad += NearestTurn(AngleOf(joint) - joint.position_rad);
  time_s_ += step_s_;
}

void OdeRobot::PlayTo(double time_s, const std::vector<double>& ctrl) {
  while (time_s_ < time_s - 0.5 * step_s_) Step(ctrl);
}

std::vector<double> OdeRobot::Positions() const {
  // The root's frame is where its body is, less the way from there to the centre of mass.
  const Plane::Rotation turned = Plane::RotationBy(1, pitch_rad_);
  const Plane::Vector centre = turned * robot_.tree.dofs[kRoot].mass_centre;
  const dReal* at = dBodyGetPosition(bodies_[kRoot]);
  std::vector<double> q(robot_.tree.dofs.size());
  q[0] = at[0] - centre.x();
  q[1] = at[1] - centre.y();
  q[kRoot] = pitch_rad_;
  for (const Joint& joint : joints_) q[joint.dof] = joint.position_rad;
  return q;
}

std::vector<double> OdeRobot::Velocities() const {
  const double w = dBodyGetAngularVel(bodies_[kRoot])[2];
  const Plane::Vector centre =
      Plane::RotationBy(1, pitch_rad_) * robot_.tree.dofs[kRoot].mass_centre;
  const dReal* v = dBodyGetLinearVel(bodies_[kRoot]);
  const Plane::Vector turning = Plane::Cross(w, centre);
  std::vector<double> qd(robot_.tree.dofs.size());
  qd[0] = v[0] - turning.x();
  qd[1] = v[1] - turning.y();
  qd[kRoot] = w;
  for (const Joint& joint : joints_) qd[joint.dof] = VelocityOf(joint);
  return qd;
}

double OdeRobot::Position(const std::string& joint) const {
  for (std::size_t dof = 0; dof < robot_.tree.dofs.size(); ++dof) {
    if (robot_.tree.dofs[dof].name == joint) return Positions()[dof];
  }
  throw std::invalid_argument("no joint " + joint);
}

}  // namespace tumbler::testing
