#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "offline/problem/problem.h"
#include "offline/scene/lane_robot.h"

namespace tumbler {

/// What the end of a robot in a packet is worth, by the targets of a task.
///
/// A loss of less than 0.2 is that of a robot that does what the motion's purpose asks for, 0.35
/// ... 0.65 of one that is near, and more than 1 of one that fell.
class RobotLoss {
 public:
  static constexpr std::size_t kPitch = 2;  ///< Of the degrees of freedom.
  /// A loss below which a motion carries a robot, and one with which the model does what is asked,
  /// and not only nearly.
  static constexpr double kCarried = 0.2, kCalm = 0.08;
  /// A loss from which on robots mostly fall, and one that cannot be told from 0.
  static constexpr double kHopeless = 0.9, kPerfect = 1e-3;
  /// The loss of a robot that the runtime stops, or whose own shapes overlap.
  static constexpr double kFault = 1.3;

  /// How fast a pendulum falls: this is one of 0.6 m. From 3 to 12 tell equally well 0.1 s after a
  /// handstand's end which robots will stand.
  static constexpr double kFalls_per_s = 4;

  /// @pre the problem has a target of the pitch.
  explicit RobotLoss(const Problem& problem);

  /// How fast robots leave the target of the pitch [rad/s]: what of the motion of an inverted
  /// pendulum grows (the divergent component of motion [T09], times kFalls_per_s), at most 20
  /// either way. One that comes to rest there by itself has little of it.
  ///
  /// [T09] T. Takenaka, T. Matsumoto, T. Yoshiike, Real Time Motion Generation and Control for
  /// Biped Robot, 1st Report, IROS 2009.
  template <class P>
  [[nodiscard]] std::array<double, P::kLanes> Divergence(const LaneState<P>& state) const;

  [[nodiscard]] double target_rad() const { return target_rad_; }        ///< Of the pitch.
  [[nodiscard]] double tolerance_rad() const { return tolerance_rad_; }  ///< Likewise.

  /// How far robots are from what the task asks for: from the target of the pitch [rad], or from a
  /// place, in as many radians as the tolerance of the pitch is of the place's. 1000 where that is
  /// not finite.
  /// @tparam P  Packet or WidePacket.
  template <class P>
  [[nodiscard]] std::array<double, P::kLanes> Off(const LaneState<P>& state) const;

  /// @param settled, off  Off when the settle phase ends, and later.
  /// @param speed         the root's largest, in the time that is watched [m/s, rad/s].
  /// @param astray        the mean of Off, of which no more than 1 counts, from 0.1 s before
  ///                      the end of the motion to that of the settle phase: where robots fall in
  ///                      the end, the motion is better in which they stay near for longer.
  [[nodiscard]] double Of(double settled, double off, double speed, double astray) const;

 private:
  /// Where the root is to be: a target of its x or z.
  struct Place {
    std::size_t dof = 0;
    double target_m = 0;
    double rad_per_m = 0;  ///< Tolerance of the pitch for that of the place.
  };
  double target_rad_ = 0;
  double tolerance_rad_ = CostTerm::kAngleTolerance_rad;
  std::vector<Place> places_;
};

}  // namespace tumbler
