#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/findings.h"

namespace tumbler {

/// A ratio of two quantities that would be 1 if the drives file were right.
struct ScaleRatio {
  /// A larger standard error tells nothing.
  static constexpr double kErrorMax = 0.08;
  /// Scales whose logarithms differ by less than this, and by less than twice their errors more,
  /// are the same: what models differ by is more, and current sensors are good for this.
  static constexpr double kSame = 0.08;

  double log = 0;                                          ///< Its natural logarithm.
  double error = std::numeric_limits<double>::infinity();  ///< Standard error of that.
  bool reversed = false;  ///< Whether the ratio is negative; `log` is that of its magnitude.

  [[nodiscard]] bool told() const { return error <= kErrorMax; }
  [[nodiscard]] double value() const;
};

/// What a drive's own words say of its scales.
///
/// With wrong ranges a drive obeys and reports, scaled. Its law (kp (position - q) + kd (velocity -
/// qdot) + torque) holds whatever its joint does, with friction, load and inertia that nobody
/// knows. So the torque that is reported is fitted to the terms of the law, and what is reported as
/// velocity to the differences of reported positions. Whatever scales everything alike cannot be
/// seen in this: positions need the joint's known way, torques a known load.
struct DriveScales {
  ScaleRatio velocity;        ///< Reported velocity to differences of reported positions.
  ScaleRatio position_asked;  ///< Positions as asked for to positions as reported.
  ScaleRatio velocity_asked;  ///< Likewise velocities.
  ScaleRatio torque_asked;    ///< Reported torque to the feed-forward that caused it.
  ScaleRatio stiffness;       ///< Reported torque to kp (position - q), with q as reported.
  ScaleRatio damping;         ///< Reported torque to kd (velocity - qdot), with qdot as reported.
  bool torque_reported = false;
  bool gains_carried = false;
  /// Share of the variance of the reported torque that the law explains. Below kExplainedMin the
  /// torque tells nothing.
  double explained = 0;
  double way_rad = 0;  ///< From the lowest to the highest reported position.

  static constexpr double kExplainedMin = 0.8;
};
Json ToJson(const DriveScales& scales);
/// The scales in words, without the drive.
std::string Describe(const DriveScales& scales);

/// Moves a drive's joint to and fro, by a position, a velocity and a push that have nothing to do
/// with each other, for a few seconds. It begins with a quarter of what the bounds allow, and goes
/// on to more only while the joint stays well within the amplitude, whatever the ranges are.
/// Torques are at most half of the bound, if the file's range is right.
DriveScales MeasureScales(BenchSession& session, std::size_t drive);

/// The scales that a recording of a motion tells.
/// @param period_s  of the control loop.
DriveScales FitScales(const DriveEntry& entry, const DriveRecording& recording, double period_s);

/// The same of any small motion: only the scale of velocities. A motion without a push of its own
/// does not tell torques and gains.
DriveScales FitMotion(const DriveEntry& entry, const DriveRecording& recording);

/// What is known of a drive's scales besides.
struct KnownScales {
  /// True way of the joint to the way that was reported, from turning it by hand; 1 where that is
  /// as it should be.
  std::optional<double> position;
  /// True torque to reported torque, from a known load.
  std::optional<double> torque;
};

/// Finds the fewest values of the drives file whose error explains the scales. Names them, with
/// what they would be, and with the models that are delivered with such a range; where several
/// explanations are as good, all of them. Says what was judged and what is not told.
/// @param drive  in words.
Judgement JudgeScales(const std::string& drive, const DriveEntry& entry, const DriveScales& scales,
                      const KnownScales& known);

}  // namespace tumbler
