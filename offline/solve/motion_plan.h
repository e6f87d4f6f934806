#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "common/core/primitive.h"
#include "offline/solve/robust_motion.h"

namespace tumbler {

/// What the plan of a motion, the model with joints that follow exactly, gives.
struct MotionPlan {
  std::vector<double> feed_forward;  ///< Torque for each tick of the motion and joint [N m].
  double excess = 0;                 ///< Of torque and of penetration, as parts of their limits.
  Feedback<double> feedback;         ///< Absent where none is searched; see MotionFeedback.

  /// The torque of a tick, the last one after the motion. @param i  `tick * joints + joint`.
  [[nodiscard]] double FeedForward(std::size_t i, std::size_t joints) const {
    return feed_forward[std::min(i, feed_forward.size() - joints + i % joints)];
  }
};

/// Plans motions in lanes. Where the model is none of the robots (RobustTask::beside_model), the
/// excess counts how far it is from resting where the task asks at the end of the settle phase,
/// too: what is found for robots around the model rests there by itself.
class MotionPlanner {
 public:
  /// Both have to outlive this object.
  MotionPlanner(const RobustTask& task, const RobustMotion& motion);

  /// The plans of up to a packet of motions whose paths keep their limits.
  [[nodiscard]] std::vector<MotionPlan> Plans(
      const std::vector<std::vector<double>>& motions) const;

  /// What robots are told in a motion and the hold after it.
  /// @tparam N  Packet, or float, of robots that a motion is ranked by (RankingSetpoints).
  template <class N>
  [[nodiscard]] std::vector<LaneSetpoint<N>> SetpointsOf(const std::vector<double>& x,
                                                         const MotionPlan& plan) const;

 private:
  /// Adds to the excess of plans how far they are from rest.
  void NoteUnrest(const PacketSetpoints& setpoints, LaneState<Packet>& state,
                  std::vector<MotionPlan>& plans) const;
  /// The feed-forward of a lane as its primitive will have it (FeedForward, in
  /// offline/certify/certificate.h): the least-squares spline through the torques, for each tick
  /// and joint.
  [[nodiscard]] std::vector<double> FeedForwardOf(const std::vector<Packet>& torques,
                                                  std::size_t lane, double duration_s) const;

  const RobustTask& task_;
  const RobustMotion& motion_;
  LaneRobot<Packet> model_;  // without what its drives rub
};

}  // namespace tumbler
