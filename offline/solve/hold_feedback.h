#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "common/core/feedback.h"
#include "offline/problem/robust_settings.h"
#include "offline/scene/lane_kernel.h"
#include "offline/solve/lane_feedback.h"

namespace tumbler {

/// A packet of robots as they are when their motion ends.
struct HeldRobots {
  LaneRobot<Packet> robots;
  LaneState<Packet> state;
  HeldSetpoints<Packet> held;
};

/// What a feedback of the hold is found for: robots at the end of a motion, which are then pushed.
struct HoldStudy {
  const LaneKernel<Packet>& kernel;
  const LaneModel& model;
  LaneSteps steps;
  std::size_t joints = 0;
  std::vector<HeldRobots> packets;
  /// What is left of the motion, for each tick and joint; the last is held.
  std::vector<LaneSetpoint<Packet>> setpoints;
  int first_tick = 0;  ///< Of the setpoints, from the motion's start.
  double settle_s = 0;
  double target_rad = 0;               ///< Of the root's pitch.
  double following_tolerance_rad = 0;  ///< A joint that is farther from its setpoint is a fault.
  FeedbackSettings settings;
  /// The law but for its gains, which are zero: they are found at its last knot.
  Feedback<double> law;
};

/// How long and how wide the search is.
struct HoldSearchSize {
  int samples = 400;     ///< Random gains, without the sensor's errors.
  int improved = 3;      ///< The best of these are improved, first without errors, then with them.
  int generations = 60;  ///< Of each improvement.
};

/// Finds gains of the hold after a motion, by which robots stay that are pushed. Only the last
/// gains are found, and the dead zone: a robot on a flat foot stays without help until the foot
/// tips, and gains that catch it then shake it before.
///
/// 1. Random gains, without errors of the sensor and without a dead zone, on a few robots under
///    pushes that are larger than those asked for; without a catch no law is better than another.
/// 2. CMA-ES improves the best of them so.
/// 3. CMA-ES improves these with all robots, the sensor's errors, a dead zone and pushes around
///    those asked for.
///
/// A robot's loss is the mean size of the root's error of pitch since the push, 1.5 rad where it
/// fell, and how far off and restless it is before the push and in the last second.
///
/// @param tell       gets the number of laws that were tried since the last call, and the loss.
/// @param interrupted  ends the search early.
/// @returns the law; without gains when none is better than no feedback. The result does not depend
///          on the threads.
/// @pre study.packets is not empty.
[[nodiscard]] Feedback<double> FindHoldFeedback(
    const HoldStudy& study, const HoldSearchSize& size, std::uint64_t seed, int threads,
    const std::function<void(int start, std::int64_t tried, double loss)>& tell,
    const std::function<bool()>& interrupted);

/// The mean loss of a study's robots with a law.
/// @param packets  how many are played, from the first on.
/// @param errors   whether the sensor has its errors; without them pushes are the larger ones.
[[nodiscard]] double HoldLoss(const HoldStudy& study, const Feedback<double>& law,
                              std::size_t packets, bool errors, std::uint64_t seed);

}  // namespace tumbler
