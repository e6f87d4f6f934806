#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/core/feedback.h"
#include "offline/scene/self_clearance.h"
#include "offline/solve/robot_ensemble.h"

namespace tumbler {

/// The distances between own shapes, for each lane of a packet, which knows where its robot was.
/// One for each thread.
using LaneDistances = std::vector<SelfDistances>;
[[nodiscard]] LaneDistances DistancesOf(const RobustTask& task);

/// What a packet of robots is played along.
struct PacketMotion {
  const PacketSetpoints& setpoints;  ///< To RobustTask::LastTick.
  int ticks = 0;                     ///< Of the motion; then comes its hold.
  /// By which setpoints are corrected; null, or absent: they are not.
  const Feedback<double>* feedback = nullptr;
};

/// Plays a motion and its hold to the end, and watches the last of that time. A robot is a fault
/// that the runtime stops, or of which own shapes overlap.
/// @param packet     of the ensemble.
/// @returns the loss of each robot (RobotLoss).
[[nodiscard]] std::array<double, Packet::kLanes> RobotLosses(const RobustTask& task,
                                                             const Ensemble& ensemble,
                                                             std::size_t packet,
                                                             const PacketMotion& motion,
                                                             LaneDistances& distances);

/// What robots that it is ranked by are played along: no setpoint is corrected.
struct RankingMotion {
  const RankingSetpoints& setpoints;  ///< To RobustTask::LastTick.
  int ticks = 0;                      ///< Of the motion; then comes its hold.
};
[[nodiscard]] std::array<double, WidePacket::kLanes> RobotLosses(const RobustTask& task,
                                                                 const RankingEnsemble& ensemble,
                                                                 std::size_t packet,
                                                                 const RankingMotion& motion);

/// Plays a motion until 0.25 s after its end.
/// @returns RobotLoss::Divergence of each robot: soon after the end, and when it shows what comes
///          of it.
[[nodiscard]] std::array<std::array<double, WidePacket::kLanes>, 2> RobotDivergences(
    const RobustTask& task, const RankingEnsemble& ensemble, std::size_t packet,
    const RankingMotion& motion);

/// The numbers of the first robots of a draw that no motion of the task's complement carries.
/// @param count  of robots, whole packets. Fewer, whole packets, are returned where so many are
/// hard
///               to find, and any when the search is interrupted.
/// @throws std::runtime_error  when there are not enough for one packet.
[[nodiscard]] std::vector<std::uint64_t> RobotsNotCarried(const RobustTask& task,
                                                          const RobotDraw& draw, std::size_t count);

}  // namespace tumbler
