#pragma once

#include <optional>
#include <span>
#include <vector>

#include "common/core/primitive.h"
#include "common/files/purpose.h"
#include "offline/certify/driven_motion.h"
#include "offline/problem/problem.h"
#include "offline/problem/purpose_gauge.h"

namespace tumbler {

/// A target of a motion in space, and when it is due.
struct DueInSpace {
  PurposeTarget target;
  PurposeGauge gauge;
  double time_s = 0;

  /// Whether what was asked for there is to last.
  [[nodiscard]] bool lasts() const {
    return target.when == PurposeTarget::When::kSettled ||
           target.when == PurposeTarget::When::kLater;
  }
};

/// The targets of a purpose.
/// @throws std::invalid_argument  about one that is none of a robot in space.
std::vector<DueInSpace> DueTargetsInSpace(const Problem& problem,
                                          std::span<const PurposeFigure> purpose);

/// When the last of the targets is due [s].
double LastDue(std::span<const DueInSpace> targets);

/// What became of a robot.
struct SpaceTrial {
  bool finite = true;                 ///< Whether its state stayed plausible.
  std::vector<JudgedTarget> purpose;  ///< In the order of the targets.
  [[nodiscard]] bool as_asked() const { return finite && AllMet(purpose).value_or(false); }
};

/// Plays a motion on a robot (PlayThroughDrivesInSpace), and judges it: every target at the last
/// step before its time is over; what is to last, at the end of the hold. A speed is the largest of
/// the last moments before that.
/// @param hold_s  how long the robot is watched after the last target; 0: what is to last is judged
///                when it is due.
SpaceTrial TryInSpace(const Problem& problem, const std::vector<double>& x,
                      std::span<const JointMotion<double>::Spline> feed_forward,
                      std::span<const DueInSpace> targets, const PlayedRobot<Spatial>& played,
                      double hold_s);

}  // namespace tumbler
