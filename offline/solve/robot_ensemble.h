#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "offline/solve/lane_feedback.h"
#include "offline/solve/robust_task.h"

namespace tumbler {

/// Robots in packets, as they stand before the motion, each on its own ground.
struct Ensemble {
  HeldSetpoints<Packet> held{};
  std::vector<LaneRobot<Packet>> robots;
  std::vector<LaneState<Packet>> states;
  std::vector<LaneNoise> noise;  ///< Of each packet's sensors; empty where there are none.
  LaneSteps steps;
};

/// The same robots in single precision, to rank motions by (RankingKernel).
struct RankingEnsemble {
  HeldSetpoints<float> held{};
  std::vector<LaneRobot<WidePacket>> robots;
  std::vector<LaneState<WidePacket>> states;
  LaneSteps steps;
  std::size_t count = 0;  ///< Of robots. Others that fill the last packet up do not count.

  /// How many of a packet's lanes count, from the first on.
  [[nodiscard]] std::size_t CountIn(std::size_t packet) const {
    return std::min(WidePacket::kLanes, count - packet * WidePacket::kLanes);
  }
};
/// @pre no noise, and all lanes are held by the same setpoints
[[nodiscard]] RankingEnsemble ForRanking(const Ensemble& robots);

/// So many packets of an ensemble from one on; after the last comes the first.
[[nodiscard]] Ensemble PartOf(const Ensemble& robots, std::size_t first, std::size_t count);

/// From what robots are drawn.
struct RobotDraw {
  double scale = 0;  ///< Of the task's spreads. 0: they do not differ.
  std::uint64_t seed = 0;
  LaneSteps steps;       ///< Made finer where the ground of these robots may be stiff.
  bool sensors = false;  ///< Whether a feedback will need them.
};

/// The robots with these numbers.
/// @param which  whole packets.
[[nodiscard]] Ensemble DrawEnsemble(const RobustTask& task, const RobotDraw& draw,
                                    const std::vector<std::uint64_t>& which);
/// The model on grounds that slope. (A posterior's robots that do not differ are its mean.)
/// @param slopes_rad  of whole packets.
[[nodiscard]] Ensemble ModelOnSlopes(const RobustTask& task, std::span<const double> slopes_rad,
                                     LaneSteps steps);
/// A packet of robots that do not differ: the model, or the mean of what is known of one robot.
[[nodiscard]] Ensemble ModelEnsemble(const RobustTask& task, LaneSteps steps, bool sensors = false);

}  // namespace tumbler
