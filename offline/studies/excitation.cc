#include "offline/studies/excitation.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "offline/certify/second_look.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/robot_posterior.h"
#include "offline/scene/self_clearance.h"
#include "offline/solve/cma_es.h"
#include "offline/solve/constraints.h"
#include "offline/solve/joint_paths.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solver.h"
#include "offline/studies/excitation_player.h"
#include "offline/studies/excitation_shape.h"
#include "offline/studies/fit_objective.h"
#include "offline/studies/recorded_motion.h"
#include "offline/studies/recorded_replay.h"
#include "offline/studies/robot_fit.h"
#include "offline/twin/simulated_robot.h"

namespace tumbler {
namespace {

constexpr std::size_t kLanes = ExcitationPlayer::kLanes;
constexpr double kStands_s = kExcitationStands_s, kAfter_s = kExcitationAfter_s,
                 kTick_s = kExcitationTick_s;
constexpr double kArrival_s = 0.2e-3;  // of a setpoint, on a bus of 1 Mbit/s
/// What a fit reads of the watch after a motion (ReadingSettings::settle_s).
constexpr double kRead_s = 0.4;
/// Amplitudes of a motion that are tried, the largest first: each is so much of the one before, and
/// then each of those between the largest that is safe and the next larger one.
constexpr double kLargest = 1.5, kSmaller = 0.65;
/// A robot rests again where it began within this [rad].
constexpr double kBack_rad = 0.05;
/// Motions that are certified, the most telling first, until one holds.
constexpr std::size_t kCertified = 8;
/// Of the search for a motion that tells more: candidates of a generation, and how far from the
/// drawn motion the first ones are, in units of MotionGenes.
constexpr int kPopulation = 12;
constexpr double kFirstSteps = 0.08;
/// Of a motion that is not safe, and of one that some robots do not bear. Lower is better.
constexpr double kUnsafe = 1e9, kFalls = 1e6;
/// Standard deviation of a reading of common drives, by two roundings to 14 and 16 bits [rad].
constexpr double kReading_rad = 1.6e-4;
/// Dry friction of the robot that motions are ranked for.
constexpr double kDry_nm = 0.02;

/// The standard deviation to which a quantity is wanted; 0: to none.
double WantedDeviation(RobotQuantity::Kind kind) {
  switch (kind) {
    case RobotQuantity::Kind::kMass:
      return 0.022;
    case RobotQuantity::Kind::kFriction:
      return 0.0075;
    case RobotQuantity::Kind::kStiffness:
    case RobotQuantity::Kind::kDamping:
      return 0.015;
    default:
      return 0;
  }
}

class Maker {
 public:
  Maker(const std::string& task_file, const ExcitationSettings& settings) : settings_(settings) {
    const Task given = LoadTask(task_file);
    CheckGiven(given, task_file);
    task_ = ParseTask(TextOfExcitation(given, settings.duration_s + kStands_s), given.task_file,
                      given.robot_text, given.robot_file);
    drive_.kp = problem().drive_gains().kp_nm_per_rad;
    drive_.kd = problem().drive_gains().kd_nm_s_per_rad;
    drive_.delay_s = kArrival_s;
    lanes_ = LanesOf(RobotVariation{});
    rows_ = DerivativeLimitRows(problem());
    TakeEarlier();
  }

  Excitation Make() {
    Excitation result;
    Draw(result);
    if (found_.empty()) {
      result.cause = fmt::format(
          "none of {} motions is safe for the model, which has to rest where it began; give more "
          "--duration-s, or a task that begins in another pose",
          result.tried);
      return result;
    }
    Improve(result);
    for (std::size_t c = 0; c < std::min(kCertified, found_.size()); ++c) {
      if (Interrupted()) break;
      if (Certified(found_[c].motion.x, result)) {
        TellWhatIsKnown(found_[c].motion, result);
        return result;
      }
      Say(fmt::format("motion {} of {}: {}", c + 1, found_.size(), result.cause));
    }
    return result;
  }

 private:
  [[nodiscard]] const Problem& problem() const { return task_.problem; }
  [[nodiscard]] ExcitationPlayer player() const { return {problem(), lanes_}; }
  [[nodiscard]] bool Interrupted() const {
    return settings_.interrupt != nullptr && *settings_.interrupt;
  }
  void Say(const std::string& text) const {
    if (settings_.say) settings_.say(text);
  }
  static std::uint64_t Number(int i) { return static_cast<std::uint64_t>(i); }

  using Setpoints = ExcitationSetpoints;
  struct Motion {
    std::vector<double> x;
    Setpoints setpoints;
  };
  struct Candidate {
    MotionGenes genes;
    Motion motion;
    double value = kUnsafe;
  };

  [[nodiscard]] Candidate Consider(const MotionGenes& genes, Excitation& result) const {
    Candidate candidate{genes, LargestSafe(ShapeOf(genes, problem().joints.size()))};
    ++result.tried;
    if (candidate.motion.x.empty()) return candidate;
    ++result.safe;
    candidate.value = ValueOf(candidate.motion.setpoints);
    return candidate;
  }

  void Keep(Candidate candidate) {
    if (candidate.value >= kFalls) return;
    const auto place = std::ranges::upper_bound(found_, candidate.value, {}, &Candidate::value);
    found_.insert(place, std::move(candidate));
    constexpr std::size_t kKept = 32;
    if (found_.size() > kKept) found_.pop_back();
  }

  void Draw(Excitation& result) {
    for (int i = 0; i < settings_.candidates && !Interrupted(); ++i)
      Keep(Consider(DrawGenes(problem().joints.size(), settings_.seed, Number(i)), result));
  }

  /// Searches about the best motion that was drawn. What is better than all before it has to be
  /// borne by the robots that differ, too, so that the search does not end where they fall.
  void Improve(Excitation& result) {
    CmaEs search(found_.front().genes, kFirstSteps, kPopulation, settings_.seed);
    double best = kFalls;
    for (int g = 0; g < settings_.generations && !Interrupted(); ++g) {
      std::vector<double> values;
      for (const MotionGenes& genes : search.Ask()) {
        Candidate candidate = Consider(genes, result);
        Excitation of_robots;
        if (candidate.value < best && !RobotsStay(candidate.motion.setpoints, of_robots))
          candidate.value = kFalls;
        best = std::min(best, candidate.value);
        values.push_back(candidate.value);
        Keep(std::move(candidate));
      }
      search.Tell(values);
    }
    if (settings_.generations > 0)
      Say(fmt::format("{} motions in {} generations", result.tried, settings_.generations));
  }

  static void CheckGiven(const Task& given, const std::string& file) {
    const Problem& problem = given.problem;
    const auto refuse = [&file](const std::string& what) {
      throw std::invalid_argument(fmt::format("{}: {}", file, what));
    };
    if (problem.scene.robot.root_dofs != 3 || problem.scene.robot.hinged())
      refuse("its robot's root is not free in the plane; only such robots can be identified");
    if (problem.scene.obstacles.empty()) refuse("it has no ground on which a robot could lie");
    for (const double rate : problem.start_root_rates)
      if (rate != 0) refuse("its motion begins with a moving robot; give one that begins at rest");
    for (const ActuatedJoint& joint : problem.joints) {
      if (joint.start_rad_s != 0)
        refuse("its motion begins with a moving joint; give one that begins at rest");
    }
  }

  [[nodiscard]] LaneScene LanesOf(const RobotVariation& variation) const {
    const bool model = variation.links.empty();
    LaneScene lanes =
        MakeLaneScene(model ? problem().scene : Varied(problem().scene, variation), drive_);
    for (std::size_t j = 0; j < problem().joints.size(); ++j)
      lanes.robot.joints[j].torque_max = problem().joints[j].limits.torque_max_nm;
    return lanes;
  }

  /// Parameters of a shape with this amplitude: its values at the places of the control points.
  [[nodiscard]] std::vector<double> ParametersOf(const WaveShape& shape,
                                                 double amplitude_rad) const {
    std::vector<double> x;
    for (std::size_t j = 0; j < problem().joints.size(); ++j) {
      const ActuatedJoint& joint = problem().joints[j];
      const std::vector<double> knots =
          PathKnots(problem(), joint.control_points, problem().duration_s);
      for (int i = 3; i < 3 + joint.free_points(); ++i) {
        double place_s = 0;  // Greville's
        for (int k = 1; k <= problem().degree; ++k) place_s += knots[Index(i + k)];
        place_s /= problem().degree;
        const double s = (place_s - kStands_s) / (problem().duration_s - kStands_s);
        const double window = s <= 0 ? 0 : std::min(1.0, 8 * s * (1 - s));
        double sum = 0;
        for (const WaveShape::Wave& wave : shape.joints[j]) {
          sum += wave.part * portable::Sin(2 * std::numbers::pi * wave.hz * place_s + wave.phase);
        }
        x.push_back(joint.start_rad + amplitude_rad * window * sum / 1.6);
      }
    }
    return x;
  }

  [[nodiscard]] bool KeepsPathLimits(const std::vector<double>& x) const {
    std::size_t next = 0;
    for (const ActuatedJoint& joint : problem().joints) {
      for (int i = 0; i < joint.free_points(); ++i, ++next) {
        if (std::abs(x[next] - joint.start_rad) > settings_.joint_max_rad) return false;
      }
    }
    for (int i = 0; i < static_cast<int>(x.size()); ++i) {
      const Interval<double> bounds = problem().bounds_of_parameter(i);
      if (x[Index(i)] < bounds.min || x[Index(i)] > bounds.max) return false;
    }
    for (const LinearRow& row : rows_) {
      double sum = row.b;
      for (std::size_t i = 0; i < row.a.size(); ++i) sum += row.a[i] * x[i];
      if (sum > 0) return false;
    }
    const SelfContact& own = problem().scene.self_contact;
    if (own.pairs.empty()) return true;
    SelfDistances distances(problem().scene.robot, own.pairs);
    std::vector<double> q = problem().start_q;
    const auto splines = SplinesOf(x);
    constexpr double kEvery_s = 5 * kTick_s;
    const auto looks = static_cast<int>(std::ceil(problem().duration_s / kEvery_s - 1e-9));
    for (int k = 0; k < looks; ++k) {
      const double t = k * kEvery_s;
      for (std::size_t j = 0; j < splines.size(); ++j)
        q[Index(problem().joints[j].dof)] = splines[j].Evaluate(t).value;
      if (distances.Nearest(q).distance_m < own.clearance_m + 1e-3) return false;
    }
    return true;
  }

  [[nodiscard]] std::vector<JointMotion<double>::Spline> SplinesOf(
      const std::vector<double>& x) const {
    std::vector<JointMotion<double>::Spline> splines;
    for (std::size_t j = 0; j < problem().joints.size(); ++j)
      splines.push_back(PositionSpline(problem(), x, j));
    return splines;
  }

  /// Whether a robot stays where it was, and comes to rest.
  [[nodiscard]] bool Stays(const PlayedExcitation& played) const {
    constexpr double kRest = 0.05;
    return played.pitch_rad < settings_.pitch_max_rad && played.end_rad < kBack_rad &&
           played.speed < kRest && played.depth < 0.9;
  }

  /// The shape with the largest amplitude that is safe for the model; no parameters: none is.
  [[nodiscard]] Motion LargestSafe(const WaveShape& shape) const {
    Motion best;
    double largest = kLargest, part = kSmaller;
    for (int round = 0; round < 2; ++round) {
      std::array<double, kLanes> amplitudes{};
      for (double& amplitude : amplitudes) {
        amplitude = largest;
        largest *= part;
      }
      const auto [motion, amplitude] = LargestSafeOf(shape, amplitudes);
      if (motion.x.empty()) break;
      best = motion;
      part = portable::Power(kSmaller, 1.0 / (kLanes + 1));
      largest = amplitude / kSmaller * part;
    }
    return best;
  }

  [[nodiscard]] std::pair<Motion, double> LargestSafeOf(
      const WaveShape& shape, const std::array<double, kLanes>& amplitudes) const {
    std::array<std::vector<double>, kLanes> x;
    std::array<Setpoints, kLanes> setpoints;
    std::array<LaneRobot<double>, kLanes> robots;
    robots.fill(lanes_.robot);
    std::array<const Setpoints*, kLanes> told{};
    bool any = false;
    for (std::size_t a = 0; a < kLanes; ++a) {
      x[a] = ParametersOf(shape, settings_.joint_max_rad * amplitudes[a]);
      if (!KeepsPathLimits(x[a])) x[a].clear();
      any = any || !x[a].empty();
      setpoints[a] = ExcitationSetpointsOf(
          problem().duration_s, SplinesOf(x[a].empty() ? ParametersOf(shape, 0) : x[a]), {});
      told[a] = &setpoints[a];
    }
    if (!any) return {};
    player().AddFeedForward(setpoints);
    const std::array<PlayedExcitation, kLanes> played = player().Play(robots, told);
    for (std::size_t a = 0; a < kLanes; ++a) {
      if (x[a].empty() || !Stays(played[a]) || played[a].torque_share > settings_.torque_share)
        continue;
      return {{x[a], setpoints[a]}, amplitudes[a]};
    }
    return {};
  }

  /// A record of a robot that is told this, but for its readings.
  [[nodiscard]] RecordedMotion Imagined(const Setpoints& setpoints,
                                        const PrimitivePose& start) const {
    RecordedMotion record;
    record.scene = problem().scene;
    record.start = start;
    record.tick_s = kTick_s;
    for (const ActuatedJoint& joint : problem().joints) {
      RecordedDrive drive;
      drive.kp = drive_.kp;
      drive.kd = drive_.kd;
      drive.torque_max_nm = joint.limits.torque_max_nm;
      drive.arrival_s = kArrival_s;
      drive.noise_rad = kReading_rad;
      record.joints.push_back(drive);
    }
    for (const auto& tick : setpoints) {
      auto& of = record.ticks.emplace_back();
      for (const LaneSetpoint<double>& setpoint : tick)
        of.push_back({setpoint, setpoint.position, kArrival_s});
    }
    const auto unread = static_cast<std::size_t>(std::lround((kAfter_s - kRead_s) / kTick_s));
    record.ticks.resize(record.ticks.size() - std::min(unread, record.ticks.size()));
    record.begins = static_cast<std::size_t>(std::lround(kStands_s / kTick_s));
    return record;
  }

  /// What a record tells of the quantities, in units of the prior's deviations, of the model with
  /// common friction: as a fit would find, wherever the robot is set down.
  [[nodiscard]] Eigen::MatrixXd ToldBy(const RecordedMotion& record) const {
    const FitPrior prior{prior_, {}, {}};
    const FitSettings settings;
    FitObjective objective(std::span(&record, 1), prior, settings);
    Eigen::VectorXd robot = Eigen::VectorXd::Zero(objective.size());
    for (std::size_t i = 0; i < prior_.size(); ++i) {
      if (prior_.quantities[i].kind == RobotQuantity::Kind::kDry)
        robot[ToIndex(i)] = (kDry_nm - prior_.mean[i]) / prior_.DeviationOf(i);
    }
    const Eigen::MatrixXd J = objective.Derivatives(robot, settings.per_tick);
    const Eigen::Index n = ToIndex(prior_.size()), starts = objective.size() - n;
    Eigen::MatrixXd H = J.transpose() * J;
    H.bottomRightCorner(starts, starts).diagonal().array() += 1;
    return H.topLeftCorner(n, n) -
           H.topRightCorner(n, starts) *
               H.bottomRightCorner(starts, starts).ldlt().solve(H.bottomLeftCorner(starts, n));
  }

  /// The same by rough steps and differences to one side, to rank motions by. Feet that chatter
  /// make it larger.
  [[nodiscard]] Eigen::MatrixXd RoughlyToldBy(const RecordedMotion& record) const {
    const RecordedReplay replay(record, prior_.quantities);
    constexpr double kDifference = 0.02;
    constexpr int kSteps = 4;
    std::vector<double> robot = prior_.mean;
    for (std::size_t i = 0; i < prior_.size(); ++i)
      if (prior_.quantities[i].kind == RobotQuantity::Kind::kDry) robot[i] = kDry_nm;
    std::vector<std::vector<double>> robots = {robot};
    for (std::size_t i = 0; i < prior_.size(); ++i) {
      robots.push_back(robot);
      robots.back()[i] += kDifference * prior_.DeviationOf(i);
    }
    const auto residuals = replay.Play(robots, kSteps);
    const auto n = static_cast<Eigen::Index>(prior_.size());
    Eigen::MatrixXd J(static_cast<Eigen::Index>(replay.count()), n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::vector<double>& of = residuals.of_robot[static_cast<std::size_t>(i) + 1];
      for (std::size_t row = 0; row < of.size(); ++row)
        J(static_cast<Eigen::Index>(row), i) = (of[row] - residuals.of_robot[0][row]) / kDifference;
    }
    return J.transpose() * J;
  }

  /// The record that a robot would make of a motion.
  [[nodiscard]] RecordedMotion Imagined(const Setpoints& setpoints) const {
    PrimitivePose start;
    start.root_x_m = problem().start_q[0];
    start.root_z_m = problem().start_q[1];
    start.root_pitch_rad = problem().start_q[2];
    return Imagined(setpoints, start);
  }

  /// Of all quantities after a record and those before it, as far as a quadratic function tells.
  [[nodiscard]] std::vector<double> DeviationsWith(const Eigen::MatrixXd& told) const {
    const Eigen::MatrixXd information = before_ + told;
    if (!information.allFinite()) return {};
    const Eigen::Index n = information.rows();
    const Eigen::MatrixXd covariance = information.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
    std::vector<double> deviations;
    for (Eigen::Index i = 0; i < n; ++i) {
      deviations.push_back(std::sqrt(std::max(0.0, covariance(i, i))) *
                           prior_.DeviationOf(static_cast<std::size_t>(i)));
    }
    return deviations;
  }

  /// The A-criterion in units of the wanted deviations: what is known worst counts most.
  /// @param deviations  DeviationsWith.
  [[nodiscard]] double CriterionOf(const std::vector<double>& deviations) const {
    if (deviations.empty()) return kUnsafe;
    double squares = 0;
    for (std::size_t i = 0; i < deviations.size(); ++i) {
      const double wanted = WantedDeviation(prior_.quantities[i].kind);
      if (wanted > 0) squares += deviations[i] * deviations[i] / (wanted * wanted);
    }
    return squares;
  }
  [[nodiscard]] double ValueOf(const Setpoints& setpoints) const {
    return CriterionOf(DeviationsWith(RoughlyToldBy(Imagined(setpoints))));
  }

  void TellWhatIsKnown(const Motion& motion, Excitation& result) const {
    result.drives = problem().drive_gains();
    result.quantities = prior_.quantities;
    result.deviations = DeviationsWith(ToldBy(Imagined(motion.setpoints)));
    result.criterion = CriterionOf(result.deviations);
  }

  /// What is known before the motion: the prior, and what records of earlier motions tell.
  void TakeEarlier() {
    RecordedMotion own;
    own.scene = problem().scene;
    prior_ = PriorOfRecords(std::span(&own, 1), false).known;
    const auto n = static_cast<Eigen::Index>(prior_.size());
    before_ = Eigen::MatrixXd::Identity(n, n);
    for (const std::string& path : settings_.after) {
      const SimulatedMotion motion(LoadMotion(path));
      const PrimitiveFile& first = motion.file().PrimitiveOf(motion.file().graph.start);
      if (first.provenance.robot_urdf != task_.robot_text) {
        throw FileError(
            path, 0, "robot",
            fmt::format("is another than that of {}; give motions of one URDF", task_.task_file));
      }
      if (!(motion.scene().contact == problem().scene.contact)) {
        throw FileError(path, 0, "contact",
                        fmt::format("is another ground than that of {}; give motions of tasks with "
                                    "one [contact]",
                                    task_.task_file));
      }
      std::vector<JointMotion<double>::Spline> positions, torques;
      for (const JointMotion<double>& joint : first.primitive.motions()) {
        positions.push_back(joint.position);
        torques.push_back(joint.torque);
      }
      before_ +=
          ToldBy(Imagined(ExcitationSetpointsOf(first.primitive.duration_s, positions, torques),
                          StartOf(motion.file())));
    }
  }

  /// Makes the primitive, and lets robots play it. @returns whether it holds.
  bool Certified(const std::vector<double>& x, Excitation& result) {
    SolveOptions silent;
    Rollout rollout(problem(), problem().solver.step_s / 4);
    Solution solution = SolveFrom(problem(), x, 1, rollout, silent, nullptr);
    solution.x = x;
    solution.end = SolveEnd::kTaken;
    solution.finished = true;
    if (!solution.feasible()) {
      result.cause = "exceeds a limit: " + solution.worst_constraint;
      return false;
    }
    FineLook fine = LookFinely(problem(), x);
    if (!fine.look.acceptable()) {
      result.cause = fine.look.Objections();
      return false;
    }
    SolveOutcome outcome;
    outcome.solutions = {solution};
    outcome.evaluations = result.tried;
    PrimitiveFile file = MakePrimitiveFile(task_, outcome, solution, fine.summary,
                                           DifferentiateBeside(problem(), x));
    file.purpose = fine.look.purpose;
    if (file.certificate.constraint_violation > kNoViolation) {
      result.cause = "the certificate finds a limit exceeded";
      return false;
    }
    std::vector<JointMotion<double>::Spline> positions, torques;
    for (const JointMotion<double>& joint : file.primitive.motions()) {
      positions.push_back(joint.position);
      torques.push_back(joint.torque);
    }
    const Setpoints setpoints = ExcitationSetpointsOf(problem().duration_s, positions, torques);
    if (!RobotsStay(setpoints, result)) return false;
    result.joint_rad.clear();
    for (std::size_t j = 0; j < positions.size(); ++j) {
      double most = 0;
      for (const auto& tick : setpoints)
        most = std::max(most, std::abs(tick[j].position - problem().joints[j].start_rad));
      result.joint_rad.push_back(most);
    }
    result.file = std::move(file);
    result.cause.clear();
    return true;
  }

  bool RobotsStay(const Setpoints& setpoints, Excitation& result) const {
    const RobotPosterior prior = PriorOf(problem().scene);
    std::array<const Setpoints*, kLanes> told;
    told.fill(&setpoints);
    result.torque_nm = result.pitch_rad = 0;
    result.robots = 0;
    for (int first = 0; first < settings_.robots; first += static_cast<int>(kLanes)) {
      std::array<LaneRobot<double>, kLanes> robots;
      int finer = 1;
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        constexpr double kTwice = 2;
        const std::vector<double> z = prior.Draw(kTwice, settings_.seed, Number(first) + lane);
        const RobotVariation variation = VariationOf(problem().scene, prior.quantities, z);
        finer = std::max(finer, FinerStepsFor(variation.stiffness, variation.damping));
        robots[lane] = LanesOf(variation).robot;
        for (std::size_t i = 0; i < z.size(); ++i) {
          if (prior.quantities[i].kind != RobotQuantity::Kind::kZero) continue;
          for (std::size_t j = 0; j < problem().joints.size(); ++j) {
            const auto& dof = problem().scene.robot.tree.dofs[Index(problem().joints[j].dof)];
            if (dof.name == prior.quantities[i].of) robots[lane].joints[j].zero_error = z[i];
          }
        }
      }
      for (const PlayedExcitation& played : player().Play(robots, told, finer)) {
        ++result.robots;
        result.torque_nm = std::max(result.torque_nm, played.torque_nm);
        result.pitch_rad = std::max(result.pitch_rad, played.pitch_rad);
        const bool stays =
            played.pitch_rad < settings_.pitch_max_rad && played.end_rad < 2 * kBack_rad;
        if (stays) continue;
        result.cause = fmt::format(
            "robot {} of those that differ turns by {:.3g} rad, {:.3g} at the end, with {:.3g} N m",
            result.robots, played.pitch_rad, played.end_rad, played.torque_nm);
        return false;
      }
    }
    return true;
  }

  const ExcitationSettings& settings_;
  Task task_;
  LaneDrive drive_;
  LaneScene lanes_;
  std::vector<LinearRow> rows_;
  RobotPosterior prior_;
  Eigen::MatrixXd before_;        ///< What is known before, in units of the prior's deviations.
  std::vector<Candidate> found_;  ///< Safe ones, the best first.
};

}  // namespace

Excitation MakeExcitation(const std::string& task_file, const ExcitationSettings& settings) {
  return Maker(task_file, settings).Make();
}

}  // namespace tumbler
