#pragma once

#include <cstddef>
#include <optional>

#include "offline/ensemble/lane_scene.h"
#include "offline/ensemble/variation.h"

namespace tumbler {

/// What a motion has to survive, and how it is searched for: `[robust]` of a task. The motion is
/// judged by robots that differ from the model and follow it through their drives.
struct RobustSettings {
  Spreads spreads;
  /// The drives of all joints. Torque limits are those of the joints.
  LaneDrive drive{.kp = 100, .kd = 5};
  /// Between these is the motion's duration found; none: it is the task's.
  std::optional<double> duration_min_s, duration_max_s;
  /// Random motions that are played on the model.
  int samples = 30000;
  /// Motions that are improved first, each with few robots ...
  int starts = 24;
  /// ... then the best of them, with more robots ...
  int improved = 3;
  /// ... and at last the best of these, with the most, whose spreads are this much larger.
  double polish_scale = 1.5;
  int polish_robots = 64;
  /// Generations of the last stage; the first has 1/3 of them, the second 1/2.
  int generations = 150;
};

}  // namespace tumbler
