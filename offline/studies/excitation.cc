#include "offline/studies/excitation.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/toml_writer.h"
#include "offline/certify/certificate.h"
#include "offline/certify/second_look.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/normal.h"
#include "offline/scene/robot_posterior.h"
#include "offline/scene/self_clearance.h"
#include "offline/solve/constraints.h"
#include "offline/solve/joint_paths.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solver.h"
#include "offline/studies/recorded_motion.h"
#include "offline/studies/recorded_replay.h"
#include "offline/studies/toml_edit.h"

namespace tumbler {
namespace {

constexpr std::size_t kLanes = Packet::kLanes;
constexpr double kTick_s = 1e-3;
constexpr double kArrival_s = 0.2e-3;  // of a setpoint, on a bus of 1 Mbit/s
/// Control points of a path: enough for waves of 5 Hz in 1.2 s.
constexpr int kPointsPerSecond = 25;
/// A robot stands so long before the motion begins in the primitive, and is watched after it.
constexpr double kStands_s = 0.4, kAfter_s = 0.6;
/// Of the waves of a joint [1/s]. Slower ones move everything together, faster ones do not get far.
constexpr double kSlowest_hz = 0.8, kFastest_hz = 4.5;
/// Amplitudes of a motion that are tried, of the largest that is allowed.
constexpr std::array<double, kLanes> kAmplitudes = {1, 0.75, 0.55, 0.4, 0.3, 0.2, 0.12, 0.07};
/// A robot rests again where it began within this [rad].
constexpr double kBack_rad = 0.05;
/// Motions that are certified, the most telling first, until one holds.
constexpr std::size_t kCertified = 8;

/// The task of an excitation: the given one's robot, start, limits and ground, with an end at the
/// start and no other aim than to rest there.
std::string TextOfTask(const Task& given, double duration_s) {
  constexpr std::array<std::string_view, 11> kKept = {
      "format",  "version",  "robot", "root",   "start",       "limits",
      "contact", "obstacle", "motor", "locked", "self_contact"};
  const Problem& problem = given.problem;
  TomlWriter writer("a task");
  writer.Line("# Made by tumbler identify excite of " +
              std::filesystem::path(given.task_file).filename().string() +
              ": to be told from, and to end where it began.");
  writer.Text("name", "identify_" + problem.name);
  writer.Number("duration_s", duration_s);
  writer.Number("settle_s", 0.5);
  writer.Line(WithOnly(given.task_text, given.task_file, kKept));
  writer.Line("[end.joints_rad]");
  for (const ActuatedJoint& joint : problem.joints) {
    const std::string& name = problem.scene.robot.tree.dofs[Index(joint.dof)].name;
    writer.Number("\"" + name + "\"", joint.start_rad);
  }
  writer.Line("[spline]\ndegree = 5");
  writer.Line(fmt::format("control_points = {}", std::lround(kPointsPerSecond * duration_s)));
  writer.Line("[[cost]]\nterm = \"terminal\"\nof = \"pitch\"\nwhen = \"settled\"\nweight = 10.0");
  writer.Number("target", problem.start_q[2]);
  writer.Line(
      "[[cost]]\nterm = \"terminal\"\nof = \"pitch_rate\"\nwhen = \"settled\"\nweight = 1.0");
  writer.Line("[[cost]]\nterm = \"effort\"\nweight = 1e-4");
  writer.Line("[drives]");
  writer.Number("kp_nm_per_rad", problem.drive_gains().kp_nm_per_rad);
  writer.Number("kd_nm_s_per_rad", problem.drive_gains().kd_nm_s_per_rad);
  writer.Line("[solver]");
  writer.Number("step_s", problem.solver.step_s);
  return writer.Take();
}

/// Two waves for each joint.
struct Shape {
  struct Wave {
    double hz = 0, phase = 0, part = 0;
  };
  std::vector<std::array<Wave, 2>> joints;
};

Shape DrawShape(std::size_t joints, std::uint64_t seed, std::uint64_t index) {
  Normal random(seed, index);
  Shape shape;
  shape.joints.resize(joints);
  const auto hz = [&] {
    return kSlowest_hz * portable::Power(kFastest_hz / kSlowest_hz, random.DrawUniform());
  };
  const double together = random.DrawUniform();
  const std::array<double, 2> both = {hz(), hz()};
  for (std::size_t j = 0; j < joints; ++j) {
    for (std::size_t w = 0; w < 2; ++w) {
      Shape::Wave& wave = shape.joints[j][w];
      // In a third of the motions all joints move at the same rates: legs sway.
      wave.hz = together < 1.0 / 3 ? both[w] : hz();
      wave.phase = 2 * std::numbers::pi * random.DrawUniform();
      wave.part = (w == 0 ? 1.0 : 0.6) * (0.3 + 0.7 * random.DrawUniform());
    }
  }
  return shape;
}

/// What a robot did in a motion.
struct Played {
  double pitch_rad = 0;  ///< Largest turn of the root.
  double end_rad = 0;    ///< Its turn at the end.
  double speed = 0;      ///< Largest of its velocities there.
  double torque_share = 0;
  double depth = 0;
  double torque_nm = 0;
};

class Maker {
 public:
  Maker(const std::string& task_file, const ExcitationSettings& settings) : settings_(settings) {
    const Task given = LoadTask(task_file);
    CheckGiven(given, task_file);
    task_ = ParseTask(TextOfTask(given, settings.duration_s + kStands_s), given.task_file,
                      given.robot_text, given.robot_file);
    drive_.kp = problem().drive_gains().kp_nm_per_rad;
    drive_.kd = problem().drive_gains().kd_nm_s_per_rad;
    drive_.delay_s = kArrival_s;
    lanes_ = LanesOf(RobotVariation{});
    rows_ = DerivativeLimitRows(problem());
  }

  Excitation Make() {
    Excitation result;
    struct Candidate {
      std::vector<double> x;
      double information;
    };
    std::vector<Candidate> candidates;
    for (int i = 0; i < settings_.candidates && !Interrupted(); ++i) {
      ++result.tried;
      const std::vector<double> x =
          LargestSafe(DrawShape(problem().joints.size(), settings_.seed, Number(i)));
      if (x.empty()) continue;
      ++result.safe;
      candidates.push_back({x, InformationOf(x)});
    }
    std::ranges::stable_sort(candidates, [](const Candidate& a, const Candidate& b) {
      return a.information > b.information;
    });
    if (candidates.empty()) {
      result.cause = fmt::format(
          "none of {} motions is safe for the model, which has to rest where it began; give more "
          "--duration-s, or a task that begins in another pose",
          result.tried);
      return result;
    }
    for (std::size_t c = 0; c < std::min(kCertified, candidates.size()); ++c) {
      if (Interrupted()) break;
      result.information = candidates[c].information;
      if (Certified(candidates[c].x, result)) return result;
      Say(fmt::format("motion {} of {}: {}", c + 1, candidates.size(), result.cause));
    }
    return result;
  }

 private:
  [[nodiscard]] const Problem& problem() const { return task_.problem; }
  [[nodiscard]] bool Interrupted() const {
    return settings_.interrupt != nullptr && *settings_.interrupt;
  }
  void Say(const std::string& text) const {
    if (settings_.say) settings_.say(text);
  }
  static std::uint64_t Number(int i) { return static_cast<std::uint64_t>(i); }

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
  [[nodiscard]] std::vector<double> ParametersOf(const Shape& shape, double amplitude_rad) const {
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
        for (const Shape::Wave& wave : shape.joints[j]) {
          sum += wave.part * portable::Sin(2 * std::numbers::pi * wave.hz * place_s + wave.phase);
        }
        x.push_back(joint.start_rad + amplitude_rad * window * sum / 1.6);
      }
    }
    return x;
  }

  [[nodiscard]] bool KeepsPathLimits(const std::vector<double>& x) const {
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

  /// Setpoints of a motion, from the hold before it to the end.
  using Setpoints = std::vector<std::vector<LaneSetpoint<double>>>;
  [[nodiscard]] Setpoints SetpointsOf(std::span<const JointMotion<double>::Spline> positions,
                                      std::span<const JointMotion<double>::Spline> torques) const {
    Setpoints setpoints;
    const double duration_s = problem().duration_s;
    const auto ticks = static_cast<int>(std::ceil((duration_s + kAfter_s) / kTick_s - 1e-9));
    for (int k = 0; k < ticks; ++k) {
      const double t = k * kTick_s;
      auto& tick = setpoints.emplace_back();
      const double at_s = std::min(t, duration_s);
      for (std::size_t j = 0; j < positions.size(); ++j) {
        const auto at = positions[j].Evaluate(at_s);
        const bool moves = t < duration_s;
        const double torque = torques.empty() ? 0 : torques[j].Evaluate(at_s).value;
        tick.push_back({at.value, moves ? at.first : 0, torque});
      }
    }
    return setpoints;
  }

  /// Plays robots, each with its own setpoints.
  [[nodiscard]] std::array<Played, kLanes> Play(
      const std::array<LaneRobot<double>, kLanes>& robots,
      const std::array<const Setpoints*, kLanes>& setpoints, int finer = 1) const {
    const std::size_t joints = problem().joints.size();
    LaneState<double> start{};
    std::copy(problem().start_q.begin(), problem().start_q.end(), start.q.begin());
    std::array<LaneState<double>, kLanes> states;
    states.fill(start);
    LaneState<Packet> state = PackLanes<LaneState>(states);
    const LaneRobot<Packet> packed = PackLanes<LaneRobot>(robots);
    HeldSetpoints<Packet> held{};
    LaneWatch<Packet> watch;
    std::vector<LaneSetpoint<Packet>> told(joints);
    const LaneSteps steps{kTick_s, 4 * finer};
    std::array<Played, kLanes> played{};
    for (std::size_t k = 0; k < setpoints[0]->size(); ++k) {
      for (std::size_t j = 0; j < joints; ++j) {
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
          const LaneSetpoint<double>& s = (*setpoints[lane])[k][j];
          told[j].position.set_lane(lane, s.position);
          told[j].velocity.set_lane(lane, s.velocity);
          told[j].third.set_lane(lane, s.third);
        }
        if (k == 0) held[j] = told[j];
      }
      // Until then a robot drops onto its own ground.
      if (k == static_cast<std::size_t>(std::lround(kStands_s / kTick_s))) watch = {};
      packets().drive(lanes_.model, packed, steps, told, held, state, watch);
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const double turn = std::abs(state.q[2].lane(lane) - problem().start_q[2]);
        Played& of = played[lane];
        of.pitch_rad = turn < of.pitch_rad ? of.pitch_rad : turn;  // keeps what is not a number
        of.end_rad = turn;
        of.speed = 0;
        for (std::size_t d = 0; d < joints + 3; ++d)
          of.speed = std::max(of.speed, std::abs(state.v[d].lane(lane)));
      }
    }
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      Played& of = played[lane];
      of.depth = watch.depth.lane(lane);
      for (std::size_t j = 0; j < joints; ++j) {
        const double torque = watch.torque[j].lane(lane);
        of.torque_nm = std::max(of.torque_nm, torque);
        of.torque_share =
            std::max(of.torque_share, torque / problem().joints[j].limits.torque_max_nm);
      }
    }
    return played;
  }

  static const LaneKernel<Packet>& packets() { return *PacketKernels().front(); }

  /// Whether a robot stays where it was, and comes to rest.
  [[nodiscard]] bool Stays(const Played& played) const {
    constexpr double kRest = 0.05;
    return played.pitch_rad < settings_.pitch_max_rad && played.end_rad < kBack_rad &&
           played.speed < kRest && played.depth < 0.9;
  }

  /// Parameters of the shape with the largest amplitude that is safe for the model; empty: none is.
  [[nodiscard]] std::vector<double> LargestSafe(const Shape& shape) const {
    std::array<std::vector<double>, kLanes> x;
    std::array<Setpoints, kLanes> setpoints;
    std::array<LaneRobot<double>, kLanes> robots;
    robots.fill(lanes_.robot);
    std::array<const Setpoints*, kLanes> told{};
    bool any = false;
    for (std::size_t a = 0; a < kLanes; ++a) {
      x[a] = ParametersOf(shape, settings_.joint_max_rad * kAmplitudes[a]);
      if (!KeepsPathLimits(x[a])) x[a].clear();
      any = any || !x[a].empty();
      setpoints[a] = SetpointsOf(SplinesOf(x[a].empty() ? ParametersOf(shape, 0) : x[a]), {});
      told[a] = &setpoints[a];
    }
    if (!any) return {};
    const std::array<Played, kLanes> played = Play(robots, told);
    for (std::size_t a = 0; a < kLanes; ++a) {
      if (x[a].empty() || !Stays(played[a]) || played[a].torque_share > settings_.torque_share)
        continue;
      return x[a];
    }
    return {};
  }

  /// log det of the information about all quantities in a record of this motion, by rough steps.
  [[nodiscard]] double InformationOf(const std::vector<double>& x) const {
    RecordedMotion record;
    record.scene = problem().scene;
    record.start.root_x_m = problem().start_q[0];
    record.start.root_z_m = problem().start_q[1];
    record.start.root_pitch_rad = problem().start_q[2];
    record.tick_s = kTick_s;
    for (const ActuatedJoint& joint : problem().joints) {
      RecordedDrive drive;
      drive.kp = drive_.kp;
      drive.kd = drive_.kd;
      drive.torque_max_nm = joint.limits.torque_max_nm;
      drive.arrival_s = kArrival_s;
      drive.noise_rad = 1.6e-4;
      record.joints.push_back(drive);
    }
    for (const auto& tick : SetpointsOf(SplinesOf(x), {})) {
      auto& of = record.ticks.emplace_back();
      for (const LaneSetpoint<double>& setpoint : tick)
        of.push_back({setpoint, setpoint.position, kArrival_s});
    }
    record.begins = static_cast<std::size_t>(std::lround(kStands_s / kTick_s));
    const RobotPosterior prior = PriorOf(record.scene);
    const RecordedReplay replay(record, prior.quantities);
    constexpr double kDifference = 0.02;
    std::vector<std::vector<double>> robots = {prior.mean};
    for (std::size_t i = 0; i < prior.size(); ++i) {
      robots.push_back(prior.mean);
      robots.back()[i] += kDifference * prior.DeviationOf(i);
    }
    const auto residuals = replay.Play(robots, 4);
    const auto n = static_cast<Eigen::Index>(prior.size());
    Eigen::MatrixXd J(static_cast<Eigen::Index>(replay.count()), n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::vector<double>& of = residuals.of_robot[static_cast<std::size_t>(i) + 1];
      for (std::size_t row = 0; row < of.size(); ++row)
        J(static_cast<Eigen::Index>(row), i) = (of[row] - residuals.of_robot[0][row]) / kDifference;
    }
    Eigen::MatrixXd information = J.transpose() * J;
    information.diagonal().array() += 1;
    const Eigen::VectorXd pivots = information.ldlt().vectorD();
    double log_det = 0;
    for (Eigen::Index i = 0; i < n; ++i) log_det += portable::Log(std::max(pivots[i], 1e-300));
    return log_det;
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
    const Setpoints setpoints = SetpointsOf(positions, torques);
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
      for (const Played& played : Play(robots, told, finer)) {
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
};

}  // namespace

Excitation MakeExcitation(const std::string& task_file, const ExcitationSettings& settings) {
  return Maker(task_file, settings).Make();
}

}  // namespace tumbler
