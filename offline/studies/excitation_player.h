#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "common/core/primitive.h"
#include "offline/problem/problem.h"
#include "offline/scene/lane_scene.h"

namespace tumbler {

/// How long an excitation's robot is watched after its motion, and the time of a tick.
inline constexpr double kExcitationAfter_s = 0.6, kExcitationTick_s = 1e-3;

/// What a robot did in a motion.
struct PlayedExcitation {
  double pitch_rad = 0;  ///< Largest turn of the root.
  double end_rad = 0;    ///< Its turn at the end.
  double speed = 0;      ///< Largest of its velocities there.
  double torque_share = 0;
  double depth = 0;
  double torque_nm = 0;
};

/// Setpoints of a motion, by tick and joint: from the hold before it to the end of the watch.
using ExcitationSetpoints = std::vector<std::vector<LaneSetpoint<double>>>;
/// @param torques  of the joints; none: no feed-forward.
ExcitationSetpoints ExcitationSetpointsOf(double duration_s,
                                          std::span<const JointMotion<double>::Spline> positions,
                                          std::span<const JointMotion<double>::Spline> torques);

/// Plays motions of an excitation, in lanes.
class ExcitationPlayer {
 public:
  static constexpr std::size_t kLanes = Packet::kLanes;

  /// Both have to outlive this.
  /// @param lanes  of the model.
  ExcitationPlayer(const Problem& problem, const LaneScene& lanes)
      : problem_(problem), lanes_(lanes) {}

  /// Plays robots, each with its own setpoints.
  /// @param finer  how many times as many steps a tick takes.
  [[nodiscard]] std::array<PlayedExcitation, kLanes> Play(
      const std::array<LaneRobot<double>, kLanes>& robots,
      const std::array<const ExcitationSetpoints*, kLanes>& setpoints, int finer = 1) const;

  /// Adds what the model's motors need, as the primitive will have it: by steps of a quarter of a
  /// tick, the mean of each tick.
  void AddFeedForward(std::array<ExcitationSetpoints, kLanes>& setpoints) const;

 private:
  /// Robots at rest where the motion begins.
  [[nodiscard]] LaneState<Packet> Start() const;

  const Problem& problem_;
  const LaneScene& lanes_;
};

}  // namespace tumbler
