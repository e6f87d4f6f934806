#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "offline/scene/robot_posterior.h"
#include "offline/studies/recorded_motion.h"

namespace tumbler {

/// Settings of a fit.
struct FitSettings {
  /// Fits are begun from the prior's mean, and then, while what was found does not explain the
  /// records, from so many robots that are drawn from it.
  int starts = 4;
  /// Integration steps in a tick of 1 ms. Residuals take the finer ones, which are as long as the
  /// drives' loop: with 4 steps they are off by several times the noise.
  int per_tick = 20, per_tick_rough = 5;
  /// Noise is taken to be so many times larger, one after the other: far from the solution a path
  /// is no linear function of the robot, and what is exact there leads astray.
  std::vector<double> annealing = {30, 6, 1};
  int iterations = 6;  ///< Of each.
  /// Root mean square of the residuals, in units of their noise, above which a fit does not explain
  /// its records.
  double chi_max = 1.0;
  /// Total mass, as weighed [kg]; 0: it was not. Then forces are taken for what drives say.
  double weight_kg = 0;
  /// Standard deviation of the scale's logarithm.
  double weight_sd = 1e-3;
  /// Coordinates of a robot from which a fit is begun before any other; empty: the prior's mean is
  /// the first.
  std::vector<double> begin;
  /// Whether a robot with these coordinates fails in the motions that the robot has failed in:
  /// where no model explains the records, one that fails is taken, if there is one near what is
  /// nearest to an explanation. Empty: it has failed in none.
  std::function<bool(const std::vector<double>& coordinates)> fails;
  std::function<void(const std::string&)> say;  ///< Told of progress; may be empty.
  const std::atomic<bool>* interrupt = nullptr;
};

/// Residuals of one record.
struct FitResiduals {
  std::string record;
  /// By joint: of each tick from `first_s` on, in units of the noise; NaN without a reply.
  std::vector<std::vector<double>> of_joint;
  double first_s = 0;  ///< Time of the first, from the beginning of the motion.
  double tick_s = 1e-3;
  std::vector<double> noise_rad;     ///< Of each joint.
  double squares = 0, readings = 0;  ///< Sum of squares, and of how many readings that differ.
  double chi = 0;                    ///< Root of their ratio.
  std::vector<double> chi_of_joint;
};

/// What is known of a robot before its records are fitted.
struct FitPrior {
  RobotPosterior known;
  /// What earlier records say; empty: there are none.
  RobotInformation earlier;
  /// Of each coordinate before the first record of the robot; empty: those of `known`.
  std::vector<double> first_deviations;
  bool weighed = false;  ///< Whether what earlier records say has the robot's weight in it.
};

/// What records say of a robot.
struct FitOutcome {
  RobotPosterior prior, posterior;
  RobotInformation information;          ///< For a fit of further records.
  std::vector<double> first_deviations;  ///< Of each coordinate before the first record.
  std::vector<FitResiduals> records;
  double chi = 0;
  /// Whether chi is above its limit: physics, or the wire, are not as modelled, and the quantities
  /// are those of a robot that only moves as this one did.
  bool effective = false;
  /// With what earlier records say: how far the robot is from the one that these alone tell,
  /// squared, in the metric of their Hessian, and the limit of it, which so many normal numbers are
  /// above once in a thousand times. Beyond it the earlier records may say other things than is
  /// known of them, and the model is called effective. 0: without.
  double moved = 0, moved_max = 0;
  /// In words, what is known to be amiss with an effective model's records.
  std::vector<std::string> causes;
  bool weighed = false;
  int starts = 0;       ///< Of which the best was taken.
  int evaluations = 0;  ///< Robots that were played through all records.
  bool interrupted = false;

  /// Whether it is too far from the earlier robot.
  [[nodiscard]] bool strays() const { return moved > moved_max; }
  /// The part of a quantity's first deviation that is left.
  [[nodiscard]] double ShareLeft(std::size_t quantity) const;
  /// Whether the records tell a quantity.
  [[nodiscard]] bool Identifiable(std::size_t quantity) const { return ShareLeft(quantity) < 0.5; }
};

/// The robot that explains records best, by maximum likelihood with a prior: Gauss and Newton's
/// method with annealed noise. Derivatives are differences between robots in lanes.
///
/// Its covariance is a sandwich: residuals of one bump are not independent of one another, so that
/// what a block of them says together counts as one observation.
///
/// With what earlier records say, the outcome is that of one fit of all records, but for what is no
/// linear function of the robot. What they say holds near the earlier robot only: of an outcome
/// that is too far from it nothing is to be believed, and it is called effective.
/// @param records  of one robot; each has the prior's links and joints.
/// @throws std::invalid_argument  when a record has another robot.
FitOutcome FitRobot(std::span<const RecordedMotion> records, const FitPrior& prior,
                    const FitSettings& settings);

/// The residuals of a robot in records that need not be those of its fit, set down for each where
/// it explains it best.
std::vector<FitResiduals> ResidualsOf(std::span<const RecordedMotion> records,
                                      const RobotPosterior& robot, int per_tick);

/// The prior of a first fit of these records: PriorOf, with the quantities of the drives.
FitPrior PriorOfRecords(std::span<const RecordedMotion> records, bool weighed);

}  // namespace tumbler
