#pragma once

#include <atomic>
#include <cstddef>
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

/// A motion of those that a robot plays one after the other, and what it is for.
struct JudgedMotion {
  const Problem* problem = nullptr;
  const std::vector<double>* x = nullptr;                          ///< Its parameters.
  std::span<const JointMotion<double>::Spline> feed_forward = {};  ///< Of each joint.
  std::span<const DueInSpace> targets = {};
  /// From the end of the motion until the next one begins. Of the last motion: how long the robot
  /// is watched after the last target; 0: what is to last is judged when it is due.
  double hold_s = 0;
  double lightest_kg = 0;  ///< As DrivenMotion::lightest_kg.
};

/// When a motion's last target is due; without any, when it has settled [s].
double LastDue(const JudgedMotion& motion);

/// What became of a robot.
struct SpaceTrial {
  bool finite = true;                 ///< Whether its state stayed plausible.
  std::vector<JudgedTarget> purpose;  ///< In the order of the motions, and of their targets.
  std::size_t ended_in = 0;           ///< The motion in which it was looked at last.
  [[nodiscard]] bool as_asked() const { return finite && AllMet(purpose).value_or(false); }
  /// Whether it is known whether it is as asked: a heading may have been none.
  [[nodiscard]] bool judged() const { return !finite || AllMet(purpose).has_value(); }
};

/// Plays motions on robots one after the other (PlayThroughDrivesInSpace), until one is not as
/// asked, and judges each in the coordinates of its task (TaskFrame): every target at the last look
/// before its time is over; what is to last, just before the next motion begins, or at the end of
/// the hold. A speed is the largest of the last moments before that.
/// @param played     with one period.
/// @param interrupt  null, or ends it when it is set: what is returned then says nothing.
/// @returns what became of each.
std::vector<SpaceTrial> TryInSpace(std::span<const JudgedMotion> motions,
                                   std::span<const PlayedRobot<Spatial>> played,
                                   const std::atomic<bool>* interrupt = nullptr);
/// The same of one motion.
std::vector<SpaceTrial> TryInSpace(const Problem& problem, const std::vector<double>& x,
                                   std::span<const JointMotion<double>::Spline> feed_forward,
                                   std::span<const DueInSpace> targets,
                                   std::span<const PlayedRobot<Spatial>> played, double hold_s);

}  // namespace tumbler
