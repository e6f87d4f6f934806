#include "offline/studies/robot_fit.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <variant>

#include "common/core/functions.h"
#include "offline/scene/normal.h"
#include "offline/studies/fit_objective.h"
#include "offline/studies/stated_motors.h"

namespace tumbler {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Kind = RobotQuantity::Kind;

/// Of the sandwich: as long as a bump of residuals.
constexpr double kBlock_s = 0.05;
/// An iteration that gains less than this part of the objective is the last of its noise.
constexpr double kGain = 1e-4;

/// By how much more than the sandwich says estimates of hidden robots scatter about the truth
/// (docs/identify.md): by rounding that stands still with the robot, and by what is no linear
/// function of the robot.
double WideningOf(Kind kind) {
  switch (kind) {
    case Kind::kZero:
      return 1.3;
    case Kind::kDry:
      return 1.6;
    default:
      return 1;
  }
}

/// Where a fit got to.
struct Found {
  VectorXd u, residuals;
  double value = std::numeric_limits<double>::infinity();  // with the true noise
};

class Fitter {
 public:
  Fitter(FitObjective& objective, const FitSettings& settings)
      : objective_(objective), settings_(settings) {}

  Found From(VectorXd u) {
    Found found;
    for (const double noise : settings_.annealing) Descend(noise, settings_.iterations, u, found);
    return found;
  }

  /// The best with so much noise, from the prior's mean or from a robot.
  Found With(double noise, const VectorXd& robot) {
    constexpr double kRough = 30;
    constexpr int kLonger = 2;  // Residuals that are not explained let steps gain little.
    Found best;
    double least = std::numeric_limits<double>::infinity();
    for (VectorXd u : {objective_.Allowed(VectorXd::Zero(robot.size())), robot}) {
      Found found;
      Descend(std::max(noise, kRough), kLonger * settings_.iterations, u, found);
      Descend(noise, kLonger * settings_.iterations, u, found);
      if (found.u.size() == 0) continue;  // interrupted before the first step
      const double value = objective_.ValueOf(found.residuals, found.u, noise);
      if (value >= least) continue;
      least = value;
      best = found;
    }
    return best;
  }

  /// Goes on from a robot that is drawn about one: the one that is better by the most than
  /// derivatives say. Between a robot that stands in a record and one that falls in it none leads.
  Found Across(double noise, const Found& from) {
    const Drawn drawn = DrawAbout(from, noise);
    double least = std::numeric_limits<double>::infinity();
    VectorXd best = from.u;
    for (std::size_t i = 0; i < kDrawn; ++i) {
      const double more =
          objective_.ValueOf(drawn.residuals.col(ToIndex(i)), drawn.robots[i], noise) -
          drawn.expected[i];
      if (more >= least) continue;
      least = more;
      best = drawn.robots[i];
    }
    Found found;
    Descend(noise, settings_.iterations, best, found);
    if (found.u.size() == 0) return from;  // interrupted before the first step
    const double value = objective_.ValueOf(found.residuals, found.u, noise);
    return value < objective_.ValueOf(from.residuals, from.u, noise) ? found : from;
  }

  /// Goes on from a robot that is drawn about one that does not fail where the robot did: the best
  /// of those that do, and from there as long as it does. Where none of the best is found that
  /// does, that one stays.
  Found ToOneThatFails(double noise, const Found& from) {
    constexpr std::size_t kAsked = 64;
    const Drawn drawn = DrawAbout(from, noise);
    std::vector<std::size_t> order(kDrawn);
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t i) {
      return objective_.ValueOf(drawn.residuals.col(ToIndex(i)), drawn.robots[i], noise);
    });
    order.resize(kAsked);
    for (const std::size_t i : order) {
      if (Interrupted()) break;
      if (!Fails(drawn.robots[i])) continue;
      Found found{drawn.robots[i], drawn.residuals.col(ToIndex(i))};
      for (int step = 0; step < settings_.iterations && !Interrupted(); ++step) {
        VectorXd u = found.u;
        Found next = found;
        const bool goes_on = Step(u, noise, next);
        if (!Fails(next.u)) break;
        found = next;
        if (!goes_on) break;
      }
      return found;
    }
    return from;
  }
  /// Whether a robot fails where the robot did.
  [[nodiscard]] bool Fails(const VectorXd& u) const {
    return !settings_.fails || settings_.fails(objective_.CoordinatesOf(u));
  }

  [[nodiscard]] bool Interrupted() const {
    return settings_.interrupt != nullptr && *settings_.interrupt;
  }

 private:
  static constexpr std::size_t kDrawn = 192;
  /// Robots that are drawn about one, at two standard deviations.
  struct Drawn {
    std::vector<VectorXd> robots;
    MatrixXd residuals;            ///< A column each.
    std::vector<double> expected;  ///< By how much derivatives say that each is worse.
  };
  Drawn DrawAbout(const Found& from, double noise) {
    constexpr double kScale = 2;
    const MatrixXd J = objective_.Derivatives(from.u, settings_.per_tick) / noise;
    const Eigen::LLT<MatrixXd> factor(J.transpose() * J + objective_.precision());
    Drawn drawn;
    for (std::size_t i = 0; i < kDrawn; ++i) {
      Normal normal(1, i);
      VectorXd u(from.u.size());
      for (double& number : u) number = kScale * normal.Draw();
      drawn.expected.push_back(0.5 * u.squaredNorm());
      factor.matrixU().solveInPlace(u);
      drawn.robots.push_back(objective_.Allowed(from.u + u));
    }
    drawn.residuals = objective_.Residuals(drawn.robots, settings_.per_tick);
    return drawn;
  }

  void Descend(double noise, int iterations, VectorXd& u, Found& found) {
    for (int i = 0; i < iterations && !Interrupted(); ++i) {
      if (!Step(u, noise, found)) break;
    }
  }

  /// @returns whether another step may gain something.
  bool Step(VectorXd& u, double noise, Found& found) {
    const MatrixXd J = objective_.Derivatives(u, settings_.per_tick_rough);
    if (found.u.size() == 0) {
      found.u = u;
      found.residuals = objective_.Residuals({u}, settings_.per_tick).col(0);
    }
    const double weight = 1 / (noise * noise);
    const MatrixXd H = weight * J.transpose() * J + objective_.precision();
    const VectorXd gradient = weight * J.transpose() * found.residuals + objective_.PullOf(u);
    std::vector<VectorXd> candidates;
    for (const double damping : {0.0, 1e-2, 0.1, 1.0, 10.0, 100.0}) {
      MatrixXd A = H;
      A.diagonal() += damping * A.diagonal();
      VectorXd step = objective_.StepOf(A, gradient, u);
      const double longest = step.cwiseAbs().maxCoeff();
      constexpr double kLongest = 3;
      if (longest > kLongest) step *= kLongest / longest;
      candidates.push_back(u + step);
      if (damping == 0) {
        candidates.push_back(u + 0.5 * step);
        candidates.push_back(u + 0.25 * step);
      }
    }
    candidates.resize(Packet::kLanes, u);
    for (VectorXd& candidate : candidates) candidate = objective_.Allowed(candidate);
    const MatrixXd residuals = objective_.Residuals(candidates, settings_.per_tick);
    const double before = objective_.ValueOf(found.residuals, u, noise);
    double best = before;
    std::size_t which = candidates.size();
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      const double value = objective_.ValueOf(residuals.col(ToIndex(c)), candidates[c], noise);
      if (value < best) {
        best = value;
        which = c;
      }
    }
    if (settings_.say) {
      settings_.say(fmt::format(
          "noise x{:.3g}: {:.6g} -> {:.6g}{}", noise, before, best,
          which == candidates.size() ? " (no step helps)" : fmt::format(" by {}", which)));
    }
    if (which == candidates.size()) return false;
    u = candidates[which];
    found.u = u;
    found.residuals = residuals.col(ToIndex(which));
    found.value = objective_.ValueOf(found.residuals, u, 1);
    return before - best > kGain * before;
  }

  FitObjective& objective_;
  const FitSettings& settings_;
};

std::vector<FitResiduals> Split(const FitObjective& objective, const VectorXd& residuals) {
  std::vector<FitResiduals> split;
  Eigen::Index row = 0;
  for (const auto& replay : objective.replays()) {
    const RecordedMotion& motion = replay->motion();
    const std::size_t joints = motion.joint_count();
    FitResiduals of;
    of.record = motion.name;
    of.tick_s = motion.tick_s;
    of.first_s =
        (static_cast<double>(replay->first()) - static_cast<double>(motion.begins)) * motion.tick_s;
    of.of_joint.resize(joints);
    of.noise_rad = replay->noise_rad();
    std::vector<double> squares(joints, 0.0), counts(joints, 0.0);
    std::size_t i = 0;
    for (std::size_t k = replay->first(); k < motion.ticks.size(); ++k) {
      for (std::size_t j = 0; j < joints; ++j, ++row, ++i) {
        const double part = replay->parts()[i], r = residuals[row];
        of.of_joint[j].push_back(part > 0 ? r / std::sqrt(part)
                                          : std::numeric_limits<double>::quiet_NaN());
        squares[j] += r * r;
        counts[j] += part;
      }
    }
    for (std::size_t j = 0; j < joints; ++j) {
      of.chi_of_joint.push_back(std::sqrt(squares[j] / std::max(1.0, counts[j])));
      of.squares += squares[j];
      of.readings += counts[j];
    }
    of.chi = std::sqrt(of.squares / std::max(1.0, of.readings));
    split.push_back(std::move(of));
  }
  return split;
}

double ChiOf(const std::vector<FitResiduals>& records) {
  double squares = 0, readings = 0;
  for (const FitResiduals& record : records) {
    squares += record.squares;
    readings += record.readings;
  }
  return std::sqrt(squares / std::max(1.0, readings));
}

/// What is known before of a robot that no model explains: nearly nothing of how its ground yields
/// and lets it creep. Where contacts follow another law there is no such quantity that a usual
/// value would say anything of, and a fit that has to stay near one is off in others for it.
FitPrior WithAnyGround(const FitPrior& prior) {
  constexpr double kAnyCompliance = 2, kAnyCreep = 1;  // deviations of logarithms
  FitPrior any = prior;
  const std::size_t n = any.known.size();
  any.first_deviations.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (prior.first_deviations.empty()) any.first_deviations[i] = prior.known.DeviationOf(i);
    const Kind kind = any.known.quantities[i].kind;
    double deviation = any.known.DeviationOf(i);
    if (kind == Kind::kStiffness || kind == Kind::kDamping)
      deviation = std::max(deviation, kAnyCompliance);
    if (kind == Kind::kCreepSpeed) deviation = std::max(deviation, kAnyCreep);
    any.known.covariance[i * n + i] = deviation * deviation;
  }
  return any;
}

/// A robot that does not explain its records.
struct Effective {
  Found found;
  double noise = 1;
};

/// What a model does not explain is no noise of single readings. It is as large as the residuals
/// are, and lasts for a bump of them, which says as much as one reading. Without it such a robot is
/// far from any that could have been built, for little that its residuals gain.
Effective FitEffective(FitObjective& objective, double tick_s, Fitter& fitter, const Found& best) {
  constexpr int kRounds = 3;
  constexpr double kGains = 0.8;  // Of the residuals, for another round.
  Effective effective{best};
  double chi = ChiOf(Split(objective, best.residuals));
  for (int round = 0; round < kRounds; ++round) {
    effective.noise = chi * std::sqrt(kBlock_s / tick_s);
    const Found with = fitter.With(effective.noise, effective.found.u);
    if (fitter.Interrupted()) return effective;
    effective.found = fitter.Across(effective.noise, with);
    const double before = chi;
    chi = ChiOf(Split(objective, effective.found.residuals));
    if (chi > kGains * before) break;
  }
  if (!fitter.Interrupted() && !fitter.Fails(effective.found.u))
    effective.found = fitter.ToOneThatFails(effective.noise, effective.found);
  return effective;
}

/// Moves a solution by a step with derivatives in the steps of its residuals.
void Refine(FitObjective& objective, const MatrixXd& J, double noise, const FitSettings& settings,
            Found& found) {
  const double weight = 1 / (noise * noise);
  const MatrixXd A = weight * J.transpose() * J + objective.precision();
  const VectorXd gradient = weight * J.transpose() * found.residuals + objective.PullOf(found.u);
  const VectorXd u = objective.Allowed(found.u + objective.StepOf(A, gradient, found.u));
  const VectorXd residuals = objective.Residuals({u}, settings.per_tick).col(0);
  if (!(objective.ValueOf(residuals, u, noise) <
        objective.ValueOf(found.residuals, found.u, noise))) {
    return;
  }
  found.u = u;
  found.residuals = residuals;
}

/// The objective about a solution, as a quadratic function.
struct About {
  MatrixXd hessian, gradient_covariance;
  VectorXd centre;  ///< Its minimum, which the bounds may not allow.
};

/// @param J  derivatives there.
About LookAbout(FitObjective& objective, const MatrixXd& J, double noise, const Found& found) {
  const double weight = 1 / (noise * noise);
  About about;
  about.hessian = weight * J.transpose() * J + objective.precision();
  about.gradient_covariance = objective.gradient_covariance();
  Eigen::Index row = 0;
  for (const auto& replay : objective.replays()) {
    const RecordedMotion& motion = replay->motion();
    const auto rows = ToIndex(replay->count());
    const auto block = ToIndex(static_cast<std::size_t>(std::lround(kBlock_s / motion.tick_s)) *
                               motion.joint_count());
    for (Eigen::Index at = 0; at < rows; at += block) {
      const Eigen::Index length = std::min(block, rows - at);
      const VectorXd score = weight * J.middleRows(row + at, length).transpose() *
                             found.residuals.segment(row + at, length);
      about.gradient_covariance += score * score.transpose();
    }
    row += rows;
  }
  for (; row < J.rows(); ++row)
    about.gradient_covariance += weight * J.row(row).transpose() * J.row(row);
  const VectorXd gradient = weight * J.transpose() * found.residuals + objective.PullOf(found.u);
  about.centre = found.u - about.hessian.ldlt().solve(gradient);
  return about;
}

/// The covariance of estimates about a solution.
MatrixXd Sandwich(const About& about) {
  const Eigen::Index n = about.hessian.cols();
  const auto solve = about.hessian.ldlt();
  const MatrixXd half = solve.solve(about.gradient_covariance);
  const MatrixXd sandwich = solve.solve(half.transpose());
  const MatrixXd plain = solve.solve(MatrixXd::Identity(n, n));
  // No residual says less than its own noise.
  MatrixXd covariance = sandwich;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (sandwich(i, i) >= plain(i, i)) continue;
    const double larger = std::sqrt(plain(i, i) / sandwich(i, i));
    covariance.row(i) *= larger;
    covariance.col(i) *= larger;
  }
  return 0.5 * (covariance + covariance.transpose());
}

/// The same of the robot alone, wherever it was set down for each record (Schur complement).
About OfRobot(const About& about, Eigen::Index n) {
  const Eigen::Index starts = about.hessian.cols() - n;
  MatrixXd score(n, n + starts);  // of the robot, less what starts take of it
  score << MatrixXd::Identity(n, n), -about.hessian.bottomRightCorner(starts, starts)
                                          .ldlt()
                                          .solve(about.hessian.bottomLeftCorner(starts, n))
                                          .transpose();
  const MatrixXd hessian = score * about.hessian.leftCols(n);
  const MatrixXd gradient_covariance = score * about.gradient_covariance * score.transpose();
  return {0.5 * (hessian + hessian.transpose()),
          0.5 * (gradient_covariance + gradient_covariance.transpose()), about.centre.head(n)};
}

RobotInformation InformationOf(const FitObjective& objective, const About& about) {
  RobotInformation information;
  information.centre = objective.CoordinatesOf(about.centre);
  const std::vector<double>& deviations = objective.deviations();
  const std::size_t n = deviations.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < n; ++k) {
      // The lower triangles, so that what is written is symmetric bit by bit.
      const Eigen::Index row = ToIndex(std::max(i, k)), column = ToIndex(std::min(i, k));
      const double scale = 1 / (deviations[i] * deviations[k]);
      information.hessian.push_back(about.hessian(row, column) * scale);
      information.gradient_covariance.push_back(about.gradient_covariance(row, column) * scale);
    }
  }
  return information;
}

/// How much of the objective of earlier records a robot loses against its minimum, twice: a sum of
/// squares of normal numbers for the robot of these records, where the objective is as quadratic as
/// it is taken to be.
double LostOf(const RobotInformation& earlier, const std::vector<double>& robot) {
  const std::size_t n = robot.size();
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < n; ++k) {
      sum += (robot[i] - earlier.centre[i]) * earlier.hessian[i * n + k] *
             (robot[k] - earlier.centre[k]);
    }
  }
  return sum;
}

/// What a sum of n squares of normal numbers is above once in a thousand times (Wilson and
/// Hilferty).
double ChiSquaredLimit(std::size_t n) {
  constexpr double kNormal = 3.09;
  const double part = 2 / (9 * static_cast<double>(n)), root = 1 - part + kNormal * std::sqrt(part);
  return static_cast<double>(n) * root * root * root;
}

/// Finds what is known to be amiss with records, and calls the model of what is not modelled
/// effective.
void NoteCauses(std::span<const RecordedMotion> records, double chi_max, FitOutcome& outcome) {
  const bool explained = outcome.chi <= chi_max;
  for (const DriveEntry& drive : records.front().drives.drives) {
    if (std::holds_alternative<MitConfig>(drive.config)) continue;
    outcome.effective = true;
    outcome.causes.push_back(fmt::format(
        "the drive of {} is none of MIT: when it takes setpoints, and what it does with them "
        "until the next, is not modelled",
        drive.joint));
    break;
  }
  for (const RecordedMotion& record : records) {
    if (record.rested || explained) continue;
    outcome.causes.push_back(
        fmt::format("{} does not show that the robot rested before its motion; if it did not, "
                    "that may be why: hold it still for half a second",
                    record.name));
  }
}

}  // namespace

double FitOutcome::ShareLeft(std::size_t quantity) const {
  const double before = first_deviations[quantity];
  return before > 0 ? posterior.DeviationOf(quantity) / before : 1;
}

FitPrior PriorOfRecords(std::span<const RecordedMotion> records, bool weighed) {
  RobotPosterior prior = PriorOf(records.front().scene);
  std::vector<RobotQuantity> more = {
      {Kind::kLag, ""}, {Kind::kVelocityLag, ""}, {Kind::kTorqueLag, ""}};
  if (weighed) more.push_back({Kind::kTorque, ""});
  for (const RobotQuantity& quantity : prior.quantities)
    if (quantity.kind == Kind::kMass) more.push_back({Kind::kLength, quantity.of});
  std::vector<MotorFacts> drives;
  for (const RecordedDrive& joint : records.front().joints) drives.push_back(joint.motor);
  const MotorFacts stated = AverageOf(drives);
  const auto mean = [&stated](Kind kind) {
    if (kind == Kind::kVelocityLag) return stated.velocity_filter_s;
    if (kind == Kind::kTorqueLag) return stated.torque_time_constant_s;
    return kind == Kind::kTorque ? portable::Log(stated.torque_factor) : 0.0;
  };
  const std::size_t n = prior.size(), m = n + more.size();
  std::vector<double> covariance(m * m, 0.0);
  for (std::size_t i = 0; i < n; ++i) covariance[i * m + i] = prior.covariance[i * n + i];
  for (std::size_t i = 0; i < more.size(); ++i) {
    const double sd = FactsOf(more[i].kind).prior_sd;
    covariance[(n + i) * m + n + i] = sd * sd;
    prior.quantities.push_back(more[i]);
    prior.mean.push_back(mean(more[i].kind));
  }
  prior.covariance = std::move(covariance);
  return {std::move(prior), {}, {}};
}

namespace {

/// Begins with the first record, and goes on from what explains it with each further one: a motion
/// that leads astray whoever knows nothing of the robot says more of one that is nearly known.
VectorXd GrowFromFirst(std::span<const RecordedMotion> records, const FitPrior& prior,
                       const FitSettings& settings) {
  constexpr double kNear = 6;  // Noise with which a fit goes on, in its true size.
  FitSettings of = settings;
  VectorXd u;
  for (std::size_t count = 1; count < records.size(); ++count) {
    FitObjective objective(records.first(count), prior, of);
    Fitter fitter(objective, of);
    const Found found = fitter.From(objective.Allowed(objective.Extended(u)));
    if (fitter.Interrupted()) break;
    u = found.u;
    of.annealing = {kNear, 1};
  }
  return u;
}

/// The best of what is found from the prior's mean and from robots that are drawn from it, until
/// the records are explained; empty where the fit was interrupted before the first step.
/// @param starts  is counted up.
Found FromStarts(std::span<const RecordedMotion> records, const FitPrior& prior,
                 const FitSettings& settings, FitObjective& objective, Fitter& fitter,
                 int& starts) {
  Found best;
  const auto explains = [&] { return ChiOf(Split(objective, best.residuals)) <= settings.chi_max; };
  const int before = settings.begin.empty() ? 0 : -1;
  for (int start = before; start < settings.starts && !fitter.Interrupted(); ++start) {
    VectorXd u = VectorXd::Zero(objective.size());
    Normal normal(1, static_cast<std::uint64_t>(std::max(start, 0)));
    for (std::size_t i = 0; start != 0 && i < prior.known.size(); ++i) {
      const double off = start < 0 ? settings.begin[i] - prior.known.mean[i]
                                   : normal.Draw() * prior.known.DeviationOf(i);
      u[ToIndex(i)] = off / objective.deviations()[i];
    }
    const Found found = fitter.From(objective.Allowed(u));
    if (found.u.size() == 0) break;  // interrupted before the first step
    ++starts;
    if (found.value < best.value || best.u.size() == 0) best = found;
    if (explains()) break;
    if (start != 0 || records.size() == 1 || fitter.Interrupted()) continue;
    const VectorXd begin = objective.Extended(GrowFromFirst(records, prior, settings));
    const Found grown = fitter.From(objective.Allowed(begin));
    ++starts;
    if (grown.value < best.value) best = grown;
    if (explains()) break;
  }
  return best;
}

/// Moves a solution by two steps with derivatives in the steps of its residuals; of one that fails
/// where the robot did no farther than it does.
/// @returns the derivatives at the solution, or so near to it that they are the same.
MatrixXd RefineTwice(FitObjective& objective, const Fitter& fitter, double noise,
                     const FitSettings& settings, bool fails, Found& found) {
  MatrixXd J = objective.Derivatives(found.u, settings.per_tick);
  for (int step = 0; step < 2; ++step) {
    Found refined = found;
    Refine(objective, J, noise, settings, refined);
    if (fails && fitter.Fails(found.u) && !fitter.Fails(refined.u)) break;
    found = refined;
    if (step == 0) J = objective.Derivatives(found.u, settings.per_tick);
  }
  return J;
}

}  // namespace

FitOutcome FitRobot(std::span<const RecordedMotion> records, const FitPrior& prior,
                    const FitSettings& settings) {
  if (records.empty()) throw std::invalid_argument("a fit needs a record");
  FitOutcome outcome;
  outcome.prior = prior.known;
  outcome.weighed = settings.weight_kg > 0 || prior.weighed;
  FitObjective objective(records, prior, settings);
  Fitter fitter(objective, settings);
  const auto chi_of = [&](const Found& found) { return ChiOf(Split(objective, found.residuals)); };
  Found best = FromStarts(records, prior, settings, objective, fitter, outcome.starts);
  outcome.interrupted = fitter.Interrupted();
  outcome.first_deviations = objective.deviations();
  if (best.u.size() == 0) return outcome;
  double noise = 1;
  const FitPrior any_ground = WithAnyGround(prior);
  std::optional<FitObjective> of_effective;
  FitObjective* last = &objective;  // the one that the outcome is the minimum of
  if (chi_of(best) > settings.chi_max && !outcome.interrupted) {
    of_effective.emplace(records, any_ground, settings);
    Fitter effective_fitter(*of_effective, settings);
    const Effective effective =
        FitEffective(*of_effective, records.front().tick_s, effective_fitter, best);
    // That may be nearer to a robot that explains the records than any other start was.
    outcome.interrupted = effective_fitter.Interrupted();
    if (outcome.interrupted) return outcome;
    const Found found = fitter.From(effective.found.u);
    ++outcome.starts;
    outcome.interrupted = fitter.Interrupted();
    if (outcome.interrupted) return outcome;
    const bool explains = chi_of(found) <= settings.chi_max;
    best = explains ? found : effective.found;
    if (!explains) {
      noise = effective.noise;
      last = &*of_effective;
    }
  }
  const MatrixXd J = RefineTwice(*last, fitter, noise, settings, last != &objective, best);
  outcome.interrupted = fitter.Interrupted();
  if (outcome.interrupted) return outcome;
  outcome.records = Split(*last, best.residuals);
  outcome.chi = ChiOf(outcome.records);
  outcome.effective = outcome.chi > settings.chi_max;
  const About about = OfRobot(LookAbout(*last, J, noise, best), ToIndex(prior.known.size()));
  outcome.information = InformationOf(*last, about);
  const MatrixXd of_variables = Sandwich(about);
  const std::size_t n = prior.known.size();
  const std::vector<double>& deviations = objective.deviations();
  outcome.posterior.quantities = prior.known.quantities;
  outcome.posterior.mean = objective.CoordinatesOf(best.u);
  for (std::size_t i = 0; i < n; ++i) {  // but for rounding at a bound
    outcome.posterior.mean[i] = std::max(
        outcome.posterior.mean[i], FactsOf(prior.known.quantities[i].kind).least_coordinate());
  }
  outcome.posterior.covariance.resize(n * n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < n; ++k) {
      outcome.posterior.covariance[i * n + k] =
          of_variables(ToIndex(i), ToIndex(k)) * deviations[i] * deviations[k] *
          WideningOf(prior.known.quantities[i].kind) * WideningOf(prior.known.quantities[k].kind);
    }
  }
  outcome.evaluations = objective.evaluations() + (of_effective ? of_effective->evaluations() : 0);
  if (!prior.earlier.empty()) {
    outcome.moved = LostOf(prior.earlier, outcome.posterior.mean);
    outcome.moved_max = ChiSquaredLimit(n);
    outcome.effective = outcome.effective || outcome.strays();
  }
  NoteCauses(records, settings.chi_max, outcome);
  return outcome;
}

std::vector<FitResiduals> ResidualsOf(std::span<const RecordedMotion> records,
                                      const RobotPosterior& robot, int per_tick) {
  const FitSettings settings;
  const FitPrior prior{robot, {}, {}};
  FitObjective objective(records, prior, settings);
  VectorXd u = VectorXd::Zero(objective.size());
  VectorXd residuals = objective.Residuals({u}, per_tick).col(0);
  const Eigen::Index starts = objective.size() - ToIndex(robot.size());
  for (int step = 0; step < 2; ++step) {
    const MatrixXd J = objective.StartDerivatives(u, per_tick);
    MatrixXd A = J.transpose() * J;
    A.diagonal().array() += 1;  // what is known before, in deviations
    VectorXd next = u;
    next.tail(starts) -= A.ldlt().solve(J.transpose() * residuals + u.tail(starts));
    const VectorXd then = objective.Residuals({next}, per_tick).col(0);
    if (!(objective.ValueOf(then, next, 1) < objective.ValueOf(residuals, u, 1))) break;
    u = next;
    residuals = then;
  }
  return Split(objective, residuals);
}

}  // namespace tumbler
