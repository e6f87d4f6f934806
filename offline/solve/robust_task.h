#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "common/core/primitive.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/variation.h"
#include "offline/solve/robot_loss.h"
#include "offline/solve/solver.h"

namespace tumbler {

/// What the robots of a packet are told: one for each tick, or step, and joint, joint by joint.
using PacketSetpoints = std::vector<LaneSetpoint<Packet>>;
/// What all robots are told that a motion is ranked by, likewise.
using RankingSetpoints = std::vector<LaneSetpoint<float>>;

/// The scene of a problem in lanes, with a robot that differs from the model; by default the model.
[[nodiscard]] LaneScene LanesOf(const Problem& problem, const RobotVariation& variation = {});
/// Where the problem's motions begin, at rest.
[[nodiscard]] LaneState<double> StartState(const Problem& problem);

/// A task for robots that differ from its model, as all parts of the search for a robust motion see
/// it. Nothing in it changes during the search.
struct RobustTask {
  static constexpr double kTick_s = 1e-3;  ///< Of the runtime that will play the motion.
  /// Steps that do where motions are ranked, and those of the last improvement, which are the
  /// twin's to some 0.5 % of robots.
  static constexpr LaneSteps kRough{.per_tick = 2}, kFine{.per_tick = 4};
  /// How long after the settle phase a robot has to be at rest, and how long that is watched.
  static constexpr double kLater_s = 0.9, kWatched_s = 0.4;

  /// All have to outlive this object.
  /// @pre of.robust
  RobustTask(const Problem& of, const SolveOptions& with,
             std::span<const Primitive<double>> tried_before);

  const Problem& problem;
  const RobustSettings& settings;
  const SolveOptions& options;
  /// Motions that are tried before the one that is searched: see SolveRobust.
  std::span<const Primitive<double>> complement;
  const LaneKernel<Packet>& kernel;
  const RankingKernel& ranking_kernel;
  LaneScene lanes;  ///< The scene, with the model in it.
  std::size_t joints;
  RobotLoss loss;

  [[nodiscard]] static int Ticks(double time_s) {
    return static_cast<int>(std::lround(time_s / kTick_s));
  }
  /// When a robot is seen for the last time whose motion takes so many ticks.
  [[nodiscard]] int LastTick(int motion) const {
    return motion + Ticks(problem.settle_s) + Ticks(kLater_s);
  }
  [[nodiscard]] bool free_duration() const { return settings.duration_max_s.has_value(); }
  /// Whether the model is none of the robots: others carry it, or it is known that the robot has
  /// friction, zeros and a slope that the model has not.
  [[nodiscard]] bool beside_model() const {
    return !complement.empty() || settings.spreads.posterior != nullptr;
  }
  /// Whether the motion is for one robot, of which a posterior is known.
  [[nodiscard]] bool tunes() const {
    return settings.spreads.posterior != nullptr && complement.empty() && !settings.feedback;
  }
  [[nodiscard]] bool interrupted() const {
    return options.interrupt != nullptr && *options.interrupt;
  }
};

}  // namespace tumbler
