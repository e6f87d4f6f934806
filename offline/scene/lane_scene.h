#pragma once

#include "offline/scene/joint_stop.h"
#include "offline/scene/lane_robot.h"
#include "offline/scene/motor.h"
#include "offline/scene/scene.h"

namespace tumbler {

/// What simulated drives of a joint have, as the twin's defaults have it.
struct LaneDrive {
  double kp = 200, kd = 4;
  double torque_max_nm = 8;
  double viscous_friction_nm_s_per_rad =
      kUsualViscousFriction_nm_s_per_rad;  ///< Besides the URDF's damping.
  double dry_friction_nm = 0;              ///< Likewise besides its friction.
  /// From a tick to when its setpoint acts: frames take a while.
  double delay_s = 0.3e-3;
};

/// A joint with its drive.
LaneJoint<double> MakeLaneJoint(double rotor_inertia_kg_m2, double damping_nm_s_per_rad,
                                double dry_friction_nm, const RobotJointLimits& limits,
                                const LaneDrive& drive);

/// A robot with its ground, as lanes have it.
struct LaneScene {
  LaneModel model;
  LaneRobot<double> robot{};
};

/// Sets a contact law, and the springs of joints' stops.
/// @param lanes  LaneScene or SpaceLaneScene.
template <class Lanes>
void SetContact(const ContactLaw& law, Lanes& lanes) {
  lanes.model.smoothing = law.smoothing;
  lanes.model.damping_law = law.damping_law;
  auto& robot = lanes.robot;
  robot.stiffness = law.stiffness_n_per_m;
  robot.damping = law.damping_n_s_per_m;
  robot.mu = law.mu;
  robot.v_max = law.v_max_m_per_s;
  robot.d_on = law.d_on_m;
  robot.d_off = law.d_off_m;
  robot.stop_stiffness = kStopStiffness_nm_per_rad;
  robot.stop_damping = kStopDamping_nm_s_per_rad;
}

/// @throws std::invalid_argument  when there are more of something than lanes have room for.
void RequireLaneRoom(std::size_t count, std::size_t room, const char* what);

/// The scene of a task in lanes.
/// @throws std::invalid_argument  when there is something in the scene that lanes do not have: its
///                                motors are given, a joint has none, the robot's root is not
///                                planar, a joint is prismatic, an obstacle is no half-space and a
///                                shape of the robot no sphere, or there are more bodies, points or
///                                obstacles than lanes have room for. The message names it.
LaneScene MakeLaneScene(const Scene& scene, const LaneDrive& drive);

}  // namespace tumbler
