#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "offline/certify/certificate.h"
#include "offline/problem/problem.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {

/// In what a robot's start and floor differ from the plan's.
struct Disturbance {
  double slope_rad = 0;  ///< By which the ground slopes more than the task's; as its `slope_rad`.
  double lean_rad = 0;   ///< That is added to the root's pitch where the motion begins.
};

/// A force on the origin of the root's frame, for a while.
template <class Space>
struct RootPush {
  /// Since the start; of motions that are played one after the other, of the first of them.
  double start_s = 0, duration_s = 0;
  typename Space::Vector force_n = Space::Vector::Zero();
};

/// Into how many parts the solver's step is divided in the motion: a foot that lands is fast.
inline constexpr double kPlayedFiner = 4;

/// A robot whose drives play a motion: not that of the problem, where it differs.
template <class Space>
struct PlayedRobot {
  SceneOf<Space> scene;
  DriveGains gains;
  double lean_rad = 0;     ///< That is added to the root's pitch where the motion begins.
  double period_s = 1e-3;  ///< With which setpoints change; those of eight motors on a bus: slower.
  std::optional<RootPush<Space>> push = std::nullopt;
  double finer = kPlayedFiner;
};

/// Plays a motion on the nominal robot through drives that give way (Problem::drive_gains), and
/// holds its end: at every joint
///
///   torque = kp (setpoint - position) + kd (its velocity - velocity) + feed-forward
///
/// within the joint's limit and its motor's torque-speed curve, less friction, with setpoints
/// that change once in a millisecond and arrive 0.3 ms later. A feedback does not act. By the
/// classical Runge-Kutta method, with a quarter of the solver's step until ExitAfter the end and
/// with the whole step from then on, and with shorter ones where a drive's damping asks for them.
///
/// @param feed_forward  of each joint (FeedForward).
/// @param visitor       is called at every step with the time [s] and the positions of all degrees
///                      of freedom [m, rad], and returns whether to go on.
/// @returns false when the state left every plausible range before `until_s`.
bool PlayThroughDrives(const Problem& problem, const std::vector<double>& x,
                       std::span<const JointMotion<double>::Spline> feed_forward,
                       const Disturbance& disturbance, double until_s,
                       const std::function<bool(double, std::span<const double>)>& visitor);

/// A robot in space at one time. Valid during a call only.
struct DrivenSample {
  double time_s = 0;
  std::span<const double> q, qd;      ///< Of all degrees of freedom.
  const SpaceMatrix* axes = nullptr;  ///< Of the root, whose angles are 0.
};

/// A motion in space that is played through drives.
struct DrivenMotion {
  const Problem* problem = nullptr;
  const std::vector<double>* x = nullptr;                          ///< Its parameters.
  std::span<const JointMotion<double>::Spline> feed_forward = {};  ///< Of each joint.
  double until_s = 0;      ///< Since it began. Then the next one begins, or all is over.
  double lightest_kg = 0;  ///< LightestContact; 0: is computed.
};

/// The smallest mass that a force on any of the robot's shapes meets in poses on a motion's way
/// (SmallestEffectiveMass), with joints that are moved by torques [kg].
double LightestContact(const Problem& problem, const std::vector<double>& x);

/// The longest step for robots in space that play motions through drives, by their contact [s]:
/// twice what is advised (AdvisableStep), of which the classical method is stable up to 2.78 times,
/// and a third of a radian of what swings on the contact's spring alone, so that a foot leaves hard
/// ground as it has to.
double ContactStepInSpace(std::span<const DrivenMotion> motions,
                          std::span<const PlayedRobot<Spatial>> played);
/// Steps are no shorter, whatever contact asks for [s]: who asks for such ground is to be told.
inline constexpr double kShortestContactStep_s = 1e-6;

/// The same in space, of motions of one robot that are played one after the other: each begins
/// where the robot is then, and on a tick of its own. The first begins where its problem does.
/// Steps are no longer than ContactStepInSpace, throughout.
/// @param played   NominalInSpace, or a robot that differs.
/// @param visitor  gets the index of the motion and the time since that began.
bool PlayThroughDrivesInSpace(
    std::span<const DrivenMotion> motions, const PlayedRobot<Spatial>& played,
    const std::function<bool(std::size_t motion, const DrivenSample&)>& visitor);
/// The same with several robots, all at once in lanes where lanes have their scene, else one after
/// the other. In lanes the visitor sees them once in a millisecond or more often, and pushes begin
/// and end then; numbers are rounded otherwise.
/// @param played   with one period; for all at once, at most Packet::kLanes.
/// @param visitor  is also told which of them it is; a robot goes on while it says so.
/// @returns for each robot whether its state stayed plausible while it went on.
std::vector<bool> PlayThroughDrivesInSpace(
    std::span<const DrivenMotion> motions, std::span<const PlayedRobot<Spatial>> played,
    const std::function<bool(std::size_t which, std::size_t motion, const DrivenSample&)>& visitor);
/// The same of one robot and one motion.
bool PlayThroughDrivesInSpace(const Problem& problem, const std::vector<double>& x,
                              std::span<const JointMotion<double>::Spline> feed_forward,
                              const PlayedRobot<Spatial>& played, double until_s,
                              const std::function<bool(const DrivenSample&)>& visitor);
PlayedRobot<Spatial> NominalInSpace(const Problem& problem, const Disturbance& disturbance);

/// The same as the first with several disturbances, each on a robot of its own, all at once in the
/// lanes of vectors where lanes have the scene (MakeLaneScene), else one after the other. In lanes
/// the visitor sees every millisecond only; numbers are rounded otherwise, so that a robot that is
/// near a fall may fall in one and not in the other.
/// @param visitor  is also told which of the disturbances it is; a robot goes on while it says so.
/// @returns for each robot whether its state stayed plausible while it went on.
std::vector<bool> PlayThroughDrives(
    const Problem& problem, const std::vector<double>& x,
    std::span<const JointMotion<double>::Spline> feed_forward,
    std::span<const Disturbance> disturbances, double until_s,
    const std::function<bool(std::size_t which, double, std::span<const double>)>& visitor);

}  // namespace tumbler
