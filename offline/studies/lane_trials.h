#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_scene.h"
#include "offline/studies/trial.h"

namespace tumbler {

/// Plays a study's robots in lanes, a packet at a time, some fifty times as fast as `Trials`.
///
/// A robot is told, tick by tick, what the executor told the model in the twin, as the wire rounded
/// it, with the time that the frames took; its encoders read half a count less than the truth, as
/// they do on average. The judges are those of `Trials`, which look in some ticks only
/// (`LookTicks`). What lanes leave out is the rest of the
/// twin: the bus, the rounding of encoders, faults of drives and executor, and everything that a
/// twin file can ask for.
class LaneTrials {
 public:
  /// @throws as Trials, std::invalid_argument as MakeLaneScene, and Refused where the study has a
  ///         twin file.
  /// @param finer  how much finer the steps are than those of robots that differ a little.
  /// @param look_every  in every so many ticks the judges look, besides those that they must not
  ///                    miss. In 4 ms own shapes, and so what overlaps, move by a few millimetres.
  explicit LaneTrials(const RobustnessStudy& study, int finer = 1, int look_every = 4);

  /// Plays robots of these numbers, one in each lane.
  /// @pre at most Packet::kLanes of them, and at least one.
  [[nodiscard]] std::vector<TrialOutcome> Play(std::span<const std::uint64_t> indices) const;
  /// The same of robots that are given.
  [[nodiscard]] std::vector<TrialOutcome> Play(std::span<const RobotVariation> variations) const;

  [[nodiscard]] const Trials& trials() const { return trials_; }

 private:
  /// Lets robots whose encoders' zeros are wrong rest at the start before the motion, as they do
  /// in a run (RunProcedureConfig::rest_ticks).
  /// @param tick  the first in which they are not held.
  /// @param held, state  get what they were told last, and how they are; those of others stay.
  void Rest(const LaneRobot<Packet>& robots, const ScriptTick& tick, HeldSetpoints<Packet>& held,
            LaneState<Packet>& state) const;
  [[nodiscard]] LaneRobot<double> RobotOf(const Scene& scene,
                                          const RobotVariation& variation) const;

  Trials trials_;
  std::vector<LaneDrive> drives_;
  LaneScene model_;
  LaneSteps steps_;
  std::vector<std::size_t> looks_;  // LookTicks
};

}  // namespace tumbler
