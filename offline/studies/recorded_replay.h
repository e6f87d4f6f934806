#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/robot_posterior.h"
#include "offline/studies/recorded_motion.h"

namespace tumbler {

/// Plays robots through a record: each is told what the recorded one was told, and gives the
/// readings that its drives would have answered with. Robots are simulated in lanes (`LaneKernel`),
/// a packet at a time, from the rest in which the recorded motion begins.
class RecordedReplay {
 public:
  /// @param motion  has to outlive this object.
  /// @throws std::invalid_argument  naming what lanes do not have of its robot.
  RecordedReplay(const RecordedMotion& motion, std::span<const RobotQuantity> quantities);

  /// Readings less the recorded ones, in units of their noise. A reading that is repeated n times
  /// tells no more than one: each counts by its part, and its residual is smaller by the root of n.
  struct Residuals {
    /// For each robot: by tick and joint from the first tick that counts; 0 where there was no
    /// reply. Of a robot that left every plausible range they are as large as kLost.
    std::vector<std::vector<double>> of_robot;
  };
  static constexpr double kLost = 1e4;

  /// @param robots     coordinates of the quantities, each.
  /// @param per_tick   integration steps in a tick.
  /// @param starts     by robot and joint, how far from its first setpoint the joint was in truth
  ///                   when the robot was set down [rad]; empty: nowhere. Feet that rest do not
  ///                   forget where they were put.
  [[nodiscard]] Residuals Play(std::span<const std::vector<double>> robots, int per_tick,
                               std::span<const std::vector<double>> starts = {}) const;

  /// The first tick that counts: shortly before the motion begins.
  [[nodiscard]] std::size_t first() const { return first_; }
  /// Residuals of each robot.
  [[nodiscard]] std::size_t count() const {
    return (motion_.ticks.size() - first_) * motion_.joint_count();
  }
  /// By tick and joint as residuals: 0 without a reply, else the part of a reading that it is.
  [[nodiscard]] const std::vector<double>& parts() const { return parts_; }
  [[nodiscard]] const RecordedMotion& motion() const { return motion_; }
  /// Standard deviation of a reading beside a robot in lanes that is this one, of each joint.
  [[nodiscard]] const std::vector<double>& noise_rad() const { return noise_rad_; }

 private:
  /// What a robot has that is no part of its lane.
  struct Sampling {
    std::vector<double> bias_rad;  // of each joint
    double lag_s = 0;
  };

  void FindParts();
  /// The delay of a lane's drive whose setpoint arrives so long after the tick [s]. Lanes ask for
  /// it in the middle of the drive's period.
  [[nodiscard]] double ActsAfter(double arrival_s) const;
  LaneRobot<double> RobotOf(std::span<const double> coordinates, Sampling& sampling) const;
  void PlayPacket(std::span<const std::vector<double>> robots, int per_tick,
                  std::span<const std::vector<double>> starts,
                  std::span<std::vector<double>> residuals) const;

  const RecordedMotion& motion_;
  std::vector<RobotQuantity> quantities_;
  LaneModel model_;
  LaneState<double> start_{};
  std::size_t first_ = 0;
  std::vector<double> parts_;
  std::vector<double> noise_rad_;   // of each joint
  std::vector<MotorFacts> stated_;  // likewise
};

}  // namespace tumbler
