#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/core/feedback.h"
#include "offline/problem/robust_settings.h"
#include "offline/scene/lane_robot.h"

namespace tumbler {

/// What a packet's sensors add to what they measure, tick by tick and lane by lane: noise and bias.
/// The same for all motions that are compared.
class LaneNoise {
 public:
  LaneNoise(const FeedbackSettings& settings, std::size_t ticks, std::uint64_t seed,
            std::uint64_t packet);
  [[nodiscard]] double angle(std::size_t tick, std::size_t lane) const { return At(tick, lane)[0]; }
  [[nodiscard]] double rate(std::size_t tick, std::size_t lane) const { return At(tick, lane)[1]; }

 private:
  [[nodiscard]] const std::array<double, 2>& At(std::size_t tick, std::size_t lane) const {
    return numbers_[tick * Packet::kLanes + lane];
  }
  std::vector<std::array<double, 2>> numbers_;
};

/// The feedback of the robots in a packet (`common/core/feedback.h`), as the executor does it: from
/// the first tick of a motion on, and in the hold after it. A sensor's angle and rate come late by
/// its delay and by the frames' tick.
class LaneFeedback {
 public:
  /// All have to outlive this object.
  /// @param first_tick  of the motion, from which on this is called.
  LaneFeedback(const Feedback<double>& law, const LaneNoise& noise, double delay_s, double tick_s,
               std::size_t joints, int first_tick = 0);

  /// Corrects the setpoints of the next tick.
  /// @param state  when the tick begins.
  void Correct(const LaneState<Packet>& state, std::span<LaneSetpoint<Packet>> setpoints);

 private:
  struct Lane {
    double error_rad = 0, rate_error_rad_s = 0, share = 0;
    std::array<double, LaneModel::kMaxJoints> correction_rad{};
  };
  struct Measurement {
    std::array<double, Packet::kLanes> angle_rad{}, rate_rad_s{};
  };
  [[nodiscard]] Measurement Measure(const LaneState<Packet>& state) const;

  const Feedback<double>& law_;
  const LaneNoise& noise_;
  double tick_s_;
  std::size_t joints_;
  std::size_t late_ticks_;
  std::size_t tick_ = 0;
  int knot_ = 0;
  bool begun_ = false;
  Feedback<double>::Spline::Basis basis_;
  std::array<Lane, Packet::kLanes> lanes_;
  std::vector<Measurement> waiting_;  ///< Of the last ticks, in a ring.
};

}  // namespace tumbler
