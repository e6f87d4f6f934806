#pragma once

#include <string>

#include "offline/problem/posterior_toml.h"
#include "offline/problem/task_toml.h"

namespace tumbler {

/// The URDF of a robot with the links that were identified.
/// @param scene  of the robot of this text, with the links of the posterior.
/// @throws FileError  when a link's inertia is not where it could be changed.
std::string IdentifiedUrdf(const std::string& robot_text, const std::string& robot_name,
                           const Scene& scene, const RobotPosterior& posterior);

/// A task of the robot that was identified: with its URDF, and its ground in `[contact]`. All else
/// of the text stays. Its motions say that their URDF is that of the robot's file as identified.
/// @throws FileError  when `[contact]` does not give a property of the ground as a number.
Task IdentifiedTask(const Task& given, const PosteriorFile& file);

/// By how much robots may differ in what no record tells: standard deviations.
struct UntoldSpreads {
  double torque_limit = 0.02;  ///< Factor of each motor's.
  double delay_s = 1e-4;       ///< Of what setpoints are late by.
};

/// By how many standard deviations robots of an effective model differ for whom a motion is tuned:
/// by more than those of the gate, since what was not explained is not in its deviations.
inline constexpr double kEffectiveDeviations = 3;

/// How many robots, and for how long, a motion is tuned to one robot: it begins near, and robots of
/// a posterior differ little.
struct TuningSettings {
  int robots = 32, generations = 50;
  int rounds = 2;  ///< Of which the first has half the robots.
  /// Of an effective model, which leaves more open.
  int robots_of_effective = 96;
  UntoldSpreads untold;
};

/// Lets the search for a task's motion be judged by the robots of a posterior, as the gate judges
/// the motion. At most these many robots and generations are taken of what `[robust]` asks for.
/// @pre the task has `[robust]`.
void TuneTo(const PosteriorFile& file, const TuningSettings& settings, Task& task);

/// The robot that was identified as a twin file, with its URDF and drives beside it,
/// robot.urdf and drives.toml.
std::string TwinOf(const PosteriorFile& file);

/// The ground that was identified, as a task's `[contact]`.
std::string GroundOf(const PosteriorFile& file, const ContactLaw& law);

}  // namespace tumbler
