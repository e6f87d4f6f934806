#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/scene/robot_posterior.h"

namespace tumbler {

/// A motion that tells about a robot, and does it no harm.
struct ExcitationSettings {
  /// Of what moves, after the hold in which the robot stands still.
  double duration_s = 1.2;
  /// Motions that are drawn. Each is a sum of two waves for every joint, as large as is safe.
  int candidates = 96;
  /// Of the search for a better one, about the best that was drawn; 0: that is taken.
  int generations = 40;
  /// Motions of which there are, or will be, records too: primitives of this robot and ground.
  std::vector<std::string> after;
  std::uint64_t seed = 1;
  /// The part of each motor's torque limit that the model may need.
  double torque_share = 0.5;
  /// How far the root may turn from where it lies or stands [rad], and a joint from where it is.
  double pitch_max_rad = 0.35, joint_max_rad = 1.2;
  /// Robots that play the motion before it is written, from the prior at twice its deviations.
  int robots = 64;
  std::function<void(const std::string&)> say;  ///< Told of progress; may be empty.
  const std::atomic<bool>* interrupt = nullptr;
};

/// An excitation, with what it does.
struct Excitation {
  std::optional<PrimitiveFile> file;  ///< None: no motion was found, for this reason.
  std::string cause;
  int tried = 0;  ///< Motions that were drawn or searched ...
  int safe = 0;   ///< ... and how many of them are safe for the model.
  /// What a record of it, and of those before it, is expected to leave of the robot's quantities,
  /// as standard deviations of coordinates: for the model, if nothing but noise disturbs.
  std::vector<RobotQuantity> quantities;
  std::vector<double> deviations;
  double criterion = 0;           ///< Of these: the A-criterion, in units of the wanted accuracy.
  double torque_nm = 0;           ///< Largest of any robot.
  double pitch_rad = 0;           ///< Largest turn of any robot's root.
  std::vector<double> joint_rad;  ///< Largest swing of each joint, either way.
  int robots = 0;                 ///< That played it, of which none fell.
  /// Through which it was designed and all of them played it: the task's, or the default ones.
  DriveGains drives;
};

/// Makes a motion that begins and ends at rest in the task's start pose, from which a robot and its
/// ground can be told (`FitRobot`).
///
/// It is designed by the Fisher information J^T J of a simulated record, J being the derivatives of
/// its readings by all quantities, together with the prior and with what records of `after` tell.
/// The A-criterion counts: the sum of the variances of masses, friction, stiffness and damping,
/// each in units of the accuracy that is wanted. The best of the random motions is improved by an
/// evolution strategy (CmaEs) over the rates, phases and parts of its waves, each motion as large
/// as is safe. So feet tap where that tells of the ground. It is a local minimum of the criterion.
///
/// Safe is a motion in which the model needs at most `torque_share` of its torque, keeps all
/// limits, turns by at most `pitch_max_rad`, and rests again where it began, and robots that differ
/// do the last two, too. It is then certified as any motion is.
/// @param task_file  of any motion that begins at rest in the pose; its end and cost do not count.
/// @throws FileError, std::invalid_argument  about a task that cannot be used.
Excitation MakeExcitation(const std::string& task_file, const ExcitationSettings& settings);

}  // namespace tumbler
