#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "offline/scene/lane_scene.h"
#include "offline/scene/variation.h"

namespace tumbler {

/// The feedback that is found with a motion, and what it is found for: `[robust.feedback]`.
struct FeedbackSettings {
  /// When a feedback acts.
  enum class Acts : std::uint8_t {
    kAlways,  ///< In the hold, and before it in the motion, which stays as it is, too.
    kHold,    ///< In the hold; its gains are found for the path, when that is known.
    kMotion   ///< In the motion, which stays as it is; a robot that has arrived needs no help.
  };
  static constexpr std::array<std::string_view, 3> kActsNames = {"always", "hold", "motion"};

  std::string link;  ///< Whose absolute angle is fed back.
  Acts acts = Acts::kAlways;
  int knots = 5;                          ///< Of gains that act in the motion, at equal distances.
  double correction_max_rad = 0.3;        ///< Of each joint.
  double correction_rate_max_rad_s = 10;  ///< Likewise.
  double noise_rad = 5e-3;                ///< Standard deviation of the measured angle.
  double rate_noise_rad_s = 0.02;         ///< Of its rate.
  double bias_rad = 0.01;                 ///< Of the angle, of either sign.
  double delay_s = 1e-3;                  ///< Of the sensor, beside the frames' own.
  /// The guess's gains and dead zone are taken as they are, along the angle of this motion.
  bool from_guess = false;
  /// Of the force, for 0.1 s to either side, that robots withstand once they stand.
  double push_n = 5;
};

/// What a motion has to survive, and how it is searched for: `[robust]` of a task. The motion is
/// judged by robots that differ from the model and follow it through their drives.
struct RobustSettings {
  Spreads spreads;
  /// The drives of all joints. Torque limits are those of the joints.
  LaneDrive drive{.kp = 100, .kd = 5};
  /// Between these is the motion's duration found; none: it is the task's.
  std::optional<double> duration_min_s, duration_max_s;
  /// Random motions that are played on the model, where how robots arrive does not tell what comes
  /// of them.
  int samples = 30000;
  /// Motions that are found for the model, or the best of the random ones, which are led to where
  /// robots come to rest, or improved with few robots ...
  int starts = 24;
  /// ... until so many are left, or then these with more robots ...
  int improved = 3;
  /// ... and at last the best of these, with the most, whose spreads are this much larger.
  double polish_scale = 1.5;
  int polish_robots = 64;
  /// How often the last stage is done, each time from what the one before found and with twice the
  /// robots, at last with all of them. Few robots lead far at little cost; what is found for few
  /// alone suits these.
  int polish_rounds = 1;
  /// Generations of the last stage, and of a motion that is led to the end. Random motions have 1/3
  /// of them at first, then 1/2.
  int generations = 150;
  std::optional<FeedbackSettings> feedback;
};

/// The same of a robot in space: the motion that is found for the model is changed until robots
/// that differ do what it is for.
struct SpaceRobustSettings {
  Spreads spreads;
  /// With which setpoints change [s]: eight motors share a bus at 400 Hz, twelve at 290 Hz.
  double period_s = 2.5e-3;
  /// By how many robots motions are judged, others in each generation: few are enough to tell
  /// motions apart, and those that rotate are none that a motion could suit alone. Two packets of
  /// lanes.
  int robots = 16;
  int candidates = 12;   ///< Motions in a generation.
  int generations = 60;  ///< At most: it ends where no robot misses anything for a while.
  /// Standard deviation of control points in the first generation [rad]: near what was found.
  double sigma_rad = 0.03;
  /// Robots that judge all motions that were the best of a generation, then as many more that judge
  /// the best of these, and those of which the result is said. None of them has met a motion
  /// before.
  int first_judges = 24, last_judges = 72, fresh = 100;
};

}  // namespace tumbler
